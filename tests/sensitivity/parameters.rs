//! Contact: derivatives in all data of a problem, in all forms, against differences of solutions of changed problems.

use std::sync::Arc;

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactParameters, ContactSensitivity, FrictionCoefficient,
    FullContact, LoadCase, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, ReducedBody, ReducedContact,
    ReducedOptions, ReducedSensitivity,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
use semismooth::fem::{
    ContactRows, Dilatation, ElasticSystem, Elasticity, Foundation, Material, MaterialConstant, Mesh,
    PlaneModel,
};
use semismooth::interface::View;
use semismooth::sensitivity::{Differentiability, SensitivityError, Validity, valid_along};
use semismooth::sparse::{Matrix, NodalMatrix};

use super::dot;
use super::random::Random;

pub type Law = Arc<dyn NodeLaw + Send + Sync>;

/// All data of a body on the ground: held at its left side, which is moved, pressed down and pushed along.
#[derive(Clone)]
pub struct Data {
    mesh: Mesh,
    points: Vec<[f64; 3]>,
    plane: PlaneModel,
    dilatation: Dilatation,
    /// E and ν of the left and of the right part.
    materials: [[f64; 2]; 2],
    motion: f64,
    pub alpha: f64,
    push: f64,
    load: Vec<f64>,
    gap: Vec<f64>,
    friction: Vec<f64>,
}

impl Data {
    pub fn new(mesh: Mesh, plane: PlaneModel, dilatation: Dilatation) -> Self {
        let (dim, random) = (mesh.dim(), &mut Random::new(3));
        let mut points = mesh.points().to_vec();
        for at in &mut points {
            // No cell is a rectangle, and contact nodes, which are sorted by their first coordinates, keep their order when they move.
            at[0] += if dim == 3 { 0.05 * at[1] } else { 0.0 };
            let bump = 0.05 * (3.0 * at[0] + 2.0 * at[1]).sin() * at[dim - 1];
            at[..dim].iter_mut().for_each(|x| *x += bump);
        }
        let mut data = Self {
            mesh,
            points,
            plane,
            dilatation,
            materials: [[1.0, 0.3], [1.7, 0.2]],
            motion: 2e-4,
            alpha: 0.7,
            push: 0.002,
            load: Vec::new(),
            gap: Vec::new(),
            friction: Vec::new(),
        };
        let (system, rows) = data.system();
        let p = rows.nodes.len();
        data.load = random.vector(system.num_free(), 1e-4);
        data.gap = random.vector(p, 3e-4);
        data.friction = random.vector(p, 0.05).iter().map(|f| 0.3 + f).collect();
        data
    }

    /// A plane body of quadrilaterals, or of triangles.
    pub fn plane(plane: PlaneModel, dilatation: Dilatation, simplices: bool) -> Self {
        let mesh = Mesh::rectangle([1.0, 0.0], [3.0, 1.0], [6, 3]).unwrap();
        let mesh = if simplices {
            mesh.simplices().unwrap()
        } else {
            mesh
        };
        Self::new(mesh, plane, dilatation)
    }

    pub fn space(cells: [usize; 3], simplices: bool) -> Self {
        let mesh = Mesh::block([1.0, 0.0, 0.0], [3.0, 1.0, 1.0], cells).unwrap();
        let mesh = if simplices {
            mesh.simplices().unwrap()
        } else {
            mesh
        };
        Self::new(mesh, PlaneModel::Strain, Dilatation::Automatic)
    }

    /// The body under a push with which some nodes stick and others slip, none of them close to a change.
    pub fn mixed(mut self) -> Self {
        for _ in 0..60 {
            let states = |factor: f64| {
                let mut data = self.clone();
                data.push *= factor;
                let problem = data.condensed();
                let found = problem
                    .solution(&problem.solve(data.alpha, None).unwrap())
                    .unwrap();
                (found.stick() > 0 && found.slip() > 0).then_some(found.states)
            };
            let [below, here, above] = [0.96, 1.0, 1.04].map(states);
            if here.is_some() && below == here && above == here {
                return self;
            }
            self.push *= 1.1;
        }
        panic!("no push leaves nodes in both states");
    }

    fn dim(&self) -> usize {
        self.mesh.dim()
    }

    pub fn up(&self) -> [f64; 3] {
        if self.dim() == 2 {
            [0.0, 1.0, 0.0]
        } else {
            [0.0, 0.0, 1.0]
        }
    }

    pub fn system(&self) -> (ElasticSystem, ContactRows) {
        let old = &self.mesh;
        let cells = (0..old.num_cells()).map(|c| (old.kind(c), old.cell(c).to_vec()));
        let mut mesh = Mesh::new(self.dim(), self.points.clone(), cells).unwrap();
        for name in ["left", "top", "bottom"] {
            mesh.add_facet_group(name, old.facet_group(name).unwrap().to_vec())
                .unwrap();
        }
        let right = (0..old.num_cells()).filter(|&c| old.centre(c)[0] > 2.0).collect();
        mesh.add_cell_group("right", right).unwrap();
        let [left, right] = self.materials.map(|[e, nu]| Material::isotropic(e, nu).unwrap());
        let motion = self.motion;
        let mut body = Elasticity::new(mesh, left)
            .with_material("right", right)
            .with_plane_model(self.plane)
            .with_dilatation(self.dilatation)
            .prescribe("left", 0, move |_| motion);
        for d in 1..self.dim() {
            body = body.fix_component("left", d);
        }
        let system = body.assemble().unwrap();
        let rows = system
            .contact("bottom", &Foundation::plane([0.0; 3], self.up()))
            .unwrap();
        (system, rows)
    }

    /// Nodal forces that do not depend on positions: a weight on the top, and a push there with α.
    pub fn load(&self, system: &ElasticSystem) -> LoadPath {
        let top = self.mesh.facet_group("top").unwrap();
        let share = 1.0 / top.len() as f64;
        let mut loads = [self.load.clone(), vec![0.0; self.load.len()]];
        for &node in top.iter().flatten() {
            let mut add = |k: usize, d: usize, f: f64| {
                if let Some(dof) = system.dof(node, d) {
                    loads[k][dof] += share * f;
                }
            };
            add(0, self.dim() - 1, -0.02);
            (0..self.dim() - 1).for_each(|d| add(1, d, self.push));
        }
        let [constant, push] = loads;
        let constant = LoadCase::from(constant).plus(system.supports()).unwrap();
        LoadPath::affine(constant, push)
    }

    pub fn body(&self) -> ContactBody {
        let (system, rows) = self.system();
        let gap = rows.gap.iter().zip(&self.gap).map(|(a, b)| a + b).collect();
        let body = semismooth::contact_body(&system, &rows, self.load(&system)).unwrap();
        body.with_gap(gap).unwrap()
    }

    pub fn law(&self, second: bool) -> Law {
        // It grows with α, faster at some nodes than at others.
        let slopes = (0..self.friction.len())
            .map(|i| 0.01 * (1 + i % 3) as f64)
            .collect();
        let mut friction = FrictionCoefficient::affine(self.friction.clone(), slopes).unwrap();
        if second {
            friction = friction.with_second(vec![1.0; self.friction.len()]).unwrap();
        }
        match self.dim() {
            2 => Arc::new(PlanarCoulomb::new(friction)),
            _ => Arc::new(OrthotropicCoulomb::new(friction.clone(), friction.times(1.25))),
        }
    }

    pub fn condensed(&self) -> CondensedContact<Law> {
        CondensedContact::new(self.body(), self.law(false)).unwrap()
    }

    fn reduced(&self) -> ReducedContact<Law> {
        let (system, rows) = self.system();
        let gap = rows.gap.iter().zip(&self.gap).map(|(a, b)| a + b).collect();
        let body = semismooth::reduced_body(&system, &rows, self.load(&system)).unwrap();
        let options = ReducedOptions::default().with_tolerance(1e-13);
        ReducedContact::new(body.with_gap(gap).unwrap(), self.law(false), options).unwrap()
    }

    /// (u, λ); `near` is a solution of the condensed form nearby.
    pub fn solution(&self, near: Option<&[f64]>) -> Vec<f64> {
        let problem = self.condensed();
        let x = problem.solve(self.alpha, near).unwrap();
        let mut full = problem.expand(&x).unwrap();
        full.truncate(full.len() - 1);
        full
    }

    /// The parameters: α, two loads, the motion of the left side, all gaps, all coefficients of friction, E and ν of the right part, E
    /// everywhere, the positions of all nodes. The second result are the first numbers of these, and their count.
    pub fn parameters(&self, empty: ContactParameters, full: &[f64]) -> (ContactParameters, Vec<usize>) {
        let (system, rows) = self.system();
        let (n, p) = (system.num_free(), rows.nodes.len());
        let supports = system.supports().displacements();
        let u = system.displacements(&full[..n], supports).unwrap();
        let loads = random_loads(n);
        let loads = Matrix::from_triplets(n, 2, &entries(&loads)).unwrap();
        let motion = system.motion("left", 0, |_| 1.0).unwrap();
        let motion = Matrix::from_triplets(n, 1, &entries(&[motion.forces().to_vec()])).unwrap();
        let by = |constant, cells| system.forces_by_material(&u, constant, cells).unwrap();
        let materials = [
            by(MaterialConstant::Young, Some("right")),
            by(MaterialConstant::Poisson, Some("right")),
            by(MaterialConstant::Young, None),
        ];
        let materials = Matrix::from_triplets(n, 3, &entries(&materials)).unwrap();
        let positions = system.forces_by_position(&u).unwrap();
        let up = self.up();
        let traces = rows.traces_by_position(&system, |_| up).unwrap();
        let identity = Matrix::identity(p);
        let made = empty
            .with_loads(&loads)
            .and_then(|made| made.with_loads(&motion))
            .and_then(|made| made.with_gaps(&identity))
            .and_then(|made| made.with_law(self.law(true), &identity))
            .and_then(|made| made.with_body(&materials, None))
            .and_then(|made| made.with_body(&positions, Some(&traces)))
            .unwrap()
            .with_alpha();
        let firsts = vec![0, 1, 3, 4, 4 + p, 4 + 2 * p, 7 + 2 * p, made.len()];
        (made, firsts)
    }

    /// The data with the parameters changed by s δ.
    pub fn changed(&self, delta: &[f64], s: f64) -> Self {
        let (mut data, p) = (self.clone(), self.gap.len());
        data.alpha += s * delta[0];
        for (k, load) in random_loads(self.load.len()).iter().enumerate() {
            data.load
                .iter_mut()
                .zip(load)
                .for_each(|(f, own)| *f += s * delta[1 + k] * own);
        }
        data.motion += s * delta[3];
        for i in 0..p {
            data.gap[i] += s * delta[4 + i];
            data.friction[i] += s * delta[4 + p + i];
        }
        let materials = &delta[4 + 2 * p..];
        data.materials[1][0] += s * (materials[0] + materials[2]);
        data.materials[1][1] += s * materials[1];
        data.materials[0][0] += s * materials[2];
        let dim = self.dim();
        for (n, at) in data.points.iter_mut().enumerate() {
            for (d, x) in at.iter_mut().enumerate().take(dim) {
                *x += s * materials[3 + dim * n + d];
            }
        }
        data
    }
}

fn random_loads(n: usize) -> [Vec<f64>; 2] {
    let random = &mut Random::new(8);
    [random.vector(n, 0.001), random.vector(n, 0.001)]
}

pub fn entries(columns: &[Vec<f64>]) -> Vec<(usize, usize, f64)> {
    let columns = columns.iter().enumerate();
    columns
        .flat_map(|(j, column)| column.iter().enumerate().map(move |(i, v)| (i, j, *v)))
        .collect()
}

/// The derivative along a direction by differences of fourth order.
pub fn differences(data: &Data, near: &[f64], delta: &[f64], step: f64) -> Vec<f64> {
    let at = |s: f64| data.changed(delta, s).solution(Some(near));
    let (a, b, c, d) = (at(-2.0 * step), at(-step), at(step), at(2.0 * step));
    let rate = |i: usize| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * step);
    (0..a.len()).map(rate).collect()
}

/// A direction of one kind of parameters, of a size that keeps all nodes in their states.
pub fn directions(firsts: &[usize], random: &mut Random) -> Vec<Vec<f64>> {
    let sizes = [1.0, 1.0, 0.01, 0.001, 0.3, 1.0, 0.1];
    let kinds = firsts.windows(2).zip(sizes);
    kinds
        .map(|(span, size)| {
            let mut delta = vec![0.0; firsts[7]];
            let own = random.vector(span[1] - span[0], size);
            delta[span[0]..span[1]].copy_from_slice(&own);
            delta
        })
        .collect()
}

pub fn close(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    let largest = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!(
            (f - e).abs() <= tolerance * largest,
            "{what}, {i}: {f} {e} of {largest}"
        );
    }
}

fn all(found: &mut ContactSensitivity<impl View>, delta: &[f64]) -> Vec<f64> {
    let change = found.jvp(delta).unwrap();
    [change.displacements, change.forces].concat()
}

fn all_alone(found: &mut ReducedSensitivity<'_>, delta: &[f64]) -> Vec<f64> {
    let change = found.jvp(delta).unwrap();
    [change.displacements, change.forces].concat()
}

/// Both forms give the derivatives of differences in each kind of parameters, and the adjoint of either is exact.
fn checked(data: Data) {
    let data = &data.mixed();
    let condensed = data.condensed();
    let x = condensed.solve(data.alpha, None).unwrap();
    let y = condensed.expand(&x).unwrap();
    let (parameters, firsts) = data.parameters(condensed.parameters(), &y);
    let full = FullContact::new(data.body(), data.law(false)).unwrap();
    let mut found = condensed.sensitivity(&x, &parameters).unwrap();
    let mut other = full.sensitivity(&y, &parameters).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(true));
    assert_eq!(other.differentiable().unwrap().known(), Some(true));
    let random = &mut Random::new(5);
    let n = full.num_displacements();
    let [matrix, other_matrix] = [found.derivative(), other.derivative()].map(Result::unwrap);
    for (kind, delta) in directions(&firsts, random).iter().enumerate() {
        let rate = all(&mut found, delta);
        let what = format!("parameters {kind}");
        for matrix in [&matrix, &other_matrix] {
            let mut product = vec![0.0; rate.len()];
            matrix.mul_vec(delta, &mut product);
            close(&product, &rate, 1e-10, &what);
        }
        close(&rate, &differences(data, &x, delta, 5e-5), 1e-7, &what);
        close(&all(&mut other, delta), &rate, 1e-10, &what);
        let w = random.vector(y.len() - 1, 1.0);
        let forward = dot(&rate, &w);
        for gradient in [found.vjp(&w[..n], &w[n..]), other.vjp(&w[..n], &w[n..])] {
            let adjoint = dot(&gradient.unwrap(), delta);
            let size: f64 = rate.iter().zip(&w).map(|(a, b)| (a * b).abs()).sum();
            assert!(
                (forward - adjoint).abs() <= 1e-11 * size,
                "{what}: {forward} {adjoint}"
            );
        }
    }
}

#[test]
fn plane_strain() {
    checked(Data::plane(PlaneModel::Strain, Dilatation::Pointwise, false));
    checked(Data::plane(PlaneModel::Strain, Dilatation::Mean, false));
    checked(Data::plane(PlaneModel::Strain, Dilatation::Automatic, true));
}

#[test]
fn plane_stress_and_revolution() {
    checked(Data::plane(PlaneModel::Stress, Dilatation::Automatic, false));
    checked(Data::plane(
        PlaneModel::Axisymmetric,
        Dilatation::Pointwise,
        false,
    ));
    checked(Data::plane(PlaneModel::Axisymmetric, Dilatation::Mean, true));
    checked(Data::plane(PlaneModel::Axisymmetric, Dilatation::Mean, false));
}

#[test]
fn space() {
    checked(Data::space([4, 2, 2], false));
    checked(Data::space([3, 2, 2], true));
}

/// The form in displacements has the derivatives of the condensed form, by transposed solves, too.
#[test]
fn displacements_alone() {
    let plane = Data::plane(PlaneModel::Strain, Dilatation::Pointwise, false);
    for data in [plane, Data::space([4, 2, 2], false), Data::space([3, 2, 2], true)] {
        let data = data.mixed();
        let condensed = data.condensed();
        let x = condensed.solve(data.alpha, None).unwrap();
        let y = condensed.expand(&x).unwrap();
        let (parameters, firsts) = data.parameters(condensed.parameters(), &y);
        let mut problem = data.reduced();
        let n = problem.body().num_displacements();
        // Two further ones move the traces alone, tangential ones, too.
        let random = &mut Random::new(5);
        let traces = y.len() - 1 - n;
        let moved = [random.vector(traces, 1.0), random.vector(traces, 1.0)];
        let moved = Matrix::from_triplets(traces, 2, &entries(&moved)).unwrap();
        let none = Matrix::from_triplets(n, 2, &[]).unwrap();
        let parameters = parameters.with_body(&none, Some(&moved)).unwrap();
        let mut expected = condensed.sensitivity(&x, &parameters).unwrap();

        let u = problem.solve(data.alpha, Some(&y[..n])).unwrap().displacements;
        let mut found = problem.sensitivity(data.alpha, &u, &parameters).unwrap();
        assert_eq!(
            found.differentiable().unwrap().known(),
            Some(true),
            "{}",
            found.margin()
        );
        let random = &mut Random::new(6);
        let mut all_directions = directions(&firsts, random);
        all_directions.iter_mut().for_each(|delta| delta.extend([0.0; 2]));
        let mut last = vec![0.0; firsts[7]];
        last.extend([1.0, -0.5]);
        all_directions.push(last);
        for (kind, delta) in all_directions.iter().enumerate() {
            let change = found.jvp(delta).unwrap();
            let rate = [change.displacements, change.forces].concat();
            close(
                &rate,
                &all(&mut expected, delta),
                1e-7,
                &format!("parameters {kind}"),
            );
            let w = random.vector(rate.len(), 1.0);
            let gradient = found.vjp(&w[..n], &w[n..]).unwrap();
            let size: f64 = rate.iter().zip(&w).map(|(a, b)| (a * b).abs()).sum();
            let (forward, adjoint) = (dot(&rate, &w), dot(&gradient, delta));
            assert!(
                (forward - adjoint).abs() <= 1e-8 * size,
                "{kind}: {forward} {adjoint}"
            );
        }
    }
}

/// Where a node begins to slip or to lift off, in the plane and in space, the form in displacements has both one-sided derivatives and the
/// element along the unit vectors that the condensed form has.
#[test]
fn transitions_in_displacements_alone() {
    let plane = Data::plane(PlaneModel::Strain, Dilatation::Pointwise, false);
    for data in [plane, Data::space([4, 2, 2], false)] {
        let condensed = data.condensed();
        let start = condensed.solve(0.0, None).unwrap();
        let options = ContinuationOptions::default().with_parameter_range((0.0, 4.0));
        let branch = Branch::follow(&condensed, &start, Direction::Increasing, options).unwrap();
        let mut kinds = Vec::new();
        for transition in &branch.transitions {
            if transition.kind != TransitionKind::PassThrough || transition.sites.len() != 1 {
                continue;
            }
            let (alpha, x) = (transition.parameter(), &transition.x);
            let y = condensed.expand(x).unwrap();
            let (parameters, firsts) = data.parameters(condensed.parameters(), &y);
            let mut expected = condensed.sensitivity(x, &parameters).unwrap();
            let mut problem = data.reduced();
            let n = problem.body().num_displacements();
            let mut found = problem.sensitivity(alpha, &y[..n], &parameters).unwrap();
            let said = found.differentiable().unwrap();
            assert_eq!(said.known(), expected.differentiable().unwrap().known());
            if let Differentiability::No {
                direction,
                forward,
                backward,
            } = &said
            {
                let opposite: Vec<f64> = direction.iter().map(|d| -d).collect();
                for (delta, side) in [(direction, forward), (&opposite, backward)] {
                    let own = expected.jvp(delta).unwrap().displacements;
                    close(side, &own, 1e-7, "a side of what is not differentiable");
                }
            }
            kinds.push(said.known());
            let random = &mut Random::new(7);
            for delta in directions(&firsts, random) {
                for sign in [1.0, -1.0] {
                    let delta: Vec<f64> = delta.iter().map(|d| sign * d).collect();
                    let expected = all(&mut expected, &delta);
                    close(&all_alone(&mut found, &delta), &expected, 1e-7, "one side");
                }
            }
            let w = random.vector(y.len() - 1, 1.0);
            let [a, b] = [found.vjp(&w[..n], &w[n..]), expected.vjp(&w[..n], &w[n..])].map(Result::unwrap);
            close(&a, &b, 1e-7, "elements");
        }
        assert!(
            kinds.iter().filter(|k| **k == Some(false)).count() >= 2,
            "{kinds:?}"
        );
    }
}

/// A body of three nodes: the first one at the limit of sticking, the second one just touching, the third one sticks. All numbers are
/// exact in binary.
struct Degenerate {
    a: Matrix,
    load: Vec<f64>,
    gap: Vec<f64>,
    friction: Vec<f64>,
}

impl Degenerate {
    const FORCES: [[f64; 3]; 2] = [[1.0, 0.0, 2.0], [0.25, 0.0, 0.125]];
    const MOTIONS: [[f64; 3]; 2] = [[0.0, 0.5, 0.25], [0.0, 0.375, 0.0]];

    fn new(first: bool, second: bool) -> Self {
        let rows = [
            [8.0, 1.0, -2.0, 0.5, 0.0, 1.0],
            [1.0, 9.0, 0.5, -1.0, 1.0, 0.0],
            [-2.0, 0.5, 7.0, 1.0, 0.5, -1.0],
            [0.5, -1.0, 1.0, 8.0, -0.5, 1.0],
            [0.0, 1.0, 0.5, -0.5, 6.0, 0.25],
            [1.0, 0.0, -1.0, 1.0, 0.25, 7.0],
        ];
        let a = Matrix::from_rows(&rows).unwrap();
        // Normal and tangential component of each node, in turn.
        let at = |of: [[f64; 3]; 2], k: usize| of[k % 2][k / 2];
        let mut load: Vec<f64> = (0..6)
            .map(|i| (0..6).map(|j| rows[i][j] * at(Self::MOTIONS, j)).sum::<f64>() + at(Self::FORCES, i))
            .collect();
        let mut gap = Self::MOTIONS[0].to_vec();
        // Away from the kinks: the first node sticks firmly, the second one is open.
        load[1] -= if first { 0.0 } else { 0.125 };
        gap[1] += if second { 0.0 } else { 0.125 };
        Self {
            a,
            load,
            gap,
            friction: vec![0.25; 3],
        }
    }

    fn problem(&self) -> CondensedContact<PlanarCoulomb> {
        let trace =
            |d: usize| Matrix::from_triplets(3, 6, &[(0, d, 1.0), (1, 2 + d, 1.0), (2, 4 + d, 1.0)]).unwrap();
        let load = LoadPath::constant(self.load.clone());
        let body = ContactBody::new(self.a.clone(), trace(0), vec![trace(1)], load).unwrap();
        let friction = FrictionCoefficient::nodal(self.friction.clone()).unwrap();
        CondensedContact::new(
            body.with_gap(self.gap.clone()).unwrap(),
            PlanarCoulomb::new(friction),
        )
        .unwrap()
    }

    fn reduced(&self) -> ReducedContact<PlanarCoulomb> {
        let trace =
            |d: usize| Matrix::from_triplets(3, 6, &[(0, d, 1.0), (1, 2 + d, 1.0), (2, 4 + d, 1.0)]).unwrap();
        let places = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let dofs = [0, 1, 2, 3, 4, 5].map(|k| [k / 2, k % 2]);
        let a = NodalMatrix::new(&self.a, places.to_vec(), &dofs, 2).unwrap();
        let load = LoadPath::constant(self.load.clone());
        let body = ReducedBody::new(a, &trace(0), &[trace(1)], load).unwrap();
        let friction = FrictionCoefficient::nodal(self.friction.clone()).unwrap();
        let body = body.with_gap(self.gap.clone()).unwrap();
        ReducedContact::new(body, PlanarCoulomb::new(friction), ReducedOptions::default()).unwrap()
    }

    /// Loads, gaps, coefficients of friction.
    fn changed(&self, delta: &[f64], s: f64) -> Self {
        let moved = |old: &[f64], d: &[f64]| old.iter().zip(d).map(|(a, d)| a + s * d).collect();
        Self {
            a: self.a.clone(),
            load: moved(&self.load, delta),
            gap: moved(&self.gap, &delta[6..]),
            friction: moved(&self.friction, &delta[9..]),
        }
    }

    fn parameters(&self, empty: ContactParameters) -> ContactParameters {
        let friction = FrictionCoefficient::nodal(self.friction.clone()).unwrap();
        let law = PlanarCoulomb::new(friction.with_second(vec![1.0; 3]).unwrap());
        let identity = Matrix::identity(3);
        let made = empty
            .with_loads(&Matrix::identity(6))
            .and_then(|made| made.with_gaps(&identity));
        made.and_then(|made| made.with_law(law, &identity)).unwrap()
    }

    fn full(&self) -> Vec<f64> {
        let problem = self.problem();
        let x = problem.solve(0.0, None).unwrap();
        problem.expand(&x).unwrap()[..12].to_vec()
    }
}

/// Where nodes are at the limit of sticking or just touch, derivatives along all directions are one-sided differences in all forms, and
/// *differentiable* is said where the two sides agree in all directions.
#[test]
fn kinks_in_all_parameters() {
    let random = &mut Random::new(9);
    for case in 0..8 {
        let [first, second, third] = [1, 2, 4].map(|bit| case & bit > 0);
        let mut data = Degenerate::new(first, second);
        if third {
            data.friction[2] = 0.0625;
        }
        let problem = data.problem();
        let x = problem.solve(0.0, None).unwrap();
        let y = problem.expand(&x).unwrap();
        let parameters = data.parameters(problem.parameters());
        let full = problem.full().unwrap();
        let mut found = problem.sensitivity(&x, &parameters).unwrap();
        let mut other = full.sensitivity(&y, &parameters).unwrap();
        let mut reduced = data.reduced();
        let mut alone = reduced.sensitivity(0.0, &y[..6], &parameters).unwrap();
        let known = found.differentiable().unwrap().known();
        assert_eq!(known, alone.differentiable().unwrap().known());
        assert_eq!(known, other.differentiable().unwrap().known());
        assert_eq!(known, Some(case == 0), "{case}");
        let mut kinks = 0;
        for _ in 0..20 {
            let delta = random.vector(12, 1.0);
            let mut sides = Vec::new();
            for sign in [1.0, -1.0] {
                let delta: Vec<f64> = delta.iter().map(|d| sign * d).collect();
                let rate = all(&mut found, &delta);
                close(&all(&mut other, &delta), &rate, 1e-12, "the full form");
                close(&all_alone(&mut alone, &delta), &rate, 1e-9, "displacements alone");
                // One-sided, of second order.
                let step = 1e-6;
                let (near, far) = (
                    data.changed(&delta, step).full(),
                    data.changed(&delta, 2.0 * step).full(),
                );
                let differences: Vec<f64> = (0..12)
                    .map(|i| (4.0 * near[i] - far[i] - 3.0 * y[i]) / (2.0 * step))
                    .collect();
                close(&rate, &differences, 1e-8, "one side");
                sides.push(rate);
            }
            let largest = sides[0].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            kinks += usize::from((0..12).any(|i| (sides[0][i] + sides[1][i]).abs() > 1e-6 * largest));
        }
        assert_eq!(kinks > 0, case > 0);
        // An element of the generalised derivative: the same from both forms.
        let w = random.vector(12, 1.0);
        let [a, b] = [found.vjp(&w[..6], &w[6..]), other.vjp(&w[..6], &w[6..])].map(Result::unwrap);
        close(&a, &b, 1e-11, "elements");
        close(&alone.vjp(&w[..6], &w[6..]).unwrap(), &a, 1e-9, "elements");
    }
}

/// Along changes of materials and positions nodes keep their states up to the end of the range that is found, and not beyond.
#[test]
fn ranges_of_materials_and_positions() {
    let data = Data::plane(PlaneModel::Strain, Dilatation::Pointwise, false).mixed();
    let condensed = data.condensed();
    let x = condensed.solve(data.alpha, None).unwrap();
    let states = |data: &Data| {
        let problem = data.condensed();
        let found = problem.solve(data.alpha, Some(&x)).unwrap();
        problem.solution(&found).unwrap().states
    };
    let (parameters, firsts) = data.parameters(condensed.parameters(), &condensed.expand(&x).unwrap());
    let mut found = condensed.sensitivity(&x, &parameters).unwrap();
    let mut random = Random::new(12);
    for (kind, size) in [(5, 0.25), (6, 0.1)] {
        let mut delta = vec![0.0; firsts[7]];
        let own = random.vector(firsts[kind + 1] - firsts[kind], size);
        delta[firsts[kind]..firsts[kind + 1]].copy_from_slice(&own);
        assert!(matches!(
            found.valid_until(&delta, 1.0),
            Err(SensitivityError::AtSolution { .. })
        ));
        let family = |s: f64| {
            let data = data.changed(&delta, s);
            Ok::<_, ContactError>((data.condensed(), vec![data.alpha]))
        };
        let range = valid_along(family, found.x(), 1.0).unwrap();
        let Validity::Followed(until) = range else {
            panic!("{kind}: {range}");
        };
        let here = states(&data);
        assert_eq!(
            states(&data.changed(&delta, until * (1.0 - 1e-6))),
            here,
            "{kind}"
        );
        assert_ne!(
            states(&data.changed(&delta, until * (1.0 + 1e-6))),
            here,
            "{kind}"
        );
        let half = valid_along(family, found.x(), 0.5 * until).unwrap();
        assert_eq!(half, Validity::Beyond(0.5 * until));
    }
}

/// A family that breaks off gives its own error, and members of another size are refused.
#[test]
fn families_that_fail() {
    let data = Degenerate::new(false, false);
    let x = data.problem().solve(0.0, None).unwrap();
    let broken = |s: f64| match s > 0.25 {
        true => Err(ContactError::Empty { what: "gone" }),
        false => Ok((data.problem(), vec![0.0])),
    };
    let error = valid_along(broken, &x[..6], 1.0).unwrap_err();
    assert_eq!(error, ContactError::Empty { what: "gone" });
    let other = |s: f64| {
        let parameters = if s > 0.25 { vec![] } else { vec![0.0] };
        Ok::<_, ContactError>((data.problem(), parameters))
    };
    let error = valid_along(other, &x[..6], 1.0).unwrap_err();
    assert!(error.to_string().contains("parameters of a member"), "{error}");
}

/// A body that nothing presses touches at all its nodes: what solutions do is then not said, and at once.
#[test]
fn many_nodes_at_kinks() {
    let mut data = Data::plane(PlaneModel::Strain, Dilatation::Pointwise, false);
    data.load.fill(0.0);
    (data.motion, data.push) = (0.0, 0.0);
    let mesh = Mesh::rectangle([1.0, 0.0], [3.0, 1.0], [12, 6]).unwrap();
    data.points = mesh.points().to_vec();
    data.mesh = mesh;
    let (system, rows) = data.system();
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let body = semismooth::reduced_body(&system, &rows, load).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.3).unwrap());
    let mut problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    let n = problem.body().num_displacements();
    let parameters = problem.parameters().with_loads(&Matrix::identity(n)).unwrap();
    let mut found = problem.sensitivity(0.0, &vec![0.0; n], &parameters).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), None);
    assert!(matches!(
        found.jvp(&vec![1.0; n]),
        Err(SensitivityError::NotUnique { .. })
    ));
    assert_eq!(found.iterations(), 0);
}

/// Along a change of loads and gaps the solutions are straight up to the next kink, and no further.
#[test]
fn ranges_end_at_the_next_kink() {
    let data = Degenerate::new(false, false);
    let problem = data.problem();
    let x = problem.solve(0.0, None).unwrap();
    let identity = Matrix::identity(3);
    let parameters = problem.parameters().with_loads(&Matrix::identity(6)).unwrap();
    let parameters = parameters.with_gaps(&identity).unwrap();
    let mut found = problem.sensitivity(&x, &parameters).unwrap();
    let mut delta = vec![0.0; 9];
    // The open node's gap closes by 1/8.
    delta[7] = -1.0;
    let range = found.valid_until(&delta, 1.0).unwrap();
    assert!(
        matches!(range, Validity::Exact(s) if (s - 0.125).abs() < 1e-12),
        "{range}"
    );
    // Forces along t reach the limit after 1/8, whatever else they do: sticking nodes stay where they are.
    let mut delta = vec![0.0; 9];
    delta[1] = 1.0;
    let range = found.valid_until(&delta, 1.0).unwrap().until();
    assert!((range - 0.125).abs() < 1e-12, "{range}");
}

/// At a kink pieces are chosen by a member of the family close by, within the horizon: a spring that presses on an obstacle as it gets
/// harder, and then moves away from it.
#[test]
fn families_are_not_asked_beyond_the_horizon() {
    for horizon in [1e-4, 0.5, 8.0] {
        // Stiffness 1 + s, load 1 + 2 s − (9/8) s²/h at distance 1: the force s − (9/8) s²/h vanishes at 0 and 8/9 h.
        let family = |s: f64| {
            assert!((0.0..=horizon).contains(&s), "{s} of {horizon}");
            let a = Matrix::from_rows(&[[1.0 + s, 0.0], [0.0, 1.0]]).unwrap();
            let trace = |row: [f64; 2]| Matrix::from_rows(&[row]).unwrap();
            let load = LoadPath::constant(vec![1.0 + 2.0 * s - 1.125 * s * s / horizon, 0.0]);
            let body = ContactBody::new(a, trace([1.0, 0.0]), vec![trace([0.0, 1.0])], load).unwrap();
            let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.5).unwrap());
            let problem = CondensedContact::new(body.with_gap(vec![1.0]).unwrap(), law).unwrap();
            Ok::<_, ContactError>((problem, vec![0.0]))
        };
        let range = valid_along(family, &[0.0, 0.0], horizon).unwrap();
        let Validity::Followed(until) = range else {
            panic!("{range}");
        };
        assert!((until - horizon * 8.0 / 9.0).abs() < 1e-8 * horizon, "{until}");
    }
}
