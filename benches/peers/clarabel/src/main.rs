//! Second-order cone programs min ½ xᵀP x + cᵀx over h − G x ∈ K, drawn at random, by `ConeSolver` from 0 and by Clarabel.
//! Ends with an error where a problem is not solved by both, or their solutions differ.
//! Run: cargo run --release --manifest-path benches/peers/clarabel/Cargo.toml --target-dir target

use std::error::Error;
use std::time::{Duration, Instant};

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus,
    SupportedConeT, ZeroConeT,
};
use semismooth::complementarity::AffineFunction;
use semismooth::cones::{Cone, ConeProblem, ConeSolver};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

/// Largest relative differences of the objective and of x. Interior points stop at a small gap, at a distance from the solution of the
/// order of its square root, as their natural residual shows.
const SAME_VALUE: f64 = 1e-7;
const SAME_POINT: f64 = 1e-3;
/// Largest natural residual of solutions of `ConeSolver`.
const RESIDUAL: f64 = 1e-8;
/// Solves per problem; the least time counts.
const REPEATED: usize = 5;
/// Problems per class.
const PROBLEMS: u64 = 50;

struct Class {
    name: &'static str,
    variables: usize,
    /// Widths of the cones, half-lines and equalities among them.
    cones: fn() -> Vec<Kind>,
    /// Entries in a row of G.
    entries: usize,
}

#[derive(Clone, Copy)]
enum Kind {
    Lorentz(usize),
    HalfLines(usize),
    Equalities(usize),
}

const CLASSES: [Class; 4] = [
    Class {
        name: "small",
        variables: 6,
        cones: || {
            vec![
                Kind::Lorentz(3),
                Kind::Lorentz(4),
                Kind::HalfLines(3),
                Kind::Equalities(1),
            ]
        },
        entries: 6,
    },
    Class {
        name: "many cones",
        variables: 30,
        cones: || {
            [
                vec![Kind::Lorentz(3); 15],
                vec![Kind::HalfLines(10), Kind::Equalities(4)],
            ]
            .concat()
        },
        entries: 30,
    },
    Class {
        name: "wide cones",
        variables: 30,
        cones: || vec![Kind::Lorentz(25), Kind::Lorentz(15), Kind::Equalities(2)],
        entries: 30,
    },
    Class {
        name: "sparse",
        variables: 300,
        cones: || [vec![Kind::Lorentz(4); 90], vec![Kind::HalfLines(60)]].concat(),
        entries: 4,
    },
];

/// xorshift64*: the same problems everywhere.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
}

struct Program {
    /// Upper triangle and lower, triplets.
    p: Vec<(usize, usize, f64)>,
    c: Vec<f64>,
    g: Vec<(usize, usize, f64)>,
    h: Vec<f64>,
    kinds: Vec<Kind>,
}

/// A program with strictly feasible primal and dual points, so that its minimum is attained.
fn draw(class: &Class, seed: u64) -> Program {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for _ in 0..8 {
        random.unit();
    }
    let (n, kinds) = (class.variables, (class.cones)());
    let inside = |random: &mut Random, dual: bool| -> Vec<f64> {
        let mut out = Vec::new();
        for kind in &kinds {
            match *kind {
                Kind::Lorentz(k) => {
                    let v: Vec<f64> = (1..k).map(|_| random.symmetric()).collect();
                    out.push(v.iter().map(|v| v * v).sum::<f64>().sqrt() + 0.1 + random.unit());
                    out.extend(v);
                }
                Kind::HalfLines(k) => out.extend((0..k).map(|_| 0.1 + random.unit())),
                Kind::Equalities(k) => {
                    out.extend((0..k).map(|_| if dual { random.symmetric() } else { 0.0 }))
                }
            }
        }
        out
    };
    let (s, z) = (inside(&mut random, false), inside(&mut random, true));
    let x: Vec<f64> = (0..n).map(|_| random.symmetric()).collect();
    let mut g = Vec::new();
    for i in 0..s.len() {
        if class.entries == n {
            g.extend((0..n).map(|j| (i, j, random.symmetric())));
        } else {
            // Row i has variable i (cyclically), so that every variable occurs.
            let mut columns = vec![i % n];
            while columns.len() < class.entries {
                let j = (random.unit() * n as f64) as usize;
                if !columns.contains(&j) {
                    columns.push(j);
                }
            }
            g.extend(columns.into_iter().map(|j| (i, j, random.symmetric())));
        }
    }
    // P = 0, P of low rank, and P positive definite.
    let curved = match seed % 3 {
        0 => 0,
        1 => n / 3,
        _ => n,
    };
    let p: Vec<_> = (0..curved).map(|i| (i, i, 0.1 + random.unit())).collect();
    let mut h = s;
    let mut c = vec![0.0; n];
    for &(i, j, v) in &g {
        h[i] += v * x[j];
        c[j] -= v * z[i];
    }
    for &(i, j, v) in &p {
        c[i] -= v * x[j];
    }
    Program { p, c, g, h, kinds }
}

struct Solved {
    x: Vec<f64>,
    /// ‖w − P(w − F(w))‖∞ of the optimality conditions.
    residual: f64,
    iterations: usize,
    time: Duration,
}

/// Optimality conditions: P x + c + Gᵀz = 0 with x free, h − G x ∈ K with z in the dual cone.
fn conditions(program: &Program) -> Result<ConeProblem<AffineFunction>, Box<dyn Error>> {
    let (n, m) = (program.c.len(), program.h.len());
    let mut entries = program.p.clone();
    for &(i, j, v) in &program.g {
        entries.push((j, n + i, v));
        entries.push((n + i, j, -v));
    }
    let matrix = Matrix::from_triplets(n + m, n + m, &entries)?;
    let q = [&program.c[..], &program.h[..]].concat();
    let mut cones = vec![Cone::Free(n)];
    cones.extend(program.kinds.iter().map(|kind| match *kind {
        Kind::Lorentz(k) => Cone::SecondOrder(k),
        Kind::HalfLines(k) => Cone::Nonnegative(k),
        Kind::Equalities(k) => Cone::Free(k),
    }));
    Ok(ConeProblem::new(AffineFunction::new(matrix, q)?, cones)?)
}

fn ours(program: &Program) -> Result<Solved, Box<dyn Error>> {
    let begun = Instant::now();
    let problem = conditions(program)?;
    let mut x = vec![0.0; problem.len()];
    let report = ConeSolver::default().solve(&problem, &mut x)?;
    let time = begun.elapsed();
    if report.status != Status::Solved {
        return Err(format!("ConeSolver: {}, error {:e}", report.status, report.error).into());
    }
    x.truncate(program.c.len());
    Ok(Solved {
        x,
        residual: report.residual,
        iterations: report.iterations,
        time,
    })
}

fn compressed(rows: usize, columns: usize, entries: &[(usize, usize, f64)]) -> CscMatrix<f64> {
    let part = |k: fn(&(usize, usize, f64)) -> usize| entries.iter().map(k).collect::<Vec<_>>();
    let values = entries.iter().map(|e| e.2).collect();
    CscMatrix::new_from_triplets(rows, columns, part(|e| e.0), part(|e| e.1), values)
}

fn clarabel(program: &Program) -> Result<Solved, Box<dyn Error>> {
    let (n, m) = (program.c.len(), program.h.len());
    let (p, g) = (compressed(n, n, &program.p), compressed(m, n, &program.g));
    let cones: Vec<SupportedConeT<f64>> = program
        .kinds
        .iter()
        .map(|kind| match *kind {
            Kind::Lorentz(k) => SecondOrderConeT(k),
            Kind::HalfLines(k) => NonnegativeConeT(k),
            Kind::Equalities(k) => ZeroConeT(k),
        })
        .collect();
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-10)
        .tol_gap_rel(1e-10)
        .tol_feas(1e-10)
        .build()?;
    let begun = Instant::now();
    let mut solver = DefaultSolver::new(&p, &program.c, &g, &program.h, &cones, settings)?;
    solver.solve();
    let time = begun.elapsed();
    let solution = solver.solution;
    if !matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return Err(format!("Clarabel: {:?}", solution.status).into());
    }
    let w = [&solution.x[..], &solution.z[..]].concat();
    let residual = conditions(program)?.natural_residual(&w, &mut vec![0.0; w.len()])?;
    Ok(Solved {
        x: solution.x,
        residual,
        iterations: solution.iterations as usize,
        time,
    })
}

fn objective(program: &Program, x: &[f64]) -> f64 {
    let curved: f64 = program.p.iter().map(|&(i, j, v)| 0.5 * v * x[i] * x[j]).sum();
    curved + program.c.iter().zip(x).map(|(c, x)| c * x).sum::<f64>()
}

/// The results for one class.
#[derive(Default)]
struct Results {
    /// Of `ConeSolver` and of Clarabel.
    times: [Vec<Duration>; 2],
    steps: [usize; 2],
    residuals: [f64; 2],
    /// Largest differences of x and of the objective.
    apart: [f64; 2],
}

impl Results {
    /// Solves one program by both; differences are errors.
    fn add(&mut self, program: &Program) -> Result<(), Box<dyn Error>> {
        let pair = [ours(program)?, clarabel(program)?];
        let [a, b] = &pair;
        let size = b.x.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
        let of_x =
            a.x.iter()
                .zip(&b.x)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()))
                / size;
        let values = [objective(program, &a.x), objective(program, &b.x)];
        let of_value = (values[0] - values[1]).abs() / (1.0 + values[1].abs());
        let residual = a.residual;
        self.apart = [self.apart[0].max(of_x), self.apart[1].max(of_value)];
        // Other processes only add time.
        let (mut least, solvers) = (pair.each_ref().map(|s| s.time), [ours, clarabel]);
        for _ in 1..REPEATED {
            for (least, solve) in least.iter_mut().zip(solvers) {
                *least = solve(program)?.time.min(*least);
            }
        }
        for (k, solved) in pair.iter().enumerate() {
            self.times[k].push(least[k]);
            self.steps[k] += solved.iterations;
            self.residuals[k] = self.residuals[k].max(solved.residual);
        }
        if of_x <= SAME_POINT && of_value <= SAME_VALUE && residual <= RESIDUAL {
            return Ok(());
        }
        Err(
            format!("x differs by {of_x:.1e}, the objective by {of_value:.1e}, residual {residual:.1e}")
                .into(),
        )
    }

    fn print(&mut self, side: usize) {
        let times = &mut self.times[side];
        times.sort_unstable();
        let ms = |t: Option<&Duration>| t.map_or(f64::NAN, |t| t.as_secs_f64() * 1e3);
        let (median, largest) = (ms(times.get(times.len() / 2)), ms(times.last()));
        let steps = self.steps[side] as f64 / times.len() as f64;
        print!(
            " | {median:>8.3} {largest:>8.3} {steps:>6.1} {:>8.1e}",
            self.residuals[side]
        );
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{PROBLEMS} problems per class; ms, least of {REPEATED} solves: median, largest; steps: mean; largest natural residual; largest differences of x, of the objective\n"
    );
    let side = |name: &str| format!("{name:>8} {:>8} {:>6} {:>8}", "largest", "steps", "residual");
    let (left, right) = (side("ours"), side("Clarabel"));
    println!(
        "{:<12} {:>5} | {left} | {right} | {:>8} {:>8}",
        "class", "n", "x", "value"
    );
    let mut failed = 0;
    for class in &CLASSES {
        let mut results = Results::default();
        for seed in 0..PROBLEMS {
            let program = draw(
                class,
                seed + 1000 * class.variables as u64 + class.name.len() as u64,
            );
            if let Err(e) = results.add(&program) {
                failed += 1;
                println!("{} {seed}: {e}", class.name);
            }
        }
        print!(
            "{:<12} {:>5}",
            class.name,
            draw(class, 0).h.len() + class.variables
        );
        results.print(0);
        results.print(1);
        println!(" | {:>8.1e} {:>8.1e}", results.apart[0], results.apart[1]);
    }
    match failed {
        0 => Ok(()),
        _ => Err(format!("{failed} problems are not solved by both, or their solutions differ").into()),
    }
}
