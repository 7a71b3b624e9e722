//! Shared code of the maps written for tests.
#![allow(dead_code, unused_imports, unused_macros)]

mod plane;

pub(crate) use plane::{Function, Plane};

/// The first methods of a map whose sites have two pieces each, distinguished by the sign of one test function; the arguments are the sign
/// of each piece and the numbers of variables, residuals and sites.
macro_rules! two_pieces {
    ($self:ident, [$first:ident, $second:ident], $vars:expr, $residuals:expr, $sites:expr) => {
        fn num_vars(&$self) -> usize {
            $vars
        }
        fn num_residuals(&$self) -> usize {
            $residuals
        }
        fn num_sites(&$self) -> usize {
            $sites
        }
        fn num_pieces(&self, _site: usize) -> usize {
            2
        }
        fn num_tests(&self, _site: usize) -> usize {
            1
        }
        fn cell(&self, _site: usize, piece: usize) -> &[semismooth::piecewise::Facet] {
            use semismooth::piecewise::Facet;
            const CELLS: [[Facet; 1]; 2] = [[Facet::$first(0)], [Facet::$second(0)]];
            &CELLS[piece]
        }
    };
}
pub(crate) use two_pieces;

/// The same for a smooth map.
macro_rules! one_piece {
    ($self:ident, $vars:expr, $residuals:expr) => {
        fn num_vars(&$self) -> usize {
            $vars
        }
        fn num_residuals(&$self) -> usize {
            $residuals
        }
        fn num_sites(&self) -> usize {
            0
        }
        fn num_pieces(&self, _site: usize) -> usize {
            1
        }
        fn num_tests(&self, _site: usize) -> usize {
            0
        }
        fn cell(&self, _site: usize, _piece: usize) -> &[semismooth::piecewise::Facet] {
            &[]
        }
        fn test_functions(&self, _x: &[f64], _out: &mut [f64]) {}
    };
}
pub(crate) use one_piece;

/// Methods delegated to a field.
macro_rules! hand_on {
    ($field:tt: $(fn $name:ident(&self $(, $arg:ident: $type:ty)*) $(-> $out:ty)?;)*) => {
        $(fn $name(&self $(, $arg: $type)*) $(-> $out)? { self.$field.$name($($arg),*) })*
    };
}
pub(crate) use hand_on;

/// The sizes and cells of a map, delegated to a field.
macro_rules! same_cells {
    ($field:tt) => {
        $crate::maps::hand_on! {
            $field:
            fn num_vars(&self) -> usize;
            fn num_residuals(&self) -> usize;
            fn num_sites(&self) -> usize;
            fn num_pieces(&self, site: usize) -> usize;
            fn num_tests(&self, site: usize) -> usize;
            fn cell(&self, site: usize, piece: usize) -> &[semismooth::piecewise::Facet];
        }
    };
}
pub(crate) use same_cells;

/// The mechanics of a node law, delegated to a field.
macro_rules! same_mechanics {
    ($field:tt) => {
        $crate::maps::hand_on! {
            $field:
            fn num_tangents(&self) -> usize;
            fn num_pieces(&self) -> usize;
            fn num_tests(&self) -> usize;
            fn cell(&self, piece: usize) -> &'static [semismooth::piecewise::Facet];
            fn state(&self, piece: usize, v: &semismooth::contact::LocalValues) -> semismooth::contact::ContactState;
            fn tests(&self, v: &semismooth::contact::LocalValues, out: &mut [f64]);
            fn test_rows(&self, v: &semismooth::contact::LocalValues, rows: &mut [semismooth::contact::LocalRow]);
            fn residual(&self, piece: usize, v: &semismooth::contact::LocalValues) -> [f64; 3];
            fn rows(&self, piece: usize, v: &semismooth::contact::LocalValues) -> [semismooth::contact::LocalRow; 3];
        }
    };
}
pub(crate) use same_mechanics;
