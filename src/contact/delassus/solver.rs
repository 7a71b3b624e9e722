use std::ops::ControlFlow;

use super::local::solve_contact;
use super::newton::{Inner, Newton, alart_curnier};
use super::report::{DelassusIteration, DelassusPhase, DelassusReport, DelassusStatus};
use super::scaled::{Scaled, Vector};
use super::{DelassusError, DelassusOptions, DelassusProblem, DelassusState};

/// Solver of [`DelassusProblem`]s.
#[derive(Debug, Clone, Default)]
pub struct DelassusSolver {
    options: DelassusOptions,
}

impl DelassusSolver {
    /// A solver with the given options.
    ///
    /// # Errors
    /// [`DelassusError::Option`] names an option out of range.
    pub fn new(options: DelassusOptions) -> Result<Self, DelassusError> {
        options.validate()?;
        Ok(Self { options })
    }

    /// Solves from r = 0.
    ///
    /// # Errors
    /// None at present for a valid problem; a failed run is told by the status of the report.
    pub fn solve(&self, problem: &DelassusProblem) -> Result<DelassusReport, DelassusError> {
        let zero = vec![0.0; problem.q().len()];
        self.solve_from(problem, &zero, |_| ControlFlow::Continue(()))
    }

    /// Solves from the reactions `start`; `observe` sees every entry of the history and may stop the run.
    ///
    /// # Errors
    /// [`DelassusError::Length`] and [`DelassusError::NotFinite`] for the start.
    pub fn solve_from(
        &self,
        problem: &DelassusProblem,
        start: &[f64],
        mut observe: impl FnMut(&DelassusIteration) -> ControlFlow<()>,
    ) -> Result<DelassusReport, DelassusError> {
        problem.velocities(start)?;
        match problem.dimension() {
            2 => Run::<2>::new(problem, &self.options, start, &mut observe).report(),
            _ => Run::<3>::new(problem, &self.options, start, &mut observe).report(),
        }
    }
}

struct Run<'a, const D: usize> {
    problem: &'a DelassusProblem,
    options: &'a DelassusOptions,
    observe: &'a mut dyn FnMut(&DelassusIteration) -> ControlFlow<()>,
    scaled: Scaled<D>,
    newton: Newton<D>,
    r: Vector<D>,
    best: Vec<f64>,
    best_residual: f64,
    plain: Vec<f64>,
    sweeps: usize,
    history: Vec<DelassusIteration>,
}

impl<'a, const D: usize> Run<'a, D> {
    fn new(
        problem: &'a DelassusProblem,
        options: &'a DelassusOptions,
        start: &[f64],
        observe: &'a mut dyn FnMut(&DelassusIteration) -> ControlFlow<()>,
    ) -> Self {
        let scaled = Scaled::new(problem);
        Self {
            newton: Newton::new(problem.contacts()),
            r: scaled.scale(start),
            best: start.to_vec(),
            best_residual: f64::INFINITY,
            plain: start.to_vec(),
            sweeps: 0,
            history: Vec::new(),
            problem,
            options,
            observe,
            scaled,
        }
    }

    /// The residual of the current iterate; the best one is kept.
    fn measure(&mut self) -> Result<f64, DelassusError> {
        self.scaled.unscale(&self.r, &mut self.plain);
        let residual = self.problem.residual(&self.plain)?;
        if residual < self.best_residual {
            self.best_residual = residual;
            self.best.copy_from_slice(&self.plain);
        }
        Ok(residual)
    }

    fn record(
        &mut self,
        phase: DelassusPhase,
        alpha: f64,
        work: usize,
        success: bool,
    ) -> Result<ControlFlow<DelassusStatus, f64>, DelassusError> {
        let residual = self.measure()?;
        let entry = DelassusIteration {
            index: self.history.len(),
            phase,
            residual,
            alpha,
            work,
            success,
        };
        self.history.push(entry);
        if self.best_residual <= self.options.tolerance {
            return Ok(ControlFlow::Break(DelassusStatus::Solved));
        }
        if (self.observe)(&entry).is_break() {
            return Ok(ControlFlow::Break(DelassusStatus::Interrupted));
        }
        Ok(ControlFlow::Continue(residual))
    }

    /// One sweep of nonsmooth Gauss–Seidel.
    fn sweep(&mut self, backward: bool) {
        let p = &self.scaled;
        let nc = p.contacts();
        for k in 0..nc {
            let i = if backward { nc - 1 - k } else { k };
            let mut b = p.q[i];
            let old = self.r[i];
            self.r[i] = [0.0; D];
            p.matrix.add_row(i, &self.r, &mut b);
            self.r[i] = old;
            self.r[i] = solve_contact(&p.matrix.diagonal[i], &b, p.friction[i]);
        }
        self.sweeps += 1;
    }

    fn run(&mut self) -> Result<DelassusStatus, DelassusError> {
        self.measure()?;
        if self.best_residual <= self.options.tolerance {
            return Ok(DelassusStatus::Solved);
        }
        for k in 0..30 {
            self.sweep(k % 2 == 1);
        }
        if let ControlFlow::Break(s) = self.record(DelassusPhase::Sweeps, 0.0, 30, true)? {
            return Ok(s);
        }
        let mut interior = super::interior::Interior::new(&self.scaled);
        let depth: f64 = std::env::var("DEPTH")
            .ok()
            .and_then(|s| s.parse().ok())
            .unwrap_or(1.0);
        interior.start(&self.scaled, &self.r, depth);
        let mut short = 0;
        for _ in 0..80 {
            let Some(length) = interior.step(&self.scaled) else {
                break;
            };
            self.newton.factorisations += 1;
            interior.reactions(&self.scaled, &mut self.r);
            if let ControlFlow::Break(s) =
                self.record(DelassusPhase::Interior, interior.gap(), 1, length > 0.1)?
            {
                return Ok(s);
            }
            short = if length < 1e-3 { short + 1 } else { 0 };
            if interior.gap() < 1e-13 || short > 3 {
                break;
            }
        }
        let mut alpha: f64 = std::env::var("ALPHA")
            .ok()
            .and_then(|s| s.parse().ok())
            .unwrap_or(1e-2);
        let mut centre = self.r.clone();
        loop {
            let before = self.newton.factorisations;
            if before >= self.options.max_factorisations {
                return Ok(DelassusStatus::Limit);
            }
            centre.copy_from_slice(&self.r);
            let scale = self.r.iter().flatten().fold(1.0_f64, |a, b| a.max(b.abs()));
            let inner = self
                .newton
                .solve(&self.scaled, &mut self.r, alpha, &centre, 1e-14 * scale, 30);
            let work = self.newton.factorisations - before;
            match inner {
                Inner::Converged => {
                    if let ControlFlow::Break(s) = self.record(DelassusPhase::Proximal, alpha, work, true)? {
                        return Ok(s);
                    }
                    alpha = (alpha * 0.3).max(1e-10);
                }
                Inner::Failed => {
                    if let ControlFlow::Break(s) = self.record(DelassusPhase::Proximal, alpha, work, false)? {
                        return Ok(s);
                    }
                    self.r.copy_from_slice(&centre);
                    alpha *= 4.0;
                    if alpha > 1e6 {
                        return Ok(DelassusStatus::Stalled);
                    }
                }
            }
        }
    }

    fn report(mut self) -> Result<DelassusReport, DelassusError> {
        let status = self.run()?;
        let u = self.problem.velocities(&self.best)?;
        let r = self.scaled.scale(&self.best);
        let mut v = vec![[0.0; D]; r.len()];
        self.scaled.velocities(&r, &mut v);
        let states: Vec<DelassusState> = (0..r.len())
            .map(|i| alart_curnier(self.problem.friction()[i], &r[i], &v[i]).state)
            .collect();
        Ok(DelassusReport {
            status,
            residual: self.problem.residual(&self.best)?,
            r: self.best,
            u,
            states,
            factorisations: self.newton.factorisations,
            sweeps: self.sweeps,
            history: self.history,
        })
    }
}
