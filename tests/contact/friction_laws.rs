//! Laws of friction at one node: derivatives of every piece, projections, one-node problems with known solutions.

use crate::maps::same_mechanics;
use proptest::prelude::*;
use semismooth::contact::{
    Bonded, Cohesive, CondensedContact, ContactBody, ContactState, FrictionCoefficient, FrictionCurve,
    Frictionless, FullContact, GivenBound, LimitedShear, LoadPath, LocalRow, LocalValues, MAX_TESTS, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::sparse::Matrix;
use serde_json::Value;

fn curve() -> FrictionCurve {
    FrictionCurve::function(|s| {
        let d = 0.3 * (-s * s / 4.0).exp();
        (0.1 + d, -s / 2.0 * d)
    })
}

fn set(v: &LocalValues, k: usize, step: f64) -> LocalValues {
    let mut v = *v;
    match k {
        0 => v.penetration += step,
        1 | 2 => v.slip[k - 1] += step,
        3 => v.pressure += step,
        4 | 5 => v.traction[k - 4] += step,
        _ => v.parameter += step,
    }
    v
}

fn entry(row: &LocalRow, k: usize) -> f64 {
    match k {
        0 => row.penetration,
        1 | 2 => row.slip[k - 1],
        3 => row.pressure,
        4 | 5 => row.traction[k - 4],
        _ => row.parameter,
    }
}

/// The derivative at 0 by central differences, extrapolated to fourth order where the function is smooth. The continuation of friction
/// coefficients to negative slip is only C¹: a step across 0 leaves an error of first order in h.
fn derivative(f: impl Fn(f64) -> f64) -> f64 {
    let central = |h: f64| (f(h) - f(-h)) / (2.0 * h);
    let h = 1e-6;
    (4.0 * central(0.5 * h) - central(h)) / 3.0
}

/// Rows against differences, for every piece and test function.
fn check_rows<L: NodeLaw>(law: &L, v: &LocalValues) {
    let columns: &[usize] = if law.num_tangents() == 1 {
        &[0, 1, 3, 4, 6]
    } else {
        &[0, 1, 2, 3, 4, 5, 6]
    };
    let mut rows = [LocalRow::default(); MAX_TESTS];
    law.test_rows(v, &mut rows);
    for &k in columns {
        for piece in 0..law.num_pieces() {
            let exact = law.rows(piece, v);
            for d in 0..=law.num_tangents() {
                let difference = derivative(|h| law.residual(piece, &set(v, k, h))[d]);
                let found = entry(&exact[d], k);
                assert!(
                    (found - difference).abs() <= 1e-6 * (1.0 + found.abs()),
                    "{} {d} {k}: {found} {difference}",
                    law.piece_name(piece)
                );
            }
        }
        for t in 0..law.num_tests() {
            let difference = derivative(|h| {
                let mut tests = [0.0; MAX_TESTS];
                law.tests(&set(v, k, h), &mut tests);
                tests[t]
            });
            assert!(
                (entry(&rows[t], k) - difference).abs() <= 1e-6 * (1.0 + difference.abs()),
                "test {t} {k}"
            );
        }
    }
}

fn values() -> impl Strategy<Value = LocalValues> {
    let x = || -2.0..2.0f64;
    let away = || prop_oneof![-2.0..-0.1f64, 0.1..2.0f64];
    (
        x(),
        away(),
        away(),
        0.1..3.0f64,
        x(),
        x(),
        0.5..2.0f64,
        0.3..3.0f64,
    )
        .prop_map(|(penetration, s1, s2, pressure, t1, t2, parameter, r)| {
            let mut v = LocalValues::default();
            v.penetration = penetration;
            v.slip = [s1, s2];
            v.pressure = pressure;
            v.traction = [t1, t2];
            v.parameter = parameter;
            v.r = r;
            v
        })
}

/// The Euclidean projection onto the ellipse (z₁/a)² + (z₂/b)² ≤ 1, by bisection of its secular equation.
fn project_ellipse(z: [f64; 2], axes: [f64; 2]) -> [f64; 2] {
    let at = |t: f64| [0, 1].map(|d| axes[d] * axes[d] * z[d] / (axes[d] * axes[d] + t));
    let level = |p: [f64; 2]| (p[0] / axes[0]).powi(2) + (p[1] / axes[1]).powi(2) - 1.0;
    if level(z) <= 0.0 {
        return z;
    }
    let (mut low, mut high) = (0.0, 1.0);
    while level(at(high)) > 0.0 {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if level(at(middle)) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    at(low)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn rows_are_derivatives(v in values()) {
        let scaled = FrictionCoefficient::scaled(curve());
        check_rows(&OrthotropicCoulomb::new(scaled.clone(), scaled.times(0.6)), &v);
        check_rows(&OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(curve())), &v);
        let hardening = FrictionCurve::exponential(0.2, 0.5, 2.0).unwrap();
        check_rows(&OrthotropicCoulomb::new(scaled.clone(), FrictionCoefficient::uniform(hardening)), &v);
        check_rows(&GivenBound::new(2, vec![0.7], vec![[0.4, 0.9]]).unwrap(), &v);
        check_rows(&Frictionless::space(), &v);
        check_rows(&LimitedShear::new(2, vec![0.4], vec![0.9]).unwrap(), &v);
        check_rows(&Cohesive::new(OrthotropicCoulomb::new(scaled.clone(), scaled.times(0.6)), vec![0.5]).unwrap(), &v);
        check_rows(&Bonded::space(), &v);
        let mut plane = v;
        plane.slip[1] = 0.0;
        plane.traction[1] = 0.0;
        check_rows(&Cohesive::new(PlanarCoulomb::new(scaled.clone()), vec![0.5]).unwrap(), &plane);
        check_rows(&PlanarCoulomb::new(scaled), &plane);
        check_rows(&LimitedShear::new(1, vec![0.4], vec![0.9]).unwrap(), &plane);
        check_rows(&Bonded::plane(), &plane);
        check_rows(&Frictionless::plane(), &plane);
    }

    /// A traction obeys the law in scaled form (residual 0 on the piece whose cell contains it) exactly if it is the Euclidean projection
    /// of λt + r u_t onto the ellipse with semi-axes F λν.
    #[test]
    fn scaled_disc_is_ellipse_projection(f1 in 0.1..2.0f64, f2 in 0.1..2.0f64, n in 0.1..3.0f64, z1 in -3.0..3.0f64, z2 in -3.0..3.0f64) {
        let axes = [f1 * n, f2 * n];
        let traction = project_ellipse([z1, z2], axes);
        let slip = [z1 - traction[0], z2 - traction[1]];
        let law = OrthotropicCoulomb::new(
            FrictionCoefficient::uniform(FrictionCurve::constant(f1).unwrap()),
            FrictionCoefficient::uniform(FrictionCurve::constant(f2).unwrap()),
        );
        let mut v = LocalValues::default();
        v.pressure = n;
        v.slip = slip;
        v.traction = traction;
        v.r = 1.7;
        let mut tests = [0.0; MAX_TESTS];
        law.tests(&v, &mut tests);
        let slips = v.slip_norm() > 0.0;
        if slips && v.slip_norm() > 1e-6 {
            prop_assert!(tests[1] > 0.0);
            if (f1 - f2).abs() > 0.1 && slip[0].abs() > 0.1 && slip[1].abs() > 0.1 {
                // Slip is not parallel to the traction.
                let cross = slip[0] * traction[1] - slip[1] * traction[0];
                prop_assert!(cross.abs() > 1e-6);
            }
        }
        let h = law.residual(if slips { 2 } else { 1 }, &v);
        prop_assert!(h[1].abs() < 1e-12 * (1.0 + n) && h[2].abs() < 1e-12 * (1.0 + n), "{:?}", h);
    }
}

/// One node with compliance w in the tangent plane under given pressure: u_t = b − w λt.
fn one_node(w: f64, b: [f64; 2], pressure: f64) -> ContactBody {
    let a = Matrix::from_rows(&[[1.0, 0.0, 0.0], [0.0, 1.0 / w, 0.0], [0.0, 0.0, 1.0 / w]]).unwrap();
    let unit = |d: usize| {
        let mut row = [0.0; 3];
        row[d] = 1.0;
        Matrix::from_rows(&[row]).unwrap()
    };
    let load = LoadPath::constant(vec![pressure, b[0] / w, b[1] / w]);
    ContactBody::new(a, unit(0), vec![unit(1), unit(2)], load).unwrap()
}

#[test]
fn one_node_in_space() {
    let text = include_str!("../data/unit3d.json");
    let json: Value = serde_json::from_str(text).unwrap();
    let number = |v: &Value| v.as_f64().unwrap();
    let pair = |v: &Value| [number(&v[0]), number(&v[1])];
    let mut seen = 0;
    for case in json.as_array().unwrap().iter().filter(|c| c.get("b").is_some()) {
        seen += 1;
        let f = pair(&case["F"]);
        let law = OrthotropicCoulomb::new(
            FrictionCoefficient::uniform(FrictionCurve::constant(f[0]).unwrap()),
            FrictionCoefficient::uniform(FrictionCurve::constant(f[1]).unwrap()),
        );
        let body = one_node(number(&case["w"]), pair(&case["b"]), number(&case["ln"]));
        let problem = CondensedContact::new(body, law).unwrap().with_r(1.7).unwrap();
        let x = problem.solve(0.0, None).unwrap();
        let solution = problem.solution(&x).unwrap();
        let v = solution.nodes[0];
        let (ut, lt) = (pair(&case["ut"]), pair(&case["lt"]));
        for d in 0..2 {
            assert!((v.slip[d] - ut[d]).abs() < 1e-12 && (v.traction[d] - lt[d]).abs() < 1e-12);
        }
        assert_eq!(
            solution.states[0] == ContactState::Stick,
            case["state"] == "stick"
        );
        let mut tests = [0.0; MAX_TESTS];
        problem.node_law().tests(&v, &mut tests);
        assert!((tests[1] - number(&case["theta2_r1p7"])).abs() < 1e-11);
    }
    assert_eq!(seen, 4);
}

/// Slip-weakening at one node: all roots, found from starts near and far.
#[test]
fn scalar_slip_weakening() {
    let json: Value = serde_json::from_str(include_str!("../data/unit3d.json")).unwrap();
    let mut seen = 0;
    for case in json
        .as_array()
        .unwrap()
        .iter()
        .filter(|c| c.get("scalar").is_some())
    {
        let data = &case["scalar"];
        let get = |key: &str| data[key].as_f64().unwrap();
        let (first, last, delta) = (get("F0"), get("F1"), get("delta"));
        let f = FrictionCurve::function(move |s| {
            let d = (first - last) * (-(s / delta).powi(2)).exp();
            (last + d, -2.0 * s / (delta * delta) * d)
        });
        let (w, b, n, zeta) = (get("w"), get("b"), get("ln"), get("zeta"));
        let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::scaled(f));
        let problem = CondensedContact::new(one_node(w, [b, 0.0], n), law).unwrap();
        for root in case["roots_u"].as_array().unwrap() {
            seen += 1;
            let root = root.as_f64().unwrap();
            let start = [n, (b - root) / w * (1.0 + 1e-7), 0.0, zeta];
            let x = problem.solve(zeta, Some(&start)).unwrap();
            let v = problem.solution(&x).unwrap().nodes[0];
            assert!((v.slip[0] - root).abs() < 1e-13, "{} {root}", v.slip[0]);
        }
    }
    assert_eq!(seen, 7);
}

#[test]
fn curves() {
    let table = FrictionCurve::table(&[(0.0, 0.5), (1.0, 0.3), (2.0, 0.29), (4.0, 0.1)]).unwrap();
    let mut last = f64::INFINITY;
    for k in 0..=500 {
        let s = k as f64 * 0.01;
        let (f, slope) = table.value(s);
        assert!(f <= last && slope <= 0.0);
        last = f;
        let h = 1e-6;
        if s > h {
            let difference = (table.value(s + h).0 - table.value(s - h).0) / (2.0 * h);
            assert!((slope - difference).abs() < 1e-5);
        }
    }
    for (s, f) in [(0.0, 0.5), (1.0, 0.3), (2.0, 0.29), (4.0, 0.1)] {
        assert!((table.value(s).0 - f).abs() < 1e-15);
    }
    assert!(FrictionCurve::constant(-0.1).is_err());
    assert!(FrictionCurve::table(&[(0.0, 0.1), (0.0, 0.2)]).is_err());
    assert!(FrictionCurve::exponential(0.3, 0.1, 0.0).is_err());
    // Negative and NaN coefficients are detected when a problem is solved.
    for bad in [-0.1, f64::NAN] {
        let law =
            OrthotropicCoulomb::isotropic(FrictionCoefficient::function(move |_, _, _| [bad, 0.0, 0.0]));
        let problem = CondensedContact::new(one_node(1.0, [1.0, 0.0], 1.0), law).unwrap();
        assert!(problem.solve(0.0, None).is_err());
    }
}

/// Coulomb's law with other names for its pieces.
#[derive(Clone)]
struct Translated(PlanarCoulomb);

impl NodeLaw for Translated {
    same_mechanics!(0);
    fn piece_name(&self, piece: usize) -> &'static str {
        ["offen", "haftend", "gleitend nach rechts", "gleitend nach links"][piece]
    }
}

/// The state of a node is defined by the law, not by the names of its pieces; and the search for a solution takes the same steps.
#[test]
fn states_do_not_depend_on_names() {
    let identity = |rows: [usize; 2]| {
        let entries: Vec<_> = rows.iter().enumerate().map(|(i, &j)| (i, j, 1.0)).collect();
        Matrix::from_triplets(2, 4, &entries).unwrap()
    };
    let mut a = Matrix::identity(4);
    a.values_mut().fill(3.0);
    for load in [
        [1.0, 0.2, 1.0, 2.0],
        [1.0, -2.0, -1.0, 0.0],
        [1.0, 0.1, 2.0, -0.3],
    ] {
        let (normal, tangential) = (identity([0, 2]), vec![identity([1, 3])]);
        let body =
            ContactBody::new(a.clone(), normal, tangential, LoadPath::constant(load.to_vec())).unwrap();
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(
            FrictionCurve::constant(0.4).unwrap(),
        ));
        let own = FullContact::new(body.clone(), law.clone()).unwrap();
        let other = FullContact::new(body, Translated(law)).unwrap();
        let (x, y) = (
            own.solve_reported(0.0, None).unwrap(),
            other.solve_reported(0.0, None).unwrap(),
        );
        assert_eq!(x, y);
        let states = own.solution(&x.x).unwrap().states;
        assert_eq!(states, other.solution(&y.x).unwrap().states);
        assert_ne!(states, [ContactState::Open; 2]);
    }
}
