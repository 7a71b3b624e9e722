use semismooth::piecewise::{
    Kinks, NonsmoothFunction, PiecewiseSmooth, Real, Selections, Traced,
    b_derivative, select,
};

/// min(max(y, −1), 1), once with two kinks and once with a projection.
struct Clipped {
    in_one_site: bool,
}

impl NonsmoothFunction for Clipped {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (y, load) = (x[0], x[1]);
        let clipped = if self.in_one_site {
            kinks.project(T::from(-1.0), y, T::from(1.0))
        } else {
            let above = kinks.max(y, T::from(-1.0));
            kinks.min(above, T::from(1.0))
        };
        out[0] = clipped - load;
    }
}

/// y |y|, which has a derivative at 0.
struct Square;

impl NonsmoothFunction for Square {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0] * kinks.abs(x[0]) - x[1];
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    let mut met = Vec::new();
    for in_one_site in [false, true] {
        let map = Traced::new(Clipped { in_one_site });
        met.clear();
        for k in -30..=30 {
            let selection = select(&map, &[0.1 * f64::from(k) + 0.05, 0.0]);
            if !met.contains(&selection) {
                met.push(selection);
            }
        }
        let total = Selections::all(&map).count();
        println!(
            "  sites: {}, selections: {total}, of which met: {}",
            map.num_sites(),
            met.len()
        );
    }

    println!("2.");
    let square = Traced::new(Square);
    for d in [-1.0, 1.0] {
        let mut derivative = [0.0];
        b_derivative(&square, &[0.0, 0.0], &[d, 0.0], 1e-12, &mut derivative)?;
        println!("  H'(0; {d:+}) = {}", derivative[0].abs());
    }
    Ok(())
}
