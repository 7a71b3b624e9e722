use semismooth::complementarity::{Lcp, Mcp, McpSolver};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::sparse::Matrix;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    let matrix = Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?;
    let limited = Mcp::affine(
        matrix,
        vec![-6.0, -4.0],
        vec![0.0, 0.0],
        vec![2.0, f64::INFINITY],
    )?;
    let mut q = [0.0, 0.0];
    let mut solver = McpSolver::default();
    println!(
        "  {}, q = ({:.4}, {:.4})",
        solver.solve(&limited, &mut q)?.status,
        q[0],
        q[1]
    );

    println!("2.");
    for q in [1.0, -1.0] {
        let problem = Lcp::new(Matrix::from_rows(&[[-1.0]])?, vec![q])?;
        let list =
            all_solutions(problem.mcp(), 0.0, &EnumerationOptions::default())?;
        let found: Vec<f64> = list.solutions.iter().map(|s| s.x[0]).collect();
        let mut z = [0.0];
        let status = McpSolver::default().solve(problem.mcp(), &mut z)?.status;
        println!(
            "  q = {q:+}: solutions {found:?}, {}; McpSolver: {status}",
            list.completeness
        );
    }

    println!("3.");
    for (a, b) in [(0.0_f64, 2.0_f64), (1.0, 0.0), (0.5, 0.5), (-1.0, 3.0)] {
        let fischer_burmeister = a.hypot(b) - a - b;
        println!(
            "  ({a}, {b}): min {:+.3}, Fischer–Burmeister {fischer_burmeister:+.3}",
            a.min(b)
        );
    }
    Ok(())
}
