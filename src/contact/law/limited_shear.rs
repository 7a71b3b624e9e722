use super::ContactState;
use super::node_law::{CLOSED, LocalRow, LocalValues, NodeLaw, OPEN};
use crate::contact::ContactError;
use crate::input::check_vector;
use crate::piecewise::Facet;

/// Coulomb friction up to a limit of the shear force: ‖λt‖ ≤ min(F λν, T), isotropic, with F and T given at each node.
///
/// With z = λt + r u_t, in the plane: pieces "open", "stick", "slip+", "slip-", "limit+", "limit-"; test functions θ¹, T − F θ¹, z ∓ F θ¹,
/// z ∓ T; affine. In space: "open", "stick", "slip", "limit"; θ¹, T − F θ¹, ‖z‖ − F θ¹, ‖z‖ − T.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitedShear {
    tangents: usize,
    friction: Vec<f64>,
    limits: Vec<f64>,
}

impl LimitedShear {
    /// The law with coefficients F ≥ 0 and limits T ≥ 0, nodal forces (τ_max times the area), one a node; one tangent in the plane, two in
    /// space.
    ///
    /// # Errors
    /// A number of tangents other than 1 or 2, lists of different lengths, values that are negative or not finite.
    pub fn new(tangents: usize, friction: Vec<f64>, limits: Vec<f64>) -> Result<Self, ContactError> {
        if tangents != 1 && tangents != 2 {
            return Err(ContactError::Tangents {
                law: tangents,
                body: 2,
            });
        }
        check_vector("the limits of shear", &limits, friction.len())?;
        super::check_bounds("the coefficient of friction", &friction)?;
        super::check_bounds("the limit of shear", &limits)?;
        Ok(Self {
            tangents,
            friction,
            limits,
        })
    }

    fn data(&self, node: usize) -> [f64; 2] {
        [&self.friction, &self.limits].map(|list| list.get(node).copied().unwrap_or(0.0))
    }

    /// z, its length, and the direction of slip: ± in the plane, as the piece says.
    fn trial(&self, piece: usize, v: &LocalValues) -> (f64, [f64; 2]) {
        let z = [0, 1].map(|d| v.trial_traction(d).0);
        let norm = z[0].hypot(z[1]);
        match (self.tangents, piece.is_multiple_of(2)) {
            (1, plus) => (norm, [if plus { 1.0 } else { -1.0 }, 0.0]),
            _ if norm > 0.0 => (norm, z.map(|c| c / norm)),
            _ => (norm, [0.0; 2]),
        }
    }

    /// The bound of a piece of slip and its derivatives.
    fn bound(&self, piece: usize, v: &LocalValues) -> (f64, LocalRow) {
        let [f, limit] = self.data(v.node);
        let mut row = LocalRow::default();
        // Slip has two pieces in the plane and one in space.
        if piece > 4 - self.tangents {
            return (limit, row);
        }
        row.add(f, &v.theta1_row());
        (f * v.theta1(), row)
    }
}

impl NodeLaw for LimitedShear {
    fn num_tangents(&self) -> usize {
        self.tangents
    }

    fn num_nodes(&self) -> Option<usize> {
        Some(self.limits.len())
    }

    fn num_pieces(&self) -> usize {
        if self.tangents == 1 { 6 } else { 4 }
    }

    fn num_tests(&self) -> usize {
        if self.tangents == 1 { 6 } else { 4 }
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        const BELOW: Facet = Facet::positive(1);
        const BEYOND: Facet = Facet::negative(1);
        const PLANE: [&[Facet]; 6] = [
            &[OPEN],
            &[
                CLOSED,
                Facet::negative(2),
                Facet::positive(3),
                Facet::negative(4),
                Facet::positive(5),
            ],
            &[CLOSED, BELOW, Facet::positive(2)],
            &[CLOSED, BELOW, Facet::negative(3)],
            &[CLOSED, BEYOND, Facet::positive(4)],
            &[CLOSED, BEYOND, Facet::negative(5)],
        ];
        const SPACE: [&[Facet]; 4] = [
            &[OPEN],
            &[CLOSED, Facet::negative(2), Facet::negative(3)],
            &[CLOSED, BELOW, Facet::positive(2)],
            &[CLOSED, BEYOND, Facet::positive(3)],
        ];
        match self.tangents {
            1 => PLANE[piece.min(5)],
            _ => SPACE[piece.min(3)],
        }
    }

    fn piece_name(&self, piece: usize) -> &'static str {
        match self.tangents {
            1 => ["open", "stick", "slip+", "slip-", "limit+", "limit-"][piece.min(5)],
            _ => ["open", "stick", "slip", "limit"][piece.min(3)],
        }
    }

    fn state(&self, piece: usize, v: &LocalValues) -> ContactState {
        match piece {
            0 => ContactState::Open,
            1 => ContactState::Stick,
            _ => ContactState::slipping(v.traction[0]),
        }
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        let ([f, limit], theta) = (self.data(v.node), v.theta1());
        let bound = f * theta;
        out[..2].copy_from_slice(&[theta, limit - bound]);
        if self.tangents == 1 {
            let z = v.trial_traction(0).0;
            out[2..6].copy_from_slice(&[z - bound, z + bound, z - limit, z + limit]);
        } else {
            let (norm, _) = self.trial(2, v);
            out[2..4].copy_from_slice(&[norm - bound, norm - limit]);
        }
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        let [f, _] = self.data(v.node);
        rows[..self.num_tests()].fill(LocalRow::default());
        rows[0] = v.theta1_row();
        rows[1].add(-f, &v.theta1_row());
        let (_, direction) = self.trial(2, v);
        for row in &mut rows[2..self.num_tests()] {
            (0..2).for_each(|d| row.add(direction[d], &v.trial_traction(d).1));
        }
        rows[2].add(-f, &v.theta1_row());
        if self.tangents == 1 {
            rows[3].add(f, &v.theta1_row());
        }
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let normal = v.normal(piece != 0).0;
        let ([t1, t2], (_, e), (bound, _)) = (v.traction, self.trial(piece, v), self.bound(piece, v));
        match piece {
            0 => [normal, t1, t2],
            1 => [normal, -v.r * v.slip[0], -v.r * v.slip[1]],
            _ => [normal, t1 - bound * e[0], t2 - bound * e[1]],
        }
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let mut rows = [
            v.normal(piece != 0).1,
            LocalRow::of_traction(0),
            LocalRow::of_traction(1),
        ];
        let ((norm, e), (bound, slope)) = (self.trial(piece, v), self.bound(piece, v));
        for (d, row) in rows[1..].iter_mut().enumerate().filter(|_| piece > 0) {
            if piece == 1 {
                *row = LocalRow::default();
                row.add(-v.r, &LocalRow::of_slip(d));
                continue;
            }
            row.add(-e[d], &slope);
            // The direction turns with z in space.
            for k in (0..2).filter(|_| self.tangents == 2 && norm > 0.0) {
                let identity = f64::from(u8::from(d == k));
                row.add(-bound / norm * (identity - e[d] * e[k]), &v.trial_traction(k).1);
            }
        }
        rows
    }

    fn is_affine(&self) -> bool {
        self.tangents == 1
    }

    fn friction(&self, v: &LocalValues) -> [f64; 2] {
        let [f, limit] = self.data(v.node);
        [if f * v.pressure > limit {
            limit / v.pressure
        } else {
            f
        }; 2]
    }
}
