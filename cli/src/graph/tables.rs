//! Piecewise linear functions, as AMPL writes `<<breakpoints; slopes>> x`.

/// A continuous piecewise linear function that is 0 at 0.
#[derive(Debug, Clone, PartialEq)]
pub struct PiecewiseLinear {
    /// Where the slope changes, in increasing order.
    breakpoints: Vec<f64>,
    /// One slope more than breakpoints.
    slopes: Vec<f64>,
    /// Value at each breakpoint.
    values: Vec<f64>,
}

impl PiecewiseLinear {
    /// The function with these breakpoints and one slope more; `None` for other numbers of them, breakpoints that decrease, and what is
    /// not finite.
    #[must_use]
    pub fn new(breakpoints: Vec<f64>, slopes: Vec<f64>) -> Option<Self> {
        let finite = breakpoints.iter().chain(&slopes).all(|x| x.is_finite());
        if slopes.len() != breakpoints.len() + 1 || !finite || breakpoints.windows(2).any(|w| w[0] > w[1]) {
            return None;
        }
        let mut table = Self {
            values: vec![0.0; breakpoints.len()],
            breakpoints,
            slopes,
        };
        // From 0 outwards, so that the value there is 0.
        let zero = table.piece(0.0);
        let (mut x, mut y) = (0.0, 0.0);
        for k in zero..table.breakpoints.len() {
            y += table.slopes[k] * (table.breakpoints[k] - x);
            x = table.breakpoints[k];
            table.values[k] = y;
        }
        (x, y) = (0.0, 0.0);
        for k in (0..zero).rev() {
            y += table.slopes[k + 1] * (table.breakpoints[k] - x);
            x = table.breakpoints[k];
            table.values[k] = y;
        }
        Some(table)
    }

    /// The piece at x: the number of breakpoints below x.
    fn piece(&self, x: f64) -> usize {
        self.breakpoints.partition_point(|&b| b < x)
    }

    /// The value at x.
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        if x.is_nan() {
            return x;
        }
        let k = self.piece(x);
        let nearest = match k {
            0 => 0,
            _ => k - 1,
        };
        match self.breakpoints.get(nearest) {
            Some(&b) => self.values[nearest] + self.slopes[k] * (x - b),
            None => self.slopes[k] * x,
        }
    }

    /// The slope at x, at a breakpoint the one to its left.
    #[must_use]
    pub fn slope(&self, x: f64) -> f64 {
        self.slopes[self.piece(x)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_function_is_continuous_and_zero_at_zero() {
        let slopes = vec![-1.0, 2.0, 0.5, 4.0];
        for breakpoints in [
            vec![1.0, 2.0, 5.0],
            vec![-5.0, -2.0, -1.0],
            vec![-1.0, 0.0, 3.0],
            vec![-1.0, 1.0, 1.0],
        ] {
            let f = PiecewiseLinear::new(breakpoints.clone(), slopes.clone()).unwrap();
            assert_eq!(f.value(0.0), 0.0);
            for &b in &breakpoints {
                assert!((f.value(b + 1e-9) - f.value(b - 1e-9)).abs() < 1e-7);
            }
            for x in [-7.3, -3.1, -1.2, -0.4, 0.3, 1.4, 4.2, 9.9] {
                let slope = (f.value(x + 1e-3) - f.value(x - 1e-3)) / 2e-3;
                assert!((slope - f.slope(x)).abs() < 1e-9, "{breakpoints:?} {x}");
            }
        }
        assert_eq!(PiecewiseLinear::new(vec![], vec![3.0]).unwrap().value(2.0), 6.0);
    }

    #[test]
    fn what_is_no_such_function_is_refused() {
        assert!(PiecewiseLinear::new(vec![2.0, 1.0], vec![0.0; 3]).is_none());
        assert!(PiecewiseLinear::new(vec![1.0], vec![0.0]).is_none());
        assert!(PiecewiseLinear::new(vec![f64::NAN], vec![0.0, 1.0]).is_none());
    }
}
