//! Diagrams: complete solution sets of the printed examples, branchings, closed curves, starts on the same
//! curve.

use crate::common;
use std::ops::ControlFlow;

use crate::common::{Case, cases};
use crate::maps::two_pieces;
use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::continuation::{
    ContinuationError, ContinuationOptions, Diagram, DiagramCompleteness, DiagramOptions, Limit, VertexKind,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

const WINDOW: (f64, f64) = (-12.0, 25.0);

fn window() -> DiagramOptions {
    let mut options = DiagramOptions::default().with_parameter_range(WINDOW);
    options.continuation.max_growth = 1e3;
    options
}

fn starts(case: &Case, at: &[(&str, f64)]) -> Vec<Vec<f64>> {
    at.iter()
        .map(|(s, alpha)| {
            case.problem
                .solve_from_states(*alpha, &common::states(s))
                .unwrap()
        })
        .collect()
}

/// Name, starts, number of branches, components, and vertices besides bounds and starts.
type Expected = (&'static str, &'static [(&'static str, f64)], usize, usize);

const EXPECTED: [Expected; 6] = [
    ("p1_ex1", &[("K", 10.0)], 1, 1),
    ("p1_ex2", &[("K", 10.0), ("O", 10.0)], 2, 2),
    ("p1_ex3", &[("K", 10.0)], 2, 1),
    ("p1_ex4", &[("O", 10.0), ("-", 10.0)], 2, 2),
    ("p2_ex1", &[("KK", 8.0), ("OO", 8.0)], 2, 2),
    ("p2_ex2", &[("KK", 0.0)], 1, 1),
];

#[test]
fn the_printed_examples_are_complete() {
    for (name, from, branches, components) in EXPECTED {
        let case = cases().into_iter().find(|c| c.name == name).unwrap();
        let map = &case.problem;
        let diagram = Diagram::explore(map, &starts(&case, from), &window()).unwrap();
        assert!(!diagram.completeness().is_limited(), "{name}\n{diagram}");
        assert_eq!(diagram.branches().len(), branches, "{name}\n{diagram}");
        assert_eq!(diagram.components().len(), components, "{name}\n{diagram}");
        for vertex in case.vertices() {
            let known = diagram
                .vertices()
                .iter()
                .find(|v| {
                    (v.parameter() - vertex.alpha).abs() < 1e-9 && {
                        let u = map.displacements(&v.x).unwrap();
                        u.iter().zip(&vertex.u).all(|(a, b)| (a - b).abs() < 1e-9)
                    }
                })
                .unwrap_or_else(|| panic!("{name}: no vertex at {}\n{diagram}", vertex.alpha));
            assert_eq!(known.kind == VertexKind::Fold, vertex.fold, "{name}\n{diagram}");
        }
        let alphas = common::numbers(&case.json["alphas"]);
        for (alpha, exact) in alphas.iter().zip(case.json["solutions"].as_array().unwrap()) {
            let exact = exact.as_array().unwrap();
            let found = diagram.solutions_at(map, *alpha).unwrap();
            assert_eq!(found.count(), Some(exact.len()), "{name} at {alpha}\n{diagram}");
            for solution in exact {
                let u = common::numbers(&solution["u"]);
                let there = found.points.iter().any(|s| {
                    let v = map.displacements(&s.x).unwrap();
                    v.iter().zip(&u).all(|(a, b)| (a - b).abs() < 1e-9)
                });
                assert!(there, "{name} at {alpha}");
            }
        }
    }
}

#[test]
fn the_vertical_segment_of_example_3_is_a_continuum() {
    let case = cases().into_iter().find(|c| c.name == "p1_ex3").unwrap();
    let diagram = Diagram::explore(&case.problem, &starts(&case, &[("O", 10.0)]), &window()).unwrap();
    let at = diagram.solutions_at(&case.problem, 2.0).unwrap();
    assert_eq!((at.count(), at.continua.len()), (None, 1), "{diagram}");
    assert!(at.points.is_empty());
    assert_eq!(diagram.edges()[at.continua[0]].det_signs(), [0]);
    assert_eq!(diagram.solutions_at(&case.problem, 3.0).unwrap().count(), Some(2));
}

fn smooth(f: impl Fn(f64, f64) -> f64) -> impl PiecewiseSmooth {
    MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = f(x[0], x[1]);
        b[0] = 1e9;
    })
}

#[test]
fn pitchfork_and_transcritical_have_four_arms() {
    let options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
    let pitchfork = smooth(|y, a| y * y * y - a * y);
    let transcritical = smooth(|y, a| y * y - a * y);
    let maps: [(&dyn PiecewiseSmooth, usize); 2] = [(&pitchfork, 3), (&transcritical, 2)];
    for (map, above) in maps {
        for start in [[0.0, -0.5], [0.6, if above == 3 { 0.36 } else { 0.6 }]] {
            let diagram = Diagram::explore(map, &[start], &options).unwrap();
            assert!(!diagram.completeness().is_limited(), "{diagram}");
            let centre = diagram
                .vertices()
                .iter()
                .find(|v| v.kind == VertexKind::BranchPoint);
            let centre = centre.unwrap_or_else(|| panic!("{diagram}"));
            assert_eq!(centre.arms.len(), 4, "{diagram}");
            assert!(centre.arms.iter().all(|a| a.edge.is_some()));
            assert_eq!((diagram.components().len(), diagram.branches().len()), (1, 2));
            let at = diagram.solutions_at(map, 0.25).unwrap();
            assert_eq!(at.count(), Some(above), "{diagram}");
        }
    }
}

#[test]
fn an_isola_is_one_closed_edge() {
    let circle = smooth(|y, a| y * y + a * a - 1.0);
    let diagram = Diagram::explore(&circle, &[[0.8, 0.6]], &DiagramOptions::default()).unwrap();
    assert!(!diagram.completeness().is_limited(), "{diagram}");
    assert_eq!(
        (diagram.edges().len(), diagram.vertices().len()),
        (1, 1),
        "{diagram}"
    );
    assert!(diagram.edges()[0].is_closed());
    assert_eq!(diagram.isolas().len(), 1);
    assert_eq!(diagram.folds().len(), 2);
    assert_eq!(diagram.solutions_at(&circle, 0.3).unwrap().count(), Some(2));
    // A second start cuts it in two; it stays one isola.
    let two = Diagram::explore(&circle, &[[0.8, 0.6], [-0.6, 0.8]], &DiagramOptions::default()).unwrap();
    assert_eq!((two.edges().len(), two.components().len()), (2, 1), "{two}");
    assert_eq!(two.isolas().len(), 1);
    assert_eq!(two.folds().len(), 2);
}

/// Starts just beyond points of a known edge cut it where they lie, on circles of all sizes, near the origin and far from it.
#[test]
fn starts_on_an_edge_cut_it_where_they_lie() {
    for (radius, centre) in [(1.0, 0.0), (3.0, 1e6)] {
        let circle = smooth(move |y, a| (y - centre).powi(2) + (a - centre).powi(2) - radius * radius);
        let on = |angle: f64| [centre + radius * angle.sin(), centre + radius * angle.cos()];
        let explore =
            |starts: &[[f64; 2]]| Diagram::explore(&circle, starts, &DiagramOptions::default()).unwrap();
        let one = explore(&[on(0.3)]);
        let whole = one.edges()[0].points.last().unwrap().arclength;
        for point in one.edges()[0].points.iter().skip(2).step_by(3) {
            let angle = (point.x[0] - centre).atan2(point.x[1] - centre);
            // The start itself is a single vertex.
            if (angle - 0.3).abs() < 0.2 {
                continue;
            }
            for beyond in [-0.01, 0.01] {
                let two = explore(&[on(0.3), on(angle + beyond)]);
                assert_eq!((two.edges().len(), two.components().len()), (2, 1), "{two}");
                let mut total = 0.0;
                for edge in two.edges() {
                    for pair in edge.points.windows(2) {
                        let [before, after] =
                            [&pair[0].x, &pair[1].x].map(|x| (x[0] - centre, x[1] - centre));
                        // The tangent of a circle is perpendicular to its radius; steps keep their sense of rotation.
                        let turned = before.0 * after.1 - before.1 * after.0;
                        let along = -before.1 * pair[0].tangent[0] + before.0 * pair[0].tangent[1];
                        assert!(turned * along > 0.0 && pair[1].arclength > pair[0].arclength);
                    }
                    total += edge.points.last().unwrap().arclength;
                }
                assert!((total - whole).abs() < 1e-2 * whole);
            }
        }
    }
}

#[test]
fn two_starts_on_a_curve_give_one_component() {
    let case = cases().into_iter().find(|c| c.name == "p2_ex2").unwrap();
    let from = starts(&case, &[("KK", 0.0), ("OO", -5.0), ("OK", 10.0), ("KK", 0.0)]);
    let diagram = Diagram::explore(&case.problem, &from, &window()).unwrap();
    assert_eq!(
        (diagram.components().len(), diagram.branches().len()),
        (1, 1),
        "{diagram}"
    );
    let one = Diagram::explore(&case.problem, &from[..1], &window()).unwrap();
    assert_eq!(diagram.vertices().len(), one.vertices().len() + 2);
    let again = Diagram::explore(&case.problem, &from, &window()).unwrap();
    assert_eq!(diagram, again);
}

#[test]
fn limits_are_reported() {
    let circle = smooth(|y, a| y * y + a * a - 1.0);
    let few = DiagramOptions::default().with_max_points(5);
    let diagram = Diagram::explore(&circle, &[[0.8, 0.6]], &few).unwrap();
    assert!(diagram.completeness().is_limited());
    let mut seen = 0;
    let stopped = Diagram::explore_observed(&circle, &[[0.8, 0.6]], &DiagramOptions::default(), |_| {
        seen += 1;
        if seen == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
    .unwrap();
    match stopped.completeness() {
        DiagramCompleteness::Limited(list) => assert!(list.contains(&Limit::Interrupted)),
        other => panic!("{other}"),
    }
    // A curve that is cut off, at its length or at its number of points, leaves a diagram that is not complete.
    let curve = DiagramOptions::default().continuation;
    for inner in [curve.clone().with_max_arclength(0.5), curve.with_max_points(3)] {
        let mut options = DiagramOptions::default();
        options.continuation = inner;
        let diagram = Diagram::explore(&circle, &[[0.8, 0.6]], &options).unwrap();
        let DiagramCompleteness::Limited(list) = diagram.completeness() else {
            panic!("{diagram}");
        };
        assert!(list.iter().any(|l| matches!(l, Limit::Curve { .. })), "{diagram}");
    }
    let outside = DiagramOptions::default().with_parameter_range((2.0, 3.0));
    assert!(Diagram::explore(&circle, &[[0.8, 0.6]], &outside).is_err());
}

/// The diagram of one circle is queried with the map of another one, of the same dimensions.
#[test]
fn a_diagram_of_another_map_is_refused() {
    let circle = smooth(|y, a| y * y + a * a - 1.0);
    let larger = smooth(|y, a| y * y + a * a - 1.1);
    let diagram = Diagram::explore(&circle, &[[0.8, 0.6]], &DiagramOptions::default()).unwrap();
    assert_eq!(diagram.solutions_at(&circle, 0.3).unwrap().points.len(), 2);
    // Points correct to six digits are points of the diagram.
    let rounded = smooth(|y, a| y * y + a * a - 1.000_001);
    let found = diagram.solutions_at(&rounded, 0.3).unwrap();
    assert!(
        found
            .points
            .iter()
            .all(|p| (p.x[0].abs() - 0.910_001_f64.sqrt()).abs() < 1e-9)
    );
    assert_eq!(found.points.len(), 2);
    match diagram.solutions_at(&larger, 0.3) {
        Err(ContinuationError::OtherMap { residual, .. }) => assert!((residual - 0.1).abs() < 1e-9),
        other => panic!("{other:?}"),
    }
}

/// |y| + α² = 1 followed first from a bound of the range or from between its bounds, α in any unit: the same arc from bound to bound.
#[test]
fn an_arc_from_bound_to_bound_has_one_diagram() {
    for unit in [1.0, 1e-8, 1e8] {
        let map = smooth(move |y, a| y + (a / unit).powi(2) - 1.0);
        let (low, high) = (-0.6 * unit, 0.5 * unit);
        let mut options = DiagramOptions::default().with_parameter_range((low, high));
        options.continuation.typical_sizes = vec![1.0, unit];
        let curve = options
            .continuation
            .with_step(0.05 * unit)
            .with_max_step(0.3 * unit);
        options.continuation = curve.with_min_step(1e-9 * unit);
        for at in [-0.6, 0.0, 0.5] {
            let start = [1.0 - at * at, at * unit];
            let diagram = Diagram::explore(&map, &[start], &options).unwrap();
            assert!(!diagram.completeness().is_limited(), "{unit:e} {at}: {diagram}");
            assert_eq!(diagram.branches().len(), 1, "{unit:e} {at}: {diagram}");
            let covered = diagram.edges().iter().map(|e| e.interval());
            let (a, b) = covered.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (l, u)| {
                (a.min(l), b.max(u))
            });
            assert!((a - low).abs() <= 1e-9 * unit && (b - high).abs() <= 1e-9 * unit);
            for at in [-0.59, 0.0, 0.49] {
                let found = diagram.solutions_at(&map, at * unit).unwrap();
                let [one] = found.points.as_slice() else {
                    panic!("{unit:e} {at}: {diagram}");
                };
                assert!((one.x[0] - (1.0 - at * at)).abs() < 1e-9);
            }
        }
    }
}

/// (y − f)(y − g) = 0, f = 0.3 (α − c) + 0.2 max(α − d, 0) and g = −0.7 (α − c): two lines that cross at c, one with a kink at d; y and α
/// in units.
struct Crossing {
    at: f64,
    kink: f64,
    units: [f64; 2],
}

impl Crossing {
    /// y, f, g and f′ of a piece.
    fn lines(&self, piece: usize, x: &[f64]) -> [f64; 4] {
        let (y, a) = (x[0] / self.units[0], x[1] / self.units[1]);
        let bend = 0.2 * piece as f64;
        let f = 0.3 * (a - self.at) + bend * (a - self.kink);
        [y, f, -0.7 * (a - self.at), 0.3 + bend]
    }
}

impl PiecewiseSmooth for Crossing {
    two_pieces!(self, [negative, positive], 2, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[1] / self.units[1] - self.kink;
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let [y, f, g, _] = self.lines(s.piece(0), x);
        out[0] = (y - f) * (y - g);
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let [y, f, g, slope] = self.lines(s.piece(0), x);
        jac.add(0, 0, (2.0 * y - f - g) / self.units[0]);
        jac.add(0, 1, (0.7 * (y - f) - slope * (y - g)) / self.units[1]);
    }
}

/// However short the edges between the crossing, the kink and the bound of α, and in all units: each edge has the constant sign of det ∇_yH
/// = ±(f − g), and none is vertical.
#[test]
fn edges_next_to_branch_points_have_the_sign_of_their_determinant() {
    let places = [
        (0.5, 0.505),
        (0.5, 0.4999),
        (0.99, 0.3),
        (-0.9999, 0.0),
        (0.1, 0.7),
    ];
    for units in [[1.0, 1.0], [1e9, 1e-9], [1e-9, 1e9]] {
        for (at, kink) in places {
            let map = Crossing { at, kink, units };
            let bend = 0.2 * f64::max(at - kink, 0.0);
            let alpha = at + bend / if kink < at { -1.2 } else { 1.0 };
            let y = -0.7 * (alpha - at);
            let inner = ContinuationOptions::default()
                .with_typical_sizes(units.to_vec())
                .with_parameter_range((-units[1], units[1]))
                .with_min_step(1e-8 * units[1])
                .with_step(0.05 * units[1])
                .with_max_step(units[1]);
            let options = DiagramOptions::default().with_continuation(inner);
            let start = [-0.7 * (0.02 - at) * units[0], 0.02 * units[1]];
            let crossing = [y * units[0], alpha * units[1]];
            for (start, starts) in [(start, 1), (crossing, 0)] {
                let diagram = Diagram::explore(&map, &[start], &options).unwrap();
                assert!(!diagram.completeness().is_limited());
                let kinds = diagram.vertices().iter().map(|v| v.kind);
                let branch_points = kinds.filter(|k| *k == VertexKind::BranchPoint).count();
                assert_eq!(
                    (branch_points, diagram.edges().len()),
                    (1, 6 + starts),
                    "{at} {kink}"
                );
                for edge in diagram.edges() {
                    let ends = [&edge.points[0].x, &edge.points.last().unwrap().x];
                    let middle = [0, 1].map(|k| 0.5 * (ends[0][k] + ends[1][k]));
                    let piece = usize::from(middle[1] > kink * units[1]);
                    let [y, f, g, _] = map.lines(piece, &middle);
                    let sign = (2.0 * y - f - g).signum() as i8;
                    assert_eq!(edge.det_signs(), [sign], "{at} {kink} {units:?}");
                    assert!(edge.points.iter().all(|p| p.det_sign == Some(sign)));
                    assert!(!edge.is_vertical());
                }
            }
        }
    }
}

/// min (y − s α, −y) vanishes on two rays to the left of 0, y = s α and y = 0: two edges that meet at a fold, however small their angle.
#[test]
fn edges_that_meet_at_small_angles_are_two() {
    for slope in [0.3, 3e-3, 1e-3] {
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] - slope * x[1];
            b[0] = -x[0];
        });
        let options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
        let diagram = Diagram::explore(&map, &[vec![0.0, -1.0]], &options).unwrap();
        assert!(!diagram.completeness().is_limited(), "{slope}\n{diagram}");
        let mut ends: Vec<f64> = (diagram.vertices().iter())
            .filter(|v| v.parameter() == -1.0)
            .map(|v| v.x[0])
            .collect();
        ends.sort_by(f64::total_cmp);
        assert_eq!(ends.len(), 2, "{slope}\n{diagram}");
        assert!((ends[0] + slope).abs() < 1e-12 && ends[1].abs() < 1e-12);
        let folds = diagram.vertices().iter().filter(|v| v.kind == VertexKind::Fold);
        assert_eq!(
            (folds.count(), diagram.edges().len()),
            (1, 2),
            "{slope}\n{diagram}"
        );
    }
}

/// On y² = α the derivative 2 y of H changes its sign at the fold: the ends of the edge around it have different signs.
#[test]
fn the_ends_of_an_edge_have_their_own_signs() {
    let parabola = smooth(|y, alpha| y * y - alpha);
    let options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
    for start in [1.0, -1.0] {
        let diagram = Diagram::explore(&parabola, &[vec![start, 1.0]], &options).unwrap();
        let [edge] = diagram.edges() else {
            panic!("{diagram}");
        };
        assert_eq!(edge.smooth_folds.len(), 1);
        for point in [&edge.points[0], &edge.points[edge.points.len() - 1]] {
            assert_eq!(point.det_sign, Some(point.x[0].signum() as i8), "{:?}", point.x);
        }
    }
}

type Rows = &'static [&'static [f64]];
/// M with the column of the parameter, q, lower and upper bounds, α of the sections, the range of α.
type Affine = (Rows, &'static [f64], &'static [f64], &'static [f64], f64, f64);

fn sections((rows, q, lower, upper, alpha, reach): &Affine) -> (Mcp<AffineFunction>, Diagram) {
    let matrix = Matrix::from_rows(rows).unwrap();
    let map = Mcp::affine(matrix, q.to_vec(), lower.to_vec(), upper.to_vec()).unwrap();
    let options = DiagramOptions::default().with_parameter_range((-reach, *reach));
    let diagram =
        Diagram::explore_sections(&map, &[*alpha], &options, &EnumerationOptions::default()).unwrap();
    assert!(!diagram.completeness().is_limited(), "{diagram}");
    (map, diagram)
}

/// Facets that are met within rounding of each other are one vertex, whose kind is that of all its arms.
#[test]
fn kinds_are_those_of_the_arms() {
    const INF: f64 = f64::INFINITY;
    let problems: [Affine; 3] = [
        (
            &[
                &[-1.0, 0.0, -2.0, 2.0],
                &[-1.0, 3.0, 3.0, 2.0],
                &[1.0, 1.0, 1.0, 3.0],
            ],
            &[2.0, -3.0, -2.0],
            &[0.0; 3],
            &[1.0, INF, 1.0],
            -0.2890625,
            6.0,
        ),
        (
            &[
                &[-0.0625, -0.0625, -0.125, 0.0],
                &[
                    5.7220458984375e-6,
                    3.814697265625e-6,
                    5.7220458984375e-6,
                    -3.814697265625e-6,
                ],
                &[12.0, 4.0, -4.0, 4.0],
            ],
            &[0.1875, 3.814697265625e-6, 4.0],
            &[0.0, -1.0, 0.0],
            &[INF, 1.0, INF],
            -0.2265625,
            6.0,
        ),
        (
            &[
                &[3.0, 0.0, 1.0, 2.0],
                &[3.0, -2.0, 1.0, 2.0],
                &[1.0, 0.0, 0.0, -1.0],
            ],
            &[-2.0, -1.0, 0.0],
            &[0.0; 3],
            &[3.0, 1.0, 2.0],
            -1.7890625,
            6.0,
        ),
    ];
    for problem in &problems {
        let (_, diagram) = sections(problem);
        for vertex in diagram.vertices() {
            let rates: Vec<f64> = vertex.arms.iter().map(|a| a.arm.tangent[3]).collect();
            let [a, b] = rates[..] else { continue };
            if a.abs().min(b.abs()) > 1e-3 && !matches!(vertex.kind, VertexKind::Start | VertexKind::Bound) {
                let turns = a * b > 0.0;
                assert_eq!(vertex.kind == VertexKind::Fold, turns, "{rates:?}\n{diagram}");
            }
        }
    }
}

/// Values of F that do not depend on x, in units far from those of the others: the solutions of the whole diagram are those at each α.
#[test]
fn units_of_constant_components_do_not_matter() {
    const INF: f64 = f64::INFINITY;
    let problems: [Affine; 4] = [
        (
            &[&[0.0, 0.0, 0.0], &[-0.03125, -0.03125, 0.03125]],
            &[100663296.0, 0.03125],
            &[0.0; 2],
            &[2.0, 1.0],
            1.6484375,
            6.0,
        ),
        (
            &[
                &[0.0, 0.0, 0.0],
                &[0.0, -1.4901161193847656e-8, 2.9802322387695313e-8],
            ],
            &[805306368.0, 1.4901161193847656e-8],
            &[0.0, -1.0],
            &[INF, 1.0],
            -1.0390625,
            6.0,
        ),
        (
            &[&[-0.0009765625, 0.0029296875, 0.0029296875], &[0.0, 0.0, 32768.0]],
            &[0.001953125, 32768.0],
            &[0.0; 2],
            &[3.0, INF],
            3.0859375,
            6.0,
        ),
        (
            &[&[0.0, 2.3283064365386963e-10]],
            &[0.0],
            &[0.0],
            &[1.5],
            -3.25,
            24.0,
        ),
    ];
    for problem in &problems {
        let (map, diagram) = sections(problem);
        // At -1/31, … no test function vanishes.
        for k in -5..=5 {
            let alpha = problem.5 * (f64::from(k) - 1.0 / 31.0) / 6.0;
            let here = all_solutions(&map, alpha, &EnumerationOptions::default()).unwrap();
            assert!(here.completeness.is_complete() && here.continua.is_empty());
            let found = diagram.solutions_at(&map, alpha).unwrap();
            assert_eq!(
                found.count(),
                Some(here.solutions.len()),
                "{problem:?} {alpha}\n{diagram}"
            );
        }
    }
}
