//! Located parameters do not depend on the units of the rows of H.
#![cfg(feature = "autodiff")]

use crate::maps::{hand_on, same_cells};
use semismooth::complementarity::{Autodiff, Mcp, SmoothFunction};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::piecewise::{Derivatives, Description, PiecewiseSmooth, PiecewiseSmoothExt, Real, Selection};
use semismooth::sparse::{Matrix, Pattern};

const N: usize = 31;

/// −u″ = α eᵘ on a grid, where u is below an obstacle; each row in its own unit.
struct Bratu {
    units: Vec<f64>,
}

impl SmoothFunction for Bratu {
    fn num_vars(&self) -> usize {
        N + 1
    }
    fn num_values(&self) -> usize {
        N
    }
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let inverse = ((N + 1) * (N + 1)) as f64;
        for i in 0..N {
            let mut second = x[i] * 2.0;
            if i > 0 {
                second -= x[i - 1];
            }
            if i + 1 < N {
                second -= x[i + 1];
            }
            out[i] = (second * inverse - x[N] * x[i].exp()) * self.units[i];
        }
    }
    fn pattern(&self) -> Pattern {
        let row = |i: usize| [i.saturating_sub(1), i, (i + 1).min(N - 1), N].map(|j| (i, j));
        let mut entries: Vec<_> = (0..N).flat_map(row).collect();
        entries.dedup();
        Pattern::from_entries(N, N + 1, entries).unwrap()
    }
}

fn obstacle(units: Vec<f64>) -> Mcp<Autodiff<Bratu>> {
    let height = |i: usize| 0.35 + 0.3 * (i + 1) as f64 / (N + 1) as f64;
    let upper = (0..N).map(height).collect();
    Mcp::new(Autodiff::new(Bratu { units }), vec![f64::NEG_INFINITY; N], upper).unwrap()
}

/// A map with scaled rows.
struct Rows<M> {
    map: M,
    factors: Vec<f64>,
}

impl<M: PiecewiseSmooth> PiecewiseSmooth for Rows<M> {
    same_cells!(map);
    hand_on! {
        map:
        fn pattern(&self) -> Pattern;
        fn description(&self) -> Option<&dyn Description>;
        fn test_functions(&self, x: &[f64], out: &mut [f64]);
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        self.map.residual(selection, x, out);
        out.iter_mut().zip(&self.factors).for_each(|(o, f)| *o *= f);
    }
    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        self.map.jacobian(selection, x, jac);
        let factors: Vec<f64> = jac.triplets().map(|(i, ..)| self.factors[i]).collect();
        jac.values_mut()
            .iter_mut()
            .zip(factors)
            .for_each(|(v, f)| *v *= f);
    }
}

impl<M: PiecewiseSmooth> Derivatives for Rows<M> {
    hand_on! {
        map:
        fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]);
        fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]);
    }
}

fn located<P: PiecewiseSmooth>(map: &P) -> Vec<f64> {
    let options = ContinuationOptions::default().with_parameter_range((0.0, 12.0));
    let branch = Branch::follow(map, &[0.0; N + 1], Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    branch.transitions.iter().map(|t| t.parameter()).collect()
}

fn agree(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-11 * b.abs(), "{a} {b}");
    }
}

/// Powers of ten from 10⁻¹² to 10¹², spread by the golden ratio.
fn spread(k: usize) -> Vec<f64> {
    let share = |i: usize| ((i + 1) as f64 * 0.618_034 + 0.37 * k as f64).fract();
    (0..N).map(|i| 10f64.powf(24.0 * share(i) - 12.0)).collect()
}

#[test]
fn rows_of_the_map_in_any_units() {
    let unit = vec![((N + 1) as f64).powi(-2); N];
    let expected = located(&obstacle(unit.clone()));
    assert!(expected.len() > 10);
    for k in 0..5 {
        let map = Rows {
            map: obstacle(unit.clone()),
            factors: spread(k),
        };
        agree(&located(&map), &expected);
    }
}

/// The natural map of F has a facet where x − F(x) meets a bound: large units of F must not swamp x.
#[test]
fn forces_in_any_units() {
    let expected = located(&obstacle(vec![((N + 1) as f64).powi(-2); N]));
    for unit in [1e-12, 1e-4, 1.0, 1e4, 1e12] {
        agree(&located(&obstacle(vec![unit; N])), &expected);
    }
    for k in 0..3 {
        agree(&located(&obstacle(spread(k))), &expected);
    }
}
