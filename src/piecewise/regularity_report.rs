//! Regularity at a solution, for reports of solvers.

use super::derivative::orientation_of;
use super::regularity::{convex_hull, examine};
use super::semismooth_regularity::examine_elements;
use super::{CoherentOrientation, PiecewiseError, PiecewiseSmooth, Regularity, Semismooth};
use crate::InputError;
use crate::input::{check_options, not_negative};
use crate::options::setters;
use crate::words;
use std::fmt;

/// How the regularity of a solution is examined. Solvers do so if their options request it (`with_regularity`); by default they do not.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct RegularityOptions {
    /// Test functions with |θ(x)| up to this value, in their units, count as vanishing at the solution; it must be at least their error
    /// there for the kinks on which the solution lies to be recognised. Default 1e-9.
    pub tolerance: f64,
    /// Largest number of active selections examined, one factorisation each for every notion. Default 1000.
    pub cap: u64,
}

impl Default for RegularityOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-9,
            cap: 1000,
        }
    }
}

impl RegularityOptions {
    setters! {
        /// Sets the value up to which test functions count as vanishing.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of active selections examined.
        with_cap(cap: u64);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[not_negative("regularity.tolerance", self.tolerance)])
    }
}

/// The regularity of a solution, examined at the point returned.
///
/// ```
/// use semismooth::newton::{Newton, NewtonOptions};
/// use semismooth::piecewise::{MinMap, RegularityOptions};
/// // min(x, 3 x) = 0: slopes 1 and 3 meet at the solution.
/// let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = 3.0 * x[0]; });
/// let mut newton = Newton::new(NewtonOptions::default().with_regularity(Some(RegularityOptions::default())));
/// newton.solve(&map, &mut [1.0])?;
/// let found = newton.report().regularity.as_ref().expect("asked for");
/// assert!(found.bd.is_regular() && found.cd.is_regular());
/// println!("{found}"); // BD-regular: yes (2 selections); CD-regular: yes (2 selections); coherently oriented: yes, sign +1
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RegularityReport {
    /// [BD-regularity](super::bd_regularity).
    pub bd: Regularity,
    /// [CD-regularity](super::cd_regularity).
    pub cd: Regularity,
    /// [Coherent orientation](super::coherent_orientation); `None` outside of all cells, for semismooth maps, and where the linear solver
    /// provides no determinants. The kernel vector of a selection of sign 0 is the direction of `bd`.
    pub orientation: Option<CoherentOrientation>,
    /// [Strong regularity](crate::complementarity::strong_regularity) for complementarity problems; else `None`.
    pub strong: Option<Regularity>,
}

impl fmt::Display for RegularityReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "BD-regular: {}; CD-regular: {}",
            Answer(&self.bd),
            Answer(&self.cd)
        )?;
        if let Some(orientation) = &self.orientation {
            write!(f, "; coherently oriented: {orientation}")?;
        }
        if let Some(strong) = &self.strong {
            write!(f, "; strongly regular: {}", Answer(strong))?;
        }
        Ok(())
    }
}

/// A verdict as an answer to the question after it.
struct Answer<'a>(&'a Regularity);

impl fmt::Display for Answer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Regularity::Regular { selections: 1, .. } => f.write_str("yes (1 selection)"),
            Regularity::Regular { selections, .. } => write!(f, "yes ({})", words::selections(*selections)),
            Regularity::Fails { .. } => write!(f, "no, {}", self.0),
            other => write!(f, "{other}"),
        }
    }
}

/// The regularity at x, without strong regularity.
pub(crate) fn regularity_report(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &RegularityOptions,
) -> Result<RegularityReport, PiecewiseError> {
    let RegularityOptions { tolerance, cap } = *options;
    let mut elements = Vec::new();
    let bd = examine(map, x, tolerance, cap, Some(&mut elements))?;
    let cd = convex_hull(bd.clone(), &elements, cap)?;
    let orientation = match &bd {
        Regularity::Outside { .. } => None,
        _ => orientation_of(map, x, tolerance, cap)?,
    };
    Ok(RegularityReport {
        bd,
        cd,
        orientation,
        strong: None,
    })
}

/// [`regularity_report`] of a semismooth map.
pub(crate) fn semismooth_report(
    map: &dyn Semismooth,
    x: &[f64],
    options: &RegularityOptions,
) -> Result<RegularityReport, PiecewiseError> {
    let mut elements = Vec::new();
    let bd = examine_elements(map, x, options.tolerance, options.cap, Some(&mut elements))?;
    let cd = convex_hull(bd.clone(), &elements, options.cap)?;
    Ok(RegularityReport {
        bd,
        cd,
        orientation: None,
        strong: None,
    })
}
