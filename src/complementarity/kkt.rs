use super::scratch::Scratch;
use super::{ComplementarityError, Mcp, McpFunction};
use crate::input::check_length;
use crate::sparse::{Matrix, Pattern};

/// A smooth program: minimise f(x) subject to c(x) ≥ 0 or c(x) = 0 and bounds on x, by its first and second derivatives.
///
/// Functions must be pure; matrices arrive zeroed. [`kkt`] makes an MCP of it.
pub trait Program {
    /// Number n of variables.
    fn num_vars(&self) -> usize;

    /// Number m of constraints, bounds not among them.
    fn num_constraints(&self) -> usize;

    /// Writes ∇f(x) (length n) to `out`.
    fn gradient(&self, x: &[f64], out: &mut [f64]);

    /// Writes c(x) (length m) to `out`.
    fn constraints(&self, x: &[f64], out: &mut [f64]);

    /// Adds ∇c(x) (m × n).
    fn constraint_jacobian(&self, x: &[f64], jac: &mut Matrix);

    /// Adds the Hessian of the Lagrangian, ∇²f(x) − Σ yᵢ ∇²cᵢ(x) (n × n, both triangles).
    fn hessian(&self, x: &[f64], multipliers: &[f64], hessian: &mut Matrix);

    /// Where ∇c has entries. Default: everywhere.
    fn constraint_pattern(&self) -> Pattern {
        Pattern::full(self.num_constraints(), self.num_vars())
    }

    /// Where the Hessian has entries. Default: everywhere.
    fn hessian_pattern(&self) -> Pattern {
        Pattern::full(self.num_vars(), self.num_vars())
    }
}

macro_rules! forward {
    () => {
        fn num_vars(&self) -> usize {
            (**self).num_vars()
        }
        fn num_constraints(&self) -> usize {
            (**self).num_constraints()
        }
        fn gradient(&self, x: &[f64], out: &mut [f64]) {
            (**self).gradient(x, out);
        }
        fn constraints(&self, x: &[f64], out: &mut [f64]) {
            (**self).constraints(x, out);
        }
        fn constraint_jacobian(&self, x: &[f64], jac: &mut Matrix) {
            (**self).constraint_jacobian(x, jac);
        }
        fn hessian(&self, x: &[f64], multipliers: &[f64], hessian: &mut Matrix) {
            (**self).hessian(x, multipliers, hessian);
        }
        fn constraint_pattern(&self) -> Pattern {
            (**self).constraint_pattern()
        }
        fn hessian_pattern(&self) -> Pattern {
            (**self).hessian_pattern()
        }
    };
}

impl<P: Program + ?Sized> Program for &P {
    forward!();
}

impl<P: Program + ?Sized> Program for Box<P> {
    forward!();
}

/// Kind of a constraint of a [`Program`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ConstraintKind {
    /// cᵢ(x) ≥ 0, with a multiplier yᵢ ≥ 0.
    Nonnegative,
    /// cᵢ(x) = 0, with a free multiplier.
    Zero,
}

/// The function (∇f(x) − ∇c(x)ᵀ y, c(x)) of the variables (x, y).
#[derive(Debug, Clone)]
struct Kkt<P> {
    program: P,
    pattern: Pattern,
    work: Scratch<(Matrix, Matrix)>,
}

/// The first-order conditions of a program as an MCP in the variables (x, y), y the multipliers.
///
/// At a solution ∇f(x) = ∇c(x)ᵀ y up to the multipliers of the bounds l ≤ x ≤ u, which are the values of F at active bounds.
/// Stationary points of a program that is not convex, maxima among them, are solutions too.
///
/// # Errors
/// As [`Mcp::new`]; as many kinds as constraints are needed, and patterns of the right shapes.
///
/// ```
/// use semismooth::complementarity::{ConstraintKind, McpSolver, Program, kkt};
/// use semismooth::sparse::Matrix;
/// /// Minimise (x₀ − 2)² + x₁² subject to x₁ ≥ x₀², x ≥ 0.
/// struct Parabola;
/// impl Program for Parabola {
///     fn num_vars(&self) -> usize { 2 }
///     fn num_constraints(&self) -> usize { 1 }
///     fn gradient(&self, x: &[f64], out: &mut [f64]) {
///         out[0] = 2.0 * (x[0] - 2.0);
///         out[1] = 2.0 * x[1];
///     }
///     fn constraints(&self, x: &[f64], out: &mut [f64]) { out[0] = x[1] - x[0] * x[0]; }
///     fn constraint_jacobian(&self, x: &[f64], jac: &mut Matrix) {
///         jac.add(0, 0, -2.0 * x[0]);
///         jac.add(0, 1, 1.0);
///     }
///     fn hessian(&self, _x: &[f64], y: &[f64], h: &mut Matrix) {
///         h.add(0, 0, 2.0 + 2.0 * y[0]);
///         h.add(1, 1, 2.0);
///     }
/// }
/// let problem = kkt(Parabola, &[ConstraintKind::Nonnegative], vec![0.0; 2], vec![f64::INFINITY; 2])?;
/// let mut xy = [0.0; 3];
/// assert!(McpSolver::default().solve(&problem, &mut xy)?.is_solved());
/// let x = xy[0];
/// assert!((2.0 * x.powi(3) + x - 2.0).abs() < 1e-8);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
pub fn kkt<P: Program>(
    program: P,
    kinds: &[ConstraintKind],
    mut lower: Vec<f64>,
    mut upper: Vec<f64>,
) -> Result<Mcp<impl McpFunction + use<P>>, ComplementarityError> {
    let (n, m) = (program.num_vars(), program.num_constraints());
    let (hessian, constraints) = (program.hessian_pattern(), program.constraint_pattern());
    let lengths = [
        ("the list of constraint kinds", kinds.len(), m),
        ("lower", lower.len(), n),
        ("upper", upper.len(), n),
        ("the pattern of the Hessian (rows)", hessian.nrows(), n),
        ("the pattern of the Hessian (columns)", hessian.ncols(), n),
        ("the pattern of the constraints (rows)", constraints.nrows(), m),
        ("the pattern of the constraints (columns)", constraints.ncols(), n),
    ];
    for (what, found, expected) in lengths {
        check_length(what, found, expected)?;
    }
    for kind in kinds {
        lower.push(match kind {
            ConstraintKind::Nonnegative => 0.0,
            ConstraintKind::Zero => f64::NEG_INFINITY,
        });
        upper.push(f64::INFINITY);
    }
    let work = (Matrix::zeros(hessian), Matrix::zeros(constraints));
    let entries = work.0.triplets().map(|t| (t.0, t.1));
    let below = work.1.triplets().map(|t| (n + t.0, t.1));
    let beside = work.1.triplets().map(|t| (t.1, n + t.0));
    let pattern = Pattern::from_entries(n + m, n + m, entries.chain(below).chain(beside))?;
    let function = Kkt {
        program,
        pattern,
        work: Scratch::new(work),
    };
    Mcp::new(function, lower, upper)
}

impl<P: Program> McpFunction for Kkt<P> {
    fn num_vars(&self) -> usize {
        self.pattern.ncols()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let n = self.program.num_vars();
        let (x, y) = x.split_at(n);
        let (gradient, constraints) = out.split_at_mut(n);
        let jac = &mut self.work.lock().1;
        self.program.gradient(x, gradient);
        self.program.constraints(x, constraints);
        jac.clear();
        self.program.constraint_jacobian(x, jac);
        for (i, j, v) in jac.triplets() {
            gradient[j] -= v * y[i];
        }
    }

    fn jacobian(&self, x: &[f64], out: &mut Matrix) {
        let n = self.program.num_vars();
        let (x, y) = x.split_at(n);
        let (hessian, jac) = &mut *self.work.lock();
        hessian.clear();
        jac.clear();
        self.program.hessian(x, y, hessian);
        self.program.constraint_jacobian(x, jac);
        for (i, j, v) in hessian.triplets() {
            out.add(i, j, v);
        }
        for (i, j, v) in jac.triplets() {
            out.add(n + i, j, v);
            out.add(j, n + i, -v);
        }
        // An entry outside a pattern of the program is passed on as one outside the pattern of the whole.
        let stray = hessian.stray().or(jac.stray().map(|(i, j)| (n + i, j)));
        if let Some((row, col)) = stray {
            out.add(row, col.max(n + y.len()), f64::NAN);
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
}
