use semismooth::newton::{Damping, Newton, NewtonError, NewtonOptions};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

/// y + P(s y) with the projection P on [−1, 1].
struct Saturating {
    slope: f64,
}

impl NonsmoothFunction for Saturating {
    fn num_vars(&self) -> usize {
        1
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, y: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] =
            y[0] + kinks.project(T::from(-1.0), y[0] * self.slope, T::from(1.0));
    }
}

/// Newton's method by hand: −3 y for y ≤ 0, y^(3/2) + y for y ≥ 0 has derivatives
/// −3 and 1 at its zero.
fn iterates(mut y: f64) -> Vec<f64> {
    let mut all = vec![y];
    while y != 0.0 && all.len() < 20 {
        let (h, slope) = if y < 0.0 {
            (-3.0 * y, -3.0)
        } else {
            (y.powf(1.5) + y, 1.5 * y.sqrt() + 1.0)
        };
        y -= h / slope;
        all.push(y);
    }
    all
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    for slope in [0.5, 2.0, 8.0] {
        let map = Traced::new(Saturating { slope });
        let outcomes = [0.25, 1.0, 4.0].map(|start| {
            let plain = NewtonOptions::default().with_damping(Damping::Never);
            match Newton::new(plain).solve(&map, &mut [start]) {
                Ok(_) => "solved".to_owned(),
                Err(NewtonError::Failed(_)) => "not solved".to_owned(),
                Err(e) => e.to_string(),
            }
        });
        println!("  s = {slope}, from 1/4, 1 and 4: {}", outcomes.join("; "));
    }

    println!("2.");
    for pair in iterates(1.0).windows(2).take(6) {
        println!(
            "  |y| = {:.1e}, divided by the last |y|^1.5: {:.2}",
            pair[1].abs(),
            pair[1].abs() / pair[0].abs().powf(1.5)
        );
    }
    Ok(())
}
