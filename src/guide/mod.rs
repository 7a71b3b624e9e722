//! The guide: eleven pages, to be read in order or where you need them.
//!
//! To learn the subject, begin with the [book](../../../book/index.html): twelve lessons with figures, exercises and solutions. In the
//! repository both are in `book/lessons`, to be read there or built with `mdbook build book`; on docs.rs links to lessons are broken.
//!
//! 1. [What a piecewise-smooth map is](pieces)
//! 2. [Solve](solve)
//! 3. [Follow a curve and read its transitions](follow)
//! 4. [Complementarity](complementarity)
//! 5. [Friction from a mesh](friction)
//! 6. [Write your own map](your_own_map)
//! 7. [Options, reports, failures](options)
//! 8. [Large problems and your own linear solver](large)
//! 9. [Limits of time and memory, and of the results](limits)
//! 10. [Relation to other programs, references](other_programs)
//! 11. [Words: ours beside those of the literature](words)
//!
//! # Doors
//!
//! One function for each job, at the root of the crate. Equations are closures over recorded variables: numbers stand on either side, kinks are
//! the methods `max`, `min`, `abs`, `project`, `switch`. What is not solved is an error that carries the best point and its report.
//!
//! | job | door | in Python |
//! |---|---|---|
//! | a root of equations with kinks | [`solve`](crate::solve) | `ss.solve(H, x0)` |
//! | 0 ≤ z ⟂ M z + q ≥ 0 | [`solve_lcp`](crate::solve_lcp) | `ss.solve_lcp(M, q)` |
//! | a mixed complementarity problem | [`solve_mcp`](crate::solve_mcp) | `ss.solve_mcp(F, lower, upper, x0)` |
//! | a variational inequality, a quadratic program | [`solve_vi`](crate::solve_vi), [`solve_qp`](crate::solve_qp) | `ss.solve_vi` |
//! | complementarity over cones | [`solve_cone`](crate::solve_cone) | `ss.solve_cone` |
//! | a curve with its folds | [`follow`](crate::follow) | `ss.follow(H, x0, ...)` |
//! | all branches | [`diagram`](crate::diagram) | `ss.diagram(H, starts, ...)` |
//! | all solutions | [`all_solutions`](crate::all_solutions) | `ss.all_solutions(H)` |
//! | derivatives of a solution in parameters | [`Solution::sensitivity`](crate::Solution::sensitivity) | `ss.solve_mcp(..., params=p)`, `ss.sensitivity(F, x, p)` |
//! | derivatives of a contact solution in loads, gaps, friction, materials, positions | [`Contact::sensitivity`](crate::contact::Contact::sensitivity) | `solution.sensitivity(...)` |
//! | many problems at once | [`sweep`](crate::sweep::sweep) | a leading dimension of `M`, `q`, `params` |
//! | eigenvalues and Hopf points along a curve of equilibria | [`stability`](crate::stability) | |
//! | f(x(p), p) minimised over p | [`minimise`](crate::minimise) | `ss.minimise(f, F, ...)` |
//! | contact from a mesh | [`contact_problem`](crate::contact_problem) | `ss.ContactProblem(...)` |
//!
//! ```
//! use semismooth::continuation::{ContinuationOptions, Direction};
//! use semismooth::{sparse::Matrix, variational::Polyhedron};
//! // A root of |x| + x/2 = 3.
//! let root = semismooth::solve(|x| vec![x[0].abs() + 0.5 * x[0] - 3.0], &[0.3])?;
//! assert_eq!(root.x, [2.0]);
//! // 0 ≤ z ⟂ M z + q ≥ 0.
//! let lcp = semismooth::solve_lcp(Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?, &[-5.0, -1.0])?;
//! assert_eq!(lcp.x, [2.5, 0.0]);
//! // 0 ≤ x ⟂ x³ − 8 ≥ 0.
//! let mcp = semismooth::solve_mcp(|x| vec![x[0].powi(3) - 8.0], &[0.0], &[f64::INFINITY], &[1.0])?;
//! assert!((mcp.x[0] - 2.0).abs() < 1e-9);
//! // min ½|x|² − x₁ − 2 x₂ with x₁ + x₂ = 1 and x ≥ 0.
//! let set = Polyhedron::boxed(vec![0.0; 2], vec![f64::INFINITY; 2])?;
//! let set = set.with_equations(Matrix::from_rows(&[[1.0, 1.0]])?, vec![1.0])?;
//! let qp = semismooth::solve_qp(Matrix::identity(2), &[-1.0, -2.0], set)?;
//! assert!((qp.x[1] - 1.0).abs() < 1e-9);
//! // The folds of y − 1.25 max(y − 1, 0) + 10 max(y − 3, 0) = load.
//! let range = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
//! let curve = semismooth::follow(
//!     |x| vec![x[0] - 1.25 * (x[0] - 1.0).max(0.0) + 10.0 * (x[0] - 3.0).max(0.0) - x[1]],
//!     &[0.0, 0.0],
//!     Direction::Increasing,
//!     range,
//! )?;
//! assert_eq!(curve.folds().len(), 2);
//! // All solutions of |x| + x/2 = 3.
//! let list = semismooth::all_solutions(1, |x| vec![x[0].abs() + 0.5 * x[0] - 3.0])?;
//! assert!(list.completeness.is_complete() && list.solutions.len() == 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What there is
//!
//! | for | in the crate | see it run |
//! |---|---|---|
//! | a piecewise-smooth map of your own, checked | `piecewise` | `your_own_problem` |
//! | solving it | `newton` | `corrector_convergence` |
//! | semismooth maps given by Jacobian–vector products: inexact Newton–Krylov methods | `newton::NewtonKrylov`, `linear::Krylov` | `sparse_control`, `bingham` |
//! | properties of a solution: generalised derivatives, BD-, CD- and strong regularity, index | `piecewise`, `complementarity::strong_regularity` | `tests/piecewise/notions.rs` |
//! | following it through kinks, every transition classified | `continuation` | `transition_points`, `follow_load`, `families` |
//! | all branches as one graph, isolas included | `continuation::Diagram` | `diagram` |
//! | all solutions at a parameter, certified to be all | `enumeration` | `all_solutions`, `sample_branches` |
//! | transitions as curves in two parameters; folds likewise | `TransitionSet`; `FoldSet` | `transition_sets`; `tests/continuation/transition_sets.rs` |
//! | runs resumed bit for bit after being killed | `SavedRun`, `output::CsvWriter` | `long_run` |
//! | any nonsmooth law on few traces of a definite operator | `interface` | `tests/contact/interface.rs` |
//! | mixed complementarity problems from any start | `complementarity` | `solve_mcp`, `obstacle` |
//! | variational inequalities over polyhedra, with proofs that there is no solution | `variational` | `solve_vi`, `quasi_variational` |
//! | complementarity over second-order cones and semidefinite matrices | `cones` | `solve_cone`, `nearest_correlation` |
//! | linear elasticity on a mesh, contact rows | `fem` | `families`, `nonuniqueness` |
//! | bodies with von Mises plasticity under a history of loads | `fem::{PlasticBody, VonMises}` | `plasticity` |
//! | friction in plane and space: slip-dependent, orthotropic, history-dependent; moving supports | `contact::FullContact`, `CondensedContact` | `nonuniqueness`, `uniqueness` |
//! | friction problems u = M r + q (Delassus form), 2D and 3D | `contact::DelassusSolver` | `friction_problem` |
//!
//! # Features
//!
//! `autodiff` (exact Jacobians of formulas), `json` (problems from JSON files), `serde` (saved runs, options from files), `svg` (pictures) and
//! `pdf` (the same for papers) are on by default. `rayon` (sweeps and large bodies on all cores; results are bitwise the same on any number of
//! threads) and `convert-nalgebra`, `convert-faer`, `convert-nalgebra-sparse`, `convert-sprs` (matrices from and to those crates) are off by
//! default. Without any of them the solvers, CSV tables and fields for ParaView remain; the library then builds for
//! `wasm32-unknown-unknown`, too.

#[doc = include_str!("pieces.md")]
pub mod pieces {}

#[doc = include_str!("solve.md")]
pub mod solve {}

#[doc = include_str!("follow.md")]
pub mod follow {}

#[doc = include_str!("complementarity.md")]
pub mod complementarity {}

#[doc = include_str!("friction.md")]
pub mod friction {}

#[doc = include_str!("your_own_map.md")]
pub mod your_own_map {}

#[doc = include_str!("options.md")]
pub mod options {}

#[doc = include_str!("large.md")]
pub mod large {}

#[doc = include_str!("limits.md")]
pub mod limits {}

#[doc = include_str!("other_programs.md")]
pub mod other_programs {}

#[doc = include_str!("words.md")]
pub mod words {}
