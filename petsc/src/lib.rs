//! Contact with friction on bodies distributed over many processes.
//!
//! [`semismooth`] provides the laws of contact nodes and Newton's method in the displacements
//! ([`solve_reduced`](semismooth::contact::solve_reduced)), PETSc the matrices and linear solvers, MPI the messages. Each process has a
//! [`Part`] of the mesh, on which [`semismooth::fem`] assembles loads and contact rows. A [`DistributedBody`] joins the parts;
//! [`DistributedContact`] solves its contact problem, as [`ReducedContact`](semismooth::contact::ReducedContact) does on one process.
//!
//! ```no_run
//! use semismooth::contact::{FrictionCoefficient, OrthotropicCoulomb, ReducedOptions};
//! use semismooth::fem::{Elasticity, Foundation, Material};
//! use semismooth_petsc::{DistributedBody, DistributedContact, Part, run};
//!
//! fn main() -> std::process::ExitCode {
//!     run(std::env::args().skip(1), |world| {
//!         let part = Part::block(world, [0.0; 3], [2.0, 2.0, 1.0], [88, 84, 44])?;
//!         let material = world.agree(Material::isotropic(1.0, 0.277))?;
//!         let system = Elasticity::new(part.mesh().clone(), material).fix("left").discretize();
//!         let system = world.agree(system)?;
//!         let press = world.agree(system.traction("top", |_| [0.0, 0.0, -0.01]))?;
//!         let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]));
//!         let body = DistributedBody::new(world, &part, &system, &world.agree(rows)?)?;
//!         let law = OrthotropicCoulomb::isotropic(world.agree(FrictionCoefficient::constant(0.3))?);
//!         let mut problem = DistributedContact::new(body, law, ReducedOptions::default())?;
//!         let found = problem.solve(0.0, &press, None)?;
//!         if world.rank() == 0 {
//!             println!("open, sticking, slipping: {:?}", found.states);
//!         }
//!         Ok(())
//!     })
//! }
//! ```
//!
//! Options of PETSc choose the linear solver; without them it is GMRES, preconditioned by PETSc's algebraic multigrid with the rigid
//! motions as near-kernel.

mod body;
mod condensed;
mod contact;
mod ffi;
mod handles;
mod part;
mod pieces;
mod saved;
mod scatter;
mod stiffness;
mod system;
mod world;

pub use body::{BodyError, DistributedBody};
pub use condensed::CondensedBody;
pub use contact::DistributedContact;
pub use part::{Part, PartError};
pub use pieces::PartField;
pub use saved::{SavedError, SavedLevel};
pub use system::SolverError;
pub use world::{Error, PetscError, World, run};
