//! Equations of friction and of function spaces, and Newton methods for them: exact, damped in several ways, and inexact.

use std::cell::RefCell;
use std::time::Instant;

use semismooth::contact::{FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::linear::{IncompleteLu, KrylovMethod};
use semismooth::newton::{Damping, Forcing, Newton, NewtonKrylov, NewtonKrylovOptions, NewtonOptions};
use semismooth::piecewise::{Assembled, MatrixFree, PiecewiseSmooth, Semismooth, select, value};
use semismooth::sparse::{Matrix, Pattern};

use crate::common::{Outcome, Random};
use crate::contenders::{MEMORY, Run, TOLERANCE, Told, told};
use crate::textbook::{Direction, minimise};

/// ‖H‖∞ of a solution, relative to that of the start. In nearly incompressible bodies terms a million times as large cancel.
const EQUILIBRIUM: f64 = 1e-7;
/// Where products alone are known, Newton steps count as exact from here on.
const EXACT: f64 = 1e-10;

/// How an equation is given.
pub(crate) enum Kind {
    /// Pieces. The last variable is a parameter, which stays as it is.
    Pieces(Box<dyn PiecewiseSmooth>),
    /// An element of the generalised Jacobian.
    Matrix(Box<dyn Semismooth>),
    /// Products with it and a preconditioner, for this method.
    Products(RefCell<Box<dyn MatrixFree>>, KrylovMethod),
}

/// An equation and a start.
pub(crate) struct Equation {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) start: Vec<f64>,
}

/// A method: its steps, and when they are shortened.
pub(crate) struct EquationMethod {
    pub(crate) name: &'static str,
    steps: Steps,
    damping: Damping,
}

#[derive(Clone, Copy)]
enum Steps {
    Exact,
    Inexact(Forcing),
    Textbook(Direction, usize),
}

const fn method(name: &'static str, steps: Steps, damping: Damping) -> EquationMethod {
    EquationMethod { name, steps, damping }
}

const CHOICE_2: Steps = Steps::Inexact(Forcing::Decrease {
    gamma: 0.9,
    alpha: 2.0,
});

/// The methods compared; the last two need matrices.
pub(crate) const EQUATION_METHODS: [EquationMethod; 9] = [
    method("Newton, full steps", Steps::Exact, Damping::Never),
    method("Newton, line search on trouble", Steps::Exact, Damping::OnTrouble),
    method("Newton, line search", Steps::Exact, Damping::Always),
    method("inexact Newton, full steps", CHOICE_2, Damping::Never),
    method(
        "inexact Newton, line search on trouble",
        CHOICE_2,
        Damping::OnTrouble,
    ),
    method("inexact Newton, line search", CHOICE_2, Damping::Always),
    method(
        "inexact Newton, forcing terms from the model",
        Steps::Inexact(Forcing::Model),
        Damping::OnTrouble,
    ),
    method(
        "Newton, nonmonotone line search",
        Steps::Textbook(Direction::Newton, MEMORY),
        Damping::Always,
    ),
    method(
        "Levenberg-Marquardt",
        Steps::Textbook(Direction::Marquardt, 1),
        Damping::Always,
    ),
];

/// How many of them need products only.
pub(crate) const BY_PRODUCTS: usize = 7;

/// A piecewise-smooth map at a fixed parameter.
struct AtParameter<'a> {
    map: &'a dyn PiecewiseSmooth,
    parameter: f64,
    whole: RefCell<Matrix>,
}

impl<'a> AtParameter<'a> {
    fn new(map: &'a dyn PiecewiseSmooth, parameter: f64) -> Self {
        Self {
            map,
            parameter,
            whole: RefCell::new(Matrix::zeros(map.pattern())),
        }
    }

    fn point(&self, x: &[f64]) -> Vec<f64> {
        let mut point = x.to_vec();
        point.push(self.parameter);
        point
    }
}

impl Semismooth for AtParameter<'_> {
    fn num_vars(&self) -> usize {
        self.map.num_residuals()
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        value(self.map, &self.point(x), out);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let (x, mut whole) = (self.point(x), self.whole.borrow_mut());
        whole.clear();
        self.map.jacobian(&select(self.map, &x), &x, &mut whole);
        // Columns lie one after the other, that of the parameter at the end.
        let entries = jac.values_mut().len();
        jac.values_mut().copy_from_slice(&whole.values()[..entries]);
    }
    fn pattern(&self) -> Pattern {
        let (n, whole) = (self.num_vars(), self.map.pattern());
        let starts = whole.col_ptr()[..=n].to_vec();
        let rows = whole.row_idx()[..starts[n]].to_vec();
        Pattern::from_csc(n, n, starts, rows).unwrap_or_else(|_| Pattern::full(n, n))
    }
}

impl Equation {
    /// A map at a parameter, from zero.
    pub(crate) fn pieces(name: String, map: Box<dyn PiecewiseSmooth>, parameter: f64) -> Self {
        let mut start = vec![0.0; map.num_vars()];
        start[map.num_vars() - 1] = parameter;
        Self {
            name,
            kind: Kind::Pieces(map),
            start,
        }
    }

    /// Equations known by products, from zero.
    pub(crate) fn products(name: String, map: impl MatrixFree + 'static, krylov: KrylovMethod) -> Self {
        Self {
            name,
            start: vec![0.0; map.order()],
            kind: Kind::Products(RefCell::new(Box::new(map)), krylov),
        }
    }

    /// ‖H‖∞.
    fn size(&self, x: &[f64]) -> f64 {
        let mut r = vec![0.0; x.len()];
        match &self.kind {
            Kind::Pieces(map) => {
                r.truncate(map.num_residuals());
                value(map, x, &mut r);
            }
            Kind::Matrix(map) => map.residual(x, &mut r),
            Kind::Products(map, _) => map.borrow_mut().residual(x, &mut r),
        }
        r.iter()
            .fold(0.0_f64, |m, v| if v.is_nan() { f64::NAN } else { m.max(v.abs()) })
    }

    pub(crate) fn run(&self, method: &EquationMethod) -> Run {
        let mut x = self.start.clone();
        let begun = Instant::now();
        let told = match &self.kind {
            Kind::Pieces(map) => match method.steps {
                Steps::Exact => {
                    let mut newton = Newton::new(NewtonOptions::default().with_damping(method.damping));
                    // A failure leaves the best iterate, which is judged.
                    newton.solve(map, &mut x).ok();
                    told(newton.report())
                }
                _ => {
                    let (y, parameter) = x.split_at_mut(map.num_residuals());
                    // The order is not determined, as pieces are not known.
                    Told {
                        order: None,
                        ..method.run(&AtParameter::new(map, parameter[0]), y)
                    }
                }
            },
            Kind::Matrix(map) => method.run(map, &mut x),
            Kind::Products(map, krylov) => method.run_products(map.borrow_mut().as_mut(), *krylov, &mut x),
        };
        let seconds = begun.elapsed().as_secs_f64();
        let (residual, first) = (self.size(&x), self.size(&self.start));
        Run {
            solved: residual <= EQUILIBRIUM * first,
            residual,
            first,
            seconds,
            ..Run::told(told)
        }
    }
}

impl EquationMethod {
    fn run(&self, map: &dyn Semismooth, x: &mut [f64]) -> Told {
        match self.steps {
            Steps::Exact => {
                let mut newton = Newton::new(NewtonOptions::default().with_damping(self.damping));
                newton.solve_semismooth(map, x).ok();
                told(newton.report())
            }
            Steps::Inexact(_) => {
                let mut map = Assembled::new(map, IncompleteLu::default());
                self.run_products(&mut map, KrylovMethod::Gmres { directions: 30 }, x)
            }
            Steps::Textbook(direction, memory) => minimise(map, x, direction, memory),
        }
    }

    fn run_products(&self, map: &mut dyn MatrixFree, krylov: KrylovMethod, x: &mut [f64]) -> Told {
        let forcing = match self.steps {
            Steps::Inexact(forcing) => forcing,
            _ => Forcing::Constant(EXACT),
        };
        let mut newton = NewtonKrylov::new(
            NewtonKrylovOptions::default()
                .with_method(krylov)
                .with_forcing(forcing)
                .with_relative_tolerance(TOLERANCE)
                .with_damping(self.damping),
        );
        newton.solve(map, x).ok();
        told(newton.report())
    }
}

/// An elastic body with p contact nodes and two displacements a node, load and friction at random, from zero.
pub(crate) fn random_friction(p: usize, random: &mut Random, name: String) -> Outcome<Equation> {
    let n = 2 * p;
    let g: Vec<Vec<f64>> = (0..n)
        .map(|_| (0..n).map(|_| random.symmetric()).collect())
        .collect();
    let entry = |i: usize, j: usize| {
        let product: f64 = (0..n).map(|k| g[i][k] * g[j][k]).sum();
        product + if i == j { 0.3 } else { 0.0 }
    };
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let pick = |first: usize| {
        let entries: Vec<_> = (0..p).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(p, n, &entries)
    };
    // Pressed on the ground at most nodes, dragged along.
    let load: Vec<f64> = (0..n)
        .map(|k| random.symmetric() * 2.0 + if k % 2 == 0 { 1.0 } else { 0.0 })
        .collect();
    let friction =
        FrictionCoefficient::nodal((0..p).map(|_| 0.2 + 2.8 * random.symmetric().abs()).collect())?;
    let problem: FullContact<PlanarCoulomb> = FullContact::planar(
        Matrix::from_rows(&rows)?,
        pick(0)?,
        pick(1)?,
        LoadPath::constant(load),
        friction,
    )?;
    Ok(Equation::pieces(name, Box::new(problem), 0.0))
}
