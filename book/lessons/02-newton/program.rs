use semismooth::newton::{Damping, Newton, NewtonError, NewtonOptions};
use semismooth::output::{
    BranchDiagram, Colour, Curve, Marker, Panel, SegmentStyle,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

/// y plus the projection of 2 y on [−1, 1]: strictly increasing, with its only
/// zero at 0.
struct Saturating;

impl NonsmoothFunction for Saturating {
    fn num_vars(&self) -> usize {
        1
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, y: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = y[0] + kinks.project(T::from(-1.0), y[0] * 2.0, T::from(1.0));
    }
}

/// exp(y) − 1 + max(y, 0): its zero lies in the kink.
struct AtTheKink;

impl NonsmoothFunction for AtTheKink {
    fn num_vars(&self) -> usize {
        1
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, y: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = y[0].exp() - 1.0 + kinks.positive_part(y[0]);
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("y + P(2 y) from y = 1:");
    let saturating = Traced::new(Saturating);
    let mut y = [1.0];
    let plain = NewtonOptions::default().with_damping(Damping::Never);
    match Newton::new(plain).solve(&saturating, &mut y) {
        Err(NewtonError::Failed(failed)) => {
            let norms: Vec<f64> = failed
                .report
                .history
                .iter()
                .take(4)
                .map(|i| i.residual_norm)
                .collect();
            println!("  full steps: {}; |H| = {norms:?} …", failed.status);
        }
        other => println!("  full steps: {other:?}"),
    }
    let mut y = [1.0];
    Newton::new(NewtonOptions::default()).solve(&saturating, &mut y)?;
    println!(
        "  shortened where full steps repeat themselves: y = {:.1}",
        y[0].abs()
    );

    println!("exp(y) − 1 + max(y, 0) from y = −2:");
    let mut y = [-2.0];
    let mut newton =
        Newton::new(NewtonOptions::default().with_tolerances(1e-12, 0.0));
    newton.solve(&Traced::new(AtTheKink), &mut y)?;
    for step in newton
        .report()
        .history
        .iter()
        .filter(|step| step.residual_norm > 1e-12)
    {
        println!("  iterate {}: |H| = {:.1e}", step.index, step.residual_norm);
    }

    // The cycle: each tangent leads to where the other begins.
    let h = |y: f64| y + (2.0 * y).clamp(-1.0, 1.0);
    let graph = [-1.5, -0.5, 0.5, 1.5].map(|y| (y, h(y)));
    let tangents = [
        (1.0, h(1.0)),
        (-1.0, 0.0),
        (-1.0, h(-1.0)),
        (1.0, 0.0),
        (1.0, h(1.0)),
    ];
    let panel = Panel::new("y", "H(y)")
        .with_curve(Curve::line(
            graph.to_vec(),
            SegmentStyle::new("H", Colour::BLUE),
        ))
        .with_curve(
            Curve::line(
                tangents.to_vec(),
                SegmentStyle::new("Newton's steps", Colour::ORANGE),
            )
            .with_marks(Marker::Isolated, [(0.0, 0.0)]),
        );
    BranchDiagram::new(panel)
        .with_size(560, 380)
        .write("cycle.svg")?;
    Ok(())
}
