//! Proofs that a step along a curve jumps over nothing, from derivatives enclosed over boxes.
//!
//! The extended system at a point z of a chord with the direction t is F(x) = (H(x), t·(x − z)). For every
//! matrix A of the enclosure of its derivative over the box z ± w let |I − C A| ≤ G and |C F(z)| ≤ y,
//! component by component. If y + G w < w, Krawczyk's theorem says that F has exactly one zero in the box,
//! and that every A is regular (R. Krawczyk 1969; A. Neumaier, Interval methods for systems of equations,
//! 1990, theorem 5.1.8). Boxes of one size w around all points z of the chord then hold exactly one curve,
//! which is a graph over t·x.

use crate::linear::{DenseLu, LinearSolver};
use crate::piecewise::expansion::TERMS;
use crate::piecewise::{Expansions, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout};
use crate::sparse::{dot, max_abs, norm};

/// Numbers of residuals up to which proofs are tried. They cost n + 1 evaluations of the map over intervals
/// and O(n³) operations for each box, some 10 ms at this size.
const LARGEST: usize = 50;

/// Numbers of boxes along a chord that are tried until all is known. If steps are accepted at a quarter of
/// the length over which H is smooth, eight boxes see a 32nd of it each; where this does not suffice, shorter
/// steps are better than more boxes.
const BOXES: [usize; 4] = [1, 2, 4, 8];

/// Rounds of x ← y + G x: each of them adds a factor |G|, and |G| ≤ ½ leaves 2⁻¹⁰ after ten.
const ROUNDS: usize = 10;

/// What is known all along a step between two points of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepEnclosure {
    /// Whether one curve joins the two points near the chord, and no other passes there. The extended
    /// Jacobian (∇H^(σ) and the chord as a last row) is regular around it, so that its determinant has one
    /// sign.
    pub(crate) regular: bool,
    /// The sign (±1) of the rate of α from the first point to the second, if it is the same all along; the
    /// determinant of ∂H/∂y then has one sign, too.
    pub(crate) rate: Option<f64>,
    /// Whether the values at the ends tell which facets of the cell the curve passes between them: each test
    /// function keeps its sign, or it grows or falls all along.
    pub(crate) facets_told_by_ends: bool,
}

/// Encloses what H^(σ) does between two points of a curve. `None` for maps whose derivatives are not
/// enclosed, that are undefined near the chord, or of more than 50 residuals.
pub(crate) fn step_enclosure(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    from: &[f64],
    to: &[f64],
) -> Option<StepEnclosure> {
    let chord: Vec<f64> = to.iter().zip(from).map(|(b, a)| b - a).collect();
    let mut tangent = chord.clone();
    let length = norm(&chord);
    tangent.iter_mut().for_each(|t| *t /= length);
    let enclosed = Enclosed::new(map, selection, &tangent)?;
    let line = Line::new(&enclosed, from, to, &chord)?;
    let mut found = StepEnclosure {
        regular: false,
        rate: None,
        facets_told_by_ends: false,
    };
    for boxes in BOXES {
        if let Some(tube) = line.tube(&enclosed, boxes) {
            found = line.judge(&enclosed, &tube);
            if found.rate.is_some() && found.facets_told_by_ends {
                break;
            }
        }
    }
    Some(found)
}

/// The largest radius ρ = 2⁻ᵏ (k = 0 … 40; in units in which variables are typically 1) such that the
/// extended Jacobian (∇H^(σ) and `tangent` as a last row) is regular in the box |x′ − x| ≤ ρ: of each
/// hyperplane normal to the tangent, the box then holds one solution of H^(σ) = 0 at most. `None` if there is
/// none, or none is known.
pub(crate) fn regular_radius(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    x: &[f64],
    tangent: &[f64],
) -> Option<f64> {
    let enclosed = Enclosed::new(map, selection, tangent)?;
    (0..=40).map(|k| 0.5_f64.powi(k)).find(|&rho| {
        let derivative = enclosed.derivative(x, &vec![rho; x.len()]);
        derivative.is_some_and(|d| {
            let rows = d.defect.chunks_exact(x.len());
            rows.map(|row| row.iter().sum::<f64>()).fold(0.0, f64::max) < 1.0 - f64::EPSILON * x.len() as f64
        })
    })
}

/// The derivatives of one selection, enclosed.
struct Enclosed<'a> {
    expansions: Box<dyn Expansions + 'a>,
    selection: &'a Selection,
    tangent: &'a [f64],
    residuals: usize,
    tests: usize,
    /// The test functions of the facets of the cell.
    facets: Vec<usize>,
}

/// The derivative over a box, the rows of C A near those of the identity.
struct Derivative {
    /// C, by rows.
    inverse: Vec<f64>,
    /// G ≥ |I − C A| for all A, by rows.
    defect: Vec<f64>,
    /// Gradients of the test functions, by rows.
    gradients: Vec<(f64, f64)>,
}

/// Coefficients of residuals and of test functions.
type Coefficients = [Vec<(f64, f64)>; 2];

fn size((low, high): (f64, f64)) -> f64 {
    low.abs().max(high.abs())
}

/// A bound of sums of `terms` products of which each was rounded, from such a rounded sum of nonnegative
/// terms.
fn above(sum: f64, terms: usize) -> f64 {
    sum * (1.0 + 2.0 * terms as f64 * f64::EPSILON) + terms as f64 * f64::MIN_POSITIVE
}

/// y + G x, rounded up.
fn added(y: &[f64], g: &[f64], x: &[f64]) -> Vec<f64> {
    let rows = y.iter().zip(g.chunks_exact(x.len()));
    rows.map(|(y, row)| above(y + dot(row, x), x.len() + 2)).collect()
}

impl<'a> Enclosed<'a> {
    fn new(map: &'a dyn PiecewiseSmooth, selection: &'a Selection, tangent: &'a [f64]) -> Option<Self> {
        let (n, m) = (map.num_residuals(), map.num_vars());
        if n > LARGEST || m != n + 1 || tangent.len() != m || tangent.iter().any(|t| !t.is_finite()) {
            return None;
        }
        let layout = TestLayout::new(map);
        let of_site = |site: usize| {
            let first = layout.range(site).start;
            let facets = map.cell(site, selection.piece(site));
            facets.iter().map(move |f| first + f.test())
        };
        Some(Self {
            expansions: map.expansions()?,
            selection,
            tangent,
            residuals: n,
            tests: layout.total(),
            facets: (0..map.num_sites()).flat_map(of_site).collect(),
        })
    }

    /// Coefficients along lines in a direction through a box.
    fn coefficients(&self, centre: &[f64], radius: &[f64], direction: &[f64]) -> Option<Coefficients> {
        let everything = (f64::NEG_INFINITY, f64::INFINITY);
        let mut residual = vec![everything; TERMS * self.residuals];
        let mut tests = vec![everything; TERMS * self.tests];
        let known = self.expansions.derivatives_within(
            self.selection,
            centre,
            radius,
            direction,
            &mut residual,
            &mut tests,
        );
        known.then_some([residual, tests])
    }

    /// The extended derivative over a box, multiplied by the inverse of its middle.
    fn derivative(&self, centre: &[f64], radius: &[f64]) -> Option<Derivative> {
        let m = centre.len();
        let everything = (f64::NEG_INFINITY, f64::INFINITY);
        let mut entries = vec![everything; self.residuals * m];
        let mut gradients = vec![everything; self.tests * m];
        let known =
            self.expansions
                .jacobian_within(self.selection, centre, radius, &mut entries, &mut gradients);
        if !known || entries.iter().any(|e| !size(*e).is_finite()) {
            return None;
        }
        let middle: Vec<f64> = entries
            .iter()
            .map(|e| 0.5 * e.0 + 0.5 * e.1)
            .chain(self.tangent.iter().copied())
            .collect();
        let reach = entries.iter().zip(&middle);
        let mut reach: Vec<f64> = reach.map(|(e, c)| (e.1 - c).max(c - e.0).next_up()).collect();
        reach.resize(m * m, 0.0);
        let inverse = inverse(m, &middle)?;
        let mut defect = vec![0.0; m * m];
        for (i, row) in inverse.chunks_exact(m).enumerate() {
            for j in 0..m {
                let (mut sum, mut bound) = (0.0, 0.0);
                for (k, c) in row.iter().enumerate() {
                    let (value, reach) = (middle[k * m + j], reach[k * m + j]);
                    sum += c * value;
                    bound += c.abs() * (reach + (m + 2) as f64 * f64::EPSILON * value.abs());
                }
                let identity = if i == j { 1.0 } else { 0.0 };
                defect[i * m + j] = above((identity - sum).abs() + bound, m + 2);
            }
        }
        defect.iter().all(|d| d.is_finite()).then_some(Derivative {
            inverse,
            defect,
            gradients,
        })
    }
}

/// The inverse of a matrix given by rows, by rows.
fn inverse(m: usize, rows: &[f64]) -> Option<Vec<f64>> {
    let mut solver = DenseLu::new();
    // The rows are the columns of the transposed matrix, and so are those of its inverse.
    solver.factor_full(m, rows).ok()?;
    let mut inverse = vec![0.0; m * m];
    inverse.iter_mut().step_by(m + 1).for_each(|d| *d = 1.0);
    solver.solve_in_place(&mut inverse).ok()?;
    Some(inverse)
}

/// H and the test functions on a chord: on it, a function is its linear interpolation less s (1 − s) times
/// its second coefficient.
struct Line<'a> {
    from: &'a [f64],
    chord: &'a [f64],
    /// Bounds of |H| on the chord.
    residual: Vec<f64>,
    ends: [Coefficients; 2],
    between: Coefficients,
}

/// Boxes of one size along a chord that hold exactly one curve.
struct Tube {
    /// w
    half: Vec<f64>,
    derivatives: Vec<Derivative>,
}

impl<'a> Line<'a> {
    fn new(enclosed: &Enclosed<'_>, from: &'a [f64], to: &[f64], chord: &'a [f64]) -> Option<Self> {
        // The ends of the chord as they are rounded.
        let rounding = |(a, d): (&f64, &f64)| 2.0 * f64::EPSILON * (a.abs() + d.abs());
        let point: Vec<f64> = from.iter().zip(chord).map(rounding).collect();
        let ends = [
            enclosed.coefficients(from, &point, chord)?,
            enclosed.coefficients(to, &point, chord)?,
        ];
        let (centre, radius) = part(from, chord, 0, 1, &point);
        let between = enclosed.coefficients(&centre, &radius, chord)?;
        let at = |c: &Coefficients, k: usize| size(c[0][k]);
        let residual = (0..enclosed.residuals).map(|i| {
            let first = TERMS * i;
            above(
                at(&ends[0], first).max(at(&ends[1], first)) + 0.25 * at(&between, first + 2),
                2,
            )
        });
        Some(Self {
            from,
            chord,
            residual: residual.collect(),
            ends,
            between,
        })
    }

    /// The derivatives over the parts of the chord, each widened by `half`.
    fn derivatives(&self, enclosed: &Enclosed<'_>, boxes: usize, half: &[f64]) -> Option<Vec<Derivative>> {
        let parts = (0..boxes).map(|k| {
            let (centre, radius) = part(self.from, self.chord, k, boxes, half);
            enclosed.derivative(&centre, &radius)
        });
        parts.collect()
    }

    /// y ≥ |C F(z)| on the chord.
    fn correction(&self, derivative: &Derivative) -> Vec<f64> {
        let rows = derivative.inverse.chunks_exact(self.chord.len());
        rows.map(|row| {
            let terms = row.iter().zip(&self.residual).map(|(c, h)| c.abs() * h);
            above(terms.sum(), self.chord.len())
        })
        .collect()
    }

    fn tube(&self, enclosed: &Enclosed<'_>, boxes: usize) -> Option<Tube> {
        let m = self.chord.len();
        // The last digits of the points are no less uncertain than this.
        let least = 4.0 * f64::EPSILON * max_abs(self.from).max(max_abs(self.chord));
        let mut half = vec![least; m];
        for derivative in self.derivatives(enclosed, boxes, &half)? {
            let y = self.correction(&derivative);
            let mut own = y.clone();
            for _ in 0..ROUNDS {
                own = added(&y, &derivative.defect, &own);
            }
            // Room for the growth of G with the boxes; beyond a factor of two, more boxes are the better
            // answer.
            half.iter_mut()
                .zip(own)
                .for_each(|(h, own)| *h = h.max(2.0 * own));
        }
        if half.iter().any(|h| !h.is_finite()) {
            return None;
        }
        let derivatives = self.derivatives(enclosed, boxes, &half)?;
        let contracts = derivatives.iter().all(|d| {
            let image = added(&self.correction(d), &d.defect, &half);
            image.iter().zip(&half).all(|(image, half)| image < half)
        });
        contracts.then_some(Tube { half, derivatives })
    }

    fn judge(&self, enclosed: &Enclosed<'_>, tube: &Tube) -> StepEnclosure {
        let m = self.chord.len();
        let tangents: Vec<Vec<(f64, f64)>> = tube.derivatives.iter().map(|d| d.tangent(&tube.half)).collect();
        let along = |k: usize| {
            let parts = tube.derivatives.iter().zip(&tangents);
            common_sign(parts.map(|(d, tangent)| product(&d.gradients[k * m..(k + 1) * m], tangent)))
        };
        StepEnclosure {
            regular: true,
            rate: common_sign(tangents.iter().map(|t| t[m - 1])),
            facets_told_by_ends: enclosed
                .facets
                .iter()
                .all(|&k| self.keeps_sign(k, tube) || along(k).is_some()),
        }
    }

    /// Whether test function k has one sign in the tube.
    fn keeps_sign(&self, k: usize, tube: &Tube) -> bool {
        let m = self.chord.len();
        let [first, last] = self.ends.each_ref().map(|e| e[1][TERMS * k]);
        let bend = self.between[1][TERMS * k + 2];
        let aside = tube.derivatives.iter().map(|d| {
            let gradient = &d.gradients[k * m..(k + 1) * m];
            gradient.iter().zip(&tube.half).map(|(g, h)| size(*g) * h).sum()
        });
        let aside = above(aside.fold(0.0, f64::max), m);
        let room = |nearest: f64, bend: f64| nearest > above(0.25 * bend.max(0.0) + aside, 2);
        room(first.0.min(last.0), bend.1) || room(-first.1.max(last.1), -bend.0)
    }
}

impl Derivative {
    /// All tangents τ with ∇H τ = 0 and t·τ = 1 in the box: τ = c + (I − C A) τ with the last column c of C.
    /// `half` is a w with G w < w.
    fn tangent(&self, half: &[f64]) -> Vec<(f64, f64)> {
        let m = half.len();
        let column: Vec<f64> = self.inverse.iter().skip(m - 1).step_by(m).copied().collect();
        let sizes: Vec<f64> = column.iter().map(|c| c.abs()).collect();
        let zero = vec![0.0; m];
        // In the norm max |τ| / w the defect is at most q < 1.
        let ratio = |x: &[f64]| x.iter().zip(half).fold(0.0_f64, |r, (x, w)| r.max(x / w));
        let q = ratio(&added(&zero, &self.defect, half));
        let bound = above(ratio(&sizes) / (1.0 - q), 4);
        let mut bounds: Vec<f64> = half.iter().map(|w| above(w * bound, 1)).collect();
        for _ in 0..ROUNDS {
            let next = added(&sizes, &self.defect, &bounds);
            bounds.iter_mut().zip(next).for_each(|(b, next)| *b = b.min(next));
        }
        let reach = added(&zero, &self.defect, &bounds);
        column
            .iter()
            .zip(reach)
            .map(|(c, r)| ((c - r).next_down(), (c + r).next_up()))
            .collect()
    }
}

/// Centre and radius of part k of `parts` of a chord, widened by `half`.
fn part(from: &[f64], chord: &[f64], k: usize, parts: usize, half: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let middle = (k as f64 + 0.5) / parts as f64;
    let centre: Vec<f64> = from.iter().zip(chord).map(|(a, d)| a + middle * d).collect();
    let sides = chord.iter().zip(half).zip(from.iter().zip(&centre));
    let radius = sides.map(|((d, w), (a, c))| {
        // Rounding of the centre included.
        above(
            0.5 * d.abs() / parts as f64 + w + f64::EPSILON * (a.abs() + c.abs() + d.abs()),
            4,
        )
    });
    let radius = radius.collect();
    (centre, radius)
}

/// An enclosure of a product of vectors.
fn product(a: &[(f64, f64)], b: &[(f64, f64)]) -> (f64, f64) {
    let (mut low, mut high, mut sizes) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let products = [a.0 * b.0, a.0 * b.1, a.1 * b.0, a.1 * b.1];
        low += products.iter().fold(f64::INFINITY, |l, p| l.min(*p));
        high += products.iter().fold(f64::NEG_INFINITY, |h, p| h.max(*p));
        sizes += size(*a) * size(*b);
    }
    let rounding = above(f64::EPSILON * (a.len() + 2) as f64 * sizes, a.len() + 2);
    if !rounding.is_finite() {
        return (f64::NEG_INFINITY, f64::INFINITY);
    }
    (low - rounding, high + rounding)
}

/// The sign that all of these have; `None` where one may be zero or is no number.
fn common_sign(ends: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let mut signs = ends.map(|(low, high)| {
        if low > 0.0 {
            Some(1.0)
        } else if high < 0.0 {
            Some(-1.0)
        } else {
            None
        }
    });
    let first = signs.next()??;
    signs.all(|s| s == Some(first)).then_some(first)
}

#[cfg(all(test, feature = "autodiff"))]
mod tests;
