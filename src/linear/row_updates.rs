use super::memory::check_finite;
use super::row_inverse::RowInverse;
use super::updated_factors::UpdatedFactors;
use super::{Bordered, LinearError, LinearSolver};
use crate::sparse::{Matrix, dot};
use crate::tolerances::{CHECKED, ROUNDING};

/// Change of the determinant below which an update would lose too many digits.
const SMALL_PIVOT: f64 = 1e-7;
/// Updates after which an inverse is recomputed, at least; as many updates as rows cost as much as recomputing it.
const MAX_UPDATES: usize = 100;

/// Most rows that differ from those of hierarchical factors.
const HIERARCHICAL: usize = 160;

/// A matrix ∇H that need not be stored.
pub(crate) trait RowSource {
    /// Adds `scale` times row i to `out`; the largest modulus in the row.
    fn add_row(&mut self, scale: f64, i: usize, out: &mut [f64]) -> f64;

    /// Adds the product with x to `out`.
    fn add_product(&mut self, x: &[f64], out: &mut [f64]);
}

impl RowSource for &Matrix {
    fn add_row(&mut self, scale: f64, i: usize, out: &mut [f64]) -> f64 {
        let full = self.pattern().is_full().then(|| self.values());
        let mut size = 0.0_f64;
        for (j, out) in out.iter_mut().enumerate() {
            let v = match full {
                Some(values) => values[j * self.nrows() + i],
                None => self.get(i, j),
            };
            size = size.max(v.abs());
            *out += scale * v;
        }
        size
    }

    fn add_product(&mut self, x: &[f64], out: &mut [f64]) {
        Matrix::as_ref(self).mul_add(1.0, x, out);
    }
}

/// Most rows that differ from those of sparse factors.
const SPARSE: usize = 64;

/// Solves with [∇H; tᵀ] while rows of ∇H are replaced.
///
/// A change of the piece at one site replaces the few rows of that site: O(n²) operations a row instead of a factorisation.
/// Every update is checked by the residual of the tangent it gives.
#[derive(Debug, Clone)]
pub(crate) struct RowUpdates {
    border: Vec<f64>,
    /// Sign and logarithm of |det [∇H; tᵀ]|.
    det: (i8, f64),
    tangent: Vec<f64>,
    /// Largest modulus in each row of ∇H.
    sizes: Vec<f64>,
    /// The rows that are about to be replaced, negative.
    old: Vec<f64>,
    residual: Vec<f64>,
    updates: usize,
    /// Residual of the tangent up to which it is not refined.
    sharp: f64,
    kept: Kept,
}

#[derive(Debug, Clone)]
enum Kept {
    Inverse(RowInverse),
    Factors(Box<UpdatedFactors>),
}

impl RowUpdates {
    /// Starts with the system factored in `bordered`, bordered by its tangent. Keeps its inverse, or else uses the factors in `bordered`.
    /// `None` without determinants.
    pub(crate) fn new<L: LinearSolver>(
        jacobian: &Matrix,
        bordered: &mut Bordered<L>,
        keep_inverse: bool,
    ) -> Result<Option<Self>, LinearError> {
        let Some(det) = bordered.log_det() else {
            return Ok(None);
        };
        let mut sizes = vec![0.0; jacobian.nrows()];
        jacobian.as_ref().raise_to_largest(&mut sizes);
        let kept = if keep_inverse {
            Kept::Inverse(RowInverse::new(bordered)?)
        } else {
            let entries = jacobian.nrows() * jacobian.ncols();
            // More rows than these cost as much as a new factorisation, or fill more memory than sparse factors.
            let eighth = jacobian.ncols() / 8;
            let sparse = jacobian.pattern().nnz() < entries / 4;
            let limit = if sparse { eighth.min(SPARSE) } else { eighth }.max(16);
            Kept::Factors(Box::new(UpdatedFactors::new(bordered, det, limit)))
        };
        Ok(Some(Self::with(bordered.tangent(), det, sizes, kept)))
    }

    /// Starts with the system that the hierarchical factors in `bordered` solve, with the sizes of its rows; `None` where its kernel is not
    /// that of `source` to the accuracy wanted of updates.
    pub(crate) fn of_factors<L: LinearSolver>(
        source: &mut dyn RowSource,
        sizes: Vec<f64>,
        bordered: &mut Bordered<L>,
    ) -> Result<Option<Self>, LinearError> {
        let Some(det) = bordered.log_det() else {
            return Ok(None);
        };
        let kept = Kept::Factors(Box::new(UpdatedFactors::new(bordered, det, HIERARCHICAL)));
        let mut found = Self::with(bordered.tangent(), det, sizes, kept);
        found.sharp = ROUNDING;
        Ok(found.refine(source, bordered)?.then_some(found))
    }

    fn with(border: &[f64], det: (i8, f64), sizes: Vec<f64>, kept: Kept) -> Self {
        Self {
            tangent: border.to_vec(),
            border: border.to_vec(),
            det,
            residual: sizes.clone(),
            sizes,
            old: Vec::new(),
            updates: 0,
            sharp: 0.0,
            kept,
        }
    }

    /// Whether the factors with which it started must be kept.
    pub(crate) fn relies_on_factors(&self) -> bool {
        matches!(self.kept, Kept::Factors(_))
    }

    /// Stores rows of the present Jacobian before they are replaced.
    pub(crate) fn note(&mut self, source: &mut dyn RowSource, rows: &[usize]) {
        let m = self.border.len();
        self.old.clear();
        self.old.resize(rows.len() * m, 0.0);
        for (old, &i) in self.old.chunks_exact_mut(m).zip(rows) {
            source.add_row(-1.0, i, old);
        }
    }

    /// Replaces the rows stored by [`note`](Self::note) by those of `source`; false when the result and all that is kept cannot be
    /// trusted.
    pub(crate) fn replace<L: LinearSolver>(
        &mut self,
        source: &mut dyn RowSource,
        rows: &[usize],
        bordered: &mut Bordered<L>,
    ) -> Result<bool, LinearError> {
        let m = self.border.len();
        self.updates += 1;
        for (change, &i) in self.old.chunks_exact_mut(m).zip(rows) {
            self.sizes[i] = source.add_row(1.0, i, change);
            let Kept::Inverse(inverse) = &mut self.kept else {
                continue;
            };
            if change.iter().all(|d| *d == 0.0) {
                continue;
            }
            let Some(factor) = inverse.add_to_row(i, change) else {
                return Ok(false);
            };
            self.det = times(self.det, factor);
            if self.updates > MAX_UPDATES.max(m) {
                return Ok(false);
            }
        }
        match &mut self.kept {
            Kept::Inverse(inverse) => self.tangent.copy_from_slice(inverse.kernel()),
            Kept::Factors(factors) => {
                if !factors.add_to_rows(rows, &self.old, bordered)? {
                    return Ok(false);
                }
                let Some(det) = factors.factor() else {
                    return Ok(false);
                };
                if is_far_from_one((det.1 - self.det.1).exp()) {
                    return Ok(false);
                }
                self.det = det;
                factors.kernel(&mut self.tangent);
            }
        }
        Ok(self.normalise() && self.refine(source, bordered)?)
    }

    fn normalise(&mut self) -> bool {
        let length = dot(&self.tangent, &self.tangent).sqrt();
        self.tangent.iter_mut().for_each(|t| *t /= length);
        length.is_finite() && length > 0.0
    }

    /// One step of iterative refinement of the tangent; false when its residual shows that the updates have become inaccurate.
    fn refine<L: LinearSolver>(
        &mut self,
        source: &mut dyn RowSource,
        bordered: &mut Bordered<L>,
    ) -> Result<bool, LinearError> {
        self.residual.fill(0.0);
        source.add_product(&self.tangent, &mut self.residual);
        if self.is_within(self.sharp) {
            return Ok(true);
        }
        match &mut self.kept {
            Kept::Inverse(inverse) => inverse.correct(&self.residual, &mut self.tangent),
            Kept::Factors(factors) => factors.correct(&self.residual, &mut self.tangent, bordered)?,
        }
        Ok(self.is_within(CHECKED) && self.normalise())
    }

    /// Whether the residual is at most this share of each row. Written so that NaN fails.
    fn is_within(&self, share: f64) -> bool {
        let mut pairs = self.residual.iter().zip(&self.sizes);
        pairs.all(|(r, size)| r.abs() <= share * size)
    }

    /// The unit kernel vector of ∇H; det [∇H; τᵀ] and the border fix its sign.
    pub(crate) fn tangent(&self) -> &[f64] {
        &self.tangent
    }

    /// x ← x − [∇H; tᵀ]⁻¹ [r; 0].
    pub(crate) fn correct<L: LinearSolver>(
        &mut self,
        r: &[f64],
        x: &mut [f64],
        bordered: &mut Bordered<L>,
    ) -> Result<(), LinearError> {
        match &mut self.kept {
            Kept::Inverse(inverse) => inverse.correct(r, x),
            Kept::Factors(factors) => factors.correct(r, x, bordered)?,
        }
        Ok(())
    }

    /// x with ∇H x = r across v.
    pub(crate) fn solve_across<L: LinearSolver>(
        &mut self,
        r: &[f64],
        v: &[f64],
        x: &mut [f64],
        bordered: &mut Bordered<L>,
    ) -> Result<(), LinearError> {
        x.fill(0.0);
        self.correct(r, x, bordered)?;
        let shift = dot(v, x) / dot(v, &self.tangent);
        (x.iter_mut().zip(&self.tangent)).for_each(|(x, t)| *x = shift * t - *x);
        check_finite(x, "").map_err(|_| LinearError::Singular { rcond: 0.0 })
    }

    /// Sign of det [∇H; vᵀ]: that of [∇H; tᵀ] is known, and both are proportional to the component along the kernel.
    pub(crate) fn orientation(&self, v: &[f64]) -> i8 {
        let along = |w: &[f64]| dot(w, &self.tangent);
        let product = along(v) * along(&self.border);
        if product == 0.0 {
            0
        } else if product > 0.0 {
            self.det.0
        } else {
            -self.det.0
        }
    }

    /// Logarithm of |det [∇H; τᵀ]|, with the unit tangent as border.
    pub(crate) fn log_det(&self) -> f64 {
        let along = dot(&self.border, &self.tangent);
        self.det.1 - along.abs().ln()
    }
}

pub(super) fn is_far_from_one(factor: f64) -> bool {
    !factor.is_finite() || factor.abs() < SMALL_PIVOT || factor.abs() > 1.0 / SMALL_PIVOT
}

fn times((sign, log): (i8, f64), factor: f64) -> (i8, f64) {
    let sign = if factor < 0.0 { -sign } else { sign };
    (sign, log + factor.abs().ln())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::AutoSolver;
    use crate::spread::Random;

    /// After each change of a row both kinds agree with new factors: kernel, determinant with its sign, and solutions.
    #[test]
    fn updates_agree_with_factors_made_anew() {
        const N: usize = 24;
        let mut random = Random::new(5);
        let mut draw = || random.symmetric();
        let rows: Vec<Vec<f64>> = (0..N).map(|_| (0..=N).map(|_| draw()).collect()).collect();
        let first = Matrix::from_rows(&rows).unwrap();
        let mut signs = std::collections::BTreeSet::new();
        for keep_inverse in [true, false] {
            let mut bordered = Bordered::new(first.pattern(), AutoSolver::new()).unwrap();
            bordered.factor(&first, None).unwrap();
            let mut updates = RowUpdates::new(&first, &mut bordered, keep_inverse)
                .unwrap()
                .unwrap();
            assert_eq!(updates.relies_on_factors(), !keep_inverse);
            let (mut rows, mut jacobian) = (rows.clone(), first.clone());
            let (mut replaced, mut refused) = (0, false);
            for k in 0..40 {
                // Rows change more than once.
                let changed = [(5 * k) % 18, 18 + k % 2];
                updates.note(&mut &jacobian, &changed);
                for i in changed {
                    rows[i].iter_mut().for_each(|v| *v += draw());
                }
                jacobian = Matrix::from_rows(&rows).unwrap();
                if updates.replace(&mut &jacobian, &changed, &mut bordered) != Ok(true) {
                    refused = true;
                    break;
                }
                replaced += 1;
                let mut anew = Bordered::new(first.pattern(), AutoSolver::new()).unwrap();
                anew.factor(&jacobian, None).unwrap();
                let t = anew.tangent();
                let same = dot(t, updates.tangent());
                assert!((same.abs() - 1.0).abs() < 1e-13, "{k}: {same}");
                assert_eq!(updates.orientation(t), 1);
                signs.insert(same > 0.0);
                assert!((updates.log_det() - anew.log_det().unwrap().1).abs() < 1e-10);
                let r: Vec<f64> = (0..N).map(|_| draw()).collect();
                let v: Vec<f64> = (0..=N).map(|_| draw()).collect();
                let (mut x, mut expected) = (vec![0.0; N + 1], vec![0.0; N + 1]);
                updates.solve_across(&r, &v, &mut x, &mut bordered).unwrap();
                anew.solve(&r, &v, 0.0, &mut expected).unwrap();
                let size = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                assert!(x.iter().zip(&expected).all(|(x, e)| (x - e).abs() < 1e-9 * size));
            }
            // The factors are used while at most 16 rows differ.
            let expected = if keep_inverse { (40, false) } else { (14, true) };
            assert_eq!((replaced, refused), expected);
        }
        assert_eq!(signs.len(), 2);
    }

    /// A change that makes ∇H singular, or nearly so, is refused, and so is one of a row that was not noted.
    #[test]
    fn changes_that_cannot_be_trusted_are_refused() {
        let first = [[2.0, 1.0, 0.5], [1.0, 3.0, 0.25]];
        for keep_inverse in [true, false] {
            for (rows, trusted) in [
                ([first[0], [1.5, 2.0, 0.25]], true),
                ([first[0], [0.0; 3]], false),
                ([first[0], [4.0, 2.0, 1.0]], false),
                ([first[0], [4.0, 2.0, 1.0 + 1e-9]], false),
                ([[2.0, 1.1, 0.5], [1.5, 2.0, 0.25]], false),
            ] {
                let before = Matrix::from_rows(&first).unwrap();
                let mut bordered = Bordered::new(before.pattern(), AutoSolver::new()).unwrap();
                bordered.factor(&before, None).unwrap();
                let updates = RowUpdates::new(&before, &mut bordered, keep_inverse);
                let mut updates = updates.unwrap().unwrap();
                updates.note(&mut &before, &[1]);
                let after = Matrix::from_rows(&rows).unwrap();
                assert_eq!(
                    updates.replace(&mut &after, &[1], &mut bordered),
                    Ok(trusted),
                    "{rows:?}"
                );
            }
        }
    }
}
