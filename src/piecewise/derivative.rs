use super::orientation::{Cones, Signs, examine, no_determinant};
use super::vanishing::pointed_into;
use super::{CertificateDoubt, PiecewiseError, PiecewiseSmooth, Selection, TestLayout, active_set};
use crate::InputError;
use crate::input::{check_length, check_vector};
use crate::sparse::Matrix;
use crate::words;
use std::fmt;

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
    check_length("the output", out.len(), n)?;
    let pattern = map.pattern();
    if pattern.nrows() != n || pattern.ncols() != m {
        return Err(PiecewiseError::Input(InputError::Length {
            what: "the declared pattern (rows times columns)",
            expected: n * m,
            found: pattern.nrows() * pattern.ncols(),
        }));
    }
    let active = active_set(map, x, tolerance);
    let layout = TestLayout::new(map);
    let selection = pointed_into(map, &layout, &active, x, d);
    let mut jac = Matrix::zeros(pattern);
    map.jacobian(&selection, x, &mut jac);
    if let Some((row, col)) = jac.stray() {
        return Err(PiecewiseError::StrayEntry { row, col });
    }
    jac.mul_vec(d, out);
    Ok(selection)
}

/// Whether H is coherently oriented at a point: det ∇_yH^(σ) has one sign for all essentially active selections σ, those whose cell has
/// interior points arbitrarily near x while y moves.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum CoherentOrientation {
    /// All have determinants of this sign. Necessary for H to be a Lipschitz homeomorphism of y near x, and sufficient where no more
    /// than four cells meet; [`local_uniqueness`](super::local_uniqueness) decides in general.
    Coherent {
        /// The sign, −1 or +1.
        sign: i8,
    },
    /// Two essentially active selections differ in sign, or one is singular.
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
    /// Not decided: the sign of a selection is not known, or it differs and it is not known whether its cell has points near x.
    Doubtful {
        /// That selection.
        selection: Selection,
        /// What is not known.
        doubt: CertificateDoubt,
    },
}

impl fmt::Display for CoherentOrientation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coherent { sign } => write!(f, "yes, sign {sign:+}"),
            Self::Incoherent { second: (_, 0), .. } => f.write_str("no, a selection is singular"),
            Self::Incoherent { .. } => f.write_str("no, determinants differ in sign"),
            Self::Undecided { examined, .. } => write!(f, "undecided after {}", words::selections(*examined)),
            Self::Doubtful { doubt, .. } => write!(f, "undecided: {doubt}"),
        }
    }
}

/// Examines up to `cap` active selections at x for coherent orientation of ∇_yH (the first n columns of ∇H).
///
/// Signs are those of an LU factorisation in floating-point numbers. Where rounding may decide (a reciprocal
/// condition number, rows and columns equilibrated so that units of H and y do not matter, below 1e-10 and
/// some roundings a row), those of maps that give [exact](crate::piecewise::Structure::exact) coefficients
/// are decided in exact arithmetic, up to 200 rows and some tenths of a second. For other maps a matrix
/// counts as singular, sign 0, where that number is below 1e-14; [`bd_regularity`](super::bd_regularity)
/// requires 1e-11.
///
/// # Errors
/// Wrong lengths, maps with neither m = n nor m = n + 1, Jacobians that are not finite, and matrices so large
/// that no determinant is available ([`LinearError::Solver`](crate::linear::LinearError::Solver)).
pub fn coherent_orientation<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<CoherentOrientation, PiecewiseError> {
    orientation_of(&map, x, tolerance, cap)?.ok_or_else(no_determinant)
}

/// [`coherent_orientation`]; `None` where the linear solver has no determinants.
pub(super) fn orientation_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Option<CoherentOrientation>, PiecewiseError> {
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
    let cones = Cones::new(Box::new(map), x, &active, n);
    let signs = examine(&cones, &active, cap, (0.0, true), &mut |_| Ok(()))?;
    Ok(Some(match signs {
        Signs::Coherent { sign: Some(sign), .. } => CoherentOrientation::Coherent { sign },
        Signs::Coherent { sign: None, .. } | Signs::NoDeterminant => return Ok(None),
        Signs::Incoherent { first, second } => CoherentOrientation::Incoherent { first, second },
        Signs::Capped { examined } => CoherentOrientation::Undecided {
            examined,
            total: active.total(),
        },
        Signs::Doubtful { selection } => CoherentOrientation::Doubtful {
            selection,
            doubt: CertificateDoubt::Activity,
        },
        Signs::Rounding { selection } => CoherentOrientation::Doubtful {
            selection,
            doubt: CertificateDoubt::Rounding,
        },
    }))
}
