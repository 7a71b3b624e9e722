//! Inexact Newton methods: how forcing terms preserve the rate of convergence, and how runs end.

use std::ops::ControlFlow;

use semismooth::linear::{IncompleteLu, KrylovMethod, LinearError, LinearOperator};
use semismooth::newton::{Damping, Forcing, Newton, NewtonError, NewtonKrylov, NewtonKrylovOptions, Step};
use semismooth::piecewise::{Assembled, MatrixFree, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

/// −Δu + eᵘ + 40 (u − 0.02)₊ = 8 on m × m points, times h².
struct Reaction(usize);

impl Reaction {
    fn h2(&self) -> f64 {
        1.0 / ((self.0 + 1) * (self.0 + 1)) as f64
    }
    fn neighbours(&self, k: usize) -> impl Iterator<Item = usize> + use<> {
        let (m, i, j) = (self.0, k % self.0, k / self.0);
        let all = [
            (i > 0, k.wrapping_sub(1)),
            (i + 1 < m, k + 1),
            (j > 0, k.wrapping_sub(m)),
            (j + 1 < m, k + m),
        ];
        all.into_iter().filter(|n| n.0).map(|n| n.1)
    }
}

impl Semismooth for Reaction {
    fn num_vars(&self) -> usize {
        self.0 * self.0
    }
    fn pattern(&self) -> Pattern {
        let n = self.num_vars();
        let row = |k| self.neighbours(k).chain([k]).map(move |l| (k, l));
        Pattern::from_entries(n, n, (0..n).flat_map(row)).unwrap()
    }
    fn residual(&self, u: &[f64], out: &mut [f64]) {
        for k in 0..u.len() {
            let terms = u[k].exp() + 40.0 * (u[k] - 0.02).max(0.0) - 8.0;
            out[k] = 4.0 * u[k] - self.neighbours(k).map(|l| u[l]).sum::<f64>() + self.h2() * terms;
        }
    }
    fn jacobian(&self, u: &[f64], jac: &mut Matrix) {
        for k in 0..u.len() {
            let slope = u[k].exp() + if u[k] > 0.02 { 40.0 } else { 0.0 };
            jac.add(k, k, 4.0 + self.h2() * slope);
            self.neighbours(k).for_each(|l| jac.add(k, l, -1.0));
        }
    }
}

fn options(forcing: Forcing, method: KrylovMethod) -> NewtonKrylovOptions {
    NewtonKrylovOptions::default()
        .with_forcing(forcing)
        .with_method(method)
        .with_relative_tolerance(1e-12)
}

/// Ratios of successive residuals.
fn ratios(newton: &NewtonKrylov) -> Vec<f64> {
    let history = &newton.report().history;
    history
        .windows(2)
        .map(|w| w[1].residual_norm / w[0].residual_norm)
        .collect()
}

/// The same with convection along the first axis, upwind differences: not symmetric.
struct Carried(Reaction, f64);

impl Carried {
    fn weight(&self) -> f64 {
        self.1 * self.0.h2().sqrt()
    }
    fn upwind(&self, k: usize) -> Option<usize> {
        (!k.is_multiple_of(self.0.0)).then(|| k - 1)
    }
}

impl Semismooth for Carried {
    fn num_vars(&self) -> usize {
        self.0.num_vars()
    }
    fn pattern(&self) -> Pattern {
        self.0.pattern()
    }
    fn residual(&self, u: &[f64], out: &mut [f64]) {
        self.0.residual(u, out);
        for k in 0..u.len() {
            out[k] += self.weight() * (u[k] - self.upwind(k).map_or(0.0, |l| u[l]));
        }
    }
    fn jacobian(&self, u: &[f64], jac: &mut Matrix) {
        self.0.jacobian(u, jac);
        for k in 0..u.len() {
            jac.add(k, k, self.weight());
            if let Some(l) = self.upwind(k) {
                jac.add(k, l, -self.weight());
            }
        }
    }
}

const GENERAL: [KrylovMethod; 2] = [
    KrylovMethod::Gmres { directions: 40 },
    KrylovMethod::FlexibleGmres { directions: 40 },
];

#[test]
fn forcing_terms_keep_the_superlinear_tail() {
    let symmetric = [KrylovMethod::Cg, KrylovMethod::Minres];
    for damping in [Damping::OnTrouble, Damping::Always] {
        keeps_the_tail(&Reaction(15), &symmetric, damping);
        keeps_the_tail(&Reaction(15), &GENERAL, damping);
        keeps_the_tail(&Carried(Reaction(15), 20.0), &GENERAL, damping);
    }
}

fn keeps_the_tail(map: &dyn Semismooth, methods: &[KrylovMethod], damping: Damping) {
    let mut direct = vec![0.0; 225];
    Newton::default().solve_semismooth(&map, &mut direct).unwrap();
    let decrease = Forcing::default();
    for &method in methods {
        for forcing in [Forcing::Model, decrease, Forcing::Constant(0.2)] {
            // ILU(0) of a symmetric matrix is symmetric, and definite for M matrices.
            let mut problem = Assembled::new(map, IncompleteLu::default());
            let mut newton = NewtonKrylov::new(options(forcing, method).with_damping(damping));
            let mut u = vec![0.0; 225];
            newton.solve(&mut problem, &mut u).unwrap();
            let distance = u.iter().zip(&direct).map(|(u, d)| (u - d).abs());
            assert!(distance.fold(0.0, f64::max) < 1e-9, "{method:?} {forcing:?}");
            let ratios = ratios(&newton);
            let tail = &ratios[ratios.len() - 3..];
            match forcing {
                // Linear, with about the factor to which the linear systems are solved.
                Forcing::Constant(eta) => assert!(
                    tail.iter().all(|r| *r > 0.02 * eta && *r < 1.5 * eta),
                    "{method:?} {tail:?}"
                ),
                _ => assert!(
                    tail[1] < tail[0] && tail.iter().any(|r| *r < 1e-3),
                    "{method:?} {forcing:?} {ratios:?}"
                ),
            }
            let history = &newton.report().history;
            let least = history[..history.len() - 1]
                .iter()
                .map(|i| i.forcing)
                .fold(1.0, f64::min);
            assert!(forcing == Forcing::Constant(0.2) || least < 0.05);
            assert!(history.iter().all(|i| i.forcing < 1.0));
        }
    }
}

#[test]
fn steps_fulfil_their_forcing_terms() {
    let map = Reaction(9);
    let mut problem = Assembled::new(&map, IncompleteLu::default());
    let mut newton = NewtonKrylov::default();
    let mut iterates = vec![];
    let mut x = vec![0.1; 81];
    // The run is repeated and stopped after each step, so that its iterates can be inspected.
    for stop in 0.. {
        x.fill(0.1);
        let outcome = newton.solve_observed(&mut problem, &mut x, |i| match i.index == stop {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        });
        if outcome.is_ok() {
            break;
        }
        iterates.push((newton.report().history[stop], x.clone()));
    }
    assert!(iterates.len() >= 4);
    let mut before = vec![0.1; 81];
    let (mut r, mut g) = (vec![0.0; 81], Matrix::zeros(map.pattern()));
    for (entry, after) in &iterates {
        map.residual(&before, &mut r);
        let size = r.iter().map(|r| r * r).sum::<f64>().sqrt();
        assert!((size - entry.residual_norm).abs() < 1e-14 * size);
        g.clear();
        map.jacobian(&before, &mut g);
        let d: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
        g.as_ref().mul_add(1.0, &d, &mut r);
        let left = r.iter().map(|r| r * r).sum::<f64>().sqrt();
        assert!(
            left <= (entry.forcing + 1e-10) * size,
            "{entry:?} {}",
            left / size
        );
        before.clone_from(after);
    }
}

/// A function of one variable, in three components, with its derivative; with transposed products or without.
struct Scalar {
    f: fn(f64) -> (f64, f64),
    slope: [f64; 3],
    transposed: bool,
}

impl Scalar {
    fn new(f: fn(f64) -> (f64, f64)) -> Self {
        Self {
            f,
            slope: [0.0; 3],
            transposed: true,
        }
    }
}

impl LinearOperator for Scalar {
    fn order(&self) -> usize {
        3
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        (0..3).for_each(|i| y[i] = self.slope[i] * x[i]);
    }
    fn transpose_product(&mut self, x: &[f64], y: &mut [f64]) -> bool {
        if self.transposed {
            self.product(x, y);
        }
        self.transposed
    }
}

impl MatrixFree for Scalar {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        (0..3).for_each(|i| out[i] = (self.f)(x[i]).0);
    }
    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        (0..3).for_each(|i| self.slope[i] = (self.f)(x[i]).1);
        Ok(())
    }
}

fn solve(map: &mut Scalar, damping: Damping, x: &mut [f64; 3]) -> Result<(), NewtonError> {
    NewtonKrylov::new(NewtonKrylovOptions::default().with_damping(damping))
        .solve(map, x)
        .map(drop)
}

fn reason(error: NewtonError) -> Status {
    match error {
        NewtonError::Failed(unsolved) => {
            assert!(unsolved.x.iter().all(|x| x.is_finite()) && unsolved.residual_norm.is_finite());
            unsolved.status
        }
        other => panic!("{other}"),
    }
}

#[test]
fn line_searches_come_in_where_full_steps_run_away() {
    // Full steps diverge from |x| > 3.92.
    let logarithm = |x: f64| x.signum() * (1.0 + x.abs()).ln();
    let mut map = Scalar::new(|x| (x.signum() * (1.0 + x.abs()).ln(), 1.0 / (1.0 + x.abs())));
    let start = [20.0, -10.0, 50.0];
    for damping in [Damping::OnTrouble, Damping::Always] {
        let mut x = start;
        solve(&mut map, damping, &mut x).unwrap();
        assert!(x.iter().all(|x| x.abs() < 1e-9), "{damping:?} {x:?}");
    }
    let mut x = start;
    reason(solve(&mut map, Damping::Never, &mut x).unwrap_err());
    // The best iterate comes back.
    let size = |x: &[f64; 3]| x.iter().map(|x| logarithm(*x).powi(2)).sum::<f64>();
    assert!(size(&x) <= size(&start));
}

#[test]
fn steps_come_back_into_the_domain() {
    let mut map = Scalar::new(|x| (x.ln() + 3.0, 1.0 / x));
    let mut x = [1.0, 2.0, 0.5];
    solve(&mut map, Damping::OnTrouble, &mut x).unwrap();
    assert!(x.iter().all(|x| (x - (-3.0_f64).exp()).abs() < 1e-9));
}

#[test]
fn failures_are_typed_and_keep_the_best_iterate() {
    // No root; 0 minimizes the residual.
    let mut map = Scalar::new(|x| (x * x + 1.0, 2.0 * x));
    for transposed in [false, true] {
        map.transposed = transposed;
        for damping in [Damping::OnTrouble, Damping::Always, Damping::Never] {
            let mut x = [3.0; 3];
            let why = reason(solve(&mut map, damping, &mut x).unwrap_err());
            let known = matches!(
                why,
                Status::Stalled | Status::Linear { .. } | Status::IterationLimit
            );
            assert!(known, "{damping:?} {why:?}");
            assert!(x.iter().all(|x| x.abs() <= 3.0));
        }
    }
    // Derivatives that are NaN or infinite.
    let mut map = Scalar::new(|x| (x - 1.0, if x > 0.5 { f64::NAN } else { 0.5 }));
    let mut x = [0.0; 3];
    let why = reason(solve(&mut map, Damping::OnTrouble, &mut x).unwrap_err());
    assert_eq!(why, Status::EvaluationFailure { component: 0 });
    // Derivatives that vanish.
    let mut map = Scalar::new(|_| (1.0, 0.0));
    let why = reason(solve(&mut map, Damping::OnTrouble, &mut [0.0; 3]).unwrap_err());
    assert!(
        matches!(why, Status::Linear { residual } if residual == 1.0),
        "{why:?}"
    );
    // A start where H is NaN or infinite.
    let mut map = Scalar::new(|x| (x.sqrt(), 1.0));
    match solve(&mut map, Damping::OnTrouble, &mut [-1.0; 3]).unwrap_err() {
        NewtonError::Failed(unsolved) => {
            assert_eq!(unsolved.status, Status::EvaluationFailure { component: 0 })
        }
        other => panic!("{other}"),
    }
}

/// Newton's steps for x³ = 0 leave 8/27 of the residual each, until it is below the absolute tolerance.
#[test]
fn an_absolute_tolerance_ends_slow_convergence() {
    let mut map = Scalar::new(|x| (x.powi(3), 3.0 * x * x));
    let mut newton = NewtonKrylov::new(
        options(Forcing::Constant(1e-10), KrylovMethod::Gmres { directions: 3 })
            .with_damping(Damping::Always)
            .with_absolute_tolerance(1e-6)
            .with_relative_tolerance(0.0),
    );
    let mut x = [1.0, 0.5, 0.0];
    newton.solve(&mut map, &mut x).unwrap();
    let norms: Vec<f64> = newton.report().history.iter().map(|i| i.residual_norm).collect();
    let (last, others) = norms.split_last().unwrap();
    assert!(
        *last <= 1e-6 && others.iter().all(|norm| *norm > 1e-6),
        "{norms:?}"
    );
    assert!(
        ratios(&newton)
            .iter()
            .all(|ratio| (ratio - 8.0 / 27.0).abs() < 1e-8),
        "{norms:?}"
    );
}

/// A quarter turn of the plane, minus (1, 2).
struct Turn;

impl LinearOperator for Turn {
    fn order(&self) -> usize {
        2
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&[-x[1], x[0]]);
    }
    fn transpose_product(&mut self, x: &[f64], y: &mut [f64]) -> bool {
        y.copy_from_slice(&[x[1], -x[0]]);
        true
    }
}

impl MatrixFree for Turn {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&[-x[1] - 1.0, x[0] - 2.0]);
    }
    fn linearize(&mut self, _x: &[f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

/// With one direction GMRES searches orthogonally to the right-hand side and makes no progress; steepest descent with exact line search
/// reaches the solution, as G Gᵀ = I.
#[test]
fn turns_are_solved_by_steepest_descent() {
    let options = NewtonKrylovOptions::default()
        .with_method(KrylovMethod::Gmres { directions: 1 })
        .with_max_linear_iterations(1);
    let solve = |damping, x: &mut [f64; 2]| {
        let mut newton = NewtonKrylov::new(options.clone().with_damping(damping));
        let solved = newton.solve(&mut Turn, x);
        (
            solved,
            newton.report().history.iter().map(|i| i.step).collect::<Vec<_>>(),
        )
    };
    let mut x = [5.0, -7.0];
    let (solved, steps) = solve(Damping::Always, &mut x);
    solved.unwrap();
    assert_eq!((x, steps), ([2.0, -1.0], vec![Step::Gradient, Step::None]));
    let why = reason(solve(Damping::Never, &mut [5.0, -7.0]).0.unwrap_err());
    assert!(
        matches!(why, Status::Linear { residual } if residual == 1.0),
        "{why:?}"
    );
}

/// a x − b = 0, each component on its own.
struct Uniform(f64, f64);

impl LinearOperator for Uniform {
    fn order(&self) -> usize {
        3
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        y.iter_mut().zip(x).for_each(|(y, x)| *y = self.0 * x);
    }
}

impl MatrixFree for Uniform {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).for_each(|(y, x)| *y = self.0 * x - self.1);
    }
    fn linearize(&mut self, _x: &[f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

/// Numbers whose squares overflow must not make a start pass for a solution.
#[test]
fn sizes_near_the_ends_of_the_range_of_numbers_end_at_solutions() {
    for (a, b) in [
        (1e160, 1.5e160),
        (1e-160, 1.5e-160),
        (1e300, 1.5e300),
        (1e-150, 1.5e140),
    ] {
        let mut x = [1.0, -2.0, 0.0];
        NewtonKrylov::default().solve(&mut Uniform(a, b), &mut x).unwrap();
        assert!(
            x.iter().all(|x| (x / (b / a) - 1.0).abs() < 1e-9),
            "{a:e} {b:e} {x:?}"
        );
    }
    // The solution would be 10³⁵⁰.
    let mut x = [1.0, -2.0, 0.0];
    let failed = NewtonKrylov::default().solve(&mut Uniform(1e-150, 1e200), &mut x);
    assert!(failed.is_err() && x == [1.0, -2.0, 0.0]);
}

/// 1 + 10¹⁷ (x − 1)₊ with its slope.
struct Steep(f64);

impl LinearOperator for Steep {
    fn order(&self) -> usize {
        1
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        y[0] = self.0 * x[0];
    }
}

impl MatrixFree for Steep {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        out[0] = 1.0 + 1e17 * (x[0] - 1.0).max(0.0);
    }
    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        self.0 = if x[0] > 1.0 { 1e17 } else { 0.0 };
        Ok(())
    }
}

/// H ≥ 1 has no zero. At the kink it changes by more than itself with the last digit of x, but no terms cancel there.
#[test]
fn steep_kinks_are_no_solutions() {
    for start in [1.0, 0.5, 1.0 - f64::EPSILON] {
        for damping in [Damping::OnTrouble, Damping::Always, Damping::Never] {
            let options = NewtonKrylovOptions::default().with_damping(damping);
            let found = NewtonKrylov::new(options).solve(&mut Steep(0.0), &mut [start]);
            assert!(
                matches!(found, Err(NewtonError::Failed(_))),
                "{start} {damping:?}: {found:?}"
            );
        }
    }
}
