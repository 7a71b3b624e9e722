//! The model of f near an iterate: the largest of linear functions, and its minimum.

use crate::complementarity::pivoting::Lemke;
use crate::complementarity::{ComplementarityError, Lcp, McpOptions, McpSolver, McpStrategy};
use crate::run::Status;
use crate::sparse::{Matrix, dot, norm};
use crate::tolerances::CHECKED;
use crate::variational::{Multipliers, Polyhedron};

/// Part of the decrease by which a plane may be violated where a solution of a quadratic program is not
/// accurate in each of its rows: p + ν and the errors are computed from the multipliers.
const CUT: f64 = 0.1;

/// A linearisation of f, or a convex combination of some.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub(super) gradient: Vec<f64>,
    /// How far it lies below f at the iterate; negative above it.
    pub(super) error: f64,
    /// Bound of the distance of its point from the iterate, in combinations the mean and the largest.
    pub(super) distance: f64,
    pub(super) radius: f64,
    weight: f64,
}

impl Plane {
    pub(super) fn new(gradient: Vec<f64>, error: f64, distance: f64) -> Self {
        Self {
            gradient,
            error,
            distance,
            radius: distance,
            weight: 0.0,
        }
    }

    /// The subgradient locality measure of C. Lemaréchal, R. Mifflin and K. C. Kiwiel: where f is not convex a plane may lie above f, and
    /// counts the less the farther away it was taken.
    fn locality(&self, curvature: f64) -> f64 {
        self.error.abs().max(curvature * self.distance * self.distance)
    }
}

/// The minimum of the model.
#[derive(Debug, Clone, Default)]
pub(super) struct Direction {
    pub(super) step: Vec<f64>,
    /// p + ν.
    pub(super) subgradient: Vec<f64>,
    pub(super) error: f64,
    pub(super) radius: f64,
    pub(super) multipliers: Multipliers,
}

impl Direction {
    /// That of a point with the gradient 0.
    pub(super) fn none(n: usize) -> Self {
        Self {
            step: vec![0.0; n],
            subgradient: vec![0.0; n],
            ..Self::default()
        }
    }

    /// The decrease of f that the model promises.
    pub(super) fn predicted(&self) -> f64 {
        self.error - dot(&self.step, &self.subgradient)
    }
}

#[derive(Debug, Clone)]
pub(super) struct Model {
    pub(super) planes: Vec<Plane>,
    pub(super) curvature: f64,
    /// M of the term ½ u dᵀM d, by rows.
    metric: Vec<f64>,
    capacity: usize,
    lemke: Lemke,
}

impl Model {
    pub(super) fn new(capacity: usize, n: usize) -> Self {
        Self {
            metric: (0..n * n)
                .map(|k| f64::from(u8::from(k % (n + 1) == 0)))
                .collect(),
            planes: Vec::new(),
            curvature: 0.0,
            capacity,
            lemke: Lemke::default(),
        }
    }

    /// The errors of all planes at θ + d, where f is larger by `change`.
    pub(super) fn moved(&mut self, d: &[f64], change: f64) {
        let length = norm(d);
        for plane in &mut self.planes {
            plane.error += change - dot(&plane.gradient, d);
            plane.distance += length;
            plane.radius += length;
        }
    }

    /// The update of C. G. Broyden, R. Fletcher, D. Goldfarb and D. F. Shanno after a step s along which the gradient changed by y: M learns
    /// what is smooth in f, the planes have the rest.
    pub(super) fn learn(&mut self, s: &[f64], y: &[f64], u: f64) {
        let n = s.len();
        let ms: Vec<f64> = (0..n).map(|i| dot(&self.metric[i * n..(i + 1) * n], s)).collect();
        let (curvature, own) = (dot(s, y), dot(s, &ms));
        let is_definite = curvature > 0.0 && own > 0.0;
        if !is_definite {
            return;
        }
        for i in 0..n {
            for j in 0..n {
                self.metric[i * n + j] += y[i] * y[j] / (u * curvature) - ms[i] * ms[j] / own;
            }
        }
    }

    /// Adds a plane. In the place of the last ones that have no weight, or of all that have, others are dropped or combined.
    pub(super) fn add(&mut self, plane: Plane) {
        while self.planes.len() >= self.capacity {
            match self.planes.iter().position(|p| p.weight == 0.0) {
                Some(idle) => drop(self.planes.remove(idle)),
                None => self.combine(),
            }
        }
        self.planes.push(plane);
    }

    /// The aggregate in the place of all planes.
    fn combine(&mut self) {
        let mut all = Plane::new(vec![0.0; self.planes[0].gradient.len()], 0.0, 0.0);
        for plane in self.planes.drain(..) {
            let w = plane.weight;
            all.gradient
                .iter_mut()
                .zip(&plane.gradient)
                .for_each(|(a, g)| *a += w * g);
            all.error += w * plane.error;
            all.distance += w * plane.distance;
            all.radius = all.radius.max(plane.radius);
        }
        self.planes.push(all);
    }

    /// The minimum of max (gⱼᵀd − βⱼ) + ½ u dᵀM d over the d with θ + d in the set; `None` where the quadratic program was not solved.
    ///
    /// Its conditions are a monotone linear complementarity problem in d, the decrease w ≥ 0 of the first term and the multipliers of all rows.
    /// It is stated in the units of gradients at the iterate and of the length of its step.
    pub(super) fn minimum(
        &mut self,
        set: &Polyhedron,
        at: &[f64],
        u: f64,
        size_g: f64,
    ) -> Result<Option<Direction>, ComplementarityError> {
        let (n, planes) = (at.len(), self.planes.len());
        let unit = size_g / u;
        let measures: Vec<f64> = self.planes.iter().map(|p| p.locality(self.curvature)).collect();
        let [inequalities, equations] = set.rows();
        let first = n + 1 + planes;
        let size = first + inequalities.len() + equations.len();
        let mut entries: Vec<_> = self
            .metric
            .iter()
            .enumerate()
            .map(|(k, m)| (k / n, k % n, *m))
            .collect();
        let (mut q, mut lower, mut upper) = (vec![0.0; size], vec![0.0; size], vec![f64::INFINITY; size]);
        let mut row = |i: usize, j: usize, v: f64| entries.extend([(i, j, -v), (j, i, v)]);
        q[n] = -1.0;
        for (j, plane) in self.planes.iter().enumerate() {
            plane
                .gradient
                .iter()
                .enumerate()
                .for_each(|(i, g)| row(n + 1 + j, i, g / size_g));
            row(n + 1 + j, n, 1.0);
            q[n + 1 + j] = measures[j] / (size_g * unit);
        }
        for (k, (entries, right)) in inequalities.iter().chain(&equations).enumerate() {
            entries.iter().for_each(|(j, v)| row(first + k, *j, *v));
            let slack = right - entries.iter().map(|(j, v)| v * at[*j]).sum::<f64>();
            // The iterate meets its constraints but for rounding.
            match k < inequalities.len() {
                true => q[first + k] = slack.max(0.0) / unit,
                false => lower[first + k] = f64::NEG_INFINITY,
            }
        }
        for i in 0..n {
            lower[i] = (set.lower()[i] - at[i]) / unit;
            upper[i] = (set.upper()[i] - at[i]) / unit;
        }
        let lcp = Lcp::boxed(Matrix::from_triplets(size, size, &entries)?, q, lower, upper)?;
        let mut z = vec![0.0; size];
        // Where the row of a plane is violated by as much as the model decreases, the next null step would change nothing.
        let is_accurate = |z: &[f64]| {
            let (step, decrease) = (
                &z[..n],
                dot(&z[..n], &z[..n]) + dot(&z[n + 1..first], &lcp.q()[n + 1..first]),
            );
            let above = |(plane, beta): (&Plane, &f64)| dot(&plane.gradient, step) / size_g - beta + z[n];
            self.planes
                .iter()
                .zip(&lcp.q()[n + 1..first])
                .all(|pair| above(pair) <= CUT * decrease)
        };
        // Pivots may meet a singular basis, at degenerate points or where there are equations.
        let pivoted = self.lemke.solve(&lcp, &mut z).is_ok_and(|found| {
            found.status == Status::Solved || (found.residual <= CHECKED && is_accurate(&z))
        });
        if !pivoted {
            let newton = McpOptions::default().with_strategies(vec![McpStrategy::Newton]);
            z.fill(0.0);
            if !McpSolver::new(newton).solve(lcp.mcp(), &mut z)?.is_solved() {
                return Ok(None);
            }
        }
        let mut f = vec![0.0; size];
        lcp.value(&z, &mut f);
        let weights = &z[n + 1..first];
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return Ok(None);
        }
        let mut subgradient = vec![0.0; n];
        let (mut error, mut radius) = (0.0, 0.0_f64);
        for ((plane, w), measure) in self.planes.iter_mut().zip(weights).zip(&measures) {
            plane.weight = w / total;
            if plane.weight > 0.0 {
                subgradient
                    .iter_mut()
                    .zip(&plane.gradient)
                    .for_each(|(p, g)| *p += plane.weight * g);
                error += plane.weight * measure;
                radius = radius.max(plane.radius);
            }
        }
        let scaled =
            |range: std::ops::Range<usize>| z[range].iter().map(|m| size_g * m).collect::<Vec<f64>>();
        let at_bound = |bounds: &[f64], sign: f64| {
            let pairs = (0..n).map(|i| {
                if z[i] == bounds[i] {
                    size_g * (sign * f[i]).max(0.0)
                } else {
                    0.0
                }
            });
            pairs.collect::<Vec<f64>>()
        };
        let multipliers = Multipliers {
            inequalities: scaled(first..first + inequalities.len()),
            equations: scaled(first + inequalities.len()..size),
            lower: at_bound(lcp.lower(), 1.0),
            upper: at_bound(lcp.upper(), -1.0),
        };
        error += set.add_normal(at, &multipliers, &mut subgradient);
        Ok(Some(Direction {
            step: z[..n].iter().map(|d| unit * d).collect(),
            subgradient,
            error,
            radius,
            multipliers,
        }))
    }
}
