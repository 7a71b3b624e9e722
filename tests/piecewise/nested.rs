//! First-order results for nested kinks, against values of the map itself on a small circle.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use crate::maps::{hand_on, same_cells};
use crate::random::Random;
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::enumeration::{Completeness, EnumerationOptions, all_arms, all_solutions};
use semismooth::interface::{InterfaceProblem, LoadPath};
use semismooth::newton::Newton;
use semismooth::piecewise::check::{CheckError, CheckOptions, FindingKind, check};
use semismooth::piecewise::{
    Activity, CoherentOrientation, Derivatives, Kinks, LocalUniqueness, NonsmoothFunction, PiecewiseSmooth,
    Real, Selection, Selections, Traced, active_set, b_derivative, b_subdifferential, coherent_orientation,
    essential_activity, local_uniqueness, select, value,
};
use semismooth::sparse::{Matrix, Pattern};

/// A kink of the sum of the earlier values with these weights (and of a second sum, for a maximum or a minimum).
struct Kink {
    kind: usize,
    weights: [Vec<f64>; 2],
}

/// ℝ² → ℝⁿ: kinks, each of sums of the variables and of the kinks before it; at 0 all of them meet. Squares make everything nonlinear.
struct Nested {
    kinks: Vec<Kink>,
    outputs: Vec<Vec<f64>>,
    bend: f64,
    shift: [f64; 2],
}

impl Nested {
    fn random(random: &mut Random, kinks: usize, outputs: usize, whole: bool) -> Self {
        let mut weights = |n: usize| -> Vec<f64> {
            let number = |_| match whole {
                true => random.below(5) as f64 - 2.0,
                false => random.symmetric(),
            };
            (0..n).map(number).collect()
        };
        let outputs = (0..outputs).map(|_| weights(2 + kinks)).collect();
        let pairs: Vec<[Vec<f64>; 2]> = (0..kinks).map(|k| [weights(2 + k), weights(2 + k)]).collect();
        let kink = |weights| Kink {
            kind: random.below(3),
            weights,
        };
        Self {
            kinks: pairs.into_iter().map(kink).collect(),
            outputs,
            bend: 0.7,
            shift: [0.0; 2],
        }
    }

    fn straight(&self) -> Self {
        let kink = |k: &Kink| Kink {
            kind: k.kind,
            weights: k.weights.clone(),
        };
        Self {
            kinks: self.kinks.iter().map(kink).collect(),
            outputs: self.outputs.clone(),
            bend: 0.0,
            shift: self.shift,
        }
    }
}

impl NonsmoothFunction for Nested {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        self.outputs.len()
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let sum = |values: &[T], weights: &[f64]| {
            let bent = match self.bend {
                0.0 => T::from(0.0),
                bend => (x[0] * x[0] + x[0] * x[1] * 0.3) * bend,
            };
            let terms = values.iter().zip(weights);
            terms.fold(bent, |sum, (v, w)| sum + *v * *w)
        };
        let mut values = x.to_vec();
        for k in &self.kinks {
            let [a, b] = [0, 1].map(|i| sum(&values, &k.weights[i]));
            values.push(match k.kind {
                0 => kinks.max(a, b),
                1 => kinks.min(a, b),
                _ => kinks.abs(a),
            });
        }
        for ((out, weights), shift) in out.iter_mut().zip(&self.outputs).zip(self.shift) {
            *out = sum(&values, weights) + shift;
        }
    }
}

/// The number of directions around the circle; none of them is special.
const DIRECTIONS: usize = 4000;

fn direction(k: usize) -> [f64; 2] {
    let (sin, cos) = (TAU * (k as f64 + 0.271) / DIRECTIONS as f64).sin_cos();
    [cos, sin]
}

fn cross(a: &[f64], b: &[f64]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The values on the circle.
struct Circle {
    images: Vec<Vec<f64>>,
    selections: Vec<Selection>,
    /// Whether no sector is so narrow, and no image so short or so flat, that the sample may mislead.
    clear: bool,
}

impl Circle {
    fn new(nested: &Nested) -> Self {
        let map = Traced::new(nested.straight());
        let (mut images, mut selections) = (Vec::new(), Vec::new());
        for k in 0..DIRECTIONS {
            let d = direction(k);
            let mut image = vec![0.0; nested.outputs.len()];
            value(&map, &d, &mut image);
            images.push(image);
            selections.push(select(&map, &d));
        }
        let begun: Vec<usize> = (0..DIRECTIONS)
            .filter(|&k| selections[k] != selections[(k + DIRECTIONS - 1) % DIRECTIONS])
            .collect();
        let wide = |w: &[usize]| w[1] - w[0] > 20;
        let round = begun.first().zip(begun.last());
        let clear = begun.windows(2).all(wide) && round.is_none_or(|(a, b)| a + DIRECTIONS - b > 20);
        Self {
            images,
            selections,
            clear,
        }
    }

    /// det ∇H at the k-th direction, if the next direction belongs to the same sector.
    fn determinant(&self, k: usize) -> Option<f64> {
        let next = (k + 1) % DIRECTIONS;
        let step = cross(&direction(k), &direction(next));
        (self.selections[k] == self.selections[next])
            .then(|| cross(&self.images[k], &self.images[next]) / step)
    }

    /// The winding number of the image.
    fn turns(&self) -> f64 {
        let angle = |k: usize| {
            let (a, b) = (&self.images[k], &self.images[(k + 1) % DIRECTIONS]);
            cross(a, b).atan2(a[0] * b[0] + a[1] * b[1])
        };
        (0..DIRECTIONS).map(angle).sum::<f64>() / TAU
    }
}

#[test]
fn directional_derivatives_are_values_of_the_homogeneous_part() {
    let mut random = Random::new(5);
    for case in 0..300 {
        let n = 1 + case % 2;
        let nested = Nested::random(&mut random, 1 + case % 5, n, case % 2 == 0);
        let (straight, map) = (Traced::new(nested.straight()), Traced::new(nested));
        for k in (0..DIRECTIONS).step_by(97) {
            let (d, mut expected, mut found) = (direction(k), vec![0.0; n], vec![0.0; n]);
            value(&straight, &d, &mut expected);
            b_derivative(&map, &[0.0; 2], &d, 1e-12, &mut found).unwrap();
            for (a, b) in expected.iter().zip(&found) {
                assert!((a - b).abs() < 1e-9, "{case}: {expected:?} {found:?}");
            }
        }
    }
}

#[test]
fn essentially_active_are_the_selections_that_are_met() {
    let mut random = Random::new(11);
    let mut compared = 0;
    for case in 0..200 {
        let nested = Nested::random(&mut random, 2 + case % 3, 2, false);
        let circle = Circle::new(&nested);
        if !circle.clear {
            continue;
        }
        compared += 1;
        let met: BTreeSet<&Selection> = circle.selections.iter().collect();
        let map = Traced::new(nested);
        for selection in active_set(&map, &[0.0; 2], 1e-12).selections() {
            let found = essential_activity(&map, &[0.0; 2], &selection, 1e-12, 20_000).unwrap();
            let expected =
                [Activity::Inessential, Activity::Essential][usize::from(met.contains(&selection))];
            assert_eq!(found, expected, "{case}: {selection:?}");
        }
        let elements = b_subdifferential(&map, &[0.0; 2], 1e-12).unwrap();
        let elements: Vec<_> = elements.map(Result::unwrap).collect();
        let certain = elements.iter().filter(|e| e.activity == Activity::Essential);
        let certain: BTreeSet<&Selection> = certain.map(|e| &e.selection).collect();
        assert_eq!(certain, met, "{case}");
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn uniqueness_agrees_with_the_image_of_a_circle() {
    let mut random = Random::new(23);
    let (mut unique, mut sharp, mut not, mut doubts) = (0, 0, 0, 0);
    let load = Matrix::from_rows(&[[1.0, 0.0], [0.0, 1.0]]).unwrap();
    for case in 0..600 {
        let mut nested = Nested::random(&mut random, 2 + case % 3, 2, case % 4 == 0);
        // Close to the identity half of them are homeomorphisms.
        nested.outputs[0][0] += 2.0;
        nested.outputs[1][1] += 2.0;
        let circle = Circle::new(&nested);
        let determinants: Vec<f64> = (0..DIRECTIONS).filter_map(|k| circle.determinant(k)).collect();
        if !circle.clear || determinants.iter().any(|d| d.abs() < 1e-6) {
            continue;
        }
        let map = Traced::new(nested);
        let active = active_set(&map, &[0.0; 2], 1e-12);
        let found = local_uniqueness(&map, &[0.0; 2], &active, &load, 10_000).unwrap();
        let oriented = coherent_orientation(&map, &[0.0; 2], 1e-12, 10_000).unwrap();
        let one_sign = determinants.iter().all(|d| d * determinants[0] > 0.0);
        let homeomorphic = one_sign && (circle.turns().abs() - 1.0).abs() < 1e-6;
        match found {
            LocalUniqueness::Lipschitz {
                constant,
                sign,
                selections,
            } => {
                assert!(homeomorphic, "{case}");
                assert_eq!(sign, Some(determinants[0].signum() as i8), "{case}");
                // The largest ‖A⁻¹‖∞ over the sectors, where A maps two directions to their images.
                let inverse = |k: usize| {
                    let next = (k + 1) % DIRECTIONS;
                    let [d, e] = [direction(k), direction(next)];
                    let [p, q] = [&circle.images[k], &circle.images[next]];
                    let det = cross(p, q);
                    let row = |i: usize| {
                        ((d[i] * q[1] - e[i] * p[1]) / det).abs() + ((e[i] * p[0] - d[i] * q[0]) / det).abs()
                    };
                    row(0).max(row(1))
                };
                let whole = (0..DIRECTIONS).filter(|&k| circle.determinant(k).is_some());
                let expected = whole.map(inverse).fold(0.0, f64::max);
                assert!(
                    constant > expected * (1.0 - 1e-8),
                    "{case}: {constant} {expected}"
                );
                // A cell that is empty to first order may have points nearby, and then counts.
                let met: BTreeSet<&Selection> = circle.selections.iter().collect();
                if selections == met.len() as u64 {
                    assert!(
                        constant < expected * (1.0 + 1e-8),
                        "{case}: {constant} {expected}"
                    );
                    sharp += 1;
                }
                assert!(matches!(oriented, CoherentOrientation::Coherent { .. }), "{case}");
                unique += 1;
            }
            LocalUniqueness::Fails { .. } => {
                assert!(!one_sign, "{case}");
                assert!(
                    matches!(oriented, CoherentOrientation::Incoherent { .. }),
                    "{case}"
                );
                not += 1;
            }
            LocalUniqueness::Winds { .. } => {
                assert!(one_sign && !homeomorphic, "{case}");
                not += 1;
            }
            LocalUniqueness::Doubtful { .. } => doubts += 1,
            other => panic!("{case}: {other:?}"),
        }
    }
    let counts = (unique, sharp, not, doubts);
    assert!(
        unique > 100 && sharp > 50 && not > 30 && doubts < 40,
        "{counts:?}"
    );
}

#[test]
fn lists_are_what_the_selections_give_one_by_one() {
    let mut random = Random::new(41);
    let (mut compared, mut several) = (0, 0);
    for case in 0..300 {
        let mut nested = Nested::random(&mut random, 2 + case % 4, 2, false).straight();
        nested.shift = [random.symmetric(), random.symmetric()];
        let map = Traced::new(nested);
        let mut expected: Vec<[f64; 2]> = Vec::new();
        let mut clear = true;
        for selection in Selections::all(&map) {
            let mut jac = Matrix::zeros(map.pattern());
            map.jacobian(&selection, &[0.0; 2], &mut jac);
            let [a, b, c, d] = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| jac.get(i, j));
            let det = a * d - b * c;
            let mut r = [0.0; 2];
            map.residual(&selection, &[0.0; 2], &mut r);
            let y = [(b * r[1] - d * r[0]) / det, (c * r[0] - a * r[1]) / det];
            let mut theta = vec![0.0; map.num_sites()];
            map.test_functions(&y, &mut theta);
            clear &= det.abs() > 1e-6 && theta.iter().all(|t| t.abs() > 1e-9);
            if select(&map, &y) == selection {
                expected.push(y);
            }
        }
        if !clear {
            continue;
        }
        let found = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
        assert!(
            found.completeness.is_complete(),
            "{case}: {:?}",
            found.completeness
        );
        assert_eq!(found.solutions.len(), expected.len(), "{case}");
        for s in &found.solutions {
            let near = |e: &[f64; 2]| (e[0] - s.x[0]).hypot(e[1] - s.x[1]) < 1e-8 * (1.0 + e[0].hypot(e[1]));
            assert!(expected.iter().any(near), "{case}: {:?}", s.x);
        }
        compared += 1;
        several += usize::from(expected.len() > 1);
    }
    assert!(compared > 200 && several > 30, "{compared} {several}");
}

#[test]
fn arms_are_the_zeros_on_a_circle() {
    let mut random = Random::new(37);
    let (mut compared, mut several) = (0, 0);
    for case in 0..400 {
        let nested = Nested::random(&mut random, 2 + case % 4, 1, false);
        let circle = Circle::new(&nested);
        let changes = |k: &usize| {
            let next = (k + 1) % DIRECTIONS;
            (circle.images[*k][0] > 0.0) != (circle.images[next][0] > 0.0)
        };
        let expected: Vec<usize> = (0..DIRECTIONS).filter(changes).collect();
        // Where the value almost vanishes without changing sign the sample may mislead.
        let near = |k: usize| {
            let small = circle.images[k][0].abs() < 1e-2;
            let there = |&e: &usize| (k + DIRECTIONS - e).min(k.abs_diff(e)) < 100;
            !small || expected.iter().any(there)
        };
        if !circle.clear || !(0..DIRECTIONS).all(near) {
            continue;
        }
        let map = Traced::new(nested);
        let found = all_arms(&map, &[0.0; 2], &EnumerationOptions::default()).unwrap();
        assert!(
            matches!(found.completeness, Completeness::Undecided { .. }),
            "{case}"
        );
        assert_eq!(found.arms.len(), expected.len(), "{case}");
        for arm in &found.arms {
            let along = |&k: &usize| cross(&arm.tangent, &direction(k)).abs() < 2.0 * TAU / DIRECTIONS as f64;
            assert!(expected.iter().any(along), "{case}: {:?}", arm.tangent);
            assert_eq!(map.num_sites(), arm.selections[0].len());
        }
        compared += 1;
        several += usize::from(expected.len() > 2);
    }
    assert!(compared > 150 && several > 20, "{compared} {several}");
}

/// An implementation with a deliberate error.
struct Wrong {
    map: Traced<Nested>,
    fault: usize,
}

impl PiecewiseSmooth for Wrong {
    same_cells!(map);
    hand_on! {
        map:
        fn test_functions(&self, x: &[f64], out: &mut [f64]);
        fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]);
        fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix);
        fn pattern(&self) -> Pattern;
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl Derivatives for Wrong {
    hand_on! {
        map:
        fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]);
        fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]);
    }
    fn has_nested_kinks(&self) -> bool {
        true
    }
    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        let last = self.num_sites() - 1;
        match (d, self.fault) {
            // Those of the active pieces at x.
            (_, 1) => match d {
                Some(d) => self.map.test_derivatives(x, d, out),
                None => self.map.test_functions(x, out),
            },
            (Some(d), 2) => self.map.test_derivatives(x, d, out),
            _ => self.map.tests_of_selection(selection, x, d, out),
        }
        match (d, self.fault) {
            (None, 3) => out[last] += 1e-3,
            (Some(d), 4) => out[last] += 1e-3 * d[1],
            _ => {}
        }
    }
}

#[test]
fn the_checker_compares_the_tests_of_selections() {
    let mut random = Random::new(53);
    for fault in 0..5 {
        let map = Wrong {
            map: Traced::new(Nested::random(&mut random, 3, 2, false)),
            fault,
        };
        let samples: Vec<Vec<f64>> = (0..20).map(|_| random.vector(2, 1.0)).collect();
        let found = check(&map, &samples, &CheckOptions::default());
        match (fault, found) {
            // Test functions with kinks have no derivative there, which shows only at samples nearby.
            (0 | 1, Ok(_)) => {}
            (_, Err(CheckError::Findings(found))) if fault > 0 => {
                let own = found.iter().all(|f| f.kind == FindingKind::SelectionTests);
                assert!(own, "{fault}: {found:?}");
            }
            (_, other) => panic!("{fault}: {other:?}"),
        }
    }
}

/// Two sites with a friction bound that itself has a kink: λᵢ is the part of vᵢ between ∓(1 + |λⱼ − vⱼ/2|)/2.
#[derive(Clone)]
struct Throttles;

impl NonsmoothFunction for Throttles {
    fn num_vars(&self) -> usize {
        5
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, z: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        for i in 0..2 {
            let (v, other) = (z[i], z[3 - i] - z[1 - i] * 0.5);
            let bound = (kinks.abs(other) + 1.0) * 0.5;
            out[i] = z[2 + i] - kinks.project(v, -bound, bound) + v * v * 0.01;
        }
    }
}

#[test]
fn laws_of_interfaces_may_nest_their_kinks() {
    let body = Matrix::from_rows(&[[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.5]]).unwrap();
    let traces = Matrix::from_rows(&[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
    let load = LoadPath::affine(vec![0.3, -0.2, 0.1], vec![1.0, 0.4, -0.8]);
    let full = InterfaceProblem::from_parts(body, &traces, load, Traced::new(Throttles)).unwrap();
    let condensed = full.condensed().unwrap();
    let mut random = Random::new(61);
    let samples: Vec<Vec<f64>> = (0..30).map(|_| random.vector(6, 2.0)).collect();
    assert!(full.has_nested_kinks() && condensed.has_nested_kinks());
    check(&full, &samples, &CheckOptions::default()).unwrap();
    let few: Vec<Vec<f64>> = samples.iter().map(|x| x[..3].to_vec()).collect();
    check(&condensed, &few, &CheckOptions::default()).unwrap();
    // Both forms have the same transitions, and the same points between them as Newton's method finds.
    let options = ContinuationOptions::default().with_parameter_range((-4.0, 4.0));
    let mut x = [0.0, 0.0, -4.0];
    Newton::default().solve(&condensed, &mut x).unwrap();
    let branch = Branch::follow(&condensed, &x, Direction::Increasing, options.clone()).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    let mut own = vec![0.0; 6];
    own[5] = -4.0;
    Newton::default().solve(&full, &mut own).unwrap();
    let other = Branch::follow(&full, &own, Direction::Increasing, options).unwrap();
    let met = |b: &Branch| -> Vec<f64> { b.transitions.iter().map(|t| t.parameter()).collect() };
    let (first, second) = (met(&branch), met(&other));
    assert!(
        first.len() >= 4 && first.len() == second.len(),
        "{first:?} {second:?}"
    );
    for (a, b) in first.iter().zip(&second) {
        assert!((a - b).abs() < 1e-9, "{first:?} {second:?}");
    }
}

/// |y| − z and y − z are one function for y > 0, and not for y < 0.
struct OneOrTwo;

impl NonsmoothFunction for OneOrTwo {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let size = kinks.abs(x[0]);
        out[0] = x[0] + kinks.positive_part(size - x[1]) * 0.1 + x[0] * x[0];
        out[1] = x[1] + kinks.positive_part(x[0] - x[1]) * 0.1;
    }
}

/// Where y > 0 neither test function is positive without the other: such selections are known to be empty, not only to first order.
#[test]
fn tests_that_are_one_function_in_a_selection_exclude_its_cell() {
    let map = Traced::new(OneOrTwo);
    let elements = b_subdifferential(&map, &[0.0; 2], 1e-12).unwrap();
    let found: Vec<_> = elements.map(Result::unwrap).collect();
    let count = |piece: usize, activity: Activity| {
        let own = found.iter().filter(|e| e.selection.piece(0) == piece);
        own.filter(|e| e.activity == activity).count()
    };
    assert_eq!(
        (count(0, Activity::Essential), count(0, Activity::Undecided)),
        (2, 0)
    );
    assert_eq!(count(1, Activity::Essential), 3);
}
