use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::approach::lower;
use super::condensed::check_symmetric;
use super::error::{check_finite, check_length};
use super::exact::{ExactTraces, exact_friction, held_at, states_coefficients};
use super::form::{Form, sites_of_the_law};
use super::full_contact::held;
use super::node_law::{LocalRow, LocalValues, MAX_TESTS, NodeLaw};
use super::paths::Path;
use super::reduced::reduced_newton;
use super::solution::judge;
use super::tries::Observer;
use super::{
    ContactBody, ContactError, ContactOptions, ContactProgress, ContactReport, ContactSolution,
    DelassusProblem, strategy,
};
use crate::interface::fill_sizes;
use crate::linear::{AutoSolver, Condensation, LinearSolver};
use crate::piecewise::{ExactConditions, ExactPieces, Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, dot};

/// A [`ContactBody`] under a [`NodeLaw`], condensed onto its contact nodes: x = (λν, λt₁[, λt₂], α).
///
/// With C = B A⁻¹ Bᵀ and the free motion w(α) = B A⁻¹ f(α) the displacements of the contact nodes are w(α) − C λ. Sites are the contact
/// nodes; pieces, cells and test functions are those of the law.
#[derive(Debug, Clone)]
pub struct CondensedContact<L> {
    pub(super) body: Arc<ContactBody>,
    pub(super) law: L,
    condensation: Arc<Condensation>,
    free: Vec<f64>,
    free_rate: Vec<f64>,
    /// f₀ᵀ A⁻¹ f₀, f₀ᵀ A⁻¹ f₁, f₁ᵀ A⁻¹ f₁ of the load f₀ + α f₁.
    free_energy: [f64; 3],
    /// Tangential displacements that count as no slip, by t₁, then t₂.
    pub(super) reference: Vec<f64>,
    pub(super) r: f64,
    /// 1 / mean diag C.
    stiffness: f64,
    pattern: Pattern,
}

impl<L: NodeLaw> CondensedContact<L> {
    /// Condenses a body. The augmentation parameter is 1 / mean diag C; solutions do not depend on it.
    ///
    /// # Errors
    /// A law of another dimension, A that is not symmetric or not positive definite, loads that are not affine in α.
    pub fn new(body: ContactBody, law: L) -> Result<Self, ContactError> {
        body.check_law(&law)?;
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
        let (mut u, mut rate) = (constant.clone(), slope.clone());
        condensation.expand(&vec![0.0; q], &mut u)?;
        if slope.iter().any(|s| *s != 0.0) {
            condensation.expand(&vec![0.0; q], &mut rate)?;
        }
        let (mut free, mut free_rate) = (vec![0.0; q], vec![0.0; q]);
        stacked.mul_vec(&u, &mut free);
        stacked.mul_vec(&rate, &mut free_rate);
        let free_energy = [dot(constant, &u), dot(constant, &rate), dot(slope, &rate)];
        let trace: f64 = (0..q)
            .map(|k| condensation.compliance().values()[k * q + k])
            .sum();
        Ok(Self {
            r: q as f64 / trace,
            stiffness: q as f64 / trace,
            reference: vec![0.0; q - p],
            pattern: Pattern::full(q, q + 1),
            body: Arc::new(body),
            law,
            condensation: Arc::new(condensation),
            free,
            free_rate,
            free_energy,
        })
    }

    /// The same body under another law: nothing is factored anew.
    ///
    /// # Errors
    /// A law of another dimension.
    pub fn with_law<M: NodeLaw>(&self, law: M) -> Result<CondensedContact<M>, ContactError> {
        self.body.check_law(&law)?;
        Ok(self.changed(law))
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

    pub(super) fn values(&self, i: usize, x: &[f64]) -> LocalValues {
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

    /// States, local quantities, energies and residuals at x.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        let q = self.order();
        let [constant, mixed, slope] = self.free_energy;
        let mut image = vec![0.0; q];
        self.compliance().as_ref().mul_add(1.0, &x[..q], &mut image);
        let free = constant + x[q] * (2.0 * mixed + x[q] * slope);
        let (reaction, both) = (dot(&image, &x[..q]), dot(&self.free_motion(x[q]), &x[..q]));
        Ok(ContactSolution::assemble(
            (0..self.num_contacts()).map(|i| self.values(i, x)).collect(),
            |v| judge(&self.law, v),
            |i| held(&self.body.gap, &self.reference, i),
            (0.5 * (free + reaction) - both, free - both, 0.0),
        ))
    }

    /// The problem at α in Delassus form: r = (λν, −λt) and u = (gap − u_ν, u_t less its reference) node by node, components divided and
    /// multiplied by F where that differs along t₁ and t₂ (then with coefficient 1). Solutions come back by
    /// [`point_of_reactions`](Self::point_of_reactions).
    ///
    /// # Errors
    /// [`ContactError::NotCoulomb`] unless the law is Coulomb's with coefficients that do not depend on the slip.
    pub fn delassus(&self, alpha: f64) -> Result<DelassusProblem, ContactError> {
        super::error::check_finite("the parameter", &[alpha])?;
        let (p, q, blocks) = (self.num_contacts(), self.order(), self.body.traces.len());
        let (friction, scale) = self.delassus_scale(alpha)?;
        let free = self.free_motion(alpha);
        let place = |k: usize| (k % p) * blocks + k / p;
        let sign = |k: usize| if k < p { -scale[k] } else { scale[k] };
        let mut matrix = Matrix::zeros(Pattern::full(q, q));
        let mut load = vec![0.0; q];
        for k in 0..q {
            let column = place(k) * q;
            for (j, c) in self.row(k).iter().enumerate() {
                matrix.values_mut()[column + place(j)] = sign(j) * sign(k) * c;
            }
            let at_rest = if k < p {
                self.body.gap[k]
            } else {
                self.reference[k - p]
            };
            load[place(k)] = sign(k) * (free[k] - at_rest);
        }
        Ok(DelassusProblem::new(blocks, matrix, load, friction)?)
    }

    /// The point x = (λν, λt, α) of reactions r of the Delassus form.
    ///
    /// # Errors
    /// As [`delassus`](Self::delassus); wrong length, values that are not finite.
    pub fn point_of_reactions(&self, alpha: f64, r: &[f64]) -> Result<Vec<f64>, ContactError> {
        let (p, q, blocks) = (self.num_contacts(), self.order(), self.body.traces.len());
        check_length("the reactions", r, q)?;
        check_finite("alpha", &[alpha])?;
        let (_, scale) = self.delassus_scale(alpha)?;
        let force = |k: usize| scale[k] * r[(k % p) * blocks + k / p];
        let forces = (0..q).map(|k| if k < p { force(k) } else { -force(k) });
        Ok(forces.chain([alpha]).collect())
    }

    /// Coefficients of the Delassus form, and the factor of each component.
    fn delassus_scale(&self, alpha: f64) -> Result<(Vec<f64>, Vec<f64>), ContactError> {
        if !self.law.is_coulomb() {
            return Err(ContactError::NotCoulomb);
        }
        let p = self.num_contacts();
        let (mut friction, mut scale) = (vec![1.0; p], vec![1.0; self.order()]);
        for i in 0..p {
            let v = LocalValues {
                node: i,
                parameter: alpha,
                ..LocalValues::default()
            };
            self.law.check(&v)?;
            let f = self.law.friction(&v);
            if self.body.num_tangents() == 1 || f[0] == f[1] {
                friction[i] = f[0];
            } else {
                (scale[p + i], scale[2 * p + i]) = (f[0], f[1]);
            }
        }
        Ok((friction, scale))
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

    /// [`solve_reported`](Self::solve_reported) with options, telling `observe` of each attempt and each point on the way; it may stop
    /// the search.
    ///
    /// # Errors
    /// As [`solve`](Self::solve), and options out of range; a search stopped by `observe` or by `max_time` is a
    /// [`ContactError::NoStart`] with [`Failure::Interrupted`](crate::newton::Failure::Interrupted).
    pub fn solve_observed(
        &self,
        alpha: f64,
        start: Option<&[f64]>,
        options: &ContactOptions,
        mut observe: impl FnMut(&ContactProgress) -> ControlFlow<()>,
    ) -> Result<ContactReport, ContactError> {
        let mut descend = |way, see: &mut Observer<'_>| lower(self, alpha, way, options, see);
        strategy::solve(self, alpha, start, options, &mut descend, &mut observe)
    }

    fn changed<M>(&self, law: M) -> CondensedContact<M> {
        CondensedContact {
            body: Arc::clone(&self.body),
            law,
            condensation: Arc::clone(&self.condensation),
            free: self.free.clone(),
            free_rate: self.free_rate.clone(),
            free_energy: self.free_energy,
            r: self.r,
            stiffness: self.stiffness,
            reference: self.reference.clone(),
            pattern: self.pattern.clone(),
        }
    }
}

impl<L: NodeLaw> Form for CondensedContact<L> {
    type Law = L;
    type Under<M: NodeLaw> = CondensedContact<M>;

    fn law(&self) -> &L {
        &self.law
    }

    fn augmentation(&self) -> f64 {
        self.r
    }

    fn stiffness(&self) -> f64 {
        self.stiffness
    }

    fn values(&self, node: usize, x: &[f64]) -> LocalValues {
        self.values(node, x)
    }

    fn under<M: NodeLaw>(&self, law: M, r: f64) -> CondensedContact<M> {
        let mut other = self.changed(law);
        other.r = r;
        other
    }

    fn at_load<M: NodeLaw>(&self, alpha: f64, law: M) -> Result<CondensedContact<M>, ContactError> {
        let mut other = self.under(law, self.stiffness);
        other.free = self.free_motion(alpha);
        other.free_rate.fill(0.0);
        Ok(other)
    }

    fn stick(&self, alpha: f64) -> Result<Option<Vec<f64>>, ContactError> {
        Ok(self.stick_start(alpha).ok())
    }

    fn improve(&self, x: &mut [f64], max_iterations: usize) -> bool {
        reduced_newton(self, x, max_iterations)
    }
}

impl<L: NodeLaw> PiecewiseSmooth for CondensedContact<L> {
    sites_of_the_law!();

    fn num_vars(&self) -> usize {
        self.order() + 1
    }

    fn num_residuals(&self) -> usize {
        self.order()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.law.is_affine()
    }

    fn exact(&self) -> Option<&dyn ExactPieces> {
        states_coefficients(&self.body, &self.law).then_some(self)
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        fill_sizes(self.body.sizes(), 0, sizes);
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
                let at = block * p + i;
                if jac.pattern().is_full() {
                    // By strides, as a search for each entry would cost most of a step.
                    let (n, values) = (self.order(), jac.values_mut());
                    self.scatter(i, row, |j, value| values[j * n + at] += value);
                } else {
                    self.scatter(i, row, |j, value| jac.add(at, j, value));
                }
            }
        }
    }
}

impl<L: NodeLaw> ExactPieces for CondensedContact<L> {
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let friction = exact_friction(&self.body, &self.law)?;
        let transposes = self.body.planar_transposes()?;
        let Path::Affine { constant, slope } = &self.body.load.0 else {
            return None;
        };
        // Under a frozen load the free motion is no longer that of the body.
        let own = self.free_rate.iter().any(|r| *r != 0.0) || slope.iter().all(|s| *s == 0.0);
        let of_body = || {
            let load: [&[f64]; 2] = [constant, slope];
            ExactTraces::of_stiffness(&self.body.a, [&transposes[0], &transposes[1]], load)
        };
        let traces = own.then(of_body).flatten();
        let traces = traces.or_else(|| ExactTraces::stored(|k| self.row(k), &self.free, &self.free_rate))?;
        traces.conditions(alpha, |k| held_at(&self.body, &self.reference, k), &friction)
    }
}
