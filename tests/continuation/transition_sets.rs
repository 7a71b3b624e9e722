//! Transition sets of the model with one contact node (Hild and Renard 2005), against the analytic lines.

use crate::maps::{one_piece, two_pieces};
use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, FrictionCurve, FullContact, LoadPath,
    OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, FoldSet, Termination, TransitionSet};
use semismooth::piecewise::check::CheckOptions;
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use semismooth::sparse::Matrix;

fn node(load: LoadPath, friction: FrictionCoefficient) -> FullContact<PlanarCoulomb> {
    FullContact::planar(
        Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap(),
        Matrix::from_rows(&[[1.0, 0.0]]).unwrap(),
        Matrix::from_rows(&[[0.0, 1.0]]).unwrap(),
        load,
        friction,
    )
    .unwrap()
}

/// x = (u_ν, u_t, λ_ν, λ_t, f_ν, f_t) at constant F.
fn load_plane(friction: f64) -> FullContact<PlanarCoulomb> {
    let load = LoadPath::affine(vec![0.0, 0.0], vec![1.0, 0.0]);
    let problem = node(load, FrictionCoefficient::nodal(vec![friction]).unwrap());
    problem
        .with_second_parameter(vec![0.0, 1.0], problem.node_law().clone())
        .unwrap()
}

/// x = (u_ν, u_t, λ_ν, λ_t, F, f_t) at f_ν = 1.5.
fn friction_plane() -> FullContact<PlanarCoulomb> {
    let problem = node(
        LoadPath::constant(vec![1.5, 0.0]),
        FrictionCoefficient::affine(vec![0.0], vec![1.0]).unwrap(),
    );
    problem
        .with_second_parameter(vec![0.0, 1.0], problem.node_law().clone())
        .unwrap()
}

fn follow<P: PiecewiseSmooth>(set: &TransitionSet<P>, x: &[f64], range: (f64, f64)) -> Branch {
    let options = ContinuationOptions::default()
        .with_parameter_range(range)
        .with_max_step(0.1);
    Branch::follow(set, x, Direction::Increasing, options).unwrap()
}

#[test]
fn families_and_their_sets_keep_the_contract() {
    let samples: Vec<Vec<f64>> = (0..60)
        .map(|k| {
            (0..6)
                .map(|j| (f64::from(k * 7 + j * 13) * 0.37).sin() * 2.0 + if j >= 4 { 2.5 } else { 0.0 })
                .collect()
        })
        .collect();
    for family in [load_plane(1.5), friction_plane()] {
        semismooth::piecewise::check::check(&family, &samples, &CheckOptions::default()).unwrap();
    }
}

#[test]
fn stick_and_slip_meet_where_the_traction_is_the_bound() {
    for friction in [1.0, 3.0] {
        let set = TransitionSet::new(load_plane(friction), 0, 2).unwrap();
        let line = follow(
            &set,
            &[0.0, 0.0, 2.0, -2.0 * friction, 2.0, -2.0 * friction],
            (-1e3, 5.0),
        );
        // The line ends at the apex f = 0, where all test functions vanish.
        assert_eq!(line.termination, Termination::End);
        assert!(line.transitions[0].x.iter().all(|v| v.abs() < 1e-12));
        for point in &line.points {
            let (normal, tangential) = (point.x[4], point.x[5]);
            assert!((friction * normal - tangential.abs()).abs() < 1e-11);
        }
        // The line consists of folds where the slope of slip is negative: F > (λ+3μ)/(λ+μ) = 2.
        let p = &line.points[0];
        assert_eq!(set.is_fold(&p.selection, &p.x).unwrap(), Some(friction > 2.0));
    }
}

#[test]
fn contact_is_lost_on_the_line_of_bifurcations() {
    for friction in [1.0, 3.0] {
        let set = TransitionSet::new(load_plane(friction), 0, 0).unwrap();
        let line = follow(&set, &[0.0, -1.0, 0.0, 0.0, 1.0, -2.0], (-3.0, 2.0));
        assert_eq!(line.termination, Termination::ParameterRange);
        // One point of codimension two: the apex, between slip− and slip+.
        assert_eq!(line.transitions.len(), 1);
        assert!(line.transitions[0].x.iter().all(|v| v.abs() < 1e-12));
        for p in &line.points {
            let (normal, tangential) = (p.x[4], p.x[5]);
            assert!((4.0 * normal + 2.0 * tangential).abs() < 1e-11);
            let fold = set.is_fold(&p.selection, &p.x).unwrap();
            if normal.abs() > 1e-9 {
                assert_eq!(
                    fold,
                    Some(normal > 0.0 && friction > 2.0),
                    "{normal} {tangential}"
                );
            }
        }
    }
}

#[test]
fn lines_of_the_plane_of_friction_and_load() {
    let set = TransitionSet::new(friction_plane(), 0, 2).unwrap();
    let line = follow(&set, &[0.0, 0.0, 1.5, -6.0, 4.0, -6.0], (-7.0, -0.5));
    assert_eq!(line.termination, Termination::ParameterRange);
    for p in &line.points {
        let (friction, tangential) = (p.x[4], p.x[5]);
        assert!((1.5 * friction - tangential.abs()).abs() < 1e-11);
        if (friction - 2.0).abs() > 1e-6 {
            assert_eq!(set.is_fold(&p.selection, &p.x).unwrap(), Some(friction > 2.0));
        }
    }
    // The bifurcation is at f_t = −(λ+3μ)/(λ+μ) f_ν = −3, whatever F.
    let set = TransitionSet::new(friction_plane(), 0, 0).unwrap();
    let along = Direction::Along(vec![0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let options = ContinuationOptions::default().with_max_arclength(5.0);
    let line = Branch::follow(&set, &[0.0, -1.5, 0.0, 0.0, 0.5, -3.0], along, options).unwrap();
    let last = &line.points.last().unwrap().x;
    assert!((last[4] - 5.5).abs() < 1e-9 && (last[5] + 3.0).abs() < 1e-12);
}

#[test]
fn folds_begin_along_the_line_of_slip_where_its_slope_vanishes() {
    let set = TransitionSet::new(friction_plane(), 0, 2).unwrap();
    let line = follow(&set, &[0.0, 0.0, 1.5, -6.0, 4.0, -6.0], (-7.0, -0.5));
    let changes = set.character_changes(&line).unwrap();
    assert_eq!(changes.len(), 1);
    // F = (λ+3μ)/(λ+μ) = 2, at f_t = −F f_ν = −3; towards larger f_t folds end there.
    assert!((changes[0].x[4] - 2.0).abs() < 1e-9, "{:?}", changes[0]);
    assert!((changes[0].x[5] + 3.0).abs() < 1e-9);
    assert!(changes[0].folds_before);
}

/// ((β − ½)² + ¼ − w²) y + |y|/4 + |β − b| = α has kinks y = 0, which are folds where |β − ½| < w. b is a transition of their line.
#[derive(Debug)]
struct Window {
    half: f64,
    other: f64,
}

impl PiecewiseSmooth for Window {
    two_pieces!(self, [negative, positive], 3, 1, 2);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        (out[0], out[1]) = (x[0], x[2] - self.other);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let [kink, other] = [0, 1].map(|k| s.piece(k) as f64 * 2.0 - 1.0);
        let slope = (x[2] - 0.5).powi(2) + 0.25 - self.half.powi(2);
        out[0] = (slope + 0.25 * kink) * x[0] + other * (x[2] - self.other) - x[1];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let [kink, other] = [0, 1].map(|k| s.piece(k) as f64 * 2.0 - 1.0);
        let slope = (x[2] - 0.5).powi(2) + 0.25 - self.half.powi(2);
        jac.add(0, 0, slope + 0.25 * kink);
        jac.add(0, 1, -1.0);
        jac.add(0, 2, 2.0 * (x[2] - 0.5) * x[0] + other);
    }
}

/// Both ends of the window are found: within one step of the curve, on both sides of a transition, and at points of the curve.
#[test]
fn folds_begin_and_end_however_short_the_window() {
    for half in [0.3, 0.02, 1e-3] {
        let ends = [0.5 - half, 0.5 + half];
        for other in [0.5, 0.5 - 0.3 * half, 0.5 + 1.1 * half, 3.0] {
            for targets in [vec![], ends.to_vec()] {
                let set = TransitionSet::new(Window { half, other }, 0, 0).unwrap();
                let options = ContinuationOptions::default()
                    .with_parameter_range((-2.0, 2.0))
                    .with_targets(targets);
                let start = [0.0, (2.0 + other).abs(), -2.0];
                let line = Branch::follow(&set, &start, Direction::Increasing, options).unwrap();
                assert_eq!(line.transitions.len(), usize::from(other < 2.0));
                let changes = set.character_changes(&line).unwrap();
                assert_eq!(changes.len(), 2, "{half} {other}");
                for (change, (beta, before)) in changes.iter().zip(ends.iter().zip([false, true])) {
                    assert!((change.x[2] - beta).abs() < 1e-12 / half, "{change:?} {beta}");
                    assert_eq!(change.folds_before, before);
                }
            }
        }
    }
}

/// s y + |y|/4 = α with s = 5/4 − 5/4 / (1 + ((β − ½)/w)²) has kinks y = 0, which are folds where |β − ½| < w/2.
#[derive(Debug)]
struct Dip {
    width: f64,
}

impl PiecewiseSmooth for Dip {
    two_pieces!(self, [negative, positive], 3, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0];
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let kink = s.piece(0) as f64 * 2.0 - 1.0;
        let depth = 1.25 / (1.0 + ((x[2] - 0.5) / self.width).powi(2));
        out[0] = (1.25 - depth + 0.25 * kink) * x[0] - x[1];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let kink = s.piece(0) as f64 * 2.0 - 1.0;
        let off = (x[2] - 0.5) / self.width;
        let depth = 1.25 / (1.0 + off * off);
        jac.add(0, 0, 1.25 - depth + 0.25 * kink);
        jac.add(0, 1, -1.0);
        jac.add(0, 2, 2.0 * depth * off / (1.0 + off * off) / self.width * x[0]);
    }
}

/// A window in a narrow dip is found, too: at the neighbouring points, a hundred of its widths away, the determinant has hardly decreased.
#[test]
fn folds_begin_and_end_in_narrow_dips() {
    for step in [0.4, 0.3, 0.2] {
        let width = 0.01 * step;
        let set = TransitionSet::new(Dip { width }, 0, 0).unwrap();
        let options = ContinuationOptions::default()
            .with_parameter_range((-2.0, 2.0))
            .with_max_step(step);
        let line = Branch::follow(&set, &[0.0, 0.0, -2.0], Direction::Increasing, options).unwrap();
        let changes = set.character_changes(&line).unwrap();
        assert_eq!(changes.len(), 2, "{step}");
        for (change, (side, before)) in changes.iter().zip([(-0.5, false), (0.5, true)]) {
            let beta = 0.5 + side * width;
            assert!((change.x[2] - beta).abs() < 1e-8, "{change:?} {beta}");
            assert_eq!(change.folds_before, before);
        }
    }
}

/// A softening spring y − β y³/3, with a stop of stiffness 9 at y = 2, under the load α.
#[derive(Debug)]
struct Softening;

impl PiecewiseSmooth for Softening {
    two_pieces!(self, [negative, positive], 3, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - 2.0;
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - x[2] * x[0].powi(3) / 3.0 + s.piece(0) as f64 * 9.0 * (x[0] - 2.0) - x[1];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, 1.0 - x[2] * x[0].powi(2) + s.piece(0) as f64 * 9.0);
        jac.add(0, 1, -1.0);
        jac.add(0, 2, -x[0].powi(3) / 3.0);
    }
}

#[test]
fn smooth_folds_end_where_they_meet_the_line_of_kinks() {
    // Folds at y = 1/√β, α = (2/3)/√β while y < 2, that is β > 1/4.
    let (set, start) = FoldSet::new(Softening, &[1.0, 2.0 / 3.0, 1.0]).unwrap();
    let options = ContinuationOptions::default()
        .with_parameter_range((0.1, 4.0))
        .with_max_step(0.2);
    let up = Branch::follow(&set, &start, Direction::Increasing, options.clone()).unwrap();
    assert_eq!(up.termination, Termination::ParameterRange);
    let down = Branch::follow(&set, &start, Direction::Decreasing, options.clone()).unwrap();
    for p in up.points.iter().chain(&down.points) {
        let [y, alpha, beta] = set.family_point(&p.x)[..] else {
            panic!("three variables");
        };
        assert!((y - 1.0 / beta.sqrt()).abs() < 1e-9, "{y} {beta}");
        assert!((alpha - 2.0 / 3.0 / beta.sqrt()).abs() < 1e-9);
    }
    assert_eq!(down.termination, Termination::End);
    let end = set.family_point(&down.transitions[0].x);
    assert!(
        (end[0] - 2.0).abs() < 1e-10 && (end[2] - 0.25).abs() < 1e-10,
        "{end:?}"
    );
    // The same point is where kinks become folds.
    let kinks = TransitionSet::new(Softening, 0, 0).unwrap();
    let start = [2.0, 2.0 - 8.0 / 3.0, 1.0];
    let line = Branch::follow(&kinks, &start, Direction::Decreasing, options).unwrap();
    let changes = kinks.character_changes(&line).unwrap();
    assert_eq!(changes.len(), 1);
    for (a, b) in changes[0].x.iter().zip(&end) {
        assert!((a - b).abs() < 1e-9, "{:?} {end:?}", changes[0]);
    }
}

/// y³ − β y = α and w = 5 y²: on the folds β = 3 y² the kernel is (1, 10 y), which turns by more than a right angle. y and w are in units,
/// the second row, too.
#[derive(Debug)]
struct TurningKernel {
    unit: f64,
    row: f64,
}

impl PiecewiseSmooth for TurningKernel {
    one_piece!(self, 4, 2);
    fn residual(&self, _: &Selection, x: &[f64], out: &mut [f64]) {
        let (y, w) = (x[0] / self.unit, x[1] / self.unit);
        out[0] = y.powi(3) - x[3] * y - x[2];
        out[1] = self.row * (w - 5.0 * y * y);
    }
    fn jacobian(&self, _: &Selection, x: &[f64], jac: &mut Matrix) {
        let y = x[0] / self.unit;
        jac.add(0, 0, (3.0 * y * y - x[3]) / self.unit);
        jac.add(0, 2, -1.0);
        jac.add(0, 3, -y);
        jac.add(1, 0, -10.0 * self.row * y / self.unit);
        jac.add(1, 1, self.row / self.unit);
    }
    fn description(&self) -> Option<&dyn semismooth::piecewise::Description> {
        Some(self)
    }
}

impl semismooth::piecewise::Description for TurningKernel {
    fn typical_sizes(&self, sizes: &mut [f64]) {
        sizes[..2].fill(self.unit);
    }
}

#[test]
fn folds_are_followed_however_their_kernel_turns() {
    for (unit, row) in [
        (1.0, 1.0),
        (1.0, 1e9),
        (1.0, 1e-9),
        (1e-9, 1.0),
        (1e9, 1.0),
        (1e-7, 1e6),
    ] {
        let family = TurningKernel { unit, row };
        let (set, start) = FoldSet::new(family, &[-unit, 5.0 * unit, 2.0, 3.0]).unwrap();
        let options = ContinuationOptions::default().with_parameter_range((-1.0, 6.0));
        let line = Branch::follow(&set, &start, Direction::Decreasing, options).unwrap();
        assert_eq!(line.termination, Termination::ParameterRange, "{unit:e} {row:e}");
        assert!(line.branch_points.is_empty());
        // It turns in the cusp.
        assert_eq!(line.smooth_folds.len(), 1);
        let cusp = &line.smooth_folds[0].x;
        assert!((cusp[0] / unit).abs() < 1e-7 && cusp[5].abs() < 1e-12, "{cusp:?}");
        for p in &line.points {
            let [y, w, alpha, beta] = set.family_point(&p.x)[..] else {
                panic!("four variables");
            };
            let y = y / unit;
            assert!((beta - 3.0 * y * y).abs() < 1e-9 && (alpha + 2.0 * y.powi(3)).abs() < 1e-9);
            assert!((w / unit - 5.0 * y * y).abs() < 1e-9);
        }
        assert!((line.points.last().unwrap().x[0] / unit - 2f64.sqrt()).abs() < 1e-9);
    }
}

#[test]
fn a_regular_point_is_no_fold_to_start_from() {
    let e = FoldSet::new(Softening, &[0.5, 0.4, 1.0]).unwrap_err();
    assert!(e.to_string().contains("kernel"), "{e}");
}

/// A set uses the names of the sites and pieces of its family.
#[test]
fn names_are_those_of_the_family() {
    for (family, test) in [(load_plane(1.5), 0), (load_plane(3.0), 2), (friction_plane(), 1)] {
        let set = TransitionSet::new(family, 0, test).unwrap();
        let family = set.family();
        assert_eq!(set.num_sites(), family.num_sites());
        assert_eq!(set.site_name(0), family.site_name(0));
        let names: Vec<String> = (0..family.num_pieces(0))
            .map(|k| family.piece_name(0, k).into_owned())
            .collect();
        assert!(set.num_pieces(0) < names.len() || test == 0);
        for piece in 0..set.num_pieces(0) {
            let own = set.family_selection(&Selection::uniform(1, piece));
            assert_eq!(set.piece_name(0, piece), names[own.piece(0)]);
        }
    }
    for (mut x, piece) in [([1.0_f64, 0.0, 1.0], 0), ([2.5, 0.0, 1.6], 1)] {
        // Smooth folds of a piece: 1 − β y² + 9 k = 0, with α from the equation.
        x[1] = x[0] - x[2] * x[0].powi(3) / 3.0 + 9.0 * piece as f64 * (x[0] - 2.0);
        let (set, start) = FoldSet::new(Softening, &x).unwrap();
        assert_eq!(set.selection().piece(0), piece);
        assert_eq!(set.family_point(&start), x);
        assert_eq!((set.num_sites(), set.num_pieces(0)), (1, 1));
        assert_eq!(set.site_name(0), Softening.site_name(0));
        assert_eq!(set.piece_name(0, 0), Softening.piece_name(0, piece));
        assert_eq!(set.family().num_vars(), 3);
    }
}

/// The sets of the condensed problem are those of the full one.
#[test]
fn sets_of_condensed_problems() {
    let full = load_plane(3.0);
    let condensed = full.condensed().unwrap();
    let samples: Vec<Vec<f64>> = (0..40)
        .map(|k| {
            (0..4)
                .map(|j| (f64::from(k * 7 + j * 13) * 0.37).sin() * 2.0)
                .collect()
        })
        .collect();
    semismooth::piecewise::check::check(&condensed, &samples, &CheckOptions::default()).unwrap();
    let set = TransitionSet::new(&condensed, 0, 2).unwrap();
    // It ends at the apex, as that of the full problem does.
    let branch = follow(&set, &[2.0, -6.0, 2.0, -6.0], (-8.0, 8.0));
    assert_eq!(branch.termination, Termination::End);
    assert!(branch.transitions[0].x.iter().all(|v| v.abs() < 1e-12));
    for p in &branch.points {
        // Stick ends where f_t = −3 f_ν.
        let [_, _, normal, tangential] = p.x[..] else {
            panic!("four variables");
        };
        assert!((tangential + 3.0 * normal).abs() < 1e-9, "{:?}", p.x);
    }
}

/// In space a node sticks while (f₁/F₁)² + (f₂/F₂)² < f_ν²: the plane of both tangential forces.
#[test]
fn stick_ends_on_an_ellipse_in_space() {
    let row = |k: usize| Matrix::from_triplets(1, 3, &[(0, k, 1.0)]).unwrap();
    let load = LoadPath::affine(vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0]);
    let mut a = Matrix::identity(3);
    a.values_mut().fill(2.0);
    let body = ContactBody::new(a, row(0), vec![row(1), row(2)], load).unwrap();
    let [first, second] = [0.5, 0.3].map(|f| FrictionCoefficient::constant(f).unwrap());
    let law = OrthotropicCoulomb::new(first, second);
    let problem = CondensedContact::new(body, law.clone()).unwrap();
    let family = problem.with_second_parameter(vec![0.0, 0.0, 1.0], law).unwrap();
    let set = TransitionSet::new(&family, 0, 1).unwrap();
    let options = ContinuationOptions::default()
        .with_parameter_range((-1.0, 1.0))
        .with_max_step(0.05);
    let start = [1.0, 0.5, 0.0, 0.5, 0.0];
    let branch = Branch::follow(&set, &start, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::Closed);
    for p in &branch.points {
        let ellipse = (p.x[3] / 0.5).powi(2) + (p.x[4] / 0.3).powi(2);
        assert!((ellipse - 1.0).abs() < 1e-9, "{:?}", p.x);
    }
}

/// Friction that falls with the slip on a node pressed by 1 + β and pulled by α: u + (1 + β) F(u) = α turns where 1 + (1 + β) F'(u) = 0.
#[test]
fn folds_of_a_condensed_problem() {
    let row = |k: usize| Matrix::from_triplets(1, 2, &[(0, k, 1.0)]).unwrap();
    let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]);
    let body = ContactBody::new(Matrix::identity(2), row(0), vec![row(1)], load).unwrap();
    let curve = FrictionCurve::exponential(0.8, 0.2, 0.1).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::uniform(curve));
    let problem = CondensedContact::new(body, law.clone()).unwrap();
    let family = problem.with_second_parameter(vec![1.0, 0.0], law).unwrap();
    let friction = |u: f64| 0.2 + 0.6 * (-10.0 * u).exp();
    let u = 6f64.ln() / 10.0;
    let start = [1.0, friction(u), u + friction(u), 0.0];
    let (set, x) = FoldSet::new(&family, &start).unwrap();
    let options = ContinuationOptions::default()
        .with_parameter_range((-0.5, 2.0))
        .with_max_step(0.1);
    let branch = Branch::follow(&set, &x, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    for p in &branch.points {
        let [pressure, traction, alpha, beta] = set.family_point(&p.x)[..] else {
            panic!("four variables");
        };
        let u = (6.0 * (1.0 + beta)).ln() / 10.0;
        assert!((pressure - 1.0 - beta).abs() < 1e-9);
        assert!(
            (traction - pressure * friction(u)).abs() < 1e-7,
            "{traction} at {beta}"
        );
        assert!((alpha - u - traction).abs() < 1e-7);
    }
}

/// The same folds towards smaller β: their slip falls to 0, where the line of kinks between stick and slip takes over.
#[test]
fn folds_of_slip_end_where_the_node_sticks() {
    let row = |k: usize| Matrix::from_triplets(1, 2, &[(0, k, 1.0)]).unwrap();
    let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]);
    let body = ContactBody::new(Matrix::identity(2), row(0), vec![row(1)], load).unwrap();
    // F' = −6 exp(−10 u) or −6 (1 + 10 u)^−2 where the slip begins: 1 + (1 + β) F' = 0 at u = 0 for β = −5/6.
    let exponential = FrictionCurve::exponential(0.8, 0.2, 0.1).unwrap();
    let function = FrictionCurve::function(|u| {
        let shrink = 1.0 / (1.0 + 10.0 * u);
        (0.2 + 0.6 * shrink, -6.0 * shrink * shrink)
    });
    let root = (3f64.sqrt() - 1.0) / 10.0;
    for (curve, slip) in [(exponential, 3f64.ln() / 10.0), (function, root)] {
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(curve.clone()));
        let problem = CondensedContact::new(body.clone(), law.clone()).unwrap();
        let family = problem.with_second_parameter(vec![1.0, 0.0], law).unwrap();
        let traction = 0.5 * curve.value(slip).0;
        let (set, x) = FoldSet::new(&family, &[0.5, traction, slip + traction, -0.5]).unwrap();
        let options = ContinuationOptions::default().with_parameter_range((-0.99, 0.0));
        let branch = Branch::follow(&set, &x, Direction::Decreasing, options).unwrap();
        assert_eq!(branch.termination, Termination::End, "{curve:?}");
        let end = set.family_point(&branch.transitions[0].x);
        for (found, exact) in end.iter().zip([1.0 / 6.0, 0.8 / 6.0, 0.8 / 6.0, -5.0 / 6.0]) {
            assert!((found - exact).abs() < 1e-9, "{end:?}");
        }
    }
}

/// (β² − 0.2) y + |y|/4 = α has kinks y = 0, which are folds where β² < 0.45. Another unknown is 0 up to rounding: 1e-20 sin(10⁵ β).
#[derive(Debug)]
struct Rounding;

impl PiecewiseSmooth for Rounding {
    two_pieces!(self, [negative, positive], 4, 2, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0];
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let slope = x[3] * x[3] - 0.2 + 0.25 * (s.piece(0) as f64 * 2.0 - 1.0);
        out[0] = slope * x[0] - x[2];
        out[1] = x[1] - 1e-20 * (1e5 * x[3]).sin();
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let slope = x[3] * x[3] - 0.2 + 0.25 * (s.piece(0) as f64 * 2.0 - 1.0);
        jac.add(0, 0, slope);
        jac.add(0, 2, -1.0);
        jac.add(0, 3, 2.0 * x[3] * x[0]);
        jac.add(1, 1, 1.0);
        jac.add(1, 3, -1e-15 * (1e5 * x[3]).cos());
    }
}

/// Unknowns that vary by rounding alone must not determine the planes in which points between neighbours are located.
#[test]
fn folds_begin_beside_unknowns_that_are_rounding() {
    let set = TransitionSet::new(Rounding, 0, 0).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 2.0));
    let line = Branch::follow(&set, &[0.0, 0.0, 0.0, -1.0], Direction::Increasing, options).unwrap();
    assert_eq!(line.termination, Termination::ParameterRange);
    let changes = set.character_changes(&line).unwrap();
    assert_eq!(changes.len(), 2, "{changes:?}");
    for (change, beta) in changes.iter().zip([-0.45f64.sqrt(), 0.45f64.sqrt()]) {
        let [y, _, alpha, found] = change.x[..] else {
            panic!("four variables");
        };
        assert!(
            (found - beta).abs() < 1e-9 && y.abs().max(alpha.abs()) < 1e-12,
            "{change:?}"
        );
        assert_eq!(change.folds_before, beta > 0.0);
    }
}

/// The kernel at a fold has length one where the family states no sizes of its variables.
#[test]
fn kernels_at_the_start_have_unit_length() {
    let (set, start) = FoldSet::new(Softening, &[1.0, 2.0 / 3.0, 1.0]).unwrap();
    assert_eq!(start.len(), 4);
    assert!((start[1].abs() - 1.0).abs() < 1e-12, "{start:?}");
    let selection = set.selection().clone();
    let mut r = vec![0.0; set.num_residuals()];
    set.residual(&selection, &start, &mut r);
    assert!(r.iter().all(|r| r.abs() < 1e-9), "{r:?}");
}
