//! Random smooth changes of coordinates: where the vertex lies, how the unknowns are turned, sheared and bent, what else depends on them,
//! how the equations are mixed, and in which units all of it is measured. The parameter is transformed monotonically and by itself, so that
//! the sides of its value at the vertex keep their meaning.

use semismooth::piecewise::{Kinks, NonsmoothFunction, Real};

use crate::forms::Core;
use crate::random::Random;

/// z = (unknowns, α) ↦ (w, a), where w begins with the unknowns of the normal form.
#[derive(Clone, Debug)]
pub struct Embedded {
    pub core: Core,
    /// Number of unknowns in all.
    pub n: usize,
    /// Units of the unknowns, of α, and of each row.
    pub unit: f64,
    pub alpha_unit: f64,
    rows: Vec<f64>,
    /// Whether the map tells its typical sizes.
    pub declared: bool,
    /// The vertex in these units.
    centre: Vec<f64>,
    alpha_centre: f64,
    /// Unit normal of a reflection of the unknowns; zero for none.
    mirror: Vec<f64>,
    /// Coefficients of r³ in each unknown and of a³ in the parameter.
    own: Vec<f64>,
    alpha_own: f64,
    /// Each unknown is sheared by b a + c a² + d q + e q² + f q³, q being the one before it.
    shear: Vec<[f64; 5]>,
    /// Each further unknown u equals g₀ + g₁ w₀ + g₂ a + g₃ tanh(u before) + g₄ w₀².
    further: Vec<[f64; 5]>,
    /// The factor 1 + `factor` tanh(w₀ + a / 2) of all rows before they are mixed, a reflection, and a shear.
    factor: f64,
    row_mirror: Vec<f64>,
    row_shear: f64,
}

fn unit_vector(random: &mut Random, n: usize) -> Vec<f64> {
    let v: Vec<f64> = (0..n).map(|_| random.normal()).collect();
    let length = v.iter().map(|v| v * v).sum::<f64>().sqrt();
    v.iter().map(|v| v / length).collect()
}

fn reflect<T: Real>(normal: &[f64], v: &mut [T]) {
    let start = T::from(0.0);
    let along = normal
        .iter()
        .zip(v.iter())
        .fold(start, |sum, (h, v)| sum + *v * *h);
    for (h, v) in normal.iter().zip(v) {
        *v -= along * (2.0 * h);
    }
}

/// x with x + c x³ = y, c ≥ 0.
fn cube_inverse(c: f64, y: f64) -> f64 {
    let mut x = y / (1.0 + c * y.abs().powf(2.0 / 3.0));
    for _ in 0..60 {
        x -= (x + c * x * x * x - y) / (1.0 + 3.0 * c * x * x);
    }
    x
}

impl Embedded {
    /// In the coordinates of the normal form itself.
    pub fn plain(core: Core) -> Self {
        let n = core.unknowns();
        Self {
            core,
            n,
            unit: 1.0,
            alpha_unit: 1.0,
            rows: vec![1.0; n],
            declared: false,
            centre: vec![0.0; n],
            alpha_centre: 0.0,
            mirror: vec![0.0; n],
            own: vec![0.0; n],
            alpha_own: 0.0,
            shear: vec![[0.0; 5]; n],
            further: Vec::new(),
            factor: 0.0,
            row_mirror: vec![0.0; n],
            row_shear: 0.0,
        }
    }

    /// Whether it is in the coordinates of the normal form itself.
    pub fn is_plain(&self) -> bool {
        self.mirror.iter().all(|v| *v == 0.0)
    }

    /// One of ten is plain, two are affine, the others are curved.
    pub fn random(core: Core, random: &mut Random) -> Self {
        let k = core.unknowns();
        let class = random.below(10);
        if class == 0 {
            return Self::plain(core);
        }
        let bent = if class <= 2 { 0.0 } else { 1.0 };
        let n = match random.below(20) {
            0..10 => k,
            10..16 => k + 1 + random.below(3),
            16..19 => (k + 4 + random.below(8)).min(40),
            _ => 40 - random.below(20),
        };
        let mut unit = |share: usize| match random.below(share) {
            0 => [1e8, 1e-8, 1e3, 1e-4][random.below(4)],
            _ => 1.0,
        };
        let (unit, alpha_unit, row_unit) = (unit(4), unit(4), unit(4));
        let rows = (0..n).map(|_| {
            let wide = row_unit != 1.0 && random.below(2) == 0;
            random.between(0.5, 2.0) * if wide { row_unit } else { 1.0 }
        });
        let rows = rows.collect();
        let shear = |random: &mut Random, j: usize| {
            let mut c = [0.6, 0.3, 0.4, 0.1, 0.05].map(|size| random.between(-size, size));
            for i in [1, 3, 4] {
                c[i] *= bent;
            }
            if j == 0 {
                c[2..].fill(0.0);
            }
            c
        };
        Self {
            n,
            unit,
            alpha_unit,
            rows,
            declared: unit != 1.0 || alpha_unit != 1.0,
            centre: random.vector(n, 1.0),
            alpha_centre: random.symmetric(),
            mirror: unit_vector(random, n),
            own: (0..n).map(|_| bent * random.between(0.0, 0.1)).collect(),
            alpha_own: bent * random.between(0.0, 0.3),
            shear: (0..n).map(|j| shear(random, j)).collect(),
            further: (k..n)
                .map(|_| {
                    let mut g = [0.5, 0.5, 0.5, 0.5, 0.2].map(|size| random.between(-size, size));
                    g[3] *= bent;
                    g[4] *= bent;
                    g
                })
                .collect(),
            factor: bent * random.between(-0.4, 0.4),
            row_mirror: unit_vector(random, n),
            row_shear: random.between(-0.5, 0.5),
            core,
        }
    }

    /// (w, a) of z.
    pub fn inside<T: Real>(&self, z: &[T]) -> (Vec<T>, T) {
        let a = z[self.n] / self.alpha_unit - self.alpha_centre;
        let a = a * (a * a * self.alpha_own + 1.0);
        let mut q: Vec<T> = z[..self.n]
            .iter()
            .zip(&self.centre)
            .map(|(z, c)| *z / self.unit - *c)
            .collect();
        reflect(&self.mirror, &mut q);
        let mut before = T::from(0.0);
        for j in 0..self.n {
            let own = q[j] * (q[j] * q[j] * self.own[j] + 1.0);
            q[j] = own + self.sheared(j, before, a);
            before = own;
        }
        (q, a)
    }

    fn sheared<T: Real>(&self, j: usize, q: T, a: T) -> T {
        let [b, c, d, e, f] = self.shear[j];
        a * (a * c + b) + q * ((q * f + e) * q + d)
    }

    fn further<T: Real>(&self, i: usize, first: T, a: T, before: T) -> T {
        let g = self.further[i];
        let curved = if g[3] == 0.0 {
            T::from(0.0)
        } else {
            before.tanh() * g[3]
        };
        first * (first * g[4] + g[1]) + a * g[2] + curved + g[0]
    }

    /// z of the unknowns y and the parameter a of the normal form, in units of 1.
    fn unscaled(&self, y: &[f64], a: f64) -> Vec<f64> {
        let mut w = y.to_vec();
        for i in 0..self.further.len() {
            let before = if i == 0 { 0.0 } else { w[w.len() - 1] };
            w.push(self.further(i, y[0], a, before));
        }
        let mut before = 0.0;
        for j in 0..self.n {
            before = w[j] - self.sheared(j, before, a);
            w[j] = before;
        }
        for (w, c) in w.iter_mut().zip(&self.own) {
            *w = cube_inverse(*c, *w);
        }
        reflect(&self.mirror, &mut w);
        for (w, c) in w.iter_mut().zip(&self.centre) {
            *w += c;
        }
        w.push(cube_inverse(self.alpha_own, a) + self.alpha_centre);
        w
    }

    /// z of the unknowns y and the parameter a of the normal form.
    pub fn place(&self, y: &[f64], a: f64) -> Vec<f64> {
        let mut z = self.unscaled(y, a);
        z.iter_mut().for_each(|z| *z *= self.unit);
        z[self.n] *= self.alpha_unit / self.unit;
        z
    }

    /// Unit tangent, in the units of z, of an arm that leaves the vertex along (y, a).
    pub fn tangent(&self, y: &[f64], a: f64) -> Vec<f64> {
        const STEP: f64 = 1e-5;
        let length = y.iter().map(|y| y * y).sum::<f64>().sqrt().hypot(a);
        let at = |s: f64| {
            let y: Vec<f64> = y.iter().map(|y| s * y / length).collect();
            self.unscaled(&y, s * a / length)
        };
        let (ahead, behind) = (at(STEP), at(-STEP));
        self.unit(ahead.iter().zip(&behind).map(|(a, b)| a - b).collect())
    }

    fn unit(&self, mut t: Vec<f64>) -> Vec<f64> {
        let length = t.iter().map(|t| t * t).sum::<f64>().sqrt();
        t.iter_mut().for_each(|t| *t /= length);
        t
    }

    /// A direction in the variables of the map as a unit vector in the units of z.
    pub fn measured(&self, t: &[f64]) -> Vec<f64> {
        let mut t: Vec<f64> = t.iter().map(|t| t / self.unit).collect();
        t[self.n] *= self.unit / self.alpha_unit;
        self.unit(t)
    }

    /// (y, a) of z: the coordinates of the normal form.
    pub fn normal(&self, z: &[f64]) -> Vec<f64> {
        let (mut w, a) = self.inside(z);
        w.truncate(self.core.unknowns());
        w.push(a);
        w
    }

    /// The largest residual in units of its row.
    pub fn largest(&self, residual: &[f64]) -> f64 {
        let sizes = residual.iter().zip(&self.rows).map(|(r, s)| (r / s).abs());
        sizes.fold(0.0, |l, r| if r <= l { l } else { r })
    }
}

impl NonsmoothFunction for Embedded {
    fn num_vars(&self) -> usize {
        self.n + 1
    }

    fn num_residuals(&self) -> usize {
        self.n
    }

    fn eval<T: Real>(&self, z: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (w, a) = self.inside(z);
        let k = self.core.unknowns();
        self.core.eval(&w[..k], a, kinks, &mut out[..k]);
        for i in 0..self.n - k {
            let before = if i == 0 { T::from(0.0) } else { w[k + i - 1] };
            out[k + i] = w[k + i] - self.further(i, w[0], a, before);
        }
        if self.factor != 0.0 {
            let factor = (w[0] + a * 0.5).tanh() * self.factor + 1.0;
            out.iter_mut().for_each(|o| *o *= factor);
        }
        reflect(&self.row_mirror, out);
        for i in 1..self.n {
            out[i] += out[i - 1] * self.row_shear;
        }
        for (o, s) in out.iter_mut().zip(&self.rows) {
            *o *= *s;
        }
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        if self.declared {
            sizes.fill(self.unit);
            sizes[self.n] = self.alpha_unit;
        }
    }
}
