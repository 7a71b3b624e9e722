//! Sparse problems whose dense form would not fit into memory (run under `ulimit -v 8000000` to see): refused or done without it.

use crate::maps::two_pieces;
use semismooth::continuation::{Continuation, ContinuationOptions, Direction, arms_at};
use semismooth::enumeration::{EnumerationError, EnumerationOptions, all_arms, all_solutions};
use semismooth::piecewise::{
    Derivatives, LocalUniqueness, PiecewiseSmooth, Selection, Structure, active_set, local_uniqueness,
};
use semismooth::sparse::{Matrix, Pattern};

const LARGE: usize = 60_000;

/// min(yᵢ − α, yᵢ − 2 α) = 0 for the first `kinks` residuals, yᵢ = α for the others: one arm to either side of 0.
struct Kinks {
    n: usize,
    kinks: usize,
}

impl PiecewiseSmooth for Kinks {
    two_pieces!(self, [negative, positive], self.n + 1, self.n, self.kinks);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.fill(x[self.n]);
    }
    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        for (i, r) in out.iter_mut().enumerate() {
            *r = x[i] - self.slope(selection, i) * x[self.n];
        }
    }
    fn jacobian(&self, selection: &Selection, _: &[f64], jac: &mut Matrix) {
        for i in 0..self.n {
            jac.add(i, i, 1.0);
            jac.add(i, self.n, -self.slope(selection, i));
        }
    }
    fn pattern(&self) -> Pattern {
        let entries = (0..self.n).flat_map(|i| [(i, i), (i, self.n)]);
        Pattern::from_entries(self.n, self.n + 1, entries).unwrap()
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Derivatives for Kinks {
    fn test_gradient(&self, _: usize, _: usize, _: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        gradient[self.n] = 1.0;
    }
}

impl Structure for Kinks {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(site);
    }
}

impl Kinks {
    fn slope(&self, selection: &Selection, i: usize) -> f64 {
        if i < self.kinks {
            1.0 + selection.piece(i) as f64
        } else {
            1.0
        }
    }
}

#[test]
fn enumeration_is_refused_before_its_table_is_made() {
    let map = Kinks {
        n: LARGE,
        kinks: LARGE,
    };
    let found = all_solutions(&map, 1.0, &EnumerationOptions::default());
    assert!(
        matches!(
            found,
            Err(EnumerationError::TooLarge {
                rows: LARGE,
                unknowns: LARGE
            })
        ),
        "{found:?}"
    );
}

#[test]
fn arms_at_a_few_kinks_of_a_large_map() {
    let map = Kinks { n: LARGE, kinks: 5 };
    let origin = vec![0.0; LARGE + 1];
    let found = all_arms(&map, &origin, &EnumerationOptions::default()).unwrap();
    assert!(!found.completeness.has_gaps());
    assert_eq!(found.arms.len(), 2);
    assert_eq!(found.orientation, Some((1, 1)));
    let options = ContinuationOptions::default();
    let list = arms_at(&map, &origin, &options).unwrap();
    let (arms, complete) = (list.arms, !list.certainty.is_undecided());
    assert_eq!((arms.len(), complete), (2, true));
    let curve = Continuation::new(&map, &origin, Direction::Increasing, options);
    assert!(curve.is_ok());
}

#[test]
fn constants_of_local_uniqueness_for_many_loads() {
    // ∇_yH is the identity, so that ‖∂y/∂f‖∞ is the largest row sum of the load, whose columns are handled some at a time.
    let n = 150;
    let map = Kinks { n, kinks: 0 };
    let x = vec![0.0; n + 1];
    let entries: Vec<_> = (0..2 * n)
        .map(|j| (j % n, j, if j == 130 { -3.0 } else { 1.0 }))
        .collect();
    let load = Matrix::from_triplets(n, 2 * n, &entries).unwrap();
    let found = local_uniqueness(&map, &x, &active_set(&map, &x, 1e-9), &load, 10).unwrap();
    assert!(
        matches!(found, LocalUniqueness::Lipschitz { constant, .. } if (constant - 4.0).abs() < 1e-12),
        "{found:?}"
    );
}
