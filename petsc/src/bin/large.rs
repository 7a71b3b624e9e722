//! A large block on a foundation, pressed and pulled: `mpiexec -n 2 large [88x84x44] [options of PETSc]`. Two loads, the second started
//! from the solution of the first; prints times, iterations, and the maxima over the processes of memory and floating-point operations.

use std::process::ExitCode;
use std::time::Instant;

use semismooth::contact::{FrictionCoefficient, OrthotropicCoulomb, ReducedOptions};
use semismooth::fem::{Elasticity, Foundation, Material};
use semismooth_petsc::{DistributedBody, DistributedContact, Error, Part, World, run};

fn main() -> ExitCode {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let cells = match arguments.first().map(|a| cells(a)) {
        Some(Some(cells)) => {
            arguments.remove(0);
            cells
        }
        _ => [88, 84, 44],
    };
    run(arguments, |world| large(world, cells))
}

fn cells(text: &str) -> Option<[usize; 3]> {
    let list: Result<Vec<usize>, _> = text.split('x').map(str::parse).collect();
    list.ok()?.try_into().ok()
}

fn large(world: &World, cells: [usize; 3]) -> Result<(), Error> {
    let mut watch = Watch::new(world);
    let part = Part::block(world, [0.0; 3], [2.0, 2.0, 1.0], cells)?;
    let material = world.agree(Material::isotropic(1.0, 0.277))?;
    let system = Elasticity::new(part.mesh().clone(), material).fix("left");
    let system = world.agree(system.discretize())?;
    let press = world.agree(system.traction("top", |_| [0.0, 0.0, -0.01]))?;
    let pull = world.agree(system.traction("right", |_| [0.01, 0.0, 0.002]))?;
    let ground = Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]);
    let rows = world.agree(system.contact("bottom", &ground))?;
    let body = DistributedBody::new(world, &part, &system, &rows)?;
    // The body has its own copy of the matrix.
    drop((system, rows, part));
    let (n, p) = (body.num_displacements(), body.num_contacts());
    let law = OrthotropicCoulomb::isotropic(world.agree(FrictionCoefficient::constant(0.3))?);
    let mut problem = DistributedContact::new(body, law, ReducedOptions::default())?;
    if world.rank() == 0 {
        println!("{} processes: {n} displacements, {p} contact nodes", world.size());
    }
    watch.say("mesh, assembly", "")?;
    let mut u: Option<Vec<f64>> = None;
    for alpha in [1.0, 1.05] {
        let load: Vec<f64> = press.iter().zip(&pull).map(|(a, b)| a + alpha * b).collect();
        let found = problem.solve(alpha, &load, u.as_deref())?;
        let told = format!(
            "{} Newton, {} GMRES, {:?} open, sticking, slipping; hierarchy {:.1} s, GMRES {:.1} s, rest {:.1} s",
            found.newton(),
            found.krylov(),
            found.states,
            found.times.select.as_secs_f64(),
            found.times.krylov.as_secs_f64(),
            found.times.rest.as_secs_f64(),
        );
        watch.say(&format!("load {alpha}"), &told)?;
        u = Some(found.displacements);
    }
    Ok(())
}

/// Wall time, processor time and operations since the previous line.
struct Watch<'w> {
    world: &'w World,
    clock: Instant,
    processor: f64,
    operations: f64,
}

impl<'w> Watch<'w> {
    fn new(world: &'w World) -> Self {
        Self {
            world,
            clock: Instant::now(),
            processor: processor_seconds(),
            operations: world.operations(),
        }
    }

    fn say(&mut self, what: &str, told: &str) -> Result<(), Error> {
        let (processor, operations) = (processor_seconds(), self.world.operations());
        let own = [
            self.clock.elapsed().as_secs_f64(),
            processor - self.processor,
            operations - self.operations,
            peak_memory(),
        ];
        let [seconds, busy, work, memory] = self.world.max(own)?;
        if self.world.rank() == 0 {
            println!(
                "{what:<15} {seconds:6.1} s, processor {busy:6.1} s, {:7.2} Gflop, peak {:6.0} MiB  {told}",
                work / 1e9,
                memory / f64::from(1 << 20),
            );
        }
        (self.clock, self.processor, self.operations) = (Instant::now(), processor, operations);
        Ok(())
    }
}

/// Processor time of this process in seconds, on Linux.
fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // After the name in parentheses, user and system time are fields 12 and 13, in hundredths of a second.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields
        .skip(11)
        .take(2)
        .filter_map(|f| f.parse::<f64>().ok())
        .sum::<f64>()
        / 100.0
}

/// Peak memory of this process in bytes, on Linux.
fn peak_memory() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let number = line
        .and_then(|l| l.split_whitespace().next())
        .and_then(|n| n.parse::<f64>().ok());
    1024.0 * number.unwrap_or(f64::NAN)
}
