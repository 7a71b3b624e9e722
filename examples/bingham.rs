//! Bingham flow through a round pipe: a paste that moves as a rigid plug where its stress is below the yield stress g.
//!
//! The velocity u minimises ½∫|∇u|² + g∫|∇u| − ∫f u with u = 0 on the circle r = 1, here with g = 1 and f = 4. Its stress is ∇u + q, with
//! q = g ∇u/|∇u| where the paste shears and |q| ≤ g in the plug. With Tikhonov's term of weight 1/γ in q that is max(g/γ, |∇u|) q = g ∇u in
//! each triangle of a mesh, solved together with the balance of forces by a semismooth Newton method in (u, q) (J. C. De los Reyes,
//! M. Hintermüller, Interfaces Free Bound. 13 (2011)). q is eliminated triangle by triangle; the reduced matrix is factored.
//! Exactly, the plug is r ≤ 2g/f = ½, u = f/4 (1 − r²) − g (1 − r) outside, and Buckingham's flow rate is ∫u = 2π · 17/192.
//!
//! You will see that the numbers of Newton steps do not grow as the mesh is refined, and the errors of velocity, plug and flow rate; and
//! in `out/bingham.svg` the velocity (darker: faster) with the plug in red and the circle r = ½.
//!
//! ```text
//! cargo run --release --example bingham -- --levels 7 --gamma 1e5
//! ```

#[macro_use]
mod common;
#[path = "common/raster.rs"]
mod raster;
#[path = "common/yielding.rs"]
mod yielding;

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, ensure, exit, file_in, growth};
use raster::{blend, square, with_classes};
use semismooth::linear::{KrylovMethod, LinearOperator};
use semismooth::newton::{Damping, NewtonKrylov, NewtonKrylovOptions};
use semismooth::output::{Colour, Curve, Panel, SegmentStyle};
use yielding::{Element, Weights, Yielding};

#[derive(Parser)]
#[command(about = "Flow of a paste with yield stress through a round pipe")]
struct Arguments {
    /// Number of meshes: 96 triangles, then four times more (2 to 8).
    #[arg(long, default_value_t = 6)]
    levels: usize,
    /// The weight of Tikhonov's term in the dual variable is 1/γ.
    #[arg(long, default_value_t = 1e4)]
    gamma: f64,
    /// Four meshes.
    #[arg(long)]
    small: bool,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

const YIELD: f64 = 1.0;
const FORCE: f64 = 4.0;

/// Largest increase of the number of Newton steps from the coarsest to the finest mesh.
const GROWTH: usize = 2;

/// Pictures of finer meshes than this one, of 6144 triangles, would be large.
const DRAWN: usize = 4;

/// The velocity at a distance from the axis.
fn exact(r: f64) -> f64 {
    let r = r.max(2.0 * YIELD / FORCE);
    0.25 * FORCE * (1.0 - r * r) - YIELD * (1.0 - r)
}

/// Triangles of the unit disc, made from those of a hexagon whose hexagonal rings become circles.
pub(crate) struct Disc {
    /// In the hexagon.
    nodes: Vec<[f64; 2]>,
    triangles: Vec<[usize; 3]>,
    /// The nodes of the coarser mesh between which each lies; twice itself for those it had already.
    parents: Vec<[usize; 2]>,
}

impl Disc {
    pub(crate) fn hexagon() -> Self {
        let corner = |k: usize| {
            let angle = k as f64 * PI / 3.0;
            [angle.cos(), angle.sin()]
        };
        Self {
            nodes: std::iter::once([0.0; 2]).chain((0..6).map(corner)).collect(),
            triangles: (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect(),
            parents: Vec::new(),
        }
    }

    /// Four triangles from each; those of triangle t are 4t to 4t + 3.
    pub(crate) fn refined(&self) -> Self {
        let mut nodes = self.nodes.clone();
        let mut parents: Vec<_> = (0..nodes.len()).map(|k| [k, k]).collect();
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (p, q) = (nodes[a], nodes[b]);
                nodes.push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
                parents.push([a, b]);
                nodes.len() - 1
            })
        };
        let mut triangles = Vec::with_capacity(4 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            triangles.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        Self {
            nodes,
            triangles,
            parents,
        }
    }

    /// The radius of a node: its distance in the norm whose unit ball is the hexagon.
    fn radius(&self, node: usize) -> f64 {
        let [x, y] = self.nodes[node];
        let side = |k: usize| {
            let angle = PI / 6.0 + k as f64 * PI / 3.0;
            (x * angle.cos() + y * angle.sin()).abs() / (PI / 6.0).cos()
        };
        (0..3).map(side).fold(0.0, f64::max)
    }

    fn point(&self, node: usize) -> [f64; 2] {
        let ([x, y], r) = (self.nodes[node], self.radius(node));
        let length = x.hypot(y);
        match length > 0.0 {
            true => [x * r / length, y * r / length],
            false => [0.0; 2],
        }
    }
}

/// The flow through a disc.
pub(crate) fn flow(disc: &Disc, threshold: f64) -> Outcome<Yielding> {
    let mut unknown = vec![None; disc.nodes.len()];
    let mut unknowns = 0;
    for (node, unknown) in unknown.iter_mut().enumerate() {
        if disc.radius(node) < 1.0 - 1e-9 {
            *unknown = Some(unknowns);
            unknowns += 1;
        }
    }
    let mut load = vec![0.0; unknowns];
    let mut elements = Vec::with_capacity(disc.triangles.len());
    for triangle in &disc.triangles {
        let [a, b, c] = triangle.map(|k| disc.point(k));
        let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
        let opposite =
            |p: [f64; 2], q: [f64; 2]| [(p[1] - q[1]) / (2.0 * area), (q[0] - p[0]) / (2.0 * area)];
        let corners = triangle.map(|k| unknown[k]);
        for i in corners.iter().flatten() {
            load[*i] += FORCE * area / 3.0;
        }
        elements.push(Element {
            corners,
            gradients: [opposite(b, c), opposite(c, a), opposite(a, b)],
            area,
        });
    }
    let weights = Weights {
        mass: 0.0,
        viscosity: 1.0,
        yield_stress: YIELD,
        threshold,
    };
    Yielding::new(elements, load, weights)
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let levels = if arguments.small { 4 } else { arguments.levels };
    if !(2..=8).contains(&levels) || !(10.0..=1e8).contains(&arguments.gamma) {
        return Err("--levels goes from 2 to 8, --gamma from 10 to 1e8".into());
    }
    println!("               Newton steps                 error of    radius");
    println!("triangles  from 0  coarser  residual    velocity    of the plug  flow rate  seconds");
    let mut disc = Disc::hexagon().refined();
    let (mut fixed, mut nested) = (Vec::new(), Vec::new());
    let mut coarse: Option<(Vec<f64>, Vec<f64>)> = None;
    for level in 0..levels {
        disc = disc.refined();
        let threshold = YIELD / arguments.gamma;
        let mut flow = flow(&disc, threshold)?;
        let mut newton = NewtonKrylov::new(
            NewtonKrylovOptions::default()
                .with_method(KrylovMethod::Gmres { directions: 10 })
                // The residual rises in early iterations, as triangles begin to yield, and steps of a derivative made definite need not
                // reduce it: line searches fail before the first of them.
                .with_damping(Damping::Never)
                .with_first_forcing(1e-2),
        );
        let mut x = vec![0.0; flow.order()];
        let begin = Instant::now();
        newton.solve(&mut flow, &mut x)?;
        let mut seconds = begin.elapsed().as_secs_f64();
        fixed.push(newton.report().history.len() - 1);
        if let Some((u, q)) = coarse {
            x = prolong(&disc, &flow, &u, &q);
            let begin = Instant::now();
            newton.solve(&mut flow, &mut x)?;
            seconds = begin.elapsed().as_secs_f64();
            nested.push(newton.report().history.len() - 1);
        }
        let found = Found::new(&disc, &flow, &x, threshold);
        println!(
            "{:9}  {:6}  {:>7}  {:8.1e}  {:10.2e}  {:11.5}  {:9.6}  {seconds:7.2}",
            disc.triangles.len(),
            fixed[level],
            nested.last().map_or("–".to_owned(), usize::to_string),
            newton.report().residual_norm(),
            found.error,
            found.plug_radius,
            found.rate,
        );
        if level + 1 == levels.min(DRAWN) {
            draw(arguments, &disc, &found)?;
        }
        if level + 1 == levels {
            check(&disc, &found, arguments.gamma)?;
        }
        coarse = Some((found.velocity, x[flow.unknowns..].to_vec()));
    }
    ensure(
        growth(&fixed) <= GROWTH && growth(&nested) <= GROWTH,
        "the number of Newton steps does not grow with refinement",
    )
}

/// A solution at the nodes.
struct Found {
    /// 0 on the circle.
    velocity: Vec<f64>,
    /// Triangles that do not yield.
    rigid: Vec<bool>,
    /// Largest difference from the exact velocity at a node.
    error: f64,
    /// Radius of a circle with the area of the rigid triangles.
    plug_radius: f64,
    /// ∫u.
    rate: f64,
}

impl Found {
    fn new(disc: &Disc, flow: &Yielding, x: &[f64], threshold: f64) -> Self {
        let (u, _) = flow.split(x);
        let mut velocity = vec![0.0; disc.nodes.len()];
        for (triangle, element) in disc.triangles.iter().zip(&flow.elements) {
            for (node, corner) in triangle.iter().zip(element.corners) {
                velocity[*node] = corner.map_or(0.0, |k| u[k]);
            }
        }
        let errors = (0..velocity.len()).map(|k| (velocity[k] - exact(disc.radius(k))).abs());
        let rigid: Vec<bool> = flow
            .elements
            .iter()
            .map(|e| {
                let g = e.gradient(u);
                g[0].hypot(g[1]) <= threshold
            })
            .collect();
        let area = |of: &dyn Fn(usize) -> f64| -> f64 {
            (0..rigid.len()).map(|t| of(t) * flow.elements[t].area).sum()
        };
        let mean = |t: usize| disc.triangles[t].iter().map(|k| velocity[*k]).sum::<f64>() / 3.0;
        Self {
            error: errors.fold(0.0, f64::max),
            plug_radius: (area(&|t| f64::from(rigid[t])) / PI).sqrt(),
            rate: area(&mean),
            rigid,
            velocity,
        }
    }
}

/// The velocity of the coarser mesh at the nodes, and q of the triangle each lies in.
fn prolong(disc: &Disc, flow: &Yielding, velocity: &[f64], q: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; flow.order()];
    let (u, fine) = x.split_at_mut(flow.unknowns);
    for (triangle, element) in disc.triangles.iter().zip(&flow.elements) {
        for (node, corner) in triangle.iter().zip(element.corners) {
            let [a, b] = disc.parents[*node];
            if let Some(k) = corner {
                u[k] = 0.5 * (velocity[a] + velocity[b]);
            }
        }
    }
    for (four, q) in fine.chunks_exact_mut(8).zip(q.chunks_exact(2)) {
        four.chunks_exact_mut(2).for_each(|fine| fine.copy_from_slice(q));
    }
    x
}

fn check(disc: &Disc, found: &Found, gamma: f64) -> Outcome<()> {
    // Sides are 1/n long in a hexagon with 6n² triangles.
    let h = (6.0 / disc.triangles.len() as f64).sqrt();
    ensure(
        found.error < 0.5 * h * h + 2.0 / gamma,
        "the velocity is the exact one to second order, up to the error of the regularisation",
    )?;
    ensure(
        (found.plug_radius - 0.5).abs() < h,
        "the plug ends within one triangle of its circle",
    )?;
    let rate = 2.0 * PI * 17.0 / 192.0;
    ensure(
        (found.rate - rate).abs() < 2.0 * h * h + 4.0 / gamma,
        "the flow rate is Buckingham's",
    )
}

fn draw(arguments: &Arguments, disc: &Disc, found: &Found) -> Outcome<()> {
    const SLOW: Colour = Colour::new(0xf0, 0xf4, 0xfa);
    let largest = exact(0.0);
    let mut panel = Panel::new("x", "y")
        .with_x_range(-1.05, 1.05)
        .with_y_range(-1.05, 1.05);
    for (triangle, rigid) in disc.triangles.iter().zip(&found.rigid) {
        let mean = triangle.iter().map(|k| found.velocity[*k]).sum::<f64>() / 3.0;
        let colour = match rigid {
            true => Colour::RED,
            false => blend(SLOW, Colour::BLUE, mean / largest),
        };
        let corners = triangle.map(|k| <(f64, f64)>::from(disc.point(k)));
        panel = panel.with_region(corners.to_vec(), colour);
    }
    let circle = (0..=120).map(|k| {
        let (sine, cosine) = (2.0 * PI * f64::from(k) / 120.0).sin_cos();
        (0.5 * cosine, 0.5 * sine)
    });
    let exact_plug = SegmentStyle::new("end of the exact plug", Colour::new(0, 0, 0));
    let panel = panel.with_curve(Curve::line(circle.collect(), exact_plug));
    let classes = [("plug", Colour::RED), ("fast", Colour::BLUE), ("slow", SLOW)];
    let path = file_in(&arguments.out, "bingham.svg")?;
    square(with_classes(panel, &classes), "Flow of a Bingham fluid in a pipe").write(&path)?;
    println!("{}", path.display());
    Ok(())
}
