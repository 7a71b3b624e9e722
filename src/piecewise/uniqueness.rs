use super::error::{check_selection, check_vector};
use super::{ActiveSet, PiecewiseError, PiecewiseSmooth, Selection};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::sparse::Matrix;

/// Columns of the load solved for at a time.
const BLOCK: usize = 64;
/// Reciprocal condition below which ∇_yH^(σ) counts as singular: smooth folds are located no better.
const SINGULAR: f64 = 1e-11;

/// Whether a solution is locally the only one, and a Lipschitz function of the load.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LocalUniqueness {
    /// All active selections were examined: their determinants are of one sign.
    Lipschitz {
        /// The common sign of det ∇_yH^(σ); `None` where a single selection is active and no determinant is known.
        sign: Option<i8>,
        /// max over active σ of ‖(∇_yH^(σ))⁻¹ ∂_fH‖∞ (largest row sum of absolute values).
        constant: f64,
        /// Number of active selections.
        selections: u64,
    },
    /// Two active selections differ in the sign of their determinants, or one is singular: folds and branchings.
    Fails {
        /// An active selection and the sign of its determinant.
        first: (Selection, i8),
        /// One whose sign differs (0: singular).
        second: (Selection, i8),
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
}

impl LocalUniqueness {
    /// Whether uniqueness is certified.
    #[must_use]
    pub fn is_certified(&self) -> bool {
        matches!(self, Self::Lipschitz { .. })
    }

    /// Whether uniqueness is known to fail.
    #[must_use]
    pub fn fails(&self) -> bool {
        matches!(self, Self::Fails { .. })
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
/// identity asks for arbitrary perturbations of the residual. At most `cap` active selections are examined.
///
/// y is such a function if the B-derivative in y is a homeomorphism (Robinson 1991; Scholtes 2012). Where at most four cells meet
/// around any face of codimension two, as for friction and complementarity, this is coherent orientation (Kuhn and Löwen 1987): one
/// sign of det ∇_yH^(σ) over all active σ. The constant holds in the limit of small neighbourhoods, in the maximum norm.
///
/// For discrete Coulomb friction with F > 0, a Lipschitz function of the load is locally one of F too (Haslinger, Janovský and
/// Ligurský).
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
    local_uniqueness_of(&map, x, active, load, cap)
}

fn local_uniqueness_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    load: &Matrix,
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
    if load.nrows() != n {
        return Err(PiecewiseError::Length {
            what: "a column of the derivative with respect to the load",
            expected: n,
            found: load.nrows(),
        });
    }
    if let Some(&site) = active.outside().first() {
        return Ok(LocalUniqueness::Outside { site });
    }
    let (mut block, mut sums) = (vec![0.0; n * BLOCK.min(load.ncols())], vec![0.0; n]);
    let mut jac = Matrix::zeros(map.pattern());
    let mut solver = AutoSolver::default();
    solver.analyze(jac.leading_columns(n).pattern)?;
    let (mut first, mut common): (Option<(Selection, i8)>, Option<i8>) = (None, None);
    let (mut constant, mut examined) = (0.0_f64, 0);
    for selection in active.selections() {
        if examined == cap {
            return Ok(LocalUniqueness::Undecided {
                examined,
                total: active.total(),
                at_least: constant,
            });
        }
        examined += 1;
        check_selection("the active set", &selection, map)?;
        jac.clear();
        map.jacobian(&selection, x, &mut jac);
        if let Some((row, col)) = jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col });
        }
        let sign = match solver.factor(jac.leading_columns(n)) {
            Ok(()) if solver.rcond().is_some_and(|r| r < SINGULAR) => Some(0),
            Ok(()) => solver.log_det().map(|d| d.0),
            Err(LinearError::Singular { .. }) => Some(0),
            Err(e) => return Err(e.into()),
        };
        if sign == Some(0) {
            return Ok(LocalUniqueness::Fails {
                first: first.unwrap_or((selection.clone(), 0)),
                second: (selection, 0),
            });
        }
        match (&first, sign) {
            // A single regular selection needs no determinant.
            (_, None) if active.is_singleton() => {}
            (_, None) => {
                return Err(LinearError::Solver {
                    what: "no determinant is available for a sparse matrix of this size".into(),
                }
                .into());
            }
            (None, Some(s)) => {
                common = sign;
                first = Some((selection, s));
            }
            (Some((_, known)), Some(s)) if *known == s => {}
            (Some(known), Some(s)) => {
                return Ok(LocalUniqueness::Fails {
                    first: known.clone(),
                    second: (selection, s),
                });
            }
        }
        match row_sums(&mut solver, load, &mut block, &mut sums) {
            Ok(()) => constant = sums.iter().fold(constant, |c, s| c.max(*s)),
            // Close to singular: regular by its determinant, but no norm can be vouched for.
            Err(LinearError::Inaccurate { .. }) => constant = f64::INFINITY,
            Err(e) => return Err(e.into()),
        }
    }
    Ok(LocalUniqueness::Lipschitz {
        sign: common,
        constant,
        selections: examined,
    })
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
    for first in (0..load.ncols()).step_by(BLOCK) {
        let columns = &load.pattern().col_ptr()[first..=load.ncols().min(first + BLOCK)];
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
