//! Constants that bound the fixed-point map Ψ of the friction problem, and consequences for uniqueness (Haslinger, Kučera, Vlach 2008).

use crate::contact::law::NodeLaw;
use crate::contact::{CondensedContact, ContactError};
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver, eigenvalues, symmetric_eigenvalues};
use crate::piecewise::Selection;
use crate::sparse::{Matrix, Pattern};

/// Constants of a discretised body with lumped multipliers. With mᵢ the area of node i, W = C the compliance and M the areas:
///
/// ```text
/// c_inv² = λmax(M, Bν A₀⁻¹ Bνᵀ in densities),  A₀: v_t = 0 on Γc     ‖μ‖_L² ≤ c_inv sup_v (μ, v_ν)/‖v‖_A
/// c_t²   = λmax(M^½ W_tt M^½)                                        ‖v_t‖_L² ≤ c_t ‖v‖_A
/// c_∞²   = maxᵢ λmax(W_tt,ii)                                        max |v_t| ≤ c_∞ ‖v‖_A
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UniquenessConstants {
    /// Constant of the inverse inequality for the multipliers, (force/length)^½ per area^½ in the caller's units.
    pub c_inv: f64,
    /// Constant of the trace in L².
    pub c_t: f64,
    /// Constant of the trace in L^∞.
    pub c_inf: f64,
}

impl UniquenessConstants {
    /// The constants of a condensed body; `areas` are the lumped areas (lengths in the plane) of its contact nodes.
    ///
    /// # Complexity
    /// Dense: O(q³) operations for q pressures and tractions.
    ///
    /// # Errors
    /// Wrong lengths, areas that are not positive, a singular compliance.
    pub fn new<L: NodeLaw>(problem: &CondensedContact<L>, areas: &[f64]) -> Result<Self, ContactError> {
        let p = problem.num_contacts();
        check_vector("the areas of the contact nodes", areas, p)?;
        check_areas(areas)?;
        problem.check_supported()?;
        let c = problem.compliance();
        let q = c.nrows();
        // (W⁻¹)_νν is the inverse of the compliance under v_t = 0.
        let mut solver = AutoSolver::default();
        solver.analyze(c.pattern().as_ref())?;
        solver.factor(c.as_ref())?;
        let mut normal = Matrix::zeros(Pattern::full(p, p));
        let mut column = vec![0.0; q];
        for j in 0..p {
            column.fill(0.0);
            column[j] = 1.0;
            solver.solve_in_place(&mut column)?;
            for i in 0..p {
                normal.values_mut()[j * p + i] = column[i] / (areas[i] * areas[j]).sqrt();
            }
        }
        let t = q - p;
        let mut tangential = Matrix::zeros(Pattern::full(t, t));
        for j in 0..t {
            for i in 0..t {
                tangential.values_mut()[j * t + i] =
                    c.values()[(p + j) * q + p + i] * (areas[i % p] * areas[j % p]).sqrt();
            }
        }
        let largest = |m: &Matrix| -> Result<f64, LinearError> {
            Ok(symmetric_eigenvalues(m)?.last().copied().unwrap_or(0.0))
        };
        let mut c_inf = 0.0f64;
        for i in 0..p {
            let at = |d: usize, e: usize| c.values()[((e + 1) * p + i) * q + (d + 1) * p + i];
            c_inf = c_inf.max(if t == p {
                at(0, 0)
            } else {
                let (mean, half) = (0.5 * (at(0, 0) + at(1, 1)), 0.5 * (at(0, 0) - at(1, 1)));
                mean + half.hypot(at(0, 1))
            });
        }
        Ok(Self {
            c_inv: largest(&normal)?.sqrt(),
            c_t: largest(&tangential)?.sqrt(),
            c_inf: c_inf.sqrt(),
        })
    }

    /// C₁ / F_max = c_t c_inv: Lipschitz constant of g ↦ λν, the part due to the size of F. ∼ H^(−1/2).
    #[must_use]
    pub fn c1(&self) -> f64 {
        self.c_t * self.c_inv
    }

    /// C₂ / (L κ ‖g‖) = c_∞ c_inv: Lipschitz constant of φ ↦ λν, the part due to the slope L of F. ∼ (H h)^(−1/2).
    #[must_use]
    pub fn c2(&self) -> f64 {
        self.c_inf * self.c_inv
    }

    /// C₂ / (L κ ‖g‖) including the change of φ′ = ‖u_t‖ with φ: c_∞ (c_inv + c_t), as ‖φ′ − φ̄′‖ ≤ c_t ‖u − ū‖_A.
    #[must_use]
    pub fn c2_with_slip(&self) -> f64 {
        self.c_inf * (self.c_inv + self.c_t)
    }

    /// Below this coefficient (independent of the slip) the solution is unique and Ψ contracts.
    #[must_use]
    pub fn guaranteed_friction(&self) -> f64 {
        1.0 / self.c1()
    }

    /// The Lipschitz constant of Ψ for a law with F ≤ `friction`, slope |F′| ≤ `slope` and anisotropy `kappa`, in the ball ‖g‖_L² ≤
    /// `pressure` ([`pressure_norm`]).
    #[must_use]
    pub fn lipschitz(&self, friction: f64, slope: f64, kappa: f64, pressure: f64) -> FixedPointBound {
        let (a, b) = (slope * kappa * pressure * self.c_inf, friction * self.c_t);
        // Where F does not depend on φ, a change of φ′ has no effect on Ψ.
        let moved = self.c_inv + if a > 0.0 { self.c_t } else { 0.0 };
        FixedPointBound {
            c1: b * moved,
            c2: a * (self.c_inv + self.c_t),
            rate: a * self.c_t + b * self.c_inv,
        }
    }

    /// L_crit = 1/(κ ‖g‖ c_∞ (c_inv + c_t)): C₂ < 1 for laws of a smaller slope, in the ball ‖g‖_L² ≤ `pressure`. Infinite
    /// without pressure.
    #[must_use]
    pub fn critical_slope(&self, kappa: f64, pressure: f64) -> f64 {
        1.0 / (kappa * pressure * self.c2_with_slip())
    }
}

/// Bounds of ‖Ψ(φ, g) − Ψ(φ̄, ḡ)‖ ≤ C ‖(φ, g) − (φ̄, ḡ)‖ in the norm ‖φ‖_L² + ‖g‖_L².
///
/// With a = L κ ‖g‖ c_∞ and b = F_max c_t: ‖u − ū‖_A ≤ a ‖φ − φ̄‖ + b ‖g − ḡ‖, and this moves λν by c_inv times as much and φ′ by c_t times
/// as much. The sum of the two norms has the units of neither; [`rate`](Self::rate) is free of them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FixedPointBound {
    /// C₁ = b (c_inv + c_t); b c_inv where L = 0.
    pub c1: f64,
    /// C₂ = a (c_inv + c_t).
    pub c2: f64,
    /// a c_t + b c_inv, the spectral radius of the 2 × 2 matrix of the four parts: the least Lipschitz constant over all weights of the two
    /// norms. Below 1, Ψ contracts in the ball.
    pub rate: f64,
}

impl FixedPointBound {
    /// C = max{C₁, C₂}.
    #[must_use]
    pub fn c(&self) -> f64 {
        self.c1.max(self.c2)
    }
}

/// ‖g‖_L² of nodal forces (those of λν in a solution, say) on lumped areas m: √(Σ gᵢ²/mᵢ).
///
/// # Errors
/// Lengths that differ, values that are not finite, areas that are not positive.
pub fn pressure_norm(areas: &[f64], forces: &[f64]) -> Result<f64, ContactError> {
    check_vector("the nodal forces", forces, areas.len())?;
    check_areas(areas)?;
    let pairs = areas.iter().zip(forces);
    Ok(pairs.map(|(m, g)| g * g / m).sum::<f64>().sqrt())
}

fn check_areas(areas: &[f64]) -> Result<(), ContactError> {
    check_vector("the areas of the contact nodes", areas, areas.len())?;
    let Some(node) = areas.iter().position(|a| *a <= 0.0) else {
        return Ok(());
    };
    Err(ContactError::Invalid {
        what: format!(
            "the area of contact node {node} is {}; it must be positive",
            areas[node]
        ),
    })
}

/// ∂H^(σ)/∂𝓕 at a solution x, one column a contact node: the derivative with respect to the coefficients of friction of all nodes, where a
/// constant is added to F(‖u_t‖) at each. Slipping nodes have −λt/F in their tangential rows, all others 0.
///
/// With it a [certificate](crate::continuation::certify_with) gives the constant of the solution as a function of 𝓕. By a theorem of
/// Haslinger, Janovský and Ligurský a solution that is locally a Lipschitz function of the load is one of 𝓕, too, where 𝓕 > 0: the
/// matrices to be inverted are the same.
///
/// # Errors
/// Wrong lengths; laws that are not Coulomb's; coefficients that are not positive or differ in the two directions.
pub fn friction_derivative<L: NodeLaw>(
    problem: &CondensedContact<L>,
    selection: &Selection,
    x: &[f64],
) -> Result<Matrix, ContactError> {
    if !problem.node_law().is_coulomb() {
        return Err(ContactError::NotCoulomb);
    }
    let p = problem.num_contacts();
    let tangents = problem.body().num_tangents();
    if selection.len() != p {
        return Err(ContactError::Invalid {
            what: format!("a selection of {} sites; the problem has {p}", selection.len()),
        });
    }
    let mut entries = Vec::new();
    for (i, v) in problem.solution(x)?.nodes.iter().enumerate() {
        problem.node_law().check(v)?;
        let f = problem.node_law().friction(v);
        if f[0] <= 0.0 || (tangents == 2 && f[0] != f[1]) {
            return Err(ContactError::Invalid {
                what: format!("F = {f:?} at node {i}; it must be positive and the same in all directions"),
            });
        }
        if problem.node_law().state(selection.piece(i), v).is_slip() {
            entries.extend((0..tangents).map(|d| ((d + 1) * p + i, i, -v.traction[d] / f[0])));
        }
    }
    Ok(Matrix::from_triplets((tangents + 1) * p, p, &entries)?)
}

/// κ(F) = sup max(F₁, F₂)/min(F₁, F₂) and L = max |∂F_k/∂ξ| of the law over slips in [0, `largest_slip`] at all nodes, by sampling
/// (`samples` slips a node; L from differences).
///
/// # Errors
/// Coefficients that are negative or not finite, fewer than two samples, a slip that is not positive.
pub fn friction_bounds<L: NodeLaw>(
    problem: &CondensedContact<L>,
    alpha: f64,
    largest_slip: f64,
    samples: usize,
) -> Result<(f64, f64), ContactError> {
    if samples < 2 || !(largest_slip > 0.0 && largest_slip.is_finite()) {
        return Err(ContactError::Invalid {
            what: format!(
                "{samples} samples up to slip {largest_slip}: at least two, up to a positive slip, are needed"
            ),
        });
    }
    let (mut kappa, mut slope) = (1.0f64, 0.0f64);
    let step = largest_slip / (samples - 1) as f64;
    for node in 0..problem.num_contacts() {
        let mut last: Option<[f64; 2]> = None;
        for k in 0..samples {
            let v = crate::contact::LocalValues {
                node,
                slip: [step * k as f64, 0.0],
                parameter: alpha,
                ..crate::contact::LocalValues::default()
            };
            problem.node_law().check(&v)?;
            let f = problem.node_law().friction(&v);
            kappa = kappa.max(f[0].max(f[1]) / f[0].min(f[1]));
            if let Some(before) = last {
                for d in 0..2 {
                    slope = slope.max((f[d] - before[d]).abs() / step);
                }
            }
            last = Some(f);
        }
    }
    Ok((kappa, slope))
}

/// The smallest coefficient F for which the pattern "all nodes in contact, slipping to one side" (constant F, plane) is singular: the
/// smallest |1/μ| over the real eigenvalues μ of W_νν⁻¹ W_νt. `None` if there is none. Below it no branch of solutions folds on this
/// pattern.
///
/// # Complexity
/// Dense: O(p³) operations for p contact nodes.
///
/// # Errors
/// A body in space, a singular compliance.
pub fn critical_friction<L: NodeLaw>(problem: &CondensedContact<L>) -> Result<Option<f64>, ContactError> {
    if problem.body().num_tangents() != 1 {
        return Err(ContactError::Tangents {
            law: 1,
            body: problem.body().num_tangents(),
        });
    }
    problem.check_supported()?;
    let p = problem.num_contacts();
    let c = problem.compliance();
    let block = |first: usize| {
        let mut m = Matrix::zeros(Pattern::full(p, p));
        for j in 0..p {
            for i in 0..p {
                m.values_mut()[j * p + i] = c.values()[(first + j) * 2 * p + i];
            }
        }
        m
    };
    let normal = block(0);
    let mut mixed = block(p);
    let mut solver = AutoSolver::default();
    solver.analyze(normal.pattern().as_ref())?;
    solver.factor(normal.as_ref())?;
    for column in mixed.values_mut().chunks_exact_mut(p) {
        solver.solve_in_place(column)?;
    }
    let real = eigenvalues(&mixed)?
        .into_iter()
        .filter(|(re, im)| im.abs() <= 1e-10 * re.abs());
    Ok(real
        .map(|(re, _)| 1.0 / re.abs())
        .filter(|f| f.is_finite())
        .min_by(f64::total_cmp))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{ContactBody, FrictionCoefficient, FrictionCurve, LoadPath, PlanarCoulomb};

    /// Two nodes with the stiffness [[4 I, −K], [−Kᵀ, I]], whose compliance is, for K Kᵀ = c I, proportional to [[I, K], [Kᵀ, 4 I]].
    fn critical(k: [[f64; 2]; 2]) -> Option<f64> {
        let mut rows = [
            [4.0, 0.0, 0.0, 0.0],
            [0.0, 4.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        for i in 0..2 {
            for j in 0..2 {
                rows[i][2 + j] = -k[i][j];
                rows[2 + j][i] = -k[i][j];
            }
        }
        let a = Matrix::from_rows(&rows).unwrap();
        let normal = Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]).unwrap();
        let tangential = Matrix::from_rows(&[[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]).unwrap();
        let body = ContactBody::new(a, normal, vec![tangential], LoadPath::constant(vec![0.0; 4])).unwrap();
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(
            FrictionCurve::constant(0.1).unwrap(),
        ));
        critical_friction(&CondensedContact::new(body, law).unwrap()).unwrap()
    }

    /// C_νν − F C_νt is singular for the real eigenvalues 1/F of C_νν⁻¹ C_νt = K alone: a rotation has none.
    #[test]
    fn only_real_eigenvalues_are_critical() {
        assert!((critical([[0.8, 0.0], [0.0, -0.8]]).unwrap() - 1.25).abs() < 1e-13);
        assert!((critical([[0.0, 1.6], [1.6, 0.0]]).unwrap() - 0.625).abs() < 1e-13);
        assert_eq!(critical([[0.0, 1.0], [-1.0, 0.0]]), None);
        assert_eq!(critical([[1.0, 1.0], [-1.0, 1.0]]), None);
    }
}
