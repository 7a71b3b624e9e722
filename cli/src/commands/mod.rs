//! Commands that read meshes and run files, for use without Rust.

mod contact;
mod error;
mod friction;
mod options;
mod problem;
mod progress;
mod report;
mod run_file;
mod text;

use std::ffi::OsString;
use std::io::Write;
use std::path::PathBuf;

use clap::{Args, CommandFactory, Parser, Subcommand};

pub use self::error::CommandError;
use self::friction::FrictionArgs;
use self::options::OptionsArgs;
use self::report::ReportArgs;
use self::run_file::RunArgs;

/// Piecewise-smooth equations: contact with friction, complementarity problems
#[derive(Debug, Parser)]
#[command(
    name = "semismooth",
    version,
    after_help = "As a solver for AMPL and Pyomo: semismooth FILE.nl [-AMPL] [option=value]…"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// A body in contact with friction: a history of loading, or the curve of solutions
    Contact(RunArgs),
    /// The curve of solutions of equations with kinks, or of a friction problem in a folder
    Follow(RunArgs),
    /// All curves of solutions connected to given starts, or to all solutions at some loads
    Diagram(RunArgs),
    /// All solutions at given parameters
    Solutions(RunArgs),
    Report(ReportArgs),
    Friction(FrictionArgs),
    Options(OptionsArgs),
    Init(InitArgs),
    /// Prints a script of completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Prints the manual page (`semismooth man | man -l -`)
    Man,
}

/// Writes a commented run file as a starting point
#[derive(Debug, Args)]
struct InitArgs {
    /// The command that reads the file
    #[arg(value_parser = TEMPLATES.map(|t| t.0))]
    kind: String,
    /// The file, by default KIND.toml; it must not exist yet
    file: Option<PathBuf>,
}

/// The run files that `init` writes, by command.
const TEMPLATES: [(&str, &str); 4] = [
    ("contact", contact::TEMPLATE),
    ("follow", problem::FOLLOW),
    ("diagram", problem::DIAGRAM),
    ("solutions", problem::SOLUTIONS),
];

/// Whether the arguments begin with a command, and are not those that AMPL passes for a problem of that name.
#[must_use]
pub fn is_command(arguments: &[OsString]) -> bool {
    let first = arguments.first().and_then(|f| f.to_str()).unwrap_or_default();
    let known = first == "help" || names().iter().any(|n| n == first);
    known && arguments.get(1).is_none_or(|second| second != "-AMPL")
}

/// The names of the commands.
#[must_use]
pub fn names() -> Vec<String> {
    let program = Arguments::command();
    let names = program.get_subcommands().map(|c| c.get_name().to_owned());
    names.collect()
}

/// The commands for jobs, with a line on each.
#[must_use]
pub fn jobs() -> Vec<(String, String)> {
    let program = Arguments::command();
    let jobs = ["contact", "follow", "diagram", "solutions", "report"];
    let found = jobs.iter().filter_map(|name| program.find_subcommand(name));
    let about = |c: &clap::Command| c.get_about().map(ToString::to_string).unwrap_or_default();
    found.map(|c| (c.get_name().to_owned(), about(c))).collect()
}

/// Runs a command with its arguments (without the name of the program).
///
/// # Errors
/// A [`CommandError`] if there is no result. Exits the process if arguments are not understood or help is requested.
pub fn run(arguments: impl IntoIterator<Item = OsString>, out: &mut dyn Write) -> Result<(), CommandError> {
    let name = OsString::from("semismooth");
    match Arguments::parse_from(std::iter::once(name).chain(arguments)).command {
        Command::Contact(arguments) => contact::run(&arguments, out),
        Command::Follow(arguments) => problem::follow(&arguments, out),
        Command::Diagram(arguments) => problem::diagram(&arguments, out),
        Command::Solutions(arguments) => problem::solutions(&arguments, out),
        Command::Report(arguments) => report::run(&arguments, out),
        Command::Friction(arguments) => friction::run(&arguments, out),
        Command::Options(arguments) => options::run(&arguments, out),
        Command::Init(arguments) => init(&arguments, out),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Arguments::command(), "semismooth", out);
            Ok(())
        }
        Command::Man => Ok(man(out)?),
    }
}

/// One page: the program, then each command with its arguments.
fn man(out: &mut dyn Write) -> std::io::Result<()> {
    let mut program = Arguments::command();
    program.build();
    let page = clap_mangen::Man::new(program.clone());
    page.render_title(out)?;
    page.render_name_section(out)?;
    page.render_synopsis_section(out)?;
    page.render_description_section(out)?;
    for command in program.get_subcommands().filter(|c| c.get_name() != "help") {
        writeln!(out, ".SH \"SEMISMOOTH {}\"", command.get_name().to_uppercase())?;
        let mut section = Vec::new();
        let page = clap_mangen::Man::new(command.clone());
        page.render_description_section(&mut section)?;
        page.render_synopsis_section(&mut section)?;
        page.render_options_section(&mut section)?;
        out.write_all(
            String::from_utf8_lossy(&section)
                .replace(".SH ", ".SS ")
                .as_bytes(),
        )?;
    }
    writeln!(
        out,
        ".SH \"RUN FILES\"\nAs `semismooth init` writes them, with all their keys."
    )?;
    for (command, template) in TEMPLATES {
        writeln!(out, ".SS \"{command}\"\n.nf")?;
        for line in template.lines() {
            // A dot or a quotation mark at the beginning of a line would be a roff request.
            writeln!(out, "\\&{}", line.replace('\\', "\\e").replace('-', "\\-"))?;
        }
        writeln!(out, ".fi")?;
    }
    page.render_extra_section(out)?;
    page.render_version_section(out)
}

fn init(arguments: &InitArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    let kind = &arguments.kind;
    let file = arguments
        .file
        .clone()
        .unwrap_or_else(|| format!("{kind}.toml").into());
    let path = file.display().to_string();
    let text = TEMPLATES.iter().find(|t| t.0 == kind).map_or("", |t| t.1);
    std::fs::File::create_new(&file)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|source| CommandError::File {
            path: path.clone(),
            source,
        })?;
    Ok(writeln!(out, "written: {path}; then: semismooth {kind} {path}")?)
}
