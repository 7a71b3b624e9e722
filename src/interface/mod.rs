//! A constant linear operator coupled to a nonsmooth law on few traces, in full and condensed form.
//!
//! ```text
//! A u + Bᵀ λ = f(α),   G(B u, λ, α) = 0
//! ```
//!
//! A is n × n, B is q × n with q ≪ n, and only G switches: contact, diodes in a network, valves in a pipe system, a membrane over few
//! stops. [`Interface`] is the map, in one of two views: [`InterfaceProblem`] of x = (u, λ, α), and, where A is symmetric and positive
//! definite, [`CondensedInterface`] of x = (λ, α), with v = B A⁻¹ f(α) − C λ, C = B A⁻¹ Bᵀ. Both have the sites and pieces of G, the same
//! solutions, transitions and signs of determinants, so that all methods of the crate apply to either; displacements, residuals, tangents
//! and determinants of the full form can be recovered from the condensed one. Contact ([`contact`](crate::contact)) is the case where G
//! consists of one law at each node.
//!
//! A law is any [`PiecewiseSmooth`](crate::piecewise::PiecewiseSmooth) map of z = (v, λ, α), most briefly written with
//! [`Traced`](crate::piecewise::Traced) (feature `autodiff`). Pipes with check valves: u are the pressures at the junctions, A holds the
//! conductances of the pipes (a reservoir at pressure 0 makes it definite), v = B u are the pressure drops over the valves, and λ the flows
//! through them, which Bᵀ removes from one junction and adds to another.
//!
//! ```
//! # #[cfg(feature = "autodiff")] {
//! use semismooth::continuation::{Branch, ContinuationOptions, Direction};
//! use semismooth::interface::{InterfaceProblem, LoadPath};
//! use semismooth::newton::Newton;
//! use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
//! use semismooth::sparse::Matrix;
//!
//! /// Valves that open at a pressure drop c and then have the resistance R: 0 ≤ λ ⟂ R λ + c − v ≥ 0.
//! #[derive(Clone)]
//! struct Valves {
//!     cracking: [f64; 2],
//!     resistance: [f64; 2],
//! }
//!
//! impl NonsmoothFunction for Valves {
//!     fn num_vars(&self) -> usize { 5 } // v, λ and α
//!     fn num_residuals(&self) -> usize { 2 }
//!     fn eval<T: Real>(&self, z: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
//!         for i in 0..2 {
//!             let (drop, flow) = (z[i], z[2 + i]);
//!             out[i] = kinks.min(flow, flow * self.resistance[i] + self.cracking[i] - drop);
//!         }
//!     }
//! }
//!
//! // Pipes of conductance 1, 2 and 1 from junction 0 to 1, from 1 to 2 and from 2 to the reservoir; valves from 0 to 2 and from 2 to 1.
//! let pipes = Matrix::from_rows(&[[1.0, -1.0, 0.0], [-1.0, 3.0, -2.0], [0.0, -2.0, 3.0]])?;
//! let drops = Matrix::from_rows(&[[1.0, 0.0, -1.0], [0.0, -1.0, 1.0]])?;
//! let valves = Valves { cracking: [1.5, 0.25], resistance: [0.5, 0.0] };
//! // The flow α enters at junction 0, the flow 1 at junction 2.
//! let inflow = LoadPath::affine(vec![0.0, 0.0, 1.0], vec![1.0, 0.0, 0.0]);
//! let network = InterfaceProblem::from_parts(pipes, &drops, inflow, Traced::new(valves))?.condensed()?;
//! let mut x = [0.0, 0.0, -3.0];
//! Newton::default().solve(&network, &mut x)?;
//! assert!((x[1] - 2.5).abs() < 1e-12); // through the second valve: (3/2 − 1/4) / (1/2)
//! let options = ContinuationOptions::default().with_parameter_range((-3.0, 3.0));
//! let branch = Branch::follow(&network, &x, Direction::Increasing, options)?;
//! // The second valve closes where −α/2 = 1/4; the first one opens where 3α/2 = 3/2.
//! let switches: Vec<f64> = branch.transitions.iter().map(|t| t.parameter()).collect();
//! assert!(switches.len() == 2 && (switches[0] + 0.5).abs() < 1e-12 && (switches[1] - 1.0).abs() < 1e-12);
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod condensed;
mod evaluation;
mod exact;
mod extended;
mod full;
mod load;
mod map;
mod operator;
mod sizes;
mod view;

pub(crate) use extended::{Columns, Extended};
pub(crate) use load::SupportState;
pub use load::{LoadCase, LoadPath};
pub use map::{CondensedInterface, Interface, InterfaceProblem};
pub(crate) use operator::Operator;
pub(crate) use sizes::{fill_sizes, typical_sizes};
pub use view::{CondensedView, FullView, View};
