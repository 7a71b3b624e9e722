//! One meaning of each status, whichever solver gives it.

use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::complementarity::active_set::{ActiveSetOptions, ActiveSetSolver};
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions};
use semismooth::complementarity::{AffineFunction, Lcp, McpOptions, McpSolver};
use semismooth::cones::{Cone, ConeOptions, ConeProblem, ConeSolver};
use semismooth::contact::{DelassusOptions, DelassusProblem, DelassusSolver};
use semismooth::linear::Krylov;
use semismooth::newton::{Newton, NewtonError, NewtonOptions};
use semismooth::run::Status;
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

/// What ends a run before its time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stop {
    Never,
    Observer,
    Time,
    Iterations,
}

impl Stop {
    fn flow(self) -> ControlFlow<()> {
        match self {
            Self::Observer => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }

    fn time(self) -> Option<Duration> {
        (self == Self::Time).then_some(Duration::ZERO)
    }

    fn iterations(self, most: usize) -> usize {
        if self == Self::Iterations { 1 } else { most }
    }
}

/// How a run on 0 ≤ z ⟂ M z + q ≥ 0 ended, at which z, and what is to prove that there is no solution.
struct End {
    status: Status,
    z: Vec<f64>,
    proof: Vec<f64>,
}

type Solve = fn(&Lcp, Stop) -> End;

const MOST: usize = 10_000;

fn start(lcp: &Lcp) -> Vec<f64> {
    vec![1.0; lcp.len()]
}

fn function(lcp: &Lcp) -> AffineFunction {
    AffineFunction::new(lcp.matrix().clone(), lcp.q().to_vec()).unwrap()
}

fn mcp(lcp: &Lcp, stop: Stop) -> End {
    let options = McpOptions::default().with_max_time(stop.time());
    let most = options.max_iterations;
    let mut solver = McpSolver::new(options.with_max_iterations(stop.iterations(most)));
    let mut z = start(lcp);
    let report = solver.solve_observed(lcp.mcp(), &mut z, |_| stop.flow()).unwrap();
    let (status, proof) = (report.status, report.certificate.clone());
    End { status, z, proof }
}

fn vi(lcp: &Lcp, stop: Stop) -> End {
    let options = McpOptions::default().with_max_time(stop.time());
    let most = options.max_iterations;
    let mut solver = ViSolver::new(options.with_max_iterations(stop.iterations(most)));
    let n = lcp.len();
    let set = Polyhedron::boxed(vec![0.0; n], vec![f64::INFINITY; n]).unwrap();
    let problem = Vi::new(function(lcp), set).unwrap();
    let mut z = start(lcp);
    let report = solver.solve_observed(&problem, &mut z, |_| stop.flow()).unwrap();
    let of_run = report.mcp.certificate[..].get(..n).map(<[f64]>::to_vec);
    let proof = report.ray.map(|ray| ray.direction).or(of_run).unwrap_or_default();
    End {
        status: report.status,
        z,
        proof,
    }
}

fn cone(lcp: &Lcp, stop: Stop) -> End {
    let options = ConeOptions::default().with_max_time(stop.time());
    let most = options.max_iterations;
    let solver = ConeSolver::new(options.with_max_iterations(stop.iterations(most)));
    let problem = ConeProblem::new(function(lcp), vec![Cone::Nonnegative(lcp.len())]).unwrap();
    let mut z = start(lcp);
    let report = { solver }
        .solve_observed(&problem, &mut z, |_| stop.flow())
        .unwrap();
    let proof = report.ray.map(|ray| ray.direction).unwrap_or_default();
    End {
        status: report.status,
        z,
        proof,
    }
}

/// Contacts without friction, whose second components are 0.
fn delassus(lcp: &Lcp, stop: Stop) -> End {
    let n = lcp.len();
    let normal = lcp.matrix().triplets().map(|(i, j, v)| (2 * i, 2 * j, v));
    let entries: Vec<_> = normal
        .chain((0..n).map(|i| (2 * i + 1, 2 * i + 1, 1.0)))
        .collect();
    let m = Matrix::from_triplets(2 * n, 2 * n, &entries).unwrap();
    let q: Vec<f64> = lcp.q().iter().flat_map(|q| [*q, 0.0]).collect();
    let problem = DelassusProblem::new(2, m, q, vec![0.0; n]).unwrap();
    let mut options = DelassusOptions::default().with_max_time(stop.time());
    if stop == Stop::Iterations {
        options = options.with_max_factorisations(1).with_max_sweeps(1);
    }
    let report = DelassusSolver::new(options)
        .solve_observed(&problem, None, |_| stop.flow())
        .unwrap();
    let z = report.r.iter().step_by(2).copied().collect();
    End {
        status: report.status,
        z,
        proof: Vec::new(),
    }
}

fn active_sets(lcp: &Lcp, stop: Stop) -> End {
    let options = ActiveSetOptions::default().with_max_iterations(stop.iterations(MOST));
    let mut z = start(lcp);
    let report = ActiveSetSolver::new(options)
        .solve_observed(lcp, &mut z, None, |_| stop.flow())
        .unwrap();
    End {
        status: report.status,
        z,
        proof: Vec::new(),
    }
}

fn lemke(lcp: &Lcp, stop: Stop) -> End {
    let options = match stop {
        Stop::Iterations => LemkeOptions::default().with_max_pivots(1),
        _ => LemkeOptions::default(),
    };
    let (mut z, mut solver) = (start(lcp), Lemke::new(options));
    let report = solver.solve_observed(lcp, &mut z, |_| stop.flow()).unwrap();
    let proof = solver.ray().map(<[f64]>::to_vec).unwrap_or_default();
    End {
        status: report.status,
        z,
        proof,
    }
}

fn newton(lcp: &Lcp, stop: Stop) -> End {
    let options = NewtonOptions::default().with_max_iterations(stop.iterations(MOST));
    let mut z = start(lcp);
    let status = match Newton::new(options).solve_observed(lcp.mcp(), &mut z, |_| stop.flow()) {
        Ok(_) => Status::Solved,
        Err(NewtonError::Failed(unsolved)) => unsolved.status,
        Err(e) => panic!("{e}"),
    };
    End {
        status,
        z,
        proof: Vec::new(),
    }
}

/// M z = −q, which has the same solution where that is positive.
fn krylov(lcp: &Lcp, stop: Stop) -> End {
    let mut z: Vec<f64> = lcp.q().iter().map(|q| -q).collect();
    let mut method = Krylov::cg().with_max_iterations(stop.iterations(MOST));
    let report = method.solve(&mut lcp.matrix().clone(), &mut z, 1e-12).unwrap();
    End {
        status: report.status,
        z,
        proof: Vec::new(),
    }
}

/// Each solver, and whether it proves that there is no solution, has a limit on time, and can be stopped by an observer.
const SOLVERS: [(&str, Solve, [bool; 3]); 8] = [
    ("McpSolver", mcp, [true, true, true]),
    ("ViSolver", vi, [true, true, true]),
    ("ConeSolver", cone, [true, true, true]),
    ("DelassusSolver", delassus, [false, true, true]),
    ("ActiveSetSolver", active_sets, [false, false, true]),
    ("Lemke", lemke, [true, false, true]),
    ("Newton", newton, [false, false, true]),
    ("Krylov", krylov, [false, false, false]),
];

/// −u″ as a matrix of second differences, which has no entry of its inverse that is not positive.
fn string(n: usize) -> Matrix {
    let beside = (1..n).flat_map(|i| [(i, i - 1, -1.0), (i - 1, i, -1.0)]);
    let entries: Vec<_> = beside.chain((0..n).map(|i| (i, i, 2.0))).collect();
    Matrix::from_triplets(n, n, &entries).unwrap()
}

/// A string under the load 1 at each of its nodes, that does not touch what it may not cross: zᵢ = i (n + 1 − i) / 2.
#[test]
fn solved_is_at_the_solution() {
    let n = 12;
    let lcp = Lcp::new(string(n), vec![-1.0; n]).unwrap();
    for (name, solve, _) in SOLVERS {
        let End { status, z, .. } = solve(&lcp, Stop::Never);
        assert!(status == Status::Solved && status.is_solved(), "{name}: {status}");
        for (i, z) in (1..).zip(&z) {
            let exact = f64::from(i) * (n as f64 + 1.0 - f64::from(i)) / 2.0;
            assert!((z - exact).abs() < 1e-8, "{name}: {z} {exact}");
        }
    }
}

/// z₁ − z₂ ≥ 1 and z₂ − z₁ ≥ 1 contradict each other. Who says that there is no solution proves it: v ≥ 0, Mᵀv ≤ 0 and qᵀv < 0, so that
/// vᵀ(M z + q) < 0 for all z ≥ 0. The others claim nothing.
#[test]
fn no_solution_is_proven() {
    let m = Matrix::from_rows(&[[1.0, -1.0], [-1.0, 1.0]]).unwrap();
    let lcp = Lcp::new(m.clone(), vec![-1.0; 2]).unwrap();
    for (name, solve, [proves, ..]) in SOLVERS {
        let End { status, proof, .. } = solve(&lcp, Stop::Never);
        assert_eq!(status == Status::NoSolution, proves, "{name}: {status}");
        if proves {
            let v = [proof[0], proof[1]];
            let image = [v[0] - v[1], v[1] - v[0]];
            let size = v[0].max(v[1]);
            assert!(v.iter().all(|v| *v >= 0.0) && size > 0.0, "{name}: {v:?}");
            assert!(image.iter().all(|i| *i <= 1e-12 * size), "{name}: {v:?}");
        } else {
            let claims = [
                Status::Solved,
                Status::AtRounding,
                Status::EmptySet,
                Status::Interrupted,
                Status::TimeLimit,
            ];
            assert!(!claims.contains(&status), "{name}: {status}");
        }
    }
}

/// A set without points is told apart from a function without solution: x ≥ 0 and x₁ + x₂ ≤ −1, with Farkas' multipliers y ≥ 0 of the row
/// and ρ ≥ 0 of the bounds, y (1, 1) − ρ = 0 and −y < 0.
#[test]
fn empty_sets_are_proven() {
    let set = Polyhedron::boxed(vec![0.0; 2], vec![f64::INFINITY; 2]).unwrap();
    let set = set
        .with_inequalities(Matrix::from_rows(&[[1.0, 1.0]]).unwrap(), vec![-1.0])
        .unwrap();
    let function = AffineFunction::new(Matrix::identity(2), vec![0.0; 2]).unwrap();
    let report = ViSolver::default()
        .solve(&Vi::new(function, set).unwrap(), &mut [1.0, 2.0])
        .unwrap();
    assert!(report.status == Status::EmptySet && report.ray.is_none());
    let found = report.infeasibility.unwrap().multipliers;
    let y = found.inequalities[0];
    assert!(
        y > 0.0 && found.lower.iter().all(|r| (r - y).abs() <= 1e-12 * y),
        "{found:?}"
    );
}

/// Each limit has its word, and the observer has another.
#[test]
fn limits_have_their_words() {
    // Loads of both signs, so that the string is held at several places and no run ends at once.
    let n = 40;
    let q = (0..n).map(|i| if i * i % 11 < 5 { -0.5 } else { 0.95 }).collect();
    let lcp = Lcp::new(string(n), q).unwrap();
    for (name, solve, [_, timed, observed]) in SOLVERS {
        let ended = solve(&lcp, Stop::Iterations).status;
        assert_eq!(ended, Status::IterationLimit, "{name}");
        if timed {
            assert_eq!(solve(&lcp, Stop::Time).status, Status::TimeLimit, "{name}");
        }
        if observed {
            assert_eq!(solve(&lcp, Stop::Observer).status, Status::Interrupted, "{name}");
        }
    }
}
