//! Mixed complementarity problems as expression trees in JSON: `n`, `lower`, `upper` (null: no bound), `defs` (shared
//! subexpressions), `rows` (F, one tree a component), `starts` {label: x}. A tree is
//! number | ["v", j] | ["d", k] | ["lin", c0, [j…], [c…]] | ["+", a…] | ["*", a…] | ["/", a, b] | ["neg", a] | ["^", a, number] |
//! ["pow", a, b] | ["exp" | "log" | "sqrt" | "sin" | "cos", a], variables counted from 0.
//!
//! Trees are flattened to a tape: one forward sweep gives F, one backward sweep a row its sparse gradient.
#![allow(dead_code)]

use std::cell::RefCell;
use std::path::Path;

use semismooth::complementarity::{Mcp, McpFunction};
use semismooth::sparse::{Matrix, Pattern};
use serde_json::Value;

/// A problem as read from a file.
pub(crate) struct Problem {
    pub(crate) name: String,
    /// Whether a solution is known to exist.
    pub(crate) solvable: bool,
    pub(crate) mcp: Mcp<Tape>,
    /// Label and x.
    pub(crate) starts: Vec<(String, Vec<f64>)>,
    /// Known solutions, where the file lists any.
    pub(crate) solutions: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, Copy)]
enum Node {
    Constant(f64),
    Variable(usize),
    /// Root of a shared subexpression.
    Shared(usize),
    /// c0 and a range of `linear`.
    Linear(f64, usize, usize),
    /// Ranges of `children`.
    Sum(usize, usize),
    Product(usize, usize),
    Quotient(usize, usize),
    Negative(usize),
    Power(usize, f64),
    GeneralPower(usize, usize),
    Exp(usize),
    Log(usize),
    Sqrt(usize),
    Sin(usize),
    Cos(usize),
}

/// A range of nodes, children before parents; the last one is the root.
#[derive(Debug, Clone, Copy)]
struct Tree {
    first: usize,
    root: usize,
}

/// F as a tape.
pub(crate) struct Tape {
    n: usize,
    nodes: Vec<Node>,
    children: Vec<usize>,
    linear: Vec<(usize, f64)>,
    defs: Vec<Tree>,
    rows: Vec<Tree>,
    pattern: Pattern,
    affine: bool,
    work: RefCell<Work>,
}

#[derive(Default)]
struct Work {
    values: Vec<f64>,
    adjoint: Vec<f64>,
    pending: Vec<bool>,
}

pub(crate) type Failure = String;

/// Reads a problem; the error says what is wrong, and where.
pub(crate) fn read(path: &Path) -> Result<Problem, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let stem = path
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    parse(&text, &stem).map_err(|e| format!("{}: {e}", path.display()))
}

/// As [`read`], from text; `name` is used where the text has none.
pub(crate) fn parse(text: &str, name: &str) -> Result<Problem, Failure> {
    let file: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    if !file.is_object() {
        return Err("a problem is a JSON object with n, lower, upper, rows, starts".to_owned());
    }
    let n = file["n"]
        .as_u64()
        .filter(|n| *n > 0)
        .ok_or("`n` is missing or no positive whole number")? as usize;
    let lower = bounds(&file, "lower", n, f64::NEG_INFINITY)?;
    let upper = bounds(&file, "upper", n, f64::INFINITY)?;
    let tape = tape(&file, n)?;
    let starts = starts(&file, n)?;
    let empty = Vec::new();
    let known = file["solutions"].as_array().unwrap_or(&empty);
    Ok(Problem {
        name: file["name"].as_str().unwrap_or(name).to_owned(),
        solvable: file["expect"].as_str() != Some("none"),
        mcp: Mcp::new(tape, lower, upper).map_err(|e| e.to_string())?,
        starts,
        solutions: known.iter().filter_map(|s| vector(&s["x"], n).ok()).collect(),
    })
}

/// F from `defs` and `rows`.
pub(crate) fn tape(file: &Value, n: usize) -> Result<Tape, Failure> {
    let mut builder = Builder {
        n,
        nodes: Vec::new(),
        children: Vec::new(),
        linear: Vec::new(),
        defs: Vec::new(),
    };
    let empty = Vec::new();
    let defs = match &file["defs"] {
        Value::Null => &empty,
        defs => defs.as_array().ok_or("`defs` is no list of expressions")?,
    };
    for (k, def) in defs.iter().enumerate() {
        let tree = builder.tree(def).map_err(|e| format!("defs[{k}]: {e}"))?;
        builder.defs.push(tree);
    }
    let list = file["rows"]
        .as_array()
        .ok_or("`rows` is missing or no list of expressions")?;
    if list.len() != n {
        return Err(format!("`rows` has {} expressions for n = {n}", list.len()));
    }
    let mut rows = Vec::with_capacity(n);
    for (i, row) in list.iter().enumerate() {
        rows.push(builder.tree(row).map_err(|e| format!("rows[{i}]: {e}"))?);
    }
    builder.finish(rows)
}

/// Labels and points of `starts`.
pub(crate) fn starts(file: &Value, n: usize) -> Result<Vec<(String, Vec<f64>)>, Failure> {
    let starts = file["starts"]
        .as_object()
        .ok_or("`starts` is missing or no object of label: list")?;
    if starts.is_empty() {
        return Err("`starts` is empty; at least one start is needed".to_owned());
    }
    let mut all = Vec::new();
    for (label, x) in starts {
        all.push((
            label.clone(),
            vector(x, n).map_err(|e| format!("starts.{label}: {e}"))?,
        ));
    }
    Ok(all)
}

/// The beginning of a value, which may be long.
pub(crate) fn shown(value: &Value) -> String {
    const SHOWN: usize = 60;
    let text = value.to_string();
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text,
    }
}

pub(crate) fn number(value: &Value) -> Result<f64, Failure> {
    value
        .as_f64()
        .filter(|v| v.is_finite())
        .ok_or_else(|| format!("{} is no finite number", shown(value)))
}

pub(crate) fn vector(value: &Value, n: usize) -> Result<Vec<f64>, Failure> {
    let list = value.as_array().ok_or("not a list of numbers")?;
    if list.len() != n {
        return Err(format!("{} numbers for n = {n}", list.len()));
    }
    list.iter().map(number).collect()
}

pub(crate) fn bounds(file: &Value, key: &str, n: usize, none: f64) -> Result<Vec<f64>, Failure> {
    let list = file[key]
        .as_array()
        .ok_or_else(|| format!("`{key}` is missing or no list"))?;
    if list.len() != n {
        return Err(format!("`{key}` has {} entries for n = {n}", list.len()));
    }
    let bound = |v: &Value| if v.is_null() { Ok(none) } else { number(v) };
    list.iter()
        .enumerate()
        .map(|(i, v)| bound(v).map_err(|e| format!("{key}[{i}]: {e}, nor null")))
        .collect()
}

struct Builder {
    n: usize,
    nodes: Vec<Node>,
    children: Vec<usize>,
    linear: Vec<(usize, f64)>,
    defs: Vec<Tree>,
}

impl Builder {
    fn tree(&mut self, value: &Value) -> Result<Tree, Failure> {
        let first = self.nodes.len();
        let root = self.node(value)?;
        Ok(Tree { first, root })
    }

    fn push(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    fn variable(&self, value: &Value) -> Result<usize, Failure> {
        value
            .as_u64()
            .map(|j| j as usize)
            .filter(|j| *j < self.n)
            .ok_or_else(|| {
                format!(
                    "{} is no variable; they count from 0 to {}",
                    shown(value),
                    self.n - 1
                )
            })
    }

    fn node(&mut self, value: &Value) -> Result<usize, Failure> {
        if value.is_number() {
            let constant = number(value)?;
            return Ok(self.push(Node::Constant(constant)));
        }
        let list = value
            .as_array()
            .ok_or_else(|| format!("{} is neither a number nor [operator, arguments]", shown(value)))?;
        let operator = list
            .first()
            .and_then(Value::as_str)
            .ok_or_else(|| format!("{} does not begin with an operator", shown(value)))?;
        let arguments = &list[1..];
        let wanted = match operator {
            "v" | "d" | "neg" | "exp" | "log" | "sqrt" | "sin" | "cos" => 1..=1,
            "/" | "^" | "pow" => 2..=2,
            "lin" => 3..=3,
            "+" | "*" => 1..=usize::MAX,
            _ => return Err(format!("operator {} is unknown", shown(&list[0]))),
        };
        if !wanted.contains(&arguments.len()) {
            return Err(format!(
                "operator `{operator}` cannot have {} arguments",
                arguments.len()
            ));
        }
        let node = match operator {
            "v" => Node::Variable(self.variable(&arguments[0])?),
            "d" => {
                let k = arguments[0].as_u64().map(|k| k as usize);
                let known = self.defs.len();
                let tree = k.and_then(|k| self.defs.get(k)).ok_or_else(|| {
                    format!(
                        "[\"d\", {}] refers to no earlier entry of `defs` ({known} known)",
                        shown(&arguments[0])
                    )
                })?;
                Node::Shared(tree.root)
            }
            "lin" => {
                let c0 = number(&arguments[0])?;
                let lists = (arguments[1].as_array(), arguments[2].as_array());
                let (Some(vars), Some(coefficients)) = lists else {
                    return Err("`lin` needs a list of variables and one of coefficients".to_owned());
                };
                if vars.len() != coefficients.len() {
                    return Err(format!(
                        "`lin` has {} variables but {} coefficients",
                        vars.len(),
                        coefficients.len()
                    ));
                }
                let first = self.linear.len();
                for (j, c) in vars.iter().zip(coefficients) {
                    let entry = (self.variable(j)?, number(c)?);
                    self.linear.push(entry);
                }
                Node::Linear(c0, first, self.linear.len())
            }
            "+" | "*" => {
                let list: Vec<usize> = arguments.iter().map(|a| self.node(a)).collect::<Result<_, _>>()?;
                let first = self.children.len();
                self.children.extend(list);
                let last = self.children.len();
                match operator {
                    "+" => Node::Sum(first, last),
                    _ => Node::Product(first, last),
                }
            }
            "/" => Node::Quotient(self.node(&arguments[0])?, self.node(&arguments[1])?),
            "pow" => Node::GeneralPower(self.node(&arguments[0])?, self.node(&arguments[1])?),
            "^" => {
                let base = self.node(&arguments[0])?;
                Node::Power(
                    base,
                    number(&arguments[1]).map_err(|e| format!("exponent of `^`: {e}"))?,
                )
            }
            _ => {
                let a = self.node(&arguments[0])?;
                match operator {
                    "neg" => Node::Negative(a),
                    "exp" => Node::Exp(a),
                    "log" => Node::Log(a),
                    "sqrt" => Node::Sqrt(a),
                    "sin" => Node::Sin(a),
                    _ => Node::Cos(a),
                }
            }
        };
        Ok(self.push(node))
    }

    fn finish(self, rows: Vec<Tree>) -> Result<Tape, Failure> {
        let mut tape = Tape {
            n: self.n,
            affine: false,
            pattern: Pattern::full(0, 0),
            work: RefCell::new(Work {
                values: vec![0.0; self.nodes.len()],
                adjoint: vec![0.0; self.nodes.len()],
                pending: vec![false; self.defs.len()],
            }),
            nodes: self.nodes,
            children: self.children,
            linear: self.linear,
            defs: self.defs,
            rows,
        };
        let degrees = tape.degrees();
        tape.affine = tape.rows.iter().all(|t| degrees[t.root] <= 1);
        let mut entries: Vec<(usize, usize)> = (0..tape.n).map(|i| (i, i)).collect();
        for (i, row) in tape.rows.iter().enumerate() {
            tape.variables(*row, &mut |j| entries.push((i, j)));
        }
        tape.pattern = Pattern::from_entries(tape.n, tape.n, entries).map_err(|e| e.to_string())?;
        Ok(tape)
    }
}

impl Tape {
    /// For each node 0: constant, 1: affine, 2: anything else. Each is visited once, however often it is shared.
    fn degrees(&self) -> Vec<u8> {
        let mut degrees: Vec<u8> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let of = |range: std::ops::Range<usize>| range.map(|c| degrees[self.children[c]]);
            let bent = |a: usize| 2 * degrees[a].min(1);
            degrees.push(match *node {
                Node::Constant(_) => 0,
                Node::Variable(_) => 1,
                Node::Linear(_, first, last) => u8::from(last > first),
                Node::Shared(a) | Node::Negative(a) | Node::Power(a, 1.0) => degrees[a],
                Node::Sum(first, last) => of(first..last).max().unwrap_or(0),
                Node::Product(first, last) => of(first..last).fold(0, |sum, d| (sum + d).min(2)),
                Node::Quotient(a, b) if degrees[b] == 0 => degrees[a],
                Node::Quotient(a, b) | Node::GeneralPower(a, b) => bent(a).max(bent(b)),
                Node::Power(a, _)
                | Node::Exp(a)
                | Node::Log(a)
                | Node::Sqrt(a)
                | Node::Sin(a)
                | Node::Cos(a) => bent(a),
            });
        }
        degrees
    }

    fn variables(&self, tree: Tree, found: &mut dyn FnMut(usize)) {
        let mut trees = vec![tree];
        let mut seen = vec![false; self.defs.len()];
        while let Some(t) = trees.pop() {
            for node in &self.nodes[t.first..=t.root] {
                match *node {
                    Node::Variable(j) => found(j),
                    Node::Linear(_, first, last) => self.linear[first..last].iter().for_each(|e| found(e.0)),
                    Node::Shared(root) => {
                        let k = self.def_of(root);
                        if !std::mem::replace(&mut seen[k], true) {
                            trees.push(self.defs[k]);
                        }
                    }
                    _ => {}
                }
            }
        }
    }

    fn def_of(&self, root: usize) -> usize {
        self.defs.partition_point(|t| t.root < root)
    }

    fn forward(&self, x: &[f64], values: &mut [f64]) {
        for k in 0..self.nodes.len() {
            values[k] = match self.nodes[k] {
                Node::Constant(c) => c,
                Node::Variable(j) => x[j],
                Node::Shared(a) => values[a],
                Node::Linear(c0, first, last) => {
                    c0 + self.linear[first..last]
                        .iter()
                        .map(|(j, c)| c * x[*j])
                        .sum::<f64>()
                }
                Node::Sum(first, last) => self.children[first..last].iter().map(|c| values[*c]).sum(),
                Node::Product(first, last) => self.children[first..last].iter().map(|c| values[*c]).product(),
                Node::Quotient(a, b) => values[a] / values[b],
                Node::Negative(a) => -values[a],
                Node::Power(a, p) => values[a].powf(p),
                Node::GeneralPower(a, b) => values[a].powf(values[b]),
                Node::Exp(a) => values[a].exp(),
                Node::Log(a) => values[a].ln(),
                Node::Sqrt(a) => values[a].sqrt(),
                Node::Sin(a) => values[a].sin(),
                Node::Cos(a) => values[a].cos(),
            };
        }
    }

    fn backward(&self, tree: Tree, work: &mut Work, emit: &mut dyn FnMut(usize, f64)) {
        let Work {
            values,
            adjoint,
            pending,
        } = work;
        for k in (tree.first..=tree.root).rev() {
            let a = std::mem::take(&mut adjoint[k]);
            if a == 0.0 {
                continue;
            }
            match self.nodes[k] {
                Node::Constant(_) => {}
                Node::Variable(j) => emit(j, a),
                Node::Shared(root) => {
                    adjoint[root] += a;
                    pending[self.def_of(root)] = true;
                }
                Node::Linear(_, first, last) => {
                    for &(j, c) in &self.linear[first..last] {
                        emit(j, a * c);
                    }
                }
                Node::Sum(first, last) => {
                    for &c in &self.children[first..last] {
                        adjoint[c] += a;
                    }
                }
                Node::Product(first, last) => {
                    let factors = &self.children[first..last];
                    for (p, &c) in factors.iter().enumerate() {
                        let others = factors.iter().enumerate().filter(|(q, _)| *q != p);
                        adjoint[c] += a * others.map(|(_, o)| values[*o]).product::<f64>();
                    }
                }
                Node::Quotient(p, q) => {
                    adjoint[p] += a / values[q];
                    adjoint[q] -= a * values[k] / values[q];
                }
                Node::Negative(p) => adjoint[p] -= a,
                Node::Power(_, 0.0) => {}
                Node::Power(p, e) => adjoint[p] += a * e * values[p].powf(e - 1.0),
                Node::GeneralPower(p, q) => {
                    let (base, exponent) = (values[p], values[q]);
                    adjoint[p] += a * exponent * base.powf(exponent - 1.0);
                    if !matches!(self.nodes[q], Node::Constant(_)) {
                        adjoint[q] += a * values[k] * base.ln();
                    }
                }
                Node::Exp(p) => adjoint[p] += a * values[k],
                Node::Log(p) => adjoint[p] += a / values[p],
                Node::Sqrt(p) => adjoint[p] += a * 0.5 / values[k],
                Node::Sin(p) => adjoint[p] += a * values[p].cos(),
                Node::Cos(p) => adjoint[p] -= a * values[p].sin(),
            }
        }
    }
}

impl McpFunction for Tape {
    fn num_vars(&self) -> usize {
        self.n
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.borrow_mut();
        self.forward(x, &mut work.values);
        for (o, row) in out.iter_mut().zip(&self.rows) {
            *o = work.values[row.root];
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let work = &mut *self.work.borrow_mut();
        self.forward(x, &mut work.values);
        for (i, row) in self.rows.iter().enumerate() {
            let mut emit = |j: usize, v: f64| jac.add(i, j, v);
            work.adjoint[row.root] = 1.0;
            self.backward(*row, work, &mut emit);
            for k in (0..self.defs.len()).rev() {
                if std::mem::take(&mut work.pending[k]) {
                    self.backward(self.defs[k], work, &mut emit);
                }
            }
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_affine(&self) -> bool {
        self.affine
    }
}
