//! Accessors and options that no other test covers.

use semismooth::complementarity::active_set::{
    ActiveSetOptions, ActiveSetSolver, AutoReduced, DirectReduced, GmresReduced, MultigridReduced,
    ReducedSolver,
};
use semismooth::complementarity::{
    AffineFunction, ConstraintKind, Lcp, Mcp, McpOptions, McpSolver, Program, kkt,
};
use semismooth::contact::{
    CondensedContact, ContactBody, DelassusOptions, DelassusPhase, DelassusProblem, DelassusSolver,
    FrictionCoefficient, FrictionCurve, Frictionless, GivenBound, LoadPath, NodeLaw, OrthotropicCoulomb,
    PlanarCoulomb,
};
use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Direction, SearchOptions, Strategy, search_solutions,
};
use semismooth::enumeration::{EnumerationOptions, all_arms};
use semismooth::fem::Mesh;
use semismooth::interface::InterfaceProblem;
use semismooth::linear::IncompleteLu;
use semismooth::piecewise::{Facet, MinMap};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

#[test]
fn complementarity() {
    let m = Matrix::from_rows(&[[2.0, 0.0], [1.0, 0.0]]).unwrap();
    let standard = Lcp::new(m.clone(), vec![-2.0, 1.0]).unwrap();
    assert!(standard.is_standard());
    let boxed = Lcp::boxed(m.clone(), vec![-2.0, 1.0], vec![0.0; 2], vec![1.0, f64::INFINITY]).unwrap();
    assert!(!boxed.is_standard());
    let problem = Mcp::ncp(AffineFunction::new(m, vec![-2.0, 1.0]).unwrap()).unwrap();
    assert!(!problem.is_parametric());
    // The diagonal is part of the pattern whatever F has.
    assert!((0..2).all(|i| problem.jacobian_pattern().slot(i, i).is_some()));
    for equilibrate in [true, false] {
        let mut solver = McpSolver::new(McpOptions::default().with_equilibrate(equilibrate));
        let mut x = [5.0, 5.0];
        assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
        assert!((x[0] - 1.0).abs() < 1e-9 && x[1].abs() < 1e-9);
    }
}

#[test]
fn both_strategies_see_the_fold() {
    // α = |y|.
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    for (strategy, accuracy) in [(Strategy::Located, 1e-12), (Strategy::Switching, 1e-5)] {
        let options = ContinuationOptions::default()
            .with_parameter_range((-1.0, 1.0))
            .with_strategy(strategy);
        let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Decreasing, options).unwrap();
        assert_eq!(branch.folds().len(), 1);
        assert!(branch.folds()[0].abs() < accuracy);
    }
}

#[test]
fn names_of_groups() {
    let mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [2, 2]).unwrap();
    let mut names: Vec<&str> = mesh.facet_group_names().collect();
    names.sort_unstable();
    assert_eq!(names, ["bottom", "left", "right", "top"]);
    assert_eq!(mesh.cell_group_names().count(), 0);
    assert!(mesh.facet_group("left").is_ok());
}

#[test]
fn walls() {
    assert!(!Facet::positive(0).is_wall() && !Facet::negative(3).is_wall());
}

#[test]
fn products_with_transposes() {
    let m = Matrix::from_rows(&[[1.0, 2.0, 0.0], [0.0, 3.0, -1.0]]).unwrap();
    let mut y = [1.0; 3];
    m.as_ref().mul_transpose_add(2.0, &[1.0, 10.0], &mut y);
    assert_eq!(y, [3.0, 65.0, -19.0]);
}

/// Minimise ½ Σ (i + 1) xᵢ² − Σ xᵢ where Σ xᵢ ≥ s, with or without a declared pattern.
#[derive(Clone)]
struct Separable {
    n: usize,
    sum: f64,
    tells: bool,
}

impl Program for Separable {
    fn num_vars(&self) -> usize {
        self.n
    }
    fn num_constraints(&self) -> usize {
        1
    }
    fn gradient(&self, x: &[f64], out: &mut [f64]) {
        for (i, (o, x)) in out.iter_mut().zip(x).enumerate() {
            *o = (i + 1) as f64 * x - 1.0;
        }
    }
    fn constraints(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x.iter().sum::<f64>() - self.sum;
    }
    fn constraint_jacobian(&self, _: &[f64], jac: &mut Matrix) {
        (0..self.n).for_each(|j| jac.add(0, j, 1.0));
    }
    fn hessian(&self, _: &[f64], _: &[f64], hessian: &mut Matrix) {
        (0..self.n).for_each(|i| hessian.add(i, i, (i + 1) as f64));
    }
    fn hessian_pattern(&self) -> Pattern {
        if self.tells {
            Pattern::from_entries(self.n, self.n, (0..self.n).map(|i| (i, i))).unwrap()
        } else {
            Pattern::full(self.n, self.n)
        }
    }
}

#[test]
fn a_program_may_declare_its_pattern() {
    let (n, sum) = (6, 4.0);
    let solve = |tells: bool| {
        let program = Separable { n, sum, tells };
        assert!(program.constraint_pattern().is_full());
        assert_eq!(program.hessian_pattern().is_full(), !tells);
        let kinds = [ConstraintKind::Nonnegative];
        let problem = kkt(
            program,
            &kinds,
            vec![f64::NEG_INFINITY; n],
            vec![f64::INFINITY; n],
        )
        .unwrap();
        let mut x = vec![0.0; n + 1];
        assert!(McpSolver::default().solve(&problem, &mut x).unwrap().is_solved());
        (problem.jacobian_pattern().nnz(), x)
    };
    let ((fewer, told), (more, full)) = (solve(true), solve(false));
    assert!(fewer < more);
    // x_i = (1 + y)/(i + 1) with Σ x_i = s.
    let harmonic: f64 = (1..=n).map(|i| 1.0 / i as f64).sum();
    for x in [told, full] {
        for i in 0..n {
            assert!((x[i] - sum / harmonic / (i + 1) as f64).abs() < 1e-9);
        }
        assert!((x[n] - (sum / harmonic - 1.0)).abs() < 1e-9);
    }
}

/// A reduced solver that declares itself direct solves to rounding however loose the tolerance; the others keep to it.
#[test]
fn direct_solvers_ignore_tolerances() {
    let n = 40;
    let second = |i: usize| [(i, i, 2.0), (i, (i + 1) % n, -0.9), (i, (i + n - 1) % n, -0.9)];
    let entries: Vec<_> = (0..n).flat_map(second).collect();
    let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
    let free = vec![true; n];
    let residual = |solver: &mut dyn ReducedSolver| {
        solver.load(&matrix).unwrap();
        solver.select(&matrix, &free).unwrap();
        let r: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        let mut d = vec![0.0; n];
        solver.solve(&mut r.clone(), &mut d, 1e-2).unwrap();
        let mut image = vec![0.0; n];
        matrix.mul_vec(&d, &mut image);
        let worst = image
            .iter()
            .zip(&r)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        (solver.is_direct(), worst)
    };
    let mut auto = AutoReduced::new();
    let mut solvers: [&mut dyn ReducedSolver; 4] = [
        &mut DirectReduced::new(),
        &mut GmresReduced::new(IncompleteLu::default()),
        &mut MultigridReduced::algebraic(),
        &mut auto,
    ];
    let found: Vec<(bool, f64)> = solvers.iter_mut().map(|s| residual(*s)).collect();
    assert_eq!([found[0].0, found[1].0, found[2].0], [true, false, false]);
    for (direct, worst) in found {
        assert!(worst < if direct { 1e-12 } else { 0.1 }, "{direct} {worst:e}");
    }
}

/// Two contact nodes under loads that press and push.
fn body() -> ContactBody {
    let stiffness = Matrix::from_rows(&[
        [2.0, -0.5, 0.1, 0.0],
        [-0.5, 2.0, 0.0, 0.1],
        [0.1, 0.0, 2.0, -0.5],
        [0.0, 0.1, -0.5, 2.0],
    ])
    .unwrap();
    let pick = |first: usize| Matrix::from_triplets(2, 4, &[(0, first, 1.0), (1, first + 2, 1.0)]).unwrap();
    let load = LoadPath::affine(vec![1.0, 0.0, 2.0, 0.0], vec![0.0, 1.0, 0.0, 1.0]);
    ContactBody::new(stiffness, pick(0), vec![pick(1)], load).unwrap()
}

fn coulomb(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap())
}

#[test]
fn a_law_replaced_in_place() {
    let [weak, strong] = [0.1, 0.6].map(|f| PlanarCoulomb::new(coulomb(f)));
    let mut contact = CondensedContact::new(body(), weak.clone()).unwrap();
    let slips = |c: &CondensedContact<PlanarCoulomb>| c.solve(1.0, None).unwrap();
    let before = slips(&contact);
    *contact.node_law_mut() = strong.clone();
    let after = slips(&contact);
    assert_ne!(before, after);
    assert_eq!(after, slips(&CondensedContact::new(body(), strong).unwrap()));
}

/// A law has a Delassus form only if its friction bound is F times the pressure.
#[test]
fn laws_with_a_delassus_form() {
    assert!(PlanarCoulomb::new(coulomb(0.3)).is_coulomb());
    assert!(OrthotropicCoulomb::isotropic(coulomb(0.3)).is_coulomb());
    // With F = 0.
    assert!(Frictionless::plane().is_coulomb());
    let given = GivenBound::new(1, vec![0.1; 2], vec![[0.3; 2]; 2]).unwrap();
    assert!(!given.is_coulomb());
    let delassus = CondensedContact::new(body(), PlanarCoulomb::new(coulomb(0.3))).unwrap();
    assert!(delassus.delassus(0.0).is_ok());
    assert!(
        CondensedContact::new(body(), given)
            .unwrap()
            .delassus(0.0)
            .is_err()
    );
}

#[test]
fn vertical_arms() {
    // min(α − y, α − 1) = 0: α = max(y, 1), which stays at 1 as y falls.
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] - 1.0;
    });
    let arms = all_arms(&map, &[1.0, 1.0], &EnumerationOptions::default()).unwrap();
    assert!(!arms.completeness.has_gaps());
    let mut vertical: Vec<bool> = arms.arms.iter().map(|a| a.is_vertical()).collect();
    vertical.sort_unstable();
    assert_eq!(vertical, [false, true]);
    let steep = arms.arms.iter().find(|a| !a.is_vertical()).unwrap();
    assert!((steep.tangent[0] - steep.tangent[1]).abs() < 1e-12 && steep.rate() > 0.0);
}

/// y³ − y = α at two unknowns: three roots each at α = 0, whatever the random numbers.
#[test]
fn searches_with_other_seeds() {
    let map = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for i in 0..2 {
            a[i] = x[i] * x[i] * x[i] - x[i] - x[2];
            b[i] = 3.0 + x[i];
        }
    });
    const NONE: [[f64; 1]; 0] = [];
    let lists = [1, 2].map(|seed| {
        let options = SearchOptions::default().with_seed(seed).with_merge_distance(1e-6);
        let found = search_solutions(&map, 0.0, &NONE, &options).unwrap();
        let mut points: Vec<[i64; 2]> = found
            .solutions
            .iter()
            .map(|s| [0, 1].map(|i| (s.x[i] * 1e6).round() as i64))
            .collect();
        points.sort_unstable();
        points
    });
    assert_eq!(lists[0].len(), 9);
    assert_eq!(lists[0], lists[1]);
    let capped = SearchOptions::default().with_max_solutions(4);
    let found = search_solutions(&map, 0.0, &NONE, &capped).unwrap();
    assert!((4..9).contains(&found.solutions.len()));
}

#[test]
fn sizes_of_an_interface() {
    let b = Matrix::from_rows(&[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
    let law = MinMap::curve(4, |_: &[f64], _: &mut [f64], _: &mut [f64]| {});
    let load = LoadPath::constant(vec![1.0; 3]);
    let make = |law| InterfaceProblem::from_parts(Matrix::identity(3), &b.clone(), load.clone(), law);
    // A law of four residuals does not fit two traces.
    assert!(make(law).is_err());
    let fitting = Law;
    let problem = InterfaceProblem::from_parts(Matrix::identity(3), &b, load, fitting).unwrap();
    assert_eq!((problem.num_displacements(), problem.num_traces()), (3, 2));
}

/// λ = 0 at two traces.
#[derive(Debug, Clone)]
struct Law;

impl semismooth::piecewise::PiecewiseSmooth for Law {
    fn num_vars(&self) -> usize {
        5
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn num_sites(&self) -> usize {
        0
    }
    fn num_pieces(&self, _: usize) -> usize {
        1
    }
    fn num_tests(&self, _: usize) -> usize {
        0
    }
    fn cell(&self, _: usize, _: usize) -> &[Facet] {
        &[]
    }
    fn test_functions(&self, _: &[f64], _: &mut [f64]) {}
    fn residual(&self, _: &semismooth::piecewise::Selection, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&x[2..4]);
    }
    fn jacobian(&self, _: &semismooth::piecewise::Selection, _: &[f64], jac: &mut Matrix) {
        jac.add(0, 2, 1.0);
        jac.add(1, 3, 1.0);
    }
}

#[test]
fn a_run_can_be_printed() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    let run = Continuation::new(
        &map,
        &[0.5, 0.5],
        Direction::Decreasing,
        ContinuationOptions::default(),
    )
    .unwrap();
    let shown = format!("{run:?}");
    assert!(
        shown.starts_with("Continuation { x: [0.5, 0.5], selection"),
        "{shown}"
    );
}

/// Every option by its builder: builders that reject a value name the option.
#[test]
fn builders_reach_the_options_they_name() {
    type Set = fn(ContinuationOptions) -> ContinuationOptions;
    let wrong: [(&str, Set); 7] = [
        ("growth", |o| o.with_growth(0.5)),
        ("shrink", |o| o.with_shrink(1.0)),
        ("residual_tolerance", |o| o.with_residual_tolerance(0.0)),
        ("step_tolerance", |o| o.with_step_tolerance(f64::NAN)),
        ("max_corrections", |o| o.with_max_corrections(0)),
        ("vanishing_distance", |o| o.with_vanishing_distance(1.0)),
        ("max_selections", |o| o.with_max_selections(0)),
    ];
    for (name, set) in wrong {
        let error = set(ContinuationOptions::default()).validate().unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
    use semismooth::newton::NewtonOptions;
    let armijo = NewtonOptions::default().with_armijo(2.0).validate();
    assert!(armijo.unwrap_err().to_string().contains("armijo"));
    let damping = NewtonOptions::default().with_min_damping(0.0).validate();
    assert!(damping.unwrap_err().to_string().contains("min_damping"));
    // A solver of LCPs accepts given states, too.
    let lcp = Lcp::new(Matrix::identity(2), vec![-1.0, 1.0]).unwrap();
    let states = [semismooth::complementarity::BoundState::Interior; 2];
    let mut z = [0.0; 2];
    let report = ActiveSetSolver::new(ActiveSetOptions::default()).solve_from_states(&lcp, &mut z, &states);
    assert_eq!((z, report.unwrap().residual), ([1.0, 0.0], 0.0));
    let mut w = [0.0; 2];
    lcp.value(&z, &mut w);
    assert_eq!(w, [0.0, 1.0]);
}

#[cfg(feature = "svg")]
#[test]
fn unstable_edges_are_dashed() {
    use semismooth::continuation::{Diagram, DiagramOptions};
    use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
    let dashed_lines = |curve: Curve| {
        let svg = BranchDiagram::new(Panel::new("α", "y").with_curve(curve))
            .to_svg()
            .unwrap();
        svg.matches("stroke-dasharray").count()
    };
    // α = y (3 − y²)/2 between its folds, with one sign of det ∇_yH or the other.
    let edge = |sign: f64| {
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = sign * (0.5 * x[0] * (3.0 - x[0] * x[0]) - x[1]);
            b[0] = x[0] + 10.0;
        });
        let options = DiagramOptions::default().with_parameter_range((-0.5, 0.5));
        let diagram = Diagram::explore(&map, &[[0.0, 0.0]], &options).unwrap();
        // The start is a vertex between two edges.
        assert!(diagram.edges().iter().all(|e| e.det_signs() == [sign as i8]));
        let style = |_: &_, _: &[usize]| SegmentStyle::new("y", Colour::BLUE);
        dashed_lines(Curve::of_edge(&diagram.edges()[0], |x| x[0], style))
    };
    // The curve, and its entry in the legend.
    assert_eq!([edge(-1.0), edge(1.0)], [2, 0]);
    let line = |dashed| {
        let style = SegmentStyle::new("y", Colour::BLUE).with_dashes(dashed);
        dashed_lines(Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], style))
    };
    assert_eq!([line(true), line(false)], [2, 0]);
}

/// A search that is asked to stop does so before the next run.
#[test]
fn searches_end_on_request() {
    use semismooth::continuation::search_solutions_observed;
    use std::ops::ControlFlow;
    use std::time::Duration;
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] * x[0] - x[0] - x[1];
        b[0] = 3.0 + x[0];
    });
    let starts = [[0.5, 0.0], [-0.5, 0.0], [2.0, 0.0]];
    let options = SearchOptions::default();
    let found = search_solutions_observed(&map, 0.0, &starts, &options, |_| ControlFlow::Break(())).unwrap();
    assert_eq!((found.runs, found.rounds), (1, 1));
    let late = options.clone().with_max_time(Some(Duration::ZERO));
    assert_eq!(search_solutions(&map, 0.0, &starts, &late).unwrap().runs, 0);
    let capped = options.with_max_solutions(1);
    assert_eq!(search_solutions(&map, 0.0, &starts, &capped).unwrap().runs, 1);
}

#[test]
fn limits_hold_where_nothing_can_be_evaluated() {
    use semismooth::complementarity::Differenced;
    use std::time::Duration;
    let f = |x: &[f64], out: &mut [f64]| out[0] = if x[0] == 1.0 { 2.0 } else { f64::NAN };
    let problem = Mcp::new(
        Differenced::new(1, f),
        vec![f64::NEG_INFINITY],
        vec![f64::INFINITY],
    )
    .unwrap();
    let options = McpOptions::default()
        .with_restarts(usize::MAX)
        .with_max_time(Some(Duration::from_millis(1)));
    let mut solver = McpSolver::new(options);
    let report = solver.solve(&problem, &mut [1.0]).unwrap();
    assert_eq!(report.status, Status::TimeLimit);
    let shrink = ContinuationOptions::default()
        .with_shrink(1.0 - f64::EPSILON)
        .validate();
    assert!(shrink.unwrap_err().to_string().contains("shrink"));
}

/// A file is replaced atomically: a failed attempt leaves it as it was, a successful one leaves nothing beside it.
#[test]
fn files_are_replaced_whole() {
    use semismooth::sparse::{read_matrix_market, write_matrix_market};
    let folder = std::env::temp_dir().join(format!("semismooth-replaced-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("a.mtx");
    for n in [3, 2] {
        write_matrix_market(&path, &Matrix::identity(n)).unwrap();
        assert_eq!(read_matrix_market(&path).unwrap(), Matrix::identity(n));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    }
    // The path of the temporary file is taken: nothing can be written.
    std::fs::create_dir(folder.join("a.part.mtx")).unwrap();
    write_matrix_market(&path, &Matrix::identity(5)).unwrap_err();
    assert_eq!(read_matrix_market(&path).unwrap(), Matrix::identity(2));
    #[cfg(feature = "svg")]
    {
        use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
        let picture = folder.join("a.svg");
        let line = Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], SegmentStyle::new("y", Colour::BLUE));
        let diagram = BranchDiagram::new(Panel::new("α", "y").with_curve(line));
        diagram.write(&picture).unwrap();
        let text = std::fs::read_to_string(&picture).unwrap();
        assert!(text.trim_end().ends_with("</svg>"));
        BranchDiagram::new(Panel::new("α", "y"))
            .write(&picture)
            .unwrap_err();
        assert_eq!(std::fs::read_to_string(&picture).unwrap(), text);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Long runs of sweeps are reported in parts, and limited.
#[test]
fn sweeps_are_reported_and_limited() {
    // No solution: two contacts that press on each other as much as on the ground, so that forces grow with each sweep.
    let m = [
        [1.0, 0.0, -1.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [-1.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let m = Matrix::from_rows(&m).unwrap();
    let problem = DelassusProblem::new(2, m, vec![-1.0, 0.0, -1.0, 0.0], vec![0.3; 2]).unwrap();
    let report = DelassusSolver::default().solve(&problem).unwrap();
    // No phase uses up the budget of the later ones: all of them were tried.
    assert_eq!(report.status, Status::Stalled);
    let sweeps = |report: &semismooth::contact::DelassusReport| {
        let parts = report.history.iter().filter(|h| h.phase == DelassusPhase::Sweeps);
        let parts: Vec<usize> = parts.map(|h| h.work).collect();
        assert!(parts.iter().all(|work| *work <= 100));
        assert_eq!(parts.iter().sum::<usize>(), report.sweeps);
        report.sweeps
    };
    let all = sweeps(&report);
    let options = DelassusOptions::default().with_max_sweeps(7);
    let fewer = sweeps(&DelassusSolver::new(options).solve(&problem).unwrap());
    assert!(all > 10_000 && fewer == 5 * 7, "{all} {fewer}");
}

/// Text printed for people consists of words, not of names of variants.
mod words {
    use semismooth::complementarity::active_set::ActiveSetSolver;
    use semismooth::complementarity::{Lcp, Mcp, McpSolver, strong_regularity};
    use semismooth::continuation::{Branch, ContinuationOptions, Direction};
    use semismooth::newton::Newton;
    use semismooth::piecewise::{MinMap, active_set, local_uniqueness};
    use semismooth::sparse::Matrix;

    fn counted(n: usize, what: &str) -> String {
        format!("{n} {what}{}", if n == 1 { "" } else { "s" })
    }

    fn ends(text: &str, start: &str, end: &str) {
        assert!(text.starts_with(start) && text.ends_with(end), "{text}");
    }

    #[test]
    fn of_solvers() {
        let lcp = Lcp::new(
            Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]]).unwrap(),
            vec![-1.0, -1.0],
        )
        .unwrap();
        let mut z = [0.0; 2];
        let report = ActiveSetSolver::default().solve(&lcp, &mut z).unwrap();
        let told = |n: usize| format!("solved after {}, residual ", counted(n, "iteration"));
        ends(&report.to_string(), &told(report.iterations), "");
        let mut solver = McpSolver::default();
        let mcp: &Mcp<_> = lcp.mcp();
        let report = solver.solve(mcp, &mut [0.0; 2]).unwrap();
        ends(&report.to_string(), &told(report.iterations), "");
        let mut newton = Newton::default();
        let how = newton.solve(mcp, &mut [0.0; 2]).unwrap();
        assert_eq!(how.to_string(), "tolerance met");
        let report = newton.report();
        let (steps, factors) = (report.history.len() - 1, report.factorisations);
        let [steps, factors] =
            [(steps, "iteration"), (factors, "factorisation")].map(|(n, what)| counted(n, what));
        ends(&report.to_string(), &format!("{steps}, {factors}, residual "), "");
        let regular = strong_regularity(mcp, &z, 1e-12, 100).unwrap();
        ends(&regular.to_string(), "regular (", " selection)");
    }

    #[test]
    fn of_curves() {
        // α = |y|
        let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[1] - x[0];
            b[0] = x[1] + x[0];
        });
        let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
        let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Decreasing, options).unwrap();
        assert_eq!(
            branch.to_string(),
            "1 transition, 1 fold, 0 branch points; bound of the parameter"
        );
        let kink = branch.transitions[0].to_string();
        ends(&kink, "fold at parameter ", ", site 0: piece 0 to 1");
        let load = Matrix::from_rows(&[[1.0]]).unwrap();
        let unique = |x: [f64; 2]| {
            let active = active_set(&map, &x, 1e-12);
            local_uniqueness(&map, &x, &active, &load, 10)
                .unwrap()
                .to_string()
        };
        assert_eq!(
            unique([0.5, 0.5]),
            "locally unique, Lipschitz constant 1.000e0 (1 selection)"
        );
        assert_eq!(
            unique([0.0, 0.0]),
            "not locally unique: determinants differ in sign"
        );
    }
}
