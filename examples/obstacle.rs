//! Obstacle problems on a square: a membrane between two obstacles (MCPLIB), over a hemisphere with a known solution, and
//! elastic-plastic torsion, as complementarity problems with m² unknowns.
//!
//! You will see a table of the levels with their iterations, times and, for the hemisphere, the error against the exact solution;
//! and in `out/contact_*.svg` the contact set (where the lower obstacle is met: red, the upper: blue).
//!
//! ```text
//! cargo run --release --example obstacle -- --m 400 --problem hemisphere --nested
//! ```

mod common;

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use common::{Outcome, exit, file_in};
use semismooth::complementarity::active_set::{
    ActiveSetIteration, ActiveSetOptions, ActiveSetReport, ActiveSetSolver, ActiveSetStatus, DirectReduced,
    Nested,
};
use semismooth::complementarity::{BoundState, Lcp};
use semismooth::linear::Prolongation;
use semismooth::sparse::{Matrix, Pattern};

#[derive(Parser)]
#[command(about = "Obstacle problems and elastic-plastic torsion on an m x m grid")]
struct Arguments {
    /// Interior points a side (3 to 4000).
    #[arg(long, default_value_t = 60)]
    m: usize,
    /// Which problem; all three by default.
    #[arg(long, value_enum)]
    problem: Option<Problem>,
    /// Solve coarse grids first, and prolong solution and active set from each to the next.
    #[arg(long)]
    nested: bool,
    /// Solve reduced systems by Cholesky factorisation whatever their size.
    #[arg(long, conflicts_with = "nested")]
    direct: bool,
    /// Print every iteration.
    #[arg(long)]
    verbose: bool,
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Problem {
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
    fn name(self) -> &'static str {
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

    fn lcp(self, m: usize) -> Outcome<Lcp> {
        let grid = Grid::new(self, m);
        let n = m * m;
        let (mut start, mut rows, mut values) =
            (vec![0], Vec::with_capacity(5 * n), Vec::with_capacity(5 * n));
        for j in 0..m {
            for i in 0..m {
                let k = j * m + i;
                let mut put = |there: bool, k: usize, v: f64| {
                    if there {
                        rows.push(k);
                        values.push(v);
                    }
                };
                put(j > 0, k.wrapping_sub(m), -1.0);
                put(i > 0, k.wrapping_sub(1), -1.0);
                put(true, k, 4.0);
                put(i + 1 < m, k + 1, -1.0);
                put(j + 1 < m, k + m, -1.0);
                start.push(rows.len());
            }
        }
        let matrix = Matrix::from_values(Pattern::from_csc(n, n, start, rows)?, values)?;
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

fn exact(r: f64) -> f64 {
    if r <= R_STAR {
        hemisphere(r)
    } else {
        -0.680_26 * r.ln() + 0.471_52
    }
}

/// m × m interior points of a square.
struct Grid {
    corner: f64,
    h: f64,
    m: usize,
}

impl Grid {
    fn new(problem: Problem, m: usize) -> Self {
        let (corner, side, _) = problem.geometry();
        let h = side / (m + 1) as f64;
        Self { corner, h, m }
    }

    /// Coordinate of line i; 0 and m + 1 are the boundary.
    fn at(&self, i: usize) -> f64 {
        self.corner + self.h * i as f64
    }

    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
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
    fn prolongation(&self, boundary: impl Fn(f64, f64) -> f64) -> Outcome<Prolongation> {
        let (m, coarse) = (self.m, self.m / 2);
        let most = 9 * coarse * coarse;
        let (mut start, mut rows, mut weights) =
            (vec![0], Vec::with_capacity(most), Vec::with_capacity(most));
        for b in 1..=coarse {
            for a in 1..=coarse {
                for j in 2 * b - 1..=(2 * b + 1).min(m) {
                    for i in 2 * a - 1..=(2 * a + 1).min(m) {
                        rows.push((j - 1) * m + i - 1);
                        weights.push(weight(i, a) * weight(j, b));
                    }
                }
                start.push(rows.len());
            }
        }
        let pattern = Pattern::from_csc(m * m, coarse * coarse, start, rows)?;
        let matrix = Matrix::from_values(pattern, weights)?;
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

/// Weight of coarse line a, which is fine line 2a, at fine line i.
fn weight(i: usize, a: usize) -> f64 {
    if i == 2 * a { 1.0 } else { 0.5 }
}

fn nested(problem: Problem, m: usize) -> Outcome<Nested> {
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

fn main() -> ExitCode {
    exit(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let m = arguments.m;
    if !(3..=4000).contains(&m) {
        return Err(format!("--m {m} is out of range; it must be 3 to 4000").into());
    }
    let problems = match arguments.problem {
        Some(problem) => vec![problem],
        None => vec![Problem::Mcplib, Problem::Hemisphere, Problem::Torsion],
    };
    println!("problem       level unknowns iterations linear   residual  seconds");
    for problem in problems {
        let (z, activity) = solve(problem, arguments)?;
        if problem == Problem::Hemisphere {
            let grid = Grid::new(problem, m);
            let errors = grid
                .points()
                .zip(&z)
                .map(|((x, y), z)| (z - exact(x.hypot(y))).abs());
            println!(
                "largest error against the exact solution {:.2e}",
                errors.fold(0.0, f64::max)
            );
        }
        let path = file_in(&arguments.out, &format!("contact_{}.svg", problem.name()))?;
        std::fs::write(&path, picture(m, &activity)?)
            .map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    }
    Ok(())
}

fn solve(problem: Problem, arguments: &Arguments) -> Outcome<(Vec<f64>, Vec<BoundState>)> {
    let m = arguments.m;
    let options = ActiveSetOptions::default();
    let mut z = vec![0.0; m * m];
    if arguments.nested {
        let begin = Instant::now();
        let hierarchy = nested(problem, m)?;
        let set_up = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let report = hierarchy.solve(&options, &mut z)?;
        let seconds = begin.elapsed().as_secs_f64();
        for (k, level) in report.levels.iter().enumerate() {
            let last = (k + 1 == report.levels.len()).then_some(seconds);
            line(problem, k, level.unknowns, &level.report, last);
            list(arguments.verbose, &level.history);
        }
        println!("set-up of the hierarchy {set_up:.3} s");
        check(report.status())?;
        return Ok((z, report.states));
    }
    let lcp = problem.lcp(m)?;
    for (z, l) in z.iter_mut().zip(lcp.lower()) {
        *z = l.max(0.0);
    }
    let begin = Instant::now();
    if arguments.direct {
        let mut solver = ActiveSetSolver::with_reduced(options, DirectReduced::new());
        let report = solver.solve(&lcp, &mut z)?;
        line(problem, 0, m * m, &report, Some(begin.elapsed().as_secs_f64()));
        list(arguments.verbose, solver.history());
        check(report.status)?;
        return Ok((z, solver.states().to_vec()));
    }
    let mut solver = ActiveSetSolver::new(options);
    let report = solver.solve(&lcp, &mut z)?;
    line(problem, 0, m * m, &report, Some(begin.elapsed().as_secs_f64()));
    list(arguments.verbose, solver.history());
    check(report.status)?;
    Ok((z, solver.states().to_vec()))
}

fn check(status: ActiveSetStatus) -> Outcome<()> {
    match status {
        ActiveSetStatus::Solved => Ok(()),
        other => Err(format!("not solved: {other:?}").into()),
    }
}

fn line(problem: Problem, level: usize, unknowns: usize, report: &ActiveSetReport, seconds: Option<f64>) {
    let time = seconds.map_or(String::new(), |s| format!("{s:8.3}"));
    println!(
        "{:12} {level:6} {unknowns:8} {:10} {:6} {:10.1e} {time}",
        problem.name(),
        report.iterations,
        report.linear_iterations,
        report.residual
    );
}

fn list(verbose: bool, history: &[ActiveSetIteration]) {
    for step in history.iter().filter(|_| verbose) {
        println!(
            "    residual {:.1e}  changes {:6}  inactive {:7}  linear {}",
            step.residual, step.changes, step.inactive, step.linear_iterations
        );
    }
}

/// The sets as runs of equal cells, row by row; at most 200 cells a side.
fn picture(m: usize, activity: &[BoundState]) -> Outcome<String> {
    let cells = m.min(200);
    let at = |i: usize, j: usize| activity[(j * m / cells) * m + i * m / cells];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"600\" height=\"600\" viewBox=\"0 0 {cells} {cells}\">\n\
         <rect width=\"{cells}\" height=\"{cells}\" fill=\"#f4f4f4\"/>\n"
    );
    for j in 0..cells {
        let mut i = 0;
        while i < cells {
            let kind = at(i, j);
            let first = i;
            while i < cells && at(i, j) == kind {
                i += 1;
            }
            let colour = match kind {
                BoundState::Lower => "#d62728",
                BoundState::Upper => "#1f5fd0",
                _ => continue,
            };
            // The y axis points up.
            let (y, width) = (cells - 1 - j, i - first);
            writeln!(
                svg,
                "<rect x=\"{first}\" y=\"{y}\" width=\"{width}\" height=\"1\" fill=\"{colour}\"/>"
            )?;
        }
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}
