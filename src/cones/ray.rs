//! Proofs that nothing solves.

use std::ops::ControlFlow;

use super::run::Run;
use super::{Cone, ConeError, ConeIteration, ConeOptions, ConeProblem, ConeRay};
use crate::clock::Deadline;
use crate::complementarity::{AffineFunction, McpFunction};
use crate::sparse::{Matrix, dot, max_abs, norm};

/// Parts of the largest component of a direction below which other ones are dropped in turn.
const SMALL: [f64; 4] = [0.0, 1e-6, 1e-4, 1e-2];
/// Least radius of a certificate, relative to the x at which the terms of M x + q are alike.
const RADIUS: f64 = 1e12;

/// The certificate of least norm, if there is one: minimise ½‖v‖² over v ∈ K, −Mᵀv ∈ K*, qᵀv = −1.
pub(super) fn ray(
    problem: &ConeProblem<&dyn McpFunction>,
    options: &ConeOptions,
    deadline: Deadline<'static>,
    x: &[f64],
) -> Result<Option<ConeRay>, ConeError> {
    let n = x.len();
    let f = problem.function();
    let mut matrix = Matrix::zeros(f.pattern());
    f.jacobian(x, &mut matrix);
    let mut q = vec![0.0; n];
    f.value(&vec![0.0; n], &mut q);
    let size = max_abs(&q);
    if size == 0.0 {
        return Ok(None);
    }
    // Conditions in (v, y, τ): v + M y + q τ ∈ K*, −Mᵀv ∈ K* and y ∈ K, −qᵀv − 1 = 0; where x is free, y is and Mᵀv = 0.
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 1.0)).collect();
    let unit = matrix.values().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let unit = if unit > 0.0 { unit } else { 1.0 };
    for (i, j, v) in matrix.triplets() {
        entries.push((i, n + j, v / unit));
        entries.push((n + j, i, -v / unit));
    }
    for (i, q) in q.iter().enumerate() {
        entries.push((i, 2 * n, q / size));
        entries.push((2 * n, i, -q / size));
    }
    let mut right = vec![0.0; 2 * n + 1];
    right[2 * n] = -1.0;
    let conditions = AffineFunction::new(Matrix::from_triplets(2 * n + 1, 2 * n + 1, &entries)?, right);
    let Ok(conditions) = conditions else {
        return Ok(None);
    };
    let cones = problem.cones().iter().chain(problem.cones()).copied();
    let cones = cones.chain([Cone::Free(1)]).collect();
    let dual = ConeProblem::new(&conditions as &dyn McpFunction, cones)?;
    let mut z = vec![0.0; 2 * n + 1];
    let mut silent = |_: &ConeIteration| ControlFlow::Continue(());
    let options = options.clone().with_restarts(0);
    let mut run = Run::new(&dual, &options, deadline, &mut silent)?;
    run.all_starts(&z)?;
    z.copy_from_slice(&run.best);
    // Where the conditions hold in the limit only, small components may be what is left of the way there.
    let mut best: Option<ConeRay> = None;
    for candidate in [&z[..n], x] {
        for rounding in SMALL {
            let largest = max_abs(candidate);
            let rounded = candidate
                .iter()
                .map(|v| if v.abs() <= rounding * largest { 0.0 } else { *v });
            let found = certificate(problem, &matrix, &q, rounded.collect())?;
            if let Some(found) = found
                && best.as_ref().is_none_or(|b| found.radius > b.radius)
            {
                best = Some(found);
            }
        }
    }
    // The size of x at which the constant is a term like the others.
    let typical = size / unit;
    Ok(best.filter(|ray| ray.radius > RADIUS * typical))
}

/// What v proves, scaled to qᵀv = −1.
fn certificate(
    problem: &ConeProblem<&dyn McpFunction>,
    matrix: &Matrix,
    q: &[f64],
    mut v: Vec<f64>,
) -> Result<Option<ConeRay>, ConeError> {
    problem.project(&mut v)?;
    let value = dot(q, &v);
    if value >= 0.0 || value.is_nan() {
        return Ok(None);
    }
    v.iter_mut().for_each(|v| *v /= -value);
    // −Mᵀv less its part in K*.
    let mut rest = vec![0.0; v.len()];
    matrix.as_ref().mul_transpose_add(-1.0, &v, &mut rest);
    for (cone, range) in problem.blocks() {
        let block = &mut rest[range];
        let mut inside = block.to_vec();
        cone.project_dual(&mut inside);
        block.iter_mut().zip(&inside).for_each(|(r, p)| *r -= p);
    }
    let (value, left) = (dot(q, &v), norm(&rest));
    Ok(Some(ConeRay {
        direction: v,
        value,
        radius: if left == 0.0 { f64::INFINITY } else { -value / left },
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// F(x) = δ x − 1 ≥ 0 ⟂ x ≥ 0 has the solution 1/δ, however small δ > 0 is, and none for δ ≤ 0.
    #[test]
    fn what_has_a_solution_far_out_is_not_refuted() {
        for (slope, solvable) in [
            (1.0, true),
            (1e-9, true),
            (1e-15, true),
            (0.0, false),
            (-1.0, false),
        ] {
            let matrix = Matrix::from_rows(&[[slope]]).unwrap();
            let function = AffineFunction::new(matrix, vec![-1.0]).unwrap();
            let problem =
                ConeProblem::new(&function as &dyn McpFunction, vec![Cone::Nonnegative(1)]).unwrap();
            let found = ray(&problem, &ConeOptions::default(), Deadline::after(None), &[1.0]).unwrap();
            assert_eq!(found.is_none(), solvable, "{slope}");
        }
    }
}
