//! Strong regularity of the solutions of complementarity problems.

use super::natural::{Piece, pieces};
use super::{ComplementarityError, Mcp, McpFunction};
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver, symmetric_eigenvalues};
use crate::piecewise::{
    Between, CertificateDoubt, ExactSigns, PiecewiseError, PiecewiseSmooth, Regularity, Selection,
    active_set, near, singular, square,
};
use crate::sparse::Matrix;
use crate::tolerances::{CHECKED, DENSE, DOUBTFUL};

/// Whether a solution of an MCP is strongly regular: the linearised problem has a unique solution near x, a Lipschitz function of all
/// small perturbations, and so has the problem itself (S. M. Robinson, Strongly regular generalized equations, Math. Oper. Res. 5 (1980)).
///
/// With α the components between their bounds, β the degenerate ones (at a bound, Fᵢ = 0), this holds exactly if ∇F_αα is regular and its
/// Schur complement in ∇F_(α∪β) is a P-matrix (all principal minors positive; Facchinei, Pang (2003), section 5.3). Equivalently all
/// matrices I − D + D ∇F, D diagonal, dᵢ = 1 on α, 0 ≤ dᵢ ≤ 1 on β, 0 elsewhere, are regular. [`Regularity::Fails`] gives a singular one, a
/// mixture of selections of the natural map; where the gradients of xᵢ − Fᵢ on β are linearly independent it is an element of Clarke's
/// generalised Jacobian of that map, else strong regularity requires more than [`cd_regularity`](crate::piecewise::cd_regularity).
///
/// Where F is affine and rounding may decide the sign of a minor, exact arithmetic is used, for up to 200 components and some tenths of a
/// second; beyond that the sign is undecided ([`CertificateDoubt::Rounding`]). Otherwise floating-point numbers decide: ∇F_αα with a reciprocal
/// condition below 1e-11 counts as singular, and quotients of minors below 1e-11 of the terms that cancel in them count as 0, whatever the
/// units of F and x.
///
/// Test functions of the natural map with |θ(x)| ≤ `tolerance` count as vanishing. A parameter keeps its value. That x is a solution is not
/// checked.
///
/// # Complexity
/// A factorisation of order n, |β| solves, and, unless the symmetric part of the Schur complement is definite, at most `cap` principal
/// minors of up to 2^|β| (M. J. Tsatsomeros, L. Li, A recursive test for P-matrices, BIT 40 (2000)).
///
/// # Errors
/// Wrong lengths, values that are not finite, failures of the linear solver other than singularity.
///
/// ```
/// use semismooth::complementarity::{Lcp, strong_regularity};
/// use semismooth::sparse::Matrix;
/// // 0 ≤ x ⟂ M x ≥ 0 at 0, where all components are degenerate.
/// let at_zero = |m: &[[f64; 2]]| {
///     let lcp = Lcp::new(Matrix::from_rows(m)?, vec![0.0; 2])?;
///     Ok::<_, Box<dyn std::error::Error>>(strong_regularity(lcp.mcp(), &[0.0; 2], 1e-12, 1000)?)
/// };
/// assert!(at_zero(&[[1.0, 5.0], [0.0, 1.0]])?.is_regular()); // minors 1, 1, 1
/// assert!(at_zero(&[[1.0, 2.0], [2.0, 1.0]])?.fails()); // determinant −3
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn strong_regularity<F: McpFunction>(
    problem: &Mcp<F>,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Regularity, ComplementarityError> {
    strong((problem.lower(), problem.upper()), problem, x, tolerance, cap)
}

/// As [`strong_regularity`], for the natural map of a problem with these bounds.
pub(super) fn strong(
    (lower, upper): (&[f64], &[f64]),
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Regularity, ComplementarityError> {
    check_vector("the point x", x, map.num_vars())?;
    let active = active_set(map, x, tolerance);
    if let Some(&site) = active.outside().first() {
        return Ok(Regularity::Outside { site });
    }
    let (mut bound, mut interior) = (active.first().clone(), active.first().clone());
    for (site, active_pieces) in active.degenerate_sites() {
        let is_interior = |p: &usize| pieces(lower[*site], upper[*site])[*p] == Piece::Interior;
        // Either bound will do: their rows are the same.
        for piece in active_pieces {
            match is_interior(piece) {
                true => interior.set(*site, *piece),
                false => bound.set(*site, *piece),
            }
        }
    }
    let beta: Vec<usize> = active.degenerate_sites().iter().map(|d| d.0).collect();
    let ends = Ends {
        map,
        x,
        bound,
        interior,
    };
    Ok(ends.decide(&beta, cap)?)
}

/// The natural map at a point, with two selections that differ where components are degenerate.
struct Ends<'a> {
    map: &'a dyn PiecewiseSmooth,
    x: &'a [f64],
    /// With the degenerate components at their bounds.
    bound: Selection,
    /// With the degenerate components between them.
    interior: Selection,
}

impl Ends<'_> {
    fn matrix(&self, selection: &Selection) -> Result<Matrix, PiecewiseError> {
        let mut jac = Matrix::zeros(self.map.pattern());
        self.map.jacobian(selection, self.x, &mut jac);
        match jac.stray() {
            Some((row, col)) => Err(PiecewiseError::StrayEntry { row, col }),
            None => square(&jac),
        }
    }

    fn decide(&self, beta: &[usize], cap: u64) -> Result<Regularity, PiecewiseError> {
        let (base, full) = (self.matrix(&self.bound)?, self.matrix(&self.interior)?);
        let mut exact = ExactSigns::new(self.map, self.x);
        let least = match exact {
            Some(_) => near(base.nrows()),
            None => DOUBTFUL,
        };
        let schur = match schur_complement(&base, &full, beta, least)? {
            Some(schur) => schur,
            None => match exact.as_mut().map(|exact| exact.sign(&self.bound)) {
                None | Some(Some(0)) => return singular(vec![(self.bound.clone(), 1.0)], &base),
                Some(None) => {
                    return Ok(Regularity::Undecided {
                        examined: 0,
                        doubt: CertificateDoubt::Rounding,
                    });
                }
                // Regular, but its inverse is too inaccurate.
                Some(Some(_)) => Schur::unknown(beta.len()),
            },
        };
        let mut sign = None;
        let mut minor = exact.as_mut().map(|exact| {
            move |which: &[usize]| {
                let first = match sign {
                    Some(sign) => sign,
                    None => *sign.insert(exact.sign(&self.bound)?),
                };
                Some(first * exact.sign(&self.between(beta, which))?)
            }
        });
        let minor = minor.as_mut().map(|m| m as &mut ExactMinor<'_>);
        match is_p_matrix(&schur, cap, minor)? {
            Minors::Positive => Ok(Regularity::Regular {
                selections: 1_u64.checked_shl(beta.len() as u32).unwrap_or(u64::MAX),
                singular_value: None,
                weakest: None,
            }),
            Minors::Capped { examined } => Ok(Regularity::Undecided {
                examined,
                doubt: CertificateDoubt::Limit,
            }),
            Minors::Unknown { examined } => Ok(Regularity::Undecided {
                examined,
                doubt: CertificateDoubt::Rounding,
            }),
            Minors::NotPositive(which) => self.singular_one(&base, beta, &which),
        }
    }

    /// The selection with some of β between their bounds.
    fn between(&self, beta: &[usize], which: &[usize]) -> Selection {
        let mut other = self.bound.clone();
        for &k in which {
            other.set(beta[k], self.interior.piece(beta[k]));
        }
        other
    }

    /// The singular matrix on the segment from that with β at its bounds to that with some of β between them; the quotient of their
    /// determinants is a principal minor that is not positive.
    fn singular_one(
        &self,
        base: &Matrix,
        beta: &[usize],
        which: &[usize],
    ) -> Result<Regularity, PiecewiseError> {
        let other = self.between(beta, which);
        let end = self.matrix(&other)?;
        let mut segment = Between::new(base, &end)?;
        // Within rounding of 0 the end itself is singular.
        let share = segment.crossing()?;
        let combination = match share < 1.0 {
            true => vec![(self.bound.clone(), 1.0 - share), (other, share)],
            false => vec![(other, 1.0)],
        };
        singular(combination, segment.at(share))
    }
}

/// The sign of a principal minor of the Schur complement in exact arithmetic, `None` where that takes too long.
type ExactMinor<'a> = dyn FnMut(&[usize]) -> Option<i8> + 'a;

/// A full matrix, row by row.
type Rows = Vec<Vec<f64>>;

/// A Schur complement.
struct Schur {
    rows: Rows,
    /// The sizes of the terms of its entries.
    terms: Rows,
    /// An entry below this part of its terms may be rounding error.
    rounding: f64,
}

impl Schur {
    /// A complement of `size` rows whose entries are not known, as rounding dominates.
    fn unknown(size: usize) -> Self {
        Self {
            rows: vec![vec![0.0; size]; size],
            terms: vec![vec![f64::INFINITY; size]; size],
            rounding: DOUBTFUL,
        }
    }
}

/// ∇F_ββ − ∇F_βα (∇F_αα)⁻¹ ∇F_αβ, row by row: with z the solution of A z = e_j, A the matrix with β at its bounds, its column j is that of
/// the rows β of the other matrix times z. `None` where the reciprocal condition of ∇F_αα is below `least`.
fn schur_complement(
    base: &Matrix,
    full: &Matrix,
    beta: &[usize],
    least: f64,
) -> Result<Option<Schur>, PiecewiseError> {
    let n = base.nrows();
    let mut solver = AutoSolver::default();
    solver.analyze(base.as_ref().pattern)?;
    match solver.factor(base.as_ref()) {
        Ok(()) if solver.rcond().is_some_and(|r| r < least) => return Ok(None),
        Ok(()) => {}
        Err(LinearError::Singular { .. }) => return Ok(None),
        Err(e) => return Err(e.into()),
    }
    let mut schur = vec![vec![0.0; beta.len()]; beta.len()];
    let mut terms = schur.clone();
    let mut sizes = full.clone();
    sizes.values_mut().iter_mut().for_each(|v| *v = v.abs());
    let mut image = vec![0.0; n];
    for (k, &j) in beta.iter().enumerate() {
        let mut z = vec![0.0; n];
        z[j] = 1.0;
        solver.solve_in_place(&mut z)?;
        full.mul_vec(&z, &mut image);
        schur.iter_mut().zip(beta).for_each(|(row, &i)| row[k] = image[i]);
        z.iter_mut().for_each(|v| *v = v.abs());
        sizes.mul_vec(&z, &mut image);
        terms.iter_mut().zip(beta).for_each(|(row, &i)| row[k] = image[i]);
    }
    let rounding = 16.0 * n as f64 * f64::EPSILON / solver.rcond().unwrap_or(1.0);
    Ok(Some(Schur {
        rows: schur,
        terms,
        rounding: rounding.max(DOUBTFUL),
    }))
}

/// Signs of the principal minors of a matrix.
#[derive(Debug, PartialEq)]
enum Minors {
    Positive,
    /// The minor of these rows and columns is not positive, up to rounding where there is no exact arithmetic.
    NotPositive(Vec<usize>),
    /// Exact arithmetic takes too long.
    Unknown {
        examined: u64,
    },
    Capped {
        examined: u64,
    },
}

/// The indices left to choose from, the Schur complement on them with the errors of its entries in units of rounding, and the indices
/// chosen.
struct Node {
    left: Vec<usize>,
    a: Vec<f64>,
    errors: Vec<f64>,
    chosen: Vec<usize>,
}

/// What is known of the sign of a minor.
#[derive(PartialEq)]
enum Judged {
    Positive,
    /// Positive by exact arithmetic: its floating-point value is dominated by rounding.
    ExactlyPositive,
    NotPositive,
    Unknown,
}

/// Judges a minor by `pivot`, its quotient with a positive minor, whose rounding error is relative to `terms`.
fn judge(
    pivot: f64,
    terms: f64,
    rounding: f64,
    which: &[usize],
    exact: Option<&mut ExactMinor<'_>>,
) -> Judged {
    // NaN is not positive.
    match exact {
        _ if pivot > rounding * terms => Judged::Positive,
        Some(exact) if pivot.is_nan() || pivot >= -rounding * terms => match exact(which) {
            Some(1) => Judged::ExactlyPositive,
            Some(_) => Judged::NotPositive,
            None => Judged::Unknown,
        },
        _ => Judged::NotPositive,
    }
}

/// Whether a matrix is a P-matrix; exact arithmetic, where there is any, decides where rounding may.
fn is_p_matrix(
    Schur {
        rows,
        terms,
        rounding,
    }: &Schur,
    cap: u64,
    mut exact: Option<&mut ExactMinor<'_>>,
) -> Result<Minors, PiecewiseError> {
    let p = rows.len();
    // Without exact arithmetic, values that may be rounding errors count as 0.
    let rounding = match exact {
        Some(_) => *rounding,
        None => DOUBTFUL,
    };
    let mut clear = true;
    for i in 0..p {
        let which = [i];
        match judge(rows[i][i], terms[i][i], rounding, &which, exact.as_deref_mut()) {
            Judged::Positive => {}
            Judged::ExactlyPositive => clear = false,
            Judged::NotPositive => return Ok(Minors::NotPositive(which.to_vec())),
            Judged::Unknown => return Ok(Minors::Unknown { examined: 0 }),
        }
    }
    if clear && p <= DENSE && p > 0 && has_definite_part(rows, terms, rounding)? {
        return Ok(Minors::Positive);
    }
    let mut stack = vec![Node {
        left: (0..p).collect(),
        a: rows.concat(),
        errors: terms.concat(),
        chosen: Vec::new(),
    }];
    let mut examined = 0;
    while let Some(Node {
        left,
        a,
        errors: e,
        chosen,
    }) = stack.pop()
    {
        let Some((&first, others)) = left.split_first() else {
            continue;
        };
        if examined == cap {
            return Ok(Minors::Capped { examined });
        }
        examined += 1;
        let k = left.len();
        let mut with = chosen.clone();
        with.push(first);
        // The quotient of the minor with `first` and the one without.
        let judged = judge(a[0], e[0], rounding, &with, exact.as_deref_mut());
        match judged {
            Judged::Positive | Judged::ExactlyPositive => {}
            Judged::NotPositive => return Ok(Minors::NotPositive(with)),
            Judged::Unknown => return Ok(Minors::Unknown { examined }),
        }
        let without = (1..k).flat_map(|i| (1..k).map(move |j| (i, j)));
        let part = |v: &[f64]| without.clone().map(|(i, j)| v[i * k + j]).collect();
        stack.push(Node {
            left: others.to_vec(),
            a: part(&a),
            errors: part(&e),
            chosen,
        });
        let (a, errors) = match judged {
            Judged::Positive => eliminated(&a, &e, k),
            _ => (
                vec![0.0; (k - 1) * (k - 1)],
                vec![f64::INFINITY; (k - 1) * (k - 1)],
            ),
        };
        stack.push(Node {
            left: others.to_vec(),
            a,
            errors,
            chosen: with,
        });
    }
    Ok(Minors::Positive)
}

/// A matrix of k rows after the elimination of the first, and the errors of its entries, from those before.
fn eliminated(a: &[f64], e: &[f64], k: usize) -> (Vec<f64>, Vec<f64>) {
    let pivot = a[0];
    let left = (1..k).flat_map(|i| (1..k).map(move |j| (i, j)));
    let factor = |i: usize| a[i * k] / pivot;
    let reduced = |(i, j): (usize, usize)| a[i * k + j] - factor(i) * a[j];
    let error = |(i, j): (usize, usize)| {
        let (l, u) = (factor(i).abs(), a[j].abs());
        e[i * k + j] + l * (e[j] + u) + (e[i * k] + l * e[0]) * u / pivot
    };
    (left.clone().map(reduced).collect(), left.map(error).collect())
}

/// Whether the symmetric part is definite, the diagonal scaled to 1: positive factors of rows and columns leave signs of minors as they
/// are.
fn has_definite_part(rows: &Rows, terms: &Rows, rounding: f64) -> Result<bool, PiecewiseError> {
    let p = rows.len();
    let scaled = |m: &Rows, i: usize, j: usize| m[i][j] / rows[i][i].sqrt() / rows[j][j].sqrt();
    let entry = |i: usize, j: usize| scaled(rows, i, j);
    // Row and column together bound the rounding error of the symmetric part.
    let error = |i: usize| {
        let pair = |j: usize| 0.5 * (scaled(terms, i, j) + scaled(terms, j, i));
        rounding * (0..p).map(pair).sum::<f64>()
    };
    let error = (0..p).map(error).fold(0.0, f64::max);
    let mean = |i: usize, j: usize| 0.5 * (entry(i, j) + entry(j, i));
    let mean: Rows = (0..p).map(|i| (0..p).map(|j| mean(i, j)).collect()).collect();
    let Ok(symmetric) = Matrix::from_rows(&mean) else {
        return Ok(false);
    };
    let values = symmetric_eigenvalues(&symmetric)?;
    Ok(values[0] > CHECKED * values[p - 1] + error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schur(m: &[Vec<f64>]) -> Schur {
        let sizes = |row: &Vec<f64>| row.iter().map(|v| v.abs()).collect();
        Schur {
            rows: m.to_vec(),
            terms: m.iter().map(sizes).collect(),
            rounding: DOUBTFUL,
        }
    }

    /// Entries that are off by no more than their errors, in units of rounding, move those of the eliminated matrix by no more than theirs,
    /// and in some case by nearly as much.
    #[test]
    fn errors_of_eliminated_entries_are_bounds() {
        const UNIT: f64 = 1e-9;
        let mut random = crate::spread::Random::new(7);
        let k = 4;
        let mut nearest = 0.0_f64;
        for _ in 0..300 {
            let mut a: Vec<f64> = (0..k * k).map(|_| random.symmetric()).collect();
            a[0] = 1.0 + random.symmetric().abs();
            let e: Vec<f64> = (0..k * k).map(|_| 1e3 * random.symmetric().abs()).collect();
            let (reduced, errors) = eliminated(&a, &e, k);
            for _ in 0..8 {
                let moved: Vec<f64> = (a.iter().zip(&e))
                    .map(|(a, e)| a + UNIT * e * random.symmetric().signum())
                    .collect();
                let (other, _) = eliminated(&moved, &e, k);
                for ((r, o), bound) in reduced.iter().zip(&other).zip(&errors) {
                    assert!((r - o).abs() <= 1.0001 * UNIT * bound, "{r} {o} {bound:e}");
                    nearest = nearest.max((r - o).abs() / (UNIT * bound));
                }
            }
        }
        assert!(nearest > 0.7, "{nearest}");
    }

    /// Against all minors, by Leibniz' formula: matrices of small integers, some of whose minors vanish.
    #[test]
    fn p_matrices_are_those_with_positive_minors() {
        let det = |m: &[Vec<f64>], s: &[usize]| match *s {
            [i] => m[i][i],
            [i, j] => m[i][i] * m[j][j] - m[i][j] * m[j][i],
            _ => {
                let term = |p: [usize; 3]| m[0][p[0]] * m[1][p[1]] * m[2][p[2]];
                term([0, 1, 2]) + term([1, 2, 0]) + term([2, 0, 1])
                    - term([0, 2, 1])
                    - term([1, 0, 2])
                    - term([2, 1, 0])
            }
        };
        let subsets: [&[usize]; 7] = [&[0], &[1], &[2], &[0, 1], &[0, 2], &[1, 2], &[0, 1, 2]];
        let mut random = crate::spread::Random::new(5);
        let (mut positive, mut other) = (0, 0);
        for _ in 0..3000 {
            let mut m: Vec<Vec<f64>> = (0..3)
                .map(|_| (0..3).map(|_| random.below(7) as f64 - 3.0).collect())
                .collect();
            (0..3).for_each(|i| m[i][i] = 1.0 + random.below(3) as f64);
            match is_p_matrix(&schur(&m), 100, None).unwrap() {
                Minors::Positive => {
                    positive += 1;
                    assert!(subsets.iter().all(|s| det(&m, s) > 0.0), "{m:?}");
                }
                Minors::NotPositive(mut which) => {
                    other += 1;
                    which.sort_unstable();
                    assert!(det(&m, &which) <= 0.0, "{m:?} {which:?}");
                }
                capped => panic!("{capped:?}"),
            }
        }
        assert!(positive > 100 && other > 100, "{positive} {other}");
    }

    #[test]
    fn long_lists_of_minors_are_cut() {
        // Cyclic, with a symmetric part that is not definite: 1 and 5 in a circle of odd length.
        let m: Vec<Vec<f64>> = (0..15)
            .map(|i| {
                (0..15)
                    .map(|j| [0.0, 1.0, 5.0][usize::from(j == i) + 2 * usize::from(j == (i + 1) % 15)])
                    .collect()
            })
            .collect();
        assert_eq!(is_p_matrix(&schur(&m), 40_000, None).unwrap(), Minors::Positive);
        assert_eq!(
            is_p_matrix(&schur(&m), 100, None).unwrap(),
            Minors::Capped { examined: 100 }
        );
    }

    /// A diagonal entry is dominated by rounding, and exact arithmetic takes too long: the sign is not computed again and left unknown.
    #[test]
    fn what_exact_arithmetic_leaves_open_is_unknown() {
        for m in [[[0.0, 0.5], [0.5, 1.0]], [[1.0, 0.5], [0.5, 0.0]]] {
            let mut asked = 0;
            let mut late = |_: &[usize]| {
                asked += 1;
                None
            };
            let found = is_p_matrix(&schur(&m.map(|row| row.to_vec())), 100, Some(&mut late)).unwrap();
            assert_eq!((found, asked), (Minors::Unknown { examined: 0 }, 1), "{m:?}");
        }
    }
}
