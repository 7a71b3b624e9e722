use super::ContactState;
use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN};
use crate::contact::ContactError;
use crate::input::check_vector;
use crate::piecewise::Facet;

/// Friction with a given bound (Tresca): ‖F⁻¹ λt‖ ≤ g with g ≥ 0 and F = diag(F₁, F₂) given at each node, whatever the pressure.
///
/// Pieces "open, stick", "open, slip", "stick", "slip"; test functions θ¹ and θ² = ‖z‖ − g, z = F⁻¹λt + r F u_t. Frictionless in a
/// direction with F_k = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenBound {
    tangents: usize,
    bounds: Vec<f64>,
    coefficients: Vec<[f64; 2]>,
}

impl GivenBound {
    /// The law with bounds g and coefficients F, one a node; one tangent in the plane (F₂ is not used), two in space.
    ///
    /// # Errors
    /// A number of tangents other than 1 or 2, lists of different lengths, values that are negative or not finite.
    pub fn new(tangents: usize, bounds: Vec<f64>, coefficients: Vec<[f64; 2]>) -> Result<Self, ContactError> {
        if tangents != 1 && tangents != 2 {
            return Err(ContactError::Tangents {
                law: tangents,
                body: 2,
            });
        }
        check_vector("the given bounds", &bounds, coefficients.len())?;
        for (node, (g, f)) in bounds.iter().zip(&coefficients).enumerate() {
            for value in [*g, f[0], f[1]] {
                if !(value >= 0.0 && value.is_finite()) {
                    return Err(ContactError::Invalid {
                        what: format!(
                            "the bound of friction at contact node {node} is made of {value}; it must be finite and not negative"
                        ),
                    });
                }
            }
        }
        Ok(Self {
            tangents,
            bounds,
            coefficients,
        })
    }

    fn data(&self, node: usize) -> (f64, [f64; 2]) {
        let g = self.bounds.get(node).copied().unwrap_or(0.0);
        (g, self.coefficients.get(node).copied().unwrap_or([0.0; 2]))
    }

    /// z and its derivatives, ‖z‖ and the direction of z.
    fn z(&self, v: &LocalValues) -> ([LocalRow; 2], f64, [f64; 2]) {
        let (_, f) = self.data(v.node);
        let (mut z, mut dz) = ([0.0; 2], [LocalRow::default(); 2]);
        for d in (0..self.tangents).filter(|&d| f[d] > 0.0) {
            z[d] = v.traction[d] / f[d] + v.r * f[d] * v.slip[d];
            dz[d].traction[d] = 1.0 / f[d];
            dz[d].slip[d] = v.r * f[d];
        }
        let norm = z[0].hypot(z[1]);
        let direction = if norm > 0.0 { z.map(|c| c / norm) } else { [0.0; 2] };
        (dz, norm, direction)
    }
}

impl NodeLaw for GivenBound {
    fn num_tangents(&self) -> usize {
        self.tangents
    }

    fn num_pieces(&self) -> usize {
        4
    }

    fn num_tests(&self) -> usize {
        2
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        const CELLS: [&[Facet]; 4] = [
            &[OPEN, Facet::negative(1)],
            &[OPEN, Facet::positive(1)],
            &[CLOSED, Facet::negative(1)],
            &[CLOSED, Facet::positive(1)],
        ];
        CELLS[piece.min(3)]
    }

    fn piece_name(&self, piece: usize) -> &'static str {
        ["open, stick", "open, slip", "stick", "slip"][piece.min(3)]
    }

    fn state(&self, piece: usize, v: &LocalValues) -> ContactState {
        match piece {
            2 => ContactState::Stick,
            3 => ContactState::slipping(v.traction[0]),
            _ => ContactState::Open,
        }
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        out[0] = v.theta1();
        out[1] = self.z(v).1 - self.data(v.node).0;
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        let (dz, _, direction) = self.z(v);
        rows[0] = v.theta1_row();
        rows[1] = LocalRow::default();
        for d in 0..2 {
            rows[1].add(direction[d], &dz[d]);
        }
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let (g, f) = self.data(v.node);
        let (_, _, direction) = self.z(v);
        let tangential = |d: usize| {
            if piece.is_multiple_of(2) && f[d] > 0.0 {
                -v.r * f[d] * f[d] * v.slip[d]
            } else {
                v.traction[d] - f[d] * g * direction[d]
            }
        };
        [v.normal(piece >= 2).0, tangential(0), tangential(1)]
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let (g, f) = self.data(v.node);
        let (dz, norm, direction) = self.z(v);
        let mut rows = [
            v.normal(piece >= 2).1,
            LocalRow::of_traction(0),
            LocalRow::of_traction(1),
        ];
        for d in 0..2 {
            let row = &mut rows[1 + d];
            if piece.is_multiple_of(2) && f[d] > 0.0 {
                *row = LocalRow::default();
                row.slip[d] = -v.r * f[d] * f[d];
            } else if norm > 0.0 {
                for e in 0..2 {
                    let identity = if d == e { 1.0 } else { 0.0 };
                    let projection = identity - direction[d] * direction[e];
                    row.add(-f[d] * g / norm * projection, &dz[e]);
                }
            }
        }
        rows
    }

    fn friction(&self, v: &LocalValues) -> [f64; 2] {
        self.data(v.node).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where F_k = 0 there is no traction, whatever the slip; elsewhere a sticking node does not move, and a slipping one bears F g.
    #[test]
    fn directions_without_friction_do_not_stick() {
        let law = GivenBound::new(2, vec![2.0], vec![[0.0, 0.5]]).unwrap();
        let values = |traction: [f64; 2], slip: [f64; 2]| LocalValues {
            node: 0,
            penetration: 0.0,
            slip,
            pressure: 3.0,
            traction,
            parameter: 0.0,
            second: 0.0,
            history: Default::default(),
            r: 7.0,
        };
        let sticks = law.residual(2, &values([0.0, 0.4], [0.3, 0.0]));
        assert_eq!(sticks, [0.0; 3]);
        assert_eq!(law.residual(2, &values([0.1, 0.4], [0.3, 0.0]))[1], 0.1);
        assert!(law.residual(2, &values([0.0, 0.4], [0.0, 0.3]))[2] != 0.0);
        assert_eq!(law.residual(3, &values([0.0, 1.0], [0.3, 0.2])), [0.0; 3]);
        assert_eq!(law.residual(3, &values([0.0, -1.0], [0.3, -0.2])), [0.0; 3]);
    }
}
