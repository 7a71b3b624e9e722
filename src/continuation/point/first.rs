//! One arm of a point, cheaply: a solution of the directional problem H'(x; τ) = 0, which is piecewise linear in τ.
//!
//! With p sites at their kinks there are kᵖ selections, and to list all arms may take exponential time. Where a curve merely goes on, one
//! arm is enough. Where the sign of α̇ is given, Newton's method on the directional problem takes a few linear solves. Else, and where it
//! fails, the curve H'(x; τ) = v with a small generic v is followed through its kinks from one end to the other: it is piecewise linear,
//! passes one facet at a time, and both of its ends at infinity run along arms, whatever other arms there are (Eaves 1976).

use std::borrow::Cow;
use std::cell::RefCell;

use crate::clock::Deadline;
use crate::continuation::engine::Solver;
use crate::continuation::error::if_solved;
use crate::continuation::start::auto_corrector;
use crate::enumeration::{Directional, EnumerationError, NewtonStop};
use crate::newton::MoorePenrose;
use crate::piecewise::{
    ActiveSet, Description, Facet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, Structure,
    TestLayout, Vanishing, pointed_into,
};
use crate::sparse::{Matrix, Pattern, dot, norm};
use crate::spread::centred;
use crate::tolerances::TANGENTIAL;

/// Largest number of facets that a path passes: a multiple of the number of sites at their kinks, and a constant. Paths pass each facet
/// about once unless they turn back and forth.
const PASSES: usize = 20;
/// How far behind the point the path of an arm of arrival begins, in lengths of the perturbation: there it runs in the cell of that arm,
/// unless the arm makes an angle below 1e-6 with a facet.
const BEHIND: f64 = 1e6;
/// Stands for the value of a test function, relative to its gradient, beyond the facet that is being crossed: larger than all others.
const CROSSED: f64 = 1e200;

/// The arm that is wanted.
#[derive(Debug, Clone, Copy)]
pub(in crate::continuation) enum Wanted<'a> {
    /// One on which α grows (1) or falls (−1).
    Rate(f64),
    /// The one on which a curve goes on that arrives with this tangent.
    After(&'a [f64]),
}

/// A selection with an arm in its cell. Where α̇ is prescribed, Newton's method starts from `start`.
///
/// # Errors
/// Maps that contradict what they say of themselves.
pub(in crate::continuation) fn one_arm(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    (active, vanishing): (&ActiveSet, &[Vanishing]),
    wanted: Wanted<'_>,
    start: &Selection,
    deadline: Deadline<'_>,
) -> Result<Option<Selection>, PiecewiseError> {
    if let Wanted::Rate(rate) = wanted {
        let mut selection = start.clone();
        let stop = Directional::new(map, x, active, deadline).and_then(|mut d| d.solve(&mut selection, rate));
        match stop {
            Ok(NewtonStop::Arm) => return Ok(Some(selection)),
            Err(EnumerationError::Map(e)) => return Err(e),
            _ => {}
        }
    }
    let frozen = Frozen {
        map,
        x,
        jac: RefCell::new(Matrix::zeros(map.pattern())),
    };
    let corrector = auto_corrector(&frozen)?;
    let mut path = Path {
        layout: TestLayout::new(map),
        frozen,
        active,
        vanishing,
        corrector,
        deadline,
    };
    path.arm(wanted)
}

/// The selections of a map with their derivatives at a fixed point x, as linear functions of directions.
struct Frozen<'a> {
    map: &'a dyn PiecewiseSmooth,
    x: &'a [f64],
    /// Derivatives of the selection whose values were asked for last.
    jac: RefCell<Matrix>,
}

impl PiecewiseSmooth for Frozen<'_> {
    fn num_vars(&self) -> usize {
        self.map.num_vars()
    }
    fn num_residuals(&self) -> usize {
        self.map.num_residuals()
    }
    fn num_sites(&self) -> usize {
        self.map.num_sites()
    }
    fn num_pieces(&self, site: usize) -> usize {
        self.map.num_pieces(site)
    }
    fn num_tests(&self, site: usize) -> usize {
        self.map.num_tests(site)
    }
    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.map.cell(site, piece)
    }
    fn pattern(&self) -> Pattern {
        self.map.pattern()
    }
    fn test_functions(&self, d: &[f64], out: &mut [f64]) {
        self.map.test_derivatives(self.x, d, out);
    }
    fn residual(&self, selection: &Selection, d: &[f64], out: &mut [f64]) {
        let mut jac = self.jac.borrow_mut();
        jac.clear();
        self.jacobian(selection, d, &mut jac);
        jac.mul_vec(d, out);
    }
    fn jacobian(&self, selection: &Selection, _d: &[f64], jac: &mut Matrix) {
        self.map.jacobian(selection, self.x, jac);
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl Structure for Frozen<'_> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.map.site_rows(site, rows);
    }
    fn site_jacobian(&self, site: usize, selection: &Selection, _d: &[f64], jac: &mut Matrix) -> bool {
        self.map.site_jacobian(site, selection, self.x, jac)
    }
}

impl Description for Frozen<'_> {
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.map.site_name(site)
    }
}

/// The curve H'(x; τ) = v for a generic v.
struct Path<'a> {
    frozen: Frozen<'a>,
    active: &'a ActiveSet,
    vanishing: &'a [Vanishing],
    layout: TestLayout,
    corrector: MoorePenrose<Solver<'a>>,
    deadline: Deadline<'a>,
}

impl<'a> Path<'a> {
    /// A selection at an end of the curve.
    fn arm(&mut self, wanted: Wanted<'_>) -> Result<Option<Selection>, PiecewiseError> {
        let m = self.frozen.num_vars();
        for second in [false, true] {
            let mut point: Vec<f64> = (0..m).map(|j| centred(j + 1, second)).collect();
            match wanted {
                Wanted::After(arrival) => {
                    let far = BEHIND * norm(&point);
                    point.iter_mut().zip(arrival).for_each(|(p, t)| *p -= far * t);
                    if let Some((selection, _)) = self.end(point, arrival)? {
                        return Ok(Some(selection));
                    }
                }
                Wanted::Rate(rate) => {
                    // One end of the curve is an arm with the wanted sign of α̇, or the other one.
                    let mut hint = vec![0.0; m];
                    for sign in [rate, -rate] {
                        hint[m - 1] = sign;
                        let end = self.end(point.clone(), &hint)?;
                        if let Some((selection, _)) = end.filter(|(_, t)| t[m - 1] * rate > 0.0) {
                            return Ok(Some(selection));
                        }
                    }
                }
            }
        }
        Ok(None)
    }

    /// The selection and the direction at the end of the curve through `point`, in the direction that is nearer to `hint`. `None` where a
    /// selection on the way has no single direction, at a wall, and at a limit.
    fn end(
        &mut self,
        mut point: Vec<f64>,
        hint: &[f64],
    ) -> Result<Option<(Selection, Vec<f64>)>, PiecewiseError> {
        let (map, x) = (self.frozen.map, self.frozen.x);
        let mut selection = pointed_into(map, &self.layout, self.active, x, &point);
        let Some(mut t) = self.tangent(&selection, &point)? else {
            return Ok(None);
        };
        if dot(&t, hint) < 0.0 {
            t.iter_mut().for_each(|t| *t = -*t);
        }
        let (mut values, mut rates) = (vec![0.0; self.layout.total()], vec![0.0; self.layout.total()]);
        map.tests_of_selection(&selection, x, Some(&t), &mut rates);
        for _ in 0..PASSES * (self.active.degenerate_sites().len() + 1) {
            if self.deadline.is_over() {
                return Ok(None);
            }
            map.tests_of_selection(&selection, x, Some(&point), &mut values);
            let Some((step, crossed)) = self.crossing(&selection, &values, &rates) else {
                return Ok(Some((selection, t)));
            };
            point.iter_mut().zip(&t).for_each(|(p, t)| *p += step * t);
            values.iter_mut().zip(&rates).for_each(|(v, r)| *v += step * r);
            let before = rates[crossed.index];
            values[crossed.index] = before.signum() * CROSSED * crossed.gradient_norm;
            let Some(piece) = self.piece_beyond(&selection, crossed.site, &values) else {
                return Ok(None);
            };
            selection.set(crossed.site, piece);
            let Some(next) = self.tangent(&selection, &point)? else {
                return Ok(None);
            };
            t = next;
            map.tests_of_selection(&selection, x, Some(&t), &mut rates);
            // The curve crosses the facet, whatever α does.
            if rates[crossed.index] * before < 0.0 {
                t.iter_mut().for_each(|t| *t = -*t);
                rates.iter_mut().for_each(|r| *r = -*r);
            }
        }
        Ok(None)
    }

    /// The kernel of a selection, if it is a line.
    fn tangent(&mut self, selection: &Selection, point: &[f64]) -> Result<Option<Vec<f64>>, PiecewiseError> {
        let at = if_solved(self.corrector.linearize(&self.frozen, selection, point, None))?;
        Ok(at.map(|at| at.tangent().to_vec()))
    }

    /// How far away, in units of the direction, the first facet of the cell is that is crossed.
    fn crossing(&self, selection: &Selection, values: &[f64], rates: &[f64]) -> Option<(f64, &'a Vanishing)> {
        let mut first: Option<(f64, &'a Vanishing)> = None;
        for v in self.vanishing {
            let cell = self.frozen.cell(v.site, selection.piece(v.site));
            let leaves =
                |f: &&Facet| f.test() == v.test && f.sign() * rates[v.index] < -TANGENTIAL * v.gradient_norm;
            if cell.iter().any(|f| leaves(&f)) {
                let step = (-values[v.index] / rates[v.index]).max(0.0);
                if first.is_none_or(|(least, _)| step < least) {
                    first = Some((step, v));
                }
            }
        }
        first
    }

    /// The other active piece of a site in whose cell the values lie.
    fn piece_beyond(&self, selection: &Selection, site: usize, values: &[f64]) -> Option<usize> {
        let sites = self.active.degenerate_sites();
        let (_, pieces) = &sites[sites.binary_search_by_key(&site, |s| s.0).ok()?];
        let of_site = || self.vanishing.iter().filter(|v| v.site == site);
        let margin = |piece: usize| {
            let facets = self.frozen.cell(site, piece).iter();
            let margins = facets.flat_map(|f| {
                let vanishing = of_site().filter(|v| v.test == f.test());
                vanishing.map(|v| f.sign() * values[v.index] / v.gradient_norm.max(f64::MIN_POSITIVE))
            });
            margins.fold(f64::INFINITY, f64::min)
        };
        let others = pieces.iter().filter(|p| **p != selection.piece(site));
        let best = others.map(|&p| (margin(p), p)).max_by(|a, b| a.0.total_cmp(&b.0));
        // The cells of the pieces cover all directions but those beyond walls.
        let relative = |v: &Vanishing| values[v.index].abs() / v.gradient_norm.max(f64::MIN_POSITIVE);
        let size = of_site()
            .map(relative)
            .filter(|v| *v < CROSSED)
            .fold(0.0, f64::max);
        best.filter(|(margin, _)| *margin >= -TANGENTIAL * size)
            .map(|b| b.1)
    }
}
