use std::sync::Arc;

use super::load::{Factors, LoadCase, LoadPath, add};
use super::operator::Operator;
use crate::clock::Until;
use crate::linear::{Condensation, Hierarchical, LinearError};
use crate::sparse::dot;

mod sealed {
    pub trait Sealed {}
}

/// The form in which an [`Interface`](super::Interface) represents A u + Bᵀ λ = f: [full](FullView), or [condensed onto the
/// multipliers](CondensedView).
pub trait View: sealed::Sealed + Clone {
    /// The condensed operator; `None` in full form.
    #[doc(hidden)]
    fn reduced(&self) -> Option<&Reduced>;

    /// The view of the same operator under another load.
    #[doc(hidden)]
    fn under(&self, load: &LoadPath) -> Result<Self, LinearError>;
}

/// x = (u, λ, α): sparse, equilibrium is part of the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FullView;

/// x = (λ, α): dense, of the order of the multipliers; u has been eliminated.
#[derive(Debug, Clone)]
pub struct CondensedView(Arc<Reduced>);

impl sealed::Sealed for FullView {}
impl sealed::Sealed for CondensedView {}

impl View for FullView {
    fn reduced(&self) -> Option<&Reduced> {
        None
    }

    fn under(&self, _load: &LoadPath) -> Result<Self, LinearError> {
        Ok(Self)
    }
}

impl View for CondensedView {
    fn reduced(&self) -> Option<&Reduced> {
        Some(&self.0)
    }

    fn under(&self, load: &LoadPath) -> Result<Self, LinearError> {
        Self::with(Arc::clone(&self.0.condensation), load)
    }
}

impl CondensedView {
    /// One factorisation, and a solve for each load case.
    pub(crate) fn new(operator: &Operator) -> Result<Self, LinearError> {
        Self::within(operator, Until::default())
    }

    /// [`new`](Self::new), or [`LinearError::TimeLimit`] at the time limit.
    pub(crate) fn within(operator: &Operator, until: Until) -> Result<Self, LinearError> {
        let mut condensation = Condensation::within(&operator.a, &operator.b_t.transpose(), until)?;
        condensation.add_to_diagonal(&operator.yielding);
        // By themselves these traces are 0 exactly: what is left there is rounding.
        condensation.clear_last(operator.anchors.len());
        Self::with(Arc::new(condensation), &operator.load)
    }

    fn with(condensation: Arc<Condensation>, load: &LoadPath) -> Result<Self, LinearError> {
        let constant = load.base();
        let all: Vec<&[f64]> = constant
            .into_iter()
            .chain(load.parts().map(LoadCase::forces))
            .collect();
        let mut cases: Vec<Vec<f64>> = if all.is_empty() {
            Vec::new()
        } else {
            let q = condensation.compliance().nrows();
            let motions = condensation.traces_of_solution(&all.concat())?;
            (0..all.len())
                .map(|k| motions[k * q..(k + 1) * q].to_vec())
                .collect()
        };
        let free = constant.map(|_| cases.remove(0));
        Ok(Self(Arc::new(Reduced {
            condensation,
            free,
            cases,
        })))
    }

    pub(crate) fn condensation(&self) -> &Condensation {
        &self.0.condensation
    }
}

/// Largest order for which C fits into the caches of the processor.
const CACHED: usize = 400;
/// Least order for which the product of C with λ is worth a call of the linear algebra library.
const WIDE: usize = 64;
/// Number of rows of C processed together.
const ROWS: usize = 4;

/// v ← v − Σ factorᵣ rowᵣ; the products of the rows with λ. Lengths are multiples of `ROWS`.
fn subtract_rows(rows: [&[f64]; ROWS], factors: [f64; ROWS], lambda: &[f64], v: &mut [f64]) -> [f64; ROWS] {
    let rows = rows.map(|row| row.as_chunks::<ROWS>().0);
    let (lambda, v) = (lambda.as_chunks::<ROWS>().0, v.as_chunks_mut::<ROWS>().0);
    let mut sums = [[0.0; ROWS]; ROWS];
    for (at, (lambda, v)) in lambda.iter().zip(v).enumerate() {
        for r in 0..ROWS {
            let row = &rows[r][at];
            for e in 0..ROWS {
                sums[r][e] += row[e] * lambda[e];
                v[e] -= factors[r] * row[e];
            }
        }
    }
    sums.map(|s| (s[0] + s[2]) + (s[1] + s[3]))
}

/// The compliance C = B A⁻¹ Bᵀ and the free motions B A⁻¹ f of the load cases.
#[derive(Debug)]
pub struct Reduced {
    condensation: Arc<Condensation>,
    /// That of the constant case; `None` for general paths of the load.
    free: Option<Vec<f64>>,
    cases: Vec<Vec<f64>>,
}

impl Reduced {
    /// Row k of C, which is its column k.
    #[inline]
    pub(crate) fn row(&self, k: usize) -> &[f64] {
        let q = self.condensation.compliance().nrows();
        &self.condensation.compliance().values()[k * q..(k + 1) * q]
    }

    pub(crate) fn hierarchical(&self) -> Option<&Arc<Hierarchical>> {
        self.condensation.hierarchical()
    }

    /// v ← v − C λ; `room` is scratch.
    pub(super) fn subtract_compliance(&self, lambda: &[f64], v: &mut [f64], room: &mut Vec<f64>) {
        if let Some(hierarchical) = self.hierarchical() {
            return hierarchical.subtract_product(lambda, v, room);
        }
        if (WIDE..=CACHED).contains(&lambda.len()) {
            return self.condensation.subtract_compliance(lambda, v);
        }
        if lambda.len() <= CACHED {
            for (k, v) in v.iter_mut().enumerate() {
                *v -= dot(self.row(k), lambda);
            }
            return;
        }
        // For large matrices reading from memory takes most of the time, so only one triangle is read.
        for k in (0..lambda.len()).step_by(ROWS) {
            let rows = ROWS.min(lambda.len() - k);
            if rows == ROWS {
                let own: [&[f64]; ROWS] = std::array::from_fn(|r| &self.row(k + r)[..k]);
                let factors: [f64; ROWS] = std::array::from_fn(|r| lambda[k + r]);
                let (before, here) = v.split_at_mut(k);
                let sums = subtract_rows(own, factors, &lambda[..k], before);
                here.iter_mut().zip(sums).for_each(|(v, sum)| *v -= sum);
            }
            let first = if rows == ROWS { k } else { 0 };
            for r in k..k + rows {
                let row = self.row(r);
                v[r] -= dot(&row[first..k + rows], &lambda[first..k + rows]);
                if rows < ROWS {
                    add(-lambda[r], &row[..k], &mut v[..k]);
                }
            }
        }
    }

    /// Free motion under a load f₀ + α f₁, and its rate.
    pub(super) fn line(&self) -> Option<(&[f64], Vec<f64>)> {
        let free = self.free.as_ref()?;
        let rate = self.cases.first().cloned();
        Some((free, rate.unwrap_or_else(|| vec![0.0; free.len()])))
    }

    /// 1 / mean diag C of the first traces.
    pub(crate) fn stiffness(&self, traces: usize) -> f64 {
        let trace: f64 = (0..traces).map(|k| self.row(k)[k]).sum();
        traces as f64 / trace
    }

    /// Brings C into hierarchical form where that pays.
    pub(super) fn compress(&self, groups: impl FnOnce() -> Vec<Vec<usize>>) {
        self.condensation.compress(groups);
    }

    pub(crate) fn compliance(&self) -> &crate::sparse::Matrix {
        self.condensation.compliance()
    }

    /// B A⁻¹ of several loads, one after the other.
    pub(crate) fn traces_of_solution(&self, f: &[f64]) -> Result<Vec<f64>, LinearError> {
        self.condensation.traces_of_solution(f)
    }

    /// Overwrites f by u = A⁻¹ (f − Bᵀ λ).
    pub(crate) fn expand(&self, lambda: &[f64], f: &mut [f64]) -> Result<(), LinearError> {
        self.condensation.expand(lambda, f)
    }

    /// w = B A⁻¹ f at these parameters.
    pub(super) fn motion(&self, load: &LoadPath, free: &mut Free, parameters: &[f64], w: &mut [f64]) {
        match &self.free {
            Some(constant) => w.copy_from_slice(constant),
            None => {
                self.solve(load, free, parameters[0]);
                w.copy_from_slice(&free.motion);
            }
        }
        for (case, c) in self.cases.iter().zip(&free.factors.value) {
            add(*c, case, w);
        }
    }

    /// Adds the rate of w where the parameters move at the rates `d`.
    pub(super) fn add_drift(&self, load: &LoadPath, free: &Free, d: &[f64], out: &mut [f64]) {
        if self.free.is_none() {
            add(d[0], &free.rate, out);
        }
        for (c, case) in self.cases.iter().enumerate() {
            add(free.factors.rate[c] * d[load.slot(c)], case, out);
        }
    }

    /// ∂w_k/∂α or ∂w_k/∂β.
    pub(super) fn drift(&self, load: &LoadPath, free: &Free, k: usize, slot: usize) -> f64 {
        let mut sum = if self.free.is_none() && slot == 0 {
            free.rate[k]
        } else {
            0.0
        };
        for (c, case) in self.cases.iter().enumerate() {
            if load.slot(c) == slot {
                sum += free.factors.rate[c] * case[k];
            }
        }
        sum
    }

    /// Free motion and its rate under a general path of the load: NaN where the solve fails.
    fn solve(&self, load: &LoadPath, free: &mut Free, alpha: f64) {
        if free.alpha == alpha {
            return;
        }
        let n = free.load.len() / 2;
        let (f, rate) = free.load.split_at_mut(n);
        load.general(alpha, f, rate);
        let q = free.motion.len();
        match self.condensation.traces_of_solution(&free.load) {
            Ok(both) => {
                free.motion.copy_from_slice(&both[..q]);
                free.rate.copy_from_slice(&both[q..]);
                free.alpha = alpha;
            }
            Err(_) => {
                free.motion.fill(f64::NAN);
                free.rate.fill(f64::NAN);
                free.alpha = f64::NAN;
            }
        }
    }
}

/// Factors of the load cases; free motion and its rate where the load follows a general path.
#[derive(Debug, Clone)]
pub(super) struct Free {
    pub(super) factors: Factors,
    /// α to which `motion` and `rate` belong.
    alpha: f64,
    motion: Vec<f64>,
    rate: Vec<f64>,
    /// f, then its derivative.
    pub(super) load: Vec<f64>,
}

impl Free {
    pub(super) fn new(operator: &Operator, condensed: bool) -> Self {
        let general = operator.load.base().is_none();
        let q = if general && condensed {
            operator.num_traces()
        } else {
            0
        };
        let n = if general { operator.num_displacements() } else { 0 };
        Self {
            factors: Factors::new(&operator.load),
            alpha: f64::NAN,
            motion: vec![0.0; q],
            rate: vec![0.0; q],
            load: vec![0.0; 2 * n],
        }
    }
}
