//! Quasi-static equilibria with friction: their rate problem, on one node whose rates are known in closed
//! form.

use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Certainty, ContinuationOptions, arms_at};
use semismooth::parametric;
use semismooth::piecewise::{LocalUniqueness, implicit_function};
use semismooth::sensitivity::{Directional, Sensitivity};
use semismooth::sparse::Matrix;
use semismooth::stability::Dynamics;

/// Stiffness 1 along both axes, coupled by c, pressed by 1 and pushed up to the limit of friction (A.
/// Klarbring 1990): with the load's rate (0, q) the node sticks if q ≤ 0, or slips at a speed v ≥ 0 with (1 −
/// F c) v = q.
fn node(friction: f64, q: f64) -> (CondensedContact<PlanarCoulomb>, [f64; 3]) {
    let (c, identity) = (0.8, [[1.0, 0.0], [0.0, 1.0]]);
    let [normal, tangential] = identity.map(|row| Matrix::from_rows(&[row]).unwrap());
    let stiffness = Matrix::from_rows(&[[1.0, c], [c, 1.0]]).unwrap();
    let load = LoadPath::affine(vec![1.0, friction], vec![0.0, q]);
    let body = ContactBody::new(stiffness, normal, vec![tangential], load).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(friction).unwrap());
    (CondensedContact::new(body, law).unwrap(), [1.0, friction, 0.0])
}

/// Below F = 1/c the rates are one function of the load; above it there are two for a load that falls
/// (sticking, and slip at v = 1/(F c − 1)) and none for one that grows: the equilibrium is lost.
#[test]
fn rates_at_the_limit_of_friction() {
    for (friction, is_unique) in [(0.5, true), (1.2, true), (1.3, false), (2.5, false)] {
        for q in [1.0, -1.0] {
            let (problem, x) = node(friction, q);
            let found = implicit_function(&problem, &x, 1e-12, 100).unwrap();
            assert_eq!(
                matches!(found.verdict, LocalUniqueness::Lipschitz { .. }),
                is_unique,
                "{friction}: {found}"
            );
            let rates = arms_at(&problem, &x, &ContinuationOptions::default()).unwrap();
            assert_eq!(rates.certainty, Certainty::Proven);
            assert_eq!(rates.arms.len(), 2);
            for arm in &rates.arms {
                let falls = q * arm.tangent[2] < 0.0;
                assert!(is_unique || falls, "{friction}, {q}: {arm:?}");
            }
            // The signs of det tell the directions in which equilibria run along the load.
            let signs: Vec<i8> = rates.arms.iter().map(|a| a.det_sign.unwrap()).collect();
            assert_eq!(signs[0] == signs[1], is_unique);
            let mut along = Sensitivity::new(&problem, &x[..2], &x[2..]).unwrap();
            match along.directional(&[-q.signum()]).unwrap() {
                // Sticking: the force follows the load.
                Directional::Derivative(rate) => {
                    assert!(is_unique && rate[0].abs() < 1e-12 && (rate[1] + 1.0).abs() < 1e-12);
                }
                Directional::Branches { branches, .. } => {
                    assert!(!is_unique && branches.len() == 2);
                    // Slip v with the pressure's rate −c v and the friction's −F c v.
                    let v = 1.0 / (friction * 0.8 - 1.0);
                    let slip = [-0.8 * v, -friction * 0.8 * v];
                    let is = |a: &[f64], b: [f64; 2]| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-10;
                    assert!(
                        branches.iter().any(|b| is(b, [0.0, -1.0])) && branches.iter().any(|b| is(b, slip))
                    );
                }
                other => panic!("{other}"),
            }
        }
    }
}

/// Where det has the other sign the slip of a node of mass m grows at the rate √((F c − 1)/m) at constant
/// load: directional instability, which the eigenvalues of m v″ = −(1 − F c) v tell.
#[test]
fn directional_instability() {
    let mass = 0.5;
    for (friction, unstable) in [(0.5, 0), (1.2, 0), (1.3, 1), (2.5, 1)] {
        let stiffness = 1.0 - 0.8 * friction;
        let motion = parametric(2, 1, |y, load| vec![1.0 * y[1], load[0] - stiffness * y[0]]);
        let dynamics = Dynamics::new(&motion).with_mass(vec![1.0, mass]).unwrap();
        let found = dynamics.spectrum(&[0.0; 3]).unwrap();
        assert_eq!(found.unstable, unstable);
        if unstable == 1 {
            assert!((found.eigenvalues[0].0 - (-stiffness / mass).sqrt()).abs() < 1e-14);
        }
        let (problem, x) = node(friction, 1.0);
        let rates = arms_at(&problem, &x, &ContinuationOptions::default()).unwrap();
        let signs: Vec<i8> = rates.arms.iter().map(|a| a.det_sign.unwrap()).collect();
        assert_eq!(signs[0] == signs[1], unstable == 0);
    }
}
