//! The conditions of the pieces of a piecewise-affine map, with coefficients as they are stored.

use crate::exact::Exact;

/// An affine form of the unknowns y: a constant and one coefficient for each.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ExactForm {
    /// Value at y = 0.
    pub constant: Exact,
    /// Coefficients.
    pub coefficients: Vec<Exact>,
}

impl ExactForm {
    /// The form 0 of the given number of unknowns.
    #[must_use]
    pub fn zero(unknowns: usize) -> Self {
        Self {
            constant: Exact::default(),
            coefficients: vec![Exact::default(); unknowns],
        }
    }

    /// The form y_k + constant.
    #[must_use]
    pub fn unknown(unknowns: usize, k: usize, constant: Exact) -> Self {
        let mut form = Self::zero(unknowns);
        form.constant = constant;
        form.coefficients[k] = Exact::one();
        form
    }

    /// self + factor · other.
    #[must_use]
    pub fn plus(&self, factor: &Exact, other: &Self) -> Self {
        let add = |a: &Exact, b: &Exact| {
            if b.is_zero() { a.clone() } else { a + &(factor * b) }
        };
        let both = self.coefficients.iter().zip(&other.coefficients);
        Self {
            constant: add(&self.constant, &other.constant),
            coefficients: both.map(|(a, b)| add(a, b)).collect(),
        }
    }
}

/// The conditions that hold where a piece is active at its site.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExactPiece {
    /// Number of the piece in the map.
    pub piece: usize,
    /// Forms of the site (by number) that vanish, each with the row of the map that it replaces: the signs of determinants are those
    /// of the matrix of these rows, in this order.
    pub equalities: Vec<(usize, usize)>,
    /// Forms of the site with their signs: ≥ 0 for +1, ≤ 0 for −1.
    pub facets: Vec<(usize, i8)>,
}

/// The conditions of one site.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ExactSite {
    /// Affine forms.
    pub forms: Vec<ExactForm>,
    /// Its pieces; one that has no point at all may be left out.
    pub pieces: Vec<ExactPiece>,
    /// Forms that have one sign in all pieces, with it.
    pub implied: Vec<(usize, i8)>,
}

/// A piecewise-affine system: the common forms vanish, and at every site all conditions of one of its pieces hold.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ExactConditions {
    /// Number of unknowns y. There may be more than the map has: the additional ones are auxiliary, each a function of the unknowns before
    /// it, given by the row of the same number with a positive coefficient, whichever piece is chosen. (Determinants then have the signs of
    /// the map's.)
    pub unknowns: usize,
    /// Rows common to all pieces: those that no equality of a piece replaces, in their order.
    pub common: Vec<ExactForm>,
    /// The sites in their order.
    pub sites: Vec<ExactSite>,
    /// Bounds of |y_k| at all solutions, `None` where none is known; or empty.
    pub bounds: Vec<Option<Exact>>,
}

/// Piecewise-affine maps that give their coefficients exactly, so that lists of their solutions can be proven complete.
///
/// The conditions are those of the solutions of H(y, α) = 0 and need not be those of the map off its solutions: 0 ≤ y ⟂ w ≥ 0 is given
/// by y and w, without units and without an augmentation parameter. Give stored numbers, and sums and products of them without rounding:
/// pieces made of rounded products disagree on the facet between them, so that solutions there are lost or counted twice.
///
/// Proofs are those of the conditions given. Lists and arms are compared with the pieces of the map at the points and directions found, and
/// doubted where these do not solve it ([`Doubt::Contradiction`](crate::enumeration::Doubt::Contradiction)); solutions that wrong conditions
/// exclude are not found in this way.
pub trait ExactPieces {
    /// The conditions at a parameter α (ignored by equations); `None` where coefficients are not known exactly.
    fn conditions(&self, alpha: f64) -> Option<ExactConditions>;

    /// Whether each number of the conditions is an affine function of α, and the forms, pieces and signs are the same for all α between
    /// which no [wall](crate::piecewise::Facet::wall) is passed. Then lists of arms are proven, too. For the law of an
    /// [`Interface`](crate::interface::Interface) the coefficients of the traces v have not to depend on α at all. Default: `false`.
    fn is_affine_in_parameter(&self) -> bool {
        false
    }

    /// For the law of an [`Interface`](crate::interface::Interface), in its variables (v, λ): forms g with λᵀ g ≤ 0 at all solutions, from
    /// which bounds of λ follow. Default: `None`.
    fn passive(&self, _alpha: f64) -> Option<Vec<ExactForm>> {
        None
    }
}
