//! Proofs that there is no solution.

use std::ops::ControlFlow;

use super::central::is_monotone;
use super::equations::{Part, check_memory};
use super::homogeneous::directions;
use super::run::{Run, between};
use super::{Cone, ConeIteration, ConeOptions, ConeProblem, ConeRay};
use crate::clock::Deadline;
use crate::complementarity::{AffineFunction, ComplementarityError, McpFunction};
use crate::exact::Exact;
use crate::sparse::{Matrix, dot, max_abs, norm};
use crate::tolerances::RADIUS;

/// Parts of the largest component of a direction below which other ones are dropped in turn.
const SMALL: [f64; 4] = [0.0, 1e-6, 1e-4, 1e-2];

/// How a certificate is sought.
pub(super) struct Search<'a> {
    pub(super) options: &'a ConeOptions,
    pub(super) deadline: Deadline<'static>,
    pub(super) observe: &'a mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    /// Among those of monotone problems that lie as far inside as they can only: they take a few steps.
    pub(super) inner_only: bool,
}

/// A proof from one of the blocks (unknowns connected by entries of M): it depends neither on the other blocks nor on their units.
pub(super) fn ray(
    problem: &ConeProblem<&dyn McpFunction>,
    search: &mut Search<'_>,
    (parts, block): (&[Part], &[usize]),
    x: &[f64],
) -> Result<Option<ConeRay>, ComplementarityError> {
    let (matrix, q) = coefficients(problem, x);
    let mut members = vec![Vec::new(); parts.len()];
    let (mut place, mut owner) = (vec![0; x.len()], vec![0; x.len()]);
    let mut blocks = vec![Vec::new(); parts.len()];
    for (part, &b) in parts.iter().zip(block) {
        blocks[b].push(part.cone);
        for i in part.range.clone() {
            (place[i], owner[i]) = (members[b].len(), b);
            members[b].push(i);
        }
    }
    let mut entries = vec![Vec::new(); parts.len()];
    for (i, j, v) in matrix.triplets().filter(|e| owner[e.0] == owner[e.1]) {
        entries[owner[i]].push((place[i], place[j], v));
    }
    for ((cones, members), entries) in blocks.into_iter().zip(&members).zip(&entries) {
        let n = members.len();
        let part_of = |v: &[f64]| members.iter().map(|&i| v[i]).collect::<Vec<_>>();
        if n == 0 {
            continue;
        }
        let function = AffineFunction::new(Matrix::from_triplets(n, n, entries)?, part_of(&q));
        let Ok(function) = function else {
            return Ok(None);
        };
        let alone = ConeProblem::new(&function as &dyn McpFunction, cones)?;
        if let Some(mut found) = ray_of_block(&alone, search, &part_of(x))? {
            let mut direction = vec![0.0; x.len()];
            members
                .iter()
                .zip(&found.direction)
                .for_each(|(&i, v)| direction[i] = *v);
            found.direction = direction;
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// M and q of an affine F.
pub(super) fn coefficients(problem: &ConeProblem<&dyn McpFunction>, x: &[f64]) -> (Matrix, Vec<f64>) {
    let (f, mut q) = (problem.function(), vec![0.0; x.len()]);
    let mut matrix = Matrix::zeros(f.pattern());
    f.jacobian(x, &mut matrix);
    f.value(&vec![0.0; x.len()], &mut q);
    (matrix, q)
}

/// A certificate found in units of the cones, for the problem itself. Its radius is at least the one found there, times the smallest unit.
pub(super) fn ray_out_of_units(
    problem: &ConeProblem<&dyn McpFunction>,
    (matrix, q): (&Matrix, &[f64]),
    ray: ConeRay,
    (rows, columns): (&[f64], &[f64]),
) -> Result<Option<ConeRay>, ComplementarityError> {
    let direction = ray.direction.iter().zip(rows).map(|(v, r)| v * r).collect();
    let Some(mut found) = certificate(problem, matrix, q, direction)? else {
        return Ok(None);
    };
    let least = columns.iter().fold(f64::INFINITY, |m, c| m.min(*c));
    found.radius = found.radius.max(ray.radius * least);
    Ok(Some(found))
}

/// A certificate as far inside of its cones as it can lie, if the problem is monotone, else the one of least
/// norm.
fn ray_of_block(
    problem: &ConeProblem<&dyn McpFunction>,
    search: &mut Search<'_>,
    x: &[f64],
) -> Result<Option<ConeRay>, ComplementarityError> {
    let (matrix, q) = coefficients(problem, x);
    let (unit, size) = (max_abs(matrix.values()), max_abs(&q));
    if size == 0.0 {
        return Ok(None);
    }
    let unit = if unit > 0.0 { unit } else { 1.0 };
    // Relative to the size of x at which the constant is as large as the other terms.
    let far = |ray: &ConeRay| ray.radius > RADIUS * (size / unit);
    if is_monotone(&matrix)? {
        let mut found = None;
        let scaled: Vec<f64> = q.iter().map(|q| q / size).collect();
        let mut alike = matrix.clone();
        alike.values_mut().iter_mut().for_each(|v| *v /= unit);
        let deadline = search.deadline;
        let mut proceed = || !deadline.is_over() && (search.observe)(&between(0)).is_continue();
        directions(problem, (&alike, &scaled), &mut proceed, &mut |v| {
            found = certificate(problem, &matrix, &q, v)?.filter(far);
            Ok(found.is_some())
        })?;
        if found.is_some() {
            return Ok(found);
        }
    }
    match search.inner_only {
        true => Ok(None),
        false => Ok(least_ray(problem, search, (&matrix, unit), (&q, size), x)?.filter(far)),
    }
}

/// The certificate of least norm, if there is one: minimise ½‖v‖² over v ∈ K, −Mᵀv ∈ K*, qᵀv = −1. M and q
/// come with their sizes.
fn least_ray(
    problem: &ConeProblem<&dyn McpFunction>,
    search: &mut Search<'_>,
    (matrix, unit): (&Matrix, f64),
    (q, size): (&[f64], f64),
    x: &[f64],
) -> Result<Option<ConeRay>, ComplementarityError> {
    let n = x.len();
    // Conditions in (v, y, τ): v + M y + q τ ∈ K*, −Mᵀv ∈ K* and y ∈ K, −qᵀv − 1 = 0; where x is free, y is and Mᵀv = 0.
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 1.0)).collect();
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
    if check_memory(&dual, search.options.max_memory).is_err() {
        return Ok(None);
    }
    let mut z = vec![0.0; 2 * n + 1];
    let options = search.options.clone().with_restarts(0);
    let mut run = Run::new(&dual, &options, search.deadline, search.observe)?;
    run.inner = true;
    run.all_starts(&z)?;
    z.copy_from_slice(&run.best);
    // Where the conditions hold in the limit only, small components may be remainders of the iteration.
    let mut best: Option<ConeRay> = None;
    for candidate in [&z[..n], x] {
        for rounding in SMALL {
            let largest = max_abs(candidate);
            let rounded = candidate
                .iter()
                .map(|v| if v.abs() <= rounding * largest { 0.0 } else { *v });
            let found = certificate(problem, matrix, q, rounded.collect())?;
            if let Some(found) = found
                && best.as_ref().is_none_or(|b| found.radius > b.radius)
            {
                best = Some(found);
            }
        }
    }
    Ok(best)
}

/// What v proves, scaled to qᵀv = −1: a solution x has 0 ≤ vᵀF(x) ≤ qᵀv + ‖x‖ d + δ (‖M‖ ‖x‖ + ‖q‖), where d is the distance of −Mᵀv from
/// K* and δ that of v from K, both with all rounding.
fn certificate(
    problem: &ConeProblem<&dyn McpFunction>,
    matrix: &Matrix,
    q: &[f64],
    mut v: Vec<f64>,
) -> Result<Option<ConeRay>, ComplementarityError> {
    problem.project(&mut v)?;
    let value = dot(q, &v);
    if value >= 0.0 || value.is_nan() {
        return Ok(None);
    }
    v.iter_mut().for_each(|v| *v /= -value);
    let (mut outside, mut left) = (0.0, 0.0);
    for (cone, range) in problem.blocks() {
        outside += move_inside(cone, &mut v[range]);
    }
    if v.iter().any(|v| !v.is_finite()) {
        return Ok(None);
    }
    let exact: Vec<Exact> = v.iter().map(|v| Exact::new(*v).unwrap_or_default()).collect();
    let mut image = vec![Exact::default(); v.len()];
    for (i, j, a) in matrix.triplets() {
        let term = &Exact::new(-a).unwrap_or_default() * &exact[i];
        image[j] = &image[j] + &term;
    }
    for (cone, range) in problem.blocks() {
        left += distance_from_dual(cone, &image[range]);
    }
    let sum = exact.iter().zip(q).fold(Exact::default(), |sum, (v, q)| {
        &sum + &(v * &Exact::new(*q).unwrap_or_default())
    });
    let value = sum.to_f64();
    let (gap, slope) = (-value - outside * norm(q), left + outside * norm(matrix.values()));
    Ok((gap > 0.0).then(|| ConeRay {
        direction: v,
        value,
        radius: if slope == 0.0 { f64::INFINITY } else { gap / slope },
    }))
}

/// Moves a projection into its cone, if rounding left it outside; returns a bound of the distance where that may not succeed.
fn move_inside(cone: Cone, v: &mut [f64]) -> f64 {
    match cone {
        Cone::Nonnegative(_) | Cone::Free(_) => 0.0,
        Cone::SecondOrder(_) => {
            let inside = |v: &[f64]| is_inside(&v.iter().filter_map(|v| Exact::new(*v)).collect::<Vec<_>>());
            if !inside(v) {
                v[0] = norm(&v[1..]) * (1.0 + v.len() as f64 * f64::EPSILON);
            }
            if inside(v) { 0.0 } else { rounding(v) }
        }
        Cone::Semidefinite(_) => rounding(v),
    }
}

/// The distance from the dual cone, at most, rounding included.
fn distance_from_dual(cone: Cone, y: &[Exact]) -> f64 {
    let rounded: Vec<f64> = y.iter().map(Exact::to_f64).collect();
    let size = |i: usize| rounded[i].abs().max(f64::MIN_POSITIVE);
    let length = |parts: Vec<f64>| norm(&parts) * (1.0 + rounded.len() as f64 * f64::EPSILON);
    let among = |keep: &dyn Fn(i8) -> bool| (0..y.len()).filter(|&i| keep(y[i].sign())).map(size).collect();
    match cone {
        Cone::Free(_) => length(among(&|sign| sign != 0)),
        Cone::Nonnegative(_) => length(among(&|sign| sign < 0)),
        Cone::SecondOrder(_) if is_inside(y) => 0.0,
        Cone::Semidefinite(_) if y.iter().all(Exact::is_zero) => 0.0,
        _ => {
            let mut inside = rounded.clone();
            cone.project(&mut inside);
            let apart = rounded.iter().zip(&inside).map(|(y, p)| y - p);
            length(apart.collect()) + rounding(&rounded)
        }
    }
}

/// Whether t ≥ ‖u‖, exactly.
fn is_inside(y: &[Exact]) -> bool {
    let Some((t, u)) = y.split_first() else {
        return true;
    };
    let squares = u.iter().fold(Exact::default(), |sum, u| &sum + &(u * u));
    t.sign() >= 0 && (&(t * t) - &squares).sign() >= 0
}

/// The rounding of a projection.
fn rounding(y: &[f64]) -> f64 {
    4.0 * (1.0 + (y.len() as f64).sqrt()) * f64::EPSILON * norm(y)
}

#[cfg(test)]
mod tests {
    use super::super::svec;
    use super::*;
    use crate::spread::Random;

    /// F = (t x₁ − s x₂, −T x₁ + S x₂ − 1) with T and S what 3 t and 3 s round to: for v = (3, 1) Mᵀv is 0 in floating-point numbers, but
    /// x₁ = s / (S t − T s) = 2.4e15 is a solution.
    #[test]
    fn radii_include_rounding() {
        let (t, s) = (0.7, 0.1);
        let matrix = Matrix::from_rows(&[[t, -s], [-3.0 * t, 3.0 * s]]).unwrap();
        let q = vec![0.0, -1.0];
        let mut image = [0.0; 2];
        matrix.as_ref().mul_transpose_add(1.0, &[3.0, 1.0], &mut image);
        assert_eq!(image, [0.0, 0.0]);
        let apart = [t, s].map(|v| f64::mul_add(3.0, v, -(3.0 * v)));
        let first = s / (apart[0] * s - apart[1] * t);
        let function = AffineFunction::new(matrix.clone(), q.clone()).unwrap();
        let cones = vec![Cone::Nonnegative(2)];
        let problem = ConeProblem::new(&function as &dyn McpFunction, cones).unwrap();
        let found = certificate(&problem, &matrix, &q, vec![3.0, 1.0])
            .unwrap()
            .unwrap();
        assert!(first > 1e15 && found.radius > 1e15 && found.radius < first.hypot(first * t / s));
    }

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
            // Half-lines are cones of each kind.
            for cone in [Cone::Nonnegative(1), Cone::SecondOrder(1), Cone::Semidefinite(1)] {
                let matrix = Matrix::from_rows(&[[slope]]).unwrap();
                let function = AffineFunction::new(matrix, vec![-1.0]).unwrap();
                let problem = ConeProblem::new(&function as &dyn McpFunction, vec![cone]).unwrap();
                let mut search = Search {
                    options: &ConeOptions::default(),
                    deadline: Deadline::after(None),
                    observe: &mut |_: &ConeIteration| ControlFlow::Continue(()),
                    inner_only: false,
                };
                let found = ray_of_block(&problem, &mut search, &[1.0]).unwrap();
                assert_eq!(found.is_none(), solvable, "{slope} {cone:?}");
                // Where F is constant the proof is exact.
                assert!(slope != 0.0 || found.unwrap().radius == f64::INFINITY);
            }
        }
    }

    /// F = u uᵀ and V = w wᵀ with w orthogonal to u: X = 0 is a solution, and ⟨F, V⟩ < 0 is due to rounding.
    #[test]
    fn rounding_refutes_no_matrix_of_the_cone() {
        let (mut random, mut negative) = (Random::new(6), 0);
        for _ in 0..200 {
            let (a, b) = (random.symmetric(), random.symmetric());
            let (q, v) = (
                svec(&[[b * b, -a * b], [-a * b, a * a]]).unwrap(),
                svec(&[[a * a, a * b], [a * b, b * b]]).unwrap(),
            );
            negative += usize::from(dot(&q, &v) < 0.0);
            let zero = Matrix::zeros(Matrix::identity(3).pattern().clone());
            let function = AffineFunction::new(zero.clone(), q.clone()).unwrap();
            let cones = vec![Cone::Semidefinite(2)];
            let problem = ConeProblem::new(&function as &dyn McpFunction, cones).unwrap();
            assert_eq!(certificate(&problem, &zero, &q, v).unwrap(), None, "{a} {b}");
        }
        assert!(negative > 20, "{negative}");
    }
}
