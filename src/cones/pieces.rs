//! The natural map of cone problems as a piecewise smooth one, away from the tips of second-order cones.

use std::borrow::Cow;
use std::ops::Range;

use super::Cone;
use crate::complementarity::{ComplementarityError, McpFunction, Scratch};
use crate::input::check_length;
use crate::piecewise::{Derivatives, Description, Facet, PiecewiseSmooth, Selection, Structure};
use crate::sparse::{Matrix, Pattern, max_abs};
use crate::tolerances::HALF_DIGITS;

/// x − P(x − F(x, θ)), P the projection on a product of half-lines, second-order cones and free variables, with its pieces: for
/// derivatives of solutions in parameters θ, which stand behind the unknowns ([`Sensitivity`](crate::sensitivity::Sensitivity)).
///
/// The projection on t ≥ ‖v‖ is z inside, 0 in the polar cone, and smooth between, where z = x − F is not at the tip, which it is where x and
/// F both are. There it is not piecewise smooth, and the derivatives here are NaN, which callers refuse.
///
/// ```
/// use semismooth::complementarity::AffineFunction;
/// use semismooth::cones::{Cone, ConePieces};
/// use semismooth::sensitivity::Sensitivity;
/// use semismooth::sparse::Matrix;
/// // The point of t ≥ ‖v‖ nearest to θ = (0, 3, 4) is (2.5, 1.5, 2); with the first component of θ it moves along itself.
/// let rows = Matrix::from_rows(&[
///     [1.0, 0.0, 0.0, -1.0, 0.0, 0.0],
///     [0.0, 1.0, 0.0, 0.0, -1.0, 0.0],
///     [0.0, 0.0, 1.0, 0.0, 0.0, -1.0],
/// ])?;
/// let distance = AffineFunction::with_parameters(rows, vec![0.0; 3])?;
/// let map = ConePieces::new(distance, vec![Cone::SecondOrder(3)])?;
/// let mut found = Sensitivity::new(map, &[2.5, 1.5, 2.0], &[0.0, 3.0, 4.0])?;
/// assert_eq!(found.differentiable()?.known(), Some(true));
/// let rate = found.jvp(&[1.0, 0.0, 0.0])?;
/// assert!(rate.iter().zip([0.5, 0.3, 0.4]).all(|(a, b)| (a - b).abs() < 1e-12));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ConePieces<F> {
    function: F,
    /// Half-lines and second-order cones of more than one variable.
    sites: Vec<Range<usize>>,
    /// Variables that belong to no site.
    free: Vec<usize>,
    pattern: Pattern,
    work: Scratch<Work>,
}

#[derive(Debug, Clone)]
struct Work {
    /// z = x − F, or a direction of it.
    z: Vec<f64>,
    dz: Vec<f64>,
    slope: Matrix,
}

/// z = (t, v): ‖v‖, its direction, and t.
struct Block<'a> {
    t: f64,
    v: &'a [f64],
    norm: f64,
}

impl<'a> Block<'a> {
    fn new(z: &'a [f64]) -> Self {
        let (t, v) = (z[0], &z[1..]);
        let norm = v.iter().fold(0.0_f64, |m, v| m.hypot(*v));
        Self { t, v, norm }
    }

    /// The derivative of ‖v‖ along d; at 0 that of the norm itself.
    fn rate(&self, d: &[f64]) -> f64 {
        match self.norm > 0.0 {
            true => self.v.iter().zip(d).map(|(v, d)| v / self.norm * d).sum(),
            false => d.iter().fold(0.0_f64, |m, d| m.hypot(*d)),
        }
    }

    /// Component i of the projection between the cone and its polar.
    fn between(&self, i: usize) -> f64 {
        let half = 0.5 * (self.t + self.norm);
        if i == 0 {
            half
        } else {
            half * self.v[i - 1] / self.norm
        }
    }

    /// Its derivative in component j of z.
    fn slope(&self, i: usize, j: usize) -> f64 {
        let n = |k: usize| self.v[k - 1] / self.norm;
        match (i, j) {
            (0, 0) => 0.5,
            (0, k) | (k, 0) => 0.5 * n(k),
            (i, j) => {
                let share = 0.5 * (1.0 + self.t / self.norm);
                let identity = f64::from(u8::from(i == j));
                0.5 * n(i) * n(j) + share * (identity - n(i) * n(j))
            }
        }
    }
}

impl<F: McpFunction> ConePieces<F> {
    /// The map of F of n unknowns and k ≥ 0 parameters behind them.
    ///
    /// # Errors
    /// No cones, a cone without variables, more variables than can be counted, F with another number of values or fewer variables than
    /// the cones, or a pattern of another shape; semidefinite cones, whose projection has no finite list of pieces.
    pub fn new(function: F, cones: Vec<Cone>) -> Result<Self, ComplementarityError> {
        let mut n = 0_usize;
        for (index, cone) in cones.iter().enumerate() {
            if cone.is_empty() {
                return Err(ComplementarityError::EmptyCone { index });
            }
            if matches!(cone, Cone::Semidefinite(_)) {
                return Err(ComplementarityError::NoPieces { index });
            }
            n = n
                .checked_add(cone.len())
                .ok_or(ComplementarityError::TooManyVariables { index })?;
        }
        if n == 0 {
            return Err(ComplementarityError::Empty);
        }
        check_length("F", function.num_values(), n)?;
        let vars = function.num_vars();
        if vars < n {
            check_length("the argument of F", vars, n)?;
        }
        let (mut first, mut sites, mut free) = (0, Vec::new(), Vec::new());
        for cone in &cones {
            let range = first..first + cone.len();
            first = range.end;
            match cone {
                Cone::SecondOrder(_) => sites.push(range),
                Cone::Nonnegative(_) => sites.extend(range.map(|i| i..i + 1)),
                _ => free.extend(range),
            }
        }
        let own = function.pattern();
        check_length("a column of the pattern of F", own.nrows(), n)?;
        check_length("a row of the pattern of F", own.ncols(), vars)?;
        let mut block: Vec<Range<usize>> = (0..n).map(|i| i..i + 1).collect();
        sites
            .iter()
            .for_each(|site| site.clone().for_each(|i| block[i] = site.clone()));
        let mut entries: Vec<(usize, usize)> = (0..n)
            .flat_map(|i| block[i].clone().map(move |j| (i, j)))
            .collect();
        for j in 0..vars {
            for &i in &own.row_idx()[own.col_ptr()[j]..own.col_ptr()[j + 1]] {
                entries.extend(block[i].clone().map(|row| (row, j)));
            }
        }
        let work = Work {
            z: vec![0.0; n],
            dz: vec![0.0; n],
            slope: Matrix::zeros(own),
        };
        Ok(Self {
            pattern: Pattern::from_entries(n, vars, entries)?,
            function,
            sites,
            free,
            work: Scratch::new(work),
        })
    }

    /// F.
    #[must_use]
    pub fn function(&self) -> &F {
        &self.function
    }

    fn set(&self, x: &[f64], work: &mut Work) {
        self.function.value(x, &mut work.z);
        work.z.iter_mut().zip(x).for_each(|(z, x)| *z = x - *z);
    }

    fn set_slope(&self, x: &[f64], work: &mut Work) {
        work.slope.clear();
        self.function.jacobian(x, &mut work.slope);
    }

    /// Changes of z along d.
    fn set_direction(&self, d: &[f64], work: &mut Work) {
        work.dz.copy_from_slice(&d[..work.z.len()]);
        work.slope.as_ref().mul_add(-1.0, d, &mut work.dz);
    }
}

const INSIDE: usize = 0;
const BETWEEN: usize = 1;

impl<F: McpFunction> PiecewiseSmooth for ConePieces<F> {
    fn num_vars(&self) -> usize {
        self.pattern.ncols()
    }

    fn num_residuals(&self) -> usize {
        self.pattern.nrows()
    }

    fn num_sites(&self) -> usize {
        self.sites.len()
    }

    fn num_pieces(&self, site: usize) -> usize {
        if self.sites[site].len() == 1 { 2 } else { 3 }
    }

    fn num_tests(&self, site: usize) -> usize {
        if self.sites[site].len() == 1 { 1 } else { 2 }
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        const LINE: [&[Facet]; 2] = [&[Facet::positive(0)], &[Facet::negative(0)]];
        const CONE: [&[Facet]; 3] = [
            &[Facet::positive(0)],
            &[Facet::negative(0), Facet::positive(1)],
            &[Facet::negative(1)],
        ];
        match self.sites[site].len() {
            1 => LINE[piece.min(1)],
            _ => CONE[piece.min(2)],
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.function.is_affine() && self.sites.iter().all(|site| site.len() == 1)
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.lock();
        self.set(x, work);
        let mut out = out.iter_mut();
        for site in &self.sites {
            let block = Block::new(&work.z[site.clone()]);
            let values = [block.t - block.norm, block.t + block.norm];
            let count = if site.len() == 1 { 1 } else { 2 };
            out.by_ref().take(count).zip(values).for_each(|(o, v)| *o = v);
        }
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.lock();
        self.set(x, work);
        for &i in &self.free {
            out[i] = x[i] - work.z[i];
        }
        for (s, site) in self.sites.iter().enumerate() {
            let (piece, block) = (selection.piece(s), Block::new(&work.z[site.clone()]));
            for (k, i) in site.clone().enumerate() {
                out[i] = match (piece, site.len()) {
                    (INSIDE, _) => x[i] - work.z[i],
                    (BETWEEN, 2..) => x[i] - block.between(k),
                    _ => x[i],
                };
            }
        }
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let work = &mut *self.work.lock();
        self.set(x, work);
        self.set_slope(x, work);
        if let Some((row, col)) = work.slope.stray() {
            jac.refuse(row, col);
        }
        // The block of each row, and whether the row is that of F, of x, or of the projection.
        let n = self.num_residuals();
        let mut piece: Vec<Option<(usize, usize)>> = vec![None; n];
        for (s, site) in self.sites.iter().enumerate() {
            site.clone()
                .for_each(|i| piece[i] = Some((s, selection.piece(s))));
        }
        let largest = max_abs(x);
        for (s, site) in self.sites.iter().enumerate().filter(|(_, site)| site.len() > 1) {
            let block = Block::new(&work.z[site.clone()]);
            if selection.piece(s) == BETWEEN && block.norm <= HALF_DIGITS * largest {
                jac.add(site.start, site.start, f64::NAN);
            }
        }
        for i in 0..n {
            match piece[i] {
                None | Some((_, INSIDE)) => {}
                Some((s, BETWEEN)) if self.sites[s].len() > 1 => {
                    let site = self.sites[s].clone();
                    let block = Block::new(&work.z[site.clone()]);
                    jac.add(i, i, 1.0);
                    for j in site.clone() {
                        jac.add(i, j, -block.slope(i - site.start, j - site.start));
                    }
                }
                Some(_) => jac.add(i, i, 1.0),
            }
        }
        for (i, j, v) in work.slope.triplets() {
            match piece[i] {
                None | Some((_, INSIDE)) => jac.add(i, j, v),
                Some((s, BETWEEN)) if self.sites[s].len() > 1 => {
                    let site = self.sites[s].clone();
                    let block = Block::new(&work.z[site.clone()]);
                    for row in site.clone() {
                        jac.add(row, j, v * block.slope(row - site.start, i - site.start));
                    }
                }
                Some(_) => {}
            }
        }
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }

    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }

    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl<F: McpFunction> Derivatives for ConePieces<F> {
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.lock();
        self.set(x, work);
        self.set_slope(x, work);
        self.set_direction(d, work);
        let mut out = out.iter_mut();
        for site in &self.sites {
            let rate = Block::new(&work.z[site.clone()]).rate(&work.dz[site.start + 1..site.end]);
            let t = work.dz[site.start];
            let count = if site.len() == 1 { 1 } else { 2 };
            out.by_ref()
                .take(count)
                .zip([t - rate, t + rate])
                .for_each(|(o, v)| *o = v);
        }
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let work = &mut *self.work.lock();
        self.set(x, work);
        self.set_slope(x, work);
        gradient.fill(0.0);
        let range = self.sites[site].clone();
        let block = Block::new(&work.z[range.clone()]);
        let sign = if test == 0 { -1.0 } else { 1.0 };
        let mut of_z = vec![0.0; self.num_residuals()];
        of_z[range.start] = 1.0;
        if block.norm > 0.0 {
            let parts = of_z[range.start + 1..range.end].iter_mut().zip(block.v);
            parts.for_each(|(g, v)| *g = sign * v / block.norm);
        }
        gradient[..of_z.len()].copy_from_slice(&of_z);
        work.slope.as_ref().mul_transpose_add(-1.0, &of_z, gradient);
    }
}

impl<F: McpFunction> Structure for ConePieces<F> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.extend(self.sites[site].clone());
    }
}

impl<F: McpFunction> Description for ConePieces<F> {
    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(match (self.sites[site].len(), piece) {
            (_, INSIDE) => "interior",
            (1, _) => "zero",
            (_, BETWEEN) => "boundary",
            _ => "tip",
        })
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        let range = &self.sites[site];
        Cow::Owned(match range.len() {
            1 => format!("variable {}", range.start),
            _ => format!("the cone of variables {} to {}", range.start, range.end - 1),
        })
    }
}
