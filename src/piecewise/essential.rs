use super::error::check_vector;
use super::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout, active_set};

/// Whether a selection is essentially active: x lies in the closure of the interior of {H = H^(σ)} (Scholtes 2012, ch. 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Activity {
    /// Its cell has points arbitrarily near x.
    Essential,
    /// The linearised cell is empty: for affine test functions not essentially active.
    Inessential,
    /// Not active at all.
    Inactive,
    /// Not decided within the iteration limit.
    Undecided,
}

/// Decides whether `selection` is essentially active at x by the gradients of its vanishing facets: it is when some direction d
/// has sign·∇θ·d > 0 on all of them (Gordan's alternative, by von Neumann's algorithm).
///
/// # Errors
/// Wrong lengths or values that are not finite.
pub fn essential_activity<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    selection: &Selection,
    tolerance: f64,
) -> Result<Activity, PiecewiseError> {
    check_vector("the point x", x, map.num_vars())?;
    if selection.len() != map.num_sites() {
        return Err(PiecewiseError::Length {
            what: "the selection",
            expected: map.num_sites(),
            found: selection.len(),
        });
    }
    let active = active_set(map, x, tolerance);
    if !active.contains(selection) {
        return Ok(Activity::Inactive);
    }
    let layout = TestLayout::new(map);
    let mut normals: Vec<Vec<f64>> = Vec::new();
    for site in 0..map.num_sites() {
        for facet in map.cell(site, selection.piece(site)) {
            let index = layout.range(site).start + facet.test();
            if active.vanishing().binary_search(&index).is_err() {
                continue;
            }
            let mut g = vec![0.0; x.len()];
            map.test_gradient(site, facet.test(), x, &mut g);
            let norm = facet.sign() * g.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm == 0.0 {
                return Ok(Activity::Undecided);
            }
            g.iter_mut().for_each(|v| *v /= norm);
            normals.push(g);
        }
    }
    Ok(open_cone(&normals))
}

/// Von Neumann's algorithm for: is there a d with g·d > 0 for all unit vectors g? The iterate w is a convex combination of the
/// g; either w itself serves as d, or w tends to 0.
fn open_cone(normals: &[Vec<f64>]) -> Activity {
    const LIMIT: usize = 20_000;
    const ZERO: f64 = 1e-7;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let Some(first) = normals.first() else {
        return Activity::Essential;
    };
    let mut w = first.clone();
    for _ in 0..LIMIT {
        let worst = normals.iter().min_by(|a, b| dot(a, &w).total_cmp(&dot(b, &w)));
        let Some(g) = worst else {
            return Activity::Essential;
        };
        let slack = dot(g, &w);
        if slack > 1e-12 {
            return Activity::Essential;
        }
        let norm2 = dot(&w, &w);
        if norm2 < ZERO * ZERO {
            return Activity::Inessential;
        }
        let step = (norm2 - slack) / (norm2 - 2.0 * slack + 1.0);
        for (w, g) in w.iter_mut().zip(g) {
            *w += step * (g - *w);
        }
    }
    Activity::Undecided
}
