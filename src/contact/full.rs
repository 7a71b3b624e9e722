use std::borrow::Cow;

use super::exact::{ExactTraces, full_conditions};
use super::law::{Row, TESTS};
use super::paths::Path;
use super::problem::write_tests;
use super::{ContactError, FrictionMap, FrictionProblem, NodeValues, SlipBound};
use crate::interface::fill_sizes;
use crate::piecewise::{Exact, ExactConditions, ExactPieces, Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

impl FrictionProblem {
    fn split<'x>(&self, x: &'x [f64]) -> (&'x [f64], &'x [f64], &'x [f64], f64) {
        let (n, p) = (self.num_displacements(), self.num_contacts());
        (&x[..n], &x[n..n + p], &x[n + p..n + 2 * p], x[n + 2 * p])
    }

    fn node(&self, i: usize, x: &[f64], friction: f64) -> NodeValues {
        let (u, pressure, traction, _) = self.split(x);
        NodeValues {
            penetration: column_dot(&self.bnu_t, i, u) - self.gap[i],
            slip: column_dot(&self.bt_t, i, u),
            pressure: pressure[i],
            traction: traction[i],
            friction,
        }
    }

    /// Calls `f(node, values, dF/dα)` for every contact node.
    pub(super) fn for_nodes(&self, x: &[f64], mut f: impl FnMut(usize, NodeValues, f64)) {
        let p = self.num_contacts();
        let alpha = x[x.len() - 1];
        match &self.friction.0 {
            super::paths::Path::Affine { constant, slope } => {
                for i in 0..p {
                    f(i, self.node(i, x, constant[i] + alpha * slope[i]), slope[i]);
                }
            }
            path @ super::paths::Path::Function(_) => {
                let (mut value, mut derivative) = (vec![0.0; p], vec![0.0; p]);
                path.value(alpha, &mut value, &mut derivative);
                for i in 0..p {
                    f(i, self.node(i, x, value[i]), derivative[i]);
                }
            }
        }
    }

    /// Adds the gradient of a node quantity, `row`, to `add(column, value)`.
    pub(super) fn scatter(&self, i: usize, row: &Row, friction_rate: f64, mut add: impl FnMut(usize, f64)) {
        let (n, p) = (self.num_displacements(), self.num_contacts());
        for (matrix, factor) in [(&self.bnu_t, row.penetration), (&self.bt_t, row.slip)] {
            if factor != 0.0 {
                for_column(matrix, i, |j, v| add(j, factor * v));
            }
        }
        let own = [
            (n + i, row.pressure),
            (n + p + i, row.traction),
            (n + 2 * p, row.friction * friction_rate),
        ];
        for (column, v) in own {
            if v != 0.0 {
                add(column, v);
            }
        }
    }

    /// Adds the rows of equilibrium, which are the same in all pieces, to a Jacobian.
    pub(super) fn equilibrium_jacobian(&self, alpha: f64, jac: &mut Matrix) {
        let (n, p) = (self.num_displacements(), self.num_contacts());
        jac.add_block(0, 0, 1.0, &self.a);
        jac.add_block(0, n, 1.0, &self.bnu_t);
        jac.add_block(0, n + p, 1.0, &self.bt_t);
        match &self.load.0 {
            super::paths::Path::Affine { slope, .. } => {
                for (i, s) in slope.iter().enumerate() {
                    jac.add(i, n + 2 * p, -s);
                }
            }
            path @ super::paths::Path::Function(_) => {
                let mut rate = vec![0.0; n];
                path.value(alpha, &mut vec![0.0; n], &mut rate);
                for (i, s) in rate.iter().enumerate() {
                    jac.add(i, n + 2 * p, -s);
                }
            }
        }
    }
}

impl PiecewiseSmooth for FrictionProblem {
    fn num_vars(&self) -> usize {
        self.num_residuals() + 1
    }

    fn num_residuals(&self) -> usize {
        self.num_displacements() + 2 * self.num_contacts()
    }

    fn num_sites(&self) -> usize {
        self.num_contacts()
    }

    fn num_pieces(&self, _site: usize) -> usize {
        self.law.num_pieces()
    }

    fn num_tests(&self, _site: usize) -> usize {
        TESTS
    }

    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        self.law.cell(piece)
    }

    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(self.law.piece_name(piece))
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("contact node {site}"))
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        let (n, p) = (self.num_displacements(), self.num_contacts());
        rows.clear();
        rows.extend([n + site, n + p + site]);
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    /// Affine pieces need a constant F and an affine load.
    fn is_piecewise_affine(&self) -> bool {
        self.law.constant_friction && self.load.0.is_affine()
    }

    fn exact(&self) -> Option<&dyn ExactPieces> {
        self.states_coefficients().then_some(self)
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        fill_sizes(self.sizes(), self.num_displacements(), sizes);
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let mut chunks = out.chunks_exact_mut(TESTS);
        self.for_nodes(x, |_, v, _| {
            if let Some(chunk) = chunks.next() {
                write_tests(&self.law, std::iter::once(v), chunk);
            }
        });
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (n, p) = (self.num_displacements(), self.num_contacts());
        let (u, pressure, traction, alpha) = self.split(x);
        let (equilibrium, contact) = out.split_at_mut(n);
        match &self.load.0 {
            super::paths::Path::Affine { constant, slope } => {
                for (o, (c, s)) in equilibrium.iter_mut().zip(constant.iter().zip(slope)) {
                    *o = -(c + alpha * s);
                }
            }
            path @ super::paths::Path::Function(_) => {
                path.value(alpha, equilibrium, &mut vec![0.0; n]);
                equilibrium.iter_mut().for_each(|o| *o = -*o);
            }
        }
        self.a.as_ref().mul_add(1.0, u, equilibrium);
        self.bnu_t.as_ref().mul_add(1.0, pressure, equilibrium);
        self.bt_t.as_ref().mul_add(1.0, traction, equilibrium);
        self.for_nodes(x, |i, v, _| {
            let [normal, tangential] = self.law.residual(selection.piece(i), &v);
            contact[i] = normal;
            contact[p + i] = tangential;
        });
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let (n, p) = (self.num_displacements(), self.num_contacts());
        self.equilibrium_jacobian(x[n + 2 * p], jac);
        self.for_nodes(x, |i, v, friction_rate| {
            let rows = self.law.rows(selection.piece(i), &v);
            for (row, index) in rows.iter().zip([n + i, n + p + i]) {
                self.scatter(i, row, friction_rate, |j, value| jac.add(index, j, value));
            }
        });
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let mut chunks = out.chunks_exact_mut(TESTS);
        self.for_nodes(x, |i, v, friction_rate| {
            let rows = self.law.test_rows(&v);
            for (o, row) in chunks.next().into_iter().flatten().zip(&rows) {
                *o = 0.0;
                self.scatter(i, row, friction_rate, |j, value| *o += value * d[j]);
            }
        });
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        self.for_nodes(x, |i, v, friction_rate| {
            if i == site {
                let row = self.law.test_rows(&v)[test.min(TESTS - 1)];
                self.scatter(i, &row, friction_rate, |j, value| gradient[j] += value);
            }
        });
    }
}

impl FrictionProblem {
    /// Whether load and friction are affine in α, so that all coefficients are at hand.
    pub(super) fn states_coefficients(&self) -> bool {
        self.law.bound == SlipBound::Augmented && self.load.0.is_affine() && self.friction.0.is_affine()
    }

    /// The gap of a normal quantity, 0 for a tangential one.
    pub(super) fn held(&self, k: usize) -> f64 {
        self.gap.get(k).copied().unwrap_or(0.0)
    }

    pub(super) fn exact_friction(&self, alpha: f64) -> Option<Vec<Exact>> {
        let Path::Affine { constant, slope } = &self.friction.0 else {
            return None;
        };
        let alpha = Exact::new(alpha)?;
        let value = |(c, s): (&f64, &f64)| Some(&Exact::new(*c)? + &(&alpha * &Exact::new(*s)?));
        constant.iter().zip(slope).map(value).collect()
    }

    pub(super) fn exact_traces(&self) -> Option<ExactTraces> {
        let Path::Affine { constant, slope } = &self.load.0 else {
            return None;
        };
        ExactTraces::of_stiffness(&self.a, [&self.bnu_t, &self.bt_t], [constant, slope])
    }
}

impl ExactPieces for FrictionProblem {
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let Path::Affine { constant, slope } = &self.load.0 else {
            return None;
        };
        full_conditions(
            &self.a,
            [&self.bnu_t, &self.bt_t],
            [constant, slope],
            alpha,
            |k| self.held(k),
            &self.exact_friction(alpha)?,
        )
    }
}

impl FrictionMap for FrictionProblem {
    fn problem(&self) -> &FrictionProblem {
        self
    }

    fn nodes(&self, x: &[f64]) -> Vec<NodeValues> {
        let mut nodes = Vec::with_capacity(self.num_contacts());
        if x.len() == self.num_vars() {
            self.for_nodes(x, |_, v, _| nodes.push(v));
        }
        nodes
    }

    fn displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        super::error::check_length("the solution x", x, self.num_vars())?;
        Ok(x[..self.num_displacements()].to_vec())
    }
}

fn for_column(matrix: &Matrix, j: usize, mut f: impl FnMut(usize, f64)) {
    let p = matrix.pattern();
    for k in p.col_ptr()[j]..p.col_ptr()[j + 1] {
        f(p.row_idx()[k], matrix.values()[k]);
    }
}

fn column_dot(matrix: &Matrix, j: usize, v: &[f64]) -> f64 {
    let mut sum = 0.0;
    for_column(matrix, j, |i, a| sum += a * v[i]);
    sum
}
