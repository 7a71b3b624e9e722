//! Tracing: a Python function is run once on variables that record every operation on them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::PyUntypedArray;
use pyo3::basic::CompareOp;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A node of a formula; arguments are positions of nodes before it. Numbers are kept as their bits, so that equal nodes have one hash.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
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
    Max(usize, usize),
    Min(usize, usize),
    Abs(usize),
    /// lower, z, upper.
    Project(usize, usize, usize),
    /// test, value where test ≥ 0, value elsewhere.
    Switch(usize, usize, usize),
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
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
}

impl Node {
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
/// Arithmetic (``+ - * / **`` and ``abs``), the functions of this module, and numpy's ``sqrt exp log sin cos tan arctan sinh cosh tanh`` work on
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
    /// The node that is ≥ 0 where the comparison holds.
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
    let node = Node::Switch(*test, operand(&a)?, operand(&b)?);
    Ok(Bound::new(a.py(), Expression::new(page, node))?.into_any())
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Expression>()?;
    module.add_class::<Condition>()?;
    module.add_function(wrap_pyfunction!(traced_maximum, module)?)?;
    module.add_function(wrap_pyfunction!(traced_minimum, module)?)?;
    module.add_function(wrap_pyfunction!(traced_clip, module)?)?;
    module.add_function(wrap_pyfunction!(traced_where, module)?)
}
