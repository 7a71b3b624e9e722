//! Valid files in both forms, and invalid files with the place of the fault.

mod common;

use common::{header, to_binary};
use semismooth_cli::model::RowKind;
use semismooth_cli::nl::{Fault, Position, read};
use semismooth_cli::options::Options;
use semismooth_cli::solve::solve;
use std::ops::ControlFlow;

/// A file with every segment: two complementarities, an equation with a defined variable, a free row, two objectives, suffixes, a function
/// that is not called.
fn everything() -> String {
    header([4, 4, 2, 1, 9, 2, 2])
        + "F0 0 1 spline\t# never called\n\
           S0 2 sosno\n0 1\n2 3\n\
           S5 1 scale\n1 0.5\n\
           V4 1 0\n3 2\no41\nv1\n\
           V5 0 1\no2\nv4\nv4\n\
           C0\no54\n3\no5\nv0\nn2\no16\nv1\ns-2\n\
           C1\no0\nv5\no64\n3\nn-1\ns0\nl2\nn1.5\nn4\nv1\n\
           C2\nn0\n\
           C3\no35\no23\nv2\nn1\no44\nv2\no11\n2\nv2\nn7\n\
           O0 0\no79\nv0\n\
           O1 1\nn3\n\
           d1\n3 0.25\n\
           x3\n0 1\n2 -0.5\n3 0.1\n\
           r\n5 1 1\n5 3 2\n4 0.5\n3\n\
           b\n2 0\n0 -1 4\n3\n3\n\
           k3\n2\n5\n7\n\
           J0 2\n0 0\n1 -1.5\n\
           J1 3\n1 0\n0 1\n3 0\n\
           J2 2\n2 1\n3 1e0\n\
           J3 2\n2 0\n1 0\n\
           G0 2\n0 1\n3 -1\n"
}

#[test]
fn text_and_binary_forms_are_the_same_model() {
    let text = everything();
    let model = read(text.as_bytes()).unwrap();
    assert_eq!(model.rows.len(), 4);
    assert_eq!(
        model.rows[1].kind,
        RowKind::Complements {
            variable: 1,
            lower: true,
            upper: true
        }
    );
    assert_eq!(model.rows[0].linear, [(0, 0.0), (1, -1.5)]);
    assert_eq!(model.start, [1.0, 0.0, -0.5, 0.1]);
    assert_eq!(model.duals, [0.0, 0.0, 0.0, 0.25]);
    assert_eq!((model.lower[1], model.upper[1]), (-1.0, 4.0));
    assert!(model.objectives[1].maximize && !model.objectives[0].maximize);
    for big_endian in [false, true] {
        let mut other = read(&to_binary(&text, big_endian)).unwrap();
        assert!(other.header.binary && other.header.big_endian == big_endian);
        (other.header.binary, other.header.big_endian) = (false, false);
        for (a, b) in model.rows.iter().zip(&mut other.rows) {
            assert!(matches!(b.at, Position::Byte(_)));
            b.at = a.at;
        }
        assert_eq!(model, other);
    }
}

#[test]
fn values_are_those_of_the_formulas() {
    let model = read(everything().as_bytes()).unwrap();
    let mut values = model.graph.workspace();
    for x in [[1.0, 0.5, 0.3, -1.0], [2.0, 3.0, 5.0, 0.7], [0.1, -0.8, 9.0, 0.0]] {
        model.graph.set_variables(&x, &mut values);
        let defined = (x[1].sin() + 2.0 * x[3]).powi(2);
        // <<0, 1.5; -1, 2, 4>>: 0 at 0.
        let pieces = match x[1] {
            v if v <= 0.0 => -v,
            v if v <= 1.5 => 2.0 * v,
            v => 3.0 + 4.0 * (v - 1.5),
        };
        let expected = [
            x[0] * x[0] - x[1] - 2.0 - 1.5 * x[1],
            defined + pieces + x[0],
            x[2] + x[3],
            if x[2] <= 1.0 { x[2].exp() } else { x[2].min(7.0) },
        ];
        for (row, expected) in model.rows.iter().zip(expected) {
            let found = row.body(&model.graph, &mut values);
            assert!(
                (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                "{found} {expected}"
            );
        }
    }
}

#[test]
fn both_forms_give_the_same_solution_to_the_last_bit() {
    let text = header([3, 3, 0, 0, 6, 0, 0])
        + "C0\no5\nv0\nn3\nC1\no44\nv1\nC2\nn0\nr\n5 1 1\n5 3 2\n4 2\nb\n2 0\n0 -1 4\n3\nk2\n2\n4\n\
           J0 2\n0 -1\n2 1\nJ1 2\n0 1\n1 0\nJ2 2\n1 1\n2 3\nx1\n0 1\n";
    let mut found = Vec::new();
    for bytes in [
        text.clone().into_bytes(),
        to_binary(&text, false),
        to_binary(&text, true),
    ] {
        let model = read(&bytes).unwrap();
        let solution = solve(&model, &Options::default(), &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(solution.code, 0, "{}", solution.message);
        found.push(solution);
    }
    assert_eq!(found[0], found[1]);
    assert_eq!(found[0], found[2]);
}

/// A small file, in which the tests replace one line.
const SMALL: &str = "g3 1 1 0\n 2 2 1 1 1 0\n 1 0 1 0 0 0\n 0 0\n 1 0 0\n 0 1 0 1\n 0 0 0 0 0\n 4 1\n 0 0\n 1 0 0 0 0\n\
    F0 0 2 hypot\nV2 1 0\n0 2\no41\nv1\nC0\no2\nv0\nv2\nC1\nn0\nO0 0\nn1\nd1\n0 1\nx1\n1 2\nr\n5 1 1\n4 3\nb\n2 0\n3\nk1\n2\n\
    J0 2\n0 0\n1 0\nJ1 2\n0 1\n1 1\nG0 1\n1 1\n";

#[test]
fn malformed_files_are_refused_with_their_line() {
    assert!(read(SMALL.as_bytes()).is_ok());
    // A line, its replacement, the line of the error, its message.
    let table = [
        ("g3 1 1 0", "z3 1 1 0", 1, "expected g"),
        ("g3 1 1 0", "g12 1 1 0", 1, "number of options 12"),
        ("g3 1 1 0", "g3 1 x 0", 1, "found x"),
        (" 2 2 1 1 1 0", " 0 2 1 1 1 0", 2, "variables 0"),
        (" 2 2 1 1 1 0", " 2 2", 2, "end of the line"),
        (
            " 2 2 1 1 1 0",
            " 2000000000 2 1 1 1 0",
            2,
            "more than the rest of the file",
        ),
        (
            " 2 2 1 1 1 0",
            " 2 2000000000 1 1 1 0",
            2,
            "more than the rest of the file",
        ),
        (
            " 2 2 1 1 1 0",
            " 2 2 2000000000 1 1 0",
            2,
            "more than the rest of the file",
        ),
        (
            " 2 2 1 1 1 0",
            " 2 2 1 1 1 2000000000",
            2,
            "more than the rest of the file",
        ),
        (" 2 2 1 1 1 0", " -2 2 1 1 1 0", 2, "-2 is out of range"),
        (
            " 0 1 0 1",
            " 0 2000000000 0 1",
            6,
            "more than the rest of the file",
        ),
        (
            " 1 0 0 0 0",
            " 2000000000 2000000000 2000000000 0 0",
            10,
            "more than the rest of the file",
        ),
        ("F0 0 2 hypot", "F1 0 2 hypot", 11, "function 1 is out of range"),
        ("F0 0 2 hypot", "F0 0 2", 11, "expected a name"),
        ("F0 0 2 hypot", "Q0 0 2 hypot", 11, "no segment begins with 'Q'"),
        ("F0 0 2 hypot", "S9 1 z\n0 1", 11, "kind of a suffix 9"),
        ("F0 0 2 hypot", "S0 99999 z\n0 1", 11, "99999 values of a suffix"),
        ("F0 0 2 hypot", "S0 1 z\n7 1", 12, "index of a suffix 7"),
        ("V2 1 0", "V9 1 0", 12, "defined variable 9"),
        ("V2 1 0", "V1 1 0", 12, "at least 2"),
        ("o41\nv1\nC0", "o41\nv2\nC0", 15, "v2 is used before"),
        ("o41\nv1\nC0", "o41\nv17\nC0", 15, "variable 17"),
        (
            "o41\nv1\nC0",
            "o41\nv1\nV2 0 0\nn1\nC0",
            16,
            "defined variable 2 is given twice",
        ),
        ("o41", "o999", 14, "operator o999"),
        ("o41", "o61", 14, "operator o61"),
        ("o41", "o-1", 14, "-1 is out of range"),
        ("o41", "p41", 14, "expected an expression, found 'p'"),
        ("o41", "o41 7", 14, "expected the end of the line, found 7"),
        ("o41", "f0 2", 14, "function hypot is imported"),
        ("o41", "h5:hello", 14, "a string"),
        ("o41\nv1", "o11\n0\nv1", 15, "number of operands 0"),
        ("o41\nv1", "o54\n2000000000\nv1", 15, "2000000000 operands"),
        ("o41\nv1", "o64\n0\nv1", 15, "number of slopes 0"),
        (
            "o41\nv1",
            "o64\n2\nn1\nv1\nn2\nv1",
            17,
            "expected a slope or a breakpoint",
        ),
        (
            "o41\nv1",
            "o64\n3\nn1\nn5\nn2\nn4\nn3\nv1",
            20,
            "breakpoints that increase",
        ),
        ("o41\nv1", "nNaN", 14, "no NaN"),
        ("o41\nv1", "n1.2.3", 14, "found 1.2.3"),
        ("o41\nv1", "s70000", 14, "found 70000"),
        ("o41\nv1", "", 14, "an empty line"),
        ("C1\nn0", "C7\nn0", 20, "constraint 7"),
        ("C1\nn0", "C0\nn0", 20, "constraint 0 is given twice"),
        ("C1\nn0", "L0\nn0", 20, "logical constraint 0"),
        ("C1\nn0", "C1\no2\nv0", 23, "found 'O'"),
        ("O0 0", "O1 0", 22, "objective 1"),
        ("O0 0\nn1", "O0 0\nn1\nO0 0\nn2", 24, "objective 0 is given twice"),
        ("d1\n0 1", "d9\n0 1", 24, "number of initial values 9"),
        ("d1\n0 1", "d1\n2 1", 25, "index of an initial value 2"),
        ("x1\n1 2", "x1\n1 inf", 27, "initial value inf"),
        ("x1\n1 2", "x1\n1", 27, "expected an initial value"),
        ("5 1 1", "5 1 0", 29, "from 1 to 2"),
        ("5 1 1", "5 1 3", 29, "from 1 to 2"),
        ("5 1 1", "6 1 1", 29, "kind of a bound"),
        ("5 1 1", "5 1", 29, "variable of a complementarity"),
        ("4 3", "0 3 1", 30, "interval [3, 1]"),
        ("4 3", "4 inf", 30, "a bound inf"),
        ("4 3", "2 inf", 30, "interval [inf, inf]"),
        ("4 3", "2 nan", 30, "interval [NaN, inf]"),
        ("4 3", "2", 30, "expected a bound"),
        ("2 0\n3\nk1", "2 0\n5 1 1\nk1", 33, "kind of a bound"),
        ("2 0\n3\nk1", "2 0\nk1", 33, "kind of a bound"),
        ("k1\n2", "k2\n2\n3", 34, "number of columns 2"),
        ("k1\n2", "k1\n-2", 35, "-2 is out of range"),
        (
            "k1\n2",
            "k1\n3",
            34,
            "column 0 has 2 entries in the J segments, but 3",
        ),
        (
            "k1\n2",
            "K1\n1",
            34,
            "column 0 has 2 entries in the J segments, but 1",
        ),
        ("J0 2\n0 0", "J5 2\n0 0", 36, "constraint 5"),
        ("J0 2\n0 0", "J0 9999\n0 0", 36, "9999 linear terms"),
        ("J0 2\n0 0", "J0 2\n4 0", 37, "variable 4"),
        ("J0 2\n0 0", "J0 2\n1 0", 38, "variable 1 is given twice"),
        ("J0 2\n0 0", "J0 2\n0 nan", 37, "a coefficient NaN"),
        ("J1 2\n0 1", "J0 2\n0 1", 39, "J segment 0 is given twice"),
        (
            "J1 2\n0 1\n1 1\n",
            "",
            41,
            "the J segments have 2 entries, but the header announces 4",
        ),
        (
            "G0 1\n1 1\n",
            "",
            42,
            "the G segments have 0 entries, but the header announces 1",
        ),
        ("G0 1\n1 1", "G0 1\n1", 43, "expected a coefficient"),
        ("G0 1\n1 1", "G1 1\n1 1", 42, "objective 1"),
        (
            "G0 1\n1 1",
            "G0 1\n1 1\nG0 1\n1 1",
            44,
            "G segment 0 is given twice",
        ),
        ("G0 1\n1 1", "b\n3\n3", 42, "segment b 0 is given twice"),
        ("G0 1\n1 1", "r\n3\n3", 42, "segment r 0 is given twice"),
        ("G0 1\n1 1", "k1\n2", 42, "segment k 0 is given twice"),
    ];
    for (line, other, at, message) in table {
        assert_eq!(SMALL.matches(line).count(), 1, "{line:?} is one place");
        let text = SMALL.replace(line, other);
        let error = read(text.as_bytes()).expect_err(other);
        assert_eq!(error.at, Position::Line(at), "{line:?} → {other:?}: {error}");
        assert!(
            error.to_string().contains(message),
            "{line:?} → {other:?}: {error}"
        );
    }
    // The header announces one entry less than the row has.
    let unlisted = SMALL
        .replace(" 4 1\n", " 3 1\n")
        .replace("k1\n2\nJ0 2\n0 0\n1 0\n", "J0 1\n0 0\n");
    let error = read(unlisted.as_bytes()).expect_err("row 0 has variable 1");
    assert_eq!(
        (error.at, error.fault),
        (Position::Line(16), Fault::Unlisted { row: 0, variable: 1 })
    );
    for (whole, fault) in [
        ("O0 0\nn1\n", Fault::Missing('O')),
        ("b\n2 0\n3\n", Fault::Missing('b')),
        ("r\n5 1 1\n4 3\n", Fault::Missing('r')),
    ] {
        assert_eq!(
            read(SMALL.replace(whole, "").as_bytes()).unwrap_err().fault,
            fault
        );
    }
}

#[test]
fn binary_files_are_refused_with_their_byte() {
    let good = to_binary(&everything(), false);
    assert!(read(&good).is_ok());
    let after = |needle: &[u8]| good.windows(needle.len()).position(|w| w == needle).unwrap();
    // The code of the first operator, o41, of V4.
    let operator = after(b"o\x29\0\0\0");
    let mut bytes = good.clone();
    bytes[operator + 1] = 99;
    let error = read(&bytes).unwrap_err();
    assert_eq!(
        (error.at, error.fault),
        (Position::Byte(operator + 1), Fault::Operator(99))
    );
    bytes = good.clone();
    bytes[operator] = b'f';
    assert_eq!(read(&bytes).unwrap_err().at, Position::Byte(operator + 1));
    bytes[operator] = b'!';
    assert_eq!(read(&bytes).unwrap_err().at, Position::Byte(operator));
    // Floating-point numbers in VAX format.
    let text = String::from_utf8_lossy(&good[..120]).replacen(" 1 1 1\n", " 1 4 1\n", 1);
    assert!(read(text.replace("0 1 1 1", "0 1 4 1").as_bytes()).is_err());
    // Truncated files give an error, never an incomplete model.
    for end in 0..good.len() {
        let error = read(&good[..end]).expect_err("a part of the file");
        assert!(matches!(error.at, Position::Byte(b) if b <= end) || matches!(error.at, Position::Line(_)));
    }
}

/// xorshift: the same files in each run.
fn random(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

#[test]
fn mutated_files_are_read_or_refused_and_solved_or_refused() {
    let options = Options::default();
    let mut short = options.clone();
    short.take("max_iter=20 max_attempt=5").unwrap();
    let mut state = 0x9e37_79b9_7f4a_7c15;
    let (mut read_well, mut refused) = (0, 0);
    for original in [
        everything().into_bytes(),
        SMALL.into(),
        to_binary(&everything(), false),
        to_binary(SMALL, true),
    ] {
        for _ in 0..3000 {
            let mut bytes = original.clone();
            for _ in 0..=random(&mut state) % 4 {
                if bytes.is_empty() {
                    break;
                }
                let (at, what) = (random(&mut state) as usize % bytes.len(), random(&mut state));
                match what % 6 {
                    0 => bytes[at] = (what >> 8) as u8,
                    1 => bytes[at] = b"0123456789-.nvosCJrbkx\n #"[(what >> 8) as usize % 25],
                    2 => {
                        bytes.remove(at);
                    }
                    3 => bytes.insert(at, (what >> 8) as u8),
                    4 => {
                        let from = (what >> 8) as usize % bytes.len();
                        let piece = bytes[from..(from + 12).min(bytes.len())].to_vec();
                        bytes.splice(at..at, piece);
                    }
                    _ => bytes.truncate(at.max(1)),
                }
            }
            match read(&bytes) {
                Ok(model) => {
                    read_well += 1;
                    let _ = solve(&model, &short, &mut |_| ControlFlow::Continue(()));
                }
                Err(error) => {
                    refused += 1;
                    match error.at {
                        Position::Line(line) => {
                            assert!(line <= 1 + bytes.iter().filter(|&&b| b == b'\n').count())
                        }
                        Position::Byte(byte) => assert!(byte <= bytes.len()),
                    }
                }
            }
        }
    }
    assert!(read_well > 500 && refused > 5000, "{read_well} {refused}");
}

#[test]
fn expressions_of_any_depth_are_read_evaluated_and_differentiated() {
    let depth = 300_000;
    // sin(sin(… x)) and ((x + x) + x) …, two separate chains.
    let mut text = header([2, 2, 1, 0, 2, 2, 0]) + "C0\n";
    text.push_str(&"o41\n".repeat(depth));
    text.push_str("v0\nC1\n");
    text.push_str(&"o0\n".repeat(depth));
    text.push_str("v1\n");
    text.push_str(&"v1\n".repeat(depth));
    text.push_str("O0 0\no2\nv0\nv1\nr\n4 0\n1 9\nb\n0 -1 1\n3\nk1\n1\nJ0 1\n0 0\nJ1 1\n1 0\nG0 2\n0 0\n1 0\nx2\n0 0.5\n1 1\n");
    let model = read(text.as_bytes()).unwrap();
    let mut values = model.graph.workspace();
    model.graph.set_variables(&[0.5, 1.0], &mut values);
    assert_eq!(model.rows[1].body(&model.graph, &mut values), depth as f64 + 1.0);
    let mut options = Options::default();
    options.take("max_iter=3 max_attempt=3").unwrap();
    solve(&model, &options, &mut |_| ControlFlow::Continue(())).unwrap();
}

#[test]
fn a_test_that_is_not_a_number_has_no_branch() {
    let text = header([1, 1, 0, 0, 1, 0, 0]) + "C0\no35\no43\nv0\nn1\nn2\nr\n3\nb\n3\nJ0 1\n0 0\n";
    let model = read(text.as_bytes()).unwrap();
    let mut values = model.graph.workspace();
    for (x, expected) in [(2.0, 1.0), (1.0, 2.0), (-1.0, f64::NAN)] {
        model.graph.set_variables(&[x], &mut values);
        let found = model.rows[0].body(&model.graph, &mut values);
        assert!(
            found == expected || (found.is_nan() && expected.is_nan()),
            "{x}: {found}"
        );
    }
}

/// if x ≥ 1 then ln(x − 1) else x: at 1 both branches count, beside it the selected one, and an equality selects the point itself.
#[test]
fn both_branches_count_where_a_test_changes() {
    for (comparison, x, defined) in [
        ("o28", 1.0, false),
        ("o28", 0.5, true),
        ("o28", 2.0, true),
        ("o24", 1.0, true),
        ("o24", 0.5, false),
    ] {
        // 22 <, 23 ≤, 24 =, 28 ≥; the branches are 1 and ln(x − 1) for =, else ln(x − 1) and x.
        let branches = if comparison == "o24" {
            "n1\no43\no1\nv0\nn1\n"
        } else {
            "o43\no1\nv0\nn1\nv0\n"
        };
        let text = header([1, 1, 0, 0, 1, 0, 0])
            + &format!("C0\no35\n{comparison}\nv0\nn1\n{branches}r\n3\nb\n3\nJ0 1\n0 0\n");
        let model = read(text.as_bytes()).unwrap();
        let mut values = model.graph.workspace();
        model.graph.set_variables(&[x], &mut values);
        let found = model.rows[0].body(&model.graph, &mut values);
        assert_eq!(found.is_finite(), defined, "{comparison} {x}: {found}");
    }
}
