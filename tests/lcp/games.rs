//! Bimatrix games by the method of Lemke and Howson, and linear programs with equations.

use super::random::Random;
use semismooth::InputError;
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions};
use semismooth::complementarity::{ComplementarityError, Lcp};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

type Rows = Vec<Vec<f64>>;

/// M = −[0 A; Bᵀ 0] and q = 1, with payoffs made positive.
fn game(a: &Rows, b: &Rows) -> Lcp {
    let (m, n) = (a.len(), a[0].len());
    let least = a.iter().chain(b).flatten().fold(0.0_f64, |l, v| l.min(*v));
    let mut rows = vec![vec![0.0; m + n]; m + n];
    for i in 0..m {
        for j in 0..n {
            rows[i][m + j] = -(a[i][j] - least + 1.0);
            rows[m + j][i] = -(b[i][j] - least + 1.0);
        }
    }
    Lcp::new(Matrix::from_rows(&rows).unwrap(), vec![1.0; m + n]).unwrap()
}

/// By how much the strategies (x, y) fail to be best responses to each other, in the payoffs as they are
/// given.
fn regret(a: &Rows, b: &Rows, x: &[f64], y: &[f64]) -> f64 {
    let first: Vec<f64> = a
        .iter()
        .map(|r| r.iter().zip(y).map(|(a, y)| a * y).sum())
        .collect();
    let second: Vec<f64> = (0..y.len())
        .map(|j| b.iter().zip(x).map(|(r, x)| r[j] * x).sum())
        .collect();
    let short = |payoff: &[f64], own: &[f64]| -> f64 {
        let best = payoff.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v));
        payoff.iter().zip(own).map(|(v, p)| (best - v) * p).sum()
    };
    short(&first, x).max(short(&second, y))
}

/// The equilibria found by the labels.
fn equilibria(a: &Rows, b: &Rows) -> Vec<Vec<f64>> {
    let (m, n) = (a.len(), a[0].len());
    let lcp = game(a, b);
    let mut found = Vec::new();
    for label in 0..m + n {
        let mut z = vec![0.0; m + n];
        let options = LemkeOptions::default().with_label(label);
        let report = Lemke::new(options).solve(&lcp, &mut z).unwrap();
        assert_eq!(
            report.status,
            Status::Solved,
            "label {label} of {a:?} {b:?}: {report}"
        );
        let (x, y) = z.split_at(m);
        let shares = |v: &[f64]| -> Vec<f64> {
            let sum: f64 = v.iter().sum();
            v.iter().map(|v| v / sum).collect()
        };
        let (x, y) = (shares(x), shares(y));
        assert!(x.iter().chain(&y).all(|p| *p >= 0.0), "{x:?} {y:?}");
        let size = a.iter().chain(b).flatten().fold(1.0_f64, |s, v| s.max(v.abs()));
        assert!(regret(a, b, &x, &y) <= 1e-12 * size, "label {label}: {x:?} {y:?}");
        found.push([x, y].concat());
    }
    found
}

fn rows(values: &[&[f64]]) -> Rows {
    values.iter().map(|r| r.to_vec()).collect()
}

/// Games of the literature, degenerate ones and those with one equilibrium among them: whatever the label, an
/// equilibrium is found.
#[test]
fn all_labels_of_known_games_lead_to_equilibria() {
    // Von Stengel's example with three equilibria; two of them are found from the artificial one.
    let a = rows(&[&[3.0, 3.0], &[2.0, 5.0], &[0.0, 6.0]]);
    let b = rows(&[&[3.0, 2.0], &[2.0, 6.0], &[3.0, 1.0]]);
    let mut kinds: Vec<Vec<i64>> = equilibria(&a, &b)
        .iter()
        .map(|e| e.iter().map(|p| (p * 60.0).round() as i64).collect())
        .collect();
    kinds.sort();
    kinds.dedup();
    assert!(
        kinds.contains(&vec![60, 0, 0, 60, 0]) && kinds.contains(&vec![0, 20, 40, 20, 40]),
        "{kinds:?}"
    );
    // Degenerate: the first player has two best responses to the first column.
    equilibria(
        &rows(&[&[3.0, 3.0], &[3.0, 5.0], &[0.0, 6.0]]),
        &rows(&[&[3.0, 3.0], &[2.0, 6.0], &[3.0, 1.0]]),
    );
    // Rock, paper, scissors: (1/3, 1/3, 1/3) for both.
    let cycle = rows(&[&[0.0, -1.0, 1.0], &[1.0, 0.0, -1.0], &[-1.0, 1.0, 0.0]]);
    let other: Rows = cycle.iter().map(|r| r.iter().map(|v| -v).collect()).collect();
    for e in equilibria(&cycle, &other) {
        assert!(e.iter().all(|p| (p - 1.0 / 3.0).abs() < 1e-14), "{e:?}");
    }
    // The prisoners' dilemma, matching pennies, a game in which all payoffs are equal, and one with a single
    // strategy.
    equilibria(
        &rows(&[&[-1.0, -3.0], &[0.0, -2.0]]),
        &rows(&[&[-1.0, 0.0], &[-3.0, -2.0]]),
    );
    equilibria(
        &rows(&[&[1.0, -1.0], &[-1.0, 1.0]]),
        &rows(&[&[-1.0, 1.0], &[1.0, -1.0]]),
    );
    equilibria(&vec![vec![2.0; 4]; 3], &vec![vec![2.0; 4]; 3]);
    equilibria(&rows(&[&[5.0, 1.0, 3.0]]), &rows(&[&[0.0, 2.0, 1.0]]));
}

/// Games of random sizes, with payoffs in full digits and, degenerate, in small integers, in zero-sum games,
/// too.
#[test]
fn random_games_are_solved_by_every_label() {
    let mut random = Random::new(8);
    for k in 0..150 {
        let (m, n) = (1 + random.below(8), 1 + random.below(5));
        let mut matrix = || -> Rows {
            let entry = |random: &mut Random| match k % 2 {
                0 => random.symmetric(),
                _ => random.below(4) as f64,
            };
            (0..m)
                .map(|_| (0..n).map(|_| entry(&mut random)).collect())
                .collect()
        };
        let a = matrix();
        let b = match k % 3 {
            0 => a.iter().map(|r| r.iter().map(|v| -v).collect()).collect(),
            _ => matrix(),
        };
        equilibria(&a, &b);
    }
}

/// Scaled payoffs leave the equilibria as they are: by powers of two, bit by bit.
#[test]
fn units_of_payoffs_do_not_matter() {
    let mut random = Random::new(3);
    let a: Rows = (0..4).map(|_| random.vector(3, 1.0)).collect();
    let b: Rows = (0..4).map(|_| random.vector(3, 1.0)).collect();
    let lcp = game(&a, &b);
    for unit in [1e-8_f64, 1e8].map(|u| u.log2().round().exp2()) {
        let values = lcp
            .matrix()
            .triplets()
            .map(|(i, j, v)| (i, j, v * unit))
            .collect::<Vec<_>>();
        let scaled = Lcp::new(Matrix::from_triplets(7, 7, &values).unwrap(), vec![1.0; 7]).unwrap();
        for label in 0..7 {
            let mut solver = Lemke::new(LemkeOptions::default().with_label(label));
            let (mut z, mut y) = (vec![0.0; 7], vec![0.0; 7]);
            let status =
                [solver.solve(&lcp, &mut z), solver.solve(&scaled, &mut y)].map(|r| r.unwrap().status);
            assert_eq!(status, [Status::Solved; 2]);
            assert!(z.iter().zip(&y).all(|(z, y)| *z == y * unit), "{z:?} {y:?}");
        }
    }
}

#[test]
fn labels_that_begin_no_path_are_refused() {
    let lcp = |q: f64, upper: f64| {
        let m = Matrix::from_rows(&[[0.0, -1.0], [-1.0, 0.0]]).unwrap();
        Lcp::boxed(m, vec![q; 2], vec![0.0; 2], vec![upper; 2]).unwrap()
    };
    let solve = |lcp: &Lcp, label: usize| {
        let options = LemkeOptions::default().with_label(label);
        Lemke::new(options).solve(lcp, &mut [0.0; 2])
    };
    let inf = f64::INFINITY;
    assert!(solve(&lcp(1.0, inf), 1).is_ok());
    let beyond = solve(&lcp(1.0, inf), 2);
    assert!(
        matches!(
            beyond,
            Err(ComplementarityError::Input(InputError::Option {
                name: "label",
                ..
            }))
        ),
        "{beyond:?}"
    );
    for refused in [solve(&lcp(-1.0, inf), 0), solve(&lcp(1.0, 3.0), 0)] {
        assert!(
            matches!(refused, Err(ComplementarityError::Unsuitable { .. })),
            "{refused:?}"
        );
    }
}

/// min cᵀx, A x = b, x ≥ 0 with x and the multipliers λ of a known optimum: the conditions c − Aᵀλ ≥ 0 ⟂ x ≥
/// 0, A x − b = 0 with λ free, whose block of M is zero.
#[test]
fn linear_programs_with_equations_are_solved() {
    let mut random = Random::new(21);
    for k in 0..100 {
        let (rows, n) = (1 + random.below(5), 4 + random.below(8));
        let mut a: Rows = (0..rows).map(|_| random.vector(n, 1.0)).collect();
        if k % 4 == 0 && rows > 1 {
            // An equation twice.
            a[rows - 1] = a[0].clone();
        }
        let x: Vec<f64> = (0..n).map(|_| random.symmetric().max(0.0)).collect();
        let lambda = random.vector(rows, 1.0);
        let b: Vec<f64> = a
            .iter()
            .map(|r| r.iter().zip(&x).map(|(a, x)| a * x).sum())
            .collect();
        let reduced: Vec<f64> = x
            .iter()
            .map(|x| if *x > 0.0 { 0.0 } else { random.unit() })
            .collect();
        let c: Vec<f64> = (0..n)
            .map(|j| reduced[j] + (0..rows).map(|i| a[i][j] * lambda[i]).sum::<f64>())
            .collect();
        let mut entries = Vec::new();
        for (i, row) in a.iter().enumerate() {
            for (j, v) in row.iter().enumerate() {
                entries.extend([(n + i, j, *v), (j, n + i, -v)]);
            }
        }
        let q = c.iter().copied().chain(b.iter().map(|b| -b)).collect();
        let lower = [vec![0.0; n], vec![f64::NEG_INFINITY; rows]].concat();
        let matrix = Matrix::from_triplets(n + rows, n + rows, &entries).unwrap();
        let lcp = Lcp::boxed(matrix, q, lower, vec![f64::INFINITY; n + rows]).unwrap();
        let mut z = vec![0.0; n + rows];
        let report = Lemke::default().solve(&lcp, &mut z).unwrap();
        assert_eq!(report.status, Status::Solved, "{k}: {report}");
        let cost = |x: &[f64]| -> f64 { x.iter().zip(&c).map(|(x, c)| x * c).sum() };
        assert!(
            (cost(&z[..n]) - cost(&x)).abs() <= 1e-9,
            "{k}: {} {}",
            cost(&z[..n]),
            cost(&x)
        );
        assert!(
            lcp.natural_residual(&z, &mut vec![0.0; n + rows]).unwrap() <= 1e-12,
            "{k}"
        );
    }
    // x₀ + x₁ = −1 with x ≥ 0: the ray proves that there is no solution.
    let m = Matrix::from_rows(&[[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [1.0, 1.0, 0.0]]).unwrap();
    let (inf, lower) = (f64::INFINITY, vec![0.0, 0.0, f64::NEG_INFINITY]);
    let lcp = Lcp::boxed(m, vec![1.0, 1.0, 1.0], lower, vec![inf; 3]).unwrap();
    let report = Lemke::default().solve(&lcp, &mut [0.0; 3]).unwrap();
    assert_eq!(report.status, Status::NoSolution);
}
