//! Derivatives of solutions in the parameters of their equations.
//!
//! The solutions x of H(x, θ) = 0, n equations in n unknowns and k parameters, are piecewise smooth functions
//! of θ where they are unique nearby. [`Sensitivity`] says whether they are differentiable at a solution,
//! gives products with the derivative and its transpose, at kinks the directional derivatives and elements of
//! the generalised derivative, and the range within which a piece holds.
//!
//! Maps of n + k variables come from closures ([`parametric`](crate::parametric)), from complementarity
//! problems ([`Mcp::with_parameters`](crate::complementarity::Mcp::with_parameters),
//! [`Lcp::in_constants`](crate::complementarity::Lcp::in_constants)), from any map and the columns of its
//! derivative in loads ([`Loaded`]), from variational inequalities with their multipliers
//! ([`Vi::with_parameters`](crate::variational::Vi::with_parameters)), from problems over second-order cones
//! ([`ConePieces`](crate::cones::ConePieces)), or are maps of your own. The map of a curve has one parameter, α: that
//! of a [contact problem](crate::contact) its load parameter, on which coefficients of friction may depend,
//! too; all other data of its problem are parameters of
//! [`Contact::sensitivity`](crate::contact::Contact::sensitivity). A [`Solution`](crate::Solution) leads here
//! by [`sensitivity`](crate::Solution::sensitivity).

mod differentiable;
mod directional;
mod element;
mod error;
mod family;
mod parameters;
mod point;
mod range;

use std::fmt;

pub use differentiable::{DerivativeDoubt, Differentiability};
pub use directional::Directional;
pub use element::Element;
pub use error::SensitivityError;
pub use family::valid_along;
pub use parameters::Loaded;
pub use range::Validity;

use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::Matrix;
pub(crate) use differentiable::directions;
pub(crate) use element::Known;
use point::Solved;
pub(crate) use point::{differ, too_many};

/// Active selections up to which kinks are examined, one factorisation each or a few: 4096, and of more than
/// 64 unknowns 2¹⁸ over their number, so that an analysis takes seconds.
fn limit(n: usize) -> u64 {
    const UNKNOWNS: u64 = 1 << 18;
    (UNKNOWNS / n.max(1) as u64).clamp(16, 4096)
}

/// A solution x of H(x, θ) = 0 as a function of the parameters θ, near the θ given: the derivative where
/// there is one, one-sided ones where there is none.
///
/// H is a map of n residuals and n + k variables, the unknowns and behind them the parameters. Its
/// derivatives are taken for exact but for rounding. At a kink, where test functions of several pieces
/// vanish, the solutions are one Lipschitz function of θ if (x, θ) ↦ (H, θ) is coherently oriented and takes
/// no value twice to first order (D. Ralph, S. Scholtes, Math. Program. 76 (1997)), as
/// [`implicit_function`](crate::piecewise::implicit_function) decides for one parameter; only then something
/// is called *the* directional derivative, and elements of a generalised derivative are given. Up to 4096
/// active selections are examined (of n > 64 unknowns 2¹⁸/n, at least 16), a few factorisations each.
///
/// A test function counts as vanishing where rounding of the equations' terms may have moved it from 0.
///
/// ```
/// use semismooth::parametric;
/// use semismooth::sensitivity::{Sensitivity, Validity};
/// // x = max(θ₀, 2 θ₁).
/// let map = || parametric(1, 2, |x, p| vec![x[0] - p[0].max(2.0 * p[1])]);
///
/// let mut smooth = Sensitivity::new(map(), &[3.0], &[3.0, 1.0])?;
/// assert_eq!(smooth.differentiable()?.known(), Some(true));
/// assert_eq!(smooth.vjp(&[1.0])?, [1.0, 0.0]);
/// assert_eq!(smooth.valid_until(&[0.0, 1.0], 10.0)?, Validity::Exact(0.5));
///
/// let mut kink = Sensitivity::new(map(), &[2.0], &[2.0, 1.0])?;
/// assert_eq!(kink.differentiable()?.known(), Some(false));
/// assert_eq!(kink.jvp(&[0.0, 1.0])?, [2.0]);
/// assert_eq!(kink.jvp(&[0.0, -1.0])?, [0.0]); // not −2
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Sensitivity<P> {
    map: P,
    solved: Solved,
    /// The element along the unit vectors, once it was asked for.
    element: Option<Element>,
}

impl<P> Sensitivity<P> {
    /// The map.
    pub fn map(&self) -> &P {
        &self.map
    }

    /// The solution x, corrected (length n).
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.solved.at[..self.solved.n]
    }

    /// The parameters θ (length k).
    #[must_use]
    pub fn parameters(&self) -> &[f64] {
        &self.solved.at[self.solved.n..]
    }
}

impl<P: PiecewiseSmooth> Sensitivity<P> {
    /// The solution x (length n) at parameters θ (length k). It is corrected by Newton's method to rounding,
    /// each unknown by at most 1e-5 of the size of the terms that determine it, or of its typical size.
    ///
    /// # Errors
    /// Wrong lengths, values or derivatives that are not finite, a map without parameters or with one that
    /// enters nowhere ([`SensitivityError::NotEntering`]); a point that is no solution
    /// ([`SensitivityError::NoSolution`]) or an irregular one ([`SensitivityError::Irregular`]).
    pub fn new(map: P, x: &[f64], parameters: &[f64]) -> Result<Self, SensitivityError> {
        Self::solved(map, x, parameters, false)
    }

    /// [`new`](Self::new), where parameters may enter nowhere, as those of an objective alone.
    pub(crate) fn with_idle_parameters(
        map: P,
        x: &[f64],
        parameters: &[f64],
    ) -> Result<Self, SensitivityError> {
        Self::solved(map, x, parameters, true)
    }

    fn solved(map: P, x: &[f64], parameters: &[f64], may_be_idle: bool) -> Result<Self, SensitivityError> {
        let solved = Solved::new(&map, x, parameters, may_be_idle)?;
        Ok(Self {
            map,
            solved,
            element: None,
        })
    }

    /// Whether x is a differentiable function of θ here.
    ///
    /// # Errors
    /// Solves whose residual is not small.
    pub fn differentiable(&mut self) -> Result<Differentiability, SensitivityError> {
        self.solved.differentiability(&self.map)
    }

    /// How the solution moves along a change δ of the parameters (length k): the directional derivative, or
    /// where the solutions are not known to be one function the one-sided branches.
    ///
    /// Where more selections are active than are examined one by one, branches come from the pruned search of
    /// [`all_arms`](crate::enumeration::all_arms), or from its pivots.
    ///
    /// # Errors
    /// A wrong length, values that are not finite; a direction that rounding does not place in a cell.
    pub fn directional(&mut self, delta: &[f64]) -> Result<Directional, SensitivityError> {
        self.solved.directional(&self.map, delta)
    }

    /// The directional derivative x′(θ; δ) (length n): where x is differentiable the product of its
    /// derivative with δ.
    ///
    /// # Errors
    /// As [`directional`](Self::directional); [`SensitivityError::NotUnique`] where that gives branches.
    pub fn jvp(&mut self, delta: &[f64]) -> Result<Vec<f64>, SensitivityError> {
        if let Some(point::Verdict::Other(verdict)) = &self.solved.verdict {
            check_vector(
                "the change of the parameters",
                delta,
                self.solved.num_parameters(),
            )?;
            let verdict = Box::new(verdict.clone());
            return Err(SensitivityError::NotUnique { verdict });
        }
        match self.directional(delta)? {
            Directional::Derivative(v) => Ok(v),
            Directional::Branches { .. } => Err(SensitivityError::Rounding),
        }
    }

    /// The product of the transposed derivative with w (length n): for the gradient w of a function of x its
    /// gradient in θ (length k). At kinks the derivative is the [`element`](Self::element) along the unit
    /// vectors. One solve, on factors that are kept.
    ///
    /// # Errors
    /// A wrong length, values that are not finite; otherwise as [`element`](Self::element).
    pub fn vjp(&mut self, w: &[f64]) -> Result<Vec<f64>, SensitivityError> {
        self.kept()?.vjp(w)
    }

    /// The derivative ∂x/∂θ (n × k).
    ///
    /// # Errors
    /// [`SensitivityError::NotDifferentiable`] where x is not known to be differentiable; solves whose
    /// residual is not small.
    pub fn derivative(&mut self) -> Result<Matrix, SensitivityError> {
        match self.differentiable()? {
            Differentiability::Yes { .. } => self.kept()?.matrix(),
            _ => Err(SensitivityError::NotDifferentiable),
        }
    }

    /// The lexicographic derivative along a frame of k linearly independent directions: the linear function
    /// that is left after x has been differentiated along the first direction, the result along the second
    /// one and so on (Yu. Nesterov, Math. Program. 104 (2005); K. A. Khan, P. I. Barton, Optim. Methods
    /// Softw. 30 (2015)). It is an element of the generalised derivative that bundle methods take, while the
    /// derivative of an arbitrary active selection need not be one. Where x is differentiable it is the
    /// derivative.
    ///
    /// # Errors
    /// Wrong lengths, directions that are not linearly independent ([`SensitivityError::Frame`]);
    /// [`SensitivityError::NotUnique`] where the solutions are not known to be one function; a direction that
    /// rounding does not place in a cell.
    pub fn element<V: AsRef<[f64]>>(&self, frame: &[V]) -> Result<Element, SensitivityError> {
        let k = self.solved.num_parameters();
        for direction in frame {
            check_vector("a direction of the frame", direction.as_ref(), k)?;
        }
        let rows = Matrix::from_rows(frame).map_err(LinearError::from)?;
        let mut solver = AutoSolver::new();
        let independent = frame.len() == k
            && (solver.analyze(rows.pattern().as_ref()))
                .and_then(|()| solver.factor(rows.as_ref()))
                .is_ok();
        if !independent {
            return Err(SensitivityError::Frame { expected: k });
        }
        self.solved.lexicographic(&self.map, frame.iter())
    }

    /// Says nothing of the solutions near a kink where an active selection has no larger reciprocal condition: for derivatives that are not
    /// known to rounding.
    pub(crate) fn doubt_below(&mut self, rcond: f64) -> Result<(), SensitivityError> {
        self.solved.doubt_below(&self.map, rcond)
    }

    /// Whether more than one selection is active.
    pub(crate) fn is_at_kink(&self) -> bool {
        self.solved.smooth.is_none()
    }

    /// The element along directions that need not be a frame: as many as there are, or until it is determined.
    pub(crate) fn element_along(
        &self,
        directions: impl IntoIterator<Item = Vec<f64>>,
    ) -> Result<Element, SensitivityError> {
        self.solved.lexicographic(&self.map, directions)
    }

    /// How far along δ (length k) the solutions x(θ + s δ), s > 0, stay on the piece that the directional
    /// derivative belongs to. For maps that are [affine on each piece](PiecewiseSmooth::is_piecewise_affine)
    /// a ratio test decides; for others the curve of solutions is followed up to s = `horizon`.
    ///
    /// # Errors
    /// A wrong length, values that are not finite, a horizon that is not positive;
    /// [`SensitivityError::NotUnique`] at kinks; failures of the [continuation](crate::continuation).
    pub fn valid_until(&mut self, delta: &[f64], horizon: f64) -> Result<Validity, SensitivityError> {
        self.solved.valid_until(&self.map, delta, horizon)
    }

    /// The element along the unit vectors, kept.
    fn kept(&mut self) -> Result<&mut Element, SensitivityError> {
        let k = self.solved.num_parameters();
        let element = match self.element.take() {
            Some(element) => element,
            None => {
                let unit = |j| (0..k).map(|i| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
                self.solved.lexicographic(&self.map, (0..k).map(unit))?
            }
        };
        Ok(self.element.insert(element))
    }
}

/// "2 parameters, kinks at 1 site, one function": in one line.
impl<P> fmt::Display for Sensitivity<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use crate::words::Count;
        let parameters = Count(self.solved.num_parameters(), "parameter", "parameters");
        match &self.solved.verdict {
            None => write!(f, "{parameters}, away from kinks"),
            Some(verdict) => {
                let sites = self.solved.active.degenerate_sites().len();
                write!(f, "{parameters}, kinks at {}, ", Count(sites, "site", "sites"))?;
                match verdict {
                    point::Verdict::Unique(_) => f.write_str("the solutions are one function"),
                    point::Verdict::Other(verdict) => verdict.fmt(f),
                }
            }
        }
    }
}
