use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

/// A beam softens at the deflection y = 1 and meets a stop at y = 3; x = (y,
/// load).
struct Beam;

impl NonsmoothFunction for Beam {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (y, load) = (x[0], x[1]);
        let softening = kinks.positive_part(y - 1.0) * 1.25;
        let stop = kinks.positive_part(y - 3.0) * 10.0;
        out[0] = y - softening + stop - load;
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let beam = Traced::new(Beam);
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let branch =
        Branch::follow(&beam, &[0.0, 0.0], Direction::Increasing, options)?;
    for t in &branch.transitions {
        let slopes = [&t.tangent_before, &t.tangent_after]
            .map(|tangent| tangent[1] / tangent[0]);
        println!(
            "load {:.4}, deflection {:.4}: {}, d load / dy {:+.2} before and {:+.2} after",
            t.parameter(),
            t.x[0],
            t.kind,
            slopes[0],
            slopes[1]
        );
    }
    println!("the curve ends: {}", branch.termination);

    let curve = Curve::of_branch(
        &branch,
        |x| x[0],
        |_, _| SegmentStyle::new("equilibria", Colour::BLUE),
    );
    BranchDiagram::new(Panel::new("load", "deflection y").with_curve(curve))
        .with_size(560, 380)
        .write("beam.svg")?;
    Ok(())
}
