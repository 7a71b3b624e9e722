//! The text forms of types: words that are read back, and lines for people.

use std::fmt::{Debug, Display};
use std::ops::ControlFlow;
use std::str::FromStr;

use semismooth::InputError;
use semismooth::complementarity::active_set::{ActiveSetOptions, Nested};
use semismooth::complementarity::{AffineFunction, Lcp, Mcp, McpOptions, Variables};
use semismooth::cones::ConeStrategy;
use semismooth::contact::{
    CondensedContact, ContactBody, ContactState, ContactStrategy, EvolutionOptions, FixedPointOptions,
    FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb, evolve, fixed_point,
};
use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction, Event, PointKind};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{CellKind, Dilatation, PlaneModel};
use semismooth::linear::{IncompleteLu, Krylov, KrylovMethod, Preconditioned, Preconditioner};
use semismooth::newton::{Newton, NewtonError};
use semismooth::piecewise::check::{CheckOptions, check};
use semismooth::piecewise::{MinMap, PiecewiseSmoothExt};
use semismooth::sparse::Matrix;

/// Each value is read back from its text, and unknown words are refused with the list of known ones.
fn read_back<T: Display + FromStr<Err = InputError> + PartialEq + Debug>(values: &[T]) {
    let words: Vec<String> = values.iter().map(T::to_string).collect();
    for (value, word) in values.iter().zip(&words) {
        assert_eq!(&word.parse::<T>().unwrap(), value);
    }
    let long = "x".repeat(1000);
    let e = long.parse::<T>().unwrap_err();
    let told = e.to_string();
    assert!(matches!(e, InputError::Name { known, .. } if known == words));
    assert!(words.iter().all(|w| told.contains(w)), "{told}");
    assert!(told.len() < 400, "{told}");
    assert_eq!(format!("{:>20}", values[0]).chars().count(), 20);
}

#[test]
fn names_are_read_back() {
    read_back(&ContactState::ALL);
    read_back(&[
        CellKind::Triangle,
        CellKind::Quadrilateral,
        CellKind::Tetrahedron,
        CellKind::Hexahedron,
        CellKind::Triangle6,
        CellKind::Quadrilateral8,
        CellKind::Quadrilateral9,
        CellKind::Tetrahedron10,
        CellKind::Hexahedron20,
        CellKind::Hexahedron27,
        CellKind::Wedge,
        CellKind::Wedge15,
        CellKind::Pyramid,
        CellKind::Pyramid13,
    ]);
    read_back(&[PlaneModel::Strain, PlaneModel::Stress, PlaneModel::Axisymmetric]);
    read_back(&[Dilatation::Automatic, Dilatation::Pointwise, Dilatation::Mean]);
    read_back(&McpOptions::default().strategies);
    read_back(&[
        ConeStrategy::Newton,
        ConeStrategy::InteriorPoints,
        ConeStrategy::Smoothing,
        ConeStrategy::CentralPath,
        ConeStrategy::ProximalPoints,
    ]);
    read_back(&[
        ContactStrategy::Newton,
        ContactStrategy::Restart,
        ContactStrategy::Stiffer,
        ContactStrategy::Increments,
        ContactStrategy::Path,
        ContactStrategy::LoadSteps,
        ContactStrategy::Condensed,
    ]);
}

#[test]
fn sets_of_solutions() {
    let list = |m: f64, q: f64| {
        let lcp = Lcp::new(Matrix::from_rows(&[[m]]).unwrap(), vec![q]).unwrap();
        all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default()).unwrap()
    };
    let two = list(-1.0, 0.25);
    assert_eq!(two.to_string(), "2 solutions, sum of indices 0, complete");
    assert_eq!(two.solutions[0].to_string(), "(0), index 1, margin 2.5e-1");
    assert_eq!(two.solutions[1].to_string(), "(0.25), index -1, margin 2.5e-1");
    assert_eq!(
        list(1.0, -1.0).to_string(),
        "1 solution, sum of indices 1, complete"
    );
    assert_eq!(
        list(-1.0, -1.0).to_string(),
        "0 solutions, sum of indices 0, complete"
    );
    assert!(
        list(0.0, 0.0).to_string().contains("1 continuum"),
        "{}",
        list(0.0, 0.0)
    );
}

/// α = |y|, with a monitor at α = ½.
#[test]
fn events_of_a_curve() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let curve = Continuation::new(&map, &[1.0, 1.0], Direction::Decreasing, options)
        .unwrap()
        .with_monitor("half", |x| x[1] - 0.5);
    let events: Vec<Event> = curve.map(Result::unwrap).collect();
    let told: Vec<String> = events.iter().map(|e| format!("{e:.3}")).collect();
    assert_eq!(told[0], "start at parameter 1.000");
    assert!(
        told.contains(&"zero of half at parameter 0.500".to_owned()),
        "{told:?}"
    );
    assert!(
        told.contains(&"fold at parameter 0.000, site 0: piece 0 to 1".to_owned())
            || told.contains(&"fold at parameter 0.000, site 0: piece 1 to 0".to_owned()),
        "{told:?}"
    );
    assert_eq!(told.last().unwrap(), "target at parameter 1.000");
    assert_eq!(PointKind::Step.to_string(), "step");
}

/// y³ − 3 y = α turns at y = ±1; (α − y) y = 0 branches at 0.
#[test]
fn singular_points() {
    let parabola = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0].powi(3) - 3.0 * x[0] - x[1];
        b[0] = 100.0;
    });
    let options = || ContinuationOptions::default().with_parameter_range((-10.0, 10.0));
    let branch = Branch::follow(&parabola, &[-2.0, -2.0], Direction::Increasing, options()).unwrap();
    assert_eq!(
        format!("{:.6}", Event::SmoothFold(branch.smooth_folds[0].clone())),
        "smooth fold at parameter 2.000000"
    );
    let cross = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = (x[1] - x[0]) * x[0];
        b[0] = 100.0;
    });
    let options = options().with_parameter_range((-1.0, 1.0));
    let branch = Branch::follow(&cross, &[0.0, -1.0], Direction::Increasing, options).unwrap();
    let told = format!("{:.6}", branch.branch_points[0]);
    assert_eq!(told, "branch point at parameter 0.000000, 3 arms leave");
}

fn body() -> ContactBody {
    let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap();
    let row = |r: [f64; 2]| Matrix::from_rows(&[r]).unwrap();
    let load = LoadPath::affine(vec![1.0, 0.0], vec![-1.0, 1.0]);
    ContactBody::new(a, row([1.0, 0.0]), vec![row([0.0, 1.0])], load).unwrap()
}

fn coulomb() -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::nodal(vec![0.5]).unwrap())
}

#[test]
fn contact() {
    let mut problem = FullContact::new(body(), coulomb()).unwrap();
    let report = problem.solve_reported(0.0, None).unwrap();
    let told = report.to_string();
    assert!(
        told.starts_with("found by Newton after ") && told.contains("residual"),
        "{told}"
    );
    let solution = problem.solution(&report.x).unwrap();
    let told = solution.to_string();
    assert!(told.starts_with("0 open, 1 sticks, 0 slip; residuals "), "{told}");
    // Slips from ⅓ on.
    let options = EvolutionOptions::default();
    let steps = evolve(&mut problem, &report.x, &[1.0], &options, |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let told = steps[0].to_string();
    assert!(
        told.starts_with("level 1: followed, 1 transition; 0 open, 0 stick, 1 slips; "),
        "{told}"
    );
    let condensed = CondensedContact::new(body(), coulomb()).unwrap();
    let start = condensed.solve(0.0, None).unwrap();
    let found = fixed_point(&condensed, &start, &FixedPointOptions::default()).unwrap();
    assert!(found.to_string().starts_with("converged after "), "{found}");
}

#[test]
fn iterations() {
    let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap();
    let mut exact = IncompleteLu::default();
    exact.prepare(a.as_ref()).unwrap();
    let mut x = [1.0; 2];
    let report = Krylov::new(KrylovMethod::Cg)
        .solve(&mut Preconditioned::new(&a, &mut exact), &mut x, 1e-10)
        .unwrap();
    let told = report.to_string();
    assert!(told.starts_with("solved after 1 iteration, residual "), "{told}");
    let lcp = Lcp::new(a, vec![-1.0, -1.0]).unwrap();
    let mut x = [0.0; 2];
    let report = Nested::new(lcp)
        .solve(&ActiveSetOptions::default(), &mut x)
        .unwrap();
    let told = report.to_string();
    assert!(
        told.starts_with("solved after ") && !told.contains("levels"),
        "{told}"
    );
}

#[test]
fn checks() {
    let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = 2.0 * x[0];
    });
    let report = check(&map, &[vec![1.0]], &CheckOptions::default()).unwrap();
    let told = report.to_string();
    assert!(told.starts_with("1 point: "), "{told}");
}

#[test]
fn components_have_the_names_of_their_blocks() {
    let mut variables = Variables::new();
    let flow = variables.add("flow", 2, 0.0, f64::INFINITY).unwrap();
    let time = variables.add("time", 1, -1.0, 1.0).unwrap();
    variables.set_bounds("flow", &[0.0, 1.0], &[2.0, 3.0]).unwrap();
    assert_eq!(
        (variables.lower(), variables.upper()),
        (&[0.0, 1.0, -1.0][..], &[2.0, 3.0, 1.0][..])
    );
    assert_eq!(
        (flow.range(), time.range(), time.index(0), flow.len()),
        (0..2, 2..3, 2, 2)
    );
    assert!(!flow.is_empty() && variables.block("time") == Ok(time));
    assert_eq!(
        variables.blocks().collect::<Vec<_>>(),
        [("flow", flow), ("time", time)]
    );
    let affine = AffineFunction::new(Matrix::identity(3), vec![0.0; 3]).unwrap();
    let problem = Mcp::of_variables(affine, &variables).unwrap();
    let names: Vec<String> = (0..3).map(|i| problem.site_name(i).into_owned()).collect();
    assert_eq!(names, ["flow[0]", "flow[1]", "time"]);
    assert_eq!(variables.name(3), None);
    // With a parameter after them, too.
    let x = variables.view(&[1.0, 2.0, 3.0, 9.0]).unwrap();
    assert_eq!(x.block("time"), Ok(&[3.0][..]));
}

/// A `main` that returns the error of a failed search prints a line, whatever the size of the problem: min(x² + 1, x² + 2) = 0 has no
/// solution.
#[test]
fn errors_of_failed_searches_are_short() {
    let map = MinMap::new(200, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for (i, x) in x.iter().enumerate() {
            (a[i], b[i]) = (x * x + 1.0, x * x + 2.0);
        }
    });
    let error = Newton::default().solve(&map, &mut [1.0; 200]).unwrap_err();
    let NewtonError::Failed(unsolved) = &error else {
        panic!("{error}");
    };
    assert_eq!(unsolved.x.len(), 200);
    let told = format!("{error:?}");
    assert!(told.len() < 300 && told.contains("residual_norm"), "{told}");
}
