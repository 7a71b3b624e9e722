//! Many problems one after another or, with the `rayon` feature, at the same time.

/// f of every input, in the order of the inputs: sweeps over starts, parameters, loads.
///
/// With the `rayon` feature the calls run in parallel on rayon's current thread pool; without it one after another. The results
/// are the same to the last bit as long as each call depends on its input alone: make solvers inside `f`.
///
/// ```
/// use semismooth::prelude::*;
/// use semismooth::sweep::sweep;
///
/// // x + 10 (x − 1)₊ = load, for many loads.
/// let loads: Vec<f64> = (0..5).map(f64::from).collect();
/// let found = sweep(&loads, |load| {
///     let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///         a[0] = load - x[0];
///         b[0] = load + 10.0 - 11.0 * x[0];
///     });
///     let mut x = [0.0];
///     Newton::new(NewtonOptions::default()).solve(&map, &mut x).map(|_| x[0])
/// });
/// assert_eq!(found.into_iter().collect::<Result<Vec<_>, _>>()?[1], 1.0);
/// # Ok::<(), NewtonError>(())
/// ```
pub fn sweep<I: Sync, R: Send>(inputs: &[I], f: impl Fn(&I) -> R + Sync) -> Vec<R> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        inputs.par_iter().map(&f).collect()
    }
    #[cfg(not(feature = "rayon"))]
    inputs.iter().map(f).collect()
}
