use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

/// The beam with a softening of its own.
struct Beam {
    softening: f64,
}

impl NonsmoothFunction for Beam {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let softening = kinks.positive_part(x[0] - 1.0) * self.softening;
        let stop = kinks.positive_part(x[0] - 3.0) * 10.0;
        out[0] = x[0] - softening + stop - x[1];
    }
}

/// A curve with a smooth fold at y = 0 and a kink at y = 0.5: y² + max(y − 1/2,
/// 0) = α.
struct Parabola;

impl NonsmoothFunction for Parabola {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0] * x[0] + kinks.positive_part(x[0] - 0.5) - x[1];
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    for softening in [0.75, 1.25] {
        let beam = Traced::new(Beam { softening });
        let branch = Branch::follow(
            &beam,
            &[0.0, 0.0],
            Direction::Increasing,
            options.clone(),
        )?;
        let kinds: Vec<String> = branch
            .transitions
            .iter()
            .map(|t| t.kind.to_string())
            .collect();
        println!("  softening {softening}: {}", kinds.join(", "));
    }

    println!("2.");
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let branch = Branch::follow(
        &Traced::new(Parabola),
        &[-1.0, 1.0],
        Direction::Decreasing,
        options,
    )?;
    for fold in &branch.smooth_folds {
        println!("  smooth fold at α = {:.4}", fold.parameter().abs());
    }
    for t in &branch.transitions {
        println!("  {} at α = {:.4}", t.kind, t.parameter());
    }
    Ok(())
}
