use semismooth::continuation::{
    Branch, ContinuationOptions, Direction, FoldSet, TransitionSet,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

/// y³ − b y + a = 0: x = (y, a, b). For each b > 0 two smooth folds over a.
struct Cusp;

impl NonsmoothFunction for Cusp {
    fn num_vars(&self) -> usize {
        3
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0] * x[0] * x[0] - x[2] * x[0] + x[1];
    }
}

/// y − b max(y − 1, 0) = a: a kink at y = 1, which is a fold for b > 1.
struct Beam;

impl NonsmoothFunction for Beam {
    fn num_vars(&self) -> usize {
        3
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0] - x[2] * kinks.positive_part(x[0] - 1.0) - x[1];
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    let beam = Traced::new(Beam);
    let kink = TransitionSet::new(&beam, 0, 0)?;
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let line =
        Branch::follow(&kink, &[1.0, 1.0, 0.0], Direction::Increasing, options)?;
    for change in kink.character_changes(&line)? {
        println!(
            "  the kink begins to be a fold at a = {:.4}, b = {:.4}",
            change.x[1], change.x[2]
        );
    }

    println!("2.");
    // At b = 3 the folds lie at y = ±1, a = ±2.
    let (folds, start) = FoldSet::new(Traced::new(Cusp), &[1.0, 2.0, 3.0])?;
    let options = ContinuationOptions::default()
        .with_parameter_range((0.0, 3.0))
        .with_targets(vec![0.75])
        .with_max_step(0.1);
    let curve = Branch::follow(&folds, &start, Direction::Decreasing, options)?;
    for point in curve
        .points
        .iter()
        .filter(|p| (p.parameter() - 0.75).abs() < 1e-12)
    {
        let x = folds.family_point(&point.x);
        println!(
            "  fold at y = {:+.4}, a = {:+.4} for b = {:.4}",
            x[0], x[1], x[2]
        );
    }
    Ok(())
}
