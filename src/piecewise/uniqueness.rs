use std::borrow::Cow;
use std::fmt;

use super::determinants::Examined;
use super::orientation::{Cones, Side, Signs, examine, no_determinant};
use super::{ActiveSet, PiecewiseError, PiecewiseSmooth, Selection};
use crate::InputError;
use crate::input::check_vector;
use crate::linear::{LinearError, LinearSolver};
use crate::sparse::Matrix;
use crate::tolerances::{COLUMNS, DOUBTFUL};
use crate::words;

/// Up to this number of cells cannot wind round x twice.
const FEW: u64 = 4;
/// Points whose preimages are counted, until none lies near a boundary of cells.
pub(super) const TRIES: u64 = 6;

/// Whether a solution is locally unique, and a Lipschitz function of the load.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LocalUniqueness {
    /// It is: H is coherently oriented in y, and its B-derivative in y is a homeomorphism.
    Lipschitz {
        /// The common sign of det ∇_yH^(σ); `None` where a single selection is active and no determinant is known.
        sign: Option<i8>,
        /// max over active σ of ‖(∇_yH^(σ))⁻¹ ∂_fH^(σ)‖∞ (largest row sum of absolute values).
        constant: f64,
        /// Number of active selections whose cells are not known to be empty near x.
        selections: u64,
    },
    /// Two essentially active selections differ in the sign of their determinants, or one is singular: folds and branchings.
    Fails {
        /// An active selection and the sign of its determinant.
        first: (Selection, i8),
        /// One whose sign differs (0: singular).
        second: (Selection, i8),
    },
    /// The signs agree, but the B-derivative takes one value in two directions: it winds round x more than once.
    Winds {
        /// A selection and a direction of y that points into its cell.
        first: (Selection, Vec<f64>),
        /// Another one with the same image.
        second: (Selection, Vec<f64>),
    },
    /// The point is not in the cell of any piece at this site.
    Outside {
        /// The site.
        site: usize,
    },
    /// Not decided: only the first selections of a longer list were examined, all of one sign.
    Undecided {
        /// Selections examined.
        examined: u64,
        /// Selections active, if the number does not overflow.
        total: Option<u128>,
        /// Their largest norm: a lower bound of the Lipschitz constant, should there be one.
        at_least: f64,
    },
    /// Not decided, because of rounding or because first derivatives do not suffice.
    Doubtful {
        /// What is not known.
        doubt: CertificateDoubt,
        /// The selection it is about.
        selection: Selection,
    },
}

/// What a certificate could not decide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum CertificateDoubt {
    /// Whether the cell of a selection whose sign differs has points near x.
    Activity,
    /// How many preimages a value of the B-derivative has: all values tried have one on a boundary of cells.
    Preimages,
    /// Whether a convex combination of regular matrices is singular: none of the arguments decides.
    Combinations,
    /// Whether a matrix is singular, or only nearly: rounding decides, and exact arithmetic takes too long.
    Rounding,
    /// Which elements the B-subdifferential of a semismooth map has, or there are infinitely many.
    Elements,
    /// The cap was reached.
    Limit,
}

impl fmt::Display for CertificateDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Activity => "whether a cell has points near the point",
            Self::Preimages => "how many directions have one image",
            Self::Combinations => "whether a convex combination is singular",
            Self::Rounding => "whether a matrix is singular or only nearly so",
            Self::Elements => "all elements of the B-subdifferential",
            Self::Limit => "limit on selections",
        })
    }
}

impl fmt::Display for LocalUniqueness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lipschitz {
                constant, selections, ..
            } => {
                write!(
                    f,
                    "locally unique, Lipschitz constant {constant:.3e} ({})",
                    words::selections(*selections)
                )
            }
            Self::Fails { second: (_, 0), .. } => f.write_str("not locally unique: a selection is singular"),
            Self::Fails { .. } => f.write_str("not locally unique: determinants differ in sign"),
            Self::Winds { .. } => f.write_str("not locally unique: two directions have one image"),
            Self::Outside { site } => write!(f, "in no cell of site {site}"),
            Self::Undecided { examined, .. } => write!(f, "undecided after {}", words::selections(*examined)),
            Self::Doubtful { doubt, .. } => write!(f, "undecided: {doubt}"),
        }
    }
}

impl LocalUniqueness {
    /// Whether uniqueness is certified.
    #[must_use]
    pub fn is_certified(&self) -> bool {
        matches!(self, Self::Lipschitz { .. })
    }

    /// Whether a unique Lipschitz function is known not to exist.
    #[must_use]
    pub fn fails(&self) -> bool {
        matches!(self, Self::Fails { .. } | Self::Winds { .. })
    }

    /// The Lipschitz constant, where certified.
    #[must_use]
    pub fn constant(&self) -> Option<f64> {
        match self {
            Self::Lipschitz { constant, .. } => Some(*constant),
            _ => None,
        }
    }
}

/// Whether the solution y at x is an isolated Lipschitz function of the load f, everything else kept fixed. `load` is ∂_fH (n × k); the
/// identity stands for arbitrary perturbations of the residual. At most `cap` active selections are examined.
///
/// y is such a function for arbitrary perturbations exactly if H is coherently oriented in y at x and its B-derivative in y is a
/// homeomorphism (J.-S. Pang, D. Ralph, Math. Oper. Res. 21 (1996), Theorems 4, 5; S. Scholtes, *Introduction to Piecewise
/// Differentiable Equations* (2012), ch. 4). The conditions are examined as follows:
///
/// * *Essentially active* is a selection whose cell has interior points arbitrarily near x, α fixed: some d has sign·∇_yθ·d > 0 on its
///   vanishing facets. Other selections (at a kink that cancels) are left out if the tests are affine or two of them are the same
///   function; else they are a [`CertificateDoubt`] if their sign differs. Gradients of tests that are dependent up to rounding count as
///   dependent: cells narrower than that are left out.
/// * *Coherent orientation*: det ∇_yH^(σ) has one sign over all essentially active σ. If not, uniqueness [fails](LocalUniqueness::fails).
/// * *One preimage*: a coherently oriented piecewise linear map takes every value without preimages on boundaries of cells equally
///   often, and is a homeomorphism exactly if that is once. At most four cells cannot wind twice (D. Kuhn, R. Löwen, Linear Algebra
///   Appl. 96 (1987), Theorem 5.3: at most four round each face of codimension two); of more, the preimages of one value are counted.
///
/// A ∇_yH^(σ) counts as singular where its reciprocal condition number, rows and columns equilibrated so that units do not matter, is below
/// 1e-11.
///
/// The constant holds in the limit of small neighbourhoods, in the maximum norm.
///
/// For discrete Coulomb friction with F > 0, a Lipschitz function of the load is locally one of F too (Haslinger, Janovský and
/// Ligurský); [`local_uniqueness_with`] with [`friction_derivative`](crate::contact::friction_derivative) gives its constant.
///
/// # Errors
/// Wrong shapes, an active set of another map, Jacobians that are not finite or leave their pattern, and several active selections of matrices so large that no
/// determinant is available ([`LinearError::Solver`]).
pub fn local_uniqueness<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    active: &ActiveSet,
    load: &Matrix,
    cap: u64,
) -> Result<LocalUniqueness, PiecewiseError> {
    local_uniqueness_of(&map, x, active, &|_| Cow::Borrowed(load), cap)
}

/// [`local_uniqueness`] for parameters p that the pieces themselves depend on: `derivative` gives ∂_pH^(σ) (n × k) of a selection.
///
/// # Errors
/// As [`local_uniqueness`].
///
/// ```
/// use semismooth::piecewise::{MinMap, active_set, local_uniqueness_with};
/// use semismooth::sparse::Matrix;
/// // min(y, p y − 1) = 0 at p = 1, y = 1: only the second piece is active, and dy/dp = −1.
/// let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = x[0] - 1.0; });
/// let active = active_set(&map, &[1.0], 1e-12);
/// let derivative = |s: &semismooth::piecewise::Selection| {
///     Matrix::from_rows(&[[if s.piece(0) == 1 { 1.0 } else { 0.0 }]]).expect("one row")
/// };
/// let found = local_uniqueness_with(&map, &[1.0], &active, derivative, 10)?;
/// assert!((found.constant().unwrap() - 1.0).abs() < 1e-9); // central differences: 2⁻⁵³ over a step of 6e-6
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn local_uniqueness_with<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    active: &ActiveSet,
    derivative: impl Fn(&Selection) -> Matrix,
    cap: u64,
) -> Result<LocalUniqueness, PiecewiseError> {
    local_uniqueness_of(&map, x, active, &|s| Cow::Owned(derivative(s)), cap)
}

/// ∂_pH of a selection.
type Derivative<'a> = dyn Fn(&Selection) -> Cow<'a, Matrix> + 'a;

fn local_uniqueness_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    load: &Derivative<'_>,
    cap: u64,
) -> Result<LocalUniqueness, PiecewiseError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    check_vector("the point x", x, m)?;
    if m < n {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "at least as many variables as residuals",
        });
    }
    check_rows(&load(active.first()), n)?;
    if let Some(&site) = active.outside().first() {
        return Ok(LocalUniqueness::Outside { site });
    }
    let cones = Cones::new(Box::new(map), x, active, n);
    let (mut block, mut sums) = (Vec::new(), vec![0.0; n]);
    let mut constant = 0.0_f64;
    let signs = examine(&cones, active, cap, (DOUBTFUL, false), &mut |found| {
        let load = load(found.selection);
        check_rows(&load, n)?;
        let Some(solver) = found.solver else {
            constant = f64::INFINITY;
            return Ok(());
        };
        block.resize(n * COLUMNS.min(load.ncols()), 0.0);
        match row_sums(solver, &load, &mut block, &mut sums) {
            Ok(()) => constant = sums.iter().fold(constant, |c, s| c.max(*s)),
            // Nearly singular: regular by its determinant, but the norm of its inverse is not reliable.
            Err(LinearError::Inaccurate { .. }) => constant = f64::INFINITY,
            Err(e) => return Err(e.into()),
        }
        Ok(())
    })?;
    verdict(&cones, active, signs, constant)
}

/// The verdict from the signs and the largest norm of an inverse.
pub(super) fn verdict(
    cones: &Cones<'_>,
    active: &ActiveSet,
    signs: Signs,
    constant: f64,
) -> Result<LocalUniqueness, PiecewiseError> {
    match signs {
        Signs::Coherent { sign, selections } => {
            if selections > FEW
                && let Some(other) = winding(cones, active)?
            {
                return Ok(other);
            }
            Ok(LocalUniqueness::Lipschitz {
                sign,
                constant,
                selections,
            })
        }
        Signs::Incoherent { first, second } => Ok(LocalUniqueness::Fails { first, second }),
        Signs::Capped { examined } => Ok(LocalUniqueness::Undecided {
            examined,
            total: active.total(),
            at_least: constant,
        }),
        Signs::Doubtful { selection } => Ok(LocalUniqueness::Doubtful {
            doubt: CertificateDoubt::Activity,
            selection,
        }),
        Signs::Rounding { selection } => Ok(LocalUniqueness::Doubtful {
            doubt: CertificateDoubt::Rounding,
            selection,
        }),
        Signs::NoDeterminant => Err(no_determinant()),
    }
}

fn check_rows(load: &Matrix, n: usize) -> Result<(), PiecewiseError> {
    if load.nrows() == n {
        return Ok(());
    }
    Err(PiecewiseError::Input(InputError::Length {
        what: "a column of the derivative with respect to the load",
        expected: n,
        found: load.nrows(),
    }))
}

/// The verdict against a unique preimage of a coherently oriented B-derivative; `None` if exactly one was counted.
fn winding(cones: &Cones<'_>, active: &ActiveSet) -> Result<Option<LocalUniqueness>, PiecewiseError> {
    for number in 0..TRIES {
        let Some(target) = cones.target(active, number) else {
            continue;
        };
        let (mut inside, mut clear): (Vec<(Selection, Vec<f64>)>, bool) = (Vec::new(), true);
        let mut preimage = |found: Examined<'_>| {
            let selection = found.selection;
            match cones.preimage(found, &target)? {
                Side::Inside(d) => {
                    let known = inside.iter().any(|(_, other)| cones.is_same(other, &d));
                    inside.extend((!known).then(|| (selection.clone(), d)));
                }
                Side::Outside => {}
                Side::Unclear => clear = false,
            }
            Ok(())
        };
        examine(cones, active, u64::MAX, (DOUBTFUL, false), &mut preimage)?;
        if inside.len() > 1 {
            let mut list = inside.into_iter();
            if let (Some(first), Some(second)) = (list.next(), list.next()) {
                return Ok(Some(LocalUniqueness::Winds { first, second }));
            }
        } else if clear && inside.len() == 1 {
            return Ok(None);
        }
    }
    Ok(Some(LocalUniqueness::Doubtful {
        doubt: CertificateDoubt::Preimages,
        selection: active.first().clone(),
    }))
}

/// Σⱼ |A⁻¹ load|ᵢⱼ for each row i, from a few columns at a time.
fn row_sums(
    solver: &mut impl LinearSolver,
    load: &Matrix,
    block: &mut [f64],
    sums: &mut [f64],
) -> Result<(), LinearError> {
    let n = sums.len();
    sums.fill(0.0);
    for first in (0..load.ncols()).step_by(COLUMNS) {
        let columns = &load.pattern().col_ptr()[first..=load.ncols().min(first + COLUMNS)];
        let block = &mut block[..n * (columns.len() - 1)];
        block.fill(0.0);
        for (column, span) in block.chunks_exact_mut(n.max(1)).zip(columns.windows(2)) {
            for k in span[0]..span[1] {
                column[load.pattern().row_idx()[k]] = load.values()[k];
            }
        }
        solver.solve_in_place(block)?;
        for column in block.chunks_exact(n.max(1)) {
            sums.iter_mut().zip(column).for_each(|(s, v)| *s += v.abs());
        }
    }
    Ok(())
}
