//! One contact problem, all routes to its solution: full form, condensed form, fixed point, Delassus form.

use proptest::prelude::*;
use semismooth::InputError;
use semismooth::contact::{
    Bonded, Cohesive, CondensedContact, ContactBody, ContactError, ContactSolution, DelassusSolver,
    FixedPointOptions, FrictionCoefficient, FrictionCurve, Frictionless, FullContact, GivenBound,
    LimitedShear, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, fixed_point,
};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::newton::Newton;
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::piecewise::check::{CheckOptions, check};

/// A clamped block on the ground under random nodal forces, mostly downwards.
fn random_body(dim: usize, forces: &[f64]) -> (ContactBody, ContactRows, LoadPath) {
    let mesh = if dim == 2 {
        Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [6, 3]).unwrap()
    } else {
        Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [4, 2, 2]).unwrap()
    };
    let system: ElasticSystem = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap())
        .fix("left")
        .assemble()
        .unwrap();
    let mut up = [0.0; 3];
    up[dim - 1] = 1.0;
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], up))
        .unwrap();
    let n = system.num_free();
    let mut load: Vec<f64> = (0..n)
        .map(|i| 1e-2 * forces[i % forces.len()] * (1.0 + (i as f64).sin()))
        .collect();
    for node in 0..system.mesh().num_nodes() {
        if let Some(dof) = system.dof(node, dim - 1) {
            load[dof] -= 0.01;
        }
    }
    let rate: Vec<f64> = (0..n)
        .map(|i| 3e-3 * forces[(7 * i + 1) % forces.len()])
        .collect();
    let gap = (0..rows.nodes.len())
        .map(|i| 2e-3 * forces[i % forces.len()].abs())
        .collect();
    let tangential = rows.tangential.clone();
    let load = LoadPath::affine(load, rate);
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal.clone(),
        tangential,
        load.clone(),
    )
    .unwrap()
    .with_gap(gap)
    .unwrap();
    (body, rows, load)
}

fn constant(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap())
}

/// Two results agree, whatever augmentation parameter each was found with.
fn agree(a: &ContactSolution, b: &ContactSolution, tolerance: f64) {
    let size = |s: &ContactSolution, f: &dyn Fn(&semismooth::contact::LocalValues) -> f64| {
        s.nodes.iter().fold(0.0f64, |m, v| m.max(f(v).abs()))
    };
    let force = size(a, &|v| v.pressure).max(size(a, &|v| v.traction[0]));
    // Where all nodes stick displacements are small because forces cancel: their scale is force over stiffness.
    let length = size(a, &|v| v.penetration)
        .max(size(a, &|v| v.slip[0]))
        .max(force / b.nodes[0].r);
    assert_eq!(a.nodes.len(), b.nodes.len());
    for (i, (v, w)) in a.nodes.iter().zip(&b.nodes).enumerate() {
        assert!(
            (v.pressure - w.pressure).abs() <= tolerance * force,
            "{i}: {v:?} {w:?}"
        );
        assert!(
            (v.penetration - w.penetration).abs() <= tolerance * length,
            "{i}: {v:?} {w:?}"
        );
        for d in 0..2 {
            assert!(
                (v.traction[d] - w.traction[d]).abs() <= tolerance * force,
                "{i}: {v:?} {w:?}"
            );
            assert!(
                (v.slip[d] - w.slip[d]).abs() <= tolerance * length,
                "{i}: {v:?} {w:?}"
            );
        }
    }
    for s in [a, b] {
        assert!(s.residuals.largest() <= tolerance, "{:?}", s.residuals);
        let e = s.energy;
        assert!(
            e.imbalance().abs() <= tolerance * (e.load.abs() + e.stored),
            "{e:?}"
        );
        assert!(e.dissipated >= -tolerance * e.stored);
    }
    let (e, f) = (a.energy, b.energy);
    for (x, y) in [
        (e.stored, f.stored),
        (e.load, f.load),
        (e.normal, f.normal),
        (e.friction, f.friction),
        (e.dissipated, f.dissipated),
    ] {
        assert!(
            (x - y).abs() <= tolerance * (e.load.abs() + e.stored),
            "{e:?} {f:?}"
        );
    }
}

fn same_states(a: &ContactSolution, b: &ContactSolution) {
    assert_eq!(a.states, b.states);
    assert_eq!((a.open(), a.stick(), a.slip()), (b.open(), b.stick(), b.slip()));
    assert_eq!(a.open() + a.stick() + a.slip(), a.nodes.len());
}

/// Full, condensed, Delassus and fixed point; α = 0.7.
fn routes<L: NodeLaw + Clone>(body: &ContactBody, law: &L) -> ContactSolution {
    let full = FullContact::new(body.clone(), law.clone()).unwrap();
    let x = full.solve(0.7, None).unwrap();
    let first = full.solution(&x).unwrap();

    let condensed = CondensedContact::new(body.clone(), law.clone()).unwrap();
    let y = condensed.solve(0.7, None).unwrap();
    let second = condensed.solution(&y).unwrap();
    agree(&first, &second, 1e-10);
    same_states(&first, &second);
    // The point of one form is the solution of the other.
    let n = body.num_displacements();
    let u = condensed.displacements(&y).unwrap();
    let largest = u.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(
        u.iter()
            .zip(&x[..n])
            .all(|(a, b)| (a - b).abs() <= 1e-10 * largest)
    );
    let mut expanded = [u, y.clone()].concat();
    agree(&first, &full.solution(&expanded).unwrap(), 1e-10);
    Newton::default().solve(&full, &mut expanded).unwrap();

    let problem = condensed.delassus(0.7).unwrap();
    let report = DelassusSolver::default().solve(&problem).unwrap();
    assert!(report.is_solved());
    let z = condensed.point_of_reactions(0.7, &report.r).unwrap();
    let third = condensed.solution(&z).unwrap();
    // The solver stops at 1e-12 of the largest of q, r and u, which may be velocities; the checks below are relative to forces.
    let velocities = problem.velocities(&report.r).unwrap();
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let size = norm(problem.q()).max(norm(&report.r)).max(norm(&velocities));
    let force = report.r.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let stop = 1e-11 * (size / force).max(1.0);
    agree(&first, &third, (100.0 * stop).max(1e-9));
    let own = report.solution(&problem).unwrap();
    // The work of random forces may cancel to nothing; what is stored does not.
    let work = first.energy.load.abs() + first.energy.stored;
    assert!(
        own.residuals.largest() < stop && own.energy.imbalance().abs() < stop * work.max(own.energy.stored),
        "{:?} {:?} {stop:e}",
        own.energy,
        own.residuals
    );
    assert_eq!(
        (own.open(), own.stick(), own.slip()),
        (first.open(), first.stick(), first.slip())
    );

    let fixed = fixed_point(&condensed, &y, &FixedPointOptions::default()).unwrap();
    let stick = condensed.stick_start(0.7).unwrap();
    let again = fixed_point(&condensed, &stick, &FixedPointOptions::default()).unwrap();
    for report in [fixed, again] {
        assert!(report.converged);
        agree(&first, &condensed.solution(&report.x).unwrap(), 1e-9);
    }
    first
}

fn forces() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0f64, 23)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn plane(forces in forces(), f in 0.05..0.4f64) {
        let (body, rows, load) = random_body(2, &forces);
        let solution = routes(&body, &PlanarCoulomb::new(constant(f)));
        // The planar problem with F by the parameter, both forms.
        let problem = FullContact::planar(
            body.stiffness().clone(), rows.normal, rows.tangential[0].clone(), load, FrictionCoefficient::nodal(vec![f; solution.nodes.len()]).unwrap(),
        ).unwrap().with_gap(solution.nodes.iter().enumerate().map(|(i, _)| 2e-3 * forces[i % forces.len()].abs()).collect()).unwrap();
        let x = problem.solve(0.7, None).unwrap();
        agree(&solution, &problem.solution(&x).unwrap(), 1e-10);
        let condensed = problem.condensed().unwrap();
        let y = condensed.solve(0.7, Some(&condensed.stick_start(0.7).unwrap())).unwrap();
        agree(&solution, &condensed.solution(&y).unwrap(), 1e-10);
        routes(&body, &Frictionless::plane());
    }

    #[test]
    fn space(forces in forces(), f in 0.05..0.3f64, ratio in 0.5..1.0f64) {
        let (body, _, _) = random_body(3, &forces);
        routes(&body, &OrthotropicCoulomb::isotropic(constant(f)));
        routes(&body, &OrthotropicCoulomb::new(constant(f), constant(ratio * f)));
        routes(&body, &Frictionless::space());
    }

    /// Laws without a Delassus form: full = condensed. Under slip weakening solutions need not be unique: the two forms may find different
    /// ones, but a solution of one form is a solution of the other.
    #[test]
    fn other_laws(forces in forces(), f in 0.05..0.3f64) {
        fn both<L: NodeLaw + Clone>(body: &ContactBody, law: &L, unique: bool) {
            let full = FullContact::new(body.clone(), law.clone()).unwrap();
            let condensed = CondensedContact::new(body.clone(), law.clone()).unwrap();
            let x = full.solve(0.7, None).unwrap();
            let y = condensed.solve(0.7, None).unwrap();
            let expanded = [condensed.displacements(&y).unwrap(), y.clone()].concat();
            for (x, y) in [(&x, &full.restrict(&x).unwrap()), (&expanded, &y)] {
                let (x, y) = (full.solution(x).unwrap(), condensed.solution(y).unwrap());
                agree(&x, &y, 1e-10);
                same_states(&x, &y);
            }
            if unique {
                let (x, y) = (full.solution(&x).unwrap(), condensed.solution(&y).unwrap());
                agree(&x, &y, 1e-10);
                same_states(&x, &y);
            }
        }
        let weakening = FrictionCoefficient::uniform(FrictionCurve::exponential(f, 0.5 * f, 0.05).unwrap());
        for dim in [2, 3] {
            let (body, rows, _) = random_body(dim, &forces);
            let p = rows.nodes.len();
            let bounds = (0..p).map(|i| 1e-2 * forces[i % forces.len()].abs()).collect();
            both(&body, &GivenBound::new(dim - 1, bounds, vec![[f, 0.7 * f]; p]).unwrap(), true);
            both(&body, &LimitedShear::new(dim - 1, vec![f; p], vec![1e-3 * f; p]).unwrap(), true);
            let tension: Vec<f64> = (0..p).map(|i| 2e-3 * (1.0 + forces[i % forces.len()])).collect();
            let soft = body.clone().with_compliance(&vec![2.0; p], &vec![5.0; p]).unwrap();
            if dim == 2 {
                both(&body, &Cohesive::new(PlanarCoulomb::new(constant(f)), tension).unwrap(), true);
                both(&soft, &PlanarCoulomb::new(constant(f)), true);
                both(&body, &Bonded::plane(), true);
                both(&soft, &Bonded::plane(), true);
            } else {
                both(&body, &Cohesive::new(OrthotropicCoulomb::isotropic(constant(f)), tension).unwrap(), true);
                both(&soft, &OrthotropicCoulomb::new(constant(f), constant(0.8 * f)), true);
                both(&soft, &Bonded::space(), true);
            }
            if dim == 2 {
                both(&body, &PlanarCoulomb::new(weakening.clone()), false);
            } else {
                both(&body, &OrthotropicCoulomb::new(weakening.clone(), weakening.times(0.8)), false);
            }
        }
    }
}

/// The full map obeys the contract of piecewise-smooth maps: derivatives, cells, continuity.
#[test]
fn full_map_is_piecewise_smooth() {
    let forces: Vec<f64> = (0..23).map(|i| (1.7 * f64::from(i)).sin()).collect();
    let (body, _, _) = random_body(3, &forces);
    let law = OrthotropicCoulomb::new(constant(0.3), constant(0.2));
    let map = FullContact::new(body, law).unwrap();
    let sample = |k: usize| {
        (0..map.num_vars())
            .map(|i| 0.1 * ((0.7 + 0.1 * k as f64) * i as f64).cos())
            .collect()
    };
    let samples: Vec<Vec<f64>> = (0..3).map(sample).collect();
    let report = check(&map, &samples, &CheckOptions::default()).unwrap();
    assert_eq!(report.points, 3);
    assert!(report.boundaries > 0);
}

#[test]
fn misuse_is_named() {
    let (body, _, _) = random_body(2, &[0.3, -0.2]);
    assert!(matches!(
        FullContact::new(body.clone(), Frictionless::space()),
        Err(ContactError::Tangents { law: 2, body: 1 })
    ));
    let tresca = GivenBound::new(1, vec![0.1; 6], vec![[0.3; 2]; 6]).unwrap();
    let condensed = CondensedContact::new(body.clone(), tresca).unwrap();
    assert_eq!(condensed.delassus(0.0).unwrap_err(), ContactError::NotCoulomb);
    let full = FullContact::new(body, PlanarCoulomb::new(constant(0.2))).unwrap();
    assert!(matches!(
        full.solve(f64::NAN, None),
        Err(ContactError::Input(InputError::NotFinite { .. }))
    ));
    assert!(matches!(
        full.solve(0.0, Some(&[0.0; 3])),
        Err(ContactError::Input(InputError::Length { found: 3, .. }))
    ));
    assert!(matches!(
        full.clone().with_r(-1.0),
        Err(ContactError::Augmentation { .. })
    ));
    assert!(full.solution(&[0.0; 2]).is_err());
}
