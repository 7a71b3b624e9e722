use std::ops::{ControlFlow, Range};
use std::time::Duration;

use super::{Cone, ConeError, ConeProblem};
use crate::clock::Deadline;
use crate::complementarity::{AffineFunction, McpFunction};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::options::setters;
use crate::sparse::{Matrix, Pattern, dot, max_abs, norm};
use crate::spread::Random;

/// Share of the merit by which a step must lessen it, and the shortest step that is tried.
const DECREASE: f64 = 1e-4;
const SHORTEST: f64 = 1e-8;
/// The smoothing parameter follows the merit: μ ≤ NEARNESS ‖Φ‖, and falls at least by the factor FALL.
const NEARNESS: f64 = 0.1;
const FALL: f64 = 0.2;
/// Merit, relative to that of the start, from which on steps of the natural map are tried, and once more after each fall by TAIL.
const TAIL: f64 = 0.1;
/// Multiples of the identity added to ∇F where steps fail.
const PROXIMAL: [f64; 6] = [0.0, 1e-10, 1e-7, 1e-4, 1e-2, 1.0];
/// Proximal points: the first weight of x − x_k in units of F, its changes after success and failure, and how far each of the problems is
/// solved.
const WEIGHT: f64 = 0.1;
const LIGHTER: f64 = 0.3;
const HEAVIER: f64 = 5.0;
const LOOSE: f64 = 1e-4;
const OUTER: usize = 40;
/// Where the constants of all rows are a smaller part of their terms, errors are compared with the constants: far out everything is small
/// relative to its terms. Smaller ones may be rounding where F is curved.
const FAR: f64 = 1e-6;
const NO_CONSTANT: f64 = 8.0 * f64::EPSILON;
/// Parts of the largest component of a direction below which other ones are dropped in turn.
const SMALL: [f64; 4] = [0.0, 1e-6, 1e-4, 1e-2];
/// Least radius of a certificate, in units of the solution's terms.
const RADIUS: f64 = 1e6;

/// Options of [`ConeSolver`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConeOptions {
    /// Bound on [`ConeReport::error`]. Default 1e-10.
    pub tolerance: f64,
    /// Largest number of iterations of one run from a start. Default 300.
    pub max_iterations: usize,
    /// Further starts, should the first one fail. Default 8.
    pub restarts: usize,
    /// Largest wall-clock time. Default none.
    pub max_time: Option<Duration>,
}

impl Default for ConeOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 300,
            restarts: 8,
            max_time: None,
        }
    }
}

impl ConeOptions {
    setters! {
        /// Sets the bound on the error.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of iterations of one run.
        with_max_iterations(max_iterations: usize);
        /// Sets the number of further starts.
        with_restarts(restarts: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// A tolerance that is not between 2⁻⁵² and 1.
    pub fn validate(&self) -> Result<(), ConeError> {
        match (f64::EPSILON..1.0).contains(&self.tolerance) {
            true => Ok(()),
            false => Err(ConeError::Option {
                name: "tolerance",
                value: self.tolerance,
                range: "at least 2.3e-16 and less than 1",
            }),
        }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ConeStatus {
    /// x lies in K, and [`ConeReport::error`] is at most the tolerance.
    Solved,
    /// No x in K has F(x) in K*: [`ConeReport::ray`] proves it.
    NoSolution,
    /// No step made progress any more.
    Stalled,
    /// The limit on iterations.
    IterationLimit,
    /// The limit on time.
    TimeLimit,
    /// F or its Jacobian is not finite at the start.
    EvaluationFailure,
    /// The observer asked to stop.
    Interrupted,
}

impl std::fmt::Display for ConeStatus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Solved => "solved",
            Self::NoSolution => "no solution",
            Self::Stalled => "stalled",
            Self::IterationLimit => "iteration limit",
            Self::TimeLimit => "time limit",
            Self::EvaluationFailure => "evaluation failure",
            Self::Interrupted => "interrupted",
        })
    }
}

/// One iterate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ConeIteration {
    /// Which start, from 0.
    pub attempt: usize,
    /// ‖Φ_μ‖₂, the smoothed Fischer–Burmeister function of x and F in units of each cone; for steps of the natural map its norm.
    pub merit: f64,
    /// The smoothing parameter; 0 for steps of the natural map.
    pub mu: f64,
    /// Length of the step to it, 1 for a full one.
    pub damping: f64,
}

/// Proof that no x in K has F(x) = M x + q in K*: v ∈ K with −Mᵀv ∈ K* and qᵀv < 0.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ConeRay {
    /// v, in K; qᵀv = −1 but for rounding.
    pub direction: Vec<f64>,
    /// qᵀv.
    pub value: f64,
    /// −Mᵀv lies in K* but for rounding; for ‖x‖₂ below this radius v is a proof all the same.
    pub radius: f64,
}

/// How a solve went.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConeReport {
    /// How it ended.
    pub status: ConeStatus,
    /// ‖x − P(x − F(x))‖_∞ at the point returned.
    pub residual: f64,
    /// Largest ‖x_b/X − P(x_b/X − F_b/S_b)‖₂ over the cones b, where X is the largest |xᵢ| and S_b the norm of the terms
    /// Σⱼ |Jᵢⱼ xⱼ| + |Fᵢ − Σⱼ Jᵢⱼ xⱼ| of its rows: the same in all units of x and of F in a cone. Far out, where the constants of all rows
    /// are less than 1e-6 of their terms, it is divided by that part times 1e6. The point is solved where this is at most the tolerance.
    pub error: f64,
    /// Iterations, over all starts.
    pub iterations: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// The iterates.
    pub history: Vec<ConeIteration>,
    /// The proof that there is no solution.
    pub ray: Option<ConeRay>,
}

impl ConeReport {
    /// Whether the problem is solved.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status == ConeStatus::Solved
    }
}

/// Semismooth Newton method for cone problems.
///
/// A smoothing Newton method for the Fischer–Burmeister function of the cones (M. Fukushima, Z.-Q. Luo, P. Tseng, 2002; S. Hayashi,
/// N. Yamashita, M. Fukushima, 2005) brings the iterates near a solution: it converges globally for monotone F with regular systems. Then
/// steps of the natural map end at it, quadratically (L. Qi, J. Sun, 1993). Where this fails, proximal points (R. T. Rockafellar, 1976),
/// for monotone F whose solutions are not unique, and other starts follow; for affine F a certificate is sought.
#[derive(Debug, Clone, Default)]
pub struct ConeSolver {
    options: ConeOptions,
}

impl ConeSolver {
    /// A solver with the given options.
    #[must_use]
    pub fn new(options: ConeOptions) -> Self {
        Self { options }
    }

    /// Solves from the start `x`, which is overwritten by the solution or the best point.
    ///
    /// # Errors
    /// A start of the wrong length or not finite, options out of range, a Jacobian entry outside the pattern.
    pub fn solve<F: McpFunction>(
        &self,
        problem: &ConeProblem<F>,
        x: &mut [f64],
    ) -> Result<ConeReport, ConeError> {
        self.solve_observed(problem, x, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting every iterate to `observe`, which may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_observed<F: McpFunction>(
        &self,
        problem: &ConeProblem<F>,
        x: &mut [f64],
        mut observe: impl FnMut(&ConeIteration) -> ControlFlow<()>,
    ) -> Result<ConeReport, ConeError> {
        self.options.validate()?;
        problem.check("the start", x.len())?;
        if let Some(index) = x.iter().position(|v| !v.is_finite()) {
            let value = x[index];
            return Err(ConeError::NotFinite { index, value });
        }
        let problem = ConeProblem::new(problem.function() as &dyn McpFunction, problem.cones().to_vec())?;
        let mut run = Run::new(&problem, &self.options, &mut observe)?;
        let status = run.all_starts(x)?;
        let mut report = run.report;
        report.status = status;
        x.copy_from_slice(&run.best);
        report.error = run.least;
        let mut room = vec![0.0; x.len()];
        report.residual = problem.natural_residual(x, &mut room)?;
        let sought = matches!(report.status, ConeStatus::Stalled | ConeStatus::IterationLimit);
        if sought && problem.function().is_affine() {
            report.ray = self.ray(&problem, x)?;
            if report.ray.is_some() {
                report.status = ConeStatus::NoSolution;
            }
        }
        Ok(report)
    }

    /// The certificate of least norm, if there is one: minimise ½‖v‖² over v ∈ K, −Mᵀv ∈ K*, qᵀv = −1.
    fn ray(&self, problem: &ConeProblem<&dyn McpFunction>, x: &[f64]) -> Result<Option<ConeRay>, ConeError> {
        let n = x.len();
        let f = problem.function();
        let mut matrix = Matrix::zeros(f.pattern());
        f.jacobian(x, &mut matrix);
        let mut q = vec![0.0; n];
        f.value(&vec![0.0; n], &mut q);
        let size = max_abs(&q);
        if size == 0.0 {
            return Ok(None);
        }
        // Conditions in (v, y, τ): v + M y + q τ ∈ K*, −Mᵀv ∈ K* and y ∈ K, −qᵀv − 1 = 0; y = 0 where F = 0 is free.
        let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 1.0)).collect();
        let unit = matrix.values().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let unit = if unit > 0.0 { unit } else { 1.0 };
        for (i, j, v) in matrix.triplets() {
            entries.push((i, n + j, v / unit));
            entries.push((n + j, i, -v / unit));
        }
        for (i, q) in q.iter().enumerate() {
            entries.push((i, 2 * n, q / size));
            entries.push((2 * n, i, -q / size));
        }
        let mut right = vec![0.0; 2 * n + 1];
        right[2 * n] = -1.0;
        let conditions = AffineFunction::new(Matrix::from_triplets(2 * n + 1, 2 * n + 1, &entries)?, right);
        let Ok(conditions) = conditions else {
            return Ok(None);
        };
        let cones = problem.cones().iter().chain(problem.cones()).copied();
        let cones = cones.chain([Cone::Free(1)]).collect();
        let dual = ConeProblem::new(&conditions as &dyn McpFunction, cones)?;
        let mut z = vec![0.0; 2 * n + 1];
        let mut silent = |_: &ConeIteration| ControlFlow::Continue(());
        let options = self.options.clone().with_restarts(0);
        let mut run = Run::new(&dual, &options, &mut silent)?;
        run.all_starts(&z)?;
        z.copy_from_slice(&run.best);
        // Where the conditions hold in the limit only, small components may be what is left of the way there.
        let mut best: Option<ConeRay> = None;
        for candidate in [&z[..n], x] {
            for rounding in SMALL {
                let largest = max_abs(candidate);
                let rounded = candidate
                    .iter()
                    .map(|v| if v.abs() <= rounding * largest { 0.0 } else { *v });
                let found = certificate(problem, &matrix, &q, rounded.collect())?;
                if let Some(found) = found
                    && best.as_ref().is_none_or(|b| found.radius > b.radius)
                {
                    best = Some(found);
                }
            }
        }
        // The size of x at which the constant is a term like the others.
        let typical = size / unit;
        Ok(best.filter(|ray| ray.radius > RADIUS * typical))
    }
}

/// What v proves, scaled to qᵀv = −1.
fn certificate(
    problem: &ConeProblem<&dyn McpFunction>,
    matrix: &Matrix,
    q: &[f64],
    mut v: Vec<f64>,
) -> Result<Option<ConeRay>, ConeError> {
    problem.project(&mut v)?;
    let value = dot(q, &v);
    if value >= 0.0 || value.is_nan() {
        return Ok(None);
    }
    v.iter_mut().for_each(|v| *v /= -value);
    // −Mᵀv less its part in K*.
    let mut rest = vec![0.0; v.len()];
    matrix.as_ref().mul_transpose_add(-1.0, &v, &mut rest);
    for (cone, range) in problem.blocks() {
        let block = &mut rest[range];
        let mut inside = block.to_vec();
        cone.project_dual(&mut inside);
        block.iter_mut().zip(&inside).for_each(|(r, p)| *r -= p);
    }
    let (value, left) = (dot(q, &v), norm(&rest));
    Ok(Some(ConeRay {
        direction: v,
        value,
        radius: if left == 0.0 { f64::INFINITY } else { -value / left },
    }))
}

/// A second-order cone, or one half-line or free variable.
struct Part {
    cone: Cone,
    range: Range<usize>,
    /// Unit of F, a power of two.
    unit: f64,
    /// Where its derivatives begin.
    at: usize,
}

/// One solve.
struct Run<'a> {
    problem: &'a ConeProblem<&'a dyn McpFunction>,
    options: &'a ConeOptions,
    observe: &'a mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    deadline: Deadline,
    solver: AutoSolver,
    /// ∇F, and the Jacobian of the equations.
    jac: Matrix,
    system: Matrix,
    parts: Vec<Part>,
    /// The part of each row.
    owner: Vec<usize>,
    x: Vec<f64>,
    f: Vec<f64>,
    phi: Vec<f64>,
    trial: Vec<f64>,
    step: Vec<f64>,
    best: Vec<f64>,
    least: f64,
    /// F in units of each cone.
    y: Vec<f64>,
    /// Derivatives of the equations by x in one cone, and by y in all of them.
    by_x: Vec<f64>,
    by_y: Vec<f64>,
    attempt: usize,
    /// Centre and weight of a proximal problem; 0 for the problem itself.
    centre: Vec<f64>,
    weight: f64,
    /// F(0) of an affine F.
    constant: Option<Vec<f64>>,
    report: ConeReport,
}

/// What the equations are: smoothed Fischer–Burmeister functions, or the natural map.
#[derive(Clone, Copy, PartialEq)]
enum Map {
    Smoothed(f64),
    Natural,
}

impl<'a> Run<'a> {
    fn new(
        problem: &'a ConeProblem<&'a dyn McpFunction>,
        options: &'a ConeOptions,
        observe: &'a mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    ) -> Result<Self, ConeError> {
        let n = problem.len();
        let jac = Matrix::zeros(problem.function().pattern());
        let (mut parts, mut at, mut widest) = (Vec::new(), 0, 0);
        for (cone, range) in problem.blocks() {
            let (cone, width) = match cone {
                Cone::SecondOrder(n) => (cone, n),
                Cone::Nonnegative(_) => (Cone::Nonnegative(1), 1),
                Cone::Free(_) => (Cone::Free(1), 1),
            };
            for first in range.step_by(width) {
                parts.push(Part {
                    cone,
                    range: first..first + width,
                    unit: 1.0,
                    at,
                });
                at += width * width;
            }
            widest = widest.max(width * width);
        }
        // Rows of a cone are mixed.
        let transposed = jac.transpose();
        let pattern = transposed.pattern();
        let mut entries = Vec::new();
        let mut owner = vec![0; n];
        for (k, part) in parts.iter().enumerate() {
            owner[part.range.clone()].fill(k);
            for i in part.range.clone() {
                for r in part.range.clone() {
                    let columns = &pattern.row_idx()[pattern.col_ptr()[r]..pattern.col_ptr()[r + 1]];
                    entries.extend(columns.iter().map(|&j| (i, j)));
                    entries.push((i, r));
                }
            }
        }
        let system = Matrix::zeros(Pattern::from_entries(n, n, entries)?);
        let mut solver = AutoSolver::new();
        solver.analyze(system.pattern().as_ref())?;
        let constant = problem.function().is_affine().then(|| {
            let mut q = vec![0.0; n];
            problem.function().value(&vec![0.0; n], &mut q);
            q
        });
        Ok(Self {
            centre: vec![0.0; n],
            weight: 0.0,
            constant,
            deadline: Deadline::after(options.max_time),
            problem,
            options,
            observe,
            solver,
            jac,
            system,
            parts,
            owner,
            x: vec![0.0; n],
            f: vec![0.0; n],
            phi: vec![0.0; n],
            trial: vec![0.0; n],
            step: vec![0.0; n],
            best: vec![0.0; n],
            least: f64::INFINITY,
            y: vec![0.0; n],
            by_x: vec![0.0; widest],
            by_y: vec![0.0; at],
            attempt: 0,
            report: ConeReport {
                status: ConeStatus::Stalled,
                residual: f64::NAN,
                error: f64::NAN,
                iterations: 0,
                factorisations: 0,
                history: Vec::new(),
                ray: None,
            },
        })
    }

    fn all_starts(&mut self, start: &[f64]) -> Result<ConeStatus, ConeError> {
        self.best.copy_from_slice(start);
        self.problem.project(&mut self.best)?;
        let mut random = Random::new(1);
        let size = 1.0 + max_abs(start);
        let mut status = ConeStatus::Stalled;
        for attempt in 0..=self.options.restarts {
            self.attempt = attempt;
            self.x.copy_from_slice(start);
            if attempt > 0 {
                // Far and near ones in turn.
                let width = size * 10_f64.powi(attempt as i32 % 4 - 1);
                self.x.iter_mut().for_each(|x| *x += width * random.symmetric());
            }
            let mut outcome = self.descend()?;
            if attempt == 0 && matches!(outcome, ConeStatus::Stalled | ConeStatus::IterationLimit) {
                outcome = self.proximal_points(start)?;
            }
            match outcome {
                ConeStatus::Stalled | ConeStatus::IterationLimit => status = outcome,
                ConeStatus::EvaluationFailure if attempt > 0 => {}
                _ => return Ok(outcome),
            }
        }
        Ok(status)
    }

    /// F and ∇F at x; `false` where they are not finite.
    fn evaluate(&mut self) -> Result<bool, ConeError> {
        self.problem.function().value(&self.x, &mut self.f);
        self.jac.clear();
        self.problem.function().jacobian(&self.x, &mut self.jac);
        if let Some((row, col)) = self.jac.stray() {
            return Err(ConeError::OutsidePattern { row, col });
        }
        self.add_proximal(false);
        Ok(self.f.iter().chain(self.jac.values()).all(|v| v.is_finite()))
    }

    /// Adds the proximal term at the trial point or at x to F.
    fn add_proximal(&mut self, at_trial: bool) {
        if self.weight == 0.0 {
            return;
        }
        let x = if at_trial { &self.trial } else { &self.x };
        for part in &self.parts {
            for i in part.range.clone() {
                self.f[i] += self.weight / part.unit * (x[i] - self.centre[i]);
            }
        }
    }

    /// Solutions of F(x) + w (x − x_k) one after the other, w → 0.
    fn proximal_points(&mut self, start: &[f64]) -> Result<ConeStatus, ConeError> {
        self.x.copy_from_slice(start);
        let mut weight = WEIGHT;
        let mut status = ConeStatus::Stalled;
        for _ in 0..OUTER {
            self.centre.copy_from_slice(&self.x);
            self.weight = weight;
            let outcome = self.descend();
            self.weight = 0.0;
            status = outcome?;
            if !matches!(
                status,
                ConeStatus::Solved | ConeStatus::Stalled | ConeStatus::IterationLimit
            ) {
                return Ok(status);
            }
            if status == ConeStatus::Solved {
                weight *= LIGHTER;
                if !self.evaluate()? {
                    return Ok(ConeStatus::Stalled);
                }
                match self.tail()? {
                    Some(ControlFlow::Continue(())) => return Ok(ConeStatus::Solved),
                    Some(ControlFlow::Break(())) => return Ok(ConeStatus::Interrupted),
                    None => {}
                }
            } else {
                weight *= HEAVIER;
                self.x.copy_from_slice(&self.centre);
            }
            status = ConeStatus::Stalled;
        }
        Ok(status)
    }

    fn choose_units(&mut self) {
        let mut largest = vec![0.0_f64; self.x.len()];
        for (i, _, v) in self.jac.triplets() {
            largest[i] = largest[i].max(v.abs());
        }
        for part in &mut self.parts {
            let size = max_abs(&largest[part.range.clone()]);
            let size = if size > 0.0 {
                size
            } else {
                max_abs(&self.f[part.range.clone()])
            };
            part.unit = match size.is_normal() {
                true => size.log2().round().exp2().recip(),
                false => 1.0,
            };
        }
    }

    /// The equations at x or at the trial point, with its F, in `phi`; their norm.
    fn map(&mut self, map: Map, at_trial: bool) -> f64 {
        let x = if at_trial { &self.trial } else { &self.x };
        for part in &self.parts {
            let range = part.range.clone();
            let y = &mut self.y[range.clone()];
            y.iter_mut()
                .zip(&self.f[range.clone()])
                .for_each(|(y, f)| *y = part.unit * f);
            let (x, out) = (&x[range.clone()], &mut self.phi[range]);
            match map {
                Map::Smoothed(mu) => part.cone.smoothed(mu, x, y, out),
                Map::Natural => {
                    out.iter_mut()
                        .zip(x.iter().zip(&*y))
                        .for_each(|(o, (x, y))| *o = x - y);
                    part.cone.project(out);
                    out.iter_mut().zip(x).for_each(|(o, x)| *o = x - *o);
                }
            }
        }
        norm(&self.phi)
    }

    /// The Newton step of the equations at x, with `proximal` times the identity (in units of F) added to ∇F; `false` where the system
    /// is singular.
    fn newton_step(&mut self, map: Map, proximal: f64) -> Result<bool, ConeError> {
        self.map(map, false);
        self.system.clear();
        for part in &self.parts {
            let range = part.range.clone();
            let (n, first) = (range.len(), range.start);
            let (x, y) = (&self.x[range.clone()], &self.y[range.clone()]);
            let (by_x, by_y) = (&mut self.by_x[..n * n], &mut self.by_y[part.at..part.at + n * n]);
            match map {
                Map::Smoothed(mu) => part.cone.smoothed_derivatives(mu, x, y, by_x, by_y),
                Map::Natural => {
                    // x − P(x − y): I − D by x, D by y.
                    let z = &mut self.trial[range];
                    z.iter_mut()
                        .zip(x.iter().zip(y))
                        .for_each(|(z, (x, y))| *z = x - y);
                    part.cone.projection_derivative(z, by_y);
                    for k in 0..n * n {
                        by_x[k] = f64::from(u8::from(k % (n + 1) == 0)) - by_y[k];
                    }
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let value = by_x[i * n + j] + proximal * by_y[i * n + j];
                    if value != 0.0 {
                        self.system.add(first + i, first + j, value);
                    }
                }
            }
        }
        for j in 0..self.x.len() {
            let pattern = self.jac.pattern();
            for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let (r, v) = (pattern.row_idx()[k], self.jac.values()[k]);
                let part = &self.parts[self.owner[r]];
                let (n, first) = (part.range.len(), part.range.start);
                for i in 0..n {
                    let factor = self.by_y[part.at + i * n + (r - first)] * part.unit * v;
                    if factor != 0.0 {
                        self.system.add(first + i, j, factor);
                    }
                }
            }
        }
        self.report.factorisations += 1;
        let known = |e: &LinearError| {
            matches!(
                e,
                LinearError::Singular { .. } | LinearError::Inaccurate { .. } | LinearError::NotFinite { .. }
            )
        };
        match self.solver.factor(self.system.as_ref()) {
            Err(e) if known(&e) => return Ok(false),
            result => result?,
        }
        self.step.iter_mut().zip(&self.phi).for_each(|(s, p)| *s = -p);
        match self.solver.solve_in_place(&mut self.step) {
            Err(e) if known(&e) => return Ok(false),
            result => result?,
        }
        Ok(self.step.iter().all(|v| v.is_finite()))
    }

    fn record(&mut self, merit: f64, map: Map, damping: f64) -> ControlFlow<()> {
        let iteration = ConeIteration {
            attempt: self.attempt,
            merit,
            mu: match map {
                Map::Smoothed(mu) => mu,
                Map::Natural => 0.0,
            },
            damping,
        };
        self.report.history.push(iteration);
        self.report.iterations += 1;
        (self.observe)(&iteration)
    }

    /// One run from x.
    fn descend(&mut self) -> Result<ConeStatus, ConeError> {
        if !self.evaluate()? {
            return Ok(ConeStatus::EvaluationFailure);
        }
        self.choose_units();
        let first = self.map(Map::Natural, false);
        let mut mu = NEARNESS * first.max(f64::MIN_POSITIVE);
        let mut merit = self.map(Map::Smoothed(mu), false);
        let mut next_tail = f64::INFINITY;
        for k in 0..=self.options.max_iterations {
            if self.record(merit, Map::Smoothed(mu), 1.0).is_break() {
                return Ok(ConeStatus::Interrupted);
            }
            if self.deadline.is_over() {
                return Ok(ConeStatus::TimeLimit);
            }
            if self.weight > 0.0 && merit.max(mu) <= LOOSE * first {
                return Ok(ConeStatus::Solved);
            }
            if self.weight == 0.0 && merit <= next_tail {
                next_tail = TAIL * merit;
                match self.tail()? {
                    Some(ControlFlow::Continue(())) => return Ok(ConeStatus::Solved),
                    Some(ControlFlow::Break(())) => return Ok(ConeStatus::Interrupted),
                    None => {}
                }
            }
            if k == self.options.max_iterations {
                return Ok(ConeStatus::IterationLimit);
            }
            if merit == 0.0 || !self.search(&mut merit, mu)? {
                return Ok(ConeStatus::Stalled);
            }
            // A smaller μ as soon as its equations are nearly met.
            if merit <= mu {
                mu = (FALL * mu).min(NEARNESS * merit).max(f64::MIN_POSITIVE);
                merit = self.map(Map::Smoothed(mu), false);
            }
        }
        Ok(ConeStatus::IterationLimit)
    }

    /// A step that lessens ‖Φ_μ‖, by line search along Newton directions, regularised more and more.
    fn search(&mut self, merit: &mut f64, mu: f64) -> Result<bool, ConeError> {
        let map = Map::Smoothed(mu);
        for proximal in PROXIMAL {
            if !self.newton_step(map, proximal + self.weight)? {
                continue;
            }
            let kept = self.f.clone();
            let mut damping = 1.0;
            while damping >= SHORTEST {
                for (t, (x, d)) in self.trial.iter_mut().zip(self.x.iter().zip(&self.step)) {
                    *t = x + damping * d;
                }
                self.problem.function().value(&self.trial, &mut self.f);
                self.add_proximal(true);
                let value = self.map(map, true);
                if value <= (1.0 - DECREASE * damping) * *merit {
                    self.x.copy_from_slice(&self.trial);
                    if self.evaluate()? {
                        *merit = value;
                        return Ok(true);
                    }
                }
                damping *= 0.5;
            }
            self.f.copy_from_slice(&kept);
        }
        Ok(false)
    }

    /// Full steps of the natural map from x, as long as they converge; `None` where they do not, x as it was.
    fn tail(&mut self) -> Result<Option<ControlFlow<()>>, ConeError> {
        let start = self.x.clone();
        let mut last = f64::INFINITY;
        let mut worse = 0;
        for _ in 0..30 {
            let merit = self.map(Map::Natural, false);
            let flow = self.record(merit, Map::Natural, 1.0);
            if self.judge()? && (merit >= 0.5 * last || merit == 0.0) {
                return Ok(Some(ControlFlow::Continue(())));
            }
            if flow.is_break() {
                return Ok(Some(flow));
            }
            worse = if merit < last { 0 } else { worse + 1 };
            last = merit;
            if worse > 2 {
                break;
            }
            // Singular where solutions are not unique.
            let mut stepped = false;
            for proximal in &PROXIMAL[..3] {
                stepped = stepped || self.newton_step(Map::Natural, *proximal)?;
            }
            if !stepped {
                break;
            }
            for (x, d) in self.x.iter_mut().zip(&self.step) {
                *x += d;
            }
            if !self.evaluate()? {
                break;
            }
        }
        if self.least <= self.options.tolerance {
            return Ok(Some(ControlFlow::Continue(())));
        }
        self.x.copy_from_slice(&start);
        self.evaluate()?;
        Ok(None)
    }

    /// Keeps the projection of x on K if it is the best point so far; tells whether it is a solution.
    fn judge(&mut self) -> Result<bool, ConeError> {
        let (x, f) = (self.x.clone(), self.f.clone());
        self.problem.project(&mut self.x)?;
        let finite = self.x == x || self.evaluate()?;
        let error = if finite { self.error() } else { f64::INFINITY };
        if error < self.least {
            self.least = error;
            self.best.copy_from_slice(&self.x);
        }
        if self.x != x {
            self.x.copy_from_slice(&x);
            self.evaluate()?;
        }
        self.f.copy_from_slice(&f);
        Ok(error <= self.options.tolerance)
    }

    /// [`ConeReport::error`] at x, F and ∇F at hand.
    fn error(&self) -> f64 {
        let n = self.x.len();
        let (mut terms, mut sum) = (vec![0.0; n], vec![0.0; n]);
        for (i, j, v) in self.jac.triplets() {
            terms[i] += (v * self.x[j]).abs();
            sum[i] += v * self.x[j];
        }
        for i in 0..n {
            terms[i] += (self.f[i] - sum[i]).abs();
        }
        let mut constants = 0.0_f64;
        for part in &self.parts {
            let rest: Vec<f64> = match &self.constant {
                Some(q) => q[part.range.clone()].to_vec(),
                None => part.range.clone().map(|i| self.f[i] - sum[i]).collect(),
            };
            let size = norm(&terms[part.range.clone()]);
            if size > 0.0 {
                constants = constants.max(norm(&rest) / size);
            }
        }
        let least = if self.constant.is_some() {
            f64::MIN_POSITIVE
        } else {
            NO_CONSTANT
        };
        let far = match (least..FAR).contains(&constants) {
            true => constants / FAR,
            false => 1.0,
        };
        let largest = max_abs(&self.x);
        let largest = if largest > 0.0 { largest } else { 1.0 };
        let mut worst = 0.0_f64;
        for part in &self.parts {
            let range = part.range.clone();
            let size = norm(&terms[range.clone()]);
            let size = if size > 0.0 { size } else { 1.0 };
            let mut z: Vec<f64> = range
                .clone()
                .map(|i| self.x[i] / largest - self.f[i] / size)
                .collect();
            part.cone.project(&mut z);
            let apart: Vec<f64> = range.zip(&z).map(|(i, z)| self.x[i] / largest - z).collect();
            let error = norm(&apart);
            if error > worst || error.is_nan() {
                worst = error;
            }
        }
        // What the rounding of the terms may hide.
        let hidden = if far < 1.0 { f64::EPSILON / far } else { 0.0 };
        (worst / far).max(hidden)
    }
}
