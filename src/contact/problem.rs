use std::sync::Arc;
use std::time::Duration;

use super::law::{LocalValues, NodeLaw, check_law};
use super::per_node::PerNode;
use super::{ContactBody, ContactError, ContactState, FrictionCoefficient, LoadPath, PlanarCoulomb};
use crate::InputError;
use crate::clock::Until;
use crate::input::{check_finite, check_vector};
use crate::interface::{CondensedView, FullView, Interface, LoadCase, View};
use crate::linear::LinearError;
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// A [`ContactBody`] under a [`NodeLaw`], in one of two views:
///
/// ```text
/// H(x) = ( A u + Bνᵀ λν + Σ Btᵀ λt − f(α);  H_ν;  H_t ),   H_ν, H_t from the law at each node
/// ```
///
/// An interface problem whose sites are the contact nodes, with the pieces, cells and test functions of the law.
pub type Contact<V, L> = Interface<V, PerNode<L>>;

/// Contact in full form, sparse: x = (u, λν, λt₁[, λt₂], α). A need not be symmetric; each Newton step is one sparse factorisation.
///
/// ```
/// use semismooth::contact::{ContactBody, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
/// use semismooth::sparse::Matrix;
/// // One contact node (Hild–Renard), λ = μ = 1, F = α.
/// let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]])?;
/// let (normal, tangential) = (Matrix::from_rows(&[[1.0, 0.0]])?, Matrix::from_rows(&[[0.0, 1.0]])?);
/// let body = ContactBody::new(a, normal, vec![tangential], LoadPath::constant(vec![1.5, 7.0]))?;
/// let friction = FrictionCoefficient::affine(vec![0.0], vec![1.0])?;
/// let problem = FullContact::new(body, PlanarCoulomb::new(friction))?;
/// let x = problem.solve(10.0, None)?;
/// assert!((x[2] - 1.5).abs() < 1e-12 && (x[3] - 7.0).abs() < 1e-12); // sticks: λ = f
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type FullContact<L> = Contact<FullView, L>;

/// Contact condensed onto its nodes, dense: x = (λν, λt₁[, λt₂], α). With C = B A⁻¹ Bᵀ and the free motion w(α) = B A⁻¹ f(α) the
/// displacements of the contact nodes are w(α) − C λ. One Cholesky factorisation at construction; afterwards every step costs as much as a
/// dense problem of 2p (in space 3p) unknowns.
///
/// ```
/// use semismooth::contact::{ContactBody, CondensedContact, ContactState, FrictionCoefficient, LoadPath, PlanarCoulomb};
/// use semismooth::sparse::Matrix;
/// // One contact node with F = ½ under the load (1 − α, α): it sticks up to α = ⅓ and slips beyond.
/// let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]])?;
/// let (normal, tangential) = (Matrix::from_rows(&[[1.0, 0.0]])?, Matrix::from_rows(&[[0.0, 1.0]])?);
/// let body = ContactBody::new(a, normal, vec![tangential], LoadPath::affine(vec![1.0, 0.0], vec![-1.0, 1.0]))?;
/// let law = PlanarCoulomb::new(FrictionCoefficient::nodal(vec![0.5])?);
/// let problem = CondensedContact::new(body, law)?;
/// let x = problem.solve(1.0, None)?;
/// // x = (λν, λt, α).
/// assert!((x[0] - 0.4).abs() < 1e-12 && (x[1] - 0.2).abs() < 1e-12 && x[2] == 1.0);
/// assert_eq!(problem.solution(&x)?.states, [ContactState::SlipPlus]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type CondensedContact<L> = Contact<CondensedView, L>;

impl<L: NodeLaw> FullContact<L> {
    /// The problem in full form. The augmentation parameter r is a quarter of the mean stiffness b A bᵀ / (b bᵀ)² of single contact nodes,
    /// over the rows b of the traces, about the effective stiffness of a node on a mesh; solutions do not depend on it.
    ///
    /// # Errors
    /// A law of another dimension.
    pub fn new(body: ContactBody, law: L) -> Result<Self, ContactError> {
        Self::of(body.released(), law, |_| Ok(FullView))
    }

    /// Sets the initial gap of each contact node: u_ν ≤ gap.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_gap(self, gap: Vec<f64>) -> Result<Self, ContactError> {
        let body = ContactBody::clone(&self.law.body).with_gap(gap)?;
        self.rebuilt(body)
    }

    /// Replaces the load.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_load(self, load: LoadPath) -> Result<Self, ContactError> {
        let body = ContactBody::clone(&self.law.body).with_load(load)?;
        self.rebuilt(body)
    }

    fn rebuilt(self, body: ContactBody) -> Result<Self, ContactError> {
        let mut nodes = self.law;
        nodes.body = Arc::new(body);
        let operator = Arc::clone(&nodes.body.operator);
        Ok(Interface::with_view(operator, FullView, nodes)?)
    }
}

impl FullContact<PlanarCoulomb> {
    /// A body in the plane under Coulomb's law: A (n × n), Bν and Bt (p × n), gap 0.
    ///
    /// # Errors
    /// As [`ContactBody::new`].
    pub fn planar(
        a: Matrix,
        normal: Matrix,
        tangential: Matrix,
        load: LoadPath,
        friction: FrictionCoefficient,
    ) -> Result<Self, ContactError> {
        let body = ContactBody::new(a, normal, vec![tangential], load)?;
        Self::new(body, PlanarCoulomb::new(friction))
    }
}

impl<L: NodeLaw> CondensedContact<L> {
    /// Condenses a body. r as in full form.
    ///
    /// Of a body that contact or friction alone holds, so that A is only semidefinite with the k motions R without energy, there are k
    /// further unknowns before α: x = (λ, c, α), u = A⁺ (f − Bᵀ λ) + R c, and k rows of balance, Rᵀ (f − Bᵀ λ) = 0, after those of the law.
    /// c are the displacements of k points, at which [`operator`](Interface::operator) has springs, whose forces c takes away. Solutions,
    /// transitions and signs of determinants are those of the full form.
    ///
    /// # Complexity
    /// That of [`Condensation::new`](crate::linear::Condensation::new) with q = 2p in the plane and 3p in space.
    ///
    /// # Errors
    /// A law of another dimension, A that is not symmetric or has an eigenvalue below 0; motions without energy that contact does not see
    /// ([`ContactError::Unsupported`] names the piece, where there are several).
    pub fn new(body: ContactBody, law: L) -> Result<Self, ContactError> {
        Self::within(body, law, None, None)
    }

    /// As [`new`](Self::new), with limits on memory, in bytes, and on time.
    ///
    /// # Errors
    /// [`ContactError::Memory`] where [`ContactBody::condensed_memory`] is above the limit, before anything large is allocated;
    /// [`LinearError::TimeLimit`] where the time limit is reached (the clock is read between parts of the factorisation and of the
    /// compliance); those of [`new`](Self::new).
    pub fn within(
        body: ContactBody,
        law: L,
        max_memory: Option<u64>,
        max_time: Option<Duration>,
    ) -> Result<Self, ContactError> {
        let until = Until::after(max_time);
        if let Some(limit) = max_memory {
            let needed = body.condensed_memory()?;
            if needed > limit {
                return Err(ContactError::Memory { needed, limit });
            }
        }
        if let Some((row, col, difference)) = body.stiffness().asymmetry(1e-10) {
            return Err(ContactError::Input(InputError::NotSymmetric {
                what: "the stiffness matrix",
                row,
                col,
                difference,
            }));
        }
        check_law(&law, body.num_tangents(), body.num_contacts())?;
        let view = match CondensedView::within(&body.operator, until) {
            Err(LinearError::NotPositiveDefinite) => {
                let Some(anchored) = body.anchored() else {
                    return Err(body.refused());
                };
                match CondensedView::within(&anchored.operator, until) {
                    Err(LinearError::NotPositiveDefinite) => return Err(body.refused()),
                    view => return Self::of(anchored, law, |_| Ok(view?)),
                }
            }
            view => view?,
        };
        Self::of(body, law, |_| Ok(view))
    }

    /// As [`new`](Self::new), for bodies that are supported without contact alone.
    pub(super) fn of_supported(body: ContactBody, law: L) -> Result<Self, ContactError> {
        Self::of(body, law, |body| Ok(CondensedView::new(&body.operator)?))
    }

    /// The displacements of the contact nodes without contact forces, w(α), in the order of [`compliance`](Self::compliance).
    ///
    /// # Errors
    /// A parameter that is not finite.
    pub fn free_motion(&self, alpha: f64) -> Result<Vec<f64>, ContactError> {
        check_finite("the parameter", &[alpha])?;
        let mut parameters = vec![0.0; self.num_parameters()];
        parameters[0] = alpha;
        Ok(self.free_traces(&parameters)?)
    }
}

impl<V: View, L: NodeLaw> Contact<V, L> {
    fn of(
        body: ContactBody,
        law: L,
        view: impl FnOnce(&ContactBody) -> Result<V, ContactError>,
    ) -> Result<Self, ContactError> {
        check_law(&law, body.num_tangents(), body.num_contacts())?;
        let view = view(&body)?;
        let operator = Arc::clone(&body.operator);
        let mut nodes = PerNode::new(Arc::new(body), law);
        if let Some(reduced) = view.reduced() {
            nodes.stiffness = reduced.stiffness(nodes.own_traces());
        }
        Ok(Interface::with_view(operator, view, nodes)?)
    }

    /// Refuses condensed bodies without supports, whose compliance is not definite.
    pub(super) fn check_supported(&self) -> Result<(), ContactError> {
        match self.body().anchors().is_empty() {
            true => Ok(()),
            false => Err(self.body().refused()),
        }
    }

    /// Sets the augmentation parameter r > 0 (force per length), at first chosen from the stiffness of the contact nodes. The iterates of
    /// Newton's method depend on r, and so do the test functions reported ([`theta`](Self::theta), [`nodes`](Self::nodes), transitions).
    /// Nothing else does: curves, lists of solutions and certificates use the map with the r chosen at construction. At solutions {θ ≥ 0}
    /// is the same for every r.
    ///
    /// # Errors
    /// [`ContactError::Augmentation`] where r is further than a factor of 10¹² from the one chosen at first.
    pub fn with_r(mut self, r: f64) -> Result<Self, ContactError> {
        const DECADES: f64 = 1e12;
        let scale = self.law.scale;
        let (lowest, highest) = (scale / DECADES, scale * DECADES);
        if !(r >= lowest && r <= highest) {
            return Err(ContactError::Augmentation { r, lowest, highest });
        }
        self.law.r = r;
        Ok(self)
    }

    /// The same body under another law, without a new factorisation.
    ///
    /// # Errors
    /// A law of another dimension.
    pub fn with_law<M: NodeLaw>(&self, law: M) -> Result<Contact<V, M>, ContactError> {
        check_law(&law, self.law.body.num_tangents(), self.num_contacts())?;
        Ok(self.under(law))
    }

    /// Sets the tangential displacements from which slips are measured (all along t₁, then all along t₂): those of the step before,
    /// in a history of loading. Zero at first.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn set_reference_slip(&mut self, reference: &[f64]) -> Result<(), ContactError> {
        check_vector("the reference of the slip", reference, self.law.reference.len())?;
        self.law.reference.copy_from_slice(reference);
        Ok(())
    }

    /// Sets the history variables, node by node: those at the end of the level before, in a history of loading. Zero at first.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn set_history(&mut self, history: &[f64]) -> Result<(), ContactError> {
        check_vector("the list of history variables", history, self.law.history.len())?;
        self.law.history.copy_from_slice(history);
        Ok(())
    }

    /// The history variables, node by node.
    #[must_use]
    pub fn history(&self) -> &[f64] {
        &self.law.history
    }

    /// Ends a load level at x: history variables and the reference of the slip are updated.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn end_level(&mut self, x: &[f64]) -> Result<(), ContactError> {
        check_vector("the solution x", x, self.num_vars())?;
        let h = self.law.law.num_history();
        for v in self.nodes(x) {
            let own = &mut self.law.history[v.node * h..(v.node + 1) * h];
            self.law.law.update(&v, own);
        }
        let traces = self.traces(x)?;
        let reference = self.tangential(&traces).to_vec();
        self.set_reference_slip(&reference)
    }

    /// The tangential ones of all traces.
    pub(super) fn tangential<'t>(&self, traces: &'t [f64]) -> &'t [f64] {
        &traces[self.num_contacts()..self.law.own_traces()]
    }

    /// The augmentation parameter.
    #[must_use]
    pub fn r(&self) -> f64 {
        self.law.r
    }

    /// The body.
    #[must_use]
    pub fn body(&self) -> &ContactBody {
        &self.law.body
    }

    /// The law of the nodes.
    #[must_use]
    pub fn node_law(&self) -> &L {
        &self.law.law
    }

    /// The law of the nodes, mutable.
    pub fn node_law_mut(&mut self) -> &mut L {
        self.law.law_mut()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.law.body.num_contacts()
    }

    /// The derivative of the residuals of the full form with respect to the load: −I above zeros.
    ///
    /// # Errors
    /// None in practice; the pattern is checked again.
    pub fn load_derivative(&self) -> Result<Matrix, ContactError> {
        let n = self.num_displacements();
        let rows = n + self.num_traces();
        let mut matrix = Matrix::zeros(Pattern::from_entries(rows, n, (0..n).map(|i| (i, i)))?);
        matrix.values_mut().fill(-1.0);
        Ok(matrix)
    }

    /// The family with a second parameter β: the load f(α) + β f₂, and a law that may depend on β
    /// ([`LocalValues::second`]). x = (u, λ, α, β) or (λ, α, β); its [transition sets](crate::continuation::TransitionSet) are curves in
    /// the (α, β) plane.
    ///
    /// # Errors
    /// Wrong length, values that are not finite; failures of the solves.
    pub fn with_second_parameter<M: NodeLaw>(
        &self,
        load: impl Into<LoadCase>,
        law: M,
    ) -> Result<Contact<V, M>, ContactError> {
        check_law(&law, self.law.body.num_tangents(), self.num_contacts())?;
        let load = self.operator.load.first().with_second(load);
        let body = Arc::new(self.law.body.under(load)?);
        let mut nodes = self.law.under(law);
        nodes.body = Arc::clone(&body);
        nodes.parameters = 2;
        let view = self.view.under(&body.operator.load)?;
        Ok(Interface::with_view(Arc::clone(&body.operator), view, nodes)?)
    }

    /// The contact quantities of each node at x, with the [augmentation parameter](Self::r) set by the user; empty where x has the wrong
    /// length.
    #[must_use]
    pub fn nodes(&self, x: &[f64]) -> Vec<LocalValues> {
        let mut nodes = self.nodes_in_own_scale(x);
        nodes.iter_mut().for_each(|v| v.r = self.law.r);
        nodes
    }

    /// The same with the augmentation parameter in which the map is evaluated, for results that must not depend on a prescribed one.
    pub(super) fn nodes_in_own_scale(&self, x: &[f64]) -> Vec<LocalValues> {
        let (first, q) = (self.leading(), self.num_traces());
        let Ok(v) = self.traces(x) else {
            return Vec::new();
        };
        let node = |i| self.law.values(i, |k| v[k], |k| x[first + k], &x[first + q..]);
        (0..self.num_contacts()).map(node).collect()
    }

    /// The test functions θ¹ = λν + r (u_ν − gap), θ²,³ = λt + r u_t ∓ F (θ¹)₊ of each node in the plane.
    #[must_use]
    pub fn theta(&self, x: &[f64]) -> Vec<[f64; 3]> {
        let theta = |v: &LocalValues| {
            let (normal, z) = (v.theta1(), v.traction[0] + v.r * v.slip[0]);
            let g = self.law.law.friction(v)[0] * normal.max(0.0);
            [normal, z - g, z + g]
        };
        self.nodes(x).iter().map(theta).collect()
    }

    /// The coefficient of friction of each node without slip, at α (along t₁).
    #[must_use]
    pub fn friction_at(&self, alpha: f64) -> Vec<f64> {
        let at = |node| {
            let v = LocalValues {
                node,
                parameter: alpha,
                ..LocalValues::default()
            };
            self.law.law.friction(&v)[0]
        };
        (0..self.num_contacts()).map(at).collect()
    }

    /// The state of each contact node in a selection. In space slip is reported as slip+.
    #[must_use]
    pub fn states(&self, selection: &Selection) -> Vec<ContactState> {
        let v = LocalValues::default();
        selection.pieces().map(|p| self.law.law.state(p, &v)).collect()
    }

    /// The selection with the given states (those beyond the number of nodes are ignored, missing ones are open; the first piece where
    /// the law has none of that state).
    #[must_use]
    pub fn selection_of(&self, states: &[ContactState]) -> Selection {
        let v = LocalValues::default();
        let piece = |state: ContactState| {
            (0..self.law.law.num_pieces()).find(|&k| self.law.law.state(k, &v) == state)
        };
        let all = ContactState::ALL.map(piece);
        Selection::from_pieces((0..self.num_contacts()).map(|i| {
            let state = states.get(i).copied().unwrap_or(ContactState::Open);
            all[state.piece()].unwrap_or(0)
        }))
    }

    /// x = 0 at α.
    pub(super) fn zero(&self, alpha: f64) -> Vec<f64> {
        let mut x = vec![0.0; self.num_vars()];
        x[self.num_residuals()] = alpha;
        x
    }

    /// The same body under another law.
    pub(super) fn under<M: NodeLaw>(&self, law: M) -> Contact<V, M> {
        let (operator, view) = (Arc::clone(&self.operator), self.view.clone());
        self.exchanged(operator, view, self.law.under(law))
    }

    /// The same problem with another augmentation parameter of Newton's method.
    pub(super) fn at_r(&self, r: f64) -> Self
    where
        L: Clone,
    {
        let mut other = self.clone();
        other.law.r = r;
        other
    }

    /// The same body under another law, with the load that it has at α.
    pub(super) fn at_load<M: NodeLaw>(&self, alpha: f64, law: M) -> Result<Contact<V, M>, ContactError> {
        let load = self.operator.load.frozen(&[alpha], self.num_displacements());
        let view = self.view.under(&load)?;
        let operator = Arc::new(self.operator.with_load(load)?);
        let mut nodes = self.law.under(law);
        (nodes.r, nodes.scale) = (nodes.stiffness, nodes.stiffness);
        if nodes.history.len() == self.law.history.len() {
            nodes.history.clone_from(&self.law.history);
        }
        Ok(self.exchanged(operator, view, nodes))
    }

    /// The free displacements u at x: one solve in condensed form.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        check_vector("the solution x", x, self.num_vars())?;
        let mut u = self.expand(x)?;
        u.truncate(self.num_displacements());
        Ok(u)
    }

    /// The displacements of the supports at x, as numbered in the [load cases](LoadCase::of_supports); empty where no case has any.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn support_displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError> {
        check_vector("the solution x", x, self.num_vars())?;
        let parameters = &x[self.num_residuals()..];
        Ok(self
            .operator
            .load
            .support_state(parameters)
            .displacements()
            .to_vec())
    }
}
