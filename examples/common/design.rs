//! Contact problems whose friction or shape is sought: blocks on a rough ground.

use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::optimise::{Bundle, BundleOptions, BundleReport};
use semismooth::sparse::Matrix;
use semismooth::variational::Polyhedron;
use semismooth::{Cause, contact_body};

type Outcome<T> = Result<T, Cause>;
type Problem = CondensedContact<PlanarCoulomb>;

/// A problem, its solution and the displacements observed.
type Response = (Problem, Vec<f64>, Vec<f64>);

const LENGTH: f64 = 2.0;

/// A block of steel-like units, held at its left side, on the ground.
fn block(cells: [usize; 2]) -> Outcome<(ElasticSystem, ContactRows)> {
    let mesh = Mesh::rectangle([0.0, 0.0], [LENGTH, 1.0], cells)?;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .fix("left")
        .assemble()?;
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    Ok((system, rows))
}

/// The friction of the ground, from displacements of the free surface that are known with errors: a coefficient for each part of the ground.
pub struct Identification {
    system: ElasticSystem,
    body: ContactBody,
    /// The part of the ground below each contact node.
    parts: Vec<usize>,
    /// The displacements observed, and what was observed: at these levels of the load.
    observed: Vec<usize>,
    pub data: Vec<Vec<f64>>,
}

pub const LEVELS: [f64; 2] = [0.6, 1.0];

impl Identification {
    pub fn new(cells: [usize; 2], parts: usize) -> Outcome<Self> {
        let (system, rows) = block(cells)?;
        // A weight, and a pull to the right at the right side that grows with the load.
        let weight = system.traction("top", |_| [0.0, -0.02, 0.0])?;
        let pull = system.traction("right", |_| [0.02, -0.005, 0.0])?;
        let body = contact_body(&system, &rows, LoadPath::affine(weight, pull))?;
        let part = |at: &[f64; 3]| ((at[0] / LENGTH * parts as f64) as usize).min(parts - 1);
        let top = system.mesh().facet_group("top")?.iter().flatten();
        let dofs = top.flat_map(|node| (0..2).filter_map(|d| system.dof(*node, d)));
        let mut observed: Vec<usize> = dofs.collect();
        observed.sort_unstable();
        observed.dedup();
        Ok(Self {
            parts: rows.points.iter().map(part).collect(),
            system,
            body,
            observed,
            data: Vec::new(),
        })
    }

    fn friction(&self, of_parts: &[f64]) -> Outcome<FrictionCoefficient> {
        Ok(FrictionCoefficient::nodal(
            self.parts.iter().map(|p| of_parts[*p]).collect(),
        )?)
    }

    /// The problem, its solution and the observed displacements at each level.
    pub fn response(&self, friction: &[f64]) -> Outcome<Vec<Response>> {
        let law = PlanarCoulomb::new(self.friction(friction)?);
        let problem = CondensedContact::new(self.body.clone(), law)?;
        let at = |level: &f64| {
            let x = problem.solve(*level, None)?;
            let full = problem.expand(&x)?;
            let seen = self.observed.iter().map(|i| full[*i]).collect();
            Ok((problem.clone(), x, seen))
        };
        LEVELS.iter().map(at).collect()
    }

    /// The gradient in the coefficients of the sum of wᵢ uᵢ over the observed displacements at one level.
    pub fn gradient(
        &self,
        (problem, x): (&Problem, &[f64]),
        friction: &[f64],
        w: &[f64],
    ) -> Outcome<Vec<f64>> {
        let law = PlanarCoulomb::new(
            self.friction(friction)?
                .with_second(vec![1.0; self.parts.len()])?,
        );
        let columns: Vec<_> = self.parts.iter().enumerate().map(|(i, p)| (i, *p, 1.0)).collect();
        let columns = Matrix::from_triplets(self.parts.len(), friction.len(), &columns)?;
        let mut found = problem.sensitivity(x, &problem.parameters().with_law(law, &columns)?)?;
        let mut slopes = vec![0.0; self.system.num_free()];
        self.observed.iter().zip(w).for_each(|(i, w)| slopes[*i] = *w);
        Ok(found.vjp(&slopes, &vec![0.0; 2 * self.parts.len()])?)
    }

    /// ½ Σ (u − d)² over all levels, with its gradient.
    pub fn misfit(&self, friction: &[f64], gradient: &mut [f64]) -> Outcome<f64> {
        gradient.fill(0.0);
        let mut sum = 0.0;
        for ((problem, x, seen), data) in self.response(friction)?.iter().zip(&self.data) {
            let off: Vec<f64> = seen.iter().zip(data).map(|(u, d)| u - d).collect();
            sum += 0.5 * off.iter().map(|o| o * o).sum::<f64>();
            let own = self.gradient((problem, x), friction, &off)?;
            gradient.iter_mut().zip(own).for_each(|(g, own)| *g += own);
        }
        Ok(sum)
    }

    /// The coefficients between 0.05 and 0.9 that fit the data, from a start.
    pub fn identify(&self, start: &[f64]) -> Outcome<(Vec<f64>, BundleReport)> {
        let set = Polyhedron::boxed(vec![0.05; start.len()], vec![0.9; start.len()])?;
        let mut f = |p: &[f64], g: &mut [f64]| self.misfit(p, g);
        Ok(Bundle::default().minimise(&set, start, &mut f)?)
    }
}

/// The shape of the lower side of the block, by heights at equally spaced points above the ground with linear interpolation, so that the
/// contact stresses are as equal as possible.
pub struct Shape {
    body: ContactBody,
    areas: Vec<f64>,
    /// The gap of each node for the heights.
    hats: Matrix,
}

impl Shape {
    pub fn new(cells: [usize; 2], heights: usize) -> Outcome<Self> {
        let (system, rows) = block(cells)?;
        let press = system.traction("top", |_| [0.005, -0.03, 0.0])?;
        let body = contact_body(
            &system,
            &rows,
            LoadPath::affine(press.clone(), vec![0.0; press.len()]),
        )?;
        let mut entries = Vec::new();
        for (i, at) in rows.points.iter().enumerate() {
            for j in 0..heights {
                let apart = (at[0] / LENGTH * (heights - 1) as f64 - j as f64).abs();
                entries.push((i, j, (1.0 - apart).max(0.0)));
            }
        }
        Ok(Self {
            body,
            hats: Matrix::from_triplets(rows.points.len(), heights, &entries)?,
            areas: rows.areas,
        })
    }

    fn gap(&self, heights: &[f64]) -> Vec<f64> {
        let mut gap = vec![0.0; self.areas.len()];
        self.hats
            .triplets()
            .for_each(|(i, j, v)| gap[i] += v * heights[j]);
        gap
    }

    /// The integral of the square of the contact pressure, with its gradient in the heights.
    pub fn unevenness(&self, heights: &[f64], gradient: &mut [f64]) -> Outcome<f64> {
        let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.3)?);
        let problem = CondensedContact::new(self.body.clone().with_gap(self.gap(heights))?, law)?;
        let x = problem.solve(0.0, None)?;
        let p = self.areas.len();
        let mut slopes = vec![0.0; 2 * p];
        let mut sum = 0.0;
        for (i, area) in self.areas.iter().enumerate() {
            sum += x[i] * x[i] / area;
            slopes[i] = 2.0 * x[i] / area;
        }
        let mut found = problem.sensitivity(&x, &problem.parameters().with_gaps(&self.hats)?)?;
        let n = problem.body().num_displacements();
        gradient.copy_from_slice(&found.vjp(&vec![0.0; n], &slopes)?);
        Ok(sum)
    }

    /// The heights between 0 and a bound, their sum being given, from equal ones: the start's and the best value.
    pub fn equalise(&self, heights: usize, most: f64) -> Outcome<(f64, Vec<f64>, BundleReport)> {
        let sum = Matrix::from_rows(&[vec![1.0; heights]])?;
        let set = Polyhedron::boxed(vec![0.0; heights], vec![most; heights])?
            .with_equations(sum, vec![0.5 * most * heights as f64])?;
        let mut f = |h: &[f64], g: &mut [f64]| self.unevenness(h, g);
        let start = vec![0.5 * most; heights];
        let first = f(&start, &mut vec![0.0; heights])?;
        let options = BundleOptions::default()
            .with_tolerance(1e-4)
            .with_value_tolerance(1e-7);
        let (best, report) = Bundle::new(options).minimise(&set, &start, &mut f)?;
        Ok((first, best, report))
    }
}
