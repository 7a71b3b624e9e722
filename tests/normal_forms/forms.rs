//! The normal forms in their own coordinates: the vertex is the origin, y are the unknowns, a is the parameter. Every arm, every kind and
//! every solution is written down by hand or, for germs that are homogeneous and piecewise linear, follows from one linear system per sign
//! pattern.

use std::rc::Rc;

use semismooth::piecewise::{Kinks, Real};

use crate::random::Random;

/// What a point is, by its arms and the sign of a on each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    PassThrough,
    Fold,
    Vertical,
    Branching,
    End,
    Isolated,
    Continuum,
}
use Kind::{Branching, Continuum, End, Fold, Isolated, PassThrough, Vertical};

/// The equations of a normal form.
#[derive(Clone, Debug)]
pub enum Core {
    /// y² − s a
    Fold(f64),
    /// y³ − c y − a
    TwoFolds(f64),
    /// The product of y − s a over all slopes s.
    Lines(Vec<f64>),
    /// y (y² − s a)
    Pitchfork(f64),
    /// y² − s a³
    CuspOfCurve(f64),
    /// (y − c₁ a²)(y − c₂ a²)
    Touching(f64, f64),
    /// y² + a² − r²
    Circle(f64),
    /// x² − y² − a and 2 x y
    Saddle,
    /// x (x − a) and y (y − s a)
    FourLines(f64),
    /// x² − y² and x y − a²
    TwoOfFour,
    /// |y| − c a
    Thin(f64),
    /// p (y⁺)^i + q (y⁻)^j − a
    Sides([f64; 2], [i32; 2]),
    /// y − c a² + k min(y − a², 0)
    CurvedKink(f64, f64),
    /// x (x⁺ + c x⁻ + s a), with |x| for c = 1
    AtKink(f64, f64),
    /// a x − x |x|
    Symmetric,
    /// |x| (|x| + s a)
    Product(f64),
    /// y − |x| and (y + s a) x
    Forced(f64),
    /// |x| + b y² − a and max(x, y) − c a
    TwoSites(f64, f64),
    /// M y + N |y| − a q
    Corner(Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>),
    /// min(λ, W λ − a q)
    Touch(Vec<Vec<f64>>, Vec<f64>),
    /// Coulomb friction at one node, u = a q − W λ: λν − (λν + uν)⁺ and λt − P_[−g,g](λt + ut) with g = F (λν + uν)⁺
    Friction([[f64; 2]; 2], [f64; 2], f64),
    /// y + c |y|: the curve runs along the kink
    AlongKink(f64),
    /// min(x, y) and x − y − s a⁺
    LeavesKink(f64),
    /// |y| − s a⁺
    SplitsFromKink(f64),
    /// |y| + c (s a)⁺
    EndOnKink(f64, f64),
    /// |y| + |a|, max(|y|, |a|), |y| + a²
    Alone(usize),
    /// y⁺ + a⁺
    Quadrant,
    /// x⁺ − a and y⁺ − s a
    VerticalQuadrant(f64),
    /// σ y⁺ + t (−1 − y)⁺ − a
    Saturated(f64, f64),
    /// y − |x| and t (|x| − 1)⁺ − a
    VerticalKink(f64),
    /// y (a − (y − 1)⁺ + (−1 − y)⁺)
    Cross,
    /// x (x⁺ + s a − s t (−1 − x)⁺)
    RayAtKink(f64, f64),
}

fn product<T: Real>(matrix: &[Vec<f64>], y: &[T], row: usize) -> T {
    y.iter()
        .zip(&matrix[row])
        .fold(T::from(0.0), |sum, (y, m)| sum + *y * *m)
}

impl Core {
    /// Number of unknowns, and of equations.
    pub fn unknowns(&self) -> usize {
        match self {
            Core::Saddle
            | Core::FourLines(_)
            | Core::TwoOfFour
            | Core::Forced(_)
            | Core::TwoSites(..)
            | Core::Friction(..)
            | Core::LeavesKink(_)
            | Core::VerticalQuadrant(_)
            | Core::VerticalKink(_) => 2,
            Core::Corner(_, _, q) | Core::Touch(_, q) => q.len(),
            _ => 1,
        }
    }

    pub fn eval<T: Real>(&self, v: &[T], a: T, kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let x = v[0];
        let y = v[v.len() - 1];
        match self {
            Core::Fold(s) => out[0] = y * y - a * *s,
            Core::TwoFolds(c) => out[0] = y * y * y - y * *c - a,
            Core::Lines(slopes) => {
                out[0] = slopes.iter().fold(T::from(1.0), |all, s| all * (y - a * *s));
            }
            Core::Pitchfork(s) => out[0] = y * (y * y - a * *s),
            Core::CuspOfCurve(s) => out[0] = y * y - a * a * a * *s,
            Core::Touching(c, d) => out[0] = (y - a * a * *c) * (y - a * a * *d),
            Core::Circle(r) => out[0] = y * y + a * a - r * r,
            Core::Saddle => (out[0], out[1]) = (x * x - y * y - a, x * y * 2.0),
            Core::FourLines(s) => (out[0], out[1]) = (x * (x - a), y * (y - a * *s)),
            Core::TwoOfFour => (out[0], out[1]) = (x * x - y * y, x * y - a * a),
            Core::Thin(c) => out[0] = kinks.abs(y) - a * *c,
            Core::Sides([p, q], [i, j]) => {
                let (above, below) = (kinks.positive_part(y), kinks.positive_part(-y));
                out[0] = above.powi(*i) * *p + below.powi(*j) * *q - a;
            }
            Core::CurvedKink(c, k) => {
                out[0] = y - a * a * *c + kinks.min(y - a * a, T::from(0.0)) * *k;
            }
            Core::AtKink(c, s) => {
                let size = if *c == 1.0 {
                    kinks.abs(x)
                } else {
                    kinks.positive_part(x) + kinks.positive_part(-x) * *c
                };
                out[0] = x * (size + a * *s);
            }
            Core::Symmetric => out[0] = a * x - x * kinks.abs(x),
            Core::Product(s) => {
                let size = kinks.abs(x);
                out[0] = size * (size + a * *s);
            }
            Core::Forced(s) => (out[0], out[1]) = (y - kinks.abs(x), (y + a * *s) * x),
            Core::TwoSites(b, c) => {
                out[0] = kinks.abs(x) + y * y * *b - a;
                out[1] = kinks.max(x, y) - a * *c;
            }
            Core::Corner(m, n, q) => {
                let sizes: Vec<T> = v.iter().map(|y| kinks.abs(*y)).collect();
                for i in 0..q.len() {
                    out[i] = product(m, v, i) + product(n, &sizes, i) - a * q[i];
                }
            }
            Core::Touch(w, q) => {
                for i in 0..q.len() {
                    out[i] = kinks.min(v[i], product(w, v, i) - a * q[i]);
                }
            }
            Core::Friction(w, q, friction) => {
                let slip = |i: usize| a * q[i] - x * w[i][0] - y * w[i][1];
                let pressure = kinks.positive_part(x + slip(0));
                let bound = pressure * *friction;
                out[0] = x - pressure;
                out[1] = y - kinks.project(-bound, y + slip(1), bound);
            }
            Core::AlongKink(c) => out[0] = y + kinks.abs(y) * *c,
            Core::LeavesKink(s) => {
                (out[0], out[1]) = (kinks.min(x, y), x - y - kinks.positive_part(a) * *s);
            }
            Core::SplitsFromKink(s) => out[0] = kinks.abs(y) - kinks.positive_part(a) * *s,
            Core::EndOnKink(c, s) => out[0] = kinks.abs(y) + kinks.positive_part(a * *s) * *c,
            Core::Alone(which) => {
                let size = kinks.abs(y);
                out[0] = match which {
                    0 => size + kinks.abs(a),
                    1 => {
                        let other = kinks.abs(a);
                        kinks.max(size, other)
                    }
                    _ => size + a * a,
                };
            }
            Core::Quadrant => out[0] = kinks.positive_part(y) + kinks.positive_part(a),
            Core::VerticalQuadrant(s) => {
                (out[0], out[1]) = (kinks.positive_part(x) - a, kinks.positive_part(y) - a * *s);
            }
            Core::Saturated(sign, t) => {
                out[0] = kinks.positive_part(y) * *sign + kinks.positive_part(-y - 1.0) * *t - a;
            }
            Core::VerticalKink(t) => {
                let size = kinks.abs(x);
                (out[0], out[1]) = (y - size, kinks.positive_part(size - 1.0) * *t - a);
            }
            Core::Cross => {
                out[0] = y * (a - kinks.positive_part(y - 1.0) + kinks.positive_part(-y - 1.0));
            }
            Core::RayAtKink(s, t) => {
                out[0] = x * (kinks.positive_part(x) + a * *s - kinks.positive_part(-x - 1.0) * (s * t));
            }
        }
    }
}

/// A curve of solutions: a has the sign `side`, and y is given as a function of |a| in [0, 1]; for `side` 0 as a function of a number in
/// [0, 1] by which the vertical segment is run through.
#[derive(Clone)]
pub struct Curve {
    pub side: i8,
    pub y: Rc<dyn Fn(f64) -> Vec<f64>>,
}

pub fn curve(side: impl Into<f64>, y: impl Fn(f64) -> Vec<f64> + 'static) -> Curve {
    let side = side.into();
    Curve {
        side: if side == 0.0 { 0 } else { side.signum() as i8 },
        y: Rc::new(y),
    }
}

/// The ray y = |a| d.
fn ray(side: f64, d: Vec<f64>) -> Curve {
    curve(side, move |t| d.iter().map(|d| d * t).collect())
}

/// A normal form with all that is known of it.
pub struct Entry {
    pub core: Core,
    /// The arms of the vertex; they are curves of solutions up to |a| = 1.
    pub arms: Vec<Curve>,
    /// Further curves of solutions, connected with the arms over vertical segments.
    pub more: Vec<Curve>,
    /// All solutions where they do not follow from the arms.
    pub solutions: Option<Rc<dyn Fn(f64) -> Vec<Vec<f64>>>>,
    /// Words that are right for the vertex.
    pub kinds: Vec<Kind>,
    /// Words that are right for maps within rounding of each term; with these nothing is proven.
    pub unfolded: &'static [Kind],
    /// Codimension; from 2 on undecided points are counted, not refused.
    pub codimension: u8,
    /// Whether the origin is a vertex.
    pub vertex: bool,
    /// Folds elsewhere, as (y, a), and to what accuracy they must be found.
    pub folds: Vec<Vec<f64>>,
    pub fold_accuracy: f64,
    /// Starts as (y, a), besides points on the arms.
    pub starts: Vec<Vec<f64>>,
    /// Values of |a| where solutions are compared, and the largest one explored.
    pub levels: Vec<f64>,
    pub reach: f64,
}

impl Entry {
    fn new(core: Core, codimension: u8, arms: Vec<Curve>) -> Self {
        let kinds = vec![kind(&arms)];
        Self {
            core,
            arms,
            more: Vec::new(),
            solutions: None,
            kinds,
            unfolded: &[],
            codimension,
            vertex: true,
            folds: Vec::new(),
            fold_accuracy: 1e-6,
            starts: Vec::new(),
            levels: vec![0.013, 0.31, 0.77],
            reach: 1.0,
        }
    }

    fn unfolds_to(mut self, kinds: &'static [Kind]) -> Self {
        self.unfolded = kinds;
        self
    }

    fn named(mut self, kinds: &[Kind]) -> Self {
        self.kinds = kinds.to_vec();
        self
    }

    fn and(mut self, more: Vec<Curve>) -> Self {
        self.more = more;
        self
    }

    /// All solutions y at a ≠ 0.
    pub fn at(&self, a: f64) -> Vec<Vec<f64>> {
        if let Some(solutions) = &self.solutions {
            return solutions(a);
        }
        let all = self.arms.iter().chain(&self.more);
        all.filter(|c| f64::from(c.side) == a.signum())
            .map(|c| (c.y)(a.abs()))
            .collect()
    }
}

/// The word for a list of arms.
fn kind(arms: &[Curve]) -> Kind {
    let vertical = arms.iter().any(|c| c.side == 0);
    match arms {
        [] => Isolated,
        _ if arms.len() > 2 => Branching,
        _ if vertical => Vertical,
        [_] => End,
        [a, b] if a.side == b.side => Fold,
        _ => PassThrough,
    }
}

fn both(y: impl Fn(f64) -> Vec<f64> + Clone + 'static) -> Vec<Curve> {
    let other = y.clone();
    vec![curve(1, y), curve(-1, move |t| other(-t))]
}

/// Gaussian elimination with row interchanges, and the determinant.
pub fn solve(matrix: &[Vec<f64>], right: &[f64]) -> (Vec<f64>, f64) {
    let n = right.len();
    let mut rows: Vec<Vec<f64>> = matrix.to_vec();
    let mut x = right.to_vec();
    let mut det = 1.0;
    for k in 0..n {
        let p = (k..n)
            .max_by(|&i, &j| rows[i][k].abs().total_cmp(&rows[j][k].abs()))
            .unwrap_or(k);
        if p != k {
            rows.swap(k, p);
            x.swap(k, p);
            det = -det;
        }
        det *= rows[k][k];
        for i in k + 1..n {
            let f = rows[i][k] / rows[k][k];
            for j in k..n {
                rows[i][j] -= f * rows[k][j];
            }
            x[i] -= f * x[k];
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (x[k] - sum) / rows[k][k];
    }
    (x, det)
}

/// M y + N |y| = a q, by one linear system for each sign pattern; only where every decision has a margin.
fn corner(random: &mut Random, p: usize) -> Entry {
    'draw: loop {
        let (m, n, q) = (random.square(p), random.square(p), random.vector(p, 1.0));
        let mut arms = Vec::new();
        for pattern in 0..1_usize << p {
            let sign = |j: usize| if pattern >> j & 1 == 0 { 1.0 } else { -1.0 };
            let entry = |i: usize, j: usize| m[i][j] + n[i][j] * sign(j);
            let matrix: Vec<Vec<f64>> = (0..p).map(|i| (0..p).map(|j| entry(i, j)).collect()).collect();
            let (y, det) = solve(&matrix, &q);
            if det.abs() < 0.1 || y.iter().any(|y| y.abs() < 0.05 || y.abs() > 4.0) {
                continue 'draw;
            }
            for side in [1.0, -1.0] {
                if (0..p).all(|j| side * y[j] * sign(j) > 0.0) {
                    arms.push(ray(side, y.iter().map(|y| side * y).collect()));
                }
            }
        }
        return Entry::new(Core::Corner(m, n, q), p as u8 - 1, arms);
    }
}

/// p nodes that all touch without load; W is positive definite, so that one state belongs to every load.
fn touch(random: &mut Random, p: usize) -> Entry {
    'draw: loop {
        let g = random.square(p);
        let entry = |i: usize, j: usize| (0..p).map(|k| g[i][k] * g[j][k]).sum::<f64>() / p as f64;
        let shift = |i: usize, j: usize| entry(i, j) + if i == j { 0.3 } else { 0.0 };
        let w: Vec<Vec<f64>> = (0..p).map(|i| (0..p).map(|j| shift(i, j)).collect()).collect();
        let q = random.vector(p, 1.0);
        let mut arms = Vec::new();
        for side in [1.0, -1.0] {
            for pattern in 0..1_usize << p {
                let closed: Vec<usize> = (0..p).filter(|i| pattern >> i & 1 == 1).collect();
                let part: Vec<Vec<f64>> = closed
                    .iter()
                    .map(|&i| closed.iter().map(|&j| w[i][j]).collect())
                    .collect();
                let load: Vec<f64> = closed.iter().map(|&i| side * q[i]).collect();
                let (pressures, _) = solve(&part, &load);
                let mut y = vec![0.0; p];
                for (&i, v) in closed.iter().zip(&pressures) {
                    y[i] = *v;
                }
                let gap = |i: usize| (0..p).map(|j| w[i][j] * y[j]).sum::<f64>() - side * q[i];
                let margins: Vec<f64> = (0..p)
                    .map(|i| if pattern >> i & 1 == 1 { y[i] } else { gap(i) })
                    .collect();
                if margins.iter().all(|m| *m > -1e-2) {
                    if margins.iter().any(|m| *m < 1e-2) || y.iter().any(|y| *y > 4.0) {
                        continue 'draw;
                    }
                    arms.push(ray(side, y));
                }
            }
        }
        return Entry::new(Core::Touch(w, q), p as u8 - 1, arms);
    }
}

/// One contact node with friction at the apex of its cone. With `grazing` the load has no normal part, and the open node slides along the
/// boundary of contact on both sides; a stick arm may leave it.
fn friction(random: &mut Random, grazing: bool) -> Entry {
    const MARGIN: f64 = 0.05;
    'draw: loop {
        let coupling = random.symmetric() * 0.7;
        let w = [
            [random.between(0.5, 1.5), coupling],
            [coupling, random.between(0.5, 1.5)],
        ];
        let f = random.between(0.2, 3.0);
        let q = [if grazing { 0.0 } else { random.symmetric() }, random.symmetric()];
        let mut arms = Vec::new();
        let mut decide = |margins: &[f64], side: f64, y: [f64; 2]| {
            if margins.iter().all(|m| *m > MARGIN) {
                arms.push(ray(side, y.to_vec()));
                return y.iter().all(|y| y.abs() < 4.0);
            }
            margins.iter().all(|m| m.abs() > MARGIN) || margins.iter().any(|m| *m < -MARGIN)
        };
        let det = w[0][0] * w[1][1] - w[0][1] * w[1][0];
        for side in [1.0, -1.0] {
            let [qn, qt] = [side * q[0], side * q[1]];
            let mut clear = det > 0.1 && qt.abs() > MARGIN;
            let open = if grazing { 1.0 } else { -qn };
            clear &= decide(&[open], side, [0.0, 0.0]);
            let stick = [
                (w[1][1] * qn - w[0][1] * qt) / det,
                (w[0][0] * qt - w[1][0] * qn) / det,
            ];
            clear &= decide(&[stick[0], f * stick[0] - stick[1].abs()], side, stick);
            for slip in [1.0, -1.0] {
                let stiffness = w[0][0] + slip * f * w[0][1];
                clear &= stiffness.abs() > 2.0 * MARGIN;
                if !grazing {
                    let pressure = qn / stiffness;
                    let ut = qt - (w[1][0] + slip * f * w[1][1]) * pressure;
                    clear &= decide(&[pressure, slip * ut], side, [pressure, slip * f * pressure]);
                }
            }
            if !clear {
                continue 'draw;
            }
        }
        let codimension = if grazing { 2 } else { 1 };
        return Entry::new(Core::Friction(w, q, f), codimension, arms);
    }
}

/// 10 to a power between two numbers.
fn power(random: &mut Random, low: f64, high: f64) -> f64 {
    10_f64.powf(random.between(low, high))
}

fn sign(random: &mut Random) -> f64 {
    if random.below(2) == 0 { 1.0 } else { -1.0 }
}

/// y³ − c y = a, all real roots.
fn cubic(c: f64, a: f64) -> Vec<Vec<f64>> {
    let (size, turn) = ((c / 3.0).sqrt(), 2.0 * (c / 3.0).powf(1.5));
    if a.abs() < turn {
        let angle = (a / turn).acos() / 3.0;
        let third = std::f64::consts::TAU / 3.0;
        return (0..3)
            .map(|k| vec![2.0 * size * (angle - third * f64::from(k)).cos()])
            .collect();
    }
    let angle = (a.abs() / turn).acosh() / 3.0;
    vec![vec![a.signum() * 2.0 * size * angle.cosh()]]
}

/// The product of y − s a.
fn lines(slopes: Vec<f64>, codimension: u8) -> Entry {
    let arms = slopes.iter().flat_map(|&s| both(move |t| vec![s * t])).collect();
    Entry::new(Core::Lines(slopes), codimension, arms).unfolds_to(&[PassThrough, Fold])
}

/// p (y⁺)^i + q (y⁻)^j = a.
fn sides(sizes: [f64; 2], powers: [i32; 2]) -> Entry {
    let arm = |k: usize, way: f64| {
        let (size, power) = (sizes[k], powers[k]);
        curve(size, move |t| {
            vec![way * (t / size.abs()).powf(1.0 / f64::from(power))]
        })
    };
    let codimension = u8::from(powers != [1, 1]);
    Entry::new(
        Core::Sides(sizes, powers),
        codimension,
        vec![arm(0, 1.0), arm(1, -1.0)],
    )
    .unfolds_to(if codimension > 0 {
        &[PassThrough, Fold]
    } else {
        &[]
    })
}

fn curved_kink(c: f64, k: f64) -> Entry {
    let mut heights = Vec::new();
    if c > 1.0 {
        heights.push(c);
    }
    let below = (c + k) / (1.0 + k);
    if below < 1.0 {
        heights.push(below);
    }
    let arms = heights
        .iter()
        .flat_map(|&h| both(move |t| vec![h * t * t]))
        .collect();
    Entry::new(Core::CurvedKink(c, k), 1, arms).unfolds_to(&[PassThrough, Fold, Isolated])
}

fn at_kink(core: Core, c: f64, s: f64) -> Entry {
    let slope = s.abs();
    let mut arms = both(|_| vec![0.0]);
    arms.push(curve(-s, move |t| vec![slope * t]));
    arms.push(curve(-s * c.signum(), move |t| vec![-slope / c.abs() * t]));
    Entry::new(core, 2, arms).unfolds_to(&[PassThrough, Fold])
}

fn circle(r: f64) -> Entry {
    let mut entry = Entry::new(Core::Circle(r), 1, Vec::new()).unfolds_to(&[Fold, PassThrough]);
    if r > 0.0 {
        entry.vertex = false;
        entry.codimension = 0;
        entry.folds = vec![vec![0.0, r], vec![0.0, -r]];
        entry.fold_accuracy = 1e-3 * r;
        entry.starts = vec![vec![0.8 * r, 0.6 * r], vec![r, 0.0], vec![0.0, r]];
        entry.levels = vec![0.013 * r, 0.31 * r, 0.77 * r, 1.3 * r];
        entry.solutions = Some(Rc::new(move |a| {
            let height = r * r - a * a;
            let one = |s: f64| vec![s * height.max(0.0).sqrt()];
            if height > 0.0 {
                vec![one(1.0), one(-1.0)]
            } else {
                Vec::new()
            }
        }));
    }
    entry
}

fn two_folds(c: f64) -> Entry {
    let arms = both(|t| vec![t]);
    let mut entry = Entry::new(Core::TwoFolds(c), 0, arms);
    (entry.arms, entry.vertex) = (Vec::new(), false);
    let (y, a) = ((c / 3.0).sqrt(), 2.0 * (c / 3.0).powf(1.5));
    entry.folds = vec![vec![y, -a], vec![-y, a]];
    entry.fold_accuracy = (0.3 * y).min(1e-4);
    // Before the first fold on either side.
    entry.starts = [0.9, -0.9].map(|a| vec![cubic(c, a)[0][0], a]).to_vec();
    entry.solutions = Some(Rc::new(move |a| cubic(c, a)));
    // Between the folds, too.
    entry.levels = vec![0.0, 0.31, 0.77];
    entry
}

fn saturated(sign: f64, t: f64) -> Entry {
    let arms = vec![curve(sign, |t| vec![t]), curve(0, |s| vec![-s])];
    Entry::new(Core::Saturated(sign, t), 1, arms).and(vec![curve(t, move |a| vec![-1.0 - a / t.abs()])])
}

fn two_sites(b: f64, c: f64) -> Entry {
    let arms = vec![
        curve(1, move |t| vec![c * t, -((1.0 - c) * t / b).sqrt()]),
        curve(1, move |t| vec![b * c * c * t * t - t, c * t]),
    ];
    Entry::new(Core::TwoSites(b, c), 1, arms).unfolds_to(&[PassThrough, Fold])
}

type Draw = fn(&mut Random) -> Entry;

/// All families: a group, a name, and how a member is drawn.
pub const FAMILIES: &[(&str, &str, Draw)] = &[
    ("smooth", "fold", |r| {
        let s = sign(r) * r.between(0.3, 2.0);
        let arm = move |way: f64| curve(s, move |t| vec![way * (s.abs() * t).sqrt()]);
        Entry::new(Core::Fold(s), 0, vec![arm(1.0), arm(-1.0)])
    }),
    ("folds", "two folds, c = 1 to 1e-2", |r| {
        two_folds(power(r, -2.0, 0.0))
    }),
    ("folds", "two folds, c = 1e-2 to 1e-5", |r| {
        two_folds(power(r, -5.0, -2.0))
    }),
    ("folds", "two folds, c = 1e-5 to 1e-8", |r| {
        two_folds(power(r, -8.0, -5.0))
    }),
    ("folds", "isola, r = 1 to 1e-5", |r| circle(power(r, -5.0, -0.2))),
    ("smooth", "transcritical", |r| {
        lines(vec![0.0, sign(r) * power(r, -1.0, 0.3)], 1)
    }),
    ("smooth", "transcritical, slope 1e-3 to 0.1", |r| {
        lines(vec![0.0, sign(r) * power(r, -3.0, -1.0)], 1)
    }),
    ("smooth", "crossing", |r| {
        lines(vec![r.between(0.2, 1.5), r.between(-1.5, 0.0)], 1)
    }),
    ("smooth", "three lines", |r| {
        lines(
            vec![r.between(0.4, 1.5), r.between(-0.2, 0.2), r.between(-1.5, -0.4)],
            4,
        )
    }),
    ("smooth", "pitchfork, supercritical", |r| {
        pitchfork(r.between(0.3, 2.0))
    }),
    ("smooth", "pitchfork, subcritical", |r| {
        pitchfork(-r.between(0.3, 2.0))
    }),
    ("smooth", "hysteresis y³ = a", |_| {
        let mut entry = Entry::new(Core::TwoFolds(0.0), 1, both(|t: f64| vec![t.cbrt()]));
        entry.unfolded = &[PassThrough, Fold];
        entry
    }),
    ("smooth", "cusp y² = a³", |r| {
        let s = sign(r) * r.between(0.3, 2.0);
        let arm = move |way: f64| curve(s, move |t| vec![way * (s.abs() * t).sqrt() * t]);
        let arms = vec![arm(1.0), arm(-1.0)];
        Entry::new(Core::CuspOfCurve(s), 2, arms).unfolds_to(&[Fold, PassThrough, Isolated])
    }),
    ("smooth", "touching parabolas", |r| {
        let (c, d) = (r.between(0.2, 1.0), r.between(-1.0, 0.0));
        let mut arms = both(move |t| vec![c * t * t]);
        arms.extend(both(move |t| vec![d * t * t]));
        Entry::new(Core::Touching(c, d), 3, arms).unfolds_to(&[Fold, PassThrough])
    }),
    ("smooth", "isola centre", |_| circle(0.0)),
    ("smooth", "saddle of two unknowns", |_| {
        let arms = [1.0, -1.0].into_iter().flat_map(|s: f64| {
            [
                curve(1, move |t: f64| vec![s * t.sqrt(), 0.0]),
                curve(-1, move |t: f64| vec![0.0, s * t.sqrt()]),
            ]
        });
        Entry::new(Core::Saddle, 1, arms.collect()).unfolds_to(&[Fold, PassThrough])
    }),
    ("smooth", "four lines in space", |r| {
        let s = sign(r) * r.between(0.4, 2.0);
        let ends = [[0.0, 0.0], [1.0, 0.0], [0.0, s], [1.0, s]];
        let arms = ends
            .into_iter()
            .flat_map(|[x, y]| both(move |t| vec![x * t, y * t]));
        Entry::new(Core::FourLines(s), 4, arms.collect()).unfolds_to(&[Fold, PassThrough])
    }),
    ("smooth", "two of four complex lines", |_| {
        let arms = [1.0, -1.0]
            .into_iter()
            .flat_map(|s| both(move |t| vec![s * t, s * t]));
        Entry::new(Core::TwoOfFour, 4, arms.collect()).unfolds_to(&[Fold, PassThrough])
    }),
    ("kinks", "pass-through", |r| {
        let s = sign(r);
        sides([s * r.between(0.2, 2.0), -s * r.between(0.2, 2.0)], [1, 1])
    }),
    ("kinks", "fold", |r| {
        let s = sign(r);
        sides([s * r.between(0.2, 2.0), s * r.between(0.2, 2.0)], [1, 1])
    }),
    ("kinks", "fold, both tangents vertical", |r| {
        let s = sign(r);
        sides([s * r.between(1.2, 2.0), s * r.between(0.3, 1.0)], [2, 2])
    }),
    ("kinks", "pass-through, both tangents vertical", |r| {
        let s = sign(r);
        sides([s * r.between(1.2, 2.0), -s * r.between(0.3, 1.0)], [2, 2])
    }),
    ("kinks", "fold, one tangent vertical", |r| {
        let s = sign(r);
        let powers = if r.below(2) == 0 { [1, 2] } else { [2, 1] };
        sides([s * r.between(0.3, 2.0), s * r.between(0.3, 2.0)], powers)
    }),
    ("kinks", "pass-through, one tangent vertical", |r| {
        let s = sign(r);
        let powers = if r.below(2) == 0 { [1, 2] } else { [2, 1] };
        sides([s * r.between(0.3, 2.0), -s * r.between(0.3, 2.0)], powers)
    }),
    ("kinks", "curved kink, c < 1", |r| {
        curved_kink(r.between(-1.0, 0.8), r.between(-0.7, 2.0))
    }),
    ("kinks", "curved kink, c > 1", |r| {
        curved_kink(r.between(1.2, 2.5), r.between(-0.7, 2.0))
    }),
    ("kinks", "curved kink, four arms", |r| {
        curved_kink(r.between(1.2, 2.0), r.between(-3.0, -1.5))
    }),
    ("kinks", "curved kink, no arm", |r| {
        curved_kink(r.between(0.0, 0.8), r.between(-3.0, -1.5))
    }),
    ("kinks", "V-fold, opening 1e-5 to 1e-2", |r| {
        let c = sign(r) * power(r, -5.0, -2.0);
        let arm = move |way: f64| curve(c, move |t| vec![way * c.abs() * t]);
        Entry::new(Core::Thin(c), 0, vec![arm(1.0), arm(-1.0)])
    }),
    ("branching", "x (|x| + s a)", |r| {
        let s = sign(r) * power(r, -1.0, 0.5);
        at_kink(Core::AtKink(1.0, s), 1.0, s)
    }),
    ("branching", "a x − x |x|", |_| {
        at_kink(Core::Symmetric, 1.0, -1.0)
    }),
    ("branching", "|x| (|x| + s a)", |r| {
        let s = sign(r) * power(r, -0.7, 0.5);
        at_kink(Core::Product(s), 1.0, s)
    }),
    ("branching", "x (x⁺ + c x⁻ + s a), c > 0", |r| {
        let (c, s) = (r.between(0.2, 0.9), sign(r) * r.between(0.2, 2.0));
        at_kink(Core::AtKink(c, s), c, s)
    }),
    ("branching", "x (x⁺ + c x⁻ + s a), c < 0", |r| {
        let (c, s) = (-r.between(0.2, 2.0), sign(r) * r.between(0.2, 2.0));
        at_kink(Core::AtKink(c, s), c, s)
    }),
    ("branching", "y = |x|, (y + s a) x = 0", |r| {
        let s = sign(r) * r.between(0.2, 2.0);
        let mut arms = both(|_| vec![0.0, 0.0]);
        arms.extend([1.0, -1.0].map(|way| ray(-s, vec![way * s.abs(), s.abs()])));
        Entry::new(Core::Forced(s), 2, arms).unfolds_to(&[PassThrough, Fold])
    }),
    ("corners", "|x| + b y² = a, max(x, y) = c a", |r| {
        two_sites(r.between(0.5, 1.0), r.between(0.3, 0.55))
    }),
    ("corners", "corner of two sites", |r| corner(r, 2)),
    ("corners", "corner of three sites", |r| corner(r, 3)),
    ("corners", "corner of four sites", |r| corner(r, 4)),
    ("corners", "2 to 6 nodes touch without load", |r| {
        let p = 2 + r.below(5);
        touch(r, p)
    }),
    ("corners", "a node with friction, unloaded", |r| {
        friction(r, false)
    }),
    ("grazing", "a sliding node without pressure", |r| {
        friction(r, true)
    }),
    ("grazing", "along a kink", |r| {
        Entry::new(Core::AlongKink(r.between(-0.8, 0.8)), 1, both(|_| vec![0.0]))
    }),
    ("grazing", "leaves a kink", |r| {
        let s = sign(r) * r.between(0.3, 2.0);
        let end = vec![s.max(0.0), (-s).max(0.0)];
        Entry::new(
            Core::LeavesKink(s),
            1,
            vec![ray(-1.0, vec![0.0, 0.0]), ray(1.0, end)],
        )
    }),
    ("grazing", "splits from a kink", |r| {
        let s = r.between(0.3, 2.0);
        let arms = vec![ray(-1.0, vec![0.0]), ray(1.0, vec![s]), ray(1.0, vec![-s])];
        Entry::new(Core::SplitsFromKink(s), 2, arms)
    }),
    ("ends", "end", |r| {
        let (c, s) = (r.between(0.3, 2.0), sign(r));
        Entry::new(Core::EndOnKink(c, s), 2, vec![ray(-s, vec![0.0])])
    }),
    ("ends", "isolated point", |r| {
        Entry::new(Core::Alone(r.below(3)), 2, Vec::new())
    }),
    ("ends", "continuum", |_| {
        let mut entry = Entry::new(Core::Quadrant, 2, Vec::new()).named(&[Continuum]);
        entry.levels = vec![];
        entry
    }),
    ("ends", "vertical continuum", |r| {
        let s = r.between(0.3, 2.0);
        Entry::new(Core::VerticalQuadrant(s), 2, vec![ray(1.0, vec![1.0, s])]).named(&[Continuum])
    }),
    ("vertical", "vertical on one side", |r| {
        saturated(sign(r), sign(r) * r.between(0.3, 2.0))
    }),
    ("vertical", "vertical on both sides of a kink", |r| {
        let t = sign(r) * r.between(0.3, 2.0);
        let arm = |way: f64| curve(0, move |s| vec![way * s, s]);
        let end = move |way: f64| curve(t, move |a| vec![way * (1.0 + a / t.abs()), 1.0 + a / t.abs()]);
        Entry::new(Core::VerticalKink(t), 1, vec![arm(1.0), arm(-1.0)]).and(vec![end(1.0), end(-1.0)])
    }),
    ("vertical", "vertical line crossed", |_| {
        let mut arms = both(|_| vec![0.0]);
        arms.extend([1.0, -1.0].map(|way| curve(0, move |s| vec![way * s])));
        let more = [1.0, -1.0].map(|way: f64| curve(way, move |t| vec![way * (1.0 + t)]));
        Entry::new(Core::Cross, 2, arms)
            .and(more.to_vec())
            .named(&[Branching, Vertical])
    }),
    ("vertical", "vertical ray at a branching kink", |r| {
        let (s, t) = (sign(r) * r.between(0.3, 2.0), sign(r) * r.between(0.3, 2.0));
        let mut arms = both(|_| vec![0.0]);
        arms.push(ray(-s, vec![s.abs()]));
        arms.push(curve(0, |s| vec![-s]));
        let more = vec![curve(t, move |a| vec![-1.0 - a / t.abs()])];
        Entry::new(Core::RayAtKink(s, t), 2, arms)
            .and(more)
            .named(&[Branching, Vertical])
    }),
];

fn pitchfork(s: f64) -> Entry {
    let mut arms = both(|_| vec![0.0]);
    arms.extend([1.0, -1.0].map(|way| curve(s, move |t| vec![way * (s.abs() * t).sqrt()])));
    Entry::new(Core::Pitchfork(s), 2, arms).unfolds_to(&[PassThrough, Fold])
}
