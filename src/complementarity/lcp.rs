use std::borrow::Cow;

use thiserror::Error;

use crate::linear::LinearError;
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, SparseError};

/// What can be wrong with a linear complementarity problem, or stops a method for it.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum LcpError {
    /// There are no unknowns.
    #[error("the problem has no unknowns")]
    Empty,
    /// The matrix is not square.
    #[error("the matrix is {nrows} x {ncols}; it must be square")]
    NotSquare {
        /// Number of rows.
        nrows: usize,
        /// Number of columns.
        ncols: usize,
    },
    /// An array has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which array.
        what: &'static str,
        /// Length asked for.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A value is NaN or infinite.
    #[error("{what} {index} is {value}; it must be finite")]
    NotFinite {
        /// Which array.
        what: &'static str,
        /// Which entry, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Bounds between which there is no number.
    #[error(
        "bounds {lower} and {upper} of unknown {index} leave no value; lower <= upper, lower < inf and upper > -inf must hold"
    )]
    Bounds {
        /// Which unknown, from 0.
        index: usize,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// An option is out of its range.
    #[error("option {name} = {value} is out of range; it must be {range}")]
    Option {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        range: &'static str,
    },
    /// A method needs what the problem has not.
    #[error("{method} cannot solve this problem: {reason}")]
    Unsuitable {
        /// The method.
        method: &'static str,
        /// Why, and what to do.
        reason: String,
    },
    /// The matrix is malformed.
    #[error(transparent)]
    Sparse(#[from] SparseError),
    /// The linear solver failed.
    #[error(transparent)]
    Linear(#[from] LinearError),
}

/// The linear complementarity problem LCP(M, q), or with bounds the box LCP (affine variational inequality over a box).
///
/// Without bounds: find z ≥ 0 with w = M z + q ≥ 0 and zᵀw = 0. With bounds l ≤ z ≤ u (infinite, equal and absent ones included):
/// wᵢ ≥ 0 where zᵢ = lᵢ, wᵢ ≤ 0 where zᵢ = uᵢ, and wᵢ = 0 between; for lᵢ = uᵢ no condition on wᵢ.
///
/// It is itself the [`PiecewiseSmooth`] natural map z − mid(l, u, z − w), one site a component with the pieces "lower", "interior"
/// and "upper", so that [`all_solutions`](crate::enumeration::all_solutions) and
/// [`Newton`](crate::newton::Newton) take it as it stands.
///
/// ```
/// use semismooth::complementarity::Lcp;
/// use semismooth::enumeration::{EnumerationOptions, all_solutions};
/// use semismooth::sparse::Matrix;
/// // Two solutions: z = 0 and z = 1.
/// let lcp = Lcp::new(Matrix::from_rows(&[[-1.0]])?, vec![1.0])?;
/// let set = all_solutions(&lcp, 0.0, &EnumerationOptions::default())?;
/// assert_eq!(set.solutions.len(), 2);
/// assert_eq!(lcp.natural_residual(&[1.0]), 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Lcp {
    matrix: Matrix,
    q: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Lcp {
    /// LCP(M, q): z ≥ 0.
    ///
    /// # Errors
    /// [`LcpError`] names the shape or the entry that is wrong.
    pub fn new(matrix: Matrix, q: Vec<f64>) -> Result<Self, LcpError> {
        let n = matrix.nrows();
        if matrix.ncols() != n {
            return Err(LcpError::NotSquare {
                nrows: n,
                ncols: matrix.ncols(),
            });
        }
        if n == 0 {
            return Err(LcpError::Empty);
        }
        if let Some((row, col)) = matrix.stray() {
            return Err(SparseError::OutOfBounds {
                row,
                col,
                nrows: n,
                ncols: n,
            }
            .into());
        }
        matrix.check_finite()?;
        check_values("q", &q, n)?;
        Ok(Self {
            matrix,
            q,
            lower: vec![0.0; n],
            upper: vec![f64::INFINITY; n],
        })
    }

    /// The box LCP: the bounds l ≤ z ≤ u in place of z ≥ 0.
    ///
    /// # Errors
    /// [`LcpError::Length`], or [`LcpError::Bounds`] for NaN, lᵢ > uᵢ, lᵢ = +∞ or uᵢ = −∞.
    pub fn with_bounds(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Result<Self, LcpError> {
        let n = self.len();
        check_length("the array of lower bounds", &lower, n)?;
        check_length("the array of upper bounds", &upper, n)?;
        check_bounds(&lower, &upper)?;
        self.lower = lower;
        self.upper = upper;
        Ok(self)
    }

    /// Number n of unknowns.
    #[must_use]
    pub fn len(&self) -> usize {
        self.q.len()
    }

    /// Whether there are no unknowns; never true of a problem that was made.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.q.is_empty()
    }

    /// M.
    #[must_use]
    pub fn matrix(&self) -> &Matrix {
        &self.matrix
    }

    /// q.
    #[must_use]
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// Lower bounds; 0 unless given.
    #[must_use]
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// Upper bounds; +∞ unless given.
    #[must_use]
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// Replaces q, for batches of problems with one matrix; nothing is allocated.
    ///
    /// # Errors
    /// [`LcpError::Length`] or [`LcpError::NotFinite`]; the problem is then unchanged.
    pub fn set_q(&mut self, q: &[f64]) -> Result<(), LcpError> {
        check_values("q", q, self.len())?;
        self.q.copy_from_slice(q);
        Ok(())
    }

    /// Replaces the values of M over its pattern; nothing is allocated.
    ///
    /// # Errors
    /// [`LcpError::Length`] or [`LcpError::NotFinite`]; the problem is then unchanged.
    pub fn set_values(&mut self, values: &[f64]) -> Result<(), LcpError> {
        check_values("value of the matrix", values, self.matrix.values().len())?;
        self.matrix.values_mut().copy_from_slice(values);
        Ok(())
    }

    /// Replaces the bounds, as [`with_bounds`](Self::with_bounds) checks them; nothing is allocated.
    ///
    /// # Errors
    /// As [`with_bounds`](Self::with_bounds); the problem is then unchanged.
    pub fn set_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<(), LcpError> {
        check_length("the array of lower bounds", lower, self.len())?;
        check_length("the array of upper bounds", upper, self.len())?;
        check_bounds(lower, upper)?;
        self.lower.copy_from_slice(lower);
        self.upper.copy_from_slice(upper);
        Ok(())
    }

    /// w = M z + q. Entries beyond the lengths of `z` or `w` are a logic error of the caller and panic.
    pub fn residual(&self, z: &[f64], w: &mut [f64]) {
        w.copy_from_slice(&self.q);
        self.matrix.as_ref().mul_add(1.0, z, w);
    }

    /// The natural residual maxᵢ |zᵢ − mid(lᵢ, uᵢ, zᵢ − wᵢ)|, zero exactly at solutions; NaN if `z` holds one. Allocates w.
    #[must_use]
    pub fn natural_residual(&self, z: &[f64]) -> f64 {
        if z.len() != self.len() {
            return f64::NAN;
        }
        let mut w = vec![0.0; z.len()];
        self.residual(z, &mut w);
        self.natural_residual_of(z, &w)
    }

    /// The natural residual for w = M z + q at hand.
    pub(crate) fn natural_residual_of(&self, z: &[f64], w: &[f64]) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..z.len() {
            let r = natural(z[i], w[i], self.lower[i], self.upper[i]).abs();
            // A NaN is kept.
            if !(r <= worst) {
                worst = r;
            }
        }
        worst
    }

    /// Whether all bounds are 0 ≤ z < ∞.
    #[must_use]
    pub fn is_standard(&self) -> bool {
        self.lower.iter().all(|l| *l == 0.0) && self.upper.iter().all(|u| *u == f64::INFINITY)
    }
}

/// z − mid(l, u, z − w), without the cancellation of z − (z − w) where the bound is not met.
pub(crate) fn natural(z: f64, w: f64, lower: f64, upper: f64) -> f64 {
    if w.is_nan() {
        return f64::NAN;
    }
    if z - w < lower {
        z - lower
    } else if z - w > upper {
        z - upper
    } else {
        w
    }
}

fn check_length(what: &'static str, v: &[f64], expected: usize) -> Result<(), LcpError> {
    if v.len() == expected {
        return Ok(());
    }
    Err(LcpError::Length {
        what,
        expected,
        found: v.len(),
    })
}

pub(crate) fn check_values(what: &'static str, v: &[f64], expected: usize) -> Result<(), LcpError> {
    check_length(what, v, expected)?;
    match v.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(LcpError::NotFinite {
            what,
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}

fn check_bounds(lower: &[f64], upper: &[f64]) -> Result<(), LcpError> {
    for (index, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
        let sound = lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY;
        if !sound {
            return Err(LcpError::Bounds { index, lower, upper });
        }
    }
    Ok(())
}

/// Pieces of a site, in the order of their numbers; which exist depends on the bounds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Piece {
    Lower,
    Interior,
    Upper,
}

impl Lcp {
    fn pieces(&self, site: usize) -> &'static [Piece] {
        match (self.lower[site].is_finite(), self.upper[site].is_finite()) {
            (true, true) if self.lower[site] == self.upper[site] => &[Piece::Lower],
            (true, true) => &[Piece::Lower, Piece::Interior, Piece::Upper],
            (true, false) => &[Piece::Lower, Piece::Interior],
            (false, true) => &[Piece::Interior, Piece::Upper],
            (false, false) => &[Piece::Interior],
        }
    }

    fn piece(&self, selection: &Selection, site: usize) -> Piece {
        let pieces = self.pieces(site);
        pieces[selection.piece(site).min(pieces.len() - 1)]
    }
}

impl PiecewiseSmooth for Lcp {
    fn num_vars(&self) -> usize {
        self.len()
    }

    fn num_residuals(&self) -> usize {
        self.len()
    }

    fn num_sites(&self) -> usize {
        self.len()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.pieces(site).len()
    }

    fn num_tests(&self, site: usize) -> usize {
        self.pieces(site).len() - 1
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        const FIRST: [Facet; 1] = [Facet::negative(0)];
        const BETWEEN: [Facet; 2] = [Facet::positive(0), Facet::negative(1)];
        const LAST: [[Facet; 1]; 2] = [[Facet::positive(0)], [Facet::positive(1)]];
        match (self.num_pieces(site), piece) {
            (1, _) => &[],
            (_, 0) => &FIRST,
            (3, 1) => &BETWEEN,
            (count, _) => &LAST[count - 2],
        }
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let mut w = vec![0.0; self.len()];
        self.residual(x, &mut w);
        let mut k = 0;
        for i in 0..self.len() {
            let mut put = |bound: f64| {
                out[k] = x[i] - w[i] - bound;
                k += 1;
            };
            if self.lower[i] == self.upper[i] {
                continue;
            }
            if self.lower[i].is_finite() {
                put(self.lower[i]);
            }
            if self.upper[i].is_finite() {
                put(self.upper[i]);
            }
        }
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        Lcp::residual(self, x, out);
        for i in 0..self.len() {
            match self.piece(selection, i) {
                Piece::Lower => out[i] = x[i] - self.lower[i],
                Piece::Interior => {}
                Piece::Upper => out[i] = x[i] - self.upper[i],
            }
        }
    }

    fn jacobian(&self, selection: &Selection, _x: &[f64], jac: &mut Matrix) {
        for (i, j, v) in self.matrix.triplets() {
            if self.piece(selection, i) == Piece::Interior {
                jac.add(i, j, v);
            }
        }
        for i in 0..self.len() {
            if self.piece(selection, i) != Piece::Interior {
                jac.add(i, i, 1.0);
            }
        }
    }

    fn pattern(&self) -> Pattern {
        let diagonal = (0..self.len()).all(|i| self.matrix.pattern().slot(i, i).is_some());
        if diagonal {
            return self.matrix.pattern().clone();
        }
        let entries = self.matrix.triplets().map(|(i, j, _)| (i, j));
        let diagonal = (0..self.len()).map(|i| (i, i));
        match Pattern::from_entries(self.len(), self.len(), entries.chain(diagonal)) {
            Ok(pattern) => pattern,
            Err(_) => unreachable!("the entries of a matrix lie inside it"),
        }
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        let pieces = self.pieces(site);
        Cow::Borrowed(match pieces[piece.min(pieces.len() - 1)] {
            Piece::Lower => "lower",
            Piece::Interior => "interior",
            Piece::Upper => "upper",
        })
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("component {site}"))
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(site);
    }

    fn is_piecewise_affine(&self) -> bool {
        true
    }

    fn test_derivatives(&self, _x: &[f64], d: &[f64], out: &mut [f64]) {
        let mut slope = vec![0.0; self.len()];
        self.matrix.mul_vec(d, &mut slope);
        let mut k = 0;
        for i in 0..self.len() {
            for _ in 0..self.num_tests(i) {
                out[k] = d[i] - slope[i];
                k += 1;
            }
        }
    }

    fn test_gradient(&self, site: usize, _test: usize, _x: &[f64], gradient: &mut [f64]) {
        for (j, g) in gradient.iter_mut().enumerate() {
            *g = f64::from(u8::from(j == site)) - self.matrix.get(site, j);
        }
    }
}
