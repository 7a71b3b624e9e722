use crate::run::Status;

/// One iterate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ConeIteration {
    /// Which start, from 0.
    pub attempt: usize,
    /// ‖Φ_μ‖₂, the smoothed Fischer–Burmeister function of x and F in units of each cone; for steps of the natural map its norm.
    pub merit: f64,
    /// The smoothing parameter; 0 for steps of the natural map.
    pub mu: f64,
    /// Length of the step to it, 1 for a full one.
    pub damping: f64,
}

/// Proof that no x in K has F(x) = M x + q in K*: v ∈ K with −Mᵀv ∈ K* and qᵀv < 0.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ConeRay {
    /// v, in K; qᵀv = −1 up to rounding. 0 outside one block of unknowns connected by entries of M.
    pub direction: Vec<f64>,
    /// qᵀv.
    pub value: f64,
    /// −Mᵀv lies in K* up to rounding; v proves that there is no solution with ‖x‖₂ below this radius. In units of each cone in which the
    /// entries of M are of one size it is at least 10¹² times the size of x at which M x and q of this block are of similar size; infinite
    /// where −Mᵀv lies in K* exactly.
    pub radius: f64,
}

/// How a solve went.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConeReport {
    /// How it ended.
    pub status: Status,
    /// ‖x − P(x − F(x))‖_∞ at the point returned.
    pub residual: f64,
    /// Largest ‖x_b/X − P(x_b/X − F_b/S_b)‖₂ over the cones b. X is the largest |xᵢ| in the block of b (the cones connected by entries of
    /// J), S_b the norm of the terms Σⱼ |Jᵢⱼ xⱼ| + |Fᵢ − Σⱼ Jᵢⱼ xⱼ| of its rows, where xⱼ in a cone counts with at least 1e-4 of the norm
    /// of its entries or of the size at which constants are as large as the other terms, whichever is less. The units of x and of F in a
    /// cone do not change it. Beside constants of a cone that are small compared with its terms it is their share of the error beyond
    /// rounding, or the square of that of the rounding, whichever is largest, unless half-lines and free variables of an affine F alone determine these unknowns, by a regular J. The point is solved where
    /// this is at most the tolerance.
    pub error: f64,
    /// Iterations, over all starts.
    pub iterations: usize,
    /// Evaluations of F, those of line searches included.
    pub evaluations: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// The iterates.
    pub history: Vec<ConeIteration>,
    /// The proof that there is no solution.
    pub ray: Option<ConeRay>,
}

impl ConeReport {
    /// Whether the problem is solved.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status.is_solved()
    }
}

impl std::fmt::Display for ConeReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        crate::words::ended(f, &self.status, self.iterations, self.residual)
    }
}
