use super::FrictionCoefficient;
use super::coefficient::check_coefficient;
use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN};
use crate::contact::{ContactError, ContactState};
use crate::piecewise::Facet;
use crate::tolerances::HALF_DIGITS;

/// Coulomb friction in space with principal coefficients F = diag(F₁, F₂) along t₁, t₂, each of them F_k(x, ‖u_t‖, α) > 0, or both 0 at
/// a node that has no friction at all:
///
/// ```text
/// λt ∈ F² u_t λν / ‖F u_t‖ where u_t ≠ 0,   ‖F⁻¹ λt‖ ≤ λν.
/// ```
///
/// With s = F⁻¹λt and w = F u_t the law is isotropic with coefficient 1: H_t = λt − F P(z), z = F⁻¹ λt + r F u_t, P the projection
/// onto the disc of radius R = θ¹. Slip is parallel to F⁻² λt, not to λt, unless F₁ = F₂. Pieces "open", "stick", "slip"; test functions
/// θ¹, θ² = ‖z‖ − R and, where F depends on α, F₁ and F₂ as walls. Only semismooth at the apex z = 0, R = 0.
///
/// Where F depends on the slip it is evaluated not at ‖u_t‖, which has a kink at u_t = 0, but at a function of u_t and λt that equals ‖u_t‖
/// at solutions and is smooth there.
#[derive(Debug, Clone)]
pub struct OrthotropicCoulomb {
    coefficients: [FrictionCoefficient; 2],
}

/// b²/a² from which φ is linear in a. A spurious solution, at which φ ≠ ‖u_t‖, would need b²/a² at least this large.
const OBLIQUE: f64 = 400.0;

/// Intermediate quantities of the orthotropic law.
struct ScaledTraction {
    f: [f64; 2],
    /// Derivatives of F₁, F₂.
    df: [LocalRow; 2],
    dz: [LocalRow; 2],
    norm: f64,
    /// z/‖z‖, 0 at 0.
    direction: [f64; 2],
}

impl OrthotropicCoulomb {
    /// The law with coefficients F₁ along t₁ and F₂ along t₂.
    #[must_use]
    pub fn new(first: FrictionCoefficient, second: FrictionCoefficient) -> Self {
        Self {
            coefficients: [first, second],
        }
    }

    /// The isotropic law.
    #[must_use]
    pub fn isotropic(coefficient: FrictionCoefficient) -> Self {
        Self::new(coefficient.clone(), coefficient)
    }

    /// Whether the node of the point is without friction, whatever its slip and the parameters are.
    fn is_smooth(&self, v: &LocalValues) -> bool {
        let is_zero = |c: &FrictionCoefficient| !c.depends_on_slip() && c.at(v, 0.0) == [0.0; 4];
        self.coefficients.iter().all(is_zero)
    }

    /// F_k, ∂F_k/∂φ, ∂F_k/∂α and ∂F_k/∂β at the slip φ.
    fn coefficients_at(&self, v: &LocalValues, phi: f64) -> [[f64; 4]; 2] {
        [0, 1].map(|d| self.coefficients[d].at(v, phi))
    }

    /// The slip φ at which the coefficients are taken, and its derivatives.
    ///
    /// ‖u_t‖ has a kink at u_t = 0, where nodes pass from slip to stick. At solutions slip has the direction of d = F⁻² λt + r u_t with F
    /// at ‖u_t‖. With a the component of u_t along d, b the other one and a short length ε, φ = a (1 + b²/(a² + ε²))^½ is smooth at
    /// u_t = 0, negative beyond, and ‖u_t‖ at solutions; for slips much larger than ε it is ±‖u_t‖, except where |b| is much larger than
    /// |a|: there it is linear in a.
    fn signed_slip(&self, v: &LocalValues) -> (f64, LocalRow) {
        let u = v.slip;
        let norm = v.slip_norm();
        let f = self.coefficients_at(v, norm);
        let d = [0, 1].map(|k| v.traction[k] / (f[k][0] * f[k][0]) + v.r * u[k]);
        let length = d[0].hypot(d[1]);
        let size = length.max(v.r * norm);
        if size == 0.0 {
            return (0.0, LocalRow::default());
        }
        let e = if norm > 0.0 { u.map(|u| u / norm) } else { [0.0; 2] };
        let a = (u[0] * d[0] + u[1] * d[1]) / size;
        let b2 = if size > length {
            (norm - a) * (norm + a)
        } else {
            ((u[0] * d[1] - u[1] * d[0]) / size).powi(2)
        };
        // In units of slip above rounding, and below all relevant slips.
        let epsilon2 = (HALF_DIGITS * length / v.r).powi(2);
        let width = a * a + epsilon2;
        let (ratio, limited) = if b2 < OBLIQUE * width {
            (b2 / width, false)
        } else {
            (OBLIQUE, true)
        };
        let root = (1.0 + ratio).sqrt();
        // Derivatives with respect to u_t, λt, α, β, one at a time.
        let derivative = |du: [f64; 2], dt: [f64; 2], rates: [f64; 2]| {
            let along = e[0] * du[0] + e[1] * du[1];
            let dd = [0, 1].map(|k| {
                let df = f[k][1] * along + f[k][2] * rates[0] + f[k][3] * rates[1];
                (dt[k] - 2.0 * v.traction[k] / f[k][0] * df) / (f[k][0] * f[k][0]) + v.r * du[k]
            });
            let lengthened = d[0] * dd[0] + d[1] * dd[1];
            let grown = if size > length {
                v.r * along
            } else {
                lengthened / size
            };
            let da = (du[0] * d[0] + du[1] * d[1] + u[0] * dd[0] + u[1] * dd[1] - a * grown) / size;
            if limited {
                return root * da;
            }
            let db2 = 2.0 * (u[0] * du[0] + u[1] * du[1] - a * da);
            let dwidth = 2.0 * (a * da + (HALF_DIGITS / v.r).powi(2) * lengthened);
            root * da + 0.5 * a / root * (db2 - ratio * dwidth) / width
        };
        let mut row = LocalRow::default();
        for k in 0..2 {
            let unit = [0, 1].map(|j| if j == k { 1.0 } else { 0.0 });
            row.slip[k] = derivative(unit, [0.0; 2], [0.0; 2]);
            row.traction[k] = derivative([0.0; 2], unit, [0.0; 2]);
        }
        row.parameter = derivative([0.0; 2], [0.0; 2], [1.0, 0.0]);
        row.second = derivative([0.0; 2], [0.0; 2], [0.0, 1.0]);
        (a * root, row)
    }

    fn scaled(&self, v: &LocalValues) -> ScaledTraction {
        let (phi, dphi) = if self.is_coulomb() {
            (v.slip_norm(), LocalRow::default())
        } else {
            self.signed_slip(v)
        };
        let coefficients = self.coefficients_at(v, phi);
        let (mut f, mut df) = ([0.0; 2], [LocalRow::default(); 2]);
        let (mut z, mut dz) = ([0.0; 2], [LocalRow::default(); 2]);
        for d in 0..2 {
            let [value, slope, rate, second] = coefficients[d];
            f[d] = value;
            df[d].parameter = rate;
            df[d].second = second;
            df[d].add(slope, &dphi);
            z[d] = v.traction[d] / value + v.r * value * v.slip[d];
            dz[d].traction[d] = 1.0 / value;
            dz[d].slip[d] = v.r * value;
            dz[d].add(v.r * v.slip[d] - v.traction[d] / (value * value), &df[d]);
        }
        let norm = z[0].hypot(z[1]);
        let direction = if norm > 0.0 { z.map(|c| c / norm) } else { [0.0; 2] };
        ScaledTraction {
            f,
            df,
            dz,
            norm,
            direction,
        }
    }
}

impl NodeLaw for OrthotropicCoulomb {
    fn num_tangents(&self) -> usize {
        2
    }

    fn num_nodes(&self) -> Option<usize> {
        self.coefficients[0]
            .num_nodes()
            .or(self.coefficients[1].num_nodes())
    }

    fn state(&self, piece: usize, v: &LocalValues) -> ContactState {
        match piece {
            2 if self.is_smooth(v) => ContactState::slipping(v.slip[0]),
            2 => ContactState::slipping(v.traction[0]),
            _ => ContactState::ALL[piece],
        }
    }

    fn num_tests(&self) -> usize {
        4
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        const WALLS: [Facet; 2] = [Facet::positive(2).wall(), Facet::positive(3).wall()];
        const CELLS: [&[Facet]; 3] = [
            &[OPEN],
            &[CLOSED, Facet::negative(1), WALLS[0], WALLS[1]],
            &[CLOSED, Facet::positive(1), WALLS[0], WALLS[1]],
        ];
        CELLS[piece.min(2)]
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        out[0] = v.theta1();
        if self.is_smooth(v) {
            // In contact such a node slips.
            out[1..4].fill(1.0);
            return;
        }
        let s = self.scaled(v);
        out[1] = s.norm - v.theta1();
        for d in 0..2 {
            out[2 + d] = if self.coefficients[d].depends_on_parameter() {
                s.f[d]
            } else {
                1.0
            };
        }
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        rows[0] = v.theta1_row();
        rows[1..4].fill(LocalRow::default());
        if self.is_smooth(v) {
            return;
        }
        let s = self.scaled(v);
        rows[1].add(-1.0, &v.theta1_row());
        for d in 0..2 {
            rows[1].add(s.direction[d], &s.dz[d]);
            if self.coefficients[d].depends_on_parameter() {
                rows[2 + d] = s.df[d];
            }
        }
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let h = v.normal(piece != 0).0;
        if piece == 0 || self.is_smooth(v) {
            return [h, v.traction[0], v.traction[1]];
        }
        let s = self.scaled(v);
        // On the piece "stick" λt − F z = −r F² u_t, written without the traction that cancels.
        let tangential = |d: usize| match piece {
            1 => -v.r * s.f[d] * s.f[d] * v.slip[d],
            _ => v.traction[d] - s.f[d] * s.direction[d] * v.theta1(),
        };
        [h, tangential(0), tangential(1)]
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let h = v.normal(piece != 0).1;
        if piece == 0 || self.is_smooth(v) {
            return [h, LocalRow::of_traction(0), LocalRow::of_traction(1)];
        }
        let s = self.scaled(v);
        let radius = v.theta1();
        let mut rows = [h, LocalRow::of_traction(0), LocalRow::of_traction(1)];
        for d in 0..2 {
            let row = &mut rows[1 + d];
            if piece == 1 {
                *row = LocalRow::default();
                row.slip[d] = -v.r * s.f[d] * s.f[d];
                row.add(-2.0 * v.r * s.f[d] * v.slip[d], &s.df[d]);
                continue;
            }
            row.add(-s.direction[d] * radius, &s.df[d]);
            row.add(-s.f[d] * s.direction[d], &v.theta1_row());
            if s.norm > 0.0 {
                for e in 0..2 {
                    let identity = if d == e { 1.0 } else { 0.0 };
                    let projection = identity - s.direction[d] * s.direction[e];
                    row.add(-s.f[d] * radius / s.norm * projection, &s.dz[e]);
                }
            }
        }
        rows
    }

    fn num_history(&self) -> usize {
        let depends = self.coefficients.iter().any(FrictionCoefficient::depends_on_slip);
        usize::from(depends)
    }

    fn update(&self, v: &LocalValues, history: &mut [f64]) {
        history.iter_mut().for_each(|h| *h += v.slip_norm());
    }

    fn is_coulomb(&self) -> bool {
        self.coefficients.iter().all(FrictionCoefficient::is_constant)
    }

    fn friction(&self, v: &LocalValues) -> [f64; 2] {
        [0, 1].map(|d| self.coefficients[d].at(v, v.slip_norm())[0])
    }

    fn check(&self, v: &LocalValues) -> Result<(), ContactError> {
        let positive = !self.is_smooth(v);
        self.coefficients
            .iter()
            .try_for_each(|c| check_coefficient(c, v, positive))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::FrictionCurve;

    /// The slip φ is smooth at u_t = 0: its derivatives agree with differences there too.
    #[test]
    fn derivatives_of_the_slip_are_differences_next_to_rest() {
        let curve = |rest: f64| FrictionCurve::exponential(rest, 0.1, 2.0).unwrap();
        let [first, second] = [0.6, 0.4].map(|f| FrictionCoefficient::uniform(curve(f)));
        let law = OrthotropicCoulomb::new(first, second);
        for slip in [[0.8, 1.5], [-0.3, 0.7], [2.0, -2.5]] {
            let at = LocalValues {
                slip: slip.map(|u| u * HALF_DIGITS),
                traction: [0.3, -0.2],
                r: 1.3,
                ..LocalValues::default()
            };
            let (value, row) = law.signed_slip(&at);
            for k in 0..2 {
                let difference = |step: f64, of: fn(&mut LocalValues) -> &mut [f64; 2]| {
                    let moved = [step, -step].map(|h| {
                        let mut v = at;
                        of(&mut v)[k] += h;
                        law.signed_slip(&v).0
                    });
                    (moved[0] - moved[1]) / (2.0 * step)
                };
                let by_traction = difference(1e-5, |v| &mut v.traction);
                assert!(
                    (row.traction[k] - by_traction).abs() < 1e-6 * value.abs(),
                    "{slip:?} {k}"
                );
                let by_slip = difference(1e-4 * HALF_DIGITS, |v| &mut v.slip);
                assert!((row.slip[k] - by_slip).abs() < 1e-6, "{slip:?} {k}");
            }
        }
    }
}
