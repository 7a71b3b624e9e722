//! Whether solutions are differentiable in the parameters: yes, no, or not known.

use std::fmt;

use super::SensitivityError;
use super::element::Known;
use super::point::{Agreement, Compared, Solved, Verdict, compared};
use crate::piecewise::{LocalUniqueness, PiecewiseSmooth};
use crate::spread::Random;
use crate::tolerances::DOUBTFUL;
use crate::words::Coordinates;

/// Directions along which two one-sided derivatives are compared, and how many of them are generic.
const DIRECTIONS: usize = 16;
const GENERIC: u64 = 4;

/// Whether the solution is a differentiable function of the parameters at θ.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Differentiability {
    /// It is: no kink is so near that rounding hides it, and the derivative in the unknowns is regular; or
    /// all selections that are active at a kink have the same derivative.
    Yes {
        /// The least test function in multiples of what rounding may hide: above 1, infinite without kinks; 0
        /// at a kink.
        margin: f64,
    },
    /// It is not: θ is at a kink (or nearer to one than rounding shows), and the one-sided derivatives along
    /// this direction do not belong to one linear function.
    No {
        /// δ.
        direction: Vec<f64>,
        /// x′(θ; δ).
        forward: Vec<f64>,
        /// x′(θ; −δ), which is not −x′(θ; δ).
        backward: Vec<f64>,
    },
    /// Not known.
    Undecided(DerivativeDoubt),
}

/// Why it is not known whether a solution is differentiable.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DerivativeDoubt {
    /// The derivative in the unknowns is so nearly singular that rounding may decide.
    IllConditioned {
        /// Reciprocal condition, rows and columns equilibrated.
        rcond: f64,
    },
    /// At a kink the solutions are not known to be one function of the parameters.
    NotUnique(Box<LocalUniqueness>),
    /// Active selections have different derivatives, but no direction was found along which the solutions
    /// have a kink.
    Selections,
    /// Rounding hides whether derivatives differ.
    Rounding,
}

impl Differentiability {
    /// `Some(true)`: it is differentiable; `Some(false)`: it is not; `None`: not known.
    #[must_use]
    pub fn known(&self) -> Option<bool> {
        match self {
            Self::Yes { .. } => Some(true),
            Self::No { .. } => Some(false),
            Self::Undecided(_) => None,
        }
    }
}

impl fmt::Display for Differentiability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Yes { .. } => f.write_str("differentiable"),
            Self::No { direction, .. } => {
                write!(
                    f,
                    "not differentiable: the derivatives along ±{} differ",
                    Coordinates(direction)
                )
            }
            Self::Undecided(doubt) => write!(f, "undecided: {doubt}"),
        }
    }
}

impl fmt::Display for DerivativeDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IllConditioned { rcond } => {
                write!(
                    f,
                    "the derivative in the unknowns is nearly singular (reciprocal condition {rcond:.1e})"
                )
            }
            Self::NotUnique(verdict) => {
                write!(f, "the solutions are not known to be one function: {verdict}")
            }
            Self::Selections => {
                f.write_str("active pieces have different derivatives, and no kink was found")
            }
            Self::Rounding => f.write_str("rounding hides whether derivatives differ"),
        }
    }
}

/// Generic directions of k parameters.
fn generic(k: usize) -> impl Iterator<Item = Vec<f64>> {
    (1..=GENERIC).map(move |seed| {
        let mut spread = Random::new(seed);
        (0..k).map(|_| spread.symmetric()).collect()
    })
}

/// Directions of k parameters along which kinks are looked for: the first unit vectors and generic ones.
pub(crate) fn directions(k: usize) -> impl Iterator<Item = Vec<f64>> {
    let unit = move |j: usize| (0..k).map(|i| f64::from(u8::from(i == j))).collect();
    (0..k.min(DIRECTIONS)).map(unit).chain(generic(k))
}

impl Solved {
    pub(super) fn differentiability(
        &mut self,
        map: &dyn PiecewiseSmooth,
    ) -> Result<Differentiability, SensitivityError> {
        if let Some(element) = &mut self.smooth {
            let rcond = element.rcond();
            return Ok(match rcond < DOUBTFUL {
                true => Differentiability::Undecided(DerivativeDoubt::IllConditioned { rcond }),
                false => Differentiability::Yes { margin: self.margin },
            });
        }
        let doubt = match &self.verdict {
            Some(Verdict::Unique(Agreement::Same)) => return Ok(Differentiability::Yes { margin: 0.0 }),
            Some(Verdict::Unique(Agreement::Differ(probes))) => match self.kink(map, probes)? {
                Some(no) => return Ok(no),
                None => DerivativeDoubt::Selections,
            },
            Some(Verdict::Other(verdict)) => DerivativeDoubt::NotUnique(Box::new(verdict.clone())),
            Some(Verdict::Unique(Agreement::Unclear)) | None => DerivativeDoubt::Rounding,
        };
        Ok(Differentiability::Undecided(doubt))
    }

    /// A direction along which the two one-sided derivatives differ: one of those in which selections differ,
    /// or a generic one.
    fn kink(
        &self,
        map: &dyn PiecewiseSmooth,
        probes: &[Vec<f64>],
    ) -> Result<Option<Differentiability>, SensitivityError> {
        let probes = probes.iter().take(DIRECTIONS).cloned();
        for direction in probes.chain(generic(self.num_parameters())) {
            let opposite: Vec<f64> = direction.iter().map(|d| -d).collect();
            let sides = (self.sided(map, &direction), self.sided(map, &opposite));
            let (forward, mut backward) = match sides {
                (Err(SensitivityError::Rounding), _) | (_, Err(SensitivityError::Rounding)) => continue,
                (forward, backward) => (forward?, backward?),
            };
            backward.value.iter_mut().for_each(|v| *v = -*v);
            if matches!(compared(&forward, &backward), Compared::Differ) {
                backward.value.iter_mut().for_each(|v| *v = -*v);
                return Ok(Some(Differentiability::No {
                    direction,
                    forward: forward.value,
                    backward: backward.value,
                }));
            }
        }
        Ok(None)
    }

    /// x′(θ; δ) with the rounding of its components.
    fn sided(&self, map: &dyn PiecewiseSmooth, delta: &[f64]) -> Result<Known, SensitivityError> {
        let branch = self.branch(map, &self.active, delta)?;
        let mut element = super::Element::new(map, &self.at, &branch.selection)?;
        element.known_at(map, &self.at, branch.rate, delta)
    }
}
