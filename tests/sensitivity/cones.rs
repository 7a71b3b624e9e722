//! Second-order cones: derivatives of solutions away from kinks and at them, against differences.

use semismooth::InputError;
use semismooth::complementarity::AffineFunction;
use semismooth::cones::{Cone, ConePieces, ConeProblem, ConeSolver};
use semismooth::sensitivity::{Sensitivity, SensitivityError};
use semismooth::sparse::Matrix;

use super::dot;
use super::random::Random;

fn cones() -> Vec<Cone> {
    vec![
        Cone::SecondOrder(3),
        Cone::Nonnegative(1),
        Cone::SecondOrder(4),
        Cone::Free(1),
    ]
}

const N: usize = 9;

/// F(x) = M x + q + θ, M positive definite but not symmetric.
struct Affine {
    m: Vec<Vec<f64>>,
    q: Vec<f64>,
}

impl Affine {
    /// The problem that has the solution x with F = y there.
    fn with(random: &mut Random, x: &[f64], y: &[f64]) -> Self {
        let a: Vec<Vec<f64>> = (0..N).map(|_| random.vector(N, 0.5)).collect();
        let entry = |i: usize, j: usize| {
            let square: f64 = (0..N).map(|k| a[i][k] * a[j][k]).sum();
            square + 0.3 * (a[i][j] - a[j][i]) + if i == j { 0.5 } else { 0.0 }
        };
        let m: Vec<Vec<f64>> = (0..N).map(|i| (0..N).map(|j| entry(i, j)).collect()).collect();
        let q = (0..N).map(|i| y[i] - dot(&m[i], x)).collect();
        Self { m, q }
    }

    fn map(&self) -> ConePieces<AffineFunction> {
        let unit = |i: usize| (0..N).map(move |j| if i == j { 1.0 } else { 0.0 });
        let rows: Vec<Vec<f64>> = (0..N)
            .map(|i| self.m[i].iter().copied().chain(unit(i)).collect())
            .collect();
        let rows = Matrix::from_rows(&rows).unwrap();
        ConePieces::new(
            AffineFunction::with_parameters(rows, self.q.clone()).unwrap(),
            cones(),
        )
        .unwrap()
    }

    /// The solution at θ, to rounding.
    fn solution(&self, theta: &[f64]) -> Vec<f64> {
        let q = self.q.iter().zip(theta).map(|(a, b)| a + b).collect();
        let function = AffineFunction::new(Matrix::from_rows(&self.m).unwrap(), q).unwrap();
        let problem = ConeProblem::new(function, cones()).unwrap();
        let mut x = vec![0.0; N];
        assert!(ConeSolver::default().solve(&problem, &mut x).unwrap().is_solved());
        Sensitivity::new(self.map(), &x, theta).unwrap().x().to_vec()
    }
}

/// Where a cone's block of the solution is.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Place {
    Interior,
    Boundary,
    Tip,
    /// On the boundary with F = 0, and at the tip with F on the boundary.
    BoundaryZero,
    TipBoundary,
}

/// (x, F) of a block, between ½ and 1½ from the axis of its cone: nearer to it surfaces are so curved that differences are not derivatives.
fn block(random: &mut Random, len: usize, place: Place) -> (Vec<f64>, Vec<f64>) {
    let mut v: Vec<f64> = random.vector(len - 1, 1.0);
    let (length, norm) = (dot(&v, &v).sqrt(), 1.0 + 0.5 * random.vector(1, 1.0)[0]);
    v.iter_mut().for_each(|v| *v *= norm / length);
    let with =
        |t: f64, sign: f64| -> Vec<f64> { [t].into_iter().chain(v.iter().map(|v| sign * v)).collect() };
    let zero = vec![0.0; len];
    match place {
        Place::Interior => (with(norm + 0.7, 1.0), zero),
        Place::Boundary => (with(norm, 1.0), with(1.5 * norm, -1.5)),
        Place::Tip => (zero, with(norm + 0.7, 1.0)),
        Place::BoundaryZero => (with(norm, 1.0), zero),
        Place::TipBoundary => (zero, with(norm, 1.0)),
    }
}

fn random_problem(random: &mut Random, places: [Place; 2]) -> (Affine, Vec<f64>) {
    let (first, second) = (block(random, 3, places[0]), block(random, 4, places[1]));
    let x: Vec<f64> = [first.0, vec![0.8], second.0, vec![-0.4]].concat();
    let y: Vec<f64> = [first.1, vec![0.0], second.1, vec![0.0]].concat();
    (Affine::with(random, &x, &y), x)
}

/// Away from kinks derivatives are differences, and the adjoint is exact; at kinks one-sided derivatives are one-sided differences.
/// `CONE_CASES` examines more problems for each pair of faces.
#[test]
fn derivatives_are_differences_on_all_faces() {
    let random = &mut Random::new(4);
    let all = [
        Place::Interior,
        Place::Boundary,
        Place::Tip,
        Place::BoundaryZero,
        Place::TipBoundary,
    ];
    let cases = super::cases("CONE_CASES", 1) as usize;
    let pairs = all.iter().flat_map(|a| all.iter().map(move |b| (*a, *b)));
    for (first, second) in pairs.flat_map(|pair| std::iter::repeat_n(pair, cases)) {
        let (problem, x) = random_problem(random, [first, second]);
        let zero = vec![0.0; N];
        let mut found = Sensitivity::new(problem.map(), &x, &zero).unwrap();
        let is_kink = |p: Place| matches!(p, Place::BoundaryZero | Place::TipBoundary);
        let smooth = !is_kink(first) && !is_kink(second);
        assert_eq!(
            found.differentiable().unwrap().known(),
            Some(smooth),
            "{first:?} {second:?}"
        );
        for _ in 0..4 {
            let delta = random.vector(N, 1.0);
            for sign in [1.0, -1.0] {
                let delta: Vec<f64> = delta.iter().map(|d| sign * d).collect();
                let rate = found.jvp(&delta).unwrap();
                let step = 1e-4;
                let at = |s: f64| problem.solution(&delta.iter().map(|d| s * step * d).collect::<Vec<_>>());
                let (a, b, c) = (at(1.0), at(2.0), at(3.0));
                for i in 0..N {
                    // One-sided, of third order.
                    let difference = (18.0 * a[i] - 9.0 * b[i] + 2.0 * c[i] - 11.0 * x[i]) / (6.0 * step);
                    assert!(
                        (rate[i] - difference).abs() < 1e-6,
                        "{first:?} {second:?}, {i}: {} {difference}",
                        rate[i]
                    );
                }
            }
            if smooth {
                let w = random.vector(N, 1.0);
                let (forward, adjoint) = (
                    dot(&found.jvp(&delta).unwrap(), &w),
                    dot(&found.vjp(&w).unwrap(), &delta),
                );
                assert!((forward - adjoint).abs() < 1e-12 * (1.0 + forward.abs()));
            }
        }
    }
}

/// Where x and F both are at the tip of a cone, the projection has no finite list of pieces, and no derivative is given.
#[test]
fn tips_are_refused() {
    let random = &mut Random::new(5);
    let x = [vec![0.0; 3], vec![0.8], vec![2.0, 0.5, 0.0, 0.0], vec![-0.4]].concat();
    let problem = Affine::with(random, &x, &[0.0; N]);
    let refused = Sensitivity::new(problem.map(), &x, &[0.0; N]).unwrap_err();
    assert!(
        matches!(refused, SensitivityError::Input(InputError::NotFinite { .. })),
        "{refused}"
    );
}
