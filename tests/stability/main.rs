//! Stability of equilibria: against normal forms and systems whose eigenvalues are known in closed form.
#![cfg(feature = "autodiff")]

mod contact;
mod kinks;
mod smooth;
