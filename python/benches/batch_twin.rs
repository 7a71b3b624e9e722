//! The batch of `batches.py` without Python: `batch_twin FILE MEMBERS THREADS`, FILE with the entries of all M and then of all q.
//! Prints the least of three times in seconds, and what the threads computed, which on Linux the kernel counts.

use std::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::sparse::{Matrix, Pattern};

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

const N: usize = 20;
/// Members that a thread takes at once.
const TOGETHER: usize = 16;

/// The members from `first` on, until none are left: their solutions.
fn solved(data: &[f64], members: usize, next: &AtomicUsize) -> Outcome<Vec<(usize, Vec<f64>)>> {
    let (matrices, constants) = data.split_at(members * N * N);
    let pattern = Pattern::full(N, N);
    let (mut solver, mut found) = (McpSolver::default(), Vec::new());
    loop {
        let first = next.fetch_add(TOGETHER, Ordering::Relaxed);
        if first >= members {
            return Ok(found);
        }
        for i in first..members.min(first + TOGETHER) {
            let rows = &matrices[i * N * N..(i + 1) * N * N];
            let columns = (0..N * N).map(|e| rows[e % N * N + e / N]).collect();
            let matrix = Matrix::from_values(pattern.clone(), columns)?;
            let lcp = Lcp::new(matrix, constants[i * N..(i + 1) * N].to_vec())?;
            let mut x = vec![0.0; N];
            if !solver.solve(lcp.mcp(), &mut x)?.is_solved() {
                return Err(format!("member {i} is not solved").into());
            }
            found.push((i, x));
        }
    }
}

/// Seconds that all threads of this process have computed, in ticks of 1/100 s; NaN where the kernel does not tell.
fn processors() -> f64 {
    const TICK: f64 = 0.01;
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Behind the name, which may have spaces: the 12th and the 13th field are the user's and the system's ticks.
    let fields = text
        .rsplit_once(')')
        .map_or("", |(_, rest)| rest)
        .split_whitespace();
    let ticks: Vec<f64> = fields
        .skip(11)
        .take(2)
        .filter_map(|field| field.parse().ok())
        .collect();
    if ticks.len() == 2 {
        TICK * ticks.iter().sum::<f64>()
    } else {
        f64::NAN
    }
}

fn main() -> Outcome<()> {
    let [file, members, threads] = [1, 2, 3].map(|k| std::env::args().nth(k).unwrap_or_default());
    let (members, threads): (usize, usize) = (members.parse()?, threads.parse()?);
    let bytes = std::fs::read(file)?;
    let numbers = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b));
    let data: Vec<f64> = numbers.collect();
    if data.len() != members * (N * N + N) {
        return Err(format!("{} numbers for {members} members", data.len()).into());
    }
    let mut best = [f64::INFINITY; 2];
    for _ in 0..3 {
        let (begun, used, next) = (Instant::now(), processors(), AtomicUsize::new(0));
        let all = std::thread::scope(|scope| {
            let spawned: Vec<_> = (0..threads)
                .map(|_| scope.spawn(|| solved(&data, members, &next)))
                .collect();
            let joined = spawned.into_iter().map(|thread| thread.join());
            joined
                .map(|found| found.unwrap_or_else(|_| Err("a thread ended".into())))
                .collect::<Outcome<Vec<_>>>()
        })?;
        let mut x = vec![0.0; members * N];
        for (i, own) in all.iter().flatten() {
            x[i * N..(i + 1) * N].copy_from_slice(own);
        }
        let times = [begun.elapsed().as_secs_f64(), processors() - used];
        best.iter_mut().zip(times).for_each(|(b, t)| *b = b.min(t));
    }
    println!("{} {}", best[0], best[1]);
    Ok(())
}
