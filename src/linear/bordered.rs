use super::condition::arg_max_abs;
use super::memory::check_finite;
use super::{AutoSolver, DENSE_LIMIT, LinearError, LinearSolver, null_space};
use crate::input::check_length;
use crate::sparse::{Matrix, MatrixRef, Pattern, PatternRef, dot, norm};
use crate::tolerances::{LEFT, RESULT};

/// The frozen coordinate is kept while its share of the hint is at least this, to save a symbolic analysis.
const KEEP: f64 = 0.01;

/// Entries of the kernel vector above this (frozen coordinate 1) show a poor choice of k for small systems …
const POOR_SMALL: f64 = 1e4;

/// … and for large ones, where another choice costs a symbolic analysis.
const POOR_LARGE: f64 = 1e7;

/// The bordered systems of continuation, `[∇H; tᵀ] x = [r; c]` with ∇H of n rows and n + 1 columns, without a dense row ever
/// being stored.
///
/// One column k of ∇H is left out (its coordinate is *frozen*), the square rest M_k is factored, and the solution is the
/// combination of a particular one with x_k = 0 and the kernel vector with v_k = 1. This works wherever ∇H has full rank, also
/// where ∇_yH (∇H without its last column) is singular: at folds and on vertical segments.
///
/// ```
/// use semismooth::linear::{AutoSolver, Bordered};
/// use semismooth::sparse::Matrix;
/// let jacobian = Matrix::from_rows(&[[0.0, 2.0]])?; // a fold: ∂H/∂y = 0
/// let mut bordered = Bordered::new(jacobian.pattern(), AutoSolver::new())?;
/// bordered.factor(&jacobian, None)?;
/// assert_eq!(bordered.det_sign(), Some(0));
/// let (t, mut x) = ([1.0, 0.0], [0.0; 2]);
/// bordered.solve(&[4.0], &t, 3.0, &mut x)?;
/// assert_eq!(x, [3.0, 2.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Bordered<L = AutoSolver> {
    solver: L,
    pattern: Pattern,
    frozen: usize,
    /// M_k, where k is not the last column; else it is a prefix of the Jacobian.
    rest: Rest,
    tangent: Vec<f64>,
    work: Vec<f64>,
    /// Sign and logarithm of |det [∇H; τᵀ]| with the sign that the solver's determinant gives to v_k = 1.
    log_det: Option<(i8, f64)>,
    factored: bool,
    factorisations: usize,
}

#[derive(Debug, Clone, Default)]
struct Rest {
    of: Option<usize>,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
}

impl Rest {
    /// Leaves column `k` out of `a`; index work is done only when `k` is new.
    fn extract(&mut self, a: MatrixRef<'_>, k: usize) -> MatrixRef<'_> {
        let p = a.pattern;
        let (start, end) = (p.col_ptr[k], p.col_ptr[k + 1]);
        if self.of != Some(k) {
            self.col_ptr.clear();
            self.col_ptr.extend_from_slice(&p.col_ptr[..=k]);
            let later = p.col_ptr[k + 2..].iter().map(|c| c - (end - start));
            self.col_ptr.extend(later);
            self.row_idx.clear();
            self.row_idx.extend_from_slice(&p.row_idx[..start]);
            self.row_idx.extend_from_slice(&p.row_idx[end..]);
            self.of = Some(k);
        }
        self.values.clear();
        self.values.extend_from_slice(&a.values[..start]);
        self.values.extend_from_slice(&a.values[end..]);
        MatrixRef {
            pattern: PatternRef {
                nrows: p.nrows,
                ncols: p.ncols - 1,
                col_ptr: &self.col_ptr,
                row_idx: &self.row_idx,
            },
            values: &self.values,
        }
    }
}

impl<L: LinearSolver> Bordered<L> {
    /// A workspace for Jacobians over `pattern` (n rows, n + 1 columns).
    ///
    /// # Errors
    /// [`InputError::Length`](crate::InputError::Length) unless there is exactly one column more than rows; errors of `solver`.
    pub fn new(pattern: &Pattern, mut solver: L) -> Result<Self, LinearError> {
        let n = pattern.nrows();
        check_length("a row of the Jacobian", pattern.ncols(), n + 1)?;
        solver.analyze(pattern.leading_columns(n))?;
        let rest = Rest {
            values: Vec::with_capacity(pattern.nnz()),
            ..Rest::default()
        };
        Ok(Self {
            solver,
            pattern: pattern.clone(),
            frozen: n,
            rest,
            tangent: vec![0.0; n + 1],
            work: vec![0.0; n],
            log_det: None,
            factored: false,
            factorisations: 0,
        })
    }

    /// The system with the last coordinate frozen, whose other columns `solver` has factored; `last` is the last one.
    ///
    /// # Errors
    /// [`LinearError::Singular`] where another coordinate should be frozen; errors of the solver.
    pub(crate) fn of_factors(pattern: &Pattern, mut solver: L, last: &[f64]) -> Result<Self, LinearError> {
        let mut work: Vec<f64> = last.iter().map(|v| -v).collect();
        solver.solve_in_place(&mut work)?;
        let mut tangent = work.clone();
        tangent.push(1.0);
        let largest = tangent[arg_max_abs(&tangent)].abs();
        if largest.is_nan() || largest > POOR_LARGE {
            return Err(LinearError::Singular {
                rcond: largest.recip(),
            });
        }
        let mut found = Self {
            solver,
            pattern: pattern.clone(),
            frozen: last.len(),
            rest: Rest::default(),
            tangent,
            work,
            log_det: None,
            factored: false,
            factorisations: 1,
        };
        found.finish();
        Ok(found)
    }

    /// Factors ∇H. `hint` is an approximate tangent (length n + 1) from which the frozen coordinate is chosen.
    ///
    /// # Complexity
    /// One factorisation of the solver and one solve, more only where the choice of k was poor. Large systems
    /// (n > [`DENSE_LIMIT`]) keep k as long as it is not poor, so that the symbolic analysis is reused.
    ///
    /// # Errors
    /// [`LinearError::Kernel`] when ∇H has not full rank, [`LinearError::NotFinite`], [`LinearError::NotAnalyzed`] when the
    /// Jacobian lies over another pattern, and errors of the solver.
    pub fn factor(&mut self, jacobian: &Matrix, hint: Option<&[f64]>) -> Result<(), LinearError> {
        self.factored = false;
        self.log_det = None;
        let n = self.pattern.nrows();
        if *jacobian.pattern() != self.pattern {
            return Err(LinearError::NotAnalyzed);
        }
        check_finite(jacobian.values(), "the Jacobian")?;
        if let Some(hint) = hint {
            check_length("the hint", hint.len(), n + 1)?;
            check_finite(hint, "the hint")?;
        }
        let hint = hint.filter(|h| h.iter().any(|v| *v != 0.0));
        let small = n <= DENSE_LIMIT;
        let k = match hint {
            None if small => n,
            None => self.frozen,
            Some(h) => {
                let best = arg_max_abs(h);
                let keep = !small && h[self.frozen].abs() >= KEEP * h[best].abs();
                if keep { self.frozen } else { best }
            }
        };
        match self.attempt(jacobian, k) {
            Ok(()) => {}
            Err(e) if !may_be_choice(&e) => return Err(e),
            Err(_) if small => self.attempt_by_kernel(jacobian)?,
            Err(_) => self.attempt_others(jacobian, k, hint)?,
        }
        let best = arg_max_abs(&self.tangent);
        let poor = if small { POOR_SMALL } else { POOR_LARGE };
        if self.tangent[best].abs() > poor {
            self.attempt(jacobian, best)?;
        }
        self.finish();
        Ok(())
    }

    /// Factors M_k and finds the kernel vector with v_k = 1 (into `tangent`).
    fn attempt(&mut self, jacobian: &Matrix, k: usize) -> Result<(), LinearError> {
        let n = self.pattern.nrows();
        let m = if k == n {
            jacobian.leading_columns(n)
        } else {
            self.rest.extract(jacobian.as_ref(), k)
        };
        self.frozen = k;
        self.solver.analyze(m.pattern)?;
        self.factorisations += 1;
        self.solver.factor(m)?;
        self.work.fill(0.0);
        let (start, end) = (self.pattern.col_ptr()[k], self.pattern.col_ptr()[k + 1]);
        for e in start..end {
            self.work[self.pattern.row_idx()[e]] = -jacobian.values()[e];
        }
        self.solver.solve_in_place(&mut self.work)?;
        insert(&self.work, k, 1.0, &mut self.tangent);
        check_finite(&self.tangent, "").map_err(|_| LinearError::Singular { rcond: 0.0 })
    }

    /// Takes k from the kernel of the equilibrated Jacobian, found densely.
    fn attempt_by_kernel(&mut self, jacobian: &Matrix) -> Result<(), LinearError> {
        let equilibrated = equilibrate(jacobian);
        let kernel = null_space(&equilibrated, LEFT)?.right;
        let [v] = kernel.as_slice() else {
            return Err(LinearError::Kernel {
                expected: 1,
                found: kernel.len(),
            });
        };
        self.attempt(jacobian, arg_max_abs(v)).map_err(not_full_rank)
    }

    /// Tries a few more coordinates; if M_k is singular for all of them, it is almost certainly singular for all k.
    fn attempt_others(
        &mut self,
        jacobian: &Matrix,
        tried: usize,
        hint: Option<&[f64]>,
    ) -> Result<(), LinearError> {
        let n = self.pattern.nrows();
        let mut others = vec![n, 0, n / 2, n / 3];
        if let Some(h) = hint {
            others.insert(0, arg_max_abs(h));
        }
        let mut done = vec![tried];
        for k in others {
            if done.contains(&k) {
                continue;
            }
            done.push(k);
            match self.attempt(jacobian, k) {
                Err(e) if may_be_choice(&e) => {}
                result => return result,
            }
        }
        Err(LinearError::Kernel {
            expected: 1,
            found: 2,
        })
    }

    /// Normalises and signs the kernel vector.
    fn finish(&mut self) {
        let n = self.pattern.nrows();
        let k = self.frozen;
        // Scaled by its largest entry first, so that squares do not overflow.
        let largest = self.tangent[arg_max_abs(&self.tangent)].abs();
        let squares: f64 = (self.tangent.iter()).map(|v| (v / largest).powi(2)).sum();
        let norm = largest * squares.sqrt();
        // With c = det [∇H; τᵀ]: c τ_k = (-1)^(n+k) det M_k, and τ is signed for c > 0.
        let mut sign = 1.0;
        if let Some((det, log)) = self.solver.log_det() {
            let minor = if (n + k).is_multiple_of(2) { det } else { -det };
            if minor < 0 {
                sign = -1.0;
            }
            self.log_det = Some((1, log + norm.ln()));
        }
        let factor = sign / norm;
        self.tangent.iter_mut().for_each(|v| *v *= factor);
        self.factored = true;
    }

    /// Brings the tangent nearer to that of a Jacobian which differs little from the factored one, by a step of refinement with the present
    /// factors; returns the length of that step.
    pub(crate) fn refine_tangent(&mut self, jacobian: &Matrix) -> Result<f64, LinearError> {
        self.work.fill(0.0);
        jacobian.as_ref().mul_add(1.0, &self.tangent, &mut self.work);
        self.solver.solve_in_place(&mut self.work)?;
        let (before, after) = self.work.split_at(self.frozen);
        let (head, tail) = self.tangent.split_at_mut(self.frozen);
        head.iter_mut().zip(before).for_each(|(t, d)| *t -= d);
        tail[1..].iter_mut().zip(after).for_each(|(t, d)| *t -= d);
        let length = norm(&self.tangent);
        self.tangent.iter_mut().for_each(|t| *t /= length);
        check_finite(&self.tangent, "").map_err(|_| LinearError::Inaccurate { residual: f64::NAN })?;
        Ok(norm(&self.work))
    }

    /// The unit vector spanning the kernel of ∇H (length n + 1); its sign makes det [∇H; τᵀ] > 0 where the solver computes determinants,
    /// else its frozen coordinate is positive. Zeros before the first factorisation.
    #[must_use]
    pub fn tangent(&self) -> &[f64] {
        &self.tangent
    }

    /// Solves `[∇H; tᵀ] x = [r; c]` (`r` of length n, `t` and `x` of length n + 1).
    ///
    /// # Errors
    /// [`LinearError::Singular`] when `t` is orthogonal to the kernel; [`LinearError::NotFactored`]; [`InputError::Length`](crate::InputError::Length);
    /// errors of the solver.
    pub fn solve(&mut self, r: &[f64], t: &[f64], c: f64, x: &mut [f64]) -> Result<(), LinearError> {
        let n = self.pattern.nrows();
        check_length("the right-hand side", r.len(), n)?;
        check_length("the solution", x.len(), n + 1)?;
        check_finite(&[c], "the right-hand side")?;
        let slope = self.slope(t)?;
        self.work.copy_from_slice(r);
        self.solver.solve_in_place(&mut self.work)?;
        insert(&self.work, self.frozen, 0.0, x);
        self.move_along_kernel(t, slope, c, x);
        check_finite(x, "").map_err(|_| LinearError::Inaccurate { residual: f64::NAN })
    }

    /// Moves x along the kernel to t·x = c.
    fn move_along_kernel(&self, t: &[f64], slope: f64, c: f64, x: &mut [f64]) {
        // The second pass removes the cancellation error of the last row.
        for _ in 0..2 {
            let beta = (c - dot(t, x)) / slope;
            for (x, v) in x.iter_mut().zip(&self.tangent) {
                *x += beta * v;
            }
        }
    }

    /// The inverse of [∇H; τᵀ], column-major, with τ the [`tangent`](Self::tangent).
    pub(crate) fn inverse(&mut self, out: &mut [f64]) -> Result<(), LinearError> {
        const BLOCK: usize = 32;
        let n = self.pattern.nrows();
        check_length("the inverse", out.len(), (n + 1) * (n + 1))?;
        let (columns, last) = out.split_at_mut(n * (n + 1));
        last.copy_from_slice(&self.tangent);
        let border = self.tangent.clone();
        let mut block = Vec::with_capacity(n * BLOCK.min(n));
        let rows: Vec<usize> = (0..n).collect();
        for (rows, columns) in rows.chunks(BLOCK).zip(columns.chunks_mut(BLOCK * (n + 1))) {
            self.solve_units(rows, &border, columns, &mut block)?;
        }
        Ok(())
    }

    /// Columns of the inverse of [∇H; tᵀ], those of the given rows, side by side into `out`. Right-hand sides solved for together read the
    /// factors once; `block` is scratch.
    pub(super) fn solve_units(
        &mut self,
        rows: &[usize],
        t: &[f64],
        out: &mut [f64],
        block: &mut Vec<f64>,
    ) -> Result<(), LinearError> {
        let n = self.pattern.nrows();
        let slope = self.slope(t)?;
        block.clear();
        block.resize(rows.len() * n, 0.0);
        for (unit, &i) in block.chunks_exact_mut(n).zip(rows) {
            unit[i] = 1.0;
        }
        self.solver.solve_in_place(block)?;
        for (x, solved) in out.chunks_exact_mut(n + 1).zip(block.chunks_exact(n)) {
            insert(solved, self.frozen, 0.0, x);
            self.move_along_kernel(t, slope, 0.0, x);
        }
        check_finite(out, "").map_err(|_| LinearError::Inaccurate { residual: f64::NAN })
    }

    /// Solves the transposed system `∇Hᵀ y + s t = g` (`g` and `t` of length n + 1, `y` of length n) and returns `s`.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_transpose(&mut self, g: &[f64], t: &[f64], y: &mut [f64]) -> Result<f64, LinearError> {
        let n = self.pattern.nrows();
        check_length("the right-hand side", g.len(), n + 1)?;
        check_length("the solution", y.len(), n)?;
        check_finite(g, "the right-hand side")?;
        // The kernel vector annihilates ∇H: (t·τ) s = g·τ.
        let s = dot(g, &self.tangent) / self.slope(t)?;
        let others = (0..=n).filter(|j| *j != self.frozen);
        for (y, j) in y.iter_mut().zip(others) {
            *y = g[j] - s * t[j];
        }
        self.solver.solve_transpose_in_place(y)?;
        Ok(s)
    }

    /// t·τ, away from zero.
    fn slope(&self, t: &[f64]) -> Result<f64, LinearError> {
        if !self.factored {
            return Err(LinearError::NotFactored);
        }
        check_length("the last row", t.len(), self.tangent.len())?;
        check_finite(t, "the last row")?;
        let slope = dot(t, &self.tangent);
        let size = dot(t, t).sqrt();
        // Also true for t = 0 and where squares overflow.
        if slope.abs() > LEFT * size {
            Ok(slope)
        } else {
            let rcond = if size > 0.0 { slope.abs() / size } else { 0.0 };
            Err(LinearError::Singular { rcond })
        }
    }

    /// Sign of det [∇H; tᵀ], where the solver computes determinants; 0 when `t` is orthogonal to the kernel.
    #[must_use]
    pub fn orientation(&self, t: &[f64]) -> Option<i8> {
        self.log_det?;
        match self.slope(t) {
            Ok(slope) => Some(sign(slope)),
            Err(LinearError::Singular { .. }) => Some(0),
            Err(_) => None,
        }
    }

    /// Sign of det ∇_yH (∇H without its last column), where the solver computes determinants; 0 when it is singular: when the last
    /// coordinate of the unit tangent is below 1e-12.
    #[must_use]
    pub fn det_sign(&self) -> Option<i8> {
        self.log_det?;
        let n = self.pattern.nrows();
        let last = self.tangent[n];
        // ∇_yH itself was factored, and is regular, if the last coordinate is frozen.
        // Where the unit tangent is vertical but for rounding its sign is not known.
        let regular = self.frozen == n || last.abs() >= RESULT;
        Some(if regular { sign(last) } else { 0 })
    }

    /// Sign and natural logarithm of |det [∇H; τᵀ]| with τ the [`tangent`](Self::tangent), where the solver computes determinants. By the
    /// sign of τ the sign is +.
    #[must_use]
    pub fn log_det(&self) -> Option<(i8, f64)> {
        self.log_det
    }

    /// The frozen coordinate k of the last factorisation (n, the last one, at first).
    #[must_use]
    pub fn frozen(&self) -> usize {
        self.frozen
    }

    /// Number of numeric factorisations made so far.
    #[must_use]
    pub fn factorisations(&self) -> usize {
        self.factorisations
    }

    /// The linear solver.
    #[must_use]
    pub fn solver(&self) -> &L {
        &self.solver
    }

    /// Reciprocal condition number of M_k, as the solver [estimates](LinearSolver::rcond) it.
    pub fn rcond(&mut self) -> Option<f64> {
        self.solver.rcond()
    }
}

/// Whether another frozen coordinate may do better.
fn may_be_choice(e: &LinearError) -> bool {
    matches!(
        e,
        LinearError::Singular { .. } | LinearError::Inaccurate { .. } | LinearError::NotPositiveDefinite
    )
}

fn not_full_rank(e: LinearError) -> LinearError {
    if may_be_choice(&e) {
        LinearError::Kernel {
            expected: 1,
            found: 2,
        }
    } else {
        e
    }
}

/// The matrix with the largest entry of rows, then of columns, brought to 1.
fn equilibrate(a: &Matrix) -> Matrix {
    let mut scaled = a.clone();
    let mut row = vec![0.0_f64; a.nrows()];
    for (i, _, v) in a.triplets() {
        row[i] = row[i].max(v.abs());
    }
    let mut col = vec![0.0_f64; a.ncols()];
    for (i, j, v) in a.triplets() {
        if v != 0.0 {
            col[j] = col[j].max(v.abs() / row[i]);
        }
    }
    let divide = |(i, j, v): (usize, usize, f64)| if v == 0.0 { 0.0 } else { v / row[i] / col[j] };
    for (s, t) in scaled.values_mut().iter_mut().zip(a.triplets()) {
        *s = divide(t);
    }
    scaled
}

/// `full` = `rest` with `value` inserted at position k.
fn insert(rest: &[f64], k: usize, value: f64, full: &mut [f64]) {
    full[..k].copy_from_slice(&rest[..k]);
    full[k] = value;
    full[k + 1..].copy_from_slice(&rest[k..]);
}

fn sign(v: f64) -> i8 {
    i8::from(v > 0.0) - i8::from(v < 0.0)
}
