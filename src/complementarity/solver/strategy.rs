use crate::words::named;

/// The strategies of the solver, tried in this order unless
/// [`McpOptions::strategies`](super::McpOptions::strategies) says otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum McpStrategy {
    /// Active-set Newton steps of the natural map, globalised by the Fischer–Burmeister merit function.
    Newton,
    /// Newton steps of the penalised Fischer–Burmeister function, without equilibration.
    FischerBurmeister,
    /// Proximal points: F(x) + ε (x − x_k), ε → 0.
    Proximal,
    /// Linearised problems solved along piecewise linear paths (Josephy 1979; Ralph 1994).
    JosephyNewton,
    /// A path from the start to a solution, t F(x) + (1 − t)(x − x⁰), through folds.
    Homotopy,
    /// Small affine problems: a pruned search of all active sets.
    Enumeration,
    /// Newton's method for smoothed equations (Chen and Harker 1993; Kanzow 1996; Smale 1987).
    Smoothing,
    /// The first two and paths from perturbed starts.
    Restart,
}

impl McpStrategy {
    /// In the order in which they are tried unless the options say otherwise.
    pub(super) const ALL: [Self; 8] = [
        Self::Newton,
        Self::FischerBurmeister,
        Self::Proximal,
        Self::JosephyNewton,
        Self::Homotopy,
        Self::Enumeration,
        Self::Smoothing,
        Self::Restart,
    ];

    /// The strategy in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Newton => "Newton",
            Self::FischerBurmeister => "Fischer-Burmeister",
            Self::Proximal => "proximal",
            Self::JosephyNewton => "Josephy-Newton",
            Self::Homotopy => "homotopy",
            Self::Enumeration => "enumeration",
            Self::Smoothing => "smoothing",
            Self::Restart => "restart",
        }
    }
}

named!(McpStrategy, "strategy for an MCP", McpStrategy::ALL);
