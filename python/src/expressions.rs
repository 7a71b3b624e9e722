//! Formulas written by running a Python function once on variables that remember what is done to them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyArray2, PyUntypedArray};
use pyo3::basic::CompareOp;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::complementarity::McpFunction;
use semismooth::piecewise::{self, Kinks, NonsmoothFunction, PiecewiseSmooth, Real, Traced};
use semismooth::sparse::{Matrix, Pattern};

use crate::arrays::{dense, names, vector};
use crate::errors::Run;

/// A node of a formula; arguments are positions of nodes before it. Numbers are kept as their bits, so that equal nodes are one.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Node {
    Variable(usize),
    Number(u64),
    Neg(usize),
    Add(usize, usize),
    Sub(usize, usize),
    Mul(usize, usize),
    Div(usize, usize),
    Integer(usize, i32),
    Power(usize, u64),
    Smooth(Smooth, usize),
    Max(usize, usize),
    Min(usize, usize),
    Abs(usize),
    /// lower, z, upper.
    Project(usize, usize, usize),
    /// test, where it is not negative, elsewhere.
    Switch(usize, usize, usize),
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Smooth {
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tanh,
}

impl Node {
    fn arguments(self) -> [Option<usize>; 3] {
        match self {
            Node::Variable(_) | Node::Number(_) => [None; 3],
            Node::Neg(a) | Node::Integer(a, _) | Node::Power(a, _) | Node::Smooth(_, a) | Node::Abs(a) => {
                [Some(a), None, None]
            }
            Node::Add(a, b)
            | Node::Sub(a, b)
            | Node::Mul(a, b)
            | Node::Div(a, b)
            | Node::Max(a, b)
            | Node::Min(a, b) => [Some(a), Some(b), None],
            Node::Project(a, b, c) | Node::Switch(a, b, c) => [Some(a), Some(b), Some(c)],
        }
    }

    fn moved(self, to: impl Fn(usize) -> usize) -> Self {
        match self {
            Node::Variable(_) | Node::Number(_) => self,
            Node::Neg(a) => Node::Neg(to(a)),
            Node::Integer(a, n) => Node::Integer(to(a), n),
            Node::Power(a, p) => Node::Power(to(a), p),
            Node::Smooth(f, a) => Node::Smooth(f, to(a)),
            Node::Abs(a) => Node::Abs(to(a)),
            Node::Add(a, b) => Node::Add(to(a), to(b)),
            Node::Sub(a, b) => Node::Sub(to(a), to(b)),
            Node::Mul(a, b) => Node::Mul(to(a), to(b)),
            Node::Div(a, b) => Node::Div(to(a), to(b)),
            Node::Max(a, b) => Node::Max(to(a), to(b)),
            Node::Min(a, b) => Node::Min(to(a), to(b)),
            Node::Project(a, b, c) => Node::Project(to(a), to(b), to(c)),
            Node::Switch(a, b, c) => Node::Switch(to(a), to(b), to(c)),
        }
    }
}

/// The nodes written so far, each once.
#[derive(Default)]
struct Writing {
    nodes: Vec<Node>,
    known: HashMap<Node, usize>,
}

impl Writing {
    fn add(&mut self, node: Node) -> usize {
        *self.known.entry(node).or_insert_with(|| {
            self.nodes.push(node);
            self.nodes.len() - 1
        })
    }
}

type Page = Arc<Mutex<Writing>>;

fn write(page: &Page) -> MutexGuard<'_, Writing> {
    page.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A real number that is not known yet: a variable of a formula being traced, or what was computed from such variables.
///
/// Arithmetic (``+ - * / **`` and ``abs``), the functions of this module, and numpy's ``sqrt exp log sin cos tan sinh cosh tanh`` work on
/// it. It has no value, so that ``if x > 0`` raises ``TypeError``: write :func:`semismooth.where` or :func:`semismooth.maximum`.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Expression {
    page: Page,
    at: usize,
}

/// A comparison of expressions, for :func:`semismooth.where`.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Condition {
    page: Page,
    /// Not negative where it holds.
    test: usize,
}

#[pymethods]
impl Condition {
    fn __bool__(&self) -> PyResult<bool> {
        Err(PyTypeError::new_err(
            "a comparison of traced expressions has no value: write semismooth.where(condition, a, b), maximum, minimum or clip in place \
             of if, max, min and numpy.maximum",
        ))
    }
}

/// An argument of an operator.
enum Operand<'py> {
    Expression(Bound<'py, Expression>),
    Number(f64),
}

impl<'py> Operand<'py> {
    fn of(object: &Bound<'py, PyAny>) -> Option<Self> {
        match object.cast::<Expression>() {
            Ok(expression) => Some(Self::Expression(expression.clone())),
            // Arrays take their elements one by one, also where there is only one.
            Err(_) if object.is_instance_of::<PyUntypedArray>() => None,
            Err(_) => object.extract().ok().map(Self::Number),
        }
    }

    fn page(&self) -> Option<&Page> {
        match self {
            Self::Expression(e) => Some(&e.get().page),
            Self::Number(_) => None,
        }
    }

    fn on(&self, page: &Page) -> PyResult<usize> {
        match self {
            Self::Number(v) => Ok(write(page).add(Node::Number(v.to_bits()))),
            Self::Expression(e) => e.get().on(page),
        }
    }
}

impl Expression {
    fn new(page: &Page, node: Node) -> Self {
        Self {
            at: write(page).add(node),
            page: page.clone(),
        }
    }

    fn on(&self, page: &Page) -> PyResult<usize> {
        match Arc::ptr_eq(&self.page, page) {
            true => Ok(self.at),
            false => Err(PyValueError::new_err(
                "expressions of two traced functions cannot be mixed: an expression must not outlive its function",
            )),
        }
    }

    fn one(&self, node: impl FnOnce(usize) -> Node) -> Self {
        Self::new(&self.page, node(self.at))
    }

    fn smooth(&self, function: Smooth) -> Self {
        self.one(|a| Node::Smooth(function, a))
    }

    /// self ∘ other, or other ∘ self; `NotImplemented` for anything but numbers and expressions.
    fn two(
        &self,
        other: &Bound<'_, PyAny>,
        reflected: bool,
        node: fn(usize, usize) -> Node,
    ) -> PyResult<Py<PyAny>> {
        let py = other.py();
        let Some(operand) = Operand::of(other) else {
            return Ok(py.NotImplemented());
        };
        let (a, b) = (self.at, operand.on(&self.page)?);
        let node = if reflected { node(b, a) } else { node(a, b) };
        Ok(Py::new(py, Self::new(&self.page, node))?.into_any())
    }

    /// x^p; e^(p ln x) for an exponent that is an expression.
    fn power(&self, exponent: &Operand<'_>) -> PyResult<Self> {
        match exponent {
            Operand::Number(p) if p.fract() == 0.0 && p.abs() <= f64::from(i32::MAX) => {
                Ok(self.one(|a| Node::Integer(a, *p as i32)))
            }
            Operand::Number(p) => Ok(self.one(|a| Node::Power(a, p.to_bits()))),
            Operand::Expression(e) => {
                let e = e.get().on(&self.page)?;
                Ok(self.log().one(|a| Node::Mul(e, a)).exp())
            }
        }
    }
}

#[pymethods]
impl Expression {
    fn __add__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, false, Node::Add)
    }
    fn __radd__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, true, Node::Add)
    }
    fn __sub__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, false, Node::Sub)
    }
    fn __rsub__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, true, Node::Sub)
    }
    fn __mul__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, false, Node::Mul)
    }
    fn __rmul__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, true, Node::Mul)
    }
    fn __truediv__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, false, Node::Div)
    }
    fn __rtruediv__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.two(other, true, Node::Div)
    }

    fn __pow__(&self, exponent: &Bound<'_, PyAny>, modulo: Option<&Bound<'_, PyAny>>) -> PyResult<Py<PyAny>> {
        let py = exponent.py();
        match (Operand::of(exponent), modulo) {
            (Some(operand), None) => Ok(Py::new(py, self.power(&operand)?)?.into_any()),
            _ => Ok(py.NotImplemented()),
        }
    }

    fn __rpow__(&self, base: &Bound<'_, PyAny>, modulo: Option<&Bound<'_, PyAny>>) -> PyResult<Py<PyAny>> {
        let py = base.py();
        match (Operand::of(base), modulo) {
            (Some(Operand::Number(base)), None) => {
                let rate = Self::new(&self.page, Node::Number(base.ln().to_bits())).at;
                Ok(Py::new(py, self.one(|a| Node::Mul(a, rate)).exp())?.into_any())
            }
            _ => Ok(py.NotImplemented()),
        }
    }

    fn __neg__(&self) -> Self {
        self.one(Node::Neg)
    }
    fn __pos__(slf: Py<Self>) -> Py<Self> {
        slf
    }
    fn __abs__(&self) -> Self {
        self.one(Node::Abs)
    }

    fn __richcmp__(&self, other: &Bound<'_, PyAny>, operator: CompareOp) -> PyResult<Py<PyAny>> {
        let py = other.py();
        let Some(operand) = Operand::of(other) else {
            return Ok(py.NotImplemented());
        };
        let (a, b) = (self.at, operand.on(&self.page)?);
        let difference = match operator {
            CompareOp::Gt | CompareOp::Ge => Node::Sub(a, b),
            CompareOp::Lt | CompareOp::Le => Node::Sub(b, a),
            CompareOp::Eq | CompareOp::Ne => {
                return Err(PyTypeError::new_err(
                    "traced expressions cannot be compared with == or !=: they have no values yet",
                ));
            }
        };
        let condition = Condition {
            test: write(&self.page).add(difference),
            page: self.page.clone(),
        };
        Ok(Py::new(py, condition)?.into_any())
    }

    fn __bool__(&self) -> PyResult<bool> {
        Err(PyTypeError::new_err(
            "a traced expression has no truth value: write semismooth.where(condition, a, b)",
        ))
    }

    fn __float__(&self) -> PyResult<f64> {
        Err(PyTypeError::new_err(
            "a traced expression has no value yet: use numpy's functions or those of semismooth in place of math's, or give the derivative \
             (jac=) so that the function is called with numbers",
        ))
    }

    fn __repr__(&self) -> String {
        format!("<traced expression {}>", self.at)
    }

    // What numpy calls for its functions of the same names.

    fn sqrt(&self) -> Self {
        self.smooth(Smooth::Sqrt)
    }
    fn exp(&self) -> Self {
        self.smooth(Smooth::Exp)
    }
    fn log(&self) -> Self {
        self.smooth(Smooth::Ln)
    }
    fn sin(&self) -> Self {
        self.smooth(Smooth::Sin)
    }
    fn cos(&self) -> Self {
        self.smooth(Smooth::Cos)
    }
    fn tanh(&self) -> Self {
        self.smooth(Smooth::Tanh)
    }
    fn tan(&self) -> Self {
        let cos = self.cos().at;
        self.sin().one(|sin| Node::Div(sin, cos))
    }
    fn cosh(&self) -> Self {
        let inverse = self.one(Node::Neg).exp().at;
        let sum = self.exp().one(|e| Node::Add(e, inverse));
        let half = Self::new(&self.page, Node::Number(0.5_f64.to_bits())).at;
        sum.one(|s| Node::Mul(s, half))
    }
    /// tanh x · cosh x, which cancels nothing near 0.
    fn sinh(&self) -> Self {
        let cosh = self.cosh().at;
        self.tanh().one(|tanh| Node::Mul(tanh, cosh))
    }
}

/// Operands on their common page; `None` if none of them is an expression.
fn together<const N: usize>(objects: [&Bound<'_, PyAny>; N]) -> PyResult<Option<(Page, [usize; N])>> {
    let mut operands = Vec::with_capacity(N);
    for object in objects {
        operands.push(Operand::of(object).ok_or_else(|| {
            PyTypeError::new_err(format!("{object:?} is neither a number nor a traced expression"))
        })?);
    }
    let Some(page) = operands.iter().find_map(Operand::page).cloned() else {
        return Ok(None);
    };
    let mut positions = [0; N];
    for (position, operand) in positions.iter_mut().zip(&operands) {
        *position = operand.on(&page)?;
    }
    Ok(Some((page, positions)))
}

fn written<'py, T>(
    py: Python<'py>,
    expression: Option<T>,
    node: impl FnOnce(T) -> (Page, Node),
) -> PyResult<Bound<'py, Expression>> {
    let Some(found) = expression else {
        return Err(PyTypeError::new_err("no argument is a traced expression"));
    };
    let (page, node) = node(found);
    Bound::new(py, Expression::new(&page, node))
}

#[pyfunction]
fn traced_maximum<'py>(a: Bound<'py, PyAny>, b: Bound<'py, PyAny>) -> PyResult<Bound<'py, Expression>> {
    written(a.py(), together([&a, &b])?, |(page, [a, b])| {
        (page, Node::Max(a, b))
    })
}

#[pyfunction]
fn traced_minimum<'py>(a: Bound<'py, PyAny>, b: Bound<'py, PyAny>) -> PyResult<Bound<'py, Expression>> {
    written(a.py(), together([&a, &b])?, |(page, [a, b])| {
        (page, Node::Min(a, b))
    })
}

#[pyfunction]
fn traced_clip<'py>(
    x: Bound<'py, PyAny>,
    lower: Bound<'py, PyAny>,
    upper: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, Expression>> {
    written(x.py(), together([&lower, &x, &upper])?, |(page, [l, x, u])| {
        (page, Node::Project(l, x, u))
    })
}

#[pyfunction]
fn traced_where<'py>(
    condition: &Bound<'py, PyAny>,
    a: Bound<'py, PyAny>,
    b: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let Ok(condition) = condition.cast::<Condition>() else {
        // Decided when the formula is written.
        return Ok(if condition.is_truthy()? { a } else { b });
    };
    let Condition { page, test } = condition.get();
    let operand = |object: &Bound<'py, PyAny>| match Operand::of(object) {
        Some(operand) => operand.on(page),
        None => Err(PyTypeError::new_err(format!(
            "{object:?} is neither a number nor a traced expression"
        ))),
    };
    let node = Node::Switch(*test, operand(&a)?, operand(&b)?);
    Ok(Bound::new(a.py(), Expression::new(page, node))?.into_any())
}

/// A formula: the nodes that its values need, in an order in which each comes after its arguments.
pub(crate) struct Formula {
    variables: usize,
    nodes: Vec<Node>,
    values: Vec<usize>,
}

impl Formula {
    /// The part of the page that the values need: kinks that decide nothing are no sites.
    fn new(variables: usize, page: &[Node], values: &[usize]) -> Self {
        let mut needed = vec![false; page.len()];
        values.iter().for_each(|&v| needed[v] = true);
        for at in (0..page.len()).rev() {
            if needed[at] {
                let arguments = page[at].arguments();
                arguments.into_iter().flatten().for_each(|a| needed[a] = true);
            }
        }
        let mut place = vec![0; page.len()];
        let mut nodes = Vec::new();
        for (at, node) in page.iter().enumerate().filter(|(at, _)| needed[*at]) {
            place[at] = nodes.len();
            nodes.push(node.moved(|a| place[a]));
        }
        Self {
            variables,
            nodes,
            values: values.iter().map(|&v| place[v]).collect(),
        }
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let mut v: Vec<T> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            v.push(match *node {
                Node::Variable(k) => x[k],
                Node::Number(bits) => T::from(f64::from_bits(bits)),
                Node::Neg(a) => -v[a],
                Node::Add(a, b) => v[a] + v[b],
                Node::Sub(a, b) => v[a] - v[b],
                Node::Mul(a, b) => v[a] * v[b],
                Node::Div(a, b) => v[a] / v[b],
                Node::Integer(a, n) => v[a].powi(n),
                Node::Power(a, bits) => v[a].powf(f64::from_bits(bits)),
                Node::Smooth(function, a) => match function {
                    Smooth::Sqrt => v[a].sqrt(),
                    Smooth::Exp => v[a].exp(),
                    Smooth::Ln => v[a].ln(),
                    Smooth::Sin => v[a].sin(),
                    Smooth::Cos => v[a].cos(),
                    Smooth::Tanh => v[a].tanh(),
                },
                Node::Max(a, b) => kinks.max(v[a], v[b]),
                Node::Min(a, b) => kinks.min(v[a], v[b]),
                Node::Abs(a) => kinks.abs(v[a]),
                Node::Project(l, z, u) => kinks.project(v[l], v[z], v[u]),
                Node::Switch(test, a, b) => kinks.switch(v[test], v[a], v[b]),
            });
        }
        for (out, &at) in out.iter_mut().zip(&self.values) {
            *out = v[at];
        }
    }
}

/// A formula in a run that Python can end.
pub(crate) struct Watched<'r> {
    formula: Arc<Formula>,
    run: Option<&'r Run>,
}

impl NonsmoothFunction for Watched<'_> {
    fn num_vars(&self) -> usize {
        self.formula.variables
    }

    fn num_residuals(&self) -> usize {
        self.formula.values.len()
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        match self.run.is_some_and(|run| run.poll().is_break()) {
            true => out.fill(T::from(f64::NAN)),
            false => self.formula.eval(x, kinks, out),
        }
    }
}

/// F of a complementarity problem as a formula. Where it has kinks, its derivative is that of the pieces at x.
pub(crate) struct TracedFunction<'r>(pub(crate) Traced<Watched<'r>>);

impl McpFunction for TracedFunction<'_> {
    fn num_vars(&self) -> usize {
        self.0.num_vars()
    }

    fn num_values(&self) -> usize {
        self.0.num_residuals()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        piecewise::value(&self.0, x, out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.0.jacobian(&piecewise::select(&self.0, x), x, jac);
    }

    fn pattern(&self) -> Pattern {
        self.0.pattern()
    }
}

/// A piecewise-smooth map H: ℝᵐ → ℝⁿ as a formula, made by :func:`semismooth.trace`.
///
/// Every ``maximum``, ``minimum``, ``abs``, ``clip`` and ``where`` that the values depend on is a *site*, whose *pieces* are the smooth
/// formulas it chooses among. ``map(x)`` evaluates it at an array of shape (m,).
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Map {
    formula: Arc<Formula>,
    own: Traced<Watched<'static>>,
}

impl Map {
    fn new(formula: Formula) -> Self {
        let formula = Arc::new(formula);
        let own = Traced::new(Watched {
            formula: formula.clone(),
            run: None,
        });
        Self { formula, own }
    }

    /// The map.
    pub(crate) fn own(&self) -> &Traced<Watched<'static>> {
        &self.own
    }

    /// The map in a run that Python can end.
    pub(crate) fn traced<'r>(&self, run: &'r Run) -> Traced<Watched<'r>> {
        Traced::new(Watched {
            formula: self.formula.clone(),
            run: Some(run),
        })
    }

    /// The first value at x, without Python.
    pub(crate) fn first_value(&self, x: &[f64]) -> f64 {
        let mut out = vec![f64::NAN; self.formula.values.len()];
        piecewise::value(&self.own, x, &mut out);
        out.first().copied().unwrap_or(f64::NAN)
    }

    fn point(&self, x: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        let x = vector(x, "x")?;
        match x.len() == self.formula.variables {
            true => Ok(x),
            false => Err(PyValueError::new_err(format!(
                "x has length {}, expected {}",
                x.len(),
                self.formula.variables
            ))),
        }
    }
}

#[pymethods]
impl Map {
    /// Number m of variables.
    #[getter]
    pub(crate) fn num_vars(&self) -> usize {
        self.formula.variables
    }

    /// Number n of values.
    #[getter]
    pub(crate) fn num_residuals(&self) -> usize {
        self.formula.values.len()
    }

    /// Number of sites: places where the formula switches.
    #[getter]
    pub(crate) fn num_sites(&self) -> usize {
        self.own.num_sites()
    }

    /// H(x), shape (n,), for x of shape (m,).
    fn __call__<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let point = self.point(x)?;
        let mut out = vec![0.0; self.formula.values.len()];
        piecewise::value(&self.own, &point, &mut out);
        Ok(PyArray1::from_vec(x.py(), out))
    }

    /// ∇H(x), shape (n, m), of the pieces at x, for x of shape (m,).
    fn jacobian<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (map, point) = (&self.own, self.point(x)?);
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&piecewise::select(map, &point), &point, &mut jac);
        Ok(dense(x.py(), &jac))
    }

    /// The piece of each site at x, by name.
    fn pieces(&self, x: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
        Ok(names(&self.own, &piecewise::select(&self.own, &self.point(x)?)))
    }

    fn __repr__(&self) -> String {
        format!(
            "<Map of {} variables with {} values and {} sites>",
            self.formula.variables,
            self.formula.values.len(),
            self.num_sites()
        )
    }
}

/// Runs ``function(x)`` once on an array x of ``num_vars`` variables, and keeps what it computes as a :class:`Map`.
///
/// The function may use arithmetic, numpy's ``sqrt exp log sin cos tan sinh cosh tanh`` and linear algebra made of sums and products
/// (``M @ x``), and :func:`maximum`, :func:`minimum`, ``abs``, :func:`clip` and :func:`where` for its kinks. It returns n values. Python's ``if``
/// on values, ``math.sin`` and ``numpy.maximum`` raise ``TypeError``. Afterwards no Python runs: what the function reads elsewhere (time,
/// globals, random numbers) is kept as it was in that one call.
///
/// >>> import semismooth as ss
/// >>> ramp = ss.trace(lambda x: [ss.maximum(x[0], 0) - x[1]], 2)
/// >>> ramp([3.0, 1.0])
/// array([2.])
#[pyfunction]
pub(crate) fn trace(py: Python<'_>, function: &Bound<'_, PyAny>, num_vars: usize) -> PyResult<Map> {
    let (page, numpy) = (Page::default(), py.import("numpy")?);
    let variables: Vec<Py<Expression>> = (0..num_vars)
        .map(|k| Py::new(py, Expression::new(&page, Node::Variable(k))))
        .collect::<PyResult<_>>()?;
    let objects = PyDict::new(py);
    objects.set_item("dtype", "object")?;
    let x = numpy.call_method("array", (variables,), Some(&objects))?;
    let values = numpy.call_method("asarray", (function.call1((x,))?,), Some(&objects))?;
    let mut found = Vec::new();
    for value in values.call_method0("ravel")?.try_iter()? {
        let value = value?;
        let operand = Operand::of(&value).ok_or_else(|| {
            PyTypeError::new_err(format!(
                "value {} of the traced function is {value:?}, neither a number nor a traced expression",
                found.len()
            ))
        })?;
        found.push(operand.on(&page)?);
    }
    let formula = Formula::new(num_vars, &write(&page).nodes, &found);
    Ok(Map::new(formula))
}

/// The map itself, or one traced.
pub(crate) fn map_of<'py>(function: &Bound<'py, PyAny>, num_vars: usize) -> PyResult<Bound<'py, Map>> {
    match function.cast::<Map>() {
        Ok(map) => Ok(map.clone()),
        Err(_) => Bound::new(function.py(), trace(function.py(), function, num_vars)?),
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Expression>()?;
    module.add_class::<Condition>()?;
    module.add_class::<Map>()?;
    module.add_function(wrap_pyfunction!(traced_maximum, module)?)?;
    module.add_function(wrap_pyfunction!(traced_minimum, module)?)?;
    module.add_function(wrap_pyfunction!(traced_clip, module)?)?;
    module.add_function(wrap_pyfunction!(traced_where, module)?)?;
    module.add_function(wrap_pyfunction!(trace, module)?)
}
