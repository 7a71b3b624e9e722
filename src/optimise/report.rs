use std::fmt;
use std::time::Duration;

use crate::Cause;
use crate::run::Status;
use crate::variational::Multipliers;
use crate::words::{Size, iterations};

/// What an iteration of the bundle method did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BundleStep {
    /// It moved to a better point.
    Serious,
    /// It moved by a small part of the step, and the gradient ahead enriches the model.
    Short,
    /// It stayed, and a gradient nearby enriches the model.
    Null,
    /// The last one.
    None,
}

/// One iteration of the bundle method.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BundleIteration {
    /// Its number, from 0.
    pub index: usize,
    /// f at the iterate.
    pub value: f64,
    /// ‖p + ν‖₂, see [`BundleReport::subgradient`].
    pub subgradient_norm: f64,
    /// The aggregate linearisation error, see [`BundleReport::error`].
    pub error: f64,
    /// The weight u of ½ u dᵀM d in the model.
    pub weight: f64,
    /// Evaluations of f so far.
    pub evaluations: usize,
    /// What it did.
    pub step: BundleStep,
}

/// Report on a run of the bundle method: what is known of the point returned.
///
/// A run that is [solved](Self::is_solved) ended at a point that is stationary in the sense of F. H. Clarke to the tolerance: p + ν is small,
/// where p is a convex combination of elements of generalised gradients, at points that are at most `radius` away, and ν is a normal of the
/// constraints, and the model of f that these make has its minimum there. That does not say that the point is a minimum of f.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BundleReport {
    /// How the run ended: [`Solved`](Status::Solved) at a stationary point to the tolerance.
    pub status: Status,
    /// f at the point returned.
    pub value: f64,
    /// The solution x(θ) there, where f depends on one; else empty.
    pub state: Vec<f64>,
    /// The aggregate subgradient with the normal of the constraints, p + ν.
    pub subgradient: Vec<f64>,
    /// ‖p + ν‖₂.
    pub subgradient_norm: f64,
    /// The Euclidean norm of the largest components of gradients in the run, which those of the subgradient are compared with one by one.
    pub gradient_norm: f64,
    /// By how much the linearisations that p combines differ from f, and constraints that ν combines are from active: at least 0.
    pub error: f64,
    /// The points at which the gradients in p were evaluated are at most this far from the point returned.
    pub radius: f64,
    /// The multipliers of the constraints in ν.
    pub multipliers: Multipliers,
    /// Iterations.
    pub iterations: usize,
    /// Evaluations of f with a gradient.
    pub evaluations: usize,
    /// Points at which f had no value or no gradient; steps to them were shortened.
    pub failures: usize,
    /// Why, at the last one of them.
    pub trouble: Option<Cause>,
    /// The iterations.
    pub history: Vec<BundleIteration>,
    /// Wall-clock time.
    pub time: Duration,
}

impl BundleReport {
    /// Whether the point is stationary in the sense of Clarke to the tolerance.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status.is_solved()
    }
}

impl fmt::Display for BundleReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.status {
            Status::Solved => f.write_str("stationary in the sense of Clarke to the tolerance")?,
            status => write!(f, "{status}")?,
        }
        write!(
            f,
            " after {}, value {}, subgradient {} of gradients up to {}",
            iterations(self.iterations),
            self.value,
            Size(self.subgradient_norm),
            Size(self.gradient_norm)
        )?;
        match &self.trouble {
            Some(trouble) if !self.is_solved() => write!(f, "; at some points f has no gradient: {trouble}"),
            _ => Ok(()),
        }
    }
}
