//! Transitions and folds as curves in a second parameter.

mod character;
mod fold_set;
mod transition_set;

pub use character::CharacterChange;
pub use fold_set::FoldSet;
pub use transition_set::TransitionSet;
