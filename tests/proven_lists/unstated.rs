//! Maps that do not state their coefficients: their lists hold within tolerances, and doubts are reported.

use semismooth::enumeration::{
    Completeness, Doubt, EnumerationError, EnumerationOptions, all_arms, all_solutions,
};
use semismooth::piecewise::{Derivatives, Facet, MinMap, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

use super::{cut_short, list};
use crate::maps::two_pieces;

/// Sites with the test functions x_i − kink, i = 0, …, and affine rows in each selection: coefficients, then a constant.
struct Rows<F> {
    vars: usize,
    sites: usize,
    rows: F,
    /// This multiple of x₀² is added to row 0.
    curvature: f64,
    kink: f64,
}

fn rows<F: Fn(&[usize]) -> Vec<Vec<f64>>>(vars: usize, sites: usize, rows: F) -> Rows<F> {
    Rows {
        vars,
        sites,
        rows,
        curvature: 0.0,
        kink: 0.0,
    }
}

impl<F: Fn(&[usize]) -> Vec<Vec<f64>>> Rows<F> {
    fn of(&self, s: &Selection) -> Vec<Vec<f64>> {
        (self.rows)(&s.pieces().collect::<Vec<_>>())
    }
}

impl<F: Fn(&[usize]) -> Vec<Vec<f64>>> PiecewiseSmooth for Rows<F> {
    two_pieces!(
        self,
        [positive, negative],
        self.vars,
        (self.rows)(&vec![0; self.sites]).len(),
        self.sites
    );
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (o, x) in out.iter_mut().zip(x) {
            *o = x - self.kink;
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for (o, row) in out.iter_mut().zip(self.of(s)) {
            let terms = row.iter().zip(x).map(|(a, x)| a * x);
            *o = terms.sum::<f64>() + row[self.vars];
        }
        out[0] += self.curvature * x[0] * x[0];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        for (i, row) in self.of(s).iter().enumerate() {
            (0..self.vars).for_each(|j| jac.add(i, j, row[j]));
        }
        jac.add(0, 0, 2.0 * self.curvature * x[0]);
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl<F: Fn(&[usize]) -> Vec<Vec<f64>>> Derivatives for Rows<F> {
    fn test_gradient(&self, site: usize, _test: usize, _x: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        gradient[site] = 1.0;
    }
}

fn doubtful(completeness: &Completeness) -> u64 {
    match completeness {
        Completeness::Undecided {
            selections,
            doubt: Doubt::NoCoefficients,
        } => *selections,
        other => panic!("{other:?}"),
    }
}

/// Three masses on two springs without support, the stiffness matrix given with 13 decimals: the rank is that of a free body, although the
/// determinant is not zero.
#[test]
fn a_free_body_has_a_line_of_solutions() {
    let told = |v: f64| (v * 1e13).round() * 1e-13;
    let (a, b) = (1.0 / 3.0, 1.0 / 7.0);
    let map = rows(3, 0, |_| {
        vec![
            vec![told(a), told(-a), 0.0, -1.0],
            vec![told(-a), told(a + b), told(-b), 0.5],
            vec![0.0, told(-b), told(b), 0.5],
        ]
    });
    let set = list(&map, 0.0);
    assert!(set.solutions.is_empty(), "{set:?}");
    assert_eq!(set.continua.len(), 1);
    assert_eq!((set.continua[0].dimension, set.index_sum), (1, None));
}

/// Sites whose pieces enter all rows of a map, not as a sum over sites, and too many for their combinations to be searched with pruning.
const MANY: usize = 10;

/// x_k = `at` ≥ 0 for k > 0; row 0 contains multiples of them that depend on the pieces of two sites and sum up to `seen`.
fn others(p: &[usize], at: f64) -> (Vec<Vec<f64>>, f64) {
    let mut all: Vec<Vec<f64>> = (0..MANY)
        .map(|k| (0..=MANY).map(|j| f64::from(j == k)).collect())
        .collect();
    all.iter_mut().for_each(|row| row[MANY] = -at);
    (1..MANY).for_each(|k| all[0][k] = [0.125, 0.25][p[k] ^ p[k % (MANY - 1) + 1]]);
    (all, 0.125 * at * (MANY as f64 - 1.0))
}

/// max(y, 0) + d has no zero for d > 0. A zero within the tolerance only is listed as doubtful.
#[test]
fn a_solution_by_tolerance_alone_is_a_doubt() {
    let options = EnumerationOptions::default().with_tolerance(1e-6);
    let map = |d: f64| {
        rows(MANY, MANY, move |p| {
            let (mut all, seen) = others(p, 1.0);
            (all[0][0], all[0][MANY]) = ([1.0, 0.0][p[0]], d - seen);
            all
        })
    };
    for (d, doubts) in [(-1e-3, 0), (-1e-7, 0), (1e-7, 1)] {
        let set = all_solutions(&map(d), 0.0, &options).unwrap();
        assert_eq!(
            (set.solutions.len(), doubtful(&set.completeness)),
            (1, doubts),
            "{d:e}"
        );
        assert!((set.solutions[0].x[0] + d).abs() <= 1e-14);
    }
    assert!(
        all_solutions(&map(1e-3), 0.0, &options)
            .unwrap()
            .solutions
            .is_empty()
    );
}

/// The end of a ray of solutions is not isolated: it has no index, although the determinants of the selections that give it alone agree in
/// sign.
#[test]
fn the_end_of_a_ray_has_no_index() {
    // 3/2 or 1/2 y₁ = 0 and max(y₂, 0) = 0.
    let plane = rows(2, 2, |p| {
        vec![vec![[1.5, 0.5][p[0]], 0.0, 0.0], vec![0.0, [1.0, 0.0][p[1]], 0.0]]
    });
    let line = rows(1, 1, |p| vec![vec![[1.0, 0.0][p[0]], 0.0]]);
    for (map, selections) in [(&plane as &dyn PiecewiseSmooth, 2), (&line, 1)] {
        let set = list(map, 0.0);
        assert!(!set.continua.is_empty());
        assert!(
            set.solutions
                .iter()
                .all(|s| s.selections.len() == selections && s.index.is_none()),
            "{set:?}"
        );
    }
    // Without the ray it has one.
    let kink = rows(1, 1, |p| vec![vec![[1.5, 0.5][p[0]], 0.0]]);
    assert_eq!(list(&kink, 0.0).solutions[0].index, Some(1));
}

/// One solution on a kink, up to rounding of unknowns of any size, beside an unknown that is 0: both selections give it, and its index
/// follows from their determinants.
#[test]
fn a_solution_on_a_kink_is_one_in_any_units() {
    for unit in [1e-9, 1.0, 1e5, 1e10] {
        for (slopes, index) in [
            ([1.3, 3.1], Some(1)),
            ([-1.7, -0.6], Some(-1)),
            ([1.3, -1.7], Some(0)),
        ] {
            let (a, b) = (unit / 3.0, unit / 7.0);
            let mut map = rows(3, 1, |p| {
                let s = slopes[p[0]];
                vec![
                    vec![s, 0.7, 0.0, -s * a - 0.7 * b],
                    vec![0.1 * s, 1.07, 0.0, -0.1 * s * a - 1.07 * b],
                    vec![0.0, 0.0, 1.0, 0.0],
                ]
            });
            map.kink = a;
            let set = list(&map, 0.0);
            assert_eq!(set.solutions.len(), 1, "{unit:e} {set:?}");
            let solution = &set.solutions[0];
            assert_eq!(
                (solution.selections.len(), solution.index),
                (2, index),
                "{unit:e}"
            );
            assert!((solution.x[0] - a).abs() + (solution.x[1] - b).abs() <= 1e-14 * unit);
        }
    }
}

/// On a kink at one site and well inside a piece at the other, whose other piece has a solution outside its cell.
#[test]
fn what_other_pieces_would_give_elsewhere_is_no_doubt() {
    let map = rows(2, 2, |p| {
        vec![
            vec![[1.5, 0.5][p[0]], 0.1, -0.1],
            vec![0.0, [2.0, 1.0][p[1]], -2.0],
        ]
    });
    let set = list(&map, 0.0);
    assert_eq!(
        (set.solutions.len(), doubtful(&set.completeness)),
        (1, 0),
        "{set:?}"
    );
    assert_eq!(set.solutions[0].x[1], 1.0);
}

/// Masses in a row on springs that soften by a third of their stiffness beyond an extension of 1 in either direction, each spring in the
/// rows of both its ends.
struct Springs(usize);

impl Springs {
    fn stiffness(&self, spring: usize, piece: usize) -> f64 {
        [1.0, 2.0 / 3.0, 2.0 / 3.0][piece] * (1.0 + spring as f64 / 7.0)
    }
    /// The force without extension.
    fn offset(&self, spring: usize, piece: usize) -> f64 {
        [0.0, 1.0, -1.0][piece] * (self.stiffness(spring, 0) - self.stiffness(spring, piece))
    }
    fn force(&self, spring: usize, piece: usize, x: f64) -> f64 {
        self.stiffness(spring, piece) * x + self.offset(spring, piece)
    }
    fn load(&self, mass: usize) -> f64 {
        [-1.0, 0.5, 0.8][mass % 3]
    }
}

impl PiecewiseSmooth for Springs {
    fn num_vars(&self) -> usize {
        self.0
    }
    fn num_residuals(&self) -> usize {
        self.0
    }
    fn num_sites(&self) -> usize {
        self.0
    }
    fn num_pieces(&self, _site: usize) -> usize {
        3
    }
    fn num_tests(&self, _site: usize) -> usize {
        2
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        const CELLS: [&[Facet]; 3] = [
            &[Facet::negative(0), Facet::positive(1)],
            &[Facet::positive(0)],
            &[Facet::negative(1)],
        ];
        CELLS[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (pair, x) in out.chunks_exact_mut(2).zip(x) {
            pair.copy_from_slice(&[x - 1.0, x + 1.0]);
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let force = |k: usize| self.force(k, s.piece(k), x[k]);
        for (k, o) in out.iter_mut().enumerate() {
            let next = if k + 1 < self.0 { force(k + 1) } else { 0.0 };
            *o = force(k) - next + self.load(k);
        }
    }
    fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
        for k in 0..self.0 {
            let stiffness = self.stiffness(k, s.piece(k));
            jac.add(k, k, stiffness);
            if k > 0 {
                jac.add(k - 1, k, -stiffness);
            }
        }
    }
}

/// 3²⁰ selections, of which the search tries few: the contribution of a spring to both rows is one unknown.
#[test]
fn springs_between_two_masses_are_one_unknown() {
    let map = Springs(20);
    let set = list(&map, 0.0);
    assert_eq!(
        (set.solutions.len(), doubtful(&set.completeness)),
        (1, 0),
        "{set:?}"
    );
    // The force of a spring is the sum of the loads behind it.
    let mut carried = 0.0;
    let mut pieces = [0; 3];
    for k in (0..map.0).rev() {
        carried -= map.load(k);
        let stretched = carried.abs() > map.stiffness(k, 0);
        let piece = usize::from(stretched) * if carried > 0.0 { 1 } else { 2 };
        let extension = (carried - map.offset(k, piece)) / map.stiffness(k, piece);
        assert!((set.solutions[0].x[k] - extension).abs() < 1e-12, "{k}");
        pieces[piece] += 1;
    }
    assert!(pieces[0] > 0 && pieces[1] + pieces[2] > 0, "{pieces:?}");
    assert!(set.nodes < 10_000, "{}", set.nodes);
}

/// |y_k| = 1 for nine y_k has 512 solutions; a long search, which examines many sites at once, must not exceed its limit on nodes.
#[test]
fn long_searches_keep_to_their_nodes() {
    const N: usize = 9;
    let map = rows(N, N, |p| {
        let entry = |i: usize, j: usize| match j {
            N => -1.0,
            _ if i == j => [1.0, -1.0][p[i]],
            _ => 0.0,
        };
        (0..N).map(|i| (0..=N).map(|j| entry(i, j)).collect()).collect()
    });
    for limit in 1_001..1_006 {
        let options = EnumerationOptions::default().with_max_nodes(limit);
        let set = all_solutions(&map, 0.0, &options).unwrap();
        let Completeness::Incomplete { examined, total } = set.completeness else {
            panic!("{:?}", set.completeness);
        };
        assert!(set.nodes <= limit && examined < total && total == 512.0);
        assert!((set.solutions.iter()).all(|s| s.x.iter().all(|y| y.abs() == 1.0)));
    }
}

/// y + y² = 0 beside kinks: all selections give 0, where the curvature does not show, and −1 would be missed.
#[test]
fn curvature_that_does_not_show_at_the_solution_is_found() {
    let mut map = rows(MANY, MANY, |p| {
        let (mut all, _) = others(p, 0.0);
        (all[0][0], all[0][MANY]) = (1.0, 0.0);
        all
    });
    assert_eq!(list(&map, 0.0).solutions.len(), 1);
    map.curvature = 1.0;
    let refused = all_solutions(&map, 0.0, &EnumerationOptions::default());
    assert!(
        matches!(refused, Err(EnumerationError::NotAffine { .. })),
        "{refused:?}"
    );
}

/// α = 0 and |y₀| = |y₁|: four vertical arms, whose directions have no half-space in common.
#[test]
fn vertical_arms_leave_to_all_sides() {
    let map = rows(3, 2, |p| {
        let [a, b] = [p[0], p[1]].map(|k| [1.0, -1.0][k]);
        vec![vec![0.0, 0.0, 1.0, 0.0], vec![a, -b, 0.0, 0.0]]
    });
    let found = all_arms(&map, &[0.0; 3], &EnumerationOptions::default()).unwrap();
    let half = 0.5_f64.sqrt();
    assert_eq!(found.arms.len(), 4, "{found:?}");
    for expected in [[half, half], [half, -half], [-half, half], [-half, -half]] {
        let near = |t: &[f64]| t[2] == 0.0 && t.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-14);
        assert!(found.arms.iter().any(|a| near(&a.tangent)), "{found:?}");
    }
    assert_eq!(found.orientation, None);
}

/// a x = α, a = 1 or −3 where x is positive or negative, and y = x − 3 α: two solutions for α > 0, none for α < 0, two arms at 0.
#[test]
fn lists_are_those_of_their_parameter() {
    let map = rows(3, 1, |p| {
        let a = [1.0, -3.0][p[0]];
        vec![vec![a, 0.0, -1.0, 0.0], vec![-1.0, 1.0, 3.0, 0.0]]
    });
    let options = EnumerationOptions::default();
    let near = |x: &[f64], y: &[f64; 3]| x.iter().zip(y).all(|(a, b)| (a - b).abs() < 1e-14);
    for alpha in [-1.0, -0.1, 0.3, 1.0] {
        let set = all_solutions(&map, alpha, &options).unwrap();
        let exact = match alpha > 0.0 {
            true => vec![
                [alpha, -2.0 * alpha, alpha],
                [-alpha / 3.0, -10.0 * alpha / 3.0, alpha],
            ],
            false => vec![],
        };
        assert_eq!(
            (set.solutions.len(), doubtful(&set.completeness)),
            (exact.len(), 0),
            "{alpha}"
        );
        assert!(
            exact.iter().all(|x| set.solutions.iter().any(|s| near(&s.x, x))),
            "{set:?}"
        );
    }
    let found = all_arms(&map, &[0.0; 3], &options).unwrap();
    let arms = [[1.0, -2.0, 1.0], [-1.0, -10.0, 3.0]].map(|d: [f64; 3]| {
        let length = d.iter().map(|d| d * d).sum::<f64>().sqrt();
        d.map(|d| d / length)
    });
    assert_eq!((found.arms.len(), found.orientation), (2, Some((0, 0))));
    assert!(
        arms.iter()
            .all(|t| found.arms.iter().any(|a| near(&a.tangent, t))),
        "{found:?}"
    );
}

/// |y₁| = 1 beside an undetermined unknown: two lines without ends, distinguished without coefficients, too.
#[test]
fn two_lines_without_ends() {
    let map = MinMap::new(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        (a[0], b[0]) = (1.0 - x[0], 1.0 + x[0]);
        (a[1], b[1]) = (0.0, 1.0);
    });
    let found = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(found.continua.len(), 2, "{found:?}");
    assert!(
        found
            .continua
            .iter()
            .all(|c| (c.dimension, c.ends.len()) == (1, 0))
    );
}

/// Each x_i is 0 or about 1. At whichever check of the clock time runs out, the list is a part of the one without a limit.
#[test]
fn lists_that_are_cut_short_are_parts_of_the_whole() {
    let map = MinMap::new(5, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for i in 0..5 {
            a[i] = x[i];
            b[i] = 1.0 - x[i] + 0.1 * x[(i + 1) % 5];
        }
    });
    let (whole, all) = cut_short(&map, usize::MAX);
    assert!(whole.solutions.len() == 32 && whole.solutions.iter().all(|s| s.index.is_some()));
    let (mut partial, mut without_index) = (0, 0);
    for most in (0..all).step_by(5) {
        let set = cut_short(&map, most).0;
        for solution in &set.solutions {
            let same = (whole.solutions.iter()).find(|s| s.selections == solution.selections);
            assert!(same.is_some_and(|s| s.x == solution.x));
            assert!(solution.index.is_none() || same.is_some_and(|s| s.index == solution.index));
        }
        let found = set.solutions.len();
        partial += usize::from(found < 32 && set.completeness.has_gaps());
        assert!(found == 32 || set.completeness.has_gaps(), "{most} of {all}");
        without_index += usize::from(found == 32 && set.solutions.iter().any(|s| s.index.is_none()));
    }
    assert!(partial > 6 && without_index > 6, "{partial} {without_index}");
}
