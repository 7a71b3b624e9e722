use super::error::check_selection;
use super::vanishing::gradient_of;
use super::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout, active_set};
use crate::input::check_vector;
use crate::tolerances::RESULT;

/// Whether a selection is essentially active: x lies in the closure of the interior of {H = H^(σ)} (Scholtes 2012, ch. 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Activity {
    /// Its cell has points arbitrarily near x.
    Essential,
    /// The linearised cell is empty: for affine test functions not essentially active.
    Inessential,
    /// Not active at all.
    Inactive,
    /// Not decided within the limit on steps, or by rounding.
    Undecided,
}

/// Decides whether `selection` is essentially active at x by the gradients of its vanishing facets: it is when some direction d
/// has sign·∇θ·d > 0 on all of them (Gordan's alternative). At most `max_steps` steps are made; a few hundred decide most cases, 20 000
/// nearly all.
///
/// # Errors
/// Wrong lengths, values that are not finite, selections of other maps.
pub fn essential_activity<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    selection: &Selection,
    tolerance: f64,
    max_steps: usize,
) -> Result<Activity, PiecewiseError> {
    essential_activity_of(&map, x, selection, tolerance, max_steps)
}

fn essential_activity_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    selection: &Selection,
    tolerance: f64,
    max_steps: usize,
) -> Result<Activity, PiecewiseError> {
    check_vector("the point x", x, map.num_vars())?;
    check_selection("the selection", selection, map)?;
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
            gradient_of(map, &layout, selection, index, x, &mut g);
            let norm = facet.sign() * g.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm == 0.0 {
                return Ok(Activity::Undecided);
            }
            g.iter_mut().for_each(|v| *v /= norm);
            normals.push(g);
        }
    }
    Ok(open_cone(&normals, max_steps))
}

/// Is there a d with g·d > 0 for all unit vectors g? The point w of their convex hull nearest to 0 decides: either d = w is one, or
/// w = 0 and there is none. Pairwise Frank–Wolfe steps move weight from the worst g to the best one; they
/// converge linearly, also where 0 lies in a face (Lacoste-Julien and Jaggi 2015). ‖w‖ is the width of the cone of these d: only where it
/// is within the rounding of the unit vectors there is none.
pub(crate) fn open_cone(normals: &[Vec<f64>], max_steps: usize) -> Activity {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let zero = 4.0 * f64::EPSILON * normals.len() as f64;
    let Some(first) = normals.first() else {
        return Activity::Essential;
    };
    let mut w = first.clone();
    let mut weights = vec![0.0; normals.len()];
    weights[0] = 1.0;
    for _ in 0..max_steps {
        let (mut toward, mut away) = (0, 0);
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, g) in normals.iter().enumerate() {
            let slack = dot(g, &w);
            if slack < lowest {
                (toward, lowest) = (k, slack);
            }
            if weights[k] > 0.0 && slack > highest {
                (away, highest) = (k, slack);
            }
        }
        if lowest > RESULT {
            return Activity::Essential;
        }
        if dot(&w, &w) <= zero * zero {
            return Activity::Inessential;
        }
        let (g, h) = (&normals[toward], &normals[away]);
        let length: f64 = g.iter().zip(h).map(|(g, h)| (g - h).powi(2)).sum();
        let step = ((highest - lowest) / length).min(weights[away]);
        if step.is_nan() || step <= 0.0 {
            return Activity::Undecided;
        }
        weights[toward] += step;
        weights[away] -= step;
        for ((w, g), h) in w.iter_mut().zip(g).zip(h) {
            *w += step * (g - h);
        }
        if dot(&w, &w) < RESULT * RESULT {
            // Without the rounding errors of all steps.
            w.fill(0.0);
            for (g, weight) in normals.iter().zip(&weights) {
                w.iter_mut().zip(g).for_each(|(w, g)| *w += weight * g);
            }
        }
    }
    Activity::Undecided
}
