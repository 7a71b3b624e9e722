//! Bodies of several disconnected pieces: motions without forces, and loads that nothing balances.

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, FullContact, LoadPath, OrthotropicCoulomb, PlanarCoulomb,
    ReducedBody, ReducedContact, ReducedOptions,
};
use semismooth::fem::{ElasticSystem, Elasticity, Material, Mesh};
use semismooth::linear::LinearError;
use semismooth::sparse::{Matrix, NodalMatrix};

use crate::{block, constant, ground};

/// The free displacements of a system: node and component of each, among nodes with the positions returned.
fn places(system: &ElasticSystem) -> (Vec<[usize; 2]>, Vec<[f64; 3]>) {
    let mut place = vec![[0; 2]; system.num_free()];
    let mut points = Vec::new();
    for node in 0..system.mesh().num_nodes() {
        let own: Vec<_> = (0..3).filter_map(|d| Some((d, system.dof(node, d)?))).collect();
        own.iter().for_each(|(d, k)| place[*k] = [points.len(), *d]);
        if !own.is_empty() {
            points.push(system.mesh().points()[node]);
        }
    }
    (place, points)
}

/// Copies of a body beside one another, each less a multiple of the layer of cells that supports it, and with a multiple added to its
/// diagonal.
fn pieces(system: &ElasticSystem, layer: &ElasticSystem, without: &[f64], more: f64) -> NodalMatrix {
    let n = system.num_free();
    let ((place, points), (lost, lost_points)) = (places(system), places(layer));
    let same = |p: &[f64; 3], q: &[f64; 3]| (0..3).all(|d| (p[d] - q[d]).abs() < 1e-9);
    let unknown: Vec<usize> = lost
        .iter()
        .map(|[node, d]| {
            let at = points.iter().position(|p| same(p, &lost_points[*node])).unwrap();
            place.iter().position(|q| *q == [at, *d]).unwrap()
        })
        .collect();
    let (mut entries, mut unknowns, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for (copy, part) in without.iter().enumerate() {
        let mut add = |i: usize, j: usize, v: f64| entries.push((copy * n + i, copy * n + j, v));
        system.stiffness().triplets().for_each(|(i, j, v)| add(i, j, v));
        (0..n).for_each(|i| add(i, i, more));
        for (i, j, v) in layer.stiffness().triplets() {
            add(unknown[i], unknown[j], -part * v);
        }
        unknowns.extend(place.iter().map(|p| [copy * points.len() + p[0], p[1]]));
        all.extend(points.iter().map(|p| [p[0] + 10.0 * copy as f64, p[1], p[2]]));
    }
    let a = Matrix::from_triplets(without.len() * n, without.len() * n, &entries).unwrap();
    NodalMatrix::new(&a, all, &unknowns, 3).unwrap()
}

/// Floating and partially supported bodies, one of two pieces that floats, and matrices with negative stiffness in smooth motions, although
/// each node by itself resists: reported when the problem is made, before anything is solved, in both forms.
#[test]
fn what_nothing_holds_is_refused() {
    let material = || Material::isotropic(1.0, 0.277).unwrap();
    let system = block([8, 6, 4], material());
    let mesh = Mesh::block([0.0; 3], [0.25, 2.0, 1.0], [1, 6, 4]).unwrap();
    let left = Elasticity::new(mesh, material()).fix("left").assemble().unwrap();
    let make = |system: &ElasticSystem, stiffness: NodalMatrix| {
        let rows = system.contact("bottom", &ground(3)).unwrap();
        let n = stiffness.num_unknowns();
        let wide =
            |t: &Matrix| Matrix::from_triplets(t.nrows(), n, &t.triplets().collect::<Vec<_>>()).unwrap();
        let tangential: Vec<_> = rows.tangential.iter().map(wide).collect();
        let load = LoadPath::constant(vec![0.0; n]);
        let body = ReducedBody::new(stiffness, &wide(&rows.normal), &tangential, load).unwrap();
        let law = || OrthotropicCoulomb::isotropic(constant(0.3));
        let condensed = CondensedContact::new(body.to_contact_body().unwrap(), law());
        let reduced = ReducedContact::new(body, law(), ReducedOptions::default());
        (reduced.err(), condensed.err())
    };
    let held = |without: &[f64], more: f64| make(&system, pieces(&system, &left, without, more));
    assert_eq!(held(&[0.0], 0.0), (None, None));
    assert_eq!(held(&[0.999, 0.5], 0.0), (None, None));
    let indefinite = Some(ContactError::Linear(LinearError::NotPositiveDefinite));
    assert_eq!(held(&[0.0], -0.02), (indefinite.clone(), indefinite.clone()));

    let modes = |found: &Option<ContactError>| match found {
        Some(ContactError::Unsupported {
            displacement,
            at,
            modes,
        }) => (*displacement, *at, modes.clone()),
        other => panic!("{other:?}"),
    };
    let all = "translation along x, translation along y, translation along z, rotation about x, rotation about y, rotation about z";
    let (reduced, condensed) = held(&[1.0], 0.0);
    // What contact and friction may hold is no obstacle to the condensed form.
    assert_eq!((modes(&reduced).2.as_str(), condensed), (all, None));
    // The second of two pieces; the rest of it begins behind the layer.
    let (reduced, condensed) = held(&[0.0, 1.0], 0.0);
    assert_eq!(reduced, condensed);
    let (displacement, at, names) = modes(&reduced);
    assert!(
        displacement >= system.num_free() && at.unwrap()[0] >= 10.0,
        "{at:?}"
    );
    assert_eq!(names, all);
    // A body supported from above only, after the support at one end has been removed.
    let under = |from: f64, cells: usize| {
        let mesh = Mesh::block([from, 0.0, 0.0], [2.0, 2.0, 1.0], [cells, 6, 4]).unwrap();
        let body = Elasticity::new(mesh, material())
            .fix("right")
            .fix_component("top", 2);
        body.assemble().unwrap()
    };
    let (slides, right) = (under(0.0, 8), under(1.75, 1));
    assert_eq!(make(&slides, pieces(&slides, &right, &[0.0], 0.0)), (None, None));
    let (reduced, condensed) = make(&slides, pieces(&slides, &right, &[1.0], 0.0));
    assert_eq!(condensed, None);
    let names = modes(&reduced).2;
    assert_eq!(
        names,
        "translation along x, translation along y, rotation about z"
    );
}

/// Without positions the condensed form names a displacement that moves where contact does not see it: a bar of two springs that floats, alone and beside a supported
/// one, a bar that rotates about its end, and one of negative stiffness, in which nothing moves without forces.
#[test]
fn motions_are_named_without_positions() {
    let refused = |entries: &[(usize, usize, f64)], n: usize| {
        let a = Matrix::from_triplets(n, n, entries).unwrap();
        let row = |k: usize| Matrix::from_triplets(1, n, &[(0, k, 1.0)]).unwrap();
        let load = LoadPath::constant(vec![0.0; n]);
        let body = ContactBody::new(a, row(0), vec![row(1)], load).unwrap();
        CondensedContact::new(body, PlanarCoulomb::new(constant(0.3))).err()
    };
    let unsupported = |displacement: usize, modes: &str| {
        Some(ContactError::Unsupported {
            displacement,
            at: None,
            modes: modes.into(),
        })
    };
    let spring = |i: usize, j: usize, k: f64| [(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)];
    // Two motions of one piece, u₀ + c u₁ = 0 among them: the second node moves further.
    let lever = |k: usize| {
        [
            (k, k, 1.0),
            (k, k + 1, 0.5),
            (k + 1, k, 0.5),
            (k + 1, k + 1, 0.25),
        ]
    };
    let held = [(0, 0, 1.0), (1, 1, 1.0)];
    assert_eq!(
        refused(&[&held[..], &lever(2)].concat(), 4),
        unsupported(2, "a motion in which displacement 3 moves most")
    );
    // What contact sees it may hold.
    assert_eq!(refused(&lever(0), 2), None);
    let beside = [&held[..], &spring(2, 3, 5.0)].concat();
    match refused(&beside, 4) {
        Some(ContactError::Unsupported {
            displacement: 2,
            modes,
            ..
        }) => {
            assert!(modes.starts_with("a motion in which displacement"), "{modes}");
        }
        other => panic!("{other:?}"),
    }
    let loose = [&held[..], &[(2, 2, 0.0)]].concat();
    assert_eq!(
        refused(&loose, 3),
        unsupported(2, "a motion in which displacement 2 moves most")
    );
    let negative = [&held[..], &[(2, 2, 1.0), (3, 3, 1.0), (2, 3, 2.0), (3, 2, 2.0)]].concat();
    assert_eq!(refused(&negative, 4), unsupported(2, ""));
    assert_eq!(
        refused(&[(0, 0, 1.0), (1, 1, 1.0), (0, 1, 2.0), (1, 0, 2.0)], 2),
        Some(ContactError::Linear(LinearError::NotPositiveDefinite))
    );
}

/// A block without supports that is pulled off the ground: nothing balances the load, and its work in that motion is its resultant.
/// Pressed, and pushed against friction, it stays.
#[test]
fn loads_that_nothing_balances_are_reported() {
    let system = block([4, 3, 2], Material::isotropic(1.0, 0.277).unwrap());
    let mesh = Mesh::block([0.0; 3], [0.5, 2.0, 1.0], [1, 3, 2]).unwrap();
    let layer = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap()).fix("left");
    let floating = pieces(&system, &layer.assemble().unwrap(), &[1.0], 0.0);
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = rows.tangential;
    let (place, points) = places(&system);
    let solve = |traction: [f64; 3], friction: f64| {
        // A load that does no work in rotations: the same force on each node.
        let load: Vec<f64> = place.iter().map(|[_, d]| traction[*d]).collect();
        let body = ContactBody::new(
            floating.to_matrix().unwrap(),
            rows.normal.clone(),
            tangential.clone(),
            LoadPath::constant(load),
        );
        let body = body.unwrap().with_nodes(points.clone(), &place).unwrap();
        let law = OrthotropicCoulomb::isotropic(constant(friction));
        FullContact::new(body, law).unwrap().solve(0.0, None)
    };
    let unbalanced = |found: Result<Vec<f64>, ContactError>, component: usize, force: f64| match found {
        Err(ContactError::Unbalanced {
            displacement,
            at,
            work,
            ..
        }) => {
            assert_eq!(place[displacement][1], component);
            assert_eq!(at, Some(points[place[displacement][0]]));
            let total = force * points.len() as f64;
            // Nodes are weighted by their stiffness: the motion is not quite a translation.
            assert!((work - total).abs() <= 1e-3 * total, "{work} {total}");
        }
        other => panic!("{other:?}"),
    };
    unbalanced(solve([0.0, 0.0, 1e-4], 0.3), 2, 1e-4);
    assert!(solve([2e-5, 0.0, -1e-4], 0.3).is_ok());
}

/// Contact carries what supports do not, in the full form: a floating block, pressed on the ground and pulled with less than the friction
/// bound.
#[test]
fn the_full_form_takes_pieces_that_contact_alone_holds() {
    let system = block([4, 3, 2], Material::isotropic(1.0, 0.277).unwrap());
    let mesh = Mesh::block([0.0; 3], [0.5, 2.0, 1.0], [1, 3, 2]).unwrap();
    let layer = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap()).fix("left");
    let floating = pieces(&system, &layer.assemble().unwrap(), &[1.0], 0.0);
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = rows.tangential;
    let press = system.traction("top", |_| [0.0, 0.0, -0.01]).unwrap();
    let pull = system.traction("top", |_| [0.002, 0.0, 0.0]).unwrap();
    let sum = |v: &[f64]| v.iter().sum::<f64>();
    let (weight, drag) = (-sum(&press), sum(&pull));
    let load: Vec<f64> = press.iter().zip(&pull).map(|(a, b)| a + b).collect();
    let body = ContactBody::new(
        floating.to_matrix().unwrap(),
        rows.normal,
        tangential.clone(),
        LoadPath::constant(load),
    );
    let law = OrthotropicCoulomb::isotropic(constant(0.3));
    let problem = FullContact::new(body.unwrap(), law).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    let (n, p) = (system.num_free(), rows.nodes.len());
    let total = |d: usize| x[n + d * p..n + (d + 1) * p].iter().sum::<f64>();
    for (found, expected) in [(total(0), weight), (total(1), drag), (total(2), 0.0)] {
        assert!((found - expected).abs() <= 1e-10 * weight, "{found} {expected}");
    }
}
