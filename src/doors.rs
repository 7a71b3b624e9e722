//! One function for each job, for equations written as closures and problems given by matrices. The modules behind them have what is
//! special: options, observers, solvers that are reused, maps of your own.

use std::fmt;

use crate::complementarity::{
    AffineFunction, Autodiff, ComplementarityError, Lcp, Mcp, McpReport, McpSolver, check_bounds,
};
use crate::cones::{Cone, ConeProblem, ConeReport, ConeSolver};
use crate::continuation::{
    Branch, ContinuationError, ContinuationOptions, Diagram, DiagramOptions, Direction,
};
use crate::enumeration::{EnumerationError, EnumerationOptions, SolutionSet};
use crate::optimise::{Bundle, BundleReport, Implicit, OptimiseError};
use crate::piecewise::{Expression, Formula, PiecewiseSmooth, Traced};
use crate::sensitivity::{Sensitivity, SensitivityError};
use crate::sparse::Matrix;
use crate::variational::{Polyhedron, Vi, ViReport, ViSolver};

/// A point with the report of the solver that found it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Solution<R> {
    /// The solution; in an error, the best point that was found.
    pub x: Vec<f64>,
    /// How it was found: status, residual at x, iterations, multipliers or certificates where there are any.
    pub report: R,
}

impl<R> Solution<R> {
    /// The solution as a function of parameters θ (length k): derivatives where there are any, one-sided ones at kinks. The map is that of
    /// the problem in the unknowns x and behind them the parameters, see [`parametric`], [`parametric_mcp`] and
    /// [`sensitivity`](crate::sensitivity).
    ///
    /// ```
    /// use semismooth::{parametric_mcp, solve_mcp};
    /// // 0 ≤ x ⟂ eˣ − p ≥ 0 at p = 2: x = ln p.
    /// let free = [f64::INFINITY];
    /// let found = solve_mcp(|x| vec![x[0].exp() - 2.0], &[0.0], &free, &[1.0])?;
    /// let map = parametric_mcp(1, |x, p| vec![x[0].exp() - p[0]], &[0.0], &free)?;
    /// let mut sensitivity = found.sensitivity(map, &[2.0])?;
    /// assert!((sensitivity.derivative()?.get(0, 0) - 0.5).abs() < 1e-14);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Sensitivity::new`].
    pub fn sensitivity<P: PiecewiseSmooth>(
        &self,
        map: P,
        parameters: &[f64],
    ) -> Result<Sensitivity<P>, SensitivityError> {
        Sensitivity::new(map, &self.x, parameters)
    }
}

/// The map of n equations H(x, p) = 0 in n unknowns and k parameters, for [`Solution::sensitivity`].
pub fn parametric<F>(num_unknowns: usize, num_parameters: usize, equations: F) -> Traced<Formula>
where
    F: for<'a> FnOnce(&[Expression<'a>], &[Expression<'a>]) -> Vec<Expression<'a>>,
{
    Traced::new(Formula::new(num_unknowns + num_parameters, |all| {
        let (x, p) = all.split_at(num_unknowns);
        equations(x, p)
    }))
}

/// The map x − mid(l, u, x − F(x, p)) of n = `lower.len()` unknowns and k parameters, whose zeros are the solutions of the mixed complementarity
/// problem of F and these bounds, for [`Solution::sensitivity`]. F may have kinks of its own.
///
/// # Errors
/// Another number of values than bounds, bounds that cross.
pub fn parametric_mcp<F>(
    num_parameters: usize,
    function: F,
    lower: &[f64],
    upper: &[f64],
) -> Result<Traced<Formula>, ComplementarityError>
where
    F: for<'a> FnOnce(&[Expression<'a>], &[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let n = lower.len();
    check_bounds(lower, upper, n)?;
    let map = parametric(n, num_parameters, |x, p| {
        let values = function(x, p).into_iter().enumerate();
        let row = |(i, f)| natural_row(x.get(i).copied(), f, lower.get(i), upper.get(i));
        values.map(row).collect()
    });
    match map.num_residuals() == n {
        true => Ok(map),
        false => Err(ComplementarityError::Dimensions {
            vars: n,
            values: map.num_residuals(),
            expected: "an MCP has as many values as unknowns, besides its parameters",
        }),
    }
}

/// x − mid(l, u, x − f): f itself without bounds.
fn natural_row<'a>(
    x: Option<Expression<'a>>,
    f: Expression<'a>,
    lower: Option<&f64>,
    upper: Option<&f64>,
) -> Expression<'a> {
    let finite = |bound: Option<&f64>| bound.copied().filter(|b| b.is_finite());
    let Some(x) = x else {
        return f;
    };
    match (finite(lower), finite(upper)) {
        (None, None) => f,
        (Some(l), Some(u)) if l == u => x - l,
        (Some(l), Some(u)) => x - (x - f).project(l, u),
        (Some(l), None) => x - (x - f).max(l),
        (None, Some(u)) => x - (x - f).min(u),
    }
}

/// Why a problem is not solved. Its `Debug` is as short as its text, so that a `main` which returns it prints a line.
#[derive(Clone, PartialEq)]
pub enum SolveError<E, R> {
    /// The problem was refused: what is wrong with it.
    Refused(E),
    /// No solution was found, or there is none: the best point and the report, which says which.
    NotSolved(Box<Solution<R>>),
}

impl<E: fmt::Display, R: fmt::Display> fmt::Display for SolveError<E, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => error.fmt(f),
            Self::NotSolved(best) => write!(f, "not solved: {}", best.report),
        }
    }
}

impl<E: fmt::Display, R: fmt::Display> fmt::Debug for SolveError<E, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl<E: std::error::Error + 'static, R: fmt::Display> std::error::Error for SolveError<E, R> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Refused(error) => error.source(),
            Self::NotSolved(_) => None,
        }
    }
}

impl<E, R> From<E> for SolveError<E, R> {
    fn from(error: E) -> Self {
        Self::Refused(error)
    }
}

fn solved<E, R>(x: Vec<f64>, report: R, is_solved: bool) -> Result<Solution<R>, SolveError<E, R>> {
    let solution = Solution { x, report };
    match is_solved {
        true => Ok(solution),
        false => Err(SolveError::NotSolved(Box::new(solution))),
    }
}

/// What [`solve`], [`solve_lcp`] and [`solve_mcp`] return.
pub type McpResult = Result<Solution<McpReport>, SolveError<ComplementarityError, McpReport>>;
/// What [`solve_vi`] and [`solve_qp`] return.
pub type ViResult = Result<Solution<ViReport>, SolveError<ComplementarityError, ViReport>>;

/// What [`implicit`] returns.
pub type ImplicitFormula = Implicit<Autodiff<Formula>, Traced<Formula>, Autodiff<Formula>>;

/// Solves n equations with kinks in n unknowns, H(x) = 0, from a start x₀.
///
/// ```
/// // |x| + x/2 = 3 and y = max(x, 1): (2, 2) or (−6, 1).
/// let found = semismooth::solve(|x| vec![x[0].abs() + 0.5 * x[0] - 3.0, x[1] - x[0].max(1.0)], &[0.3, 0.0])?;
/// assert!(found.x == [2.0, 2.0] || found.x == [-6.0, 1.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Another number of equations than unknowns, a start that is not finite; that no solution was found, with the best point.
pub fn solve<F>(equations: F, x0: &[f64]) -> McpResult
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let free = |bound: f64| vec![bound; x0.len()];
    solve_mcp(equations, &free(f64::NEG_INFINITY), &free(f64::INFINITY), x0)
}

/// Solves a mixed complementarity problem: l ≤ x ≤ u, with Fᵢ(x) ≥ 0 where xᵢ = lᵢ, Fᵢ(x) ≤ 0 where xᵢ = uᵢ, and Fᵢ(x) = 0 between.
/// Infinite bounds are absent ones.
///
/// ```
/// // 0 ≤ x ⟂ eˣ − 2 ≥ 0.
/// let found = semismooth::solve_mcp(|x| vec![x[0].exp() - 2.0], &[0.0], &[f64::INFINITY], &[1.0])?;
/// assert!((found.x[0] - 2.0_f64.ln()).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Wrong lengths, bounds that cross, a start that is not finite; that no solution was found, with the best point.
pub fn solve_mcp<F>(function: F, lower: &[f64], upper: &[f64], x0: &[f64]) -> McpResult
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let formula = Formula::new(x0.len(), function);
    let (lower, upper) = (lower.to_vec(), upper.to_vec());
    match Traced::new(formula.clone()).affine() {
        Some((m, q)) => mcp(Lcp::boxed(m, q, lower, upper)?.mcp(), x0),
        None => mcp(&Mcp::new(Autodiff::new(formula), lower, upper)?, x0),
    }
}

/// Solves the linear complementarity problem 0 ≤ z ⟂ M z + q ≥ 0.
///
/// ```
/// use semismooth::sparse::Matrix;
/// let m = Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?;
/// assert_eq!(semismooth::solve_lcp(m, &[-5.0, -1.0])?.x, [2.5, 0.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Wrong shapes, entries that are not finite; that no solution was found, with the best point.
pub fn solve_lcp(m: Matrix, q: &[f64]) -> McpResult {
    let problem = Lcp::new(m, q.to_vec())?;
    mcp(problem.mcp(), &vec![0.0; q.len()])
}

fn mcp<F: crate::complementarity::McpFunction>(problem: &Mcp<F>, x0: &[f64]) -> McpResult {
    let mut x = x0.to_vec();
    let mut solver = McpSolver::default();
    let report = solver.solve(problem, &mut x)?.clone();
    let is_solved = report.is_solved();
    solved(x, report, is_solved)
}

/// Solves a variational inequality over a polyhedron C: x ∈ C with F(x)ᵀ(y − x) ≥ 0 for all y ∈ C.
///
/// # Errors
/// Wrong lengths, a start that is not finite; that no solution was found, or that there is none, with the certificate in the report.
pub fn solve_vi<F>(function: F, set: Polyhedron, x0: &[f64]) -> ViResult
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    vi(
        &Vi::new(Autodiff::new(Formula::new(x0.len(), function)), set)?,
        x0,
    )
}

/// Solves the quadratic program min ½ xᵀP x + qᵀx over a polyhedron, P symmetric: where it is positive semidefinite the point is a minimum,
/// else one that satisfies the first-order conditions. The multipliers are in the report.
///
/// ```
/// use semismooth::sparse::Matrix;
/// use semismooth::variational::Polyhedron;
/// // The point of x₁ + x₂ = 1, x ≥ 0 nearest to (1, 2).
/// let set = Polyhedron::boxed(vec![0.0; 2], vec![f64::INFINITY; 2])?
///     .with_equations(Matrix::from_rows(&[[1.0, 1.0]])?, vec![1.0])?;
/// let found = semismooth::solve_qp(Matrix::identity(2), &[-1.0, -2.0], set)?;
/// assert!(found.x[0].abs() < 1e-12 && (found.x[1] - 1.0).abs() < 1e-12);
/// assert!((found.report.multipliers.equations[0] - 1.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Wrong shapes, entries that are not finite; that no solution was found, or that there is none, with the certificate in the report.
pub fn solve_qp(p: Matrix, q: &[f64], set: Polyhedron) -> ViResult {
    let gradient = AffineFunction::new(p, q.to_vec())?;
    vi(&Vi::new(gradient, set)?, &vec![0.0; q.len()])
}

fn vi<F: crate::complementarity::McpFunction>(problem: &Vi<F>, x0: &[f64]) -> ViResult {
    let mut x = x0.to_vec();
    let report = ViSolver::default().solve(problem, &mut x)?;
    let is_solved = report.is_solved();
    solved(x, report, is_solved)
}

/// Solves the complementarity problem x ∈ K, F(x) ∈ K*, xᵀF(x) = 0 over a product of cones.
///
/// ```
/// use semismooth::cones::Cone;
/// // The projection of (1, 3, 0) on the second-order cone.
/// let found = semismooth::solve_cone(|x| vec![x[0] - 1.0, x[1] - 3.0, 1.0 * x[2]], vec![Cone::SecondOrder(3)], &[0.0; 3])?;
/// assert!((found.x[0] - 2.0).abs() < 1e-9 && (found.x[1] - 2.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Wrong lengths, a start that is not finite; that no solution was found, or that there is none, with the certificate in the report.
pub fn solve_cone<F>(
    function: F,
    cones: Vec<Cone>,
    x0: &[f64],
) -> Result<Solution<ConeReport>, SolveError<ComplementarityError, ConeReport>>
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let problem = ConeProblem::new(Autodiff::new(Formula::new(x0.len(), function)), cones)?;
    let mut x = x0.to_vec();
    let report = ConeSolver::default().solve(&problem, &mut x)?;
    let is_solved = report.is_solved();
    solved(x, report, is_solved)
}

/// Minimises f(x(p), p) over the parameters p in a polyhedron, where x(p) solves the mixed complementarity problem of F(x, p) and the bounds l
/// ≤ x ≤ u, from the start (x₀, p₀). The solution's `x` are the parameters; x(p) is the `state` of its report. F and f may have kinks of
/// their own.
///
/// What is found is stationary in the sense of Clarke to the tolerance, near the start: see [`optimise`](crate::optimise), which also has
/// options and observers.
///
/// ```
/// use semismooth::variational::Polyhedron;
/// // A leader sells p, a follower q: 0 ≤ q ⟂ 2 q + p − 10 ≥ 0. The leader's profit p (10 − p − q) is largest where he keeps the follower in
/// // the market, p = 5, q = 5/2.
/// let found = semismooth::minimise(
///     |x, p| p[0] * (p[0] + x[0] - 10.0),
///     |x, p| vec![2.0 * x[0] + p[0] - 10.0],
///     [&[0.0], &[f64::INFINITY]],
///     &Polyhedron::boxed(vec![0.0], vec![20.0])?,
///     (&[1.0], &[1.0]),
/// )?;
/// assert!((found.x[0] - 5.0).abs() < 1e-6 && (found.report.state[0] - 2.5).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`Implicit::new`] and [`Bundle::minimise`]; that the run ended before a stationary point, with the best point.
pub fn minimise<O, F>(
    objective: O,
    function: F,
    [lower, upper]: [&[f64]; 2],
    set: &Polyhedron,
    (x0, p0): (&[f64], &[f64]),
) -> Result<Solution<BundleReport>, SolveError<OptimiseError, BundleReport>>
where
    O: for<'a> FnOnce(&[Expression<'a>], &[Expression<'a>]) -> Expression<'a>,
    F: for<'a> Fn(&[Expression<'a>], &[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let mut objective = implicit(objective, function, [lower, upper], x0, p0.len())?;
    let (x, report) = Bundle::default().minimise(set, p0, &mut objective)?;
    let is_solved = report.is_solved();
    solved(x, report, is_solved)
}

/// The function f(x(p), p) of [`minimise`], for a [`Bundle`] with options or an observer.
///
/// # Errors
/// As [`Implicit::new`].
pub fn implicit<O, F>(
    objective: O,
    function: F,
    [lower, upper]: [&[f64]; 2],
    x0: &[f64],
    num_parameters: usize,
) -> Result<ImplicitFormula, OptimiseError>
where
    O: for<'a> FnOnce(&[Expression<'a>], &[Expression<'a>]) -> Expression<'a>,
    F: for<'a> Fn(&[Expression<'a>], &[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let (n, m) = (lower.len(), lower.len() + num_parameters);
    let map = parametric_mcp(num_parameters, &function, lower, upper)?;
    let function = Autodiff::new(Formula::new(m, |all| {
        let (x, p) = all.split_at(n);
        function(x, p)
    }));
    let problem = Mcp::with_parameters(function, lower.to_vec(), upper.to_vec())?;
    let objective = Autodiff::new(Formula::new(m, |all| {
        let (x, p) = all.split_at(n);
        vec![objective(x, p)]
    }));
    Implicit::new(problem, map, objective, x0)
}

/// Follows the curve of solutions of n equations in n unknowns and a parameter, the last variable, from a point x₀ on it or near it.
///
/// ```
/// use semismooth::continuation::{ContinuationOptions, Direction};
/// let range = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
/// let curve = semismooth::follow(|x| vec![x[0].abs() - x[1]], &[-1.0, 1.0], Direction::Decreasing, range)?;
/// assert_eq!(curve.folds(), [0.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`Branch::follow`].
pub fn follow<F>(
    equations: F,
    x0: &[f64],
    direction: Direction,
    options: ContinuationOptions,
) -> Result<Branch, ContinuationError>
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    Branch::follow(
        &Traced::new(Formula::new(x0.len(), equations)),
        x0,
        direction,
        options,
    )
}

/// All branches of n equations in n unknowns and a parameter, the last variable, that are connected to given starts.
///
/// ```
/// use semismooth::continuation::{ContinuationOptions, DiagramOptions, VertexKind};
/// // y (|y| − α) = 0: y = 0, and y = ±α for α > 0.
/// let range = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let options = DiagramOptions::default().with_continuation(range);
/// let diagram = semismooth::diagram(|x| vec![x[0] * (x[0].abs() - x[1])], &[[0.0, -0.5]], &options)?;
/// assert!(diagram.vertices().iter().any(|v| v.kind == VertexKind::Branching || v.kind == VertexKind::BranchPoint));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`Diagram::explore`]; no start at all.
pub fn diagram<F, S>(
    equations: F,
    starts: &[S],
    options: &DiagramOptions,
) -> Result<Diagram, ContinuationError>
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
    S: AsRef<[f64]>,
{
    let num_vars = starts.first().map_or(0, |start| start.as_ref().len());
    Diagram::explore(&Traced::new(Formula::new(num_vars, equations)), starts, options)
}

/// All solutions of n piecewise-affine equations in n unknowns, with the proof that there are no others. For curved equations
/// [`search_solutions`](crate::continuation::search_solutions) looks for as many as it can find.
///
/// ```
/// let list = semismooth::all_solutions(1, |x| vec![x[0].abs() + 0.5 * x[0] - 3.0])?;
/// assert_eq!(list.solutions.len(), 2);
/// assert!(list.completeness.is_complete());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`enumeration::all_solutions`](crate::enumeration::all_solutions): equations that are not piecewise affine, among others.
pub fn all_solutions<F>(num_vars: usize, equations: F) -> Result<SolutionSet, EnumerationError>
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    let map = Traced::new(Formula::new(num_vars, equations));
    crate::enumeration::all_solutions(&map, 0.0, &EnumerationOptions::default())
}

#[cfg(test)]
mod tests {
    use super::{Formula, SolveError, Traced, all_solutions, solve};
    use crate::run::Status;

    /// Affine equations are taken as data: what contradicts itself is proven to, and solutions far out are found.
    #[test]
    fn affine_equations_are_judged_by_their_coefficients() {
        let Err(SolveError::NotSolved(best)) = solve(|x| vec![x[0] - x[0] + 1.0], &[0.0]) else {
            panic!("0 x + 1 = 0 is refused or solved");
        };
        assert_eq!(best.report.status, Status::NoSolution);
        let found = solve(
            |x| vec![x[0] + x[1] - 1.0, 2.0 * (x[0] + x[1]) - 3.0],
            &[0.0, 0.0],
        );
        assert!(
            matches!(found, Err(SolveError::NotSolved(best)) if best.report.status == Status::NoSolution)
        );
        let x = solve(|x| vec![1e-20 * x[0] - 1.0, x[0] - x[1] - 1.0], &[0.0, 0.0])
            .unwrap()
            .x;
        assert!(x.iter().all(|x| (x / 1e20 - 1.0).abs() < 1e-15), "{x:?}");
    }

    /// 0.1 x + 0.2 x − 0.3 x has the coefficient 2⁻⁵⁵ for the numbers as they are stored, not the 2⁻⁵⁴ of their rounded sum.
    #[test]
    fn coefficients_are_added_exactly() {
        let found = solve(|x| vec![0.1 * x[0] + 0.2 * x[0] - 0.3 * x[0] - 1.0], &[0.0]).unwrap();
        let list = all_solutions(1, |x| vec![0.1 * x[0] + 0.2 * x[0] - 0.3 * x[0] - 1.0]).unwrap();
        assert_eq!(found.x, [2.0_f64.powi(55)]);
        assert_eq!(list.solutions[0].x, found.x);
        // Here the sum is none that can be stored.
        let sum = Formula::new(1, |x| vec![0.1 * x[0] + 0.2 * x[0] - 1.0]);
        assert!(Traced::new(sum).affine().is_none());
    }
}
