//! Bodies condensed onto their contact nodes, for the condensed form on one process.

use semismooth::InputError;
use semismooth::contact::{ContactBody, ContactError};
use semismooth::interface::LoadPath;
use semismooth::sparse::Matrix as Sparse;

use crate::DistributedBody;
use crate::body::{BodyError, Boxed};
use crate::ffi::Int;
use crate::handles::{Solver, Vector};
use crate::system::{SolverError, krylov};
use crate::world::{Error, PetscError};

/// A [`DistributedBody`] without its inner displacements: the Schur complement S of its stiffness matrix on the contact nodes, a dense
/// matrix on process 0, from a Cholesky factorisation by MUMPS on all processes. The factors are freed; loads are condensed onto the
/// contact nodes, and displacements recovered, by the linear solver that options of PETSc choose (to 1e-12).
///
/// The condensed body consists of the contact nodes, with stiffness S and the same contact forces. On process 0 it serves as input of
/// [`CondensedContact`](semismooth::contact::CondensedContact), so that paths, diagrams and enumeration can be computed for bodies whose
/// factors no single process could store. Contact nodes are numbered process by process, as for laws of the distributed body; the
/// displacements of a node are those along ν, t₁[, t₂].
///
/// ```no_run
/// use semismooth::contact::{CondensedContact, OrthotropicCoulomb};
/// use semismooth_petsc::{DistributedBody, Error, World};
/// /// Displacements of the part at α = 1 under `press` + α `pull`.
/// fn from_one_process(
///     world: &World,
///     body: &DistributedBody<'_>,
///     law: OrthotropicCoulomb,
///     [press, pull]: [&[f64]; 2],
/// ) -> Result<Vec<f64>, Error> {
///     let mut condensed = body.condense(Some(1 << 30))?;
///     let nodes = condensed.contact_body(press, pull)?;
///     let solved = nodes.map(|nodes| CondensedContact::new(nodes, law)?.solve(1.0, None));
///     let mut forces = world.agree(solved.transpose())?.unwrap_or_default(); // on process 0: λ, then α
///     forces.pop();
///     let load: Vec<f64> = press.iter().zip(pull).map(|(a, b)| a + b).collect();
///     condensed.displacements(&load, &forces)
/// }
/// ```
#[derive(Debug)]
pub struct CondensedBody<'b, 'w> {
    body: &'b DistributedBody<'w>,
    solver: Solver<'w>,
    /// On process 0: S, row by row, with the components of a node together; gaps; the number of contact nodes on each process.
    schur: Vec<f64>,
    gap: Vec<f64>,
    counts: Vec<usize>,
}

/// Relative residual requested for displacements, largest one that is accepted, and largest number of iterations.
const EXACT: f64 = 1e-13;
const REACHED: f64 = 1e-12;
const ITERATIONS: usize = 1000;
const DIRECTIONS: usize = 30;
/// Largest relative error of contact forces condensed onto the contact nodes, which should remain unchanged.
const TRUSTED: f64 = 1e-7;
/// Upper bound of the memory of process 0 during condensation, in dense matrices: S here and in MUMPS, S as a sparse matrix with its indices,
/// its factor.
const COPIES: u64 = 6;

impl<'w> DistributedBody<'w> {
    /// Eliminates all but the contact nodes, by MUMPS. `max_memory`, in bytes, limits the dense matrices on process 0 and is checked before
    /// they are allocated; it does not limit the factor, which MUMPS allocates on all processes. Collective.
    ///
    /// # Errors
    /// Dense matrices beyond `max_memory` or beyond `PetscInt`, a PETSc without MUMPS, a failed allocation in MUMPS.
    pub fn condense(&self, max_memory: Option<u64>) -> Result<CondensedBody<'_, 'w>, Error> {
        let world = self.world;
        let q = self.dim * self.num_contacts();
        let needed = 8 * COPIES * (q as u64).saturating_pow(2);
        world.agree(match max_memory {
            Some(limit) if needed > limit => Err(ContactError::Memory { needed, limit }),
            _ => Ok(()),
        })?;
        world.agree(match Int::try_from(q.saturating_mul(q)) {
            Ok(_) => Ok(()),
            Err(_) => Err(BodyError::TooLarge { unknowns: q }),
        })?;
        world.agree(self.eliminate())
    }

    fn eliminate(&self) -> Result<CondensedBody<'_, 'w>, Boxed> {
        let world = self.world;
        let first = (self.dim * self.first) as u64;
        let own: Vec<u64> = self.components.iter().map(|c| first + *c as u64).collect();
        let starts = world.collect(&own)?;
        let counts: Vec<usize> = starts.iter().map(Vec::len).collect();
        let rows: Vec<Int> = starts
            .concat()
            .into_iter()
            .flat_map(|c| (0..self.dim as u64).map(move |d| (c + d) as Int))
            .collect();
        let bits: Vec<u64> = self.gap.iter().map(|g| g.to_bits()).collect();
        let gap = world.collect(&bits)?.concat();
        let mut schur = vec![0.0; rows.len() * rows.len()];
        let stiffness = self.stiffness.original()?;
        world.trim();
        stiffness.eliminate_others(&rows, &mut schur)?;
        let mut solver = krylov(world, DIRECTIONS)?;
        solver.set(stiffness, stiffness)?;
        let mut condensed = CondensedBody {
            body: self,
            solver,
            schur,
            gap: gap.into_iter().map(f64::from_bits).collect(),
            counts,
        };
        condensed.verify()?;
        Ok(condensed)
    }
}

impl CondensedBody<'_, '_> {
    /// On process 0 the body of the contact nodes under the load `constant` + α `slope`, forces on the free displacements of each part
    /// as in [`solve`](crate::DistributedContact::solve); `None` elsewhere. Collective.
    ///
    /// # Errors
    /// Loads of the wrong length, errors of PETSc.
    pub fn contact_body(&mut self, constant: &[f64], slope: &[f64]) -> Result<Option<ContactBody>, Error> {
        let loads = [self.reduced(constant)?, self.reduced(slope)?];
        let body = match self.body.world.rank() {
            0 => self.of_nodes(loads).map(Some),
            _ => Ok(None),
        };
        self.body.world.agree(body)
    }

    /// On process 0 the load condensed onto the contact nodes: S times the displacements that it causes there.
    fn reduced(&mut self, load: &[f64]) -> Result<Vec<f64>, Error> {
        let (body, world) = (self.body, self.body.world);
        world.agree(body.check_length("the load", load))?;
        world.agree(self.brought_down(&body.turned(load)))
    }

    fn brought_down(&mut self, f: &[f64]) -> Result<Vec<f64>, Boxed> {
        let u = self.solve(f)?;
        let u = self.at_contacts(&u)?;
        let rows = self.schur.chunks_exact(u.len().max(1));
        Ok(rows
            .map(|row| row.iter().zip(&u).map(|(a, u)| a * u).sum())
            .collect())
    }

    /// On process 0 the components of a vector at all contact nodes.
    fn at_contacts(&self, v: &[f64]) -> Result<Vec<f64>, PetscError> {
        let own = self
            .body
            .components
            .iter()
            .flat_map(|c| &v[*c..c + self.body.dim]);
        let own: Vec<u64> = own.map(|v| v.to_bits()).collect();
        let all = self.body.world.collect(&own)?.concat();
        Ok(all.into_iter().map(f64::from_bits).collect())
    }

    /// Checks that condensation leaves forces on the contact nodes unchanged: libraries differ in the form in which they return S.
    fn verify(&mut self) -> Result<(), Boxed> {
        let mut forces = vec![0.0; self.body.len];
        for (k, c) in self.body.components.iter().enumerate() {
            (0..self.body.dim).for_each(|d| forces[c + d] = (1 + (3 * k + d) % 7) as f64);
        }
        let (found, expected) = (self.brought_down(&forces)?, self.at_contacts(&forces)?);
        let differ = found.iter().zip(&expected).map(|(a, b)| (a - b).abs() / 7.0);
        let error = differ.fold(0.0, |m: f64, d| if d.is_nan() { d } else { m.max(d) });
        match error <= TRUSTED {
            true => Ok(()),
            false => Err(BodyError::Schur { error }.into()),
        }
    }

    fn of_nodes(&self, [constant, slope]: [Vec<f64>; 2]) -> Result<ContactBody, ContactError> {
        let (dim, p) = (self.body.dim, self.body.num_contacts());
        let rows: Vec<&[f64]> = self.schur.chunks_exact(dim * p).collect();
        let trace = |d: usize| {
            let entries: Vec<_> = (0..p).map(|i| (i, dim * i + d, 1.0)).collect();
            Sparse::from_triplets(p, dim * p, &entries)
        };
        let tangential = (1..dim).map(trace).collect::<Result<_, _>>()?;
        let load = LoadPath::affine(constant, slope);
        ContactBody::new(Sparse::from_rows(&rows)?, trace(0)?, tangential, load)?.with_gap(self.gap.clone())
    }

    /// The free displacements of each part under a load of the part and contact forces. The forces are those on process 0: λν of all nodes,
    /// then λt₁, in space then λt₂; `forces` on other processes is ignored. Collective.
    ///
    /// # Errors
    /// Lists of the wrong length, errors of PETSc.
    pub fn displacements(&mut self, load: &[f64], forces: &[f64]) -> Result<Vec<f64>, Error> {
        let (body, world) = (self.body, self.body.world);
        let p = body.num_contacts();
        let mut checked = body.check_length("the load", load);
        if checked.is_ok() && world.rank() == 0 && forces.len() != body.dim * p {
            checked = Err(ContactError::Input(InputError::Length {
                what: "the list of contact forces",
                expected: body.dim * p,
                found: forces.len(),
            }));
        }
        world.agree(checked)?;
        let mut first = 0;
        let lists = self.counts.iter().filter(|_| world.rank() == 0).map(|count| {
            let nodes = first..first + count;
            first += count;
            let at = (0..body.dim).flat_map(|d| nodes.clone().map(move |i| forces[d * p + i].to_bits()));
            at.collect::<Vec<u64>>()
        });
        let lists: Vec<_> = lists.collect();
        let own = world.agree(world.spread(&lists))?;
        let mut all = body.turned(load);
        for (k, v) in own.iter().enumerate() {
            let (d, i) = (k / body.components.len(), k % body.components.len());
            all[body.components[i] + d] -= f64::from_bits(*v);
        }
        let u = world.agree(self.solve(&all))?;
        body.free(&u)
    }

    /// A⁻¹ f, at all components of this process.
    fn solve(&mut self, f: &[f64]) -> Result<Vec<f64>, Boxed> {
        let body = self.body;
        let mut b = Vector::new(body.world, body.len, body.dim)?;
        let mut x = Vector::new(body.world, body.len, body.dim)?;
        b.set(f)?;
        let solved = self.solver.solve(&b, &mut x, EXACT, ITERATIONS)?;
        let mut size = [f.iter().map(|f| f * f).sum::<f64>()];
        body.world.add(&mut size)?;
        // False for NaN, too.
        let reached = solved.residual <= REACHED * size[0].sqrt();
        if solved.reason < 0 || !reached {
            return Err(SolverError::Diverged {
                reason: solved.reason,
                iterations: solved.iterations,
            }
            .into());
        }
        let mut u = vec![0.0; body.len];
        x.get(&mut u)?;
        Ok(u)
    }
}
