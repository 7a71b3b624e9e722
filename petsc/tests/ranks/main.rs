//! Each case starts this program again on several processes and checks how the job ends. An argument selects the cases whose names contain
//! it.

mod files;
mod history;

use std::io::Read;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use semismooth::contact::{
    ContactError, FrictionCoefficient, LocalRow, LocalValues, NodeLaw, OrthotropicCoulomb, ReducedOptions,
};
use semismooth::fem::{CellKind, Elasticity, Foundation, Material, Mesh};
use semismooth::sparse::Matrix;
use semismooth_petsc::{DistributedBody, DistributedContact, Error, Part, PartField, World, run};

/// A job that takes longer counts as hanging.
const LIMIT: Duration = Duration::from_secs(600);

/// Packages that PETSc may have been built with: name, text in the view of the solver, and options that select it.
const OTHER_SOLVERS: [(&str, &str, &[&str]); 2] = [
    (
        "mumps",
        "type: mumps",
        &[
            "-pc_type",
            "lu",
            "-pc_factor_mat_solver_type",
            "mumps",
            "-ksp_view",
        ],
    ),
    // hypre smooths point by point: nodes on the verge of slip, whose stiff direction is along no axis, need blocks.
    (
        "hypre",
        "HYPRE BoomerAMG preconditioning",
        &[
            "-pc_type",
            "composite",
            "-pc_composite_type",
            "multiplicative",
            "-pc_composite_pcs",
            "hypre,pbjacobi",
            "-ksp_view",
        ],
    ),
];
/// PETSc's errors for packages that it was built without: unknown type, missing factorisation.
const LACKING: [&str; 2] = ["PETSc error 86", "PETSc error 92"];

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let first = arguments.next();
    if first.as_deref() == Some("--on-ranks") {
        let case = arguments.next().unwrap_or_default();
        let options: Vec<_> = arguments.collect();
        return run(options, |world| on_ranks(world, &case));
    }
    let filter = first.unwrap_or_default();
    from_outside(&|case| case.contains(&filter));
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

/// Runs a program on a number of processes; `meddle` is called with their output so far and the id of mpiexec.
fn job(program: &str, ranks: usize, arguments: &[&str], mut meddle: impl FnMut(&str, u32)) -> Ended {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut child = Command::new(std::env::var("MPIEXEC").unwrap_or("mpiexec".into()))
        .args(["--oversubscribe", "-n", &ranks.to_string(), program])
        .args(arguments)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        // Waiting processes yield only if there are fewer cores than processes: on a busy machine they would resume late.
        .env(
            "OMPI_MCA_mpi_yield_when_idle",
            if ranks > cores { "1" } else { "0" },
        )
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
                meddle(&output, child.id());
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

fn from_outside(wanted: &dyn Fn(&str) -> bool) {
    let own = std::env::current_exe().expect("the path of this program");
    let own = own.to_str().expect("a path in UTF-8");
    let here = |ranks: usize, case: &str| {
        println!("{case} on {ranks} processes");
        let options: &[&str] = match case {
            "solver" => &["-pc_type", "nonsense"],
            // With this tolerance every residual counts as divergence.
            "breakdown" => &["-ksp_divtol", "1e-30"],
            _ => &["-pc_type", "gamg"],
        };
        job(own, ranks, &[&["--on-ranks", case], options].concat(), |_, _| {})
    };
    for ranks in [1, 2, 3].into_iter().filter(|_| wanted("check")) {
        println!("check on {ranks} processes");
        let ended = job(env!("CARGO_BIN_EXE_check"), ranks, &[], |_, _| {});
        print!("{}", ended.output);
        assert!(ended.success, "{}", ended.output);
        assert_eq!(ended.count("all agree with one process"), 1);
    }
    for (package, shown, options) in OTHER_SOLVERS.into_iter().filter(|s| wanted(s.0)) {
        for ranks in [1, 2] {
            println!("check with {package} on {ranks} processes");
            let ended = job(env!("CARGO_BIN_EXE_check"), ranks, options, |_, _| {});
            if LACKING.iter().any(|code| ended.output.contains(code)) {
                println!("left out: this PETSc has no {package}");
                continue;
            }
            assert!(ended.success, "{}", ended.output);
            assert_eq!(ended.count("all agree with one process"), 1);
            assert!(
                ended.count(shown) >= 1,
                "{package} was not used: {}",
                ended.output
            );
        }
    }
    files::write_gmsh(&files::folder().join("body.msh"));
    let files = [
        (1, "files-1"),
        (2, "files-2"),
        (3, "files-3"),
        (1, "condensed-1"),
        (3, "condensed-3"),
    ];
    for (ranks, case) in files.into_iter().filter(|c| wanted(c.1)) {
        let ended = here(ranks, case);
        assert!(ended.success, "{}", ended.output);
        files::compare(&format!("{case}.pvtu"), ranks, &ended.output);
    }
    // (Case, message, process that reports it.)
    for (case, message, rank) in [
        ("error", "only here", 1),
        ("two-errors", "only here", 1),
        ("law", "does not determine the forces", 1),
        ("length", "the load", 2),
        ("floating", "rigid motions", 0),
        ("coupled", "couple several nodes", 1),
        ("dense", "bytes", 0),
        ("too-many", "cannot be cut", 0),
        ("too-few-nodes", "cannot be spread", 0),
        ("no-mesh", "gave none", 0),
        ("no-file", "no-such-file.msh", 0),
        ("pvtu", "ends in .pvtu", 0),
        ("field", "speed", 1),
        ("not-converged", "no solution found", 0),
        ("memory", "bytes would be needed", 0),
        ("breakdown", "linear solver stopped", 0),
        ("solver", "PETSc error", 0),
    ]
    .into_iter()
    .filter(|c| wanted(c.0))
    {
        // A triangle has three nodes.
        let ended = here(if case == "too-few-nodes" { 4 } else { 3 }, case);
        assert!(!ended.success, "{case}: {}", ended.output);
        assert_eq!(ended.count("error: process"), 1, "{case}: {}", ended.output);
        let said = format!("error: process {rank}: ");
        assert_eq!(ended.count(&said), 1, "{case}: {}", ended.output);
        assert!(ended.count(message) >= 1, "{case}: {}", ended.output);
    }
    // Errors that cannot be put to a vote end the job as well.
    let left = [("elsewhere", "the others do not answer"), ("panic", "fell over")];
    for (case, message) in left.into_iter().filter(|c| wanted(c.0)) {
        let ended = here(3, case);
        assert!(!ended.success, "{case}: {}", ended.output);
        assert_eq!(ended.count(message), 1, "{case}: {}", ended.output);
    }
    if wanted("history") {
        history::from_outside(own, 3);
    }
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
        "too-many" => Part::rectangle(world, [0.0; 2], [1.0; 2], [1, 0]).map(|_| ()),
        "too-few-nodes" => {
            let mesh = world.agree(Mesh::new(
                2,
                vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
                [(CellKind::Triangle, vec![0, 1, 2])],
            ))?;
            Part::scatter(world, Some(&mesh)).map(|_| ())
        }
        "no-mesh" => Part::scatter(world, None).map(|_| ()),
        "no-file" => Part::read_gmsh(world, "no-such-file.msh").map(|_| ()),
        "pvtu" | "field" => {
            let part = Part::rectangle(world, [0.0; 2], [1.0; 2], [4, 4])?;
            let missing = usize::from(case == "field" && world.rank() == 1);
            let values = vec![0.0; part.mesh().num_nodes() - missing];
            let name = if case == "field" {
                "field.pvtu"
            } else {
                "field.vtu"
            };
            part.write(
                world,
                files::folder().join(name),
                &[PartField::new("speed", 1, &values)],
            )
        }
        _ if case.starts_with("files-") || case.starts_with("condensed-") => {
            files::solve(world, &format!("{case}.pvtu"))
        }
        _ if case.starts_with("history") => history::run(world, case),
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
    let mut rows = world.agree(system.contact("bottom", &ground))?;
    if case == "coupled" && world.rank() == 1 {
        // As between two bodies: a row with the displacements of two nodes.
        let (p, n) = (rows.nodes.len(), system.num_free());
        let own = rows.normal.triplets().chain([(0, 0, -0.5), (0, n - 1, -0.5)]);
        rows.normal = Matrix::from_triplets(p, n, &own.collect::<Vec<_>>()).expect("contact nodes here");
    }
    let body = DistributedBody::new(world, &part, &system, &rows)?;
    if case == "memory" {
        let needed = body.memory(&ReducedOptions::default());
        let options = ReducedOptions::default().with_max_memory(Some(needed - 1));
        let coulomb = OrthotropicCoulomb::isotropic(world.agree(FrictionCoefficient::constant(0.3))?);
        return DistributedContact::new(body, coulomb, options).map(|_| ());
    }
    if case == "dense" {
        return body.condense(Some(1000)).map(|_| ());
    }
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
    match (case, &outcome) {
        // Each process has its part of the best iterate.
        ("law", Err(Error::Agreed { source, .. })) => {
            let source = source.as_ref().and_then(|e| e.downcast_ref::<ContactError>());
            let Some(ContactError::NotReducible { best, .. } | ContactError::Elsewhere { best }) = source
            else {
                panic!("no best iterate");
            };
            assert_eq!(best.displacements.len(), load.len());
        }
        ("breakdown", Err(Error::StepFailed { best, .. })) => {
            assert_eq!((best.displacements.len(), best.iterations.len()), (load.len(), 1));
        }
        ("law" | "breakdown", _) => panic!("no best iterate"),
        _ => {}
    }
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

/// Coulomb friction, except at nodes whose forces the law does not determine.
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
