use std::fmt;

use num_dual::Dual64;

use super::McpFunction;
use super::scratch::Scratch;
use crate::piecewise::trace::{lacking, ordinary_point, structure};
use crate::piecewise::{Formula, Kinks, NonsmoothFunction, Real};
use crate::sparse::{Coloring, Matrix, Pattern};

/// A smooth function written once over [`Real`]; [`Autodiff`] turns it into an [`McpFunction`] with exact Jacobians.
pub trait SmoothFunction {
    /// Number m of variables.
    fn num_vars(&self) -> usize;

    /// Number n of values: m, or m − 1 for a function with a parameter. Default: m.
    fn num_values(&self) -> usize {
        self.num_vars()
    }

    /// Writes F(x) to `out`.
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]);

    /// Where the Jacobian has entries. Default: found by tracing [`eval`](Self::eval) at two points, the zero vector and one in (½, ¾)ᵐ,
    /// with one evaluation for 256 variables. A pattern of your own saves these evaluations; one that lacks an entry is refused
    /// ([`PiecewiseError::StrayEntry`](crate::piecewise::PiecewiseError::StrayEntry)) where the first Jacobian is evaluated. Entries of a
    /// branch of [`eval`](Self::eval) that none of these points takes are not seen: Jacobians are wrong where it is taken later (d² x₂ for
    /// d = x₀ − 2 > 0 is counted for another column). Functions with such branches need a pattern of their own.
    fn pattern(&self) -> Pattern {
        let (n, m) = (self.num_values(), self.num_vars());
        let mut entries = Vec::new();
        for x in [vec![0.0; m], ordinary_point(m)] {
            entries.extend(structure(n, m, &x, &mut |x, _, out| self.eval(x, out)));
        }
        // All of them lie inside.
        Pattern::from_entries(n, m, entries).unwrap_or_else(|_| Pattern::full(n, m))
    }
}

/// At a kink, value and derivatives are those of the piece that the test functions choose.
impl SmoothFunction for Formula {
    fn num_vars(&self) -> usize {
        NonsmoothFunction::num_vars(self)
    }

    fn num_values(&self) -> usize {
        self.num_residuals()
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        NonsmoothFunction::eval(self, x, &mut Kinks::chosen(), out);
    }
}

/// A [`SmoothFunction`] with its Jacobian by forward-mode dual numbers, one evaluation for all columns of a colour.
///
/// ```
/// use semismooth::complementarity::{Autodiff, Mcp, McpSolver, SmoothFunction};
/// use semismooth::piecewise::Real;
/// struct Prices;
/// impl SmoothFunction for Prices {
///     fn num_vars(&self) -> usize { 2 }
///     fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
///         out[0] = x[0].ln() + x[1] - 1.0;
///         out[1] = x[1] * x[1] + x[0] - 1.0;
///     }
/// }
/// let problem = Mcp::new(Autodiff::new(Prices), vec![1e-6, 0.0], vec![f64::INFINITY; 2])?;
/// let mut x = [3.0, 3.0];
/// let mut solver = McpSolver::default();
/// let report = solver.solve(&problem, &mut x)?;
/// assert!(report.is_solved());
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
#[derive(Clone)]
pub struct Autodiff<S> {
    function: S,
    pattern: Pattern,
    coloring: Coloring,
    work: Scratch<Work>,
}

#[derive(Clone)]
struct Work {
    seeded: Vec<Dual64>,
    out: Vec<Dual64>,
    /// Whether the pattern was compared with the function at a point.
    checked: bool,
}

impl<S: SmoothFunction> Autodiff<S> {
    /// Wraps a function.
    pub fn new(function: S) -> Self {
        let pattern = function.pattern();
        Self {
            coloring: Coloring::new(&pattern),
            work: Scratch::new(Work {
                seeded: vec![Dual64::from(0.0); function.num_vars()],
                out: vec![Dual64::from(0.0); function.num_values()],
                checked: false,
            }),
            pattern,
            function,
        }
    }

    /// The function.
    #[must_use]
    pub fn function(&self) -> &S {
        &self.function
    }
}

impl<S: fmt::Debug> fmt::Debug for Autodiff<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Autodiff")
            .field("function", &self.function)
            .finish_non_exhaustive()
    }
}

impl<S: SmoothFunction> McpFunction for Autodiff<S> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }

    fn num_values(&self) -> usize {
        self.function.num_values()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.function.eval(x, out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let Work { seeded, out, checked } = &mut *self.work.lock();
        if !*checked {
            // Columns of one colour would hide an entry that the pattern lacks in another.
            if let Some((i, j)) = lacking(&self.pattern, x, &mut |x, _, out| self.function.eval(x, out)) {
                jac.refuse(i, j);
                return;
            }
            *checked = true;
        }
        for (s, v) in seeded.iter_mut().zip(x) {
            *s = Dual64::from(*v);
        }
        for group in self.coloring.groups() {
            group.iter().for_each(|&j| seeded[j].eps = 1.0);
            self.function.eval(seeded, out);
            for &j in group {
                seeded[j].eps = 0.0;
                for k in self.pattern.col_ptr()[j]..self.pattern.col_ptr()[j + 1] {
                    let i = self.pattern.row_idx()[k];
                    jac.add(i, j, out[i].eps);
                }
            }
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
}
