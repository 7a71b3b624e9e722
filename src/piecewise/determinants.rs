//! Signs of determinants: those of a factorisation, and in exact arithmetic where rounding may decide and the map states its coefficients.

use super::{ExactConditions, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use crate::exact::{Exact, determinant_sign};
use crate::linear::{AutoSolver, DENSE_LIMIT, LinearError, LinearSolver};
use crate::sparse::{Matrix, MatrixRef};
use crate::tolerances::CHECKED;

/// Allowance for the growth of entries in a factorisation of order n, whose rounding is some n ε else, for
/// the rounding of the entries and for the error of the estimated condition.
const ALLOWANCE: f64 = 1e3;
/// Numbers written in exact arithmetic for one verdict, long ones counted as many: some tenths of a second.
const WORK: u64 = 4_000_000;

/// A regular selection examined: its matrix is factored in `solver`, unless that took it for singular.
pub(super) struct Examined<'a> {
    pub(super) solver: Option<&'a mut AutoSolver>,
    pub(super) selection: &'a Selection,
}

/// What is known of the sign of a determinant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Determinant {
    Sign(i8),
    /// The linear solver has no determinants.
    Unavailable,
    /// Rounding may decide, and exact arithmetic takes too long.
    Doubtful,
}

/// Signs of det ∇_yH^(σ) at a point.
pub(super) struct Determinants<'a> {
    pub(super) solver: AutoSolver,
    /// Whether the solver holds factors of the last matrix.
    pub(super) factored: bool,
    n: usize,
    singular: f64,
    exact: Option<ExactSigns<'a>>,
}

impl<'a> Determinants<'a> {
    /// A reciprocal condition below `singular` counts as singular, unless exact arithmetic is requested and the map gives its coefficients.
    pub(super) fn new(
        map: &'a dyn PiecewiseSmooth,
        x: &[f64],
        pattern: &Matrix,
        singular: f64,
        exact: bool,
    ) -> Result<Self, PiecewiseError> {
        let n = map.num_residuals();
        let mut solver = AutoSolver::default();
        solver.analyze(pattern.leading_columns(n).pattern)?;
        Ok(Self {
            solver,
            factored: false,
            n,
            singular,
            exact: ExactSigns::new(map, x).filter(|_| exact),
        })
    }

    /// The sign for a selection and its Jacobian.
    pub(crate) fn sign(
        &mut self,
        selection: &Selection,
        jac: &Matrix,
    ) -> Result<Determinant, PiecewiseError> {
        let rcond = self.factor(jac.leading_columns(self.n))?;
        if let Some(exact) = &mut self.exact
            && rcond.is_some_and(|r| r < near(self.n))
        {
            let sign = exact.sign(selection);
            return Ok(sign.map_or(Determinant::Doubtful, Determinant::Sign));
        }
        if !self.factored || rcond.is_some_and(|r| r < self.singular) {
            return Ok(Determinant::Sign(0));
        }
        Ok(match self.solver.log_det() {
            Some((sign, _)) => Determinant::Sign(sign),
            None => Determinant::Unavailable,
        })
    }

    /// The regular selection examined last, with the factors of its matrix if the solver holds them.
    pub(super) fn examined<'s>(&'s mut self, selection: &'s Selection) -> Examined<'s> {
        Examined {
            solver: self.factored.then_some(&mut self.solver),
            selection,
        }
    }

    /// The reciprocal condition, 0 where the solver finds the matrix singular.
    fn factor(&mut self, matrix: MatrixRef<'_>) -> Result<Option<f64>, PiecewiseError> {
        let factored = self.solver.factor(matrix);
        self.factored = factored.is_ok();
        match factored {
            Ok(()) => Ok(self.solver.rcond()),
            Err(LinearError::Singular { .. }) => Ok(Some(0.0)),
            Err(e) => Err(e.into()),
        }
    }
}

/// Reciprocal condition of a matrix of order n, rows and columns equilibrated, below which exact arithmetic
/// decides where it is available.
pub(crate) fn near(n: usize) -> f64 {
    CHECKED.max(ALLOWANCE * n as f64 * f64::EPSILON)
}

/// Signs of det ∇_yH^(σ) in exact arithmetic.
pub(crate) struct ExactSigns<'a> {
    map: &'a dyn PiecewiseSmooth,
    parameter: f64,
    /// Obtained from the map once they are needed.
    conditions: Option<ExactConditions>,
    work: u64,
}

impl<'a> ExactSigns<'a> {
    /// `None` for maps that do not state exact coefficients.
    pub(crate) fn new(map: &'a dyn PiecewiseSmooth, x: &[f64]) -> Option<Self> {
        map.exact()?;
        Some(Self {
            map,
            parameter: x.get(map.num_residuals()).copied().unwrap_or(0.0),
            conditions: None,
            work: WORK,
        })
    }

    /// `None` where the coefficients are not stated, or too many, or too long.
    pub(crate) fn sign(&mut self, selection: &Selection) -> Option<i8> {
        if self.map.num_residuals() > DENSE_LIMIT {
            return None;
        }
        if self.conditions.is_none() {
            self.conditions = self.map.exact()?.conditions(self.parameter);
        }
        let rows = rows_of(self.conditions.as_ref()?, selection)?;
        determinant_sign(&rows, &mut self.work)
    }
}

/// The rows of a selection in the order of those of the map.
fn rows_of<'c>(conditions: &'c ExactConditions, selection: &Selection) -> Option<Vec<&'c [Exact]>> {
    let mut rows: Vec<Option<&[Exact]>> = vec![None; conditions.unknowns];
    for (site, stated) in conditions.sites.iter().enumerate() {
        let piece = stated.pieces.iter().find(|p| p.piece == selection.piece(site))?;
        for &(row, form) in &piece.equalities {
            *rows.get_mut(row)? = Some(&stated.forms.get(form)?.coefficients);
        }
    }
    let mut common = conditions.common.iter().map(|form| form.coefficients.as_slice());
    let rows: Option<Vec<&[Exact]>> = rows
        .into_iter()
        .map(|row| row.or_else(|| common.next()))
        .collect();
    rows.filter(|rows| common.next().is_none() && rows.iter().all(|r| r.len() == conditions.unknowns))
}
