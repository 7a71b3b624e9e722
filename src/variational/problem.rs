use super::Polyhedron;
use crate::complementarity::{AffineFunction, ComplementarityError, Mcp, McpFunction};
use crate::input::check_length;
use crate::sparse::{Matrix, Pattern};

/// The variational inequality VI(F, C) over a polyhedron: find x ∈ C with F(x)ᵀ(y − x) ≥ 0 for all y ∈ C.
///
/// F has n variables, and behind them parameters, if any.
///
/// # Normal map
/// With P the projection on C, x is a solution if and only if x = P(z) for a zero z of F(P(z)) + z − P(z), the normal map of S. M. Robinson
/// (1992); then z = x − F(x) (F. Facchinei, J.-S. Pang, 2003, Proposition 1.5.9). In the n variables z its pieces belong to sets of active
/// constraints. Where constraints are linearly dependent several sets may give the same P, and no set is determined by the signs at single
/// constraints. [`kkt`](Self::kkt) states the same in (x, λ, μ): a map whose sites are the constraints, each with pieces of its own. Its
/// zeros give those of the normal map as z = x + Aᵀλ + Eᵀμ − ρₗ + ρᵤ, ρ the [multipliers](super::Multipliers) of the bounds, and z gives
/// (λ, μ, ρ) as the multipliers of [`Polyhedron::project`], unique where the normals of active constraints are linearly independent.
/// [`NormalMap`](crate::complementarity::NormalMap) of [`kkt`](Self::kkt) is the normal map of the box of (x, λ, μ), and for C a box
/// without rows that of the problem itself.
///
/// ```
/// use semismooth::complementarity::AffineFunction;
/// use semismooth::sparse::Matrix;
/// use semismooth::variational::{Polyhedron, Vi, ViSolver};
/// // Minimise ½‖x − (2, 2)‖² over x₁ + x₂ ≤ 1, x ≥ 0: F is the gradient.
/// let f = AffineFunction::new(Matrix::identity(2), vec![-2.0, -2.0])?;
/// let set = Polyhedron::boxed(vec![0.0; 2], vec![f64::INFINITY; 2])?
///     .with_inequalities(Matrix::from_rows(&[[1.0, 1.0]])?, vec![1.0])?;
/// let vi = Vi::new(f, set)?;
/// let mut x = [9.0, -7.0];
/// let report = ViSolver::default().solve(&vi, &mut x)?;
/// assert!(report.is_solved() && (x[0] - 0.5).abs() < 1e-12);
/// assert!((report.multipliers.inequalities[0] - 1.5).abs() < 1e-12);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Vi<F> {
    function: F,
    set: Polyhedron,
}

impl<F: McpFunction> Vi<F> {
    /// The problem of F and C.
    ///
    /// # Errors
    /// F with another number of values or variables than C has, or a pattern of another shape.
    pub fn new(function: F, set: Polyhedron) -> Result<Self, ComplementarityError> {
        let (n, vars) = (set.dimension(), function.num_vars());
        if vars != n + 1 {
            check_length("the argument of F", vars, n)?;
        }
        Self::with_parameters(function, set)
    }

    /// The problem of a function F of the n unknowns and behind them k ≥ 0 parameters: its [conditions](Self::kkt) are a map for
    /// [`Sensitivity`](crate::sensitivity::Sensitivity) at a solution with its multipliers (x, λ, μ). Where multipliers are not unique,
    /// as at vertices where more rows are active than C has dimensions, these conditions are not known to have derivatives, whether x has
    /// or not.
    ///
    /// ```
    /// use semismooth::complementarity::AffineFunction;
    /// use semismooth::sensitivity::Sensitivity;
    /// use semismooth::sparse::Matrix;
    /// use semismooth::variational::{Polyhedron, Vi};
    /// // The nearest point of {x₁ + x₂ ≤ 1} to θ = (1, 1) is ½ (1, 1), with λ = ½; it moves along the line alone.
    /// let rows = Matrix::from_rows(&[[1.0, 1.0]])?;
    /// let set = Polyhedron::space(2)?.with_inequalities(rows, vec![1.0])?;
    /// let offset = Matrix::from_rows(&[[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])?;
    /// let vi = Vi::with_parameters(AffineFunction::with_parameters(offset, vec![0.0; 2])?, set)?;
    /// let mut found = Sensitivity::new(vi.kkt()?, &[0.5, 0.5, 0.5], &[1.0, 1.0])?;
    /// assert_eq!(found.differentiable()?.known(), Some(true));
    /// let rate = found.jvp(&[1.0, 0.0])?;
    /// assert!((rate[0] - 0.5).abs() < 1e-12 && (rate[1] + 0.5).abs() < 1e-12 && (rate[2] - 0.5).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// F with another number of values or fewer variables than C has, or a pattern of another shape.
    pub fn with_parameters(function: F, set: Polyhedron) -> Result<Self, ComplementarityError> {
        let (n, vars) = (set.dimension(), function.num_vars());
        check_length("F", function.num_values(), n)?;
        if vars < n {
            check_length("the argument of F", vars, n)?;
        }
        let pattern = function.pattern();
        check_length("a column of the pattern of F", pattern.nrows(), n)?;
        check_length("a row of the pattern of F", pattern.ncols(), vars)?;
        Ok(Self { function, set })
    }

    /// F.
    #[must_use]
    pub fn function(&self) -> &F {
        &self.function
    }

    /// C.
    #[must_use]
    pub fn set(&self) -> &Polyhedron {
        &self.set
    }

    /// The Karush–Kuhn–Tucker conditions as a mixed complementarity problem in (x, λ, μ), of lengths n, m, k (then the
    /// parameters, if there are any):
    ///
    /// * l ≤ x ≤ u ⟂ F(x) + Aᵀλ + Eᵀμ,
    /// * 0 ≤ λ ⟂ b − A x ≥ 0,
    /// * d − E x = 0, μ free.
    ///
    /// x solves VI(F, C) if and only if some (λ, μ) belongs to it (F. Facchinei, J.-S. Pang, 2003, Proposition 1.2.1). Its natural map
    /// and its [normal map](crate::complementarity::NormalMap) have a site for each bounded component and each row of A, so that solution
    /// curves of parametric problems are followed and all solutions of affine ones listed like those of any other map.
    ///
    /// # Errors
    /// Bounds with lᵢ > uᵢ; as [`Mcp::new`].
    pub fn kkt(&self) -> Result<Mcp<impl McpFunction>, ComplementarityError> {
        let (m, k) = (self.set.a.len(), self.set.e.len());
        let (mut lower, mut upper) = (self.set.lower.clone(), self.set.upper.clone());
        lower.resize(lower.len() + m, 0.0);
        lower.resize(lower.len() + k, f64::NEG_INFINITY);
        upper.resize(lower.len(), f64::INFINITY);
        Mcp::with_parameters(ViConditions::new(&self.function, &self.set)?, lower, upper)
    }
}

/// The function (F(x) + Aᵀλ + Eᵀμ, b − A x, d − E x) of [`Vi::kkt`].
#[derive(Debug, Clone)]
struct ViConditions<F> {
    function: F,
    /// The constant part of the Jacobian, over the whole pattern, and the constants b, d.
    coupling: Matrix,
    constants: Vec<f64>,
    n: usize,
    /// The function as M x + q, where F gives M and q.
    affine: Option<AffineFunction>,
}

impl<F: McpFunction> ViConditions<F> {
    fn new(function: F, set: &Polyhedron) -> Result<Self, ComplementarityError> {
        let n = set.dimension();
        let (m, k) = (set.a.len(), set.e.len());
        let total = n + m + k;
        let parameters = function.num_vars() - n;
        let place = |j: usize| if j < n { j } else { total + j - n };
        let own = function.pattern();
        let own = (0..own.ncols()).flat_map(|j| {
            let span = own.col_ptr()[j]..own.col_ptr()[j + 1];
            let rows = own.row_idx()[span].to_vec();
            rows.into_iter().map(move |i| (i, place(j)))
        });
        let mut triplets = Vec::new();
        for (first, rows) in [(n, &set.a), (n + m, &set.e)] {
            for (j, i, v) in rows.transposed.triplets() {
                triplets.push((j, first + i, v));
                triplets.push((first + i, j, -v));
            }
        }
        let entries = triplets.iter().map(|t| (t.0, t.1)).chain(own);
        let diagonal = (0..total).map(|i| (i, i));
        let pattern = Pattern::from_entries(total, total + parameters, entries.chain(diagonal))?;
        let mut coupling = Matrix::zeros(pattern);
        for (i, j, v) in triplets {
            coupling.add(i, j, v);
        }
        let constants: Vec<f64> = set.a.right.iter().chain(&set.e.right).copied().collect();
        let affine = match function.coefficients() {
            Some((f, None)) => {
                let mut all = coupling.clone();
                for (i, j, v) in f.matrix().triplets() {
                    all.add(i, place(j), v);
                }
                let q = f.q().iter().chain(&constants).copied().collect();
                Some(AffineFunction::with_parameters(all, q)?)
            }
            _ => None,
        };
        Ok(Self {
            function,
            coupling,
            constants,
            n,
            affine,
        })
    }

    /// x and the parameter, for F.
    fn arguments<'a>(&self, x: &'a [f64], room: &'a mut Vec<f64>) -> &'a [f64] {
        if self.function.num_vars() == self.n {
            return &x[..self.n];
        }
        room.extend_from_slice(&x[..self.n]);
        room.extend_from_slice(&x[self.coupling.nrows()..]);
        room
    }
}

impl<F: McpFunction> McpFunction for ViConditions<F> {
    fn num_vars(&self) -> usize {
        self.coupling.ncols()
    }

    fn num_values(&self) -> usize {
        self.coupling.nrows()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let mut room = Vec::new();
        let (first, rest) = out.split_at_mut(self.n);
        self.function.value(self.arguments(x, &mut room), first);
        rest.copy_from_slice(&self.constants);
        self.coupling.as_ref().mul_add(1.0, x, out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        if let Some(affine) = &self.affine {
            affine.jacobian(x, jac);
            return;
        }
        let mut room = Vec::new();
        let mut own = Matrix::zeros(self.function.pattern());
        self.function.jacobian(self.arguments(x, &mut room), &mut own);
        if let Some((row, _)) = own.stray() {
            // An entry outside the pattern of F is passed on as one outside the pattern of the whole.
            jac.add(row, usize::MAX, f64::NAN);
        }
        let last = self.coupling.nrows();
        for (i, j, v) in own.triplets() {
            jac.add(i, if j < self.n { j } else { last + j - self.n }, v);
        }
        if jac.pattern() == self.coupling.pattern() {
            let values = jac.values_mut().iter_mut().zip(self.coupling.values());
            values.for_each(|(a, c)| *a += c);
        } else {
            jac.add_block(0, 0, 1.0, &self.coupling);
        }
    }

    fn pattern(&self) -> Pattern {
        self.coupling.pattern().clone()
    }

    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }

    fn coefficients(&self) -> Option<(&AffineFunction, Option<f64>)> {
        self.affine.as_ref().map(|f| (f, None))
    }
}
