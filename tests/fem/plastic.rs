//! Von Mises plasticity: the law against its variational principle, the tangent against differences, bodies against exact states.

use semismooth::fem::{CellKind, Elasticity, Mesh, PlasticBody, PlasticState, VonMises};
use semismooth::piecewise::Semismooth;
use semismooth::piecewise::check::{CheckOptions, check_semismooth};
use semismooth::sparse::Matrix;

use super::all_meshes;

/// Reproducible numbers in [−1, 1).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

fn law() -> VonMises {
    let law = VonMises::new(2.6, 0.3, 0.1).unwrap();
    law.with_hardening(0.2, 0.3).unwrap()
}

/// The incremental functional of a step to `strain` with the plastic increment `flow`: stored energy plus dissipation.
fn cost(law: &VonMises, strain: &[f64; 6], before: &PlasticState, flow: &[f64; 6]) -> f64 {
    let square: f64 = (0..6)
        .map(|a| flow[a] * flow[a] * if a < 3 { 1.0 } else { 0.5 })
        .sum();
    let mut after = *before;
    (0..6).for_each(|a| after.strain[a] += flow[a]);
    let grows = (2.0 / 3.0 * square).sqrt();
    after.accumulated += grows;
    law.energies(strain, &after).iter().sum::<f64>() + law.yield_stress() * grows
}

/// A random path through several states; calls `see` with each strain and the state before it.
fn path(mut see: impl FnMut(&mut Numbers, &[f64; 6], &PlasticState)) {
    let mut numbers = Numbers(1);
    for _ in 0..40 {
        let mut state = PlasticState::default();
        for _ in 0..5 {
            let strain: [f64; 6] = std::array::from_fn(|_| 0.1 * numbers.next());
            see(&mut numbers, &strain, &state);
            state = law().respond(&strain, &state).state;
        }
    }
}

/// A step minimises stored energy plus dissipation (M. Ortiz, L. Stainier, Comput. Methods Appl. Mech. Eng. 171 (1999)), and its stress is
/// the derivative of the minimum.
#[test]
fn steps_are_minima() {
    let law = law();
    let mut yielding = 0;
    path(|numbers, strain, before| {
        let answer = law.respond(strain, before);
        let flow = std::array::from_fn(|a| answer.state.strain[a] - before.strain[a]);
        assert!((flow[0] + flow[1] + flow[2]).abs() < 1e-15);
        let least = cost(&law, strain, before, &flow);
        let found = law.energies(strain, &answer.state).iter().sum::<f64>()
            + law.yield_stress() * (answer.state.accumulated - before.accumulated);
        assert!(
            (least - found).abs() < 1e-15,
            "accumulated is the length of the flow"
        );
        yielding += usize::from(flow != [0.0; 6]);
        for size in [1e-1, 1e-2, 1e-3] {
            let mut other: [f64; 6] = std::array::from_fn(|a| flow[a] + size * numbers.next());
            let trace = (other[0] + other[1] + other[2]) / 3.0;
            (0..3).for_each(|a| other[a] -= trace);
            assert!(cost(&law, strain, before, &other) > least);
        }
        for a in 0..6 {
            let h = 1e-5;
            let at = |h: f64| {
                let mut moved = *strain;
                moved[a] += h;
                let state = law.respond(&moved, before).state;
                let flow = std::array::from_fn(|a| state.strain[a] - before.strain[a]);
                cost(&law, &moved, before, &flow)
            };
            // Energies of 0.1, less where the yield surface lies within h.
            let slope = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (slope - answer.stress[a]).abs() < 1e-8,
                "{slope} {}",
                answer.stress[a]
            );
        }
    });
    assert!(yielding > 100);
}

/// A body of each kind of cell with a random history.
fn histories() -> Vec<(PlasticBody, Vec<f64>)> {
    let mut numbers = Numbers(7);
    let mut all = Vec::new();
    for mut mesh in all_meshes() {
        let axis = mesh.dim() - 1;
        mesh.mark_boundary("held", |f| f.normal[axis] < -0.5);
        let supported = Elasticity::new(mesh, law().elastic().clone()).fix("held");
        let mut body = PlasticBody::new(&supported, law()).unwrap();
        let mut x = vec![0.0; body.system().num_free()];
        for _ in 0..3 {
            x = x.iter().map(|_| 0.05 * numbers.next()).collect();
            body.commit(&x).unwrap();
        }
        let x = x.iter().map(|x| x + 0.05 * numbers.next()).collect();
        all.push((body, x));
    }
    all
}

fn jacobian(body: &PlasticBody, x: &[f64]) -> Matrix {
    let mut jac = Matrix::zeros(body.pattern());
    body.jacobian(x, &mut jac);
    jac
}

#[test]
fn tangents_are_newton_derivatives() {
    for (body, x) in histories().into_iter().take(2) {
        check_semismooth(&body, &[x], &CheckOptions::default()).unwrap();
    }
    // In space with fewer directions.
    let mut numbers = Numbers(3);
    for (body, x) in histories().into_iter().skip(2) {
        let (jac, n) = (jacobian(&body, &x), x.len());
        let d: Vec<f64> = (0..n).map(|_| numbers.next()).collect();
        let at = |h: f64| {
            let moved: Vec<f64> = x.iter().zip(&d).map(|(x, d)| x + h * d).collect();
            let mut r = vec![0.0; n];
            body.residual(&moved, &mut r);
            r
        };
        let (up, down, mut product) = (at(1e-7), at(-1e-7), vec![0.0; n]);
        jac.mul_vec(&d, &mut product);
        for i in 0..n {
            let quotient = (up[i] - down[i]) / 2e-7;
            assert!((quotient - product[i]).abs() < 1e-6, "{quotient} {}", product[i]);
        }
    }
}

/// The work of the load that keeps each step in equilibrium is stored, dissipated, or the energy of the increment.
#[test]
fn energy_is_balanced() {
    for (mut body, _) in histories() {
        let n = body.system().num_free();
        let (mut numbers, mut stored, mut x) = (Numbers(5), None::<f64>, vec![0.0; n]);
        for _ in 0..4 {
            let next: Vec<f64> = x.iter().map(|x| x + 0.02 * numbers.next()).collect();
            let mut force = vec![0.0; n];
            body.residual(&next, &mut force);
            let work: f64 = (0..n).map(|k| force[k] * (next[k] - x[k])).sum();
            let e = body.commit(&next).unwrap();
            let now = e.elastic + e.hardening;
            if let Some(stored) = stored {
                assert!((work - (now - stored + e.dissipated + e.increment)).abs() < 1e-13 * now.max(1.0));
                assert!(e.dissipated > 0.0);
            }
            (stored, x) = (Some(now), next);
        }
    }
}

/// Before yielding a body is the elastic one where the dilatation is no mean, and displaced supports give the forces of their load case.
#[test]
fn bodies_are_elastic_before_they_yield() {
    let is_mean = |m: &Mesh| matches!(m.kind(0), CellKind::Quadrilateral | CellKind::Hexahedron);
    for mut mesh in all_meshes().into_iter().filter(|m| !is_mean(m)) {
        let axis = mesh.dim() - 1;
        mesh.mark_boundary("held", |f| f.normal[axis] < -0.5);
        let supported = Elasticity::new(mesh, law().elastic().clone()).fix("held");
        let mut body = PlasticBody::new(&supported, law()).unwrap();
        let x = vec![0.0; body.system().num_free()];
        let (ours, theirs) = (jacobian(&body, &x), body.system().stiffness().clone());
        for (a, b) in ours.values().iter().zip(theirs.values()) {
            assert!((a - b).abs() < 1e-13);
        }
        let moved = body.system().motion("held", 0, |p| 1e-3 * p[1]).unwrap();
        body.set_supports(moved.displacements()).unwrap();
        let mut force = x.clone();
        body.residual(&x, &mut force);
        for (a, b) in force.iter().zip(moved.forces()) {
            assert!((a + b).abs() < 1e-15);
        }
    }
}

/// Affine displacements of the whole boundary give the stress of a single material point everywhere, in any mesh, also after the first
/// step.
#[test]
fn affine_motions_yield_evenly() {
    for mesh in all_meshes() {
        let dim = mesh.dim();
        let mut supported = Elasticity::new(mesh, law().elastic().clone());
        for d in 0..dim {
            supported = supported.prescribe("all", d, |_| 0.0);
        }
        let mut body = PlasticBody::new(&supported, law()).unwrap();
        let points = body.system().mesh().points().to_vec();
        let mut state = PlasticState::default();
        for step in [1.0, -0.4] {
            // Gradient of the displacement.
            let g = [[0.1, 0.05, 0.02], [-0.02, -0.08, 0.01], [0.03, 0.0, 0.04]].map(|r| r.map(|g| step * g));
            let at = |p: &[f64; 3]| {
                (0..dim)
                    .map(|d| (0..dim).map(|e| g[d][e] * p[e]).sum::<f64>())
                    .collect()
            };
            let all: Vec<f64> = points.iter().flat_map::<Vec<f64>, _>(at).collect();
            let mut x = vec![0.0; body.system().num_free()];
            for k in 0..points.len() {
                for d in 0..dim {
                    if let Some(free) = body.system().dof(k, d) {
                        x[free] = all[dim * k + d];
                    }
                }
            }
            let mut strain = [0.0; 6];
            for (s, [i, j]) in [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [0, 2]]
                .into_iter()
                .enumerate()
            {
                if i < dim && j < dim {
                    strain[s] = if i == j { g[i][i] } else { g[i][j] + g[j][i] };
                }
            }
            body.set_supports(&all).unwrap();
            let mut force = x.clone();
            body.residual(&x, &mut force);
            assert!(force.iter().all(|f| f.abs() < 1e-14), "{force:?}");
            let answer = law().respond(&strain, &state);
            assert!(answer.state.accumulated > state.accumulated);
            for stress in body.stresses(&x).unwrap() {
                assert!((0..6).all(|a| (stress[a] - answer.stress[a]).abs() < 1e-14));
            }
            body.commit(&x).unwrap();
            state = answer.state;
            let cells = 0..body.system().mesh().num_cells();
            for found in cells.flat_map(|c| body.states(c)) {
                assert!((found.accumulated - state.accumulated).abs() < 1e-14);
            }
        }
    }
}

/// A box whose mean volume is fixed resists with its shear modulus alone, however nearly incompressible it is.
#[test]
fn boxes_do_not_lock() {
    let bent = |poisson: f64| {
        let mut meshes = [
            Mesh::rectangle([-1.0; 2], [1.0; 2], [1, 1]).unwrap(),
            Mesh::block([-1.0; 3], [1.0; 3], [1, 1, 1]).unwrap(),
        ];
        meshes.each_mut().map(|mesh| {
            let law = VonMises::new(2.0 * (1.0 + poisson), poisson, 1.0).unwrap();
            let dim = mesh.dim();
            mesh.mark_boundary("all", |_| true);
            mesh.add_facet_group("side", vec![mesh.boundary()[0].nodes.clone()])
                .unwrap();
            let supported = Elasticity::new(mesh.clone(), law.elastic().clone()).fix("side");
            let mut body = PlasticBody::new(&supported, law).unwrap();
            let mode = |p: &[f64; 3]| {
                let mut u = vec![0.0; dim];
                u[0] = 1e-3 * p[0] * p[1];
                u
            };
            let all: Vec<f64> = mesh.points().iter().flat_map(mode).collect();
            let mut x = vec![0.0; body.system().num_free()];
            for k in 0..mesh.num_nodes() {
                for d in 0..dim {
                    if let Some(free) = body.system().dof(k, d) {
                        x[free] = all[dim * k + d];
                    }
                }
            }
            body.set_supports(&all).unwrap();
            body.commit(&x).unwrap().elastic
        })
    };
    for (soft, stiff) in bent(0.0).into_iter().zip(bent(0.499_999)) {
        assert!((stiff / soft - 1.0).abs() < 1e-9, "{soft} {stiff}");
    }
}
