//! Parameters of a contact problem: what their derivatives are made of.

use std::fmt;
use std::sync::Arc;

use super::law::{NodeLaw, check_law};
use super::{ContactError, ReducedContact};
use crate::InputError;
use crate::contact::Contact;
use crate::input::{check_finite, check_length};
use crate::interface::View;
use crate::sparse::Matrix;

/// A law that threads may share.
pub(super) type SharedLaw = Arc<dyn NodeLaw + Send + Sync>;

/// Parameters θ that the data of a contact problem depend on, by the derivatives of its equations: made by `parameters` of a problem in any
/// of its forms ([`Contact::parameters`], [`ReducedContact::parameters`]), filled by the functions below, and used by `sensitivity` of that
/// problem. Parameters are numbered in the order in which they are added, and measured as changes: they are 0 at the solution.
///
/// Each is a column of ∂_θ(A u + Bᵀ λ − f), of ∂_θ(B u − gap), and a change of the second parameter β that the law has at each node. These
/// columns are all that a derivative needs of it, be it a load, a gap, a coefficient of friction, Young's modulus or the position of a node.
#[derive(Clone)]
pub struct ContactParameters {
    /// Numbers of displacements and of contact nodes, and of directions of a node.
    sizes: [usize; 3],
    count: usize,
    equilibrium: Vec<(usize, usize, f64)>,
    traces: Vec<(usize, usize, f64)>,
    second: Vec<(usize, usize, f64)>,
    law: Option<SharedLaw>,
    /// Parameters whose columns hold at one solution only.
    at_solution: Vec<usize>,
    alpha: bool,
}

impl fmt::Debug for ContactParameters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ContactParameters")
            .field("len", &self.len())
            .field("alpha", &self.alpha)
            .finish_non_exhaustive()
    }
}

impl ContactParameters {
    pub(super) fn new(displacements: usize, contacts: usize, directions: usize) -> Self {
        Self {
            sizes: [displacements, contacts, directions],
            count: 0,
            equilibrium: Vec::new(),
            traces: Vec::new(),
            second: Vec::new(),
            law: None,
            at_solution: Vec::new(),
            alpha: false,
        }
    }

    /// Number of parameters.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count + usize::from(self.alpha)
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Makes the load parameter α a parameter, the first one.
    #[must_use]
    pub fn with_alpha(mut self) -> Self {
        self.alpha = true;
        self
    }

    /// Adds loads: one parameter for each column of `forces` (n rows, one a free displacement). The identity stands for all components of
    /// the load; [forces](super::LoadCase::forces) of a case of [moving supports](crate::fem::ElasticSystem::motion) for their motion.
    ///
    /// # Errors
    /// Another number of rows, entries that are not finite.
    pub fn with_loads(mut self, forces: &Matrix) -> Result<Self, ContactError> {
        self.check("the columns of loads", forces, self.sizes[0])?;
        let loads = forces.triplets().map(|(i, j, f)| (i, self.count + j, -f));
        self.equilibrium.extend(loads);
        self.count += forces.ncols();
        Ok(self)
    }

    /// Adds initial gaps: one parameter for each column of `gaps` (p rows, one a contact node). The identity stands for all gaps.
    ///
    /// # Errors
    /// Another number of rows, entries that are not finite.
    pub fn with_gaps(mut self, gaps: &Matrix) -> Result<Self, ContactError> {
        self.check("the columns of gaps", gaps, self.sizes[1])?;
        let gaps_of = gaps.triplets().map(|(i, j, g)| (i, self.count + j, -g));
        self.traces.extend(gaps_of);
        self.count += gaps.ncols();
        Ok(self)
    }

    /// Adds parameters of the law: `law` is that of the problem where its second parameter β is 0
    /// ([`LocalValues::second`](super::LocalValues::second)), and each column of `second` (p rows) is the change of β at the contact nodes
    /// with one parameter. With [`FrictionCoefficient::with_second`](super::FrictionCoefficient::with_second) and slopes 1, β is added to
    /// the coefficient of friction: the identity then stands for the coefficients of all nodes, and a column of ones for one common to all.
    ///
    /// # Errors
    /// Another number of rows, entries that are not finite, a law of another dimension, a second law.
    pub fn with_law(
        mut self,
        law: impl NodeLaw + Send + Sync + 'static,
        second: &Matrix,
    ) -> Result<Self, ContactError> {
        self.check("the columns of the second parameter", second, self.sizes[1])?;
        check_law(&law, self.sizes[2] - 1, self.sizes[1])?;
        if self.law.is_some() {
            let what = "the parameters of the law are given twice: one law with one β has all of them".into();
            return Err(ContactError::Invalid { what });
        }
        self.law = Some(Arc::new(law));
        let changes = second.triplets().map(|(i, j, b)| (i, self.count + j, b));
        self.second.extend(changes);
        self.count += second.ncols();
        Ok(self)
    }

    /// Adds parameters of the body by what they change at the solution (u, λ): a column of ∂_θ(A u + Bᵀ λ − f) (n rows) and one of
    /// ∂_θ(B u − gap) (one row a trace: all normal ones, then all along t₁, t₂) for each. Of elastic bodies,
    /// [`ElasticSystem::forces_by_material`](crate::fem::ElasticSystem::forces_by_material) and
    /// [`forces_by_position`](crate::fem::ElasticSystem::forces_by_position) give the former,
    /// [`ContactRows::traces_by_position`](crate::fem::ContactRows::traces_by_position) the latter.
    ///
    /// # Errors
    /// Other shapes, entries that are not finite.
    pub fn with_body(mut self, forces: &Matrix, traces: Option<&Matrix>) -> Result<Self, ContactError> {
        self.check("the columns of forces", forces, self.sizes[0])?;
        let k = forces.ncols();
        if let Some(traces) = traces {
            self.check("the columns of traces", traces, self.sizes[1] * self.sizes[2])?;
            check_length("the list of columns of traces", traces.ncols(), k)?;
            let columns = traces.triplets().map(|(i, j, t)| (i, self.count + j, t));
            self.traces.extend(columns);
        }
        let columns = forces.triplets().map(|(i, j, f)| (i, self.count + j, f));
        self.equilibrium.extend(columns);
        // Nodes of cells that are held at all their nodes move nothing, which is no mistake.
        self.equilibrium.extend((0..k).map(|j| (0, self.count + j, 0.0)));
        self.at_solution.extend(self.count..self.count + k);
        self.count += k;
        Ok(self)
    }

    /// These and, behind them, the tangential displacements from which slips are measured; none needs to enter.
    pub(super) fn with_references(&self) -> Self {
        let mut made = self.clone();
        let [_, p, directions] = self.sizes;
        let references = p * (directions - 1);
        made.equilibrium.extend((0..self.count).map(|j| (0, j, 0.0)));
        let columns = (0..references).map(|k| (p + k, self.count + k, -1.0));
        made.traces.extend(columns);
        made.count += references;
        made
    }

    fn check(&self, what: &'static str, columns: &Matrix, rows: usize) -> Result<(), ContactError> {
        if columns.nrows() != rows {
            return Err(ContactError::Input(InputError::Shape {
                what,
                rows,
                cols: columns.ncols(),
                found_rows: columns.nrows(),
                found_cols: columns.ncols(),
            }));
        }
        Ok(check_finite(what, columns.values())?)
    }

    /// Whether these are parameters of a problem of that size.
    pub(super) fn check_sizes(&self, sizes: [usize; 3]) -> Result<(), ContactError> {
        const WHAT: [&str; 3] = [
            "the list of displacements of the parameters",
            "the list of contact nodes of the parameters",
            "the list of directions of the parameters",
        ];
        for ((what, expected), found) in WHAT.into_iter().zip(sizes).zip(self.sizes) {
            check_length(what, found, expected)?;
        }
        match self.is_empty() {
            true => Err(ContactError::Empty {
                what: "there are no parameters",
            }),
            false => Ok(()),
        }
    }

    pub(super) fn has_alpha(&self) -> bool {
        self.alpha
    }

    pub(super) fn shared_law(&self) -> Option<&SharedLaw> {
        self.law.as_ref()
    }

    /// Whether the law with parameters remembers as much as the problem's own.
    pub(super) fn check_law(&self, own: &dyn NodeLaw) -> Result<(), ContactError> {
        let expected = own.num_history();
        match self.law.as_ref().map(|law| law.num_history()) {
            Some(found) if found != expected => Err(ContactError::Law {
                what: "history variables",
                found,
                least: expected,
                most: expected,
            }),
            _ => Ok(()),
        }
    }

    /// Numbers, α counted, of the parameters whose columns hold at one solution only.
    pub(super) fn at_solution(&self) -> Vec<usize> {
        let first = usize::from(self.alpha);
        self.at_solution.iter().map(|j| first + j).collect()
    }

    /// ∂_θ(A u + Bᵀ λ − f), without α.
    pub(super) fn equilibrium(&self) -> Result<Matrix, ContactError> {
        Ok(Matrix::from_triplets(
            self.sizes[0],
            self.count,
            &self.equilibrium,
        )?)
    }

    /// ∂_θ(B u − gap), without α; `rows` beyond those of the contact nodes are zero.
    pub(super) fn traces(&self, rows: usize) -> Result<Matrix, ContactError> {
        Ok(Matrix::from_triplets(rows, self.count, &self.traces)?)
    }

    /// ∂_θβ at the nodes, without α; no rows where the law has no parameters.
    pub(super) fn second(&self) -> Result<Matrix, ContactError> {
        let rows = if self.law.is_some() { self.sizes[1] } else { 0 };
        Ok(Matrix::from_triplets(rows, self.count, &self.second)?)
    }
}

impl<V: View, L: NodeLaw> Contact<V, L> {
    /// No parameters yet: the start of a list of them.
    #[must_use]
    pub fn parameters(&self) -> ContactParameters {
        let body = self.body();
        ContactParameters::new(
            body.num_displacements(),
            body.num_contacts(),
            1 + body.num_tangents(),
        )
    }
}

impl<L: NodeLaw> ReducedContact<L> {
    /// No parameters yet: the start of a list of them.
    #[must_use]
    pub fn parameters(&self) -> ContactParameters {
        let body = self.body();
        ContactParameters::new(body.num_displacements(), body.num_contacts(), body.dim())
    }
}
