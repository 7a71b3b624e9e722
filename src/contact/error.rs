use thiserror::Error;

use crate::Cause;
use crate::InputError;
use crate::linear::LinearError;
use crate::newton::NewtonError;
use crate::piecewise::{PiecewiseError, carries_maps};
use crate::run::Status;
use crate::sensitivity::SensitivityError;

/// What can be wrong with a contact problem.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ContactError {
    /// The space has neither two nor three dimensions.
    #[error("dimension {found}: contacts live in the plane (2) or in space (3)")]
    Dimension {
        /// The dimension given.
        found: usize,
    },
    /// A coefficient of friction is negative.
    #[error("the coefficient of friction of contact {contact} is {value}; it must not be negative")]
    NegativeCoefficient {
        /// The contact, from 0.
        contact: usize,
        /// Its coefficient.
        value: f64,
    },
    /// A diagonal entry of M is negative, so that a push at a contact makes it move against the push.
    #[error(
        "M[{index}, {index}] = {value} is negative; a Delassus matrix is positive semidefinite: check signs and block order"
    )]
    NegativeDiagonal {
        /// Row and column, from 0.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Derivatives of a solution in parameters.
    #[error(transparent)]
    Sensitivity(Box<SensitivityError>),
    /// There are no displacements or no contact nodes.
    #[error("the problem is empty: {what}")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A matrix entry is NaN or infinite.
    #[error("{what}: {source}")]
    Matrix {
        /// Which matrix.
        what: &'static str,
        /// The entry.
        source: InputError,
    },
    /// The augmentation parameter r is too far from the one chosen from the stiffness of the contact nodes, or not positive.
    #[error(
        "the augmentation parameter r = {r:e} must be between {lowest:e} and {highest:e}: 10^±12 times the one chosen from the stiffness of the contact nodes"
    )]
    Augmentation {
        /// Its value.
        r: f64,
        /// The least value allowed.
        lowest: f64,
        /// The largest value allowed.
        highest: f64,
    },
    /// A coefficient of friction is negative where a node may be in contact.
    #[error(
        "the coefficient of friction of node {node} is {value} at parameter {parameter}; it must not be negative"
    )]
    NegativeFriction {
        /// The contact node, from 0.
        node: usize,
        /// The parameter α.
        parameter: f64,
        /// F at α.
        value: f64,
    },
    /// A coefficient of friction is 0 under a law that divides by it.
    #[error(
        "the coefficient of friction of node {node} is 0 at parameter {parameter}, and the law in space divides by it: at a node without friction \
         both coefficients are 0, whatever the parameter and the slip; without any friction, `Frictionless::space()` is the law"
    )]
    NoFriction {
        /// The contact node, from 0.
        node: usize,
        /// The parameter α.
        parameter: f64,
    },
    /// A Lamé coefficient is not positive.
    #[error("Lamé coefficient {name} = {value} must be positive", name = ["lambda", "mu"][(*index).min(1)])]
    Modulus {
        /// 0 for λ, 1 for μ.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A curve of the coefficient of friction, a given bound, an area or a range of slips is malformed.
    #[error("{what}")]
    Invalid {
        /// What is wrong, and where.
        what: String,
    },
    /// A law for another dimension than the body.
    #[error("the law has {law} tangential direction(s), the body {body}: use planar laws with planar bodies")]
    Tangents {
        /// Of the law.
        law: usize,
        /// Of the body.
        body: usize,
    },
    /// A number of pieces, test functions or history variables of a law that is out of range.
    #[error("the law has {found} {what}; it must have {least} to {most}")]
    Law {
        /// What is counted.
        what: &'static str,
        /// Its number.
        found: usize,
        /// The least number allowed; of test functions, the number that the cells of the pieces name.
        least: usize,
        /// The largest number allowed.
        most: usize,
    },
    /// Multipliers that do no work in any displacement: condition (1) of Haslinger, Kučera and Vlach (2008) fails.
    #[error(
        "{expected} multipliers, but their pairing with the displacements has rank {rank} only: use fewer (larger faces), or nodal multipliers"
    )]
    InvisibleMultiplier {
        /// Number of multipliers.
        expected: usize,
        /// Rank of the pairing with the displacements.
        rank: usize,
    },
    /// The body could not be made.
    #[error("the body: {source}")]
    Body {
        /// Why.
        source: Cause,
    },
    /// Traces without a node of their own, or along directions that are not orthonormal: contact in the displacements alone requires both.
    #[error(
        "the traces of contact node {node} are {what}; contact in the displacements alone needs orthonormal traces in which one node, which no other contact node has, has a share of a half at least: use the condensed form"
    )]
    NotNodal {
        /// The contact node, from 0.
        node: usize,
        /// What was found.
        what: &'static str,
    },
    /// A law whose equations at a node do not determine its forces from its displacements.
    #[error(
        "the law does not determine the forces of node {node} in the piece \"{piece}\": use the condensed form"
    )]
    NotReducible {
        /// The contact node, from 0.
        node: usize,
        /// The piece of the law.
        piece: String,
        /// The best iterate before, with its history.
        best: Box<super::ReducedReport>,
    },
    /// Another process that computes a part of the same body found an error.
    #[error("another process found an error in its part of the body")]
    Elsewhere {
        /// The best iterate before, in the part of this process, with its history.
        best: Box<super::ReducedReport>,
    },
    /// More memory would be needed than is allowed.
    #[error("about {needed} bytes would be needed, {limit} are allowed")]
    Memory {
        /// Estimate, in bytes.
        needed: u64,
        /// Limit set in the options, in bytes.
        limit: u64,
    },
    /// Contact in the displacements alone found no solution, or ended early: the status of the report says why.
    #[error(
        "no solution found in {}, {}: relative residuals of equilibrium {:e}, of the normal law {:e}, of friction {:e} at the best iterate",
        crate::words::Count(.best.iterations.len(), "step", "steps"), .best.status,
        .best.residuals.equilibrium, .best.residuals.normal, .best.residuals.tangential
    )]
    NotConverged {
        /// The best iterate, with its history.
        best: Box<super::ReducedReport>,
    },
    /// The linear system of a Newton step in the displacements could not be solved, as where numbers overflow or the preconditioner breaks
    /// down, and no other strategy found a solution.
    #[error(
        "the linear system of Newton step {} could not be solved; relative residuals of equilibrium {:e}, of the normal law {:e}, of friction \
         {:e} at the best iterate: check the sizes of stiffness, load and r",
        .best.iterations.len(), .best.residuals.equilibrium, .best.residuals.normal, .best.residuals.tangential
    )]
    StepFailed {
        /// What went wrong.
        source: LinearError,
        /// The best iterate, with its history.
        best: Box<super::ReducedReport>,
    },
    /// A connected part (piece) of the body is insufficiently supported, or its stiffness matrix is not positive definite for another
    /// reason.
    #[error(
        "the piece of the body that displacement {displacement}{} belongs to {}",
        .at.map_or(String::new(), |p| format!(" at ({}, {}, {})", p[0], p[1], p[2])),
        if .modes.is_empty() {
            "has a stiffness matrix that is not positive definite, and no motion that makes no forces: check the signs of its entries".to_owned()
        } else {
            format!(
                "is not supported against {modes}, or by less than rounding. Each piece needs supports of its own; the full and the condensed form accept pieces supported by contact alone"
            )
        }
    )]
    Unsupported {
        /// The first displacement of the piece, as numbered in the stiffness matrix.
        displacement: usize,
        /// Position of its node, if known.
        at: Option<[f64; 3]>,
        /// The free rigid motions about the centre of the piece, in words; where positions are not known, or the motion is not rigid, the
        /// displacement that moves most in a zero-energy motion; empty where there is none.
        modes: String,
    },
    /// No contact forces balance the load: it moves an unsupported body away from the foundation, or along it against less friction than
    /// would be needed (then in a motion that lifts it, too: no contact forces do work against that).
    #[error(
        "nothing balances the load at parameter {parameter}: it does the work {work:e} in a motion that makes no forces, in which {}\
         displacement {displacement}{} moves most, by 1, and no contact node comes nearer to the foundation: hold the body, or change the load",
        .motion.as_ref().map_or(String::new(), |m| format!("the body {m}, ")),
        .at.map_or(String::new(), |p| format!(" at ({}, {}, {})", p[0], p[1], p[2]))
    )]
    Unbalanced {
        /// The parameter α.
        parameter: f64,
        /// The displacement that moves most, as numbered in the stiffness matrix.
        displacement: usize,
        /// Position of its node, if known.
        at: Option<[f64; 3]>,
        /// The motion in words where it is rigid and positions are known: "slides along (1, 0)", say.
        motion: Option<String>,
        /// The work of the load for a largest displacement of 1.
        work: f64,
    },
    /// The law has no Delassus form.
    #[error(
        "only Coulomb's law with coefficients of friction that do not depend on the slip has a Delassus form: solve the full or the condensed form"
    )]
    NotCoulomb,
    /// A law without history variables whose coefficients of friction depend on the slip, in a history of loading that measures slips level
    /// by level.
    #[error(
        "the coefficients of friction depend on the slip, which is measured anew in each level, and the law has no history: they would depend on the number of levels; give the law a history, or choose increments of slip (`with_slip_increments`)"
    )]
    SlipOfLevels,
    /// No first point was found.
    #[error("no solution found at parameter {parameter}: {source}")]
    NoStart {
        /// The parameter α.
        parameter: f64,
        /// Why the last attempt failed.
        source: Box<NewtonError>,
    },
    /// The linear problem with given states of all nodes is singular.
    #[error(
        "the linear problem with the given states is singular at parameter {parameter}: give another start"
    )]
    SingularStart {
        /// The parameter α.
        parameter: f64,
    },
    /// A failure in the evaluation of the map.
    #[error(transparent)]
    Map(PiecewiseError),
    /// A failure in linear algebra.
    #[error(transparent)]
    Linear(#[from] LinearError),
}

carries_maps!(ContactError);

impl From<SensitivityError> for ContactError {
    fn from(error: SensitivityError) -> Self {
        Self::Sensitivity(Box::new(error))
    }
}

impl ContactError {
    /// Whether a search was stopped, by its observer or by the time limit.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.status().is_some_and(Status::is_early)
    }

    /// Whether the caller ended the search.
    pub(super) fn is_stopped(&self) -> bool {
        self.status() == Some(Status::Interrupted)
    }

    fn status(&self) -> Option<Status> {
        match self {
            Self::NotConverged { best } => Some(best.status),
            Self::NoStart { source, .. } => match &**source {
                NewtonError::Failed(unsolved) => Some(unsolved.status),
                _ => None,
            },
            _ => None,
        }
    }
}
