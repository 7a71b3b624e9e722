//! Units of the unknowns change nothing: with typical sizes given, the points agree to the last bit.

use std::ops::ControlFlow;

use super::curves::{lens, parabola_and_line, two_arcs, within};
use super::maps::{Plane, same_cells};
use semismooth::InputError;
use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::continuation::{
    Branch, Continuation, ContinuationError, ContinuationOptions, Diagram, DiagramOptions, Direction, Event,
    Termination, TransitionKind, arms_at,
};
use semismooth::piecewise::{
    Derivatives, Description, Kinks, MinMap, NonsmoothFunction, PiecewiseError, PiecewiseSmooth, Real,
    Selection, Traced,
};
use semismooth::sparse::Matrix;

/// A plane map whose y is measured in another unit.
struct InUnits {
    map: Plane,
    unit: f64,
    /// Whether the map itself states its typical sizes.
    tells: bool,
}

impl InUnits {
    fn natural(&self, x: &[f64]) -> [f64; 2] {
        [x[0] / self.unit, x[1]]
    }
}

impl PiecewiseSmooth for InUnits {
    same_cells!(map);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.map.test_functions(&self.natural(x), out);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        self.map.residual(s, &self.natural(x), out);
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let mut own = Matrix::zeros(jac.pattern().clone());
        self.map.jacobian(s, &self.natural(x), &mut own);
        jac.add(0, 0, own.get(0, 0) / self.unit);
        jac.add(0, 1, own.get(0, 1));
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl Derivatives for InUnits {
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        self.map.test_derivatives(&self.natural(x), &self.natural(d), out);
    }
    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        self.map.test_gradient(site, test, &self.natural(x), gradient);
        gradient[0] /= self.unit;
    }
}

impl Description for InUnits {
    fn typical_sizes(&self, sizes: &mut [f64]) {
        if self.tells {
            sizes[0] = self.unit;
        }
    }
}

/// About 1e-9 and 1e9.
const UNITS: [f64; 2] = [1.0 / (1 << 30) as f64, (1 << 30) as f64];

type Curve = (fn() -> Plane, [f64; 2]);

const CURVES: [Curve; 3] = [
    (parabola_and_line, [2.5, 5.25]),
    (lens, [0.75, 0.5]),
    (two_arcs, [0.6, 0.8]),
];

#[test]
fn the_same_branch_in_every_bit() {
    for (make, start) in CURVES {
        let range = within((-2.0, 6.0));
        let first = Branch::follow(&make(), &start, Direction::Decreasing, range.clone()).unwrap();
        for unit in UNITS {
            for tells in [false, true] {
                let map = InUnits {
                    map: make(),
                    unit,
                    tells,
                };
                let options = if tells {
                    range.clone()
                } else {
                    range.clone().with_typical_sizes(vec![unit, 1.0])
                };
                let x = [unit * start[0], start[1]];
                let branch = Branch::follow(&map, &x, Direction::Decreasing, options).unwrap();
                assert_eq!(branch.termination, first.termination);
                assert_eq!(branch.points.len(), first.points.len());
                for (p, q) in branch.points.iter().zip(&first.points) {
                    assert_eq!(map.natural(&p.x), q.x[..]);
                    assert_eq!((p.arclength, p.det_sign), (q.arclength, q.det_sign));
                    let length = p.tangent[0].hypot(p.tangent[1]);
                    assert!((length - 1.0).abs() < 1e-12);
                    // The same direction: p' = D q'.
                    let cross = p.tangent[0] * q.tangent[1] - unit * q.tangent[0] * p.tangent[1];
                    assert!(cross.abs() <= 1e-12 * p.tangent[0].abs());
                }
                assert_eq!(branch.transitions.len(), first.transitions.len());
                for (s, t) in branch.transitions.iter().zip(&first.transitions) {
                    assert_eq!(map.natural(&s.x), t.x[..]);
                    assert_eq!(
                        (s.kind, &s.before, &s.after, &s.test_functions),
                        (t.kind, &t.before, &t.after, &t.test_functions)
                    );
                    assert_eq!(s.arms.len(), t.arms.len());
                    let arms = s.arms.iter().zip(&t.arms).map(|(a, b)| (&a.tangent, &b.tangent));
                    let sides = [
                        (&s.tangent_before, &t.tangent_before),
                        (&s.tangent_after, &t.tangent_after),
                    ];
                    for (p, q) in sides.into_iter().chain(arms) {
                        assert!((p[0].hypot(p[1]) - 1.0).abs() < 1e-12);
                        let cross = p[0] * q[1] - unit * q[0] * p[1];
                        assert!(cross.abs() <= 1e-12 * p[0].abs().max(unit * p[1].abs()));
                    }
                }
            }
        }
    }
}

#[test]
fn saved_monitored_and_along_an_arm() {
    let unit = UNITS[0];
    let map = InUnits {
        map: lens(),
        unit,
        tells: true,
    };
    let start = || {
        Continuation::new(
            &map,
            &[0.75 * unit, 0.5],
            Direction::Decreasing,
            within((-2.0, 2.0)),
        )
        .unwrap()
        .with_monitor("y = 0.19", |x| x[0] - 0.19 * unit)
    };
    let mut run = start();
    let before: Vec<Event> = run.by_ref().take(4).map(Result::unwrap).collect();
    let saved = run.save().unwrap();
    assert_eq!(saved.x(), run.point().x);
    assert_eq!(before[3].x(), saved.x());
    let resumed: Vec<Event> = Continuation::resume(&map, &saved)
        .unwrap()
        .with_monitor("y = 0.19", |x| x[0] - 0.19 * unit)
        .map(Result::unwrap)
        .collect();
    let rest: Vec<Event> = run.map(Result::unwrap).collect();
    assert_eq!(resumed, rest);
    let met: Vec<f64> = before
        .iter()
        .chain(&rest)
        .filter_map(|e| match e {
            Event::Monitor(m) => Some(m.point.parameter()),
            _ => None,
        })
        .collect();
    assert_eq!(met.len(), 2);
    assert!((met[0] + 0.9).abs() < 1e-12 && (met[1] - 0.9).abs() < 1e-12);
    // The arm of a transition continues the curve itself.
    let branch = Branch::collect(start(), |_| ControlFlow::Continue(())).unwrap();
    let fold = &branch.transitions[0];
    assert_eq!((fold.kind, fold.parameter()), (TransitionKind::Fold, -1.0));
    let arm = &fold.arms[fold.followed.unwrap()];
    let on = Branch::follow_arm(&map, &fold.x, arm, within((-2.0, 2.0))).unwrap();
    assert!((on.transitions[0].parameter() - 1.0).abs() < 1e-12);
}

#[test]
fn diagrams_of_the_pitchfork() {
    for unit in UNITS {
        // z³ = αz for y = z·unit.
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            let z = x[0] / unit;
            a[0] = z * z * z - x[1] * z;
            b[0] = 1e9;
        })
        .with_typical_sizes(vec![unit, 1.0])
        .unwrap();
        let options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
        let mut seen = Vec::new();
        let diagram = Diagram::explore_observed(&map, &[[0.0, -0.5]], &options, |progress| {
            seen.push(progress.event.x()[0].abs());
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(!diagram.completeness().is_limited());
        // Tangents in x are nearly orthogonal to the α axis where y is of the order 1e9, and yet α varies.
        assert!(diagram.edges().iter().all(|e| !e.is_vertical()));
        let largest = seen.iter().fold(0.0_f64, |a, y| a.max(*y));
        assert!((largest / unit - 1.0).abs() < 1e-9, "{largest}");
        let three = diagram.solutions_at(&map, 0.25).unwrap();
        let mut y: Vec<f64> = three.points.iter().map(|s| s.x[0] / unit).collect();
        y.sort_by(f64::total_cmp);
        assert_eq!(y.len(), 3);
        assert!((y[0] + 0.5).abs() < 1e-12 && y[1].abs() < 1e-12 && (y[2] - 0.5).abs() < 1e-12);
        assert_eq!(three.index_sum(), Some(1));
        // |z − ½| + |α − ¼| = 0 is a single point.
        let point = MinMap::curve(3, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            let (z, s) = (x[0] / unit - 0.5, x[3] - 0.25);
            (a[0], b[0]) = (x[1] - z, x[1] + z);
            (a[1], b[1]) = (x[2] - s, x[2] + s);
            (a[2], b[2]) = (x[1] + x[2], 1e9);
        })
        .with_typical_sizes(vec![unit, 1.0, 1.0, 1.0])
        .unwrap();
        let start = [0.5 * unit, 0.0, 0.0, 0.25];
        let alone = Diagram::explore(&point, &[start], &options).unwrap();
        let found = alone.solutions_at(&point, 0.25).unwrap();
        assert_eq!(
            (found.isolated.as_slice(), found.points.len()),
            ([start.to_vec()].as_slice(), 0)
        );
        // Half of it, and then the rest, gives the whole.
        let half = Diagram::explore(&map, &[[0.0, -0.5]], &options.clone().with_max_points(12)).unwrap();
        assert!(half.completeness().is_limited());
        let none: [[f64; 2]; 0] = [];
        let whole = half.resume(&map, &none, &options).unwrap();
        assert!(!whole.completeness().is_limited());
        assert_eq!(whole.solutions_at(&map, 0.25).unwrap().count(), Some(3));
    }
}

#[test]
fn sizes_that_make_no_sense() {
    let map = lens();
    let follow = |sizes: Vec<f64>| {
        let options = within((-2.0, 2.0)).with_typical_sizes(sizes);
        Branch::follow(&map, &[0.75, 0.5], Direction::Decreasing, options).unwrap_err()
    };
    assert!(matches!(
        follow(vec![1.0]),
        ContinuationError::Input(InputError::Length {
            expected: 2,
            found: 1,
            ..
        })
    ));
    assert!(matches!(
        follow(vec![1.0, 0.0]),
        ContinuationError::Map(PiecewiseError::Size { index: 1, value: 0.0 })
    ));
    assert!(matches!(
        follow(vec![f64::NAN, 1.0]),
        ContinuationError::Input(InputError::NotFinite { index: 0, .. })
    ));
}

/// y = max(0, c α (0.3 − α)): flat bumps, each of which fits into one step.
#[test]
fn a_facet_crossed_twice_in_one_step() {
    for c in [1e-1, 1e-3, 1e-5] {
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0];
            b[0] = x[0] - c * x[1] * (0.3 - x[1]);
        });
        for (start, direction, order) in [
            (-0.5, Direction::Increasing, [0.0, 0.3]),
            (0.8, Direction::Decreasing, [0.3, 0.0]),
        ] {
            let options = within((-1.0, 1.0)).with_step(1.0);
            let branch = Branch::follow(&map, &[0.0, start], direction, options).unwrap();
            assert_eq!(branch.transitions.len(), 2, "c = {c}, from {start}");
            for (t, alpha) in branch.transitions.iter().zip(order) {
                assert_eq!(t.kind, TransitionKind::PassThrough);
                assert!((t.parameter() - alpha).abs() < 1e-12 / c.min(1e-2), "{t:?}");
            }
        }
    }
}

/// y₁/s = α and v + ½ |v| = α (1 + c α) with v = s y₂: y₁ is large where y₂ is small.
struct Apart {
    unit: f64,
    curved: f64,
}

impl Apart {
    fn v(&self, a: f64) -> f64 {
        let right = a * (1.0 + self.curved * a);
        if right > 0.0 { right / 1.5 } else { right / 0.5 }
    }
}

impl NonsmoothFunction for Apart {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], k: &mut Kinks<'_, T>, out: &mut [T]) {
        let v = x[1] * self.unit;
        let kink = k.abs(v);
        out[0] = x[0] / self.unit - x[2];
        out[1] = v + kink * 0.5 - x[2] * (x[2] * self.curved + 1.0);
    }
}

/// Without sizes the tangent is almost that of y₁ alone, orthogonal to the gradient of v up to 10⁻¹⁸: it crosses the facet nevertheless,
/// and a start that is far from the facet in its own units is not on it.
#[test]
fn facets_are_crossed_in_variables_of_small_units() {
    for curved in [0.0, 0.25] {
        for unit in [1e5, 1e9] {
            let function = Apart { unit, curved };
            let map = Traced::new(Apart { unit, curved });
            for (begin, direction) in [(-0.9, Direction::Increasing), (0.9, Direction::Decreasing)] {
                let start = [unit * begin, function.v(begin) / unit, begin];
                let options = within((-1.0, 1.0)).with_step(0.05 * unit).with_max_step(unit);
                let branch = Branch::follow(&map, &start, direction, options).unwrap();
                assert_eq!(
                    branch.termination,
                    Termination::ParameterRange,
                    "{unit:e} {curved}"
                );
                for p in &branch.points {
                    let [y, v, a] = [p.x[0] / unit, p.x[1] * unit, p.x[2]];
                    assert!(
                        (y - a).abs() < 1e-12 && (v - function.v(a)).abs() < 1e-9,
                        "{v} {a}"
                    );
                }
                let [t] = branch.transitions.as_slice() else {
                    panic!("{unit:e} {curved}: {:?}", branch.transitions);
                };
                assert_eq!((t.kind, t.arms.len()), (TransitionKind::PassThrough, 1));
                assert!(t.parameter().abs() < 1e-12, "{}", t.parameter());
            }
        }
    }
}

/// M v + v² / 10 = c α, or M times v₀ (v₀ − α), v₁ + v₀ − 2 α, v₂ − v₁ + v₀, with unknowns and parameter in units.
struct Sheared {
    units: [f64; 4],
    branching: bool,
}

const SHEAR: [[f64; 3]; 3] = [[1.0, 0.4, -0.3], [0.2, 1.0, 0.5], [-0.6, 0.1, 1.0]];

impl NonsmoothFunction for Sheared {
    fn num_vars(&self) -> usize {
        4
    }
    fn num_residuals(&self) -> usize {
        3
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        let v: Vec<T> = x.iter().zip(&self.units).map(|(x, u)| *x / *u).collect();
        let terms = match self.branching {
            true => [v[0] * (v[0] - v[3]), v[1] + v[0] - v[3] * 2.0, v[2] - v[1] + v[0]],
            false => [v[0] - v[3], v[1] - v[3] * 2.0, v[2] + v[3] * 3.0],
        };
        for ((out, row), v) in out.iter_mut().zip(SHEAR).zip(&v) {
            *out = terms[0] * row[0] + terms[1] * row[1] + terms[2] * row[2];
            if !self.branching {
                *out += *v * *v / 10.0;
            }
        }
    }
}

/// Units 10⁹ apart make the least singular value of ∇H small: yet no regular start is taken for singular, and no branch point for regular.
#[test]
fn units_far_apart_do_not_make_starts_singular() {
    const TANGENT: [f64; 4] = [1.0, 2.0, -3.0, 1.0];
    let (mut crossings, options) = (0, ContinuationOptions::default());
    for k in 0..81_u32 {
        let units = [0, 1, 2, 3].map(|j| [3e-5, 1.0, 3e4][(k / 3_u32.pow(j)) as usize % 3]);
        let map = |branching| Traced::new(Sheared { units, branching });
        let list = arms_at(&map(false), &[0.0; 4], &options).unwrap();
        let (arms, complete) = (list.arms, !list.certainty.is_undecided());
        assert_eq!((arms.len(), complete), (2, true), "{units:?}");
        for arm in arms {
            let natural: Vec<f64> = arm.tangent.iter().zip(units).map(|(t, u)| t / u).collect();
            for (v, expected) in natural.iter().zip(TANGENT) {
                assert!((v / natural[3] - expected).abs() < 1e-9, "{units:?} {natural:?}");
            }
        }
        let list = arms_at(&map(true), &[0.0; 4], &options).unwrap();
        let (arms, complete) = (list.arms, !list.certainty.is_undecided());
        assert!(!complete || arms.len() == 4, "{units:?} {arms:?}");
        crossings += usize::from(complete);
    }
    assert!(crossings > 0);
}

/// The default shortest step scales with α: steps in its unit are not refused.
#[test]
fn steps_in_a_small_unit_of_the_parameter() {
    let follow = |unit: f64| {
        let units = [1.0, 1.0, 1.0, unit];
        let options = ContinuationOptions::default()
            .with_typical_sizes(units.to_vec())
            .with_step(0.05 * unit)
            .with_max_step(0.125 * unit)
            .with_parameter_range((0.0, unit));
        let map = Traced::new(Sheared {
            units,
            branching: false,
        });
        Branch::follow(&map, &[0.0; 4], Direction::Increasing, options).unwrap()
    };
    let (first, unit) = (follow(1.0), UNITS[0]);
    let branch = follow(unit);
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert_eq!(branch.points.len(), first.points.len());
    for (p, q) in branch.points.iter().zip(&first.points) {
        assert_eq!(
            (p.x[..3].to_vec(), p.x[3], p.arclength),
            (q.x[..3].to_vec(), unit * q.x[3], unit * q.arclength)
        );
    }
}

/// Where y₂ stays at its bound along a vertical segment, ∇H does not depend on y₁: only ∇θ shows that the arm leaves the kink of y₂ and
/// does not run in it.
#[test]
fn vertical_arms_leave_kinks_in_any_unit() {
    // 0 ≤ y₁ ≤ 3 ⟂ −2 α − 2 and 0 ≤ y₂ ⟂ 2 y₁ + y₂ − α − 3.
    let follow = |[first, second]: [f64; 2]| {
        let rows = [[0.0, 0.0, -2.0], [2.0 / first, 1.0 / second, -1.0]];
        let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![-2.0, -3.0]).unwrap();
        let map = Mcp::new(f, vec![0.0; 2], vec![3.0 * first, f64::INFINITY]).unwrap();
        let options = ContinuationOptions::default()
            .with_parameter_range((-8.0, 8.0))
            .with_typical_sizes(vec![first, second, 1.0]);
        let start = [0.0, 0.5 * second, -2.5];
        Branch::follow(&map, &start, Direction::Increasing, options).unwrap()
    };
    let of = |branch: &Branch, units: [f64; 2]| -> Vec<(TransitionKind, usize, [f64; 3])> {
        let transitions = branch.transitions.iter();
        let told = transitions.map(|t| {
            (
                t.kind,
                t.arms.len(),
                [t.x[0] / units[0], t.x[1] / units[1], t.x[2]],
            )
        });
        told.collect()
    };
    use TransitionKind::{PassThrough, VerticalBegin, VerticalEnd};
    let exact = [
        (VerticalBegin, 1, [0.0, 2.0, -1.0]),
        (PassThrough, 1, [1.0, 0.0, -1.0]),
        (VerticalEnd, 1, [3.0, 0.0, -1.0]),
        (PassThrough, 1, [3.0, 0.0, 3.0]),
    ];
    for exponent in [0, 10, 20, 30] {
        let unit = f64::from(exponent).exp2();
        for units in [[1.0, unit], [1.0 / unit, 1.0], [unit.sqrt().recip(), unit.sqrt()]] {
            let branch = follow(units);
            assert_eq!(of(&branch, units), exact, "{units:?}");
            assert_eq!(branch.termination, Termination::ParameterRange);
        }
    }
}
