//! Operators with a law on few of their quantities: full form, condensed form and the contact module's own forms are the same problem.

use crate::random::Random;
use crate::support::laplacian;
use semismooth::InputError;
use semismooth::contact::{CondensedContact, FrictionCoefficient, FrictionCurve, FullContact, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::interface::{InterfaceProblem, LoadPath};
use semismooth::linear::{AutoSolver, LinearSolver};
use semismooth::newton::Newton;
use semismooth::piecewise::check::{CheckOptions, check};
use semismooth::piecewise::{
    Facet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, Structure, select,
};
use semismooth::sparse::Matrix;

/// Coulomb friction in the plane, implemented independently: v = (u_ν, u_t), λ = (λ_ν, λ_t), nodes in blocks; r = 1.
#[derive(Debug, Clone)]
struct Coulomb {
    friction: Vec<f64>,
}

impl Coulomb {
    fn node(&self, i: usize, z: &[f64]) -> [f64; 4] {
        let p = self.friction.len();
        [z[i], z[p + i], z[2 * p + i], z[3 * p + i]]
    }
}

impl PiecewiseSmooth for Coulomb {
    fn num_vars(&self) -> usize {
        4 * self.friction.len() + 1
    }
    fn num_residuals(&self) -> usize {
        2 * self.friction.len()
    }
    fn num_sites(&self) -> usize {
        self.friction.len()
    }
    fn num_pieces(&self, _site: usize) -> usize {
        4
    }
    fn num_tests(&self, _site: usize) -> usize {
        3
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        const CELLS: [&[Facet]; 4] = [
            &[Facet::negative(0)],
            &[Facet::positive(0), Facet::negative(1), Facet::positive(2)],
            &[Facet::positive(0), Facet::positive(1)],
            &[Facet::positive(0), Facet::negative(2)],
        ];
        CELLS[piece]
    }
    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        for (i, f) in self.friction.iter().enumerate() {
            let [un, ut, ln, lt] = self.node(i, z);
            let g = f * (ln + un);
            out[3 * i..3 * i + 3].copy_from_slice(&[ln + un, lt + ut - g, lt + ut + g]);
        }
    }
    fn residual(&self, s: &Selection, z: &[f64], out: &mut [f64]) {
        let p = self.friction.len();
        for (i, f) in self.friction.iter().enumerate() {
            let [un, ut, ln, lt] = self.node(i, z);
            let g = f * (ln + un);
            (out[i], out[p + i]) = match s.piece(i) {
                0 => (ln, lt),
                1 => (-un, -ut),
                2 => (-un, lt - g),
                _ => (-un, lt + g),
            };
        }
    }
    fn jacobian(&self, s: &Selection, _z: &[f64], jac: &mut Matrix) {
        let p = self.friction.len();
        for (i, &f) in self.friction.iter().enumerate() {
            if s.piece(i) == 0 {
                jac.add(i, 2 * p + i, 1.0);
                jac.add(p + i, 3 * p + i, 1.0);
                continue;
            }
            jac.add(i, i, -1.0);
            if s.piece(i) == 1 {
                jac.add(p + i, p + i, -1.0);
                continue;
            }
            let f = if s.piece(i) == 2 { f } else { -f };
            jac.add(p + i, 3 * p + i, 1.0);
            jac.add(p + i, i, -f);
            jac.add(p + i, 2 * p + i, -f);
        }
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Structure for Coulomb {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.extend([site, self.friction.len() + site]);
    }
}

struct Parts {
    a: Matrix,
    bnu: Matrix,
    bt: Matrix,
    b: Matrix,
    load: [Vec<f64>; 2],
    friction: Vec<f64>,
}

/// A membrane-like operator of order m², p contact nodes with traces of two or three unknowns each.
fn parts(m: usize, p: usize, seed: u64) -> Parts {
    let mut rng = Random::new(seed);
    let a = laplacian(m, false);
    let n = a.nrows();
    let (mut normal, mut tangential) = (Vec::new(), Vec::new());
    for i in 0..p {
        let k = i * (n / p);
        normal.extend([(i, k, 1.0), (i, k + 2, 0.25 * rng.symmetric())]);
        tangential.extend([(i, k + 1, 1.0), (i, k, 0.3), (i, k + 2, 0.5 * rng.symmetric())]);
    }
    let both: Vec<_> = normal
        .iter()
        .copied()
        .chain(tangential.iter().map(|&(i, j, v)| (p + i, j, v)))
        .collect();
    let load = [
        rng.vector(n, 1.0),
        rng.vector(n, 1.0).iter().map(|v| 4.0 * v).collect(),
    ];
    Parts {
        bnu: Matrix::from_triplets(p, n, &normal).unwrap(),
        bt: Matrix::from_triplets(p, n, &tangential).unwrap(),
        b: Matrix::from_triplets(2 * p, n, &both).unwrap(),
        load,
        friction: (0..p).map(|_| 0.6 + 0.5 * rng.symmetric()).collect(),
        a,
    }
}

impl Parts {
    fn interface(&self) -> InterfaceProblem<Coulomb> {
        let [f0, f1] = self.load.clone();
        self.with_load(LoadPath::affine(f0, f1))
    }

    fn with_load(&self, load: LoadPath) -> InterfaceProblem<Coulomb> {
        let law = Coulomb {
            friction: self.friction.clone(),
        };
        InterfaceProblem::from_parts(self.a.clone(), &self.b.clone(), load, law).unwrap()
    }

    fn contact(&self, load: LoadPath) -> FullContact<PlanarCoulomb> {
        let friction = FrictionCoefficient::nodal(self.friction.clone()).unwrap();
        FullContact::planar(self.a.clone(), self.bnu.clone(), self.bt.clone(), load, friction).unwrap()
    }
}

fn close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let size = b.iter().fold(1.0f64, |m, v| m.max(v.abs()));
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= tolerance * size, "{a} and {b}");
    }
}

fn options() -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range((0.0, 3.0))
}

/// The first solution that complete enumeration finds at α = 0, in condensed form.
fn start(map: &CondensedContact<PlanarCoulomb>) -> Vec<f64> {
    map.solve(0.0, None).unwrap()
}

#[test]
fn full_condensed_and_contact_agree_along_affine_paths() {
    let mut met = 0;
    for seed in 1..=12 {
        let parts = parts(6, 1 + seed as usize % 4, seed);
        let full = parts.interface();
        let condensed = parts.interface().condensed().unwrap();
        let [f0, f1] = parts.load.clone();
        let contact = parts.contact(LoadPath::affine(f0, f1)).condensed().unwrap();
        let x = start(&contact);
        let follow = |map: &dyn PiecewiseSmooth, x: &[f64]| {
            Branch::follow(map, x, Direction::Increasing, options()).unwrap()
        };
        let reference = follow(&contact, &x);
        let ours = follow(&condensed, &x);
        let whole = follow(&full, &condensed.expand(&x).unwrap());
        assert_eq!(ours.transitions.len(), reference.transitions.len());
        assert_eq!(whole.transitions.len(), reference.transitions.len());
        for ((t, r), w) in ours
            .transitions
            .iter()
            .zip(&reference.transitions)
            .zip(&whole.transitions)
        {
            close(&t.x, &r.x, 1e-10);
            close(&condensed.expand(&t.x).unwrap(), &w.x, 1e-10);
            assert_eq!((t.kind, &t.sites), (r.kind, &r.sites));
            assert_eq!((t.kind, &t.sites), (w.kind, &w.sites));
            // Tangents of the two forms are parallel, and point the same way.
            let mut tangent = condensed.expand_tangent(&t.x, &t.tangent_after).unwrap();
            let length = tangent.iter().map(|v| v * v).sum::<f64>().sqrt();
            tangent.iter_mut().for_each(|v| *v /= length);
            close(&tangent, &w.tangent_after, 1e-9);
            let residual = condensed.full_residual(&t.after, &t.x).unwrap();
            assert!(residual.iter().all(|r| r.abs() < 1e-10));
            met += 1;
        }
    }
    assert!(met > 20, "the problems met {met} transitions only");
}

#[test]
fn determinants_of_both_forms_differ_by_that_of_the_operator() {
    let parts = parts(5, 3, 77);
    let full = parts.interface();
    let condensed = parts.interface().condensed().unwrap();
    let det = |map: &dyn PiecewiseSmooth, selection: &Selection, x: &[f64]| {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(selection, x, &mut jac);
        let square = jac.leading_columns(map.num_residuals());
        // Dense elimination, whatever the pattern: its determinant is always known.
        let mut dense = Matrix::zeros(semismooth::sparse::Pattern::full(
            map.num_residuals(),
            map.num_residuals(),
        ));
        for (i, j, v) in jac.triplets().filter(|t| t.1 < map.num_residuals()) {
            dense.add(i, j, v);
        }
        assert_eq!(square.pattern.ncols, dense.ncols());
        let mut solver = AutoSolver::default();
        solver.analyze(dense.as_ref().pattern).unwrap();
        solver.factor(dense.as_ref()).unwrap();
        solver.log_det().unwrap()
    };
    for code in 0..64 {
        let selection = Selection::from_pieces([code % 4, code / 4 % 4, code / 16]);
        let x = vec![0.3; 7];
        let (s, l) = det(&condensed, &selection, &x);
        let (full_s, full_l) = det(&full, &selection, &condensed.expand(&x).unwrap());
        assert_eq!(s, full_s);
        assert!((full_l - l - condensed.log_det_operator()).abs() < 1e-9);
    }
}

#[test]
fn loads_with_curved_amplitudes_agree_with_the_full_form() {
    let parts = parts(5, 2, 5);
    let [f0, f1] = parts.load.clone();
    let bent = |alpha: f64, value: &mut [f64], rate: &mut [f64]| {
        value.copy_from_slice(&[alpha.sin(), 0.1 * alpha * alpha]);
        rate.copy_from_slice(&[alpha.cos(), 0.2 * alpha]);
    };
    let load = || LoadPath::cases(f0.clone(), vec![f1.clone(), vec![1.0; 25]], bent);
    let full = parts.with_load(load());
    let condensed = parts.with_load(load()).condensed().unwrap();
    assert!(!condensed.is_piecewise_affine());
    let (c0, c1) = (f0.clone(), f1.clone());
    let same = LoadPath::function(move |alpha, value, rate| {
        for i in 0..25 {
            value[i] = c0[i] + alpha.sin() * c1[i] + 0.1 * alpha * alpha;
            rate[i] = alpha.cos() * c1[i] + 0.2 * alpha;
        }
    });
    let contact = parts.contact(same);
    let x = contact.solve(0.0, None).unwrap();
    let reference = Branch::follow(&contact, &x, Direction::Increasing, options()).unwrap();
    let whole = Branch::follow(&full, &x, Direction::Increasing, options()).unwrap();
    let start = condensed.restrict(&x).unwrap();
    let ours = Branch::follow(&condensed, &start, Direction::Increasing, options()).unwrap();
    // A general path is condensed, too: by a solve at each α.
    let general = contact.condensed().unwrap();
    let solved = Branch::follow(&general, &start, Direction::Increasing, options()).unwrap();
    assert_eq!(solved.transitions.len(), reference.transitions.len());
    for (t, r) in solved.transitions.iter().zip(&reference.transitions) {
        close(&general.expand(&t.x).unwrap(), &r.x, 1e-10);
    }
    let along: Vec<f64> = (0..start.len()).map(|k| (k as f64).cos()).collect();
    close(
        &general.expand_tangent(&start, &along).unwrap(),
        &condensed.expand_tangent(&start, &along).unwrap(),
        1e-10,
    );
    assert!(
        reference.transitions.len() >= 2,
        "{}",
        reference.transitions.len()
    );
    assert_eq!(ours.transitions.len(), reference.transitions.len());
    for ((t, w), r) in ours
        .transitions
        .iter()
        .zip(&whole.transitions)
        .zip(&reference.transitions)
    {
        close(&condensed.expand(&t.x).unwrap(), &r.x, 1e-10);
        close(&w.x, &r.x, 1e-10);
        assert_eq!(t.kind, r.kind);
    }
}

#[test]
fn newton_and_enumeration_work_on_the_condensed_form() {
    let parts = parts(5, 3, 9);
    let condensed = parts.interface().condensed().unwrap();
    let mut x = vec![0.0; 7];
    x[6] = 1.0;
    let set = all_solutions(&condensed, 1.0, &EnumerationOptions::default()).unwrap();
    let [f0, f1] = parts.load.clone();
    let contact = parts.contact(LoadPath::affine(f0, f1)).condensed().unwrap();
    let reference = all_solutions(&contact, 1.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(set.solutions.len(), reference.solutions.len());
    Newton::default().solve(&condensed, &mut x).unwrap();
    let found = set.solutions.iter().any(|s| {
        let apart = s.x.iter().zip(&x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        apart < 1e-10
    });
    assert!(found, "Newton's solution is on the list");
}

#[test]
fn maps_keep_the_contract() {
    let parts = parts(3, 2, 3);
    let full = parts.interface();
    let condensed = parts.interface().condensed().unwrap();
    let mut rng = Random::new(4);
    let points: Vec<Vec<f64>> = (0..12)
        .map(|_| rng.vector(5, 1.0).iter().map(|v| 2.0 * v).collect())
        .collect();
    let report = check(&condensed, &points, &CheckOptions::default()).unwrap();
    assert!(report.boundaries > 0);
    let points: Vec<Vec<f64>> = (0..12)
        .map(|_| rng.vector(14, 1.0).iter().map(|v| 2.0 * v).collect())
        .collect();
    check(&full, &points, &CheckOptions::default()).unwrap();
    let sample = &points[0];
    assert_eq!(select(&full, sample).len(), 2);
}

#[test]
fn bad_parts_are_named() {
    let good = parts(3, 1, 1);
    let law = Coulomb { friction: vec![0.5] };
    let load = || LoadPath::constant(vec![1.0; 9]);
    let narrow = Matrix::from_rows(&[[1.0, 0.0]]).unwrap();
    let e = InterfaceProblem::from_parts(good.a.clone(), &narrow, load(), law.clone()).unwrap_err();
    assert!(e.to_string().contains("columns of B"), "{e}");
    let e = InterfaceProblem::from_parts(good.a.clone(), &good.bnu.clone(), load(), law.clone()).unwrap_err();
    assert!(
        e.to_string().contains("variables of the law must be 3, found 5"),
        "{e}"
    );
    let short = LoadPath::constant(vec![1.0; 8]);
    let e = InterfaceProblem::from_parts(good.a.clone(), &good.b.clone(), short, law.clone()).unwrap_err();
    assert!(e.to_string().contains("load"), "{e}");
    let wild = LoadPath::affine(vec![0.0; 9], vec![f64::NAN; 9]);
    let e = InterfaceProblem::from_parts(good.a.clone(), &good.b.clone(), wild, law.clone()).unwrap_err();
    assert!(
        matches!(e, PiecewiseError::Input(InputError::NotFinite { index: 0, .. })),
        "{e}"
    );
    let mut skew = good.a.clone();
    skew.add(0, 1, 0.5);
    let problem = InterfaceProblem::from_parts(skew, &good.b.clone(), load(), law.clone()).unwrap();
    let e = problem.condensed().unwrap_err();
    assert!(
        matches!(e, PiecewiseError::Input(InputError::NotSymmetric { .. })),
        "{e}"
    );
    let floating = InterfaceProblem::from_parts(laplacian(3, true), &good.b.clone(), load(), law).unwrap();
    let e = floating.condensed().unwrap_err();
    assert!(e.to_string().contains("positive definite"), "{e}");
}

/// Clones and threads: the workspace shared by evaluations has no visible effect.
#[test]
fn many_threads_on_one_problem() {
    let problem = parts(9, 3, 5).interface();
    let condensed = problem.condensed().unwrap();
    fn image<P: PiecewiseSmooth>(map: &P, seed: u64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let x = Random::new(seed).vector(map.num_vars(), 1.0);
        let selection = select(map, &x);
        let mut r = vec![0.0; map.num_residuals()];
        map.residual(&selection, &x, &mut r);
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, &x, &mut jac);
        let tests = (0..map.num_sites()).map(|s| map.num_tests(s)).sum();
        let mut theta = vec![0.0; tests];
        map.test_functions(&x, &mut theta);
        (r, jac.values().to_vec(), theta)
    }
    let seeds = 1..200_u64;
    let alone: Vec<_> = seeds
        .clone()
        .map(|s| (image(&problem, s), image(&condensed, s)))
        .collect();
    let copies = (problem.clone(), condensed.clone());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for (seed, known) in seeds.clone().zip(&alone) {
                    assert_eq!((image(&problem, seed), image(&condensed, seed)), *known);
                }
            });
        }
    });
    for (seed, known) in seeds.zip(&alone) {
        assert_eq!((image(&copies.0, seed), image(&copies.1, seed)), *known);
    }
}

/// Residuals, tangents and derivatives at one point leave no trace in those at another one: for friction that depends on the slip under load
/// cases with curved amplitudes, and for an affine law under a general path.
#[test]
fn derivatives_belong_to_the_point_given() {
    let parts = parts(5, 2, 5);
    let [f0, f1] = parts.load.clone();
    let weakening = FrictionCurve::exponential(0.8, 0.2, 0.1).unwrap();
    let weakening = FrictionCoefficient::uniform(weakening);
    let bent = |alpha: f64, value: &mut [f64], rate: &mut [f64]| {
        (value[0], rate[0]) = (alpha.sin(), alpha.cos());
    };
    let cases = LoadPath::cases(f0.clone(), [f1.clone()], bent);
    let path = LoadPath::function(move |alpha, value, rate| {
        for i in 0..25 {
            value[i] = f0[i] + alpha.sin() * f1[i];
            rate[i] = alpha.cos() * f1[i];
        }
    });
    let selection = Selection::from_pieces([2, 3]);
    let derivatives = |map: &dyn PiecewiseSmooth, x: &[f64]| {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, x, &mut jac);
        let mut rates = vec![0.0; (0..2).map(|site| map.num_tests(site)).sum()];
        map.test_derivatives(x, &vec![0.3; x.len()], &mut rates);
        (jac.values().to_vec(), rates)
    };
    for (load, friction) in [
        (cases, weakening),
        (path, FrictionCoefficient::constant(0.4).unwrap()),
    ] {
        let full = || {
            let (a, bnu, bt) = (parts.a.clone(), parts.bnu.clone(), parts.bt.clone());
            FullContact::planar(a, bnu, bt, load.clone(), friction.clone()).unwrap()
        };
        let condensed = full().condensed().unwrap();
        let at = |alpha: f64| vec![-1.5, -0.8, 0.4, -0.3, alpha];
        let evaluate = |map: &dyn PiecewiseSmooth, x: &[f64]| {
            map.residual(&selection, x, &mut vec![0.0; map.num_residuals()]);
        };
        let (here, there) = (at(0.2), at(1.4));
        let fresh = full().condensed().unwrap();
        evaluate(&fresh, &here);
        let expected = derivatives(&fresh, &here);
        evaluate(&condensed, &there);
        assert_eq!(derivatives(&condensed, &here), expected);
        evaluate(&condensed, &here);
        condensed
            .expand_tangent(&there, &[0.0, 0.0, 0.0, 0.0, 1.0])
            .unwrap();
        assert_eq!(derivatives(&condensed, &here), expected);
        let (map, fresh) = (full(), full());
        let [here, there] = [here, there].map(|x| condensed.expand(&x).unwrap());
        evaluate(&fresh, &here);
        evaluate(&map, &there);
        assert_eq!(derivatives(&map, &here), derivatives(&fresh, &here));
    }
}

/// A line of loads has the same typical sizes as load cases and as a general path; α is large where it changes the load little.
#[test]
fn sizes_do_not_depend_on_how_a_load_is_given() {
    let parts = parts(3, 2, 1);
    let (f0, f1) = (vec![f64::exp2(40.0); 9], vec![1.0; 9]);
    let cases = LoadPath::affine(f0.clone(), f1.clone());
    let path = LoadPath::function(move |alpha, value, rate| {
        for i in 0..9 {
            value[i] = f0[i] + alpha * f1[i];
            rate[i] = f1[i];
        }
    });
    let [first, second] = [cases, path].map(|load| {
        let map = parts.with_load(load);
        let mut sizes = vec![1.0; map.num_vars()];
        map.typical_sizes(&mut sizes);
        sizes
    });
    assert_eq!(first, second);
    assert_eq!(first.last(), Some(&f64::exp2(40.0)));
    // Without cases there is nothing that amplitudes could bend.
    let none: [Vec<f64>; 0] = [];
    let constant = LoadPath::cases(vec![1.0; 9], none, |_, _, _| {});
    assert!(parts.with_load(constant).is_piecewise_affine());
}

/// Gradients of test functions and their derivatives along the unit vectors, two parameters of the load included.
#[test]
fn gradients_of_tests_are_their_derivatives() {
    let parts = parts(5, 2, 5);
    let [f0, f1] = parts.load.clone();
    let problem = parts.contact(LoadPath::affine(f0, f1));
    let law = PlanarCoulomb::new(FrictionCoefficient::nodal(parts.friction.clone()).unwrap());
    let second = Random::new(6).vector(25, 1.0);
    let full = problem.with_second_parameter(second, law).unwrap();
    let condensed = full.condensed().unwrap();
    for map in [&full as &dyn PiecewiseSmooth, &condensed] {
        let m = map.num_vars();
        let x = Random::new(7).vector(m, 1.0);
        let tests = map.num_tests(0);
        let (mut rates, mut gradient) = (vec![0.0; 2 * tests], vec![0.0; m]);
        for j in 0..m {
            let mut unit = vec![0.0; m];
            unit[j] = 1.0;
            map.test_derivatives(&x, &unit, &mut rates);
            for (k, rate) in rates.iter().enumerate() {
                map.test_gradient(k / tests, k % tests, &x, &mut gradient);
                assert!(
                    (gradient[j] - rate).abs() < 1e-7,
                    "{k}, {j}: {} {rate}",
                    gradient[j]
                );
            }
        }
    }
}

/// With so many multipliers that only one triangle of C is read: traces are those of the displacements, and derivatives agree with
/// differences.
#[test]
fn large_condensed_forms_are_the_full_one() {
    let parts = parts(26, 201, 5);
    let full = parts.interface();
    let map = parts.interface().condensed().unwrap();
    let (q, mut rng) = (map.num_traces(), Random::new(9));
    let (x, d) = (rng.vector(q + 1, 1.0), rng.vector(q + 1, 1.0));
    let beside: Vec<f64> = x.iter().zip(&d).map(|(x, d)| x + d).collect();
    let expanded = map.expand(&x).unwrap();
    close(&map.traces(&x).unwrap(), &full.traces(&expanded).unwrap(), 1e-11);
    let selection = Selection::from_pieces((0..201).map(|i| i % 4).collect::<Vec<_>>());
    let values = |x: &[f64]| {
        let mut out = vec![0.0; q + 603];
        let (residual, tests) = out.split_at_mut(q);
        map.residual(&selection, x, residual);
        map.test_functions(x, tests);
        out
    };
    let change: Vec<f64> = values(&beside)
        .iter()
        .zip(&values(&x))
        .map(|(b, a)| b - a)
        .collect();
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(&selection, &x, &mut jac);
    let mut rates = vec![0.0; q + 603];
    jac.as_ref().mul_add(1.0, &d, &mut rates[..q]);
    map.test_derivatives(&x, &d, &mut rates[q..]);
    close(&rates[..q], &change[..q], 1e-11);
    // The derivatives of this law are differences.
    close(&rates[q..], &change[q..], 1e-7);
}
