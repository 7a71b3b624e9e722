//! The problems of `problems.py` without Python.

use std::error::Error;
use std::time::{Duration, Instant};

use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::contact::{CondensedContact, FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::sparse::Matrix;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Uniform in (−1/2, 1/2), by the generator of Knuth's MMIX.
fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    std::iter::repeat_with(next).take(count).collect()
}

fn square(n: usize, diagonal: f64, seed: u64) -> Outcome<Matrix> {
    let mut values = numbers(n * n, seed);
    for k in 0..n {
        values[k * n + k] = diagonal;
    }
    let rows: Vec<Vec<f64>> = values.chunks(n).map(<[f64]>::to_vec).collect();
    Ok(Matrix::from_rows(&rows)?)
}

fn solved(lcp: &Lcp) -> Outcome<f64> {
    let mut x = vec![0.0; lcp.len()];
    Ok(McpSolver::default().solve(lcp.mcp(), &mut x)?.residual)
}

fn five_points(m: usize) -> Outcome<Matrix> {
    let mut entries = Vec::new();
    for j in 0..m {
        for i in 0..m {
            let k = j * m + i;
            entries.push((k, k, 4.0));
            for (there, other) in [(i + 1 < m, k + 1), (j + 1 < m, k + m)] {
                if there {
                    entries.extend([(k, other, -1.0), (other, k, -1.0)]);
                }
            }
        }
    }
    Ok(Matrix::from_triplets(m * m, m * m, &entries)?)
}

fn block(n: usize) -> Outcome<(CondensedContact<PlanarCoulomb>, Vec<f64>)> {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n])?;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()?;
    let load = LoadPath::affine(system.supports(), system.motion("top", 0, |_| 0.05)?);
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let body = semismooth::contact_body(&system, &rows, load)?;
    let problem = CondensedContact::new(body, PlanarCoulomb::new(FrictionCoefficient::constant(0.4)?))?;
    let start = problem.solve(0.0, None)?;
    Ok((problem, start))
}

fn measure(name: &str, work: &dyn Fn() -> Outcome<f64>) -> Outcome<()> {
    let result = work()?;
    let (mut best, begun) = (f64::INFINITY, Instant::now());
    while begun.elapsed() < Duration::from_secs(1) {
        let before = Instant::now();
        work()?;
        best = best.min(before.elapsed().as_secs_f64());
    }
    println!("{{\"name\": \"{name}\", \"result\": {result:?}, \"seconds\": {best:?}}}");
    Ok(())
}

fn main() -> Outcome<()> {
    // Problems are made once; the time starts from their arrays, as in Python.
    let (matrix, q) = (square(300, 300.0 / 8.0, 1)?, numbers(300, 2));
    measure("dense LCP, n = 300", &|| {
        solved(&Lcp::new(matrix.clone(), q.clone())?)
    })?;
    let (matrix, q) = (five_points(100)?, numbers(10_000, 3));
    measure("sparse LCP, n = 10 000", &|| {
        solved(&Lcp::new(matrix.clone(), q.clone())?)
    })?;
    let (problem, start) = block(20)?;
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    measure("followed block, 41 contact nodes", &|| {
        let branch = Branch::follow(&problem, &start, Direction::Increasing, options.clone())?;
        Ok(branch.transitions.len() as f64)
    })?;
    let q = numbers(14, 5).iter().map(|v| -v - 0.1).collect();
    let lcp = Lcp::new(square(14, 0.0, 4)?, q)?;
    measure("all solutions, LCP, n = 14", &|| {
        Ok(all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default())?
            .solutions
            .len() as f64)
    })
}
