//! Verdicts at nearly singular points of affine complementarity problems, checked in rational arithmetic.

use num_bigint::BigInt;
use num_traits::{Signed, Zero};
use semismooth::complementarity::{Lcp, strong_regularity};
use semismooth::piecewise::{
    CertificateDoubt, CoherentOrientation, Regularity, Selection, bd_regularity, cd_regularity,
    coherent_orientation, local_index,
};
use semismooth::sparse::Matrix;

use super::dense::{det_sign, norm};
use super::random::Random;

/// v · 2^200, an integer for the entries here.
fn integer(v: f64) -> BigInt {
    let bits = v.abs().to_bits();
    let (mantissa, exponent) = match bits >> 52 {
        0 => (bits, -1074),
        e => (bits & ((1 << 52) - 1) | 1 << 52, e as i64 - 1075),
    };
    let shift = 200 + exponent;
    let value = if shift >= 0 {
        BigInt::from(mantissa) << shift as u64
    } else {
        assert!(mantissa.trailing_zeros() as i64 >= -shift || mantissa == 0);
        BigInt::from(mantissa) >> (-shift) as u64
    };
    if v < 0.0 { -value } else { value }
}

/// By expansion along rows.
fn determinant(m: &[Vec<BigInt>]) -> BigInt {
    let Some((first, rest)) = m.split_first() else {
        return BigInt::from(1);
    };
    let mut sum = BigInt::zero();
    for (j, entry) in first.iter().enumerate() {
        let minor: Vec<Vec<BigInt>> = rest.iter().map(|r| [&r[..j], &r[j + 1..]].concat()).collect();
        let term = entry * determinant(&minor);
        sum += if j % 2 == 0 { term } else { -term };
    }
    sum
}

/// The rows of I and of M, times 2^200.
struct Rational {
    one: Vec<Vec<BigInt>>,
    m: Vec<Vec<BigInt>>,
}

impl Rational {
    fn new(m: &[Vec<f64>]) -> Self {
        let n = m.len();
        let unit = |i, j| integer(f64::from(u8::from(i == j)));
        Self {
            one: (0..n).map(|i| (0..n).map(|j| unit(i, j)).collect()).collect(),
            m: m.iter()
                .map(|row| row.iter().map(|v| integer(*v)).collect())
                .collect(),
        }
    }

    /// The rows of a selection: piece 1 is F.
    fn rows(&self, s: &Selection) -> Vec<Vec<BigInt>> {
        let row = |(i, piece): (usize, usize)| [&self.one, &self.m][piece][i].clone();
        s.pieces().enumerate().map(row).collect()
    }

    fn sign(&self, s: &Selection) -> i8 {
        let d = determinant(&self.rows(s));
        if d.is_zero() {
            0
        } else if d.is_positive() {
            1
        } else {
            -1
        }
    }

    /// The direction that a regular selection maps to `value`, times its determinant, and whether it lies inside the cell; `None` on its
    /// boundary.
    fn holds_preimage(&self, s: &Selection, value: &[i64]) -> Option<bool> {
        let rows = self.rows(s);
        let n = value.len();
        let d: Vec<BigInt> = (0..n)
            .map(|j| {
                let mut with = rows.clone();
                for (row, v) in with.iter_mut().zip(value) {
                    row[j] = BigInt::from(*v);
                }
                determinant(&with)
            })
            .collect();
        let over = BigInt::from(self.sign(s));
        let mut inside = true;
        for i in 0..n {
            let theta = |j: usize| &self.one[i][j] - &self.m[i][j];
            let rate: BigInt = (0..n).map(|j| theta(j) * &d[j]).sum::<BigInt>() * &over;
            if rate.is_zero() {
                return None;
            }
            inside &= rate.is_positive() == (s.piece(i) == 1);
        }
        Some(inside)
    }
}

/// Small integers; with one row a combination of others; the same divided by a number that is no power of two; and that with its last bits
/// changed.
fn matrix(rng: &mut Random, kind: usize) -> Vec<Vec<f64>> {
    let n = 2 + rng.below(3);
    let mut m: Vec<Vec<f64>> = (0..n)
        .map(|_| (0..n).map(|_| rng.below(7) as f64 - 3.0).collect())
        .collect();
    if rng.below(2) == 0 {
        (0..n).for_each(|i| m[i][i] = m[i][i].abs() + 1.0);
    }
    if kind > 0 {
        let (to, from) = (rng.below(n), rng.below(n));
        let factor = rng.below(3) as f64 + 1.0;
        let combined: Vec<f64> = (0..n)
            .map(|j| if to == from { 0.0 } else { factor * m[from][j] } + m[(to + 1) % n][j])
            .collect();
        m[to] = combined;
    }
    if kind > 1 {
        let by = [3.0, 7.0, 10.0][rng.below(3)];
        m.iter_mut().flatten().for_each(|v| *v /= by);
    }
    if kind > 2 {
        let (i, j) = (rng.below(n), rng.below(n));
        m[i][j] *= 1.0 + f64::EPSILON * (rng.below(9) as f64 - 4.0);
    }
    m
}

/// Whether the gradients of x − M x are far enough from linear dependence to prove in floating-point arithmetic that all cells have
/// interior points.
fn all_cells_are_open(m: &[Vec<f64>]) -> bool {
    let n = m.len();
    let row = |i: usize| -> Vec<f64> {
        let theta: Vec<f64> = (0..n).map(|j| f64::from(u8::from(i == j)) - m[i][j]).collect();
        let size = norm(&theta).max(f64::MIN_POSITIVE);
        theta.iter().map(|v| v / size).collect()
    };
    let theta: Vec<Vec<f64>> = (0..n).map(row).collect();
    det_sign(&theta).1 > 1e-3
}

/// All components degenerate at 0.
#[test]
fn verdicts_agree_with_rational_arithmetic() {
    let mut rng = Random::new(17);
    let (mut nearly, mut regular, mut open, mut indices) = (0, 0, 0, 0);
    for k in 0..4000 {
        let m = matrix(&mut rng, k % 4);
        let n = m.len();
        let rational = Rational::new(&m);
        let lcp = Lcp::new(Matrix::from_rows(&m).unwrap(), vec![0.0; n]).unwrap();
        let (map, x) = (lcp.mcp(), vec![0.0; n]);
        let all: Vec<Selection> = (0..1_usize << n)
            .map(|bits| Selection::from_pieces((0..n).map(|i| bits >> i & 1)))
            .collect();
        let signs: Vec<i8> = all.iter().map(|s| rational.sign(s)).collect();
        let p = signs.iter().all(|s| *s == 1);

        let strong = strong_regularity(map, &x, 1e-12, 1000).unwrap();
        assert_eq!((strong.is_regular(), strong.fails()), (p, !p), "{m:?} {strong:?}");

        if !all_cells_are_open(&m) {
            continue;
        }
        let bd = bd_regularity(map, &x, 1e-12, 1000).unwrap();
        match &bd {
            Regularity::Regular { .. } => assert!(signs.iter().all(|s| *s != 0), "{m:?}"),
            Regularity::Fails { combination, .. } => {
                assert_eq!(
                    (combination.len(), rational.sign(&combination[0].0)),
                    (1, 0),
                    "{m:?}"
                );
            }
            other => panic!("{m:?}: {other}"),
        }
        if let Regularity::Regular { singular_value, .. } = bd {
            regular += 1;
            nearly += usize::from(singular_value.unwrap() < 1e-13);
        }
        let orientation = coherent_orientation(map, &x, 1e-12, 1000).unwrap();
        match &orientation {
            CoherentOrientation::Coherent { sign } => assert!(signs.iter().all(|s| s == sign), "{m:?}"),
            CoherentOrientation::Incoherent { first, second } => {
                assert_eq!(
                    [first.1, second.1],
                    [rational.sign(&first.0), rational.sign(&second.0)]
                );
                assert!(first.1 != second.1 || second.1 == 0, "{m:?}");
            }
            other => panic!("{m:?}: {other}"),
        }
        let cd = cd_regularity(map, &x, 1e-12, 1000).unwrap();
        assert!(!(cd.is_regular() && !p || cd.fails() && p), "{m:?} {cd}");
        open += usize::from(!cd.is_regular() && !cd.fails());

        // With all selections regular the index is that of any value without preimages on boundaries of cells.
        if signs.contains(&0) {
            continue;
        }
        let Some(index) = local_index(map, &x, 1e-12, 1000).unwrap() else {
            continue;
        };
        let mut expected = Some(0);
        for (s, sign) in all.iter().zip(&signs) {
            let inside = rational.holds_preimage(s, &[1009, -2003, 3001, 4507][..n]);
            expected = expected
                .zip(inside)
                .map(|(sum, inside)| sum + i64::from(inside) * i64::from(*sign));
        }
        if let Some(expected) = expected {
            assert_eq!(index, expected, "{m:?}");
            indices += 1;
        }
    }
    assert!(
        nearly > 100 && regular > 1000 && indices > 500,
        "{nearly} {regular} {indices}"
    );
    assert_eq!(open, 0);
}

/// A pair of unknowns with a determinant of 2⁻⁵², beside others: decided up to 200 rows, and reported undecided above.
#[test]
fn what_takes_too_long_is_undecided() {
    for (n, decided) in [(200, true), (201, false)] {
        let mut m = Matrix::identity(n);
        m = {
            let mut entries: Vec<(usize, usize, f64)> = m.triplets().collect();
            entries.extend([(0, 1, 1.0), (1, 0, 1.0), (1, 1, f64::EPSILON)]);
            Matrix::from_triplets(n, n, &entries).unwrap()
        };
        let mut q = vec![-1.0; n];
        (q[0], q[1]) = (-2.0, -2.0 - f64::EPSILON);
        let lcp = Lcp::new(m, q).unwrap();
        // Strictly between its bounds everywhere: a single selection.
        let x = vec![1.0; n];
        let rounding = Regularity::Undecided {
            examined: 0,
            doubt: CertificateDoubt::Rounding,
        };
        for found in [
            bd_regularity(lcp.mcp(), &x, 1e-9, 10).unwrap(),
            cd_regularity(lcp.mcp(), &x, 1e-9, 10).unwrap(),
            strong_regularity(lcp.mcp(), &x, 1e-9, 10).unwrap(),
        ] {
            assert_eq!(
                (found.is_regular(), found == rounding),
                (decided, !decided),
                "{n} {found:?}"
            );
        }
        let found = coherent_orientation(lcp.mcp(), &x, 1e-9, 10).unwrap();
        let doubtful = matches!(
            found,
            CoherentOrientation::Doubtful {
                doubt: CertificateDoubt::Rounding,
                ..
            }
        );
        assert_eq!(
            (found == CoherentOrientation::Coherent { sign: 1 }, doubtful),
            (decided, !decided)
        );
        assert_eq!(
            local_index(lcp.mcp(), &x, 1e-9, 10).unwrap(),
            decided.then_some(1)
        );
    }
}
