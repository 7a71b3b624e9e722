use crate::sparse::dot;

/// Broyden's method in limited-memory form: the steps made with the same factors give the update of the
/// factored Jacobian. C. T. Kelley, Solving Nonlinear Equations with Newton's Method, SIAM 2003, section 4.
#[derive(Debug, Clone, Default)]
pub(super) struct Secants {
    steps: Vec<f64>,
    squares: Vec<f64>,
}

impl Secants {
    pub(super) fn clear(&mut self) {
        self.steps.clear();
        self.squares.clear();
    }

    pub(super) fn push(&mut self, step: &[f64]) {
        self.steps.extend_from_slice(step);
        self.squares.push(dot(step, step));
    }

    /// Turns the next chord step into that of Broyden's method.
    pub(super) fn turn(&self, step: &mut [f64]) {
        const LEAST: f64 = 0.5;
        let known = self.steps.chunks_exact(step.len()).zip(&self.squares);
        for (place, (s, square)) in known.clone().enumerate() {
            let share = dot(s, step) / square;
            if !share.is_finite() {
                return;
            }
            if let Some((next, _)) = known.clone().nth(place + 1) {
                step.iter_mut().zip(next).for_each(|(d, n)| *d += share * n);
            } else if 1.0 - share >= LEAST {
                step.iter_mut().for_each(|d| *d /= 1.0 - share);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Secants;
    use crate::sparse::{dot, norm};

    /// Broyden's method solves n linear equations in 2 n steps (D. M. Gay, SIAM J. Numer. Anal. 16, 1979).
    #[test]
    fn secants_solve_linear_equations_in_twice_as_many_steps() {
        let (a, b) = (
            [[1.2, 0.1, -0.1], [-0.2, 0.9, 0.2], [0.1, 0.1, 1.1]],
            [1.0, -2.0, 0.5],
        );
        let (mut x, mut secants) = ([0.0; 3], Secants::default());
        let rest = |x: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|i| dot(&a[i], x) - b[i]) };
        for k in 0..6 {
            assert!(k > 3 || norm(&rest(&x)) > 1e-14, "{k}");
            let mut step = rest(&x);
            secants.turn(&mut step);
            secants.push(&step);
            x.iter_mut().zip(step).for_each(|(x, d)| *x -= d);
        }
        assert!(norm(&rest(&x)) < 1e-14, "{:?}", rest(&x));
    }
}
