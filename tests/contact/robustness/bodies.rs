//! Random contact problems from a number.

use crate::random::Random;
use semismooth::contact::{ContactBody, FrictionCurve, LoadPath};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::sparse::Matrix;

/// A body with what is needed to check its solutions.
pub struct Body {
    pub body: ContactBody,
    pub traces: Vec<Matrix>,
    pub gap: Vec<f64>,
    pub load: Vec<f64>,
    /// The order of magnitude of slips.
    pub length: f64,
}

impl Body {
    fn new(a: Matrix, traces: Vec<Matrix>, load: Vec<f64>, gap: Vec<f64>, length: f64) -> Self {
        let path = LoadPath::constant(load.clone());
        let body = ContactBody::new(a, traces[0].clone(), traces[1..].to_vec(), path).unwrap();
        Self {
            body: body.with_gap(gap.clone()).unwrap(),
            traces,
            gap,
            load,
            length,
        }
    }

    /// Finite elements, clamped on the left, on the ground, random nodal forces, mostly downwards.
    pub fn elastic(rng: &mut Random, dim: usize) -> Self {
        let mesh = if dim == 2 {
            let nx = 1 + rng.below(12);
            Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [nx, 1 + rng.below(3)]).unwrap()
        } else {
            let (nx, ny) = (1 + rng.below(4), 1 + rng.below(3));
            Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [nx, ny, 1 + rng.below(2)]).unwrap()
        };
        let material = Material::isotropic(1.0, rng.between(0.0, 0.45)).unwrap();
        let system: ElasticSystem = Elasticity::new(mesh, material).fix("left").assemble().unwrap();
        let mut up = [0.0; 3];
        up[dim - 1] = 1.0;
        let rows = system
            .contact("bottom", &Foundation::plane([0.0; 3], up))
            .unwrap();
        let forces: Vec<f64> = (0..23).map(|_| rng.between(-1.0, 1.0)).collect();
        let size = [1e-2, 1e-3, 5e-2][rng.below(3)];
        let mut load: Vec<f64> = (0..system.num_free())
            .map(|i| size * forces[i % 23] * (1.0 + (i as f64).sin()))
            .collect();
        let down = size * rng.between(0.0, 2.0);
        for node in 0..system.mesh().num_nodes() {
            if let Some(dof) = system.dof(node, dim - 1) {
                load[dof] -= down;
            }
        }
        let p = rows.nodes.len();
        let gap = match rng.below(3) {
            0 => vec![0.0; p],
            1 => (0..p).map(|_| 0.2 * size * rng.unit()).collect(),
            _ => (0..p).map(|_| 0.5 * size * rng.normal()).collect(),
        };
        let mut traces = vec![rows.normal];
        traces.extend(rows.tangential);
        Self::new(system.stiffness().clone(), traces, load, gap, 3.0 * size)
    }

    /// A random positive definite matrix, sometimes near a singular one, with strong coupling of all nodes.
    pub fn dense(rng: &mut Random, dim: usize) -> Self {
        let p = 1 + rng.below(12);
        let n = dim * p + rng.below(4);
        let m = n + rng.below(3) + if rng.below(2) == 0 { 0 } else { n };
        let g: Vec<f64> = (0..n * m).map(|_| rng.normal()).collect();
        let shift = 1e-3 + [0.0, 1e-2, 1.0][rng.below(3)];
        let entry = |i: usize, j: usize| {
            let product: f64 = (0..m).map(|k| g[i * m + k] * g[j * m + k]).sum();
            product / m as f64 + if i == j { shift } else { 0.0 }
        };
        let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        let trace = |d: usize| {
            let entries: Vec<_> = (0..p).map(|i| (i, dim * i + d, 1.0)).collect();
            Matrix::from_triplets(p, n, &entries).unwrap()
        };
        let size = 10f64.powf(rng.between(-3.0, 1.0));
        let load = (0..n).map(|_| size * rng.normal()).collect();
        let gap = match rng.below(3) {
            0 => vec![0.0; p],
            1 => (0..p).map(|_| size * rng.unit()).collect(),
            _ => (0..p).map(|_| 0.3 * size * rng.normal()).collect(),
        };
        let a = Matrix::from_rows(&rows).unwrap();
        Self::new(a, (0..dim).map(trace).collect(), load, gap, size)
    }
}

/// A coefficient of friction up to `largest`: constant, weakening or hardening over slips comparable with `length` or much shorter.
pub fn curve(rng: &mut Random, length: f64, largest: f64) -> FrictionCurve {
    let first = rng.between(0.05, largest);
    let l = length * 10f64.powf(rng.between(-2.0, 0.5));
    let last = first * rng.between(0.05, 0.9);
    match rng.below(5) {
        0 => FrictionCurve::constant(first).unwrap(),
        1 => FrictionCurve::exponential(first, last, l).unwrap(),
        // Linear weakening with a smoothed corner.
        2 => FrictionCurve::function(move |slip| {
            let left = l - slip;
            let root = left.hypot(0.1 * l);
            let height = 0.5 * (left + root);
            let slope = -0.5 * (1.0 + left / root);
            let drop = (first - last) / l;
            (last + drop * height, drop * slope)
        }),
        3 => {
            let mut slip = 0.0;
            let points: Vec<(f64, f64)> = (0..5)
                .map(|_| {
                    let point = (slip, rng.between(0.02, first));
                    slip += l * rng.between(0.2, 1.0);
                    point
                })
                .collect();
            FrictionCurve::table(&points).unwrap()
        }
        _ => FrictionCurve::exponential(last, first, l).unwrap(),
    }
}
