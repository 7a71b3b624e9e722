//! Obstacle problems on m × m points of a square, and their hierarchies of grids.
#![allow(dead_code)]

#[path = "grids.rs"]
pub(crate) mod grids;

use std::error::Error;

use clap::ValueEnum;
use semismooth::complementarity::Lcp;
use semismooth::complementarity::active_set::Nested;
use semismooth::linear::Prolongation;

use grids::{bilinear, five_point, weight};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Problem {
    /// (sin 9.2x sin 9.3y)³ ≤ v ≤ (sin 9.2x sin 9.3y)² + 0.2 on the unit square, load 1.
    Mcplib,
    /// v above a hemisphere on (−2, 2)², no load; the exact solution is known.
    Hemisphere,
    /// |v| ≤ distance to the boundary of the unit square, load 5.
    Torsion,
}

/// Radius of the contact set of the hemisphere.
const R_STAR: f64 = 0.697_965_148_223_374;

impl Problem {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Mcplib => "mcplib",
            Self::Hemisphere => "hemisphere",
            Self::Torsion => "torsion",
        }
    }

    /// Corner and side of the square, and the load.
    fn geometry(self) -> (f64, f64, f64) {
        match self {
            Self::Mcplib => (0.0, 1.0, 1.0),
            Self::Hemisphere => (-2.0, 4.0, 0.0),
            Self::Torsion => (0.0, 1.0, 5.0),
        }
    }

    /// The lowest and the highest corner of the square.
    pub(crate) fn window(self) -> [[f64; 2]; 2] {
        let (corner, side, _) = self.geometry();
        [[corner; 2], [corner + side; 2]]
    }

    fn bounds(self, x: f64, y: f64) -> (f64, f64) {
        match self {
            Self::Mcplib => {
                let s = (9.2 * x).sin() * (9.3 * y).sin();
                (s.powi(3), s * s + 0.2)
            }
            Self::Hemisphere => (hemisphere(x.hypot(y)), f64::INFINITY),
            Self::Torsion => {
                let distance = x.min(1.0 - x).min(y).min(1.0 - y);
                (-distance, distance)
            }
        }
    }

    /// Values on the boundary.
    fn boundary(self, x: f64, y: f64) -> f64 {
        match self {
            Self::Hemisphere => exact(x.hypot(y)),
            _ => 0.0,
        }
    }

    /// The problem on m × m points.
    pub(crate) fn lcp(self, m: usize) -> Result<Lcp> {
        let grid = Grid::new(self, m);
        let n = m * m;
        let matrix = five_point(m)?;
        let mut q = vec![-grid.h * grid.h * self.geometry().2; n];
        for k in 0..m {
            // Neighbours on the four sides, in the grid with its boundary.
            for (i, j, a, b) in [
                (1, k + 1, 0, k + 1),
                (m, k + 1, m + 1, k + 1),
                (k + 1, 1, k + 1, 0),
                (k + 1, m, k + 1, m + 1),
            ] {
                q[(j - 1) * m + i - 1] -= self.boundary(grid.at(a), grid.at(b));
            }
        }
        let (mut lower, mut upper) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (x, y) in grid.points() {
            let (l, u) = self.bounds(x, y);
            lower.push(l);
            upper.push(u);
        }
        Ok(Lcp::boxed(matrix, q, lower, upper)?)
    }
}

/// ψ: a hemisphere up to r = 0.9, continued linearly.
fn hemisphere(r: f64) -> f64 {
    let edge = (1.0_f64 - 0.81).sqrt();
    if r <= 0.9 {
        (1.0 - r * r).sqrt()
    } else {
        edge - 0.9 / edge * (r - 0.9)
    }
}

/// The solution over the hemisphere.
pub(crate) fn exact(r: f64) -> f64 {
    if r <= R_STAR {
        hemisphere(r)
    } else {
        -0.680_26 * r.ln() + 0.471_52
    }
}

/// m × m interior points of a square.
pub(crate) struct Grid {
    corner: f64,
    h: f64,
    m: usize,
}

impl Grid {
    pub(crate) fn new(problem: Problem, m: usize) -> Self {
        let (corner, side, _) = problem.geometry();
        let h = side / (m + 1) as f64;
        Self { corner, h, m }
    }

    /// Coordinate of line i; 0 and m + 1 are the boundary.
    fn at(&self, i: usize) -> f64 {
        self.corner + self.h * i as f64
    }

    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        (1..=self.m).flat_map(move |j| (1..=self.m).map(move |i| (self.at(i), self.at(j))))
    }

    /// What boundary values contribute at point (i, j) beside the boundary.
    fn add_boundary(&self, i: usize, j: usize, boundary: &impl Fn(f64, f64) -> f64, offset: &mut [f64]) {
        let parents = |i: usize| match i % 2 {
            0 => vec![i],
            _ => vec![i - 1, i + 1],
        };
        for &b in &parents(j) {
            for &a in &parents(i) {
                if a == 0 || b == 0 || a > self.m || b > self.m {
                    let share = weight(i, a / 2) * weight(j, b / 2);
                    offset[(j - 1) * self.m + i - 1] += share * boundary(self.at(a), self.at(b));
                }
            }
        }
    }

    /// Bilinear interpolation from the lines 2, 4, … (1 to m/2 of the coarse grid). Boundary values are the offset.
    fn prolongation(&self, boundary: impl Fn(f64, f64) -> f64) -> Result<Prolongation> {
        let m = self.m;
        let matrix = bilinear(m)?;
        let mut offset = vec![0.0; m * m];
        for k in 1..=m {
            for side in [1, m] {
                self.add_boundary(side, k, &boundary, &mut offset);
                if k != 1 && k != m {
                    self.add_boundary(k, side, &boundary, &mut offset);
                }
            }
        }
        Ok(Prolongation::new(&matrix)?.with_offset(offset)?)
    }
}

/// The problem with all its coarser grids.
pub(crate) fn nested(problem: Problem, m: usize) -> Result<Nested> {
    let mut nested = Nested::new(problem.lcp(m)?);
    let mut size = m;
    // Coarse lines are fine ones, so that the coordinates of a level follow from those of the finest.
    let mut grid = Grid::new(problem, m);
    while size > 8 {
        nested = nested.coarsen(grid.prolongation(|x, y| problem.boundary(x, y))?)?;
        size /= 2;
        grid = Grid {
            corner: grid.corner,
            h: 2.0 * grid.h,
            m: size,
        };
    }
    Ok(nested)
}
