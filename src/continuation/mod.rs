//! Piecewise-smooth Moore–Penrose continuation: solution curves of H(y, α) = 0 followed through their kinks.

mod black_box;
mod branch;
mod certificate;
mod curve;
mod diagram;
mod engine;
mod error;
mod event;
mod natural;
mod options;
mod point;
mod pursuit;
mod record;
#[cfg(feature = "serde")]
pub(crate) mod recorded;
mod save;
mod search;
mod start;
mod step;
#[cfg(test)]
mod testing;
mod two_parameters;
mod vertices;

pub use black_box::BlackBoxCurve;
pub use branch::Branch;
pub use certificate::{certify, certify_with};
pub use curve::Continuation;
pub use diagram::{
    Diagram, DiagramBranch, DiagramCompleteness, DiagramEdge, DiagramFold, DiagramOptions, DiagramSolution,
    DiagramVertex, EdgeEnd, Limit, Progress, SectionProgress, SolutionsAt, VertexArm, VertexKind,
};
pub use error::ContinuationError;
pub use options::{ContinuationOptions, StepRule, Strategy};
pub use point::{Certainty, PointAnalysis, PointDoubt, arms_at};
pub(crate) use pursuit::pursue;
pub use record::{
    Arm, BranchPoint, Event, MonitorCrossing, Point, PointKind, SiteChange, Termination, Transition,
    TransitionKind,
};
pub use save::SavedRun;
pub use search::{
    FoundBy, FoundSolution, FoundSolutions, SearchOptions, SolutionList, list_solutions, search_solutions,
    search_solutions_observed,
};
pub use start::Direction;
pub use two_parameters::{CharacterChange, FoldSet, TransitionSet};
pub use vertices::BranchVertex;
