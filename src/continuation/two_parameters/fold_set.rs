use std::borrow::Cow;

use crate::InputError;
use crate::input::check_vector;
use crate::linear::{LinearError, null_space};
use crate::piecewise::{
    Derivatives, Description, Facet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection,
    TestLayout, check_sizes, gradient_of, select,
};
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::CENTRAL;

/// The smooth folds of a two-parameter family: a curve to [follow](crate::continuation::Continuation) in the
/// last parameter β.
///
/// The family is a map of n residuals in x = (y, α, β). A fold in α has a kernel v of ∇_yH, so that
///
/// ```text
/// H(y, α, β) = 0,   ∇_yH(y, α, β) v = 0,   Σ (v_j / s_j)² = 1
/// ```
///
/// are 2n + 1 equations in the 2n + 2 variables (y, v, α, β) (Seydel 1979; Allgower and Georg 1990, ch. 8). s
/// are the [typical sizes](crate::piecewise::Description::typical_sizes) of y in the family, and those of v.
/// The set belongs to one selection: where the curve leaves its cell the fold is no longer smooth, and the
/// curve [ends](crate::continuation::TransitionKind::End) in a point of codimension two, from which a
/// [`TransitionSet`](crate::continuation::TransitionSet) continues it as non-smooth folds. [Smooth
/// folds](crate::continuation::Event::SmoothFold) of this curve are its turning points in β: cusps, and
/// births of isolas.
///
/// Second derivatives are central differences of Jacobians along v.
///
/// ```
/// use semismooth::continuation::{Branch, ContinuationOptions, Direction, FoldSet};
/// # use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
/// # use semismooth::sparse::Matrix;
/// /// y³ − β y = α folds where 3 y² = β: on the cusp 27 α² = 4 β³.
/// struct Cusp;
/// # impl PiecewiseSmooth for Cusp {
/// #     fn num_vars(&self) -> usize { 3 }
/// #     fn num_residuals(&self) -> usize { 1 }
/// #     fn num_sites(&self) -> usize { 0 }
/// #     fn num_pieces(&self, _site: usize) -> usize { 1 }
/// #     fn num_tests(&self, _site: usize) -> usize { 0 }
/// #     fn cell(&self, _site: usize, _piece: usize) -> &[Facet] { &[] }
/// #     fn test_functions(&self, _x: &[f64], _out: &mut [f64]) {}
/// #     fn residual(&self, _s: &Selection, x: &[f64], out: &mut [f64]) { out[0] = x[0].powi(3) - x[2] * x[0] - x[1]; }
/// #     fn jacobian(&self, _s: &Selection, x: &[f64], jac: &mut Matrix) {
/// #         jac.add(0, 0, 3.0 * x[0] * x[0] - x[2]);
/// #         jac.add(0, 1, -1.0);
/// #         jac.add(0, 2, -x[0]);
/// #     }
/// # }
/// let (set, start) = FoldSet::new(Cusp, &[1.0, -2.0, 3.0])?;
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 12.0));
/// let line = Branch::follow(&set, &start, Direction::Increasing, options)?;
/// let end = set.family_point(&line.points.last().unwrap().x).to_vec(); // (y, α, β)
/// assert!((27.0 * end[1].powi(2) - 4.0 * end[2].powi(3)).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct FoldSet<P> {
    family: P,
    /// s, of all variables of the family.
    sizes: Vec<f64>,
    selection: Selection,
    layout: TestLayout,
    /// The cell of the selection, site by site, every facet a wall.
    cells: Vec<Vec<Facet>>,
    pattern: Pattern,
}

/// Singular value up to which ∇_yH counts as singular at the given fold, with variables in units of s and the largest entry in each row of
/// ∇H 1.
const KERNEL: f64 = 1e-5;

impl<P: PiecewiseSmooth> FoldSet<P> {
    /// The set through the smooth fold near `x` = (y, α, β), in the selection there, and the point (y, v, α, β) to start from.
    ///
    /// # Complexity
    /// The start takes singular values of a dense matrix, O(n³) for n residuals. Each Jacobian of the set takes three of the family and is as
    /// sparse as they are; a step factors systems of 2 n + 1 rows.
    ///
    /// # Errors
    /// A family that has not two variables more than residuals, or sizes that are not positive; x of the wrong length or not finite, a point
    /// at which ∇_yH has no kernel of dimension one.
    pub fn new(family: P, x: &[f64]) -> Result<(Self, Vec<f64>), PiecewiseError> {
        let (m, n) = (family.num_vars(), family.num_residuals());
        if m != n + 2 {
            return Err(PiecewiseError::Dimensions {
                vars: m,
                residuals: n,
                expected: "a family has two variables (its parameters) more than residuals",
            });
        }
        check_vector("the fold x", x, m)?;
        let mut sizes = vec![1.0; m];
        family.typical_sizes(&mut sizes);
        check_sizes(&sizes, m)?;
        let selection = select(&family, x);
        let mut jac = Matrix::zeros(family.pattern());
        family.jacobian(&selection, x, &mut jac);
        if let Some((row, col)) = jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col });
        }
        jac.scale_columns(&sizes);
        let mut rows = vec![0.0f64; n];
        for (i, _, v) in jac.triplets() {
            rows[i] = rows[i].max(v.abs());
        }
        let mut square = Matrix::zeros(Pattern::full(n, n));
        for (i, j, v) in jac.triplets().filter(|t| t.1 < n && rows[t.0] > 0.0) {
            square.add(i, j, v / rows[i]);
        }
        let largest = null_space(&square, 0.0)?.singular_values.first().copied();
        let rtol = match largest {
            Some(s) if s > 0.0 => (KERNEL / s).min(1.0),
            _ => 1.0,
        };
        let kernel = null_space(&square, rtol)?.right;
        let [v] = kernel.as_slice() else {
            return Err(PiecewiseError::Input(InputError::Length {
                what: "the kernel of ∇_yH at the fold (its dimension)",
                expected: 1,
                found: kernel.len(),
            }));
        };
        let cells = (0..family.num_sites())
            .map(|site| {
                let facets = family.cell(site, selection.piece(site)).iter();
                facets.map(|f| f.wall()).collect()
            })
            .collect();
        let mut start = x[..n].to_vec();
        start.extend(v.iter().zip(&sizes).map(|(v, s)| v * s));
        start.extend_from_slice(&x[n..]);
        let set = Self {
            pattern: pattern(&family.pattern(), n)?,
            sizes,
            layout: TestLayout::new(&family),
            cells,
            selection,
            family,
        };
        Ok((set, start))
    }

    /// The selection whose folds these are.
    #[must_use]
    pub fn selection(&self) -> &Selection {
        &self.selection
    }

    /// The family.
    #[must_use]
    pub fn family(&self) -> &P {
        &self.family
    }

    /// The point (y, α, β) of the family that belongs to a point (y, v, α, β).
    ///
    /// An x of the wrong length gives an empty vector.
    #[must_use]
    pub fn family_point(&self, x: &[f64]) -> Vec<f64> {
        let n = self.family.num_residuals();
        if x.len() != 2 * n + 2 {
            return Vec::new();
        }
        let mut own = x[..n].to_vec();
        own.extend_from_slice(&x[2 * n..]);
        own
    }

    /// The kernel v in a point (y, v, α, β).
    fn kernel<'x>(&self, x: &'x [f64]) -> &'x [f64] {
        let n = self.family.num_residuals();
        &x[n..2 * n]
    }

    /// The length of v in units of s.
    fn length(&self, v: &[f64]) -> f64 {
        let squares = v.iter().zip(&self.sizes).map(|(v, s)| (v / s).powi(2));
        squares.sum::<f64>().sqrt()
    }

    /// out = ∇_yH v.
    fn apply(&self, own: &[f64], v: &[f64], jac: &mut Matrix, out: &mut [f64]) {
        jac.clear();
        self.family.jacobian(&self.selection, own, jac);
        out.fill(0.0);
        jac.leading_columns(v.len()).mul_add(1.0, v, out);
    }

    /// The column of a variable of the family in this map.
    fn column(&self, j: usize) -> usize {
        let n = self.family.num_residuals();
        if j < n { j } else { j + n }
    }
}

impl<P: PiecewiseSmooth> PiecewiseSmooth for FoldSet<P> {
    fn num_vars(&self) -> usize {
        self.num_residuals() + 1
    }

    fn num_residuals(&self) -> usize {
        2 * self.family.num_residuals() + 1
    }

    fn num_sites(&self) -> usize {
        self.cells.len()
    }

    fn num_pieces(&self, _site: usize) -> usize {
        1
    }

    fn num_tests(&self, site: usize) -> usize {
        self.family.num_tests(site)
    }

    fn cell(&self, site: usize, _piece: usize) -> &[Facet] {
        self.cells.get(site).map_or(&[], Vec::as_slice)
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.family
            .tests_of_selection(&self.selection, &self.family_point(x), None, out);
    }

    fn residual(&self, _selection: &Selection, x: &[f64], out: &mut [f64]) {
        let n = self.family.num_residuals();
        let (own, v) = (self.family_point(x), self.kernel(x));
        let (first, rest) = out.split_at_mut(n);
        self.family.residual(&self.selection, &own, first);
        let mut jac = Matrix::zeros(self.family.pattern());
        self.apply(&own, v, &mut jac, &mut rest[..n]);
        rest[n] = 0.5 * (self.length(v).powi(2) - 1.0);
    }

    fn jacobian(&self, _selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let n = self.family.num_residuals();
        let (mut own, v) = (self.family_point(x), self.kernel(x));
        let mut part = Matrix::zeros(self.family.pattern());
        self.family.jacobian(&self.selection, &own, &mut part);
        if let Some((i, j)) = part.stray() {
            return jac.refuse(i, j);
        }
        for (i, j, value) in part.triplets() {
            jac.add(i, self.column(j), value);
            if j < n {
                jac.add(n + i, n + j, value);
            }
        }
        for (j, (v, s)) in v.iter().zip(&self.sizes).enumerate() {
            jac.add(2 * n, n + j, v / (s * s));
        }
        // The derivatives of ∇_yH v are those of ∇H along v.
        let largest = own
            .iter()
            .zip(&self.sizes)
            .fold(1.0f64, |a, (x, s)| a.max(x.abs() / s));
        let h = CENTRAL * largest / self.length(v).max(f64::MIN_POSITIVE);
        let mut back = part.clone();
        for (jac, h) in [(&mut part, h), (&mut back, -2.0 * h)] {
            own.iter_mut().zip(v).for_each(|(x, v)| *x += h * v);
            jac.clear();
            self.family.jacobian(&self.selection, &own, jac);
        }
        for ((i, j, ahead), (_, _, behind)) in part.triplets().zip(back.triplets()) {
            jac.add(n + i, self.column(j), (ahead - behind) / (2.0 * h));
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }

    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl<P: PiecewiseSmooth> Derivatives for FoldSet<P> {
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let direction = self.family_point(d);
        self.family
            .tests_of_selection(&self.selection, &self.family_point(x), Some(&direction), out);
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let mut own = vec![0.0; self.family.num_vars()];
        let index = self.layout.range(site).start + test;
        let (layout, selection, x) = (&self.layout, &self.selection, self.family_point(x));
        gradient_of(&self.family, layout, selection, index, &x, &mut own);
        gradient.fill(0.0);
        for (j, g) in own.into_iter().enumerate() {
            gradient[self.column(j)] = g;
        }
    }
}

impl<P: PiecewiseSmooth> Description for FoldSet<P> {
    fn typical_sizes(&self, sizes: &mut [f64]) {
        let n = self.family.num_residuals();
        sizes[..n].copy_from_slice(&self.sizes[..n]);
        sizes[n..].copy_from_slice(&self.sizes);
    }

    fn piece_name(&self, site: usize, _piece: usize) -> Cow<'_, str> {
        self.family.piece_name(site, self.selection.piece(site))
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.family.site_name(site)
    }
}

/// H depends on its own variables, ∇_yH v on everything.
fn pattern(family: &Pattern, n: usize) -> Result<Pattern, PiecewiseError> {
    let mut entries = Vec::new();
    for j in 0..n + 2 {
        let column = if j < n { j } else { j + n };
        for &i in &family.row_idx()[family.col_ptr()[j]..family.col_ptr()[j + 1]] {
            entries.push((i, column));
            entries.push((n + i, column));
            if j < n {
                entries.push((n + i, n + j));
            }
        }
    }
    entries.extend((0..n).map(|j| (2 * n, n + j)));
    let pattern = Pattern::from_entries(2 * n + 1, 2 * n + 2, entries);
    Ok(pattern.map_err(LinearError::from)?)
}
