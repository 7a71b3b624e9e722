//! The rate problem of the nodes at kinks: laws differentiated along directions, in the forces of these nodes alone.

use std::borrow::Cow;

use crate::contact::law::{LocalRow, LocalValues, MAX_TESTS, NodeLaw};
use crate::piecewise::{Derivatives, Description, Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// What the law of a node is to first order.
#[derive(Debug, Clone)]
pub(super) struct RateNode {
    node: usize,
    /// Test functions, 0 where they vanish but for errors, and their derivatives.
    tests: [f64; MAX_TESTS],
    test_rows: [LocalRow; MAX_TESTS],
    /// Derivatives of the residuals of all pieces.
    rows: Vec<[LocalRow; 3]>,
}

impl RateNode {
    pub(super) fn new(law: &dyn NodeLaw, v: &LocalValues, errors: &[f64; MAX_TESTS]) -> Self {
        let mut made = Self {
            node: v.node,
            tests: [0.0; MAX_TESTS],
            test_rows: [LocalRow::default(); MAX_TESTS],
            rows: (0..law.num_pieces()).map(|piece| law.rows(piece, v)).collect(),
        };
        law.tests(v, &mut made.tests);
        law.test_rows(v, &mut made.test_rows);
        for (test, error) in made.tests.iter_mut().zip(errors) {
            if test.abs() <= *error {
                *test = 0.0;
            }
        }
        made
    }
}

/// The laws of some nodes to first order, in z = (λ, v, α, β): the rates of their forces, node by node, of their displacements without these
/// forces, of the load parameter and of the second parameter of each node. Zero is a solution; which pieces are active there are those at the
/// kink.
#[derive(Debug, Clone)]
pub(super) struct RateMap {
    nodes: Vec<RateNode>,
    directions: usize,
    num_tests: usize,
    cells: Vec<&'static [Facet]>,
    names: Vec<&'static str>,
    /// Displacements by unit forces, column by column.
    compliance: Vec<f64>,
}

impl RateMap {
    /// Without compliance.
    pub(super) fn new(law: &dyn NodeLaw, nodes: Vec<RateNode>) -> Self {
        let directions = 1 + law.num_tangents();
        let n = directions * nodes.len();
        Self {
            nodes,
            directions,
            num_tests: law.num_tests(),
            cells: (0..law.num_pieces()).map(|piece| law.cell(piece)).collect(),
            names: (0..law.num_pieces()).map(|piece| law.piece_name(piece)).collect(),
            compliance: vec![0.0; n * n],
        }
    }

    /// Numbers of forces and of data.
    pub(super) fn sizes(&self) -> (usize, usize) {
        let n = self.directions * self.nodes.len();
        (n, n + 1 + self.nodes.len())
    }

    pub(super) fn set_column(&mut self, k: usize, displacements: impl Iterator<Item = f64>) {
        let n = self.sizes().0;
        let column = self.compliance[n * k..n * (k + 1)].iter_mut();
        column.zip(displacements).for_each(|(c, u)| *c = u);
    }

    /// The largest displacement that forces could cause, Σ |terms|.
    pub(super) fn largest_response(&self, forces: &[f64]) -> f64 {
        let n = forces.len();
        let row = |i: usize| {
            (0..n)
                .map(|k| (self.compliance[n * k + i] * forces[k]).abs())
                .sum::<f64>()
        };
        (0..n).map(row).fold(0.0, f64::max)
    }

    /// The rates of all values of each node.
    fn values<'a>(&'a self, z: &'a [f64]) -> impl Iterator<Item = LocalRow> + 'a {
        let (n, m) = (self.sizes().0, self.directions);
        (0..self.nodes.len()).map(move |i| {
            let displacement = |k: usize| {
                let by_force = (0..n).map(|j| self.compliance[n * j + k] * z[j]).sum::<f64>();
                z[n + k] + by_force
            };
            let mut v = LocalRow {
                penetration: displacement(m * i),
                pressure: z[m * i],
                parameter: z[2 * n],
                second: z[2 * n + 1 + i],
                ..LocalRow::default()
            };
            for d in 1..m {
                (v.slip[d - 1], v.traction[d - 1]) = (displacement(m * i + d), z[m * i + d]);
            }
            v
        })
    }

    /// Adds the gradient in z of a function of the values of node i.
    fn scatter(&self, i: usize, row: &LocalRow, mut add: impl FnMut(usize, f64)) {
        let (n, m) = (self.sizes().0, self.directions);
        let by = [row.penetration, row.slip[0], row.slip[1]];
        let of_force = [row.pressure, row.traction[0], row.traction[1]];
        for d in 0..m {
            let k = m * i + d;
            (0..n).for_each(|j| add(j, by[d] * self.compliance[n * j + k]));
            add(k, of_force[d]);
            add(n + k, by[d]);
        }
        add(2 * n, row.parameter);
        add(2 * n + 1 + i, row.second);
    }
}

impl PiecewiseSmooth for RateMap {
    fn num_vars(&self) -> usize {
        let (n, k) = self.sizes();
        n + k
    }
    fn num_residuals(&self) -> usize {
        self.sizes().0
    }
    fn num_sites(&self) -> usize {
        self.nodes.len()
    }
    fn num_pieces(&self, _site: usize) -> usize {
        self.cells.len()
    }
    fn num_tests(&self, _site: usize) -> usize {
        self.num_tests
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        self.cells[piece]
    }
    fn pattern(&self) -> Pattern {
        Pattern::full(self.num_residuals(), self.num_vars())
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        self.test_derivatives(z, z, out);
        let tests = self.nodes.iter().flat_map(|node| &node.tests[..self.num_tests]);
        out.iter_mut().zip(tests).for_each(|(o, t)| *o += t);
    }
    fn residual(&self, selection: &Selection, z: &[f64], out: &mut [f64]) {
        let all = self.nodes.iter().zip(self.values(z)).enumerate();
        for ((i, (node, v)), own) in all.zip(out.chunks_exact_mut(self.directions)) {
            let rows = &node.rows[selection.piece(i)];
            own.iter_mut().zip(rows).for_each(|(o, row)| *o = row.along(&v));
        }
    }
    fn jacobian(&self, selection: &Selection, _z: &[f64], jac: &mut Matrix) {
        for (i, node) in self.nodes.iter().enumerate() {
            let rows = node.rows[selection.piece(i)].iter().take(self.directions);
            for (d, row) in rows.enumerate() {
                self.scatter(i, row, |k, value| jac.add(self.directions * i + d, k, value));
            }
        }
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl Derivatives for RateMap {
    fn test_derivatives(&self, _z: &[f64], d: &[f64], out: &mut [f64]) {
        let all = self.nodes.iter().zip(self.values(d));
        for ((node, v), own) in all.zip(out.chunks_exact_mut(self.num_tests.max(1))) {
            own.iter_mut()
                .zip(&node.test_rows)
                .for_each(|(o, row)| *o = row.along(&v));
        }
    }
    fn test_gradient(&self, site: usize, test: usize, _z: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let row = &self.nodes[site].test_rows[test];
        self.scatter(site, row, |k, value| gradient[k] += value);
    }
}

impl Description for RateMap {
    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(self.names[piece])
    }
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("contact node {}", self.nodes[site].node))
    }
}
