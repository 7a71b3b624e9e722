//! Bingham flow through a round pipe: a paste that moves as a rigid plug where its stress is below the yield stress g.
//!
//! The velocity u makes ½∫|∇u|² + g∫|∇u| − ∫f u least, u = 0 on the circle r = 1, here with g = 1 and f = 4. Its stress is ∇u + q, with
//! q = g ∇u/|∇u| where the paste shears and |q| ≤ g in the plug. With Tikhonov's term of weight 1/γ in q that is
//! max(g/γ, |∇u|) q = g ∇u in each triangle of a mesh, solved together with the balance of forces by a semismooth Newton method in (u, q)
//! (J. C. De los Reyes, M. Hintermüller, Interfaces Free Bound. 13 (2011)). q is eliminated triangle by triangle; what is left is factored.
//! Exactly, the plug is r ≤ 2g/f = ½, u = f/4 (1 − r²) − g (1 − r) outside, and Buckingham's flow rate is ∫u = 2π · 17/192.
//!
//! You will see that the numbers of Newton steps do not grow as the mesh is refined, and the errors of velocity, plug and flow rate; and
//! in `out/bingham.svg` the velocity (darker: faster) with the plug in red and the circle r = ½.
//!
//! ```text
//! cargo run --release --example bingham -- --levels 6 --gamma 1e5
//! ```

#[macro_use]
mod common;

use std::collections::HashMap;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, ensure, exit, file_in};
use semismooth::linear::{Cholesky, KrylovMethod, LinearError, LinearOperator, LinearSolver};
use semismooth::newton::{Damping, NewtonKrylov, NewtonKrylovOptions};
use semismooth::piecewise::MatrixFree;
use semismooth::sparse::{Matrix, Pattern};

#[derive(Parser)]
#[command(about = "Flow of a paste with yield stress through a round pipe")]
struct Arguments {
    /// Number of meshes, from 96 triangles on, each with four times as many as the one before (2 to 8).
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

/// More Newton steps than this may not come in from the coarsest to the finest mesh.
const GROWTH: usize = 2;

/// Pictures of finer meshes than this one, of 6144 triangles, would be large.
const DRAWN: usize = 4;

/// The velocity at a distance from the axis.
fn exact(r: f64) -> f64 {
    let r = r.max(2.0 * YIELD / FORCE);
    0.25 * FORCE * (1.0 - r * r) - YIELD * (1.0 - r)
}

/// Triangles of the unit disc, made from those of a hexagon whose hexagonal rings become circles.
struct Disc {
    /// In the hexagon.
    nodes: Vec<[f64; 2]>,
    triangles: Vec<[usize; 3]>,
    /// The nodes of the coarser mesh between which each lies; twice itself for those it had already.
    parents: Vec<[usize; 2]>,
}

impl Disc {
    fn hexagon() -> Self {
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
    fn refined(&self) -> Self {
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

/// A triangle: unknowns of its corners (none on the circle), gradients of their hat functions, area.
struct Element {
    corners: [Option<usize>; 3],
    gradients: [[f64; 2]; 3],
    area: f64,
}

impl Element {
    fn gradient(&self, u: &[f64]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (corner, g) in self.corners.iter().zip(&self.gradients) {
            if let Some(k) = corner {
                sum[0] += u[*k] * g[0];
                sum[1] += u[*k] * g[1];
            }
        }
        sum
    }

    /// Adds ∫ v · ∇φ for the hat functions φ of its corners.
    fn add_divergence(&self, v: [f64; 2], out: &mut [f64]) {
        for (corner, g) in self.corners.iter().zip(&self.gradients) {
            if let Some(k) = corner {
                out[*k] += self.area * (v[0] * g[0] + v[1] * g[1]);
            }
        }
    }
}

/// The equations in x = (u, q): ∫(∇u + q)·∇φ − ∫f φ = 0 for every hat function, area (max(g/γ, |∇u|) q − g ∇u) = 0 in every triangle.
struct Flow {
    elements: Vec<Element>,
    unknowns: usize,
    load: Vec<f64>,
    /// g/γ.
    threshold: f64,
    /// For each triangle max(g/γ, |∇u|), and the matrix C of the derivative m δq − C ∇δu. With q taken back into |q| ≤ g and C made
    /// symmetric, what is left for u is positive definite (Hintermüller, Stadler 2006); at solutions nothing is changed by that.
    slopes: Vec<(f64, [[f64; 2]; 2])>,
    reduced: Matrix,
    solver: Cholesky,
}

impl Flow {
    fn new(disc: &Disc, gamma: f64) -> Outcome<Self> {
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
        let mut entries = Vec::new();
        for triangle in &disc.triangles {
            let [a, b, c] = triangle.map(|k| disc.point(k));
            let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
            let opposite =
                |p: [f64; 2], q: [f64; 2]| [(p[1] - q[1]) / (2.0 * area), (q[0] - p[0]) / (2.0 * area)];
            let corners = triangle.map(|k| unknown[k]);
            for i in corners.iter().flatten() {
                load[*i] += FORCE * area / 3.0;
                entries.extend(corners.iter().flatten().map(|j| (*i, *j)));
            }
            elements.push(Element {
                corners,
                gradients: [opposite(b, c), opposite(c, a), opposite(a, b)],
                area,
            });
        }
        let pattern = Pattern::from_entries(unknowns, unknowns, entries)?;
        let mut solver = Cholesky::new();
        solver.analyze(pattern.as_ref())?;
        Ok(Self {
            slopes: vec![(YIELD, [[0.0; 2]; 2]); elements.len()],
            elements,
            unknowns,
            load,
            threshold: YIELD / gamma,
            reduced: Matrix::zeros(pattern),
            solver,
        })
    }

    fn split<'a>(&self, x: &'a [f64]) -> (&'a [f64], &'a [[f64; 2]]) {
        let (u, q) = x.split_at(self.unknowns);
        (u, q.as_chunks().0)
    }
}

impl LinearOperator for Flow {
    fn order(&self) -> usize {
        self.unknowns + 2 * self.elements.len()
    }

    fn product(&mut self, v: &[f64], out: &mut [f64]) {
        let (u, q) = self.split(v);
        let (forces, laws) = out.split_at_mut(self.unknowns);
        forces.fill(0.0);
        let laws = laws.as_chunks_mut::<2>().0;
        for (((element, (m, c)), q), law) in self.elements.iter().zip(&self.slopes).zip(q).zip(laws) {
            let g = element.gradient(u);
            element.add_divergence([g[0] + q[0], g[1] + q[1]], forces);
            *law = [0, 1].map(|i| element.area * (m * q[i] - c[i][0] * g[0] - c[i][1] * g[1]));
        }
    }

    /// Exact: q is eliminated triangle by triangle.
    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let (u, q) = b.split_at_mut(self.unknowns);
        let q = q.as_chunks_mut::<2>().0;
        for ((element, (m, _)), q) in self.elements.iter().zip(&self.slopes).zip(&mut *q) {
            *q = q.map(|q| q / (m * element.area));
            element.add_divergence(q.map(|q| -q), u);
        }
        self.solver.solve_in_place(u)?;
        for ((element, (m, c)), q) in self.elements.iter().zip(&self.slopes).zip(q) {
            let g = element.gradient(u);
            for i in 0..2 {
                q[i] += (c[i][0] * g[0] + c[i][1] * g[1]) / m;
            }
        }
        Ok(())
    }
}

impl MatrixFree for Flow {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        let (u, q) = self.split(x);
        let (forces, laws) = out.split_at_mut(self.unknowns);
        forces.iter_mut().zip(&self.load).for_each(|(r, f)| *r = -f);
        for ((element, q), law) in self.elements.iter().zip(q).zip(laws.as_chunks_mut::<2>().0) {
            let g = element.gradient(u);
            element.add_divergence([g[0] + q[0], g[1] + q[1]], forces);
            let m = g[0].hypot(g[1]).max(self.threshold);
            *law = [0, 1].map(|i| element.area * (m * q[i] - YIELD * g[i]));
        }
    }

    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        let (u, q) = self.split(x);
        self.reduced.clear();
        for ((element, slope), q) in self.elements.iter().zip(&mut self.slopes).zip(q) {
            let g = element.gradient(u);
            let size = g[0].hypot(g[1]);
            let mut c = [[YIELD, 0.0], [0.0, YIELD]];
            if size > self.threshold {
                let back = 1.0 / (q[0].hypot(q[1]) / YIELD).max(1.0);
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    c[i][j] -= 0.5 * back * (q[i] * g[j] + q[j] * g[i]) / size;
                }
            }
            let m = size.max(self.threshold);
            *slope = (m, c);
            for (i, p) in element.corners.iter().zip(&element.gradients) {
                for (j, r) in element.corners.iter().zip(&element.gradients) {
                    if let (Some(i), Some(j)) = (i, j) {
                        let dual: f64 = [(0, 0), (0, 1), (1, 0), (1, 1)]
                            .iter()
                            .map(|&(k, l)| p[k] * c[k][l] * r[l])
                            .sum();
                        let viscous = p[0] * r[0] + p[1] * r[1];
                        self.reduced.add(*i, *j, element.area * (viscous + dual / m));
                    }
                }
            }
        }
        self.solver.factor(self.reduced.as_ref())
    }
}

fn main() -> ExitCode {
    exit(run(&Arguments::parse()))
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
        let mut flow = Flow::new(&disc, arguments.gamma)?;
        let mut newton = NewtonKrylov::new(
            NewtonKrylovOptions::default()
                .with_method(KrylovMethod::Gmres { directions: 10 })
                // The residual rises on the way, as triangles begin to yield.
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
        let found = Found::new(&disc, &flow, &x);
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
    let grows = |counts: &[usize]| match counts {
        [first, .., last] => last.saturating_sub(*first),
        _ => 0,
    };
    ensure(
        grows(&fixed) <= GROWTH && grows(&nested) <= GROWTH,
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
    /// That of a circle with the area of the rigid triangles.
    plug_radius: f64,
    /// ∫u.
    rate: f64,
}

impl Found {
    fn new(disc: &Disc, flow: &Flow, x: &[f64]) -> Self {
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
                g[0].hypot(g[1]) <= flow.threshold
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
fn prolong(disc: &Disc, flow: &Flow, velocity: &[f64], q: &[f64]) -> Vec<f64> {
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
        "the velocity is the exact one to second order, less what regularisation takes",
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
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"600\" height=\"600\" viewBox=\"-1.05 -1.05 2.1 2.1\">\n",
    );
    let largest = exact(0.0);
    for (triangle, rigid) in disc.triangles.iter().zip(&found.rigid) {
        let mean = triangle.iter().map(|k| found.velocity[*k]).sum::<f64>() / 3.0;
        let shade = (235.0 - 190.0 * (mean / largest).clamp(0.0, 1.0)) as u8;
        let colour = match rigid {
            true => "#d62728".to_owned(),
            false => format!("#{shade:02x}{shade:02x}e0"),
        };
        let corner = |k: usize| {
            let [x, y] = disc.point(k);
            format!("{x:.4},{:.4}", -y)
        };
        let [a, b, c] = triangle.map(corner);
        writeln!(
            svg,
            "<polygon points=\"{a} {b} {c}\" fill=\"{colour}\" stroke=\"{colour}\" stroke-width=\"0.002\"/>"
        )?;
    }
    svg.push_str("<circle r=\"0.5\" fill=\"none\" stroke=\"black\" stroke-width=\"0.008\"/>\n</svg>\n");
    let path = file_in(&arguments.out, "bingham.svg")?;
    std::fs::write(&path, svg).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    println!("{}", path.display());
    Ok(())
}
