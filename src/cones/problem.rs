use super::Cone;
use crate::complementarity::{ComplementarityError, McpFunction};
use crate::input::check_length;
use crate::sparse::max_abs;

/// The problem x ∈ K, F(x) ∈ K*, xᵀF(x) = 0 for K a product of cones, which partition x in order.
///
/// ```
/// use semismooth::complementarity::AffineFunction;
/// use semismooth::cones::{Cone, ConeProblem, ConeSolver};
/// use semismooth::sparse::Matrix;
/// // The point of t ≥ ‖v‖ nearest to (0, 3, 4): F is the gradient of half the squared distance.
/// let f = AffineFunction::new(Matrix::identity(3), vec![0.0, -3.0, -4.0])?;
/// let problem = ConeProblem::new(f, vec![Cone::SecondOrder(3)])?;
/// let mut x = [0.0; 3];
/// let report = ConeSolver::default().solve(&problem, &mut x)?;
/// assert!(report.is_solved() && (x[0] - 2.5).abs() < 1e-12 && (x[2] - 2.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ConeProblem<F> {
    function: F,
    cones: Vec<Cone>,
}

impl<F: McpFunction> ConeProblem<F> {
    /// The problem of F and K.
    ///
    /// # Errors
    /// No cones, a cone without variables, more variables than can be counted, F with other numbers of variables or values than K or a
    /// pattern of another shape.
    pub fn new(function: F, cones: Vec<Cone>) -> Result<Self, ComplementarityError> {
        let mut n = 0_usize;
        for (index, cone) in cones.iter().enumerate() {
            if cone.is_empty() {
                return Err(ComplementarityError::EmptyCone { index });
            }
            n = n
                .checked_add(cone.len())
                .ok_or(ComplementarityError::TooManyVariables { index })?;
        }
        if n == 0 {
            return Err(ComplementarityError::Empty);
        }
        for (what, found) in [
            ("F", function.num_values()),
            ("the argument of F", function.num_vars()),
        ] {
            check_length(what, found, n)?;
        }
        let pattern = function.pattern();
        for (what, found) in [
            ("a column of the pattern of F", pattern.nrows()),
            ("a row of the pattern of F", pattern.ncols()),
        ] {
            check_length(what, found, n)?;
        }
        Ok(Self { function, cones })
    }

    /// F.
    #[must_use]
    pub fn function(&self) -> &F {
        &self.function
    }

    /// The factors of K.
    #[must_use]
    pub fn cones(&self) -> &[Cone] {
        &self.cones
    }

    /// Number of variables.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cones.iter().map(|c| c.len()).sum()
    }

    /// Always false: a problem has at least one variable.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cones.is_empty()
    }

    /// Each cone with the range of its variables.
    pub(super) fn blocks(&self) -> impl Iterator<Item = (Cone, std::ops::Range<usize>)> + '_ {
        let mut first = 0;
        self.cones.iter().map(move |&cone| {
            let range = first..first + cone.len();
            first = range.end;
            (cone, range)
        })
    }

    /// Moves x to the nearest point of K.
    ///
    /// # Errors
    /// x of the wrong length.
    pub fn project(&self, x: &mut [f64]) -> Result<(), ComplementarityError> {
        self.check("x", x.len())?;
        for (cone, range) in self.blocks() {
            cone.project(&mut x[range]);
        }
        Ok(())
    }

    /// Writes x − P(x − F(x)), P the projection on K, to `out` and returns its largest absolute value; NaN where F is.
    ///
    /// # Errors
    /// Wrong lengths.
    pub fn natural_residual(&self, x: &[f64], out: &mut [f64]) -> Result<f64, ComplementarityError> {
        self.check("x", x.len())?;
        self.check("out", out.len())?;
        self.natural_map(x, out);
        Ok(max_abs(out))
    }

    pub(super) fn natural_map(&self, x: &[f64], out: &mut [f64]) {
        self.function.value(x, out);
        for (cone, range) in self.blocks() {
            let block = &mut out[range.clone()];
            block
                .iter_mut()
                .zip(&x[range.clone()])
                .for_each(|(f, x)| *f = x - *f);
            cone.project(block);
            block.iter_mut().zip(&x[range]).for_each(|(p, x)| *p = x - *p);
        }
    }

    pub(super) fn check(&self, what: &'static str, found: usize) -> Result<(), ComplementarityError> {
        Ok(check_length(what, found, self.len())?)
    }
}
