/// Multipliers of the constraints of a [`Polyhedron`](super::Polyhedron).
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Multipliers {
    /// Of A x ≤ b: length m, ≥ 0.
    pub inequalities: Vec<f64>,
    /// Of E x = d: length k, of any sign.
    pub equations: Vec<f64>,
    /// Of x ≥ l: length n, ≥ 0.
    pub lower: Vec<f64>,
    /// Of x ≤ u: length n, ≥ 0.
    pub upper: Vec<f64>,
}

/// A row as nᵀx ≥ β with ‖n‖ = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Equation(usize),
    Inequality(usize),
    Lower(usize),
    Upper(usize),
    /// Equal bounds.
    Fixed(usize),
}
