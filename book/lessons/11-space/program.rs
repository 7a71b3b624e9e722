use semismooth::complementarity::AffineFunction;
use semismooth::cones::{Cone, ConeProblem, ConeSolver};
use semismooth::contact::{DelassusProblem, DelassusSolver};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A rod on two feet, components (N, T₁, T₂) of each; pushed at the first foot
    // across, and along the rod.
    let m = Matrix::from_rows(&[
        [3.0, 0.0, 0.0, -1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 3.0, 0.0, 0.0, -1.0],
        [-1.0, 0.0, 0.0, 3.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, -1.0, 0.0, 0.0, 3.0],
    ])?;
    let rod = DelassusProblem::new(
        3,
        m,
        vec![-1.0, 0.1, 0.9, -1.0, 0.1, -0.3],
        vec![0.5, 0.5],
    )?;
    let report = DelassusSolver::default().solve(&rod)?;
    println!("rod: {}", report.status);
    let mut panel = Panel::new("T_1", "T_2");
    let circle = (0..=72).map(|k| f64::from(k) * std::f64::consts::TAU / 72.0);
    let limit = circle.map(|t| (0.25 * t.cos(), 0.25 * t.sin())).collect();
    panel = panel
        .with_curve(Curve::line(limit, SegmentStyle::new("μ r_N", Colour::GREY)));
    for (foot, (colour, name)) in
        [(Colour::ORANGE, "foot 1"), (Colour::BLUE, "foot 2")]
            .into_iter()
            .enumerate()
    {
        let r = &report.r[3 * foot..3 * foot + 3];
        println!(
            "  foot {}: {}, r = ({:.4}, {:.4}, {:.4})",
            foot + 1,
            if report.states[foot].is_slip() {
                "slip"
            } else {
                report.states[foot].name()
            },
            r[0],
            plain(r[1]),
            r[2]
        );
        let force = Curve::line(
            vec![(0.0, 0.0), (r[1], r[2])],
            SegmentStyle::new(name, colour),
        );
        panel = panel.with_curve(force.with_arrows(true));
    }
    let panel = panel.with_x_range(-0.4, 0.4).with_y_range(-0.3, 0.3);
    BranchDiagram::new(panel)
        .with_size(560, 440)
        .write("forces.svg")?;

    // The projection of p on the second-order cone: x ∈ K, x − p ∈ K* = K, xᵀ(x −
    // p) = 0.
    let p = [1.0, 3.0, 0.0];
    let distance =
        AffineFunction::new(Matrix::identity(3), p.map(|v| -v).to_vec())?;
    let nearest = ConeProblem::new(distance, vec![Cone::SecondOrder(3)])?;
    let mut x = vec![0.0; 3];
    let report = ConeSolver::default().solve(&nearest, &mut x)?;
    println!(
        "projection on the cone: {}, x = ({:.4}, {:.4}, {:.4})",
        report.status,
        x[0],
        x[1],
        plain(x[2])
    );

    // Drivers choose between two roads with travel times 1 + 2 x₁ and 3 + x₂: a
    // variational inequality on x₁ + x₂ = 4, x ≥ 0.
    let times = AffineFunction::new(
        Matrix::from_rows(&[[2.0, 0.0], [0.0, 1.0]])?,
        vec![1.0, 3.0],
    )?;
    let demand = Polyhedron::boxed(vec![0.0, 0.0], vec![f64::INFINITY; 2])?
        .with_equations(Matrix::from_rows(&[[1.0, 1.0]])?, vec![4.0])?;
    let mut x = vec![0.0, 0.0];
    let report = ViSolver::default().solve(&Vi::new(times, demand)?, &mut x)?;
    println!("roads: {}, x = ({:.4}, {:.4})", report.status, x[0], x[1]);
    Ok(())
}

/// Without rounding errors about zero.
fn plain(value: f64) -> f64 {
    if value.abs() < 1e-9 { 0.0 } else { value }
}
