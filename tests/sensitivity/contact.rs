//! Contact with friction: derivatives in the load parameter, in loads and in the coefficient of friction.

use semismooth::contact::{
    CondensedContact, ContactBody, ContactState, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::piecewise::{PiecewiseSmooth, select};
use semismooth::sensitivity::{Loaded, Sensitivity};
use semismooth::sparse::Matrix;

use super::dot;
use super::random::Random;

/// The body under a load of the nodes.
type Loading = Box<dyn Fn(&[f64]) -> ContactBody>;

/// A block held at its left side, pressed down and pushed to the right; the load is `constant` plus α times
/// the push.
struct Block {
    body: Loading,
    /// Pressure on the top, and a traction along it.
    pressure: Vec<f64>,
    push: Vec<f64>,
}

fn block() -> Block {
    let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [8, 4]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .fix("left")
        .assemble()
        .unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let pressure = system.traction("top", |_| [0.0, -0.02, 0.0]).unwrap();
    let push = system.traction("top", |_| [0.02, 0.0, 0.0]).unwrap();
    let slope = push.clone();
    Block {
        body: Box::new(move |constant: &[f64]| {
            let load = LoadPath::affine(constant.to_vec(), slope.clone());
            semismooth::contact_body(&system, &rows, load).unwrap()
        }),
        pressure,
        push,
    }
}

/// F = 0.3 + 0.1 α at each node.
fn law(slope: f64, p: usize) -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::affine(vec![0.3; p], vec![slope; p]).unwrap())
}

/// Displacements and forces of the solution in the full form, α behind them.
fn solved(body: ContactBody, slope: f64, alpha: f64) -> (FullContact<PlanarCoulomb>, Vec<f64>) {
    let p = body.num_contacts();
    let full = FullContact::new(body, law(slope, p)).unwrap();
    let x = full.solve(alpha, None).unwrap();
    (full, x)
}

/// Derivatives in α, which changes load and friction, and in two loads are those of differences; the
/// condensed form has the same ones; the adjoint is exact.
#[test]
fn derivatives_in_loads_and_friction_are_differences() {
    let (block, alpha) = (block(), 0.5);
    let (full, x) = solved((block.body)(&block.pressure), 0.1, alpha);
    let n = full.num_residuals();
    let states = full.states(&select(&full, &x));
    let sliding = |s: &ContactState| matches!(s, ContactState::SlipMinus | ContactState::SlipPlus);
    assert!(
        states.iter().any(sliding) && states.contains(&ContactState::Stick),
        "{states:?}"
    );

    let loads = [&block.pressure, &block.push];
    let entries: Vec<_> = (loads.iter().enumerate())
        .flat_map(|(j, load)| load.iter().enumerate().map(move |(i, f)| (i, j, -f)))
        .collect();
    let columns = Matrix::from_triplets(n, 2, &entries).unwrap();
    let map = Loaded::new(&full, columns).unwrap();
    let mut found = Sensitivity::new(map, &x[..n], &[alpha, 0.0, 0.0]).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(true));

    let step = 1e-5;
    let at = |d: [f64; 3], s: f64| {
        let constant: Vec<f64> = (block.pressure.iter().zip(&block.push))
            .map(|(p, q)| p + s * (d[1] * p + d[2] * q))
            .collect();
        solved((block.body)(&constant), 0.1, alpha + s * d[0]).1
    };
    for d in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -0.2, 1.0]] {
        let rate = found.jvp(&d).unwrap();
        let (ahead, behind) = (at(d, step), at(d, -step));
        for i in 0..n {
            let difference = (ahead[i] - behind[i]) / (2.0 * step);
            assert!(
                (rate[i] - difference).abs() < 1e-7,
                "{i}: {} {difference}",
                rate[i]
            );
        }
    }
    let random = &mut Random::new(1);
    let (w, delta) = (random.vector(n, 1.0), random.vector(3, 1.0));
    let forward = dot(&found.jvp(&delta).unwrap(), &w);
    let adjoint = dot(&found.vjp(&w).unwrap(), &delta);
    assert!((forward - adjoint).abs() < 1e-11 * forward.abs().max(1.0));

    let condensed = CondensedContact::new((block.body)(&block.pressure), law(0.1, states.len())).unwrap();
    let y = condensed.solve(alpha, None).unwrap();
    let m = condensed.num_residuals();
    let own = Sensitivity::new(&condensed, &y[..m], &[alpha])
        .unwrap()
        .jvp(&[1.0])
        .unwrap();
    let rate = found.jvp(&[1.0, 0.0, 0.0]).unwrap();
    for (a, b) in own.iter().zip(&rate[n - m..]) {
        assert!((a - b).abs() < 1e-11);
    }
}

/// Where a node begins to slip the forces have two one-sided derivatives: the slopes of the branch on both
/// sides.
#[test]
fn transitions_have_the_slopes_of_both_sides() {
    let block = block();
    let body = (block.body)(&block.pressure);
    let p = body.num_contacts();
    let map = CondensedContact::new(body, law(0.0, p)).unwrap();
    let start = map.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &start, Direction::Increasing, options).unwrap();
    let m = map.num_residuals();
    let mut passed = 0;
    for (k, transition) in branch.transitions.iter().enumerate() {
        if transition.kind != TransitionKind::PassThrough || transition.sites.len() != 1 {
            continue;
        }
        let at = transition.parameter();
        let mut found = Sensitivity::new(&map, &transition.x[..m], &[at]).unwrap();
        assert_eq!(
            found.differentiable().unwrap().known(),
            Some(false),
            "transition {k}"
        );
        // Between transitions the branch is straight.
        let ends = |ahead: bool| {
            let all = branch.transitions.iter().map(|t| &t.x).chain([&start]);
            let distance = |x: &&Vec<f64>| if ahead { x[m] - at } else { at - x[m] };
            all.filter(|x| distance(x) > 1e-6)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        };
        for (sign, ahead) in [(1.0, true), (-1.0, false)] {
            let Some(end) = ends(ahead) else {
                continue;
            };
            passed += 1;
            let rate = found.jvp(&[sign]).unwrap();
            for i in 0..m {
                let slope = sign * (end[i] - transition.x[i]) / (end[m] - at);
                assert!(
                    (rate[i] - slope).abs() < 1e-7,
                    "transition {k}: {} {slope}",
                    rate[i]
                );
            }
            let until = found.valid_until(&[sign], 1.0).unwrap().until();
            assert!(
                (until - (end[m] - at).abs()).abs() < 1e-7 || end == &start,
                "{until}"
            );
        }
    }
    assert!(passed >= 4, "{passed}");
}
