use super::body::check_matrices;
use super::error::check_length;
use super::full_contact::{held, node_stiffness};
use super::law::{Law, TESTS};
use super::solution::imbalance;
use super::{
    ContactError, ContactSolution, ContactState, FrictionPath, LoadPath, LocalValues, NodeValues, SlipBound,
};
use crate::interface::typical_sizes;
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, dot};

/// A discrete contact problem with Coulomb friction in the plane (Haslinger, Janovský, Ligurský):
///
/// ```text
/// H(x) = ( A u + Bνᵀ λν + Btᵀ λt − f(α);  λν − (θ¹)₊;  λt − P_[−g, g](λt + r Bt u) ),   x = (u, λν, λt, α)
/// θ¹ = λν + r (Bν u − gap),   g = F(α) (θ¹)₊  or  F(α) λν
/// ```
///
/// n displacements u, p contact nodes; forces λ in the units of f. As a [`PiecewiseSmooth`] map its sites are the contact nodes, with the
/// pieces "open", "stick", "slip+", "slip-" and the test functions θ¹, θ², θ³ and F (a wall: where F becomes negative a node in
/// contact has no solution). [`CondensedFriction`](super::CondensedFriction) is the same problem on the contact nodes alone.
///
/// ```
/// use semismooth::contact::{FrictionPath, FrictionProblem, FrictionStart, LoadPath, first_point};
/// use semismooth::sparse::Matrix;
/// // One contact node (Hild–Renard), λ = μ = 1, F = α.
/// let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]])?;
/// let problem = FrictionProblem::new(
///     a,
///     Matrix::from_rows(&[[1.0, 0.0]])?,
///     Matrix::from_rows(&[[0.0, 1.0]])?,
///     LoadPath::constant(vec![1.5, 7.0]),
///     FrictionPath::affine(vec![0.0], vec![1.0]),
/// )?;
/// let x = first_point(&problem, 10.0, &FrictionStart::Zero)?;
/// assert!((x[2] - 1.5).abs() < 1e-12 && (x[3] - 7.0).abs() < 1e-12); // sticks: λ = f
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct FrictionProblem {
    pub(super) a: Matrix,
    /// Transposes: column i is row i of Bν, Bt.
    pub(super) bnu_t: Matrix,
    pub(super) bt_t: Matrix,
    pub(super) gap: Vec<f64>,
    pub(super) load: LoadPath,
    pub(super) friction: FrictionPath,
    pub(super) law: Law,
    pub(super) pattern: Pattern,
}

impl FrictionProblem {
    /// The problem with gap 0, g = F (θ¹)₊ and r = the mean stiffness b A bᵀ / (b bᵀ)² of single contact nodes, over the rows b of Bν
    /// and Bt (1 where that is not positive). `a` is n × n, `bnu` and `bt` are p × n.
    ///
    /// # Errors
    /// Empty problems, wrong shapes, entries that are not finite, a constant coefficient of friction below 0.
    pub fn new(
        a: Matrix,
        bnu: Matrix,
        bt: Matrix,
        load: LoadPath,
        friction: FrictionPath,
    ) -> Result<Self, ContactError> {
        check_matrices(&a, &[&bnu, &bt])?;
        let (n, p) = (a.nrows(), bnu.nrows());
        load.0.check("the load", n)?;
        friction.0.check("the coefficients of friction", p)?;
        let constant_friction = friction.0.is_constant();
        let (bnu_t, bt_t) = (bnu.transpose(), bt.transpose());
        let pattern = full_pattern(&a, &bnu, &bt)?;
        let stiffness = node_stiffness(&a, &[&bnu_t, &bt_t]);
        let problem = Self {
            gap: vec![0.0; p],
            law: Law {
                r: if stiffness > 0.0 && stiffness.is_finite() {
                    stiffness
                } else {
                    1.0
                },
                bound: SlipBound::default(),
                constant_friction,
            },
            a,
            bnu_t,
            bt_t,
            load,
            friction,
            pattern,
        };
        if constant_friction {
            problem.check_friction(0.0)?;
        }
        Ok(problem)
    }

    /// Sets the initial gap of each contact node: u_ν ≤ gap.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_gap(mut self, gap: Vec<f64>) -> Result<Self, ContactError> {
        check_length("the gap", &gap, self.num_contacts())?;
        self.gap = gap;
        Ok(self)
    }

    /// Typical sizes of u, λ and α.
    pub(super) fn sizes(&self) -> Option<[f64; 3]> {
        let loads = self.load.0.sizes(self.num_displacements());
        typical_sizes(&self.a, [&self.bnu_t, &self.bt_t], loads, &self.gap)
    }

    /// Replaces the load.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_load(mut self, load: LoadPath) -> Result<Self, ContactError> {
        load.0.check("the load", self.num_displacements())?;
        self.load = load;
        Ok(self)
    }

    /// Replaces the coefficients of friction.
    ///
    /// # Errors
    /// Wrong length, values that are not finite, a constant coefficient below 0.
    pub fn with_friction(mut self, friction: FrictionPath) -> Result<Self, ContactError> {
        friction
            .0
            .check("the coefficients of friction", self.num_contacts())?;
        self.law.constant_friction = friction.0.is_constant();
        self.friction = friction;
        if self.law.constant_friction {
            self.check_friction(0.0)?;
        }
        Ok(self)
    }

    /// Sets the augmentation parameter r > 0 (force per length). Solutions do not depend on it, but what counts as near a change of
    /// state does: values more than 10⁵ away from the stiffness of the contact nodes make rounding errors count.
    ///
    /// # Errors
    /// r ≤ 0 or not finite.
    pub fn with_r(mut self, r: f64) -> Result<Self, ContactError> {
        if !(r > 0.0 && r.is_finite()) {
            return Err(ContactError::Augmentation { r });
        }
        self.law.r = r;
        Ok(self)
    }

    /// Sets the form of the friction bound.
    #[must_use]
    pub fn with_bound(mut self, bound: SlipBound) -> Self {
        self.law.bound = bound;
        self
    }

    /// Number n of displacements.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.a.nrows()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.bnu_t.ncols()
    }

    /// The augmentation parameter r.
    #[must_use]
    pub fn r(&self) -> f64 {
        self.law.r
    }

    /// The stiffness matrix A.
    #[must_use]
    pub fn stiffness(&self) -> &Matrix {
        &self.a
    }

    /// The load f(α).
    #[must_use]
    pub fn load_at(&self, alpha: f64) -> Vec<f64> {
        let n = self.num_displacements();
        let (mut f, mut df) = (vec![0.0; n], vec![0.0; n]);
        self.load.0.value(alpha, &mut f, &mut df);
        f
    }

    /// ∂_fH in the full form, the derivative of the residuals with respect to the load: −I above zeros.
    ///
    /// # Errors
    /// None in practice; the pattern is checked again.
    pub fn load_derivative(&self) -> Result<Matrix, ContactError> {
        let n = self.num_displacements();
        let rows = n + 2 * self.num_contacts();
        let mut matrix = Matrix::zeros(Pattern::from_entries(rows, n, (0..n).map(|i| (i, i)))?);
        matrix.values_mut().fill(-1.0);
        Ok(matrix)
    }

    /// The coefficients of friction F(α).
    #[must_use]
    pub fn friction_at(&self, alpha: f64) -> Vec<f64> {
        let p = self.num_contacts();
        let (mut f, mut df) = (vec![0.0; p], vec![0.0; p]);
        self.friction.0.value(alpha, &mut f, &mut df);
        f
    }

    /// Checks that F(α) ≥ 0 and finite at every node.
    ///
    /// # Errors
    /// [`ContactError::NegativeFriction`] or [`ContactError::NotFinite`] names the node.
    pub fn check_friction(&self, alpha: f64) -> Result<(), ContactError> {
        let f = self.friction_at(alpha);
        super::error::check_finite("the coefficient of friction", &f)?;
        match f.iter().position(|v| *v < 0.0) {
            Some(node) => Err(ContactError::NegativeFriction {
                node,
                parameter: alpha,
                value: f[node],
            }),
            None => Ok(()),
        }
    }
}

/// What full and condensed friction maps have in common: contact nodes as sites, and values at them.
pub trait FrictionMap: PiecewiseSmooth {
    /// The problem behind the map.
    fn problem(&self) -> &FrictionProblem;

    /// What happens at each contact node at x.
    fn nodes(&self, x: &[f64]) -> Vec<NodeValues>;

    /// The displacements u at a solution x.
    ///
    /// # Errors
    /// Failures of the linear solver (condensed form).
    fn displacements(&self, x: &[f64]) -> Result<Vec<f64>, ContactError>;

    /// The state of each contact node in a selection.
    fn states(&self, selection: &Selection) -> Vec<ContactState> {
        let law = self.problem().law;
        selection.pieces().map(|p| law.state(p)).collect()
    }

    /// The selection with the given states (those beyond the number of nodes are ignored, missing ones are open).
    fn selection_of(&self, states: &[ContactState]) -> Selection {
        let p = self.problem().num_contacts();
        Selection::from_pieces((0..p).map(|i| states.get(i).map_or(0, |s| s.piece())))
    }

    /// States, local quantities, energies and residuals at a solution x.
    ///
    /// # Errors
    /// Wrong length; failures of the linear solver (condensed form).
    fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError> {
        check_length("the solution x", x, self.num_vars())?;
        let problem = self.problem();
        let (p, parameter) = (problem.num_contacts(), x[x.len() - 1]);
        let u = self.displacements(x)?;
        let load = problem.load_at(parameter);
        let (mut stiff, mut reaction) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        problem.a.mul_vec(&u, &mut stiff);
        let forces = &x[x.len() - 1 - 2 * p..];
        problem.bnu_t.as_ref().mul_add(1.0, &forces[..p], &mut reaction);
        problem
            .bt_t
            .as_ref()
            .mul_add(1.0, &forces[p..2 * p], &mut reaction);
        let own = self.nodes(x);
        let nodes = own.iter().enumerate().map(|(node, v)| LocalValues {
            node,
            penetration: v.penetration,
            slip: [v.slip, 0.0],
            pressure: v.pressure,
            traction: [v.traction, 0.0],
            parameter,
            r: problem.r(),
        });
        let law = problem.law;
        Ok(ContactSolution::assemble(
            nodes.collect(),
            |v| {
                let (v, tests) = (&own[v.node], law.tests(&own[v.node]));
                let margin = |piece: usize| crate::piecewise::cell_margin(law.cell(piece), &tests);
                let piece = (0..law.num_pieces())
                    .max_by(|&a, &b| margin(a).total_cmp(&margin(b)))
                    .unwrap_or(0);
                let [normal, tangential] = law.residual(piece, v);
                (law.state(piece), [normal, tangential, 0.0])
            },
            |i| held(&problem.gap, &[], i),
            (
                0.5 * dot(&u, &stiff),
                dot(&u, &load),
                imbalance(&stiff, &reaction, &load),
            ),
        ))
    }

    /// The printed test functions θ¹, θ², θ³ of each node.
    fn theta(&self, x: &[f64]) -> Vec<[f64; 3]> {
        let r = self.problem().r();
        self.nodes(x).iter().map(|v| v.theta(r)).collect()
    }
}

fn full_pattern(a: &Matrix, bnu: &Matrix, bt: &Matrix) -> Result<Pattern, ContactError> {
    let (n, p) = (a.nrows(), bnu.nrows());
    let mut entries: Vec<(usize, usize)> = a.triplets().map(|(i, j, _)| (i, j)).collect();
    for (b, offset) in [(bnu, n), (bt, n + p)] {
        for (i, j, _) in b.triplets() {
            entries.push((j, offset + i));
            for row in [n + i, n + p + i] {
                entries.push((row, j));
            }
        }
    }
    let alpha = n + 2 * p;
    for i in 0..p {
        for row in [n + i, n + p + i] {
            for col in [n + i, n + p + i, alpha] {
                entries.push((row, col));
            }
        }
    }
    entries.extend((0..n).map(|i| (i, alpha)));
    Ok(Pattern::from_entries(n + 2 * p, alpha + 1, entries)?)
}

/// Writes the test functions of all nodes.
pub(super) fn write_tests(law: &Law, nodes: impl Iterator<Item = NodeValues>, out: &mut [f64]) {
    for (chunk, v) in out.chunks_exact_mut(TESTS).zip(nodes) {
        chunk.copy_from_slice(&law.tests(&v));
    }
}
