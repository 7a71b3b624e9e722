//! Mixed complementarity problems: the corpus, defects of other solvers, properties.

#[path = "../../examples/common/expressions.rs"]
mod expressions;

#[path = "../common/random.rs"]
mod random;

mod accuracy;
mod corpus;
mod defects;
mod functions;
mod globalisation;
mod linear;
mod outcomes;
mod parametric;
mod properties;
mod regularity;
mod reports;
mod singular;
mod strategies;
mod support;
