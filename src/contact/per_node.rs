use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::ContactBody;
use super::law::{LocalRow, LocalValues, MAX_TESTS, NodeLaw};
use super::tolerances::RELATIVE_R;
use crate::piecewise::{Derivatives, Description, ExactPieces, Facet, PiecewiseSmooth, Selection, Structure};
use crate::sparse::{Matrix, Pattern};

/// A [`NodeLaw`] at each contact node of a body, as the law of an [`Interface`](crate::interface::Interface): a map of z = (v, λ, α) with
/// v and λ ordered by direction (all normal ones first), then by node. Its sites are the contact nodes.
#[derive(Debug, Clone)]
pub struct PerNode<L> {
    pub(super) body: Arc<ContactBody>,
    pub(super) law: L,
    /// Tangential displacements from which slips are measured, all along t₁, then t₂.
    pub(super) reference: Vec<f64>,
    /// History variables, node by node.
    pub(super) history: Vec<f64>,
    /// The augmentation parameter of Newton's method and of the test functions that are reported.
    pub(super) r: f64,
    /// The augmentation parameter in which the map is evaluated: continuation, classification and lists of solutions must not depend on
    /// `r`.
    pub(super) scale: f64,
    /// Stiffness of the contact nodes; the search for solutions tries multiples of it as r.
    pub(super) stiffness: f64,
    /// Number of parameters: α alone, α and β, or α and one second parameter for each node.
    pub(super) parameters: usize,
    /// The derivatives of the test functions of each node where they are the same at all points, and the scale they are for.
    rows: OnceLock<(f64, Vec<TestRows>)>,
}

type TestRows = [LocalRow; MAX_TESTS];

impl<L: NodeLaw> PerNode<L> {
    pub(super) fn new(body: Arc<ContactBody>, law: L) -> Self {
        let p = body.num_contacts();
        let stiffness = body.node_stiffness();
        Self {
            reference: vec![0.0; p * body.num_tangents()],
            history: initial_history(&law, p),
            body,
            law,
            r: RELATIVE_R * stiffness,
            scale: RELATIVE_R * stiffness,
            stiffness,
            parameters: 1,
            rows: OnceLock::new(),
        }
    }

    /// The same nodes under another law, with the same reference of slips; history variables are reset to 0.
    pub(super) fn under<M: NodeLaw>(&self, law: M) -> PerNode<M> {
        PerNode {
            body: Arc::clone(&self.body),
            reference: self.reference.clone(),
            history: initial_history(&law, self.body.num_contacts()),
            law,
            r: self.r,
            scale: self.scale,
            stiffness: self.stiffness,
            parameters: self.parameters,
            rows: OnceLock::new(),
        }
    }

    /// 2 in the plane, 3 in space: a normal and one or two tangential quantities.
    pub(super) fn directions(&self) -> usize {
        1 + self.body.num_tangents()
    }

    /// Those of the contact nodes, then those of the [anchors](ContactBody::anchored), which the law keeps at 0.
    fn num_traces(&self) -> usize {
        self.own_traces() + self.body.anchors().len()
    }

    /// Those of the contact nodes.
    pub(super) fn own_traces(&self) -> usize {
        self.directions() * self.body.num_contacts()
    }

    pub(super) fn law_mut(&mut self) -> &mut L {
        self.rows = OnceLock::new();
        &mut self.law
    }

    /// The derivatives of the test functions, where they are the same at all points: of affine laws without history.
    fn constant_rows(&self) -> Option<&[TestRows]> {
        if !self.law.is_affine() || !self.history.is_empty() {
            return None;
        }
        let (scale, rows) = self.rows.get_or_init(|| {
            let origin = vec![0.0; self.num_vars()];
            let nodes = 0..self.body.num_contacts();
            (self.scale, nodes.map(|i| self.rows_at(i, &origin)).collect())
        });
        (*scale == self.scale).then_some(rows)
    }

    fn rows_at(&self, i: usize, z: &[f64]) -> TestRows {
        let mut rows = TestRows::default();
        self.law.test_rows(&self.at(i, z), &mut rows);
        rows
    }

    /// Values of node i, with the displacement, the force of each direction and the parameters taken from functions.
    pub(super) fn values(
        &self,
        i: usize,
        displacement: impl Fn(usize) -> f64,
        force: impl Fn(usize) -> f64,
        parameters: &[f64],
    ) -> LocalValues {
        let mut v = values_at(parameters, self.scale);
        self.set(&mut v, i, displacement, force);
        v.second = self.second(i, parameters);
        v
    }

    /// The second parameter of node i.
    #[inline]
    fn second(&self, i: usize, parameters: &[f64]) -> f64 {
        let place = if self.parameters > 2 { 1 + i } else { 1 };
        parameters.get(place).copied().unwrap_or(0.0)
    }

    /// Sets the values to those of node i; parameters and r are unchanged.
    #[inline]
    fn set(
        &self,
        v: &mut LocalValues,
        i: usize,
        displacement: impl Fn(usize) -> f64,
        force: impl Fn(usize) -> f64,
    ) {
        let p = self.body.num_contacts();
        v.node = i;
        v.penetration = displacement(i) - self.body.gap[i];
        v.pressure = force(i);
        for d in 0..self.body.num_tangents() {
            let k = (d + 1) * p + i;
            v.slip[d] = displacement(k) - self.reference[k - p];
            v.traction[d] = force(k);
        }
        if !self.history.is_empty() {
            let history = self.history_of(i);
            v.history[..history.len()].copy_from_slice(history);
        }
    }

    /// Calls `see` with the values of each node at z and the augmentation parameter r, reusing one struct: copies would cost more than the
    /// laws.
    #[inline]
    fn each(&self, z: &[f64], r: f64, mut see: impl FnMut(usize, &LocalValues)) {
        let q = self.num_traces();
        let mut v = values_at(&z[2 * q..], r);
        for i in 0..self.body.num_contacts() {
            self.set(&mut v, i, |k| z[k], |k| z[q + k]);
            v.second = self.second(i, &z[2 * q..]);
            see(i, &v);
        }
    }

    /// The test functions of all nodes at r.
    fn tests_of_all(&self, z: &[f64], r: f64, out: &mut [f64]) {
        let mut chunks = out.chunks_exact_mut(self.law.num_tests().max(1));
        self.each(z, r, |_, v| {
            if let Some(chunk) = chunks.next() {
                self.law.tests(v, chunk);
            }
        });
    }

    /// The history variables of node i.
    pub(super) fn history_of(&self, i: usize) -> &[f64] {
        if self.history.is_empty() {
            return &[];
        }
        let h = self.law.num_history();
        &self.history[i * h..(i + 1) * h]
    }

    fn at(&self, i: usize, z: &[f64]) -> LocalValues {
        let q = self.num_traces();
        self.values(i, |k| z[k], |k| z[q + k], &z[2 * q..])
    }

    /// The gradient with respect to z of a function of the values of node i.
    fn scatter(&self, i: usize, row: &LocalRow, mut add: impl FnMut(usize, f64)) {
        let (p, q) = (self.body.num_contacts(), self.num_traces());
        add(i, row.penetration);
        add(q + i, row.pressure);
        for d in 0..self.body.num_tangents() {
            let k = (d + 1) * p + i;
            add(k, row.slip[d]);
            add(q + k, row.traction[d]);
        }
        add(2 * q, row.parameter);
        match self.parameters {
            1 => {}
            2 => add(2 * q + 1, row.second),
            _ => add(2 * q + 1 + i, row.second),
        }
    }

    fn add_rows(&self, i: usize, piece: usize, z: &[f64], jac: &mut Matrix) {
        let p = self.body.num_contacts();
        let rows = self.law.rows(piece, &self.at(i, z));
        for (block, row) in rows.iter().enumerate().take(self.directions()) {
            self.scatter(i, row, |k, value| {
                if value != 0.0 {
                    jac.add(block * p + i, k, value);
                }
            });
        }
    }
}

/// The values shared by all nodes: α and r.
fn values_at(parameters: &[f64], r: f64) -> LocalValues {
    LocalValues {
        parameter: parameters[0],
        r,
        ..LocalValues::default()
    }
}

/// History variables of p nodes before any loading.
fn initial_history<L: NodeLaw>(law: &L, p: usize) -> Vec<f64> {
    vec![0.0; law.num_history() * p]
}

impl<L: NodeLaw> PiecewiseSmooth for PerNode<L> {
    fn num_vars(&self) -> usize {
        2 * self.num_traces() + self.parameters
    }

    fn num_residuals(&self) -> usize {
        self.num_traces()
    }

    fn num_sites(&self) -> usize {
        self.body.num_contacts()
    }

    fn num_pieces(&self, _site: usize) -> usize {
        self.law.num_pieces()
    }

    fn num_tests(&self, _site: usize) -> usize {
        self.law.num_tests()
    }

    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        self.law.cell(piece)
    }

    fn pattern(&self) -> Pattern {
        let (p, q, blocks) = (self.body.num_contacts(), self.num_traces(), self.directions());
        let own = self.own_traces();
        let mut columns: Vec<Vec<usize>> = Vec::with_capacity(2 * q + self.parameters);
        for k in 0..2 * q {
            columns.push(match (k < q, k % q) {
                (_, k) if k < own => (0..blocks).map(|block| block * p + k % p).collect(),
                (true, k) => vec![k],
                (false, _) => Vec::new(),
            });
        }
        columns.extend((0..self.parameters.min(2)).map(|_| (0..own).collect()));
        if self.parameters > 2 {
            let own = |i: usize| (0..blocks).map(|block| block * p + i).collect();
            columns.truncate(2 * q + 1);
            columns.extend((0..p).map(own));
        }
        let entries = columns.into_iter().enumerate();
        let entries = entries.flat_map(|(k, rows)| rows.into_iter().map(move |i| (i, k)));
        Pattern::from_entries(q, 2 * q + self.parameters, entries)
            .unwrap_or_else(|_| Pattern::full(q, 2 * q + self.parameters))
    }

    fn is_piecewise_affine(&self) -> bool {
        self.law.is_affine()
    }

    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        self.tests_of_all(z, self.scale, out);
    }

    fn residual(&self, selection: &Selection, z: &[f64], out: &mut [f64]) {
        let p = self.body.num_contacts();
        self.each(z, self.scale, |i, v| {
            let h = self.law.residual(selection.piece(i), v);
            for (block, value) in h.iter().enumerate().take(self.directions()) {
                out[block * p + i] = *value;
            }
        });
        let anchors = self.own_traces()..self.num_traces();
        out[anchors.clone()].copy_from_slice(&z[anchors]);
    }

    fn jacobian(&self, selection: &Selection, z: &[f64], jac: &mut Matrix) {
        for i in 0..self.body.num_contacts() {
            self.add_rows(i, selection.piece(i), z, jac);
        }
        for k in self.own_traces()..self.num_traces() {
            jac.add(k, k, 1.0);
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

impl<L: NodeLaw> Derivatives for PerNode<L> {
    fn test_derivatives(&self, z: &[f64], d: &[f64], out: &mut [f64]) {
        let (p, q) = (self.body.num_contacts(), self.num_traces());
        let constant = self.constant_rows();
        let mut moved = LocalRow {
            parameter: d[2 * q],
            ..LocalRow::default()
        };
        for (i, chunk) in out.chunks_exact_mut(self.law.num_tests().max(1)).enumerate() {
            let own;
            let rows = match constant {
                Some(all) => &all[i],
                None => {
                    own = self.rows_at(i, z);
                    &own
                }
            };
            (moved.penetration, moved.pressure) = (d[i], d[q + i]);
            moved.second = self.second(i, &d[2 * q..]);
            for t in 0..self.body.num_tangents() {
                let k = (t + 1) * p + i;
                (moved.slip[t], moved.traction[t]) = (d[k], d[q + k]);
            }
            for (o, row) in chunk.iter_mut().zip(rows) {
                *o = row.along(&moved);
            }
        }
    }

    fn test_gradient(&self, site: usize, test: usize, z: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let rows = self
            .constant_rows()
            .map_or_else(|| self.rows_at(site, z), |all| all[site]);
        self.scatter(site, &rows[test.min(MAX_TESTS - 1)], |k, value| {
            gradient[k] += value
        });
    }
}

impl<L: NodeLaw> Structure for PerNode<L> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        let p = self.body.num_contacts();
        rows.clear();
        rows.extend((0..self.directions()).map(|block| block * p + site));
    }

    fn exact(&self) -> Option<&dyn ExactPieces> {
        self.states_coefficients().then_some(self)
    }

    fn site_jacobian(&self, site: usize, selection: &Selection, z: &[f64], jac: &mut Matrix) -> bool {
        self.add_rows(site, selection.piece(site), z, jac);
        true
    }
}

impl<L: NodeLaw> Description for PerNode<L> {
    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(self.law.piece_name(piece))
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("contact node {site}"))
    }

    fn reported_tests(&self, z: &[f64], out: &mut [f64]) -> bool {
        if self.r == self.scale {
            return false;
        }
        self.tests_of_all(z, self.r, out);
        true
    }

    fn in_prescribed_scale(&self) -> Option<Box<dyn PiecewiseSmooth + '_>> {
        if self.r == self.scale {
            return None;
        }
        let mut other = self.under(&self.law as &dyn NodeLaw);
        other.history.clone_from(&self.history);
        other.scale = self.r;
        Some(Box::new(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{FrictionCoefficient, FrictionCurve, LoadPath, PlanarCoulomb};

    /// One node under a given law.
    fn one_node(curve: FrictionCurve) -> PerNode<PlanarCoulomb> {
        let matrix = |rows: &[[f64; 2]]| Matrix::from_rows(rows).unwrap();
        let a = matrix(&[[2.0, -0.5], [-0.5, 1.0]]);
        let load = LoadPath::constant(vec![3.0, 5.0]);
        let body = ContactBody::new(a, matrix(&[[1.0, 0.0]]), vec![matrix(&[[0.0, 1.0]])], load).unwrap();
        PerNode::new(
            Arc::new(body),
            PlanarCoulomb::new(FrictionCoefficient::uniform(curve)),
        )
    }

    /// Constant derivatives are those of the current law, also after the law is replaced.
    #[test]
    fn derivatives_are_those_of_the_law_in_force() {
        let mut nodes = one_node(FrictionCurve::constant(0.3).unwrap());
        let (z, d) = ([0.1, 0.3, 2.0, 0.4, 0.0], [0.7, -0.2, 1.1, 0.5, 0.25]);
        for friction in [0.3, 0.5] {
            let law = PlanarCoulomb::new(FrictionCoefficient::constant(friction).unwrap());
            *nodes.law_mut() = law;
            let (mut low, mut high, mut rates) = ([0.0; 4], [0.0; 4], [0.0; 4]);
            nodes.test_derivatives(&z, &d, &mut rates);
            let moved = |sign: f64| -> Vec<f64> { (0..5).map(|k| z[k] + sign * d[k]).collect() };
            nodes.test_functions(&moved(-1.0), &mut low);
            nodes.test_functions(&moved(1.0), &mut high);
            for k in 0..4 {
                assert!(
                    (high[k] - low[k] - 2.0 * rates[k]).abs() < 1e-13,
                    "{friction} {k}"
                );
                let mut gradient = [0.0; 5];
                nodes.test_gradient(0, k, &z, &mut gradient);
                let along: f64 = gradient.iter().zip(&d).map(|(g, d)| g * d).sum();
                assert!((along - rates[k]).abs() < 1e-14);
            }
        }
    }

    /// A node that has slipped by 0.7 under slip-dependent friction: the map in the scale that users prescribed is the same map with
    /// another r, history and all.
    #[test]
    fn the_prescribed_scale_changes_nothing_but_r() {
        let mut nodes = one_node(FrictionCurve::exponential(0.6, 0.1, 2.0).unwrap());
        assert!(nodes.in_prescribed_scale().is_none());
        nodes.history = vec![0.7];
        nodes.reference = vec![0.05];
        nodes.r = 3.0 * nodes.scale;
        let prescribed = nodes.in_prescribed_scale().unwrap();
        let expected = PerNode {
            scale: nodes.r,
            ..nodes.clone()
        };
        let z = [0.1, 0.3, 2.0, 0.4, 0.0];
        let of = |map: &dyn PiecewiseSmooth| {
            let mut all = vec![0.0; 4];
            map.test_functions(&z, &mut all);
            for piece in 0..4 {
                let mut r = [0.0; 2];
                map.residual(&Selection::uniform(1, piece), &z, &mut r);
                all.extend(r);
            }
            all
        };
        assert_eq!(of(&*prescribed), of(&expected));
        // History counts, and so does r.
        let fresh = PerNode {
            history: vec![0.0],
            ..expected.clone()
        };
        assert!(of(&fresh) != of(&expected) && of(&nodes) != of(&expected));
    }
}
