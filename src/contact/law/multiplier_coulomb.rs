use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN, add_row, free, normal, theta1_row};
use crate::contact::{ContactError, ContactState, FrictionCoefficient};
use crate::piecewise::Facet;

/// Planar Coulomb friction with the bound g = F λν, the form of Haslinger, Janovský and Ligurský;
/// [`PlanarCoulomb`](crate::contact::PlanarCoulomb) has g = F (θ¹)₊.
///
/// The same solutions and determinants; off solutions the open state splits ("open", "open, stick", "open, slip-"), and where
/// λν < 0 the interval is reversed ("reversed", "open, reversed"). Along a branch an open node whose u_t changes sign passes from one open piece
/// to another: an artefact, no transition of the solution.
#[derive(Debug, Clone)]
pub struct MultiplierCoulomb {
    coefficient: FrictionCoefficient,
}

/// The tangential formula of a piece. Between −g and g reversed (g < 0) the projection continues continuously as z ↦ −z.
#[derive(Clone, Copy)]
enum Tangential {
    Stick,
    Slip(f64),
    Reversed,
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

    /// g and its derivatives.
    fn bound(&self, v: &LocalValues) -> (f64, LocalRow) {
        let [f, _, rate, second] = self.coefficient.at(v, 0.0);
        let row = LocalRow {
            pressure: f,
            parameter: rate * v.pressure,
            second: second * v.pressure,
            ..LocalRow::default()
        };
        (f * v.pressure, row)
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
        const WALL: Facet = Facet::positive(3).wall();
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
        let (z, g) = (v.traction[0] + v.r * v.slip[0], self.bound(v).0);
        out[0] = v.theta1();
        out[1] = z - g;
        out[2] = z + g;
        out[3] = if self.coefficient.depends_on_parameter() {
            self.coefficient.at(v, 0.0)[0]
        } else {
            1.0
        };
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        rows[0] = theta1_row(v);
        for (row, side) in rows[1..3].iter_mut().zip([1.0, -1.0]) {
            *row = free(0);
            row.slip[0] = v.r;
            add_row(row, -side, &self.bound(v).1);
        }
        rows[3] = LocalRow::default();
        if self.coefficient.depends_on_parameter() {
            let [_, _, rate, second] = self.coefficient.at(v, 0.0);
            rows[3].parameter = rate;
            rows[3].second = second;
        }
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let tangential = match Self::tangential(piece) {
            Tangential::Stick => -v.r * v.slip[0],
            Tangential::Slip(side) => v.traction[0] - side * self.bound(v).0,
            Tangential::Reversed => 2.0 * v.traction[0] + v.r * v.slip[0],
        };
        [normal(Self::is_closed(piece), v).0, tangential, 0.0]
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let mut row = LocalRow::default();
        match Self::tangential(piece) {
            Tangential::Stick => row.slip[0] = -v.r,
            Tangential::Slip(side) => {
                row = free(0);
                add_row(&mut row, -side, &self.bound(v).1);
            }
            Tangential::Reversed => {
                row.slip[0] = v.r;
                row.traction[0] = 2.0;
            }
        }
        [normal(Self::is_closed(piece), v).1, row, LocalRow::default()]
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
        super::coulomb_laws::check_coefficient(&self.coefficient, v, false)
    }
}
