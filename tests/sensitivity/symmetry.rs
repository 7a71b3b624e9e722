//! Half models: as their shapes change within the symmetric class, their derivatives are those of whole bodies.

use std::collections::BTreeMap;

use semismooth::contact::{CondensedContact, FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::sparse::Matrix;

use super::parameters::close;

/// Cells along half the width.
const CELLS: usize = 5;

/// Two velocities of a shape: odd along x, even along y.
const VELOCITIES: [fn([f64; 3]) -> [f64; 3]; 2] = [
    |[x, y, _]| [0.3 * x * (1.0 + y), 0.0, 0.0],
    |[x, y, _]| [0.1 * (3.0 * x).sin() * y, 0.04 * x * x + 0.1 * y * y, 0.0],
];

struct Model {
    system: ElasticSystem,
    rows: ContactRows,
    problem: CondensedContact<PlanarCoulomb>,
}

/// A block with a rounded bottom, pressed down at its top, or its right half; its shape changed by s times the velocities.
fn model(half: bool, s: [f64; 2]) -> Model {
    let (left, cells) = if half { (0.0, CELLS) } else { (-1.0, 2 * CELLS) };
    let old = Mesh::rectangle([left, 0.0], [1.0, 1.0], [cells, 4]).unwrap();
    let moved = |at: &[f64; 3]| {
        let mut at = *at;
        at[1] += 0.06 * at[0] * at[0] * (1.0 - at[1]);
        let from = at;
        for (velocity, s) in VELOCITIES.iter().zip(s) {
            at.iter_mut().zip(velocity(from)).for_each(|(x, v)| *x += s * v);
        }
        at
    };
    let cells = (0..old.num_cells()).map(|c| (old.kind(c), old.cell(c).to_vec()));
    let mut mesh = Mesh::new(2, old.points().iter().map(moved).collect(), cells).unwrap();
    for name in ["left", "top", "bottom"] {
        mesh.add_facet_group(name, old.facet_group(name).unwrap().to_vec())
            .unwrap();
    }
    let mut body = Elasticity::new(mesh, Material::isotropic(1.0, 0.35).unwrap())
        .fix_component("top", 0)
        .prescribe("top", 1, |_| -0.03);
    if half {
        body = body.fix_component("left", 0);
    }
    let system = body.assemble().unwrap();
    let ground = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
    let rows = system.contact("bottom", &ground).unwrap();
    let body = semismooth::contact_body(&system, &rows, LoadPath::constant(system.supports())).unwrap();
    let friction = FrictionCoefficient::constant(0.15).unwrap();
    let problem = CondensedContact::new(body, PlanarCoulomb::new(friction)).unwrap();
    Model {
        system,
        rows,
        problem,
    }
}

impl Model {
    /// Displacements and forces of the nodes with x ≥ 0, forces on the plane of symmetry left out: there half models have half of them.
    fn right(&self, displacements: &[f64], forces: &[f64]) -> Vec<f64> {
        let points = self.system.mesh().points();
        let place = |node: usize| [0, 1].map(|d| (1e6 * points[node][d]).round() as i64);
        // Prescribed displacements do not change.
        let held = vec![0.0; self.system.supports().displacements().len()];
        let u = self.system.displacements(displacements, &held).unwrap();
        let mut found = BTreeMap::new();
        for node in (0..points.len()).filter(|&node| place(node)[0] >= 0) {
            found.extend((0..2).map(|d| ((d, place(node)), u[2 * node + d])));
        }
        let p = self.rows.nodes.len();
        for (i, &node) in self
            .rows
            .nodes
            .iter()
            .enumerate()
            .filter(|(_, node)| place(**node)[0] > 0)
        {
            found.extend((0..2).map(|d| ((2 + d, place(node)), forces[d * p + i])));
        }
        found.into_values().collect()
    }

    /// (u, λ).
    fn solution(&self) -> Vec<f64> {
        let x = self.problem.solve(0.0, None).unwrap();
        self.problem.expand(&x).unwrap()
    }

    /// The derivatives in the shape.
    fn rates(&self) -> [Vec<f64>; 2] {
        let x = self.problem.solve(0.0, None).unwrap();
        let states = self.problem.solution(&x).unwrap();
        assert!(states.stick() > 0 && states.slip() > 0 && states.open() > 0);
        let n = self.problem.num_displacements();
        let full = self.problem.expand(&x).unwrap();
        let u = self
            .system
            .displacements(&full[..n], self.system.supports().displacements())
            .unwrap();
        let forces = self.system.forces_by_position(&u).unwrap();
        let traces = self
            .rows
            .traces_by_position(&self.system, |_| [0.0, 1.0, 0.0])
            .unwrap();
        let product = |m: &Matrix, velocity: fn([f64; 3]) -> [f64; 3]| {
            let points = self.system.mesh().points().iter();
            let v: Vec<f64> = points.flat_map(|at| velocity(*at)[..2].to_vec()).collect();
            let mut column = vec![0.0; m.nrows()];
            m.mul_vec(&v, &mut column);
            column
        };
        let columns = |m: &Matrix| {
            let all = VELOCITIES.map(|v| product(m, v));
            Matrix::from_triplets(m.nrows(), 2, &super::parameters::entries(&all)).unwrap()
        };
        let parameters = self
            .problem
            .parameters()
            .with_body(&columns(&forces), Some(&columns(&traces)));
        let mut found = self.problem.sensitivity(&x, &parameters.unwrap()).unwrap();
        assert_eq!(found.differentiable().unwrap().known(), Some(true));
        [[1.0, 0.0], [0.0, 1.0]].map(|delta| {
            let change = found.jvp(&delta).unwrap();
            self.right(&change.displacements, &change.forces)
        })
    }
}

/// Of one function, the half model and the whole body have the same shape derivatives, which are those of differences.
#[test]
fn half_models_have_the_derivatives_of_whole_bodies() {
    let (half, whole) = (model(true, [0.0; 2]), model(false, [0.0; 2]));
    let [own, other] = [half.rates(), whole.rates()];
    for (k, (own, other)) in own.iter().zip(&other).enumerate() {
        close(own, other, 1e-10, "the whole body");
        let step = 2e-4;
        let at = |s: f64| {
            let mut parameters = [0.0; 2];
            parameters[k] = s * step;
            let full = model(true, parameters).solution();
            let (u, forces) = full[..full.len() - 1].split_at(half.problem.num_displacements());
            half.right(u, forces)
        };
        let (a, b, c, d) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
        let differences: Vec<f64> = (0..own.len())
            .map(|i| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * step))
            .collect();
        close(own, &differences, 1e-7, "differences");
    }
}
