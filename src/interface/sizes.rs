use crate::sparse::Matrix;

/// Typical sizes of displacements u, multipliers λ and the parameter α in A u + Bᵀ λ = f: those of forces, stiffnesses and entries of
/// B, so that they change with the units as u and λ do. `loads` are the sizes of the load at α = 0 and of its change; α is small where
/// a load grows to many times what it begins with. `None` where nothing is given: no load and no gap.
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
    let begins = loads[0].max(closing);
    let parameter = if begins > 0.0 && begins < loads[1] {
        (begins / loads[1]).max(f64::EPSILON)
    } else {
        1.0
    };
    // With the load at the typical α.
    let sizes = [load / stiffness * parameter, load / trace * parameter, parameter];
    sizes.iter().all(|s| s.is_normal()).then_some(sizes)
}

/// The largest entry that is a number, without its sign.
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
