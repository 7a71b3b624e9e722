use super::ContactState;
use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN};
use crate::piecewise::Facet;

/// Frictionless contact: λt = 0. Pieces "open", "closed".
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frictionless {
    tangents: usize,
}

impl Frictionless {
    /// In the plane (one tangent).
    #[must_use]
    pub const fn plane() -> Self {
        Self { tangents: 1 }
    }

    /// In space (two tangents).
    #[must_use]
    pub const fn space() -> Self {
        Self { tangents: 2 }
    }
}

impl NodeLaw for Frictionless {
    fn num_tangents(&self) -> usize {
        self.tangents
    }

    fn num_pieces(&self) -> usize {
        2
    }

    fn num_tests(&self) -> usize {
        1
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        if piece == 0 { &[OPEN] } else { &[CLOSED] }
    }

    fn piece_name(&self, piece: usize) -> &'static str {
        if piece == 0 { "open" } else { "slip" }
    }

    fn state(&self, piece: usize, v: &LocalValues) -> ContactState {
        match piece {
            0 => ContactState::Open,
            // The side is that of the slip: the traction is zero up to rounding.
            _ => ContactState::slipping(v.slip[0]),
        }
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        out[0] = v.theta1();
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        rows[0] = v.theta1_row();
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        [v.normal(piece == 1).0, v.traction[0], v.traction[1]]
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        [
            v.normal(piece == 1).1,
            LocalRow::of_traction(0),
            LocalRow::of_traction(1),
        ]
    }

    fn is_affine(&self) -> bool {
        true
    }

    fn is_coulomb(&self) -> bool {
        true
    }
}
