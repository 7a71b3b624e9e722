//! Lists for chains: springs in series, tunnel diodes in series; kernels that remain undecided.

use crate::maps::hand_on;
use semismooth::continuation::ContinuationOptions;
use semismooth::enumeration::{
    Completeness, EnumerationOptions, all_arms, all_solutions, all_solutions_until,
};
use semismooth::piecewise::{Facet, MinMap, PiecewiseSmooth, Selection, Structure};
use semismooth::sparse::Matrix;

/// Springs in series, each with kinks at the elongations 1 and 2, in displacements and forces; the load is α (or the displacement
/// of the end).
struct Springs {
    count: usize,
    stiffness: [f64; 3],
    held: bool,
}

impl Springs {
    fn elongation(&self, x: &[f64], i: usize) -> f64 {
        if i == 0 { x[0] } else { x[i] - x[i - 1] }
    }

    /// All springs at their first kink.
    fn at_kink(&self) -> Vec<f64> {
        let n = self.count;
        let mut x: Vec<f64> = (1..=n).map(|i| i as f64).chain(vec![1.0; n]).collect();
        x.push(if self.held { n as f64 } else { 1.0 });
        x
    }
}

impl PiecewiseSmooth for Springs {
    fn num_vars(&self) -> usize {
        2 * self.count + 1
    }
    fn num_residuals(&self) -> usize {
        2 * self.count
    }
    fn num_sites(&self) -> usize {
        self.count
    }
    fn num_pieces(&self, _: usize) -> usize {
        3
    }
    fn num_tests(&self, _: usize) -> usize {
        2
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        const CELLS: [&[Facet]; 3] = [
            &[Facet::negative(0)],
            &[Facet::positive(0), Facet::negative(1)],
            &[Facet::positive(1)],
        ];
        CELLS[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..self.count {
            let e = self.elongation(x, i);
            (out[2 * i], out[2 * i + 1]) = (e - 1.0, e - 2.0);
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let (n, k) = (self.count, self.stiffness);
        for i in 0..n {
            let e = self.elongation(x, i);
            let force = match s.piece(i) {
                0 => k[0] * e,
                1 => k[0] + k[1] * (e - 1.0),
                _ => k[0] + k[1] + k[2] * (e - 2.0),
            };
            out[i] = x[n + i] - force;
            out[n + i] = match (i + 1 < n, self.held) {
                (true, _) => x[n + i] - x[n + i + 1],
                (false, true) => x[n - 1] - x[2 * n],
                (false, false) => x[n + i] - x[2 * n],
            };
        }
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        let n = self.count;
        for i in 0..n {
            let k = self.stiffness[s.piece(i)];
            jac.add(i, n + i, 1.0);
            jac.add(i, i, -k);
            if i > 0 {
                jac.add(i, i - 1, k);
            }
            if i + 1 < n {
                jac.add(n + i, n + i, 1.0);
                jac.add(n + i, n + i + 1, -1.0);
            } else {
                jac.add(n + i, if self.held { n - 1 } else { n + i }, 1.0);
                jac.add(n + i, 2 * n, -1.0);
            }
        }
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Structure for Springs {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        *rows = vec![site];
    }
}

#[test]
fn a_stiffening_chain_has_one_solution_everywhere() {
    let options = EnumerationOptions::default().with_max_nodes(20_000);
    for held in [false, true] {
        let map = Springs {
            count: 40,
            stiffness: [1.0, 3.0, 9.0],
            held,
        };
        let arms = all_arms(&map, &map.at_kink(), &options).unwrap();
        assert!(!arms.completeness.has_gaps(), "{:?}", arms.completeness);
        assert_eq!((arms.arms.len(), arms.orientation), (2, Some((1, 1))));
        // Elongation of each spring, α, and the active selections: at the kink 2⁴⁰.
        for (e, force) in [(0.5, 0.5), (0.75, 0.75), (1.0, 1.0), (1.5, 2.5), (1.7, 3.1)] {
            let alpha = if held { 40.0 * e } else { force };
            let set = all_solutions(&map, alpha, &options).unwrap();
            // All selections are examined, but the map does not state its coefficients.
            assert!(
                !set.completeness.has_gaps(),
                "e = {e}, held: {held}: {:?}",
                set.completeness
            );
            assert!(set.continua.is_empty());
            let [one] = set.solutions.as_slice() else {
                panic!("{} solutions at e = {e}", set.solutions.len());
            };
            for i in 0..40 {
                assert!((map.elongation(&one.x, i) - e).abs() < 1e-12);
                assert!((one.x[40 + i] - force).abs() < 1e-12);
            }
            let count = if e == 1.0 { 40f64.exp2() } else { 1.0 };
            assert_eq!(one.num_selections, count, "e = {e}, held: {held}");
            assert!(one.selections.len() <= 256 && one.det_signs.len() == one.selections.len());
        }
    }
}

/// The same springs in their displacements alone, without stating which rows depend on which springs.
struct Coupled(Springs);

impl PiecewiseSmooth for Coupled {
    fn num_vars(&self) -> usize {
        self.0.count + 1
    }
    fn num_residuals(&self) -> usize {
        self.0.count
    }
    fn num_sites(&self) -> usize {
        self.0.count
    }
    hand_on! {
        0:
        fn num_pieces(&self, site: usize) -> usize;
        fn num_tests(&self, site: usize) -> usize;
        fn cell(&self, site: usize, piece: usize) -> &[Facet];
        fn test_functions(&self, x: &[f64], out: &mut [f64]);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let n = self.0.count;
        // With zero forces the residuals of the first rows are the spring forces.
        let mut free = x[..n].to_vec();
        free.resize(2 * n, 0.0);
        free.push(x[n]);
        let mut rows = vec![0.0; 2 * n];
        self.0.residual(s, &free, &mut rows);
        for i in 0..n {
            let next = if i + 1 < n { -rows[i + 1] } else { x[n] };
            out[i] = -rows[i] - next;
        }
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        let n = self.0.count;
        for i in 0..n {
            let k = self.0.stiffness[s.piece(i)];
            for (row, sign) in [(Some(i), 1.0), (i.checked_sub(1), -1.0)] {
                let Some(row) = row else { continue };
                jac.add(row, i, sign * k);
                if i > 0 {
                    jac.add(row, i - 1, -sign * k);
                }
            }
        }
        jac.add(n - 1, n, -1.0);
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

#[test]
fn rows_that_couple_all_sites_are_searched_as_sums() {
    let map = Coupled(Springs {
        count: 40,
        stiffness: [1.0, 3.0, 9.0],
        held: false,
    });
    let options = EnumerationOptions::default().with_max_nodes(2_000);
    let mut kink: Vec<f64> = (1..=40).map(f64::from).collect();
    kink.push(1.0);
    let arms = all_arms(&map, &kink, &options).unwrap();
    assert!(!arms.completeness.has_gaps(), "{:?}", arms.completeness);
    assert_eq!((arms.arms.len(), arms.orientation), (2, Some((1, 1))));
    for (e, alpha) in [(0.5, 0.5), (1.0, 1.0), (1.5, 2.5), (3.0, 13.0)] {
        let set = all_solutions(&map, alpha, &options).unwrap();
        assert!(
            !set.completeness.has_gaps(),
            "α = {alpha}: {:?}",
            set.completeness
        );
        // Nothing of this is proven.
        assert!(!set.completeness.is_complete() && set.index_sum.is_none());
        let [one] = set.solutions.as_slice() else {
            panic!("{} solutions at α = {alpha}", set.solutions.len());
        };
        assert!((0..40).all(|i| (map.0.elongation(&one.x, i) - e).abs() < 1e-12));
        assert_eq!(one.num_selections, if e == 1.0 { 40f64.exp2() } else { 1.0 });
        assert!(one.selections.len() <= 256);
    }
}

#[test]
fn limits_of_time_leave_what_was_found() {
    use semismooth::continuation::{Branch, Direction, TransitionKind};
    use std::time::Duration;
    let map = Springs {
        count: 40,
        stiffness: [1.0, -0.5, 2.0],
        held: false,
    };
    let none = EnumerationOptions::default().with_max_time(Some(Duration::ZERO));
    let set = all_solutions(&map, 0.7, &none).unwrap();
    assert!(matches!(
        set.completeness,
        Completeness::Incomplete { examined: 0.0, .. }
    ));
    let arms = all_arms(&map, &map.at_kink(), &none).unwrap();
    assert!(!arms.completeness.is_complete());
    // A callback that asks to stop is not called much longer, and the list is not called complete.
    let asked = std::cell::Cell::new(0);
    let stop = || {
        asked.set(asked.get() + 1);
        asked.get() > 100
    };
    let set = all_solutions_until(&map, 0.7, &EnumerationOptions::default(), &stop).unwrap();
    assert!(matches!(set.completeness, Completeness::Incomplete { examined, .. } if examined < 40f64.exp2()));
    assert!((101..400).contains(&asked.get()), "{}", asked.get());
    let never = all_solutions_until(&map, 0.1, &EnumerationOptions::default(), &|| false).unwrap();
    assert_eq!(
        never,
        all_solutions(&map, 0.1, &EnumerationOptions::default()).unwrap()
    );
    // 2⁴⁰ arms leave the point; the curve goes on along one of them, and the list is not called complete.
    let options = ContinuationOptions::default()
        .with_parameter_range((0.0, 4.0))
        .with_max_time(Some(Duration::from_secs(2)));
    let branch = Branch::follow(&map, &vec![0.0; 81], Direction::Increasing, options).unwrap();
    let kink = &branch.transitions[0];
    assert!(!kink.complete && kink.kind != TransitionKind::End && kink.followed.is_some());
    assert!(!kink.arms.is_empty() && kink.arms.len() < 1 << 20);
    for arm in &kink.arms {
        let rates: Vec<f64> = (0..40).map(|i| map.elongation(&arm.tangent, i)).collect();
        let force = arm.tangent[40];
        for rate in rates {
            let law = if rate <= 0.0 { rate } else { -0.5 * rate };
            assert!((law - force).abs() < 1e-9);
        }
    }
}

/// A curve ends within a search for arms, midway or at its start, once the callback says so; a callback that never does changes nothing.
#[test]
fn curves_end_within_a_search_on_request() {
    use semismooth::continuation::{Branch, Continuation, ContinuationError, Direction, Termination};
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};
    let springs = |count| Springs {
        count,
        stiffness: [1.0, -0.5, 2.0],
        held: false,
    };
    let options = || ContinuationOptions::default().with_parameter_range((0.0, 4.0));
    let map = springs(40);
    let follow = |x: &[f64], direction, limit: usize| {
        let asked = AtomicUsize::new(0);
        let over = || asked.fetch_add(1, Ordering::Relaxed) >= limit;
        let curve = Continuation::new_until(&map, x, direction, options(), over);
        let found = curve.and_then(|curve| Branch::collect(curve, |_| ControlFlow::Continue(())));
        (found, asked.load(Ordering::Relaxed))
    };
    let (branch, asked) = follow(&vec![0.0; 81], Direction::Increasing, 300);
    let branch = branch.unwrap();
    assert_eq!(branch.termination, Termination::Interrupted);
    assert!(
        branch.transitions.iter().all(|t| !t.complete) && (301..1_000).contains(&asked),
        "{asked}"
    );
    let (branch, asked) = follow(&map.at_kink(), Direction::Increasing, 0);
    assert!(
        matches!(branch, Err(ContinuationError::UndecidedArms { .. })),
        "{branch:?}"
    );
    assert!((1..400).contains(&asked), "{asked}");

    let few = springs(3);
    let start = vec![0.0; 7];
    let alone = Branch::follow(&few, &start, Direction::Increasing, options()).unwrap();
    let never = Continuation::new_until(&few, &start, Direction::Increasing, options(), || false);
    let never = never.and_then(|curve| Branch::collect(curve, |_| ControlFlow::Continue(())));
    assert_eq!(alone, never.unwrap());
}

#[cfg(feature = "autodiff")]
mod diodes {
    use super::*;
    use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

    /// Tunnel diodes in series with a resistor of ½, the k-th with a current (1 + k/20) times that of the first.
    /// x = (voltages, current, source).
    struct Diodes(usize);

    impl NonsmoothFunction for Diodes {
        fn num_vars(&self) -> usize {
            self.0 + 2
        }
        fn num_residuals(&self) -> usize {
            self.0 + 1
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            let k = self.0;
            let mut sum = x[k] * 0.5 - x[k + 1];
            for d in 0..k {
                let peak = kinks.positive_part(x[d] - 1.0);
                let valley = kinks.positive_part(x[d] - 3.0);
                let current = x[d] * 2.0 - peak * 2.75 + valley * 1.75;
                out[d] = x[k] - current * (1.0 + 0.05 * d as f64);
                sum += x[d];
            }
            out[k] = sum;
        }
    }

    /// Number of solutions by all 3^k choices of branches of the characteristics, in each of which the current i solves one equation.
    fn by_branches(k: usize, source: f64) -> usize {
        // v = a + b i/s on each branch, for v in a range.
        const BRANCHES: [(f64, f64, f64, f64); 3] = [
            (0.0, 0.5, f64::NEG_INFINITY, 1.0),
            (11.0 / 3.0, -4.0 / 3.0, 1.0, 3.0),
            (2.5, 1.0, 3.0, f64::INFINITY),
        ];
        let mut count = 0;
        for mut code in 0..3usize.pow(k as u32) {
            let mut chosen = Vec::with_capacity(k);
            let (mut constant, mut rate) = (-source, 0.5);
            for d in 0..k {
                let (a, b, low, high) = BRANCHES[code % 3];
                code /= 3;
                let b = b / (1.0 + 0.05 * d as f64);
                (constant, rate) = (constant + a, rate + b);
                chosen.push((a, b, low, high));
            }
            let current = -constant / rate;
            let inside = |&(a, b, low, high): &(f64, f64, f64, f64)| {
                let v = a + b * current;
                v > low && v < high
            };
            count += usize::from(chosen.iter().all(inside));
        }
        count
    }

    #[test]
    fn traced_maps_are_pruned() {
        let map = Traced::new(Diodes(12));
        let options = EnumerationOptions::default().with_max_nodes(60_000);
        for source in [2.03, 6.07, 9.31] {
            let set = all_solutions(&map, source, &options).unwrap();
            assert_eq!(set.completeness, Completeness::Complete, "E = {source}");
            assert_eq!(set.solutions.len(), by_branches(12, source), "E = {source}");
            assert_eq!(set.index_sum, Some(1));
        }
    }
}

#[test]
fn undecided_kernels_are_named() {
    use semismooth::continuation::{Branch, ContinuationError, Direction};
    // Two flows of equal cost share one demand: x₀ + x₁ = α twice, and x₂ is separate.
    let map = MinMap::curve(3, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for row in 0..2 {
            a[row] = (x[0] + x[1] - x[3]) * (1.0 + row as f64);
            b[row] = a[row] + 1.0;
        }
        (a[2], b[2]) = (x[2] - 0.5, x[2]);
    });
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let error = Branch::follow(&map, &[0.5, 0.5, 0.5, 1.0], Direction::Increasing, options).unwrap_err();
    let ContinuationError::UndecidedArms {
        found,
        kernel,
        mut variables,
        ..
    } = error.clone()
    else {
        panic!("{error}");
    };
    variables.sort_unstable();
    assert_eq!((found, kernel, variables), (0, 2, vec![0, 1, 3]));
    let text = error.to_string();
    assert!(
        text.contains("undecided") && text.contains("kernel of dimension 2 along x["),
        "{text}"
    );
    assert!(!text.contains("more"), "{text}");
    // Twelve flows share one demand: eight are named.
    let map = MinMap::curve(12, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for row in 0..12 {
            a[row] = x[..12].iter().sum::<f64>() - x[12];
            b[row] = a[row] + 1.0;
        }
    });
    let start = [vec![1.0 / 12.0; 12], vec![1.0]].concat();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let error = Branch::follow(&map, &start, Direction::Increasing, options).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("kernel of dimension 12 along x["), "{text}");
    assert_eq!(
        (text.matches("x[").count(), text.contains(" and 5 more")),
        (8, true),
        "{text}"
    );
}
