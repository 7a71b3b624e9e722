//! All solutions at a fixed parameter.

mod collector;

use super::contradiction::drop_overflows;
use super::lists::{Completeness, Doubt, SolutionSet};
use super::search::SelectionSearch;
use super::stated::stated_conditions;
use super::{EnumerationError, EnumerationOptions, system};
use crate::clock::Deadline;
use crate::input::check_vector;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Scaled, ScaledMap, Selection, Selections};
use crate::sparse::max_abs;
use crate::tolerances::MAX_COEFFICIENTS;
use collector::Collector;

/// All solutions y of H(y, α) = 0 for a map whose pieces are affine in y. For an equation (as many variables
/// as residuals) `alpha` is ignored.
///
/// For maps that give [exact coefficients](crate::piecewise::Structure::exact), friction problems, affine
/// complementarity problems and piecewise-affine formulas ([`Traced`](crate::piecewise)) among them, a list
/// is proven complete for the problem that the floating-point numbers define. The search works in
/// floating-point numbers; excluded selections, the regularity of selections, the signs of facets and the
/// coincidence of solutions are decided by error bounds, and in exact rational arithmetic where these do not
/// suffice. `tolerance` and `merge_distance` are not used.
///
/// For other maps affinity is tested on every row by derivatives at two points, and every solution by its
/// residual and its cell, within tolerances: such a list is never complete, but at best
/// [`Undecided`](Completeness::Undecided). If each residual depends on the pieces of few sites, or residuals
/// are sums over sites (which is tested at some selections), the search is pruned; else it tries all
/// selections.
///
/// # Errors
/// Options out of range, maps that are neither equation nor curve, α not finite,
/// [`EnumerationError::NotAffine`] with the row or site, [`EnumerationError::TooLarge`], Jacobians that are
/// not finite or have entries outside their pattern.
///
/// ```
/// use semismooth::complementarity::Lcp;
/// use semismooth::enumeration::{EnumerationOptions, all_solutions};
/// use semismooth::sparse::Matrix;
/// // 0 ≤ x ⟂ −x + q ≥ 0 has the solutions 0 and q > 0, however small q is.
/// let lcp = Lcp::new(Matrix::from_rows(&[[-1.0]])?, vec![1e-300])?;
/// let set = all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default())?;
/// assert_eq!(set.solutions.len(), 2);
/// assert_eq!(set.index_sum, Some(0));
/// assert!(set.completeness.is_complete());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn all_solutions<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    alpha: f64,
    options: &EnumerationOptions,
) -> Result<SolutionSet, EnumerationError> {
    solutions_of(&map, alpha, options, Deadline::after(options.max_time))
}

/// [`all_solutions`] that ends also once `stop` returns `true`. It is called wherever
/// [`max_time`](EnumerationOptions::max_time) is checked, so its own cost matters.
///
/// # Errors
/// As [`all_solutions`].
pub fn all_solutions_until<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    alpha: f64,
    options: &EnumerationOptions,
    stop: &dyn Fn() -> bool,
) -> Result<SolutionSet, EnumerationError> {
    solutions_of(&map, alpha, options, Deadline::after(options.max_time).or(stop))
}

fn solutions_of(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Result<SolutionSet, EnumerationError> {
    options.validate()?;
    check_vector("the parameter", &[alpha], 1)?;
    check_shape(map)?;
    if let Some(conditions) = stated_conditions(map, alpha, MAX_COEFFICIENTS) {
        return super::proof::proven_solutions(map, alpha, &conditions, options, deadline);
    }
    let scaled = Scaled::new(map, &[], (alpha, alpha))?;
    let mut set = of_scaled(&scaled, alpha / scaled.parameter_size(), options, deadline)?;
    set.solutions.iter_mut().for_each(|s| scaled.unscale(&mut s.x));
    for continuum in &mut set.continua {
        let points = continuum.ends.iter_mut().chain([&mut continuum.point]);
        points.filter(|x| !x.is_empty()).for_each(|x| scaled.unscale(x));
        for direction in &mut continuum.directions {
            scaled.unscale(direction);
            let largest = max_abs(direction);
            direction.iter_mut().for_each(|v| *v /= largest);
        }
    }
    let overflows = drop_overflows(&mut set);
    if overflows > 0 {
        set.index_sum = None;
        let doubt = Doubt::Overflow;
        set.completeness = match set.completeness {
            Completeness::Complete => Completeness::Undecided {
                selections: overflows,
                doubt,
            },
            Completeness::Undecided { selections, .. } => Completeness::Undecided {
                selections: selections + overflows,
                doubt,
            },
            incomplete => incomplete,
        };
    }
    Ok(set)
}

fn check_shape(map: &dyn PiecewiseSmooth) -> Result<(), EnumerationError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    if m == n || m == n + 1 {
        return Ok(());
    }
    Err(PiecewiseError::Dimensions {
        vars: m,
        residuals: n,
        expected: "as many variables as residuals, or one more (the parameter)",
    }
    .into())
}

fn of_scaled(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Result<SolutionSet, EnumerationError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    let mut origin = vec![0.0; m];
    if m > n {
        origin[n] = alpha;
    }
    let mut collector = Collector::new(map, origin.clone(), options)?;
    let mut set = SolutionSet {
        solutions: Vec::new(),
        continua: Vec::new(),
        index_sum: None,
        completeness: Completeness::Complete,
        nodes: 0,
        pivots: 0,
    };
    let (examined, total, stopped);
    let choices = system::all_choices(map);
    if let Some(system) = system::at_parameter(map, &choices, &origin, deadline)? {
        let mut search = SelectionSearch::new(&system, None, options.max_nodes, deadline);
        match search.root(&[]) {
            Ok(root) => search.run(root, &mut |pieces| {
                let selection = Selection::from_pieces(pieces.iter().copied());
                collector.examine(&selection)?;
                collector.settle(&selection, deadline)
            })?,
            Err(_) => search.examined = search.total,
        }
        (set.nodes, set.pivots) = (search.nodes, search.pivots);
        (examined, total, stopped) = (search.examined, search.total, search.stopped);
    } else {
        total = (0..map.num_sites()).map(|s| map.num_pieces(s) as f64).product();
        for selection in Selections::all(map).take(usize::try_from(options.max_nodes).unwrap_or(usize::MAX)) {
            if deadline.is_over() {
                break;
            }
            collector.examine(&selection)?;
            set.nodes += 1;
        }
        examined = set.nodes as f64;
        stopped = examined < total;
    }
    // On a facet the selections of both sides give the same point, one of them up to rounding.
    let mut doubtful = 0;
    for k in (0..collector.solutions.len()).filter(|_| !stopped) {
        let doubt = deadline.is_over() || !collector.clean[k] || collector.is_torn(k);
        doubtful += u64::from(doubt);
    }
    set.completeness = match collector.undecided + doubtful {
        _ if stopped => Completeness::Incomplete { examined, total },
        selections => Completeness::Undecided {
            selections,
            doubt: Doubt::NoCoefficients,
        },
    };
    collector.finish(&mut set, deadline);
    Ok(set)
}
