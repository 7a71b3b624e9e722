use semismooth::contact::{
    ContactError, LocalValues, NodeLaw, ReducedError, ReducedNodes, ReducedOptions, ReducedReport, check_law,
    solve_reduced,
};

use crate::DistributedBody;
use crate::body::Boxed;
use crate::system::System;
use crate::world::{Error, World};

/// The augmentation parameter against the stiffness of single contact nodes, as in one process.
const GIVING_WAY: f64 = 0.25;

/// A [`DistributedBody`] under a [`NodeLaw`], solved by semismooth Newton in the displacements alone, like
/// [`ReducedContact`](semismooth::contact::ReducedContact), with the same laws, options and reports; but for
/// `max_condensed`, of which there is nothing here; `max_memory` is what each process may take.
///
/// Displacements are those of each part, as its [`ElasticSystem`](semismooth::fem::ElasticSystem) numbers them, at nodes of other processes
/// too: [`ElasticSystem::displacements`](semismooth::fem::ElasticSystem::displacements), stresses and files take them as they are. Forces are those of the
/// contact nodes of the process.
#[derive(Debug)]
pub struct DistributedContact<'w, L> {
    system: System<'w>,
    law: L,
    options: ReducedOptions,
    r: f64,
    pub(crate) reference: Vec<f64>,
    pub(crate) history: Vec<f64>,
}

impl<'w, L: NodeLaw> DistributedContact<'w, L> {
    /// The problem.
    ///
    /// # Errors
    /// Options out of range, a law of another dimension or for another number of nodes, [`ContactError::Memory`] where
    /// [`DistributedBody::memory`] is above the limit in a process, before anything is allocated; what PETSc says.
    pub fn new(body: DistributedBody<'w>, law: L, options: ReducedOptions) -> Result<Self, Error> {
        let world = body.world;
        world.agree(fits(&body, &law, &options))?;
        let (p, r) = (body.components.len(), GIVING_WAY * body.node_stiffness);
        let (tangents, history) = (body.dim - 1, law.num_history());
        let system = System::new(body, options.directions, options.max_krylov);
        Ok(Self {
            system: world.agree(system)?,
            law,
            options,
            r,
            reference: vec![0.0; p * tangents],
            history: vec![0.0; p * history],
        })
    }

    /// The body.
    #[must_use]
    pub fn body(&self) -> &DistributedBody<'w> {
        &self.system.body
    }

    /// The law of the nodes.
    #[must_use]
    pub fn node_law(&self) -> &L {
        &self.law
    }

    pub(crate) fn world(&self) -> &'w World {
        self.system.body.world
    }

    /// A solution at α under a load, the forces on the free displacements of the part (those that stem from moved supports among them), by
    /// Newton's method from the displacements `start` (zero if there is none), then by load steps.
    ///
    /// # Errors
    /// On all processes, if there is one on any: wrong lengths, values that are not finite, coefficients of friction that the law
    /// refuses. [`ContactError::NotConverged`], [`ContactError::Interrupted`], [`ContactError::NotReducible`] or [`ContactError::Elsewhere`], with the best iterate and the
    /// history, is the source of the error where no solution was found, and [`Error::StepFailed`] has them where a linear solver failed.
    pub fn solve(&mut self, alpha: f64, load: &[f64], start: Option<&[f64]>) -> Result<ReducedReport, Error> {
        self.world().agree(self.check(alpha, load, start))?;
        let body = &self.system.body;
        let load = body.turned(load);
        let u = start.map_or_else(|| vec![0.0; body.len], |u| body.turned(u));
        let (components, gap) = (body.components.clone(), body.gap.clone());
        let nodes = ReducedNodes {
            components: &components,
            first: body.first_contact(),
            gap: &gap,
            reference: &self.reference,
            history: &self.history,
            r: self.r,
            parameter: alpha,
        };
        let solved = solve_reduced(&mut self.system, &nodes, &self.law, &load, u, &self.options);
        let (best, end) = match solved {
            Ok(report) => (Some(report), End::Solved),
            Err(ReducedError::System { source, best }) => (Some(*best), End::Step(source)),
            Err(ReducedError::Contact(e)) => match e {
                ContactError::NotConverged { best } => (Some(*best), End::NotConverged),
                ContactError::Interrupted { best } => (Some(*best), End::Interrupted),
                ContactError::NotReducible { node, piece, best } => (Some(*best), End::Law(node, piece)),
                ContactError::Elsewhere { best } => (Some(*best), End::Elsewhere),
                e => (None, End::Other(e)),
            },
            Err(e) => (None, End::Other(ContactError::Invalid { what: e.to_string() })),
        };
        // All processes take part, whatever each has found.
        let own = best.as_ref().map(|best| best.displacements.as_slice());
        let blank = vec![0.0; self.system.body.len];
        let displacements = self.system.body.free(own.unwrap_or(&blank))?;
        let best = best.map(|mut best| {
            best.displacements = displacements;
            Box::new(best)
        });
        self.ended(best, end)
    }

    /// The result of all processes.
    fn ended(&self, best: Option<Box<ReducedReport>>, end: End) -> Result<ReducedReport, Error> {
        let found = match (end, best) {
            (End::Solved, Some(best)) => Ok(*best),
            // Agreed before.
            (End::Step(source), Some(best)) => {
                let source = Box::new(source);
                return Err(Error::StepFailed { source, best });
            }
            (End::Interrupted, Some(best)) => Err(Some(ContactError::Interrupted { best })),
            (End::NotConverged, Some(best)) => Err(Some(ContactError::NotConverged { best })),
            (End::Law(node, piece), Some(best)) => {
                Err(Some(ContactError::NotReducible { node, piece, best }))
            }
            (End::Elsewhere, Some(best)) => {
                let mut told = self.world().settle(Err(None));
                if let Err(Error::Agreed { source, .. }) = &mut told {
                    *source = Some(ContactError::Elsewhere { best }.into());
                }
                return told;
            }
            (End::Other(e), _) => Err(Some(e)),
            (_, None) => Err(None),
        };
        self.world().settle(found.map_err(|e| e.map(Into::into)))
    }

    pub(crate) fn check(&self, alpha: f64, load: &[f64], start: Option<&[f64]>) -> Result<(), ContactError> {
        let vectors = [("the load", Some(load)), ("the start", start)];
        for (what, v) in vectors.iter().filter_map(|(what, v)| Some((*what, (*v)?))) {
            self.system.body.check_length(what, v)?;
            check_finite(what, v)?;
        }
        check_finite("the parameter", &[alpha])?;
        (0..self.system.body.components.len()).try_for_each(|i| self.law.check(&self.blank(i, alpha)))
    }

    /// What the law sees at node i, without displacements and forces.
    fn blank(&self, i: usize, alpha: f64) -> LocalValues {
        let h = self.law.num_history();
        let mut v = LocalValues::default();
        v.node = self.system.body.first_contact() + i;
        (v.parameter, v.r) = (alpha, self.r);
        v.history[..h].copy_from_slice(&self.history[i * h..(i + 1) * h]);
        v
    }

    /// Ends a load level at what was found: history variables and the slips that count as none are updated.
    ///
    /// # Errors
    /// A report that does not belong to this problem.
    pub fn end_level(&mut self, alpha: f64, found: &ReducedReport) -> Result<(), Error> {
        let (p, dim) = (self.system.body.components.len(), self.system.body.dim);
        let mut checked = self.check(alpha, &found.displacements, None);
        if checked.is_ok() && found.forces.len() != dim * p {
            checked = Err(ContactError::Length {
                what: "the list of contact forces",
                expected: dim * p,
                found: found.forces.len(),
            });
        }
        self.world().agree(checked)?;
        let u = self.system.body.turned(&found.displacements);
        let h = self.law.num_history();
        for i in 0..p {
            let (at, mut v) = (self.system.body.components[i], self.blank(i, alpha));
            v.penetration = u[at] - self.system.body.gap[i];
            v.pressure = found.forces[i];
            for d in 0..dim - 1 {
                v.slip[d] = u[at + 1 + d] - self.reference[d * p + i];
                v.traction[d] = found.forces[(1 + d) * p + i];
                self.reference[d * p + i] = u[at + 1 + d];
            }
            self.law.update(&v, &mut self.history[i * h..(i + 1) * h]);
        }
        Ok(())
    }
}

/// How a solve ended in this process.
enum End {
    Solved,
    NotConverged,
    Interrupted,
    Step(Error),
    Law(usize, String),
    Elsewhere,
    Other(ContactError),
}

fn fits(body: &DistributedBody<'_>, law: &impl NodeLaw, options: &ReducedOptions) -> Result<(), Boxed> {
    options.validate()?;
    check_law(law, body.dim - 1, body.num_contacts())?;
    let needed = body.memory(options);
    match options.max_memory {
        Some(limit) if needed > limit => Err(ContactError::Memory { needed, limit }.into()),
        _ => Ok(()),
    }
}

fn check_finite(what: &'static str, v: &[f64]) -> Result<(), ContactError> {
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ContactError::NotFinite {
            what,
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}
