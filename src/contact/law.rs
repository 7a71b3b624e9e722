//! The planar Coulomb law at one contact node: test functions, pieces, residuals and their derivatives.

use std::fmt;

use crate::piecewise::Facet;

/// State of a contact node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactState {
    /// λ_ν = λ_t = 0.
    Open,
    /// u_ν = gap, u_t = 0.
    Stick,
    /// u_ν = gap, λ_t = F λ_ν, u_t ≥ 0.
    SlipPlus,
    /// u_ν = gap, λ_t = −F λ_ν, u_t ≤ 0.
    SlipMinus,
}

impl ContactState {
    /// All states, in the order of the pieces.
    pub const ALL: [Self; 4] = [Self::Open, Self::Stick, Self::SlipPlus, Self::SlipMinus];

    /// The state in words: "open", "stick", "slip+", "slip-".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Stick => "stick",
            Self::SlipPlus => "slip+",
            Self::SlipMinus => "slip-",
        }
    }

    /// The state as one letter: O, K, +, −.
    #[must_use]
    pub const fn letter(self) -> char {
        match self {
            Self::Open => 'O',
            Self::Stick => 'K',
            Self::SlipPlus => '+',
            Self::SlipMinus => '-',
        }
    }

    /// Whether the node slips, to whichever side.
    #[must_use]
    pub const fn is_slip(self) -> bool {
        matches!(self, Self::SlipPlus | Self::SlipMinus)
    }

    /// Slip under the force `traction` along t₁: slip− if that is negative, slip+ otherwise.
    #[must_use]
    pub fn slipping(traction: f64) -> Self {
        if traction < 0.0 {
            Self::SlipMinus
        } else {
            Self::SlipPlus
        }
    }

    /// Number of the piece of this state.
    #[must_use]
    pub const fn piece(self) -> usize {
        self as usize
    }
}

impl fmt::Display for ContactState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The bound g of the friction interval [−g, g].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SlipBound {
    /// g = F (θ¹)₊ with θ¹ = λ_ν + r (u_ν − gap): continuous everywhere, with exactly four pieces a node.
    #[default]
    Augmented,
    /// g = F λ_ν, the form of Haslinger, Janovský and Ligurský. The same solutions and determinants; off solutions the open state
    /// splits ("open", "open, stick", …), and where λ_ν < 0 the interval is reversed ("reversed"). Along a branch an open node
    /// whose u_t changes sign passes from one open piece to another: an artefact, no transition of the solution.
    Multiplier,
}

/// What happens at one contact node.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NodeValues {
    /// u_ν − gap, ≤ 0 where admissible.
    pub penetration: f64,
    /// Tangential displacement u_t.
    pub slip: f64,
    /// Pressure λ_ν ≥ 0 (nodal force).
    pub pressure: f64,
    /// Tangential force λ_t.
    pub traction: f64,
    /// Coefficient of friction F.
    pub friction: f64,
}

impl NodeValues {
    /// The printed test functions θ¹ = λ_ν + r (u_ν − gap), θ²,³ = λ_t + r u_t ∓ F (θ¹)₊.
    #[must_use]
    pub fn theta(&self, r: f64) -> [f64; 3] {
        let normal = self.pressure + r * self.penetration;
        let tangential = self.traction + r * self.slip;
        let g = self.friction * normal.max(0.0);
        [normal, tangential - g, tangential + g]
    }
}

/// Number of test functions of a node: θ¹, θ², θ³ and, as a wall of the contact pieces, F.
pub(super) const TESTS: usize = 4;

/// The law with its parameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law {
    pub(super) r: f64,
    pub(super) bound: SlipBound,
    /// F does not depend on α: it can not become negative, and is no wall.
    pub(super) constant_friction: bool,
}

/// Derivatives of a node's row with respect to its own quantities.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Row {
    pub(super) penetration: f64,
    pub(super) slip: f64,
    pub(super) pressure: f64,
    pub(super) traction: f64,
    pub(super) friction: f64,
}

impl Law {
    pub(super) fn num_pieces(&self) -> usize {
        match self.bound {
            SlipBound::Augmented => 4,
            SlipBound::Multiplier => 8,
        }
    }

    pub(super) fn piece_name(&self, piece: usize) -> &'static str {
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

    /// The state a piece stands for.
    pub(super) fn state(&self, piece: usize) -> ContactState {
        match piece {
            1 | 6 => ContactState::Stick,
            2 => ContactState::SlipPlus,
            3 => ContactState::SlipMinus,
            _ => ContactState::Open,
        }
    }

    pub(super) fn cell(&self, piece: usize) -> &'static [Facet] {
        const CLOSED: Facet = Facet::positive(0);
        const OPEN: Facet = Facet::negative(0);
        const RUBBING: Facet = Facet::positive(3).wall();
        const AUGMENTED: [&[Facet]; 4] = [
            &[OPEN],
            &[CLOSED, Facet::negative(1), Facet::positive(2), RUBBING],
            &[CLOSED, Facet::positive(1), RUBBING],
            &[CLOSED, Facet::negative(2), RUBBING],
        ];
        const MULTIPLIER: [&[Facet]; 8] = [
            &[OPEN, Facet::positive(1), Facet::positive(2)],
            &[CLOSED, Facet::negative(1), Facet::positive(2), RUBBING],
            &[CLOSED, Facet::positive(1), Facet::positive(2), RUBBING],
            &[CLOSED, Facet::negative(1), Facet::negative(2), RUBBING],
            &[OPEN, Facet::negative(1), Facet::positive(2)],
            &[OPEN, Facet::negative(1), Facet::negative(2)],
            &[CLOSED, Facet::positive(1), Facet::negative(2), RUBBING],
            &[OPEN, Facet::positive(1), Facet::negative(2)],
        ];
        match self.bound {
            SlipBound::Augmented => AUGMENTED[piece.min(3)],
            SlipBound::Multiplier => MULTIPLIER[piece.min(7)],
        }
    }

    /// Test functions; with (θ¹)₊ replaced by θ¹, which agrees wherever a cell asks, they are smooth.
    pub(super) fn tests(&self, v: &NodeValues) -> [f64; TESTS] {
        let normal = v.pressure + self.r * v.penetration;
        let tangential = v.traction + self.r * v.slip;
        let g = v.friction * self.bounding(v, normal);
        let wall = if self.constant_friction { 1.0 } else { v.friction };
        [normal, tangential - g, tangential + g, wall]
    }

    fn bounding(&self, v: &NodeValues, normal: f64) -> f64 {
        match self.bound {
            SlipBound::Augmented => normal,
            SlipBound::Multiplier => v.pressure,
        }
    }

    /// Derivatives of the test functions.
    pub(super) fn test_rows(&self, v: &NodeValues) -> [Row; TESTS] {
        let normal = Row {
            penetration: self.r,
            pressure: 1.0,
            ..Row::default()
        };
        let g = self.bound_row(v);
        let side = |sign: f64| Row {
            penetration: sign * g.penetration,
            slip: self.r,
            pressure: sign * g.pressure,
            traction: 1.0,
            friction: sign * g.friction,
        };
        let wall = Row {
            friction: if self.constant_friction { 0.0 } else { 1.0 },
            ..Row::default()
        };
        [normal, side(-1.0), side(1.0), wall]
    }

    /// Derivatives of g = F·(θ¹ or λ_ν).
    fn bound_row(&self, v: &NodeValues) -> Row {
        let normal = v.pressure + self.r * v.penetration;
        Row {
            penetration: match self.bound {
                SlipBound::Augmented => v.friction * self.r,
                SlipBound::Multiplier => 0.0,
            },
            pressure: v.friction,
            friction: self.bounding(v, normal),
            ..Row::default()
        }
    }

    /// The rows H_ν, H_t of a piece.
    pub(super) fn residual(&self, piece: usize, v: &NodeValues) -> [f64; 2] {
        let normal = v.pressure + self.r * v.penetration;
        let g = v.friction * self.bounding(v, normal);
        let tangential = v.traction + self.r * v.slip;
        let (closed, form) = self.form(piece);
        let h_normal = if closed {
            -self.r * v.penetration
        } else {
            v.pressure
        };
        let h_tangential = match form {
            Form::Free => v.traction,
            Form::Stick => -self.r * v.slip,
            Form::Slip(sign) => v.traction - sign * g,
            Form::Reversed => v.traction + tangential,
        };
        [h_normal, h_tangential]
    }

    /// Derivatives of the rows H_ν, H_t of a piece.
    pub(super) fn rows(&self, piece: usize, v: &NodeValues) -> [Row; 2] {
        let (closed, form) = self.form(piece);
        let normal = if closed {
            Row {
                penetration: -self.r,
                ..Row::default()
            }
        } else {
            Row {
                pressure: 1.0,
                ..Row::default()
            }
        };
        let tangential = match form {
            Form::Free => Row {
                traction: 1.0,
                ..Row::default()
            },
            Form::Stick => Row {
                slip: -self.r,
                ..Row::default()
            },
            Form::Slip(sign) => {
                let g = self.bound_row(v);
                Row {
                    penetration: -sign * g.penetration,
                    pressure: -sign * g.pressure,
                    friction: -sign * g.friction,
                    traction: 1.0,
                    ..Row::default()
                }
            }
            Form::Reversed => Row {
                slip: self.r,
                traction: 2.0,
                ..Row::default()
            },
        };
        [normal, tangential]
    }

    /// Whether a piece is closed in the normal direction, and its tangential formula. Between −g and g reversed (g < 0) the
    /// projection continues continuously as z ↦ −z.
    fn form(&self, piece: usize) -> (bool, Form) {
        match (self.bound, piece) {
            (SlipBound::Augmented, 0) => (false, Form::Free),
            (_, 1) => (true, Form::Stick),
            (_, 2) => (true, Form::Slip(1.0)),
            (_, 3) => (true, Form::Slip(-1.0)),
            (_, 4) => (false, Form::Stick),
            (_, 5) => (false, Form::Slip(-1.0)),
            (_, 6) => (true, Form::Reversed),
            (_, 7) => (false, Form::Reversed),
            _ => (false, Form::Slip(1.0)),
        }
    }
}

#[derive(Clone, Copy)]
enum Form {
    Free,
    Stick,
    Slip(f64),
    Reversed,
}
