//! What a point of a solution set is: the arms that leave it, and what the parameter does on them.

mod beside;
mod first;

pub(in crate::continuation) use first::{Wanted, one_arm};
