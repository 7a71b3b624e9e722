//! Classification of KKT points: minimum, no minimum, or undecided.

mod common;

use common::header;
use semismooth_cli::nl::read;
use semismooth_cli::options::Options;
use semismooth_cli::solution::Solution;
use semismooth_cli::solve::solve;
use std::ops::ControlFlow;

const SQUARE_X: &str = "o5\nv0\nn2\n";
const SQUARE_Y: &str = "o5\nv1\nn2\n";

/// The text of a problem: an objective of x and y with bounds, and the constraint that x + y lies in the interval `row`.
fn problem(objective: &str, linear: [f64; 2], maximize: bool, bounds: [&str; 2], row: &str) -> String {
    header([2, 1, 1, 0, 2, 2, 0])
        + &format!("C0\nn0\nO0 {}\n{objective}", i32::from(maximize))
        + &format!("r\n{row}\nb\n{}\n{}\nk1\n1\n", bounds[0], bounds[1])
        + &format!("J0 2\n0 1\n1 1\nG0 2\n0 {}\n1 {}\n", linear[0], linear[1])
}

fn solution_of(text: &str) -> Solution {
    let model = read(text.as_bytes()).unwrap();
    solve(&model, &Options::default(), &mut |_| ControlFlow::Continue(())).unwrap()
}

/// The classification of the KKT point that is found from (0, 0).
fn word(objective: &str, linear: [f64; 2], maximize: bool, bounds: [&str; 2], row: &str) -> String {
    let solution = solution_of(&problem(objective, linear, maximize, bounds, row));
    assert_eq!(solution.code, 0, "{}", solution.message);
    assert!(solution.message.contains("A KKT point, objective "));
    let word = solution.message.rsplit("; ").next().unwrap();
    word.trim_end_matches('.').to_owned()
}

#[test]
fn minima_are_told_from_saddles_and_from_what_second_derivatives_leave_open() {
    let free = ["3", "3"];
    let bowl = format!("o0\n{SQUARE_X}{SQUARE_Y}");
    let saddle = format!("o1\n{SQUARE_X}{SQUARE_Y}");
    let flat = "o5\nv0\nn4\n";
    let cup = format!("o0\n{SQUARE_X}o5\nv1\nn4\n");
    let strict = "a strict local minimum, by second derivatives";
    let none = "no local minimum, by second derivatives";
    let open = "whether it is a minimum has not been decided";
    let zero = [0.0, 0.0];
    for (objective, linear, bounds, row, expected) in [
        (&bowl[..], zero, free, "3", strict),
        (&saddle, zero, free, "3", none),
        (&cup, zero, free, "3", open),
        (flat, zero, free, "3", open),
        // The bound of y is strongly active; weakly active; y is fixed.
        (&saddle, [0.0, 1.0], ["3", "2 0"], "3", strict),
        (&saddle, zero, ["3", "2 0"], "3", open),
        (&saddle, zero, ["3", "4 0"], "3", strict),
        // x + y = 0 leaves one direction, along which x² − 2 y² falls and 2 x² − y² rises.
        (
            &format!("o1\n{SQUARE_X}o2\nn2\n{SQUARE_Y}"),
            zero,
            free,
            "4 0",
            none,
        ),
        (
            &format!("o1\no2\nn2\n{SQUARE_X}{SQUARE_Y}"),
            zero,
            free,
            "4 0",
            strict,
        ),
        // x + y ≥ 0 with a multiplier of 1 does so, too, and so does an interval.
        (
            &format!("o1\no2\nn2\n{SQUARE_X}{SQUARE_Y}"),
            [1.0, 1.0],
            free,
            "2 0",
            strict,
        ),
        (
            &format!("o1\no2\nn2\n{SQUARE_X}{SQUARE_Y}"),
            [1.0, 1.0],
            free,
            "0 0 0.1",
            strict,
        ),
        // The same without a multiplier: along y the objective falls.
        (
            &format!("o1\no2\nn2\n{SQUARE_X}{SQUARE_Y}"),
            zero,
            free,
            "2 0",
            open,
        ),
        // A corner.
        ("n0\n", [1.0, 2.0], ["2 0", "2 0"], "3", strict),
    ] {
        let found = word(objective, linear, false, bounds, row);
        assert_eq!(found, expected, "{objective:?} {linear:?} {bounds:?} {row:?}");
    }
    assert_eq!(
        word(&bowl, zero, true, free, "3"),
        "no local maximum, by second derivatives"
    );
    assert_eq!(
        word(&format!("o16\n{bowl}"), zero, true, free, "3"),
        "a strict local maximum, by second derivatives"
    );
}

#[test]
fn kinks_leave_it_open() {
    let found = word(
        &format!("o0\no15\nv0\no0\n{SQUARE_X}{SQUARE_Y}"),
        [-1.0, 0.0],
        false,
        ["2 0", "3"],
        "3",
    );
    assert_eq!(
        found,
        "whether it is a minimum has not been decided.\nAt kinks the derivatives are those of one of the pieces"
    );
}

#[test]
fn active_constraints_that_depend_on_each_other_leave_it_open() {
    // x − y² with x ≥ 0 as a bound and as a row: y makes it fall, but multipliers are not unique.
    let text = problem(
        &format!("o16\n{SQUARE_Y}"),
        [1.0, 0.0],
        false,
        ["2 0", "3"],
        "2 0",
    );
    let text = text
        .replace("J0 2\n0 1\n1 1\n", "J0 1\n0 1\n")
        .replace(" 2 2\n 0 0\n 0 0", " 1 2\n 0 0\n 0 0");
    let solution = solution_of(&text);
    assert!(
        solution.code == 0 && solution.message.contains("has not been decided"),
        "{}",
        solution.message
    );
}

#[test]
fn multipliers_are_changes_of_the_objective_with_the_right_hand_side() {
    // x² + y² with x + y on its bound 2: 2 r²/4 changes by r. Its negative is maximised there, and changes by −r.
    let bowl = format!("o0\n{SQUARE_X}{SQUARE_Y}");
    let hill = format!("o16\n{bowl}");
    for (objective, maximize, row, expected) in [
        (&bowl, false, "2 2", 2.0),
        (&bowl, false, "4 2", 2.0),
        (&bowl, false, "0 2 5", 2.0),
        (&bowl, false, "1 -2", -2.0),
        (&hill, true, "2 2", -2.0),
        (&hill, true, "4 2", -2.0),
        (&hill, true, "0 2 5", -2.0),
        (&hill, true, "1 -2", 2.0),
    ] {
        let solution = solution_of(&problem(objective, [0.0; 2], maximize, ["3", "3"], row));
        assert_eq!(solution.code, 0, "{}", solution.message);
        assert!(
            (solution.duals[0] - expected).abs() < 1e-8,
            "{row} {maximize}: {}",
            solution.duals[0]
        );
    }
}

#[test]
fn programs_without_solutions_are_told_why() {
    let line = |row: &str| solution_of(&problem("n0\n", [-1.0, 0.0], false, ["2 0", "2 0"], row)).code;
    assert_eq!(line("1 -1"), 200);
    assert_eq!(line("2 1"), 300);
    assert_eq!(line("1 1"), 0);
}

#[test]
fn a_stationary_point_outside_the_domain_is_none() {
    // log x − x²/2 + y² has slope 1/x − x, which vanishes at −1, too.
    let objective = format!("o0\no1\no43\nv0\no3\n{SQUARE_X}n2\n{SQUARE_Y}");
    let text = problem(&objective, [0.0; 2], true, ["3", "3"], "3") + "x1\n0 -2\n";
    let solution = solution_of(&text);
    assert!(
        solution.code >= 400 || (solution.x[0] - 1.0).abs() < 1e-8,
        "{}",
        solution.message
    );
}
