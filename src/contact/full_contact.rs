use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::approach::lower;
use super::error::check_length;
use super::exact::{exact_friction, full_conditions, held_at, states_coefficients};
use super::form::{Form, sites_of_the_law};
use super::node_law::{LocalRow, LocalValues, MAX_TESTS, NodeLaw};
use super::paths::Path;
use super::solution::{imbalance, judge};
use super::tries::{Observer, newton_step};
use super::{
    CondensedContact, ContactBody, ContactError, ContactOptions, ContactProgress, ContactReport,
    ContactSolution, ContactState, LoadPath, strategy,
};
use crate::interface::fill_sizes;
use crate::piecewise::{ExactConditions, ExactPieces, Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, dot};

/// Pressures and tractions up to which the way down is followed in condensed form, whose matrices are dense.
const CONDENSED: usize = 10_000;

/// A [`ContactBody`] under a [`NodeLaw`] in full form, sparse: x = (u, λν, λt₁[, λt₂], α).
///
/// ```text
/// H(x) = ( A u + Bνᵀ λν + Σ Btᵀ λt − f(α);  H_ν;  H_t ),   H_ν, H_t from the law at each node
/// ```
///
/// The same sites, pieces and solutions as [`CondensedContact`](super::CondensedContact), without its demands: A need not be symmetric
/// nor the load affine in α. Each Newton step is one sparse factorisation.
#[derive(Debug, Clone)]
pub struct FullContact<L> {
    pub(super) body: Arc<ContactBody>,
    pub(super) law: L,
    /// Transposes of the traces: column i belongs to node i.
    traces: Arc<[Matrix]>,
    /// Tangential displacements that count as no slip, by t₁, then t₂.
    pub(super) reference: Vec<f64>,
    pub(super) r: f64,
    /// Mean stiffness of single contact nodes.
    stiffness: f64,
    pattern: Pattern,
}

impl<L: NodeLaw> FullContact<L> {
    /// The problem with r = mean of b A bᵀ / (b bᵀ)² over the rows b of the traces, the stiffness of single contact nodes.
    ///
    /// # Errors
    /// A law of another dimension, traces that vanish at a node.
    pub fn new(body: ContactBody, law: L) -> Result<Self, ContactError> {
        body.check_law(&law)?;
        let traces: Vec<Matrix> = body.traces.iter().map(Matrix::transpose).collect();
        let p = body.num_contacts();
        let r = node_stiffness(&body.a, &traces.iter().collect::<Vec<_>>());
        if !(r > 0.0 && r.is_finite()) {
            return Err(ContactError::Augmentation { r });
        }
        Ok(Self {
            reference: vec![0.0; p * (traces.len() - 1)],
            pattern: pattern(&body, &traces)?,
            body: Arc::new(body),
            law,
            traces: traces.into(),
            r,
            stiffness: r,
        })
    }

    /// The point (λν, λt, α) of the condensed form.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn restrict(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        Ok(x[self.body.num_displacements()..].to_vec())
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
        // The way down is followed on the contact nodes alone, where the body can be condensed.
        let mut condensed = None;
        let mut descend = |way, see: &mut Observer<'_>| match condensed.get_or_insert_with(|| {
            (self.law_rows() <= CONDENSED)
                .then(|| self.condensed(alpha).ok())
                .flatten()
        }) {
            Some(condensed) => {
                let mut end = lower(condensed, alpha, way, options, see)?;
                if let Some(end) = &mut end {
                    let u = condensed.displacements(&end.x)?;
                    end.x.splice(..0, u);
                }
                Ok(end)
            }
            None => lower(self, alpha, way, options, see),
        };
        strategy::solve(self, alpha, start, options, &mut descend, &mut observe)
    }

    /// The condensed form under the load at α.
    fn condensed(&self, alpha: f64) -> Result<CondensedContact<&L>, ContactError> {
        let mut condensed = CondensedContact::new(self.body_at(alpha), &self.law)?;
        condensed.set_reference_slip(&self.reference)?;
        Ok(condensed)
    }

    /// Number of pressures and tractions.
    fn law_rows(&self) -> usize {
        self.traces.len() * self.body.num_contacts()
    }

    fn body_at(&self, alpha: f64) -> ContactBody {
        let mut body = ContactBody::clone(&self.body);
        body.load = LoadPath::constant(self.body.load_at(alpha));
        body
    }

    /// States, local quantities, energies and residuals at x.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        let (n, p) = (self.body.num_displacements(), self.body.num_contacts());
        let u = &x[..n];
        let load = self.body.load_at(x[self.num_vars() - 1]);
        let mut stiff = vec![0.0; n];
        self.body.a.mul_vec(u, &mut stiff);
        let mut reaction = vec![0.0; n];
        for (trace, force) in self.traces.iter().zip(x[n..].chunks_exact(p)) {
            trace.as_ref().mul_add(1.0, force, &mut reaction);
        }
        let nodes = (0..p).map(|i| self.values(i, x)).collect();
        Ok(ContactSolution::assemble(
            nodes,
            |v| judge(&self.law, v),
            |i| held(&self.body.gap, &self.reference, i),
            (
                0.5 * dot(u, &stiff),
                dot(u, &load),
                imbalance(&stiff, &reaction, &load),
            ),
        ))
    }

    fn values(&self, i: usize, x: &[f64]) -> LocalValues {
        let (n, p) = (self.body.num_displacements(), self.body.num_contacts());
        let displacement = |block: usize| {
            let mut sum = 0.0;
            for_column(&self.traces[block], i, |j, v| sum += v * x[j]);
            sum
        };
        let mut v = LocalValues {
            node: i,
            penetration: displacement(0) - self.body.gap[i],
            pressure: x[n + i],
            parameter: x[x.len() - 1],
            r: self.r,
            ..LocalValues::default()
        };
        for d in 0..self.body.num_tangents() {
            v.slip[d] = displacement(d + 1) - self.reference[d * p + i];
            v.traction[d] = x[n + (d + 1) * p + i];
        }
        v
    }

    /// The gradient with respect to x of a function of the values of node i.
    fn scatter(&self, i: usize, row: &LocalRow, mut add: impl FnMut(usize, f64)) {
        let (n, p) = (self.body.num_displacements(), self.body.num_contacts());
        for (block, trace) in self.traces.iter().enumerate() {
            let (displacement, force) = match block {
                0 => (row.penetration, row.pressure),
                d => (row.slip[d - 1], row.traction[d - 1]),
            };
            if displacement != 0.0 {
                for_column(trace, i, |j, v| add(j, displacement * v));
            }
            if force != 0.0 {
                add(n + block * p + i, force);
            }
        }
        if row.parameter != 0.0 {
            add(n + self.traces.len() * p, row.parameter);
        }
    }
}

impl<L: NodeLaw> Form for FullContact<L> {
    type Law = L;
    type Under<M: NodeLaw> = FullContact<M>;

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

    fn under<M: NodeLaw>(&self, law: M, r: f64) -> FullContact<M> {
        FullContact {
            body: Arc::clone(&self.body),
            law,
            traces: Arc::clone(&self.traces),
            reference: self.reference.clone(),
            r,
            stiffness: self.stiffness,
            pattern: self.pattern.clone(),
        }
    }

    fn at_load<M: NodeLaw>(&self, alpha: f64, law: M) -> Result<FullContact<M>, ContactError> {
        let body = self.body_at(alpha);
        let mut other = self.under(law, self.stiffness);
        other.pattern = pattern(&body, &self.traces)?;
        other.body = Arc::new(body);
        Ok(other)
    }

    fn stick(&self, alpha: f64) -> Result<Option<Vec<f64>>, ContactError> {
        let pieces = self.law.num_pieces();
        let at_rest = |&k: &usize| self.law.state(k, &LocalValues::default()) == ContactState::Stick;
        let piece = (0..pieces).rev().find(at_rest);
        let selection = Selection::uniform(self.body.num_contacts(), piece.unwrap_or(pieces - 1));
        let mut zero = vec![0.0; self.num_vars()];
        zero[self.num_residuals()] = alpha;
        newton_step(self, &selection, zero)
    }
}

/// u_ν, u_t less penetration and slip.
pub(super) fn held(gap: &[f64], reference: &[f64], i: usize) -> [f64; 3] {
    let p = gap.len();
    let at = |d: usize| reference.get(d * p + i).copied().unwrap_or(0.0);
    [gap[i], at(0), at(1)]
}

impl<L: NodeLaw> PiecewiseSmooth for FullContact<L> {
    sites_of_the_law!();

    fn num_vars(&self) -> usize {
        self.num_residuals() + 1
    }

    fn num_residuals(&self) -> usize {
        self.body.num_displacements() + self.traces.len() * self.body.num_contacts()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.law.is_affine() && self.body.load.0.is_affine()
    }

    fn exact(&self) -> Option<&dyn ExactPieces> {
        states_coefficients(&self.body, &self.law).then_some(self)
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        fill_sizes(self.body.sizes(), self.body.num_displacements(), sizes);
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (n, p) = (self.body.num_displacements(), self.body.num_contacts());
        let (equilibrium, contact) = out.split_at_mut(n);
        match &self.body.load.0 {
            Path::Affine { constant, slope } => {
                for (o, (c, s)) in equilibrium.iter_mut().zip(constant.iter().zip(slope)) {
                    *o = -(c + x[x.len() - 1] * s);
                }
            }
            path @ Path::Function(_) => {
                path.value(x[x.len() - 1], equilibrium, &mut vec![0.0; n]);
                equilibrium.iter_mut().for_each(|o| *o = -*o);
            }
        }
        self.body.a.as_ref().mul_add(1.0, &x[..n], equilibrium);
        for (trace, force) in self.traces.iter().zip(x[n..].chunks_exact(p)) {
            trace.as_ref().mul_add(1.0, force, equilibrium);
        }
        for i in 0..p {
            let h = self.law.residual(selection.piece(i), &self.values(i, x));
            for (block, value) in h.iter().enumerate().take(self.traces.len()) {
                contact[block * p + i] = *value;
            }
        }
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let (n, p) = (self.body.num_displacements(), self.body.num_contacts());
        jac.add_block(0, 0, 1.0, &self.body.a);
        for (block, trace) in self.traces.iter().enumerate() {
            jac.add_block(0, n + block * p, 1.0, trace);
        }
        let alpha = x.len() - 1;
        match &self.body.load.0 {
            Path::Affine { slope, .. } => {
                for (i, s) in slope.iter().enumerate().filter(|s| *s.1 != 0.0) {
                    jac.add(i, alpha, -s);
                }
            }
            path @ Path::Function(_) => {
                let mut rate = vec![0.0; n];
                path.value(x[alpha], &mut vec![0.0; n], &mut rate);
                for (i, s) in rate.iter().enumerate() {
                    jac.add(i, alpha, -s);
                }
            }
        }
        for i in 0..p {
            let rows = self.law.rows(selection.piece(i), &self.values(i, x));
            for (block, row) in rows.iter().enumerate().take(self.traces.len()) {
                self.scatter(i, row, |j, value| jac.add(n + block * p + i, j, value));
            }
        }
    }
}

/// Mean stiffness of single contact nodes, b A bᵀ / (b bᵀ)² over the columns b of the transposed traces.
pub(super) fn node_stiffness(a: &Matrix, traces: &[&Matrix]) -> f64 {
    let mut mean = 0.0;
    let mut b = vec![0.0; a.nrows()];
    for trace in traces {
        for i in 0..trace.ncols() {
            for_column(trace, i, |j, v| b[j] = v);
            // Only the columns of A that the row touches.
            let (mut square, mut energy) = (0.0, 0.0);
            for_column(trace, i, |j, v| {
                square += v * v;
                for_column(a, j, |k, a| energy += b[k] * a * v);
            });
            for_column(trace, i, |j, _| b[j] = 0.0);
            mean += energy / (square * square) / (trace.ncols() * traces.len()) as f64;
        }
    }
    mean
}

fn for_column(matrix: &Matrix, j: usize, mut f: impl FnMut(usize, f64)) {
    let p = matrix.pattern();
    for k in p.col_ptr()[j]..p.col_ptr()[j + 1] {
        f(p.row_idx()[k], matrix.values()[k]);
    }
}

fn pattern(body: &ContactBody, traces: &[Matrix]) -> Result<Pattern, ContactError> {
    let (n, p, blocks) = (body.num_displacements(), body.num_contacts(), traces.len());
    let rows = n + blocks * p;
    let mut entries: Vec<(usize, usize)> = body.a.triplets().map(|(i, j, _)| (i, j)).collect();
    for i in 0..p {
        for block in 0..blocks {
            let own = n + block * p + i;
            for_column(&traces[block], i, |j, _| {
                entries.push((j, own));
                entries.extend((0..blocks).map(|b| (n + b * p + i, j)));
            });
            entries.extend((0..blocks).map(|b| (own, n + b * p + i)));
            entries.push((own, rows));
        }
    }
    match &body.load.0 {
        Path::Affine { slope, .. } => {
            entries.extend((0..n).filter(|&i| slope[i] != 0.0).map(|i| (i, rows)));
        }
        Path::Function(_) => entries.extend((0..n).map(|i| (i, rows))),
    }
    Ok(Pattern::from_entries(rows, rows + 1, entries)?)
}

impl<L: NodeLaw> ExactPieces for FullContact<L> {
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let Path::Affine { constant, slope } = &self.body.load.0 else {
            return None;
        };
        full_conditions(
            &self.body.a,
            [self.traces.first()?, self.traces.get(1)?],
            [constant, slope],
            alpha,
            |k| held_at(&self.body, &self.reference, k),
            &exact_friction(&self.body, &self.law)?,
        )
    }
}
