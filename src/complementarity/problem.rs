use std::sync::Arc;

use super::affine::with_diagonal;
use super::scratch::Scratch;
use super::units::Units;
use super::{AffineFunction, ComplementarityError, McpFunction, Variables};
use crate::InputError;
use crate::input::{check_length, check_vector};
use crate::sparse::{Matrix, Pattern, max_abs};

/// A mixed complementarity problem MCP(F, l, u).
///
/// ```
/// use semismooth::complementarity::{Mcp, McpSolver, WithJacobian};
/// use semismooth::sparse::Matrix;
/// // 0 ≤ x ≤ 2 with F(x) = x² − 9: F is still negative at the upper bound.
/// let f = WithJacobian::new(
///     1,
///     |x: &[f64], out: &mut [f64]| out[0] = x[0] * x[0] - 9.0,
///     |x: &[f64], jac: &mut Matrix| jac.add(0, 0, 2.0 * x[0]),
/// );
/// let problem = Mcp::new(f, vec![0.0], vec![2.0])?;
/// let mut x = [1.0];
/// assert!(McpSolver::default().solve(&problem, &mut x)?.is_solved());
/// assert_eq!(x, [2.0]);
/// assert_eq!(problem.natural_residual(&x, &mut [0.0])?, 0.0);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
///
/// Also the variational inequality over the box [l, u]: F(x)ᵀ(y − x) ≥ 0 for all y in it.
///
/// `Mcp` implements [`PiecewiseSmooth`](crate::piecewise::PiecewiseSmooth) as its natural map: component i is a site with the pieces
///
/// * lower: xᵢ − lᵢ, where xᵢ − Fᵢ < lᵢ,
/// * interior: Fᵢ, where lᵢ < xᵢ − Fᵢ < uᵢ,
/// * upper: xᵢ − uᵢ, where xᵢ − Fᵢ > uᵢ,
///
/// without those that infinite bounds rule out; a component with equal bounds has the single piece "fixed". Where the units of
/// F are far from those of x, sᵢ Fᵢ stands for Fᵢ, with powers of two sᵢ that bring both to the same size.
#[derive(Debug, Clone, PartialEq)]
pub struct Mcp<F> {
    function: F,
    lower: Vec<f64>,
    upper: Vec<f64>,
    pattern: Pattern,
    pub(super) units: Units,
    /// Names of the components, where they have any.
    names: Option<Arc<Variables>>,
}

impl<F: McpFunction> Mcp<F> {
    /// The problem of F with bounds of length n; −∞ and +∞ where there is none.
    ///
    /// # Errors
    /// n = 0, wrong lengths, a pattern of another shape, NaN among the bounds, lᵢ > uᵢ, lᵢ = +∞ or uᵢ = −∞.
    pub fn new(function: F, lower: Vec<f64>, upper: Vec<f64>) -> Result<Self, ComplementarityError> {
        let (n, m) = (function.num_values(), function.num_vars());
        if m > n + 1 {
            return Err(ComplementarityError::Dimensions {
                vars: m,
                values: n,
                expected: "an MCP has as many variables as values, a parametric one has one variable more",
            });
        }
        Self::with_parameters(function, lower, upper)
    }

    /// The problem of a function F of n values whose variables are the n unknowns and behind them k ≥ 0 parameters: for
    /// [`Sensitivity`](crate::sensitivity::Sensitivity), and for solving [at values](Self::at_parameters) of the parameters.
    /// F is taken for smooth there; where it has kinks of its own, use `parametric_mcp`.
    ///
    /// # Errors
    /// As [`new`](Self::new); fewer variables than values.
    pub fn with_parameters(
        function: F,
        lower: Vec<f64>,
        upper: Vec<f64>,
    ) -> Result<Self, ComplementarityError> {
        let (n, m) = (function.num_values(), function.num_vars());
        if n == 0 {
            return Err(ComplementarityError::Empty);
        }
        if m < n {
            return Err(ComplementarityError::Dimensions {
                vars: m,
                values: n,
                expected: "an MCP has as many variables as values, and those behind them are parameters",
            });
        }
        check_bounds(&lower, &upper, n)?;
        let pattern = function.pattern();
        if pattern.nrows() != n || pattern.ncols() != m {
            return Err(ComplementarityError::Input(InputError::Length {
                what: "the declared pattern (rows times columns)",
                expected: n * m,
                found: pattern.nrows() * pattern.ncols(),
            }));
        }
        Ok(Self {
            pattern: with_diagonal(&pattern)?,
            function,
            lower,
            upper,
            units: Units::default(),
            names: None,
        })
    }

    /// The problem of F with the bounds and names of [`Variables`]: transitions and reports name sites accordingly.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_variables(function: F, variables: &Variables) -> Result<Self, ComplementarityError> {
        let (lower, upper) = (variables.lower().to_vec(), variables.upper().to_vec());
        let mut problem = Self::new(function, lower, upper)?;
        problem.names = Some(Arc::new(variables.clone()));
        Ok(problem)
    }

    /// The name of a component, "component 3" where it has none.
    pub(super) fn name(&self, component: usize) -> String {
        let own = self.names.as_ref().and_then(|v| v.name(component));
        own.unwrap_or_else(|| format!("component {component}"))
    }

    /// The nonlinear complementarity problem 0 ≤ x ⟂ F(x) ≥ 0.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn ncp(function: F) -> Result<Self, ComplementarityError> {
        let n = function.num_values();
        Self::new(function, vec![0.0; n], vec![f64::INFINITY; n])
    }

    /// The system of equations F(x) = 0.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn equations(function: F) -> Result<Self, ComplementarityError> {
        let n = function.num_values();
        Self::new(function, vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n])
    }

    /// F.
    #[must_use]
    pub fn function(&self) -> &F {
        &self.function
    }

    pub(super) fn function_mut(&mut self) -> &mut F {
        &mut self.function
    }

    /// Lower bounds; −∞ where there is none.
    #[must_use]
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// Upper bounds; +∞ where there is none.
    #[must_use]
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// Number n of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lower.len()
    }

    /// Always false: a problem has at least one component.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lower.is_empty()
    }

    /// Whether F has parameters, its last variables.
    #[must_use]
    pub fn is_parametric(&self) -> bool {
        self.function.num_vars() > self.len()
    }

    /// Where Jacobians of F and of the reformulations have entries: the pattern of F with the diagonal.
    #[must_use]
    pub fn jacobian_pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The nearest point within the bounds, component by component; NaN stays.
    pub fn project(&self, x: &mut [f64]) {
        for ((x, l), u) in x.iter_mut().zip(&self.lower).zip(&self.upper) {
            *x = x.max(*l).min(*u);
        }
    }

    /// Writes the natural residual xᵢ − mid(lᵢ, uᵢ, xᵢ − Fᵢ(x)) to `out` and returns its largest absolute value; NaN where F or x
    /// is not finite.
    ///
    /// # Errors
    /// Wrong lengths.
    pub fn natural_residual(&self, x: &[f64], out: &mut [f64]) -> Result<f64, ComplementarityError> {
        for (what, found, expected) in [
            ("x", x.len(), self.function.num_vars()),
            ("out", out.len(), self.len()),
        ] {
            check_length(what, found, expected)?;
        }
        self.function.value(x, out);
        for i in 0..out.len() {
            out[i] = natural(x[i], self.lower[i], self.upper[i], out[i]);
        }
        Ok(max_abs(out))
    }

    /// The problem at a value of its parameter.
    ///
    /// # Errors
    /// A problem without a parameter; a value that is not finite.
    pub fn at(&self, parameter: f64) -> Result<Mcp<impl McpFunction>, ComplementarityError> {
        if self.function.num_vars() != self.len() + 1 {
            return Err(ComplementarityError::Dimensions {
                vars: self.function.num_vars(),
                values: self.len(),
                expected: "only a function with one variable more than values has a parameter",
            });
        }
        self.at_parameters(&[parameter])
    }

    /// The problem at values of its k parameters.
    ///
    /// # Errors
    /// Another number of values; values that are not finite.
    pub fn at_parameters<'a>(
        &'a self,
        parameters: &[f64],
    ) -> Result<Mcp<impl McpFunction + use<'a, F>>, ComplementarityError> {
        check_vector(
            "the parameters",
            parameters,
            self.function.num_vars() - self.len(),
        )?;
        let function = AtParameter::new(&self.function, parameters, self.pattern.clone())?;
        let mut problem = Mcp::new(function, self.lower.clone(), self.upper.clone())?;
        problem.names.clone_from(&self.names);
        Ok(problem)
    }
}

impl Mcp<AffineFunction> {
    /// The affine problem with F = M x + q: an LCP over a box.
    ///
    /// # Errors
    /// As [`AffineFunction::new`] and [`Mcp::new`].
    pub fn affine(
        matrix: Matrix,
        q: Vec<f64>,
        lower: Vec<f64>,
        upper: Vec<f64>,
    ) -> Result<Self, ComplementarityError> {
        Self::new(AffineFunction::new(matrix, q)?, lower, upper)
    }
}

/// Bounds of length n that leave a value to each of their variables.
pub(crate) fn check_bounds(lower: &[f64], upper: &[f64], n: usize) -> Result<(), ComplementarityError> {
    for (what, bound, wrong, free) in [
        ("lower", lower, f64::INFINITY, "-inf"),
        ("upper", upper, f64::NEG_INFINITY, "+inf"),
    ] {
        check_length(what, bound.len(), n)?;
        if let Some(index) = bound.iter().position(|b| b.is_nan() || *b == wrong) {
            return Err(ComplementarityError::Bound {
                what,
                index,
                value: bound[index],
                free,
            });
        }
    }
    if let Some(index) = (0..n).find(|&i| lower[i] > upper[i]) {
        return Err(ComplementarityError::CrossedBounds {
            index,
            lower: lower[index],
            upper: upper[index],
        });
    }
    Ok(())
}

/// x − mid(l, u, x − f), without the rounding of the difference where it is f; NaN where x or f is.
pub(super) fn natural(x: f64, lower: f64, upper: f64, f: f64) -> f64 {
    if !f.is_finite() || !x.is_finite() {
        return f64::NAN;
    }
    // x − f < l is tested as x − l < f: exact where both are near 0.
    if f > x - lower {
        x - lower
    } else if f < x - upper {
        x - upper
    } else {
        f
    }
}

/// A function with its parameters fixed.
#[derive(Debug, Clone)]
struct AtParameter<F> {
    function: F,
    work: Scratch<(Vec<f64>, Matrix)>,
    pattern: Pattern,
}

impl<F: McpFunction> AtParameter<F> {
    fn new(function: F, parameters: &[f64], pattern: Pattern) -> Result<Self, ComplementarityError> {
        let n = function.num_values();
        let leading = pattern.leading_columns(n);
        let own = Pattern::from_csc(n, n, leading.col_ptr.to_vec(), leading.row_idx.to_vec())?;
        let mut x = vec![0.0; n];
        x.extend(parameters);
        Ok(Self {
            function,
            work: Scratch::new((x, Matrix::zeros(pattern))),
            pattern: own,
        })
    }
}

impl<F: McpFunction> McpFunction for AtParameter<F> {
    fn num_vars(&self) -> usize {
        self.function.num_values()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let (all, _) = &mut *self.work.lock();
        all[..x.len()].copy_from_slice(x);
        self.function.value(all, out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let (all, full) = &mut *self.work.lock();
        all[..x.len()].copy_from_slice(x);
        full.clear();
        self.function.jacobian(all, full);
        if let Some((row, col)) = full.stray() {
            jac.add(row, col, f64::NAN);
        }
        for (i, j, v) in full.triplets() {
            if j < x.len() {
                jac.add(i, j, v);
            }
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }

    fn coefficients(&self) -> Option<(&AffineFunction, Option<f64>)> {
        match self.function.coefficients()? {
            (function, None) if function.num_vars() == function.num_values() + 1 => {
                Some((function, self.work.lock().0.last().copied()))
            }
            _ => None,
        }
    }
}
