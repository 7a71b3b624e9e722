use crate::piecewise::is_ordinary;
use crate::sparse::Matrix;

/// Typical sizes of displacements u, multipliers λ and the parameter α in A u + Bᵀ λ = f: derived from forces, stiffnesses and entries of
/// B, so that they scale with the units as u and λ do. `loads` are the sizes of the load at α = 0 and of its change; the typical α is
/// the one at which both contribute equally. `None` without load and gap.
pub(crate) fn typical_sizes<'a>(
    a: &Matrix,
    traces: impl IntoIterator<Item = &'a Matrix>,
    loads: [f64; 2],
    gap: &[f64],
) -> Option<[f64; 3]> {
    let stiffness = largest(&mut (0..a.nrows().min(a.ncols())).map(|i| a.get(i, i)));
    let trace = largest(&mut traces.into_iter().flat_map(|b| b.values().iter().copied()));
    let closing = stiffness * largest(&mut gap.iter().copied()) / trace;
    let mut load = loads[0].max(loads[1]);
    if load == 0.0 {
        load = closing;
    }
    let ratio = loads[0].max(closing) / loads[1];
    let parameter = if ratio > 0.0 && ratio.is_finite() && !is_ordinary(ratio) {
        ratio.clamp(f64::EPSILON, f64::EPSILON.recip())
    } else {
        1.0
    };
    load *= parameter.min(1.0);
    let sizes = [load / stiffness, load / trace, parameter];
    sizes.iter().all(|s| s.is_normal()).then_some(sizes)
}

/// The largest modulus of the finite entries.
pub(crate) fn largest(v: &mut dyn Iterator<Item = f64>) -> f64 {
    v.filter(|v| v.is_finite()).fold(0.0, |a: f64, v| a.max(v.abs()))
}

/// Writes them to the entries of x = (u, λ, α).
pub(crate) fn fill_sizes(found: Option<[f64; 3]>, displacements: usize, sizes: &mut [f64]) {
    if let (Some([u, lambda, parameter]), Some((alpha, y))) = (found, sizes.split_last_mut()) {
        *alpha = parameter;
        let (first, second) = y.split_at_mut(displacements);
        first.fill(u);
        second.fill(lambda);
    }
}
