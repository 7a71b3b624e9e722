//! The segments after the header. They may come in any order, except that defined variables come before their use.

use super::{Fault, Header, NlError, Position, Source};
use crate::graph::{Binary, Expression, Graph, Node};
use crate::model::{Linear, Model, Objective, Row, RowKind};
use crate::names::Names;

/// Reads segments from either form of file.
pub(super) struct Reader<'a, S> {
    pub(super) source: &'a mut S,
    pub(super) header: &'a Header,
    pub(super) graph: &'a mut Graph,
    /// Names of imported functions.
    pub(super) functions: Vec<Option<String>>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    rows: Vec<Draft>,
    objectives: Vec<Objective>,
    seen_objectives: Vec<[bool; 2]>,
    start: Vec<f64>,
    duals: Vec<f64>,
    /// Numbers of entries announced for each column but the last, and the place of the announcement.
    columns: Option<(Position, Vec<usize>)>,
    kinds: Option<Vec<RowKind>>,
    bounded: bool,
    /// For each variable the last linear part in which it appeared.
    listed: Vec<usize>,
    parts: usize,
}

/// A row, some parts of which may not have been read yet.
#[derive(Debug, Clone, Default)]
struct Draft {
    expression: Option<Expression>,
    at: Option<Position>,
    linear: Option<Linear>,
}

impl<'a, S: Source> Reader<'a, S> {
    pub(super) fn new(source: &'a mut S, header: &'a Header, graph: &'a mut Graph) -> Self {
        Self {
            source,
            graph,
            functions: vec![None; header.functions],
            lower: Vec::new(),
            upper: Vec::new(),
            rows: vec![Draft::default(); header.rows],
            objectives: vec![Objective::default(); header.objectives],
            seen_objectives: vec![[false; 2]; header.objectives],
            start: vec![0.0; header.variables],
            duals: vec![0.0; header.rows],
            columns: None,
            kinds: None,
            bounded: false,
            listed: vec![0; header.variables],
            parts: 0,
            header,
        }
    }

    /// Reads all segments.
    pub(super) fn read(mut self) -> Result<Parts, NlError> {
        while let Some(tag) = self.source.tag()? {
            match tag {
                b'F' => self.function()?,
                b'S' => self.suffix()?,
                b'V' => self.defined()?,
                b'C' => self.constraint()?,
                b'L' => self.logical()?,
                b'O' => self.objective()?,
                b'd' => self.initial("a dual value")?,
                b'x' => self.initial("an initial value")?,
                b'r' => self.row_bounds()?,
                b'b' => self.variable_bounds()?,
                b'k' => self.column_counts(true)?,
                b'K' => self.column_counts(false)?,
                b'J' => self.jacobian()?,
                b'G' => self.gradient()?,
                other => return Err(self.source.fail(Fault::Segment(char::from(other)))),
            }
        }
        self.finish()
    }

    fn twice(&self, what: &'static str, index: usize, seen: bool) -> Result<(), NlError> {
        match seen {
            true => Err(self.source.fail(Fault::Twice { what, index })),
            false => Ok(()),
        }
    }

    fn function(&mut self) -> Result<(), NlError> {
        let index = self.source.index_below("a function", self.header.functions)?;
        self.source.index("the type of a function")?;
        self.source.integer("a number of arguments")?;
        self.functions[index] = Some(self.source.name()?);
        self.source.end_line()
    }

    /// Skips a suffix: this program uses none.
    fn suffix(&mut self) -> Result<(), NlError> {
        let kind = self.source.index_below("the kind of a suffix", 8)?;
        let count = self.source.count("values of a suffix")?;
        self.source.name()?;
        self.source.end_line()?;
        let items = match kind & 3 {
            0 => self.header.variables,
            1 => self.header.rows + self.header.logical,
            2 => self.header.objectives,
            _ => 1,
        };
        for _ in 0..count {
            self.source.index_below("the index of a suffix", items)?;
            match kind & 4 {
                0 => self.source.integer("the value of a suffix").map(f64::from)?,
                _ => self.source.number("the value of a suffix")?,
            };
            self.source.end_line()?;
        }
        Ok(())
    }

    fn defined(&mut self) -> Result<(), NlError> {
        let variables = self.header.variables;
        let index = self
            .source
            .index_below("a defined variable", variables + self.header.defined)?;
        let Some(index) = index.checked_sub(variables) else {
            return Err(self.source.out_of_range(
                "a defined variable",
                index,
                format_args!("at least {variables}"),
            ));
        };
        self.twice(
            "defined variable",
            variables + index,
            self.graph.defined(index).is_some(),
        )?;
        let terms = self.source.count("linear terms")?;
        self.source.index("the use of a defined variable")?;
        self.source.end_line()?;
        let linear = self.linear(terms)?;
        let start = self.graph.nodes().len();
        let mut expression = self.expression_from(start)?;
        let mut root = expression.root;
        for (variable, factor) in linear {
            let term = self.graph.push(Node::Scale(factor, variable));
            let sum = term.and_then(|term| self.graph.push(Node::Binary(Binary::Add, root, term)));
            root = sum.map_err(|e| self.too_large(e))?;
        }
        expression = self.graph.close(start, root);
        self.graph.define(index, expression);
        Ok(())
    }

    fn constraint(&mut self) -> Result<(), NlError> {
        let index = self.source.index_below("a constraint", self.header.rows)?;
        self.twice("constraint", index, self.rows[index].expression.is_some())?;
        self.rows[index].at = Some(self.source.position());
        self.source.end_line()?;
        self.rows[index].expression = Some(self.expression()?);
        Ok(())
    }

    /// Reads a logical constraint; the solver refuses problems that have any.
    fn logical(&mut self) -> Result<(), NlError> {
        self.source
            .index_below("a logical constraint", self.header.logical)?;
        self.source.end_line()?;
        self.expression()?;
        Ok(())
    }

    fn objective(&mut self) -> Result<(), NlError> {
        let index = self.source.index_below("an objective", self.header.objectives)?;
        self.twice("objective", index, self.seen_objectives[index][0])?;
        self.seen_objectives[index][0] = true;
        let sense = self.source.index("the sense of an objective")?;
        self.source.end_line()?;
        self.objectives[index].maximize = sense != 0;
        self.objectives[index].expression = self.expression()?;
        Ok(())
    }

    fn initial(&mut self, what: &'static str) -> Result<(), NlError> {
        let dual = what == "a dual value";
        let limit = if dual {
            self.header.rows
        } else {
            self.header.variables
        };
        let count = self
            .source
            .index_below("the number of initial values", limit + 1)?;
        self.source.end_line()?;
        for _ in 0..count {
            let index = self.source.index_below("the index of an initial value", limit)?;
            let value = self.finite(what)?;
            self.source.end_line()?;
            let values = if dual { &mut self.duals } else { &mut self.start };
            values[index] = value;
        }
        Ok(())
    }

    fn finite(&mut self, what: &'static str) -> Result<f64, NlError> {
        let value = self.source.number(what)?;
        match value.is_finite() {
            true => Ok(value),
            false => Err(self.source.out_of_range(what, value, "finite")),
        }
    }

    fn row_bounds(&mut self) -> Result<(), NlError> {
        self.twice("segment r", 0, self.kinds.is_some())?;
        self.source.end_line()?;
        let mut kinds = Vec::new();
        for _ in 0..self.header.rows {
            let kind = match self.source.tag()? {
                Some(b'5') => self.complementarity()?,
                tag => {
                    let (lower, upper) = self.bounds(tag)?;
                    RowKind::Range { lower, upper }
                }
            };
            self.source.end_line()?;
            kinds.push(kind);
        }
        self.kinds = Some(kinds);
        Ok(())
    }

    fn complementarity(&mut self) -> Result<RowKind, NlError> {
        // Bits other than those of the two bounds are used by AMPL only.
        let flags = self.source.integer("the bounds of a complementarity")?;
        let variable = self.source.index("the variable of a complementarity")?;
        match variable.checked_sub(1) {
            Some(index) if index < self.header.variables => Ok(RowKind::Complements {
                variable: index,
                lower: flags & 1 != 0,
                upper: flags & 2 != 0,
            }),
            _ => {
                let range = format_args!("from 1 to {}", self.header.variables).to_string();
                Err(self
                    .source
                    .out_of_range("the variable of a complementarity", variable, range))
            }
        }
    }

    fn variable_bounds(&mut self) -> Result<(), NlError> {
        self.twice("segment b", 0, self.bounded)?;
        self.bounded = true;
        self.source.end_line()?;
        for _ in 0..self.header.variables {
            let tag = self.source.tag()?;
            let (lower, upper) = self.bounds(tag)?;
            self.source.end_line()?;
            self.lower.push(lower);
            self.upper.push(upper);
        }
        Ok(())
    }

    /// Reads bounds; their kind has been read.
    fn bounds(&mut self, tag: Option<u8>) -> Result<(f64, f64), NlError> {
        let what = "a bound";
        let (lower, upper) = match tag {
            Some(b'0') => (self.source.number(what)?, self.source.number(what)?),
            Some(b'1') => (f64::NEG_INFINITY, self.source.number(what)?),
            Some(b'2') => (self.source.number(what)?, f64::INFINITY),
            Some(b'3') => (f64::NEG_INFINITY, f64::INFINITY),
            Some(b'4') => {
                let value = self.finite(what)?;
                (value, value)
            }
            Some(other) => {
                return Err(self.source.fail(Fault::Expected {
                    what: "the kind of a bound, from 0 to 4, for a constraint to 5",
                    found: format!("{:?}", char::from(other)),
                }));
            }
            None => return Err(self.source.fail(Fault::End { what })),
        };
        // In this form the test rejects NaN.
        if !(lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY) {
            let value = format_args!("[{lower}, {upper}]").to_string();
            return Err(self.source.out_of_range("an interval", value, "not empty"));
        }
        Ok((lower, upper))
    }

    fn column_counts(&mut self, cumulative: bool) -> Result<(), NlError> {
        self.twice("segment k", 0, self.columns.is_some())?;
        let expected = self.header.variables - 1;
        let count = self.source.index("the number of columns")?;
        let at = self.source.position();
        if count != expected {
            return Err(self.source.out_of_range("the number of columns", count, expected));
        }
        self.source.end_line()?;
        let mut columns = Vec::new();
        let mut before = 0;
        for _ in 0..count {
            let value = self.source.index("a column count")?;
            let own = match cumulative {
                true => value.checked_sub(before),
                false => Some(value),
            };
            let Some(own) = own else {
                let range = format_args!("at least {before}").to_string();
                return Err(self.source.out_of_range("a column count", value, range));
            };
            before = value;
            columns.push(own);
            self.source.end_line()?;
        }
        self.columns = Some((at, columns));
        Ok(())
    }

    fn jacobian(&mut self) -> Result<(), NlError> {
        let index = self.source.index_below("a constraint", self.header.rows)?;
        self.twice("J segment", index, self.rows[index].linear.is_some())?;
        let terms = self.source.count("linear terms")?;
        self.source.end_line()?;
        self.rows[index].linear = Some(self.linear(terms)?);
        Ok(())
    }

    fn gradient(&mut self) -> Result<(), NlError> {
        let index = self.source.index_below("an objective", self.header.objectives)?;
        self.twice("G segment", index, self.seen_objectives[index][1])?;
        self.seen_objectives[index][1] = true;
        let terms = self.source.count("linear terms")?;
        self.source.end_line()?;
        self.objectives[index].linear = self.linear(terms)?;
        Ok(())
    }

    fn linear(&mut self, terms: usize) -> Result<Linear, NlError> {
        self.parts += 1;
        let mut linear = Vec::new();
        for _ in 0..terms {
            let variable = self.source.index_below("a variable", self.header.variables)?;
            self.twice("variable", variable, self.listed[variable] == self.parts)?;
            self.listed[variable] = self.parts;
            linear.push((variable as u32, self.finite("a coefficient")?));
            self.source.end_line()?;
        }
        Ok(linear)
    }

    fn finish(self) -> Result<Parts, NlError> {
        if !self.bounded {
            return Err(self.source.fail(Fault::Missing('b')));
        }
        let kinds = match self.kinds {
            Some(kinds) => kinds,
            None if self.header.rows == 0 => Vec::new(),
            None => return Err(self.source.fail(Fault::Missing('r'))),
        };
        if self.seen_objectives.iter().any(|seen| !seen[0]) {
            return Err(self.source.fail(Fault::Missing('O')));
        }
        // A file truncated between two segments has too few entries.
        let rows = self.rows.iter().filter_map(|r| r.linear.as_ref());
        let objectives = self.objectives.iter().map(|o| &o.linear);
        for (segment, announced, found) in [
            ('J', self.header.nonzeros, rows.map(Vec::len).sum()),
            ('G', self.header.gradient, objectives.map(Vec::len).sum()),
        ] {
            if announced != found {
                return Err(self.source.fail(Fault::Entries {
                    segment,
                    announced,
                    found,
                }));
            }
        }
        if let Some((at, announced)) = &self.columns {
            let mut found = vec![0; self.header.variables];
            for (variable, _) in self.rows.iter().filter_map(|r| r.linear.as_ref()).flatten() {
                found[*variable as usize] += 1;
            }
            if let Some(column) = (0..announced.len()).find(|&j| announced[j] != found[j]) {
                return Err(NlError {
                    at: *at,
                    fault: Fault::Columns {
                        column,
                        announced: announced[column],
                        found: found[column],
                    },
                });
            }
        }
        let here = self.source.position();
        let rows = self.rows.into_iter().zip(kinds).map(|(draft, kind)| Row {
            expression: draft.expression,
            at: draft.at.unwrap_or(here),
            linear: draft.linear.unwrap_or_default(),
            kind,
        });
        Ok(Parts {
            rows: rows.collect(),
            lower: self.lower,
            upper: self.upper,
            objectives: self.objectives,
            start: self.start,
            duals: self.duals,
        })
    }
}

/// The parts of the model that have been read, other than header and graph.
pub(super) struct Parts {
    rows: Vec<Row>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    objectives: Vec<Objective>,
    start: Vec<f64>,
    duals: Vec<f64>,
}

impl Parts {
    pub(super) fn into_model(self, header: Header, graph: Graph) -> Model {
        Model {
            header,
            graph,
            rows: self.rows,
            lower: self.lower,
            upper: self.upper,
            objectives: self.objectives,
            start: self.start,
            duals: self.duals,
            names: Names::default(),
        }
    }
}
