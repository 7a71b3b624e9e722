//! Contact in the displacements alone, for bodies too large for one factorisation.

mod basis;
mod body;
mod derivative;
mod evolution;
mod floating;
mod kink;
mod newton;
mod node;
mod options;
mod report;
mod solve;
mod system;

use std::ops::ControlFlow;
use std::sync::Arc;

use super::body_state::BodyState;
use super::rounding::is_rounding_of;
use super::solution::judge;
use super::tolerances::{CONDENSED, RELATIVE_R};
use super::{
    CondensedContact, ContactError, ContactOptions, ContactProgress, ContactSolution, ContactStrategy,
    NodeLaw, check_law,
};
use crate::clock::{Clock, Until};
use crate::input::{check_finite, check_vector};
use crate::linear::LinearError;
use crate::run::Status;

pub use body::ReducedBody;
pub use derivative::ReducedSensitivity;
pub use evolution::ReducedLevel;
pub(super) use floating::floating_piece;
pub use options::ReducedOptions;
pub use report::{ReducedIteration, ReducedProgress, ReducedReport, ReducedTimes};
pub use solve::{ReducedError, ReducedNodes, ReducedObserver, solve_reduced, solve_reduced_observed};
use system::SerialSystem;
pub use system::{KrylovObserver, ReducedStep, ReducedSystem};

/// How many more displacements a body in the plane may have than one in space for a factorisation of about the same cost.
const THINNER: usize = 10;

/// A large [`ReducedBody`] under a [`NodeLaw`], solved by semismooth Newton in the displacements alone: the equations of the law are
/// eliminated at each node, which leaves the stiffness matrix with few rows changed, solved by GMRES with [multigrid](crate::guide::large).
/// λ is recovered as f − A u.
///
/// The stiffness matrix is stored once, in blocks; the only matrix that is factored has a few hundred unknowns. [`CondensedContact`] has
/// the same solutions where it can be used; continuation, enumeration and certificates need it.
///
/// ```
/// use semismooth::contact::{
///     FrictionCoefficient, LoadPath, OrthotropicCoulomb, ReducedContact, ReducedOptions,
/// };
/// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
/// // A block on the ground, fixed at the left, pressed and pulled.
/// let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [6, 6, 3])?;
/// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277)?).fix("left").discretize()?;
/// let press = system.traction("top", |_| [0.0, 0.0, -0.01])?;
/// let pull = system.traction("right", |_| [0.01, 0.0, 0.002])?;
/// let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))?;
/// let load = LoadPath::affine(press, pull);
/// let body = semismooth::reduced_body(&system, &rows, load)?;
/// let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.3)?);
/// let mut problem = ReducedContact::new(body, law, ReducedOptions::default())?;
/// let found = problem.solve(1.0, None)?;
/// assert!(found.residuals.largest() <= 1e-10);
/// let further = problem.solve(1.05, Some(&found.displacements))?;
/// assert!(problem.solution(1.05, &further.displacements)?.slip() > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ReducedContact<L> {
    body: Arc<ReducedBody>,
    law: L,
    options: ReducedOptions,
    system: SerialSystem,
    /// The component along ν of each contact node.
    components: Vec<usize>,
    r: f64,
    reference: Vec<f64>,
    history: Vec<f64>,
}

/// Checks the memory needed against its limit.
fn fits(body: &ReducedBody, options: &ReducedOptions) -> Result<(), ContactError> {
    let needed = body.memory(options);
    match options.max_memory {
        Some(limit) if needed > limit => Err(ContactError::Memory { needed, limit }),
        _ => Ok(()),
    }
}

/// A search without a solution.
struct Failed {
    /// In free displacements.
    best: ReducedReport,
    /// The error that ended it, if any.
    source: Option<LinearError>,
}

impl From<Failed> for ContactError {
    fn from(failed: Failed) -> Self {
        let best = Box::new(failed.best);
        match failed.source {
            Some(source) => Self::StepFailed { source, best },
            None => Self::NotConverged { best },
        }
    }
}

impl<L: NodeLaw> ReducedContact<L> {
    /// The problem, with its multigrid hierarchy.
    ///
    /// # Errors
    /// Options out of range, a law of another dimension, [`ContactError::Memory`] where more memory would be needed than the options allow;
    /// a stiffness matrix that is not positive definite ([`ContactError::Unsupported`] names a piece that the supports leave free to move);
    /// [`LinearError::TimeLimit`] where the time limit is reached before the hierarchy is complete.
    pub fn new(body: ReducedBody, law: L, options: ReducedOptions) -> Result<Self, ContactError> {
        options.validate()?;
        let tangents = body.dim() - 1;
        let p = body.num_contacts();
        check_law(&law, tangents, p)?;
        fits(&body, &options)?;
        let body = Arc::new(body);
        let until = Until::after(options.max_time);
        let system = SerialSystem::new(Arc::clone(&body), options.directions, options.max_krylov, until);
        let system = system.map_err(|e| match e {
            LinearError::NotPositiveDefinite => body.floating_piece().unwrap_or(e.into()),
            e => e.into(),
        })?;
        Ok(Self {
            components: body.basis.nodes.iter().map(|c| body.dim() * c).collect(),
            r: RELATIVE_R * body.node_stiffness(),
            reference: vec![0.0; p * tangents],
            history: vec![0.0; p * law.num_history()],
            body,
            law,
            options,
            system,
        })
    }

    /// Replaces the options, from the next solve on.
    ///
    /// # Errors
    /// Options out of range; [`ContactError::Memory`] where more memory would be needed than they allow.
    pub fn set_options(&mut self, options: ReducedOptions) -> Result<(), ContactError> {
        options.validate()?;
        fits(&self.body, &options)?;
        self.system.limit(options.directions, options.max_krylov);
        self.options = options;
        Ok(())
    }

    /// The body.
    #[must_use]
    pub fn body(&self) -> &ReducedBody {
        &self.body
    }

    /// The law of the nodes.
    #[must_use]
    pub fn node_law(&self) -> &L {
        &self.law
    }

    /// The augmentation parameter, chosen as in the other forms.
    #[must_use]
    pub fn r(&self) -> f64 {
        self.r
    }

    /// Nodes and stored blocks of the levels of multigrid, finest first.
    #[must_use]
    pub fn levels(&self) -> Vec<(usize, usize)> {
        self.system.levels()
    }

    /// A solution at α: by Newton's method from the displacements `start` (zero if there is none), then by load steps, then, where the
    /// options and the size of the body allow, by the strategies of [`CondensedContact::solve`].
    ///
    /// # Errors
    /// Wrong lengths, values that are not finite, coefficients of friction that the law rejects; [`ContactError::NotConverged`],
    /// also at the limit on time, [`ContactError::StepFailed`] and [`ContactError::NotReducible`], with the best
    /// iterate and its history.
    pub fn solve(&mut self, alpha: f64, start: Option<&[f64]>) -> Result<ReducedReport, ContactError> {
        self.solve_observed(alpha, start, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), calling `observe` before each Newton step, each GMRES iteration and each attempt in the condensed form; it
    /// may stop the search, except during a factorisation. It may be called from a worker thread.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); [`ContactError::NotConverged`] with the best iterate where `observe` has stopped.
    pub fn solve_observed(
        &mut self,
        alpha: f64,
        start: Option<&[f64]>,
        mut observe: impl FnMut(&ReducedProgress) -> ControlFlow<()> + Send,
    ) -> Result<ReducedReport, ContactError> {
        self.solve_telling(alpha, start, &mut observe)
    }

    pub(super) fn solve_telling(
        &mut self,
        alpha: f64,
        start: Option<&[f64]>,
        observe: &mut ReducedObserver<'_>,
    ) -> Result<ReducedReport, ContactError> {
        check_finite("the parameter", &[alpha])?;
        let n = self.body.num_displacements();
        let free = match start {
            Some(u) => {
                check_vector("the start", u, n)?;
                u.to_vec()
            }
            None => vec![0.0; n],
        };
        let nodes = ReducedNodes {
            components: &self.components,
            first: 0,
            gap: &self.body.gap,
            reference: &self.reference,
            history: &self.history,
            r: self.r,
            parameter: alpha,
        };
        for i in 0..self.components.len() {
            let h = self.law.num_history();
            let mut v = super::LocalValues {
                node: i,
                parameter: alpha,
                r: self.r,
                ..super::LocalValues::default()
            };
            v.history[..h].copy_from_slice(&self.history[i * h..(i + 1) * h]);
            self.law.check(&v)?;
        }
        let load = self.load_at(alpha);
        check_finite("the load", &load)?;
        let load = self.body.turned_forces(&load);
        let u = self.body.turned(&free);
        let (system, options) = (&mut self.system, &self.options);
        system.set_time_limit(options.max_time);
        let solved = solve_reduced_observed(system, &nodes, &self.law, &load, u, options, observe);
        match solved {
            Ok(report) => Ok(self.in_free(report)),
            Err(e) => {
                let failed = self.failed(e)?;
                self.condensed(alpha, &load, failed, observe)
            }
        }
    }

    /// The load at α; what is left of load cases that balance each other up to rounding is as good as nothing.
    fn load_at(&self, alpha: f64) -> Vec<f64> {
        let n = self.body.num_displacements();
        let mut load = self.body.load.at(&[alpha], n);
        if is_rounding_of(&load, &self.body.load.terms(&[alpha], n)) {
            load.fill(0.0);
        }
        load
    }

    /// The best iterate of a search without a solution and the error that ended it, if any; other errors are passed on.
    fn failed(&self, error: ReducedError<LinearError>) -> Result<Failed, ContactError> {
        let (best, source) = match error {
            ReducedError::System { source, best } => (best, Some(source)),
            ReducedError::Contact(ContactError::NotConverged { best }) if best.status.is_early() => {
                let best = Box::new(self.in_free(*best));
                return Err(ContactError::NotConverged { best });
            }
            ReducedError::Contact(ContactError::NotConverged { best }) => (best, None),
            ReducedError::Contact(ContactError::NotReducible { node, piece, best }) => {
                let best = Box::new(self.in_free(*best));
                return Err(ContactError::NotReducible { node, piece, best });
            }
            ReducedError::Contact(e) => return Err(e),
        };
        Ok(Failed {
            best: self.in_free(*best),
            source,
        })
    }

    fn in_free(&self, mut report: ReducedReport) -> ReducedReport {
        report.displacements = self.body.free(&report.displacements);
        report
    }

    /// The strategies of the condensed form, polished here.
    fn condensed(
        &mut self,
        alpha: f64,
        load: &[f64],
        failed: Failed,
        observe: &mut ReducedObserver<'_>,
    ) -> Result<ReducedReport, ContactError> {
        let (n, q) = (self.body.num_displacements(), failed.best.forces.len());
        let spent = failed.best.times.total();
        let late = self.options.max_time.is_some_and(|limit| spent >= limit);
        let most = match self.body.dim() {
            2 => self.options.max_condensed.saturating_mul(THINNER),
            _ => self.options.max_condensed,
        };
        if n > most || q > CONDENSED || late {
            return Err(failed.into());
        }
        let clock = Clock::start();
        let left = self.options.max_time.map(|limit| limit.saturating_sub(spent));
        let options = ContactOptions::default().with_max_time(left);
        let mut progress = ReducedProgress {
            load: 1.0,
            newton: failed.best.newton(),
            krylov: 0,
            residual: failed.best.residuals.largest(),
        };
        let mut stopped = false;
        let mut each = |tried: &ContactProgress| {
            progress.load = tried.level;
            let flow = observe(&progress);
            stopped |= flow.is_break();
            flow
        };
        let found = self.condensed_solution(alpha, &options, &mut each);
        let late = self
            .options
            .max_time
            .is_some_and(|limit| spent + clock.elapsed() >= limit);
        let u = match found {
            Ok(u) => u,
            Err(_) if stopped || late => {
                let mut best = Box::new(failed.best);
                best.status = if stopped {
                    Status::Interrupted
                } else {
                    Status::TimeLimit
                };
                return Err(ContactError::NotConverged { best });
            }
            Err(_) => return Err(failed.into()),
        };
        let u = self.body.turned(&u);
        let elapsed = clock.elapsed();
        let nodes = ReducedNodes {
            components: &self.components,
            first: 0,
            gap: &self.body.gap,
            reference: &self.reference,
            history: &self.history,
            r: self.r,
            parameter: alpha,
        };
        let options = self.options.clone().with_max_load_steps(0);
        let before = failed.best;
        let join = |mut report: ReducedReport| {
            let mut iterations = before.iterations.clone();
            iterations.append(&mut report.iterations);
            report.iterations = iterations;
            report.strategy = ContactStrategy::Condensed;
            report.times.select += before.times.select;
            report.times.krylov += before.times.krylov;
            report.times.rest += before.times.rest + elapsed;
            report
        };
        let system = &mut self.system;
        system.set_time_limit(options.max_time);
        match solve_reduced_observed(system, &nodes, &self.law, load, u, &options, observe) {
            Ok(report) => Ok(join(self.in_free(report))),
            Err(e) => {
                let Failed { best, source } = self.failed(e)?;
                let best = join(best);
                Err(Failed { best, source }.into())
            }
        }
    }

    /// Displacements from the condensed form, if the memory left suffices for it.
    fn condensed_solution(
        &self,
        alpha: f64,
        options: &ContactOptions,
        observe: &mut dyn FnMut(&ContactProgress) -> ControlFlow<()>,
    ) -> Result<Vec<f64>, ContactError> {
        let clock = Clock::start();
        let taken = self
            .body
            .memory(&self.options)
            .saturating_add(self.body.memory_by_columns());
        let left = match self.options.max_memory {
            Some(limit) if taken > limit => {
                return Err(ContactError::Memory { needed: taken, limit });
            }
            limit => limit.map(|limit| limit - taken),
        };
        let (body, law): (_, &dyn NodeLaw) = (self.body.to_contact_body()?, &self.law);
        let mut problem = CondensedContact::within(body, law, left, options.max_time)?;
        problem.set_reference_slip(&self.reference)?;
        problem.set_history(&self.history)?;
        let left = options
            .max_time
            .map(|limit| limit.saturating_sub(clock.elapsed()));
        let options = options.clone().with_max_time(left);
        let found = problem.solve_observed(alpha, None, &options, observe)?;
        problem.displacements(&found.x)
    }

    /// States, local quantities, energies and residuals at displacements.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn solution(&self, alpha: f64, displacements: &[f64]) -> Result<ContactSolution, ContactError> {
        let n = self.body.num_displacements();
        check_vector("the displacements", displacements, n)?;
        let load = self.load_at(alpha);
        let u = self.body.turned(displacements);
        let f = self.body.turned_forces(&load);
        let mut image = vec![0.0; u.len()];
        self.body.stiffness.mul(&u, &mut image);
        let (p, tangents) = (self.components.len(), self.body.dim() - 1);
        let mut is_contact = vec![false; u.len()];
        let mut values = Vec::with_capacity(p);
        for (i, &at) in self.components.iter().enumerate() {
            let mut v = super::LocalValues {
                node: i,
                penetration: u[at] - self.body.gap[i],
                pressure: f[at] - image[at],
                parameter: alpha,
                r: self.r,
                ..super::LocalValues::default()
            };
            is_contact[at] = true;
            for d in 0..tangents {
                v.slip[d] = u[at + 1 + d] - self.reference[d * p + i];
                v.traction[d] = f[at + 1 + d] - image[at + 1 + d];
                is_contact[at + 1 + d] = true;
            }
            let h = self.law.num_history();
            v.history[..h].copy_from_slice(&self.history[i * h..(i + 1) * h]);
            values.push(v);
        }
        let (mut worst, mut size) = (0.0f64, f64::MIN_POSITIVE);
        for ((a, f), contact) in image.iter().zip(&f).zip(&is_contact) {
            size = size.max(a.abs()).max(f.abs());
            let rest = (a - f).abs();
            if *contact {
                size = size.max(rest);
            } else {
                worst = worst.max(rest);
            }
        }
        let equilibrium = worst / size;
        let stiff = self.body.free_forces(&image);
        let supports = self.body.load.support_state(&[alpha]);
        let state = BodyState::of(displacements.to_vec(), stiff, load, supports);
        Ok(ContactSolution::assemble(
            values,
            |v| judge(&self.law, v),
            |i| {
                let at = |d: usize| self.reference.get(d * p + i).copied().unwrap_or(0.0);
                [self.body.gap[i], at(0), at(1)]
            },
            (state.stored(), state.load_energy(), equilibrium),
            0.0,
        ))
    }

    /// Sets the tangential displacements from which slips are measured (all along t₁, then all along t₂), as
    /// [`Contact::set_reference_slip`](super::Contact::set_reference_slip) does. Zero at first.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn set_reference_slip(&mut self, reference: &[f64]) -> Result<(), ContactError> {
        check_vector("the reference of the slip", reference, self.reference.len())?;
        self.reference.copy_from_slice(reference);
        Ok(())
    }

    /// Sets the history variables, node by node: those at the end of the level before. Zero at first.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn set_history(&mut self, history: &[f64]) -> Result<(), ContactError> {
        check_vector("the list of history variables", history, self.history.len())?;
        self.history.copy_from_slice(history);
        Ok(())
    }

    /// The history variables, node by node.
    #[must_use]
    pub fn history(&self) -> &[f64] {
        &self.history
    }

    /// Ends a load level at displacements: history variables and the reference of slips are updated.
    ///
    /// # Errors
    /// As [`solution`](Self::solution).
    pub fn end_level(&mut self, alpha: f64, displacements: &[f64]) -> Result<(), ContactError> {
        let solution = self.solution(alpha, displacements)?;
        self.end_at(&solution);
        Ok(())
    }

    fn end_at(&mut self, solution: &ContactSolution) {
        let (p, h) = (self.components.len(), self.law.num_history());
        for v in &solution.nodes {
            self.law
                .update(v, &mut self.history[v.node * h..(v.node + 1) * h]);
            for d in 0..self.body.dim() - 1 {
                self.reference[d * p + v.node] += v.slip[d];
            }
        }
    }
}
