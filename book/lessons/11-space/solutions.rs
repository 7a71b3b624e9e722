use semismooth::complementarity::AffineFunction;
use semismooth::cones::Cone;
use semismooth::contact::{DelassusProblem, DelassusSolver};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Projection, Vi, ViSolver};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    for push in [0.28, 0.32] {
        let one = DelassusProblem::new(
            3,
            Matrix::identity(3),
            vec![-1.0, 0.6 * push, 0.8 * push],
            vec![0.3],
        )?;
        let report = DelassusSolver::default().solve(&one)?;
        let force = report.r[1].hypot(report.r[2]);
        let slip = report.u[1].hypot(report.u[2]);
        println!(
            "  push {push}: {}, |r_T| = {force:.4}, |u_T| = {:.4}",
            if report.states[0].is_slip() {
                "slip"
            } else {
                report.states[0].name()
            },
            (slip * 1e9).round() / 1e9
        );
    }

    println!("2.");
    for p in [[2.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [1.0, 3.0, 4.0]] {
        let mut x = p;
        Cone::SecondOrder(3).project(&mut x);
        println!("  {p:?} goes to ({:.4}, {:.4}, {:.4})", x[0], x[1], x[2]);
    }

    println!("3.");
    let set = Polyhedron::boxed(vec![0.0, 0.0], vec![1.0, 1.0])?
        .with_equations(Matrix::from_rows(&[[1.0, 1.0]])?, vec![4.0])?;
    if let Projection::Empty(proof) = set.project(&[0.0, 0.0])? {
        println!(
            "  empty: multiplier {:.1} of the equation, {:.1?} of the upper bounds",
            proof.multipliers.equations[0], proof.multipliers.upper
        );
    }
    let times = AffineFunction::new(
        Matrix::from_rows(&[[2.0, 0.0], [0.0, 1.0]])?,
        vec![1.0, 3.0],
    )?;
    let report =
        ViSolver::default().solve(&Vi::new(times, set)?, &mut [0.0, 0.0])?;
    println!("  ViSolver: {}", report.status.name());
    Ok(())
}
