//! Compares solutions on all processes with those on one: `mpiexec -n 2 check [options of PETSc]`.
//!
//! The reference is the condensed form of `semismooth` (a Cholesky factorisation and a dense problem on the contact nodes), an independent
//! route to the same solution. Displacements and forces must agree to 1e-8 of the largest; the numbers of open, sticking and slipping
//! nodes must be equal.

use std::collections::HashMap;
use std::error::Error as StdError;
use std::process::ExitCode;

use semismooth::contact::{
    CondensedContact, FrictionCoefficient, FrictionCurve, Frictionless, LoadPath, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, ReducedOptions,
};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh};
use semismooth_petsc::{DistributedBody, DistributedContact, Error, Part, World, run};

const AGREEMENT: f64 = 1e-8;
const TOLERANCE: f64 = 1e-12;
/// Largest number of iterations for one linear system: multigrid with blocks at nodes on the verge of slip takes about ten.
const KRYLOV: usize = 30;

fn main() -> ExitCode {
    run(std::env::args().skip(1), check)
}

/// A body, given by its numbers of cells, foundation and law, at two loads; the second solve starts from the first solution.
struct Case<'a> {
    name: &'a str,
    cells: &'a [usize],
    curved: bool,
    levels: bool,
    law: &'a dyn NodeLaw,
    alphas: [f64; 2],
}

fn check(world: &World) -> Result<(), Error> {
    let constant = |f| world.agree(FrictionCoefficient::constant(f));
    let weakening = |f: f64| {
        let curve = world.agree(FrictionCurve::exponential(f, 0.5 * f, 0.02))?;
        Ok(FrictionCoefficient::uniform(curve))
    };
    let planar = PlanarCoulomb::new(constant(0.3)?);
    let planar_weakening = PlanarCoulomb::new(weakening(0.4)?);
    let coulomb = OrthotropicCoulomb::isotropic(constant(0.3)?);
    let rough = OrthotropicCoulomb::isotropic(constant(0.8)?);
    let orthotropic = OrthotropicCoulomb::new(constant(0.2)?, constant(0.6)?);
    let slip_dependent = OrthotropicCoulomb::new(weakening(0.3)?, weakening(0.5)?);
    let frictionless = Frictionless::space();
    let case = |name, cells, law, alphas| Case {
        name,
        cells,
        curved: false,
        levels: false,
        law,
        alphas,
    };
    let cases = [
        case("plane, Coulomb", &[48, 24], &planar, [0.5, 1.0]),
        case("plane, slip-dependent", &[48, 24], &planar_weakening, [0.5, 1.0]),
        case("space, frictionless", &[6, 6, 3], &frictionless, [1.0, 2.0]),
        case("space, Coulomb", &[10, 10, 5], &coulomb, [1.0, 1.05]),
        case("space, Coulomb, F = 0.8", &[6, 6, 3], &rough, [0.5, 1.0]),
        case("space, orthotropic", &[6, 6, 3], &orthotropic, [1.0, 1.5]),
        case("space, slip-dependent", &[6, 6, 3], &slip_dependent, [0.8, 1.0]),
        Case {
            curved: true,
            ..case("space, curved ground", &[8, 6, 4], &orthotropic, [0.5, 1.0])
        },
        Case {
            levels: true,
            ..case("space, levels of slip", &[6, 6, 3], &slip_dependent, [0.5, 1.0])
        },
        Case {
            levels: true,
            ..case("space, levels of slip", &[14, 14, 7], &coulomb, [0.9, 1.0])
        },
    ];
    if world.rank() == 0 {
        println!(
            "{:<24} {:>8} {:>5}  {:>6}  {:>21} {:>11}  {:>13}",
            "", "unknowns", "nodes", "α", "open, stick, slip", "Newton+GMRES", "u, λ differ by"
        );
    }
    let mut worst = 0.0f64;
    for case in &cases {
        worst = worst.max(case.compare(world)?);
    }
    world.agree(if worst <= AGREEMENT {
        Ok(())
    } else {
        Err(format!("differences of {worst:.1e}, {AGREEMENT:.0e} are allowed"))
    })?;
    if world.rank() == 0 {
        println!(
            "{} processes: all agree with one process to {worst:.1e}",
            world.size()
        );
    }
    Ok(())
}

type Boxed = Box<dyn StdError + Send + Sync>;

impl Case<'_> {
    /// The largest difference.
    fn compare(&self, world: &World) -> Result<f64, Error> {
        let part = match *self.cells {
            [nx, ny] => Part::rectangle(world, [0.0; 2], [2.0, 1.0], [nx, ny]),
            _ => {
                let cells = [0, 1, 2].map(|d| self.cells.get(d).copied().unwrap_or(0));
                Part::block(world, [0.0; 3], [2.0, 2.0, 1.0], cells)
            }
        }?;
        let system = world.agree(discretize(part.mesh().clone()))?;
        let [press, pull] = world.agree(loads(&system))?;
        let rows = world.agree(self.contact(&system))?;
        let body = DistributedBody::new(world, &part, &system, &rows)?;
        let options = ReducedOptions::default().with_tolerance(TOLERANCE);
        let mut problem = DistributedContact::new(body, self.law, options)?;
        let mut whole = world.agree(self.whole())?;
        let (mut x, mut u): (Option<Vec<f64>>, Option<Vec<f64>>) = (None, None);
        let mut worst = 0.0f64;
        for alpha in self.alphas {
            let load: Vec<f64> = press.iter().zip(&pull).map(|(a, b)| a + alpha * b).collect();
            let found = problem.solve(alpha, &load, u.as_deref())?;
            let expected = world.agree(whole.problem.solve(alpha, x.as_deref()))?;
            let solution = world.agree(whole.problem.solution(&expected))?;
            let differ = whole.difference(
                &part,
                &system,
                &problem,
                &found.displacements,
                &found.forces,
                &expected,
            );
            let differ = world.max(world.agree(differ)?)?;
            let counts = [solution.open(), solution.stick(), solution.slip()];
            if world.rank() == 0 {
                println!(
                    "{:<24} {:>8} {:>5}  {alpha:>6}  {:>21} {:>5} + {:<5} {:>7.0e} {:>6.0e}",
                    self.name,
                    problem.body().num_displacements(),
                    problem.body().num_contacts(),
                    format!("{:?}", found.states),
                    found.newton(),
                    found.krylov(),
                    differ[0],
                    differ[1],
                );
            }
            world.agree(if counts == found.states {
                Ok(())
            } else {
                Err(format!(
                    "open, stick, slip are {:?} here, {counts:?} in one process",
                    found.states
                ))
            })?;
            let longest = found.iterations.iter().map(|i| i.krylov).max().unwrap_or(0);
            world.agree(if longest <= KRYLOV {
                Ok(())
            } else {
                Err(format!(
                    "a linear system took {longest} iterations, {KRYLOV} are allowed"
                ))
            })?;
            worst = worst.max(differ[0]).max(differ[1]);
            if self.levels {
                problem.end_level(alpha, &found)?;
                world.agree(whole.problem.end_level(&expected))?;
            }
            (x, u) = (Some(expected), Some(found.displacements));
        }
        Ok(worst)
    }

    fn contact(&self, system: &ElasticSystem) -> Result<ContactRows, FemError> {
        let ground = match (self.curved, self.cells.len()) {
            (true, _) => Foundation::gap(|x| 0.004 * ((x[0] - 1.0).powi(2) + (x[1] - 1.0).powi(2)))
                .with_normal(|x| [0.2 * (x[0] - 1.0), 0.3 * (x[1] - 1.0), -1.0]),
            (false, 2) => Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]),
            (false, _) => Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]),
        };
        system.contact("bottom", &ground)
    }

    fn whole(&self) -> Result<Whole<'_>, Boxed> {
        let mesh = match *self.cells {
            [nx, ny] => Mesh::rectangle([0.0; 2], [2.0, 1.0], [nx, ny])?,
            _ => Mesh::block(
                [0.0; 3],
                [2.0, 2.0, 1.0],
                [0, 1, 2].map(|d| self.cells.get(d).copied().unwrap_or(0)),
            )?,
        };
        let system = discretize(mesh)?;
        let [press, pull] = loads(&system)?;
        let rows = self.contact(&system)?;
        let body = semismooth::contact_body(&system, &rows, LoadPath::affine(press, pull))?;
        Ok(Whole {
            at: rows
                .points
                .iter()
                .enumerate()
                .map(|(i, p)| (bits(p), i))
                .collect(),
            problem: CondensedContact::new(body, self.law)?,
            system,
        })
    }
}

fn discretize(mesh: Mesh) -> Result<ElasticSystem, FemError> {
    Elasticity::new(mesh, Material::isotropic(1.0, 0.277)?)
        .fix("left")
        .discretize()
}

/// Pressure on top, and a pull on the right.
fn loads(system: &ElasticSystem) -> Result<[Vec<f64>; 2], FemError> {
    let plane = system.mesh().dim() == 2;
    let down = if plane {
        [0.0, -0.01, 0.0]
    } else {
        [0.0, 0.0, -0.01]
    };
    let along = if plane {
        [0.01, 0.002, 0.0]
    } else {
        [0.01, 0.003, 0.002]
    };
    Ok([
        system.traction("top", |_| down)?,
        system.traction("right", |_| along)?,
    ])
}

fn bits(p: &[f64; 3]) -> [u64; 3] {
    p.map(f64::to_bits)
}

/// The whole body; each process solves for it.
struct Whole<'a> {
    system: ElasticSystem,
    problem: CondensedContact<&'a dyn NodeLaw>,
    /// Contact nodes by position.
    at: HashMap<[u64; 3], usize>,
}

impl Whole<'_> {
    /// The largest differences of displacements and of contact forces of a part, relative to the largest values of the whole.
    fn difference<L: NodeLaw>(
        &self,
        part: &Part,
        system: &ElasticSystem,
        problem: &DistributedContact<'_, L>,
        u: &[f64],
        forces: &[f64],
        x: &[f64],
    ) -> Result<[f64; 2], Boxed> {
        let dim = system.mesh().dim();
        let theirs = self.system.displacements(&self.problem.displacements(x)?, &[])?;
        let points = self.system.mesh().points().iter().enumerate();
        let at: HashMap<_, _> = points.map(|(n, p)| (bits(p), n)).collect();
        let ours = system.displacements(u, &[])?;
        let largest = |v: &[f64]| v.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
        let mut differ = [0.0f64; 2];
        // Including nodes of other processes.
        for (n, p) in part.mesh().points().iter().enumerate() {
            let m = at
                .get(&bits(p))
                .ok_or("a node that the whole mesh does not have")?;
            for d in 0..dim {
                differ[0] = differ[0].max((ours[dim * n + d] - theirs[dim * m + d]).abs());
            }
        }
        let (own, all) = (problem.body().contacts(), self.at.len());
        for (i, n) in own.iter().enumerate() {
            let at = self.at.get(&bits(&part.mesh().points()[*n]));
            let j = at.ok_or("a contact node that the whole body does not have")?;
            for d in 0..dim {
                differ[1] = differ[1].max((forces[d * own.len() + i] - x[d * all + j]).abs());
            }
        }
        Ok([differ[0] / largest(&theirs), differ[1] / largest(&x[..dim * all])])
    }
}
