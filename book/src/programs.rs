//! The Rust programs of the lessons, each a whole program with a `main` of its own, in one binary.

use semismooth_book::Outcome;

/// Each file becomes a module, in which its `main` is an ordinary function.
macro_rules! programs {
    ($($module:ident = $name:literal),* $(,)?) => {
        $(mod $module {
            include!(concat!("../lessons/", $name, ".rs"));

            pub(super) fn run() -> semismooth_book::Outcome<()> {
                main()
            }
        })*

        /// LESSON/PROGRAM and the function that runs it.
        pub(crate) const PROGRAMS: &[(&str, fn() -> Outcome<()>)] = &[$(($name, $module::run)),*];
    };
}

programs! {
    kinks = "01-kinks/program",
    kinks_solutions = "01-kinks/solutions",
    newton = "02-newton/program",
    newton_solutions = "02-newton/solutions",
    complementarity = "03-complementarity/program",
    complementarity_solutions = "03-complementarity/solutions",
    following = "04-following/program",
    following_solutions = "04-following/solutions",
    transitions = "05-transitions/program",
    transitions_solutions = "05-transitions/solutions",
    all_solutions = "06-all-solutions/program",
    all_solutions_solutions = "06-all-solutions/solutions",
    diagrams = "07-diagrams/program",
    diagrams_solutions = "07-diagrams/solutions",
    certificates = "08-certificates/program",
    certificates_solutions = "08-certificates/solutions",
    friction = "09-friction/program",
    friction_solutions = "09-friction/solutions",
    histories = "10-histories/program",
    histories_solutions = "10-histories/solutions",
    space = "11-space/program",
    space_solutions = "11-space/solutions",
    large = "12-large/program",
    large_solutions = "12-large/solutions",
}

pub(crate) fn run(name: &str) -> Outcome<()> {
    let found = PROGRAMS.iter().find(|(known, _)| *known == name);
    let (_, program) =
        found.ok_or_else(|| format!("there is no program {name}"))?;
    program()
}
