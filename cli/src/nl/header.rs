//! The ten header lines of a file, which are text in binary files, too.

use super::{Fault, NlError, Source, Text};

/// The contents of the header.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Header {
    /// Whether what follows is binary.
    pub binary: bool,
    /// Whether numbers of a binary file have their highest byte first.
    pub big_endian: bool,
    /// Option values of the first line, to be repeated in the .sol file.
    pub options: Vec<i32>,
    /// Tolerance of the first line, to be repeated there, too.
    pub tolerance: Option<f64>,
    /// Number of variables.
    pub variables: usize,
    /// Number of algebraic constraints.
    pub rows: usize,
    /// Number of objectives.
    pub objectives: usize,
    /// Number of logical constraints.
    pub logical: usize,
    /// Number of imported functions.
    pub functions: usize,
    /// Number of binary and integer variables.
    pub integers: usize,
    /// Nonzeros of the Jacobian.
    pub nonzeros: usize,
    /// Nonzeros of the gradients of all objectives.
    pub gradient: usize,
    /// Number of defined variables.
    pub defined: usize,
}

/// Largest number of options on the first line.
const MAX_OPTIONS: usize = 9;

impl Header {
    /// Reads the header, and leaves `text` at the first token after it.
    ///
    /// # Errors
    /// An invalid header, or one that announces more than the file can hold.
    pub fn read(text: &mut Text<'_>) -> Result<Self, NlError> {
        let mut header = Self::default();
        header.first_line(text)?;

        header.variables = text.count("variables")?;
        header.rows = text.count("constraints")?;
        header.objectives = text.count("objectives")?;
        text.optional_index("the number of ranges")?;
        text.optional_index("the number of equations")?;
        header.logical = text.optional_index("the number of logical constraints")?;
        header.logical = text.can_hold(header.logical, "logical constraints")?;
        text.skip_line()?;
        if header.variables == 0 {
            return Err(text.out_of_range("the number of variables", 0, "at least 1"));
        }
        // Numbers of nonlinear rows and objectives, complementarities, network rows, nonlinear variables: the segments give them.
        for _ in 0..3 {
            text.index("a count of the header")?;
            text.index("a count of the header")?;
            text.skip_line()?;
        }
        text.index("the number of network variables")?;
        header.functions = text.count("functions")?;
        let arithmetic = text.optional_index("the kind of arithmetic")?;
        header.big_endian = arithmetic == 2;
        if header.binary && arithmetic > 2 {
            return Err(text.fail(Fault::Arithmetic(arithmetic)));
        }
        text.skip_line()?;
        for _ in 0..5 {
            header.integers = header
                .integers
                .saturating_add(text.optional_index("a count of integer variables")?);
        }
        text.skip_line()?;
        header.nonzeros = text.count("entries of the Jacobian")?;
        header.gradient = text.count("entries of gradients")?;
        text.skip_line()?;
        text.skip_line()?;
        for _ in 0..5 {
            header.defined = header
                .defined
                .saturating_add(text.optional_index("a count of defined variables")?);
        }
        header.defined = text.can_hold(header.defined, "defined variables")?;
        text.skip_line()?;
        Ok(header)
    }

    fn first_line(&mut self, text: &mut Text<'_>) -> Result<(), NlError> {
        self.binary = match text.tag()? {
            Some(b'g') => false,
            Some(b'b') => true,
            Some(other) => {
                return Err(text.fail(Fault::Expected {
                    what: "g (text) or b (binary), with which .nl files begin",
                    found: format!("{:?}", char::from(other)),
                }));
            }
            None => return Err(text.fail(Fault::End { what: "a header" })),
        };
        let number = text.optional_index("the number of options")?;
        if number > MAX_OPTIONS {
            return Err(text.out_of_range("the number of options", number, "at most 9"));
        }
        for _ in 0..number {
            self.options.push(text.integer("an option of the first line")?);
        }
        if self.options.get(1) == Some(&3) {
            self.tolerance = text.optional()?;
        }
        text.skip_line()
    }
}
