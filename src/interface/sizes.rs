use crate::sparse::Matrix;

/// Typical sizes of displacements u and multipliers λ in A u + Bᵀ λ = f: those of forces, stiffnesses and entries of B, so that they
/// change with the units as u and λ do. `loads` are the sizes of the load at α = 0 and of its change. `None` where nothing is given:
/// no load and no gap.
pub(crate) fn typical_sizes<'a>(
    a: &Matrix,
    traces: impl IntoIterator<Item = &'a Matrix>,
    loads: [f64; 2],
    gap: &[f64],
) -> Option<(f64, f64)> {
    let stiffness = largest(&mut (0..a.nrows().min(a.ncols())).map(|i| a.get(i, i)));
    let trace = largest(&mut traces.into_iter().flat_map(|b| b.values().iter().copied()));
    let mut load = typical_of(loads);
    if load == 0.0 {
        load = stiffness * largest(&mut gap.iter().copied()) / trace;
    }
    let sizes = (load / stiffness, load / trace);
    let usable = |s: f64| s.is_normal();
    (usable(sizes.0) && usable(sizes.1)).then_some(sizes)
}

/// The size of what starts at `first` and changes by `change` a unit of α. A change that is far larger says more about the unit of α:
/// what is there at α = 0 must stay visible.
pub(crate) fn typical_of([first, change]: [f64; 2]) -> f64 {
    const ROUNDING: f64 = 1e-12;
    if first > ROUNDING * change { first } else { change }
}

/// The largest entry that is a number, without its sign.
pub(crate) fn largest(v: &mut dyn Iterator<Item = f64>) -> f64 {
    v.filter(|v| v.is_finite()).fold(0.0, |a: f64, v| a.max(v.abs()))
}

/// Writes them to the entries of x = (u, λ, α).
pub(crate) fn fill_sizes(found: Option<(f64, f64)>, displacements: usize, sizes: &mut [f64]) {
    if let (Some((u, lambda)), Some((_, y))) = (found, sizes.split_last_mut()) {
        let (first, second) = y.split_at_mut(displacements);
        first.fill(u);
        second.fill(lambda);
    }
}
