//! The normal map of an MCP as a piecewise-smooth map.

use std::borrow::Cow;

use super::{Mcp, McpFunction};
use crate::piecewise::{Derivatives, Description, Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// Robinson's normal map F(x) + z − x, x = mid(l, u, z), of an MCP (S. M. Robinson, 1992).
///
/// z is a zero if and only if x = mid(l, u, z) solves the MCP, and then z = x − F(x). Unlike those of the natural map its test
/// functions zᵢ − lᵢ and zᵢ − uᵢ do not involve F, and F is evaluated within the bounds only; every site changes a column of the
/// Jacobian, not a row. The variables are z, and the parameter of a parametric problem.
///
/// ```
/// use semismooth::complementarity::{Mcp, NormalMap};
/// use semismooth::newton::Newton;
/// use semismooth::sparse::Matrix;
/// let m = Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?;
/// let problem = Mcp::affine(m, vec![-5.0, -1.0], vec![0.0; 2], vec![f64::INFINITY; 2])?;
/// let map = NormalMap::new(&problem);
/// let mut z = vec![1.0, 1.0];
/// Newton::default().solve(&map, &mut z)?;
/// assert_eq!(map.point(&z), [2.5, 0.0]);
/// assert_eq!(z[1], -1.5); // −F₂ at the bound
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct NormalMap<'a, F> {
    problem: &'a Mcp<F>,
}

impl<'a, F: McpFunction> NormalMap<'a, F> {
    /// The normal map of a problem.
    #[must_use]
    pub fn new(problem: &'a Mcp<F>) -> Self {
        Self { problem }
    }

    /// x = mid(l, u, z), with the parameter if there is one.
    #[must_use]
    pub fn point(&self, z: &[f64]) -> Vec<f64> {
        let mut x = z.to_vec();
        self.problem.project(&mut x);
        x
    }

    /// x of a selection, on either side of its facets.
    fn selected(&self, selection: &Selection, z: &[f64]) -> Vec<f64> {
        let mut x = z.to_vec();
        for i in 0..self.problem.len() {
            if let Some(bound) = self.bound(selection, i) {
                x[i] = bound;
            }
        }
        x
    }

    /// The bound at which a selection has component i.
    fn bound(&self, selection: &Selection, i: usize) -> Option<f64> {
        let (l, u) = (self.problem.lower()[i], self.problem.upper()[i]);
        match (selection.piece(i), l.is_finite()) {
            _ if l == u => Some(l),
            (0, true) => Some(l),
            (0, false) => None,
            (1, false) => Some(u),
            (piece, _) => (piece > 1).then_some(u),
        }
    }
}

impl<F: McpFunction> PiecewiseSmooth for NormalMap<'_, F> {
    fn num_vars(&self) -> usize {
        PiecewiseSmooth::num_vars(self.problem)
    }

    fn num_residuals(&self) -> usize {
        self.problem.len()
    }

    fn num_sites(&self) -> usize {
        self.problem.num_sites()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.problem.num_pieces(site)
    }

    fn num_tests(&self, site: usize) -> usize {
        self.problem.num_tests(site)
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.problem.cell(site, piece)
    }

    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        self.problem.each_test(|k, i, bound| out[k] = z[i] - bound);
    }

    fn residual(&self, selection: &Selection, z: &[f64], out: &mut [f64]) {
        let x = self.selected(selection, z);
        self.problem.function().value(&x, out);
        for i in 0..out.len() {
            out[i] += z[i] - x[i];
        }
    }

    fn jacobian(&self, selection: &Selection, z: &[f64], jac: &mut Matrix) {
        self.problem
            .function()
            .jacobian(&self.selected(selection, z), jac);
        for i in 0..self.problem.len() {
            if self.bound(selection, i).is_some() {
                let span = jac.pattern().col_ptr()[i]..jac.pattern().col_ptr()[i + 1];
                jac.values_mut()[span].fill(0.0);
                jac.add(i, i, 1.0);
            }
        }
    }

    fn pattern(&self) -> Pattern {
        self.problem.jacobian_pattern().clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.problem.function().is_affine()
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }

    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl<F: McpFunction> Derivatives for NormalMap<'_, F> {
    fn test_derivatives(&self, _z: &[f64], d: &[f64], out: &mut [f64]) {
        self.problem.each_test(|k, i, _| out[k] = d[i]);
    }

    fn test_gradient(&self, site: usize, _test: usize, _z: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        gradient[site] = 1.0;
    }
}

impl<F: McpFunction> Description for NormalMap<'_, F> {
    fn typical_sizes(&self, sizes: &mut [f64]) {
        self.problem.typical_sizes(sizes);
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.problem.piece_name(site, piece)
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.problem.site_name(site)
    }
}
