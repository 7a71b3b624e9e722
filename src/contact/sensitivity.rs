//! Derivatives of contact solutions in parameters of their data.

use std::fmt;
use std::sync::Arc;

use super::law::NodeLaw;
use super::parameters::{ContactParameters, SharedLaw};
use super::per_node::PerNode;
use super::{Contact, ContactError};
use crate::input::check_vector;
use crate::interface::{Columns, Extended, Interface, View};
use crate::linear::LinearError;
use crate::piecewise::PiecewiseSmooth;
use crate::sensitivity::{Differentiability, Directional, Sensitivity, SensitivityError, Validity};
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::{ALLOWANCE, COLUMNS};

/// A change of a contact solution to first order.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ContactChange {
    /// Of the displacements u.
    pub displacements: Vec<f64>,
    /// Of the contact forces λν, λt₁[, λt₂].
    pub forces: Vec<f64>,
}

type Map<V> = Extended<V, PerNode<SharedLaw>>;

/// A contact solution as a function of [parameters](ContactParameters) of its data: made by [`Contact::sensitivity`]. What
/// [`Sensitivity`] says of derivatives, kinks and ranges holds here, too; in condensed form all factors are of the size of the contact
/// forces, and displacements take one solve with the factors of A.
///
/// Gradients are those of functions of (u, λ). A function that depends on the parameters directly, too, as ½ uᵀ A u on stiffnesses, has that
/// part beside: ½ uᵀ ∂_θA u.
///
/// ```
/// use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
/// use semismooth::sparse::Matrix;
/// // One node of stiffness 2, pressed by 1 and pushed by 2: it slips, with λν = 1 and λt = F.
/// let [normal, tangential] = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]));
/// let a = Matrix::from_rows(&[[2.0, 0.0], [0.0, 2.0]])?;
/// let body = ContactBody::new(a, normal?, vec![tangential?], LoadPath::constant(vec![1.0, 2.0]))?;
/// let friction = FrictionCoefficient::constant(0.3)?;
/// let problem = CondensedContact::new(body, PlanarCoulomb::new(friction.clone()))?;
/// let x = problem.solve(0.0, None)?;
/// let one = Matrix::identity(1);
/// let law = PlanarCoulomb::new(friction.with_second(vec![1.0])?);
/// let parameters = problem.parameters().with_gaps(&one)?.with_law(law, &one)?;
/// let mut found = problem.sensitivity(&x, &parameters)?;
/// // With F, the friction grows by λν and the slip falls by λν/2.
/// let change = found.jvp(&[0.0, 1.0])?;
/// assert!((change.forces[1] - 1.0).abs() < 1e-12 && (change.displacements[1] + 0.5).abs() < 1e-12);
/// // With the gap, the pressure falls by 2, and friction by 0.6.
/// let gradient = found.vjp(&[0.0, 0.0], &[0.0, 1.0])?;
/// assert!((gradient[0] + 0.6).abs() < 1e-12 && (gradient[1] - 1.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct ContactSensitivity<V> {
    inner: Sensitivity<Map<V>>,
    /// Number of contact forces; unknowns behind them are motions of a body without supports.
    forces: usize,
    alpha: f64,
    /// ∂_θ(A u + Bᵀ λ − f), α left out.
    equilibrium: Matrix,
    /// ∂_α of the load, where α is a parameter.
    rate: Option<Vec<f64>>,
    at_solution: Vec<usize>,
}

impl<V> fmt::Debug for ContactSensitivity<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ContactSensitivity")
            .field("alpha", &self.alpha)
            .field("x", &self.inner.x())
            .finish_non_exhaustive()
    }
}

impl<V: View, L: NodeLaw + Clone + Send + Sync + 'static> Contact<V, L> {
    /// The solution x of this problem as a function of parameters of its data.
    ///
    /// # Complexity
    /// In condensed form as many products B A⁻¹ as there are parameters or, if there are fewer, contact forces; at kinks some more for each
    /// parameter, from which their rounding is known.
    ///
    /// # Errors
    /// Parameters of a problem of another size, or none; a second load parameter; a law with another number of history variables than that
    /// of the problem; [`ContactError::Sensitivity`] with the errors of [`Sensitivity::new`].
    pub fn sensitivity(
        &self,
        x: &[f64],
        parameters: &ContactParameters,
    ) -> Result<ContactSensitivity<V>, ContactError> {
        let body = self.body();
        let sizes = [
            body.num_displacements(),
            body.num_contacts(),
            1 + body.num_tangents(),
        ];
        parameters.check_sizes(sizes)?;
        check_vector("the solution x", x, self.num_vars())?;
        if self.num_parameters() > 1 {
            let what =
                "the derivatives of problems with a second load parameter are those of `Sensitivity`".into();
            return Err(ContactError::Invalid { what });
        }
        let law = match parameters.shared_law() {
            Some(law) => Arc::clone(law),
            None => Arc::new(self.node_law().clone()),
        };
        parameters.check_law(self.node_law())?;
        let mut nodes = self.law.under(law);
        nodes.history.clone_from(&self.law.history);
        if parameters.shared_law().is_some() {
            nodes.parameters = 1 + sizes[1];
        }
        let equilibrium = parameters.equilibrium()?;
        // The rows of balance of a body that contact alone holds depend on no parameter but by the forces.
        let traces = parameters.traces(self.num_traces())?;
        let mut columns = Columns {
            traces: match self.view.reduced() {
                None => traces,
                Some(_) => condensed(self, &traces, &equilibrium)?,
            },
            equilibrium: equilibrium.clone(),
            law: parameters.second()?,
            constant: parameters.at_solution().is_empty(),
        };
        let (alpha, m) = (x[self.num_vars() - 1], self.num_residuals());
        let fixed = (!parameters.has_alpha()).then_some(alpha);
        let mut theta = vec![0.0; parameters.len()];
        if parameters.has_alpha() {
            theta[0] = alpha;
        }
        let made = |columns: Columns| -> Result<_, ContactError> {
            let base = self.exchanged(Arc::clone(&self.operator), self.view.clone(), nodes.clone());
            Ok(Sensitivity::new(
                Extended::new(base, columns, fixed)?,
                &x[..m],
                &theta,
            )?)
        };
        let mut inner = made(columns.clone())?;
        if self.view.reduced().is_some() && inner.is_at_kink() {
            // There remainders of rounding would choose a side.
            columns.traces = without_rounding(self, &columns)?;
            inner = made(columns)?;
        }
        Ok(ContactSensitivity {
            inner,
            forces: self.law.own_traces(),
            alpha,
            equilibrium,
            rate: parameters
                .has_alpha()
                .then(|| self.operator.load.rate(alpha, sizes[0])),
            at_solution: parameters.at_solution(),
        })
    }
}

/// T − B A⁻¹ E.
fn condensed<V: View, G: PiecewiseSmooth>(
    problem: &Interface<V, G>,
    traces: &Matrix,
    equilibrium: &Matrix,
) -> Result<Matrix, LinearError> {
    let (n, q, k) = (equilibrium.nrows(), traces.nrows(), traces.ncols());
    let mut all = Matrix::zeros(Pattern::full(q, k));
    traces.triplets().for_each(|(i, j, t)| all.add(i, j, t));
    let Some(reduced) = problem.view.reduced() else {
        return Ok(all);
    };
    let (ptr, rows) = (equilibrium.pattern().col_ptr(), equilibrium.pattern().row_idx());
    let column = |j: usize| {
        let span = ptr[j]..ptr[j + 1];
        (rows[span.clone()].iter().copied()).zip(equilibrium.values()[span].iter().copied())
    };
    let moving: Vec<usize> = (0..k).filter(|&j| column(j).any(|e| e.1 != 0.0)).collect();
    if moving.len() <= q {
        for some in moving.chunks(COLUMNS) {
            let mut forces = vec![0.0; n * some.len()];
            for (own, &j) in forces.chunks_exact_mut(n).zip(some) {
                column(j).for_each(|(i, v)| own[i] = v);
            }
            let motions = reduced.traces_of_solution(&forces)?;
            for (own, &j) in motions.chunks_exact(q).zip(some) {
                own.iter().enumerate().for_each(|(i, v)| all.add(i, j, -v));
            }
        }
        return Ok(all);
    }
    let mut unit = vec![0.0; q];
    for i in 0..q {
        // −A⁻¹ Bᵀ of one trace.
        let mut motion = vec![0.0; n];
        unit[i] = 1.0;
        reduced.expand(&unit, &mut motion)?;
        unit[i] = 0.0;
        for &j in &moving {
            all.add(i, j, column(j).map(|(row, v)| motion[row] * v).sum());
        }
    }
    Ok(all)
}

/// T − B A⁻¹ E, 0 where that is no more than its rounding.
fn without_rounding<V: View, G: PiecewiseSmooth>(
    problem: &Interface<V, G>,
    columns: &Columns,
) -> Result<Matrix, LinearError> {
    let (n, q) = (columns.equilibrium.nrows(), problem.num_traces());
    let mut values = columns.traces.values().to_vec();
    let mut unit = vec![0.0; columns.traces.ncols()];
    for (j, column) in values.chunks_exact_mut(q.max(1)).enumerate() {
        let mut forces = vec![0.0; n];
        unit[j] = 1.0;
        columns.equilibrium.as_ref().mul_add(1.0, &unit, &mut forces);
        unit[j] = 0.0;
        let terms = forces.iter().map(|f| f.abs()).collect();
        solve(problem, &vec![0.0; q], &mut forces)?;
        let samples = problem.roundings_of_traces(&forces, terms)?;
        for (i, value) in column.iter_mut().enumerate() {
            let own = samples.iter().skip(i).step_by(q);
            let rounding = own.fold(0.0_f64, |m, r| m.max(r.abs()));
            if value.abs() <= ALLOWANCE * rounding {
                *value = 0.0;
            }
        }
    }
    Ok(Matrix::from_values(columns.traces.pattern().clone(), values)?)
}

impl<V: View> ContactSensitivity<V> {
    /// Number of parameters.
    #[must_use]
    pub fn num_parameters(&self) -> usize {
        self.inner.parameters().len()
    }

    /// The solution, corrected to rounding: (u, λ) or λ, of a condensed body without supports (λ, c).
    #[must_use]
    pub fn x(&self) -> &[f64] {
        self.inner.x()
    }

    /// Whether the solution is a differentiable function of the parameters here.
    ///
    /// # Errors
    /// Solves whose residual is not small.
    pub fn differentiable(&mut self) -> Result<Differentiability, SensitivityError> {
        self.inner.differentiable()
    }

    /// The directional derivative along a change δ of the parameters.
    ///
    /// # Errors
    /// As [`Sensitivity::jvp`].
    pub fn jvp(&mut self, delta: &[f64]) -> Result<ContactChange, SensitivityError> {
        let rate = self.inner.jvp(delta)?;
        self.expanded(rate, delta)
    }

    /// How the unknowns of the form, (u, λ) or λ, move along δ: the directional derivative, or where the solutions are not known to be one
    /// function the one-sided branches.
    ///
    /// # Errors
    /// As [`Sensitivity::directional`].
    pub fn directional(&mut self, delta: &[f64]) -> Result<Directional, SensitivityError> {
        self.inner.directional(delta)
    }

    /// The gradient in the parameters of a function of the solution, from its gradients in the displacements (length n) and in the contact
    /// forces: one solve with transposed factors, in condensed form one more with those of A. At kinks the derivative is the lexicographic
    /// one along the unit vectors.
    ///
    /// # Errors
    /// As [`Sensitivity::vjp`].
    pub fn vjp(&mut self, displacements: &[f64], forces: &[f64]) -> Result<Vec<f64>, SensitivityError> {
        let map = self.inner.map();
        let (n, q) = (map.base().num_displacements(), map.base().num_traces());
        check_vector("the gradient in the displacements", displacements, n)?;
        check_vector("the gradient in the forces", forces, self.forces)?;
        let mut moved = forces.to_vec();
        moved.resize(q, 0.0);
        if map.base().view.reduced().is_none() {
            return self.inner.vjp(&[displacements, forces].concat());
        }
        let adjoint = match displacements.iter().any(|w| *w != 0.0) {
            true => {
                let map = self.inner.map();
                let mut adjoint = displacements.to_vec();
                solve(map.base(), &vec![0.0; q], &mut adjoint)?;
                (map.base().operator.b_t.as_ref().as_ref()).mul_transpose_add(-1.0, &adjoint, &mut moved);
                Some(adjoint)
            }
            false => None,
        };
        let mut gradient = self.inner.vjp(&moved)?;
        if let Some(adjoint) = adjoint {
            let first = usize::from(self.rate.is_some());
            (self.equilibrium.as_ref()).mul_transpose_add(-1.0, &adjoint, &mut gradient[first..]);
            if let Some(rate) = &self.rate {
                gradient[0] += rate.iter().zip(&adjoint).map(|(f, y)| f * y).sum::<f64>();
            }
        }
        Ok(gradient)
    }

    /// The derivative of (u, λ): n + q rows, a column for each parameter.
    ///
    /// # Errors
    /// [`SensitivityError::NotDifferentiable`] where it is not known that there is one; as [`jvp`](Self::jvp).
    pub fn derivative(&mut self) -> Result<Matrix, SensitivityError> {
        if !matches!(self.differentiable()?, Differentiability::Yes { .. }) {
            return Err(SensitivityError::NotDifferentiable);
        }
        let k = self.num_parameters();
        let mut columns = Vec::new();
        let mut delta = vec![0.0; k];
        for j in 0..k {
            delta[j] = 1.0;
            let change = self.jvp(&delta)?;
            delta[j] = 0.0;
            columns.extend(change.displacements);
            columns.extend(change.forces);
        }
        let rows = columns.len() / k.max(1);
        Ok(Matrix::from_values(Pattern::full(rows, k), columns).map_err(LinearError::from)?)
    }

    /// How far along δ the solutions stay on the piece of the directional derivative, up to `horizon` where they are followed.
    ///
    /// # Errors
    /// [`SensitivityError::AtSolution`] where δ changes a parameter of the body ([`ContactParameters::with_body`]), whose columns are known
    /// at this solution alone: [`valid_along`](crate::sensitivity::valid_along) takes the problems along δ; otherwise as [`Sensitivity::valid_until`].
    pub fn valid_until(&mut self, delta: &[f64], horizon: f64) -> Result<Validity, SensitivityError> {
        let changed = |j: &&usize| delta.get(**j).is_some_and(|d| *d != 0.0);
        if let Some(&parameter) = self.at_solution.iter().find(changed) {
            return Err(SensitivityError::AtSolution { parameter });
        }
        self.inner.valid_until(delta, horizon)
    }

    /// Displacements and forces of a direction of the unknowns.
    fn expanded(&self, mut rate: Vec<f64>, delta: &[f64]) -> Result<ContactChange, SensitivityError> {
        let base = self.inner.map().base();
        let n = base.num_displacements();
        if base.view.reduced().is_none() {
            let forces = rate.split_off(n);
            return Ok(ContactChange {
                displacements: rate,
                forces,
            });
        }
        let first = usize::from(self.rate.is_some());
        let mut displacements = match &self.rate {
            Some(rate) => rate.iter().map(|f| delta[0] * f).collect(),
            None => vec![0.0; n],
        };
        (self.equilibrium.as_ref()).mul_add(-1.0, &delta[first..], &mut displacements);
        solve(base, &rate, &mut displacements)?;
        rate.truncate(self.forces);
        Ok(ContactChange {
            displacements,
            forces: rate,
        })
    }
}

/// A⁻¹ (f − Bᵀ λ) in place of f.
fn solve<V: View, G: PiecewiseSmooth>(
    base: &Interface<V, G>,
    lambda: &[f64],
    f: &mut [f64],
) -> Result<(), LinearError> {
    match base.view.reduced() {
        Some(reduced) => reduced.expand(lambda, f),
        None => Ok(()),
    }
}

/// "derivatives in 3 parameters at α = 0.5: …", in one line.
impl<V> fmt::Display for ContactSensitivity<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at parameter {}: {}", self.alpha, self.inner)
    }
}
