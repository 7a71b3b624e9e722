//! The text of formulas, for names of pieces.

use super::node::{Binary, Node, Smooth};

/// Characters that a name of a piece may have: longer ones say less than the kind of the kink.
const LONGEST: usize = 60;

/// How tightly operators bind, from sums to atoms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Sign,
    Power,
    Atom,
}

/// The text of a piece of a kink; none where it is too long.
pub(super) fn piece(nodes: &[Node], variables: &[String], kink: usize, piece: usize) -> Option<String> {
    let mut text = Text {
        nodes,
        variables,
        text: String::new(),
        depth: 0,
    };
    match *nodes.get(kink)? {
        Node::Max(a) | Node::Min(a) => text.write(*a.get(piece)?, Binding::Sum)?,
        Node::Abs([a]) => {
            text.write(a, Binding::Sum)?;
            text.text.push_str([" ≥ 0", " ≤ 0"].get(piece)?);
        }
        Node::Project(a) => text.write(*a.get(piece)?, Binding::Sum)?,
        Node::Switch([_, a, b]) => text.write(*[a, b].get(piece)?, Binding::Sum)?,
        _ => return None,
    }
    Some(text.text)
}

struct Text<'a> {
    nodes: &'a [Node],
    variables: &'a [String],
    text: String,
    /// How deep in the formula: no deeper than a name may be long.
    depth: usize,
}

impl Text<'_> {
    /// Appends a node, in parentheses if it binds less tightly than its surroundings; `None` where the text becomes too long.
    fn write(&mut self, at: usize, around: Binding) -> Option<()> {
        self.depth += 1;
        if self.depth > LONGEST {
            return None;
        }
        let own = self.binding(at);
        if own < around {
            self.text.push('(');
        }
        match self.nodes[at] {
            Node::Variable(k) => self.text.push_str(&self.variables[k]),
            Node::Number(bits) => self.number(f64::from_bits(bits)),
            Node::Neg([a]) => {
                self.text.push('−');
                self.write(a, Binding::Sign)?;
            }
            Node::Two(operator, [a, b]) => self.operator(operator, own, a, b)?,
            Node::Integer([a], n) => self.power(a, f64::from(n))?,
            Node::Power([a], bits) => self.power(a, f64::from_bits(bits))?,
            Node::Of(function, [a]) => {
                let named = Smooth::ALL.iter().find(|(_, f)| *f == function)?;
                self.call(named.0, &[a])?;
            }
            Node::Max(a) => self.call("max", &a)?,
            Node::Min(a) => self.call("min", &a)?,
            Node::Abs(a) => self.call("abs", &a)?,
            Node::Project([l, z, u]) => self.call("project", &[z, l, u])?,
            Node::Switch(a) => self.call("switch", &a)?,
        }
        if own < around {
            self.text.push(')');
        }
        self.depth -= 1;
        (self.text.chars().count() <= LONGEST).then_some(())
    }

    fn binding(&self, at: usize) -> Binding {
        match self.nodes[at] {
            Node::Two(Binary::Add | Binary::Sub, _) => Binding::Sum,
            Node::Two(..) => Binding::Product,
            Node::Neg(_) => Binding::Sign,
            Node::Number(bits) if f64::from_bits(bits).is_sign_negative() => Binding::Sign,
            Node::Integer(..) | Node::Power(..) => Binding::Power,
            _ => Binding::Atom,
        }
    }

    fn number(&mut self, value: f64) {
        // Rust writes 1e-20 with all its zeros otherwise.
        let text = match value == 0.0 || (1e-5..1e16).contains(&value.abs()) {
            true => value.to_string(),
            false => format!("{value:e}"),
        };
        self.text.push_str(&text.replace('-', "−"));
    }

    fn operator(&mut self, operator: Binary, own: Binding, a: usize, b: usize) -> Option<()> {
        self.write(a, own)?;
        self.text.push_str(match operator {
            Binary::Add => " + ",
            Binary::Sub => " − ",
            Binary::Mul => "*",
            Binary::Div => "/",
        });
        // a − (b − c) and a/(b*c) need their parentheses.
        let right = match operator {
            Binary::Add | Binary::Mul => own,
            Binary::Sub => Binding::Product,
            Binary::Div => Binding::Power,
        };
        self.write(b, right)
    }

    fn power(&mut self, base: usize, exponent: f64) -> Option<()> {
        self.write(base, Binding::Atom)?;
        self.text.push('^');
        self.number(exponent);
        Some(())
    }

    fn call(&mut self, name: &str, arguments: &[usize]) -> Option<()> {
        self.text.push_str(name);
        self.text.push('(');
        for (k, &a) in arguments.iter().enumerate() {
            if k > 0 {
                self.text.push_str(", ");
            }
            self.write(a, Binding::Sum)?;
        }
        self.text.push(')');
        Some(())
    }
}
