use semismooth::complementarity::{Autodiff, Lcp, Mcp, McpSolver, SmoothFunction};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::Real;
use semismooth::sparse::Matrix;

/// What a further unit costs each of two firms, x = (q₁, q₂, a): unit costs 2 and
/// 4, price a − q₁ − q₂.
struct Market;

impl SmoothFunction for Market {
    fn num_vars(&self) -> usize {
        3
    }

    fn num_values(&self) -> usize {
        2
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let [q1, q2, a] = [x[0], x[1], x[2]];
        out[0] = q1 * 2.0 + q2 + 2.0 - a;
        out[1] = q1 + q2 * 2.0 + 4.0 - a;
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let matrix = Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?;
    for a in [5.0, 8.0] {
        let problem = Lcp::new(matrix.clone(), vec![2.0 - a, 4.0 - a])?;
        let mut q = [0.0, 0.0];
        let mut solver = McpSolver::default();
        let report = solver.solve(problem.mcp(), &mut q)?;
        println!("a = {a}: {}, q = ({:.4}, {:.4})", report.status, q[0], q[1]);
    }

    // The equilibrium as a curve over the size a of the market.
    let market = Mcp::ncp(Autodiff::new(Market))?;
    let options = ContinuationOptions::default().with_parameter_range((0.0, 10.0));
    let branch =
        Branch::follow(&market, &[0.0, 0.0, 0.0], Direction::Increasing, options)?;
    for t in &branch.transitions {
        println!(
            "at a = {:.4} firm {} enters",
            t.parameter(),
            t.sites[0].site + 1
        );
    }
    let firm = |k: usize, name: &'static str, colour| {
        Curve::of_branch(
            &branch,
            move |x| x[k],
            move |_, _| SegmentStyle::new(name, colour),
        )
    };
    let panel = Panel::new("size of the market a", "quantity")
        .with_curve(firm(0, "firm 1, cost 2", Colour::BLUE))
        .with_curve(firm(1, "firm 2, cost 4", Colour::ORANGE));
    BranchDiagram::new(panel)
        .with_size(560, 360)
        .write("market.svg")?;
    Ok(())
}
