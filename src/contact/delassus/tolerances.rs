//! The ledger of the solver's numbers: value, unit, where it comes from, the test that fixes it. In scaled variables the mean diagonal of M and
//! ‖q‖∞ are 1.

/// Number of sweeps of the cheap first attempt, and number after which unchanged states may be tried, in the plane by one linear system, in
/// space by Newton's method: up to SMALL unknowns a factorisation costs no more than the remaining sweeps.
pub(super) const SWEEPS: usize = 30;
pub(super) const FEW_SWEEPS: [usize; 2] = [3, 4];
pub(super) const SMALL: usize = 64;

/// Sweeps that change no reaction by more than this share of the largest one have converged.
pub(super) const AT_REST: f64 = 2.0 * f64::EPSILON;

/// First weight of the proximal term, far from a solution and after interior points; its changes after success and failure.
pub(super) const ALPHA: f64 = 1e-2;
pub(super) const ALPHA_NEAR: f64 = 1e-5;

/// In a small problem the first weight: near the least one with which half of the digits remain where M is singular.
pub(super) const ALPHA_SMALL: f64 = 1e-8;
pub(super) const SHRINK: f64 = 0.3;
pub(super) const GROW: f64 = 4.0;
pub(super) const LEAST_ALPHA: f64 = 1e-10;
pub(super) const LARGEST_ALPHA: f64 = 1e6;

/// Tolerance of a proximal problem relative to the largest reaction, first and last.
pub(super) const PRECISION: f64 = 1e-14;
pub(super) const LEAST_PRECISION: f64 = 1e-24;

/// Newton iterations of one proximal step.
pub(super) const INNER: usize = 60;

/// Factorisations without a gain of a factor 3 after which proximal steps are given up: more than one step may take, so that no single step
/// ends the attempt before a larger α has been tried.
pub(super) const PATIENCE: usize = 300;
pub(super) const FIRST_PATIENCE: usize = INNER + INNER / 2;

/// Newton iterations of one proximal step before interior points are tried. The attempt ends with the first step that fails; where there is
/// no solution, all may converge while reactions grow without bound, and the limit on factorisations without gain ends it.
pub(super) const QUICK: usize = 6;
pub(super) const QUICK_PATIENCE: usize = 30;

/// Largest number of consecutive proximal steps without a factorisation: α is then minimal and the iterate does not change.
pub(super) const MAX_IDLE: usize = 60;

/// Weight of velocities in Newton's residual where 1 has failed: with 1, contacts of packings may alternate between open and closed from
/// one iteration to the next.
pub(super) const HEAVY: f64 = 100.0;

/// Sweeps per entry of the history.
pub(super) const REPORTED: usize = 100;

/// Sweeps before each further attempt at proximal steps.
pub(super) const MORE_SWEEPS: [usize; 4] = [300, 1000, 3000, 10_000];

/// Largest violation of the law against q and u that a solution may have; proximal steps converge from there, as a rule.
pub(super) const NEAR: f64 = 1e-6;

/// Largest number of interior-point steps in one attempt.
pub(super) const INTERIOR_STEPS: usize = 80;

/// Factorisations on the central path after which it is given up unless ν has come below half of its least value: in a heap whose path had 16
/// folds it took some 2000, and some 1200 without a new least value.
pub(super) const PATH_PATIENCE: usize = 1500;

/// The ν at which the central path is left.
pub(super) const LEAST_NU: f64 = 1e-16;

/// Reactions and slips below this share of the terms that cancel at the contact, in scaled variables, count as 0, and tractions below the
/// bound by more than this share of it stick.
pub(super) const ZERO: f64 = 1e-9;

/// Largest number of secant and bisection steps for the slip; the bracket halves in each, on a logarithmic scale.
pub(super) const SLIP_STEPS: usize = 80;

/// The line search is nonmonotone and compares with the largest of the last merits: across kinks a full step may increase the merit and
/// still lead to a faster decrease later.
pub(super) const MEMORY: usize = 4;
pub(super) const HALVINGS: usize = 12;

/// A proximal problem counts as solved where its residual is this small relative to the proximal step (R. T. Rockafellar 1976, criterion
/// B).
pub(super) const INEXACT: f64 = 0.1;

/// Below this length a step is taken to be shortened by De Saxcé's term; the next few steps omit its derivative. The iteration then is that
/// of a convex problem: slower, with longer steps.
pub(super) const SHORT: f64 = 0.1;
pub(super) const FREEZE: usize = 5;

/// Orders from here on are solved by Cholesky and GMRES where M is sparse: fill-in is a fraction of that of LU.
pub(super) const LARGE: usize = 1500;

/// Least distance of the first point from the boundaries of the cones, where ‖q‖ is 1.
pub(super) const INTERIOR_START: f64 = 1e-3;

/// Largest number of Newton iterations for the first point, and its tolerance.
pub(super) const FIRST: usize = 60;
pub(super) const FIRST_RESIDUAL: f64 = 1e-8;
pub(super) const FIRST_HALVINGS: usize = 20;

/// Largest number of corrections of a step, each at most half of the one before; the step is accepted once a correction is this share of
/// its length.
pub(super) const CORRECTIONS: usize = 6;
pub(super) const CORRECTED: f64 = 1e-3;

/// Lengths of steps in (x / max(1, ‖x‖), ln ν).
pub(super) const FIRST_STEP: f64 = 0.5;
pub(super) const LARGEST_STEP: f64 = 3.0;
pub(super) const LEAST_STEP: f64 = 1e-9;
pub(super) const LENGTHEN: f64 = 1.5;
pub(super) const SHORTEN: f64 = 0.7;
