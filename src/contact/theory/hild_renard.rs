use crate::contact::{
    ContactBody, ContactError, ContactState, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb,
};
use crate::input::check_finite;
use crate::sparse::Matrix;

/// The model with one contact node of Hild and Renard (2005): A = ½ [[λ+3μ, −(λ+μ)], [−(λ+μ), λ+3μ]], load (f_ν, f_t), F = α, and
/// the closed forms of its solution branches.
///
/// ```
/// use semismooth::contact::{HildRenard, HildRenardCase};
/// let model = HildRenard::new(1.0, -2.0, 1.0, 1.0)?;
/// assert_eq!(model.case(), HildRenardCase::OneBifurcating);
/// # Ok::<(), semismooth::contact::ContactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HildRenard {
    f_nu: f64,
    f_t: f64,
    lambda: f64,
    mu: f64,
}

/// How many solution branches there are in α = F ≥ 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum HildRenardCase {
    /// One branch: (λ+3μ) f_ν + (λ+μ) f_t > 0, or ≤ 0 with f_ν ≤ 0.
    One,
    /// Two branches: (λ+3μ) f_ν + (λ+μ) f_t < 0 and f_ν > 0.
    Two,
    /// One bifurcating branch: (λ+3μ) f_ν + (λ+μ) f_t = 0 and f_ν > 0.
    OneBifurcating,
}

/// A piece of a branch: a state, the interval of α on which it solves the problem, and its solution there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HildRenardBranch {
    /// State of the node.
    pub state: ContactState,
    /// Interval of α, within [0, ∞).
    pub interval: (f64, f64),
}

impl HildRenard {
    /// The model with load (f_ν, f_t) and Lamé coefficients λ, μ > 0.
    ///
    /// # Errors
    /// Values that are not finite; λ or μ not positive ([`ContactError::Modulus`]).
    pub fn new(f_nu: f64, f_t: f64, lambda: f64, mu: f64) -> Result<Self, ContactError> {
        check_finite("(f_nu, f_t, lambda, mu)", &[f_nu, f_t, lambda, mu])?;
        for (index, value) in [(2, lambda), (3, mu)] {
            if value <= 0.0 {
                return Err(ContactError::Modulus {
                    index: index - 2,
                    value,
                });
            }
        }
        Ok(Self {
            f_nu,
            f_t,
            lambda,
            mu,
        })
    }

    /// The discrete problem, with F = α.
    ///
    /// # Errors
    /// None in practice; the constructor of the problem checks everything again.
    pub fn problem(&self) -> Result<FullContact<PlanarCoulomb>, ContactError> {
        let (d, o) = (self.diagonal(), -self.off());
        let body = ContactBody::new(
            Matrix::from_rows(&[[d, o], [o, d]])?,
            Matrix::from_rows(&[[1.0, 0.0]])?,
            vec![Matrix::from_rows(&[[0.0, 1.0]])?],
            LoadPath::constant(vec![self.f_nu, self.f_t]),
        )?;
        let friction = FrictionCoefficient::affine(vec![0.0], vec![1.0])?;
        FullContact::new(body, PlanarCoulomb::new(friction))
    }

    fn diagonal(&self) -> f64 {
        0.5 * (self.lambda + 3.0 * self.mu)
    }

    fn off(&self) -> f64 {
        0.5 * (self.lambda + self.mu)
    }

    /// (λ+3μ) f_ν + (λ+μ) f_t, whose sign is that of the free normal displacement.
    #[must_use]
    pub fn indicator(&self) -> f64 {
        2.0 * (self.diagonal() * self.f_nu + self.off() * self.f_t)
    }

    /// The case, by the analysis of Hild and Renard.
    #[must_use]
    pub fn case(&self) -> HildRenardCase {
        let indicator = self.indicator();
        if indicator > 0.0 || self.f_nu <= 0.0 {
            HildRenardCase::One
        } else if indicator < 0.0 {
            HildRenardCase::Two
        } else {
            HildRenardCase::OneBifurcating
        }
    }

    /// The pieces of all branches in α ≥ 0. Vertical segments (α = (λ+3μ)/(λ+μ) in the bifurcating case) are intervals of length 0.
    ///
    /// With d = (λ+3μ)/2 and c = (λ+μ)/2: open: u = A⁻¹ f, wherever u_ν ≤ 0; stick: λ = f, wherever f_ν ≥ 0 and |f_t| ≤ α f_ν;
    /// slip±: u_ν = 0, u_t = (f_t ∓ α f_ν)/(d ± α c), λ_ν = f_ν + c u_t, λ_t = ±α λ_ν, wherever λ_ν ≥ 0 and ±u_t ≥ 0.
    #[must_use]
    pub fn branches(&self) -> Vec<HildRenardBranch> {
        let (d, c) = (self.diagonal(), self.off());
        let indicator = self.indicator();
        let mut list = Vec::new();
        let mut add = |state, lower: f64, upper: f64| {
            if lower <= upper {
                list.push(HildRenardBranch {
                    state,
                    interval: (lower, upper),
                });
            }
        };
        if indicator <= 0.0 {
            add(ContactState::Open, 0.0, f64::INFINITY);
        }
        if self.f_nu > 0.0 {
            add(ContactState::Stick, self.f_t.abs() / self.f_nu, f64::INFINITY);
        }
        // slip+: numerator of λ_ν is d f_ν + c f_t, its denominator d + α c > 0; u_t ≥ 0 while f_t ≥ α f_ν.
        if indicator > 0.0 && self.f_t > 0.0 {
            let upper = if self.f_nu > 0.0 {
                self.f_t / self.f_nu
            } else {
                f64::INFINITY
            };
            add(ContactState::SlipPlus, 0.0, upper);
        }
        // slip−: denominator d − α c changes sign at the pole α* = d/c.
        let pole = d / c;
        if self.f_nu > 0.0 && self.f_t < 0.0 {
            let edge = -self.f_t / self.f_nu;
            if indicator > 0.0 {
                add(ContactState::SlipMinus, 0.0, edge);
            } else if indicator < 0.0 {
                add(ContactState::SlipMinus, edge, f64::INFINITY);
            } else {
                add(ContactState::SlipMinus, pole, pole);
            }
        }
        list
    }

    /// The solution (u_ν, u_t, λ_ν, λ_t) in a given state at α; meaningful on the interval of that state. It does not apply on the vertical
    /// segment of the bifurcating case: there u_t ranges from 0 to −f_ν/c, with λ_ν = f_ν + c u_t, λ_t = −α λ_ν.
    #[must_use]
    pub fn solution(&self, state: ContactState, alpha: f64) -> [f64; 4] {
        let (d, c) = (self.diagonal(), self.off());
        let slip = |sign: f64| {
            let u_t = (self.f_t - sign * alpha * self.f_nu) / (d + sign * alpha * c);
            let pressure = self.f_nu + c * u_t;
            [0.0, u_t, pressure, sign * alpha * pressure]
        };
        match state {
            ContactState::Open => {
                let det = d * d - c * c;
                [
                    (d * self.f_nu + c * self.f_t) / det,
                    (c * self.f_nu + d * self.f_t) / det,
                    0.0,
                    0.0,
                ]
            }
            ContactState::Stick => [0.0, 0.0, self.f_nu, self.f_t],
            ContactState::SlipPlus => slip(1.0),
            ContactState::SlipMinus => slip(-1.0),
        }
    }
}
