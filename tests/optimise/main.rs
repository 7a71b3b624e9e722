//! Minimisation of functions with kinks, alone and of solutions.
#![cfg(feature = "autodiff")]

mod branches;
mod functions;
mod mpecs;
