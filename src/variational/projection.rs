//! Projection onto a polyhedron by the dual active-set method of D. Goldfarb and A. Idnani (1983) with the identity as Hessian.

use super::emptiness::emptiness;
use super::limits::{Limit, limits_of};
use super::multipliers::Kind;
use super::{Multipliers, Polyhedron};
use crate::complementarity::ComplementarityError;
use crate::exact::Exact;
use crate::input::check_vector;
use crate::judge::Emptiness;
use crate::sparse::{dot, max_abs, norm};
use crate::tolerances::{CHECKED, LEFT, RADIUS, ROUNDING};

/// How often rows are checked again after the rounding errors of earlier steps have been removed.
const LOOKS: usize = 2;

/// Result of a projection.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Projection {
    /// The nearest point.
    Nearest(Nearest),
    /// The polyhedron is empty, even if each of its constants were to move by 2⁻⁵³ of itself (zeros and integers stay as they are): what
    /// contradicts itself by less, as 0.1 + 0.2 = 0.3 does, was meant to have a point.
    Empty(Infeasibility),
}

/// The point y of C nearest to x: y − x + Aᵀλ + Eᵀμ − ρₗ + ρᵤ = 0, multipliers complementary to their constraints.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Nearest {
    /// The point, length n. Active bounds hold exactly, other constraints at least to 1e-10 of their terms and of the largest component of
    /// this point and of the projected one.
    pub x: Vec<f64>,
    /// Multipliers; those of constraints that are not active are 0.
    pub multipliers: Multipliers,
    /// Whether C is empty as stored, by exact arithmetic, but not if its constants move by 2⁻⁵³ of themselves: the point is one of these
    /// sets.
    pub within_rounding: bool,
}

/// A certificate after J. Farkas (1902): y, ρₗ, ρᵤ ≥ 0 with Aᵀy + Eᵀw − ρₗ + ρᵤ = 0 and bᵀy + dᵀw − lᵀρₗ + uᵀρᵤ < 0.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Infeasibility {
    /// y, w, ρₗ and ρᵤ, the largest coefficient of a row of length 1 being 1.
    pub multipliers: Multipliers,
    /// bᵀy + dᵀw − lᵀρₗ + uᵀρᵤ, negative.
    pub value: f64,
    /// There is no point x with ‖x‖_∞ below this radius. Infinite where exact arithmetic has confirmed that the constraints, with their
    /// floating-point data taken as exact, contradict each other. Where they are too many for that (more than 5 000 entries), the first
    /// condition holds up to rounding, which leaves a radius of at least 10¹² times the size of the data.
    pub radius: f64,
}

impl Infeasibility {
    /// The certificate of a polyhedron with these multipliers, if they are one.
    pub(super) fn of(set: &Polyhedron, multipliers: Multipliers) -> Option<Self> {
        let m = &multipliers;
        // Sums without rounding, so that the radius is right. Numbers of a polyhedron are finite.
        let exact = |v: f64| Exact::new(v).unwrap_or_default();
        let bounds = m.upper.iter().zip(&m.lower);
        let mut rest: Vec<Exact> = bounds.map(|(u, l)| &exact(*u) - &exact(*l)).collect();
        let mut value = Exact::default();
        for (rows, factors) in [(&set.a, &m.inequalities), (&set.e, &m.equations)] {
            for (j, i, v) in rows.transposed.triplets() {
                rest[j] = &rest[j] + &(&exact(v) * &exact(factors[i]));
            }
            for (right, factor) in rows.right.iter().zip(factors) {
                value = &value + &(&exact(*right) * &exact(*factor));
            }
        }
        for (bounds, factors, sign) in [(&set.lower, &m.lower, -1.0), (&set.upper, &m.upper, 1.0)] {
            for (bound, factor) in bounds.iter().zip(factors).filter(|p| *p.1 != 0.0) {
                value = &value + &(&exact(sign * bound) * &exact(*factor));
            }
        }
        let value = value.to_f64();
        let signs = [&m.inequalities, &m.lower, &m.upper];
        let valid = value < 0.0 && signs.iter().all(|v| v.iter().all(|v| *v >= 0.0));
        let size: f64 = rest.iter().map(|r| r.to_f64().abs()).sum();
        valid.then(|| Self {
            radius: if size == 0.0 { f64::INFINITY } else { -value / size },
            value,
            multipliers,
        })
    }
}

struct Solver<'a> {
    set: &'a Polyhedron,
    kinds: Vec<Kind>,
    /// Norms of rows; 0 for empty ones.
    norms: Vec<f64>,
    /// −1 for equations that are approached from above.
    signs: Vec<f64>,
    y: Vec<f64>,
    /// Largest component of the point that is projected.
    far: f64,
    /// Orthonormal basis of the active normals, one vector each, and the triangle R with N = Q R, column by column.
    q: Vec<Vec<f64>>,
    r: Vec<Vec<f64>>,
    active: Vec<usize>,
    u: Vec<f64>,
    is_active: Vec<bool>,
    /// Rows that are linearly dependent on the active ones and satisfied up to rounding.
    skipped: Vec<bool>,
    /// Whether some of them contradict the others as stored, but not with moved constants.
    within_rounding: bool,
}

enum Added {
    Yes,
    Redundant,
    Empty(Multipliers),
}

impl Polyhedron {
    /// The point of C nearest to x in the Euclidean norm, with its multipliers, or a certificate that C is
    /// empty, by the dual active-set method of D. Goldfarb and A. Idnani (1983).
    ///
    /// # Complexity
    /// O(n (m + k + n)) operations a change of the active set, of which there are rarely more than a few for
    /// each active constraint.
    ///
    /// # Errors
    /// x of the wrong length or not finite; constraints that are linearly dependent up to rounding
    /// ([`ComplementarityError::Unresolved`]).
    pub fn project(&self, x: &[f64]) -> Result<Projection, ComplementarityError> {
        check_vector("x", x, self.dimension())?;
        project(self, x)
    }
}

fn project(set: &Polyhedron, x: &[f64]) -> Result<Projection, ComplementarityError> {
    let mut solver = Solver::new(set, x);
    if let Some(empty) = solver.empty_rows().or_else(|| solver.empty_intervals()) {
        return Ok(Projection::Empty(empty));
    }
    let limit = 100 * (solver.kinds.len() + x.len()) + 1000;
    let mut steps = 0;
    let equations = (0..solver.kinds.len()).filter(|&p| solver.is_equation(p));
    let mut waiting: Vec<usize> = equations.rev().collect();
    let mut looks = LOOKS;
    loop {
        let p = match waiting.pop().or_else(|| solver.most_violated()) {
            Some(p) => p,
            None => {
                solver.finish();
                looks -= 1;
                match solver.most_violated() {
                    Some(p) if looks > 0 => p,
                    _ => break,
                }
            }
        };
        match solver.add(p, &mut steps, limit)? {
            Added::Yes | Added::Redundant => {}
            Added::Empty(multipliers) => {
                if let Some(certificate) = solver.confirmed(multipliers) {
                    return Ok(Projection::Empty(certificate));
                }
                // Whether it holds nevertheless is measured at the end.
                solver.skipped[p] = true;
            }
        }
    }
    // Rows dependent on the active ones up to rounding have been skipped.
    match solver.violated() {
        Some(row) => Err(ComplementarityError::Unresolved { steps, row }),
        None => Ok(Projection::Nearest(solver.nearest(x))),
    }
}

impl<'a> Solver<'a> {
    fn new(set: &'a Polyhedron, x: &[f64]) -> Self {
        let mut kinds: Vec<Kind> = (0..set.e.len()).map(Kind::Equation).collect();
        let fixed = |j: &usize| set.lower[*j] == set.upper[*j];
        kinds.extend((0..x.len()).filter(fixed).map(Kind::Fixed));
        kinds.extend((0..set.a.len()).map(Kind::Inequality));
        let bounded = |bounds: &'a [f64]| (0..x.len()).filter(move |&j| bounds[j].is_finite() && !fixed(&j));
        kinds.extend(bounded(&set.lower).map(Kind::Lower));
        kinds.extend(bounded(&set.upper).map(Kind::Upper));
        let length = |rows: &super::polyhedron::Rows, i: usize| {
            let row: Vec<f64> = rows.row(i).map(|e| e.1).collect();
            norm(&row)
        };
        let norms = kinds.iter().map(|kind| match *kind {
            Kind::Equation(i) => length(&set.e, i),
            Kind::Inequality(i) => length(&set.a, i),
            _ => 1.0,
        });
        Self {
            norms: norms.collect(),
            signs: vec![1.0; kinds.len()],
            is_active: vec![false; kinds.len()],
            skipped: vec![false; kinds.len()],
            set,
            kinds,
            y: x.to_vec(),
            far: max_abs(x),
            q: Vec::new(),
            r: Vec::new(),
            active: Vec::new(),
            u: Vec::new(),
            within_rounding: false,
        }
    }

    fn is_equation(&self, p: usize) -> bool {
        matches!(self.kinds[p], Kind::Equation(_) | Kind::Fixed(_))
    }

    /// Calls `with` for each entry of the normal of row p.
    fn each_entry(&self, p: usize, mut with: impl FnMut(usize, f64)) {
        match self.kinds[p] {
            Kind::Equation(i) => {
                let factor = self.signs[p] / self.norms[p];
                self.set.e.row(i).for_each(|(j, v)| with(j, factor * v));
            }
            Kind::Inequality(i) => self.set.a.row(i).for_each(|(j, v)| with(j, -v / self.norms[p])),
            Kind::Lower(j) => with(j, 1.0),
            Kind::Upper(j) => with(j, -1.0),
            Kind::Fixed(j) => with(j, self.signs[p]),
        }
    }

    fn right(&self, p: usize) -> f64 {
        match self.kinds[p] {
            Kind::Equation(i) => self.signs[p] * self.set.e.right[i] / self.norms[p],
            Kind::Inequality(i) => -self.set.a.right[i] / self.norms[p],
            Kind::Lower(j) => self.set.lower[j],
            Kind::Upper(j) => -self.set.upper[j],
            Kind::Fixed(j) => self.signs[p] * self.set.lower[j],
        }
    }

    /// nᵀy − β, and the size of its terms.
    fn slack(&self, p: usize) -> (f64, f64) {
        let right = self.right(p);
        let (mut sum, mut size) = (-right, right.abs());
        self.each_entry(p, |j, v| {
            sum += v * self.y[j];
            size += (v * self.y[j]).abs();
        });
        (sum, size)
    }

    /// A row 0 x ≤ b < 0, 0 x = d ≠ 0 or l > u proves that there is no point.
    fn empty_rows(&self) -> Option<Infeasibility> {
        let set = self.set;
        let mut certificate = self.no_multipliers();
        for j in 0..self.y.len() {
            if set.lower[j] > set.upper[j] {
                certificate.lower[j] = 1.0;
                certificate.upper[j] = 1.0;
                return Infeasibility::of(set, certificate);
            }
        }
        let impossible = (0..self.kinds.len()).find(|&p| {
            self.norms[p] == 0.0
                && match self.kinds[p] {
                    Kind::Equation(i) => set.e.right[i] != 0.0,
                    Kind::Inequality(i) => set.a.right[i] < 0.0,
                    _ => false,
                }
        })?;
        match self.kinds[impossible] {
            Kind::Equation(i) => certificate.equations[i] = -set.e.right[i].signum(),
            Kind::Inequality(i) => certificate.inequalities[i] = 1.0,
            _ => {}
        }
        Infeasibility::of(set, certificate)
    }

    /// Two constraints of one unknown each that leave no number between them: they are compared exactly, since a projection cannot tell
    /// a contradiction in the last digits from rounding.
    fn empty_intervals(&mut self) -> Option<Infeasibility> {
        // The greatest lower and the least upper limit of each unknown.
        let mut limits: Vec<[Option<Limit>; 2]> = vec![[None; 2]; self.y.len()];
        for kind in self.kinds.iter().copied() {
            for (j, side, limit) in limits_of(self.set, kind).into_iter().flatten() {
                let sign = [1.0, -1.0][side];
                let best = &mut limits[j][side];
                if best.is_none_or(|b| sign * limit.at > sign * b.at) {
                    *best = Some(limit);
                }
            }
        }
        limits.iter().enumerate().find_map(|(j, pair)| {
            let [Some(lower), Some(upper)] = *pair else {
                return None;
            };
            // Quotients are rounded: where they agree, the rows may contradict each other all the same.
            let is_rounded = lower.coefficient != 1.0 || upper.coefficient != 1.0;
            if lower.kind == upper.kind || lower.at < upper.at || (lower.at == upper.at && !is_rounded) {
                return None;
            }
            let mut multipliers = self.no_multipliers();
            lower.weigh(j, -upper.coefficient.abs(), &mut multipliers);
            upper.weigh(j, lower.coefficient.abs(), &mut multipliers);
            self.confirmed(multipliers)
        })
    }

    /// The certificate with multipliers that are right up to rounding, if the set is empty in exact arithmetic, or else by a wide margin.
    fn confirmed(&mut self, multipliers: Multipliers) -> Option<Infeasibility> {
        let mut certificate = Infeasibility::of(self.set, multipliers)?;
        match emptiness(self.set, &certificate.multipliers) {
            Some(Emptiness::Empty) => certificate.radius = f64::INFINITY,
            Some(found) => {
                self.within_rounding |= found == Emptiness::WithinRounding;
                return None;
            }
            None => {
                let size = (0..self.kinds.len())
                    .filter(|&p| self.norms[p] > 0.0)
                    .fold(self.far.max(max_abs(&self.y)), |m, p| m.max(self.right(p).abs()));
                if certificate.radius < RADIUS * size {
                    return None;
                }
            }
        }
        Some(certificate)
    }

    /// Whether constraints contradict each other however their constants were rounded. Exact arithmetic decides where the constants, moved,
    /// do not make up for the contradiction.
    fn contradict(&mut self, multipliers: &Multipliers) -> bool {
        let Some(certificate) = Infeasibility::of(self.set, multipliers.clone()) else {
            return false;
        };
        let found = emptiness(self.set, multipliers);
        self.within_rounding |= found == Some(Emptiness::WithinRounding);
        found == Some(Emptiness::Empty) && certificate.value < 0.0
    }

    fn no_multipliers(&self) -> Multipliers {
        let n = self.y.len();
        Multipliers {
            inequalities: vec![0.0; self.set.a.len()],
            equations: vec![0.0; self.set.e.len()],
            lower: vec![0.0; n],
            upper: vec![0.0; n],
        }
    }

    /// Coefficients of normals as multipliers of the rows as stated.
    fn multipliers(&self, coefficients: impl Iterator<Item = (usize, f64)>) -> Multipliers {
        let mut all = self.no_multipliers();
        for (p, c) in coefficients {
            match self.kinds[p] {
                Kind::Equation(i) => all.equations[i] = -self.signs[p] * c / self.norms[p],
                Kind::Inequality(i) => all.inequalities[i] = c.max(0.0) / self.norms[p],
                Kind::Lower(j) => all.lower[j] = c.max(0.0),
                Kind::Upper(j) => all.upper[j] = c.max(0.0),
                Kind::Fixed(j) => {
                    all.lower[j] = (self.signs[p] * c).max(0.0);
                    all.upper[j] = (-self.signs[p] * c).max(0.0);
                }
            }
        }
        all
    }

    fn most_violated(&self) -> Option<usize> {
        let mut worst = None;
        for p in 0..self.kinds.len() {
            if self.is_active[p] || self.skipped[p] || self.is_equation(p) || self.norms[p] == 0.0 {
                continue;
            }
            let (slack, size) = self.slack(p);
            if slack < -ROUNDING * size && worst.is_none_or(|(_, s)| slack < s) {
                worst = Some((p, slack));
            }
        }
        worst.map(|w| w.0)
    }

    /// Makes row p active; other rows leave the active set where their multipliers would turn negative.
    fn add(&mut self, p: usize, steps: &mut usize, limit: usize) -> Result<Added, ComplementarityError> {
        if self.norms[p] == 0.0 {
            return Ok(Added::Redundant);
        }
        if self.is_equation(p) && self.slack(p).0 > 0.0 {
            self.signs[p] = -1.0;
        }
        let mut multiplier = 0.0;
        loop {
            *steps += 1;
            if *steps > limit {
                return Err(ComplementarityError::Unresolved { steps: limit, row: p });
            }
            let mut z = vec![0.0; self.y.len()];
            self.each_entry(p, |j, v| z[j] += v);
            let mut d = vec![0.0; self.q.len()];
            // Twice is enough for orthogonality to rounding.
            for _ in 0..2 {
                for (d, q) in d.iter_mut().zip(&self.q) {
                    let part = dot(q, &z);
                    *d += part;
                    z.iter_mut().zip(q).for_each(|(z, q)| *z -= part * q);
                }
            }
            let r = self.back_substitute(&d);
            let length = norm(&z);
            let spread = 1.0 + r.iter().map(|r| r.abs()).sum::<f64>();
            // Nothing is left of the normal beside the active ones.
            let dependent = length <= LEFT * spread;
            let (slack, size) = self.slack(p);
            // The row is a combination of active rows, whose rounding errors count, as do those of y since the start at x.
            let size = size + self.far.max(max_abs(&self.y));
            let rounding = slack.abs() <= 8.0 * ROUNDING * spread * size;
            let mut leaves: Option<(usize, f64)> = None;
            for (k, &row) in self.active.iter().enumerate() {
                if !self.is_equation(row) && r[k] > 0.0 {
                    let t = self.u[k] / r[k];
                    if leaves.is_none_or(|(_, s)| t < s) {
                        leaves = Some((k, t));
                    }
                }
            }
            let full = match dependent {
                true => f64::INFINITY,
                false => (-slack / (length * length)).max(0.0),
            };
            if dependent && (rounding || leaves.is_none()) {
                let others = self.active.iter().zip(&r).map(|(row, r)| (*row, -r));
                let multipliers = self.multipliers(others.chain([(p, 1.0)]));
                if rounding && !(leaves.is_none() && self.contradict(&multipliers)) {
                    self.skipped[p] = true;
                    return Ok(Added::Redundant);
                }
                return Ok(Added::Empty(multipliers));
            }
            let t = leaves.map_or(full, |(_, t)| t.min(full));
            if !dependent {
                self.y.iter_mut().zip(&z).for_each(|(y, z)| *y += t * z);
            }
            self.u.iter_mut().zip(&r).for_each(|(u, r)| *u -= t * r);
            multiplier += t;
            match leaves {
                Some((k, s)) if s < full => self.remove(k),
                _ => {
                    z.iter_mut().for_each(|z| *z /= length);
                    self.q.push(z);
                    d.push(length);
                    self.r.push(d);
                    self.active.push(p);
                    self.u.push(multiplier);
                    self.is_active[p] = true;
                    self.skipped.fill(false);
                    return Ok(Added::Yes);
                }
            }
        }
    }

    /// R⁻¹ d.
    fn back_substitute(&self, d: &[f64]) -> Vec<f64> {
        let mut x = d.to_vec();
        for k in (0..x.len()).rev() {
            x[k] /= self.r[k][k];
            for i in 0..k {
                x[i] -= self.r[k][i] * x[k];
            }
        }
        x
    }

    /// Takes the k-th active row out; rotations make R a triangle again.
    fn remove(&mut self, k: usize) {
        self.is_active[self.active[k]] = false;
        self.active.remove(k);
        self.u.remove(k);
        self.r.remove(k);
        for i in k..self.r.len() {
            let (a, b) = (self.r[i][i], self.r[i][i + 1]);
            let h = a.hypot(b);
            let (c, s) = if h == 0.0 { (1.0, 0.0) } else { (a / h, b / h) };
            for column in &mut self.r[i..] {
                let (a, b) = (column[i], column[i + 1]);
                (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
            }
            self.r[i].truncate(i + 1);
            let (first, second) = self.q.split_at_mut(i + 1);
            for (a, b) in first[i].iter_mut().zip(&mut second[0]) {
                (*a, *b) = (c * *a + s * *b, c * *b - s * *a);
            }
        }
        self.q.pop();
    }

    /// A row that y violates by more than rounding.
    fn violated(&self) -> Option<usize> {
        let far = self.far.max(max_abs(&self.y));
        let met = |p: &usize| {
            let (slack, size) = self.slack(*p);
            let off = if self.is_equation(*p) { slack.abs() } else { -slack };
            self.norms[*p] == 0.0 || off <= CHECKED * (size + far)
        };
        (0..self.kinds.len()).find(|p| !met(p))
    }

    /// Moves y onto the active rows, which removes the rounding errors of earlier steps.
    fn finish(&mut self) {
        for _ in 0..2 {
            // Least change of y that meets the active rows: Rᵀ v = −slack, y + Q v.
            let mut v: Vec<f64> = Vec::with_capacity(self.active.len());
            for (k, &p) in self.active.iter().enumerate() {
                let known: f64 = (0..k).map(|i| self.r[k][i] * v[i]).sum();
                v.push((-self.slack(p).0 - known) / self.r[k][k]);
            }
            for (v, q) in v.iter().zip(&self.q) {
                self.y.iter_mut().zip(q).for_each(|(y, q)| *y += v * q);
            }
        }
        for &p in &self.active {
            match self.kinds[p] {
                Kind::Lower(j) | Kind::Fixed(j) => self.y[j] = self.set.lower[j],
                Kind::Upper(j) => self.y[j] = self.set.upper[j],
                _ => {}
            }
        }
        for j in 0..self.y.len() {
            self.y[j] = self.y[j].max(self.set.lower[j]).min(self.set.upper[j]);
        }
    }

    /// y, and the multipliers of the step to it from x.
    fn nearest(self, x: &[f64]) -> Nearest {
        let moved: Vec<f64> = self.y.iter().zip(x).map(|(y, x)| y - x).collect();
        let d: Vec<f64> = self.q.iter().map(|q| dot(q, &moved)).collect();
        // Multipliers that rounding makes negative are those of rows that need not be active.
        let small = ROUNDING * max_abs(&moved);
        let u = self.back_substitute(&d);
        let coefficients = self.active.iter().zip(&u).map(|(p, u)| match u.abs() <= small {
            true => (*p, 0.0),
            false => (*p, *u),
        });
        Nearest {
            multipliers: self.multipliers(coefficients),
            within_rounding: self.within_rounding,
            x: self.y,
        }
    }
}
