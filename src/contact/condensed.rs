use std::borrow::Cow;

use super::error::check_length;
use super::law::{Row, TESTS};
use super::paths::Path;
use super::{ContactError, FrictionMap, FrictionProblem, NodeValues};
use crate::linear::{Cholesky, LinearSolver};
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// A [`FrictionProblem`] condensed onto its contact nodes: x = (λν, λt, α).
///
/// With C = B A⁻¹ Bᵀ, B = (Bν; Bt), and the free motion w(α) = B A⁻¹ f(α), the displacements of the contact nodes are
/// w(α) − C λ; the rest is as in the full form, with the same sites, pieces and test functions, the same solutions and the same
/// signs of det ∇_yH (A is positive definite). One Cholesky factorisation and 2p + 2 solves at construction; afterwards every
/// step costs as much as a dense problem of 2p unknowns.
#[derive(Debug, Clone)]
pub struct CondensedFriction {
    problem: FrictionProblem,
    factor: Cholesky,
    /// C, 2p × 2p, row-major (it is symmetric); rows and columns are the normal, then the tangential quantities.
    compliance: Vec<f64>,
    /// Free motion at α = 0 and its rate.
    free: Vec<f64>,
    free_rate: Vec<f64>,
    pattern: Pattern,
}

impl CondensedFriction {
    /// Condenses a problem.
    ///
    /// # Errors
    /// A that is not symmetric or not positive definite; loads that are not affine in α (their free motion would need a solve at
    /// every α: use the full form).
    pub fn new(problem: FrictionProblem) -> Result<Self, ContactError> {
        let (n, p) = (problem.num_displacements(), problem.num_contacts());
        check_symmetric(&problem.a)?;
        let Path::Affine { constant, slope } = &problem.load.0 else {
            return Err(ContactError::LoadNotAffine);
        };
        let mut factor = Cholesky::default();
        factor.analyze(problem.a.pattern().as_ref())?;
        factor.factor(problem.a.as_ref())?;
        // One block of right-hand sides: Bνᵀ, Btᵀ, f₀, f₁.
        let columns = 2 * p + 2;
        let mut block = vec![0.0; n * columns];
        for (b, first) in [(&problem.bnu_t, 0), (&problem.bt_t, p)] {
            for (i, j, v) in b.triplets() {
                block[(first + j) * n + i] = v;
            }
        }
        block[2 * p * n..(2 * p + 1) * n].copy_from_slice(constant);
        block[(2 * p + 1) * n..].copy_from_slice(slope);
        factor.solve_in_place(&mut block)?;
        let traces = |column: &[f64]| -> Vec<f64> {
            let mut out = vec![0.0; 2 * p];
            problem
                .bnu_t
                .as_ref()
                .mul_transpose_add(1.0, column, &mut out[..p]);
            problem
                .bt_t
                .as_ref()
                .mul_transpose_add(1.0, column, &mut out[p..]);
            out
        };
        let mut compliance: Vec<f64> = block[..2 * p * n].chunks_exact(n).flat_map(traces).collect();
        // Rounding leaves C slightly unsymmetric; rows and columns are used interchangeably below.
        for i in 0..2 * p {
            for j in 0..i {
                let mean = 0.5 * (compliance[i * 2 * p + j] + compliance[j * 2 * p + i]);
                compliance[i * 2 * p + j] = mean;
                compliance[j * 2 * p + i] = mean;
            }
        }
        let free = traces(&block[2 * p * n..(2 * p + 1) * n]);
        let free_rate = traces(&block[(2 * p + 1) * n..]);
        Ok(Self {
            pattern: Pattern::full(2 * p, 2 * p + 1),
            problem,
            factor,
            compliance,
            free,
            free_rate,
        })
    }

    /// The compliance C = B A⁻¹ Bᵀ, 2p × 2p: normal quantities first, then tangential.
    #[must_use]
    pub fn compliance(&self) -> Matrix {
        let q = 2 * self.problem.num_contacts();
        let mut c = Matrix::zeros(Pattern::full(q, q));
        c.values_mut().copy_from_slice(&self.compliance);
        c
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
        let row = &self.compliance[k * q..(k + 1) * q];
        let reaction: f64 = row.iter().zip(x).map(|(c, l)| c * l).sum();
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
        let p = self.problem.num_contacts();
        let alpha = x[2 * p];
        match &self.problem.friction.0 {
            Path::Affine { constant, slope } => {
                for i in 0..p {
                    f(i, self.node(i, x, constant[i] + alpha * slope[i]), slope[i]);
                }
            }
            path @ Path::Function(_) => {
                let (mut value, mut derivative) = (vec![0.0; p], vec![0.0; p]);
                path.value(alpha, &mut value, &mut derivative);
                for i in 0..p {
                    f(i, self.node(i, x, value[i]), derivative[i]);
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
        let mut v =
            -row.penetration * self.compliance[i * q + j] - row.slip * self.compliance[(p + i) * q + j];
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
        let p = self.problem.num_contacts();
        self.for_nodes(x, |i, v, friction_rate| {
            let rows = self.problem.law.rows(selection.piece(i), &v);
            for (row, index) in rows.iter().zip([i, p + i]) {
                for j in 0..=2 * p {
                    let value = self.entry(i, row, friction_rate, j);
                    if value != 0.0 {
                        jac.add(index, j, value);
                    }
                }
            }
        });
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let p = self.problem.num_contacts();
        let q = 2 * p;
        let moved = |k: usize| -> f64 {
            let row = &self.compliance[k * q..(k + 1) * q];
            let reaction: f64 = row.iter().zip(d).map(|(c, l)| c * l).sum();
            d[q] * self.free_rate[k] - reaction
        };
        let mut chunks = out.chunks_exact_mut(TESTS);
        self.for_nodes(x, |i, v, friction_rate| {
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
        let v = self.node(site, x, friction);
        let row = self.problem.law.test_rows(&v)[test.min(TESTS - 1)];
        for (j, g) in gradient.iter_mut().enumerate() {
            *g = self.entry(site, &row, friction_rate, j);
        }
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
        self.problem.bnu_t.as_ref().mul_add(-1.0, &x[..p], &mut u);
        self.problem.bt_t.as_ref().mul_add(-1.0, &x[p..2 * p], &mut u);
        self.factor.clone().solve_in_place(&mut u)?;
        Ok(u)
    }
}

fn check_symmetric(a: &Matrix) -> Result<(), ContactError> {
    let largest = a.values().iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let worst = a
        .triplets()
        .map(|(i, j, v)| (i, j, (v - a.get(j, i)).abs()))
        .max_by(|x, y| x.2.total_cmp(&y.2));
    match worst {
        Some((row, col, difference)) if difference > 1e-10 * largest => {
            Err(ContactError::NotSymmetric { row, col, difference })
        }
        _ => Ok(()),
    }
}
