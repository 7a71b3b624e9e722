//! Curves with known transitions, folds and branch points.

mod control;
mod kinks;
mod maps;
mod smooth;
mod units;
