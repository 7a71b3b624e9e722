//! Arms at points that are accurate to rounding, against references in exact arithmetic and lists of solutions.

use super::common::{self, cases};
use super::random::Random;
use super::{blocks, loaded, pick};
use proptest::prelude::*;
use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::contact::{Contact, ContactState, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::enumeration::{
    Completeness, DirectionalArm, DirectionalArms, Doubt, EnumerationOptions, all_arms, all_solutions,
};
use semismooth::interface::View;
use semismooth::piecewise::{MinMap, PiecewiseSmooth};
use semismooth::sparse::Matrix;

fn arms(map: &dyn PiecewiseSmooth, x: &[f64]) -> DirectionalArms {
    all_arms(map, x, &EnumerationOptions::default()).unwrap()
}

fn sign(arm: &DirectionalArm) -> i8 {
    match arm.rate() {
        0.0 => 0,
        rate if rate > 0.0 => 1,
        _ => -1,
    }
}

/// y ≥ 0 ⟂ M y − α d + q ≥ 0.
fn complementarity(m: &[Vec<f64>], d: &[f64], q: &[f64]) -> Mcp<AffineFunction> {
    let rows: Vec<Vec<f64>> = m
        .iter()
        .zip(d)
        .map(|(row, d)| row.iter().copied().chain([-d]).collect())
        .collect();
    let n = q.len();
    let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), q.to_vec()).unwrap();
    Mcp::new(f, vec![0.0; n], vec![f64::INFINITY; n]).unwrap()
}

/// Compares the pieces of branches that meet at a vertex, with the sign of α̇ away from it, with the arms found.
fn compare<V: View>(map: &Contact<V, PlanarCoulomb>, case: &common::Case, k: usize) {
    let vertex = &case.vertices()[k];
    let json = &case.json["graph"]["vertices"][k];
    let mut x = vec![0.0; map.num_vars()];
    let full = x.len() > 2 * vertex.lambda_nu.len() + 1;
    let mut values = if full { vertex.u.clone() } else { Vec::new() };
    values.extend(vertex.lambda_nu.iter().chain(&vertex.lambda_t));
    values.push(vertex.alpha);
    x.copy_from_slice(&values);
    let found = arms(map, &x);
    let context = format!("{}, vertex {k}: {found:#?}", case.name);
    // Where F = 0 the domain of the map ends, which its exact conditions do not state; a segment that leaves a branch point at constant α
    // has a kernel of dimension two.
    let doubt = match (vertex.kind.as_str(), case.name.as_str()) {
        ("end", _) => Some(Doubt::NoCoefficients),
        ("branching", "p1_ex3") => Some(Doubt::Rounding),
        _ => None,
    };
    match found.completeness {
        Completeness::Complete => assert_eq!(doubt, None, "{context}"),
        Completeness::Undecided { doubt: why, .. } => assert_eq!(Some(why), doubt, "{context}"),
        _ => panic!("{context}"),
    }
    if doubt.is_some() {
        return;
    }
    let all = case.json["graph"]["pieces"].as_array().unwrap();
    let mut expected: Vec<(String, i8)> = (json["pieces"].as_array().unwrap().iter())
        .map(|p| {
            let piece = all.iter().find(|q| q["id"] == p["piece"]).unwrap();
            let rate = match p["end"].as_str() {
                _ if piece["vertical"] == true => 0,
                Some("lo") => 1,
                _ => -1,
            };
            (p["states"].as_str().unwrap().to_owned(), rate)
        })
        .collect();
    let vertical = expected.iter().any(|e| e.1 == 0);
    expected.sort();
    let word = |s: &_| -> String { map.states(s).iter().map(|c: &ContactState| c.letter()).collect() };
    let mut mine: Vec<(String, i8)> = (found.arms.iter())
        .flat_map(|a| a.selections.iter().map(|s| (word(s), sign(a))))
        .collect();
    mine.sort();
    assert_eq!(mine, expected, "{context}");
    let degrees = found.orientation.is_some_and(|(plus, minus)| plus == minus);
    assert!(degrees || vertical, "{context}");
}

#[test]
fn transitions_of_the_printed_examples_are_proven() {
    let mut count = 0;
    for case in cases() {
        for k in 0..case.vertices().len() {
            compare(&case.problem, &case, k);
            compare(&case.problem.condensed().unwrap(), &case, k);
            count += 1;
        }
    }
    assert_eq!(count, 20);
}

/// 0 ≤ y ⟂ ε y − α ≥ 0: y = α/ε for α > 0, and at ε = 0 vertical.
#[test]
fn steep_arms_are_not_vertical() {
    for (stiffness, rate, det, orientation) in [
        (f64::powi(2.0, -60), 1, 1, Some((1, 1))),
        (-f64::powi(2.0, -60), -1, -1, Some((0, 0))),
        (f64::powi(2.0, -400), 1, 1, Some((1, 1))),
        (0.0, 0, 0, None),
    ] {
        let map = complementarity(&[vec![stiffness]], &[1.0], &[0.0]);
        let found = arms(&map, &[0.0, 0.0]);
        assert_eq!(found.completeness, Completeness::Complete, "{stiffness}");
        let [open, closed] = found.arms.as_slice() else {
            panic!("{stiffness}: {found:?}");
        };
        let (rest, steep) = if open.tangent[0] == 0.0 {
            (open, closed)
        } else {
            (closed, open)
        };
        assert_eq!(
            (rest.tangent.as_slice(), &rest.det_signs),
            (&[0.0, -1.0][..], &vec![Some(1)])
        );
        assert_eq!(
            (sign(steep), &steep.det_signs),
            (rate, &vec![Some(det)]),
            "{stiffness}"
        );
        assert!((steep.tangent[0] - 1.0).abs() < 1e-12);
        assert_eq!(found.orientation, orientation, "{stiffness}");
    }
}

/// y_i = max(0, α − c_i): kinks at c₁ and c₂ = c₁ + 2⁻⁴⁰ are two; if the numbers are equal they are one.
#[test]
fn kinks_that_are_close_are_two() {
    let identity = [vec![1.0, 0.0], vec![0.0, 1.0]];
    let apart = complementarity(&identity, &[1.0; 2], &[0.3, 0.3 + f64::powi(2.0, -40)]);
    let x = [0.0, 0.0, 0.3];
    let found = arms(&apart, &x);
    let undecided = Completeness::Undecided {
        selections: 0,
        doubt: Doubt::Coincidence,
    };
    assert_eq!(found.completeness, undecided);
    let sharp = EnumerationOptions::default().with_tolerance(1e-14);
    let found = all_arms(&apart, &x, &sharp).unwrap();
    assert_eq!(
        (found.completeness, found.arms.len(), found.orientation),
        (Completeness::Complete, 2, Some((1, 1)))
    );
    let growing = found.arms.iter().find(|a| sign(a) > 0).unwrap();
    assert!((growing.tangent[0] - growing.tangent[2]).abs() < 1e-15 && growing.tangent[1] == 0.0);
    let together = complementarity(&identity, &[1.0; 2], &[0.3; 2]);
    let found = arms(&together, &x);
    assert_eq!(
        (found.completeness, found.arms.len()),
        (Completeness::Complete, 2)
    );
    let growing = found.arms.iter().find(|a| sign(a) > 0).unwrap();
    assert!(
        growing
            .tangent
            .iter()
            .all(|t| (t - 3f64.sqrt().recip()).abs() < 1e-15)
    );
    // The point need not be representable: 0.3/0.7.
    let scaled = complementarity(&identity, &[0.7; 2], &[0.3; 2]);
    let found = arms(&scaled, &[0.0, 0.0, 0.3 / 0.7]);
    assert_eq!(
        (found.completeness, found.arms.len()),
        (Completeness::Complete, 2)
    );
}

/// A point off the curve, and a map that does not state its coefficients.
#[test]
fn points_and_maps_without_proof() {
    let map = complementarity(&[vec![1.0]], &[1.0], &[0.0]);
    let found = arms(&map, &[0.5, 0.25]);
    let Completeness::Undecided { doubt, .. } = found.completeness else {
        panic!("{found:?}");
    };
    assert_eq!(doubt, Doubt::Coincidence);
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    let Completeness::Undecided { doubt, .. } = arms(&map, &[0.0, 0.0]).completeness else {
        panic!("not stated");
    };
    assert_eq!(doubt, Doubt::NoCoefficients);
}

/// A curve through a regular point: one selection, two opposite arms.
#[test]
fn regular_points_have_two_arms() {
    let load = LoadPath::affine(vec![0.0; 2], vec![1.0, -2.25]);
    let problem = loaded(blocks(1), load, vec![3.0]);
    let map = problem.condensed().unwrap();
    for solution in all_solutions(&map, 1.0, &EnumerationOptions::default())
        .unwrap()
        .solutions
    {
        let found = arms(&map, &solution.x);
        assert_eq!(
            (found.completeness, found.arms.len()),
            (Completeness::Complete, 2)
        );
        let [a, b] = [&found.arms[0], &found.arms[1]];
        assert!(a.tangent.iter().zip(&b.tangent).all(|(a, b)| a == &-b));
        assert_eq!(a.selections, solution.selections);
        assert_eq!(a.det_signs, solution.det_signs);
    }
}

/// Random stiffness and load, with zero force at α = 0 (or 0.25), with friction F or F + α.
fn unloaded(p: usize, seed: u64, rates: bool) -> FullContact<PlanarCoulomb> {
    let mut rng = Random::new(seed);
    let n = 2 * p;
    let g = rng.vector(n * n, 1.0);
    let entry = |i: usize, j: usize| {
        let dot: f64 = (0..n).map(|k| g[i * n + k] * g[j * n + k]).sum();
        dot / n as f64 + if i == j { 0.2 } else { 0.0 }
    };
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let at = if rates { 0.25 } else { 0.0 };
    let slope: Vec<f64> = rng.vector(n, 1.0).into_iter().map(|v| 3.0 * v).collect();
    let base: Vec<f64> = slope.iter().map(|v| -at * v).collect();
    let coefficient: Vec<f64> = rng.vector(p, 1.0).into_iter().map(|v| 1.5 * (1.0 + v)).collect();
    let rate = vec![f64::from(u8::from(rates)); p];
    let constant: Vec<f64> = coefficient
        .iter()
        .map(|f| f - if rates { at } else { 0.0 })
        .collect();
    FullContact::planar(
        Matrix::from_rows(&rows).unwrap(),
        pick(p, 0),
        pick(p, 1),
        LoadPath::affine(base, slope),
        FrictionCoefficient::affine(constant, rate).unwrap(),
    )
    .unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Without gaps and forces the directions for α̇ = ±1 are the solutions under ± the rate of the load.
    #[test]
    fn arms_of_unloaded_bodies_are_solutions(p in 1usize..=6, seed in 1u64..u64::MAX, rates: bool) {
        let problem = unloaded(p, seed, rates);
        let map = problem.condensed().unwrap();
        let mut x = vec![0.0; map.num_vars()];
        x[2 * p] = if rates { 0.25 } else { 0.0 };
        let found = arms(&map, &x);
        prop_assert_eq!(found.completeness, Completeness::Complete);
        prop_assert_eq!(found.orientation, Some((1, 1)));
        let constant = unloaded(p, seed, false).condensed().unwrap();
        // The coefficient is F + α − 0.25: at α = 0.25 that of the other problem up to rounding.
        let mut count = 0;
        for alpha in [1.0, -1.0] {
            let set = all_solutions(&constant, alpha, &EnumerationOptions::default()).unwrap();
            prop_assert_eq!(set.completeness, Completeness::Complete);
            count += set.solutions.len();
            for solution in &set.solutions {
                let length = solution.x.iter().map(|v| v * v).sum::<f64>().sqrt();
                let near = |a: &&DirectionalArm| {
                    let both = a.tangent.iter().zip(&solution.x);
                    both.into_iter().all(|(t, v)| (t - v / length).abs() < 1e-9)
                };
                let arm = found.arms.iter().find(near);
                prop_assert_eq!(arm.map(|a| &a.selections), Some(&solution.selections));
                prop_assert_eq!(arm.map(|a| &a.det_signs), Some(&solution.det_signs));
            }
        }
        prop_assert_eq!(found.arms.len(), count);
    }
}

/// A part of the search that error bounds do not decide is decided in exact arithmetic: in the unknowns of the map, since the reduced ones
/// have too many digits.
#[test]
fn what_error_bounds_leave_open_is_decided() {
    for (p, seed) in [(5, 7_855_145_792_876_383_765), (6, 4_664_866_812_566_085_134)] {
        let map = unloaded(p, seed, true).condensed().unwrap();
        let mut x = vec![0.0; map.num_vars()];
        x[2 * p] = 0.25;
        let found = arms(&map, &x);
        assert_eq!(
            (found.completeness, found.orientation),
            (Completeness::Complete, Some((1, 1)))
        );
    }
}

/// 3 y₁ = α and y₂ ≥ 0 with 3 y₁ + y₂ − α ≥ 0: along the arm with α̇ > 0 that row stays at 0, which error bounds for 1/3 cannot prove. The
/// other arm is y = 0. With −α the two change places.
#[test]
fn rows_that_rest_at_zero_along_an_arm_are_decided() {
    for side in [1, -1] {
        let d = f64::from(side);
        let map = complementarity(&[vec![3.0, 0.0], vec![3.0, 1.0]], &[d; 2], &[0.0; 2]);
        let found = arms(&map, &[0.0; 3]);
        assert_eq!(
            (found.completeness, found.arms.len()),
            (Completeness::Complete, 2),
            "{side}"
        );
        for arm in &found.arms {
            let [y, z, rate] = [0, 1, 2].map(|j| arm.tangent[j] / arm.tangent[2].abs());
            let expected = if f64::from(side) * rate > 0.0 {
                1.0 / 3.0
            } else {
                0.0
            };
            assert!((y - expected).abs() < 1e-15 && z == 0.0, "{side} {y} {z}");
        }
    }
}

/// F = α for all z: with z ≤ 0 the point 0 has an arm along which z decreases at α = 0, with z ≥ 0 one along which it increases, and with z
/// free both.
#[test]
fn vertical_arms_lead_into_the_bounds() {
    let infinite = f64::INFINITY;
    for (lower, upper, expected) in [
        (-infinite, 0.0, vec![[-1.0, 0.0], [0.0, -1.0]]),
        (0.0, infinite, vec![[0.0, 1.0], [1.0, 0.0]]),
        (-infinite, infinite, vec![[-1.0, 0.0], [1.0, 0.0]]),
    ] {
        let f = AffineFunction::new(Matrix::from_rows(&[[0.0, 1.0]]).unwrap(), vec![0.0]).unwrap();
        let map = Mcp::new(f, vec![lower], vec![upper]).unwrap();
        let found = arms(&map, &[0.0, 0.0]);
        assert!(found.completeness.is_complete(), "{found:?}");
        let mut tangents: Vec<Vec<f64>> = found.arms.iter().map(|a| a.tangent.clone()).collect();
        tangents.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert_eq!(tangents, expected, "{lower} {upper}");
    }
}

/// A stiff plate on an obstacle, just touched by its first node: where exact elimination would take too long, error bounds prove that there
/// are two arms, forward and back.
#[test]
fn arms_of_large_problems_are_proven_without_exact_arithmetic() {
    let (n, band) = (200, 40);
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 3.0 * band as f64)).collect();
    for k in 1..=band {
        entries.extend((k..n).flat_map(|i| [(i, i - k, -1.0), (i - k, i, -1.0)]));
    }
    entries.push((0, n, -1.0));
    // F = M y − α e₀ + q with y = (0, 1, …, 1) and F = 0 at α = 1.
    let mut y = vec![1.0; n];
    y[0] = 0.0;
    let mut q = vec![0.0; n];
    q[0] = 1.0;
    for &(i, j, v) in entries.iter().filter(|e| e.1 < n) {
        q[i] -= v * y[j];
    }
    let matrix = Matrix::from_triplets(n, n + 1, &entries).unwrap();
    let f = AffineFunction::new(matrix, q).unwrap();
    let map = Mcp::new(f, vec![0.0; n], vec![f64::INFINITY; n]).unwrap();
    y.push(1.0);
    let found = arms(&map, &y);
    assert!(
        matches!(found.completeness, Completeness::Complete),
        "{:?}",
        found.completeness
    );
    let mut signs: Vec<i8> = found.arms.iter().map(sign).collect();
    signs.sort_unstable();
    assert_eq!(signs, [-1, 1]);
}
