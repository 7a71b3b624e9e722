//! Formulas as text, for the names of pieces in legends.

use crate::expressions::{Node, Smooth};

/// Characters up to which a formula is a name.
const LONGEST: usize = 28;

/// How tightly the outermost operation of a text binds.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Binding {
    Sum,
    Product,
    Power,
}

/// The formula of a node in terms of the names of the variables; `None` if it is long.
pub(crate) fn text(nodes: &[Node], at: usize, variables: &[String]) -> Option<String> {
    Some(bound(nodes, at, variables)?.0)
}

fn bound(nodes: &[Node], at: usize, variables: &[String]) -> Option<(String, Binding)> {
    let within = |at: usize, least: Binding| {
        let (text, binding) = bound(nodes, at, variables)?;
        Some(if binding < least {
            format!("({text})")
        } else {
            text
        })
    };
    let call = |name: &str, arguments: &[usize]| {
        let texts: Option<Vec<String>> = arguments.iter().map(|a| within(*a, Binding::Sum)).collect();
        Some((format!("{name}({})", texts?.join(", ")), Binding::Power))
    };
    let two = |a: usize, b: usize, sign: &str, binding: Binding, right: Binding| {
        Some((
            format!("{}{sign}{}", within(a, binding)?, within(b, right)?),
            binding,
        ))
    };
    let found = match *nodes.get(at)? {
        Node::Variable(k) => (
            variables.get(k).cloned().unwrap_or_else(|| format!("x[{k}]")),
            Binding::Power,
        ),
        Node::Number(bits) => {
            let value = f64::from_bits(bits);
            let text = format!("{value}").replace('-', "−");
            (text, if value < 0.0 { Binding::Sum } else { Binding::Power })
        }
        Node::Neg(a) => (format!("−{}", within(a, Binding::Product)?), Binding::Sum),
        Node::Add(a, b) => two(a, b, " + ", Binding::Sum, Binding::Sum)?,
        Node::Sub(a, b) => two(a, b, " − ", Binding::Sum, Binding::Product)?,
        Node::Mul(a, b) => two(a, b, " ", Binding::Product, Binding::Power)?,
        Node::Div(a, b) => two(a, b, "/", Binding::Product, Binding::Power)?,
        Node::Integer(a, n) => (format!("{}^{n}", within(a, Binding::Power)?), Binding::Product),
        Node::Power(a, bits) => (
            format!("{}^{}", within(a, Binding::Power)?, f64::from_bits(bits)),
            Binding::Product,
        ),
        Node::Smooth(function, a) => call(word(function), &[a])?,
        Node::Atan2(a, b) => call("arctan2", &[a, b])?,
        Node::Max(a, b) => call("max", &[a, b])?,
        Node::Min(a, b) => call("min", &[a, b])?,
        Node::Abs(a) => (format!("|{}|", within(a, Binding::Sum)?), Binding::Power),
        Node::Project(lower, z, upper) => call("clip", &[z, lower, upper])?,
        Node::Switch(..) => return None,
    };
    (found.0.chars().count() <= LONGEST).then_some(found)
}

const fn word(function: Smooth) -> &'static str {
    match function {
        Smooth::Sqrt => "√",
        Smooth::Exp => "exp",
        Smooth::Ln => "ln",
        Smooth::Sin => "sin",
        Smooth::Cos => "cos",
        Smooth::Tan => "tan",
        Smooth::Atan => "arctan",
        Smooth::Sinh => "sinh",
        Smooth::Cosh => "cosh",
        Smooth::Tanh => "tanh",
        Smooth::Asin => "arcsin",
        Smooth::Acos => "arccos",
        Smooth::Ln1p => "log1p",
        Smooth::Expm1 => "expm1",
        Smooth::Cbrt => "∛",
    }
}
