//! Diagrams from all solutions at chosen parameters, against brute force over all selections; and their output.

use std::ops::ControlFlow;

use crate::common;
use semismooth::contact::{CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::continuation::{
    Diagram, DiagramCompleteness, DiagramOptions, Limit, SectionProgress, VertexKind, certify,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::linear::{DenseLu, LinearSolver};
use semismooth::output::{Column, write_diagram_csv};
use semismooth::piecewise::{LocalUniqueness, MinMap, PiecewiseSmooth, Selections};
use semismooth::sparse::Matrix;

const RANGE: (f64, f64) = (-4.0, 4.0);

/// Three contact nodes, p = 3, found by a random search: 17 solutions at α = 0, five branches.
fn three_nodes() -> CondensedContact<PlanarCoulomb> {
    let stiffness = Matrix::from_rows(&[
        [2.0, -1.3, -0.2, 0.0, 0.0, -0.3],
        [-1.3, 2.1, -0.3, 0.1, -0.2, 0.2],
        [-0.2, -0.3, 1.9, -0.8, 0.2, 0.1],
        [0.0, 0.1, -0.8, 1.9, 0.0, -0.1],
        [0.0, -0.2, 0.2, 0.0, 2.0, -1.1],
        [-0.3, 0.2, 0.1, -0.1, -1.1, 2.3],
    ]);
    let pick = |first: usize| {
        let entries: Vec<_> = (0..3).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(3, 6, &entries).unwrap()
    };
    let load = LoadPath::affine(
        vec![1.6, -2.3, 0.7, -1.9, 1.5, -3.1],
        vec![-0.2, -0.6, -0.9, 0.4, 0.9, -0.2],
    );
    let friction = FrictionCoefficient::nodal(vec![5.5, 7.75, 8.75]).unwrap();
    FullContact::planar(stiffness.unwrap(), pick(0), pick(1), load, friction)
        .unwrap()
        .condensed()
        .unwrap()
}

/// A piece of curve: the segment of one selection between two points.
struct Segment {
    sign: i8,
    ends: [Vec<f64>; 2],
}

/// The solution set in `RANGE` by trying all selections: each has one solution y(α), affine in α, which solves H = 0 where it lies in the
/// cell of the selection.
fn segments(map: &CondensedContact<PlanarCoulomb>) -> Vec<Segment> {
    let n = map.num_residuals();
    let mut list = Vec::new();
    for selection in Selections::all(map) {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, &vec![0.0; n + 1], &mut jac);
        let mut lu = DenseLu::new();
        lu.analyze(jac.leading_columns(n).pattern).unwrap();
        lu.factor(jac.leading_columns(n)).unwrap();
        let sign = lu.log_det().unwrap().0;
        let mut at = |alpha: f64| {
            let mut x = vec![0.0; n + 1];
            x[n] = alpha;
            let mut r = vec![0.0; n];
            map.residual(&selection, &x, &mut r);
            let mut y = r;
            lu.solve_in_place(&mut y).unwrap();
            y.iter_mut().for_each(|v| *v = -*v);
            y.push(alpha);
            y
        };
        let (a, b) = (at(RANGE.0), at(RANGE.1));
        let total: usize = (0..map.num_sites()).map(|s| map.num_tests(s)).sum();
        let (mut ta, mut tb) = (vec![0.0; total], vec![0.0; total]);
        map.test_functions(&a, &mut ta);
        map.test_functions(&b, &mut tb);
        let (mut low, mut high): (f64, f64) = (0.0, 1.0);
        let mut first = 0;
        for site in 0..map.num_sites() {
            let range = first..first + map.num_tests(site);
            first = range.end;
            for facet in map.cell(site, selection.piece(site)) {
                let (m0, m1) = (facet.margin(&ta[range.clone()]), facet.margin(&tb[range.clone()]));
                // m0 + s (m1 − m0) ≥ 0
                if m1 > m0 {
                    low = low.max(-m0 / (m1 - m0));
                } else if m1 < m0 {
                    high = high.min(m0 / (m0 - m1));
                } else if m0 < 0.0 {
                    high = -1.0;
                }
            }
        }
        if high - low > 1e-9 {
            let mut point = |s: f64| at(RANGE.0 + s * (RANGE.1 - RANGE.0));
            list.push(Segment {
                sign,
                ends: [point(low), point(high)],
            });
        }
    }
    list
}

fn near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-8)
}

/// Chains of segments that share end points, and which of them are closed.
fn chains(list: &[Segment]) -> (usize, usize) {
    let mut seen = vec![false; list.len()];
    let (mut count, mut closed) = (0, 0);
    for first in 0..list.len() {
        if seen[first] {
            continue;
        }
        count += 1;
        let mut members = vec![first];
        seen[first] = true;
        let mut next = 0;
        let mut loose = 0;
        while next < members.len() {
            let k = members[next];
            next += 1;
            for end in &list[k].ends {
                let met: Vec<usize> = (0..list.len())
                    .filter(|&j| j != k && list[j].ends.iter().any(|e| near(e, end)))
                    .collect();
                assert!(met.len() <= 1, "no branching in this problem");
                loose += usize::from(met.is_empty());
                for j in met {
                    if !seen[j] {
                        seen[j] = true;
                        members.push(j);
                    }
                }
            }
        }
        closed += usize::from(loose == 0);
    }
    (count, closed)
}

#[test]
fn seventeen_solutions_on_five_branches() {
    let map = three_nodes();
    let options = DiagramOptions::default().with_parameter_range(RANGE);
    let sections = EnumerationOptions::default();
    let diagram = Diagram::explore_sections(&map, &[0.0], &options, &sections).unwrap();
    assert!(!diagram.completeness().is_limited(), "{diagram}");
    let exact = segments(&map);
    assert_eq!(chains(&exact), (5, 4));
    assert_eq!(diagram.branches().len(), 5, "{diagram}");
    assert_eq!(diagram.components().len(), 5, "{diagram}");
    assert_eq!(diagram.isolas().len(), 4, "{diagram}");
    // 17 starts cut as many edges in two.
    let starts = diagram.vertices().iter().filter(|v| v.is_start).count();
    assert_eq!(starts, 17);
    assert_eq!(diagram.edges().len(), exact.len() + starts, "{diagram}");
    for k in 0..=400 {
        let alpha = -3.98 + 0.02 * f64::from(k) * 0.995;
        let through: Vec<&Segment> = exact
            .iter()
            .filter(|s| {
                let [a, b] = [&s.ends[0], &s.ends[1]].map(|e| e[6]);
                alpha > a.min(b) && alpha < a.max(b)
            })
            .collect();
        let at = diagram.solutions_at(&map, alpha).unwrap();
        assert_eq!(at.count(), Some(through.len()), "{alpha}");
        assert_eq!(at.index_sum(), Some(1), "{alpha}");
        let set = all_solutions(&map, alpha, &sections).unwrap();
        assert_eq!(set.solutions.len(), through.len(), "{alpha}");
        for s in through {
            let [a, b] = &s.ends;
            let u = (alpha - a[6]) / (b[6] - a[6]);
            let x: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + u * (b - a)).collect();
            let found = at.points.iter().find(|p| near(&p.x, &x));
            assert_eq!(found.unwrap().det_sign, Some(s.sign));
        }
    }
    let zero = diagram.solutions_at(&map, 0.0).unwrap();
    assert_eq!((zero.count(), zero.index_sum()), (Some(17), Some(1)));
    // Signs change at folds and nowhere else.
    for vertex in diagram.vertices().iter().filter(|v| v.arms.len() == 2) {
        let signs: Vec<i8> = vertex
            .arms
            .iter()
            .map(|a| diagram.edges()[a.edge.unwrap()].det_signs()[0])
            .collect();
        assert_eq!(signs[0] != signs[1], vertex.kind == VertexKind::Fold);
    }
    // At a fold two solutions of opposite index meet.
    let fold = diagram.folds()[3].parameter();
    let at = diagram.solutions_at(&map, fold).unwrap();
    assert_eq!(at.points.iter().filter(|s| s.index == Some(0)).count(), 1);
    assert_eq!(at.index_sum(), Some(1));
}

/// Local uniqueness fails at the folds of all branches, closed ones included, and nowhere else.
#[test]
fn certificates_fail_exactly_at_folds() {
    let map = three_nodes();
    let options = DiagramOptions::default().with_parameter_range(RANGE);
    let diagram =
        Diagram::explore_sections(&map, &[0.0, 1.0], &options, &EnumerationOptions::default()).unwrap();
    let load = Matrix::identity(map.num_residuals());
    let certificate = |x: &[f64]| certify(&map, x, &load, &options.continuation).unwrap();
    let (mut folds, mut others) = (0, 0);
    for vertex in diagram.vertices() {
        let found = certificate(&vertex.x);
        if vertex.kind == VertexKind::Fold {
            assert!(found.fails(), "{} {found:?}", vertex.parameter());
            folds += 1;
        } else {
            assert!(
                found.is_certified(),
                "{} {} {found:?}",
                vertex.parameter(),
                vertex.kind
            );
            others += 1;
        }
    }
    assert!(
        folds == diagram.folds().len() && folds > 15 && others > 15,
        "{diagram}"
    );
    for edge in diagram.edges() {
        let [a, b] = [&edge.points[0], edge.points.last().unwrap()];
        let middle: Vec<f64> = a.x.iter().zip(&b.x).map(|(a, b)| 0.5 * (a + b)).collect();
        match certificate(&middle) {
            LocalUniqueness::Lipschitz { sign, selections, .. } => {
                assert_eq!((sign, selections), (a.det_sign, 1));
            }
            other => panic!("{other:?}"),
        }
    }
}

/// An observer is called for each section and for each event on the curves; once it has stopped it is not called again, and the missing
/// part is reported.
#[test]
fn sections_are_observed() {
    let (map, none) = (three_nodes(), EnumerationOptions::default());
    let options = DiagramOptions::default().with_parameter_range(RANGE);
    let sections = [0.0, 0.5];
    let (mut told, mut points) = (Vec::new(), 0);
    let whole = Diagram::explore_sections_observed(&map, &sections, &options, &none, |progress| {
        match progress {
            SectionProgress::Solutions(alpha) => told.push(*alpha),
            SectionProgress::Curves(now) => points = now.points,
            _ => unreachable!(),
        }
        ControlFlow::Continue(())
    });
    told.dedup();
    assert_eq!(told, sections);
    let whole = whole.unwrap();
    assert!(whole == Diagram::explore_sections(&map, &sections, &options, &none).unwrap());
    assert!(points > 0);

    let stopped = |at: &dyn Fn(&SectionProgress<'_>) -> bool| {
        let mut asked_after = 0;
        let mut is_over = false;
        let diagram = Diagram::explore_sections_observed(&map, &sections, &options, &none, |progress| {
            asked_after += usize::from(is_over);
            is_over |= at(progress);
            match is_over {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        })
        .unwrap();
        assert_eq!(asked_after, 0);
        match diagram.completeness() {
            DiagramCompleteness::Limited(list) => assert!(list.contains(&Limit::Interrupted), "{list:?}"),
            other => panic!("{other}"),
        }
        diagram
    };
    let listing = stopped(&|p| *p == SectionProgress::Solutions(0.5));
    assert_eq!((listing.vertices().len(), listing.edges().len()), (0, 0));
    let following = stopped(&|p| matches!(p, SectionProgress::Curves(now) if now.edges == 2));
    assert!(following.edges().len() >= 2 && following.edges().len() < whole.edges().len());
}

#[test]
fn a_section_that_is_not_complete_is_reported() {
    let options = DiagramOptions::default().with_parameter_range(RANGE);
    let few = EnumerationOptions::default().with_max_nodes(3);
    let diagram = Diagram::explore_sections(&three_nodes(), &[0.0], &options, &few).unwrap();
    match diagram.completeness() {
        DiagramCompleteness::Limited(list) => assert!(list.contains(&Limit::Solutions { parameter: 0.0 })),
        other => panic!("{other}"),
    }
}

#[test]
fn grazing_solutions_have_no_index() {
    let case = common::cases().into_iter().find(|c| c.name == "p1_ex3").unwrap();
    let map = case.problem.condensed().unwrap();
    let options = DiagramOptions::default().with_parameter_range((0.0, 5.0));
    let diagram =
        Diagram::explore_sections(&map, &[1.0, 3.0], &options, &EnumerationOptions::default()).unwrap();
    let at = diagram.solutions_at(&map, 3.0).unwrap();
    assert_eq!((at.count(), at.index_sum()), (Some(2), None), "{diagram}");
    assert_eq!(
        (diagram.components().len(), diagram.branches().len()),
        (1, 2),
        "{diagram}"
    );
    let centre = diagram.vertices().iter().find(|v| v.arms.len() == 3).unwrap();
    assert!(
        (centre.parameter() - 2.0).abs() < 1e-9 && centre.complete,
        "{diagram}"
    );
    assert_eq!(diagram.solutions_at(&map, 2.0).unwrap().continua.len(), 1);
}

fn circle() -> (impl PiecewiseSmooth, Diagram) {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    });
    let diagram = Diagram::explore(&map, &[[0.8, 0.6]], &DiagramOptions::default()).unwrap();
    (map, diagram)
}

/// A section through a point of an edge, or within the tolerance at which parameters count as equal, meets it once.
#[test]
fn sections_at_points_of_edges_meet_them_once() {
    let (map, diagram) = circle();
    let mut looked = 0;
    for point in diagram.edges().iter().flat_map(|e| &e.points) {
        let alpha = point.parameter();
        if alpha.abs() > 0.99 {
            continue;
        }
        for shift in [0.0, 1e-13, -1e-13, 5e-11, -5e-11, 1e-6, -1e-6] {
            let at = diagram.solutions_at(&map, alpha + shift).unwrap();
            let half = (1.0 - (alpha + shift) * (alpha + shift)).sqrt();
            assert_eq!(
                (at.count(), at.index_sum()),
                (Some(2), Some(0)),
                "{alpha} {shift:e}"
            );
            for solution in &at.points {
                assert!((solution.x[0].abs() - half).abs() < 1e-9, "{alpha} {shift:e}");
                assert!(solution.index.is_some());
            }
            looked += 1;
        }
    }
    assert!(looked > 50, "{looked}");
}

#[test]
fn the_table_holds_every_point() {
    let map = three_nodes();
    let options = DiagramOptions::default().with_parameter_range(RANGE);
    let polygons = Diagram::explore_sections(&map, &[0.0], &options, &EnumerationOptions::default()).unwrap();
    let (round, curved) = circle();
    let check = |map: &dyn PiecewiseSmooth, diagram: &Diagram| {
        let mut out = Vec::new();
        let columns = [Column::entry("a, b", 0)];
        write_diagram_csv(&mut out, map, diagram, &columns).unwrap();
        let text = String::from_utf8(out).unwrap();
        let mut lines = text.split_terminator("\r\n");
        assert!(
            lines
                .next()
                .unwrap()
                .starts_with("edge,arclength,parameter,event,det,\"a, b\",")
        );
        for (e, edge) in diagram.edges().iter().enumerate() {
            for (k, point) in edge.points.iter().enumerate() {
                let fields: Vec<&str> = lines.next().unwrap().split(',').collect();
                assert_eq!(fields[0].parse::<usize>().unwrap(), e);
                assert_eq!(fields[1].parse::<f64>().unwrap(), point.arclength);
                assert_eq!(fields[2].parse::<f64>().unwrap(), point.parameter());
                let ends = [(0, edge.from), (edge.points.len() - 1, edge.to)];
                let event = match ends.iter().find(|end| end.0 == k) {
                    Some((_, end)) => diagram.vertices()[end.vertex].kind.name(),
                    None if edge.smooth_folds.contains(&k) => "smooth fold",
                    None => "point",
                };
                assert_eq!(fields[3], event);
                assert_eq!(fields[4].parse::<i8>().ok(), point.det_sign);
                assert_eq!(fields[5].parse::<f64>().unwrap(), point.x[0]);
                assert_eq!(fields.len(), 6 + map.num_sites());
            }
        }
        assert_eq!(lines.next(), None);
    };
    check(&map, &polygons);
    check(&round, &curved);
    assert_eq!(curved.folds().len(), 2);
}

#[cfg(feature = "json")]
#[test]
fn the_json_object_agrees_with_the_diagram() {
    use semismooth::output::write_diagram_json;
    let map = three_nodes();
    let options = DiagramOptions::default().with_parameter_range((f64::NEG_INFINITY, 4.0));
    let diagram = Diagram::explore_sections(&map, &[0.0], &options, &EnumerationOptions::default()).unwrap();
    let mut out = Vec::new();
    write_diagram_json(&mut out, &map, &diagram, &[Column::entry("λ", 0)]).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&out).unwrap();
    assert!(json["parameter_range"][0].is_null());
    assert_eq!(json["parameter_range"][1], 4.0);
    assert_eq!(json["complete"], diagram.completeness().is_complete());
    let length = |key: &str| json[key].as_array().unwrap().len();
    assert_eq!(length("vertices"), diagram.vertices().len());
    assert_eq!(length("edges"), diagram.edges().len());
    assert_eq!(
        (length("branches"), length("isolas"), length("folds")),
        (5, 4, diagram.folds().len())
    );
    for (edge, value) in diagram.edges().iter().zip(json["edges"].as_array().unwrap()) {
        assert_eq!(value["from"]["vertex"], edge.from.vertex);
        assert_eq!(value["det_signs"][0], edge.det_signs()[0]);
        for (p, v) in edge.points.iter().zip(value["points"].as_array().unwrap()) {
            assert!((v["values"]["λ"].as_f64().unwrap() - p.x[0]).abs() <= 1e-15 * p.x[0].abs());
        }
        let vertex = &json["vertices"][edge.to.vertex];
        assert_eq!(
            vertex["arms"][edge.to.arm]["edge"].as_u64().map(|e| e as usize),
            diagram.vertices()[edge.to.vertex].arms[edge.to.arm].edge
        );
    }
}

#[cfg(feature = "svg")]
#[test]
fn negative_determinants_are_dashed() {
    use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};
    let (_, diagram) = circle();
    let style = |_: &_, _: &[usize]| SegmentStyle::new("curve", Colour::BLUE);
    let panel = Panel::new("α", "y").with_diagram(&diagram, |x| x[0], style);
    let svg = BranchDiagram::new(panel).to_svg().unwrap();
    assert!(svg.contains("det &lt; 0"));
    // One half of the circle, and the entry of the legend; the other half is solid.
    assert_eq!(svg.matches("stroke-dasharray").count(), 2);
    let (map, line) = {
        let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] - x[1];
            b[0] = 1e9;
        });
        let range = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
        let line = Diagram::explore(&map, &[[0.5, 0.5]], &range).unwrap();
        (map, line)
    };
    assert_eq!(line.solutions_at(&map, 0.25).unwrap().index_sum(), Some(1));
    let panel = Panel::new("α", "y").with_diagram(&line, |x| x[0], style);
    assert!(!BranchDiagram::new(panel).to_svg().unwrap().contains("det &lt; 0"));
}

/// α = |y| between −1 and 1: two edges from the bound to the kink, of opposite determinants.
#[test]
fn tables_in_words() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    let options = DiagramOptions::default().with_parameter_range((-1.0, 0.75));
    let diagram = Diagram::explore(&map, &[[0.5, 0.5]], &options).unwrap();
    let text = diagram.to_string();
    let lines: Vec<&str> = text.lines().collect();
    let (edges, vertices) = (diagram.edges(), diagram.vertices());
    assert_eq!(lines.len(), 1 + 1 + vertices.len() + 1 + edges.len());
    assert_eq!(
        lines[0],
        format!(
            "1 component, 1 branch, {} edges, {} vertices, nothing else was found within the bounds",
            edges.len(),
            vertices.len()
        )
    );
    assert_eq!(
        lines[1],
        "vertex             parameter  kind                      edges"
    );
    assert_eq!(lines[2 + vertices.len()], "  edge    from      to    points  det");
    let kinds: Vec<(String, f64)> = vertices
        .iter()
        .map(|v| (v.kind.to_string(), v.parameter()))
        .collect();
    let count = |kind: &str, alpha: f64| {
        kinds
            .iter()
            .filter(|k| k.0 == kind && (k.1 - alpha).abs() < 1e-12)
            .count()
    };
    assert_eq!(
        (count("start", 0.5), count("fold", 0.0), count("bound", 0.75)),
        (1, 1, 2),
        "{text}"
    );
    for (v, vertex) in vertices.iter().enumerate() {
        let words: Vec<&str> = lines[2 + v].split_whitespace().collect();
        let met: Vec<String> = vertex
            .arms
            .iter()
            .filter_map(|a| a.edge)
            .map(|e| e.to_string())
            .collect();
        let number = |alpha: &str| (alpha.to_owned(), vertex.kind.to_string());
        let (alpha, kind) = match vertex.kind {
            VertexKind::Start => number("0.500000000000"),
            VertexKind::Fold => number("0.000000000000"),
            _ => number("0.750000000000"),
        };
        assert_eq!(words[..3], [v.to_string(), alpha, kind], "{text}");
        assert_eq!(words[3..], met, "{text}");
    }
    // y < 0 on one side of the fold, y > 0 on the other.
    for (e, edge) in edges.iter().enumerate() {
        let y = edge.points[edge.points.len() / 2].x[0];
        // The map is max(−(α − y), −(α + y)) or its negative, according to its sign.
        let words: Vec<&str> = lines[3 + vertices.len() + e].split_whitespace().collect();
        let expected = [e, edge.from.vertex, edge.to.vertex, edge.points.len()].map(|k| k.to_string());
        assert_eq!(words[..4], expected, "{text}");
        assert_eq!(words[4..], [if y < 0.0 { "+" } else { "-" }], "{text}");
    }
}

/// What an incomplete diagram reports about itself.
#[test]
fn limits_in_words() {
    use semismooth::continuation::Termination;
    let curve = Limit::Curve {
        vertex: 3,
        termination: Termination::Unbounded,
    };
    for (limit, text) in [
        (Limit::EdgeLimit, "edge limit"),
        (Limit::PointLimit, "point limit"),
        (Limit::TimeLimit, "time limit"),
        (Limit::Interrupted, "interrupted"),
        (curve.clone(), "tends to infinity at vertex 3"),
        (
            Limit::Solutions { parameter: -0.5 },
            "solutions at parameter -0.5 not all known",
        ),
        (Limit::Arms { vertex: 7 }, "arms of vertex 7 undecided"),
        (
            Limit::Contradiction { vertex: 1 },
            "a curve arrived at vertex 1 along the arm of another edge",
        ),
    ] {
        assert_eq!(limit.to_string(), text);
    }
    let list = DiagramCompleteness::Limited(vec![Limit::EdgeLimit, curve]);
    assert_eq!(
        list.to_string(),
        "incomplete: edge limit; tends to infinity at vertex 3"
    );
    // A run that reaches its limits reports the same.
    let (map, _) = circle();
    let few = DiagramOptions::default().with_max_points(5);
    let cut = Diagram::explore(&map, &[[0.8, 0.6]], &few).unwrap();
    let first = cut.to_string().lines().next().unwrap().to_owned();
    assert!(first.contains("incomplete: "), "{first}");
    assert!(first.contains("point limit"), "{first}");
}
