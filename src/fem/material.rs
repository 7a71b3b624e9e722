use super::FemError;
use crate::words::named;

/// Order of strains and stresses: 11, 22, 33, 12, 23, 13 (shear strains doubled).
pub(super) const VOIGT: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [0, 2]];

/// Those in the plane.
pub(super) const KEPT: [usize; 3] = [0, 1, 3];

/// Stress from strain.
pub(super) type Tensor = [[f64; 6]; 6];

/// The reduction of a body in space to a plane problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum PlaneModel {
    /// ε₁₃ = ε₂₃ = ε₃₃ = 0: a long body, one unit of its length.
    #[default]
    Strain,
    /// σ₁₃ = σ₂₃ = σ₃₃ = 0: a thin plate of unit thickness.
    Stress,
    /// A body of revolution about the line x = 0, without torsion: x ≥ 0 is the radius, y the height, the third direction that of the
    /// circumference, with ε₃₃ = u₁/x. Forces, areas and energies are those of the whole rings; u₁ = 0 at nodes on the axis.
    Axisymmetric,
}

impl PlaneModel {
    /// "strain", "stress" or "axisymmetric".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Strain => "strain",
            Self::Stress => "stress",
            Self::Axisymmetric => "axisymmetric",
        }
    }
}

/// A constant of an isotropic [`Material`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum MaterialConstant {
    /// Young's modulus E, Poisson's ratio being fixed.
    Young,
    /// Poisson's ratio ν, E being fixed.
    Poisson,
}

named!(
    PlaneModel,
    "model of a plane body",
    [Self::Strain, Self::Stress, Self::Axisymmetric]
);

/// Poisson's ratio above which elements of first order lock noticeably: at 0.49 a bonded block on a mesh of 8 cells is 7 % too stiff with
/// quadrilaterals and 13 % with triangles, at 0.3 it is 0.3 %.
const LOCKING: f64 = 0.45;

/// A linearly elastic material.
///
/// ```
/// use semismooth::fem::Material;
/// let steel = Material::isotropic(211.9, 0.277)?; // GPa
/// assert!(Material::isotropic(211.9, 0.5).is_err()); // incompressible: no finite λ
/// let same = Material::tensor(&steel.components())?;
/// assert_eq!(steel, same);
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Unchecked")
)]
pub struct Material {
    /// Stress from strain, in the order of [`VOIGT`].
    matrix: [[f64; 6]; 6],
}

/// A material as read from a file.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "Material")]
struct Unchecked {
    matrix: [[f64; 6]; 6],
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for Material {
    type Error = FemError;

    fn try_from(Unchecked { matrix }: Unchecked) -> Result<Self, FemError> {
        let read = Self { matrix };
        // Isotropic ones may be arbitrarily close to incompressible.
        match Self::lame(matrix[0][1], matrix[3][3]) {
            Ok(isotropic) if isotropic == read => Ok(read),
            _ => Self::tensor(&read.components()),
        }
    }
}

impl Material {
    /// Whether elements of first order lock; of anisotropic materials that is judged by the mean over all orientations.
    pub(super) fn locks(&self) -> bool {
        let c = &self.matrix;
        let normal = c[0][0] + c[1][1] + c[2][2];
        let mixed = c[0][1] + c[1][2] + c[0][2];
        let shear = c[3][3] + c[4][4] + c[5][5];
        let (bulk, shear) = (
            (normal + 2.0 * mixed) / 9.0,
            (normal - mixed + 3.0 * shear) / 15.0,
        );
        let poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear);
        poisson > LOCKING
    }

    /// Young's modulus E > 0 and Poisson's ratio −1 < ν < ½.
    ///
    /// # Errors
    /// Constants out of range.
    pub fn isotropic(young: f64, poisson: f64) -> Result<Self, FemError> {
        if !(young > 0.0 && young.is_finite()) {
            return Err(FemError::Material {
                what: "Young's modulus E",
                value: young,
                rule: "it must be positive and finite",
            });
        }
        if !(poisson > -1.0 && poisson < 0.5) {
            return Err(FemError::Material {
                what: "Poisson's ratio",
                value: poisson,
                rule: "it must lie strictly between -1 and 0.5",
            });
        }
        let mu = young / (2.0 * (1.0 + poisson));
        Self::lame(2.0 * mu * poisson / (1.0 - 2.0 * poisson), mu)
    }

    /// Lamé's constants: μ > 0, 3λ + 2μ > 0.
    ///
    /// # Errors
    /// Constants out of range.
    pub fn lame(lambda: f64, mu: f64) -> Result<Self, FemError> {
        if !(mu > 0.0 && mu.is_finite()) {
            return Err(FemError::Material {
                what: "the Lamé constant mu",
                value: mu,
                rule: "it must be positive and finite",
            });
        }
        if !(3.0 * lambda + 2.0 * mu > 0.0 && lambda.is_finite()) {
            return Err(FemError::Material {
                what: "the Lamé constant lambda",
                value: lambda,
                rule: "3 lambda + 2 mu must be positive and finite",
            });
        }
        let mut matrix = [[0.0; 6]; 6];
        for i in 0..3 {
            for j in 0..3 {
                matrix[i][j] = lambda;
            }
            matrix[i][i] = lambda + 2.0 * mu;
            matrix[i + 3][i + 3] = mu;
        }
        Ok(Self { matrix })
    }

    /// A general elasticity tensor, σ_ij = c_ijkl ε_kl. Symmetry is required to 1e-12 of the largest entry.
    ///
    /// # Errors
    /// Entries that are not finite, c_ijkl ≠ c_jikl, c_ijlk or c_klij, a tensor that is not positive definite.
    pub fn tensor(c: &[[[[f64; 3]; 3]; 3]; 3]) -> Result<Self, FemError> {
        let indices = || (0..81).map(|m| [m / 27, m / 9 % 3, m / 3 % 3, m % 3]);
        let at = |[i, j, k, l]: [usize; 4]| c[i][j][k][l];
        let mut largest = 0.0f64;
        for index in indices() {
            if !at(index).is_finite() {
                return Err(FemError::Material {
                    what: "an entry of the elasticity tensor",
                    value: at(index),
                    rule: "it must be finite",
                });
            }
            largest = largest.max(at(index).abs());
        }
        for index in indices() {
            let [i, j, k, l] = index;
            for other in [[j, i, k, l], [i, j, l, k], [k, l, i, j]] {
                if (at(index) - at(other)).abs() > 1e-12 * largest {
                    return Err(FemError::TensorSymmetry {
                        indices: index,
                        other,
                        first: at(index),
                        second: at(other),
                    });
                }
            }
        }
        let mut matrix = [[0.0; 6]; 6];
        for (row, [i, j]) in matrix.iter_mut().zip(VOIGT) {
            for (entry, [k, l]) in row.iter_mut().zip(VOIGT) {
                *entry = 0.5 * (c[i][j][k][l] + c[k][l][i][j]);
            }
        }
        let mut work = matrix;
        for pivot in 0..6 {
            let value = work[pivot][pivot];
            if value <= 1e-14 * largest {
                return Err(FemError::TensorDefinite { pivot, value });
            }
            for i in pivot + 1..6 {
                let factor = work[i][pivot] / value;
                for j in pivot..6 {
                    work[i][j] -= factor * work[pivot][j];
                }
            }
        }
        Ok(Self { matrix })
    }

    /// All components c_ijkl.
    #[must_use]
    pub fn components(&self) -> [[[[f64; 3]; 3]; 3]; 3] {
        let place = |i: usize, j: usize| match (i.min(j), i.max(j)) {
            (0, 1) => 3,
            (1, 2) => 4,
            (0, 2) => 5,
            (i, _) => i,
        };
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                std::array::from_fn(|k| std::array::from_fn(|l| self.matrix[place(i, j)][place(k, l)]))
            })
        })
    }

    /// A constant c_ijkl that makes a ring twist under strains in its plane of revolution: none may differ from 0 where u₃ = 0 is assumed.
    pub(super) fn twisting(&self) -> Option<f64> {
        let mixed = self.matrix[..4].iter().flat_map(|row| &row[4..]);
        mixed.copied().find(|c| *c != 0.0)
    }

    /// The derivative of the tensor in a constant, in plane stress that of its reduced one.
    pub(super) fn derivative(
        &self,
        constant: MaterialConstant,
        is_plane_stress: bool,
    ) -> Result<[[f64; 6]; 6], FemError> {
        let (lambda, mu) = (self.matrix[0][1], self.matrix[3][3]);
        // Entries of isotropic materials are rounded alike.
        if Self::lame(lambda, mu).as_ref() != Ok(self) {
            return Err(FemError::Material {
                what: "the shear modulus c_1212",
                value: mu,
                rule: "derivatives in E and Poisson's ratio are those of isotropic materials",
            });
        }
        let poisson = 0.5 * lambda / (lambda + mu);
        let young = 2.0 * mu * (1.0 + poisson);
        let reduced = match is_plane_stress {
            true => lambda * 2.0 * mu / (lambda + 2.0 * mu),
            false => lambda,
        };
        let [lambda, mu] = match constant {
            MaterialConstant::Young => [reduced / young, mu / young],
            MaterialConstant::Poisson => {
                let shear = -mu / (1.0 + poisson);
                let square = |v: f64| v * v;
                let bulk = match is_plane_stress {
                    true => young * (1.0 + square(poisson)) / square(1.0 - square(poisson)),
                    false => {
                        young * (1.0 + 2.0 * square(poisson))
                            / square((1.0 + poisson) * (1.0 - 2.0 * poisson))
                    }
                };
                [bulk, shear]
            }
        };
        let mut matrix = [[0.0; 6]; 6];
        for i in 0..3 {
            matrix[i][..3].fill(lambda);
            matrix[i][i] += 2.0 * mu;
            matrix[i + 3][i + 3] = mu;
        }
        Ok(matrix)
    }

    /// Stress from strain in space.
    pub(super) fn solid(&self) -> [[f64; 6]; 6] {
        self.matrix
    }

    /// Stress (11, 22, 12) from strain in the plane.
    pub(super) fn plane(&self, model: PlaneModel) -> [[f64; 3]; 3] {
        let mut c = self.matrix;
        if model == PlaneModel::Stress {
            // Out-of-plane stresses vanish: their strains are eliminated.
            for pivot in [2, 4, 5] {
                for i in 0..6 {
                    if i == pivot {
                        continue;
                    }
                    let factor = c[i][pivot] / c[pivot][pivot];
                    for j in 0..6 {
                        c[i][j] -= factor * c[pivot][j];
                    }
                }
            }
        }
        std::array::from_fn(|a| std::array::from_fn(|b| 0.5 * (c[KEPT[a]][KEPT[b]] + c[KEPT[b]][KEPT[a]])))
    }
}
