//! How far a solution stays on its pieces through a family of maps, of which each member is known and how it changes is not.

use super::element::{Element, WIDTH};
use super::point::{Solved, hidden, spreads};
use super::{SensitivityError, Validity};
use crate::continuation::Termination;
use crate::input::{check_length, check_options, check_vector, positive};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout};
use crate::tolerances::{HALF_DIGITS, SAME};

/// Steps of Newton's method for a member, from the solution of another one.
const STEPS: usize = 12;

/// How far a solution stays on its pieces as its map changes with s, 0 ≤ s ≤ `horizon`, in whatever way: as stiffnesses and shapes of
/// contact problems do. `family` gives the map at s and the values of its parameters, the variables behind the n unknowns; `x` (length n) is
/// a solution at s = 0.
///
/// The solutions of these pieces are computed at the ends and in the middle of ever shorter intervals, until on each the parabola through the
/// three values of every test function is positive, or one has a zero that is located to 1e-9 of the horizon: [`Validity::Followed`]. This is
/// an estimate: test functions that are not like parabolas may change their sign twice between such points. At a kink the pieces are those
/// entered.
///
/// ```
/// use semismooth::contact::{CondensedContact, ContactBody, ContactError, Frictionless, LoadPath};
/// use semismooth::sensitivity::valid_along;
/// use semismooth::sparse::Matrix;
/// // A spring that gets softer, 1 − s, under the load 1, above an obstacle at distance 4.
/// let spring = |s: f64| {
///     let a = Matrix::from_rows(&[[1.0 - s, 0.0], [0.0, 1.0]])?;
///     let trace = |row: [f64; 2]| Matrix::from_rows(&[row]);
///     let load = LoadPath::constant(vec![1.0, 0.0]);
///     let body = ContactBody::new(a, trace([1.0, 0.0])?, vec![trace([0.0, 1.0])?], load)?;
///     let problem = CondensedContact::new(body.with_gap(vec![4.0])?, Frictionless::plane())?;
///     Ok::<_, ContactError>((problem, vec![0.0]))
/// };
/// // 1/(1 − s) = 4.
/// let until = valid_along(spring, &[0.0, 0.0], 0.9)?.until();
/// assert!((until - 0.75).abs() < 1e-8);
/// # Ok::<(), ContactError>(())
/// ```
///
/// # Errors
/// Those of the family; members of other sizes than the first; otherwise as [`Sensitivity::new`](super::Sensitivity::new) at s = 0; a horizon
/// that is not positive; [`SensitivityError::Rounding`] at a kink where none of the pieces is entered.
pub fn valid_along<M: PiecewiseSmooth, E: From<SensitivityError>>(
    mut family: impl FnMut(f64) -> Result<(M, Vec<f64>), E>,
    x: &[f64],
    horizon: f64,
) -> Result<Validity, E> {
    check_options(&[positive("horizon", horizon)]).map_err(SensitivityError::from)?;
    let (map, parameters) = family(0.0)?;
    let solved = Solved::new(&map, x, &parameters, true)?;
    let sizes = [map.num_residuals(), map.num_vars(), map.num_sites()];
    let mut member = |s: f64| -> Result<(M, Vec<f64>), E> {
        let (map, theta) = family(s)?;
        check_member(sizes, &map, &theta)?;
        Ok((map, theta))
    };
    let (x, layout) = (&solved.at[..solved.n], &solved.layout);
    let selection = match &solved.smooth {
        Some(element) => element.selection().clone(),
        None => {
            let (near, theta) = member(SAME.sqrt() * horizon)?;
            entered(&solved, &near, &theta)?
        }
    };
    let Some(mut from) = Place::new(&map, &parameters, &selection, layout, x)? else {
        return Ok(Validity::Lost(0.0, Termination::StepTooSmall));
    };
    let mut place = |s: f64, near: &[f64]| -> Result<Option<Place>, E> {
        let (map, theta) = member(s * horizon)?;
        Ok(Place::new(&map, &theta, &selection, layout, near)?)
    };
    // Ends of intervals that are still to be examined, the next one last.
    let mut start = 0.0;
    let mut ends = vec![(1.0, place(1.0, &from.x)?)];
    while let Some((end, there)) = ends.pop() {
        let middle = 0.5 * (start + end);
        let half = place(middle, &from.x)?;
        let holds = match (&half, &there) {
            (Some(half), Some(there)) => from.holds_to(half, there),
            _ => false,
        };
        let is_short = end - start <= SAME;
        match there {
            Some(there) if holds || is_short && there.is_inside() => (start, from) = (end, there),
            Some(_) if is_short => return Ok(Validity::Followed(horizon * end)),
            None if is_short => return Ok(Validity::Lost(horizon * start, Termination::StepTooSmall)),
            there => ends.extend([(end, there), (middle, half)]),
        }
    }
    Ok(Validity::Beyond(horizon))
}

fn check_member(sizes: [usize; 3], map: &dyn PiecewiseSmooth, theta: &[f64]) -> Result<(), SensitivityError> {
    const WHAT: [&str; 3] = [
        "the residuals of a member of the family",
        "the variables of a member of the family",
        "the sites of a member of the family",
    ];
    let found = [map.num_residuals(), map.num_vars(), map.num_sites()];
    for ((what, found), expected) in WHAT.into_iter().zip(found).zip(sizes) {
        check_length(what, found, expected)?;
    }
    let parameters = sizes[1] - sizes[0];
    Ok(check_vector(
        "the parameters of a member of the family",
        theta,
        parameters,
    )?)
}

/// The active selection at a kink whose solution at the parameters of a member nearby is farthest inside its cell.
fn entered(
    solved: &Solved,
    near: &dyn PiecewiseSmooth,
    theta: &[f64],
) -> Result<Selection, SensitivityError> {
    let mut best: Option<(f64, Selection)> = None;
    for selection in solved.active.selections() {
        let place = match Place::new(near, theta, &selection, &solved.layout, &solved.at[..solved.n]) {
            Ok(Some(place)) if place.is_inside() => place,
            _ => continue,
        };
        let margin = place.values.iter().copied().fold(f64::INFINITY, f64::min);
        if best.as_ref().is_none_or(|b| margin > b.0) {
            best = Some((margin, selection));
        }
    }
    best.map(|b| b.1).ok_or(SensitivityError::Rounding)
}

/// The solution of fixed pieces of a member, and the test functions of the facets of their cells, positive inside.
pub(super) struct Place {
    x: Vec<f64>,
    /// Whether the point given was this solution to half of all digits.
    was_near: bool,
    values: Vec<f64>,
    /// By how much rounding may move them.
    roundings: Vec<f64>,
}

impl Place {
    /// `None` where Newton's method does not find the solution from the point given.
    pub(super) fn new(
        map: &dyn PiecewiseSmooth,
        parameters: &[f64],
        selection: &Selection,
        layout: &TestLayout,
        near: &[f64],
    ) -> Result<Option<Self>, SensitivityError> {
        let n = near.len();
        let mut at = near.to_vec();
        at.extend(parameters);
        let mut r = vec![0.0; n];
        let (mut widths, mut was_near) = (None, false);
        for step in 0..STEPS {
            map.residual(selection, &at, &mut r);
            check_vector("the residual", &r, n)?;
            let mut element = match Element::new(map, &at, selection) {
                Ok(element) => element,
                Err(SensitivityError::Irregular { .. }) => return Ok(None),
                Err(e) => return Err(e),
            };
            let d = element.step(&r)?;
            let own = element.widths(&at)?;
            at.iter_mut().zip(&d).for_each(|(x, d)| *x += d);
            let is_small = d
                .iter()
                .zip(&own)
                .all(|(d, w)| d.abs() <= w / WIDTH * HALF_DIGITS);
            was_near |= is_small && step == 0;
            // Squared, the next step is rounding.
            let is_found = d.iter().zip(&own).all(|(d, w)| d.abs() <= *w);
            if is_found || widths.is_some() {
                widths = Some(own);
                break;
            }
            widths = is_small.then_some(own);
        }
        let Some(widths) = widths else {
            return Ok(None);
        };
        let mut tests = vec![0.0; layout.total()];
        map.tests_of_selection(selection, &at, None, &mut tests);
        check_vector("the test functions", &tests, tests.len())?;
        let mut hidden = hidden(map, layout, &at, &spreads(&at, &widths), Some(selection));
        if let Some(own) = map.derivatives() {
            own.test_roundings(&at, &mut hidden);
        }
        let (mut values, mut roundings) = (Vec::new(), Vec::new());
        for site in 0..layout.num_sites() {
            for facet in map.cell(site, selection.piece(site)) {
                let t = layout.range(site).start + facet.test();
                values.push(facet.sign() * tests[t]);
                roundings.push(hidden[t]);
            }
        }
        at.truncate(n);
        Ok(Some(Self {
            x: at,
            was_near,
            values,
            roundings,
        }))
    }

    pub(super) fn was_near(&self) -> bool {
        self.was_near
    }

    pub(super) fn x(&self) -> &[f64] {
        &self.x
    }

    fn is_inside(&self) -> bool {
        self.values.iter().zip(&self.roundings).all(|(v, r)| *v >= -r)
    }

    /// Whether the parabolas through the values here, halfway and at the end of an interval are positive on it, but for rounding.
    pub(super) fn holds_to(&self, half: &Self, end: &Self) -> bool {
        (0..self.values.len()).all(|k| {
            let [a, m, b] = [self, half, end].map(|place| place.values[k]);
            let rounding = [self, half, end]
                .iter()
                .fold(0.0_f64, |l, place| l.max(place.roundings[k]));
            // a + slope t + curvature t², 0 ≤ t ≤ 1.
            let (slope, curvature) = (4.0 * m - 3.0 * a - b, 2.0 * (a - 2.0 * m + b));
            let lowest = -slope / (2.0 * curvature);
            let is_within = curvature > 0.0 && lowest > 0.0 && lowest < 1.0;
            let least = a.min(m).min(b);
            let least = if is_within {
                least.min(a + 0.5 * slope * lowest)
            } else {
                least
            };
            least >= -rounding.max(f64::MIN_POSITIVE)
        })
    }
}
