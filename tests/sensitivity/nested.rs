//! Kinks within kinks: A x + B |C x + D |E x|| = θ at 0, against the enumeration of all signs.

use semismooth::parametric;
use semismooth::piecewise::Expression;
use semismooth::sensitivity::{Differentiability, Directional, Sensitivity, SensitivityError};

use super::degenerate::solved;
use super::random::Random;

type Rows = Vec<Vec<f64>>;

struct Nested {
    a: Rows,
    b: Rows,
    c: Rows,
    d: Rows,
    e: Rows,
}

fn times(m: &Rows, v: &[f64]) -> Vec<f64> {
    m.iter().map(|row| super::dot(row, v)).collect()
}

fn recorded<'a>(m: &Rows, v: &[Expression<'a>]) -> Vec<Expression<'a>> {
    let product = |row: &Vec<f64>| {
        let terms = row.iter().zip(v).map(|(m, v)| *m * *v);
        terms.fold(Expression::from(0.0), |sum, term| sum + term)
    };
    m.iter().map(product).collect()
}

impl Nested {
    fn new(random: &mut Random) -> Self {
        let [n, outer, inner] = [1 + random.below(3), 1 + random.below(2), 1 + random.below(2)];
        let mut rows = |rows: usize, columns: usize| -> Rows {
            let mut row = || (0..columns).map(|_| random.below(5) as f64 - 2.0).collect();
            (0..rows).map(|_| row()).collect()
        };
        let mut made = Self {
            a: rows(n, n),
            b: rows(n, outer),
            c: rows(outer, n),
            d: rows(outer, inner),
            e: rows(inner, n),
        };
        (0..n).for_each(|i| made.a[i][i] += 4.0);
        made
    }

    fn value(&self, v: &[f64]) -> Vec<f64> {
        let inner: Vec<f64> = times(&self.e, v).iter().map(|z| z.abs()).collect();
        let outer = times(&self.c, v).into_iter().zip(times(&self.d, &inner));
        let outer: Vec<f64> = outer.map(|(a, b)| (a + b).abs()).collect();
        let all = times(&self.a, v).into_iter().zip(times(&self.b, &outer));
        all.map(|(a, b)| a + b).collect()
    }

    /// All v with the value δ that regular choices of signs give, and whether all choices are regular.
    fn solutions(&self, delta: &[f64]) -> (Vec<Vec<f64>>, bool) {
        let (n, outer, inner) = (self.a.len(), self.c.len(), self.e.len());
        let (mut list, mut regular): (Vec<Vec<f64>>, bool) = (Vec::new(), true);
        for bits in 0..1_u32 << (outer + inner) {
            let sign = |k: usize| if bits >> k & 1 == 1 { 1.0 } else { -1.0 };
            let entry = |i: usize, j: usize| {
                let of_inner = |k: usize, l: usize| self.d[k][l] * sign(outer + l) * self.e[l][j];
                let within = |k: usize| self.c[k][j] + (0..inner).map(|l| of_inner(k, l)).sum::<f64>();
                self.a[i][j]
                    + (0..outer)
                        .map(|k| self.b[i][k] * sign(k) * within(k))
                        .sum::<f64>()
            };
            let rows = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
            let Some(v) = solved(rows, delta.to_vec()) else {
                regular = false;
                continue;
            };
            if are_same(&self.value(&v), delta) && !list.iter().any(|known| are_same(known, &v)) {
                list.push(v);
            }
        }
        (list, regular)
    }
}

fn are_same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
}

/// One derivative is given only where one v belongs to every direction, and is that one; *yes* where v is linear, *no* where it is not; lists
/// that are called complete are.
#[test]
fn what_is_said_of_nested_kinks_holds() {
    let random = &mut Random::new(31);
    let mut counts = [0; 4];
    for case in 0..600 {
        let nested = Nested::new(random);
        let n = nested.a.len();
        let map = parametric(n, n, |x, p| {
            let inner: Vec<_> = recorded(&nested.e, x).iter().map(|z| z.abs()).collect();
            let outer = recorded(&nested.c, x)
                .into_iter()
                .zip(recorded(&nested.d, &inner));
            let outer: Vec<_> = outer.map(|(a, b)| (a + b).abs()).collect();
            let all = recorded(&nested.a, x)
                .into_iter()
                .zip(recorded(&nested.b, &outer));
            all.zip(p).map(|((a, b), p)| a + b - *p).collect()
        });
        let mut found = match Sensitivity::new(&map, &vec![0.0; n], &vec![0.0; n]) {
            Ok(found) => found,
            Err(SensitivityError::Irregular { .. }) => {
                assert!(!nested.solutions(&vec![1.0; n]).1, "{case}");
                continue;
            }
            Err(e) => panic!("{case}: {e}"),
        };
        let verdict = found.differentiable().unwrap();
        let directions: Vec<Vec<f64>> = (0..12)
            .map(|_| (0..n).map(|_| random.below(7) as f64 - 3.0).collect())
            .collect();
        let one = |delta: &[f64]| {
            let (list, _) = nested.solutions(delta);
            assert_eq!(list.len(), 1, "{case} {delta:?}");
            list[0].clone()
        };
        for delta in &directions {
            match found.directional(delta).unwrap() {
                Directional::Derivative(v) => assert!(are_same(&v, &one(delta)), "{case} {delta:?}"),
                Directional::Branches { branches, complete } => {
                    let (list, regular) = nested.solutions(delta);
                    for v in &branches {
                        assert!(are_same(&nested.value(v), delta), "{case} {delta:?} {v:?}");
                    }
                    if complete && regular {
                        assert_eq!(branches.len(), list.len(), "{case} {delta:?}");
                        counts[3] += 1;
                    }
                }
                other => panic!("{case}: {other}"),
            }
        }
        let opposite = |v: &[f64]| v.iter().map(|v| -v).collect::<Vec<f64>>();
        match verdict {
            Differentiability::Yes { .. } => {
                counts[0] += 1;
                for pair in directions.windows(2) {
                    let sum: Vec<f64> = pair[0].iter().zip(&pair[1]).map(|(a, b)| a + b).collect();
                    let (a, b) = (one(&pair[0]), one(&pair[1]));
                    let both: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + b).collect();
                    assert!(are_same(&one(&sum), &both), "{case}");
                    assert!(are_same(&one(&opposite(&pair[0])), &opposite(&a)), "{case}");
                }
            }
            Differentiability::No { direction, .. } => {
                counts[1] += 1;
                let back = opposite(&one(&opposite(&direction)));
                assert!(!are_same(&one(&direction), &back), "{case}");
            }
            _ => counts[2] += 1,
        }
    }
    assert!(counts[1..].iter().all(|c| *c > 30), "{counts:?}");
}
