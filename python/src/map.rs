//! Maps made of formulas, traced from Python functions.

use std::borrow::Cow;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::complementarity::McpFunction;
use semismooth::piecewise::check::{CheckError, CheckOptions, FindingKind, check};
use semismooth::piecewise::{self, Kinks, NonsmoothFunction, PiecewiseSmooth, Real, Traced};
use semismooth::sparse::{Matrix, Pattern};

use crate::arrays::{counted, dense, names, vector};
use crate::errors::{Run, raised};
use crate::expressions::{Expression, Node, Operand, Page, Smooth, Writing, write};
use crate::saving::{data, data_of, state_of};
use crate::structure::{Structure, structure};
use crate::text::text;

/// Variables and sites up to which a failed run looks for jumps.
const EXAMINED: usize = 100;

/// A formula: the nodes that its values need, in an order in which each comes after its arguments.
pub(crate) struct Formula {
    variables: usize,
    nodes: Vec<Node>,
    values: Vec<usize>,
    structure: Structure,
    /// The names that the function gives to its kinks, site by site.
    names: Vec<Option<String>>,
}

impl Formula {
    /// The nodes on which the values depend: kinks that do not affect them are no sites.
    fn new(variables: usize, written: &Writing, values: &[usize]) -> Self {
        let page = &written.nodes;
        let mut needed = vec![false; page.len()];
        values.iter().for_each(|&v| needed[v] = true);
        for at in (0..page.len()).rev() {
            if needed[at] {
                let arguments = page[at].arguments();
                arguments.into_iter().flatten().for_each(|a| needed[a] = true);
            }
        }
        let mut place = vec![0; page.len()];
        let (mut nodes, mut names) = (Vec::new(), Vec::new());
        for (at, node) in page.iter().enumerate().filter(|(at, _)| needed[*at]) {
            place[at] = nodes.len();
            nodes.push(node.moved(|a| place[a]));
            if node.is_kink() {
                names.push(written.names.get(&at).cloned());
            }
        }
        let values: Vec<usize> = values.iter().map(|&v| place[v]).collect();
        Self {
            structure: structure(variables, &nodes, &values),
            variables,
            nodes,
            values,
            names,
        }
    }

    fn name(&self, site: usize) -> Option<&str> {
        self.names.get(site)?.as_deref()
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
                    Smooth::Tan => v[a].tan(),
                    Smooth::Atan => v[a].atan(),
                    Smooth::Sinh => v[a].sinh(),
                    Smooth::Cosh => v[a].cosh(),
                    Smooth::Tanh => v[a].tanh(),
                    Smooth::Asin => v[a].asin(),
                    Smooth::Acos => v[a].acos(),
                    Smooth::Ln1p => v[a].ln_1p(),
                    Smooth::Expm1 => v[a].exp_m1(),
                    Smooth::Cbrt => v[a].cbrt(),
                },
                Node::Atan2(a, b) => v[a].atan2(v[b]),
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

    fn pattern(&self) -> Pattern {
        self.formula.structure.pattern.clone()
    }

    fn dependencies(&self, rows: &mut [Vec<usize>], variables: &mut [Vec<usize>], nested: &mut bool) -> bool {
        let known = &self.formula.structure.dependencies;
        rows.clone_from_slice(&known.rows);
        variables.clone_from_slice(&known.variables);
        *nested = known.nested;
        true
    }

    fn site_name(&self, site: usize) -> Option<Cow<'_, str>> {
        self.formula.name(site).map(Cow::Borrowed)
    }

    fn piece_name(&self, site: usize, piece: usize) -> Option<Cow<'_, str>> {
        let name = self.formula.name(site)?;
        let mut kinks = self.formula.nodes.iter().filter(|node| node.is_kink());
        let words: &[&str] = match *kinks.nth(site)? {
            Node::Abs(_) => &["positive", "negative"],
            Node::Project(..) => &["lower", "interior", "upper"],
            _ => &["first", "second"],
        };
        Some(Cow::Owned(format!("{name}: {}", words.get(piece)?)))
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

    /// A jump found between two points and around them, in a sentence; small maps alone are examined.
    pub(crate) fn jump(&self, ends: [&[f64]; 2]) -> Option<String> {
        let (m, sites) = (self.formula.variables, self.num_sites());
        if sites == 0 || m.max(sites) > EXAMINED {
            return None;
        }
        let size = ends
            .iter()
            .flat_map(|x| x.iter())
            .fold(0.0, |s: f64, v| s.max(v.abs()));
        let size = if size > 0.0 { size } else { 1.0 };
        let mut samples = Vec::new();
        for x in ends {
            for shift in [-0.5, -0.05, 0.03, 0.3] {
                // Another multiple in each direction, so that no sample lies on a kink by symmetry.
                let moved = x
                    .iter()
                    .enumerate()
                    .map(|(k, v)| v + shift * size * (1.0 + 0.1 * ((k % 7) as f64)));
                samples.push(moved.collect());
            }
        }
        match check(&self.own, &samples, &CheckOptions::default()) {
            Err(CheckError::Findings(found)) => {
                let jump = found.iter().find(|f| {
                    // Where a formula has no value there is nothing to compare.
                    f.kind == FindingKind::Discontinuity && f.expected.is_finite() && f.found.is_finite()
                })?;
                let name = jump.site.as_ref().map_or("a kink", |(_, name)| name.as_str());
                let (a, b) = (jump.expected, jump.found);
                Some(format!(
                    "the function jumps at {name}: its two formulas give {a:.3e} and {b:.3e} there"
                ))
            }
            _ => None,
        }
    }

    /// What legends call a piece: its formula, after the name of the site if it has one.
    pub(crate) fn label(&self, site: usize, piece: usize, variables: &[String]) -> Option<String> {
        let formula = &self.formula;
        let kink = formula.nodes.iter().filter(|node| node.is_kink()).nth(site)?;
        let of = |at: usize| text(&formula.nodes, at, variables);
        let own = match (*kink, piece) {
            (Node::Max(a, _) | Node::Min(a, _) | Node::Abs(a) | Node::Switch(_, a, _), 0) => of(a)?,
            (Node::Max(_, b) | Node::Min(_, b) | Node::Switch(_, _, b), 1) => of(b)?,
            (Node::Abs(a), 1) => format!("−({})", of(a)?),
            (Node::Project(lower, ..), 0) => of(lower)?,
            (Node::Project(_, z, _), 1) => of(z)?,
            (Node::Project(_, _, upper), 2) => of(upper)?,
            _ => return None,
        };
        Some(match formula.name(site) {
            Some(name) => format!("{name}: {own}"),
            None => own,
        })
    }

    /// The map in a run that Python can end.
    pub(crate) fn traced<'r>(&self, run: &'r Run) -> Traced<Watched<'r>> {
        Traced::new(Watched {
            formula: self.formula.clone(),
            run: Some(run),
        })
    }

    /// The map outside of any run.
    pub(crate) fn free(&self) -> Traced<Watched<'static>> {
        Traced::new(Watched {
            formula: self.formula.clone(),
            run: None,
        })
    }

    /// The map of the first n variables, the others being these numbers.
    pub(crate) fn fixed(&self, n: usize, numbers: &[f64]) -> Self {
        let fixed = |node: &Node| match node {
            Node::Variable(k) if *k >= n => Node::Number(numbers[*k - n].to_bits()),
            other => *other,
        };
        let formula = &self.formula;
        self.rewritten(
            n,
            formula.nodes.iter().map(fixed).collect(),
            formula.values.clone(),
        )
    }

    /// The map x − mid(lower, x − F, upper), x being the first variables: its zeros are the solutions of the complementarity problem of F.
    /// Components without bounds are those of F.
    pub(crate) fn natural(&self, lower: &[f64], upper: &[f64]) -> Self {
        let mut nodes = self.formula.nodes.clone();
        let mut values = self.formula.values.clone();
        for (i, value) in values.iter_mut().enumerate() {
            let mut write = |node: Node| {
                nodes.push(node);
                nodes.len() - 1
            };
            let bounds = [lower[i], upper[i]];
            if bounds.iter().all(|b| b.is_infinite()) {
                continue;
            }
            let x = write(Node::Variable(i));
            let moved = write(Node::Sub(x, *value));
            let [l, u] = bounds.map(|b| b.is_finite().then(|| write(Node::Number(b.to_bits()))));
            let nearest = match (l, u) {
                (Some(l), _) if bounds[0] == bounds[1] => l,
                (Some(l), Some(u)) => write(Node::Project(l, moved, u)),
                (Some(l), None) => write(Node::Max(l, moved)),
                (None, Some(u)) => write(Node::Min(u, moved)),
                (None, None) => continue,
            };
            *value = write(Node::Sub(x, nearest));
        }
        self.rewritten(self.formula.variables, nodes, values)
    }

    /// The map of other nodes, of which the first ones are kinks where those of this map are.
    fn rewritten(&self, variables: usize, nodes: Vec<Node>, values: Vec<usize>) -> Self {
        let mut names = self.formula.names.clone();
        names.resize(nodes.iter().filter(|node| node.is_kink()).count(), None);
        Self::new(Formula {
            structure: structure(variables, &nodes, &values),
            variables,
            nodes,
            values,
            names,
        })
    }

    /// The first value at x, without Python.
    pub(crate) fn first_value(&self, x: &[f64]) -> f64 {
        let mut out = vec![f64::NAN; self.formula.values.len()];
        piecewise::value(&self.own, x, &mut out);
        out.first().copied().unwrap_or(f64::NAN)
    }

    /// The first value at x and its derivatives there, without Python.
    pub(crate) fn value_and_gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let mut jac = Matrix::zeros(self.own.pattern());
        self.own.jacobian(&piecewise::select(&self.own, x), x, &mut jac);
        let gradient = (0..x.len()).map(|k| jac.get(0, k)).collect();
        (self.first_value(x), gradient)
    }

    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, formula) = (slf.py(), &slf.get().formula);
        state_of(
            py,
            &[
                ("variables", data_of(py, &formula.variables)?),
                ("nodes", data_of(py, &formula.nodes)?),
                ("values", data_of(py, &formula.values)?),
                ("names", data_of(py, &formula.names)?),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let (variables, names) = (data(state, "variables")?, data(state, "names")?);
        let (nodes, values): (Vec<Node>, Vec<usize>) = (data(state, "nodes")?, data(state, "values")?);
        let behind = |at: usize, node: &Node| match node {
            Node::Variable(k) => *k < variables,
            node => node.arguments().into_iter().flatten().all(|a| a < at),
        };
        let fits = nodes.iter().enumerate().all(|(at, node)| behind(at, node));
        if !fits || values.iter().any(|v| *v >= nodes.len()) {
            return Err(PyValueError::new_err(
                "the saved formula refers to what it does not have",
            ));
        }
        let formula = Formula {
            structure: structure(variables, &nodes, &values),
            variables,
            nodes,
            values,
            names,
        };
        Ok(Bound::new(py, Self::new(formula))?.into_any())
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

    /// What is wrong with the map, tested at points, shape (k, m), and at the kinks between them: a list of sentences, empty where nothing was
    /// found. A ``where`` whose two formulas do not agree at the kink is a "jump between active selections".
    ///
    /// >>> import numpy as np, semismooth as ss
    /// >>> jumps = ss.trace(lambda x: [np.where(x[0] > 0, x[0] + 1, x[0])], 1)
    /// >>> [text.partition(" at ")[0] for text in jumps.check([[-0.5], [0.7]])]
    /// ['jump between active selections']
    fn check(&self, py: Python<'_>, points: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
        let samples: Vec<Vec<f64>> = (points.try_iter()?)
            .map(|point| self.point(&point?))
            .collect::<PyResult<_>>()?;
        match py.detach(|| check(&self.own, &samples, &CheckOptions::default())) {
            Ok(_) => Ok(Vec::new()),
            Err(CheckError::Findings(found)) => Ok(found.iter().map(ToString::to_string).collect()),
            Err(other) => Err(raised(other)),
        }
    }

    fn __repr__(&self) -> String {
        format!(
            "<Map of {} with {} and {}>",
            counted(self.formula.variables, "variable"),
            counted(self.formula.values.len(), "value"),
            counted(self.num_sites(), "site")
        )
    }
}

/// Runs ``function(x)`` once on an array x of ``num_vars`` variables, and keeps what it computes as a :class:`Map`.
///
/// The function may use arithmetic, numpy's functions (``numpy.maximum``, ``where``, ``clip``, ``sum``, ``interp``, …), ``max``, ``min``, ``math``, products with
/// matrices, those of scipy.sparse among them, and returns n values. Python's ``if`` on values raises ``TypeError``: write ``numpy.where``.
/// Afterwards no Python runs: what the function reads elsewhere (time, globals, random numbers) is kept as it was in that one call.
///
/// In the module of the function (and in those of functions it names) numpy, ``math``, ``max`` and ``min`` are replaced by versions that can hold traced
/// variables (:mod:`semismooth.numpy`) for the time of this call; other threads see no difference.
///
/// >>> import semismooth as ss
/// >>> ramp = ss.trace(lambda x: [ss.maximum(x[0], 0) - x[1]], 2)
/// >>> ramp([3.0, 1.0])
/// array([2.])
#[pyfunction]
pub(crate) fn trace(py: Python<'_>, function: &Bound<'_, PyAny>, num_vars: usize) -> PyResult<Map> {
    traced_call(py, function, num_vars, None)
}

/// A function of two arrays, n unknowns and k parameters, as a map of n + k variables.
pub(crate) fn trace_two(py: Python<'_>, function: &Bound<'_, PyAny>, n: usize, k: usize) -> PyResult<Map> {
    traced_call(py, function, n + k, Some(n))
}

fn traced_call(
    py: Python<'_>,
    function: &Bound<'_, PyAny>,
    num_vars: usize,
    unknowns: Option<usize>,
) -> PyResult<Map> {
    let page = Page::default();
    let variables: Vec<Py<Expression>> = (0..num_vars)
        .map(|k| Py::new(py, Expression::new(&page, Node::Variable(k))))
        .collect::<PyResult<_>>()?;
    let run = py.import("semismooth._arrays")?.getattr("run")?;
    let mut found = Vec::new();
    for value in run.call1((function, variables, unknowns))?.try_iter()? {
        let value = value?;
        let operand = Operand::of(&value).ok_or_else(|| {
            PyTypeError::new_err(format!(
                "value {} of the traced function is {value:?}, neither a number nor a traced expression",
                found.len()
            ))
        })?;
        found.push(operand.on(&page)?);
    }
    Ok(py.detach(|| Map::new(Formula::new(num_vars, &write(&page), &found))))
}

/// The map itself, or one traced.
pub(crate) fn map_of<'py>(function: &Bound<'py, PyAny>, num_vars: usize) -> PyResult<Bound<'py, Map>> {
    match function.cast::<Map>() {
        Ok(map) => Ok(map.clone()),
        Err(_) => Bound::new(function.py(), trace(function.py(), function, num_vars)?),
    }
}

/// A traced function with one value and no kinks.
pub(crate) fn smooth(function: &Bound<'_, PyAny>, vars: usize, what: &str) -> PyResult<Py<Map>> {
    let map = map_of(function, vars)?;
    let (found, values, sites) = {
        let map = map.get();
        (map.num_vars(), map.num_residuals(), map.num_sites())
    };
    match (found, values, sites) == (vars, 1, 0) {
        true => Ok(map.unbind()),
        false => Err(PyValueError::new_err(format!(
            "{what} must be a smooth function of {vars} variables with one value; variables of this one: {found}, values: {values}, kinks: {sites}"
        ))),
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Map>()?;
    module.add_function(wrap_pyfunction!(trace, module)?)
}
