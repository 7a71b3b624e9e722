//! The selections active at a point one by one: which of them have points nearby, and the signs of their determinants.

use super::determinants::{Determinant, Determinants, Examined};
use super::error::check_selection;
use super::essential::open_cone;
use super::vanishing::{gradient_of, pointed_into};
use super::{
    ActiveSet, Activity, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout,
};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::sparse::Matrix;
use crate::spread::Random;
use crate::tolerances::{DIRECTION, HALF_DIGITS, INTERIOR_STEPS};

/// Distances, in units of the variables, at which test functions that may be identical are compared.
const AROUND: [f64; 4] = [0.3, 0.1, 1e-2, 1e-3];

/// The cell of a selection near x, where only the variables that may move vary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell {
    /// It has interior points arbitrarily near x.
    Open,
    /// It has none.
    Empty,
    /// Its linearisation has none, but the map is not affine; or it is not known.
    Unknown,
}

/// The cone of directions that point into the cell of each active selection.
pub(super) struct Cones<'a> {
    map: Box<dyn PiecewiseSmooth + 'a>,
    x: &'a [f64],
    layout: TestLayout,
    vanishing: Vec<usize>,
    /// Sizes of the variables that move, in which directions are measured.
    sizes: Vec<f64>,
    /// Gradients of the vanishing test functions, unless kinks are nested; then each selection has its own.
    common: Option<Gradients>,
}

/// Gradients of the vanishing test functions of a selection, in the variables that move.
struct Gradients {
    /// Of unit length; `None` where a test function does not depend on these variables to first order.
    units: Vec<Option<Vec<f64>>>,
    /// Whether they are linearly independent, so that all signs occur.
    independent: bool,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<'a> Cones<'a> {
    /// The first `moving` variables may move.
    pub(super) fn new(
        map: Box<dyn PiecewiseSmooth + 'a>,
        x: &'a [f64],
        active: &ActiveSet,
        moving: usize,
    ) -> Self {
        let m = map.num_vars();
        let layout = TestLayout::new(&map);
        let mut sizes = vec![1.0; m];
        map.typical_sizes(&mut sizes);
        sizes.truncate(moving);
        for s in &mut sizes {
            if !(*s > 0.0 && s.is_finite()) {
                *s = 1.0;
            }
        }
        // A single selection needs no cone.
        let vanishing = if active.is_singleton() {
            Vec::new()
        } else {
            active.vanishing().to_vec()
        };
        let mut cones = Self {
            map,
            x,
            layout,
            vanishing,
            sizes,
            common: None,
        };
        if !cones.map.has_nested_kinks() {
            cones.common = Some(cones.own_gradients(active.first()));
        }
        cones
    }

    fn own_gradients(&self, selection: &Selection) -> Gradients {
        let mut full = vec![0.0; self.map.num_vars()];
        let unit = |&index: &usize| {
            full.fill(0.0);
            gradient_of(&self.map, &self.layout, selection, index, self.x, &mut full);
            let mut g: Vec<f64> = full.iter().zip(&self.sizes).map(|(g, s)| g * s).collect();
            let norm = dot(&g, &g).sqrt();
            g.iter_mut().for_each(|v| *v /= norm);
            (norm > 0.0 && norm.is_finite()).then_some(g)
        };
        let units: Vec<_> = self.vanishing.iter().map(unit).collect();
        Gradients {
            independent: are_independent(&units),
            units,
        }
    }

    /// The gradients of a selection, with storage for them if they are its own.
    fn gradients<'b>(&'b self, selection: &Selection, own: &'b mut Option<Gradients>) -> &'b Gradients {
        match &self.common {
            Some(common) => common,
            None => own.insert(self.own_gradients(selection)),
        }
    }

    /// The vanishing facets of a selection: position among the vanishing tests, and sign.
    fn facets(&self, selection: &Selection) -> Vec<(usize, f64)> {
        let mut list = Vec::new();
        for site in 0..self.layout.num_sites() {
            for facet in self.map.cell(site, selection.piece(site)) {
                let index = self.layout.range(site).start + facet.test();
                if let Ok(k) = self.vanishing.binary_search(&index) {
                    list.push((k, facet.sign()));
                }
            }
        }
        list
    }

    /// What is known of the cell of an active selection and, unless it is empty, ∇H^(σ)(x) in `jac`.
    pub(super) fn element(&self, selection: &Selection, jac: &mut Matrix) -> Result<Cell, PiecewiseError> {
        check_selection("the active set", selection, &self.map)?;
        let cell = self.cell(selection);
        if cell == Cell::Empty {
            return Ok(cell);
        }
        jac.clear();
        self.map.jacobian(selection, self.x, jac);
        match jac.stray() {
            Some((row, col)) => Err(PiecewiseError::StrayEntry { row, col }),
            None => Ok(cell),
        }
    }

    fn cell(&self, selection: &Selection) -> Cell {
        let facets = self.facets(selection);
        let opposite = |a: &(usize, f64), b: &(usize, f64)| a.0 == b.0 && a.1 * b.1 < 0.0;
        if (facets.iter().enumerate()).any(|(i, a)| facets[..i].iter().any(|b| opposite(a, b))) {
            return Cell::Empty;
        }
        let mut own = None;
        let gradients = self.gradients(selection, &mut own);
        if gradients.independent {
            return Cell::Open;
        }
        let affine = self.map.is_piecewise_affine();
        let mut normals = Vec::new();
        for (k, sign) in &facets {
            match &gradients.units[*k] {
                Some(g) => normals.push(g.iter().map(|v| sign * v).collect()),
                // Constant in y: it has the same value in all cells that it bounds.
                None if affine => {}
                None => return Cell::Unknown,
            }
        }
        match open_cone(&normals, INTERIOR_STEPS) {
            Activity::Essential => Cell::Open,
            Activity::Inessential if affine || self.contradicts(selection, &gradients.units, &facets) => {
                Cell::Empty
            }
            _ => Cell::Unknown,
        }
    }

    /// Whether a cell requires both signs of one function that occurs as two test functions.
    fn contradicts(
        &self,
        selection: &Selection,
        units: &[Option<Vec<f64>>],
        facets: &[(usize, f64)],
    ) -> bool {
        let gradient = |f: &(usize, f64)| units[f.0].as_ref();
        facets.iter().enumerate().any(|(i, a)| {
            facets[..i].iter().any(|b| {
                let along = gradient(a).zip(gradient(b)).map(|(g, h)| dot(g, h));
                let same = along.is_some_and(|c| (c.abs() - 1.0).abs() < 1e-6 && c * a.1 * b.1 < 0.0);
                same && self.coincide(selection, self.vanishing[a.0], self.vanishing[b.0])
            })
        })
    }

    /// Whether two test functions are proportional at points on all sides of x.
    fn coincide(&self, selection: &Selection, first: usize, second: usize) -> bool {
        let mut theta = vec![0.0; self.layout.total()];
        let mut spread = Random::new(3);
        let mut factor: Option<f64> = None;
        let mut seen = 0;
        for step in AROUND {
            for _ in 0..3 {
                let mut at = self.x.to_vec();
                for (v, s) in at.iter_mut().zip(&self.sizes) {
                    *v += step * s.max(v.abs()) * spread.symmetric();
                }
                self.map.tests_of_selection(selection, &at, None, &mut theta);
                let (a, b) = (theta[first], theta[second]);
                let known = *factor.get_or_insert(b / a);
                // NaN is no agreement.
                let same = (b - known * a).abs() <= 1e-12 * b.abs();
                if !same {
                    return false;
                }
                seen += usize::from(b != 0.0);
            }
        }
        seen > 0
    }

    /// How far d points into the cell of a selection, against its length: negative outside, infinite for a cell without facets here.
    pub(super) fn margin(&self, selection: &Selection, d: &[f64]) -> f64 {
        let d: Vec<f64> = d.iter().zip(&self.sizes).map(|(d, s)| d / s).collect();
        let length = dot(&d, &d).sqrt();
        let mut margin = f64::INFINITY;
        let mut own = None;
        let gradients = self.gradients(selection, &mut own);
        for (k, sign) in self.facets(selection) {
            match &gradients.units[k] {
                Some(g) => margin = margin.min(sign * dot(g, &d) / length),
                None if self.map.is_piecewise_affine() => {}
                None => return f64::NAN,
            }
        }
        margin
    }

    /// The preimage of a target under a selection's derivative, and where it lies.
    pub(super) fn preimage(&self, found: Examined<'_>, target: &Target) -> Result<Side, PiecewiseError> {
        let Some(solver) = found.solver else {
            return Ok(Side::Unclear);
        };
        let mut d = target.image.clone();
        let n = d.len();
        if target.rates.iter().any(|r| *r != 0.0) {
            let mut jac = Matrix::zeros(self.map.pattern());
            self.map.jacobian(found.selection, self.x, &mut jac);
            let mut moved = vec![0.0; n];
            moved.extend(&target.rates);
            jac.as_ref().mul_add(-1.0, &moved, &mut d);
        }
        match solver.solve_in_place(&mut d) {
            Ok(()) => {}
            Err(LinearError::Inaccurate { .. }) => return Ok(Side::Unclear),
            Err(e) => return Err(e.into()),
        }
        d.extend(&target.rates);
        let rounding = 16.0 * n as f64 * f64::EPSILON;
        let clear = DIRECTION.max(rounding / solver.rcond().unwrap_or(1.0));
        let margin = self.margin(found.selection, &d);
        Ok(if margin > clear {
            Side::Inside(d)
        } else if margin < -clear {
            Side::Outside
        } else {
            Side::Unclear
        })
    }

    /// Whether two directions agree: where a test function vanishes identically, the selections on both of its sides are active everywhere.
    pub(super) fn is_same(&self, d: &[f64], e: &[f64]) -> bool {
        let scaled = |v: &[f64], w: &[f64]| -> f64 {
            let terms = v.iter().zip(w).zip(&self.sizes);
            terms.map(|((v, w), s)| ((v - w) / s).powi(2)).sum()
        };
        let zero = vec![0.0; d.len()];
        scaled(d, e) <= DIRECTION * DIRECTION * scaled(d, &zero)
    }

    /// The image of a direction in general position under the B-derivative, a different one for every `number`; `None` where that
    /// direction is too near to a boundary of cells.
    pub(super) fn target(&self, active: &ActiveSet, number: u64) -> Option<Target> {
        let (m, n) = (self.map.num_vars(), self.map.num_residuals());
        let mut spread = Random::new(2 * number + 1);
        let mut d: Vec<f64> = self.sizes.iter().map(|s| s * spread.symmetric()).collect();
        let moving = d.len();
        d.resize(m, 0.0);
        let selection = pointed_into(&self.map, &self.layout, active, self.x, &d);
        let clear = self.margin(&selection, &d[..moving]) > DIRECTION;
        if !clear {
            return None;
        }
        let mut jac = Matrix::zeros(self.map.pattern());
        self.map.jacobian(&selection, self.x, &mut jac);
        let mut image = vec![0.0; n];
        jac.mul_vec(&d, &mut image);
        let rates = d[n.min(moving)..moving].to_vec();
        Some(Target { image, rates })
    }
}

fn are_independent(gradients: &[Option<Vec<f64>>]) -> bool {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for g in gradients {
        let Some(mut g) = g.clone() else {
            return false;
        };
        // Twice is enough (Kahan, Parlett).
        for _ in 0..2 {
            for b in &basis {
                let along = dot(b, &g);
                g.iter_mut().zip(b).for_each(|(g, b)| *g -= along * b);
            }
        }
        let norm = dot(&g, &g).sqrt();
        if norm.is_nan() || norm < HALF_DIGITS {
            return false;
        }
        g.iter_mut().for_each(|v| *v /= norm);
        basis.push(g);
    }
    true
}

/// The verdict of the signs of det ∇_yH^(σ) over the essentially active selections σ.
pub(super) enum Signs {
    /// One sign, `None` where a single selection is active and no determinant is known.
    Coherent { sign: Option<i8>, selections: u64 },
    /// Two differ, or one vanishes.
    Incoherent {
        first: (Selection, i8),
        second: (Selection, i8),
    },
    /// The first ones of a longer list have one sign.
    Capped { examined: u64 },
    /// One whose cell is not known to have points near x has another sign than the rest.
    Doubtful { selection: Selection },
    /// It is not known whether one is singular.
    Rounding { selection: Selection },
    /// The linear solver has none.
    NoDeterminant,
}

/// The error where determinants are needed that the linear solver does not provide.
pub(super) fn no_determinant() -> PiecewiseError {
    let what = "no determinant is available for a sparse matrix of this size";
    LinearError::Solver { what: what.into() }.into()
}

/// A value of the B-derivative.
pub(super) struct Target {
    /// H'(x; d).
    image: Vec<f64>,
    /// The changes along d of the parameters that may move.
    rates: Vec<f64>,
}

/// Where the preimage of a value under a selection's derivative lies.
pub(super) enum Side {
    /// In the cell of the selection: the direction.
    Inside(Vec<f64>),
    Outside,
    /// Too near to the boundary to decide, by rounding.
    Unclear,
}

/// Goes through at most `cap` active selections whose cells are not empty; `visit` sees each of them that is regular. A reciprocal
/// condition below `singular` counts as singular, unless `exact` arithmetic is to decide.
pub(super) fn examine(
    cones: &Cones<'_>,
    active: &ActiveSet,
    cap: u64,
    (singular, exact): (f64, bool),
    visit: &mut dyn FnMut(Examined<'_>) -> Result<(), PiecewiseError>,
) -> Result<Signs, PiecewiseError> {
    let mut jac = Matrix::zeros(cones.map.pattern());
    let mut determinants = Determinants::new(&cones.map, cones.x, &jac, singular, exact)?;
    let mut rounding = None;
    let mut first: Option<(Selection, i8)> = None;
    let mut unknown: Vec<(Selection, i8)> = Vec::new();
    let mut selections = 0;
    for (selection, examined) in active.selections().zip(0..) {
        if examined == cap {
            return Ok(Signs::Capped { examined });
        }
        let cell = cones.element(&selection, &mut jac)?;
        if cell == Cell::Empty {
            continue;
        }
        let sign = match determinants.sign(&selection, &jac)? {
            Determinant::Sign(sign) => sign,
            Determinant::Doubtful => {
                rounding = rounding.or(Some(selection));
                continue;
            }
            // A single regular selection needs no determinant.
            Determinant::Unavailable if active.is_singleton() => {
                visit(determinants.examined(&selection))?;
                return Ok(Signs::Coherent {
                    sign: None,
                    selections: 1,
                });
            }
            Determinant::Unavailable => return Ok(Signs::NoDeterminant),
        };
        selections += 1;
        if sign != 0 {
            visit(determinants.examined(&selection))?;
        }
        match &first {
            _ if cell == Cell::Unknown => unknown.push((selection, sign)),
            Some((_, known)) if *known == sign => {}
            None if sign != 0 => first = Some((selection, sign)),
            _ => {
                let first = first.unwrap_or_else(|| (selection.clone(), sign));
                return Ok(Signs::Incoherent {
                    first,
                    second: (selection, sign),
                });
            }
        }
    }
    if let Some(selection) = rounding {
        return Ok(Signs::Rounding { selection });
    }
    // Even where no cell is known to have interior points, signs that agree decide.
    let common = first.map(|f| f.1).or_else(|| unknown.first().map(|u| u.1));
    Ok(
        match unknown.into_iter().find(|u| Some(u.1) != common || u.1 == 0) {
            Some((selection, _)) => Signs::Doubtful { selection },
            None => Signs::Coherent {
                sign: common,
                selections,
            },
        },
    )
}

/// Sign of det of the leading n columns, 0 when singular (a reciprocal condition below `singular` counts as that); `None` where the
/// solver has no determinant.
pub(super) fn sign_of(
    solver: &mut AutoSolver,
    jac: &Matrix,
    n: usize,
    singular: f64,
) -> Result<Option<i8>, PiecewiseError> {
    match solver.factor(jac.leading_columns(n)) {
        Ok(()) if solver.rcond().is_some_and(|r| r < singular) => Ok(Some(0)),
        Ok(()) => Ok(solver.log_det().map(|d| d.0)),
        Err(LinearError::Singular { .. }) => Ok(Some(0)),
        Err(e) => Err(e.into()),
    }
}
