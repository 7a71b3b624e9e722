use super::error::check_vector;
use super::{ActiveSet, PiecewiseError, PiecewiseSmooth, Selection, TestLayout, active_set, cell_margin};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::sparse::Matrix;

/// The B-derivative H'(x; d): the directional derivative of H at x along d, written to `out` (length n). Returns a selection
/// whose cell d points into, so that H'(x; d) = ∇H^(σ)(x) d.
///
/// Test functions with |θ(x)| ≤ `tolerance` count as vanishing.
///
/// # Errors
/// Wrong lengths, values that are not finite, a Jacobian entry outside the pattern.
///
/// ```
/// use semismooth::piecewise::{MinMap, b_derivative};
/// let h = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = -x[0]; });
/// let mut out = [0.0];
/// b_derivative(&h, &[0.0], &[2.0], 1e-12, &mut out)?; // min(x, −x) = −|x|
/// assert!((out[0] + 2.0).abs() < 1e-9);
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn b_derivative<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    d: &[f64],
    tolerance: f64,
    out: &mut [f64],
) -> Result<Selection, PiecewiseError> {
    b_derivative_of(&map, x, d, tolerance, out)
}

fn b_derivative_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    d: &[f64],
    tolerance: f64,
    out: &mut [f64],
) -> Result<Selection, PiecewiseError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    check_vector("the point x", x, m)?;
    check_vector("the direction d", d, m)?;
    if out.len() != n {
        return Err(PiecewiseError::Length {
            what: "the output",
            expected: n,
            found: out.len(),
        });
    }
    let pattern = map.pattern();
    if pattern.nrows() != n || pattern.ncols() != m {
        return Err(PiecewiseError::Length {
            what: "the declared pattern (rows times columns)",
            expected: n * m,
            found: pattern.nrows() * pattern.ncols(),
        });
    }
    let active = active_set(map, x, tolerance);
    let layout = TestLayout::new(map);
    let mut rates = vec![0.0; layout.total()];
    map.test_derivatives(x, d, &mut rates);
    let selection = pointed_into(map, &layout, &active, &rates);
    let mut jac = Matrix::zeros(pattern);
    map.jacobian(&selection, x, &mut jac);
    if let Some((row, col)) = jac.stray() {
        return Err(PiecewiseError::StrayEntry { row, col });
    }
    jac.mul_vec(d, out);
    Ok(selection)
}

/// Of the active pieces of each degenerate site, the one into whose cell a direction with the given rates of the test functions
/// points most.
fn pointed_into(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    active: &ActiveSet,
    rates: &[f64],
) -> Selection {
    let mut selection = active.first().clone();
    for (site, pieces) in active.degenerate_sites() {
        let range = layout.range(*site);
        let mut best = f64::NEG_INFINITY;
        for &piece in pieces {
            let facets: Vec<_> = map
                .cell(*site, piece)
                .iter()
                .filter(|f| {
                    active
                        .vanishing()
                        .binary_search(&(range.start + f.test()))
                        .is_ok()
                })
                .copied()
                .collect();
            let margin = cell_margin(&facets, &rates[range.clone()]);
            if margin > best {
                best = margin;
                selection.set(*site, piece);
            }
        }
    }
    selection
}

/// Whether H is coherently oriented at a point: det ∇_yH^(σ) has one sign for all active selections σ.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum CoherentOrientation {
    /// All active selections have determinants of this sign: H is locally a Lipschitz homeomorphism in y when pieces are affine.
    Coherent {
        /// The sign, −1 or +1.
        sign: i8,
    },
    /// Two active selections differ in sign, or one is singular.
    Incoherent {
        /// A selection and the sign of its determinant.
        first: (Selection, i8),
        /// One whose sign differs (0: singular).
        second: (Selection, i8),
    },
    /// Not decided: the cap was reached with all signs equal so far.
    Undecided {
        /// Selections examined.
        examined: u64,
        /// Selections active, if the number does not overflow.
        total: Option<u128>,
    },
}

/// Examines up to `cap` active selections at x for coherent orientation of ∇_yH (the first n columns of ∇H).
///
/// # Errors
/// Wrong lengths, maps with neither m = n nor m = n + 1, Jacobians that are not finite, and matrices so large that no determinant
/// is available ([`LinearError::Solver`]).
pub fn coherent_orientation<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<CoherentOrientation, PiecewiseError> {
    coherent_orientation_of(&map, x, tolerance, cap)
}

fn coherent_orientation_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<CoherentOrientation, PiecewiseError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    if m != n && m != n + 1 {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "as many variables as residuals, or one more (the parameter)",
        });
    }
    check_vector("the point x", x, m)?;
    let active = active_set(map, x, tolerance);
    let mut jac = Matrix::zeros(map.pattern());
    let mut solver = AutoSolver::default();
    solver.analyze(jac.leading_columns(n).pattern)?;
    let mut first: Option<(Selection, i8)> = None;
    for (selection, examined) in active.selections().zip(0..) {
        if examined == cap {
            return Ok(CoherentOrientation::Undecided {
                examined,
                total: active.total(),
            });
        }
        jac.clear();
        map.jacobian(&selection, x, &mut jac);
        if let Some((row, col)) = jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col });
        }
        let sign = det_sign(&mut solver, &jac, n)?;
        match &first {
            _ if sign == 0 => {
                let other = first.take().unwrap_or((selection.clone(), 0));
                return Ok(CoherentOrientation::Incoherent {
                    first: other,
                    second: (selection, 0),
                });
            }
            None => first = Some((selection, sign)),
            Some((_, s)) if *s == sign => {}
            Some(f) => {
                return Ok(CoherentOrientation::Incoherent {
                    first: f.clone(),
                    second: (selection, sign),
                });
            }
        }
    }
    Ok(CoherentOrientation::Coherent {
        sign: first.map_or(1, |f| f.1),
    })
}

/// Sign of det of the leading n columns; 0 when singular.
fn det_sign<L: LinearSolver>(solver: &mut L, jac: &Matrix, n: usize) -> Result<i8, PiecewiseError> {
    match solver.factor(jac.leading_columns(n)) {
        Ok(()) => match solver.log_det() {
            Some((sign, _)) => Ok(sign),
            None => Err(LinearError::Solver {
                what: "no determinant is available for a sparse matrix of this size".into(),
            }
            .into()),
        },
        Err(LinearError::Singular { .. }) => Ok(0),
        Err(e) => Err(e.into()),
    }
}
