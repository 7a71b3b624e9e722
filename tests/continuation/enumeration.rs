//! Complete lists of solutions and arms, against exact arithmetic and brute force.

use crate::common;
use crate::common::{cases, numbers};
use crate::maps::{hand_on, same_cells, two_pieces};
use crate::random::Random;
use proptest::prelude::*;
use semismooth::complementarity::Lcp;
use semismooth::contact::{
    CondensedContact, Contact, ContactState, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb,
    read_folder,
};
use semismooth::continuation::{ContinuationOptions, arms_at};
use semismooth::enumeration::{
    Completeness, Doubt, EnumerationError, EnumerationOptions, SolutionSet, all_arms, all_solutions,
};
use semismooth::interface::View;
use semismooth::linear::{DenseLu, LinearSolver};
use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection, Selections};
use semismooth::sparse::Matrix;

fn letters<V: View>(map: &Contact<V, PlanarCoulomb>, set: &SolutionSet) -> Vec<Vec<String>> {
    let name = |s: &_| map.states(s).iter().map(|c: &ContactState| c.letter()).collect();
    set.solutions
        .iter()
        .map(|s| s.selections.iter().map(name).collect())
        .collect()
}

fn compare<V: View>(map: &Contact<V, PlanarCoulomb>, case: &common::Case) {
    let alphas = numbers(&case.json["alphas"]);
    let exact = case.json["alphas_exact"].as_array().unwrap();
    for ((&alpha, exact), list) in alphas
        .iter()
        .zip(exact)
        .zip(case.json["solutions"].as_array().unwrap())
    {
        let denominator = exact.as_str().unwrap().split('/').nth(1);
        let representable = denominator.is_none_or(|d| d.parse::<u64>().is_ok_and(u64::is_power_of_two));
        let set = all_solutions(map, alpha, &EnumerationOptions::default()).unwrap();
        let list = list.as_array().unwrap();
        let context = format!("{} at {alpha}: {:?}", case.name, letters(map, &set));
        assert_eq!(set.completeness, Completeness::Complete, "{context}");
        if !representable {
            // The floating-point number nearest to a transition at 14/3 lies beside it: fewer selections meet there, and a fold has two
            // solutions or none.
            let stored = |s: &String| {
                list.iter()
                    .any(|l| l["all_states"].as_array().unwrap().iter().any(|w| w == s))
            };
            assert!(letters(map, &set).iter().flatten().all(stored), "{context}");
            assert_eq!(set.index_sum, Some(1), "{context}");
            continue;
        }
        assert_eq!(set.solutions.len(), list.len(), "{context}");
        assert!(set.continua.is_empty(), "{context}");
        let friction = case.problem.friction_at(alpha);
        for stored in list {
            // Where F < 0 the map has no contact piece; the stored list admits it as long as λν = 0.
            let admitted = |s: &String| s.chars().zip(&friction).all(|(c, f)| c == 'O' || *f >= 0.0);
            let mut wanted: Vec<String> = (stored["all_states"].as_array().unwrap().iter())
                .map(|s| s.as_str().unwrap().to_owned())
                .filter(admitted)
                .collect();
            wanted.sort();
            let position = letters(map, &set)
                .into_iter()
                .position(|mut mine| {
                    mine.sort();
                    mine == wanted
                })
                .unwrap_or_else(|| panic!("{context}: {wanted:?} is missing"));
            let solution = &set.solutions[position];
            let mut exact = numbers(&stored["lam_nu"]);
            exact.extend(numbers(&stored["lam_t"]));
            let p = exact.len() / 2;
            let start = map.num_residuals() - 2 * p;
            let u = map.displacements(&solution.x).unwrap();
            let mine = solution.x[start..start + 2 * p].iter().chain(&u);
            for (a, b) in mine.zip(exact.iter().chain(&numbers(&stored["u"]))) {
                assert!((a - b).abs() <= 1e-10 * (1.0 + b.abs()), "{context}");
            }
            let sign = stored["det_sign"].as_i64().unwrap();
            assert_eq!(solution.det_signs[0].map(i64::from), Some(sign), "{context}");
        }
        if friction.iter().all(|f| *f >= 0.0) {
            assert_eq!(set.index_sum, Some(1), "{context}");
        }
    }
}

#[test]
fn lists_of_the_printed_examples_are_complete() {
    for case in cases() {
        compare(&case.problem, &case);
        compare(&case.problem.condensed().unwrap(), &case);
    }
}

fn friction(p: usize, extra: usize, rng: &mut Random) -> FullContact<PlanarCoulomb> {
    let n = 2 * p + extra;
    let g = rng.vector(n * n, 1.0);
    let mut a = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..n {
            a[i][j] = (0..n).map(|k| g[i * n + k] * g[j * n + k]).sum::<f64>() / n as f64;
        }
        a[i][i] += 0.2;
    }
    let pick = |offset: usize| {
        let row = |i: usize| -> Vec<f64> { (0..n).map(|j| f64::from(j == 2 * i + offset)).collect() };
        Matrix::from_rows(&(0..p).map(row).collect::<Vec<_>>()).unwrap()
    };
    let load: Vec<f64> = rng.vector(n, 1.0).into_iter().map(|v| 3.0 * v).collect();
    let friction = rng.vector(p, 1.0).into_iter().map(|v| 1.5 * (1.0 + v)).collect();
    FullContact::planar(
        Matrix::from_rows(&a).unwrap(),
        pick(0),
        pick(1),
        LoadPath::constant(load),
        FrictionCoefficient::nodal(friction).unwrap(),
    )
    .unwrap()
}

/// All solutions by trying every selection.
fn brute_force<P: PiecewiseSmooth>(map: &P) -> Vec<Vec<f64>> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    let origin = vec![0.0; m];
    let mut found = Vec::new();
    for selection in Selections::all(map) {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, &origin, &mut jac);
        let mut lu = DenseLu::new();
        lu.analyze(jac.leading_columns(n).pattern).unwrap();
        let mut r = vec![0.0; n];
        map.residual(&selection, &origin, &mut r);
        if lu.factor(jac.leading_columns(n)).is_err() || lu.solve_in_place(&mut r).is_err() {
            continue;
        }
        let mut x = origin.clone();
        for (x, r) in x.iter_mut().zip(&r) {
            *x = -r;
        }
        let tests: usize = (0..map.num_sites()).map(|s| map.num_tests(s)).sum();
        let mut theta = vec![0.0; tests];
        map.test_functions(&x, &mut theta);
        let mut first = 0;
        let inside = (0..map.num_sites()).all(|site| {
            let range = first..first + map.num_tests(site);
            first = range.end;
            let cell = map.cell(site, selection.piece(site));
            cell.iter().all(|f| f.margin(&theta[range.clone()]) >= 0.0)
        });
        if inside {
            found.push(x);
        }
    }
    found
}

fn same_lists(set: &SolutionSet, brute: &[Vec<f64>], tolerance: f64) -> Result<(), TestCaseError> {
    prop_assert!(!set.completeness.has_gaps());
    prop_assert_eq!(set.solutions.len(), brute.len());
    for x in brute {
        let near = |y: &[f64]| {
            x.iter()
                .zip(y)
                .all(|(a, b)| (a - b).abs() <= tolerance * (1.0 + b.abs()))
        };
        prop_assert!(set.solutions.iter().any(|s| near(&s.x)));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn friction_against_brute_force(p in 1usize..=4, extra in 0usize..3, seed in 1u64..u64::MAX) {
        let problem = friction(p, extra, &mut Random::new(seed));
        let condensed = problem.condensed().unwrap();
        let brute = brute_force(&condensed);
        let options = EnumerationOptions::default();
        let set = all_solutions(&condensed, 0.0, &options).unwrap();
        same_lists(&set, &brute, 1e-10)?;
        prop_assert_eq!((set.completeness, set.index_sum), (Completeness::Complete, Some(1)));
        let full = all_solutions(&problem, 0.0, &options).unwrap();
        prop_assert_eq!(full.solutions.len(), brute.len());
        prop_assert_eq!((full.completeness, full.index_sum), (Completeness::Complete, Some(1)));
    }

    #[test]
    fn complementarity_against_brute_force(n in 1usize..=7, seed in 1u64..u64::MAX) {
        let mut rng = Random::new(seed);
        let (m, q) = (rng.vector(n * n, 1.0), rng.vector(n, 1.0));
        let map = MinMap::new(n, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a.copy_from_slice(x);
            for i in 0..n {
                b[i] = q[i] + (0..n).map(|j| m[i * n + j] * x[j]).sum::<f64>();
            }
        });
        let brute = brute_force(&map);
        let options = EnumerationOptions::default();
        let rows: Vec<&[f64]> = m.chunks(n).collect();
        let lcp = Lcp::new(Matrix::from_rows(&rows).unwrap(), q.clone()).unwrap();
        let set = all_solutions(lcp.mcp(), 0.0, &options).unwrap();
        prop_assert_eq!(set.completeness, Completeness::Complete);
        same_lists(&set, &brute, 1e-7)?;
        // The same map without its coefficients: the same list, not proven.
        let unproven = all_solutions(&map, 0.0, &options).unwrap();
        prop_assert!(!unproven.completeness.is_complete() && unproven.index_sum.is_none());
        same_lists(&unproven, &brute, 1e-7)?;
    }
}

/// The model with two nodes, F = (α, α), of which at most two branches have been observed: five solutions at one α, found by sampling
/// loads near those with three.
#[test]
fn five_solutions_with_two_nodes() {
    let (lambda, mu) = (0.033_207_348_086_647_76, 1.0);
    let (a, b, c, d) = (
        0.5 * mu,
        0.5 * lambda,
        0.5 * (lambda + 2.0 * mu),
        lambda + 3.0 * mu,
    );
    let stiffness = Matrix::from_rows(&[
        [a, 0.0, -a, -a],
        [0.0, c, -b, -c],
        [-a, -b, d, 0.0],
        [-a, -c, 0.0, d],
    ]);
    let normal = Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    let tangential = Matrix::from_rows(&[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);
    let load = LoadPath::constant(vec![
        0.116_716_292_134_593_13,
        -0.939_125_465_557_446_5,
        0.025_673_130_455_481_75,
        0.322_120_408_332_781_05,
    ]);
    let friction = FrictionCoefficient::nodal(vec![6.431_985; 2]).unwrap();
    let (stiffness, normal, tangential) = (stiffness.unwrap(), normal.unwrap(), tangential.unwrap());
    let problem = FullContact::planar(stiffness, normal, tangential, load, friction).unwrap();
    let map = problem.condensed().unwrap();
    let set = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(set.completeness, Completeness::Complete);
    assert_eq!((set.solutions.len(), set.index_sum), (5, Some(1)));
    assert_eq!(brute_force(&map).len(), 5);
}

#[test]
fn many_nodes() {
    let options = EnumerationOptions::default();
    for seed in [3, 11, 19] {
        let map = friction(8, 2, &mut Random::new(seed)).condensed().unwrap();
        let set = all_solutions(&map, 0.0, &options).unwrap();
        assert_eq!(set.completeness, Completeness::Complete);
        assert_eq!(set.index_sum, Some(1));
        println!(
            "p = 8: {} solutions, {} nodes, {} pivots",
            set.solutions.len(),
            set.nodes,
            set.pivots
        );
    }
    let map = friction(12, 0, &mut Random::new(5)).condensed().unwrap();
    let set = all_solutions(&map, 0.0, &options).unwrap();
    println!(
        "p = 12: {} solutions, {} nodes, {:?}",
        set.solutions.len(),
        set.nodes,
        set.completeness
    );
    assert!(!set.completeness.is_complete() || set.index_sum == Some(1));
}

#[test]
fn a_list_cut_off_by_the_limit_says_so() {
    let map = friction(8, 0, &mut Random::new(3)).condensed().unwrap();
    let set = all_solutions(&map, 0.0, &EnumerationOptions::default().with_max_nodes(6)).unwrap();
    let Completeness::Incomplete { examined, total } = set.completeness else {
        panic!("{:?}", set.completeness);
    };
    assert_eq!(total, 65536.0);
    assert!(examined < total);
    // The number of examined selections does not decrease as more nodes are allowed, up to all of them.
    let mut before = 0.0;
    for nodes in [1, 2, 4, 8, 16, 32, 64, 128] {
        let options = EnumerationOptions::default().with_max_nodes(nodes);
        let set = all_solutions(&map, 0.0, &options).unwrap();
        let Completeness::Incomplete { examined, total } = set.completeness else {
            break;
        };
        assert!(
            (before..=total).contains(&examined),
            "{nodes}: {before} {examined} {total}"
        );
        before = examined;
    }
}

/// A piece with constant derivatives but different constants is not affine.
#[test]
fn pieces_with_steps_are_refused() {
    let map = |height: f64| {
        MinMap::new(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            let step = if (0.1..0.4).contains(&x[0]) { height } else { 0.0 };
            a[0] = x[0] - 5.0 + step;
            b[0] = x[0] + 3.0;
        })
    };
    let set = all_solutions(&map(0.0), 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(set.solutions.len(), 1);
    for height in [1e-3, 1.0, 50.0] {
        let refused = all_solutions(&map(height), 0.0, &EnumerationOptions::default());
        assert!(
            matches!(refused, Err(EnumerationError::NotAffine { .. })),
            "{refused:?}"
        );
    }
}

#[test]
fn curved_pieces_are_refused() {
    let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] - 1.0;
        b[0] = x[0] + 3.0;
    });
    let refused = all_solutions(&map, 0.0, &EnumerationOptions::default());
    assert!(
        matches!(refused, Err(EnumerationError::NotAffine { .. })),
        "{refused:?}"
    );
}

/// The unloaded body: u = 0, λ = 0, and all contact nodes graze.
#[cfg(feature = "json")]
#[test]
fn six_arms_where_eleven_nodes_graze() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/block_symmetric");
    let map = read_folder(folder).unwrap().condensed().unwrap();
    let mut x = vec![0.0; map.num_vars()];
    x[map.num_vars() - 1] = 0.5;
    let found = all_arms(&map, &x, &EnumerationOptions::default()).unwrap();
    println!("{} nodes", found.nodes);
    assert_eq!(found.completeness, Completeness::Complete);
    let growing = found.arms.iter().filter(|a| a.rate() > 1e-9).count();
    assert_eq!((growing, found.arms.len()), (3, 6));
    let (plus, minus) = found.orientation.unwrap();
    assert_eq!(plus, minus);
    let list = arms_at(&map, &x, &ContinuationOptions::default()).unwrap();
    let (arms, complete) = (list.arms, !list.certainty.is_undecided());
    assert!(complete);
    assert_eq!(arms.len(), 6);
}

/// At F = α = 2 a slipping solution becomes a vertical segment between the open and the sticking one.
#[test]
fn branching_with_a_vertical_segment() {
    let case = cases().into_iter().find(|c| c.name == "p1_ex3").unwrap();
    let map = case.problem.condensed().unwrap();
    let set = all_solutions(&map, 2.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(set.completeness, Completeness::Complete);
    assert_eq!(set.continua.len(), 1);
    let segment = &set.continua[0];
    assert_eq!((segment.dimension, segment.ends.len()), (1, 2));
    let vertex = |kind: &str| {
        let found = case.json["graph"]["vertices"].as_array().unwrap().iter();
        found
            .filter(|v| v["kind"] == kind && v["alpha"] == 2.0)
            .collect::<Vec<_>>()
    };
    let branching = vertex("branching")[0];
    let point = [
        numbers(&branching["lam_nu"])[0],
        numbers(&branching["lam_t"])[0],
        2.0,
    ];
    let near = |e: &Vec<f64>| e.iter().zip(&point).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(segment.ends.iter().any(near), "{:?} {point:?}", segment.ends);
    // At the branching: open on both sides, and the segment. The Jacobian of the slipping selection has a kernel of dimension two
    // there, so that directions alone do not decide; its curvature does.
    let arms = all_arms(&map, &point, &EnumerationOptions::default()).unwrap();
    let undecided = Completeness::Undecided {
        selections: 1,
        doubt: Doubt::Rounding,
    };
    assert_eq!(arms.completeness, undecided);
    assert_eq!(arms.orientation, None);
    let mut full = numbers(&branching["u"]);
    full.extend(point);
    let list = arms_at(&map.full().unwrap(), &full, &ContinuationOptions::default()).unwrap();
    let (arms, complete) = (list.arms, !list.certainty.is_undecided());
    assert!(complete);
    let mut rates: Vec<f64> = arms.iter().map(|a| a.tangent[4]).collect();
    rates.sort_by(f64::total_cmp);
    assert_eq!(rates.len(), 3, "{rates:?}");
    assert!(
        rates[0] < -0.1 && rates[1].abs() < 1e-7 && rates[2] > 0.1,
        "{rates:?}"
    );
}

/// A map that provides nothing but its values and derivatives.
#[cfg(feature = "autodiff")]
mod opaque {
    use super::*;
    use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

    struct Opaque<F>(Traced<F>);

    impl<F: NonsmoothFunction> PiecewiseSmooth for Opaque<F> {
        same_cells!(0);
        hand_on! {
            0:
            fn test_functions(&self, x: &[f64], out: &mut [f64]);
            fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]);
            fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix);
        }
    }

    /// Seven kinks in two rows: a sum, or each nested in the next.
    struct Seven {
        weights: Vec<f64>,
        nested: bool,
    }

    impl NonsmoothFunction for Seven {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            out[0] = x[0] * 0.6 + x[1] * 0.2 - 0.7;
            out[1] = x[1] * 0.5 - x[0] * 0.3 - 0.2;
            let mut last = T::from(0.0);
            for w in self.weights.chunks(5) {
                let bend = x[0] * w[0] + x[1] * w[1] + w[2];
                last = if self.nested {
                    kinks.max(last, bend)
                } else {
                    kinks.abs(bend)
                };
                if !self.nested {
                    out[0] += last * w[3];
                    out[1] += last * w[4];
                }
            }
            if self.nested {
                out[0] -= last;
                out[1] += last * 0.5;
            }
        }
    }

    #[test]
    fn rows_of_many_sites_are_sums_or_listed_one_by_one() {
        let mut rng = Random::new(5);
        let mut several = 0;
        for case in 0..60 {
            let nested = case % 3 == 0;
            let map = Opaque(Traced::new(Seven {
                weights: rng.vector(35, 1.0),
                nested,
            }));
            let set = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
            let unproven = Completeness::Undecided {
                selections: 0,
                doubt: Doubt::NoCoefficients,
            };
            assert_eq!(set.completeness, unproven);
            let mut wanted = brute_force(&map);
            wanted.dedup_by(|a, b| a.iter().zip(&*b).all(|(a, b)| (a - b).abs() < 1e-9));
            assert_eq!(set.solutions.len(), wanted.len(), "case {case}");
            for s in &set.solutions {
                let near = |w: &Vec<f64>| w.iter().zip(&s.x).all(|(a, b)| (a - b).abs() < 1e-9);
                assert!(wanted.iter().any(near), "case {case}");
            }
            several += usize::from(wanted.len() > 1);
            // One by one where the kinks are nested: nothing is a sum.
            assert_eq!(
                nested,
                set.nodes == 128 && set.pivots == 0,
                "case {case}: {} nodes",
                set.nodes
            );
        }
        assert!(several > 5, "{several}");
        let map = Opaque(Traced::new(Seven {
            weights: rng.vector(35, 1.0),
            nested: true,
        }));
        let capped = all_solutions(&map, 0.0, &EnumerationOptions::default().with_max_nodes(1)).unwrap();
        assert!(
            matches!(capped.completeness, Completeness::Incomplete { examined, total: 128.0 } if examined < 128.0)
        );
    }
}

/// A = I + GᵀG, contact of displacements (2i, 2i + 1), condensed: the shape of the fuzzed problems.
fn fuzzed(g: [[f64; 6]; 6], load: [[f64; 6]; 2], friction: [f64; 3]) -> CondensedContact<PlanarCoulomb> {
    let entry = |i: usize, j: usize| g.iter().map(|g| g[i] * g[j]).sum::<f64>() + f64::from(u8::from(i == j));
    let a: Vec<Vec<f64>> = (0..6).map(|i| (0..6).map(|j| entry(i, j)).collect()).collect();
    let rows = |first: usize| {
        let entries: Vec<_> = (0..3).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(3, 6, &entries).unwrap()
    };
    let problem = FullContact::planar(
        Matrix::from_rows(&a).unwrap(),
        rows(0),
        rows(1),
        LoadPath::between(load[0].to_vec(), &load[1]),
        FrictionCoefficient::nodal(friction.to_vec()).unwrap(),
    );
    problem.unwrap().condensed().unwrap()
}

/// r = 1 is an eigenvalue of the condensed problem: with F = 1 a test function of the third node vanishes identically, including its
/// gradient, up to rounding. Found by fuzzing: the only solution at α = 0 must be listed.
#[test]
fn test_functions_that_vanish_everywhere() {
    let g = [
        [0.0, 0.0, 0.0625, 0.0, 5.0, 5.0],
        [5.0, -5.0, -5.0625, -5.0625, -5.0625, -5.0625],
        [-5.0625, -5.0625, -5.0, 5.0, 5.0, 5.0],
        [5.0; 6],
        [5.0; 6],
        [5.0; 6],
    ];
    let map = fuzzed(
        g,
        [[5.0; 6], [5.0, 5.0, 5.8125, 5.0, 5.0, 5.0]],
        [2.5, 0.3125, 1.0],
    );
    for alpha in [-1e-6, -1e-9, 0.0, 1e-9, 1e-6] {
        let set = all_solutions(&map, alpha, &EnumerationOptions::default()).unwrap();
        assert!(set.completeness.is_complete());
        assert_eq!((set.solutions.len(), set.index_sum), (1, Some(1)), "α = {alpha}");
    }
}

/// A direction 10⁹ times stiffer than the others: a gap of 1e-10 decides over a force of 10⁶. Found by fuzzing: points that are solutions
/// within the tolerance only must not be listed. In rational arithmetic there is one solution, with slip−, open, slip+.
#[test]
fn a_direction_a_billion_times_stiffer() {
    let s = -0.0625;
    let mut g = [[s; 6]; 6];
    g[0][0] = 7.3125;
    g[1] = [-7.8125, 3.125, 2.9375, -4.9375, 1e9, s];
    let map = fuzzed(g, [[s, s, s, s, 1.3125, 1.3125], [1.3125; 6]], [0.0; 3]);
    let set = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(
        (set.completeness, set.index_sum),
        (Completeness::Complete, Some(1))
    );
    let [solution] = set.solutions.as_slice() else {
        panic!("{set:?}");
    };
    assert_eq!(solution.selections, [Selection::from_pieces([3, 0, 2])]);
    let exact = [
        0.368_761_456_124_116_04,
        0.0,
        3_976_471.096_392_560_3,
        0.0,
        0.0,
        0.0,
    ];
    for (a, b) in solution.x.iter().zip(exact) {
        assert!((a - b).abs() <= 4.0 * f64::EPSILON * b.abs(), "{:?}", solution.x);
    }
}

/// y₂ = 0 (or y₁ = 2 y₂) and |y₁| + |y₂| = α: one residual depends on both sites.
struct TwoRoofs {
    tilted: bool,
}

impl PiecewiseSmooth for TwoRoofs {
    two_pieces!(self, [negative, positive], 3, 2, 2);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&x[..2]);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let sign = |i| [-1.0, 1.0][s.piece(i)];
        out[0] = sign(0) * x[0] + sign(1) * x[1] - x[2];
        out[1] = if self.tilted { x[0] - 2.0 * x[1] } else { x[1] };
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        let sign = |i| [-1.0, 1.0][s.piece(i)];
        let second = if self.tilted { [1.0, -2.0] } else { [0.0, 1.0] };
        for j in 0..2 {
            jac.add(0, j, sign(j));
            jac.add(1, j, second[j]);
        }
        jac.add(0, 2, -1.0);
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

/// Where a residual depends on two degenerate sites nothing is ruled out early: all selections are tried, up to the limit.
#[test]
fn arms_where_residuals_share_sites() {
    let arms = |map: &TwoRoofs, cap: u64| {
        let options = EnumerationOptions::default()
            .with_max_nodes(cap)
            .with_local_starts(0);
        all_arms(map, &[0.0; 3], &options).unwrap()
    };
    for tilted in [true, false] {
        let map = TwoRoofs { tilted };
        let found = arms(&map, 4);
        let unproven = Completeness::Undecided {
            selections: 0,
            doubt: Doubt::NoCoefficients,
        };
        assert_eq!((found.completeness, found.nodes), (unproven, 4));
        let expected = if tilted { [2.0, 1.0, 3.0] } else { [1.0, 0.0, 1.0] };
        let length = expected.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert_eq!(found.arms.len(), 2);
        for side in [1.0, -1.0] {
            let unit = [
                side * expected[0] / length,
                side * expected[1] / length,
                expected[2] / length,
            ];
            let near = |t: &[f64]| t.iter().zip(&unit).all(|(a, b)| (a - b).abs() < 1e-12);
            let arm = found.arms.iter().find(|a| near(&a.tangent)).unwrap();
            // det ∇_yH is the sign of y₁ where y₂ = 0, in both cells of the second site; −(2 s₁ + s₂) on the tilted line.
            let (signs, cells) = match tilted {
                true => (vec![Some(-side as i8)], 1),
                false => (vec![Some(side as i8); 2], 2),
            };
            assert_eq!((&arm.det_signs, arm.selections.len()), (&signs, cells));
        }
        // Both arms have increasing α; their indices cancel, as no arm has decreasing α.
        assert_eq!(found.orientation, Some((0, 0)));
        let capped = arms(&map, 2);
        assert!(
            matches!(capped.completeness, Completeness::Incomplete { examined, total } if examined < total)
        );
        assert_eq!(capped.nodes, 2);
        assert!(
            capped.arms.len() < 2,
            "the cells tried hold one of the two at most"
        );
    }
}

/// Solutions that fill a square or an edge of it, or a line that would lie outside the cell of its selection.
#[test]
fn continua_in_a_box() {
    let solve = |m: [[f64; 2]; 2], q: [f64; 2]| {
        let matrix = Matrix::from_rows(&m).unwrap();
        let lcp = Lcp::boxed(matrix, q.to_vec(), vec![0.0; 2], vec![1.0; 2]).unwrap();
        all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default()).unwrap()
    };
    let square = solve([[0.0; 2]; 2], [0.0; 2]);
    assert_eq!(square.index_sum, None);
    let largest = square.continua.iter().map(|c| c.dimension).max();
    assert_eq!(largest, Some(2), "{:?}", square.continua);
    // The unconstrained value of the second component is 5, so that it is at its bound; the first is free.
    let edge = solve([[0.0, 0.0], [0.0, 1.0]], [0.0, -5.0]);
    assert_eq!(
        (edge.continua.len(), edge.index_sum),
        (1, None),
        "{:?}",
        edge.continua
    );
    assert_eq!(edge.continua[0].dimension, 1);
    let mut ends = edge.continua[0].ends.clone();
    ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert_eq!(ends, [[0.0, 1.0], [1.0, 1.0]]);
}

/// A slope that varies by a few parts in a million between two points does not belong to an affine piece.
#[test]
fn pieces_that_are_slightly_curved_are_refused() {
    let map = |bend: f64| {
        MinMap::new(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] + bend * x[0] * x[0] - 1.0;
            b[0] = 3.0 * x[0] + 3.0;
        })
    };
    let list = |bend: f64| all_solutions(&map(bend), 0.0, &EnumerationOptions::default());
    assert_eq!(list(0.0).unwrap().solutions.len(), 1);
    for bend in [4e-6, 1e-4, 1e-2] {
        let refused = list(bend);
        assert!(
            matches!(refused, Err(EnumerationError::NotAffine { .. })),
            "{bend:e}: {refused:?}"
        );
    }
}
