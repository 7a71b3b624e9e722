use std::borrow::Cow;
use std::sync::OnceLock;

use super::error::check_length;
use super::exact::ExactTraces;
use super::law::{Row, TESTS};
use super::paths::Path;
use super::{ContactError, FrictionMap, FrictionProblem, NodeValues};
use crate::interface::fill_sizes;
use crate::linear::Condensation;
use crate::piecewise::{ExactConditions, ExactPieces, Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, dot};

/// A [`FrictionProblem`] condensed onto its contact nodes: x = (λν, λt, α).
///
/// With C = B A⁻¹ Bᵀ, B = (Bν; Bt), and the free motion w(α) = B A⁻¹ f(α), the displacements of the contact nodes are
/// w(α) − C λ; the rest is as in the full form, with the same sites, pieces and test functions, the same solutions and the same
/// signs of det ∇_yH (A is positive definite). One Cholesky factorisation and 2p + 2 solves at construction; afterwards every
/// step costs as much as a dense problem of 2p unknowns.
#[derive(Debug, Clone)]
pub struct CondensedFriction {
    problem: FrictionProblem,
    /// C, 2p × 2p; rows and columns are the normal, then the tangential quantities.
    condensation: Condensation,
    /// Free motion at α = 0 and its rate.
    free: Vec<f64>,
    free_rate: Vec<f64>,
    pattern: Pattern,
    /// Made when first asked for.
    traces: OnceLock<Option<ExactTraces>>,
}

impl CondensedFriction {
    /// Condenses a problem.
    ///
    /// # Errors
    /// A that is not symmetric or not positive definite; loads that are not affine in α (their free motion would need a solve at
    /// every α: use the full form).
    pub fn new(problem: FrictionProblem) -> Result<Self, ContactError> {
        let p = problem.num_contacts();
        check_symmetric(&problem.a)?;
        let Path::Affine { constant, slope } = &problem.load.0 else {
            return Err(ContactError::LoadNotAffine);
        };
        let condensation = Condensation::new(&problem.a, &stacked(&problem)?)?;
        let rests = slope.iter().all(|s| *s == 0.0);
        let loads = [constant.as_slice(), if rests { &[] } else { slope }].concat();
        let mut free = condensation.traces_of_solution(&loads)?;
        let mut free_rate = free.split_off(2 * p);
        free_rate.resize(2 * p, 0.0);
        Ok(Self {
            pattern: Pattern::full(2 * p, 2 * p + 1),
            problem,
            condensation,
            free,
            free_rate,
            traces: OnceLock::new(),
        })
    }

    /// Displacements of the contact nodes without rounding: of A itself where that is small, else of C and w as stored.
    fn exact_traces(&self) -> Option<&ExactTraces> {
        let make = || {
            self.problem
                .exact_traces()
                .or_else(|| ExactTraces::stored(|k| self.compliance_row(k), &self.free, &self.free_rate))
        };
        self.traces.get_or_init(make).as_ref()
    }

    /// The compliance C = B A⁻¹ Bᵀ, 2p × 2p: normal quantities first, then tangential.
    #[must_use]
    pub fn compliance(&self) -> &Matrix {
        self.condensation.compliance()
    }

    /// Row k of C, which is its column k.
    fn compliance_row(&self, k: usize) -> &[f64] {
        let q = 2 * self.problem.num_contacts();
        &self.condensation.compliance().values()[k * q..(k + 1) * q]
    }

    /// The point (u, λν, λt, α) of the full form.
    ///
    /// # Errors
    /// Wrong length; failures of the linear solver.
    pub fn expand(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        let mut full = self.displacements(x)?;
        full.extend_from_slice(x);
        Ok(full)
    }

    /// The point (λν, λt, α) of the condensed form.
    ///
    /// # Errors
    /// Wrong length.
    pub fn restrict(&self, full: &[f64]) -> Result<Vec<f64>, ContactError> {
        let n = self.problem.num_displacements();
        check_length("the full point", full, self.problem.num_vars())?;
        Ok(full[n..].to_vec())
    }

    /// Displacement (less the gap) of contact quantity k: normal ones first.
    fn displacement(&self, k: usize, x: &[f64]) -> f64 {
        let p = self.problem.num_contacts();
        let q = 2 * p;
        let row = self.compliance_row(k);
        let reaction = dot(row, x);
        let gap = if k < p { self.problem.gap[k] } else { 0.0 };
        self.free[k] + x[q] * self.free_rate[k] - reaction - gap
    }

    fn node(&self, i: usize, x: &[f64], friction: f64) -> NodeValues {
        let p = self.problem.num_contacts();
        NodeValues {
            penetration: self.displacement(i, x),
            slip: self.displacement(p + i, x),
            pressure: x[i],
            traction: x[p + i],
            friction,
        }
    }

    /// F of one node and dF/dα.
    fn friction(&self, i: usize, alpha: f64) -> (f64, f64) {
        match &self.problem.friction.0 {
            Path::Affine { constant, slope } => (constant[i] + alpha * slope[i], slope[i]),
            path @ Path::Function(_) => {
                let p = self.problem.num_contacts();
                let (mut value, mut derivative) = (vec![0.0; p], vec![0.0; p]);
                path.value(alpha, &mut value, &mut derivative);
                (value[i], derivative[i])
            }
        }
    }

    fn for_nodes(&self, x: &[f64], mut f: impl FnMut(usize, NodeValues, f64)) {
        self.for_friction(x, |i, friction, rate| f(i, self.node(i, x, friction), rate));
    }

    /// As [`for_nodes`](Self::for_nodes), for derivatives: where F does not depend on α these do not depend on displacements, which
    /// are left out.
    fn for_rows(&self, x: &[f64], mut f: impl FnMut(usize, NodeValues, f64)) {
        self.for_friction(x, |i, friction, rate| {
            f(i, self.node_for_rows(i, x, (friction, rate)), rate)
        });
    }

    fn node_for_rows(&self, i: usize, x: &[f64], (friction, rate): (f64, f64)) -> NodeValues {
        if rate != 0.0 {
            return self.node(i, x, friction);
        }
        NodeValues {
            penetration: 0.0,
            slip: 0.0,
            pressure: x[i],
            traction: x[self.problem.num_contacts() + i],
            friction,
        }
    }

    /// Calls `f` with each node, its F and dF/dα.
    fn for_friction(&self, x: &[f64], mut f: impl FnMut(usize, f64, f64)) {
        let p = self.problem.num_contacts();
        let alpha = x[2 * p];
        match &self.problem.friction.0 {
            Path::Affine { constant, slope } => {
                for i in 0..p {
                    f(i, constant[i] + alpha * slope[i], slope[i]);
                }
            }
            path @ Path::Function(_) => {
                let (mut value, mut derivative) = (vec![0.0; p], vec![0.0; p]);
                path.value(alpha, &mut value, &mut derivative);
                for i in 0..p {
                    f(i, value[i], derivative[i]);
                }
            }
        }
    }

    /// Adds the two rows of node i, which uses `piece`.
    fn add_rows(&self, i: usize, piece: usize, v: &NodeValues, friction_rate: f64, jac: &mut Matrix) {
        let p = self.problem.num_contacts();
        let q = 2 * p;
        let rows = self.problem.law.rows(piece, v);
        let (normal, tangential) = (self.compliance_row(i), self.compliance_row(p + i));
        for (row, index) in rows.iter().zip([i, p + i]) {
            let closed = row.penetration != 0.0 || row.slip != 0.0;
            if closed && jac.pattern().is_full() {
                // The rows of a closed node are full: written by strides, as a search a entry would cost most of a step.
                for (factor, compliance) in [(row.penetration, normal), (row.slip, tangential)] {
                    if factor != 0.0 {
                        for (column, c) in jac.values_mut().chunks_exact_mut(q).zip(compliance) {
                            column[index] -= factor * c;
                        }
                    }
                }
                jac.add(index, i, row.pressure);
                jac.add(index, p + i, row.traction);
                jac.add(index, q, self.entry(i, row, friction_rate, q));
            } else {
                let columns = if closed { 0..q } else { i..i };
                for j in columns.chain([q]) {
                    jac.add(index, j, self.entry(i, row, friction_rate, j));
                }
                if !closed {
                    jac.add(index, i, row.pressure);
                    jac.add(index, p + i, row.traction);
                }
            }
        }
    }

    /// The derivative of a node quantity with respect to column j.
    fn entry(&self, i: usize, row: &Row, friction_rate: f64, j: usize) -> f64 {
        let p = self.problem.num_contacts();
        let q = 2 * p;
        if j == q {
            return row.penetration * self.free_rate[i]
                + row.slip * self.free_rate[p + i]
                + row.friction * friction_rate;
        }
        let mut v = -row.penetration * self.compliance_row(i)[j] - row.slip * self.compliance_row(p + i)[j];
        if j == i {
            v += row.pressure;
        }
        if j == p + i {
            v += row.traction;
        }
        v
    }
}

impl PiecewiseSmooth for CondensedFriction {
    fn num_vars(&self) -> usize {
        2 * self.problem.num_contacts() + 1
    }

    fn num_residuals(&self) -> usize {
        2 * self.problem.num_contacts()
    }

    fn num_sites(&self) -> usize {
        self.problem.num_contacts()
    }

    fn num_pieces(&self, _site: usize) -> usize {
        self.problem.law.num_pieces()
    }

    fn num_tests(&self, _site: usize) -> usize {
        TESTS
    }

    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        self.problem.law.cell(piece)
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.problem.piece_name(site, piece)
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.problem.site_name(site)
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.extend([site, self.problem.num_contacts() + site]);
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.problem.is_piecewise_affine()
    }

    fn exact(&self) -> Option<&dyn ExactPieces> {
        self.problem.states_coefficients().then_some(self)
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        fill_sizes(self.problem.sizes(), 0, sizes);
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let law = self.problem.law;
        let mut chunks = out.chunks_exact_mut(TESTS);
        self.for_nodes(x, |_, v, _| {
            if let Some(chunk) = chunks.next() {
                chunk.copy_from_slice(&law.tests(&v));
            }
        });
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let p = self.problem.num_contacts();
        self.for_nodes(x, |i, v, _| {
            let [normal, tangential] = self.problem.law.residual(selection.piece(i), &v);
            out[i] = normal;
            out[p + i] = tangential;
        });
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        self.for_rows(x, |i, v, rate| {
            self.add_rows(i, selection.piece(i), &v, rate, jac)
        });
    }

    fn site_jacobian(&self, site: usize, selection: &Selection, x: &[f64], jac: &mut Matrix) -> bool {
        let (friction, rate) = self.friction(site, x[x.len() - 1]);
        let v = self.node_for_rows(site, x, (friction, rate));
        self.add_rows(site, selection.piece(site), &v, rate, jac);
        true
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let p = self.problem.num_contacts();
        let q = 2 * p;
        let moved = |k: usize| -> f64 {
            let row = self.compliance_row(k);
            let reaction = dot(row, d);
            d[q] * self.free_rate[k] - reaction
        };
        let mut chunks = out.chunks_exact_mut(TESTS);
        self.for_rows(x, |i, v, friction_rate| {
            let (penetration, slip) = (moved(i), moved(p + i));
            let rows = self.problem.law.test_rows(&v);
            for (o, row) in chunks.next().into_iter().flatten().zip(&rows) {
                *o = row.penetration * penetration
                    + row.slip * slip
                    + row.pressure * d[i]
                    + row.traction * d[p + i]
                    + row.friction * friction_rate * d[q];
            }
        });
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let (friction, friction_rate) = self.friction(site, x[x.len() - 1]);
        let v = self.node_for_rows(site, x, (friction, friction_rate));
        let row = self.problem.law.test_rows(&v)[test.min(TESTS - 1)];
        for (j, g) in gradient.iter_mut().enumerate() {
            *g = self.entry(site, &row, friction_rate, j);
        }
    }
}

impl ExactPieces for CondensedFriction {
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let friction = self.problem.exact_friction(alpha)?;
        self.exact_traces()?
            .conditions(alpha, |k| self.problem.held(k), &friction)
    }
}

impl FrictionMap for CondensedFriction {
    fn problem(&self) -> &FrictionProblem {
        &self.problem
    }

    fn nodes(&self, x: &[f64]) -> Vec<NodeValues> {
        let mut nodes = Vec::with_capacity(self.num_sites());
        if x.len() == self.num_vars() {
            self.for_nodes(x, |_, v, _| nodes.push(v));
        }
        nodes
    }

    fn displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        let p = self.problem.num_contacts();
        check_length("the solution x", x, self.num_vars())?;
        let mut u = self.problem.load_at(x[2 * p]);
        self.condensation.expand(&x[..2 * p], &mut u)?;
        Ok(u)
    }
}

/// B = (Bν; Bt).
fn stacked(problem: &FrictionProblem) -> Result<Matrix, ContactError> {
    let (n, p) = (problem.num_displacements(), problem.num_contacts());
    let normal = problem.bnu_t.triplets().map(|(j, i, v)| (i, j, v));
    let tangential = problem.bt_t.triplets().map(|(j, i, v)| (p + i, j, v));
    let entries: Vec<_> = normal.chain(tangential).collect();
    Ok(Matrix::from_triplets(2 * p, n, &entries)?)
}

pub(super) fn check_symmetric(a: &Matrix) -> Result<(), ContactError> {
    match a.asymmetry(1e-10) {
        Some((row, col, difference)) => Err(ContactError::NotSymmetric { row, col, difference }),
        None => Ok(()),
    }
}
