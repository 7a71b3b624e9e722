use std::sync::Arc;

use super::{LoadPath, typical_sizes};
use crate::input::check_size;
use crate::piecewise::PiecewiseError;
use crate::sparse::Matrix;

/// A, B and the load of A u + Bᵀ λ = f. Clones share the matrices.
#[derive(Debug, Clone)]
pub(crate) struct Operator {
    pub(crate) a: Arc<Matrix>,
    /// Bᵀ: column k belongs to the trace v_k.
    pub(crate) b_t: Arc<Matrix>,
    pub(crate) load: LoadPath,
    /// d ≥ 0 for each trace, or empty for zeros: the law receives v = B u − d λ, as if each trace had a spring of its own.
    pub(crate) yielding: Vec<f64>,
    /// Displacements with springs that make A definite, one for each of the last traces, which take them away again: see
    /// `contact/anchors.rs`.
    pub(crate) anchors: Vec<usize>,
    /// Typical sizes of u, λ and α.
    pub(crate) sizes: Option<[f64; 3]>,
}

impl Operator {
    /// The operator with the traces B, q × n.
    pub(crate) fn new(a: Matrix, b: &Matrix, mut load: LoadPath) -> Result<Self, PiecewiseError> {
        let n = a.nrows();
        check_size("the number of columns of A", n, a.ncols())?;
        check_size("the number of columns of B", n, b.ncols())?;
        load.check(n)?;
        a.check_finite()?;
        b.check_finite()?;
        let mut operator = Self {
            a: Arc::new(a),
            b_t: Arc::new(b.transpose()),
            load,
            yielding: Vec::new(),
            anchors: Vec::new(),
            sizes: None,
        };
        operator.set_sizes(&[]);
        Ok(operator)
    }

    /// Computes typical sizes; initial gaps count as typical lengths.
    pub(crate) fn set_sizes(&mut self, gap: &[f64]) {
        let loads = self.load.sizes(self.num_displacements());
        self.sizes = typical_sizes(&self.a, [&*self.b_t], loads, gap);
    }

    pub(crate) fn with_load(&self, mut load: LoadPath) -> Result<Self, PiecewiseError> {
        load.check(self.num_displacements())?;
        Ok(Self { load, ..self.clone() })
    }

    pub(crate) fn num_displacements(&self) -> usize {
        self.a.nrows()
    }

    pub(crate) fn num_traces(&self) -> usize {
        self.b_t.ncols()
    }

    /// f at these parameters.
    pub(crate) fn load_at(&self, parameters: &[f64]) -> Vec<f64> {
        self.load.at(parameters, self.num_displacements())
    }

    /// d of a trace.
    #[inline]
    pub(super) fn yielding(&self, k: usize) -> f64 {
        self.yielding.get(k).copied().unwrap_or(0.0)
    }

    /// v_k = (B u)_k − d_k λ_k from x = (u, λ, …).
    pub(super) fn trace_at(&self, k: usize, x: &[f64]) -> f64 {
        let moved: f64 = self.trace(k).map(|(j, b)| b * x[j]).sum();
        match self.yielding(k) {
            0.0 => moved,
            d => moved - d * x[self.num_displacements() + k],
        }
    }

    /// The entries of column k of Bᵀ.
    pub(super) fn trace(&self, k: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let span = self.b_t.pattern().col_ptr()[k]..self.b_t.pattern().col_ptr()[k + 1];
        let rows = self.b_t.pattern().row_idx()[span.clone()].iter().copied();
        rows.zip(self.b_t.values()[span].iter().copied())
    }
}
