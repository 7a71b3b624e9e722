//! Expressions in Polish prefix form, read with an explicit stack, so that nesting may have any depth.

use super::segments::Reader;
use super::{Fault, NlError, Source};
use crate::graph::{Binary, Expression, Node, NodeId, PiecewiseLinear, TooLarge, Unary};

/// How an operator is applied once all its operands are read.
#[derive(Debug, Clone)]
enum Action {
    Unary(Unary),
    Binary(Binary),
    /// A left fold: the operation on the first two, then on the result and the third, and so on.
    Chain(Binary),
    /// Condition, value if it holds, value if not.
    If,
    Square,
    SignedSquare,
    Piecewise(PiecewiseLinear),
    /// How many are true.
    Count,
    /// How many equal the first.
    NumberOf,
    /// Whether all differ, or the negation.
    AllDifferent(bool),
}

#[derive(Debug, Clone)]
struct Frame {
    action: Action,
    /// Number of operands still to be read.
    missing: usize,
    /// Where its operands begin on the stack of operands.
    operands: usize,
}

impl<S: Source> Reader<'_, S> {
    /// Reads one expression, up to the end of its last line.
    pub(super) fn expression(&mut self) -> Result<Expression, NlError> {
        self.expression_from(self.graph.nodes().len())
    }

    /// Reads one expression that owns the nodes from `start` on.
    pub(super) fn expression_from(&mut self, start: usize) -> Result<Expression, NlError> {
        let root = self.operand()?;
        Ok(self.graph.close(start, root))
    }

    fn operand(&mut self) -> Result<NodeId, NlError> {
        let mut frames: Vec<Frame> = Vec::new();
        let mut operands: Vec<NodeId> = Vec::new();
        loop {
            if let Some(id) = self.begin(&mut frames, operands.len())? {
                operands.push(id);
                if let Some(frame) = frames.last_mut() {
                    frame.missing -= 1;
                }
            }
            while let Some(frame) = frames.pop_if(|f| f.missing == 0) {
                let id = self
                    .apply(frame.action, &operands[frame.operands..])
                    .map_err(|e| self.too_large(e))?;
                operands.truncate(frame.operands);
                operands.push(id);
                if let Some(outer) = frames.last_mut() {
                    outer.missing -= 1;
                }
            }
            if frames.is_empty()
                && let Some(&root) = operands.first()
            {
                return Ok(root);
            }
        }
    }

    pub(super) fn too_large(&self, error: TooLarge) -> NlError {
        self.source
            .out_of_range("the number of operations", error, "less")
    }

    /// Reads the head of an expression: a number or a variable, which is an operand, or an operator, whose operands follow.
    fn begin(&mut self, frames: &mut Vec<Frame>, operands: usize) -> Result<Option<NodeId>, NlError> {
        let what = "an expression";
        let node = match self.source.tag()? {
            None => return Err(self.source.fail(Fault::End { what })),
            Some(b'o') => {
                let (action, missing) = self.operator()?;
                frames.push(Frame {
                    action,
                    missing,
                    operands,
                });
                return Ok(None);
            }
            Some(b'v') => return self.reference().map(Some),
            Some(tag @ (b'n' | b's' | b'l')) => Node::Constant(self.constant(tag)?),
            Some(b'f') => {
                let index = self.source.index("a function")?;
                let name = self.functions.get(index).and_then(Clone::clone);
                let name = name.unwrap_or_else(|| format!("number {index}"));
                return Err(self.source.fail(Fault::Function(name)));
            }
            Some(b'h') => return Err(self.source.fail(Fault::Text)),
            Some(other) => {
                let found = format!("{:?}", char::from(other));
                return Err(self.source.fail(Fault::Expected { what, found }));
            }
        };
        self.graph.push(node).map(Some).map_err(|e| self.too_large(e))
    }

    /// Reads a number; its letter has been read.
    fn constant(&mut self, tag: u8) -> Result<f64, NlError> {
        let what = "a number";
        let value = match tag {
            b's' => f64::from(self.source.short(what)?),
            b'l' => f64::from(self.source.integer(what)?),
            _ => self.source.number(what)?,
        };
        if value.is_nan() {
            return Err(self.source.out_of_range(what, value, "no NaN"));
        }
        self.source.end_line()?;
        Ok(value)
    }

    /// Reads a variable or defined variable; its letter has been read.
    fn reference(&mut self) -> Result<NodeId, NlError> {
        let variables = self.header.variables;
        let index = self
            .source
            .index_below("a variable", variables + self.header.defined)?;
        if index >= variables && self.graph.defined(index - variables).is_none() {
            return Err(self.source.fail(Fault::Undefined(index)));
        }
        self.source.end_line()?;
        if index < variables {
            return Ok(index as NodeId);
        }
        let node = Node::Defined((index - variables) as u32);
        self.graph.push(node).map_err(|e| self.too_large(e))
    }

    /// Reads an operator and its number of operands; its letter has been read.
    fn operator(&mut self) -> Result<(Action, usize), NlError> {
        let code = self.source.index("an operator")?;
        let Some((action, arity)) = action(code) else {
            return match code {
                64 => {
                    self.source.end_line()?;
                    Ok((Action::Piecewise(self.table()?), 1))
                }
                _ => Err(self.source.fail(Fault::Operator(code))),
            };
        };
        self.source.end_line()?;
        if arity > 0 {
            return Ok((action, arity));
        }
        let count = self.source.count("operands")?;
        if count == 0 {
            return Err(self
                .source
                .out_of_range("the number of operands", 0, "at least 1"));
        }
        self.source.end_line()?;
        Ok((action, count))
    }

    /// Reads the number of slopes, then slopes and breakpoints in turn.
    fn table(&mut self) -> Result<PiecewiseLinear, NlError> {
        let count = self.source.count("slopes")?;
        if count == 0 {
            return Err(self.source.out_of_range("the number of slopes", 0, "at least 1"));
        }
        self.source.end_line()?;
        let (mut slopes, mut breakpoints) = (Vec::new(), Vec::new());
        for k in 0..2 * count - 1 {
            let what = "a slope or a breakpoint";
            let value = match self.source.tag()? {
                Some(tag @ (b'n' | b's' | b'l')) => self.constant(tag)?,
                Some(other) => {
                    let found = format!("{:?}", char::from(other));
                    return Err(self.source.fail(Fault::Expected { what, found }));
                }
                None => return Err(self.source.fail(Fault::End { what })),
            };
            match k % 2 {
                0 => slopes.push(value),
                _ => breakpoints.push(value),
            }
        }
        PiecewiseLinear::new(breakpoints, slopes).ok_or_else(|| {
            self.source.fail(Fault::Range {
                what: "a piecewise linear term",
                value: String::new(),
                range: "finite, with breakpoints that increase".into(),
            })
        })
    }

    fn apply(&mut self, action: Action, operands: &[NodeId]) -> Result<NodeId, TooLarge> {
        let graph = &mut *self.graph;
        match action {
            Action::Unary(op) => graph.push(Node::Unary(op, operands[0])),
            Action::Binary(op) => graph.push(Node::Binary(op, operands[0], operands[1])),
            Action::Chain(op) => {
                let mut id = operands[0];
                if matches!(op, Binary::And | Binary::Or) && operands.len() == 1 {
                    id = graph.push(Node::Unary(Unary::Truth, id))?;
                }
                for &next in &operands[1..] {
                    id = graph.push(Node::Binary(op, id, next))?;
                }
                Ok(id)
            }
            Action::If => {
                if let Some(test) = graph.constant(operands[0]).filter(|t| !t.is_nan()) {
                    return Ok(operands[if test != 0.0 { 1 } else { 2 }]);
                }
                graph.push(Node::If(operands[0], operands[1], operands[2]))
            }
            Action::Square => graph.push(Node::Power(2.0, operands[0])),
            Action::SignedSquare => {
                let two = graph.push(Node::Constant(2.0))?;
                graph.push(Node::Binary(Binary::SignPower, operands[0], two))
            }
            Action::Piecewise(table) => graph.push_piecewise(table, operands[0]),
            Action::Count => {
                let mut id = graph.push(Node::Constant(0.0))?;
                for &next in operands {
                    let one = graph.push(Node::Unary(Unary::Truth, next))?;
                    id = graph.push(Node::Binary(Binary::Add, id, one))?;
                }
                Ok(id)
            }
            Action::NumberOf => {
                let mut id = graph.push(Node::Constant(0.0))?;
                for &next in &operands[1..] {
                    let one = graph.push(Node::Binary(Binary::Equal, operands[0], next))?;
                    id = graph.push(Node::Binary(Binary::Add, id, one))?;
                }
                Ok(id)
            }
            Action::AllDifferent(all) => {
                let id = graph.push_all_different(operands.to_vec())?;
                match all {
                    true => Ok(id),
                    false => graph.push(Node::Unary(Unary::Not, id)),
                }
            }
        }
    }
}

/// The operator of a code, and its number of operands, 0 where a count follows. The codes are those of AMPL's solver library.
fn action(code: usize) -> Option<(Action, usize)> {
    use Action::{AllDifferent, Chain, Count, NumberOf};
    let unary = |op| Some((Action::Unary(op), 1));
    let binary = |op| Some((Action::Binary(op), 2));
    match code {
        0 => binary(Binary::Add),
        1 => binary(Binary::Subtract),
        2 => binary(Binary::Multiply),
        3 => binary(Binary::Divide),
        4 => binary(Binary::Remainder),
        // Also with a constant exponent, or a constant base.
        5 | 81 | 83 => binary(Binary::Power),
        6 => binary(Binary::Less),
        11 => Some((Chain(Binary::Min), 0)),
        12 => Some((Chain(Binary::Max), 0)),
        13 => unary(Unary::Floor),
        14 => unary(Unary::Ceil),
        15 => unary(Unary::Abs),
        16 => unary(Unary::Negate),
        20 => binary(Binary::Or),
        21 => binary(Binary::And),
        22 => binary(Binary::Below),
        23 => binary(Binary::AtMost),
        24 => binary(Binary::Equal),
        28 => binary(Binary::AtLeast),
        29 => binary(Binary::Above),
        30 => binary(Binary::Different),
        34 => unary(Unary::Not),
        35 | 72 => Some((Action::If, 3)),
        37 => unary(Unary::Tanh),
        38 => unary(Unary::Tan),
        39 => unary(Unary::Sqrt),
        40 => unary(Unary::Sinh),
        41 => unary(Unary::Sin),
        42 => unary(Unary::Log10),
        43 => unary(Unary::Log),
        44 => unary(Unary::Exp),
        45 => unary(Unary::Cosh),
        46 => unary(Unary::Cos),
        47 => unary(Unary::Atanh),
        48 => binary(Binary::Atan2),
        49 => unary(Unary::Atan),
        50 => unary(Unary::Asinh),
        51 => unary(Unary::Asin),
        52 => unary(Unary::Acosh),
        53 => unary(Unary::Acos),
        54 => Some((Chain(Binary::Add), 0)),
        55 => binary(Binary::IntegerDivide),
        56 => binary(Binary::Precision),
        57 => binary(Binary::Round),
        58 => binary(Binary::Truncate),
        59 => Some((Count, 0)),
        60 => Some((NumberOf, 0)),
        // A number and a count: at least, at most, exactly that many, and the negations.
        62 => binary(Binary::AtMost),
        63 => binary(Binary::AtLeast),
        66 => binary(Binary::Equal),
        67 => binary(Binary::Above),
        68 => binary(Binary::Below),
        69 => binary(Binary::Different),
        70 => Some((Chain(Binary::And), 0)),
        71 => Some((Chain(Binary::Or), 0)),
        73 => binary(Binary::Same),
        74 => Some((AllDifferent(true), 0)),
        75 => Some((AllDifferent(false), 0)),
        79 => unary(Unary::Logistic),
        80 | 84 | 86 => binary(Binary::SignPower),
        82 => Some((Action::Square, 1)),
        85 => Some((Action::SignedSquare, 1)),
        _ => None,
    }
}
