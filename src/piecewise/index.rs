use super::determinants::{Determinant, Determinants};
use super::orientation::{Cell, Cones, Side, Target};
use super::regularity::square;
use super::uniqueness::TRIES;
use super::{ActiveSet, PiecewiseError, PiecewiseSmooth, Selection, active_set};
use crate::input::check_vector;
use crate::linear::null_space;
use crate::sparse::Matrix;
use crate::tolerances::{DENSE, DIRECTION, DOUBTFUL, SAME};

/// Directions with one image, with the signs of their selections.
type Preimages = Vec<(Vec<f64>, i8)>;

/// The local index of an isolated solution x: the topological degree of y ↦ H(y, α) on small neighbourhoods. `None` where it is not known.
///
/// Where 0 is the only zero of the B-derivative, x is isolated, and its index is the degree of the B-derivative (its homotopy to
/// H has no other zero near x; J.-S. Pang, D. Ralph, Math. Oper. Res. 21 (1996)): for almost every value v, Σ sign det ∇_yH^(σ) over all σ
/// whose cells contain the direction (∇_yH^(σ))⁻¹ v. At smooth points this is the sign of the determinant, at a fold 0, and two facets of a
/// branching can give ±2. On a region without solutions on its boundary the degree of H is the sum of the indices in it, and does not change
/// with data as long as no solution crosses the boundary.
///
/// The index is unknown where
///
/// * x is in no cell of some site, or more than `cap` selections are active,
/// * a selection is singular (decided as in [`bd_regularity`](super::bd_regularity)) and a direction of its kernel lies in its cell or on the boundary, or the kernel
///   has more than one dimension, or there are more than 500 rows,
/// * first derivatives do not decide whether the cell of a selection has points near x,
/// * all values v tried have a direction on a boundary of cells, or the linear solver provides no determinants.
///
/// For the map of a curve y alone varies. Test functions with |θ(x)| ≤ `tolerance` count as vanishing. That H(x) = 0 is not checked.
///
/// # Errors
/// Wrong lengths, maps with neither m = n nor m = n + 1, Jacobians that are not finite or leave their pattern, and failures of the linear
/// solver other than singularity.
///
/// ```
/// use semismooth::piecewise::{MinMap, local_index};
/// // −|x| = 0 has the solution 0, which both neighbours −|x| = ±ε tell is none: two solutions of opposite sign, or none.
/// let h = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = -x[0]; });
/// assert_eq!(local_index(&h, &[0.0], 1e-12, 100)?, Some(0));
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn local_index<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Option<i64>, PiecewiseError> {
    let m = map.num_vars();
    check_vector("the point x", x, m)?;
    index_of(&map, x, &active_set(map, x, tolerance), cap)
}

fn index_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    cap: u64,
) -> Result<Option<i64>, PiecewiseError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    if m != n && m != n + 1 {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "as many variables as residuals, or one more (the parameter)",
        });
    }
    if !active.outside().is_empty() || active.total().is_none_or(|t| t > u128::from(cap)) {
        return Ok(None);
    }
    let cones = Cones::new(Box::new(map), x, active, n);
    let mut jac = Matrix::zeros(map.pattern());
    let mut determinants = Determinants::new(map, x, &jac, DOUBTFUL, true)?;
    if active.is_singleton() {
        cones.element(active.first(), &mut jac)?;
        return Ok(match determinants.sign(active.first(), &jac)? {
            Determinant::Sign(sign) if sign != 0 => Some(i64::from(sign)),
            _ => None,
        });
    }
    let targets: Vec<Target> = (0..TRIES).filter_map(|k| cones.target(active, k)).collect();
    // For each value its preimages with their signs, unless one is on a boundary.
    let mut preimages: Vec<Option<Preimages>> = vec![Some(Vec::new()); targets.len()];
    for selection in active.selections() {
        match cones.element(&selection, &mut jac)? {
            Cell::Empty => continue,
            Cell::Unknown => return Ok(None),
            Cell::Open => {}
        }
        let sign = match determinants.sign(&selection, &jac)? {
            Determinant::Unavailable | Determinant::Doubtful => return Ok(None),
            Determinant::Sign(0) if has_zero(&cones, &selection, &jac)? => return Ok(None),
            Determinant::Sign(0) => continue,
            Determinant::Sign(sign) => sign,
        };
        for (target, found) in targets.iter().zip(&mut preimages) {
            let Some(known) = found else {
                continue;
            };
            match cones.preimage(determinants.examined(&selection), target)? {
                Side::Inside(d) if !known.iter().any(|(e, _)| cones.is_same(e, &d)) => known.push((d, sign)),
                Side::Inside(_) | Side::Outside => {}
                Side::Unclear => *found = None,
            }
        }
    }
    // All values must give the same sum, which is checked.
    let sum = |list: Preimages| list.iter().map(|(_, sign)| i64::from(*sign)).sum();
    let mut sums = preimages.into_iter().flatten().map(sum);
    let first: Option<i64> = sums.next();
    Ok(first.filter(|f| sums.all(|s: i64| s == *f)))
}

/// Whether a kernel vector of a singular selection may lie in its closed cell.
fn has_zero(cones: &Cones<'_>, selection: &Selection, jac: &Matrix) -> Result<bool, PiecewiseError> {
    let n = jac.nrows();
    if n > DENSE {
        return Ok(true);
    }
    // Singular values below this part of the largest one belong to the kernel.
    let found = null_space(&square(jac)?, SAME)?;
    let [v] = found.right.as_slice() else {
        return Ok(true);
    };
    let opposite: Vec<f64> = v.iter().map(|v| -v).collect();
    let clear = |d: &[f64]| cones.margin(selection, d) < -DIRECTION;
    Ok(!(clear(v) && clear(&opposite)))
}
