//! Accessors and options that no other test asks for.

use semismooth::complementarity::{AffineFunction, Lcp, Mcp, McpOptions, McpSolver};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Strategy};
use semismooth::fem::Mesh;
use semismooth::piecewise::{Facet, MinMap};
use semismooth::sparse::Matrix;

#[test]
fn complementarity() {
    let m = Matrix::from_rows(&[[2.0, 0.0], [1.0, 0.0]]).unwrap();
    let standard = Lcp::new(m.clone(), vec![-2.0, 1.0]).unwrap();
    assert!(standard.is_standard());
    let boxed = Lcp::boxed(m.clone(), vec![-2.0, 1.0], vec![0.0; 2], vec![1.0, f64::INFINITY]).unwrap();
    assert!(!boxed.is_standard());
    let problem = Mcp::ncp(AffineFunction::new(m, vec![-2.0, 1.0]).unwrap()).unwrap();
    assert!(!problem.is_parametric());
    // The diagonal belongs to it whatever F has.
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
