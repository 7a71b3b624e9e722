//! Planar Coulomb friction with the bound F θ¹, and functions shared by laws with one tangent.

use super::FrictionCoefficient;
use super::coefficient::check_coefficient;
use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN};
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Where F depends on α it may become negative: pieces in contact end there.
pub(super) const WALL: Facet = Facet::positive(3).wall();

/// The tangential formula of a piece.
#[derive(Clone, Copy)]
pub(super) enum Tangential {
    /// λt = 0.
    Free,
    /// u_t = 0.
    Stick,
    /// λt = ±g.
    Slip(f64),
    /// Between −g and g where g < 0: the projection continues continuously as z ↦ −z.
    Reversed,
}

impl Tangential {
    /// H_t, with g for either side.
    pub(super) fn residual(self, v: &LocalValues, bound: impl Fn(f64) -> f64) -> f64 {
        match self {
            Self::Free => v.traction[0],
            Self::Stick => -v.r * v.slip[0],
            Self::Slip(side) => v.traction[0] - side * bound(side),
            Self::Reversed => 2.0 * v.traction[0] + v.r * v.slip[0],
        }
    }

    /// The derivatives of H_t from those of g.
    pub(super) fn row(self, v: &LocalValues, bound: impl Fn(f64) -> LocalRow) -> LocalRow {
        let mut row = LocalRow::of_traction(0);
        match self {
            Self::Free => {}
            Self::Stick => (row.traction[0], row.slip[0]) = (0.0, -v.r),
            Self::Slip(side) => row.add(-side, &bound(side)),
            Self::Reversed => (row.traction[0], row.slip[0]) = (2.0, v.r),
        }
        row
    }
}

/// θ¹, θ² = λt + r u_t − g, θ³ = λt + r u_t + g and, where F depends on α, F; `bounds` are g at u_t and at −u_t.
pub(super) fn tests(coefficient: &FrictionCoefficient, v: &LocalValues, bounds: [f64; 2], out: &mut [f64]) {
    let (z, _) = v.trial_traction(0);
    out[0] = v.theta1();
    out[1] = z - bounds[0];
    out[2] = z + bounds[1];
    out[3] = if coefficient.depends_on_parameter() {
        coefficient.at(v, v.slip[0].abs())[0]
    } else {
        1.0
    };
}

/// The derivatives of [`tests`] from those of g at u_t and at −u_t.
pub(super) fn test_rows(
    coefficient: &FrictionCoefficient,
    v: &LocalValues,
    bounds: &[LocalRow; 2],
    rows: &mut [LocalRow],
) {
    rows[0] = v.theta1_row();
    for ((row, bound), side) in rows[1..3].iter_mut().zip(bounds).zip([1.0, -1.0]) {
        *row = v.trial_traction(0).1;
        row.add(-side, bound);
    }
    rows[3] = LocalRow::default();
    if coefficient.depends_on_parameter() {
        let [_, slope, rate, second] = coefficient.at(v, v.slip[0].abs());
        rows[3].slip[0] = slope * v.slip[0].signum();
        rows[3].parameter = rate;
        rows[3].second = second;
    }
}

/// Planar Coulomb friction |λt| ≤ F λν with F = F(x, |u_t|, α). Pieces "open", "stick", "slip+", "slip-"; test functions θ¹, θ², θ³
/// (F at u_t in θ², at −u_t in θ³, so that both are smooth) and, where F depends on α, F as a wall.
#[derive(Debug, Clone)]
pub struct PlanarCoulomb {
    coefficient: FrictionCoefficient,
}

impl PlanarCoulomb {
    /// The law with the given coefficient.
    #[must_use]
    pub fn new(coefficient: FrictionCoefficient) -> Self {
        Self { coefficient }
    }

    /// g = F(σ u_t) θ¹ on the side σ.
    fn bound(&self, side: f64, v: &LocalValues) -> f64 {
        self.coefficient.at(v, side * v.slip[0])[0] * v.theta1()
    }

    /// The derivatives of g.
    fn bound_row(&self, side: f64, v: &LocalValues) -> LocalRow {
        let [f, slope, rate, second] = self.coefficient.at(v, side * v.slip[0]);
        let pressure = v.theta1();
        let mut row = LocalRow {
            parameter: rate * pressure,
            second: second * pressure,
            ..LocalRow::default()
        };
        row.slip[0] = side * slope * pressure;
        row.add(f, &v.theta1_row());
        row
    }

    /// A function of the side σ = ±1 at both sides, evaluated once where F does not depend on the slip.
    fn sides<T: Copy>(&self, of: impl Fn(f64) -> T) -> [T; 2] {
        let first = of(1.0);
        let depends = self.coefficient.depends_on_slip();
        [first, if depends { of(-1.0) } else { first }]
    }

    fn tangential(piece: usize) -> Tangential {
        match piece {
            0 => Tangential::Free,
            1 => Tangential::Stick,
            2 => Tangential::Slip(1.0),
            _ => Tangential::Slip(-1.0),
        }
    }
}

impl NodeLaw for PlanarCoulomb {
    fn num_tangents(&self) -> usize {
        1
    }

    fn num_nodes(&self) -> Option<usize> {
        self.coefficient.num_nodes()
    }

    fn num_tests(&self) -> usize {
        4
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        const CELLS: [&[Facet]; 4] = [
            &[OPEN],
            &[CLOSED, Facet::negative(1), Facet::positive(2), WALL],
            &[CLOSED, Facet::positive(1), WALL],
            &[CLOSED, Facet::negative(2), WALL],
        ];
        CELLS[piece.min(3)]
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        let bounds = self.sides(|side| self.bound(side, v));
        tests(&self.coefficient, v, bounds, out);
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        let bounds = self.sides(|side| self.bound_row(side, v));
        test_rows(&self.coefficient, v, &bounds, rows);
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let tangential = Self::tangential(piece).residual(v, |side| self.bound(side, v));
        [v.normal(piece != 0).0, tangential, 0.0]
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let tangential = Self::tangential(piece).row(v, |side| self.bound_row(side, v));
        [v.normal(piece != 0).1, tangential, LocalRow::default()]
    }

    fn is_affine(&self) -> bool {
        self.coefficient.is_constant()
    }

    fn num_history(&self) -> usize {
        usize::from(self.coefficient.depends_on_slip())
    }

    fn update(&self, v: &LocalValues, history: &mut [f64]) {
        history.iter_mut().for_each(|h| *h += v.slip_norm());
    }

    fn is_coulomb(&self) -> bool {
        self.coefficient.is_constant()
    }

    fn affine_friction(&self, node: usize, _history: &[f64]) -> Option<[f64; 2]> {
        self.coefficient.affine_at(node)
    }

    fn friction(&self, v: &LocalValues) -> [f64; 2] {
        [self.coefficient.at(v, v.slip_norm())[0]; 2]
    }

    fn check(&self, v: &LocalValues) -> Result<(), ContactError> {
        check_coefficient(&self.coefficient, v, false)
    }
}
