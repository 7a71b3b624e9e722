//! The graph of all branches connected to given starts.

mod arc;
mod certain;
mod chains;
mod explore;
#[cfg(feature = "serde")]
mod file;
mod identity;
mod model;
mod natural;
mod options;
mod query;
mod resume;
mod sections;
mod slots;
mod split;
mod table;

pub use chains::DiagramBranch;
pub use explore::Progress;
pub use model::{
    Diagram, DiagramCompleteness, DiagramEdge, DiagramVertex, EdgeEnd, Limit, VertexArm, VertexKind,
};
pub use options::DiagramOptions;
pub use query::{DiagramFold, DiagramSolution, SolutionsAt};
pub use sections::SectionProgress;
