//! The nonuniqueness problems of slip-weakening friction, against independent digits.

use semismooth::contact::{CondensedContact, FixedPointOptions, NodeLaw, fixed_point};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, PointKind, Termination};

#[path = "../../examples/common/bars.rs"]
pub(crate) mod problems;

/// Follows ζ downwards from 3.2 on the sticking side, through both folds.
fn follow<L: NodeLaw>(problem: &CondensedContact<L>) -> Branch {
    let start = problem
        .solve(3.2, Some(&problem.stick_start(3.2).unwrap()))
        .unwrap();
    let options = ContinuationOptions::default()
        .with_parameter_range((0.6, 3.3))
        .with_targets(vec![1.4]);
    let branch = Branch::follow(problem, &start, Direction::Decreasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    branch
}

/// The points at ζ = 1.4: slip of the last contact node along x, and sign of the determinant.
fn at_target<L: NodeLaw>(problem: &CondensedContact<L>, branch: &Branch) -> Vec<(f64, Option<i8>)> {
    let targets = branch
        .points
        .iter()
        .filter(|p| p.kind == PointKind::Target && p.parameter() == 1.4);
    targets
        .map(|p| {
            (
                problem.solution(&p.x).unwrap().nodes.last().unwrap().slip[0],
                p.det_sign,
            )
        })
        .collect()
}

fn close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "{found} {expected}"
    );
}

#[test]
fn plane_bar() {
    for (nx, folds) in [
        (20, [1.398827735096, 2.724786266795]),
        (40, [1.375501835970, 2.725414553670]),
    ] {
        let bar = problems::bar2d(nx).unwrap();
        let branch = follow(&bar.problem);
        let found = branch.folds();
        assert_eq!(found.len(), 2);
        found.iter().zip(folds).for_each(|(f, e)| close(*f, e, 1e-9));
        let kinks: Vec<_> = branch.transitions.iter().filter(|t| t.is_fold()).collect();
        assert_eq!((kinks.len(), branch.smooth_folds.len()), (1, 1));
        // Stick → slip at x = 8 m on both meshes (seen from the slipping side: the other way round).
        let site = kinks[0].sites[0].site;
        if nx == 40 {
            close(bar.rows.points[site][0], 8.0, 1e-12);
        }
        let solutions = at_target(&bar.problem, &branch);
        assert_eq!(
            solutions.iter().map(|s| s.1).collect::<Vec<_>>(),
            [Some(1), Some(-1), Some(1)]
        );
        if nx == 40 {
            for (s, expected) in solutions.iter().zip([2.0880547e-3, 3.1783958e-3, 2.02185555e-2]) {
                close(s.0, expected, 3e-8);
            }
        }
    }
}

/// Displacements and nodal forces of all contact nodes at ζ = 1.4, all three solutions on both meshes.
#[test]
fn all_nodes_of_the_plane_bar() {
    let json: serde_json::Value = serde_json::from_str(include_str!("../data/bar2d.json")).unwrap();
    for (nx, name) in [(20, "20x2"), (40, "40x4")] {
        let bar = problems::bar2d(nx).unwrap();
        let branch = follow(&bar.problem);
        let targets = branch
            .points
            .iter()
            .filter(|p| p.kind == PointKind::Target && p.parameter() == 1.4);
        let points: Vec<_> = targets.collect();
        assert_eq!(points.len(), 3);
        // From the sticking side the branch meets the solutions in the order of their slips.
        for (point, solution) in points.iter().zip(["solution1", "solution2", "solution3"]) {
            let expected = &json[name][solution];
            let list = |key: &str| -> Vec<f64> {
                let flat = |v: &serde_json::Value| v.as_array().map_or(vec![v.clone()], Vec::clone);
                let all = expected[key].as_array().unwrap().iter().flat_map(flat);
                all.map(|v| v.as_f64().unwrap()).collect()
            };
            let (u, l) = (list("u"), list("l"));
            assert_eq!(l.len(), 2 * nx);
            let nodes = bar.problem.solution(&point.x).unwrap().nodes;
            let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            for (i, v) in nodes.iter().enumerate() {
                for (found, expected) in [(v.penetration, u[2 * i]), (v.slip[0], u[2 * i + 1])] {
                    assert!(
                        (found - expected).abs() <= 1e-9 * largest(&u),
                        "{found} {expected}"
                    );
                }
                for (found, expected) in [(v.pressure, l[2 * i]), (v.traction[0], l[2 * i + 1])] {
                    assert!(
                        (found - expected).abs() <= 1e-9 * largest(&l),
                        "{found} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn solid_bar() {
    let bar = problems::bar3d(20, false).unwrap();
    let branch = follow(&bar.problem);
    let folds = branch.folds();
    assert_eq!(folds.len(), 2);
    close(folds[0], 1.3890682216770, 1e-9);
    close(folds[1], 2.7635195967850, 1e-9);
    assert_eq!(branch.smooth_folds.len(), 2);
    let signs: Vec<_> = at_target(&bar.problem, &branch).iter().map(|s| s.1).collect();
    assert_eq!(signs, [Some(1), Some(-1), Some(1)]);
}

/// The fixed point from stick finds the sticking solution above the lower fold and the slipping one below.
#[test]
fn fixed_point_jumps_at_the_fold() {
    let bar = problems::bar2d(40).unwrap();
    let end = |zeta: f64| {
        let start = bar.problem.stick_start(zeta).unwrap();
        let report = fixed_point(&bar.problem, &start, &FixedPointOptions::default()).unwrap();
        assert!(report.converged);
        assert!(report.contraction().unwrap() < 1.0);
        // A fixed point is a solution: Newton stays there.
        let x = bar.problem.solve(zeta, Some(&report.x)).unwrap();
        let slip = |x: &[f64]| bar.problem.solution(x).unwrap().nodes[39].slip[0];
        close(slip(&report.x), slip(&x), 1e-7);
        slip(&x)
    };
    assert!(end(1.3755019) < 5e-3);
    assert!(end(1.3755018) > 1e-2);
    // The rate is that of the last increments above rounding.
    let start = bar.problem.stick_start(1.4).unwrap();
    let report = fixed_point(&bar.problem, &start, &FixedPointOptions::default()).unwrap();
    let rate = report.contraction().unwrap();
    let late = |w: &&[f64]| (1e-9..1e-6).contains(&w[1]);
    let ratios: Vec<f64> = report
        .changes
        .windows(2)
        .filter(late)
        .map(|w| w[1] / w[0])
        .collect();
    assert!(
        ratios.len() > 5 && ratios.iter().all(|r| (r - rate).abs() < 2e-3),
        "{rate} {ratios:?}"
    );
    close(rate, 0.5063, 1e-3);
}
