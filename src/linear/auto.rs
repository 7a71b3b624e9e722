use super::{DenseLu, LinearError, LinearSolver, SparseLu};
use crate::sparse::{MatrixRef, PatternRef};

/// Orders up to this one are solved densely by [`AutoSolver`].
pub const DENSE_LIMIT: usize = 200;

/// Dense LU for small or mostly full matrices, sparse LU for the rest; chosen when a pattern is analysed.
#[derive(Debug, Clone)]
pub struct AutoSolver {
    kind: Kind,
    determinants: bool,
}

#[derive(Debug, Clone)]
enum Kind {
    Dense(Box<DenseLu>),
    Sparse(Box<SparseLu>),
}

impl Default for AutoSolver {
    fn default() -> Self {
        Self {
            kind: Kind::Dense(Box::default()),
            determinants: false,
        }
    }
}

impl AutoSolver {
    /// A solver without a pattern.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A solver whose [`log_det`](LinearSolver::log_det) is always known: sparse factors are made by
    /// [`SparseLu::with_determinants`].
    #[must_use]
    pub fn with_determinants() -> Self {
        Self {
            determinants: true,
            ..Self::default()
        }
    }

    /// Whether the dense factorisation is in use.
    #[must_use]
    pub fn is_dense(&self) -> bool {
        matches!(self.kind, Kind::Dense(_))
    }

    fn inner(&self) -> &dyn LinearSolver {
        match &self.kind {
            Kind::Dense(s) => s.as_ref(),
            Kind::Sparse(s) => s.as_ref(),
        }
    }

    fn inner_mut(&mut self) -> &mut dyn LinearSolver {
        match &mut self.kind {
            Kind::Dense(s) => s.as_mut(),
            Kind::Sparse(s) => s.as_mut(),
        }
    }
}

/// Fill-in makes a matrix with a quarter of its entries practically full.
pub(crate) fn prefers_dense(p: PatternRef<'_>) -> bool {
    p.ncols <= DENSE_LIMIT || p.nnz() / p.ncols >= p.ncols / 4
}

impl LinearSolver for AutoSolver {
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
        match (prefers_dense(pattern), self.is_dense()) {
            (true, false) => self.kind = Kind::Dense(Box::default()),
            (false, true) => {
                let sparse = match self.determinants {
                    true => SparseLu::with_determinants(),
                    false => SparseLu::new(),
                };
                self.kind = Kind::Sparse(Box::new(sparse));
            }
            _ => {}
        }
        self.inner_mut().analyze(pattern)
    }

    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        self.inner_mut().factor(a)
    }

    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.inner_mut().solve_in_place(b)
    }

    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.inner_mut().solve_transpose_in_place(b)
    }

    fn rcond(&mut self) -> Option<f64> {
        self.inner_mut().rcond()
    }

    fn log_det(&self) -> Option<(i8, f64)> {
        self.inner().log_det()
    }
}
