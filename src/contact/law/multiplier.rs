use super::coefficient::check_coefficient;
use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN};
use super::planar::{Tangential, WALL, test_rows, tests};
use super::{ContactState, FrictionCoefficient};
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Planar Coulomb friction with the bound g = F λν, the form of Haslinger, Janovský and Ligurský;
/// [`PlanarCoulomb`](crate::contact::PlanarCoulomb) has g = F (θ¹)₊.
///
/// The same solutions and determinants; off solutions the open state splits ("open", "open, stick", "open, slip-"), and where λν < 0 the
/// interval is reversed ("reversed", "open, reversed"). Along a branch an open node whose u_t changes sign passes from one open piece to
/// another: an artefact of the formulation, not a transition of the solution.
#[derive(Debug, Clone)]
pub struct MultiplierCoulomb {
    coefficient: FrictionCoefficient,
}

impl MultiplierCoulomb {
    /// The law with the given coefficient.
    ///
    /// # Errors
    /// A coefficient that depends on the slip: its pieces would not be continuous.
    pub fn new(coefficient: FrictionCoefficient) -> Result<Self, ContactError> {
        if coefficient.depends_on_slip() {
            return Err(ContactError::Invalid {
                what: "the bound F λν needs a coefficient of friction that does not depend on the slip"
                    .into(),
            });
        }
        Ok(Self { coefficient })
    }

    /// g = F λν.
    fn bound(&self, v: &LocalValues) -> f64 {
        self.coefficient.at(v, 0.0)[0] * v.pressure
    }

    /// The derivatives of g.
    fn bound_row(&self, v: &LocalValues) -> LocalRow {
        let [f, _, rate, second] = self.coefficient.at(v, 0.0);
        LocalRow {
            pressure: f,
            parameter: rate * v.pressure,
            second: second * v.pressure,
            ..LocalRow::default()
        }
    }

    fn is_closed(piece: usize) -> bool {
        matches!(piece, 1..=3 | 6)
    }

    fn tangential(piece: usize) -> Tangential {
        match piece {
            1 | 4 => Tangential::Stick,
            3 | 5 => Tangential::Slip(-1.0),
            6 | 7 => Tangential::Reversed,
            _ => Tangential::Slip(1.0),
        }
    }
}

impl NodeLaw for MultiplierCoulomb {
    fn num_tangents(&self) -> usize {
        1
    }

    fn num_nodes(&self) -> Option<usize> {
        self.coefficient.num_nodes()
    }

    fn num_pieces(&self) -> usize {
        8
    }

    fn num_tests(&self) -> usize {
        4
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        const CELLS: [&[Facet]; 8] = [
            &[OPEN, Facet::positive(1), Facet::positive(2)],
            &[CLOSED, Facet::negative(1), Facet::positive(2), WALL],
            &[CLOSED, Facet::positive(1), Facet::positive(2), WALL],
            &[CLOSED, Facet::negative(1), Facet::negative(2), WALL],
            &[OPEN, Facet::negative(1), Facet::positive(2)],
            &[OPEN, Facet::negative(1), Facet::negative(2)],
            &[CLOSED, Facet::positive(1), Facet::negative(2), WALL],
            &[OPEN, Facet::positive(1), Facet::negative(2)],
        ];
        CELLS[piece.min(7)]
    }

    fn piece_name(&self, piece: usize) -> &'static str {
        const NAMES: [&str; 8] = [
            "open",
            "stick",
            "slip+",
            "slip-",
            "open, stick",
            "open, slip-",
            "reversed",
            "open, reversed",
        ];
        NAMES[piece.min(7)]
    }

    fn state(&self, piece: usize, _v: &LocalValues) -> ContactState {
        match piece {
            1 | 6 => ContactState::Stick,
            2 => ContactState::SlipPlus,
            3 => ContactState::SlipMinus,
            _ => ContactState::Open,
        }
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        tests(&self.coefficient, v, [self.bound(v); 2], out);
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        test_rows(&self.coefficient, v, &[self.bound_row(v); 2], rows);
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let tangential = Self::tangential(piece).residual(v, |_| self.bound(v));
        [v.normal(Self::is_closed(piece)).0, tangential, 0.0]
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let tangential = Self::tangential(piece).row(v, |_| self.bound_row(v));
        [
            v.normal(Self::is_closed(piece)).1,
            tangential,
            LocalRow::default(),
        ]
    }

    fn is_affine(&self) -> bool {
        self.coefficient.is_constant()
    }

    fn is_coulomb(&self) -> bool {
        self.coefficient.is_constant()
    }

    fn friction(&self, v: &LocalValues) -> [f64; 2] {
        [self.coefficient.at(v, 0.0)[0]; 2]
    }

    fn check(&self, v: &LocalValues) -> Result<(), ContactError> {
        check_coefficient(&self.coefficient, v, false)
    }
}
