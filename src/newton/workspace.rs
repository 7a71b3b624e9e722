use super::{NewtonError, Report};
use crate::InputError;
use crate::judge::Judge;
use crate::piecewise::PiecewiseError;
use crate::sparse::{Matrix, Pattern};

/// The arrays of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Workspace {
    pub(super) jac: Option<Matrix>,
    /// Whether the solver has analysed the pattern: not before the first step, since the start may be a solution.
    pub(super) analyzed: bool,
    pub(super) n: usize,
    pub(super) r: Vec<f64>,
    pub(super) trial_r: Vec<f64>,
    pub(super) d: Vec<f64>,
    pub(super) trial: Vec<f64>,
    pub(super) best: Vec<f64>,
    pub(super) size: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    pub(super) conjugate: Vec<f64>,
    /// Factors of the residuals in the merit function, so that units of rows do not matter to line searches.
    pub(super) weight: Vec<f64>,
    /// ∇H d of the step taken last, where rows are watched; else free.
    pub(super) model: Vec<f64>,
    /// Rows whose residual a full step no longer improves.
    pub(super) settled: Vec<bool>,
    pub(super) visited: Vec<(u64, f64)>,
    pub(super) judge: Judge,
    pub(super) report: Report,
}

impl Workspace {
    pub(super) fn fits(&self, m: usize, n: usize) -> bool {
        self.n == n && self.jac.as_ref().is_some_and(|j| j.ncols() == m)
    }

    pub(super) fn prepare(&mut self, pattern: Pattern, m: usize, n: usize) -> Result<(), NewtonError> {
        let sides = [
            ("the rows of the declared pattern", n, pattern.nrows()),
            ("the columns of the declared pattern", m, pattern.ncols()),
        ];
        for (what, expected, found) in sides {
            if found != expected {
                return Err(PiecewiseError::Input(InputError::Length {
                    what,
                    expected,
                    found,
                })
                .into());
            }
        }
        self.jac = None;
        self.analyzed = false;
        self.jac = Some(Matrix::zeros(pattern));
        self.n = n;
        for v in [
            &mut self.r,
            &mut self.trial_r,
            &mut self.d,
            &mut self.size,
            &mut self.gradient,
            &mut self.conjugate,
            &mut self.weight,
            &mut self.model,
        ] {
            v.resize(n, 0.0);
        }
        self.settled.resize(n, false);
        self.trial.resize(m, 0.0);
        self.best.resize(m, 0.0);
        Ok(())
    }
}
