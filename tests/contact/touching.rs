//! Bodies that touch the ground without load: all nodes are at the apex of the law, and the curve that leaves needs one arm, not all.

use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};

/// A block held at its top, on the ground without a gap, under α times a traction on its right side.
fn block<L: NodeLaw>(mesh: Mesh, law: L) -> CondensedContact<L> {
    let mut up = [0.0; 3];
    up[mesh.dim() - 1] = 1.0;
    let system = Elasticity::new(mesh, Material::isotropic(210.0, 0.3).unwrap())
        .fix("top")
        .assemble()
        .unwrap();
    let push = system.traction("right", |_| [5.0, 0.0, 0.0]).unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], up))
        .unwrap();
    let tangential = rows.tangential;
    let load = LoadPath::affine(vec![0.0; push.len()], push);
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, tangential, load).unwrap();
    CondensedContact::new(body.with_gap(rows.gap).unwrap(), law).unwrap()
}

/// Coulomb's law is a cone: without a gap the solutions are α times that at α = 1, in the plane and in space, and the curve from the
/// unloaded body leads to it.
fn follows_the_ray<L: NodeLaw>(map: &CondensedContact<L>) {
    let q = map.num_traces();
    let start = vec![0.0; q + 1];
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    for (direction, end) in [(Direction::Increasing, 1.0), (Direction::Decreasing, -1.0)] {
        let branch = Branch::follow(map, &start, direction, options.clone()).unwrap();
        assert_eq!(branch.termination, Termination::ParameterRange);
        assert!(branch.transitions.is_empty());
        let last = branch.points.last().unwrap();
        assert_eq!(last.parameter(), end);
        let direct = map.solve(end, None).unwrap();
        let size = direct[..q].iter().fold(0.0f64, |a, v| a.max(v.abs()));
        let apart = direct.iter().zip(&last.x).map(|(a, b)| (a - b).abs());
        assert!(size > 0.01 && apart.fold(0.0, f64::max) < 1e-9 * size);
        for point in &branch.points {
            let ray = last.x.iter().map(|v| v * point.parameter().abs());
            let apart = ray.zip(&point.x).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-8 * size, "{}", point.parameter());
        }
    }
}

fn friction(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::constant(f).unwrap()
}

#[test]
fn an_unloaded_block_on_the_ground_is_followed_in_the_plane() {
    for n in [4, 24, 48] {
        let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [n, n / 2]).unwrap();
        follows_the_ray(&block(mesh, PlanarCoulomb::new(friction(0.5))));
    }
}

#[test]
fn an_unloaded_block_on_the_ground_is_followed_in_space() {
    for (n, f) in [(2, 0.5), (4, 0.5), (4, 0.0625)] {
        let mesh = Mesh::block([0.0; 3], [1.0; 3], [n, n, 1]).unwrap();
        follows_the_ray(&block(mesh, OrthotropicCoulomb::isotropic(friction(f))));
    }
}
