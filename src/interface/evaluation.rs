//! The parts of an interface problem at a point: the point of the law, the equilibrium, and their derivatives.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, TryLockError};

use super::Interface;
use super::load::add;
use super::operator::Operator;
use super::view::{Free, Reduced, View};
use crate::linear::CondensedRows;
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::{Matrix, Pattern};

/// Workspace of an evaluation.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    /// The point z = (v, λ, α) of the law, and a direction there.
    pub(super) z: Vec<f64>,
    pub(super) dz: Vec<f64>,
    /// The point x for which z was computed, in condensed form: residuals, test functions and derivatives are usually evaluated at the same
    /// x, and v costs as much as all the rest. Empty where z does not contain v.
    at: Vec<f64>,
    /// The direction of λ for which −C λ was computed last, where C has a hierarchical form: the residual of a tangent and the rates along it
    /// need the same.
    direction: Vec<f64>,
    motion: Vec<f64>,
    room: Vec<f64>,
    /// Whether the law had reported tests at the last evaluation.
    pub(super) reports: bool,
    pub(super) free: Free,
    pub(super) jac: Matrix,
    /// The entries of `jac` that are not zero.
    entries: Vec<(usize, usize, f64)>,
    /// Of these, the derivatives of rows with respect to their own traces, and those with respect to other traces.
    own: Vec<f64>,
    across: Vec<(usize, usize, f64)>,
}

/// The workspace of a problem, or a new one.
pub(super) enum Borrowed<'a> {
    Shared(MutexGuard<'a, Scratch>),
    Own(Box<Scratch>),
}

impl Deref for Borrowed<'_> {
    type Target = Scratch;

    fn deref(&self) -> &Scratch {
        match self {
            Self::Shared(scratch) => scratch,
            Self::Own(scratch) => scratch,
        }
    }
}

impl DerefMut for Borrowed<'_> {
    fn deref_mut(&mut self) -> &mut Scratch {
        match self {
            Self::Shared(scratch) => scratch,
            Self::Own(scratch) => scratch,
        }
    }
}

impl Scratch {
    pub(super) fn new(operator: &Operator, law: &Pattern, condensed: bool) -> Self {
        Self {
            z: vec![0.0; law.ncols()],
            dz: vec![0.0; law.ncols()],
            at: Vec::with_capacity(law.ncols()),
            direction: Vec::new(),
            motion: Vec::new(),
            room: Vec::new(),
            reports: false,
            free: Free::new(operator, condensed),
            jac: Matrix::zeros(law.clone()),
            entries: Vec::new(),
            own: Vec::new(),
            across: Vec::new(),
        }
    }

    /// Finds −C λ for a direction, up to the sign returned.
    fn find_motion(&mut self, reduced: &Reduced, lambda: &[f64]) -> f64 {
        if same_bits(&self.direction, lambda) {
            return 1.0;
        }
        let known = self.direction.len() == lambda.len();
        if known && self.direction.iter().zip(lambda).all(|(a, b)| *a == -*b) {
            return -1.0;
        }
        self.direction.clear();
        self.direction.extend_from_slice(lambda);
        self.motion.clear();
        self.motion.resize(lambda.len(), 0.0);
        reduced.subtract_compliance(lambda, &mut self.motion, &mut self.room);
        1.0
    }

    /// `scratch`, or a new one while another thread uses it. Compiled once, for all laws.
    pub(super) fn borrow<'a>(
        scratch: &'a Mutex<Self>,
        operator: &Operator,
        law: &Pattern,
        condensed: bool,
    ) -> Borrowed<'a> {
        match scratch.try_lock() {
            Ok(scratch) => Borrowed::Shared(scratch),
            Err(TryLockError::Poisoned(scratch)) => Borrowed::Shared(scratch.into_inner()),
            Err(TryLockError::WouldBlock) => Borrowed::Own(Box::new(Self::new(operator, law, condensed))),
        }
    }
}

impl<V: View, G: PiecewiseSmooth> Interface<V, G> {
    pub(super) fn parts(&self) -> Parts<'_> {
        Parts {
            operator: &self.operator,
            reduced: self.view.reduced(),
            num_parameters: self.num_parameters(),
        }
    }
}

/// The parts of an interface problem other than its law: their computations are compiled once for all laws.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a> {
    pub(super) operator: &'a Operator,
    pub(super) reduced: Option<&'a Reduced>,
    pub(super) num_parameters: usize,
}

impl Parts<'_> {
    fn num_displacements(&self) -> usize {
        self.operator.num_displacements()
    }

    fn num_traces(&self) -> usize {
        self.operator.num_traces()
    }

    /// Number of variables before the multipliers.
    fn leading(&self) -> usize {
        match self.reduced {
            Some(_) => 0,
            None => self.num_displacements(),
        }
    }

    /// z = (v, λ, α).
    pub(super) fn law_point(&self, x: &[f64], s: &mut Scratch) {
        let (first, q) = (self.leading(), self.num_traces());
        match self.reduced {
            None => {
                for k in 0..q {
                    s.z[k] = self.operator.trace_at(k, x);
                }
            }
            Some(_) if same_bits(&s.at, x) => return,
            Some(reduced) => {
                let load = &self.operator.load;
                s.at.clear();
                s.free.factors.set(load, &x[q..]);
                reduced.motion(load, &mut s.free, &x[q..], &mut s.z[..q]);
                reduced.subtract_compliance(&x[..q], &mut s.z[..q], &mut s.room);
                s.at.extend_from_slice(x);
            }
        }
        s.z[q..].copy_from_slice(&x[first..]);
    }

    /// As [`law_point`](Self::law_point), for derivatives: those of `affine` laws do not depend on v, which is then not computed.
    pub(super) fn point_of_derivatives(&self, affine: bool, x: &[f64], s: &mut Scratch) {
        let (first, q) = (self.leading(), self.num_traces());
        if affine && self.operator.load.base().is_some() {
            s.free.factors.set(&self.operator.load, &x[first + q..]);
            s.z[q..].copy_from_slice(&x[first..]);
            s.at.clear();
        } else {
            self.law_point(x, s);
        }
    }

    /// The derivative of z along d, and z as for derivatives.
    pub(super) fn law_direction(&self, affine: bool, x: &[f64], d: &[f64], s: &mut Scratch) {
        let (first, q) = (self.leading(), self.num_traces());
        self.point_of_derivatives(affine, x, s);
        match self.reduced {
            None => {
                for k in 0..q {
                    s.dz[k] = self.operator.trace_at(k, d);
                }
            }
            Some(reduced) => {
                if reduced.hierarchical().is_some() {
                    let sign = s.find_motion(reduced, &d[..q]);
                    (s.dz.iter_mut().zip(&s.motion)).for_each(|(dz, m)| *dz = sign * m);
                } else {
                    s.dz[..q].fill(0.0);
                    reduced.subtract_compliance(&d[..q], &mut s.dz[..q], &mut s.room);
                }
                reduced.add_drift(&self.operator.load, &s.free, &d[q..], &mut s.dz[..q]);
            }
        }
        s.dz[q..].copy_from_slice(&d[first..]);
    }

    /// −C λ.
    pub(super) fn motion(&self, lambda: &[f64], s: &mut Scratch, out: &mut [f64]) {
        let Some(reduced) = self.reduced else { return };
        let sign = s.find_motion(reduced, lambda);
        (out.iter_mut().zip(&s.motion)).for_each(|(out, m)| *out = sign * m);
    }

    /// The derivatives of the law as combinations of traces, multipliers and the parameter.
    pub(super) fn condensed_rows(&self, s: &Scratch, rows: &mut CondensedRows) {
        let (Some(reduced), q) = (self.reduced, self.num_traces()) else {
            return;
        };
        rows.traces.clear();
        rows.multipliers.clear();
        rows.parameter.clear();
        rows.parameter.resize(q, 0.0);
        for (i, k, v) in nonzeros(&s.jac) {
            if k < q {
                rows.parameter[i] += v * reduced.drift(&self.operator.load, &s.free, k, 0);
                rows.traces.push((i, k, v));
            } else if k < 2 * q {
                rows.multipliers.push((i, k - q, v));
            } else {
                rows.parameter[i] += v;
            }
        }
    }

    /// A u + Bᵀ λ − f of a point (u, λ, α).
    pub(super) fn equilibrium(&self, x: &[f64], s: &mut Scratch, out: &mut [f64]) {
        let (n, q) = (self.num_displacements(), self.num_traces());
        let load = &self.operator.load;
        s.free.factors.set(load, &x[n + q..]);
        let half = s.free.load.len() / 2;
        load.general(x[n + q], out, &mut s.free.load[half..]);
        for (case, c) in load.parts().zip(&s.free.factors.value) {
            add(*c, case.forces(), out);
        }
        out.iter_mut().for_each(|f| *f = -*f);
        Matrix::as_ref(&self.operator.a).mul_add(1.0, &x[..n], out);
        Matrix::as_ref(&self.operator.b_t).mul_add(1.0, &x[n..n + q], out);
    }

    /// Derivatives of the equilibrium of the full form.
    pub(super) fn equilibrium_jacobian(&self, x: &[f64], s: &mut Scratch, jac: &mut Matrix) {
        let (n, q) = (self.num_displacements(), self.num_traces());
        let load = &self.operator.load;
        jac.add_block(0, 0, 1.0, &self.operator.a);
        jac.add_block(0, n, 1.0, &self.operator.b_t);
        s.free.factors.set(load, &x[n + q..]);
        if load.base().is_none() {
            let (f, rate) = s.free.load.split_at_mut(n);
            load.general(x[n + q], f, rate);
            for (i, r) in rate.iter().enumerate() {
                jac.add(i, n + q, -r);
            }
        }
        for (k, case) in load.parts().enumerate() {
            let (rate, column) = (s.free.factors.rate[k], n + q + load.slot(k));
            for (i, f) in case.forces().iter().enumerate().filter(|c| *c.1 != 0.0) {
                jac.add(i, column, -rate * f);
            }
        }
    }

    /// Adds the gradients of all rows of the law to a Jacobian.
    pub(super) fn add_gradients(&self, s: &mut Scratch, jac: &mut Matrix) {
        let (Some(reduced), true) = (self.reduced, jac.pattern().is_full()) else {
            return self.add_gradients_one_by_one(s, jac);
        };
        let (q, order) = (self.num_traces(), jac.nrows());
        s.entries.clear();
        s.entries.extend(nonzeros(&s.jac));
        let of_traces = s.entries.partition_point(|e| e.1 < q);
        // Most rows depend on their own trace: these terms are added along columns of C.
        s.own.clear();
        s.own.resize(q, 0.0);
        for &(i, k, c) in &s.entries[..of_traces] {
            if i == k {
                s.own[i] = c;
            }
        }
        let (of_traces, others) = s.entries.split_at(of_traces);
        s.across.clear();
        s.across.extend(of_traces.iter().filter(|e| e.0 != e.1));
        // Column by column, with the column of C in cache: the entries of a row of a large Jacobian are far apart in memory.
        for (j, column) in jac
            .values_mut()
            .chunks_exact_mut(order.max(1))
            .take(q)
            .enumerate()
        {
            let compliance = reduced.row(j);
            for ((v, c), own) in column.iter_mut().zip(compliance).zip(&s.own) {
                *v -= own * c;
            }
            for &(i, k, c) in &s.across {
                column[i] -= c * compliance[k];
            }
        }
        for &(i, k, c) in of_traces {
            self.add_drift(reduced, &s.free, (i, k, c), jac);
        }
        for &(i, k, c) in others {
            jac.add(i, k - q, c);
        }
    }

    fn add_drift(&self, reduced: &Reduced, s: &Free, (i, k, c): (usize, usize, f64), jac: &mut Matrix) {
        for slot in 0..self.num_parameters {
            let drift = reduced.drift(&self.operator.load, s, k, slot);
            jac.add(i, self.num_traces() + slot, c * drift);
        }
    }

    /// The same where few rows are written.
    pub(super) fn add_gradients_one_by_one(&self, s: &Scratch, jac: &mut Matrix) {
        nonzeros(&s.jac).for_each(|entry| self.add_gradient(&s.free, entry, jac));
    }

    /// The gradient of a function of z, with derivatives `s.dz`, in the variables of the problem.
    pub(super) fn gradient(&self, s: &Scratch, gradient: &mut [f64]) {
        let (first, q) = (self.leading(), self.num_traces());
        gradient[..first].fill(0.0);
        gradient[first..].copy_from_slice(&s.dz[q..]);
        for (k, &g) in s.dz[..q].iter().enumerate().filter(|g| *g.1 != 0.0) {
            match self.reduced {
                None => {
                    self.operator.trace(k).for_each(|(j, b)| gradient[j] += g * b);
                    gradient[first + k] -= g * self.operator.yielding(k);
                }
                Some(reduced) => {
                    add(-g, reduced.row(k), &mut gradient[..q]);
                    for slot in 0..self.num_parameters {
                        gradient[q + slot] += g * reduced.drift(&self.operator.load, &s.free, k, slot);
                    }
                }
            }
        }
    }

    /// Adds c times the gradient of variable k of the law to row `i` of a Jacobian.
    pub(super) fn add_gradient(&self, s: &Free, (i, k, c): (usize, usize, f64), jac: &mut Matrix) {
        let (first, q) = (self.leading(), self.num_traces());
        if k >= q {
            jac.add(first + i, first + k - q, c);
        } else if let Some(reduced) = self.reduced {
            let row = reduced.row(k);
            if jac.pattern().is_full() {
                // By strides: searching for each entry would take most of the time of a step.
                let order = jac.nrows();
                for (column, v) in jac.values_mut().chunks_exact_mut(order).zip(row) {
                    column[i] -= c * v;
                }
            } else {
                for (j, v) in row.iter().enumerate() {
                    jac.add(i, j, -c * v);
                }
            }
            self.add_drift(reduced, s, (i, k, c), jac);
        } else {
            for (j, b) in self.operator.trace(k) {
                jac.add(first + i, j, c * b);
            }
            if self.operator.yielding(k) != 0.0 {
                jac.add(first + i, first + k, -c * self.operator.yielding(k));
            }
        }
    }
}

/// The entries that are not zero, of which there are few when a single site has written its rows.
fn nonzeros(a: &Matrix) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
    let (col_ptr, row_idx) = (a.pattern().col_ptr(), a.pattern().row_idx());
    let entries = a.values().iter().enumerate().filter(|e| *e.1 != 0.0);
    entries.map(move |(k, v)| (row_idx[k], col_ptr.partition_point(|c| *c <= k) - 1, *v))
}

/// Whether two points are the same to the sign of their zeros.
fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}
