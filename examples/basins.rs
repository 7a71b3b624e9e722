//! Basins of attraction: which start leads Newton's method to which solution?
//!
//! 1. One contact node with friction (Hild and Renard's model), with three solutions. Starts are forces (λν, λt). With full steps the
//!    method goes from a start to the solution of its piece, in whatever cell that lies, and on from there: so all starts in one cell end
//!    alike, and the parts of the plane are areas of polygons. They are computed separately, and compared with the counts.
//! 2. The problem of Kojima and Shindo with its two solutions, of which one is degenerate, from starts in a plane through both:
//!    x = (s, 0, t, max(½ − t/6, 0)).
//!
//! You will see the share of starts for each solution and that of failures, for several methods, and a picture of each: a colour for each
//! solution, black for failures, discs at the solutions.
//!
//! ```text
//! cargo run --release --example basins -- --full
//! ```

#[macro_use]
mod common;
#[path = "common/raster.rs"]
mod raster;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, distance, ensure, exit, file_in};
use raster::{raster, square, with_classes};
use semismooth::complementarity::{Autodiff, FischerBurmeister, Mcp, McpSolver, SmoothFunction};
use semismooth::contact::{ContactState, HildRenard};
use semismooth::newton::{Damping, Newton, NewtonOptions};
use semismooth::output::{Colour, Curve, Marker, Panel};
use semismooth::piecewise::Real;

#[derive(Parser)]
#[command(about = "Basins of attraction of Newton's method for two problems with several solutions")]
struct Arguments {
    /// A million starts for each problem and method: a minute or two in place of seconds.
    #[arg(long)]
    full: bool,
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

const SMALL: usize = 200;
const FULL: usize = 1000;

/// Of solutions, as names in the legend.
const COLOURS: [(&str, Colour); 3] = [
    ("to the first", Colour::BLUE),
    ("to the second", Colour::ORANGE),
    ("to the third", Colour::GREEN),
];
const FAILURE: Colour = Colour::new(0, 0, 0);

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let n = if arguments.full { FULL } else { SMALL };
    println!("{} starts; % of them by solution, then failures", n * n);
    friction(arguments, n)?;
    kojima_shindo(arguments, n)
}

/// A rectangle of starts, n × n midpoints of its cells.
#[derive(Clone, Copy)]
struct Window {
    low: [f64; 2],
    high: [f64; 2],
    n: usize,
}

impl Window {
    fn start(&self, i: usize, j: usize) -> [f64; 2] {
        let at = |d: usize, k: usize| {
            self.low[d] + (self.high[d] - self.low[d]) * (k as f64 + 0.5) / self.n as f64
        };
        [at(0, i), at(1, j)]
    }
}

/// Where each start leads: a solution by number, or none. Row by row, from below.
struct Basins {
    window: Window,
    ends: Vec<Option<usize>>,
}

impl Basins {
    /// `solve` returns the end of a run from a start, if the method reports success; an end that is no known solution is an error.
    fn new(
        window: Window,
        solutions: &[Vec<f64>],
        mut solve: impl FnMut([f64; 2]) -> Outcome<Option<Vec<f64>>>,
    ) -> Outcome<Self> {
        let mut ends = Vec::with_capacity(window.n * window.n);
        for j in 0..window.n {
            for i in 0..window.n {
                ends.push(match solve(window.start(i, j))? {
                    None => None,
                    Some(x) => {
                        // A residual at rounding level leaves an error of its square root at a degenerate solution.
                        let known = solutions.iter().position(|s| distance(s, &x) < 1e-5);
                        Some(known.ok_or_else(|| format!("{x:?} is said to be a solution"))?)
                    }
                });
            }
        }
        Ok(Self { window, ends })
    }

    /// Shares of the starts, for each solution and for failures.
    fn shares(&self, solutions: usize) -> Vec<f64> {
        let mut counts = vec![0.0; solutions + 1];
        for end in &self.ends {
            counts[end.unwrap_or(solutions)] += 1.0 / self.ends.len() as f64;
        }
        counts
    }

    fn draw(
        &self,
        arguments: &Arguments,
        (name, file): (&str, &str),
        labels: [&str; 2],
        solutions: &[[f64; 2]],
    ) -> Outcome<()> {
        let Window { low, high, n } = self.window;
        let colour = |k: usize| Some(self.ends[k].map_or(FAILURE, |end| COLOURS[end].1));
        let panel = raster(Panel::new(labels[0], labels[1]), n, [low, high], colour);
        let mut classes = COLOURS[..solutions.len()].to_vec();
        if self.ends.contains(&None) {
            classes.push(("fails", FAILURE));
        }
        let at = solutions.iter().map(|s| (s[0], s[1]));
        let marks = Curve::default().with_marks(Marker::Isolated, at);
        let path = file_in(&arguments.out, file)?;
        square(
            with_classes(panel, &classes).with_curve(marks),
            &format!("Where starts lead: {name}"),
        )
        .write(&path)?;
        println!("    {}", path.display());
        Ok(())
    }
}

fn print(method: &str, shares: &[f64], seconds: f64) {
    let shares: Vec<_> = shares.iter().map(|s| format!("{:9.4}", 100.0 * s)).collect();
    println!("  {method:36} {}  {seconds:6.2} s", shares.join(" "));
}

const STATES: [ContactState; 4] = [
    ContactState::Open,
    ContactState::Stick,
    ContactState::SlipPlus,
    ContactState::SlipMinus,
];

/// The friction problem at a fixed coefficient F, λ = μ = 1.
struct Node {
    model: HildRenard,
    load: [f64; 2],
    friction: f64,
    /// Augmentation.
    r: f64,
}

/// a + b · λ ≥ 0.
#[derive(Clone, Copy)]
struct HalfPlane {
    a: f64,
    b: [f64; 2],
}

impl HalfPlane {
    fn value(&self, x: [f64; 2]) -> f64 {
        self.a + self.b[0] * x[0] + self.b[1] * x[1]
    }

    fn opposite(&self) -> Self {
        Self {
            a: -self.a,
            b: self.b.map(|b| -b),
        }
    }
}

impl Node {
    /// The cell of a state: θ¹ = λν + r uν, θ² and θ³ = λt + r ut ∓ F θ¹ with u = A⁻¹ (f − λ), A⁻¹ = ⅓ [2 1; 1 2].
    fn cell(&self, state: ContactState) -> Vec<HalfPlane> {
        let [f, g] = self.load;
        let r = self.r / 3.0;
        let normal = HalfPlane {
            a: r * (2.0 * f + g),
            b: [1.0 - 2.0 * r, -r],
        };
        let slope = |sign: f64| HalfPlane {
            a: r * (f + 2.0 * g) - sign * self.friction * normal.a,
            b: [
                -r - sign * self.friction * normal.b[0],
                1.0 - 2.0 * r - sign * self.friction * normal.b[1],
            ],
        };
        let (second, third) = (slope(1.0), slope(-1.0));
        match state {
            ContactState::Open => vec![normal.opposite()],
            ContactState::SlipPlus => vec![normal, second],
            ContactState::SlipMinus => vec![normal, third.opposite()],
            _ => vec![normal, second.opposite(), third],
        }
    }

    fn forces(&self, state: ContactState) -> [f64; 2] {
        let [_, _, normal, tangential] = self.model.solution(state, self.friction);
        [normal, tangential]
    }

    /// The state whose cell holds a point; none where it lies on a border.
    fn state_of(&self, x: [f64; 2]) -> Option<ContactState> {
        let inside = |s: &ContactState| self.cell(*s).iter().all(|h| h.value(x) > 1e-12);
        STATES.into_iter().find(inside)
    }

    /// The state at whose solution full steps end from the cell of a state; none where they cycle.
    fn fate(&self, mut state: ContactState) -> Option<ContactState> {
        for _ in STATES {
            let next = self.state_of(self.forces(state))?;
            if next == state {
                return Some(state);
            }
            state = next;
        }
        None
    }
}

/// The part of a polygon in a half-plane (I. Sutherland, G. Hodgman, 1974).
fn clipped(polygon: &[[f64; 2]], half: &HalfPlane) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = (half.value(p), half.value(q));
        if a >= 0.0 {
            kept.push(p);
        }
        if (a >= 0.0) != (b >= 0.0) {
            let t = a / (a - b);
            kept.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
        }
    }
    kept
}

fn area(polygon: &[[f64; 2]]) -> f64 {
    let corners = polygon.iter().zip(polygon.iter().cycle().skip(1));
    0.5 * corners.map(|(p, q)| p[0] * q[1] - q[0] * p[1]).sum::<f64>()
}

fn friction(arguments: &Arguments, n: usize) -> Outcome<()> {
    let (load, coefficient) = ([1.0, -3.0], 4.0);
    let model = HildRenard::new(load[0], load[1], 1.0, 1.0)?;
    let problem = model.problem()?.condensed()?;
    let node = Node {
        model,
        load,
        friction: coefficient,
        r: problem.r(),
    };
    let ends: Vec<ContactState> = STATES.into_iter().filter(|s| node.fate(*s) == Some(*s)).collect();
    let points: Vec<[f64; 2]> = ends.iter().map(|s| node.forces(*s)).collect();
    let solutions: Vec<Vec<f64>> = points.iter().map(|p| p.to_vec()).collect();
    let window = Window {
        low: [-4.0, -6.0],
        high: [6.0, 4.0],
        n,
    };

    // The areas, of the cells that end alike.
    let [low, high] = [window.low, window.high];
    let whole = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let mut exact = vec![0.0; ends.len() + 1];
    for state in STATES {
        let cell = node
            .cell(state)
            .iter()
            .fold(whole.to_vec(), |p, half| clipped(&p, half));
        let fate = node.fate(state).and_then(|f| ends.iter().position(|e| *e == f));
        exact[fate.unwrap_or(ends.len())] += area(&cell) / area(&whole);
    }

    let names: Vec<&str> = ends.iter().map(|s| s.name()).collect();
    println!("friction at one node, F = {coefficient}: {}", names.join(", "));
    print("full steps, by areas", &exact, 0.0);
    let methods = [
        ("full steps", "basins_friction_full.svg", Damping::Never),
        (
            "line search on trouble",
            "basins_friction_trouble.svg",
            Damping::OnTrouble,
        ),
        ("line search", "basins_friction_search.svg", Damping::Always),
    ];
    for (name, file, damping) in methods {
        let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
        let begin = Instant::now();
        let basins = Basins::new(window, &solutions, |[normal, tangential]| {
            let mut x = [normal, tangential, coefficient];
            let solved = newton.solve(&problem, &mut x).is_ok();
            Ok(solved.then(|| x[..2].to_vec()))
        })?;
        let shares = basins.shares(ends.len());
        print(name, &shares, begin.elapsed().as_secs_f64());
        basins.draw(arguments, (name, file), ["λ_ν", "λ_t"], &points)?;
        if damping == Damping::Never {
            // A border of a cell misses at most one start of each row or column.
            ensure(
                distance(&shares, &exact) < 4.0 / n as f64,
                "the shares of full steps agree with the areas of the cells",
            )?;
        }
    }
    ensure(ends.len() == 3, "the friction problem has three solutions")
}

/// M. Kojima, S. Shindo, J. Oper. Res. Soc. Japan 29 (1986).
struct KojimaShindo;

impl SmoothFunction for KojimaShindo {
    fn num_vars(&self) -> usize {
        4
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let [a, b, c, d] = [x[0], x[1], x[2], x[3]];
        out[0] = a * a * 3.0 + a * b * 2.0 + b * b * 2.0 + c + d * 3.0 - 6.0;
        out[1] = a * a * 2.0 + a + b * b + c * 10.0 + d * 2.0 - 2.0;
        out[2] = a * a * 3.0 + a * b + b * b * 2.0 + c * 2.0 + d * 9.0 - 9.0;
        out[3] = a * a + b * b * 3.0 + c * 2.0 + d * 3.0 - 3.0;
    }
}

fn kojima_shindo(arguments: &Arguments, n: usize) -> Outcome<()> {
    let problem = Mcp::new(Autodiff::new(KojimaShindo), vec![0.0; 4], vec![f64::INFINITY; 4])?;
    let fischer = FischerBurmeister::new(&problem)?;
    let degenerate = 1.5_f64.sqrt();
    let solutions = [vec![1.0, 0.0, 3.0, 0.0], vec![degenerate, 0.0, 0.0, 0.5]];
    let points = [[1.0, 3.0], [degenerate, 0.0]];
    let window = Window {
        low: [0.0, -0.5],
        high: [3.0, 5.5],
        n,
    };
    let start = |[s, t]: [f64; 2]| [s, 0.0, t.max(0.0), (0.5 - t / 6.0).clamp(0.0, 0.5)];
    println!("Kojima and Shindo: (1, 0, 3, 0), (√6/2, 0, 0, ½)");

    let damped = |damping| Newton::new(NewtonOptions::default().with_damping(damping));
    let [mut natural, mut search] = [Damping::Never, Damping::Always].map(damped);
    let mut solver = McpSolver::default();
    type Method<'a> = Box<dyn FnMut(&mut [f64]) -> Outcome<bool> + 'a>;
    let methods: [(&str, &str, Method<'_>); 3] = [
        (
            "natural map, full steps",
            "basins_kojima_natural.svg",
            Box::new(|x| Ok(natural.solve(&problem, x).is_ok())),
        ),
        (
            "Fischer-Burmeister, line search",
            "basins_kojima_fischer.svg",
            Box::new(|x| Ok(search.solve_semismooth(&fischer, x).is_ok())),
        ),
        (
            "McpSolver, all strategies",
            "basins_kojima_solver.svg",
            Box::new(|x| Ok(solver.solve(&problem, x)?.is_solved())),
        ),
    ];
    for (name, file, mut method) in methods {
        let begin = Instant::now();
        let basins = Basins::new(window, &solutions, |at| {
            let mut x = start(at);
            Ok(method(&mut x)?.then(|| x.to_vec()))
        })?;
        let shares = basins.shares(2);
        print(name, &shares, begin.elapsed().as_secs_f64());
        basins.draw(arguments, (name, file), ["s", "t"], &points)?;
        if name.starts_with("McpSolver") {
            ensure(shares[2] == 0.0, "McpSolver solves from every start")?;
        }
    }
    Ok(())
}
