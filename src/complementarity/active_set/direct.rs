use super::ReducedSolver;
use super::reduced::{check_order, check_square, is_symmetric};
use crate::complementarity::ComplementarityError;
use crate::linear::{Cholesky, DenseLu, LinearError, LinearSolver, SmallLu, SparseLu, prefers_dense};
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::NONE;

/// Up to this order full systems keep rows for all components, so that nothing is allocated from one set to the next.
const KEEP_DENSE: usize = 64;
/// Part of the components that must be free for the pattern of the whole matrix to be kept, and its symbolic analysis with it.
const KEEP_SPARSE: f64 = 0.6;

/// Direct solves: LU for full and unsymmetric matrices, Cholesky for sparse symmetric ones.
///
/// Of up to 64 unknowns only the free ones are eliminated; where that meets a pivot near zero the system is equilibrated first and
/// its condition estimated, as larger ones are.
/// While most components are free the others keep their rows, as equations d_i = 0: the pattern stays, and with it the symbolic
/// analysis and all memory. A sparse symmetric matrix that is not positive definite falls back to LU.
#[derive(Debug, Clone, Default)]
pub struct DirectReduced {
    kind: Kind,
    symmetric: bool,
    /// Rows of the system, as components; all of them where the pattern is kept.
    rows: Vec<usize>,
    /// Place of each component among the rows.
    place: Vec<usize>,
    free: Vec<bool>,
    system: Option<Matrix>,
    rhs: Vec<f64>,
    /// Whether `small` has factors of the system of the free components.
    is_small: bool,
    small: SmallLu,
    dense: DenseLu,
    cholesky: Cholesky,
    sparse: SparseLu,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Kind {
    #[default]
    Dense,
    Cholesky,
    Sparse,
}

impl DirectReduced {
    /// A solver without a matrix.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn solver(&mut self) -> &mut dyn LinearSolver {
        match self.kind {
            Kind::Dense => &mut self.dense,
            Kind::Cholesky => &mut self.cholesky,
            Kind::Sparse => &mut self.sparse,
        }
    }

    /// Factors the matrix of the free components alone; `false` where a pivot is near zero.
    fn factor_small(&mut self, matrix: &Matrix) -> bool {
        self.rows.clear();
        for (i, free) in self.free.iter().enumerate() {
            self.place[i] = if *free { self.rows.len() } else { NONE };
            if *free {
                self.rows.push(i);
            }
        }
        let p = matrix.pattern();
        let k = self.rows.len();
        let entries = self.small.matrix(k);
        for (c, &j) in self.rows.iter().enumerate() {
            for e in p.col_ptr()[j]..p.col_ptr()[j + 1] {
                let r = self.place[p.row_idx()[e]];
                if r != NONE {
                    entries[c * k + r] = matrix.values()[e];
                }
            }
        }
        self.small.factor()
    }

    /// The matrix of the free components alone.
    fn compress(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        let p = matrix.pattern();
        let n = self.rows.len();
        let mut values = Vec::new();
        let entries = |j: usize| p.col_ptr()[j]..p.col_ptr()[j + 1];
        let pattern = if p.is_full() {
            for &j in &self.rows {
                let column = &matrix.values()[entries(j)];
                values.extend(self.rows.iter().map(|&i| column[i]));
            }
            Pattern::full(n, n)
        } else {
            let (mut start, mut rows) = (vec![0], Vec::new());
            for &j in &self.rows {
                for k in entries(j) {
                    let i = self.place[p.row_idx()[k]];
                    if i != NONE {
                        rows.push(i);
                        values.push(matrix.values()[k]);
                    }
                }
                start.push(rows.len());
            }
            Pattern::from_csc(n, n, start, rows)?
        };
        self.system = Some(Matrix::from_values(pattern, values)?);
        Ok(())
    }

    fn factor(&mut self) -> Result<(), LinearError> {
        let Some(system) = self.system.take() else {
            return Err(LinearError::NotAnalyzed);
        };
        let solver = self.solver();
        let result = solver
            .analyze(system.pattern().as_ref())
            .and_then(|()| solver.factor(system.as_ref()));
        self.system = Some(system);
        result
    }
}

impl ReducedSolver for DirectReduced {
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        check_square(matrix)?;
        let n = matrix.nrows();
        let full = prefers_dense(matrix.as_ref().pattern);
        self.symmetric = !full && is_symmetric(matrix);
        self.kind = match (full, self.symmetric) {
            (true, _) => Kind::Dense,
            (false, true) => Kind::Cholesky,
            (false, false) => Kind::Sparse,
        };
        self.free.clear();
        self.free.resize(n, false);
        self.place.resize(n, NONE);
        self.rhs.resize(n, 0.0);
        self.rows.clear();
        self.rows.reserve(n);
        Ok(())
    }

    fn select(&mut self, matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError> {
        let n = free.len();
        check_order(
            self.free.len(),
            &[("the matrix", matrix.nrows()), ("the set of free components", n)],
        )?;
        check_square(matrix)?;
        self.free.copy_from_slice(free);
        self.is_small = self.kind == Kind::Dense && n <= KEEP_DENSE && self.factor_small(matrix);
        if self.is_small {
            return Ok(());
        }
        let count = free.iter().filter(|f| **f).count();
        let keep = match self.kind {
            Kind::Dense => n <= KEEP_DENSE,
            _ => count as f64 >= KEEP_SPARSE * n as f64,
        };
        self.rows.clear();
        for i in 0..n {
            self.place[i] = NONE;
            if keep || free[i] {
                self.place[i] = self.rows.len();
                self.rows.push(i);
            }
        }
        if self.rows.is_empty() {
            return Ok(());
        }
        if keep {
            mask(matrix, &self.free, &mut self.system);
        } else {
            self.compress(matrix)?;
        }
        match self.factor() {
            Err(LinearError::NotPositiveDefinite) if self.kind == Kind::Cholesky => {
                self.kind = Kind::Sparse;
                Ok(self.factor()?)
            }
            result => Ok(result?),
        }
    }

    fn solve(
        &mut self,
        r: &mut [f64],
        d: &mut [f64],
        _tolerance: f64,
    ) -> Result<usize, ComplementarityError> {
        check_order(self.free.len(), &[("r", r.len()), ("d", d.len())])?;
        d.fill(0.0);
        if self.rows.is_empty() {
            return Ok(0);
        }
        let mut rhs = std::mem::take(&mut self.rhs);
        let n = self.rows.len();
        for (b, &i) in rhs.iter_mut().zip(&self.rows) {
            *b = if self.free[i] { r[i] } else { 0.0 };
        }
        let result = match self.is_small {
            true => {
                self.small.solve(&mut rhs[..n]);
                Ok(())
            }
            false => self.solver().solve_in_place(&mut rhs[..n]),
        };
        for (b, &i) in rhs.iter().zip(&self.rows) {
            d[i] = *b;
        }
        self.rhs = rhs;
        result?;
        Ok(0)
    }

    fn is_direct(&self) -> bool {
        true
    }
}

/// The matrix over the pattern of the whole, rows and columns that are not free replaced by those of the identity.
pub(super) fn mask(matrix: &Matrix, free: &[bool], system: &mut Option<Matrix>) {
    let pattern = matrix.pattern();
    let system = match system {
        Some(system) if system.pattern() == pattern => system,
        other => other.insert(Matrix::zeros(pattern.clone())),
    };
    for j in 0..matrix.ncols() {
        for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
            let i = pattern.row_idx()[k];
            system.values_mut()[k] = match (free[i] && free[j], i == j) {
                (true, _) => matrix.values()[k],
                (false, true) => 1.0,
                (false, false) => 0.0,
            };
        }
    }
}
