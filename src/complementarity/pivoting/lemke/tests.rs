use super::*;
use crate::sparse::Matrix;

fn solve(rows: &[&[f64]], q: &[f64]) -> (LemkeReport, Vec<f64>, Option<Vec<f64>>) {
    let lcp = Lcp::new(Matrix::from_rows(rows).unwrap(), q.to_vec()).unwrap();
    let mut solver = Lemke::default();
    let mut z = vec![f64::NAN; q.len()];
    let report = solver.solve(&lcp, &mut z).unwrap();
    (report, z, solver.ray().map(<[f64]>::to_vec))
}

#[test]
fn one_unknown() {
    assert_eq!(solve(&[&[2.0]], &[-3.0]).1, [1.5]);
    assert_eq!(solve(&[&[2.0]], &[3.0]).0.pivots, 0);
    let (report, _, ray) = solve(&[&[0.0]], &[-1.0]);
    assert_eq!(report.status, Status::NoSolution);
    assert_eq!(ray, Some(vec![1.0]));
    let (report, _, _) = solve(&[&[-1.0]], &[-1.0]);
    assert_eq!(report.status, Status::NoSolution);
}

#[test]
fn a_ray_of_a_solvable_problem_is_no_certificate() {
    // z = (1, 0), w = (0, 1) is a solution, but M is not copositive.
    let (report, z, _) = solve(&[&[1.0, 0.0], &[2.0, -1.0]], &[-1.0, -1.0]);
    match report.status {
        Status::Solved => assert!(report.residual < 1e-14, "{z:?}"),
        status => assert_eq!(status, Status::Ray),
    }
}

#[test]
fn the_lexicographic_rule_ends_cycles() {
    // M. M. Kostreva, "Cycling in linear complementarity problems", Math. Prog. 16 (1979): three equal ratios at the start.
    let (report, _, _) = solve(
        &[&[1.0, 2.0, 0.0], &[0.0, 1.0, 2.0], &[2.0, 0.0, 1.0]],
        &[-1.0, -1.0, -1.0],
    );
    assert_eq!(report.status, Status::Solved);
    assert!(report.residual < 1e-14);
}

#[test]
fn free_and_fixed_unknowns_and_upper_bounds() {
    let m = Matrix::from_rows(&[
        [2.0, 1.0, 0.0, 0.5],
        [-1.0, 3.0, 1.0, 0.0],
        [0.0, 1.0, 2.0, 0.0],
        [1.0, 0.0, 0.0, 1.0],
    ]);
    let inf = f64::INFINITY;
    let (lower, upper) = (vec![0.0, -inf, 0.25, -inf], vec![1.5, inf, 0.25, 2.0]);
    let lcp = Lcp::boxed(m.unwrap(), vec![-8.0, 3.0, -1.0, 4.0], lower, upper).unwrap();
    let mut z = [0.0; 4];
    let report = Lemke::default().solve(&lcp, &mut z).unwrap();
    assert_eq!(report.status, Status::Solved);
    assert!(lcp.natural_residual(&z, &mut z.clone()).unwrap() < 1e-14, "{z:?}");
    assert_eq!((z[0], z[2]), (1.5, 0.25));
}

/// Inaccurate basic variables are detected, and recomputed from the equations.
#[test]
fn decayed_variables_are_made_anew() {
    let m = Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]]).unwrap();
    let lcp = Lcp::new(m, vec![-5.0, -7.0]).unwrap();
    let mut solver = Lemke::default();
    let mut z = [0.0; 2];
    assert_eq!(solver.solve(&lcp, &mut z).unwrap().status, Status::Solved);
    let (exact, before) = (solver.value.clone(), solver.refactorisations);
    for off in [1e-3, -1e-7] {
        solver.value[1] += off;
        assert!(solver.verify(&lcp).unwrap());
        let error = |(a, b): (&f64, &f64)| (a - b).abs();
        assert!(
            solver.value.iter().zip(&exact).map(error).all(|e| e < 1e-14),
            "{off:e}"
        );
    }
    assert_eq!(solver.refactorisations, before + 2);
    assert!(solver.verify(&lcp).unwrap() && solver.refactorisations == before + 2);
}

/// 2 z = 3, and a row of 1e-9 times the size: the end of a path is a solution only if each row is satisfied.
#[test]
fn ends_are_measured_row_by_row() {
    let m = Matrix::from_rows(&[[2.0, 0.0], [0.0, 2e-9]]).unwrap();
    let lcp = Lcp::new(m, vec![-3.0, -3e-9]).unwrap();
    let mut solver = Lemke::default();
    let mut judged = |z: [f64; 2]| {
        solver.work = vec![0.0; 2];
        lcp.value(&z, &mut solver.work);
        solver.is_solution(&lcp, &z)
    };
    assert!(judged([1.5, 1.5]) && judged([1.5 + 1e-11, 1.5]));
    assert!(
        !judged([1.5 + 1e-8, 1.5])
            && !judged([1.5, 1.5 + 1e-8])
            && !judged([1.5, 0.0])
            && !judged([1.5, -1e-8])
    );
}

/// w = z − (1, 0): dropping the rounding in z₁ turns (1, ε) into a solution, but not (3, ε), which is returned unchanged.
#[test]
fn rounding_is_dropped_only_where_a_solution_is_left() {
    let lcp = Lcp::new(
        Matrix::from_rows(&[[1.0, 0.0], [0.0, 1.0]]).unwrap(),
        vec![-1.0, 0.0],
    );
    let lcp = lcp.unwrap();
    for (first, solves) in [(1.0, true), (3.0, false)] {
        let mut solver = Lemke::default();
        solver.solve(&lcp, &mut [0.0; 2]).unwrap();
        let mut z = [first, 1e-17];
        lcp.value(&z, &mut solver.work);
        let before = solver.work.clone();
        assert_eq!(solver.is_solution_without_rounding(&lcp, &mut z), solves);
        assert_eq!(z, [first, if solves { 0.0 } else { 1e-17 }]);
        assert_eq!(solver.work == before, !solves);
    }
}
