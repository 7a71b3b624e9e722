//! Singular points of a selection: whether ∇H^(σ) is singular there, and which curves pass through them.

use super::search::{ArmSearch, RANK};
use super::units::{Units, changes, row_sizes};
use crate::continuation::event::branch_point::BranchSystem;
use crate::linear::{LinearSolver, null_space};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Scaled, ScaledMap, Selection};
use crate::sparse::{Matrix, dot, max_abs, norm};
use crate::spread::centred;

/// Largest number of residuals whose kernels are found by singular values; beyond, next to simple branch points only.
pub(super) const MAX_BRANCHING: usize = 600;

/// Directions of curves through a point or, where they are undecided, a basis of the kernel, if that is known.
pub(super) type Directions = Result<Vec<Vec<f64>>, Vec<Vec<f64>>>;

impl<'a, P: PiecewiseSmooth + ?Sized, L: LinearSolver> ArmSearch<'a, P, L> {
    /// Whether ∇H^(σ) is singular within rounding of x, both in the units of the unknowns and equilibrated: bad scaling alone makes the
    /// least singular value small.
    pub(in crate::continuation) fn is_singular(
        &mut self,
        selection: &Selection,
    ) -> Result<bool, PiecewiseError> {
        self.is_nearly_singular(selection, RANK)
    }

    /// [`is_singular`](Self::is_singular) up to a relative singular value.
    pub(in crate::continuation) fn is_nearly_singular(
        &mut self,
        selection: &Selection,
        bound: f64,
    ) -> Result<bool, PiecewiseError> {
        if self.least_value_at(self.map, self.x, selection)? > bound {
            return Ok(false);
        }
        let (map, z) = self.in_own_units(selection)?;
        Ok(map.divisors().is_empty() || self.least_value_at(&map, &z, selection)? <= bound)
    }

    fn least_value_at<M: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &M,
        x: &[f64],
        selection: &Selection,
    ) -> Result<f64, PiecewiseError> {
        let (sizes, _) = self.row_sizes(map, x, selection)?;
        self.corrector.least_singular_value(map, selection, x, &sizes)
    }

    /// The map in the units of ∇H^(σ), and x in these units.
    fn in_own_units(&self, selection: &Selection) -> Result<(Scaled<&'a P>, Vec<f64>), PiecewiseError> {
        let units = Units::new(self.map, selection, self.x).divisors();
        let map = Scaled::with_divisors(self.map, units)?;
        let mut z = self.x.to_vec();
        map.scale(&mut z);
        Ok((map, z))
    }

    /// The largest entry of each row of ∇H^(σ), or its change over the distance 1 + ‖x‖: at branch points
    /// rows may vanish up to rounding; and ∇H^(σ).
    fn row_sizes<M: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &M,
        x: &[f64],
        selection: &Selection,
    ) -> Result<(Vec<f64>, Matrix), PiecewiseError> {
        const NEAR: f64 = 1e-4;
        let mut jacobian_at = |s: f64| {
            let moved: Vec<f64> = (x.iter().enumerate())
                .map(|(j, x)| x + s * centred(j + 1, false))
                .collect();
            let jac = self.corrector.jacobian_at(&map, selection, &moved)?;
            Ok::<_, PiecewiseError>(jac.clone())
        };
        let distance = NEAR * (1.0 + norm(x));
        let (ahead, behind, here) = (jacobian_at(distance)?, jacobian_at(-distance)?, jacobian_at(0.0)?);
        let sizes = row_sizes(&changes(&here, [&ahead, &behind], 0.5 / NEAR));
        Ok((sizes, here))
    }

    /// The directions of the curves through a point where ∇H^(σ) is singular; `Err` where they are not decided, with the kernel unless
    /// the problem is too large for it. What is undecided in the units of the unknowns is tried in those of ∇H^(σ), too.
    pub(super) fn branching_directions(
        &mut self,
        selection: &Selection,
    ) -> Result<Directions, PiecewiseError> {
        if self.map.num_residuals() > MAX_BRANCHING {
            return self.directions_next_to_simple_points(selection);
        }
        self.decomposed = true;
        let found = self.directions_at(self.map, self.x, selection)?;
        let Err(kernel) = &found else {
            return Ok(found);
        };
        let (map, z) = self.in_own_units(selection)?;
        if map.divisors().is_empty() {
            return Ok(found);
        }
        match self.directions_at(&map, &z, selection)? {
            Ok(mut directions) => {
                directions.iter_mut().for_each(|d| map.unscale_direction(d));
                Ok(Ok(directions))
            }
            Err(mut own) if own.len() < kernel.len() => {
                own.iter_mut().for_each(|d| map.unscale_direction(d));
                Ok(Err(own))
            }
            Err(_) => Ok(found),
        }
    }

    fn directions_next_to_simple_points(
        &mut self,
        selection: &Selection,
    ) -> Result<Directions, PiecewiseError> {
        let away = 0.01 * (1.0 + norm(self.x));
        let from = self.x.iter().enumerate();
        let from: Vec<f64> = from.map(|(j, x)| x + away * centred(j + 1, false)).collect();
        let kernels = BranchSystem::new(self.map, selection, &from, self.x).kernels(self.x)?;
        let jac = self.corrector.jacobian_at(&self.map, selection, self.x)?;
        let Some(k) = kernels else {
            return Ok(Err(Vec::new()));
        };
        let scale = max_abs(jac.values());
        Ok(branching_equation(
            self.map,
            self.x,
            selection,
            (k.right.as_slice(), &k.left),
            scale,
        ))
    }

    fn directions_at<M: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &M,
        x: &[f64],
        selection: &Selection,
    ) -> Result<Directions, PiecewiseError> {
        let (sizes, mut jac) = self.row_sizes(map, x, selection)?;
        let factors: Vec<f64> = jac.triplets().map(|(i, ..)| sizes[i].recip()).collect();
        let values = jac.values_mut().iter_mut();
        values.zip(factors).for_each(|(v, f)| *v *= f);
        let largest = max_abs(jac.values()).max(f64::MIN_POSITIVE);
        let mut kernel = null_space(&jac, (RANK / largest).clamp(RANK, 1.0))?;
        for psi in &mut kernel.left {
            psi.iter_mut().zip(&sizes).for_each(|(w, size)| *w /= size);
        }
        Ok(match (kernel.right.as_slice(), kernel.left.as_slice()) {
            ([tangent], []) => Ok(vec![tangent.clone()]),
            (right @ [_, _], [psi]) => branching_equation(map, x, selection, (right, psi), 1.0),
            (right, _) => Err(right.to_vec()),
        })
    }
}

/// Where the kernel of ∇H^(σ) is spanned by n₁ and n₂ and that of its transpose by ψ: the roots of Σ
/// ψᵀH''(nᵢ, nⱼ) aᵢ aⱼ = 0 (Keller 1977).
fn branching_equation<M: PiecewiseSmooth + ?Sized>(
    map: &M,
    x: &[f64],
    selection: &Selection,
    (right, psi): (&[Vec<f64>], &[f64]),
    scale: f64,
) -> Directions {
    let [n1, n2] = right else {
        return Err(right.to_vec());
    };
    let mut shifted = Matrix::zeros(map.pattern());
    let mut second = |a: &[f64], b: &[f64]| second_derivative(map, selection, x, a, b, psi, &mut shifted);
    let (b11, b12, b22) = (second(n1, n1), second(n1, n2), second(n2, n2));
    let size = b11.abs().max(b12.abs()).max(b22.abs());
    let discriminant = b12 * b12 - b11 * b22;
    if size <= 1e-7 * scale.max(f64::MIN_POSITIVE) || discriminant.abs() <= 1e-7 * size * size {
        return Err(right.to_vec());
    }
    if discriminant < 0.0 {
        return Ok(Vec::new());
    }
    let root = discriminant.sqrt();
    // The root without cancellation gives the other one; q ≠ 0 as the discriminant is positive.
    let q = -(b12 + b12.signum() * root);
    let pairs = [(q, b11), (b22, q)];
    let combine = |(a, b): (f64, f64)| -> Vec<f64> {
        let v: Vec<f64> = n1.iter().zip(n2).map(|(x, y)| a * x + b * y).collect();
        let length = norm(&v);
        v.into_iter().map(|c| c / length).collect()
    };
    Ok(pairs.into_iter().map(combine).collect())
}

/// ψᵀ H^(σ)''(x)(a, b) by central differences, of fourth order, of the Jacobian along a.
fn second_derivative<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    selection: &Selection,
    x: &[f64],
    a: &[f64],
    b: &[f64],
    psi: &[f64],
    jac: &mut Matrix,
) -> f64 {
    let h = 1e-4 * (1.0 + norm(x));
    let mut image = vec![0.0; psi.len()];
    let mut at = |s: f64| {
        let y: Vec<f64> = x.iter().zip(a).map(|(x, a)| x + s * a).collect();
        jac.clear();
        map.jacobian(selection, &y, jac);
        jac.mul_vec(b, &mut image);
        dot(psi, &image)
    };
    (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
}
