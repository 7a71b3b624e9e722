//! Planar Coulomb friction with exact coefficients, without the augmentation parameter, on which solutions do not depend.

use super::per_node::PerNode;
use super::{ContactBody, NodeLaw};
use crate::exact::Exact;
use crate::piecewise::{ExactConditions, ExactForm, ExactPiece, ExactPieces, ExactSite, PiecewiseSmooth};

impl<L: NodeLaw> PerNode<L> {
    /// Whether law and body are planar, with coefficients of friction affine in α.
    pub(super) fn states_coefficients(&self) -> bool {
        self.parameters == 1 && self.body.num_tangents() == 1 && self.exact_friction(0.0).is_some()
    }

    fn exact_friction(&self, alpha: f64) -> Option<Vec<Exact>> {
        let alpha = Exact::new(alpha)?;
        let value = |node: usize| {
            let [constant, slope] = self.law.affine_friction(node, self.history_of(node))?;
            Some(&Exact::new(constant)? + &(&alpha * &Exact::new(slope)?))
        };
        (0..self.body.num_contacts()).map(value).collect()
    }

    /// gap − u_ν, then −u_t less its reference, as forms in (v, λ).
    fn opposite(&self) -> Option<Vec<ExactForm>> {
        let q = self.num_residuals();
        let form = |k: usize| {
            let mut form = ExactForm::zero(2 * q);
            form.constant = Exact::new(at_rest(&self.body, &self.reference, k))?;
            if k < self.body.num_contacts() {
                form.constant = &form.constant + &Exact::new(self.law.wear(self.history_of(k)))?;
            }
            form.coefficients[k] = -&Exact::one();
            Some(form)
        };
        (0..self.own_traces()).map(form).collect()
    }
}

/// The law at its nodes, in (v, λ).
impl<L: NodeLaw> ExactPieces for PerNode<L> {
    fn is_affine_in_parameter(&self) -> bool {
        true
    }

    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let friction = self.exact_friction(alpha)?;
        let opposite = self.opposite()?;
        let (p, q) = (friction.len(), self.num_residuals());
        let at_anchor = |k: usize| ExactForm::unknown(2 * q, k, Exact::default());
        let site = |i: usize| {
            let force = |k: usize, shift: Exact| ExactForm::unknown(2 * q, q + k, shift);
            let traces = [opposite[i].clone(), opposite[p + i].clone()];
            let pressure = force(i, Exact::new(self.law.tension(i))?);
            let traction = force(p + i, Exact::default());
            Some(coulomb([pressure, traction], traces, &friction[i], [i, p + i]))
        };
        Some(ExactConditions {
            unknowns: 2 * q,
            common: (self.own_traces()..q).map(at_anchor).collect(),
            sites: (0..p).map(site).collect::<Option<_>>()?,
            bounds: Vec::new(),
        })
    }

    /// λᵀ (v − v₀) ≥ 0: contact and friction forces dissipate energy, unless there is tension. Of a body without supports the compliance is
    /// not definite: this bounds nothing.
    fn passive(&self, _alpha: f64) -> Option<Vec<ExactForm>> {
        let mut nodes = 0..self.body.num_contacts();
        if nodes.any(|node| self.law.tension(node) != 0.0) || !self.body.anchors().is_empty() {
            return None;
        }
        self.opposite()
    }
}

/// The gap of a normal quantity, the displacement at rest of a tangential one.
fn at_rest(body: &ContactBody, reference: &[f64], k: usize) -> f64 {
    let p = body.num_contacts();
    if k < p { body.gap[k] } else { reference[k - p] }
}

/// The forms of a node, in their order.
#[derive(Clone, Copy)]
enum Form {
    Pressure,
    Traction,
    Gap,
    Slip,
    /// λt − F λν.
    Below,
    /// λt + F λν.
    Above,
}

/// The pieces open, stick, slip+, slip− of a node with the forms λν, λt; gap − u_ν, −u_t; F; and the rows of the map to which they
/// correspond.
fn coulomb(
    [pressure, traction]: [ExactForm; 2],
    [gap, slip]: [ExactForm; 2],
    friction: &Exact,
    rows: [usize; 2],
) -> ExactSite {
    use Form::{Above, Below, Gap, Pressure, Slip, Traction};
    let below = traction.plus(&-friction, &pressure);
    let above = traction.plus(friction, &pressure);
    let places = |facets: &[(Form, i8)]| {
        facets
            .iter()
            .map(|(form, sign)| (*form as usize, *sign))
            .collect()
    };
    let piece = |piece, [normal, tangential]: [Form; 2], facets: &[(Form, i8)]| ExactPiece {
        piece,
        equalities: vec![(rows[0], normal as usize), (rows[1], tangential as usize)],
        facets: places(facets),
    };
    let mut pieces = vec![piece(0, [Pressure, Traction], &[(Gap, 1)])];
    let mut implied = vec![(Pressure, 1), (Gap, 1)];
    // Where F < 0 only the open piece has solutions.
    if friction.sign() >= 0 {
        let mut sticking = vec![(Below, -1), (Above, 1)];
        if friction.is_zero() {
            sticking.push((Pressure, 1));
        }
        pieces.push(piece(1, [Gap, Slip], &sticking));
        pieces.push(piece(2, [Gap, Below], &[(Slip, -1), (Pressure, 1)]));
        pieces.push(piece(3, [Gap, Above], &[(Slip, 1), (Pressure, 1)]));
        implied.extend([(Below, -1), (Above, 1)]);
    }
    ExactSite {
        forms: vec![pressure, traction, gap, slip, below, above],
        pieces,
        implied: places(&implied),
    }
}
