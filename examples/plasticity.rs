//! Elastic–plastic bodies: a thick-walled tube under pressure, and a perforated strip that is pulled and pushed.
//!
//! Von Mises plasticity with linear hardening in plane strain. In each step of the load the stress is a piecewise smooth function of the
//! strain (radial return, J. C. Simo, T. J. R. Hughes, Computational Inelasticity (1998), section 3.3), so that Newton's method with the
//! consistent tangent is a semismooth one (M. Sauter, C. Wieners, Comput. Methods Appl. Mech. Eng. 200 (2011)).
//!
//! The tube 1 < r < 2 is nearly incompressible. Incompressible it has a closed solution, Hill's (The Mathematical Theory of Plasticity
//! (1950), chapter V) with linear hardening: u_r = c/r, so that the shear strain is 2c/r², the shear stress its piecewise linear function,
//! and the pressure ∫ 2τ/r dr. The strip has the shape of Simo and Hughes: 20 mm × 36 mm with a hole of radius 5 mm, of which a quarter is
//! computed. Its hardening is isotropic and kinematic; the load on its ends goes 0, 1, −1, 1.
//!
//! You will see the errors of the tube's displacement and of the radius of its plastic front; for the strip the numbers of Newton steps
//! from three starts (the last load, rest, the coarser mesh), which grow by two at most from the first mesh to the last; and the balance of
//! its work. In `out/plasticity.svg` the strip at the three ends of the load: red yields, orange has yielded before, grey never has.
//!
//! ```text
//! cargo run --release --example plasticity -- --levels 4
//! ```

#[macro_use]
mod common;

use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, ensure, exit, file_in, growth};
use semismooth::fem::{CellKind, Elasticity, Mesh, PlasticBody, PlasticEnergies, VonMises};
use semismooth::linear::Cholesky;
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};

#[derive(Parser)]
#[command(about = "A tube under pressure and a perforated strip, with von Mises plasticity")]
struct Arguments {
    /// Number of meshes, 96 cells and four times more each (2 to 7).
    #[arg(long, default_value_t = 4)]
    levels: usize,
    /// Steps from no load to the largest (1 to 100).
    #[arg(long, default_value_t = 5)]
    steps: usize,
    /// Three meshes and two steps.
    #[arg(long)]
    small: bool,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

/// Largest increase of the number of Newton steps from the coarsest to the finest mesh.
const GROWTH: usize = 2;

/// A quarter of a body around a hole, in rings of quadrilaterals.
pub(crate) struct Rings {
    around: usize,
    across: usize,
    pub(crate) body: PlasticBody,
}

impl Rings {
    /// `outer(i)` is the end of the ray that leaves the hole at the angle i/around · π/2; groups are "bottom", "left" and those of `mark`.
    fn new(
        [around, across]: [usize; 2],
        radius: f64,
        outer: impl Fn(usize) -> [f64; 2],
        mark: impl FnOnce(&mut Mesh),
        law: VonMises,
    ) -> Outcome<Self> {
        let node = |i, j| i * (across + 1) + j;
        let mut points = Vec::new();
        for i in 0..=around {
            let (angle, end) = (FRAC_PI_2 * i as f64 / around as f64, outer(i));
            for j in 0..=across {
                let s = j as f64 / across as f64;
                let x = (1.0 - s) * radius * angle.cos() + s * end[0];
                let y = (1.0 - s) * radius * angle.sin() + s * end[1];
                points.push([if i == around { 0.0 } else { x }, y, 0.0]);
            }
        }
        let places = (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
        let cells = places.map(|(i, j)| {
            let corners = [node(i, j), node(i, j + 1), node(i + 1, j + 1), node(i + 1, j)];
            (CellKind::Quadrilateral, corners.to_vec())
        });
        let mut mesh = Mesh::new(2, points, cells)?;
        mesh.mark_boundary("bottom", |f| f.centre[1] < 1e-9);
        mesh.mark_boundary("left", |f| f.centre[0] < 1e-9);
        mark(&mut mesh);
        let supported = Elasticity::new(mesh, law.elastic().clone())
            .fix_component("bottom", 1)
            .fix_component("left", 0);
        Ok(Self {
            around,
            across,
            body: PlasticBody::new(&supported, law)?,
        })
    }

    /// Displacements node by node.
    fn all(&self, x: &[f64]) -> Outcome<Vec<f64>> {
        Ok(self.body.system().displacements(x, &[])?)
    }

    /// The free displacements from those of the nodes of the mesh with half as many cells each way.
    fn prolonged(&self, coarse: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; self.body.system().num_free()];
        for i in 0..=self.around {
            for j in 0..=self.across {
                for d in 0..2 {
                    let at = |i: usize, j: usize| coarse[2 * (i * (self.across / 2 + 1) + j) + d];
                    if let Some(free) = self.body.system().dof(i * (self.across + 1) + j, d) {
                        let (low, high) = ([i / 2, j / 2], [i.div_ceil(2), j.div_ceil(2)]);
                        x[free] = 0.25
                            * (at(low[0], low[1])
                                + at(high[0], low[1])
                                + at(low[0], high[1])
                                + at(high[0], high[1]));
                    }
                }
            }
        }
        x
    }

    /// The share of a cell's quadrature points that have ever yielded or, from the plastic strain `before` a step, yield in it.
    fn yielded(&self, cell: usize, before: Option<&[f64]>) -> f64 {
        let states = self.body.states(cell);
        let yields = |k: usize| states[k].accumulated > before.map_or(0.0, |b| b[states.len() * cell + k]);
        (0..states.len()).filter(|k| yields(*k)).count() as f64 / states.len() as f64
    }

    fn accumulated(&self) -> Vec<f64> {
        let cells = 0..self.body.system().mesh().num_cells();
        cells
            .flat_map(|c| self.body.states(c).iter().map(|s| s.accumulated))
            .collect()
    }
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let levels = if arguments.small { 3 } else { arguments.levels };
    if !(2..=7).contains(&levels) || !(1..=100).contains(&arguments.steps) {
        return Err("--levels goes from 2 to 7, --steps from 1 to 100".into());
    }
    let steps = if arguments.small { 2 } else { arguments.steps };
    tube(levels)?;
    strip(levels, steps, arguments)
}

/// Largest pressure such that the front has this radius, and the displacement c/r, where τ = k at the front.
pub(crate) struct Hill {
    pressure: f64,
    c: f64,
}

const INNER: f64 = 1.0;
const OUTER: f64 = 2.0;
const FRONT: f64 = 1.45;

fn hill(young: f64, yield_stress: f64, hardening: f64) -> Hill {
    let (mu, k) = (young / 3.0, yield_stress / 3f64.sqrt());
    // The slope of the shear stress beyond yield, relative to that before.
    let slope = hardening / (3.0 * mu + hardening);
    let elastic = k * (1.0 - (FRONT / OUTER).powi(2));
    let plastic =
        2.0 * k * (1.0 - slope) * (FRONT / INNER).ln() + slope * k * ((FRONT / INNER).powi(2) - 1.0);
    Hill {
        pressure: elastic + plastic,
        c: k * FRONT * FRONT / (2.0 * mu),
    }
}

/// A quarter of the tube under the pressure of the closed solution.
pub(crate) fn pressed(level: usize) -> Outcome<(Rings, Hill)> {
    let (young, yield_stress, hardening) = (210.0, 0.25, 10.0);
    let exact = hill(young, yield_stress, hardening);
    let cells = [12 << level, 8 << level];
    let law = VonMises::new(young, 0.499_99, yield_stress)?.with_hardening(hardening, 0.0)?;
    let end = |i: usize| {
        let angle = FRAC_PI_2 * i as f64 / cells[0] as f64;
        [OUTER * angle.cos(), OUTER * angle.sin()]
    };
    let mark = |mesh: &mut Mesh| {
        mesh.mark_boundary("inner", |f| f.centre[0].hypot(f.centre[1]) < INNER);
    };
    let mut rings = Rings::new(cells, INNER, end, mark, law)?;
    let load = rings.body.system().traction("inner", |x| {
        let r = x[0].hypot(x[1]);
        [exact.pressure * x[0] / r, exact.pressure * x[1] / r, 0.0]
    })?;
    rings.body.set_load(&load)?;
    Ok((rings, exact))
}

fn tube(levels: usize) -> Outcome<()> {
    println!("tube: Newton steps            error of    radius of");
    println!("   cells  from 0  residual  displacement  the front");
    let (mut steps, mut errors) = (Vec::new(), Vec::new());
    let (mut found, mut pressure) = (0.0, 0.0);
    for level in 0..levels {
        let (mut rings, exact) = pressed(level)?;
        let mut newton = Newton::with_solver(NewtonOptions::default(), Cholesky::default());
        let mut x = vec![0.0; rings.body.system().num_free()];
        newton.solve_semismooth(&rings.body, &mut x)?;
        rings.body.commit(&x)?;
        let u = rings.all(&x)?;
        let points = rings.body.system().mesh().points();
        let errors_at = points.iter().zip(u.chunks_exact(2)).map(|(p, u)| {
            let r2 = p[0] * p[0] + p[1] * p[1];
            (u[0] - exact.c * p[0] / r2).hypot(u[1] - exact.c * p[1] / r2)
        });
        errors.push(errors_at.fold(0.0, f64::max) * INNER / exact.c);
        // Rings of the mesh are all alike: the front is that of a circle with the yielded share of their area.
        let ring = |j: usize| {
            let r = |j: usize| INNER + (OUTER - INNER) * j as f64 / rings.across as f64;
            r(j + 1).powi(2) - r(j).powi(2)
        };
        let area: f64 = (0..rings.across).map(|j| ring(j) * rings.yielded(j, None)).sum();
        found = (INNER * INNER + area).sqrt();
        steps.push(newton.report().history.len() - 1);
        pressure = exact.pressure;
        println!(
            "{:8}  {:6}  {:8.1e}  {:12.2e}  {found:9.5}",
            rings.around * rings.across,
            steps[level],
            newton.report().residual_norm(),
            errors[level],
        );
    }
    let h = 0.125 / f64::from(1 << (levels - 1));
    println!("exactly, incompressible: p = {pressure:.6}, front {FRONT}",);
    not_growing(&steps)?;
    // The tube is compressible by 1 − 2ν = 2e-5.
    ensure(
        errors[levels - 1] < h * h + 1e-4,
        "the displacement of the tube is Hill's to second order",
    )?;
    ensure(
        (found - FRONT).abs() < h,
        "the front lies within one cell of Hill's",
    )
}

const WIDTH: f64 = 10.0;
const LENGTH: f64 = 18.0;
const HOLE: f64 = 5.0;
/// GPa.
const PULL: f64 = 0.14;

/// The quarter of the strip, and the forces of a unit load.
pub(crate) fn quarter(level: usize) -> Outcome<(Rings, Vec<f64>)> {
    let n = 4 << level;
    // Two thirds of the rays end at the side, one third at the top.
    let end = |i: usize| match i <= 2 * n {
        true => [WIDTH, LENGTH * i as f64 / (2 * n) as f64],
        false => [WIDTH * (3 * n - i) as f64 / n as f64, LENGTH],
    };
    let mark = |mesh: &mut Mesh| {
        mesh.mark_boundary("top", |f| f.centre[1] > LENGTH - 1e-9);
    };
    let law = VonMises::new(70.0, 0.2, 0.243)?.with_hardening(0.75, 1.5)?;
    let rings = Rings::new([3 * n, 2 * n], HOLE, end, mark, law)?;
    let load = rings.body.system().traction("top", |_| [0.0, PULL, 0.0])?;
    Ok((rings, load))
}

/// A history of the strip.
/// The corners of an element in a picture, and its colour.
type Element = (Vec<(f64, f64)>, Colour);

#[derive(Default)]
struct History {
    /// Most Newton steps from the last load, from rest and from the coarser mesh.
    steps: [usize; 3],
    residual: f64,
    /// At the ends of the load: all displacements.
    ends: Vec<Vec<f64>>,
    /// Elements of a picture at each.
    pictures: Vec<Vec<Element>>,
    /// After each step: load, work by the trapezoidal rule, energies with what was dissipated so far.
    balance: Vec<(f64, f64, PlasticEnergies)>,
    /// Largest error of the balance with the load at the end of the step.
    defect: f64,
}

impl History {
    /// Work by the trapezoidal rule that was neither stored nor dissipated.
    fn missing(&self) -> f64 {
        let (_, work, e) = &self.balance[self.balance.len() - 1];
        work - (e.elastic + e.hardening + e.dissipated)
    }
}

/// 0, 1, −1, 1 in steps, and which of them are ends.
fn loads(steps: usize) -> Vec<(f64, bool)> {
    let step = |k: usize| {
        let t = k as f64 / steps as f64;
        let load = match t {
            t if t <= 1.0 => t,
            t if t <= 3.0 => 2.0 - t,
            t => t - 4.0,
        };
        (load, k % (2 * steps) == steps)
    };
    (1..=5 * steps).map(step).collect()
}

/// Loads the strip; at the ends of the load from other starts as well.
fn cycle(rings: &mut Rings, unit: &[f64], steps: usize, coarse: Option<&[Vec<f64>]>) -> Outcome<History> {
    let mut newton = Newton::with_solver(NewtonOptions::default(), Cholesky::default());
    let mut solve = |rings: &Rings, x: &mut [f64]| -> Outcome<[f64; 2]> {
        newton.solve_semismooth(&rings.body, x)?;
        let report = newton.report();
        Ok([(report.history.len() - 1) as f64, report.residual_norm()])
    };
    let mut history = History::default();
    let mut x = vec![0.0; unit.len()];
    let (mut last, mut work, mut dissipated) = (0.0, 0.0, 0.0);
    let mut stored = 0.0;
    for (load, end) in loads(steps) {
        let forces: Vec<f64> = unit.iter().map(|f| load * f).collect();
        rings.body.set_load(&forces)?;
        let before = x.clone();
        let mut starts = vec![(0, x)];
        if end {
            starts.push((1, vec![0.0; unit.len()]));
            let coarse = coarse.map(|c| rings.prolonged(&c[history.ends.len()]));
            starts.extend(coarse.map(|x| (2, x)));
        }
        for (start, x) in &mut starts {
            let [count, residual] = solve(rings, x)?;
            history.steps[*start] = history.steps[*start].max(count as usize);
            history.residual = history.residual.max(residual);
        }
        x = starts.swap_remove(0).1;
        let moved: f64 = (0..x.len()).map(|k| unit[k] * (x[k] - before[k])).sum();
        let accumulated = rings.accumulated();
        let mut energies = rings.body.commit(&x)?;
        work += 0.5 * (last + load) * moved;
        let change = energies.elastic + energies.hardening - stored;
        let defect = load * moved - (change + energies.dissipated + energies.increment);
        history.defect = history.defect.max(defect.abs());
        stored = energies.elastic + energies.hardening;
        dissipated += energies.dissipated;
        energies.dissipated = dissipated;
        history.balance.push((load, work, energies));
        if end {
            history.ends.push(rings.all(&x)?);
            history.pictures.push(picture(rings, &accumulated));
        }
        last = load;
    }
    Ok(history)
}

fn strip(levels: usize, steps: usize, arguments: &Arguments) -> Outcome<()> {
    println!("strip: most Newton steps from");
    println!("   cells  last load  rest  coarser  residual  dissipated  seconds");
    let mut counts = [const { Vec::new() }; 3];
    let mut coarse: Option<History> = None;
    for level in 0..levels {
        let (mut rings, unit) = quarter(level)?;
        let begin = Instant::now();
        let ends = coarse.as_ref().map(|c| c.ends.as_slice());
        let history = cycle(&mut rings, &unit, steps, ends)?;
        let (_, work, energies) = &history.balance[history.balance.len() - 1];
        println!(
            "{:8}  {:9}  {:4}  {:>7}  {:8.1e}  {:10.6}  {:7.2}",
            rings.body.system().mesh().num_cells(),
            history.steps[0],
            history.steps[1],
            ends.map_or("–".to_owned(), |_| history.steps[2].to_string()),
            history.residual,
            energies.dissipated,
            begin.elapsed().as_secs_f64(),
        );
        for (counts, steps) in counts.iter_mut().zip(history.steps) {
            counts.push(steps);
        }
        ensure(
            history.defect <= 1e-9 * work,
            "the work of the load at the end of each step is stored, dissipated, or the energy of the increment",
        )?;
        coarse = Some(history);
    }
    not_growing(&counts[0])?;
    not_growing(&counts[1])?;
    not_growing(&counts[2][1..])?;
    let history = coarse.ok_or("no level")?;
    println!("   load       work    elastic  hardening  dissipated    missing");
    for (load, work, e) in &history.balance {
        println!(
            "{load:7.3}  {work:9.6}  {:9.6}  {:9.6}  {:10.6}  {:9.1e}",
            e.elastic,
            e.hardening,
            e.dissipated,
            work - (e.elastic + e.hardening + e.dissipated)
        );
    }
    balance()?;
    draw(arguments, &history)
}

/// The trapezoidal rule is exact for the work along straight steps; what is missing is the second-order error of implicit Euler.
fn balance() -> Outcome<()> {
    const STEPS: usize = 10;
    let missing = |steps| -> Outcome<[f64; 2]> {
        let (mut rings, unit) = quarter(0)?;
        let history = cycle(&mut rings, &unit, steps, None)?;
        Ok([history.missing(), history.balance[5 * steps - 1].1])
    };
    let ([coarse, work], [fine, _]) = (missing(STEPS)?, missing(2 * STEPS)?);
    println!(
        "missing on the coarsest mesh, of the work {work:.6}: {coarse:.1e} in steps of 1/{STEPS}, {fine:.1e} in 1/{}",
        2 * STEPS
    );
    ensure(
        coarse < 0.0 && coarse > -1e-2 * work && coarse / fine > 3.0,
        "work is stored or dissipated, up to an error of second order in the step",
    )
}

fn not_growing(counts: &[usize]) -> Outcome<()> {
    ensure(
        growth(counts) <= GROWTH,
        "no mesh takes over two Newton steps more than the first",
    )
}

const NEVER: Colour = Colour::new(0xd0, 0xd0, 0xd0);

/// The cells of a quarter, coloured.
fn picture(rings: &Rings, before: &[f64]) -> Vec<Element> {
    let mesh = rings.body.system().mesh();
    let cells = (0..mesh.num_cells()).map(|cell| {
        let colour = match (rings.yielded(cell, Some(before)), rings.yielded(cell, None)) {
            (now, _) if now >= 0.5 => Colour::RED,
            (_, ever) if ever >= 0.5 => Colour::ORANGE,
            _ => NEVER,
        };
        let corners = mesh.cell(cell).iter().map(|&node| {
            let [x, y, _] = mesh.points()[node];
            (x, y)
        });
        (corners.collect(), colour)
    });
    cells.collect()
}

/// Three strips side by side, each a quarter and its mirror images.
fn draw(arguments: &Arguments, history: &History) -> Outcome<()> {
    let strip = |cells: &[(Vec<(f64, f64)>, Colour)], load: &str| {
        let mut panel = Panel::new("x [mm]", "y [mm]").with_caption(load);
        for (corners, colour) in cells {
            for (a, b) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                let mirrored = corners.iter().map(|(x, y)| (a * x, b * y)).collect();
                panel = panel.with_region(mirrored, *colour);
            }
        }
        let classes = [
            ("yields", Colour::RED),
            ("has yielded before", Colour::ORANGE),
            ("never has", NEVER),
        ];
        classes.into_iter().fold(panel, |panel, (name, colour)| {
            panel.with_class(SegmentStyle::new(name, colour))
        })
    };
    let panels = history.pictures.iter().zip(["load 1", "load −1", "load 1 again"]);
    let mut panels = panels.map(|(cells, load)| strip(cells, load));
    let first = panels.next().ok_or("no picture")?;
    let path = file_in(&arguments.out, "plasticity.svg")?;
    panels
        .fold(BranchDiagram::new(first), BranchDiagram::with_panel)
        .with_title("Where a strip with a hole yields")
        .with_size(960, 580)
        .write(&path)?;
    println!("{}", path.display());
    Ok(())
}
