//! Solved, row by row.

use super::parts::Parts;
use super::{Columns, equilibrate};
use crate::sparse::max_abs;
use crate::tolerances::{ROUNDING, SUM, UNCANCELLED};

/// Rounding that may hide a contradiction between the rows of a singular part, as a part of their terms: eight times [`ROUNDING`]. At the
/// default tolerance none above 2e-7 of the constants passes (`contradictory_equations_are_never_solved` of tests/mcp).
const HIDING: f64 = 8.0 * ROUNDING;

/// A point and the residual f there, of square equations or of the complementarity problem of f and its bounds.
///
/// The *terms* of row i are the |Jᵢⱼ xⱼ| and its *constants*: |fᵢ − Σⱼ Jᵢⱼ xⱼ|, and the terms of unknowns at their bounds.
#[derive(Clone, Copy)]
pub(crate) struct Point<'a> {
    pub(crate) x: &'a [f64],
    pub(crate) f: &'a [f64],
    pub(crate) jac: Columns<'a>,
    /// f − J x, where it is known without cancellation: then 0 is exact.
    pub(crate) rest: Option<&'a [f64]>,
    /// Where the run began; empty where nothing was met but x.
    pub(crate) start: &'a [f64],
    /// Typical sizes of the unknowns; empty for 1.
    pub(crate) typical: &'a [f64],
    /// Sizes of the unknowns in place of |x|, for solvers that are accurate relative to whole blocks.
    pub(crate) sizes: Option<&'a [f64]>,
    /// Bounds; empty for equations. x may lie slightly outside of them: the distance counts as an error.
    pub(crate) lower: &'a [f64],
    pub(crate) upper: &'a [f64],
}

impl Point<'_> {
    fn bounds(&self, i: usize) -> (f64, f64) {
        let bound = |b: &[f64], none: f64| b.get(i).copied().unwrap_or(none);
        (
            bound(self.lower, f64::NEG_INFINITY),
            bound(self.upper, f64::INFINITY),
        )
    }

    /// Whether the component is at a bound at which f has the required sign.
    fn rests(&self, i: usize) -> bool {
        let ((l, u), x, f) = (self.bounds(i), self.x[i], self.f[i]);
        (x == l && f >= 0.0) || (x == u && f <= 0.0) || l == u
    }

    fn typical(&self, j: usize) -> f64 {
        self.typical.get(j).copied().unwrap_or(1.0)
    }
}

/// How near a point is to a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Verdict {
    /// Largest residual of a component relative to the terms and constants of its row; where all of these are rounding, relative to the
    /// row at the sizes that were met.
    pub(crate) error: f64,
    /// The same with every row relative to its own terms and constants.
    pub(crate) strict: f64,
    /// Over rows whose part of the Jacobian is singular, where the terms cancel whatever the constants are: the largest residual beyond
    /// rounding relative to the constants, and the largest square of what rounding is relative to them, which lets no more than √τ of them
    /// pass at a tolerance τ.
    pub(crate) hidden: f64,
    /// Over rows whose part is regular, the largest square of what residual and rounding are relative to the constants: nothing is hidden
    /// there if the rows are straight.
    pub(crate) distant: f64,
    /// Whether a row vanishes with all its terms although its unknowns do not: flat, or its numbers underflow.
    pub(crate) flat: bool,
}

impl Verdict {
    /// Whether the point is solved to a tolerance, where rows are straight: affine in all unknowns.
    pub(crate) fn is_solved(self, tolerance: f64) -> bool {
        self.error <= tolerance && self.hidden <= tolerance
    }

    /// Whether that depends on rows being straight.
    pub(crate) fn needs_straight(self, tolerance: f64) -> bool {
        exceeds(self.distant, tolerance)
    }

    /// Whether some residual is not small relative to its terms.
    pub(crate) fn is_open(self) -> bool {
        self.error >= UNCANCELLED
    }

    /// Whether the residuals are only rounding errors of the terms.
    pub(crate) fn is_rounding(self) -> bool {
        self.error <= ROUNDING
    }
}

/// What is known of a row.
#[derive(Debug, Clone, Copy, Default)]
struct Row {
    /// Σ|Jᵢⱼ xⱼ| over the unknowns between their bounds.
    variable: f64,
    /// Sum of the constants.
    constant: f64,
    /// Σⱼ Jᵢⱼ xⱼ, from which constants follow; later Σ|Jᵢⱼ| mⱼ with the sizes that were met.
    sum: f64,
    /// Σ|Jᵢⱼ| sⱼ with typical sizes s.
    typical: f64,
}

impl Row {
    fn terms(&self) -> f64 {
        self.variable + self.constant
    }

    /// What is unknown beside a constant where the rows of the part depend on each other: the residual beyond rounding, and the square of what
    /// rounding may hide.
    fn conceals(&self, residual: f64, constant: f64) -> f64 {
        let beyond = (residual.abs() - SUM * self.variable).max(0.0);
        larger(
            share(beyond, constant),
            share(HIDING * self.variable, constant).powi(2),
        )
    }

    /// Whether all terms and constants are rounding of the row at the sizes that were met, with which `sum` was made.
    fn is_rounding(&self) -> bool {
        self.terms() <= ROUNDING * self.sum
    }
}

/// Decides whether points are solutions; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Judge {
    rows: Vec<Row>,
    /// Sizes at which unknowns were met.
    met: Vec<f64>,
    /// Rows with a term that is more than rounding of these, by a coefficient that is more than rounding of its row.
    loud: Vec<bool>,
    /// Rows that have constants, or unknowns of other parts.
    told: Vec<bool>,
    parts: Parts,
    is_found: bool,
    /// Factors of rows and units of unknowns in which J is equilibrated.
    factors: Vec<f64>,
    columns: Vec<f64>,
    room: Vec<f64>,
    /// Whether each part is regular, once asked.
    regular: Vec<Option<bool>>,
    /// The largest constants of the rows of each part, in units in which J is equilibrated, once asked.
    constants: Vec<Option<f64>>,
    /// The rows that [`Verdict::distant`] is about.
    distant: Vec<usize>,
    /// The rows whose terms and constants all are rounding, and whose residual is not small relative to these.
    homogeneous: Vec<usize>,
}

impl Judge {
    /// The verdict on a point; `tolerance` only says how closely it must be looked at.
    pub(crate) fn verdict(&mut self, p: &Point<'_>, tolerance: f64) -> Verdict {
        self.verdict_with(p, tolerance, tolerance)
    }

    /// The same, if what is hidden has a tolerance of its own, at most the other one.
    pub(crate) fn verdict_with(&mut self, p: &Point<'_>, tolerance: f64, of_hidden: f64) -> Verdict {
        let n = p.x.len();
        self.is_found = false;
        self.distant.clear();
        self.homogeneous.clear();
        self.read(p);
        let (mut error, mut failing) = (0.0_f64, 0);
        for i in 0..n {
            let e = self.error(p, i);
            failing += usize::from(exceeds(e, tolerance));
            error = larger(error, e);
        }
        let strict = error;
        if failing > 0 && self.may_be_homogeneous(p, tolerance) {
            error = self.error_of_homogeneous(p, tolerance);
        }
        let (mut hidden, mut distant) = (0.0, 0.0);
        if error <= tolerance && p.sizes.is_none() {
            (hidden, distant) = self.hidden(p, of_hidden);
        }
        Verdict {
            error,
            strict,
            hidden,
            distant,
            flat: self.is_flat(p),
        }
    }

    /// The first row, at a point whose residuals others have judged, of a part that is singular and whose constants are hidden by the rounding
    /// of its terms. Of curved rows what is beside their derivatives may be noise: constants are at least as large as the terms of a typical
    /// x, and as the largest of their part.
    pub(crate) fn conceals(&mut self, p: &Point<'_>, tolerance: f64) -> Option<usize> {
        self.is_found = false;
        self.read(p);
        let largest = |row: &Row| row.constant.max(row.typical);
        let mut of_parts = Vec::new();
        for i in 0..p.x.len() {
            let row = self.rows[i];
            if row.conceals(p.f[i], largest(&row)) <= tolerance {
                continue;
            }
            self.find_parts(p);
            let Some(part) = self.parts.of(i) else { continue };
            let scaled = |&k: &usize| largest(&self.rows[k]) * self.factors[k];
            of_parts.resize(self.parts.len(), None);
            let constant = *of_parts[part].get_or_insert_with(|| {
                { self.parts.members(part).iter() }
                    .map(scaled)
                    .fold(0.0, f64::max)
            });
            let constant = constant / self.factors[i];
            if exceeds(row.conceals(p.f[i], constant), tolerance) && !self.is_regular(p, part) {
                return Some(i);
            }
        }
        None
    }

    /// Euclidean norm of what rounding leaves in the sums of the rows read last.
    pub(crate) fn rounding(&self) -> f64 {
        let squares = self.rows.iter().map(|row| (SUM * row.terms()).powi(2));
        squares.sum::<f64>().sqrt()
    }

    /// The rows, increasing, that the last verdict measures at the sizes that were met. Where their derivatives change within a small part of
    /// x, these do not say how large a residual may be: ln x at 1e-200.
    pub(crate) fn homogeneous_rows(&self) -> &[usize] {
        &self.homogeneous
    }

    /// The rows, increasing, that must be straight, if the last verdict [needs](Verdict::needs_straight) it.
    pub(crate) fn distant_rows(&self) -> &[usize] {
        &self.distant
    }

    /// Terms and constants of all rows.
    fn read(&mut self, p: &Point<'_>) {
        let n = p.x.len();
        self.rows.clear();
        self.rows.resize(n, Row::default());
        for j in 0..n {
            let x = p.x[j];
            let (l, u) = p.bounds(j);
            let (size, typical) = (p.sizes.map_or(x, |sizes| sizes[j]).abs(), p.typical(j));
            let moves = x != l && x != u;
            p.jac.each(j, |i, v| {
                let row = &mut self.rows[i];
                let term = v.abs() * size;
                match moves {
                    true => row.variable += term,
                    false => row.constant += term,
                }
                row.sum += v * x;
                row.typical += v.abs() * typical;
            });
        }
        for (i, row) in self.rows.iter_mut().enumerate() {
            row.constant += p.rest.map_or_else(|| p.f[i] - row.sum, |rest| rest[i]).abs();
        }
    }

    /// The residual of one component relative to the terms of its row; NaN where f is.
    fn error(&self, p: &Point<'_>, i: usize) -> f64 {
        let (f, x) = (p.f[i], p.x[i]);
        let (l, u) = p.bounds(i);
        let outside = (l - x).max(x - u);
        if outside > 0.0 {
            return self.shift(p, i, outside);
        }
        if f == 0.0 || p.rests(i) {
            return 0.0;
        }
        self.part(i, f.abs())
    }

    /// A part of the terms of a row; infinite where these are above the largest number, since they hide any residual then.
    fn part(&self, row: usize, size: f64) -> f64 {
        match self.rows[row].terms() {
            f64::INFINITY => f64::INFINITY,
            terms => size / terms,
        }
    }

    /// The largest relative change of a row, with respect to its terms, when x_i moves by `length`.
    fn shift(&self, p: &Point<'_>, i: usize, length: f64) -> f64 {
        let mut worst: Option<f64> = None;
        p.jac.each(i, |row, v| {
            let change = (v * length).abs();
            if change > 0.0 {
                worst = Some(worst.unwrap_or(0.0).max(self.part(row, change)));
            }
        });
        worst.unwrap_or(length / p.x[i].abs())
    }

    /// Finds the parts of the unknowns that do not rest at bounds, and units in which J is equilibrated, once a point.
    fn find_parts(&mut self, p: &Point<'_>) {
        if !std::mem::replace(&mut self.is_found, true) {
            let n = p.x.len();
            for units in [&mut self.factors, &mut self.columns, &mut self.room] {
                units.clear();
                units.resize(n, 1.0);
            }
            if let Columns::Long(jac) = p.jac {
                equilibrate(jac, &mut self.factors, &mut self.columns, &mut self.room);
            }
            self.parts.find(p.jac, p.x.len(), &|i| !p.rests(i));
            self.regular.clear();
            self.regular.resize(self.parts.len(), None);
            self.constants.clear();
            self.constants.resize(self.parts.len(), None);
        }
    }

    /// Whether every row that fails may be one whose terms all are rounding: cheap, and yes too often. Known constants never are rounding.
    fn may_be_homogeneous(&mut self, p: &Point<'_>, tolerance: f64) -> bool {
        let n = p.x.len();
        let known = |i: usize| p.rest.is_some_and(|rest| rest[i] != 0.0);
        if p.sizes.is_some() || (0..n).any(|i| known(i) && exceeds(self.error(p, i), tolerance)) {
            return false;
        }
        let all = max_abs(p.x).max(max_abs(p.start));
        self.met.clear();
        self.met.resize(n, all);
        for (j, met) in self.met.iter_mut().enumerate() {
            let rows = &self.rows;
            p.jac.each(j, |i, v| {
                if v != 0.0 {
                    *met = met.max(rows[i].terms() / v.abs());
                }
            });
        }
        self.add_up(p);
        (0..n).all(|i| self.error(p, i) <= tolerance || !self.loud[i])
    }

    /// Finds the sizes at which unknowns were met: the largest of their part, in units in which J is equilibrated; of the start, too, where
    /// nothing else tells of sizes, neither constants nor unknowns of other parts.
    fn meet(&mut self, p: &Point<'_>) {
        self.find_parts(p);
        let mut told = std::mem::take(&mut self.told);
        told.clear();
        told.extend(self.rows.iter().map(|row| row.constant > SUM * row.variable));
        self.met.clear();
        self.met.extend(p.x.iter().map(|x| x.abs()));
        // An unknown's part comes after the parts of all rows that depend on it.
        for part in (0..self.parts.len()).rev() {
            let members = self.parts.members(part);
            let from_start = !p.start.is_empty() && !members.iter().any(|&k| told[k]);
            let size = |j: usize| {
                if from_start {
                    p.x[j].abs().max(p.start[j].abs())
                } else {
                    p.x[j].abs()
                }
            };
            let largest = members
                .iter()
                .fold(0.0_f64, |m, &j| m.max(size(j) / self.columns[j]));
            for &j in members {
                self.met[j] = largest * self.columns[j];
                if self.is_loud(p, j) {
                    p.jac.each(j, |i, v| told[i] |= v != 0.0);
                }
            }
        }
        self.told = told;
        self.add_up(p);
    }

    /// Whether an unknown is more than rounding: of the size at which it was met, or to a row that has constants. What a curved row has beside
    /// its derivatives is none where it vanishes with the unknowns.
    fn is_loud(&self, p: &Point<'_>, j: usize) -> bool {
        let x = p.x[j].abs();
        let mut loud = x > ROUNDING * self.met[j];
        p.jac.each(j, |i, v| {
            let row = &self.rows[i];
            let has_constant = row.constant > SUM * row.variable
                && (p.rest.is_some() || row.constant > ROUNDING * row.typical);
            loud |= has_constant && v.abs() * x > ROUNDING * row.terms();
        });
        loud
    }

    /// Σ|Jᵢⱼ| mⱼ for all rows, in their `sum`, with the sizes m that were met, and which rows have a term beyond rounding.
    fn add_up(&mut self, p: &Point<'_>) {
        self.rows.iter_mut().for_each(|row| row.sum = 0.0);
        let n = p.x.len();
        for j in 0..n {
            p.jac.each(j, |i, v| self.rows[i].sum += v.abs() * self.met[j]);
        }
        self.loud.clear();
        self.loud.resize(n, false);
        for j in 0..n {
            if self.is_loud(p, j) {
                p.jac.each(j, |i, v| {
                    self.loud[i] |= v.abs() * self.met[j] > ROUNDING * self.rows[i].sum;
                });
            }
        }
    }

    /// The largest error, where rows whose terms and constants are rounding are measured at the sizes met.
    fn error_of_homogeneous(&mut self, p: &Point<'_>, tolerance: f64) -> f64 {
        self.meet(p);
        let mut worst = 0.0;
        for i in 0..p.x.len() {
            let (mut e, row) = (self.error(p, i), &self.rows[i]);
            if exceeds(e, tolerance) && !self.loud[i] && row.is_rounding() {
                e = p.f[i].abs() / row.sum;
                self.homogeneous.push(i);
            }
            worst = larger(worst, e);
        }
        worst
    }

    /// The constants of a row beside which residual and rounding are looked at; 0 where it is known to have none. Where they are not given
    /// and no more than the rounding of the terms, there may be others that round away: they are assumed to be as large as the terms of a
    /// typical x.
    fn constants(&self, p: &Point<'_>, i: usize) -> f64 {
        let row = &self.rows[i];
        match p.rest.is_some() || row.constant > ROUNDING * row.variable {
            true => row.constant,
            false => row.constant.max(row.typical),
        }
    }

    /// [`Verdict::hidden`] and [`Verdict::distant`], each looked at only where the tolerance asks for it.
    fn hidden(&mut self, p: &Point<'_>, tolerance: f64) -> (f64, f64) {
        let n = p.x.len();
        // The least part that constants have of the terms, of all rows that have any: a quick look at rows without.
        let mut least = f64::INFINITY;
        for i in (0..n).filter(|&i| !p.rests(i)) {
            let constant = self.constants(p, i);
            if constant > 0.0 {
                least = least.min(constant / self.rows[i].terms());
            }
        }
        let (mut hidden, mut distant) = (0.0, 0.0);
        for i in (0..n).filter(|&i| !p.rests(i)) {
            let (constant, row) = (self.constants(p, i), self.rows[i]);
            let (left, rounding) = (p.f[i].abs(), SUM * row.variable);
            let quick = if constant > 0.0 {
                constant
            } else {
                row.terms() * least
            };
            let singular = |c: f64| row.conceals(left, c);
            if singular(quick) <= tolerance {
                continue;
            }
            self.find_parts(p);
            let Some(part) = self.parts.of(i) else { continue };
            let constant = self.constants_of_part(p, part, i);
            let if_singular = singular(constant);
            if if_singular <= tolerance {
                continue;
            }
            if !self.is_regular(p, part) {
                hidden = larger(hidden, if_singular);
                continue;
            }
            let if_regular = share(left + rounding, constant).powi(2);
            if exceeds(if_regular, tolerance) {
                distant = larger(distant, if_regular);
                self.distant.push(i);
            }
        }
        (hidden, distant)
    }

    /// The constants of a row; where they are rounding of the largest of its part, in units in which J is equilibrated, these.
    fn constants_of_part(&mut self, p: &Point<'_>, part: usize, i: usize) -> f64 {
        let scaled = |k: usize| self.constants(p, k) * self.factors[k];
        // Once a part: its rows may be all there are.
        let largest = self.constants[part].unwrap_or_else(|| {
            let members = self.parts.members(part).iter();
            members.fold(0.0_f64, |m, &k| m.max(scaled(k)))
        });
        let own = scaled(i);
        self.constants[part] = Some(largest);
        match own > ROUNDING * largest {
            true => self.constants(p, i),
            false => largest / self.factors[i],
        }
    }

    fn is_regular(&mut self, p: &Point<'_>, part: usize) -> bool {
        if let Some(known) = self.regular[part] {
            return known;
        }
        let found = self.parts.is_regular(part, p.jac);
        self.regular[part] = Some(found);
        found
    }

    fn is_flat(&self, p: &Point<'_>) -> bool {
        let empty = |i: usize| {
            let (l, u) = p.bounds(i);
            self.rows[i].terms() == 0.0 && p.x[i] != l && p.x[i] != u
        };
        let n = p.x.len();
        (0..n).any(empty)
            && (0..n).any(|j| {
                let mut acts = false;
                p.jac.each(j, |i, _| acts |= empty(i));
                p.x[j] != 0.0 && acts
            })
    }
}

/// What is unknown relative to the constants; 0 where nothing is.
fn share(unknown: f64, constants: f64) -> f64 {
    match unknown == 0.0 {
        true => 0.0,
        false => unknown / constants,
    }
}

/// Whether an error is above a tolerance, or NaN.
fn exceeds(error: f64, tolerance: f64) -> bool {
    error > tolerance || error.is_nan()
}

/// The larger one, NaN if there is one.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}
