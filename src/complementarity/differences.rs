use super::scratch::Scratch;
use super::{ComplementarityError, McpFunction};
use crate::InputError;
use crate::input::{check_length, check_vector};
use crate::sparse::{Coloring, Matrix, Pattern};
use crate::tolerances::CENTRAL;

/// A function given by its value alone; its Jacobian is made of coloured finite differences.
///
/// With a sparse [pattern](Self::with_pattern) a Jacobian costs two evaluations a colour (for a tridiagonal one six in all),
/// otherwise two a variable. Differences are central (error about 1e-10 relative), one-sided where F is not finite on one side or
/// the [bounds](Self::with_bounds) are near.
///
/// ```
/// use semismooth::complementarity::{Differenced, Mcp, McpSolver};
/// let f = Differenced::new(2, |x: &[f64], out: &mut [f64]| {
///     out[0] = x[0] + x[1].sqrt() - 3.0;
///     out[1] = x[1] - x[0] * x[0];
/// })
/// .with_bounds(vec![0.0; 2], vec![f64::INFINITY; 2])?;
/// let mut x = [5.0, 5.0];
/// assert!(McpSolver::default().solve(&Mcp::ncp(f)?, &mut x)?.is_solved());
/// assert!((x[0] - 1.5).abs() < 1e-8 && (x[1] - 2.25).abs() < 1e-8);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Differenced<V> {
    value: V,
    num_values: usize,
    num_vars: usize,
    /// Where the Jacobian has entries, unless everywhere.
    sparse: Option<(Pattern, Coloring)>,
    bounds: Option<(Vec<f64>, Vec<f64>)>,
    work: Scratch<Work>,
}

#[derive(Debug, Clone)]
struct Work {
    /// A point and values there.
    y: Vec<f64>,
    here: Vec<f64>,
    plus: Vec<f64>,
    minus: Vec<f64>,
    steps: Vec<f64>,
    /// Whether the pattern was compared with the function at a point.
    checked: bool,
}

impl<V: Fn(&[f64], &mut [f64])> Differenced<V> {
    /// A function of `n` variables with `n` values; `value(x, out)` overwrites `out`. Unless a pattern is given, the Jacobian is full:
    /// 16 n² bytes when a solver makes it.
    pub fn new(n: usize, value: V) -> Self {
        Self::over(n, n, None, value)
    }

    /// A function of `n` variables and a parameter, which comes last; the Jacobian is full unless a pattern is given.
    pub fn parametric(n: usize, value: V) -> Self {
        Self::over(n, n.saturating_add(1), None, value)
    }

    fn over(n: usize, m: usize, sparse: Option<(Pattern, Coloring)>, value: V) -> Self {
        Self {
            value,
            num_values: n,
            num_vars: m,
            sparse,
            bounds: None,
            work: Scratch::new(Work {
                y: vec![0.0; m],
                here: vec![0.0; n],
                plus: vec![0.0; n],
                minus: vec![0.0; n],
                steps: vec![0.0; m],
                checked: false,
            }),
        }
    }

    /// Says where the Jacobian has entries. The pattern also settles the numbers of values and variables.
    ///
    /// One that lacks an entry is refused ([`PiecewiseError::StrayEntry`](crate::piecewise::PiecewiseError::StrayEntry)) where the first
    /// Jacobian is evaluated: values must not change, to the last bit, with variables that the pattern does not give them. That
    /// takes 2 ⌈log₂ k⌉ evaluations a colour of k columns, once.
    #[must_use]
    pub fn with_pattern(self, pattern: Pattern) -> Self {
        let coloring = Coloring::new(&pattern);
        Self {
            bounds: self.bounds,
            ..Self::over(
                pattern.nrows(),
                pattern.ncols(),
                Some((pattern, coloring)),
                self.value,
            )
        }
    }

    /// Keeps the points of difference quotients within bounds (of length n; a parameter has none).
    ///
    /// # Errors
    /// Wrong lengths.
    pub fn with_bounds(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Result<Self, ComplementarityError> {
        for (what, found) in [("lower", lower.len()), ("upper", upper.len())] {
            check_length(what, found, self.num_values)?;
        }
        self.bounds = Some((lower, upper));
        Ok(self)
    }

    /// Number of colours: evaluations of a one-sided Jacobian.
    #[must_use]
    pub fn num_colors(&self) -> usize {
        self.sparse
            .as_ref()
            .map_or(self.num_vars, |(_, coloring)| coloring.groups().len())
    }

    /// An entry (value, variable) of the function at x that the pattern lacks; `here` is the value there.
    ///
    /// Columns of one colour share no row of the pattern. Perturbing half of them at a time, by each binary digit of their number in the
    /// colour, separates every pair of them, so that no column hides an entry that another one lacks.
    fn lacking(&self, x: &[f64], work: &mut Work) -> Option<(usize, usize)> {
        let (pattern, coloring) = self.sparse.as_ref().filter(|(pattern, _)| !pattern.is_full())?;
        let Work {
            y,
            here,
            plus: out,
            steps,
            ..
        } = work;
        let mut covered = vec![false; self.num_values];
        let rows = |j: usize| &pattern.row_idx()[pattern.col_ptr()[j]..pattern.col_ptr()[j + 1]];
        let mut stray = |columns: &[usize]| {
            for &j in columns {
                let (l, u) = self.range(j);
                let ahead = (x[j] + steps[j]).max(l).min(u);
                y[j] = if ahead == x[j] {
                    (x[j] - steps[j]).max(l).min(u)
                } else {
                    ahead
                };
                rows(j).iter().for_each(|&i| covered[i] = true);
            }
            (self.value)(y, out);
            let changed = |i: usize| out[i] != here[i] && !(out[i].is_nan() && here[i].is_nan());
            let row = (0..covered.len()).find(|&i| !covered[i] && changed(i));
            for &j in columns {
                y[j] = x[j];
                rows(j).iter().for_each(|&i| covered[i] = false);
            }
            row
        };
        for group in coloring.groups() {
            for digit in 0..usize::BITS - (group.len().max(2) - 1).leading_zeros() {
                for half in 0..2 {
                    let members = group.iter().enumerate().filter(|(k, _)| k >> digit & 1 == half);
                    let columns: Vec<usize> = members.map(|(_, &j)| j).collect();
                    if columns.is_empty() {
                        continue;
                    }
                    if let Some(row) = stray(&columns) {
                        let one = columns.iter().find_map(|&j| Some((stray(&[j])?, j)));
                        return one.or(Some((row, columns[0])));
                    }
                }
            }
        }
        None
    }

    fn range(&self, j: usize) -> (f64, f64) {
        match &self.bounds {
            Some((l, u)) if j < l.len() => (l[j], u[j]),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }
}

impl<V: Fn(&[f64], &mut [f64])> McpFunction for Differenced<V> {
    fn num_vars(&self) -> usize {
        self.num_vars
    }

    fn num_values(&self) -> usize {
        self.num_values
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        (self.value)(x, out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let work = &mut *self.work.lock();
        work.y.copy_from_slice(x);
        (self.value)(x, &mut work.here);
        for (s, x) in work.steps.iter_mut().zip(x) {
            // A power of two near the ideal step, so that x + h − x is h where x is not much larger.
            *s = (CENTRAL * (1.0 + x.abs())).log2().round().exp2();
        }
        if !work.checked {
            if let Some((i, j)) = self.lacking(x, work) {
                jac.refuse(i, j);
                return;
            }
            work.checked = true;
        }
        let Work {
            y,
            here,
            plus,
            minus,
            steps,
            ..
        } = work;
        for colour in 0..self.num_colors() {
            let own = [colour];
            let group: &[usize] = match &self.sparse {
                Some((_, coloring)) => &coloring.groups()[colour],
                None => &own,
            };
            let shift = |sign: f64, out: &mut [f64], y: &mut [f64]| {
                for &j in group {
                    let (l, u) = self.range(j);
                    y[j] = (x[j] + sign * steps[j]).max(l).min(u);
                }
                (self.value)(y, out);
            };
            shift(1.0, plus, y);
            shift(-1.0, minus, y);
            for &j in group {
                let (l, u) = self.range(j);
                let ahead = (x[j] + steps[j]).max(l).min(u) - x[j];
                let back = x[j] - (x[j] - steps[j]).max(l).min(u);
                y[j] = x[j];
                let entries = match &self.sparse {
                    Some((pattern, _)) => pattern.col_ptr()[j]..pattern.col_ptr()[j + 1],
                    None => 0..self.num_values,
                };
                for k in entries {
                    let i = self
                        .sparse
                        .as_ref()
                        .map_or(k, |(pattern, _)| pattern.row_idx()[k]);
                    let quotient = match (
                        plus[i].is_finite() && ahead > 0.0,
                        minus[i].is_finite() && back > 0.0,
                    ) {
                        (true, false) => (plus[i] - here[i]) / ahead,
                        (false, true) => (here[i] - minus[i]) / back,
                        // Equal bounds leave no room; the entry does not matter there.
                        (false, false) if ahead <= 0.0 && back <= 0.0 => 0.0,
                        _ => (plus[i] - minus[i]) / (ahead + back),
                    };
                    jac.add(i, j, quotient);
                }
            }
        }
    }

    fn pattern(&self) -> Pattern {
        match &self.sparse {
            Some((pattern, _)) => pattern.clone(),
            None => Pattern::full(self.num_values, self.num_vars),
        }
    }
}

/// Result of [`check_jacobian`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct JacobianCheck {
    /// Largest difference between an entry and its difference quotient, relative to 1 + its size.
    pub largest_error: f64,
    /// Its row and column.
    pub entry: (usize, usize),
}

/// Compares the Jacobian of a function at x with central differences.
///
/// # Complexity
/// 4 m evaluations for m variables, and n m comparisons for n values.
///
/// # Errors
/// [`ComplementarityError::WrongDerivative`] names the worst entry if it is off by more than `tolerance` (1e-5 is sensible)
/// relative to 1 + its size and beyond the error of the quotient; wrong lengths, entries outside the pattern, values that are not
/// finite.
///
/// ```
/// use semismooth::complementarity::{ComplementarityError, WithJacobian, check_jacobian};
/// let wrong = WithJacobian::new(
///     1,
///     |x: &[f64], out: &mut [f64]| out[0] = x[0] * x[0],
///     |x: &[f64], jac: &mut semismooth::sparse::Matrix| jac.add(0, 0, x[0]),
/// );
/// let error = check_jacobian(&wrong, &[3.0], 1e-5).unwrap_err();
/// assert!(matches!(error, ComplementarityError::WrongDerivative { row: 0, col: 0, .. }));
/// ```
pub fn check_jacobian<F: McpFunction + ?Sized>(
    function: &F,
    x: &[f64],
    tolerance: f64,
) -> Result<JacobianCheck, ComplementarityError> {
    let (n, m) = (function.num_values(), function.num_vars());
    check_vector("the point x", x, m)?;
    let mut jac = Matrix::zeros(super::affine::with_diagonal(&function.pattern())?);
    function.jacobian(x, &mut jac);
    if let Some((row, col)) = jac.stray() {
        return Err(crate::piecewise::PiecewiseError::StrayEntry { row, col }.into());
    }
    let mut y = x.to_vec();
    let mut quotient = |j: usize, h: f64| {
        let (mut plus, mut minus) = (vec![0.0; n], vec![0.0; n]);
        y[j] = x[j] + h;
        function.value(&y, &mut plus);
        y[j] = x[j] - h;
        function.value(&y, &mut minus);
        y[j] = x[j];
        plus.iter()
            .zip(&minus)
            .map(|(p, m)| (p - m) / (2.0 * h))
            .collect::<Vec<f64>>()
    };
    let mut worst = JacobianCheck {
        largest_error: 0.0,
        entry: (0, 0),
    };
    for j in 0..m {
        let h = (CENTRAL * (1.0 + x[j].abs())).log2().round().exp2();
        let (fine, coarse) = (quotient(j, h), quotient(j, 8.0 * h));
        for i in 0..n {
            let given = jac.get(i, j);
            if !(given.is_finite() && fine[i].is_finite()) {
                return Err(ComplementarityError::Input(InputError::NotFinite {
                    what: "the row of the Jacobian, or of its difference quotients,",
                    index: i,
                    value: if given.is_finite() { fine[i] } else { given },
                }));
            }
            let doubt = (fine[i] - coarse[i]).abs();
            let error = ((given - fine[i]).abs() - doubt).max(0.0) / (1.0 + given.abs().max(fine[i].abs()));
            if error > worst.largest_error {
                worst = JacobianCheck {
                    largest_error: error,
                    entry: (i, j),
                };
            }
            if error > tolerance {
                return Err(ComplementarityError::WrongDerivative {
                    row: i,
                    col: j,
                    given,
                    found: fine[i],
                });
            }
        }
    }
    Ok(worst)
}
