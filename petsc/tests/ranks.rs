//! Started by `cargo test`, each case starts this program again on several processes, and looks at how the job ends.

use std::io::Read;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use semismooth::contact::{
    ContactError, FrictionCoefficient, LocalRow, LocalValues, NodeLaw, OrthotropicCoulomb, ReducedOptions,
};
use semismooth::fem::{Elasticity, Foundation, Material};
use semismooth_petsc::{DistributedBody, DistributedContact, Error, Part, World, run};

/// A job that takes longer hangs.
const LIMIT: Duration = Duration::from_secs(600);

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    if let Some("--on-ranks") = arguments.next().as_deref() {
        let case = arguments.next().unwrap_or_default();
        let options: Vec<_> = arguments.collect();
        return run(options, |world| on_ranks(world, &case));
    }
    from_outside();
    ExitCode::SUCCESS
}

struct Ended {
    success: bool,
    output: String,
}

impl Ended {
    fn count(&self, what: &str) -> usize {
        self.output.matches(what).count()
    }
}

/// Runs a program on processes; `meddle` sees the numbers of the processes that have said them.
fn job(program: &str, ranks: usize, arguments: &[&str], mut meddle: impl FnMut(&str)) -> Ended {
    let mut child = Command::new(std::env::var("MPIEXEC").unwrap_or("mpiexec".into()))
        .args(["--oversubscribe", "-n", &ranks.to_string(), program])
        .args(arguments)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        // There may be fewer cores than processes.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("mpiexec starts (MPIEXEC names another one)");
    let begun = Instant::now();
    let (send, told) = std::sync::mpsc::channel::<Vec<u8>>();
    let mut pipes: Vec<Box<dyn Read + Send>> = Vec::new();
    pipes.extend(child.stdout.take().map(|p| Box::new(p) as Box<dyn Read + Send>));
    pipes.extend(child.stderr.take().map(|p| Box::new(p) as Box<dyn Read + Send>));
    for mut pipe in pipes {
        let send = send.clone();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(n) = pipe.read(&mut buffer) {
                if n == 0 || send.send(buffer[..n].to_vec()).is_err() {
                    break;
                }
            }
        });
    }
    drop(send);
    let mut output = String::new();
    loop {
        match told.recv_timeout(Duration::from_millis(100)) {
            Ok(text) => {
                output += &String::from_utf8_lossy(&text);
                meddle(&output);
            }
            Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => break,
            Err(_) => {}
        }
        if begun.elapsed() > LIMIT {
            let _ = child.kill();
            panic!("the job hangs:\n{output}");
        }
    }
    let success = child.wait().expect("the job ends").success();
    Ended { success, output }
}

fn from_outside() {
    let own = std::env::current_exe().expect("the path of this program");
    let own = own.to_str().expect("a path in UTF-8");
    let here = |ranks: usize, case: &str| {
        println!("{case} on {ranks} processes");
        let options = if case == "solver" { "nonsense" } else { "gamg" };
        job(own, ranks, &["--on-ranks", case, "-pc_type", options], |_| {})
    };
    for ranks in [1, 2, 3] {
        println!("check on {ranks} processes");
        let ended = job(env!("CARGO_BIN_EXE_check"), ranks, &[], |_| {});
        print!("{}", ended.output);
        assert!(ended.success, "{}", ended.output);
        assert_eq!(ended.count("all agree with one process"), 1);
    }
    // (Case, message, by which process.)
    for (case, message, rank) in [
        ("error", "only here", 1),
        ("two-errors", "only here", 1),
        ("law", "does not determine the forces", 1),
        ("length", "the load", 2),
        ("floating", "rigid motions", 0),
        ("too-many", "cannot be cut", 0),
        ("not-converged", "no solution found", 0),
        ("solver", "PETSc error", 0),
    ] {
        let ended = here(3, case);
        assert!(!ended.success, "{case}: {}", ended.output);
        assert_eq!(ended.count("error: process"), 1, "{case}: {}", ended.output);
        let said = format!("error: process {rank}: ");
        assert_eq!(ended.count(&said), 1, "{case}: {}", ended.output);
        assert!(ended.count(message) >= 1, "{case}: {}", ended.output);
    }
    // What no vote can tell the others ends the job all the same.
    for (case, message) in [("elsewhere", "the others do not answer"), ("panic", "fell over")] {
        let ended = here(3, case);
        assert!(!ended.success, "{case}: {}", ended.output);
        assert_eq!(ended.count(message), 1, "{case}: {}", ended.output);
    }
    println!("killed on 3 processes");
    let mut killed = false;
    let ended = job(own, 3, &["--on-ranks", "killed"], |output| {
        let number = |line: &str| line.strip_prefix("process 1 is ")?.parse::<u32>().ok();
        // The last line may not have come whole.
        let whole = output.rfind('\n').map_or("", |end| &output[..end]);
        if let Some(id) = whole.lines().find_map(number)
            && !std::mem::replace(&mut killed, true)
        {
            let status = Command::new("kill").args(["-9", &id.to_string()]).status();
            assert!(status.is_ok_and(|s| s.success()));
        }
    });
    assert!(killed && !ended.success, "{}", ended.output);
}

fn on_ranks(world: &World, case: &str) -> Result<(), Error> {
    let here = |ranks: &[usize]| match ranks.contains(&world.rank()) {
        true => Err("only here"),
        false => Ok(()),
    };
    match case {
        "error" => world.agree(here(&[1])),
        "two-errors" => world.agree(here(&[1, 2])),
        "elsewhere" => {
            world.set_patience(Duration::from_secs(2));
            if world.rank() == 1 {
                return world.agree(here(&[1]));
            }
            world.sum([1.0]).map(|_| ())
        }
        "panic" => {
            assert!(world.rank() != 1, "fell over");
            world.sum([1.0]).map(|_| ())
        }
        "killed" => {
            println!("process {} is {}", world.rank(), std::process::id());
            loop {
                if world.rank() == 1 {
                    std::thread::sleep(Duration::from_millis(50));
                }
                world.sum([1.0])?;
            }
        }
        "too-many" => Part::rectangle(world, [0.0; 2], [1.0; 2], [1, 0]).map(|_| ()),
        _ => contact(world, case),
    }
}

fn contact(world: &World, case: &str) -> Result<(), Error> {
    let part = Part::block(world, [0.0; 3], [2.0, 2.0, 1.0], [6, 6, 3])?;
    let body = Elasticity::new(part.mesh().clone(), world.agree(Material::isotropic(1.0, 0.277))?);
    let body = match case {
        "floating" => body.fix_component("top", 2),
        _ => body.fix("left"),
    };
    let system = world.agree(body.discretize())?;
    let mut load = world.agree(system.traction("top", |_| [0.01, 0.0, -0.01]))?;
    let ground = Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]);
    let rows = world.agree(system.contact("bottom", &ground))?;
    let body = DistributedBody::new(world, &part, &system, &rows)?;
    let coulomb = OrthotropicCoulomb::isotropic(world.agree(FrictionCoefficient::constant(0.3))?);
    let law = Odd {
        coulomb,
        from: match (case, world.rank()) {
            ("law", 1 | 2) => 0,
            _ => usize::MAX,
        },
    };
    if case == "length" && world.rank() == 2 {
        load.pop();
    }
    let mut options = ReducedOptions::default();
    if case == "not-converged" {
        options = options.with_max_iterations(2).with_max_load_steps(0);
    }
    let mut problem = DistributedContact::new(body, law, options)?;
    let outcome = problem.solve(1.0, &load, None);
    if let ("not-converged", Err(Error::Agreed { source, .. })) = (case, &outcome) {
        let source = source.as_ref().and_then(|e| e.downcast_ref::<ContactError>());
        let Some(ContactError::NotConverged { best }) = source else {
            panic!("no best iterate");
        };
        assert_eq!(best.displacements.len(), load.len());
        assert!(
            best.iterations.len() == 2 && best.residuals.largest() < best.iterations[0].residuals.largest()
        );
    }
    outcome.map(|_| ())
}

/// Coulomb friction, but for nodes whose forces it leaves open.
struct Odd {
    coulomb: OrthotropicCoulomb,
    from: usize,
}

impl NodeLaw for Odd {
    fn num_tangents(&self) -> usize {
        self.coulomb.num_tangents()
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        self.coulomb.tests(v, out);
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        self.coulomb.test_rows(v, rows);
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        self.coulomb.residual(piece, v)
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        match v.node >= self.from {
            true => [LocalRow::default(); 3],
            false => self.coulomb.rows(piece, v),
        }
    }
}
