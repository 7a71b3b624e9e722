//! Formulas: recorded from a closure, or read from text as people type them.

mod expression;
mod node;
mod parser;
mod words;

use std::borrow::Cow;

pub use expression::Expression;
use node::{Node, Page};
pub use parser::FormulaError;

use super::{Kinks, NonsmoothFunction, Real};

/// Nodes up to which a formula is evaluated without memory from the heap.
const ON_THE_STACK: usize = 64;

/// A function ℝᵐ → ℝⁿ with kinks, written as a closure or as text: what [`Traced`](super::Traced) and
/// [`Autodiff`](crate::complementarity::Autodiff) turn into maps with exact derivatives.
///
/// The closure runs once, on variables that record what is done with them. Numbers stand on either side of an operator; kinks are the
/// methods [`max`](Expression::max), [`min`](Expression::min), [`abs`](Expression::abs), [`project`](Expression::project) and
/// [`switch`](Expression::switch). Equal expressions are recorded once, so that a kink that is written twice is one site, and kinks on which no
/// value depends are none. Sites and pieces have the text of the formula for a name.
///
/// ```
/// use semismooth::newton::Newton;
/// use semismooth::piecewise::{Formula, Traced};
///
/// // |x| + x/2 = 3 and y = max(x, 1).
/// let formula = Formula::new(2, |x| vec![x[0].abs() + 0.5 * x[0] - 3.0, x[1] - x[0].max(1.0)]);
/// let mut x = [0.3, 0.0];
/// Newton::default().solve(&Traced::new(formula), &mut x)?;
/// assert_eq!(x, [2.0, 2.0]);
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
///
/// For a complementarity problem:
///
/// ```
/// use semismooth::complementarity::{Autodiff, Mcp, McpSolver};
/// use semismooth::piecewise::Formula;
///
/// // 0 ≤ x ⟂ eˣ − 2 ≥ 0.
/// let formula = Formula::new(1, |x| vec![x[0].exp() - 2.0]);
/// let problem = Mcp::new(Autodiff::new(formula), vec![0.0], vec![f64::INFINITY])?;
/// let mut x = [1.0];
/// let mut solver = McpSolver::default();
/// assert!(solver.solve(&problem, &mut x)?.is_solved());
/// assert!((x[0] - 2.0_f64.ln()).abs() < 1e-12);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    variables: Vec<String>,
    /// Each after its arguments.
    nodes: Vec<Node>,
    values: Vec<usize>,
    /// The nodes that are kinks, in the order of the sites.
    kinks: Vec<usize>,
}

impl Formula {
    /// Records a function of `num_vars` variables, named x₀, x₁, … in the names of pieces.
    pub fn new<F>(num_vars: usize, function: F) -> Self
    where
        F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
    {
        let names: Vec<String> = (0..num_vars).map(subscripted).collect();
        Self::named(names, function)
    }

    /// Records a function of as many variables as there are names.
    pub fn named<S, F>(names: impl IntoIterator<Item = S>, function: F) -> Self
    where
        S: Into<String>,
        F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
    {
        let variables: Vec<String> = names.into_iter().map(Into::into).collect();
        let page = Page::default();
        let x: Vec<Expression<'_>> = (0..variables.len())
            .map(|k| Expression::recorded(&page, Node::Variable(k)))
            .collect();
        let values: Vec<usize> = function(&x).iter().map(|v| v.on(&page)).collect();
        Self::of_page(variables, &page, &values)
    }

    /// Reads equations in the variables of these names, of which the last may be a parameter: each is `formula`, meaning formula = 0, or
    /// `left = right`, made of numbers, names, `+ - * / ^`, parentheses, `max`, `min`, `abs`, `sqrt`, `exp`, `ln`, `sin`, `cos`, `tan`, `atan`,
    /// `sinh`, `cosh`, `tanh` and `pi`.
    ///
    /// ```
    /// use semismooth::piecewise::{Formula, PiecewiseSmoothExt, Traced, value};
    /// let beam = Formula::read(&["y - 1.25*max(y - 1, 0) = load"], &["y", "load"])?;
    /// let map = Traced::new(beam);
    /// assert_eq!((map.site_name(0), map.piece_name(0, 1)), ("y − 1 | 0".into(), "0".into()));
    /// let mut out = [0.0];
    /// value(&map, &[3.0, 0.5], &mut out);
    /// assert_eq!(out, [0.0]);
    /// # Ok::<(), semismooth::piecewise::FormulaError>(())
    /// ```
    ///
    /// # Errors
    /// The first equation that cannot be read, with what is wrong and where.
    pub fn read<S: AsRef<str>>(texts: &[S], variables: &[&str]) -> Result<Self, FormulaError> {
        Self::read_with(texts, variables, &[])
    }

    /// [`read`](Self::read) with names for numbers. A name that is both a variable's and a constant's is the variable's.
    ///
    /// ```
    /// use semismooth::piecewise::{Formula, PiecewiseSmooth, Traced, value};
    /// let stop = Formula::read_with(&["k*max(y - gap, 0) = load"], &["y", "load"], &[("k", 10.0), ("gap", 3.0)])?;
    /// let mut out = [0.0];
    /// value(&Traced::new(stop), &[4.0, 2.5], &mut out);
    /// assert_eq!(out, [7.5]);
    /// # Ok::<(), semismooth::piecewise::FormulaError>(())
    /// ```
    ///
    /// # Errors
    /// As [`read`](Self::read); a constant that is used and is not finite.
    pub fn read_with<S: AsRef<str>>(
        texts: &[S],
        variables: &[&str],
        constants: &[(&str, f64)],
    ) -> Result<Self, FormulaError> {
        let names = parser::Names { variables, constants };
        let page = Page::default();
        let values = texts.iter().zip(0..);
        let values = values
            .map(|(text, equation)| parser::read(text.as_ref(), equation, names, &page))
            .collect::<Result<Vec<usize>, _>>()?;
        let variables = variables.iter().map(|&name| name.to_owned()).collect();
        Ok(Self::of_page(variables, &page, &values))
    }

    /// The nodes on which the values depend.
    fn of_page(variables: Vec<String>, page: &Page, values: &[usize]) -> Self {
        let written = page.nodes();
        let mut needed = vec![false; written.len()];
        values.iter().for_each(|&v| needed[v] = true);
        for at in (0..written.len()).rev() {
            if needed[at] {
                written[at].arguments().for_each(|a| needed[a] = true);
            }
        }
        let mut place = vec![0; written.len()];
        let mut nodes = Vec::new();
        for (at, node) in written.iter().enumerate().filter(|(at, _)| needed[*at]) {
            place[at] = nodes.len();
            nodes.push(node.moved(|a| place[a]));
        }
        Self {
            variables,
            kinks: (0..nodes.len()).filter(|&k| nodes[k].is_kink()).collect(),
            nodes,
            values: values.iter().map(|&v| place[v]).collect(),
        }
    }

    fn compute<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, v: &mut [T], out: &mut [T]) {
        for (k, node) in self.nodes.iter().enumerate() {
            v[k] = node.value(x, v, kinks);
        }
        for (out, &at) in out.iter_mut().zip(&self.values) {
            *out = v[at];
        }
    }
}

/// x₀, x₁, …
fn subscripted(k: usize) -> String {
    let digits = k.to_string();
    let lowered = digits.chars().map(|d| {
        let digit = d.to_digit(10).unwrap_or(0);
        char::from_u32('₀' as u32 + digit).unwrap_or(d)
    });
    std::iter::once('x').chain(lowered).collect()
}

impl NonsmoothFunction for Formula {
    fn num_vars(&self) -> usize {
        self.variables.len()
    }

    fn num_residuals(&self) -> usize {
        self.values.len()
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let zero = T::from(0.0);
        match self.nodes.len() <= ON_THE_STACK {
            true => self.compute(x, kinks, &mut [zero; ON_THE_STACK], out),
            false => self.compute(x, kinks, &mut vec![zero; self.nodes.len()], out),
        }
    }

    fn site_name(&self, site: usize) -> Option<Cow<'_, str>> {
        let kink = *self.kinks.get(site)?;
        let names: Option<Vec<String>> = (0..self.nodes[kink].num_pieces())
            .map(|piece| words::piece(&self.nodes, &self.variables, kink, piece))
            .collect();
        Some(Cow::Owned(names?.join(" | ")))
    }

    fn piece_name(&self, site: usize, piece: usize) -> Option<Cow<'_, str>> {
        words::piece(&self.nodes, &self.variables, *self.kinks.get(site)?, piece).map(Cow::Owned)
    }
}
