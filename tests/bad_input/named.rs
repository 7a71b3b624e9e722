//! Each bad input is refused by the variant of the error that names it.

use semismooth::InputError;
use semismooth::contact::{
    ContactBody, ContactError, ContactState, FrictionCoefficient, FullContact, HildRenard, LoadPath,
    OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::continuation::{
    Arm, Branch, Continuation, ContinuationError, ContinuationOptions, Direction, arms_at,
};
use semismooth::linear::{AutoSolver, Cholesky, DenseLu, LinearError, LinearSolver, SparseLu};
use semismooth::newton::{Newton, NewtonError, NewtonOptions};
use semismooth::piecewise::{MinMap, PiecewiseError, PiecewiseSmooth, Selection};
use semismooth::sparse::{Matrix, Pattern};

const BAD: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

macro_rules! refused {
    ($($call:expr => $error:pat),+ $(,)?) => {$(
        let result = $call;
        assert!(matches!(result, Err($error)), "{}: {:?}", stringify!($call), result.err());
    )+};
}

fn rows(rows: &[&[f64]]) -> Matrix {
    Matrix::from_rows(rows).unwrap()
}

fn stiffness() -> Matrix {
    rows(&[&[2.0, -1.0], &[-1.0, 2.0]])
}

fn with_matrices(a: Matrix, bnu: Matrix, bt: Matrix) -> Result<FullContact<PlanarCoulomb>, ContactError> {
    let load = LoadPath::constant(vec![1.5, 7.0]);
    FullContact::planar(a, bnu, bt, load, FrictionCoefficient::nodal(vec![0.5]).unwrap())
}

fn with_paths(
    load: LoadPath,
    friction: FrictionCoefficient,
) -> Result<FullContact<PlanarCoulomb>, ContactError> {
    FullContact::planar(
        stiffness(),
        rows(&[&[1.0, 0.0]]),
        rows(&[&[0.0, 1.0]]),
        load,
        friction,
    )
}

fn load() -> LoadPath {
    LoadPath::constant(vec![1.5, 7.0])
}

/// F = α.
fn problem() -> FullContact<PlanarCoulomb> {
    with_paths(load(), FrictionCoefficient::affine(vec![0.0], vec![1.0]).unwrap()).unwrap()
}

#[test]
fn friction_problems() {
    let (nu, t) = (|| rows(&[&[1.0, 0.0]]), || rows(&[&[0.0, 1.0]]));
    let empty = |m, n| Matrix::zeros(Pattern::full(m, n));
    refused! {
        with_matrices(empty(0, 0), nu(), t()) => ContactError::Empty { .. },
        with_matrices(stiffness(), empty(0, 2), t()) => ContactError::Empty { .. },
        with_matrices(rows(&[&[1.0, 2.0]]), nu(), t()) => ContactError::Input(InputError::Shape { .. }),
        with_matrices(stiffness(), rows(&[&[1.0]]), t()) => ContactError::Input(InputError::Shape { .. }),
        with_matrices(stiffness(), nu(), rows(&[&[1.0]])) => ContactError::Input(InputError::Shape { .. }),
        with_matrices(stiffness(), nu(), empty(2, 2)) => ContactError::Input(InputError::Shape { .. }),
        with_paths(LoadPath::constant(vec![1.0]), FrictionCoefficient::nodal(vec![0.5]).unwrap()) => ContactError::Input(InputError::Length { .. }),
        with_paths(LoadPath::affine(vec![1.0; 2], vec![1.0]), FrictionCoefficient::nodal(vec![0.5]).unwrap()) => ContactError::Input(InputError::Length { .. }),
        with_paths(LoadPath::between(vec![1.0; 2], &[1.0]), FrictionCoefficient::nodal(vec![0.5]).unwrap()) => ContactError::Input(InputError::Length { .. }),
        FrictionCoefficient::nodal(vec![]) => ContactError::Empty { .. },
        with_paths(load(), FrictionCoefficient::nodal(vec![0.5; 2]).unwrap()) => ContactError::Input(InputError::Length { .. }),
        FrictionCoefficient::nodal(vec![-0.1]) => ContactError::NegativeFriction { node: 0, .. },
        problem().with_gap(vec![]) => ContactError::Input(InputError::Length { .. }),
        problem().with_r(0.0) => ContactError::Augmentation { .. },
        problem().with_r(-1.0) => ContactError::Augmentation { .. },
        HildRenard::new(1.0, 1.0, 0.0, 1.0) => ContactError::Modulus { index: 0, .. },
        HildRenard::new(1.0, 1.0, 1.0, -1.0) => ContactError::Modulus { index: 1, .. },
    }
    for bad in BAD {
        let mut a = stiffness();
        a.values_mut()[1] = bad;
        let mut b = nu();
        b.values_mut()[0] = bad;
        refused! {
            with_matrices(a.clone(), nu(), t()) => ContactError::Matrix { .. },
            with_matrices(stiffness(), b.clone(), t()) => ContactError::Matrix { .. },
            with_matrices(stiffness(), nu(), b.clone()) => ContactError::Matrix { .. },
            with_paths(LoadPath::constant(vec![0.0, bad]), FrictionCoefficient::nodal(vec![0.5]).unwrap()) => ContactError::Input(InputError::NotFinite { index: 1, .. }),
            FrictionCoefficient::affine(vec![0.5], vec![bad]) => ContactError::Input(InputError::NotFinite { index: 0, .. }),
            problem().with_gap(vec![bad]) => ContactError::Input(InputError::NotFinite { .. }),
            problem().with_r(bad) => ContactError::Augmentation { .. },
            HildRenard::new(1.0, bad, 1.0, 1.0) => ContactError::Input(InputError::NotFinite { index: 1, .. }),
            HildRenard::new(1.0, 1.0, 1.0, bad) => ContactError::Input(InputError::NotFinite { index: 3, .. }),
        }
    }
}

#[test]
fn condensation() {
    let (nu, t) = (|| rows(&[&[1.0, 0.0]]), || rows(&[&[0.0, 1.0]]));
    let unsymmetric = with_matrices(rows(&[&[2.0, -1.0], &[0.0, 2.0]]), nu(), t()).unwrap();
    let indefinite = with_matrices(rows(&[&[1.0, 2.0], &[2.0, 1.0]]), nu(), t()).unwrap();
    let singular = with_matrices(rows(&[&[1.0, -1.0], &[-1.0, 1.0]]), nu(), t()).unwrap();
    refused! {
        unsymmetric.condensed() => PiecewiseError::Input(InputError::NotSymmetric { .. }),
        indefinite.condensed() => PiecewiseError::Linear(LinearError::NotPositiveDefinite),
        singular.condensed() => PiecewiseError::Linear(_),
    }
    let condensed = problem().condensed().unwrap();
    refused! {
        condensed.expand(&[0.0]) => PiecewiseError::Input(InputError::Length { .. }),
        condensed.expand(&[0.0, f64::NAN, 1.0]) => PiecewiseError::Input(InputError::NotFinite { .. }),
        condensed.restrict(&[0.0]) => PiecewiseError::Input(InputError::Length { .. }),
    }
}

#[test]
fn first_points() {
    let p = problem();
    use ContactState::{Open, Stick};
    refused! {
        p.solve(-1.0, None) => ContactError::NegativeFriction { .. },
        p.solve_from_states(-1.0, &[Stick]) => ContactError::NegativeFriction { .. },
        p.solve_from_states(1.0, &[]) => ContactError::Input(InputError::Length { .. }),
        p.solve_from_states(1.0, &[Open, Open]) => ContactError::Input(InputError::Length { .. }),
        p.solve(1.0, Some(&[0.0])) => ContactError::Input(InputError::Length { .. }),
        p.solve(1.0, Some(&[f64::NAN; 5])) => ContactError::Input(InputError::NotFinite { .. }),
    }
    for bad in BAD {
        refused!(p.solve(bad, None) => ContactError::Input(InputError::NotFinite { .. }));
    }
    let body = ContactBody::new(
        Matrix::identity(3),
        rows(&[&[1.0, 0.0, 0.0]]),
        vec![rows(&[&[0.0, 1.0, 0.0]]), rows(&[&[0.0, 0.0, 1.0]])],
        LoadPath::constant(vec![1.0, 0.5, 0.0]),
    );
    let [none, some] = [0.0, 0.3].map(|f| FrictionCoefficient::constant(f).unwrap());
    let none = OrthotropicCoulomb::new(none, some);
    let space = FullContact::new(body.unwrap(), none).unwrap();
    refused!(space.solve(0.0, None) => ContactError::NoFriction { node: 0, .. });
    // A body that can move freely under a load that pulls it away has no equilibrium.
    let free = FullContact::planar(
        rows(&[&[0.0, 0.0], &[0.0, 0.0]]),
        rows(&[&[1.0, 0.0]]),
        rows(&[&[0.0, 1.0]]),
        LoadPath::constant(vec![-1.0, 0.0]),
        FrictionCoefficient::nodal(vec![0.5]).unwrap(),
    )
    .unwrap();
    refused!(free.solve(0.0, None) => ContactError::Unbalanced { displacement: 0, work: 1.0, .. });
}

/// α = |y|.
fn vee() -> impl PiecewiseSmooth {
    MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    })
}

fn start(o: ContinuationOptions) -> Result<(), ContinuationError> {
    Continuation::new(&vee(), &[0.5, 0.5], Direction::Increasing, o).map(|_| ())
}

#[test]
fn continuation_options() {
    let o = ContinuationOptions::default;
    let mut table: Vec<(&str, ContinuationOptions)> = vec![
        ("min_step", o().with_min_step(0.1)),
        ("min_step", o().with_max_step(1e-9)),
        ("max_points", o().with_max_points(0)),
        ("parameter_range", o().with_parameter_range((1.0, 1.0))),
        ("parameter_range", o().with_parameter_range((2.0, 1.0))),
        ("parameter_range", o().with_parameter_range((0.0, f64::NAN))),
        ("parameter_range", o().with_parameter_range((f64::NAN, 1.0))),
        ("targets", o().with_targets(vec![0.5, f64::INFINITY])),
        ("min_cos", o().with_min_cos(1.0)),
        ("max_arclength", o().with_max_arclength(0.0)),
    ];
    for bad in [0.0, -1.0, f64::NAN] {
        table.push(("step", o().with_step(bad)));
        table.push(("min_step", o().with_min_step(bad)));
        table.push(("max_step", o().with_max_step(bad)));
        table.push(("min_cos", o().with_min_cos(bad)));
        table.push(("max_growth", o().with_max_growth(bad)));
    }
    table.push(("targets", o().with_targets(vec![f64::NAN])));
    table.push(("max_arclength", o().with_max_arclength(f64::NAN)));
    table.push(("step", o().with_step(f64::INFINITY)));
    for (wanted, options) in table {
        match start(options.clone()) {
            Err(ContinuationError::Input(InputError::Option { name, .. })) => assert_eq!(name, wanted),
            other => panic!("{wanted}: {other:?}"),
        }
        refused!(arms_at(&vee(), &[0.5, 0.5], &options) => ContinuationError::Input(InputError::Option { .. }));
    }
}

#[test]
fn continuation_starts() {
    let o = ContinuationOptions::default;
    let map = vee();
    let follow = |x: &[f64], d: Direction| Branch::follow(&map, x, d, o()).map(|_| ());
    let arm = |tangent: Vec<f64>, sites: usize| {
        let mut arm = arms_at(&map, &[0.5, 0.5], &o()).unwrap().arms[0].clone();
        (arm.tangent, arm.selection) = (tangent, Selection::uniform(sites, 0));
        arm
    };
    let along = |arm: &Arm| Branch::follow_arm(&map, &[0.5, 0.5], arm, o()).map(|_| ());
    refused! {
        follow(&[0.5], Direction::Increasing) => ContinuationError::Input(InputError::Length { .. }),
        follow(&[], Direction::Increasing) => ContinuationError::Input(InputError::Length { .. }),
        follow(&[0.0, -1.0], Direction::Increasing) => ContinuationError::Start(_),
        follow(&[0.0, 0.0], Direction::Decreasing) => ContinuationError::NoArm { found: 2, .. },
        follow(&[0.5, 0.5], Direction::Along(vec![1.0])) => ContinuationError::Input(InputError::Length { .. }),
        follow(&[0.5, 0.5], Direction::Along(vec![0.0, 0.0])) => ContinuationError::NoArm { .. },
        along(&arm(vec![1.0], 1)) => ContinuationError::Input(InputError::Length { .. }),
        along(&arm(vec![1.0, 1.0], 2)) => ContinuationError::Input(InputError::Length { .. }),
    }
    for bad in BAD {
        refused! {
            follow(&[bad, 0.5], Direction::Increasing) => ContinuationError::Input(InputError::NotFinite { .. }),
            follow(&[0.5, bad], Direction::Increasing) => ContinuationError::Input(InputError::NotFinite { .. }),
            follow(&[0.5, 0.5], Direction::Along(vec![bad, 1.0])) => ContinuationError::Input(InputError::NotFinite { .. }),
            along(&arm(vec![bad, 1.0], 1)) => ContinuationError::Input(InputError::NotFinite { .. }),
        }
    }
    // A square system defines no curve, and a point behind a wall is no start.
    let square = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = 1.0;
    });
    let p = problem();
    let behind = [0.0, 0.0, 1.5, 7.0, -1.0];
    refused! {
        Branch::follow(&square, &[0.0], Direction::Increasing, o()) => ContinuationError::Map(PiecewiseError::Dimensions { .. }),
        Branch::follow(&p, &behind, Direction::Increasing, o()) => ContinuationError::Outside { .. } | ContinuationError::Start(_),
    }
}

#[test]
fn corrector() {
    let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = 1.0;
    });
    let solve = |x: &[f64], o: NewtonOptions| Newton::new(o).solve(&map, &mut x.to_vec()).map(|_| ());
    let o = NewtonOptions::default;
    refused! {
        solve(&[], o()) => NewtonError::Input(InputError::Length { .. }),
        solve(&[f64::NAN], o()) => NewtonError::Input(InputError::NotFinite { .. }),
        solve(&[1.0], o().with_max_iterations(0)) => NewtonError::Input(InputError::Option { name: "max_iterations", .. }),
        solve(&[1.0], o().with_tolerances(f64::NAN, 0.0)) => NewtonError::Input(InputError::Option { .. }),
        solve(&[1.0], o().with_tolerances(0.0, -1.0)) => NewtonError::Input(InputError::Option { .. }),
    }
}

fn factor(mut solver: impl LinearSolver, a: &Matrix) -> Result<(), LinearError> {
    solver.analyze(a.pattern().as_ref())?;
    solver.factor(a.as_ref())
}

#[test]
fn linear_algebra() {
    let singular = rows(&[&[1.0, 2.0], &[2.0, 4.0]]);
    let oblong = rows(&[&[1.0, 2.0]]);
    let mut spoilt = stiffness();
    spoilt.values_mut()[0] = f64::NAN;
    refused! {
        factor(DenseLu::new(), &singular) => LinearError::Singular { .. },
        factor(SparseLu::new(), &singular) => LinearError::Singular { .. },
        factor(AutoSolver::new(), &singular) => LinearError::Singular { .. },
        factor(Cholesky::new(), &rows(&[&[1.0, 2.0], &[2.0, 1.0]])) => LinearError::NotPositiveDefinite,
        factor(DenseLu::new(), &oblong) => LinearError::NotSquare { .. },
        factor(SparseLu::new(), &oblong) => LinearError::NotSquare { .. },
        factor(Cholesky::new(), &oblong) => LinearError::NotSquare { .. },
        factor(DenseLu::new(), &spoilt) => LinearError::NotFinite { .. },
        factor(SparseLu::new(), &spoilt) => LinearError::NotFinite { .. },
        factor(Cholesky::new(), &spoilt) => LinearError::NotFinite { .. },
        DenseLu::new().solve_in_place(&mut [1.0]) => LinearError::NotFactored,
        Matrix::from_triplets(1, 1, &[(0, 1, 1.0)]) => InputError::OutOfBounds { .. },
        Matrix::from_rows(&[vec![1.0, 2.0], vec![1.0]]) => InputError::Length { .. },
    }
}
