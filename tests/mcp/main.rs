//! Mixed complementarity problems: the corpus, defects seen elsewhere, properties.

#[path = "../../examples/common/expressions.rs"]
mod expressions;

mod corpus;
mod defects;
mod functions;
mod globalisation;
mod outcomes;
mod parametric;
mod properties;
mod support;
