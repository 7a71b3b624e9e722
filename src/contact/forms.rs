//! One type for the three forms of a contact problem, and the form that suits a body.

use super::law::NodeLaw;
use super::{CondensedContact, ContactError, ContactSolution, FullContact, ReducedContact};
use crate::piecewise::PiecewiseSmooth;

/// Free displacements of a solid beyond which multigrid takes much less time than one factorisation of the stiffness matrix and the dense
/// compliance of its contact nodes: the body and two solutions of 7 344 displacements (`contact_size --solid 16x16x8 --route …`) take 0.10 s
/// against 0.28 s condensed. Smaller bodies take less than 0.2 s condensed, a form that also follows curves. Solutions do not depend on it.
const LARGE_SOLID: usize = 6_000;
/// The same in the plane, where factors stay sparse and time grows alike: the size whose factors fill 16 GB.
const LARGE_PLANE: usize = 3_000_000;

/// The unknowns in which a contact problem is solved. Solutions are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum ContactForm {
    /// The displacements alone for large bodies that their supports hold, where the contact nodes permit it, else condensed.
    #[default]
    Auto,
    /// Displacements and contact forces, sparse: [`FullContact`].
    Full,
    /// The contact forces, dense: [`CondensedContact`]. Curves, lists of all solutions and certificates are quickest in it.
    Condensed,
    /// The displacements alone, with multigrid: [`ReducedContact`]. Not for curves.
    Displacements,
}

impl ContactForm {
    /// The form for a body of `dim` dimensions, 2 or 3, with this number of free displacements: what `Auto` stands for, any other form
    /// unchanged. `Auto` is `Displacements` for solids of more than 6 000 free displacements and for plane bodies of more than 3 000 000,
    /// if each contact node has a node of the mesh to itself (`nodal`:
    /// [`ContactRows::has_own_nodes`](crate::fem::ContactRows::has_own_nodes)), as the form needs; else `Condensed`.
    ///
    /// ```
    /// use semismooth::contact::ContactForm;
    /// assert_eq!(ContactForm::Auto.suited(3, 100_000, true), ContactForm::Displacements);
    /// assert_eq!(ContactForm::Auto.suited(3, 100_000, false), ContactForm::Condensed);
    /// assert_eq!(ContactForm::Auto.suited(2, 100_000, true), ContactForm::Condensed);
    /// assert_eq!(ContactForm::Full.suited(3, 100_000, true), ContactForm::Full);
    /// ```
    #[must_use]
    pub const fn suited(self, dim: usize, displacements: usize, nodal: bool) -> Self {
        let most = if dim == 2 { LARGE_PLANE } else { LARGE_SOLID };
        match self {
            Self::Auto if nodal && displacements > most => Self::Displacements,
            Self::Auto => Self::Condensed,
            form => form,
        }
    }
}

/// A contact problem in the form that was asked for or suits it: made by [`contact_problem`](crate::contact_problem), or from a problem
/// in one of its forms.
#[derive(Debug)]
#[non_exhaustive]
pub enum ContactProblem<L> {
    /// x = (u, λν, λt₁[, λt₂], α).
    Full(Box<FullContact<L>>),
    /// x = (λν, λt₁[, λt₂], α), for bodies that contact alone holds (λν, λt₁[, λt₂], c, α).
    Condensed(Box<CondensedContact<L>>),
    /// u.
    Displacements(Box<ReducedContact<L>>),
}

/// A solution of a [`ContactProblem`] at a parameter value.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ContactEquilibrium {
    /// The parameter α.
    pub parameter: f64,
    /// The free displacements u, as numbered in the stiffness matrix.
    pub displacements: Vec<f64>,
    /// Nodal contact forces λν of all nodes, then λt₁, in space then λt₂.
    pub forces: Vec<f64>,
    /// States, forces and slips node by node, energies and residuals.
    pub solution: ContactSolution,
}

impl<L: NodeLaw> ContactProblem<L> {
    /// The form of this problem; never `Auto`.
    #[must_use]
    pub const fn form(&self) -> ContactForm {
        match self {
            Self::Full(_) => ContactForm::Full,
            Self::Condensed(_) => ContactForm::Condensed,
            Self::Displacements(_) => ContactForm::Displacements,
        }
    }

    /// The piecewise-smooth map, for curves, diagrams and lists; none in the displacements alone.
    #[must_use]
    pub fn map(&self) -> Option<&(dyn PiecewiseSmooth + Sync)>
    where
        L: Sync,
    {
        match self {
            Self::Full(problem) => Some(&**problem),
            Self::Condensed(problem) => Some(&**problem),
            Self::Displacements(_) => None,
        }
    }

    /// A solution at α, from `start`, a solution at another parameter value, if there is one.
    ///
    /// # Errors
    /// As [`Contact::solve`](super::Contact::solve) and [`ReducedContact::solve`], with the best iterate and its history; a start of
    /// another problem.
    pub fn solve(
        &mut self,
        alpha: f64,
        start: Option<&ContactEquilibrium>,
    ) -> Result<ContactEquilibrium, ContactError> {
        let (displacements, forces, solution) = match self {
            Self::Full(problem) => {
                let start = start.map(|s| [&s.displacements[..], &s.forces, &[s.parameter]].concat());
                let x = problem.solve(alpha, start.as_deref())?;
                let solution = problem.solution(&x)?;
                let (u, forces) = x[..x.len() - 1].split_at(problem.num_displacements());
                (u.to_vec(), forces.to_vec(), solution)
            }
            Self::Condensed(problem) => {
                let start = start.map(|s| problem.body().point_of(&s.displacements, &s.forces, s.parameter));
                let mut x = problem.solve(alpha, start.as_deref())?;
                let (u, solution) = (problem.displacements(&x)?, problem.solution(&x)?);
                x.truncate(problem.law().own_traces());
                (u, x, solution)
            }
            Self::Displacements(problem) => {
                let found = problem.solve(alpha, start.map(|s| &s.displacements[..]))?;
                let solution = problem.solution(alpha, &found.displacements)?;
                (found.displacements, found.forces, solution)
            }
        };
        Ok(ContactEquilibrium {
            parameter: alpha,
            displacements,
            forces,
            solution,
        })
    }
}
