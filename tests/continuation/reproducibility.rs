//! The same input gives the same bits: run after run, alone or concurrently with other threads.

use crate::squares;
use std::fmt::Debug;
use std::ops::ControlFlow;

use crate::common::cases;
use semismooth::complementarity::pivoting::Lemke;
use semismooth::complementarity::{AffineFunction, Lcp, Mcp, McpSolver};
use semismooth::contact::{
    ContactState, DelassusProblem, DelassusSolver, EvolutionOptions, FrictionCoefficient, FrictionCurve,
    OrthotropicCoulomb, evolve,
};
use semismooth::continuation::{Diagram, DiagramOptions, SearchOptions, search_solutions};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sparse::Matrix;

/// The result of a computation, with all digits of all numbers.
fn digits(value: &impl Debug) -> String {
    format!("{value:?}")
}

/// Computes once, again, and in three threads at the same time.
fn repeated(compute: impl Fn() -> String + Sync) {
    let first = compute();
    assert!(first.len() > 20, "{first}");
    assert_eq!(compute(), first);
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(&compute)).collect();
        for thread in threads {
            assert_eq!(thread.join().unwrap(), first);
        }
    });
}

#[test]
fn solutions_and_diagrams_of_planar_friction() {
    for case in cases().iter().filter(|c| c.name != "p1_ex1") {
        repeated(|| {
            let map = case.problem.condensed().unwrap();
            let states = vec![ContactState::Open; map.num_sites()];
            let x = map.solve_from_states(8.0, &states).ok();
            let x: Vec<Vec<f64>> = x.into_iter().collect();
            let options = DiagramOptions::default().with_parameter_range((-12.0, 25.0));
            let diagram = Diagram::explore(&map, &x, &options).unwrap();
            let all = all_solutions(&map, 3.3, &EnumerationOptions::default()).unwrap();
            let searched = search_solutions(&map, 3.3, &x, &SearchOptions::default()).unwrap();
            digits(&(diagram, all, searched))
        });
    }
}

#[test]
fn complementarity() {
    const N: usize = 30;
    let rows: Vec<Vec<f64>> = (0..N)
        .map(|i| {
            (0..N)
                .map(|j| f64::from(((i * j + 3 * i) % 7) as u8) - 3.0 + 40.0 * f64::from(i == j))
                .collect()
        })
        .collect();
    let q: Vec<f64> = (0..N).map(|i| 50.0 * (i as f64).sin()).collect();
    repeated(|| {
        let m = Matrix::from_rows(&rows).unwrap();
        let mut z = vec![0.0; N];
        let lcp = Lcp::new(m.clone(), q.clone()).unwrap();
        let pivoting = Lemke::default().solve(&lcp, &mut z).unwrap();
        let problem = Mcp::ncp(AffineFunction::new(m, q.clone()).unwrap()).unwrap();
        let mut x = vec![1.0; N];
        let mut solver = McpSolver::default();
        assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
        digits(&(pivoting, z, x))
    });
}

fn friction(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap())
}

#[test]
fn contact_in_the_plane_and_in_space() {
    repeated(|| {
        let law = OrthotropicCoulomb::new(friction(0.5), friction(0.3));
        let (problem, _) = squares::cube(3, law).unwrap();
        let solved = problem.solve(0.0, None).unwrap();
        let delassus = DelassusProblem::new(
            3,
            Matrix::identity(6),
            vec![-1.0, 0.4, 0.2, 0.5, -1.0, 0.3],
            vec![0.3, 0.6],
        )
        .unwrap();
        let mut pushed = squares::pushed_block(4, 0.4).unwrap();
        let start = pushed.solve(0.0, None).unwrap();
        let history = evolve(
            &mut pushed,
            &start,
            &[0.3, 1.0, -1.0, 1.0],
            &EvolutionOptions::default(),
            |_| ControlFlow::Continue(()),
        )
        .unwrap();
        digits(&(
            problem.solution(&solved).unwrap(),
            DelassusSolver::default().solve(&delassus).unwrap().r,
            history,
        ))
    });
}
