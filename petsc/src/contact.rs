use semismooth::InputError;
use semismooth::contact::{
    ContactError, LocalValues, NodeLaw, ReducedError, ReducedNodes, ReducedOptions, ReducedReport, check_law,
    solve_reduced,
};

use crate::DistributedBody;
use crate::body::Boxed;
use crate::system::System;
use crate::world::{Error, World};

/// The augmentation parameter r over the mean stiffness of single contact nodes, as on one process.
const GIVING_WAY: f64 = 0.25;

/// A [`DistributedBody`] under a [`NodeLaw`], solved by semismooth Newton in the displacements alone, like
/// [`ReducedContact`](semismooth::contact::ReducedContact), with the same laws, options and reports. The option `max_condensed` has no
/// effect here; `max_memory` is the limit for each process.
///
/// Displacements are those of each part, as its [`ElasticSystem`](semismooth::fem::ElasticSystem) numbers them, including those at nodes of
/// other processes: [`ElasticSystem::displacements`](semismooth::fem::ElasticSystem::displacements), stresses and output accept them
/// unchanged. Forces are those of the contact nodes of the process.
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
    /// The contact problem of a body and a law.
    ///
    /// # Errors
    /// Options out of range, a law of another dimension or for another number of nodes, [`ContactError::Memory`] if
    /// [`DistributedBody::memory`] exceeds the limit on a process (checked before anything is allocated), errors of PETSc.
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

    /// A solution at α under `load`, the forces on the free displacements of the part (including those of prescribed displacements), by
    /// Newton's method from the displacements `start` (zero for `None`), then by load steps.
    ///
    /// # Errors
    /// On all processes, if there is one on any: wrong lengths, values that are not finite, coefficients of friction that the law
    /// refuses. If no solution was found, the source of the error is [`ContactError::NotConverged`],
    /// [`ContactError::NotReducible`] or [`ContactError::Elsewhere`], with the best iterate and the history. If a linear solver failed, the
    /// error is [`Error::StepFailed`], with the same.
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
                ContactError::NotReducible { node, piece, best } => (Some(*best), End::Law(node, piece)),
                ContactError::Elsewhere { best } => (Some(*best), End::Elsewhere),
                e => (None, End::Other(e)),
            },
            Err(e) => (None, End::Other(ContactError::Invalid { what: e.to_string() })),
        };
        // Collective: all processes call it, whatever their result is.
        let own = best.as_ref().map(|best| best.displacements.as_slice());
        let blank = vec![0.0; self.system.body.len];
        let displacements = self.system.body.free(own.unwrap_or(&blank))?;
        let best = best.map(|mut best| {
            best.displacements = displacements;
            Box::new(best)
        });
        self.ended(best, end)
    }

    /// The result on which all processes agree.
    fn ended(&self, best: Option<Box<ReducedReport>>, end: End) -> Result<ReducedReport, Error> {
        let found = match (end, best) {
            (End::Solved, Some(best)) => Ok(*best),
            // All processes have agreed on this error already.
            (End::Step(source), Some(best)) => {
                let source = Box::new(source);
                return Err(Error::StepFailed { source, best });
            }
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

    /// The arguments of the law at node i, with displacements and forces zero.
    fn blank(&self, i: usize, alpha: f64) -> LocalValues {
        let h = self.law.num_history();
        let mut v = LocalValues::default();
        v.node = self.system.body.first_contact() + i;
        (v.parameter, v.r) = (alpha, self.r);
        v.history[..h].copy_from_slice(&self.history[i * h..(i + 1) * h]);
        v
    }

    /// Ends a load level with a solution: updates the history variables and the reference positions from which slip is measured.
    ///
    /// # Errors
    /// A report whose sizes do not fit this problem.
    pub fn end_level(&mut self, alpha: f64, found: &ReducedReport) -> Result<(), Error> {
        let (p, dim) = (self.system.body.components.len(), self.system.body.dim);
        let mut checked = self.check(alpha, &found.displacements, None);
        if checked.is_ok() && found.forces.len() != dim * p {
            checked = Err(ContactError::Input(InputError::Length {
                what: "the list of contact forces",
                expected: dim * p,
                found: found.forces.len(),
            }));
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

/// How a solve ended on this process.
enum End {
    Solved,
    NotConverged,
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
        Some(index) => Err(ContactError::Input(InputError::NotFinite {
            what,
            index,
            value: v[index],
        })),
        None => Ok(()),
    }
}
