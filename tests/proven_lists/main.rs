//! Proven lists of solutions: near-degenerate problems against exact references (tests/data/near_degenerate.json: all selections tried one
//! by one in rational arithmetic, from the same floating-point data).

use std::cell::Cell;

use semismooth::complementarity::Lcp;
use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, FrictionCoefficient, FrictionCurve, FullContact, LoadPath,
    PlanarCoulomb,
};
use semismooth::enumeration::{
    Completeness, Doubt, EnumerationOptions, SolutionSet, all_solutions, all_solutions_until,
};
use semismooth::piecewise::{MinMap, PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use semismooth::sparse::Matrix;
use serde_json::Value;

#[path = "../common/mod.rs"]
mod common;
#[path = "../maps/mod.rs"]
mod maps;
#[path = "../common/random.rs"]
mod random;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

mod arms;
mod continua;
mod points;
mod polyhedra;
mod statements;
#[cfg(feature = "autodiff")]
mod traced;
mod unstated;

fn list(map: &dyn PiecewiseSmooth, alpha: f64) -> SolutionSet {
    all_solutions(map, alpha, &EnumerationOptions::default()).unwrap()
}

/// The list at α = 0 if time runs out after this number of checks of the clock, and the number of checks.
fn cut_short(map: &dyn PiecewiseSmooth, most: usize) -> (SolutionSet, usize) {
    let looks = Cell::new(0);
    let stop = || {
        looks.set(looks.get() + 1);
        looks.get() > most
    };
    let set = all_solutions_until(map, 0.0, &EnumerationOptions::default(), &stop).unwrap();
    (set, looks.get())
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn matrix(v: &Value) -> Matrix {
    let rows: Vec<Vec<f64>> = v.as_array().unwrap().iter().map(numbers).collect();
    Matrix::from_rows(&rows).unwrap()
}

/// n × p: the normal (offset 0) or tangential (1) displacement of each node.
fn pick(p: usize, offset: usize) -> Matrix {
    let row = |i: usize| -> Vec<f64> { (0..2 * p).map(|j| f64::from(j == 2 * i + offset)).collect() };
    Matrix::from_rows(&(0..p).map(row).collect::<Vec<_>>()).unwrap()
}

fn friction(a: Matrix, f: Vec<f64>, coefficient: Vec<f64>) -> FullContact<PlanarCoulomb> {
    loaded(a, LoadPath::constant(f), coefficient)
}

fn loaded(a: Matrix, load: LoadPath, coefficient: Vec<f64>) -> FullContact<PlanarCoulomb> {
    let p = coefficient.len();
    FullContact::planar(
        a,
        pick(p, 0),
        pick(p, 1),
        load,
        FrictionCoefficient::nodal(coefficient).unwrap(),
    )
    .unwrap()
}

/// Blocks [[2, −1], [−1, 2]], one per node: F = 2 is critical.
fn blocks(p: usize) -> Matrix {
    let entry = |i: usize, j: usize| match i.abs_diff(j) {
        0 => 2.0,
        1 if i / 2 == j / 2 => -1.0,
        _ => 0.0,
    };
    let rows: Vec<Vec<f64>> = (0..2 * p)
        .map(|i| (0..2 * p).map(|j| entry(i, j)).collect())
        .collect();
    Matrix::from_rows(&rows).unwrap()
}

/// The selections of each solution as letters, with the signs of determinants.
fn states(set: &SolutionSet, letter: impl Fn(usize, usize) -> char) -> Vec<Vec<(String, i64)>> {
    let word = |s: &Selection| {
        s.pieces()
            .enumerate()
            .map(|(k, piece)| letter(k, piece))
            .collect()
    };
    let mut all: Vec<Vec<(String, i64)>> = set
        .solutions
        .iter()
        .map(|s| {
            let signs = s.det_signs.iter().map(|d| i64::from(d.unwrap()));
            let mut own: Vec<(String, i64)> = s.selections.iter().map(word).zip(signs).collect();
            own.retain(|(_, sign)| *sign != 0);
            own.sort();
            own
        })
        .filter(|own| !own.is_empty())
        .collect();
    all.sort();
    all
}

fn expected(case: &Value) -> Vec<Vec<(String, i64)>> {
    let solution = |s: &Value| -> Vec<(String, i64)> {
        let words = s[0].as_array().unwrap().iter();
        let words = words.map(|w| w.as_str().unwrap().to_owned());
        words
            .zip(s[1].as_array().unwrap().iter().map(|d| d.as_i64().unwrap()))
            .collect()
    };
    let mut all: Vec<_> = case["solutions"]
        .as_array()
        .unwrap()
        .iter()
        .map(solution)
        .collect();
    all.sort();
    all
}

/// Whether a singular selection contains a segment (or more), by the reference.
fn has_continua(case: &Value) -> bool {
    let held = case["singular"].as_array().unwrap().iter();
    held.filter_map(Value::as_str).any(|s| s.ends_with('|'))
}

fn reference() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/near_degenerate.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn near_degenerate_friction() {
    let file = reference();
    for (k, case) in file["friction"].as_array().unwrap().iter().enumerate() {
        let problem = friction(matrix(&case["A"]), numbers(&case["f"]), numbers(&case["F"]))
            .with_gap(numbers(&case["gap"]))
            .unwrap();
        // An r of any size changes nothing; one beyond the admissible range is refused.
        let problem = match problem.clone().with_r(case["r"].as_f64().unwrap()) {
            Ok(problem) => problem,
            Err(ContactError::Augmentation { .. }) => problem,
            Err(e) => panic!("{e}"),
        };
        let condensed = problem.condensed().unwrap();
        for (form, map) in [
            ("condensed", &condensed as &dyn PiecewiseSmooth),
            ("full", &problem),
        ] {
            let set = list(map, 0.0);
            let context = format!("friction {k}, {form}: {case}");
            assert_eq!(set.completeness, Completeness::Complete, "{context}");
            let found = states(&set, |_, piece| ['O', 'K', '+', '-'][piece]);
            assert_eq!(found, expected(case), "{context}");
            assert_eq!(!set.continua.is_empty(), has_continua(case), "{context}");
            // The degree of friction problems with F ≥ 0.
            assert!(set.index_sum.is_none_or(|sum| sum == 1), "{context}");
        }
    }
}

#[test]
fn near_degenerate_complementarity() {
    let file = reference();
    for (k, case) in file["lcp"].as_array().unwrap().iter().enumerate() {
        let bounds = |key: &str, none: f64| -> Vec<f64> {
            let all = case[key].as_array().unwrap().iter();
            all.map(|v| v.as_f64().unwrap_or(none)).collect()
        };
        let (lower, upper) = (bounds("lower", f64::NEG_INFINITY), bounds("upper", f64::INFINITY));
        let lcp = Lcp::boxed(matrix(&case["M"]), numbers(&case["q"]), lower, upper).unwrap();
        let set = list(lcp.mcp(), 0.0);
        let context = format!("LCP {k}: {case}");
        assert_eq!(set.completeness, Completeness::Complete, "{context}");
        let found = states(&set, |i, piece| match lcp.mcp().piece_name(i, piece).as_ref() {
            "lower" => 'l',
            "interior" => 'm',
            "upper" => 'u',
            _ => 'f',
        });
        assert_eq!(found, expected(case), "{context}");
        assert_eq!(!set.continua.is_empty(), has_continua(case), "{context}");
    }
}

/// f = (1, −2), F = 2 + 2⁻ᵏ: stick and slip⁻ are 2⁻ᵏ apart, and both are solutions; at F = 2 a vertical segment joins them.
#[test]
fn solutions_that_are_close_are_two() {
    for k in [10, 20, 24, 28, 40, 50] {
        let gap = f64::powi(2.0, -k);
        let map = friction(blocks(1), vec![1.0, -2.0], vec![2.0 + gap])
            .condensed()
            .unwrap();
        let set = list(&map, 0.0);
        assert_eq!(set.completeness, Completeness::Complete);
        assert_eq!((set.solutions.len(), set.continua.len()), (2, 0), "2^-{k}");
        assert_eq!(set.index_sum, Some(1), "2^-{k}");
    }
    let map = friction(blocks(1), vec![1.0, -2.0], vec![2.0])
        .condensed()
        .unwrap();
    let set = list(&map, 0.0);
    assert_eq!(
        (set.completeness, set.continua.len(), set.index_sum),
        (Completeness::Complete, 1, None)
    );
    assert_eq!(set.continua[0].ends.len(), 2);
    // Both ends are solutions of regular selections, and not isolated.
    assert_eq!(set.solutions.len(), 2);
    assert!(
        set.solutions
            .iter()
            .all(|s| s.det_signs.iter().any(|d| *d != Some(0)) && s.index.is_none())
    );
}

/// Two decoupled nodes with three solutions each, however small the load of one is.
#[test]
fn small_loads_count_like_large_ones() {
    for k in [0, 20, 24, 30, 34, 45, 300] {
        let s = f64::powi(2.0, -k);
        let problem = friction(blocks(2), vec![1.0, -2.25, s, -2.25 * s], vec![3.0; 2]);
        let set = list(&problem.condensed().unwrap(), 0.0);
        assert_eq!(
            (set.completeness, set.solutions.len(), set.index_sum),
            (Completeness::Complete, 9, Some(1)),
            "2^-{k}"
        );
    }
}

/// The same body as friction problem and as contact body with a law, condensed and in full form.
#[test]
fn all_forms_of_a_body_agree() {
    let f = vec![1.0, -2.25, 1.0, -2.0];
    let coefficient = 2.0 + f64::powi(2.0, -30);
    let reference = list(
        &friction(blocks(2), f.clone(), vec![coefficient; 2])
            .condensed()
            .unwrap(),
        0.0,
    );
    let body = || {
        let load = LoadPath::constant(f.clone());
        ContactBody::new(blocks(2), pick(2, 0), vec![pick(2, 1)], load).unwrap()
    };
    let law = || {
        PlanarCoulomb::new(FrictionCoefficient::uniform(
            FrictionCurve::constant(coefficient).unwrap(),
        ))
    };
    let condensed = list(&CondensedContact::new(body(), law()).unwrap(), 0.0);
    let full = list(&FullContact::new(body(), law()).unwrap(), 0.0);
    assert!(reference.solutions.len() > 1);
    for set in [&condensed, &full] {
        assert_eq!(set.completeness, Completeness::Complete);
        let selections = |s: &SolutionSet| -> Vec<Vec<Selection>> {
            s.solutions.iter().map(|s| s.selections.clone()).collect()
        };
        assert_eq!(selections(set), selections(&reference));
    }
}

/// Two contact forces on the same displacement cannot be distinguished: refused.
#[test]
fn dependent_contacts_are_refused() {
    let double = Matrix::from_rows(&[[1.0, 0.0], [1.0, 0.0]]).unwrap();
    let tangential = Matrix::from_rows(&[[0.0, 1.0], [0.0, 1.0]]).unwrap();
    let problem = FullContact::planar(
        blocks(1),
        double,
        tangential,
        LoadPath::constant(vec![1.0, 0.0]),
        FrictionCoefficient::nodal(vec![0.5; 2]).unwrap(),
    );
    assert!(problem.unwrap_err().to_string().contains("multipliers"));
}

/// z ≥ 0 ⟂ −z₁ + z₂ + q …: a ray of solutions, and none for the neighbouring floating-point number.
#[test]
fn rays_are_found_and_lost_by_one_bit() {
    let lcp = |q: f64| {
        let matrix = Matrix::from_rows(&[[1.0, -1.0], [-1.0, 1.0]]).unwrap();
        Lcp::new(matrix, vec![-1.0, q]).unwrap()
    };
    let ray = list(lcp(1.0).mcp(), 0.0);
    assert_eq!(
        (ray.completeness, ray.continua.len()),
        (Completeness::Complete, 1)
    );
    assert_eq!((ray.continua[0].dimension, ray.continua[0].ends.len()), (1, 1));
    let above = list(lcp(1.0 + f64::EPSILON).mcp(), 0.0);
    assert_eq!(
        (above.completeness, above.solutions.len(), above.continua.len()),
        (Completeness::Complete, 1, 0)
    );
    let below = list(lcp(1.0 - f64::EPSILON / 2.0).mcp(), 0.0);
    assert_eq!(
        (below.completeness, below.solutions.len(), below.continua.len()),
        (Completeness::Complete, 0, 0)
    );
}

#[test]
fn maps_without_coefficients_are_not_proven() {
    let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = 1.0 - x[0];
    });
    let set = list(&map, 0.0);
    assert_eq!((set.solutions.len(), set.index_sum), (2, None));
    let unproven = Completeness::Undecided {
        selections: 0,
        doubt: Doubt::NoCoefficients,
    };
    assert_eq!(set.completeness, unproven);
    assert!(!set.completeness.is_complete() && !set.completeness.has_gaps());
}

/// Where exact arithmetic has to stop, nothing is claimed: at the apex of three nodes all 64 selections give one point.
#[test]
fn limits_leave_lists_undecided() {
    let problem = friction(blocks(3), vec![0.0; 6], vec![1.0; 3]);
    let map = problem.condensed().unwrap();
    let whole = list(&map, 0.0);
    assert_eq!(
        (whole.completeness, whole.solutions.len()),
        (Completeness::Complete, 1)
    );
    assert_eq!(whole.solutions[0].selections.len(), 64);
    // With as many nodes as the other search needed.
    let options = EnumerationOptions::default().with_max_nodes(whole.nodes);
    let set = all_solutions(&map, 0.0, &options).unwrap();
    assert!(
        matches!(set.completeness, Completeness::Undecided { selections, doubt: Doubt::Limit } if selections > 0),
        "{:?}",
        set.completeness
    );
    assert!(set.completeness.has_gaps() && set.index_sum.is_none());
}

/// A P matrix with the solution inside the box. Found by random tests: 0 is no solution.
#[test]
fn a_solution_inside_of_the_box() {
    let matrix = Matrix::from_rows(&[
        [
            0.9012453400418989,
            -4.45339131070017,
            2.158205016648596,
            -2.723128781356332,
            1.5527714774420125,
        ],
        [
            3.2672591181095028,
            0.7408240401320385,
            3.5561562599142285,
            -1.5776621768701833,
            3.503198658769762,
        ],
        [
            -3.2184184073143802,
            -2.9069100049090695,
            0.49654264962037076,
            2.220147213128543,
            0.3407026076151785,
        ],
        [
            3.3555238855237923,
            1.0515235786541808,
            -2.220147213128543,
            0.5046323739543699,
            4.556907614803151,
        ],
        [
            -2.321210963452796,
            -3.503198658769762,
            0.3407026076151785,
            -4.556907614803151,
            0.5126708855910469,
        ],
    ]);
    let q = vec![
        0.7203676078163059,
        0.7258308339129486,
        0.0,
        0.5255400810931996,
        0.0,
    ];
    let upper = vec![
        0.9353847551233458,
        0.4937171293374467,
        0.7656561596833591,
        1.2053146986269139,
        1.0345982735441663,
    ];
    let lcp = Lcp::boxed(matrix.unwrap(), q, vec![-0.5; 5], upper).unwrap();
    let set = list(lcp.mcp(), 0.0);
    assert_eq!(
        (set.completeness, set.solutions.len(), set.index_sum),
        (Completeness::Complete, 1, Some(1)),
        "{set:?}"
    );
    let exact = [
        -0.126_134_594_370_624_6,
        0.102_433_800_036_310_2,
        -0.053_152_792_018_877_57,
        -0.026_242_134_584_566_29,
        -0.069_074_998_197_502_68,
    ];
    for (a, b) in set.solutions[0].x.iter().zip(exact) {
        assert!((a - b).abs() < 1e-14, "{:?}", set.solutions[0].x);
    }
}

/// Selections of 1 + z₂ = z₁ = 1 + t with the restrictions of t by a third and a fourth component: three segments and rays, one after the
/// other, in different selections; other selections contain single points of them, and add nothing. The end at t = 0 is a solution of a
/// regular selection.
#[test]
fn points_of_a_continuum_are_not_listed_separately() {
    let matrix = Matrix::from_rows(&[
        [1.0, -1.0, 0.0, 0.0],
        [-1.0, 1.0, 0.0, 0.0],
        [1.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0, 1.0],
    ]);
    let upper = vec![f64::INFINITY, f64::INFINITY, 1.0, f64::INFINITY];
    let lcp = Lcp::boxed(matrix.unwrap(), vec![-1.0, 1.0, -3.0, -2.0], vec![0.0; 4], upper).unwrap();
    let set = list(lcp.mcp(), 0.0);
    assert_eq!(set.completeness, Completeness::Complete);
    let points: Vec<&[f64]> = set.solutions.iter().map(|s| s.x.as_slice()).collect();
    assert_eq!(points, [[1.0, 0.0, 1.0, 1.0]]);
    assert_eq!((set.solutions[0].index, set.index_sum), (None, None));
    let at = |t: f64| [1.0 + t, t, (2.0 - t).clamp(0.0, 1.0), (1.0 - t).max(0.0)].to_vec();
    assert!(set.continua.iter().all(|c| c.dimension == 1));
    let mut ends: Vec<Vec<Vec<f64>>> = set.continua.iter().map(|c| c.ends.clone()).collect();
    let order = |a: &Vec<f64>, b: &Vec<f64>| a.partial_cmp(b).unwrap();
    ends.iter_mut().for_each(|e| e.sort_by(order));
    ends.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let rays = [vec![at(0.0), at(1.0)], vec![at(1.0), at(2.0)], vec![at(2.0)]];
    assert_eq!(ends, rays);
}

/// w₁ = w₂ = z₃, w₃ = z₃ − z₁ − z₂: where z₃ = 0 two unknowns are free, but their signs admit only 0.
#[test]
fn signs_may_leave_one_point_of_a_plane() {
    let matrix = Matrix::from_rows(&[[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [-1.0, -1.0, 1.0]]);
    let lcp = Lcp::new(matrix.unwrap(), vec![0.0; 3]).unwrap();
    let set = list(lcp.mcp(), 0.0);
    assert_eq!(
        (set.completeness, set.solutions.len(), set.continua.len()),
        (Completeness::Complete, 1, 0),
        "{set:?}"
    );
    assert_eq!(set.solutions[0].x, [0.0; 3]);
}

/// The second node has no friction and no tangential load: it opens under the least tension, whatever the force at the first one.
#[test]
fn the_least_tension_opens_a_node_without_friction() {
    for k in [20, 40, 52, 53, 60, 300] {
        let f = vec![1.0, -2.25, -f64::powi(2.0, -k), 0.0];
        let problem = friction(blocks(2), f, vec![3.0, 0.0]);
        for map in [
            &problem.condensed().unwrap() as &dyn PiecewiseSmooth,
            &problem as &dyn PiecewiseSmooth,
        ] {
            let set = list(map, 0.0);
            assert_eq!(
                (set.completeness, set.solutions.len(), set.index_sum),
                (Completeness::Complete, 3, Some(1)),
                "2^-{k}"
            );
            let all = set.solutions.iter().flat_map(|s| &s.selections);
            assert!(all.clone().all(|s| s.piece(1) == 0), "2^-{k}");
        }
    }
}

/// The bounds that are stated hold for all solutions.
#[test]
fn stated_bounds_hold() {
    let mut problems: Vec<FullContact<PlanarCoulomb>> = Vec::new();
    for case in reference()["friction"].as_array().unwrap() {
        let problem = friction(matrix(&case["A"]), numbers(&case["f"]), numbers(&case["F"]));
        problems.push(problem.with_gap(numbers(&case["gap"])).unwrap());
    }
    // Open and closed nodes, alone and together.
    for f in [
        [1.0, -2.25, 1.0, 0.5],
        [-1.0, 0.0, -1.0, 0.0],
        [-1.0, 1.0, 1.0, 0.0],
    ] {
        problems.push(friction(blocks(2), f.to_vec(), vec![0.5; 2]));
    }
    // A spring that no contact force reaches: |u₃| = 1/3.
    let a = Matrix::from_rows(&[[3.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 3.0]]).unwrap();
    let [normal, tangential] = [0, 1].map(|j| Matrix::from_triplets(1, 3, &[(0, j, 1.0)]).unwrap());
    let load = LoadPath::constant(vec![1.0, -2.25, -1.0]);
    let friction = FrictionCoefficient::nodal(vec![0.5]).unwrap();
    problems.push(FullContact::planar(a, normal, tangential, load, friction).unwrap());
    for problem in &problems {
        let condensed = problem.condensed().unwrap();
        for map in [problem as &dyn PiecewiseSmooth, &condensed] {
            let bounds = map.exact().unwrap().conditions(0.0).unwrap().bounds;
            assert_eq!(bounds.len(), map.num_residuals());
            for solution in &list(map, 0.0).solutions {
                for (x, bound) in solution.x.iter().zip(&bounds) {
                    assert!(x.abs() <= bound.as_ref().unwrap().to_f64(), "{x:e} {bounds:?}");
                }
            }
        }
    }
}

/// (2 − ε) z₁ + 2 z₂ = 1 = 2 z₁ + (2 − δ) z₂ at z₁ = δ/(2 ε + 2 δ − ε δ), z₂ = ε/(2 ε + 2 δ − ε δ), in any units: the digits that a
/// floating-point solution loses to the condition number are restored by exact arithmetic.
#[test]
fn points_of_ill_conditioned_selections_are_exact() {
    for (first, second) in [(1e-6, 3e-6), (9.2e-10, 5.3e-10), (1e-13, 7e-14)] {
        for [row, column] in [[1.0, 1.0], [4096.0, 1e-20], [1e10, 1e3]] {
            let diagonal = [2.0 - first, 2.0 - second];
            // These differences are exact.
            let [e, d] = diagonal.map(|v| 2.0 - v);
            // Powers of ten are as exact as their products where only ratios matter.
            let unit = |v: f64| v * row * column;
            let two = unit(2.0);
            let m = [[two - unit(e), two], [two, two - unit(d)]];
            let stored = [(two - m[0][0]) / two * 2.0, (two - m[1][1]) / two * 2.0];
            let whole = 2.0 * (stored[0] + stored[1]) - stored[0] * stored[1];
            let exact = [stored[1] / whole / column, stored[0] / whole / column];
            let lcp = Lcp::new(Matrix::from_rows(&m).unwrap(), vec![-row; 2]).unwrap();
            let set = list(lcp.mcp(), 0.0);
            assert!(set.completeness.is_complete() && set.solutions.len() == 3);
            let inside = set
                .solutions
                .iter()
                .find(|s| s.x.iter().all(|z| *z > 0.0))
                .unwrap();
            for (z, exact) in inside.x.iter().zip(exact) {
                assert!((z - exact).abs() < 1e-13 * exact, "{first} {row}: {z} {exact}");
            }
        }
    }
}
