//! The phases of a run: sweeps, interior points, Newton's method, the central path.

use crate::contact::ContactError;
use std::ops::ControlFlow;

use super::cone::tangential_norm;
use super::interior::Interior;
use super::local::solve_contact;
use super::newton::{Inner, Newton, Piece};
use super::path::CentralPath;
use super::report::{DelassusIteration, DelassusPhase, DelassusReport};
use super::scaled::{ScaledProblem, Vector, add_product, larger};
use super::settled::solve_settled;
use super::tolerances::{
    ALPHA, ALPHA_NEAR, ALPHA_SMALL, AT_REST, FEW_SWEEPS, FIRST_PATIENCE, GROW, HEAVY, INNER, INTERIOR_STEPS,
    LARGEST_ALPHA, LEAST_ALPHA, LEAST_NU, LEAST_PRECISION, MAX_IDLE, MORE_SWEEPS, NEAR, PATH_PATIENCE,
    PATIENCE, PRECISION, QUICK, QUICK_PATIENCE, REPORTED, SHORT, SHRINK, SMALL, SWEEPS, ZERO,
};
use super::{DelassusOptions, DelassusProblem};
use crate::clock::Deadline;
use crate::contact::ContactState;
use crate::run::Status;

/// Break with a status ends the run.
type Outcome = ControlFlow<Status>;

/// The change made by a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Swept {
    /// Some contact is in another state: open, stick or slip.
    States,
    /// Reactions, but no state, as far as states were compared.
    Reactions,
    /// Nothing beyond rounding.
    Nothing,
}

/// The law at an iterate.
struct Measure {
    residual: f64,
    /// The merit, which decreases towards a solution.
    progress: f64,
}

/// One run of the solver.
pub(super) struct Run<'a, const D: usize> {
    problem: &'a DelassusProblem,
    options: &'a DelassusOptions,
    observe: &'a mut dyn FnMut(&DelassusIteration) -> ControlFlow<()>,
    scaled: ScaledProblem<D>,
    newton: Newton<D>,
    r: Vector<D>,
    u: Vector<D>,
    /// Whether other contacts have changed the velocity of a contact since it was solved.
    stale: Vec<bool>,
    /// For each contact, the squared size of its terms and its squared residual, as evaluated last.
    contacts: Vec<[f64; 2]>,
    best: Vec<f64>,
    best_progress: f64,
    /// Whether the best iterate is a solution.
    solved: bool,
    /// Whether the best iterate was evaluated last, and its residual.
    best_is_last: bool,
    residual: f64,
    started: bool,
    /// The start of further attempts: the best iterate, except those of an attempt that diverged.
    near: Vector<D>,
    near_progress: f64,
    plain: Vec<f64>,
    /// `plain` in scaled variables.
    at: Vector<D>,
    sweeps: usize,
    history: Vec<DelassusIteration>,
}

impl<'a, const D: usize> Run<'a, D> {
    pub(super) fn new(
        problem: &'a DelassusProblem,
        options: &'a DelassusOptions,
        start: Option<&[f64]>,
        observe: &'a mut dyn FnMut(&DelassusIteration) -> ControlFlow<()>,
    ) -> Self {
        let scaled = ScaledProblem::new(problem);
        let started = start.is_some();
        let zero = vec![[0.0; D]; problem.contacts()];
        let r = start.map_or_else(|| zero.clone(), |start| scaled.scale(start));
        let start = start.map_or_else(|| vec![0.0; problem.q().len()], <[f64]>::to_vec);
        Self {
            newton: Newton::new(Deadline::after(options.max_time)),
            u: zero.clone(),
            stale: vec![true; problem.contacts()],
            contacts: vec![[0.0; 2]; problem.contacts()],
            best_is_last: false,
            residual: f64::INFINITY,
            started,
            plain: start.clone(),
            best: start,
            best_progress: f64::INFINITY,
            solved: false,
            near: r.clone(),
            near_progress: f64::INFINITY,
            r,
            at: zero,
            sweeps: 0,
            history: Vec::new(),
            problem,
            options,
            observe,
            scaled,
        }
    }

    /// The residuals of the law at the current iterate, as it would be returned; the best one is kept.
    ///
    /// Where a problem has no solution, reactions that grow without bound make the violation of the law small relative to themselves. An
    /// iterate counts only if the violation is small relative to q and u, too.
    fn measure(&mut self) -> Measure {
        let tolerance = self.options.tolerance;
        self.scaled.unscale(&self.r, &mut self.plain);
        self.scaled.scale_into(&self.plain, &mut self.at);
        let law = self.scaled.law(&self.at, &mut self.u, &mut self.contacts);
        let small = law.violation <= NEAR;
        // Far from a solution the residual of the worst contact says little: the norm over all contacts is compared first.
        let progress = match small {
            false => law.violation,
            true if law.overall > tolerance => law.overall,
            true => tolerance * law.residual.min(1.0),
        };
        let solved = small
            && law.overall <= tolerance
            && law.residual <= tolerance
            && self.scaled.violation(&self.at, &self.u, &self.contacts) <= tolerance;
        // A gain within rounding does not count.
        self.best_is_last = progress < 0.99 * self.best_progress || (solved && !self.solved);
        if self.best_is_last {
            self.best_progress = progress;
            self.residual = law.residual;
            self.solved = solved;
            std::mem::swap(&mut self.best, &mut self.plain);
        }
        if progress < 0.99 * self.near_progress {
            self.near_progress = progress;
            self.near.copy_from_slice(&self.at);
        }
        Measure {
            residual: law.residual,
            progress,
        }
    }

    fn record(
        &mut self,
        phase: DelassusPhase,
        alpha: f64,
        work: usize,
        success: bool,
    ) -> ControlFlow<Status, f64> {
        let Measure { residual, progress } = self.measure();
        let entry = DelassusIteration {
            index: self.history.len(),
            phase,
            residual,
            alpha,
            work,
            success,
        };
        self.history.push(entry);
        let told = (self.observe)(&entry);
        if self.solved {
            return ControlFlow::Break(Status::Solved);
        }
        if told.is_break() {
            return ControlFlow::Break(Status::Interrupted);
        }
        ControlFlow::Continue(progress)
    }

    /// One sweep of nonsmooth Gauss–Seidel, from r and u = M r + q to those after it, over the contacts that others have changed since they
    /// were solved. States are compared only on request.
    fn sweep(&mut self, backward: bool, states: bool) -> Swept {
        let p = &self.scaled;
        let nc = p.contacts();
        let (mut moved, mut same) = (0.0_f64, true);
        for k in 0..nc {
            let i = if backward { nc - 1 - k } else { k };
            let old = self.r[i];
            let stays_open = old == [0.0; D] && self.u[i][0] >= 0.0;
            if !self.stale[i] || stays_open {
                continue;
            }
            let w = p.matrix.diagonal(i);
            let mut b = self.u[i];
            add_product(w, &old.map(|v| -v), &mut b);
            let new = solve_contact(w, &b, p.friction[i]);
            let step: [f64; D] = std::array::from_fn(|k| new[k] - old[k]);
            if step != [0.0; D] {
                for (j, block) in p.matrix.column(i) {
                    add_product(block, &step, &mut self.u[j]);
                    self.stale[j] = true;
                }
            }
            self.stale[i] = false;
            moved = larger(moved, &step);
            if states && same {
                same = piece(p.friction[i], &new) == piece(p.friction[i], &old);
            }
            self.r[i] = new;
        }
        self.sweeps += 1;
        let is_at_rest = moved == 0.0 || moved <= AT_REST * self.r.iter().fold(0.0, larger);
        match same {
            _ if is_at_rest => Swept::Nothing,
            true => Swept::Reactions,
            false => Swept::States,
        }
    }

    fn run(&mut self) -> Status {
        match self.phases() {
            ControlFlow::Break(status) => status,
            ControlFlow::Continue(()) => Status::Stalled,
        }
    }

    fn phases(&mut self) -> Outcome {
        // If r = 0 is a solution, sweeps do not change it.
        if self.started {
            self.measure();
            if self.solved {
                return ControlFlow::Break(Status::Solved);
            }
        }
        let is_large = Interior::is_large(&self.scaled);
        let is_small = D * self.scaled.contacts() <= SMALL;
        let most = SWEEPS.min(self.options.max_sweeps);
        let first = self.sweeps_of(most, is_small)?;
        if !is_large {
            let is_settled = is_small && first < most;
            self.quick(if is_small { ALPHA_SMALL } else { ALPHA_NEAR }, is_settled)?;
            if is_settled {
                self.sweeps_of(most - first, false)?;
                self.quick(ALPHA_NEAR, false)?;
            }
        }
        let mut interior = Interior::new(&self.scaled);
        let shortened = self.interior(&mut interior, false)?;
        // Without a short step De Saxcé's term would never be frozen, and the same steps would be repeated.
        if shortened && self.near_progress > NEAR {
            self.restart();
            self.interior(&mut interior, true)?;
        }
        self.restart();
        self.proximal(ALPHA_NEAR, FIRST_PATIENCE, INNER)?;
        self.newton.rho = HEAVY;
        self.restart();
        self.proximal(ALPHA_NEAR, PATIENCE, INNER)?;
        if is_large {
            drop(interior);
        } else {
            self.newton.rho = 1.0;
            self.central_path(interior)?;
            self.proximal(ALPHA_NEAR, FIRST_PATIENCE, INNER)?;
            self.newton.rho = HEAVY;
        }
        for sweeps in MORE_SWEEPS {
            self.restart();
            self.sweeps_of(sweeps, false)?;
            self.proximal(ALPHA, PATIENCE, INNER)?;
        }
        ControlFlow::Continue(())
    }

    /// Goes back to the iterate that further attempts start from.
    fn restart(&mut self) {
        self.r.copy_from_slice(&self.near);
    }

    /// Where sweeps have found the states, a few factorisations of the closed contacts solve the problem, a single one if it is then
    /// linear; otherwise the iterate is unchanged.
    fn quick(&mut self, alpha: f64, settled: bool) -> Outcome {
        let swept = self.r.clone();
        let state = |i: usize, r: &[f64; D]| piece(self.scaled.friction[i], r);
        let may_factor = self.newton.factorisations < self.options.max_factorisations;
        if settled && may_factor && solve_settled(&self.scaled, state, &mut self.r) {
            self.newton.factorisations += 1;
            self.record(DelassusPhase::States, 0.0, 1, true)?;
            self.r.copy_from_slice(&swept);
        }
        self.proximal(alpha, QUICK_PATIENCE, QUICK)?;
        self.r = swept;
        self.near_progress = f64::INFINITY;
        self.measure();
        ControlFlow::Continue(())
    }

    /// At most n sweeps: fewer at the time limit, where they converge, or, on request, where states are unchanged. Returns their number.
    fn sweeps_of(&mut self, n: usize, until_settled: bool) -> ControlFlow<Status, usize> {
        let n = n.min(self.options.max_sweeps);
        let (mut done, mut ended) = (0, false);
        while done < n && !ended {
            let end = n.min(done + REPORTED);
            let begun = done;
            // Recomputed, so that rounding errors do not accumulate.
            self.u.copy_from_slice(&self.scaled.q);
            self.scaled.matrix.add(&self.r, &mut self.u);
            self.stale.fill(true);
            while done < end && !ended {
                ended = self.newton.deadline.is_over();
                if ended {
                    break;
                }
                let swept = self.sweep(done % 2 == 1, until_settled);
                done += 1;
                ended = match swept {
                    Swept::Nothing => true,
                    Swept::Reactions => until_settled && done >= FEW_SWEEPS[D - 2],
                    Swept::States => false,
                };
            }
            self.record(DelassusPhase::Sweeps, 0.0, done - begun, true)?;
        }
        ControlFlow::Continue(done)
    }

    /// Ends the run at a limit.
    fn limits(&self) -> Outcome {
        if self.newton.deadline.is_over() {
            return ControlFlow::Break(Status::TimeLimit);
        }
        match self.newton.factorisations >= self.options.max_factorisations {
            true => ControlFlow::Break(Status::IterationLimit),
            false => ControlFlow::Continue(()),
        }
    }

    /// The interior-point method from the iterate; the last iterate stays in place. Returns whether a step was short.
    fn interior(&mut self, interior: &mut Interior<D>, may_freeze: bool) -> ControlFlow<Status, bool> {
        interior.start(&self.scaled, &self.r, may_freeze);
        let (mut best, mut since, mut stuck, mut shortened) = (f64::INFINITY, 0, 0, false);
        for _ in 0..INTERIOR_STEPS {
            self.limits()?;
            let Some(length) = interior.step(&self.scaled) else {
                break;
            };
            self.newton.factorisations += 1;
            interior.reactions(&self.scaled, &mut self.r);
            let gap = interior.gap();
            shortened |= length < SHORT;
            let progress = self.record(DelassusPhase::Interior, gap, 1, length > SHORT)?;
            if progress < 0.7 * best {
                (best, since) = (progress, 0);
            } else {
                since += 1;
            }
            stuck = if length < 0.02 { stuck + 1 } else { 0 };
            if gap < 1e-13 || since > 10 || stuck > 4 {
                break;
            }
        }
        ControlFlow::Continue(shortened)
    }

    /// Follows the central path through its folds; its last point stays in place.
    fn central_path(&mut self, interior: Interior<D>) -> Outcome {
        let mut path = CentralPath::new(&self.scaled, interior);
        let deadline = self.newton.deadline;
        let left = self.options.max_factorisations - self.newton.factorisations;
        let begun = self.newton.factorisations;
        let (mut least, mut least_at) = (1.0, 0);
        let mut spent = 0;
        let mut on = path.start(&self.scaled, left, deadline, &mut spent);
        while on.is_some() && path.nu() > LEAST_NU && spent - least_at <= PATH_PATIENCE {
            let before = spent;
            on = path.advance(&self.scaled, left, deadline, &mut spent);
            self.newton.factorisations = begun + spent;
            path.reactions(&self.scaled, &mut self.r);
            self.record(DelassusPhase::Path, path.nu(), spent - before, on.is_some())?;
            if path.nu() < 0.5 * least {
                (least, least_at) = (path.nu(), spent);
            }
        }
        self.newton.factorisations = begun + spent;
        ControlFlow::Continue(())
    }

    /// Proximal steps from the iterate, until `patience` factorisations have not gained a factor of 3 or, in the quick attempt, a step
    /// fails.
    fn proximal(&mut self, mut alpha: f64, patience: usize, inner: usize) -> Outcome {
        let mut centre = self.r.clone();
        let (mut mark, mut mark_at) = (f64::INFINITY, self.newton.factorisations);
        // The violation at the centre, once known.
        let mut at_centre = f64::INFINITY;
        // Tolerance of the proximal problems, tightened where one is met without a Newton step: a norm over all contacts may hide one with
        // small forces.
        let mut precision = PRECISION;
        // Steps in a row that needed no factorisation, which no other limit counts.
        let mut idle = 0;
        loop {
            self.limits()?;
            let before = self.newton.factorisations;
            let left = self.options.max_factorisations - before;
            centre.copy_from_slice(&self.r);
            let scale = self.r.iter().flatten().fold(1.0_f64, |a, b| a.max(b.abs()));
            let tolerance = precision * scale;
            let outcome = self.newton.solve(
                &self.scaled,
                &mut self.r,
                alpha,
                &centre,
                tolerance,
                left.min(inner),
            );
            let work = self.newton.factorisations - before;
            let converged = outcome == Inner::Converged;
            idle = if work == 0 { idle + 1 } else { 0 };
            if idle > MAX_IDLE {
                return ControlFlow::Continue(());
            }
            if converged && work == 0 {
                precision = (1e-2 * precision).max(LEAST_PRECISION);
            }
            let progress = self.record(DelassusPhase::Proximal, alpha, work, converged)?;
            if converged {
                alpha = (alpha * SHRINK).max(LEAST_ALPHA);
                at_centre = progress;
            } else {
                alpha *= GROW;
                // The gain of a failed iteration is kept.
                if progress < at_centre {
                    at_centre = progress;
                } else {
                    self.r.copy_from_slice(&centre);
                }
            }
            if progress < 0.3 * mark {
                (mark, mark_at) = (progress, self.newton.factorisations);
            }
            let idled = self.newton.factorisations - mark_at > patience;
            let failed = inner == QUICK && !converged;
            if failed || idled || alpha > LARGEST_ALPHA {
                return ControlFlow::Continue(());
            }
        }
    }

    pub(super) fn report(mut self) -> Result<DelassusReport, ContactError> {
        let status = self.run();
        if !self.best_is_last {
            self.scaled.scale_into(&self.best, &mut self.at);
            let law = self.scaled.law(&self.at, &mut self.u, &mut self.contacts);
            self.residual = law.residual;
        }
        let contacts = self.at.iter().zip(&self.u).zip(&self.contacts);
        let states = contacts.map(|((r, u), [size, _])| state(r, u, *size)).collect();
        Ok(DelassusReport {
            status,
            residual: self.residual,
            u: self.problem.velocities(&self.best)?,
            r: self.best,
            states,
            factorisations: self.newton.factorisations,
            evaluations: self.scaled.evaluations(),
            sweeps: self.sweeps,
            history: self.history,
        })
    }
}

/// The piece of Coulomb's law given by the reaction of a contact in the cone.
fn piece<const D: usize>(mu: f64, r: &[f64; D]) -> Piece {
    if r[0] <= 0.0 {
        Piece::Open
    } else if tangential_norm(r) < (1.0 - ZERO) * mu * r[0] {
        Piece::Stick
    } else {
        Piece::Slip
    }
}

/// The state of a contact of a solution in scaled variables, the square of whose largest term is `size`.
fn state<const D: usize>(r: &[f64; D], u: &[f64; D], size: f64) -> ContactState {
    let vanishes = |v: f64| v * v <= ZERO * ZERO * size;
    if r[0] <= 0.0 || vanishes(r[0]) {
        ContactState::Open
    } else if vanishes(tangential_norm(u)) {
        ContactState::Stick
    } else if r[1] != 0.0 {
        ContactState::slipping(-r[1])
    } else {
        // Without friction (or across T1) only the slip gives the direction.
        ContactState::slipping(u[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::Matrix;

    /// Uncoupled contacts are solved by one sweep from any start, also after others have converged.
    #[test]
    fn sweeps_from_another_iterate_solve_all_contacts() {
        let q = [-1.0, 0.4].repeat(5);
        let problem = DelassusProblem::new(2, Matrix::identity(10), q, vec![0.6; 5]).unwrap();
        let options = DelassusOptions::default();
        let mut observe = |_: &DelassusIteration| ControlFlow::Continue(());
        let mut run = Run::<2>::new(&problem, &options, None, &mut observe);
        for start in [[0.0; 2], [7.0, 3.0], [0.0, 1.0]] {
            run.r.fill(start);
            assert_eq!(run.sweeps_of(1, false), ControlFlow::Break(Status::Solved));
            let mut r = [0.0; 10];
            run.scaled.unscale(&run.r, &mut r);
            for r in r.chunks(2) {
                assert!((r[0] - 1.0).abs() < 1e-15 && (r[1] + 0.4).abs() < 1e-15, "{r:?}");
            }
        }
    }
}
