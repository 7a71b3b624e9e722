//! What does not fit into the memory allowed is refused before any of it is allocated.

use semismooth::complementarity::{AffineFunction, ComplementarityError};
use semismooth::cones::{Cone, ConeMap, ConeOptions, ConeProblem, ConeSolver};
use semismooth::sparse::Matrix;

fn nearest(cones: Vec<Cone>) -> ConeProblem<AffineFunction> {
    let n = cones.iter().map(|c| c.len()).sum();
    let q = (0..n)
        .map(|i| f64::from((i * 37 % 101) as u32) / 101.0 - 0.5)
        .collect();
    ConeProblem::new(AffineFunction::new(Matrix::identity(n), q).unwrap(), cones).unwrap()
}

/// Of a cone with n variables n² derivatives are stored; many small cones with as many variables, or
/// half-lines, need little.
#[test]
fn what_does_not_fit_is_refused() {
    for cone in [Cone::SecondOrder(20_000), Cone::Semidefinite(150)] {
        let problem = nearest(vec![cone]);
        let refused = ConeSolver::default().solve(&problem, &mut vec![0.0; cone.len()]);
        let squared = (cone.len() as f64).powi(2);
        let large = |needed: f64, limit: f64| limit == 4096.0 * 1024.0 * 1024.0 && needed >= 8.0 * squared;
        assert!(
            matches!(refused, Err(ComplementarityError::Memory { needed, limit }) if large(needed, limit)),
            "{cone:?}: {refused:?}"
        );
        assert!(matches!(
            ConeMap::natural(&problem),
            Err(ComplementarityError::Memory { .. })
        ));
        assert!(matches!(
            ConeMap::normal(&problem),
            Err(ComplementarityError::Memory { .. })
        ));
    }
    for cones in [vec![Cone::SecondOrder(4); 5_000], vec![Cone::Nonnegative(20_000)]] {
        let problem = nearest(cones);
        let report = ConeSolver::default()
            .solve(&problem, &mut vec![0.0; 20_000])
            .unwrap();
        assert!(report.is_solved(), "{report}");
    }
}

/// The estimate grows with the square of the order of a cone, and the limit is that of the options.
#[test]
fn the_limit_is_chosen() {
    let needed = |n: usize| {
        let options = ConeOptions::default().with_max_memory(1);
        match ConeSolver::new(options).solve(&nearest(vec![Cone::SecondOrder(n)]), &mut vec![0.0; n]) {
            Err(ComplementarityError::Memory { needed, .. }) => needed,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(needed(200), 4.0 * needed(100));
    let options = ConeOptions::default().with_max_memory(needed(100) as u64);
    let solve = |n: usize| {
        ConeSolver::new(options.clone()).solve(&nearest(vec![Cone::SecondOrder(n)]), &mut vec![0.0; n])
    };
    assert!(solve(100).is_ok_and(|r| r.is_solved()) && solve(101).is_err());
}
