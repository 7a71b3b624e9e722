//! Methods for complementarity problems, and the cost of one run of one method on one problem.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Instant;

use semismooth::complementarity::{
    AffineFunction, FischerBurmeister, Mcp, McpFunction, McpOptions, McpSolver, McpStrategy, NormalMap,
};
use semismooth::linear::IncompleteLu;
use semismooth::newton::{Damping, Newton, NewtonKrylov, NewtonKrylovOptions, NewtonOptions, Report};
use semismooth::piecewise::{Assembled, PiecewiseSmooth, Semismooth};
use semismooth::sparse::{Matrix, Pattern};

use crate::common::{Outcome, Random};
use crate::textbook::{Direction, minimise};

/// Natural residual of a solution of a complementarity problem, also over cones.
pub(crate) const SOLVED: f64 = 1e-6;
/// Relative tolerance of inexact methods, the same as of exact ones.
pub(crate) const TOLERANCE: f64 = 1e-13;
/// Merits that nonmonotone line searches look back on.
pub(crate) const MEMORY: usize = 8;

/// Cost and result of a run.
pub(crate) struct Run {
    pub(crate) solved: bool,
    /// ‖x − mid(l, u, x − F(x))‖∞ at the point within its bounds, or ‖H‖∞.
    pub(crate) residual: f64,
    /// The same at the start; 1 for residuals that are relative already.
    pub(crate) first: f64,
    /// Points at which F was evaluated; of equations, residuals.
    pub(crate) evaluations: usize,
    /// Points at which ∇F was evaluated, or derivatives of equations. One is enough where F is affine and the method uses this.
    pub(crate) jacobians: usize,
    /// Iterations of all attempts.
    pub(crate) iterations: usize,
    pub(crate) factorisations: usize,
    /// Iterations of the Krylov method, where one solves for the steps.
    pub(crate) linear_iterations: usize,
    pub(crate) seconds: f64,
    /// Observed order of the tail; of methods that know pieces or active sets, since the last change of one.
    pub(crate) order: Option<f64>,
}

/// A complementarity problem with a start.
pub(crate) struct Complementarity {
    pub(crate) name: String,
    /// The family that it belongs to.
    pub(crate) family: String,
    pub(crate) function: Rc<dyn McpFunction>,
    pub(crate) lower: Vec<f64>,
    pub(crate) upper: Vec<f64>,
    pub(crate) start: Vec<f64>,
}

/// The function of a problem.
pub(crate) struct FunctionOf<F>(pub(crate) Mcp<F>);

impl<F: McpFunction> McpFunction for FunctionOf<F> {
    fn num_vars(&self) -> usize {
        self.0.function().num_vars()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.0.function().value(x, out);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.0.function().jacobian(x, jac);
    }
    fn pattern(&self) -> Pattern {
        self.0.function().pattern()
    }
    fn is_affine(&self) -> bool {
        self.0.function().is_affine()
    }
}

/// F, counting the points at which it is evaluated: repeated evaluations at one point count once.
pub(crate) struct Counted<'a> {
    function: &'a dyn McpFunction,
    last: RefCell<[Vec<f64>; 2]>,
    seen: [Cell<usize>; 2],
}

impl<'a> Counted<'a> {
    fn new(function: &'a dyn McpFunction) -> Self {
        Self {
            function,
            last: RefCell::default(),
            seen: [Cell::new(0), Cell::new(0)],
        }
    }

    fn note(&self, which: usize, x: &[f64]) {
        let last = &mut self.last.borrow_mut()[which];
        if last.as_slice() != x {
            last.clear();
            last.extend_from_slice(x);
            self.seen[which].set(self.seen[which].get() + 1);
        }
    }
}

impl McpFunction for Counted<'_> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.note(0, x);
        self.function.value(x, out);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.note(1, x);
        self.function.jacobian(x, jac);
    }
    fn pattern(&self) -> Pattern {
        self.function.pattern()
    }
    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }
}

/// The data in the report of a method.
#[derive(Default)]
pub(crate) struct Told {
    /// Of residuals of equations; what complementarity problems evaluate is counted.
    pub(crate) evaluations: usize,
    pub(crate) iterations: usize,
    pub(crate) factorisations: usize,
    /// Iterations of the Krylov method in all steps.
    pub(crate) linear_iterations: usize,
    pub(crate) order: Option<f64>,
}

impl Run {
    /// A run with unknown residuals and costs.
    pub(crate) fn told(told: Told) -> Self {
        Self {
            solved: false,
            residual: f64::NAN,
            first: 1.0,
            evaluations: told.evaluations,
            jacobians: told.iterations + 1,
            iterations: told.iterations,
            factorisations: told.factorisations,
            linear_iterations: told.linear_iterations,
            seconds: 0.0,
            order: told.order,
        }
    }
}

type Attempt = fn(&Mcp<Counted<'_>>, &mut [f64]) -> Option<Told>;

/// A method for complementarity problems: it overwrites x and returns its costs, unless it refuses the problem.
pub(crate) struct Method {
    pub(crate) name: &'static str,
    run: Attempt,
}

/// The methods compared. Each starts from the same x and stops by its own rule; whether it has solved is judged by one rule.
pub(crate) const METHODS: [Method; 14] = [
    Method {
        name: "natural map, full steps",
        run: |p, x| pieces(p, x, Damping::Never),
    },
    Method {
        name: "natural map, line search on trouble",
        run: |p, x| pieces(p, x, Damping::OnTrouble),
    },
    Method {
        name: "natural map, line search",
        run: |p, x| pieces(p, x, Damping::Always),
    },
    Method {
        name: "normal map, line search on trouble",
        run: |p, x| {
            let map = NormalMap::new(p);
            let mut z = x.to_vec();
            let told = pieces(&map, &mut z, Damping::OnTrouble);
            x.copy_from_slice(&map.point(&z));
            told
        },
    },
    Method {
        name: "Fischer-Burmeister, full steps",
        run: |p, x| fischer(p, x, 1.0, Damping::Never),
    },
    Method {
        name: "Fischer-Burmeister, line search",
        run: |p, x| fischer(p, x, 1.0, Damping::Always),
    },
    Method {
        name: "Fischer-Burmeister, nonmonotone line search",
        run: |p, x| {
            let map = FischerBurmeister::new(p).ok()?;
            Some(minimise(&map, x, Direction::Newton, MEMORY))
        },
    },
    Method {
        name: "Fischer-Burmeister, Levenberg-Marquardt",
        run: |p, x| {
            let map = FischerBurmeister::new(p).ok()?;
            Some(minimise(&map, x, Direction::Marquardt, 1))
        },
    },
    Method {
        name: "penalised Fischer-Burmeister, line search",
        run: |p, x| fischer(p, x, 0.8, Damping::Always),
    },
    Method {
        name: "inexact Fischer-Burmeister (GMRES, ILU)",
        run: |p, x| {
            let map = FischerBurmeister::new(p).ok()?;
            let options = NewtonKrylovOptions::default().with_relative_tolerance(TOLERANCE);
            let mut newton = NewtonKrylov::new(options);
            // A failure leaves the best iterate, which is judged.
            newton
                .solve(&mut Assembled::new(&map, IncompleteLu::default()), x)
                .ok();
            Some(told(newton.report()))
        },
    },
    Method {
        name: "McpSolver, Newton alone",
        run: |p, x| solver(p, x, &[McpStrategy::Newton]),
    },
    Method {
        name: "McpSolver, Fischer-Burmeister alone",
        run: |p, x| solver(p, x, &[McpStrategy::FischerBurmeister]),
    },
    Method {
        name: "McpSolver, smoothing alone",
        run: |p, x| solver(p, x, &[McpStrategy::Smoothing]),
    },
    Method {
        name: "McpSolver, all strategies",
        run: |p, x| solver(p, x, &[]),
    },
];

pub(crate) fn told(report: &Report) -> Told {
    let first = report.history.first().map_or(1.0, |i| i.residual_norm);
    Told {
        evaluations: report.evaluations,
        iterations: report.history.len().saturating_sub(1),
        factorisations: report.factorisations,
        linear_iterations: report.history.iter().map(|i| i.linear_iterations).sum(),
        order: report.observed_order(1e-13 * first),
    }
}

fn pieces(map: &dyn PiecewiseSmooth, x: &mut [f64], damping: Damping) -> Option<Told> {
    let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
    newton.solve(map, x).ok();
    Some(told(newton.report()))
}

fn fischer(p: &Mcp<Counted<'_>>, x: &mut [f64], lambda: f64, damping: Damping) -> Option<Told> {
    let map = FischerBurmeister::penalised(p, lambda).ok()?;
    let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
    newton.solve_semismooth(&map as &dyn Semismooth, x).ok();
    Some(told(newton.report()))
}

/// McpSolver with these strategies alone, or with all.
pub(crate) fn solver(p: &Mcp<Counted<'_>>, x: &mut [f64], strategies: &[McpStrategy]) -> Option<Told> {
    let mut options = McpOptions::default();
    if !strategies.is_empty() {
        options = options.with_strategies(strategies.to_vec());
    }
    let mut solver = McpSolver::new(options);
    let report = solver.solve(p, x).ok()?;
    let first = report.history.first().map_or(1.0, |i| i.residual);
    Some(Told {
        evaluations: 0,
        iterations: report.iterations,
        factorisations: report.factorisations,
        linear_iterations: 0,
        order: report.observed_order(1e-13 * first),
    })
}

impl Complementarity {
    pub(crate) fn run(&self, method: &Method) -> Outcome<Run> {
        self.run_with(method.run)
    }

    pub(crate) fn run_with(
        &self,
        method: impl Fn(&Mcp<Counted<'_>>, &mut [f64]) -> Option<Told>,
    ) -> Outcome<Run> {
        let counted = Counted::new(self.function.as_ref());
        let problem = Mcp::new(counted, self.lower.clone(), self.upper.clone())?;
        let mut x = self.start.clone();
        let begun = Instant::now();
        let told = method(&problem, &mut x);
        let seconds = begun.elapsed().as_secs_f64();
        let [evaluations, jacobians] = [0, 1].map(|k| problem.function().seen[k].get());
        problem.project(&mut x);
        let mut room = vec![0.0; x.len()];
        let residual = problem.natural_residual(&x, &mut room)?;
        Ok(Run {
            solved: residual <= SOLVED,
            residual,
            first: problem.natural_residual(&self.start, &mut room)?,
            evaluations,
            jacobians,
            seconds,
            ..Run::told(told.unwrap_or_default())
        })
    }
}

/// A linear complementarity problem with a matrix of one of four kinds, from zero or from a point at random.
pub(crate) fn random_lcp(n: usize, kind: usize, random: &mut Random, name: &str) -> Outcome<Complementarity> {
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|_| (0..n).map(|_| random.symmetric()).collect())
        .collect();
    let (label, add) = [
        ("skew", 0.1),
        ("monotone", 0.1),
        ("triangular", 1.0),
        ("indefinite", 0.0),
    ][kind % 4];
    match kind % 4 {
        0 => {
            let g = rows.clone();
            (0..n * n).for_each(|k| rows[k / n][k % n] = g[k / n][k % n] - g[k % n][k / n]);
        }
        1 => {
            let g = rows.clone();
            let product = |i: usize, j: usize| -> f64 { (0..n).map(|k| g[i][k] * g[j][k]).sum() };
            (0..n * n).for_each(|k| rows[k / n][k % n] = product(k / n, k % n) / n as f64);
        }
        // Murty's family with other numbers: a P-matrix on which Newton's method cycles.
        2 => (0..n * n).for_each(|k| rows[k / n][k % n] *= if k % n < k / n { 2.0 } else { 0.0 }),
        _ => {}
    }
    (0..n).for_each(|i| rows[i][i] += add);
    // q = w − M z with z, w ≥ 0 complementary: there is a solution.
    let z: Vec<f64> = (0..n).map(|_| random.symmetric().max(0.0)).collect();
    let q = rows.iter().zip(&z).map(|(row, z_i)| {
        let image: f64 = row.iter().zip(&z).map(|(m, z)| m * z).sum();
        let slack = if *z_i > 0.0 { 0.0 } else { random.symmetric().abs() };
        slack - image
    });
    let q: Vec<f64> = q.collect();
    let function = AffineFunction::new(Matrix::from_rows(&rows)?, q)?;
    let start = (0..n)
        .map(|_| random.symmetric().abs() * (kind % 2) as f64)
        .collect();
    Ok(Complementarity {
        name: format!("{label} {name}"),
        family: label.to_owned(),
        function: Rc::new(function),
        lower: vec![0.0; n],
        upper: vec![f64::INFINITY; n],
        start,
    })
}
