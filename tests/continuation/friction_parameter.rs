//! The coefficient of friction as the parameter: curved pieces, folds, and paths of load and friction together.
#![cfg(feature = "json")]

use crate::common;
use std::path::Path;

use semismooth::contact::{
    CondensedContact, ContactState, FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb,
    read_folder,
};
use semismooth::continuation::{
    Branch, ContinuationOptions, Direction, Termination, TransitionKind, certify,
};
use semismooth::piecewise::{PiecewiseSmooth, select};
use semismooth::sparse::Matrix;

use ContactState::{Open, SlipMinus, Stick};

const FOLD: f64 = 1.667_252_305_251_824_4;
const NODE: usize = 0;

/// The vee at γ = 0.38, with one coefficient of friction F = α for all nodes.
fn vee() -> FullContact<PlanarCoulomb> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vee");
    let problem = read_folder(folder).unwrap();
    let p = problem.num_contacts();
    let load = problem.body().load_at(0.38);
    problem
        .with_load(LoadPath::constant(load))
        .unwrap()
        .with_law(PlanarCoulomb::new(
            FrictionCoefficient::affine(vec![0.0; p], vec![1.0; p]).unwrap(),
        ))
        .unwrap()
}

fn states(p: usize, first: ContactState) -> Vec<ContactState> {
    let mut list = vec![Open; p];
    list[NODE] = first;
    list
}

#[test]
fn three_solutions_and_a_nonsmooth_fold_in_friction() {
    let map = vee();
    let p = map.num_contacts();
    // Stored solutions: (λν, λt) of the closed node; all other nodes are open.
    let stored = [
        (Open, 0.0, 0.0),
        (Stick, 0.279_517_156_801_907, -0.466_025_624_035_415_1),
        (SlipMinus, 0.170_151_854_180_239_87, -0.306_273_337_524_431_7),
    ];
    let mut starts = Vec::new();
    for (state, pressure, traction) in stored {
        let wanted = states(p, state);
        let x = map.solve_from_states(1.8, &wanted).unwrap();
        let node = map.nodes(&x)[NODE];
        assert!((node.pressure - pressure).abs() < 1e-9 && (node.traction[0] - traction).abs() < 1e-9);
        assert_eq!(map.states(&semismooth::piecewise::select(&map, &x)), wanted);
        starts.push(x);
    }
    let options = ContinuationOptions::default().with_parameter_range((1.0, 1.8));
    let branch = Branch::follow(&map, &starts[1], Direction::Decreasing, options.clone()).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert_eq!(branch.transitions.len(), 1, "{:?}", branch.folds());
    let fold = &branch.transitions[0];
    assert_eq!(fold.kind, TransitionKind::Fold);
    assert!(
        (fold.parameter() - FOLD).abs() <= 1e-9,
        "{:.17}",
        fold.parameter()
    );
    assert_eq!(fold.sites[0].site, NODE);
    assert_eq!(
        (fold.sites[0].from, fold.sites[0].to),
        (Stick.piece(), SlipMinus.piece())
    );
    assert!(fold.complete);

    // Steps do not leave the branch: each point is the exact solution of its state at its F.
    let mut seen = Vec::new();
    for point in &branch.points {
        let alpha = point.parameter();
        assert!((FOLD - 1e-9..=1.8).contains(&alpha), "{alpha}");
        let own = map.states(&point.selection);
        let x = map.solve_from_states(alpha, &own).unwrap();
        let distance = point
            .x
            .iter()
            .zip(&x)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-8, "{distance:e} at {alpha}");
        if seen.last() != Some(&own) {
            seen.push(own);
        }
    }
    assert_eq!(seen, [states(p, Stick), states(p, SlipMinus)]);
    let last = &branch.points.last().unwrap().x;
    assert!(last.iter().zip(&starts[2]).all(|(a, b)| (a - b).abs() < 1e-9));

    // Uniqueness is certified on both sides of the fold and fails at it.
    let load = map.load_derivative().unwrap();
    assert!(fold.certify(&map, &load, &options).unwrap().fails());
    for x in &starts {
        assert!(certify(&map, x, &load, &options).unwrap().is_certified());
    }
}

/// Hild–Renard model along a smooth path of load and friction: each point against the closed form at its own data.
#[test]
fn load_and_friction_together_along_a_smooth_path() {
    let data = |s: f64| (1.5 + 0.5 * s.sin(), -4.0 + s * s, 3.0 + (0.7 * s).cos());
    let rates = |s: f64| (0.5 * s.cos(), 2.0 * s, -0.7 * (0.7 * s).sin());
    let map = FullContact::planar(
        Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap(),
        Matrix::from_rows(&[[1.0, 0.0]]).unwrap(),
        Matrix::from_rows(&[[0.0, 1.0]]).unwrap(),
        LoadPath::function(move |s, f, df| {
            (f[0], f[1]) = (data(s).0, data(s).1);
            (df[0], df[1]) = (rates(s).0, rates(s).1);
        }),
        FrictionCoefficient::of_parameter(move |_, s| [data(s).2, rates(s).2]),
    )
    .unwrap();
    // |f_t| = F f_ν at the changes between stick and slip, by bisection.
    let excess = |s: f64| {
        let (normal, tangential, friction) = data(s);
        tangential.abs() - friction * normal
    };
    let root = |mut a: f64, mut b: f64| {
        for _ in 0..200 {
            let c = 0.5 * (a + b);
            if (excess(a) > 0.0) == (excess(c) > 0.0) {
                a = c;
            } else {
                b = c;
            }
        }
        a
    };
    let exit = root(2.0, 4.0);
    let x = map.solve_from_states(0.0, &[Stick]).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 4.0));
    let branch = Branch::follow(&map, &x, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert_eq!(branch.transitions.len(), 1);
    assert!((branch.transitions[0].parameter() - exit).abs() < 1e-11);
    for point in &branch.points {
        let s = point.parameter();
        let (normal, tangential, friction) = data(s);
        let model = HildRenard::new(normal, tangential, 1.0, 1.0).unwrap();
        let state = map.states(&point.selection)[0];
        let exact = model.solution(state, friction);
        let distance = point
            .x
            .iter()
            .zip(exact)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-10, "{distance:e} at {s}");
    }
}

/// Coefficients that vary from node to node: the branch of the two-node example along F = (α, β(α)) against independent solves at each
/// point.
#[test]
fn friction_that_differs_between_nodes() {
    let case = common::cases().into_iter().find(|c| c.name == "p2_ex1").unwrap();
    let problem = &case.problem;
    let map = FullContact::planar(
        problem.operator().clone(),
        Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]).unwrap(),
        Matrix::from_rows(&[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]).unwrap(),
        LoadPath::constant(problem.body().load_at(0.0)),
        FrictionCoefficient::of_parameter(|node, s| match node {
            0 => [s, 1.0],
            _ => [0.5 * s + 0.05 * s * s, 0.5 + 0.1 * s],
        }),
    )
    .unwrap();
    let x = map.solve_from_states(10.0, &[Stick, Stick]).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.5, 10.0));
    let branch = Branch::follow(&map, &x, Direction::Decreasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    // Stick ends where |λt| = F λν with λ = f: the first change by hand.
    let f = problem.body().load_at(0.0);
    let first = f[1].abs() / f[0];
    let second = (-0.5 + (0.25 + 0.2 * f[3].abs() / f[2]).sqrt()) / 0.1;
    let change = branch.transitions.first().unwrap();
    assert!((change.parameter() - first.max(second)).abs() < 1e-11);
    for point in &branch.points {
        let own = map.states(&point.selection);
        let x = map.solve_from_states(point.parameter(), &own).unwrap();
        let distance = point
            .x
            .iter()
            .zip(&x)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-9, "{distance:e} at {}", point.parameter());
    }
}

/// A path of friction given by a function is the affine path with the same values: residuals, Jacobians, test functions and curves of
/// the condensed problem, the last against the full one too.
#[test]
fn condensed_problems_with_friction_by_a_function() {
    let body = || {
        [
            Matrix::from_rows(&[
                [2.0, -1.0, -0.3, 0.0],
                [-1.0, 2.0, 0.0, 0.1],
                [-0.3, 0.0, 3.0, -1.0],
                [0.0, 0.1, -1.0, 2.5],
            ])
            .unwrap(),
            Matrix::from_triplets(2, 4, &[(0, 0, 1.0), (1, 2, 1.0)]).unwrap(),
            Matrix::from_triplets(2, 4, &[(0, 1, 1.0), (1, 3, 1.0)]).unwrap(),
        ]
    };
    let with = |friction: FrictionCoefficient| {
        let [a, bnu, bt] = body();
        let load = LoadPath::affine(vec![1.5, -2.0, 1.0, 0.5], vec![0.1, 1.0, 0.0, -0.4]);
        FullContact::planar(a, bnu, bt, load, friction).unwrap()
    };
    let (constant, slope) = ([0.8, 1.2], [0.3, -0.2]);
    let affine = with(FrictionCoefficient::affine(constant.to_vec(), slope.to_vec()).unwrap());
    let function = with(FrictionCoefficient::of_parameter(move |i, s| {
        [constant[i] + s * slope[i], slope[i]]
    }));
    let start = affine
        .solve(0.0, Some(&affine.stick_start(0.0).unwrap()))
        .unwrap();
    let n = start.len();
    let follow = |map: &dyn PiecewiseSmooth, x: &[f64]| {
        let options = ContinuationOptions::default()
            .with_parameter_range((-3.0, 3.0))
            .with_max_step(0.2);
        Branch::follow(map, x, Direction::Increasing, options).unwrap()
    };
    let full = follow(&affine, &start);
    assert!(!full.transitions.is_empty());
    let (affine, function) = (affine.condensed().unwrap(), function.condensed().unwrap());
    for k in 0..40 {
        let x: Vec<f64> = (0..5)
            .map(|j| (f64::from(7 * k + 3 * j) * 0.61).sin() * 2.0)
            .collect();
        let selection = select(&affine, &x);
        assert_eq!(selection, select(&function, &x));
        let image = |map: &CondensedContact<PlanarCoulomb>| {
            let (mut r, mut theta) = (vec![0.0; 4], vec![0.0; 2 * map.num_tests(0)]);
            map.residual(&selection, &x, &mut r);
            map.test_functions(&x, &mut theta);
            let mut jac = Matrix::zeros(map.pattern());
            map.jacobian(&selection, &x, &mut jac);
            [
                r,
                theta,
                (0..4)
                    .flat_map(|i| (0..5).map(move |j| (i, j)))
                    .map(|(i, j)| jac.get(i, j))
                    .collect(),
            ]
        };
        for (a, b) in image(&affine)
            .iter()
            .flatten()
            .zip(image(&function).iter().flatten())
        {
            assert!((a - b).abs() < 1e-14 * (1.0 + a.abs()), "{a} {b}");
        }
    }
    let alphas = |b: &Branch| b.transitions.iter().map(|t| t.parameter()).collect::<Vec<_>>();
    for map in [&affine, &function] {
        let curve = follow(map, &start[n - 5..]);
        let (found, expected) = (alphas(&curve), alphas(&full));
        assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
        assert!(
            found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9),
            "{found:?} {expected:?}"
        );
    }
}
