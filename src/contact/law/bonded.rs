use super::ContactState;
use super::node_law::{LocalRow, LocalValues, NodeLaw};
use crate::piecewise::Facet;

/// Nodes glued to what they touch: u_ν = gap, u_t = 0, whatever the forces. One piece, "bonded"; linear.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bonded {
    tangents: usize,
}

impl Bonded {
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

impl NodeLaw for Bonded {
    fn num_tangents(&self) -> usize {
        self.tangents
    }

    fn num_pieces(&self) -> usize {
        1
    }

    fn num_tests(&self) -> usize {
        0
    }

    fn cell(&self, _piece: usize) -> &'static [Facet] {
        &[]
    }

    fn piece_name(&self, _piece: usize) -> &'static str {
        "bonded"
    }

    fn state(&self, _piece: usize, _v: &LocalValues) -> ContactState {
        ContactState::Stick
    }

    fn tests(&self, _v: &LocalValues, _out: &mut [f64]) {}

    fn test_rows(&self, _v: &LocalValues, _rows: &mut [LocalRow]) {}

    fn residual(&self, _piece: usize, v: &LocalValues) -> [f64; 3] {
        let [t1, t2] = v.slip;
        [v.normal(true).0, -v.r * t1, -v.r * t2]
    }

    fn rows(&self, _piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let sticking = |d: usize| {
            let mut row = LocalRow::default();
            row.add(-v.r, &LocalRow::of_slip(d));
            row
        };
        [v.normal(true).1, sticking(0), sticking(1)]
    }

    fn is_affine(&self) -> bool {
        true
    }
}
