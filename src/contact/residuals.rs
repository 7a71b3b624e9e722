use std::fmt;

use crate::words::{Count, Size};

/// Largest residuals of the three blocks of equations, each against the largest force in it: free of units.
///
/// Where all forces are small differences of terms that cancel (load cases that balance each other;
/// displacements equal to the gap), 1.4e-4 of these terms count in their place: smaller forces consist of
/// rounding errors to more than 1e-10.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactResiduals {
    /// Of A u + Bᵀ λ = f. Zero where displacements are computed from the forces (condensed and Delassus
    /// form).
    pub equilibrium: f64,
    /// Of λν = (λν + r (u_ν − gap))₊.
    pub normal: f64,
    /// Of the law of friction.
    pub tangential: f64,
}

impl ContactResiduals {
    /// The largest of the three.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.equilibrium.max(self.normal).max(self.tangential)
    }
}

/// Numbers of open, sticking and slipping nodes.
pub(super) struct StateCounts(pub(super) [usize; 3]);

impl fmt::Display for StateCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} open, {}", self.0[0], self.closed())
    }
}

impl StateCounts {
    /// Those in contact, in words.
    pub(super) fn closed(&self) -> String {
        let [_, stick, slip] = self.0;
        format!(
            "{}, {}",
            Count(stick, "sticks", "stick"),
            Count(slip, "slips", "slip")
        )
    }
}

impl fmt::Display for ContactResiduals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "residuals {} of equilibrium, {} of the normal law, {} of friction",
            Size(self.equilibrium),
            Size(self.normal),
            Size(self.tangential)
        )
    }
}
