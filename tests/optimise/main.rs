//! Minimisation of functions with kinks, alone and of solutions.
#![cfg(feature = "autodiff")]

#[path = "../common/random.rs"]
mod random;

mod branches;
mod contact;
mod functions;
mod mpecs;
