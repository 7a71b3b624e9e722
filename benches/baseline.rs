//! Key figures, compared with those stored in `benches/baseline.csv`.
//!
//! Run: cargo bench --bench baseline [-- --save "machine"]
//!
//! Each figure is the least time of 20 runs. With `--save` the new figures replace the stored ones.

use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use semismooth::complementarity::active_set::ActiveSetSolver;
use semismooth::complementarity::pivoting::Lemke;
use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::contact::{DelassusSolver, HildRenard, read_delassus, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Diagram, DiagramOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::newton::Newton;
use semismooth::sparse::Matrix;

const RUNS: usize = 20;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let save = arguments.iter().position(|a| a == "--save");
    let stored = std::fs::read_to_string(file()).unwrap_or_default();
    for line in stored.lines().filter(|l| l.starts_with('#')) {
        println!("{line}");
    }
    println!("{:44} {:>12} {:>12} {:>7}", "", "stored, us", "now, us", "ratio");
    let mut lines = Vec::new();
    let mut report = |name: &str, time: Duration| {
        let now = time.as_secs_f64() * 1e6;
        let before = stored
            .lines()
            .find_map(|l| l.strip_prefix(name)?.strip_prefix(',')?.parse::<f64>().ok());
        match before {
            Some(before) => println!("{name:44} {before:12.1} {now:12.1} {:7.2}", now / before),
            None => println!("{name:44} {:>12} {now:12.1} {:>7}", "-", "-"),
        }
        lines.push(format!("{name},{now:.2}"));
    };
    one_node(&mut report)?;
    load_path(&mut report)?;
    complementarity(&mut report)?;
    delassus(&mut report)?;
    if let Some(at) = save {
        let machine = arguments.get(at + 1).map_or("not named", |m| m.as_str());
        let seconds = SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)?
            .as_secs();
        let head = format!("# {machine}; {seconds} s after 1970; least of {RUNS} runs, in microseconds");
        std::fs::write(file(), format!("{head}\n{}\n", lines.join("\n")))?;
    }
    Ok(())
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/baseline.csv")
}

fn least<T>(mut run: impl FnMut() -> Outcome<T>) -> Outcome<Duration> {
    let mut least = Duration::MAX;
    for _ in 0..RUNS {
        let begun = Instant::now();
        black_box(run()?);
        least = least.min(begun.elapsed());
    }
    Ok(least)
}

/// The corrector, and the diagram of the talk's Example 2, for one contact node.
fn one_node(report: &mut dyn FnMut(&str, Duration)) -> Outcome<()> {
    let map = HildRenard::new(1.5, -4.0, 1.0, 1.0)?.problem()?;
    let mut newton = Newton::default();
    let time = least(|| {
        for _ in 0..1000 {
            let mut x = black_box([0.3, 0.2, 0.1, 4.0, 3.0]);
            newton.solve(&map, &mut x)?;
        }
        Ok(())
    })?;
    report("corrector, one contact node, 1000 solves", time);
    let condensed = map.condensed()?;
    let starts = all_solutions(&condensed, 10.0, &EnumerationOptions::default())?;
    let starts: Vec<Vec<f64>> = starts.solutions.into_iter().map(|s| s.x).collect();
    let curves = ContinuationOptions::default().with_parameter_range((-0.5, 11.0));
    let options = DiagramOptions::default().with_continuation(curves);
    report(
        "diagram, one contact node",
        least(|| Ok(Diagram::explore(&condensed, &starts, &options)?))?,
    );
    Ok(())
}

fn load_path(report: &mut dyn FnMut(&str, Duration)) -> Outcome<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = read_folder(root.join("tests/data/vee"))?;
    let time = least(|| {
        let map = folder.condensed()?;
        let start = map.solve(0.0, None)?;
        let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
        Ok(Branch::follow(&map, &start, Direction::Increasing, options)?)
    })?;
    report("load path of tests/data/vee", time);
    Ok(())
}

/// A random P matrix by three methods.
fn complementarity(report: &mut dyn FnMut(&str, Duration)) -> Outcome<()> {
    let n = 300;
    let mut state = 7_u64;
    let mut next = || {
        state = state
            .wrapping_mul(0x5851_f42d_4c95_7f2d)
            .wrapping_add(0x1405_7b7e_f767_814f);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut rows = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..i {
            (rows[i][j], rows[j][i]) = (next(), next());
        }
    }
    for (i, row) in rows.iter_mut().enumerate() {
        row[i] = 1.0 + row.iter().map(|v: &f64| v.abs()).sum::<f64>();
    }
    let q = (0..n).map(|_| 100.0 * next()).collect();
    let lcp = Lcp::new(Matrix::from_rows(&rows)?, q)?;
    let mut z = vec![0.0; n];
    let (mut sets, mut lemke, mut mcp) = (ActiveSetSolver::default(), Lemke::default(), McpSolver::default());
    let mut from_zero = |name: &str, solve: &mut dyn FnMut(&mut [f64]) -> Outcome<()>| -> Outcome<()> {
        let time = least(|| {
            z.fill(0.0);
            solve(&mut z)
        })?;
        report(name, time);
        Ok(())
    };
    from_zero("LCP, n = 300, active sets", &mut |z| {
        Ok(sets.solve(&lcp, z).map(|_| ())?)
    })?;
    from_zero("LCP, n = 300, Lemke", &mut |z| {
        Ok(lemke.solve(&lcp, z).map(|_| ())?)
    })?;
    from_zero("LCP, n = 300, McpSolver", &mut |z| {
        Ok(mcp.solve(lcp.mcp(), z).map(|_| ())?)
    })
}

fn delassus(report: &mut dyn FnMut(&str, Duration)) -> Outcome<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/friction");
    let solver = DelassusSolver::default();
    for name in ["Box_Stacks-i0122-82-5", "Spheres-i099-356-679"] {
        let problem = read_delassus(folder.join(format!("{name}.json")))?;
        report(name, least(|| Ok(solver.solve(&problem)?))?);
    }
    Ok(())
}
