//! Minimisers of energies ½ uᵀ(m + v K) u − bᵀu + s Σ area |∇u| with norms of gradients that are constant on elements: pastes with a yield
//! stress, pictures with small total variation.
#![allow(dead_code)]

use semismooth::linear::{Cholesky, LinearError, LinearOperator, LinearSolver};
use semismooth::piecewise::MatrixFree;
use semismooth::sparse::{Matrix, Pattern};

/// A triangle or pixel: unknowns of its corners (none where u is 0), what each adds to ∇u there, area.
pub(crate) struct Element {
    pub(crate) corners: [Option<usize>; 3],
    pub(crate) gradients: [[f64; 2]; 3],
    pub(crate) area: f64,
}

impl Element {
    pub(crate) fn gradient(&self, u: &[f64]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (corner, g) in self.corners.iter().zip(&self.gradients) {
            if let Some(k) = corner {
                sum[0] += u[*k] * g[0];
                sum[1] += u[*k] * g[1];
            }
        }
        sum
    }

    /// Adds area · vᵀ ∂∇u/∂u.
    pub(crate) fn add_divergence(&self, v: [f64; 2], out: &mut [f64]) {
        for (corner, g) in self.corners.iter().zip(&self.gradients) {
            if let Some(k) = corner {
                out[*k] += self.area * (v[0] * g[0] + v[1] * g[1]);
            }
        }
    }
}

/// The weights of the terms of the energy.
pub(crate) struct Weights {
    /// m, of ½|u|².
    pub(crate) mass: f64,
    /// v, of ½∫|∇u|².
    pub(crate) viscosity: f64,
    /// s, of ∫|∇u|.
    pub(crate) yield_stress: f64,
    /// t, below which |∇u| counts as 0: Tikhonov's term of weight t/(2s) in q.
    pub(crate) threshold: f64,
}

/// The equations in x = (u, q): m u + ∫(v ∇u + q)·∇φ − b = 0 for every unknown, area (max(t, |∇u|) q − s ∇u) = 0 for every element
/// (M. Hintermüller, G. Stadler, SIAM J. Sci. Comput. 28 (2006)).
pub(crate) struct Yielding {
    pub(crate) elements: Vec<Element>,
    pub(crate) unknowns: usize,
    load: Vec<f64>,
    weights: Weights,
    /// For each element max(t, |∇u|), and the matrix C of the derivative m δq − C ∇δu. With q scaled back into |q| ≤ s and C made
    /// symmetric, the reduced matrix for u is positive definite; at solutions this changes nothing.
    slopes: Vec<(f64, [[f64; 2]; 2])>,
    reduced: Matrix,
    solver: Cholesky,
}

impl Yielding {
    /// With the vector b, one entry an unknown.
    pub(crate) fn new(
        elements: Vec<Element>,
        load: Vec<f64>,
        weights: Weights,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let unknowns = load.len();
        let pairs = |e: &Element| {
            let corners = e.corners;
            let all = corners.into_iter().flatten();
            all.flat_map(move |i| corners.into_iter().flatten().map(move |j| (i, j)))
                .collect::<Vec<_>>()
        };
        let pattern = Pattern::from_entries(unknowns, unknowns, elements.iter().flat_map(pairs))?;
        let mut solver = Cholesky::new();
        solver.analyze(pattern.as_ref())?;
        Ok(Self {
            slopes: vec![(1.0, [[0.0; 2]; 2]); elements.len()],
            elements,
            unknowns,
            load,
            weights,
            reduced: Matrix::zeros(pattern),
            solver,
        })
    }

    /// u and q.
    pub(crate) fn split<'a>(&self, x: &'a [f64]) -> (&'a [f64], &'a [[f64; 2]]) {
        let (u, q) = x.split_at(self.unknowns);
        (u, q.as_chunks().0)
    }
}

impl LinearOperator for Yielding {
    fn order(&self) -> usize {
        self.unknowns + 2 * self.elements.len()
    }

    fn product(&mut self, v: &[f64], out: &mut [f64]) {
        let (u, q) = self.split(v);
        let (forces, laws) = out.split_at_mut(self.unknowns);
        let Weights { mass, viscosity, .. } = self.weights;
        forces.iter_mut().zip(u).for_each(|(out, u)| *out = mass * u);
        let laws = laws.as_chunks_mut::<2>().0;
        for (((element, (m, c)), q), law) in self.elements.iter().zip(&self.slopes).zip(q).zip(laws) {
            let g = element.gradient(u);
            element.add_divergence([0, 1].map(|i| viscosity * g[i] + q[i]), forces);
            *law = [0, 1].map(|i| element.area * (m * q[i] - c[i][0] * g[0] - c[i][1] * g[1]));
        }
    }

    /// Exact: q is eliminated triangle by triangle.
    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let (u, q) = b.split_at_mut(self.unknowns);
        let q = q.as_chunks_mut::<2>().0;
        for ((element, (m, _)), q) in self.elements.iter().zip(&self.slopes).zip(&mut *q) {
            *q = q.map(|q| q / (m * element.area));
            element.add_divergence(q.map(|q| -q), u);
        }
        self.solver.solve_in_place(u)?;
        for ((element, (m, c)), q) in self.elements.iter().zip(&self.slopes).zip(q) {
            let g = element.gradient(u);
            for i in 0..2 {
                q[i] += (c[i][0] * g[0] + c[i][1] * g[1]) / m;
            }
        }
        Ok(())
    }
}

impl MatrixFree for Yielding {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        let (u, q) = self.split(x);
        let (forces, laws) = out.split_at_mut(self.unknowns);
        let Weights {
            mass,
            viscosity,
            yield_stress,
            threshold,
        } = self.weights;
        for ((out, u), load) in forces.iter_mut().zip(u).zip(&self.load) {
            *out = mass * u - load;
        }
        for ((element, q), law) in self.elements.iter().zip(q).zip(laws.as_chunks_mut::<2>().0) {
            let g = element.gradient(u);
            element.add_divergence([0, 1].map(|i| viscosity * g[i] + q[i]), forces);
            let m = g[0].hypot(g[1]).max(threshold);
            *law = [0, 1].map(|i| element.area * (m * q[i] - yield_stress * g[i]));
        }
    }

    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        let (u, q) = self.split(x);
        let Weights {
            mass,
            viscosity,
            yield_stress,
            threshold,
        } = self.weights;
        self.reduced.clear();
        (0..self.unknowns).for_each(|i| self.reduced.add(i, i, mass));
        for ((element, slope), q) in self.elements.iter().zip(&mut self.slopes).zip(q) {
            let g = element.gradient(u);
            let size = g[0].hypot(g[1]);
            let mut c = [[yield_stress, 0.0], [0.0, yield_stress]];
            if size > threshold {
                let back = 1.0 / (q[0].hypot(q[1]) / yield_stress).max(1.0);
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    c[i][j] -= 0.5 * back * (q[i] * g[j] + q[j] * g[i]) / size;
                }
            }
            let m = size.max(threshold);
            *slope = (m, c);
            for (i, p) in element.corners.iter().zip(&element.gradients) {
                for (j, r) in element.corners.iter().zip(&element.gradients) {
                    if let (Some(i), Some(j)) = (i, j) {
                        let dual: f64 = [(0, 0), (0, 1), (1, 0), (1, 1)]
                            .iter()
                            .map(|&(k, l)| p[k] * c[k][l] * r[l])
                            .sum();
                        let viscous = viscosity * (p[0] * r[0] + p[1] * r[1]);
                        self.reduced.add(*i, *j, element.area * (viscous + dual / m));
                    }
                }
            }
        }
        self.solver.factor(self.reduced.as_ref())
    }
}
