use std::borrow::Cow;

use super::condensed::check_symmetric;
use super::error::check_length;
use super::node_law::{LocalRow, LocalValues, MAX_TESTS, NodeLaw};
use super::paths::Path;
use super::{ContactBody, ContactError, ContactState};
use crate::linear::{AutoSolver, Condensation, LinearSolver};
use crate::newton::{Newton, NewtonError, NewtonOptions};
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// A [`ContactBody`] under a [`NodeLaw`], condensed onto its contact nodes: x = (λν, λt₁[, λt₂], α).
///
/// With C = B A⁻¹ Bᵀ and the free motion w(α) = B A⁻¹ f(α) the displacements of the contact nodes are w(α) − C λ. Sites are the contact
/// nodes; pieces, cells and test functions are those of the law.
#[derive(Debug, Clone)]
pub struct CondensedContact<L> {
    body: ContactBody,
    law: L,
    condensation: Condensation,
    free: Vec<f64>,
    free_rate: Vec<f64>,
    /// Tangential displacements that count as no slip, by t₁, then t₂.
    reference: Vec<f64>,
    r: f64,
    pattern: Pattern,
}

/// A solution, node by node.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ContactSolution {
    /// Open, stick or slip.
    pub states: Vec<ContactState>,
    /// Quantities at the nodes: penetrations, slips, nodal forces.
    pub nodes: Vec<LocalValues>,
}

impl<L: NodeLaw> CondensedContact<L> {
    /// Condenses a body. The augmentation parameter is 1 / mean diag C; solutions do not depend on it.
    ///
    /// # Errors
    /// A law of another dimension, A that is not symmetric or not positive definite, loads that are not affine in α.
    pub fn new(body: ContactBody, law: L) -> Result<Self, ContactError> {
        if law.num_tangents() != body.num_tangents() {
            return Err(ContactError::Tangents {
                law: law.num_tangents(),
                body: body.num_tangents(),
            });
        }
        check_symmetric(&body.a)?;
        let Path::Affine { constant, slope } = &body.load.0 else {
            return Err(ContactError::LoadNotAffine);
        };
        let p = body.num_contacts();
        let q = p * body.traces.len();
        let mut entries = Vec::new();
        for (block, trace) in body.traces.iter().enumerate() {
            entries.extend(trace.triplets().map(|(i, j, v)| (block * p + i, j, v)));
        }
        let stacked = Matrix::from_triplets(q, body.num_displacements(), &entries)?;
        let condensation = Condensation::new(&body.a, &stacked)?;
        let free = condensation.traces_of_solution(constant)?;
        let free_rate = if slope.iter().all(|s| *s == 0.0) {
            vec![0.0; q]
        } else {
            condensation.traces_of_solution(slope)?
        };
        let trace: f64 = (0..q)
            .map(|k| condensation.compliance().values()[k * q + k])
            .sum();
        Ok(Self {
            r: q as f64 / trace,
            reference: vec![0.0; q - p],
            pattern: Pattern::full(q, q + 1),
            body,
            law,
            condensation,
            free,
            free_rate,
        })
    }

    /// The same body under another law: nothing is factored anew.
    ///
    /// # Errors
    /// A law of another dimension.
    pub fn with_law<M: NodeLaw>(&self, law: M) -> Result<CondensedContact<M>, ContactError> {
        if law.num_tangents() != self.body.num_tangents() {
            return Err(ContactError::Tangents {
                law: law.num_tangents(),
                body: self.body.num_tangents(),
            });
        }
        Ok(CondensedContact {
            body: self.body.clone(),
            law,
            condensation: self.condensation.clone(),
            free: self.free.clone(),
            free_rate: self.free_rate.clone(),
            r: self.r,
            reference: self.reference.clone(),
            pattern: self.pattern.clone(),
        })
    }

    /// Sets the augmentation parameter r > 0 (force per length).
    ///
    /// # Errors
    /// r ≤ 0 or not finite.
    pub fn with_r(mut self, r: f64) -> Result<Self, ContactError> {
        if !(r > 0.0 && r.is_finite()) {
            return Err(ContactError::Augmentation { r });
        }
        self.r = r;
        Ok(self)
    }

    /// Sets the tangential displacements from which slips are measured (all along t₁, then all along t₂): those of the step before, in a
    /// history of loading. Zero at first.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn set_reference_slip(&mut self, reference: &[f64]) -> Result<(), ContactError> {
        check_length("the reference of the slip", reference, self.reference.len())?;
        self.reference.copy_from_slice(reference);
        Ok(())
    }

    /// Displacements u_ν (from the undeformed state), u_t₁[, u_t₂] of the contact nodes at x, in the order of
    /// [`compliance`](Self::compliance).
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn contact_displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        let q = self.order();
        let mut v = self.free_motion(x[q]);
        self.compliance().as_ref().mul_add(-1.0, &x[..q], &mut v);
        Ok(v)
    }

    /// The augmentation parameter.
    #[must_use]
    pub fn r(&self) -> f64 {
        self.r
    }

    /// The body.
    #[must_use]
    pub fn body(&self) -> &ContactBody {
        &self.body
    }

    /// The law.
    #[must_use]
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The law, to be changed.
    pub fn law_mut(&mut self) -> &mut L {
        &mut self.law
    }

    /// The compliance C = B A⁻¹ Bᵀ: normal quantities first, then those along t₁, then t₂.
    #[must_use]
    pub fn compliance(&self) -> &Matrix {
        self.condensation.compliance()
    }

    /// The displacements of the contact nodes without contact forces, w(α), in the order of [`compliance`](Self::compliance).
    #[must_use]
    pub fn free_motion(&self, alpha: f64) -> Vec<f64> {
        let terms = self.free.iter().zip(&self.free_rate);
        terms.map(|(w, rate)| w + alpha * rate).collect()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.body.num_contacts()
    }

    fn order(&self) -> usize {
        self.free.len()
    }

    fn row(&self, k: usize) -> &[f64] {
        let q = self.order();
        &self.condensation.compliance().values()[k * q..(k + 1) * q]
    }

    fn values(&self, i: usize, x: &[f64]) -> LocalValues {
        let (p, q) = (self.num_contacts(), self.order());
        let displacement = |k: usize| {
            let reaction: f64 = self.row(k).iter().zip(x).map(|(c, l)| c * l).sum();
            self.free[k] + x[q] * self.free_rate[k] - reaction
        };
        let mut v = LocalValues {
            node: i,
            penetration: displacement(i) - self.body.gap[i],
            pressure: x[i],
            parameter: x[q],
            r: self.r,
            ..LocalValues::default()
        };
        for d in 0..self.body.num_tangents() {
            v.slip[d] = displacement((d + 1) * p + i) - self.reference[d * p + i];
            v.traction[d] = x[(d + 1) * p + i];
        }
        v
    }

    /// Derivative of a function of the values of node i with respect to all of x, added to `out` times `scale`.
    fn scatter(&self, i: usize, row: &LocalRow, mut add: impl FnMut(usize, f64)) {
        let (p, q) = (self.num_contacts(), self.order());
        let mut blocks = [(0, row.penetration, row.pressure); 3];
        for d in 0..2 {
            blocks[d + 1] = (d + 1, row.slip[d], row.traction[d]);
        }
        let mut rate = row.parameter;
        for &(block, displacement, force) in &blocks[..self.body.traces.len()] {
            let k = block * p + i;
            if displacement != 0.0 {
                rate += displacement * self.free_rate[k];
                for (j, c) in self.row(k).iter().enumerate() {
                    add(j, -displacement * c);
                }
            }
            if force != 0.0 {
                add(k, force);
            }
        }
        add(q, rate);
    }

    /// States and local quantities at x.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        let nodes: Vec<LocalValues> = (0..self.num_contacts()).map(|i| self.values(i, x)).collect();
        let mut tests = [0.0; MAX_TESTS];
        let states = nodes
            .iter()
            .map(|v| {
                self.law.tests(v, &mut tests);
                let margin = |piece: usize| crate::piecewise::cell_margin(self.law.cell(piece), &tests);
                let piece = (0..self.law.num_pieces())
                    .max_by(|&a, &b| margin(a).total_cmp(&margin(b)))
                    .unwrap_or(0);
                self.law.state(piece, v)
            })
            .collect();
        Ok(ContactSolution { states, nodes })
    }

    /// All displacements u at x.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        let q = self.order();
        let mut u = self.body.load_at(x[q]);
        self.condensation.expand(&x[..q], &mut u)?;
        Ok(u)
    }

    /// The forces that keep all contact nodes at u_ν = gap without slip: a start from the stick-like side.
    ///
    /// # Errors
    /// A singular compliance.
    pub fn stick_start(&self, alpha: f64) -> Result<Vec<f64>, ContactError> {
        let mut x = self.free_motion(alpha);
        for (w, held) in x.iter_mut().zip(self.body.gap.iter().chain(&self.reference)) {
            *w -= held;
        }
        let mut solver = AutoSolver::default();
        solver.analyze(self.compliance().pattern().as_ref())?;
        solver.factor(self.compliance().as_ref())?;
        solver.solve_in_place(&mut x)?;
        x.push(alpha);
        Ok(x)
    }

    /// A solution at fixed α by PS-Newton from `start` (α is set), or, where that fails, from zero and from stick.
    ///
    /// # Errors
    /// Coefficients of friction that are negative or not finite, [`ContactError::NoStart`] when no start converges.
    pub fn solve(&self, alpha: f64, start: Option<&[f64]>) -> Result<Vec<f64>, ContactError> {
        super::error::check_finite("the parameter", &[alpha])?;
        let mut zero = vec![0.0; self.num_vars()];
        zero[self.order()] = alpha;
        for i in 0..self.num_contacts() {
            self.law.check(&LocalValues {
                slip: [0.0; 2],
                ..self.values(i, &zero)
            })?;
        }
        let mut starts = Vec::new();
        if let Some(x) = start {
            check_length("the start", x, self.num_vars())?;
            let mut x = x.to_vec();
            x[self.order()] = alpha;
            starts.push(x);
        }
        starts.push(zero);
        if let Ok(x) = self.stick_start(alpha) {
            starts.push(x);
        }
        let mut newton = Newton::new(NewtonOptions::default());
        let mut failure = None;
        for mut x in starts {
            match newton.solve(self, &mut x) {
                Ok(_) => return Ok(x),
                Err(NewtonError::Map(e)) => return Err(e.into()),
                Err(e) => failure = Some(e),
            }
        }
        match failure {
            Some(source) => Err(ContactError::NoStart {
                parameter: alpha,
                source: Box::new(source),
            }),
            None => Err(ContactError::Empty {
                what: "no start was tried",
            }),
        }
    }
}

impl<L: NodeLaw> PiecewiseSmooth for CondensedContact<L> {
    fn num_vars(&self) -> usize {
        self.order() + 1
    }

    fn num_residuals(&self) -> usize {
        self.order()
    }

    fn num_sites(&self) -> usize {
        self.num_contacts()
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

    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(self.law.piece_name(piece))
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("contact node {site}"))
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        let p = self.num_contacts();
        rows.clear();
        rows.extend((0..self.body.traces.len()).map(|block| block * p + site));
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.law.is_affine()
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (i, chunk) in out.chunks_exact_mut(self.law.num_tests()).enumerate() {
            self.law.tests(&self.values(i, x), chunk);
        }
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let p = self.num_contacts();
        for i in 0..p {
            let h = self.law.residual(selection.piece(i), &self.values(i, x));
            for (block, value) in h.iter().enumerate().take(self.body.traces.len()) {
                out[block * p + i] = *value;
            }
        }
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let p = self.num_contacts();
        for i in 0..p {
            let rows = self.law.rows(selection.piece(i), &self.values(i, x));
            for (block, row) in rows.iter().enumerate().take(self.body.traces.len()) {
                self.scatter(i, row, |j, value| jac.add(block * p + i, j, value));
            }
        }
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let mut rows = [LocalRow::default(); MAX_TESTS];
        for (i, chunk) in out.chunks_exact_mut(self.law.num_tests()).enumerate() {
            self.law.test_rows(&self.values(i, x), &mut rows);
            for (o, row) in chunk.iter_mut().zip(&rows) {
                *o = 0.0;
                self.scatter(i, row, |j, value| *o += value * d[j]);
            }
        }
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let mut rows = [LocalRow::default(); MAX_TESTS];
        self.law.test_rows(&self.values(site, x), &mut rows);
        gradient.fill(0.0);
        self.scatter(site, &rows[test.min(MAX_TESTS - 1)], |j, value| {
            gradient[j] += value
        });
    }
}
