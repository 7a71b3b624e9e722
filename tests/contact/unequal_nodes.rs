//! Diagrams of bodies whose branching node moves 10⁴ times less than others: nearly clamped beside soft nodes, or in a tiny cell.

use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{
    Branch, ContinuationOptions, Diagram, DiagramOptions, DiagramSolution, Direction, Termination,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{CellKind, Elasticity, Foundation, Material, Mesh};
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sparse::Matrix;

fn largest_difference(a: &[f64], b: &[f64], sizes: &[f64]) -> f64 {
    let parts = a.iter().zip(b).zip(sizes).map(|((a, b), s)| (a - b).abs() / s);
    parts.fold(0.0, f64::max)
}

/// The largest value of each variable in a list of points, at least 1e-6 of the largest of all: forces of nodes that are open are rounding.
fn sizes<'a>(points: impl Iterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    let mut sizes = Vec::new();
    for x in points {
        sizes.resize(x.len(), 0.0);
        sizes.iter_mut().zip(x).for_each(|(s, v)| *s = v.abs().max(*s));
    }
    let least = 1e-6 * sizes.iter().fold(0.0, |m: f64, s| m.max(*s));
    sizes.iter().map(|s| s.max(least)).collect()
}

/// The diagram from the solutions at nine parameters has, at `count` parameters in the range, the solutions of the list proven there, in
/// the size of each variable; the branch from each end has its folds. Returns the largest number of solutions.
fn diagram_agrees<M: PiecewiseSmooth>(map: &M, range: (f64, f64), count: usize, what: &str) -> usize {
    let list = |alpha: f64| {
        let set = all_solutions(map, alpha, &EnumerationOptions::default()).unwrap();
        assert!(set.completeness.is_complete(), "{what} at {alpha}");
        set.solutions.into_iter().map(|s| s.x).collect::<Vec<_>>()
    };
    let options = DiagramOptions::default().with_parameter_range(range);
    // Some curves are closed, and met by no other.
    let places = (0..=8).map(|k| range.0 + (range.1 - range.0) * f64::from(k) / 8.0);
    let starts: Vec<_> = places.flat_map(list).collect();
    let diagram = Diagram::explore(map, &starts, &options).unwrap();
    let alphas: Vec<f64> = (0..count)
        .map(|k| range.0 + (range.1 - range.0) * (k as f64 + 0.37) / count as f64)
        .collect();
    let lists: Vec<_> = alphas.iter().map(|alpha| list(*alpha)).collect();
    let sizes = sizes(lists.iter().flatten());
    for (alpha, expected) in alphas.iter().zip(&lists) {
        let found = diagram.solutions_at(map, *alpha).unwrap();
        assert_eq!(found.count(), Some(expected.len()), "{what} at {alpha}");
        for x in expected {
            let near = |p: &&DiagramSolution| largest_difference(&p.x, x, &sizes) < 1e-8;
            assert_eq!(found.points.iter().filter(near).count(), 1, "{what} at {alpha}");
        }
    }
    let options = ContinuationOptions::default().with_parameter_range(range);
    let [up, down] =
        [(range.0, Direction::Increasing), (range.1, Direction::Decreasing)].map(|(end, direction)| {
            let starts = list(end);
            assert_eq!(starts.len(), 1, "{what} at {end}");
            let branch = Branch::follow(map, &starts[0], direction, options.clone()).unwrap();
            assert_eq!(branch.termination, Termination::ParameterRange, "{what}");
            let mut folds = branch.folds();
            folds.sort_by(f64::total_cmp);
            folds
        });
    assert_eq!(
        (up.len(), up.len() % 2),
        (down.len(), 0),
        "{what}: {up:?} {down:?}"
    );
    assert!(
        largest_difference(&up, &down, &vec![1.0; up.len()]) < 1e-9,
        "{what}: {up:?} {down:?}"
    );
    lists.iter().map(Vec::len).max().unwrap_or(0)
}

fn coefficient(values: Vec<f64>) -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::nodal(values).unwrap())
}

/// Two nodes with stiffness k [[2, −1], [−1, 2]], k = 1 and 10⁴ (or 10⁶), coupled by a weak spring, pressed by 1 and pushed by α. With F = 3
/// a node alone sticks down to α = −3, where it turns to slip until it opens at −2: three solutions between; with F = 0.3 there is one.
#[test]
fn a_nearly_clamped_node_beside_a_soft_one() {
    for stiff in [1e4, 1e6] {
        for branching in [0, 1] {
            let k = [1.0, stiff];
            let mut entries = Vec::new();
            for (node, k) in k.into_iter().enumerate() {
                for (i, j, v) in [(0, 0, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 2.0)] {
                    entries.push((2 * node + i, 2 * node + j, k * v));
                }
            }
            for d in 0..2 {
                for (i, j, v) in [(0, 0, 0.01), (0, 1, -0.01), (1, 0, -0.01), (1, 1, 0.01)] {
                    entries.push((2 * i + d, 2 * j + d, v));
                }
            }
            let a = Matrix::from_triplets(4, 4, &entries).unwrap();
            let pick = |d: usize| Matrix::from_triplets(2, 4, &[(0, d, 1.0), (1, 2 + d, 1.0)]).unwrap();
            let load = LoadPath::affine(vec![1.0, 0.0, 1.0, 0.0], vec![0.0, 1.0, 0.0, 1.0]);
            let body = ContactBody::new(a, pick(0), vec![pick(1)], load).unwrap();
            let mut friction = vec![0.3; 2];
            friction[branching] = 3.0;
            let law = coefficient(friction);
            let what = format!("node {branching} of {stiff:e}");
            let condensed = CondensedContact::new(body.clone(), law.clone()).unwrap();
            assert_eq!(diagram_agrees(&condensed, (-6.0, 6.0), 100, &what), 3, "{what}");
            if stiff > 1e4 {
                // r is a quarter of the mean stiffness: rounding of r u is 10⁻¹⁰ of the forces of the soft node.
                continue;
            }
            let full = FullContact::new(body, law).unwrap();
            let what = format!("{what}, full");
            assert_eq!(diagram_agrees(&full, (-6.0, 6.0), 25, &what), 3, "{what}");
        }
    }
}

/// A strip of three cells a row, one of them 10⁴ times shorter, or each ten times longer than the one before: areas of contact nodes differ
/// as much, and so do the lengths by which they move.
#[test]
fn a_long_mesh_with_a_tiny_cell() {
    let meshes: [(&str, &[f64], f64); 3] = [
        ("within", &[0.0, 1.0, 1.0001, 2.0], 0.003),
        ("at the end", &[0.0, 1.0, 2.0, 2.0001], 0.003),
        ("graded", &[0.0, 0.01, 0.1, 1.0, 10.0], 0.0),
    ];
    for (what, places, pull) in meshes {
        let heights = [0.0, 0.5, 1.0];
        let n = places.len();
        let points = heights.iter().flat_map(|y| places.iter().map(|x| [*x, *y, 0.0]));
        let cells = (0..2).flat_map(|j| {
            (0..n - 1).map(move |i| {
                let first = j * n + i;
                (
                    CellKind::Quadrilateral,
                    vec![first, first + 1, first + n + 1, first + n],
                )
            })
        });
        let mut mesh = Mesh::new(2, points.collect(), cells).unwrap();
        let end = places[n - 1];
        mesh.mark_boundary("top", |f| f.centre[1] > 1.0 - 1e-9);
        mesh.mark_boundary("bottom", |f| f.centre[1] < 1e-9);
        mesh.mark_boundary("right", |f| f.centre[0] > end - 1e-9);
        let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).fix("top");
        let system = system.assemble().unwrap();
        let traction = |t: [f64; 2]| system.traction("right", |_| [t[0], t[1], 0.0]).unwrap();
        let rows = system
            .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
            .unwrap();
        let load = LoadPath::affine(traction([pull, -0.01]), traction([0.01, 0.005]));
        let tangential = rows.tangential;
        let body = ContactBody::new(system.stiffness().clone(), rows.normal, tangential, load).unwrap();
        let law = coefficient(vec![4.0; rows.gap.len()]);
        let condensed = CondensedContact::new(body.clone(), law.clone()).unwrap();
        let most = diagram_agrees(&condensed, (-4.0, 4.0), 100, what);
        assert!(most >= 3, "{what}");
        let full = FullContact::new(body, law).unwrap();
        assert_eq!(
            diagram_agrees(&full, (-4.0, 4.0), 10, &format!("{what}, full")),
            most
        );
    }
}
