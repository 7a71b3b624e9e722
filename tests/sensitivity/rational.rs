//! Mixed complementarity problems and variational inequalities whose matrix depends on the parameters, with small integers: solutions,
//! derivatives, one-sided ones and ranges against the enumeration of all selections in exact arithmetic.

use semismooth::complementarity::{Autodiff, Mcp, McpSolver, SmoothFunction};
use semismooth::piecewise::{PiecewiseSmooth, Real};
use semismooth::sensitivity::{Differentiability, Directional, Sensitivity, SensitivityError, Validity};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi};

use super::exact::{Fraction, determinant};
use super::random::Random;

/// Parts of the whole in which the end of a range is looked for.
const FINE: i128 = 1 << 12;
/// Number of parameters.
const K: usize = 2;

/// Where a component is: at its lower bound, between, at its upper one, unbounded; F positive, zero, negative there.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Place {
    Lower,
    LowerZero,
    Between,
    UpperZero,
    Upper,
    Free,
}

/// What is required of a component: F = 0, or to be at a bound.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Piece {
    Zero,
    Lower,
    Upper,
}

/// l ≤ x ≤ u ⟂ M(θ) x + q(θ), M(θ) = M₀ + Σ θⱼ Mⱼ and q(θ) likewise, with a solution at θ = 0.
struct Problem {
    /// M₀, M₁, …; rows of constants q₀, q₁, ….
    m: [Vec<Vec<i128>>; K + 1],
    q: [Vec<i128>; K + 1],
    lower: Vec<Option<i128>>,
    upper: Vec<Option<i128>>,
    places: Vec<Place>,
    x: Vec<i128>,
    /// Of a variational inequality: the number of its unknowns, behind which the multipliers are.
    primal: Option<usize>,
}

fn integer(random: &mut Random, bound: i128) -> i128 {
    random.below(2 * bound as usize + 1) as i128 - bound
}

fn integers(random: &mut Random, rows: usize, columns: usize, bound: i128) -> Vec<Vec<i128>> {
    let row = |random: &mut Random| (0..columns).map(|_| integer(random, bound)).collect();
    (0..rows).map(|_| row(random)).collect()
}

impl Problem {
    /// A mixed complementarity problem.
    fn boxed(random: &mut Random, definite: bool) -> Self {
        use Place::{Between, Free, Lower, LowerZero, Upper, UpperZero};
        let n = 1 + random.below(4);
        let mut m: [_; K + 1] = std::array::from_fn(|_| integers(random, n, n, 2));
        if definite {
            (0..n).for_each(|i| m[0][i][i] += 3 * n as i128);
        }
        let kinds = [Lower, LowerZero, LowerZero, Between, UpperZero, Upper, Free];
        let places: Vec<Place> = (0..n).map(|_| kinds[random.below(7)]).collect();
        let bounded = |i: usize| places[i] != Free;
        let lower: Vec<_> = (0..n).map(|i| bounded(i).then(|| integer(random, 2))).collect();
        let upper: Vec<_> = lower.iter().map(|l| l.map(|l| l + 3)).collect();
        let x = (0..n).map(|i| match places[i] {
            Lower | LowerZero => lower[i].unwrap(),
            Upper | UpperZero => upper[i].unwrap(),
            Between => lower[i].unwrap() + 1 + random.below(2) as i128,
            Free => integer(random, 3),
        });
        let x = x.collect();
        let q = std::array::from_fn(|_| (0..n).map(|_| integer(random, 3)).collect());
        Self {
            m,
            q,
            lower,
            upper,
            places,
            x,
            primal: None,
        }
        .balanced(random)
    }

    /// A variational inequality over a polyhedron {A x ≤ b} by its conditions for (x, λ).
    fn polyhedral(random: &mut Random) -> Self {
        use Place::{Between, Free, Lower, LowerZero};
        let (n, rows) = (1 + random.below(3), 1 + random.below(2));
        let a = integers(random, rows, n, 2);
        let mut m: [Vec<Vec<i128>>; K + 1] = std::array::from_fn(|_| vec![vec![0; n + rows]; n + rows]);
        for (j, m) in m.iter_mut().enumerate() {
            let own = integers(random, n, n, 2);
            for i in 0..n {
                m[i][..n].copy_from_slice(&own[i]);
                m[i][i] += if j == 0 { 2 * n as i128 } else { 0 };
            }
        }
        for (i, row) in a.iter().enumerate() {
            for (j, v) in row.iter().enumerate() {
                m[0][n + i][j] = -v;
                m[0][j][n + i] = *v;
            }
        }
        let kinds = [Lower, LowerZero, LowerZero, Between];
        let mut places = vec![Free; n];
        places.extend((0..rows).map(|_| kinds[random.below(4)]));
        let x = places.iter().map(|p| match p {
            Free => integer(random, 3),
            Between => 1 + random.below(3) as i128,
            _ => 0,
        });
        let x = x.collect();
        // The set does not change with the parameters.
        let q = std::array::from_fn(|_| {
            (0..n + rows)
                .map(|i| if i < n { integer(random, 3) } else { 0 })
                .collect()
        });
        let bound = |p: &Place| (*p != Free).then_some(0);
        let (lower, upper) = (places.iter().map(bound).collect(), vec![None; n + rows]);
        Self {
            m,
            q,
            lower,
            upper,
            places,
            x,
            primal: Some(n),
        }
        .balanced(random)
    }

    /// With q₀ for which x is a solution.
    fn balanced(mut self, random: &mut Random) -> Self {
        for i in 0..self.x.len() {
            let w = match self.places[i] {
                Place::Lower => 1 + random.below(4) as i128,
                Place::Upper => -1 - random.below(4) as i128,
                _ => 0,
            };
            self.q[0][i] = w - times(&self.m[0][i], &self.x);
        }
        if self.primal.is_none() && random.below(4) == 0 {
            self.flatten(random);
        }
        self
    }

    /// With q₁, … for which degenerate components stay at their kinks to first order, as others move.
    fn flatten(&mut self, random: &mut Random) {
        for k in 1..=K {
            let moves = |p: &Place| matches!(p, Place::Between | Place::Free);
            let rate = |p: &Place| if moves(p) { integer(random, 2) } else { 0 };
            let v: Vec<i128> = self.places.iter().map(rate).collect();
            for i in 0..v.len() {
                self.q[k][i] = -times(&self.m[0][i], &v) - times(&self.m[k][i], &self.x);
            }
        }
    }

    fn len(&self) -> usize {
        self.x.len()
    }

    /// d M(θ) and d q(θ) at θ = p δ/d.
    fn at(&self, delta: [i128; K], p: i128, d: i128) -> (Vec<Vec<i128>>, Vec<i128>) {
        let n = self.len();
        let sum = |entry: &dyn Fn(usize) -> i128| {
            d * entry(0) + (0..K).map(|k| p * delta[k] * entry(k + 1)).sum::<i128>()
        };
        let m = (0..n)
            .map(|i| (0..n).map(|j| sum(&|k| self.m[k][i][j])).collect())
            .collect();
        (m, (0..n).map(|i| sum(&|k| self.q[k][i])).collect())
    }

    /// The pieces that each component may have at x.
    fn active(&self) -> Vec<Vec<Piece>> {
        let of = |place: &Place| match place {
            Place::Lower => vec![Piece::Lower],
            Place::LowerZero => vec![Piece::Zero, Piece::Lower],
            Place::Between | Place::Free => vec![Piece::Zero],
            Place::UpperZero => vec![Piece::Zero, Piece::Upper],
            Place::Upper => vec![Piece::Upper],
        };
        self.places.iter().map(of).collect()
    }

    /// All pieces of each component.
    fn all(&self) -> Vec<Vec<Piece>> {
        let of = |i: usize| {
            let mut own = vec![Piece::Zero];
            own.extend(self.lower[i].map(|_| Piece::Lower));
            own.extend(self.upper[i].map(|_| Piece::Upper));
            own
        };
        (0..self.len()).map(of).collect()
    }

    /// The determinant of a selection's derivative at θ = 0.
    fn determinant(&self, selection: &[Piece]) -> i128 {
        determinant(&rows(&self.m[0], selection))
    }

    /// Whether all active selections have determinants of one sign: the solution is then locally unique and Lipschitz (Robinson 1980).
    fn is_strongly_regular(&self) -> bool {
        let signs: Vec<i128> = (choices(&self.active()).iter())
            .map(|s| self.determinant(s).signum())
            .collect();
        signs[0] != 0 && signs.iter().all(|s| *s == signs[0])
    }

    /// The rates v of a selection along δ; nothing where it is singular or v leaves its cell.
    fn rate(&self, selection: &[Piece], delta: [i128; K]) -> Option<Vec<Fraction>> {
        let n = self.len();
        let change: Vec<i128> = (0..n)
            .map(|i| {
                (0..K)
                    .map(|k| delta[k] * (times(&self.m[k + 1][i], &self.x) + self.q[k + 1][i]))
                    .sum()
            })
            .collect();
        let right: Vec<i128> = (0..n)
            .map(|i| {
                if selection[i] == Piece::Zero {
                    -change[i]
                } else {
                    0
                }
            })
            .collect();
        let (v, d) = solved(&rows(&self.m[0], selection), &right)?;
        let holds = (0..n).all(|i| {
            let w = times(&self.m[0][i], &v) + d * change[i];
            match self.places[i] {
                Place::LowerZero => v[i] >= 0 && w >= 0,
                Place::UpperZero => v[i] <= 0 && w <= 0,
                _ => true,
            }
        });
        holds.then(|| v.iter().map(|v| Fraction(*v, d)).collect())
    }

    /// All rates along δ of regular selections.
    fn rates(&self, delta: [i128; K]) -> Vec<Vec<Fraction>> {
        let mut list: Vec<Vec<Fraction>> = Vec::new();
        for selection in choices(&self.active()) {
            if let Some(v) = self.rate(&selection, delta)
                && !list.iter().any(|known| equal(known, &v))
            {
                list.push(v);
            }
        }
        list
    }

    /// The solution of a selection at θ = p δ/d; nothing where that is singular or has none there.
    fn solution(&self, selection: &[Piece], delta: [i128; K], p: i128, d: i128) -> Option<Vec<Fraction>> {
        let n = self.len();
        let (m, q) = self.at(delta, p, d);
        let bound = |i: usize| match selection[i] {
            Piece::Zero => -q[i],
            Piece::Lower => self.lower[i].unwrap(),
            Piece::Upper => self.upper[i].unwrap(),
        };
        let right: Vec<i128> = (0..n).map(bound).collect();
        let (x, size) = solved(&rows(&m, selection), &right)?;
        let holds = (0..n).all(|i| match selection[i] {
            Piece::Zero => {
                self.lower[i].is_none_or(|l| x[i] >= l * size)
                    && self.upper[i].is_none_or(|u| x[i] <= u * size)
            }
            Piece::Lower => times(&m[i], &x) + q[i] * size >= 0,
            Piece::Upper => times(&m[i], &x) + q[i] * size <= 0,
        });
        holds.then(|| x.iter().map(|x| Fraction(*x, size)).collect())
    }

    /// Whether a selection that is entered along δ still has the solution at θ = s δ for all s given, in parts of the whole.
    fn holds(&self, delta: [i128; K], parts: &[i128], whole: i128) -> bool {
        (choices(&self.active()).iter())
            .filter(|s| self.rate(s, delta).is_some())
            .any(|s| parts.iter().all(|p| self.solution(s, delta, *p, whole).is_some()))
    }

    /// Whether a selection that is entered along δ is singular between two parts.
    fn turns(&self, delta: [i128; K], parts: [i128; 2], whole: i128) -> bool {
        let entered = choices(&self.active())
            .into_iter()
            .filter(|s| self.rate(s, delta).is_some());
        let sign = |s: &[Piece], p: i128| determinant(&rows(&self.at(delta, p, whole).0, s)).signum();
        entered
            .into_iter()
            .any(|s| sign(&s, parts[0]) != sign(&s, parts[1]))
    }

    /// In floating-point numbers; if rounded, in units in which no number is stored exactly.
    fn in_floats(&self, rounded: bool) -> InFloats {
        let n = self.len();
        // Rows and unknowns of a variational inequality belong together.
        let own = rounded && self.primal.is_none();
        let row = |i: usize| if own { 10_f64.powi(i as i32) / 7.0 } else { 1.0 };
        let m = self.m.each_ref().map(|m| {
            (0..n)
                .map(|i| (0..n).map(|j| row(i) * m[i][j] as f64 * unit(j, own)).collect())
                .collect()
        });
        let q = self
            .q
            .each_ref()
            .map(|q| (0..n).map(|i| row(i) * q[i] as f64).collect());
        InFloats {
            m,
            q,
            size: self.primal.unwrap_or(n),
        }
    }
}

/// The unit of an unknown.
fn unit(j: usize, rounded: bool) -> f64 {
    if rounded { (j + 2) as f64 / 3.0 } else { 1.0 }
}

fn times(row: &[i128], x: &[i128]) -> i128 {
    row.iter().zip(x).map(|(a, b)| a * b).sum()
}

fn equal(a: &[Fraction], b: &[Fraction]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.0 * b.1 == b.0 * a.1)
}

/// All selections of one piece for each component.
fn choices(pieces: &[Vec<Piece>]) -> Vec<Vec<Piece>> {
    let mut list = vec![Vec::new()];
    for own in pieces {
        let longer = |s: &Vec<Piece>| {
            own.iter()
                .map(|p| [s.as_slice(), &[*p]].concat())
                .collect::<Vec<_>>()
        };
        list = list.iter().flat_map(longer).collect();
    }
    list
}

/// The rows of M where F = 0, of the identity at bounds.
fn rows(m: &[Vec<i128>], selection: &[Piece]) -> Vec<Vec<i128>> {
    let n = selection.len();
    let row = |i: usize| match selection[i] {
        Piece::Zero => m[i].clone(),
        _ => (0..n).map(|j| i128::from(i == j)).collect(),
    };
    (0..n).map(row).collect()
}

/// The numerators and the positive denominator of a solution, by Cramer's rule.
fn solved(rows: &[Vec<i128>], right: &[i128]) -> Option<(Vec<i128>, i128)> {
    let d = determinant(rows);
    let column = |j: usize| {
        let mut replaced = rows.to_vec();
        replaced.iter_mut().zip(right).for_each(|(row, r)| row[j] = *r);
        determinant(&replaced) * d.signum()
    };
    (d != 0).then(|| ((0..right.len()).map(column).collect(), d.abs()))
}

/// F(x, θ) = M(θ) x + q(θ) of the first unknowns, the constraints of a variational inequality left out.
struct InFloats {
    m: [Vec<Vec<f64>>; K + 1],
    q: [Vec<f64>; K + 1],
    size: usize,
}

impl SmoothFunction for InFloats {
    fn num_vars(&self) -> usize {
        self.size + K
    }
    fn num_values(&self) -> usize {
        self.size
    }
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let n = self.size;
        for (i, out) in out.iter_mut().enumerate() {
            *out = T::from(0.0);
            for (k, (m, q)) in self.m.iter().zip(&self.q).enumerate() {
                let sum = (0..n).fold(T::from(q[i]), |sum, j| sum + x[j] * m[i][j]);
                *out += if k == 0 { sum } else { sum * x[n + k - 1] };
            }
        }
    }
}

/// Integer directions all around.
const FAN: [[i128; K]; 12] = [
    [1, 0],
    [3, 1],
    [1, 1],
    [1, 3],
    [0, 1],
    [-1, 2],
    [-1, 1],
    [-2, 1],
    [-1, 0],
    [-1, -1],
    [0, -1],
    [2, -1],
];

/// What was seen.
#[derive(Default, Debug)]
struct Seen {
    smooth: usize,
    flat: usize,
    kinks: usize,
    doubts: usize,
    branches: usize,
    several: usize,
    none: usize,
    ends: usize,
    beyond: usize,
    irregular: usize,
    lost: usize,
}

/// Examines all that is said of a problem.
fn examine<P: PiecewiseSmooth>(
    problem: &Problem,
    found: Result<Sensitivity<P>, SensitivityError>,
    (rounded, scaled): (bool, bool),
    seen: &mut Seen,
) {
    let n = problem.len();
    let near = |v: &[f64], exact: &[Fraction]| {
        let largest = exact.iter().fold(1.0_f64, |m, v| m.max(v.value().abs()));
        (0..n).all(|j| (v[j] * unit(j, scaled) - exact[j].value()).abs() <= 1e-9 * largest)
    };
    let floats = |delta: [i128; K]| delta.map(|d| d as f64);
    let mut found = match found {
        Ok(found) => found,
        Err(SensitivityError::Irregular { .. }) => {
            assert!(
                choices(&problem.active())
                    .iter()
                    .any(|s| problem.determinant(s) == 0)
            );
            seen.irregular += 1;
            return;
        }
        Err(SensitivityError::NotEntering { parameter }) => {
            // Not in the equations of this problem at all.
            let k = parameter + 1;
            let idle = |i: usize| problem.m[k][i].iter().all(|v| *v == 0) && problem.q[k][i] == 0;
            assert!((0..n).all(idle));
            return;
        }
        Err(e) => panic!("{e}"),
    };
    let verdict = found.differentiable().unwrap();
    if !problem.is_strongly_regular() {
        assert_eq!(verdict.known(), None, "{verdict}");
        let singular = choices(&problem.active())
            .iter()
            .any(|s| problem.determinant(s) == 0);
        for delta in FAN {
            let Directional::Branches { branches, complete } = found.directional(&floats(delta)).unwrap()
            else {
                panic!("one function");
            };
            assert!(found.jvp(&floats(delta)).is_err() && found.valid_until(&floats(delta), 1.0).is_err());
            let exact = problem.rates(delta);
            assert_eq!(complete, !singular);
            // Next to singular selections branches may be missing, which is said.
            assert!(branches.len() == exact.len() || (!complete && branches.len() < exact.len()));
            assert!(
                branches.iter().all(|b| exact.iter().any(|e| near(b, e))),
                "{branches:?} {exact:?}"
            );
            match exact.len() {
                0 => seen.none += 1,
                1 => seen.branches += 1,
                _ => seen.several += 1,
            }
        }
        return;
    }
    let one = |delta: [i128; K]| {
        let mut list = problem.rates(delta);
        assert_eq!(
            list.len(),
            1,
            "a strongly regular solution has one derivative along {delta:?}"
        );
        list.remove(0)
    };
    for delta in FAN {
        match found.jvp(&floats(delta)) {
            Ok(rate) => assert!(near(&rate, &one(delta)), "{delta:?}"),
            // Refused, not guessed.
            Err(SensitivityError::Rounding) => {
                seen.doubts += 1;
                return;
            }
            Err(e) => panic!("{e}"),
        }
    }
    // Differentiated along one unit vector after the other: the second one is felt far along the first.
    let far = 1_i128 << 40;
    let (first, both) = (one([1, 0]), one([far, 1]));
    let columns = [
        first.clone(),
        (first.iter().zip(&both))
            .map(|(a, b)| Fraction(b.0 * a.1 - far * a.0 * b.1, a.1 * b.1))
            .collect(),
    ];
    for i in 0..n {
        let w: Vec<f64> = (0..n)
            .map(|j| if i == j { unit(j, scaled) } else { 0.0 })
            .collect();
        let gradient = found.vjp(&w).unwrap();
        if rounded && verdict.known() != Some(true) {
            // Ties between pieces are broken by the rounding of the data: an element of a problem within rounding.
            continue;
        }
        for (g, column) in gradient.iter().zip(&columns) {
            let largest = column.iter().fold(1.0_f64, |m, v| m.max(v.value().abs()));
            assert!(
                (g - column[i].value()).abs() <= 1e-9 * largest,
                "{g} {:?}",
                column[i]
            );
        }
    }
    let linear = FAN.iter().all(|delta| {
        let v = one(*delta);
        (0..n).all(|i| {
            let [a, b] = columns.each_ref().map(|c| c[i]);
            v[i].0 * a.1 * b.1 == v[i].1 * (delta[0] * a.0 * b.1 + delta[1] * b.0 * a.1)
        })
    });
    match verdict {
        Differentiability::Yes { margin } => {
            assert!(linear, "called differentiable");
            let matrix = found.derivative().unwrap();
            for (k, column) in columns.iter().enumerate() {
                let own: Vec<f64> = (0..n).map(|i| matrix.get(i, k)).collect();
                assert!(near(&own, column));
            }
            let is_degenerate = choices(&problem.active()).len() > 1;
            assert_eq!(margin == 0.0, is_degenerate);
            if is_degenerate {
                seen.flat += 1
            } else {
                seen.smooth += 1
            }
        }
        Differentiability::No {
            forward, backward, ..
        } => {
            assert!(!linear, "called not differentiable");
            assert!((0..n).any(|i| (forward[i] + backward[i]).abs() > 1e-9));
            assert!(found.derivative().is_err());
            seen.kinks += 1;
        }
        _ => {
            // Selections may differ in cells that hold no direction of the parameters.
            assert!(linear, "a kink that was not found");
            seen.doubts += 1;
        }
    }
    for delta in FAN.into_iter().step_by(5) {
        // Half as fast, and twice as far.
        let half = floats(delta).map(|d| 0.5 * d);
        let until = match found.valid_until(&half, 2.0).unwrap() {
            Validity::Followed(s) => 0.5 * s,
            Validity::Beyond(s) => {
                assert_eq!(s, 2.0);
                seen.beyond += 1;
                assert!(problem.holds(delta, &[16, 32, 48, 63], 64), "beyond: {delta:?}");
                continue;
            }
            // Towards a pole steps fall geometrically; what was followed is right.
            Validity::Lost(s, why) => {
                let part = (0.5 * s * FINE as f64).floor() as i128 - 1;
                assert!(
                    problem.holds(delta, &[part / 4, part / 2, part], FINE),
                    "{s}: {why}"
                );
                seen.lost += 1;
                continue;
            }
            other => panic!("{other}"),
        };
        // At the end itself the selection may be singular.
        let part = (until * FINE as f64).floor() as i128 - 1;
        assert!(
            problem.holds(delta, &[part / 4, part / 2, part], FINE),
            "{until} along {delta:?}"
        );
        // The next piece may lead back to this one, and another one hold beyond a pole: just beyond, and all the way.
        let beyond = (until * FINE as f64).floor() as i128 + 2;
        let way: Vec<i128> = (1..16).map(|k| k * beyond / 16).chain([beyond]).collect();
        assert!(
            !problem.holds(delta, &way, FINE) || problem.turns(delta, [part, beyond], FINE),
            "more than {until} along {delta:?}"
        );
        seen.ends += 1;
    }
}

fn infinite(bounds: &[Option<i128>], none: f64, scaled: bool) -> Vec<f64> {
    let value = |(j, b): (usize, &Option<i128>)| b.map_or(none, |b| b as f64 / unit(j, scaled));
    bounds.iter().enumerate().map(value).collect()
}

fn examined(seeds: std::ops::Range<u64>, rounded: bool) -> Seen {
    let mut seen = Seen::default();
    for seed in seeds {
        let random = &mut Random::new(seed);
        let problem = match seed % 3 {
            0 => Problem::polyhedral(random),
            kind => Problem::boxed(random, kind == 1),
        };
        let function = Autodiff::new(problem.in_floats(rounded));
        let scaled = rounded && problem.primal.is_none();
        let x: Vec<f64> = (problem.x.iter().enumerate())
            .map(|(j, x)| {
                *x as f64 / unit(j, scaled) + if rounded { 1e-10 * random.symmetric() } else { 0.0 }
            })
            .collect();
        let lower = infinite(&problem.lower, f64::NEG_INFINITY, scaled);
        let upper = infinite(&problem.upper, f64::INFINITY, scaled);
        if let Some(n) = problem.primal {
            let count = problem.len() - n;
            let row = |i: usize| {
                (0..n)
                    .map(|j| -problem.m[0][n + i][j] as f64)
                    .collect::<Vec<f64>>()
            };
            let a = Matrix::from_rows(&(0..count).map(row).collect::<Vec<_>>()).unwrap();
            let b = (0..count).map(|i| problem.q[0][n + i] as f64).collect();
            let set = Polyhedron::space(n).unwrap().with_inequalities(a, b).unwrap();
            let vi = Vi::with_parameters(function, set).unwrap();
            examine(
                &problem,
                Sensitivity::new(vi.kkt().unwrap(), &x, &[0.0; K]),
                (rounded, scaled),
                &mut seen,
            );
            continue;
        }
        let family = Mcp::with_parameters(function, lower.clone(), upper.clone()).unwrap();
        examine(
            &problem,
            Sensitivity::new(&family, &x, &[0.0; K]),
            (rounded, scaled),
            &mut seen,
        );
        // Elsewhere, what is solved is one of the solutions.
        let (delta, p) = (FAN[random.below(12)], 1 + random.below(32) as i128);
        let exact: Vec<_> = choices(&problem.all())
            .iter()
            .filter_map(|s| problem.solution(s, delta, p, 64))
            .collect();
        let singular = choices(&problem.all())
            .iter()
            .any(|s| determinant(&rows(&problem.at(delta, p, 64).0, s)) == 0);
        let theta = delta.map(|d| d as f64 * p as f64 / 64.0);
        let fixed = AtParameters {
            function: problem.in_floats(rounded),
            theta,
        };
        let at = Mcp::new(Autodiff::new(fixed), lower, upper).unwrap();
        let mut y = x.clone();
        let solved = McpSolver::default().solve(&at, &mut y).unwrap().is_solved();
        let is_known = |e: &Vec<Fraction>| {
            let size = e.iter().fold(1.0_f64, |m, v| m.max(v.value().abs()));
            (0..e.len()).all(|j| (y[j] * unit(j, scaled) - e[j].value()).abs() <= 1e-6 * size)
        };
        assert!(
            !solved || singular || exact.iter().any(is_known),
            "{y:?} {exact:?}"
        );
    }
    seen
}

/// F(·, θ).
struct AtParameters {
    function: InFloats,
    theta: [f64; K],
}

impl SmoothFunction for AtParameters {
    fn num_vars(&self) -> usize {
        self.function.size
    }
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let mut all = x.to_vec();
        all.extend(self.theta.map(T::from));
        self.function.eval(&all, out);
    }
}

/// *Differentiable* is said where it is true, *not* where it is not, derivatives and elements are the exact ones, and ranges end where
/// the piece does; where solutions are not one function, the branches are the exact ones. `RATIONAL_CASES` examines more problems.
#[test]
fn matrices_that_depend_on_parameters() {
    let cases = super::cases("RATIONAL_CASES", 300);
    for rounded in [false, true] {
        let seen = examined(0..cases, rounded);
        println!("{seen:?}");
        let Seen {
            smooth,
            flat,
            kinks,
            branches,
            several,
            none,
            ends,
            beyond,
            irregular,
            ..
        } = seen;
        let all = [
            smooth, flat, kinks, branches, several, none, ends, beyond, irregular,
        ];
        assert!(all.iter().all(|count| *count > 3), "{all:?}");
    }
}

/// Parameters that do not move the solution to first order, in data that are rounded, at a point that is not strongly regular: one branch,
/// although selections have rates of the size of roundings.
#[test]
fn rates_of_rounding_are_no_branches() {
    assert_eq!(examined(428..429, true).branches, FAN.len());
}
