//! Curves through points where all of many sites are at their kinks.

use crate::random::Random;
use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::sparse::Matrix;

/// 0 ≤ y ⟂ M y + q α ≥ 0 with M lower triangular, ones on the diagonal and up to three entries to the left of it.
struct Chain {
    rows: Vec<Vec<f64>>,
    q: Vec<f64>,
}

impl Chain {
    fn new(random: &mut Random, k: usize) -> Self {
        let entry = |random: &mut Random, i: usize, j: usize| match i.wrapping_sub(j) {
            0 => 1.0,
            1..=3 => 1.5 * random.symmetric(),
            _ => 0.0,
        };
        let rows = (0..k).map(|i| (0..k).map(|j| entry(random, i, j)).collect());
        Self {
            rows: rows.collect(),
            q: random.vector(k, 1.0),
        }
    }

    fn map(&self) -> Mcp<AffineFunction> {
        let k = self.q.len();
        let rows: Vec<Vec<f64>> = (self.rows.iter().zip(&self.q))
            .map(|(row, q)| [row.as_slice(), &[*q]].concat())
            .collect();
        let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![0.0; k]).unwrap();
        Mcp::new(f, vec![0.0; k], vec![f64::INFINITY; k]).unwrap()
    }

    /// The only solution, component after component.
    fn solution(&self, alpha: f64) -> Vec<f64> {
        let mut y: Vec<f64> = Vec::new();
        for (row, q) in self.rows.iter().zip(&self.q) {
            let known: f64 = row.iter().zip(&y).map(|(m, y)| m * y).sum();
            y.push((-known - q * alpha).max(0.0));
        }
        y.push(alpha);
        y
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let size = b.iter().fold(0.0f64, |s, v| s.max(v.abs()));
    a.iter().zip(b).fold(0.0f64, |s, (a, b)| s.max((a - b).abs())) / size
}

/// At α = 0 all components are at their kinks: from there, and across it.
#[test]
fn a_curve_of_unique_solutions_passes_a_point_with_all_kinks() {
    let mut random = Random::new(3);
    for k in [3, 20, 60] {
        for case in 0..10 {
            let chain = Chain::new(&mut random, k);
            let map = chain.map();
            let options = ContinuationOptions::default()
                .with_parameter_range((-1.0, 1.0))
                .with_max_growth(f64::INFINITY);
            let origin = vec![0.0; k + 1];
            for (start, direction, end) in [
                (origin.clone(), Direction::Increasing, 1.0),
                (origin, Direction::Decreasing, -1.0),
                (chain.solution(-1.0), Direction::Increasing, 1.0),
                (chain.solution(1.0), Direction::Decreasing, -1.0),
            ] {
                let branch = Branch::follow(&map, &start, direction, options.clone()).unwrap();
                assert_eq!(branch.termination, Termination::ParameterRange, "{k} {case}");
                let last = branch.points.last().unwrap();
                assert_eq!(last.parameter(), end);
                assert!(apart(&last.x, &chain.solution(end)) < 1e-9, "{k} {case}");
                assert!(branch.folds().is_empty() && branch.transitions.len() <= 1);
            }
        }
    }
}
