//! The ledger of numbers that mean the same in several modules: value, unit, where it comes from, the test that fixes it. Numbers of one
//! module are in a file of this name in its folder.

/// Rounding of a sum, as a part of the moduli of its terms, as long as these are few; with many it is of random signs: eight units in the
/// last place (`judge::rows`).
pub(crate) const SUM: f64 = 8.0 * f64::EPSILON;

/// The same for a sum of some dozens of terms, the residual of a row as a rule: below this part of its terms it is rounding
/// (`contradictory_equations_are_never_solved` of tests/mcp).
pub(crate) const ROUNDING: f64 = 8.0 * SUM;

/// The same for a value that a few operations give, as a part of it.
pub(crate) const VALUE: f64 = 4.0 * f64::EPSILON;

/// The same for results: numbers whose terms are results of other sums, of factorisations or of corrections.
pub(crate) const RESULT: f64 = 1e-12;

/// Reciprocal condition of an equilibrated matrix, and part of its terms of a minor, below which rounding may decide whether it is singular:
/// smooth folds are located no better.
pub(crate) const DOUBTFUL: f64 = 1e-11;

/// Relative error of a result up to which it may be used: six digits are left to bad conditions. What is off by more is refused, refined or
/// computed again, and an eigenvalue or pivot that is smaller has no sign.
pub(crate) const CHECKED: f64 = 1e-10;

/// Relative difference up to which two results are one, whichever way they were computed.
pub(crate) const SAME: f64 = 1e-9;

/// The square root of rounding: half of the digits. Numbers whose squares decide are known no better.
pub(crate) const HALF_DIGITS: f64 = 1e-8;

/// Six digits: what inverse iteration, differences of derivatives and decimal files give, and to which
/// problems are solved that only lead to others. Directions of which less is left beside others are dependent
/// on them, and conditions below are examined.
pub(crate) const SIX_DIGITS: f64 = 1e-6;

/// What is left of a vector, a column or a difference of unit size once all else was taken off: below this it
/// is rounding of some hundreds of operations.
pub(crate) const LEFT: f64 = 1e-13;

/// Part of its terms from which on a residual shows no cancellation: the terms vanish together.
pub(crate) const UNCANCELLED: f64 = 1e-3;

/// How far one more Newton step may move a solution that a user gives, relative to its size: solvers stop at
/// 1e-8 or below.
pub(crate) const MOVED: f64 = 1e-5;

/// Relative accuracy of systems and problems within an outer iteration that corrects what they leave.
pub(crate) const LOOSE: f64 = 1e-4;

/// Share of a diagonal that is added where a block is singular by rounding: regular then, and hardly changed.
pub(crate) const SHIFT: f64 = 1e-9;

/// Least radius of a certificate, relative to the data.
pub(crate) const RADIUS: f64 = 1e12;

/// Rate of a test function along a unit direction, relative to its gradient, below which the direction runs along its zero set; the
/// same for α, along which curves are then vertical.
pub(crate) const TANGENTIAL: f64 = 1e-9;

/// Least coefficient of a contact node in its own row: its displacement follows from that row with no more than twice its rounding
/// (`two_bodies_have_one_solution_in_all_forms` of tests/contact).
pub(crate) const OWN_SHARE: f64 = 0.5;

/// Difference of two unit directions below which they may be one, and component of one below which it has no
/// sign: they are found at points known to half of the digits.
pub(crate) const DIRECTION: f64 = 1e-7;

/// Factor from the largest effect of a few random roundings to a bound of all.
pub(crate) const ALLOWANCE: f64 = 8.0;

/// Step of central differences in a variable of size one: the cube root of the rounding unit balances truncation and rounding.
pub(crate) const CENTRAL: f64 = 6.055e-6;

/// Part of the decrease that the slope promises by which a step has to lower its merit (L. Armijo 1966): any small number will do.
pub(crate) const ARMIJO: f64 = 1e-4;

/// Rows up to which all singular values and eigenvalues are computed: both are dense.
pub(crate) const DENSE: usize = 500;

/// Exact coefficients that a map is asked for, or states, at most: 16 MB of numbers before they grow.
pub(crate) const MAX_COEFFICIENTS: usize = 1 << 21;

/// Selections at one point up to which each of them is examined: eight sites with two pieces.
pub(crate) const SELECTIONS: u64 = 256;

/// Halvings of an interval after which its ends are neighbouring numbers, and other steps that bracket.
pub(crate) const HALVINGS: usize = 60;

/// Steps of an iteration that takes some dozens where it converges: a limit so that it ends.
pub(crate) const STEPS: usize = 100;

/// Steps after which it is left undecided whether the interiors of cones have a common point.
pub(crate) const INTERIOR_STEPS: usize = 20_000;

/// Rows, columns or nodes that files and meshes may have at most.
pub(crate) const MAX_DIMENSION: usize = 1 << 31;

/// Numbers that fill a gigabyte: tables and lists of searches are refused, or end, in multiples of it (`src/guide/limits.md`).
pub(crate) const GIGABYTE: usize = 1 << 27;

/// Columns, or right-hand sides, computed at a time where all of them together might not fit into memory.
pub(crate) const COLUMNS: usize = 64;

/// No index.
pub(crate) const NONE: usize = usize::MAX;
