//! Histories that are killed and resumed.

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use semismooth::contact::{FrictionCoefficient, FrictionCurve, OrthotropicCoulomb, ReducedOptions};
use semismooth::fem::{Elasticity, Foundation, Material};
use semismooth_petsc::{DistributedBody, DistributedContact, Error, Part, World};

use crate::{Ended, files::folder, job};

const LEVELS: u64 = 6;
/// The level after which a job that is to be killed loops forever.
const LAST: u64 = 3;
const AGREEMENT: f64 = 1e-10;

fn state() -> PathBuf {
    folder().join("history.state")
}

/// On each process: computes the levels that are not saved yet, or all levels without saving.
pub fn run(world: &World, case: &str) -> Result<(), Error> {
    let part = Part::block(world, [0.0; 3], [2.0, 2.0, 1.0], [6, 6, 3])?;
    let material = world.agree(Material::isotropic(1.0, 0.277))?;
    let system = Elasticity::new(part.mesh().clone(), material).fix("left");
    let system = world.agree(system.discretize())?;
    let press = world.agree(system.traction("top", |_| [0.0, 0.0, -0.01]))?;
    let pull = world.agree(system.traction("right", |_| [0.01, 0.003, 0.002]))?;
    let ground = Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]);
    let rows = world.agree(system.contact("bottom", &ground))?;
    let body = DistributedBody::new(world, &part, &system, &rows)?;
    let weakening = |f: f64| {
        let curve = world.agree(FrictionCurve::exponential(f, 0.5 * f, 0.02))?;
        Ok(FrictionCoefficient::uniform(curve))
    };
    let law = OrthotropicCoulomb::new(weakening(0.3)?, weakening(0.5)?);
    let options = ReducedOptions::default().with_tolerance(1e-12);
    let mut problem = DistributedContact::new(body, law, options)?;
    let keeps = case != "history-whole";
    let saved = match keeps {
        true => problem.resume(state())?,
        false => None,
    };
    let first = saved.as_ref().map_or(1, |s| s.level + 1);
    if world.rank() == 0 {
        println!("from level {first}");
    }
    let mut u = saved.map(|s| s.displacements);
    for level in first..=LEVELS {
        let alpha = level as f64 / LEVELS as f64;
        let load: Vec<f64> = press.iter().zip(&pull).map(|(a, b)| a + alpha * b).collect();
        let found = problem.solve(alpha, &load, u.as_deref())?;
        problem.end_level(alpha, &found)?;
        if keeps {
            problem.save(state(), level, alpha, &found.displacements)?;
        }
        let weighed = |v: &[f64]| v.iter().enumerate().map(|(i, v)| (1 + i % 7) as f64 * v).sum();
        let told: [f64; 2] = world.sum([weighed(&found.displacements), weighed(&found.forces)])?;
        if world.rank() == 0 {
            println!("level {level} {:?} {:?} {:?}", told[0], told[1], found.states);
        }
        if case == "history-held" && level == LAST {
            println!("process {} is {}", world.rank(), std::process::id());
            loop {
                problem.solve(alpha, &load, None)?;
            }
        }
        u = Some(found.displacements);
    }
    Ok(())
}

/// Ids of the processes that have printed them in a complete line.
pub fn processes(output: &str) -> Vec<(u32, u32)> {
    let whole = output.rfind('\n').map_or("", |end| &output[..end]);
    let told = |line: &str| {
        let (rank, id) = line.strip_prefix("process ")?.split_once(" is ")?;
        Some((rank.parse().ok()?, id.parse().ok()?))
    };
    whole.lines().filter_map(told).collect()
}

fn send(signal: &str, id: u32) {
    let status = Command::new("kill").args([signal, &id.to_string()]).status();
    assert!(status.is_ok_and(|s| s.success()));
}

/// Checks that no process of a job is left some seconds after its end.
fn none_left(output: &str) {
    let begun = Instant::now();
    for (rank, id) in processes(output) {
        // The id may belong to another process meanwhile.
        let lives = || {
            let line = std::fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
            String::from_utf8_lossy(&line).contains("--on-ranks")
        };
        while lives() {
            assert!(
                begun.elapsed() < Duration::from_secs(20),
                "process {rank} stays:\n{output}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

struct Level {
    number: u64,
    sums: [f64; 2],
    states: String,
}

fn levels(output: &str) -> Vec<Level> {
    let read = |line: &str| {
        let mut words = line.strip_prefix("level ")?.splitn(4, ' ');
        let number = words.next()?.parse().ok()?;
        let sums = [words.next()?.parse().ok()?, words.next()?.parse().ok()?];
        let states = words.next()?.into();
        Some(Level { number, sums, states })
    };
    output.lines().filter_map(read).collect()
}

/// A job that is killed after its third level, by each signal, and resumed.
pub fn from_outside(own: &str, ranks: usize) {
    let start = |case: &str, meddle: &mut dyn FnMut(&str, u32)| -> Ended {
        println!("{case} on {ranks} processes");
        job(own, ranks, &["--on-ranks", case], meddle)
    };
    let whole = start("history-whole", &mut |_, _| {});
    assert!(whole.success, "{}", whole.output);
    let expected = levels(&whole.output);
    assert_eq!(expected.len() as u64, LEVELS);
    // SIGKILL, which cannot be caught, to one process; Ctrl-C (SIGINT) to mpiexec, which ends all of them.
    for (signal, message) in [("-9", "signal 9"), ("-INT", "interrupted by a signal")] {
        let _ = std::fs::remove_file(state());
        let mut killed = false;
        let ended = start("history-held", &mut |output, mpiexec| {
            let known = processes(output);
            if known.len() == ranks && !std::mem::replace(&mut killed, true) {
                let one = known.iter().find(|p| p.0 == 1).map_or(mpiexec, |p| p.1);
                send(signal, if signal == "-9" { one } else { mpiexec });
            }
        });
        assert!(killed && !ended.success, "{}", ended.output);
        assert_eq!(ended.count(message), 1, "{}", ended.output);
        none_left(&ended.output);
        let resumed = start("history", &mut |_, _| {});
        assert!(resumed.success, "{}", resumed.output);
        assert_eq!(
            resumed.count(&format!("from level {}\n", LAST + 1)),
            1,
            "{}",
            resumed.output
        );
        let mut found = levels(&ended.output);
        found.extend(levels(&resumed.output));
        assert_eq!(found.len(), expected.len());
        for (a, b) in found.iter().zip(&expected) {
            assert_eq!((a.number, &a.states), (b.number, &b.states));
            for k in 0..2 {
                assert!((a.sums[k] - b.sums[k]).abs() <= AGREEMENT * b.sums[k].abs());
            }
        }
    }
    // One file per process, and the one that names them.
    let files = || {
        let all = std::fs::read_dir(folder()).expect("the folder").flatten();
        let mut own: Vec<PathBuf> = all.map(|f| f.path()).collect();
        own.retain(|p| p.to_string_lossy().contains("history.state."));
        own
    };
    assert_eq!(files().len(), ranks);
    // Another number of processes, and a file with a wrong byte.
    println!("history of another size and from a damaged file");
    let other = job(own, ranks + 1, &["--on-ranks", "history"], |_, _| {});
    let told = format!("was saved by {ranks} processes, and this job has {}", ranks + 1);
    assert!(!other.success && other.count(&told) == 1, "{}", other.output);
    let path = files().pop().expect("a file");
    let mut bytes = std::fs::read(&path).expect("a file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).expect("a file");
    let damaged = start("history", &mut |_, _| {});
    assert!(
        !damaged.success && damaged.count("not all of one") == 1,
        "{}",
        damaged.output
    );
}
