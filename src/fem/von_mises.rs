use super::{FemError, Material};

/// √(2/3): the ratio of |dev σ| to the stress in uniaxial tension.
const TENSION: f64 = 0.816_496_580_927_726;

/// Von Mises plasticity with linear hardening, isotropic and kinematic, of an isotropic elastic material.
///
/// |dev σ − ⅔ H_k εᵖ| ≤ √⅔ (σ_y + H_i α), where εᵖ is the plastic strain and α the accumulated one, ∫√⅔ |ε̇ᵖ|. A time step by the implicit
/// Euler method is solved in closed form by radial return (J. C. Simo, T. J. R. Hughes, *Computational Inelasticity* (1998), section 3.3).
/// The stress is a piecewise smooth function of the strain, its consistent tangent (box 3.2) an element of the generalised Jacobian, so
/// that Newton's method on a body is a semismooth Newton method (M. Sauter, C. Wieners, Comput. Methods Appl. Mech. Eng. 200 (2011)).
///
/// Strains and stresses are written 11, 22, 33, 12, 23, 13, shear strains doubled.
///
/// ```
/// use semismooth::fem::{PlasticState, VonMises};
/// // MPa; shear yields at σ_y/√3, beyond it the slope is μ H/(3 μ + H) with H = H_i + H_k.
/// let steel = VonMises::new(210e3, 0.3, 250.0)?.with_hardening(1e3, 4e3)?;
/// let (mu, k) = (210e3 / 2.6, 250.0 / 3f64.sqrt());
/// let strain = [0.0, 0.0, 0.0, 0.01, 0.0, 0.0];
/// let answer = steel.respond(&strain, &PlasticState::default());
/// let slope = mu * 5e3 / (3.0 * mu + 5e3);
/// assert!((answer.stress[3] - (k + slope * (0.01 - k / mu))).abs() < 1e-9 * k);
/// assert!((answer.tangent[3][3] - slope).abs() < 1e-9 * mu);
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct VonMises {
    elastic: Material,
    bulk: f64,
    shear: f64,
    yield_stress: f64,
    isotropic: f64,
    kinematic: f64,
}

/// The history variables of a point of a plastic body. The default is the virgin state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct PlasticState {
    /// The plastic strain εᵖ, of trace 0: 11, 22, 33, 12, 23, 13, shear strains doubled.
    pub strain: [f64; 6],
    /// The accumulated plastic strain α ≥ 0, in uniaxial tension the plastic strain itself.
    pub accumulated: f64,
}

/// The response of a [`VonMises`] material to a strain.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PlasticResponse {
    /// The stress.
    pub stress: [f64; 6],
    /// The consistent tangent, symmetric: derivative of the stress with respect to the strain; on the yield surface the elastic one.
    pub tangent: [[f64; 6]; 6],
    /// The state after the step.
    pub state: PlasticState,
}

impl VonMises {
    /// Young's modulus E > 0, Poisson's ratio −1 < ν < ½ and the yield stress σ_y > 0 in tension, without hardening.
    ///
    /// # Errors
    /// Constants out of range.
    pub fn new(young: f64, poisson: f64, yield_stress: f64) -> Result<Self, FemError> {
        let elastic = Material::isotropic(young, poisson)?;
        if !(yield_stress > 0.0 && yield_stress.is_finite()) {
            return Err(FemError::Material {
                what: "the yield stress",
                value: yield_stress,
                rule: "it must be positive and finite",
            });
        }
        Ok(Self {
            elastic,
            bulk: young / (3.0 * (1.0 - 2.0 * poisson)),
            shear: young / (2.0 * (1.0 + poisson)),
            yield_stress,
            isotropic: 0.0,
            kinematic: 0.0,
        })
    }

    /// The plastic moduli H_i ≥ 0 of isotropic hardening (growth of the yield stress with α) and H_k ≥ 0 of kinematic hardening (shift of
    /// the elastic range), in the units of E. Their sum is the slope of the stress over the plastic strain in tension.
    ///
    /// # Errors
    /// Moduli that are negative or not finite.
    pub fn with_hardening(mut self, isotropic: f64, kinematic: f64) -> Result<Self, FemError> {
        for (what, value) in [
            ("the modulus of isotropic hardening", isotropic),
            ("the modulus of kinematic hardening", kinematic),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(FemError::Material {
                    what,
                    value,
                    rule: "it must not be negative, and finite",
                });
            }
        }
        (self.isotropic, self.kinematic) = (isotropic, kinematic);
        Ok(self)
    }

    /// The elastic material.
    #[must_use]
    pub fn elastic(&self) -> &Material {
        &self.elastic
    }

    /// The yield stress σ_y of the virgin material.
    #[must_use]
    pub fn yield_stress(&self) -> f64 {
        self.yield_stress
    }

    /// Stress, tangent and new state when the strain becomes `strain` from a state. NaN in the input gives NaN.
    #[must_use]
    pub fn respond(&self, strain: &[f64; 6], state: &PlasticState) -> PlasticResponse {
        let two_mu = 2.0 * self.shear;
        let trace = strain[0] + strain[1] + strain[2];
        let elastic = self.elastic_deviator(strain, state);
        let back = 2.0 / 3.0 * self.kinematic;
        // Relative to the centre of the elastic range.
        let trial: [f64; 6] =
            std::array::from_fn(|a| two_mu * elastic[a] - back * undoubled(a) * state.strain[a]);
        let size = product(&trial, &trial).sqrt();
        let excess = size - TENSION * (self.yield_stress + self.isotropic * state.accumulated);
        let mut answer = PlasticResponse {
            stress: elastic.map(|e| two_mu * e),
            tangent: [[0.0; 6]; 6],
            state: *state,
        };
        let (mut kept, mut radial) = (1.0, 0.0);
        let mut direction = [0.0; 6];
        if excess > 0.0 {
            let flow = excess / (two_mu + 2.0 / 3.0 * (self.isotropic + self.kinematic));
            direction = trial.map(|t| t / size);
            for a in 0..6 {
                answer.stress[a] -= two_mu * flow * direction[a];
                answer.state.strain[a] += flow * direction[a] / undoubled(a);
            }
            answer.state.accumulated += TENSION * flow;
            kept = 1.0 - two_mu * flow / size;
            radial = kept
                - (self.isotropic + self.kinematic) / (3.0 * self.shear + self.isotropic + self.kinematic);
        }
        for a in 0..6 {
            for b in 0..6 {
                answer.tangent[a][b] = -two_mu * radial * direction[a] * direction[b];
                if a < 3 && b < 3 {
                    answer.tangent[a][b] += self.bulk - two_mu * kept / 3.0;
                }
            }
            answer.tangent[a][a] += two_mu * kept * undoubled(a);
            if a < 3 {
                answer.stress[a] += self.bulk * trace;
            }
        }
        answer
    }

    /// Elastic energy per volume, and energy per volume stored by hardening: ½ (⅔ H_k |εᵖ|² + H_i α²).
    #[must_use]
    pub fn energies(&self, strain: &[f64; 6], state: &PlasticState) -> [f64; 2] {
        let trace = strain[0] + strain[1] + strain[2];
        let elastic = self.elastic_deviator(strain, state);
        let plastic: [f64; 6] = std::array::from_fn(|a| undoubled(a) * state.strain[a]);
        [
            0.5 * self.bulk * trace * trace + self.shear * product(&elastic, &elastic),
            self.kinematic / 3.0 * product(&plastic, &plastic)
                + 0.5 * self.isotropic * state.accumulated * state.accumulated,
        ]
    }

    /// dev ε − εᵖ, shear strains not doubled.
    fn elastic_deviator(&self, strain: &[f64; 6], state: &PlasticState) -> [f64; 6] {
        let mean = (strain[0] + strain[1] + strain[2]) / 3.0;
        std::array::from_fn(|a| undoubled(a) * (strain[a] - state.strain[a]) - if a < 3 { mean } else { 0.0 })
    }
}

/// The equivalent stress of von Mises, (3/2 s : s)^½ of σ = (σ₁₁, σ₂₂, σ₃₃, σ₁₂, σ₂₃, σ₁₃) with its deviator s, in the unit of σ.
///
/// ```
/// // Under tension it is the tension, under a shear τ it is √3 τ, and a pressure has none.
/// use semismooth::fem::von_mises_stress;
/// assert_eq!(von_mises_stress(&[-2.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 2.0);
/// assert!((von_mises_stress(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]) - 12f64.sqrt()).abs() < 1e-15);
/// assert_eq!(von_mises_stress(&[7.0, 7.0, 7.0, 0.0, 0.0, 0.0]), 0.0);
/// ```
#[must_use]
pub fn von_mises_stress(stress: &[f64; 6]) -> f64 {
    let [a, b, c, shear @ ..] = *stress;
    let normal = (a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2);
    (0.5 * normal + 3.0 * shear.iter().map(|s| s * s).sum::<f64>()).sqrt()
}

/// From engineering (doubled) shear strains to components of the tensor.
const fn undoubled(a: usize) -> f64 {
    if a < 3 { 1.0 } else { 0.5 }
}

/// s : t of tensors with six components.
fn product(s: &[f64; 6], t: &[f64; 6]) -> f64 {
    (0..6).map(|a| s[a] * t[a] / undoubled(a)).sum()
}
