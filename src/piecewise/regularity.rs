//! Regularity of the generalised Jacobians at a point.

use super::determinants::{Determinant, Determinants};
use super::hull::{self, Hull};
use super::orientation::{Cell, Cones, sign_of};
use super::{CertificateDoubt, PiecewiseError, PiecewiseSmooth, Selection, active_set};
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver, least_singular_value};
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::{DENSE, DOUBTFUL, HALVINGS};
use crate::words;
use std::fmt;

/// Whether all matrices of a set belonging to a point are regular.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Regularity {
    /// They are.
    Regular {
        /// Number of selections whose matrices span the set.
        selections: u64,
        /// The least singular value of these matrices, in the units of the map; `None` with more than 500 rows, and where it was decided
        /// without them.
        singular_value: Option<f64>,
        /// The selection whose matrix has it, and a unit vector whose image under this matrix has that length; `None` where
        /// `singular_value` is.
        weakest: Option<(Selection, Vec<f64>)>,
    },
    /// One is singular.
    Fails {
        /// It is Σ w_σ ∇_yH^(σ), w_σ ≥ 0 of sum 1; a single selection for a singular ∇_yH^(σ).
        combination: Vec<(Selection, f64)>,
        /// Its least singular value, 0 up to rounding; `None` with more than 500 rows.
        singular_value: Option<f64>,
        /// A unit vector whose image has this length; empty with more than 500 rows.
        direction: Vec<f64>,
    },
    /// The point is not in the cell of any piece at this site.
    Outside {
        /// The site.
        site: usize,
    },
    /// Not decided.
    Undecided {
        /// Selections examined, none of them singular.
        examined: u64,
        /// What is not known.
        doubt: CertificateDoubt,
    },
}

impl Regularity {
    /// Whether all matrices are known to be regular.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        matches!(self, Self::Regular { .. })
    }

    /// Whether one is known to be singular.
    #[must_use]
    pub fn fails(&self) -> bool {
        matches!(self, Self::Fails { .. })
    }
}

impl fmt::Display for Regularity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Regular { selections, .. } => write!(f, "regular ({})", words::selections(*selections)),
            Self::Fails { combination, .. } if combination.len() == 1 => {
                f.write_str("a selection is singular")
            }
            Self::Fails { .. } => f.write_str("a convex combination of selections is singular"),
            Self::Outside { site } => write!(f, "in no cell of site {site}"),
            Self::Undecided { examined, doubt } => {
                write!(f, "undecided after {}: {doubt}", words::selections(*examined))
            }
        }
    }
}

/// BD-regularity: whether all elements of the B-subdifferential ∂_B H(x) are regular (L. Qi, Math. Oper. Res.
/// 18 (1993)). Newton's method then converges superlinearly near the solution x, quadratically where ∇H^(σ)
/// are Lipschitz continuous, and ‖H‖ bounds the distance.
///
/// For the map of a curve, y alone varies (∇_yH, the first n columns). A matrix whose reciprocal condition,
/// rows and columns equilibrated, is below 1e-11 counts as singular. If the map gives
/// [exact](crate::piecewise::Structure::exact) coefficients, matrices whose regularity rounding leaves open
/// are decided in exact arithmetic instead, up to 200 rows and some tenths of a second
/// ([`CertificateDoubt::Rounding`] beyond). Test functions with |θ(x)| ≤ `tolerance` count as vanishing.
/// Which cells have points near x is decided by their unit gradients: those that are dependent up to rounding
/// count as dependent; a cell that is narrow, but wider than that, is a [`CertificateDoubt::Activity`]. At
/// most `cap` active selections are examined, with one factorisation each and, up to 500 rows, one singular
/// value decomposition, O(n³).
///
/// # Errors
/// Wrong lengths, maps with neither m = n nor m = n + 1, Jacobians that are not finite or leave their
/// pattern, and failures of the linear solver other than singularity.
///
/// ```
/// use semismooth::piecewise::{MinMap, Regularity, bd_regularity, cd_regularity};
/// // −|x| at 0: both slopes are regular, their mean is not.
/// let h = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = -x[0]; });
/// assert!(bd_regularity(&h, &[0.0], 1e-12, 100)?.is_regular());
/// let Regularity::Fails { combination, .. } = cd_regularity(&h, &[0.0], 1e-12, 100)? else { panic!() };
/// assert!(combination.iter().all(|(_, weight)| (weight - 0.5).abs() < 1e-9));
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn bd_regularity<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Regularity, PiecewiseError> {
    examine(&map, x, tolerance, cap, None)
}

/// CD-regularity: whether all elements of Clarke's generalised Jacobian ∂H(x) = conv ∂_B H(x) are regular. H is then a Lipschitz
/// homeomorphism near x (F. H. Clarke, Pacific J. Math. 64 (1976), Theorem 1); not every homeomorphism has this property.
///
/// It fails where two elements of ∂_B H(x) differ in the sign of their determinants, and holds if one of these arguments applies:
///
/// * Any choice of each row (or of each column) from those of the elements gives a determinant of the same sign: determinants are affine
///   in each row, and ∂H(x) lies in the set of all row-wise mixtures. For the natural map of a complementarity problem this says that a
///   Schur complement is a P-matrix.
/// * With M the inverse of their mean, the symmetric part of M V is positive definite for all V in ∂_B H(x).
/// * ∂H(x) is the segment between two matrices A and B, and A⁻¹B has no eigenvalue on the negative half-line.
///
/// Otherwise segments between two elements, and random combinations, are searched for a determinant of the other sign; if none is found the
/// answer is undecided ([`CertificateDoubt::Combinations`]). The elements are judged as in [`bd_regularity`]; other mixtures of their rows must be
/// clearly regular in floating-point arithmetic. Above 500 rows only signs and choices of rows and columns decide.
///
/// Conventions are those of [`bd_regularity`]; `cap` limits the choices of rows and the segments, too, each O(n³).
///
/// # Errors
/// As [`bd_regularity`].
pub fn cd_regularity<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Regularity, PiecewiseError> {
    let mut elements = Vec::new();
    let known = examine(&map, x, tolerance, cap, Some(&mut elements))?;
    convex_hull(known, &elements, cap)
}

/// CD-regularity, from what is known of BD-regularity and the elements.
pub(super) fn convex_hull(
    known: Regularity,
    elements: &[Element],
    cap: u64,
) -> Result<Regularity, PiecewiseError> {
    let Regularity::Regular { selections, .. } = known else {
        return Ok(known);
    };
    match hull::search(elements, cap)? {
        Hull::Regular => Ok(known),
        Hull::Crossing { from, mut weights } => {
            let mut end = elements[from].matrix.clone();
            hull::mix(elements, &weights, &mut end);
            let mut between = Between::new(&elements[from].matrix, &end)?;
            let share = between.crossing()?;
            weights.iter_mut().for_each(|w| *w *= share);
            weights[from] += 1.0 - share;
            let selections = elements.iter().map(|e| e.selection.clone());
            let combination = selections.zip(weights).filter(|c| c.1 > 0.0).collect();
            singular(combination, between.at(share))
        }
        Hull::Open => Ok(Regularity::Undecided {
            examined: selections,
            doubt: CertificateDoubt::Combinations,
        }),
    }
}

/// ∇_yH^(σ) of an active selection, regular.
pub(super) struct Element {
    pub(super) selection: Selection,
    /// n × n.
    pub(super) matrix: Matrix,
    /// Sign of its determinant, unless the solver has none.
    pub(super) sign: Option<i8>,
    /// Whether its cell is known to have points near x.
    pub(super) certain: bool,
}

/// BD-regularity; the different elements go to `keep`.
pub(super) fn examine(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    tolerance: f64,
    cap: u64,
    keep: Option<&mut Vec<Element>>,
) -> Result<Regularity, PiecewiseError> {
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
    if let Some(&site) = active.outside().first() {
        return Ok(Regularity::Outside { site });
    }
    let cones = Cones::new(Box::new(map), x, &active, n);
    let mut jac = Matrix::zeros(map.pattern());
    let mut determinants = Determinants::new(map, x, &jac, DOUBTFUL, true)?;
    let (mut tally, mut doubtful) = (Tally::new(keep), None);
    for (selection, examined) in active.selections().zip(0..) {
        if examined == cap {
            return Ok(tally.verdict(Some(CertificateDoubt::Limit)));
        }
        let cell = cones.element(&selection, &mut jac)?;
        if cell == Cell::Empty {
            continue;
        }
        let sign = match determinants.sign(&selection, &jac)? {
            Determinant::Sign(0) if cell == Cell::Open => {
                return singular(vec![(selection, 1.0)], &square(&jac)?);
            }
            Determinant::Sign(0) => {
                doubtful = doubtful.or(Some(CertificateDoubt::Activity));
                continue;
            }
            Determinant::Doubtful => {
                doubtful = doubtful.or(Some(CertificateDoubt::Rounding));
                continue;
            }
            Determinant::Sign(sign) => Some(sign),
            Determinant::Unavailable => None,
        };
        tally.add(Element {
            selection,
            matrix: square(&jac)?,
            sign,
            certain: cell == Cell::Open,
        })?;
    }
    Ok(tally.verdict(doubtful))
}

/// The regular elements seen so far.
#[derive(Default)]
pub(super) struct Tally<'k> {
    selections: u64,
    least: Option<f64>,
    weakest: Option<(Selection, Vec<f64>)>,
    /// Those that differ.
    keep: Option<&'k mut Vec<Element>>,
}

impl<'k> Tally<'k> {
    pub(super) fn new(keep: Option<&'k mut Vec<Element>>) -> Self {
        Self {
            keep,
            ..Self::default()
        }
    }

    pub(super) fn add(&mut self, element: Element) -> Result<(), PiecewiseError> {
        self.selections += 1;
        if element.matrix.nrows() <= DENSE {
            let (value, direction) = least_singular_value(&element.matrix)?;
            if self.least.is_none_or(|least| value < least) {
                self.least = Some(value);
                self.weakest = Some((element.selection.clone(), direction));
            }
        }
        if let Some(list) = &mut self.keep {
            // Kinks that cancel give one matrix several times.
            match list.iter_mut().find(|e| e.matrix == element.matrix) {
                Some(same) => same.certain |= element.certain,
                None => list.push(element),
            }
        }
        Ok(())
    }

    /// The verdict without a singular element; `doubt` is what is not known of others.
    pub(super) fn verdict(self, doubt: Option<CertificateDoubt>) -> Regularity {
        match doubt {
            Some(doubt) => undecided(self.selections, doubt),
            None => Regularity::Regular {
                selections: self.selections,
                singular_value: self.least,
                weakest: self.weakest,
            },
        }
    }
}

fn undecided(examined: u64, doubt: CertificateDoubt) -> Regularity {
    Regularity::Undecided { examined, doubt }
}

/// ∇_yH without the derivative with respect to a parameter.
pub(crate) fn square(jac: &Matrix) -> Result<Matrix, PiecewiseError> {
    let n = jac.nrows();
    let leading = jac.leading_columns(n);
    let (ptr, idx) = (leading.pattern.col_ptr.to_vec(), leading.pattern.row_idx.to_vec());
    let made =
        Pattern::from_csc(n, n, ptr, idx).and_then(|p| Matrix::from_values(p, leading.values.to_vec()));
    Ok(made.map_err(LinearError::from)?)
}

/// The data reported with a singular combination.
pub(crate) fn singular(
    combination: Vec<(Selection, f64)>,
    matrix: &Matrix,
) -> Result<Regularity, PiecewiseError> {
    let (singular_value, direction) = match matrix.nrows() <= DENSE {
        true => {
            let (value, direction) = least_singular_value(matrix)?;
            (Some(value), direction)
        }
        false => (None, Vec::new()),
    };
    Ok(Regularity::Fails {
        combination,
        singular_value,
        direction,
    })
}

/// The segment between two square matrices over one pattern.
pub(crate) struct Between<'a> {
    ends: [&'a Matrix; 2],
    mixed: Matrix,
    solver: AutoSolver,
}

impl<'a> Between<'a> {
    pub(crate) fn new(first: &'a Matrix, second: &'a Matrix) -> Result<Self, PiecewiseError> {
        let mut solver = AutoSolver::default();
        solver.analyze(first.as_ref().pattern)?;
        Ok(Self {
            ends: [first, second],
            mixed: first.clone(),
            solver,
        })
    }

    pub(crate) fn at(&mut self, share: f64) -> &Matrix {
        let ends = self.ends[0].values().iter().zip(self.ends[1].values());
        for (v, (a, b)) in self.mixed.values_mut().iter_mut().zip(ends) {
            *v = (1.0 - share) * a + share * b;
        }
        &self.mixed
    }

    /// Sign of the determinant at a parameter of the segment, 0 where it is singular.
    fn sign(&mut self, share: f64) -> Result<i8, PiecewiseError> {
        self.at(share);
        let n = self.mixed.nrows();
        Ok(sign_of(&mut self.solver, &self.mixed, n, 0.0)?.unwrap_or(0))
    }

    /// The parameter of the segment at which the determinant loses the sign that it has at the start and not at the end, by bisection.
    pub(crate) fn crossing(&mut self) -> Result<f64, PiecewiseError> {
        let sign = self.sign(0.0)?;
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match self.sign(middle)? == sign {
                true => low = middle,
                false => high = middle,
            }
        }
        Ok(high)
    }
}
