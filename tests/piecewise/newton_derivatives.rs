//! The checker of Newton derivatives.

use semismooth::complementarity::{FischerBurmeister, Lcp, Mcp};
use semismooth::piecewise::Semismooth;
use semismooth::piecewise::check::{CheckError, CheckOptions, Finding, FindingKind, check_semismooth};
use semismooth::sparse::{Matrix, Pattern};

use super::random::Random;

/// A map of one variable by its value and its declared derivative.
struct Scalar(fn(f64) -> f64, fn(f64) -> f64);

impl Semismooth for Scalar {
    fn num_vars(&self) -> usize {
        1
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        out[0] = (self.0)(x[0]);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, (self.1)(x[0]));
    }
}

fn orders(map: &dyn Semismooth, samples: &[Vec<f64>]) -> Vec<Option<f64>> {
    check_semismooth(map, samples, &CheckOptions::default()).unwrap()
}

fn findings(map: &dyn Semismooth, samples: &[Vec<f64>]) -> Vec<Finding> {
    match check_semismooth(map, samples, &CheckOptions::default()) {
        Err(CheckError::Findings(list)) => list,
        other => panic!("{other:?}"),
    }
}

/// x |x|^p has the remainder p |d|^(1 + p) at 0.
#[test]
fn orders_are_those_of_powers() {
    for (map, order) in [
        (
            Scalar(|x| x * x.abs().powf(0.25), |x| 1.25 * x.abs().powf(0.25)),
            0.25,
        ),
        (Scalar(|x| x * x.abs().sqrt(), |x| 1.5 * x.abs().sqrt()), 0.5),
        (Scalar(|x| x + x * x.abs(), |x| 1.0 + 2.0 * x.abs()), 1.0),
    ] {
        let found = orders(&map, &[vec![0.0]])[0].unwrap();
        assert!((found - order).abs() < 1e-2, "{found} {order}");
    }
    // Affine pieces have no remainder.
    assert_eq!(
        orders(&Scalar(f64::abs, f64::signum), &[vec![0.0], vec![1.5]]),
        [None, None]
    );
    // x / ln |x| is semismooth of no positive order: the remainder falls as |d| / ln² |d|.
    let logarithm = |x: f64| if x == 0.0 { 0.0 } else { x / x.abs().ln() };
    let slope = |x: f64| {
        if x == 0.0 {
            0.0
        } else {
            1.0 / x.abs().ln() - 1.0 / x.abs().ln().powi(2)
        }
    };
    let found = orders(&Scalar(logarithm, slope), &[vec![0.0]])[0].unwrap();
    assert!(found > 0.1 && found < 0.25, "{found}");
}

/// Fischer–Burmeister functions are strongly semismooth, degenerate solutions included (order 1, where M x is not linear).
#[test]
fn fischer_burmeister_is_strongly_semismooth() {
    struct Bent;
    impl semismooth::complementarity::McpFunction for Bent {
        fn num_vars(&self) -> usize {
            2
        }
        fn value(&self, x: &[f64], out: &mut [f64]) {
            out[0] = 2.0 * x[0] + x[1] + x[0] * x[1];
            out[1] = x[1].exp() - x[0] - 1.0;
        }
        fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
            jac.add(0, 0, 2.0 + x[1]);
            jac.add(0, 1, 1.0 + x[0]);
            jac.add(1, 0, -1.0);
            jac.add(1, 1, x[1].exp());
        }
    }
    let problem = semismooth::complementarity::Mcp::ncp(Bent).unwrap();
    let found = orders(
        &FischerBurmeister::new(&problem).unwrap(),
        &[vec![0.0; 2], vec![0.5, -0.3]],
    );
    for order in found {
        assert!((order.unwrap() - 1.0).abs() < 0.05, "{order:?}");
    }
    let lcp = Lcp::new(
        Matrix::from_rows(&[[2.0, 1.0], [0.0, 1.0]]).unwrap(),
        vec![0.0; 2],
    )
    .unwrap();
    // Positively homogeneous: exact at 0.
    assert_eq!(
        orders(&FischerBurmeister::new(lcp.mcp()).unwrap(), &[vec![0.0; 2]]),
        [None]
    );
}

/// (x₀ + x₁², |x₁| + x₀ x₁) with an error.
struct Wrong {
    row: usize,
    col: usize,
    by: f64,
}

impl Semismooth for Wrong {
    fn num_vars(&self) -> usize {
        2
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] + x[1] * x[1];
        out[1] = x[1].abs() + x[0] * x[1];
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, 1.0);
        jac.add(0, 1, 2.0 * x[1]);
        jac.add(1, 0, x[1]);
        jac.add(1, 1, x[1].signum() + x[0]);
        jac.add(self.row, self.col, self.by);
    }
}

#[test]
fn wrong_entries_are_named_with_row_and_column() {
    let samples = [vec![0.7, 0.0], vec![-1.1, 2.0]];
    assert_eq!(
        orders(
            &Wrong {
                row: 0,
                col: 0,
                by: 0.0
            },
            &samples
        )
        .len(),
        2
    );
    for (row, col) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        for by in [1e-3, -0.5] {
            let found = findings(&Wrong { row, col, by }, &samples);
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(
                (found[0].kind, found[0].entry),
                (FindingKind::Jacobian, Some((row, col)))
            );
            assert!(
                (found[0].found - found[0].expected - by).abs() < 1e-6,
                "{found:?}"
            );
        }
    }
    let outside = findings(
        &Wrong {
            row: 2,
            col: 0,
            by: 1.0,
        },
        &samples,
    );
    assert_eq!(
        (outside[0].kind, outside[0].entry),
        (FindingKind::StrayEntry, Some((2, 0)))
    );
}

/// H(x) = (x₁ + 2 x₂ + 3 x₃, x₂, x₃) with a pattern that has the diagonal alone.
struct Sparse;

impl Semismooth for Sparse {
    fn num_vars(&self) -> usize {
        3
    }
    fn pattern(&self) -> Pattern {
        Pattern::from_entries(3, 3, (0..3).map(|i| (i, i))).unwrap()
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&[x[0] + 2.0 * x[1] + 3.0 * x[2], x[1], x[2]]);
    }
    fn jacobian(&self, _: &[f64], jac: &mut Matrix) {
        for (i, j, v) in [(0, 0, 1.0), (0, 1, 2.0), (0, 2, 3.0), (1, 1, 1.0), (2, 2, 1.0)] {
            jac.add(i, j, v);
        }
    }
}

#[test]
fn a_pattern_that_lacks_entries_is_the_only_finding() {
    let found = findings(&Sparse, &[vec![0.3, 0.4, 0.5]]);
    assert!(!found.is_empty());
    assert!(
        found.iter().all(|f| f.kind == FindingKind::StrayEntry),
        "{found:?}"
    );
}

#[test]
fn maps_that_are_not_semismooth_are_reported() {
    // Differentiable, with a derivative that does not converge.
    let wave = Scalar(
        |x| if x == 0.0 { 0.0 } else { x * x * (1.0 / x).sin() },
        |x| {
            if x == 0.0 {
                0.0
            } else {
                2.0 * x * (1.0 / x).sin() - (1.0 / x).cos()
            }
        },
    );
    let found = findings(&wave, &[vec![0.0]]);
    assert!(
        found.iter().any(|f| f.kind == FindingKind::Semismooth),
        "{found:?}"
    );
    // The derivative of |x| smoothed near 0, which is wrong only next to the kink.
    let smoothed = Scalar(f64::abs, |x| (x / 1e-5).tanh());
    let found = findings(&smoothed, &[vec![0.0]]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(
        (found[0].kind, found[0].point),
        (FindingKind::Semismooth, Some(0))
    );
    let nan = Scalar(|x| x, |x| x / x);
    assert_eq!(findings(&nan, &[vec![0.0]])[0].kind, FindingKind::NotFinite);
    // Outside a domain nothing is evaluated.
    assert_eq!(
        orders(&Scalar(|x| x * x.sqrt(), |x| 1.5 * x.sqrt()), &[vec![0.0]]).len(),
        1
    );
}

fn derivative(map: &dyn Semismooth, x: &[f64]) -> Matrix {
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(x, &mut jac);
    jac
}

/// Where kinks of the penalty meet, the derivative of all components is that at points on one side of all kinks. If no gap is closed with F
/// = 0, there are finitely many such derivatives.
#[test]
fn penalised_derivatives_at_kinks_are_those_nearby() {
    let inf = f64::INFINITY;
    let mut rng = Random::new(4);
    let mut several = 0;
    for _ in 0..300 {
        let entry = |rng: &mut Random| rng.below(5) as f64 - 2.0;
        let rows: Vec<Vec<f64>> = (0..3)
            .map(|_| (0..3).map(|_| entry(&mut rng)).collect())
            .collect();
        let boxes: Vec<(f64, f64)> = (0..3)
            .map(|_| [(0.0, inf), (-inf, 2.0), (0.0, 2.0), (0.0, 2.0)][rng.below(4)])
            .collect();
        let x: Vec<f64> = (0..3).map(|_| rng.below(3) as f64).collect();
        let closed = |i: usize| x[i] == boxes[i].0 || x[i] == boxes[i].1;
        let f: Vec<f64> = (0..3)
            .map(|i| {
                if closed(i) {
                    [-1.0, 1.0][rng.below(2)]
                } else {
                    [0.0, 0.0, 1.0][rng.below(3)]
                }
            })
            .collect();
        let q = (0..3).map(|i| f[i] - (0..3).map(|j| rows[i][j] * x[j]).sum::<f64>());
        let problem = Mcp::affine(
            Matrix::from_rows(&rows).unwrap(),
            q.collect(),
            boxes.iter().map(|b| b.0).collect(),
            boxes.iter().map(|b| b.1).collect(),
        )
        .unwrap();
        several += usize::from((0..3).filter(|&i| closed(i) || f[i] == 0.0).count() > 1);
        let map = FischerBurmeister::penalised(&problem, 0.8).unwrap();
        let found = derivative(&map, &x);
        let nearest = (0..500)
            .map(|_| {
                let near: Vec<f64> = x.iter().map(|x| x + 1e-8 * rng.symmetric()).collect();
                let other = derivative(&map, &near);
                let pairs = found.values().iter().zip(other.values());
                pairs.fold(0.0_f64, |d, (a, b)| d.max((a - b).abs()))
            })
            .fold(inf, f64::min);
        assert!(nearest < 1e-6, "{rows:?} {boxes:?} {x:?} {f:?}: {nearest:e}");
    }
    assert!(several > 100, "{several}");
}
