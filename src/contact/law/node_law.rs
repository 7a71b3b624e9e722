//! Laws of contact at one node, in the plane and in space.

use super::ContactState;
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Quantities at one contact node, and the augmentation parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LocalValues {
    /// The contact node, from 0.
    pub node: usize,
    /// u_ν − gap, ≤ 0 where admissible.
    pub penetration: f64,
    /// u_t; the second component is 0 in the plane.
    pub slip: [f64; 2],
    /// λν ≥ 0.
    pub pressure: f64,
    /// λt; the second component is 0 in the plane.
    pub traction: [f64; 2],
    /// α.
    pub parameter: f64,
    /// β, the second parameter of a family; 0 where there is none.
    pub second: f64,
    /// History variables; those that the law does not have are 0.
    pub history: [f64; MAX_HISTORY],
    /// r > 0.
    pub r: f64,
}

impl LocalValues {
    /// θ¹ = λν + r (u_ν − gap).
    #[must_use]
    pub fn theta1(&self) -> f64 {
        self.pressure + self.r * self.penetration
    }

    /// ‖u_t‖.
    #[must_use]
    pub fn slip_norm(&self) -> f64 {
        self.slip[0].hypot(self.slip[1])
    }
}

/// Derivatives of a function of [`LocalValues`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct LocalRow {
    /// With respect to the penetration.
    pub penetration: f64,
    /// With respect to u_t.
    pub slip: [f64; 2],
    /// With respect to λν.
    pub pressure: f64,
    /// With respect to λt.
    pub traction: [f64; 2],
    /// With respect to α.
    pub parameter: f64,
    /// With respect to β.
    pub second: f64,
}

impl LocalRow {
    fn theta1(r: f64) -> Self {
        Self {
            penetration: r,
            pressure: 1.0,
            ..Self::default()
        }
    }

    /// The derivative in a direction of the values.
    pub(in crate::contact) fn along(&self, d: &Self) -> f64 {
        self.penetration * d.penetration
            + self.pressure * d.pressure
            + self.slip[0] * d.slip[0]
            + self.traction[0] * d.traction[0]
            + self.slip[1] * d.slip[1]
            + self.traction[1] * d.traction[1]
            + self.parameter * d.parameter
            + self.second * d.second
    }

    fn add(&mut self, scale: f64, other: &Self) {
        self.penetration += scale * other.penetration;
        self.pressure += scale * other.pressure;
        self.parameter += scale * other.parameter;
        self.second += scale * other.second;
        for d in 0..2 {
            self.slip[d] += scale * other.slip[d];
            self.traction[d] += scale * other.traction[d];
        }
    }
}

/// Most test functions a law may have.
pub const MAX_TESTS: usize = 4;

/// Most history variables a law may have at a node.
pub const MAX_HISTORY: usize = 4;

/// A law of contact at one node: a finite list of smooth pieces, each with its cell.
///
/// Residuals have one normal component (order: normal, t₁, t₂; in the plane the last is not used). Pieces and test functions obey the
/// contract of [`PiecewiseSmooth`](crate::piecewise::PiecewiseSmooth); all functions are pure.
pub trait NodeLaw {
    /// 1 in the plane, 2 in space.
    fn num_tangents(&self) -> usize;

    /// How many contact nodes the law is for; `None`: any.
    fn num_nodes(&self) -> Option<usize> {
        None
    }

    /// Number of pieces; piece 0 is the open node.
    fn num_pieces(&self) -> usize;

    /// Number of test functions, at most [`MAX_TESTS`].
    fn num_tests(&self) -> usize;

    /// The cell of a piece.
    fn cell(&self, piece: usize) -> &'static [Facet];

    /// Name of a piece.
    fn piece_name(&self, piece: usize) -> &'static str;

    /// The state of a node in a piece. Where slip of either direction is one piece,
    /// [`ContactState::slipping`] tells the side.
    fn state(&self, piece: usize, v: &LocalValues) -> ContactState;

    /// Test functions.
    fn tests(&self, v: &LocalValues, out: &mut [f64]);

    /// Derivatives of the test functions.
    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]);

    /// Residuals H_ν, H_t of a piece.
    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3];

    /// Derivatives of the residuals.
    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3];

    /// Whether all pieces and test functions are affine in the local values and α.
    fn is_affine(&self) -> bool {
        false
    }

    /// The coefficients of friction F₁, F₂ at a point (equal where the law is isotropic); 0 without friction.
    fn friction(&self, _v: &LocalValues) -> [f64; 2] {
        [0.0; 2]
    }

    /// Number of history variables at each node, at most [`MAX_HISTORY`]; all begin with 0.
    fn num_history(&self) -> usize {
        0
    }

    /// Updates the history variables of a node at the end of a load level, from the values there: slips are those of the level. The law
    /// must be independent of rates: levels are no times.
    fn update(&self, _v: &LocalValues, _history: &mut [f64]) {}

    /// Whether the coefficients of friction depend on the slip u_t of a level alone, and not on a history. A history of loading measures slips level by level
    /// ([`evolve`](crate::contact::evolve)).
    fn depends_on_slip(&self) -> bool {
        false
    }

    /// Whether the law is Coulomb's with coefficients of friction that do not depend on the slip: only such a law has a Delassus form.
    fn is_coulomb(&self) -> bool {
        false
    }

    /// [c, s] of the coefficient of friction F = c + α s of a node, where the law is planar Coulomb friction with the pieces open, stick,
    /// slip+ and slip− and F depends on nothing else: contact is then
    /// [stated exactly](crate::piecewise::PiecewiseSmooth::exact).
    fn affine_friction(&self, _node: usize) -> Option<[f64; 2]> {
        None
    }

    /// Checks coefficients at a point.
    ///
    /// # Errors
    /// Coefficients of friction that are negative (or zero, where the law divides by them) or not finite.
    fn check(&self, _v: &LocalValues) -> Result<(), ContactError> {
        Ok(())
    }
}

macro_rules! borrowed {
    ($(fn $name:ident(&self $(, $arg:ident: $ty:ty)*) $(-> $out:ty)?;)*) => {
        /// A law behind a reference.
        impl<L: NodeLaw + ?Sized> NodeLaw for &L {
            $(fn $name(&self $(, $arg: $ty)*) $(-> $out)? { (**self).$name($($arg),*) })*
        }
    };
}

borrowed! {
    fn num_tangents(&self) -> usize;
    fn num_nodes(&self) -> Option<usize>;
    fn num_pieces(&self) -> usize;
    fn num_tests(&self) -> usize;
    fn cell(&self, piece: usize) -> &'static [Facet];
    fn piece_name(&self, piece: usize) -> &'static str;
    fn tests(&self, v: &LocalValues, out: &mut [f64]);
    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]);
    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3];
    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3];
    fn is_affine(&self) -> bool;
    fn friction(&self, v: &LocalValues) -> [f64; 2];
    fn num_history(&self) -> usize;
    fn update(&self, v: &LocalValues, history: &mut [f64]);
    fn depends_on_slip(&self) -> bool;
    fn is_coulomb(&self) -> bool;
    fn affine_friction(&self, node: usize) -> Option<[f64; 2]>;
    fn check(&self, v: &LocalValues) -> Result<(), ContactError>;
    fn state(&self, piece: usize, v: &LocalValues) -> ContactState;
}

pub(super) const CLOSED: Facet = Facet::positive(0);
pub(super) const OPEN: Facet = Facet::negative(0);

/// H_ν of a piece and its derivatives.
pub(super) fn normal(closed: bool, v: &LocalValues) -> (f64, LocalRow) {
    let mut row = LocalRow::default();
    if closed {
        row.penetration = -v.r;
        (-v.r * v.penetration, row)
    } else {
        row.pressure = 1.0;
        (v.pressure, row)
    }
}

/// λt of an open node.
pub(super) fn free(d: usize) -> LocalRow {
    let mut row = LocalRow::default();
    row.traction[d] = 1.0;
    row
}

pub(super) fn theta1_row(v: &LocalValues) -> LocalRow {
    LocalRow::theta1(v.r)
}

pub(super) fn add_row(target: &mut LocalRow, scale: f64, other: &LocalRow) {
    target.add(scale, other);
}
