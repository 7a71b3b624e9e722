//! Tracing: a Python function is run once on variables that record every operation on them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::PyUntypedArray;
use pyo3::basic::CompareOp;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde::{Deserialize, Serialize};

use crate::arrays::{indices as positions, vector};

/// A node of a formula; arguments are positions of nodes before it. Numbers are kept as their bits, so that equal nodes have one hash.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(crate) enum Node {
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
    /// The angle of the point (second, first).
    Atan2(usize, usize),
    Max(usize, usize),
    Min(usize, usize),
    Abs(usize),
    /// lower, z, upper.
    Project(usize, usize, usize),
    /// test, value where test ≥ 0, value elsewhere.
    Switch(usize, usize, usize),
}

#[derive(Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(crate) enum Smooth {
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asin,
    Acos,
    Ln1p,
    Expm1,
    Cbrt,
}

impl Node {
    pub(crate) fn is_kink(self) -> bool {
        matches!(
            self,
            Node::Max(..) | Node::Min(..) | Node::Abs(..) | Node::Project(..) | Node::Switch(..)
        )
    }

    pub(crate) fn arguments(self) -> [Option<usize>; 3] {
        match self {
            Node::Variable(_) | Node::Number(_) => [None; 3],
            Node::Neg(a) | Node::Integer(a, _) | Node::Power(a, _) | Node::Smooth(_, a) | Node::Abs(a) => {
                [Some(a), None, None]
            }
            Node::Add(a, b)
            | Node::Sub(a, b)
            | Node::Mul(a, b)
            | Node::Div(a, b)
            | Node::Atan2(a, b)
            | Node::Max(a, b)
            | Node::Min(a, b) => [Some(a), Some(b), None],
            Node::Project(a, b, c) | Node::Switch(a, b, c) => [Some(a), Some(b), Some(c)],
        }
    }

    pub(crate) fn moved(self, to: impl Fn(usize) -> usize) -> Self {
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
            Node::Atan2(a, b) => Node::Atan2(to(a), to(b)),
            Node::Max(a, b) => Node::Max(to(a), to(b)),
            Node::Min(a, b) => Node::Min(to(a), to(b)),
            Node::Project(a, b, c) => Node::Project(to(a), to(b), to(c)),
            Node::Switch(a, b, c) => Node::Switch(to(a), to(b), to(c)),
        }
    }
}

/// The nodes of a formula under construction, each once.
#[derive(Default)]
pub(crate) struct Writing {
    pub(crate) nodes: Vec<Node>,
    /// Names that the function gives to kinks, by node.
    pub(crate) names: HashMap<usize, String>,
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

pub(crate) type Page = Arc<Mutex<Writing>>;

pub(crate) fn write(page: &Page) -> MutexGuard<'_, Writing> {
    page.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A variable of a formula being traced, or an expression computed from such variables.
///
/// Arithmetic (``+ - * / **``, ``abs``), numpy's functions and those of this module work on it. It has no value, so that ``if x > 0`` raises
/// ``TypeError``: write ``where`` or ``maximum``.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Expression {
    page: Page,
    at: usize,
}

/// A comparison of expressions, for ``where``; ``&``, ``|`` and ``~`` combine them, and a product with an expression is the expression where
/// the comparison holds, else 0.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Condition {
    page: Page,
    test: Arc<Test>,
}

enum Test {
    /// Holds where a node is ≥ 0.
    Sign(usize),
    Both(Arc<Test>, Arc<Test>),
    Either(Arc<Test>, Arc<Test>),
    Not(Arc<Test>),
}

impl Test {
    /// The node of a where the condition holds, b elsewhere.
    fn choose(&self, page: &Page, a: usize, b: usize) -> usize {
        match self {
            Self::Sign(test) => write(page).add(Node::Switch(*test, a, b)),
            Self::Both(p, q) => {
                let inner = q.choose(page, a, b);
                p.choose(page, inner, b)
            }
            Self::Either(p, q) => {
                let inner = q.choose(page, a, b);
                p.choose(page, a, inner)
            }
            Self::Not(p) => p.choose(page, b, a),
        }
    }
}

impl Condition {
    /// With another condition, or with a truth value, which makes it that or nothing new.
    fn with(
        &self,
        other: &Bound<'_, PyAny>,
        neutral: bool,
        join: fn(Arc<Test>, Arc<Test>) -> Test,
    ) -> PyResult<Py<PyAny>> {
        let py = other.py();
        let test = match other.cast::<Self>() {
            Ok(other) => {
                let other = other.get();
                same(&self.page, &other.page)?;
                Arc::new(join(self.test.clone(), other.test.clone()))
            }
            Err(_) => match other.extract::<bool>() {
                Ok(value) if value == neutral => self.test.clone(),
                Ok(_) => return Ok(other.clone().unbind()),
                Err(_) => return Ok(py.NotImplemented()),
            },
        };
        let page = self.page.clone();
        Ok(Py::new(py, Self { page, test })?.into_any())
    }
}

#[pymethods]
impl Condition {
    fn __bool__(&self) -> PyResult<bool> {
        Err(PyTypeError::new_err(
            "a comparison of traced variables has no truth value: the function is run once, for all values. In place of `if x > 0: a` \
             and `else: b` write numpy.where(x > 0, a, b), or maximum, minimum, clip; in place of `and`, `or`, `not` and chains `0 < x < 1` \
             write &, |, ~ with parentheses. For a function that cannot be written so, give its derivative, jac=function or \
             jac=\"differences\": it is then called with numbers",
        ))
    }

    fn __and__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.with(other, true, Test::Both)
    }
    fn __rand__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.with(other, true, Test::Both)
    }
    fn __or__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.with(other, false, Test::Either)
    }
    fn __ror__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.with(other, false, Test::Either)
    }
    fn __invert__(&self) -> Self {
        Self {
            page: self.page.clone(),
            test: Arc::new(Test::Not(self.test.clone())),
        }
    }

    fn __mul__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let Some(operand) = Operand::of(other) else {
            return Ok(other.py().NotImplemented());
        };
        let value = operand.on(&self.page)?;
        let zero = Operand::Number(0.0).on(&self.page)?;
        let at = self.test.choose(&self.page, value, zero);
        let page = self.page.clone();
        Ok(Py::new(other.py(), Expression { page, at })?.into_any())
    }
    fn __rmul__(&self, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        self.__mul__(other)
    }

    #[pyo3(signature = (ufunc, method, *inputs, **options))]
    fn __array_ufunc__<'py>(
        &self,
        ufunc: &Bound<'py, PyAny>,
        method: &Bound<'py, PyAny>,
        inputs: &Bound<'py, PyTuple>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        dispatched(ufunc, method, inputs, options)
    }

    fn __array_function__<'py>(
        &self,
        function: &Bound<'py, PyAny>,
        types: &Bound<'py, PyAny>,
        arguments: &Bound<'py, PyAny>,
        options: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let _ = types;
        called(function, arguments, options)
    }

    fn __repr__(&self) -> &'static str {
        "<condition on traced variables>"
    }
}

/// numpy's protocols lead to the tables of `semismooth._arrays`.
fn dispatched<'py>(
    ufunc: &Bound<'py, PyAny>,
    method: &Bound<'py, PyAny>,
    inputs: &Bound<'py, PyTuple>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = ufunc.py();
    let options = options.cloned().unwrap_or_else(|| PyDict::new(py));
    py.import("semismooth._arrays")?
        .call_method1("apply_ufunc", (ufunc, method, inputs, options))
}

fn called<'py>(
    function: &Bound<'py, PyAny>,
    arguments: &Bound<'py, PyAny>,
    options: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    function
        .py()
        .import("semismooth._arrays")?
        .call_method1("apply_function", (function, arguments, options))
}

fn same(page: &Page, other: &Page) -> PyResult<()> {
    match Arc::ptr_eq(page, other) {
        true => Ok(()),
        false => Err(PyValueError::new_err(
            "expressions of two traced functions cannot be mixed: an expression must not outlive its function",
        )),
    }
}

/// An argument of an operator.
pub(crate) enum Operand<'py> {
    Expression(Bound<'py, Expression>),
    Number(f64),
}

impl<'py> Operand<'py> {
    pub(crate) fn of(object: &Bound<'py, PyAny>) -> Option<Self> {
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

    pub(crate) fn on(&self, page: &Page) -> PyResult<usize> {
        match self {
            Self::Number(v) => Ok(write(page).add(Node::Number(v.to_bits()))),
            Self::Expression(e) => e.get().on(page),
        }
    }
}

impl Expression {
    pub(crate) fn new(page: &Page, node: Node) -> Self {
        Self {
            at: write(page).add(node),
            page: page.clone(),
        }
    }

    fn on(&self, page: &Page) -> PyResult<usize> {
        same(&self.page, page)?;
        Ok(self.at)
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
                    "traced variables cannot be compared with == or !=: they have no values yet, and a function that differs at a single \
                     point jumps there",
                ));
            }
        };
        let condition = Condition {
            test: Arc::new(Test::Sign(write(&self.page).add(difference))),
            page: self.page.clone(),
        };
        Ok(Py::new(py, condition)?.into_any())
    }

    fn __bool__(&self) -> PyResult<bool> {
        Err(PyTypeError::new_err(
            "a traced variable has no truth value: write numpy.where(x > 0, a, b)",
        ))
    }

    fn __float__(&self) -> PyResult<f64> {
        Err(PyTypeError::new_err(
            "a traced variable has no value yet, and does not fit into an array of numbers: make arrays by numpy.zeros_like(x), by \
             numpy.zeros(n, dtype=object), or from lists, use numpy's functions in place of math's, or write `import semismooth.numpy as np` \
             where the function is defined. For a function that cannot be written so, give its derivative, jac=function or \
             jac=\"differences\": it is then called with numbers",
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
        self.smooth(Smooth::Tan)
    }
    fn arctan(&self) -> Self {
        self.smooth(Smooth::Atan)
    }
    fn sinh(&self) -> Self {
        self.smooth(Smooth::Sinh)
    }
    fn cosh(&self) -> Self {
        self.smooth(Smooth::Cosh)
    }
    fn arcsin(&self) -> Self {
        self.smooth(Smooth::Asin)
    }
    fn arccos(&self) -> Self {
        self.smooth(Smooth::Acos)
    }
    fn log1p(&self) -> Self {
        self.smooth(Smooth::Ln1p)
    }
    fn expm1(&self) -> Self {
        self.smooth(Smooth::Expm1)
    }
    fn cbrt(&self) -> Self {
        self.smooth(Smooth::Cbrt)
    }
    /// The projection on [lower, upper], as numpy's numbers have it.
    #[pyo3(signature = (min=None, max=None))]
    fn clip<'py>(
        slf: Bound<'py, Self>,
        min: Option<Bound<'py, PyAny>>,
        max: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Self>> {
        match (min, max) {
            (Some(min), Some(max)) => traced_clip(slf.into_any(), min, max),
            (Some(min), None) => traced_maximum(slf.into_any(), min),
            (None, Some(max)) => traced_minimum(slf.into_any(), max),
            (None, None) => Ok(slf),
        }
    }

    #[pyo3(signature = (ufunc, method, *inputs, **options))]
    fn __array_ufunc__<'py>(
        &self,
        ufunc: &Bound<'py, PyAny>,
        method: &Bound<'py, PyAny>,
        inputs: &Bound<'py, PyTuple>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        dispatched(ufunc, method, inputs, options)
    }

    fn __array_function__<'py>(
        &self,
        function: &Bound<'py, PyAny>,
        types: &Bound<'py, PyAny>,
        arguments: &Bound<'py, PyAny>,
        options: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let _ = types;
        called(function, arguments, options)
    }
}

/// The nodes of operands on their common page; `None` if none of them is an expression.
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
        // Without traced variables it is decided while tracing.
        return Ok(if condition.is_truthy()? { a } else { b });
    };
    let Condition { page, test } = condition.get();
    let operand = |object: &Bound<'py, PyAny>| match Operand::of(object) {
        Some(operand) => operand.on(page),
        None => Err(PyTypeError::new_err(format!(
            "{object:?} is neither a number nor a traced expression"
        ))),
    };
    let (first, second) = (operand(&a)?, operand(&b)?);
    let (page, at) = (page.clone(), test.choose(page, first, second));
    Ok(Bound::new(a.py(), Expression { page, at })?.into_any())
}

/// Names the kink that was written last into an expression; what is no kink has no name.
#[pyfunction]
fn traced_name(expression: &Bound<'_, PyAny>, name: String) {
    if let Ok(expression) = expression.cast::<Expression>() {
        let Expression { page, at } = expression.get();
        let mut written = write(page);
        if written.nodes[*at].is_kink() {
            written.names.entry(*at).or_insert(name);
        }
    }
}

/// The angle of the point (x, y).
#[pyfunction]
fn traced_arctan2<'py>(y: Bound<'py, PyAny>, x: Bound<'py, PyAny>) -> PyResult<Bound<'py, Expression>> {
    written(y.py(), together([&y, &x])?, |(page, [y, x])| {
        (page, Node::Atan2(y, x))
    })
}

/// The sums Σ coefficient × expression of the rows of a matrix in compressed form. A coefficient 0 of a variable is left out: a variable
/// is finite, and the row does not depend on it.
#[pyfunction]
fn traced_product<'py>(
    starts: &Bound<'py, PyAny>,
    indices: &Bound<'py, PyAny>,
    coefficients: &Bound<'py, PyAny>,
    x: Vec<Bound<'py, PyAny>>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let py = starts.py();
    let (starts, columns) = (positions(starts, "indptr")?, positions(indices, "indices")?);
    let coefficients = vector(coefficients, "the matrix")?;
    let operands = x.iter().map(|value| {
        Operand::of(value).ok_or_else(|| {
            PyTypeError::new_err(format!("{value:?} is neither a number nor a traced expression"))
        })
    });
    let operands: Vec<Operand<'_>> = operands.collect::<PyResult<_>>()?;
    let Some(page) = operands.iter().find_map(Operand::page).cloned() else {
        return Err(PyTypeError::new_err("no argument is a traced expression"));
    };
    let places: Vec<usize> = operands.iter().map(|o| o.on(&page)).collect::<PyResult<_>>()?;
    let outside = || PyValueError::new_err("the matrix and the vector do not fit together");
    let mut rows = Vec::with_capacity(starts.len().saturating_sub(1));
    for ends in starts.windows(2) {
        let entries = columns.get(ends[0]..ends[1]).ok_or_else(outside)?;
        let factors = coefficients.get(ends[0]..ends[1]).ok_or_else(outside)?;
        let mut written = write(&page);
        let mut sum = None;
        for (&column, &factor) in entries.iter().zip(factors) {
            let place = *places.get(column).ok_or_else(outside)?;
            if factor == 0.0 && matches!(written.nodes[place], Node::Variable(_)) {
                continue;
            }
            let number = written.add(Node::Number(factor.to_bits()));
            let term = match factor {
                1.0 => place,
                _ => written.add(Node::Mul(number, place)),
            };
            sum = Some(sum.map_or(term, |sum| written.add(Node::Add(sum, term))));
        }
        let at = sum.unwrap_or_else(|| written.add(Node::Number(0.0_f64.to_bits())));
        drop(written);
        let page = page.clone();
        rows.push(Bound::new(py, Expression { page, at })?.into_any());
    }
    Ok(rows)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Expression>()?;
    module.add_class::<Condition>()?;
    module.add_function(wrap_pyfunction!(traced_maximum, module)?)?;
    module.add_function(wrap_pyfunction!(traced_minimum, module)?)?;
    module.add_function(wrap_pyfunction!(traced_clip, module)?)?;
    module.add_function(wrap_pyfunction!(traced_where, module)?)?;
    module.add_function(wrap_pyfunction!(traced_arctan2, module)?)?;
    module.add_function(wrap_pyfunction!(traced_name, module)?)?;
    module.add_function(wrap_pyfunction!(traced_product, module)?)
}
