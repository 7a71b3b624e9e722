//! Equations of cone problems: elements of B-subdifferentials are limits of Jacobians, orders of semismoothness, Newton's method on them.

use semismooth::complementarity::{AffineFunction, FischerBurmeister, Mcp, McpFunction, WithJacobian};
use semismooth::cones::{Cone, ConeMap, ConeProblem, ConeSolver, svec};
use semismooth::newton::{Damping, Newton, NewtonOptions};
use semismooth::piecewise::Semismooth;
use semismooth::piecewise::check::{CheckOptions, check_semismooth};
use semismooth::sparse::{Matrix, Pattern};

use super::monotone_of;
use super::random::Random;

/// A cone with x and F(x) at which a square root or a projection has no derivative, or is close to having none.
struct Sample {
    cone: Cone,
    x: Vec<f64>,
    f: Vec<f64>,
}

fn samples() -> Vec<Sample> {
    let second = |x: [f64; 3], f: [f64; 3]| Sample {
        cone: Cone::SecondOrder(3),
        x: x.to_vec(),
        f: f.to_vec(),
    };
    let line = |x: [f64; 2], f: [f64; 2]| Sample {
        cone: Cone::Nonnegative(2),
        x: x.to_vec(),
        f: f.to_vec(),
    };
    let matrices = |x: [[f64; 3]; 3], f: [[f64; 3]; 3]| Sample {
        cone: Cone::Semidefinite(3),
        x: svec(&x).unwrap(),
        f: svec(&f).unwrap(),
    };
    let (zero, ray) = ([0.0; 3], [5.0, 3.0, -4.0]);
    let opposite = [5.0, -3.0, 4.0];
    let double = [-10.0, -6.0, 8.0];
    let none = [[0.0; 3]; 3];
    let one = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
    let rank = [[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
    vec![
        second(zero, zero),
        second(ray, zero),
        second(zero, ray),
        second(ray, opposite),
        second(ray, double),
        second(double, zero),
        second([6.0, 3.0, -4.0], zero),
        line([0.0, 2.0], [0.0, 0.0]),
        line([-1.0, 0.0], [0.0, -3.0]),
        Sample {
            cone: Cone::SecondOrder(1),
            x: vec![0.0],
            f: vec![0.0],
        },
        Sample {
            cone: Cone::Free(1),
            x: vec![1.0],
            f: vec![0.0],
        },
        matrices(none, none),
        matrices(one, none),
        matrices(none, one),
        matrices(rank, none),
        matrices(rank, rank.map(|row| row.map(|v| -0.5 * v))),
    ]
}

/// F with F(x) = f in each cone, exactly, and the derivative s I + M in all of them.
fn function(chosen: &[&Sample], slope: f64, mixed: &[Vec<f64>]) -> Box<dyn McpFunction> {
    let (x, f): (Vec<f64>, Vec<f64>) = (
        chosen.iter().flat_map(|s| s.x.clone()).collect(),
        chosen.iter().flat_map(|s| s.f.clone()).collect(),
    );
    let n = x.len();
    let entry = |i: usize, j: usize| mixed[i][j] + if i == j { slope } else { 0.0 };
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let slopes = rows.clone();
    Box::new(WithJacobian::new(
        n,
        move |z: &[f64], out: &mut [f64]| {
            for (i, row) in rows.iter().enumerate() {
                out[i] = f[i] + (0..n).map(|j| row[j] * (z[j] - x[j])).sum::<f64>();
            }
        },
        move |_: &[f64], jac: &mut Matrix| {
            (0..n * n).for_each(|k| jac.add(k / n, k % n, slopes[k / n][k % n]));
        },
    ))
}

fn jacobian(map: &dyn Semismooth, x: &[f64]) -> Matrix {
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(x, &mut jac);
    assert_eq!(jac.stray(), None);
    jac
}

fn apart(a: &Matrix, b: &Matrix) -> f64 {
    let n = a.nrows();
    let entries = (0..n * n).map(|k| (a.get(k / n, k % n) - b.get(k / n, k % n)).abs());
    entries.fold(0.0, |m: f64, v| if v <= m { m } else { v })
}

fn differences(map: &dyn Semismooth, x: &[f64]) -> Matrix {
    const H: f64 = 1e-6;
    let n = x.len();
    let mut entries = Vec::new();
    for j in 0..n {
        let at = |h: f64| {
            let mut x = x.to_vec();
            x[j] += h;
            let mut out = vec![0.0; n];
            map.residual(&x, &mut out);
            out
        };
        let (up, down) = (at(H), at(-H));
        entries.extend((0..n).map(|i| (i, j, (up[i] - down[i]) / (2.0 * H))));
    }
    Matrix::from_triplets(n, n, &entries).unwrap()
}

/// The identity of the algebra of each cone.
fn units(chosen: &[&Sample]) -> Vec<f64> {
    let of = |s: &&Sample| -> Vec<f64> {
        let n = s.x.len();
        match s.cone {
            Cone::Nonnegative(_) => vec![1.0; n],
            Cone::SecondOrder(_) => (0..n).map(|i| if i == 0 { 1.0 } else { 0.0 }).collect(),
            Cone::Semidefinite(k) => {
                let row = |i: usize| {
                    (0..k)
                        .map(|j| if i == j { 1.0 } else { 0.0 })
                        .collect::<Vec<f64>>()
                };
                svec(&(0..k).map(row).collect::<Vec<_>>()).unwrap()
            }
            _ => vec![0.0; n],
        }
    };
    chosen.iter().flat_map(of).collect()
}

fn moved(x: &[f64], step: f64, direction: &[f64]) -> Vec<f64> {
    x.iter().zip(direction).map(|(x, d)| x + step * d).collect()
}

/// Fischer–Burmeister: the element is the limit of Jacobians, checked by differences, along the ray stated in the documentation; with F
/// that couples all cones, each cone alone and three together.
#[test]
fn elements_of_fischer_burmeister_maps_are_limits() {
    let (samples, mut random) = (samples(), Random::new(5));
    let n = samples.len();
    for k in 0..3 * n {
        let chosen: Vec<&Sample> = match k < n {
            true => vec![&samples[k]],
            false => vec![&samples[k % n], &samples[(k * 7) % n], &samples[(k * 3 + 1) % n]],
        };
        let x: Vec<f64> = chosen.iter().flat_map(|s| s.x.clone()).collect();
        let mixed = random.square(x.len());
        let problem = ConeProblem::new(
            function(&chosen, 1.0, &mixed),
            chosen.iter().map(|s| s.cone).collect(),
        )
        .unwrap();
        let map = ConeMap::fischer_burmeister(&problem).unwrap();
        let (element, unit) = (jacobian(&map, &x), units(&chosen));
        for t in [1e-3, 1e-5, 1e-7] {
            let near = jacobian(&map, &moved(&x, t, &unit));
            let distance = apart(&near, &element);
            assert!(distance <= 100.0 * t + 1e-8, "{k}, {t}: {distance}");
        }
        let near = moved(&x, 0.1, &unit);
        assert!(
            apart(&jacobian(&map, &near), &differences(&map, &near)) < 1e-7,
            "{k}"
        );
        for mu in [1e-3, 1.0] {
            let map = ConeMap::smoothed(&problem, mu).unwrap();
            let off = apart(&jacobian(&map, &near), &differences(&map, &near));
            assert!(off < 1e-7, "{k}: {off}");
        }
    }
}

/// Natural and normal maps with F′ = 2 I, so that x − F(x) moves opposite to x: limits from inside the cone on its boundary, otherwise from
/// outside.
#[test]
fn elements_of_natural_and_normal_maps_are_limits() {
    for (k, sample) in samples().iter().enumerate() {
        let (chosen, n) = ([sample], sample.x.len());
        let f = function(&chosen, 2.0, &vec![vec![0.0; n]; n]);
        let problem = ConeProblem::new(f, vec![sample.cone]).unwrap();
        let z = moved(&sample.x, -1.0, &sample.f);
        let inside = matches!(sample.cone, Cone::SecondOrder(3)) && z[0] > 0.0;
        let sign = if inside { 1.0 } else { -1.0 };
        let unit = units(&chosen);
        let (natural, normal) = (
            ConeMap::natural(&problem).unwrap(),
            ConeMap::normal(&problem).unwrap(),
        );
        for (map, at, sign) in [
            (&natural as &dyn Semismooth, &sample.x, -sign),
            (&normal, &z, sign),
        ] {
            let element = jacobian(map, at);
            for t in [1e-3, 1e-6] {
                let near = jacobian(map, &moved(at, sign * t, &unit));
                let distance = apart(&near, &element);
                assert!(distance <= 10.0 * t + 1e-12, "{k}, {t}: {distance}");
            }
            let near = moved(at, sign * 0.1, &unit);
            assert!(
                apart(&jacobian(map, &near), &differences(map, &near)) < 1e-7,
                "{k}"
            );
        }
    }
}

/// By the theorems the order is 1 at every point, kinks and the origin included, also for nonlinear F.
#[test]
fn maps_are_strongly_semismooth() {
    for (k, sample) in samples().iter().enumerate() {
        let n = sample.x.len();
        let (x, f) = (sample.x.clone(), sample.f.clone());
        let (here, at) = (x.clone(), x.clone());
        let curved = WithJacobian::new(
            n,
            move |x: &[f64], out: &mut [f64]| {
                for i in 0..x.len() {
                    let (d, next) = (x[i] - at[i], x[(i + 1) % n] - at[(i + 1) % n]);
                    out[i] = f[i] + 1.5 * d + 0.3 * next + d * next;
                }
            },
            move |x: &[f64], jac: &mut Matrix| {
                for i in 0..x.len() {
                    let j = (i + 1) % n;
                    let (d, next) = (x[i] - here[i], x[j] - here[j]);
                    jac.add(i, i, 1.5 + next);
                    jac.add(i, j, 0.3 + d);
                }
            },
        );
        let problem = ConeProblem::new(curved, vec![sample.cone]).unwrap();
        let z = moved(&x, -1.0, &sample.f);
        for (map, at) in [
            (ConeMap::natural(&problem).unwrap(), &x),
            (ConeMap::normal(&problem).unwrap(), &z),
            (ConeMap::fischer_burmeister(&problem).unwrap(), &x),
            (ConeMap::penalised(&problem, 0.7).unwrap(), &x),
        ] {
            // x + F and its root have terms of size 1, whose rounding shows in entries of 1e-7.
            let options = CheckOptions::default().with_tolerance(1e-3);
            let report = check_semismooth(&map, std::slice::from_ref(at), &options);
            let orders = report.unwrap_or_else(|e| panic!("{k}: {e}"));
            assert!(orders.iter().flatten().all(|p| *p > 0.9), "{k}: {orders:?}");
        }
    }
}

/// A banded F over cones of several kinds: the patterns contain all entries of the Jacobians, and zeros are solutions, those that
/// [`ConeSolver`] finds.
#[test]
fn newton_on_maps_and_the_solver_agree() {
    let cones = vec![
        Cone::SecondOrder(3),
        Cone::Nonnegative(2),
        Cone::Semidefinite(2),
        Cone::Free(1),
        Cone::SecondOrder(3),
    ];
    let n = 12;
    let mut random = Random::new(11);
    for k in 0..40 {
        let mut rows = monotone_of(n, &mut random);
        let near = |i: usize, j: usize| i.abs_diff(j) <= 2;
        for (i, row) in rows.iter_mut().enumerate() {
            for (j, v) in row.iter_mut().enumerate() {
                *v = match i == j {
                    true => v.abs() + n as f64 / 2.0,
                    false if near(i, j) => *v,
                    false => 0.0,
                };
            }
        }
        let entries = (0..n * n).map(|k| (k / n, k % n)).filter(|(i, j)| near(*i, *j));
        let mut matrix = Matrix::zeros(Pattern::from_entries(n, n, entries.clone()).unwrap());
        entries.for_each(|(i, j)| matrix.add(i, j, rows[i][j]));
        let q = random.vector(n, 5.0);
        let problem = ConeProblem::new(AffineFunction::new(matrix, q).unwrap(), cones.clone()).unwrap();
        let mut x = vec![0.0; n];
        assert!(ConeSolver::default().solve(&problem, &mut x).unwrap().is_solved());
        let start = random.vector(n, 3.0);
        for map in [
            ConeMap::natural(&problem).unwrap(),
            ConeMap::normal(&problem).unwrap(),
            ConeMap::fischer_burmeister(&problem).unwrap(),
        ] {
            let mut y = start.clone();
            let options = NewtonOptions::default()
                .with_damping(Damping::OnTrouble)
                .with_tolerances(1e-11, 0.0);
            Newton::new(options).solve_semismooth(&map, &mut y).unwrap();
            problem.project(&mut y).unwrap();
            for (x, y) in x.iter().zip(&y) {
                assert!((x - y).abs() < 1e-8, "{k}: {x} {y}");
            }
        }
    }
}

/// Zeros of the smoothed map lie inside the cone with x ∘ F(x) = μ² e.
#[test]
fn zeros_of_smoothed_maps_are_central() {
    for mu in [1e-3, 0.3, 2.0] {
        let f = AffineFunction::new(Matrix::identity(3), vec![0.0, -3.0, -4.0]).unwrap();
        let problem = ConeProblem::new(&f, vec![Cone::SecondOrder(3)]).unwrap();
        let mut x = [1.0, 0.0, 0.0];
        let map = ConeMap::smoothed(&problem, mu).unwrap();
        Newton::default().solve_semismooth(&map, &mut x).unwrap();
        let y = [x[0], x[1] - 3.0, x[2] - 4.0];
        let product = [
            x[0] * y[0] + x[1] * y[1] + x[2] * y[2] - mu * mu,
            x[0] * y[1] + y[0] * x[1],
            x[0] * y[2] + y[0] * x[2],
        ];
        assert!(product.iter().all(|v| v.abs() < 1e-9), "{mu}: {product:?}");
        assert!(x[0] > x[1].hypot(x[2]) && y[0] > y[1].hypot(y[2]));
    }
}

/// On half-lines the penalised map is that of Chen, Chen and Kanzow for a complementarity problem, kinks included; with λ = 1 it is the
/// Fischer–Burmeister map.
#[test]
fn penalised_maps_of_half_lines_are_those_of_complementarity_problems() {
    let mut random = Random::new(31);
    for case in 0..100 {
        let n = 1 + case % 4;
        let matrix = Matrix::from_rows(&random.square(n)).unwrap();
        let mut x = random.vector(n, 2.0);
        let mut q = random.vector(n, 2.0);
        if case % 3 == 0 {
            // F(x) = 1 beside x = 0, and the other way round.
            x[0] = 0.0;
            let mut y = vec![0.0; n];
            matrix.mul_vec(&x, &mut y);
            q[0] = 1.0 - y[0];
            if n > 1 {
                (x[1], q[1]) = (1.0, -y[1]);
                matrix.mul_vec(&x, &mut y);
                (q[0], q[1]) = (1.0 - y[0], -y[1]);
            }
        }
        let function = AffineFunction::new(matrix, q).unwrap();
        let ncp = Mcp::ncp(function.clone()).unwrap();
        let problem = ConeProblem::new(function, vec![Cone::Nonnegative(n)]).unwrap();
        for lambda in [1.0, 0.8, 0.3] {
            let map = ConeMap::penalised(&problem, lambda).unwrap();
            let scalar = FischerBurmeister::penalised(&ncp, lambda).unwrap();
            let (mut ours, mut theirs) = (vec![0.0; n], vec![0.0; n]);
            map.residual(&x, &mut ours);
            scalar.residual(&x, &mut theirs);
            assert!(ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-14));
            if case % 3 > 0 {
                assert!(apart(&jacobian(&map, &x), &jacobian(&scalar, &x)) < 1e-13);
            }
        }
        let plain = jacobian(&ConeMap::fischer_burmeister(&problem).unwrap(), &x);
        assert_eq!(jacobian(&ConeMap::penalised(&problem, 1.0).unwrap(), &x), plain);
    }
}

/// A zero of a penalised map at which Newton's method ends is a solution of the problem; in general position derivatives agree with
/// differences.
#[test]
fn zeros_of_penalised_maps_are_solutions() {
    let mut random = Random::new(32);
    let cones = [
        vec![Cone::SecondOrder(3), Cone::Free(1), Cone::SecondOrder(2)],
        vec![Cone::Semidefinite(3)],
        vec![Cone::Semidefinite(2), Cone::Nonnegative(2), Cone::SecondOrder(1)],
    ];
    let mut zeros = 0;
    for case in 0..240 {
        let cones = cones[case % 3].clone();
        let rows = match case % 2 {
            0 => monotone_of(6, &mut random),
            _ => random.square(6),
        };
        let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), random.vector(6, 2.0)).unwrap();
        let problem = ConeProblem::new(function, cones).unwrap();
        let map = ConeMap::penalised(&problem, [0.9, 0.5, 0.1][case / 3 % 3]).unwrap();
        let mut x = random.vector(6, 2.0);
        assert!(apart(&jacobian(&map, &x), &differences(&map, &x)) < 1e-6);
        let mut newton = Newton::new(NewtonOptions::default().with_damping(Damping::Always));
        if newton.solve_semismooth(&map, &mut x).is_ok() {
            zeros += 1;
            let residual = problem.natural_residual(&x, &mut [0.0; 6]).unwrap();
            assert!(residual < 1e-6, "{case}: {residual}");
        }
    }
    assert!(zeros > 120, "{zeros}");
}
