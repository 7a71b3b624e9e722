//! Sweeps give what single runs give, in the order of the inputs, whatever the number of threads.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use semismooth::complementarity::{AffineFunction, Mcp, McpSolver};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::newton::{Newton, NewtonError, NewtonOptions};
use semismooth::piecewise::MinMap;
use semismooth::sparse::Matrix;
use semismooth::sweep::sweep;

/// A tridiagonal LCP from its own start: the bits of the solution.
fn solve(start: &f64) -> Vec<u64> {
    const N: usize = 12;
    let entries = (0..N).flat_map(|i| {
        let beside = if i + 1 < N {
            vec![(i, i + 1, -1.0), (i + 1, i, -1.0)]
        } else {
            Vec::new()
        };
        [vec![(i, i, 2.1)], beside].concat()
    });
    let m = Matrix::from_triplets(N, N, &entries.collect::<Vec<_>>()).unwrap();
    let q: Vec<f64> = (0..N).map(|i| (i as f64 + start).sin()).collect();
    let f = AffineFunction::new(m, q).unwrap();
    let problem = Mcp::ncp(f).unwrap();
    let mut x = vec![*start; N];
    let mut solver = McpSolver::default();
    assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
    x.iter().map(|v| v.to_bits()).collect()
}

/// The corners of a followed curve, as bits.
fn follow(start: &f64) -> Vec<u64> {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 2.0 - x[0] - x[1] * 1.5;
    });
    let x = [(1.0 - start * start).sqrt(), *start];
    let branch = Branch::follow(&map, &x, Direction::Increasing, ContinuationOptions::default()).unwrap();
    branch
        .polyline()
        .iter()
        .flat_map(|p| p.1)
        .map(|v| v.to_bits())
        .collect()
}

#[test]
fn sweeps_are_single_runs() {
    let starts: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.02 - 0.4).collect();
    let alone: Vec<_> = starts.iter().map(solve).collect();
    assert_eq!(sweep(&starts, solve), alone);
    let curves: Vec<_> = starts.iter().map(follow).collect();
    assert_eq!(sweep(&starts, follow), curves);
    // Equal runs give the same bits.
    assert_eq!(sweep(&starts, follow), curves);
    assert!(sweep(&[] as &[f64], solve).is_empty());
}

#[cfg(feature = "rayon")]
#[test]
fn the_number_of_threads_changes_nothing() {
    let starts: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.02 - 0.4).collect();
    let alone: Vec<_> = starts.iter().map(solve).collect();
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        assert_eq!(pool.install(|| sweep(&starts, solve)), alone);
    }
}

/// Member `member` of `members`: computes the inputs without results; each result is a file, written completely or not at all.
fn run_member(folder: &Path, inputs: &[f64], member: usize, members: usize) -> std::io::Result<()> {
    let file = |k: usize| folder.join(format!("{k}.txt"));
    let missing = (member..inputs.len())
        .step_by(members)
        .filter(|k| !file(*k).exists());
    let missing: Vec<usize> = missing.collect();
    let written = sweep(&missing, |&k| {
        let text = match solved(inputs[k]) {
            Ok(x) => format!("{x:?}\n"),
            Err(e) => format!("{e}\n"),
        };
        let part = folder.join(format!("{k}.part"));
        std::fs::write(&part, text)?;
        std::fs::rename(part, file(k))
    });
    written.into_iter().collect()
}

/// x + 10 (x − 1)₊ = load.
fn solved(load: f64) -> Result<f64, NewtonError> {
    let map = MinMap::new(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        // The member to be killed waits here.
        if load == STUCK && std::env::var_os("SEMISMOOTH_TEST_STUCK").is_some() {
            std::thread::sleep(Duration::from_secs(600));
        }
        a[0] = load - x[0];
        b[0] = load + 10.0 - 11.0 * x[0];
    });
    let mut x = [0.0];
    Newton::new(NewtonOptions::default())
        .solve(&map, &mut x)
        .map(|_| x[0])
}

const STUCK: f64 = 7.0;
const MEMBERS: usize = 3;

/// Not a test by itself: the work of one member of the job array below.
#[test]
fn member_of_a_job_array() -> std::io::Result<()> {
    let Ok(member) = std::env::var("SEMISMOOTH_TEST_MEMBER") else {
        return Ok(());
    };
    let folder = PathBuf::from(std::env::var("SEMISMOOTH_TEST_FOLDER").unwrap());
    run_member(&folder, &loads(), member.parse().unwrap(), MEMBERS)
}

fn loads() -> Vec<f64> {
    (0..20).map(f64::from).collect()
}

/// The recipe of the guide: a member is killed, and the same array, started again, computes what is missing and nothing else.
#[test]
fn a_job_array_started_again_fills_in_what_is_missing() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("job_array");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let start = |member: usize, stuck: bool| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "member_of_a_job_array", "--test-threads=1"])
            .env("SEMISMOOTH_TEST_MEMBER", member.to_string())
            .env("SEMISMOOTH_TEST_FOLDER", &folder)
            .stdout(Stdio::null());
        if stuck {
            command.env("SEMISMOOTH_TEST_STUCK", "1");
        }
        command.spawn().unwrap()
    };
    let has = |k: usize| folder.join(format!("{k}.txt")).exists();
    let mut members: Vec<_> = (0..MEMBERS).map(|m| start(m, true)).collect();
    // Input 7 belongs to member 1, which waits there; the others end.
    for m in [0, 2] {
        assert!(members[m].wait().unwrap().success());
    }
    members[1].kill().unwrap();
    assert!(!members[1].wait().unwrap().success());
    let done: Vec<usize> = (0..20).filter(|k| has(*k)).collect();
    assert!(!done.contains(&7) && (0..20).filter(|k| k % 3 != 1).all(|k| done.contains(&k)));
    let written = |k: usize| {
        std::fs::metadata(folder.join(format!("{k}.txt")))
            .unwrap()
            .modified()
            .unwrap()
    };
    let before: Vec<_> = done.iter().map(|k| written(*k)).collect();
    let again: Vec<_> = (0..MEMBERS).map(|m| start(m, false)).collect();
    for mut member in again {
        assert!(member.wait().unwrap().success());
    }
    assert!(done.iter().map(|k| written(*k)).eq(before));
    let expected = sweep(&loads(), |load| solved(*load));
    for (k, expected) in expected.into_iter().enumerate() {
        let text = std::fs::read_to_string(folder.join(format!("{k}.txt"))).unwrap();
        assert_eq!(text.trim().parse::<f64>().unwrap(), expected.unwrap());
    }
}
