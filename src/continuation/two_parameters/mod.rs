//! Transitions and folds as curves in a second parameter.

mod fold_set;
mod transition_set;

pub use fold_set::FoldSet;
pub use transition_set::{CharacterChange, TransitionSet};
