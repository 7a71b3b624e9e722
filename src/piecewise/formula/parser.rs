//! Reads formulas as people type them.

use super::node::{Binary, Node, Page, Smooth};

/// Largest number of characters in an equation.
const LONGEST: usize = 400;
/// Largest depth of nested parentheses, signs and powers.
const DEEPEST: usize = 40;

/// What is wrong with one of several equations, and where: the characters from `from` to before `to` in UTF-16, as browsers count them.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct FormulaError {
    /// Number of the equation, from 0.
    pub equation: usize,
    /// What is wrong.
    pub message: String,
    /// The first character of the mistake.
    pub from: usize,
    /// The character after its last.
    pub to: usize,
}

/// A mistake, before it is known in which equation.
struct Mistake {
    message: String,
    from: usize,
    to: usize,
}

/// Reads `formula` or `left = right` in the given variables, onto a page.
pub(super) fn read(
    text: &str,
    equation: usize,
    names: Names<'_>,
    page: &Page,
) -> Result<usize, FormulaError> {
    equation_of(text, names, page).map_err(|Mistake { message, from, to }| FormulaError {
        equation,
        message,
        from,
        to,
    })
}

fn equation_of(text: &str, names: Names<'_>, page: &Page) -> Result<usize, Mistake> {
    let length = text.encode_utf16().count();
    if length > LONGEST {
        return Err(Mistake {
            message: format!("the equation has {length} characters; {LONGEST} are allowed"),
            from: LONGEST,
            to: length,
        });
    }
    let mut reader = Reader {
        tokens: tokens(text)?,
        next: 0,
        depth: 0,
        end: length,
        names,
        page,
    };
    let mut read = reader.sum()?;
    if reader.eat("=") {
        let right = reader.sum()?;
        read = page.add(Node::Two(Binary::Sub, [read, right]));
    }
    match reader.peek() {
        None => Ok(read),
        Some(t) if t.text == "=" => Err(t.mistake("an equation has one sign =")),
        Some(t) if t.text == ")" => Err(t.mistake("nothing was opened that this ) closes")),
        Some(t) if t.text == "," => Err(t.mistake("a comma belongs between the arguments of max or min")),
        Some(t) => Err(t.mistake(format!("an operator is missing before {}", t.text))),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Number,
    Name,
    Sign,
}

#[derive(Debug, Clone)]
struct Token {
    kind: Kind,
    text: String,
    from: usize,
    to: usize,
}

impl Token {
    fn mistake(&self, message: impl Into<String>) -> Mistake {
        Mistake {
            message: message.into(),
            from: self.from,
            to: self.to,
        }
    }
}

fn tokens(text: &str) -> Result<Vec<Token>, Mistake> {
    let characters: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let (mut k, mut at) = (0, 0);
    while k < characters.len() {
        let c = characters[k];
        let begun = k;
        let kind = if c.is_whitespace() {
            k += 1;
            at += c.len_utf16();
            continue;
        } else if c.is_ascii_digit() || c == '.' {
            k = end_of_number(&characters, k);
            Kind::Number
        } else if c.is_alphabetic() || c == '_' {
            while k < characters.len() && (characters[k].is_alphanumeric() || characters[k] == '_') {
                k += 1;
            }
            Kind::Name
        } else {
            k += 1;
            Kind::Sign
        };
        let read = &characters[begun..k];
        let from = at;
        at += read.iter().map(|c| c.len_utf16()).sum::<usize>();
        let mut token = Token {
            kind,
            text: read.iter().collect(),
            from,
            to: at,
        };
        if kind == Kind::Sign {
            token.text = match c {
                '−' | '–' => "-".to_owned(),
                '·' | '×' => "*".to_owned(),
                '+' | '-' | '*' | '/' | '^' | '(' | ')' | ',' | '=' => token.text,
                '|' => return Err(token.mistake("write abs(…) for an absolute value")),
                _ => return Err(token.mistake(format!("{c} has no meaning here"))),
            };
            let power = token.text == "*"
                && tokens
                    .last()
                    .is_some_and(|t: &Token| t.text == "*" && t.to == from);
            if power {
                tokens.pop();
                token.text = "^".to_owned();
                token.from -= 1;
            }
        }
        tokens.push(token);
    }
    Ok(tokens)
}

/// Digits, a point, and an exponent if there are digits in it.
fn end_of_number(characters: &[char], from: usize) -> usize {
    let digits = |mut k: usize| {
        while characters.get(k).is_some_and(char::is_ascii_digit) {
            k += 1;
        }
        k
    };
    let mut k = digits(from);
    if characters.get(k) == Some(&'.') {
        k = digits(k + 1);
    }
    if matches!(characters.get(k), Some('e' | 'E')) {
        let signed = matches!(characters.get(k + 1), Some('+' | '-'));
        let begin = k + 1 + usize::from(signed);
        let end = digits(begin);
        if end > begin {
            k = end;
        }
    }
    k
}

/// Names of variables, and of constants with their values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Names<'a> {
    pub(super) variables: &'a [&'a str],
    pub(super) constants: &'a [(&'a str, f64)],
}

struct Reader<'a> {
    tokens: Vec<Token>,
    next: usize,
    depth: usize,
    /// The position after the last character.
    end: usize,
    names: Names<'a>,
    page: &'a Page,
}

impl Reader<'_> {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.next)
    }

    fn eat(&mut self, sign: &str) -> bool {
        let found = self
            .peek()
            .is_some_and(|t| t.kind == Kind::Sign && t.text == sign);
        self.next += usize::from(found);
        found
    }

    fn missing(&self, what: &str) -> Mistake {
        match self.peek() {
            Some(t) => t.mistake(format!("{what} is expected before {}", t.text)),
            None => Mistake {
                message: format!("{what} is expected at the end"),
                from: self.end,
                to: self.end,
            },
        }
    }

    fn sum(&mut self) -> Result<usize, Mistake> {
        let mut sum = self.product()?;
        loop {
            let operator = match () {
                () if self.eat("+") => Binary::Add,
                () if self.eat("-") => Binary::Sub,
                () => return Ok(sum),
            };
            let next = self.product()?;
            sum = self.page.add(Node::Two(operator, [sum, next]));
        }
    }

    fn product(&mut self) -> Result<usize, Mistake> {
        let mut product = self.signed()?;
        loop {
            let operator = match () {
                () if self.eat("*") => Binary::Mul,
                () if self.eat("/") => Binary::Div,
                () => return Ok(product),
            };
            let next = self.signed()?;
            product = self.page.add(Node::Two(operator, [product, next]));
        }
    }

    /// All recursion goes through here, where its depth is limited.
    fn signed(&mut self) -> Result<usize, Mistake> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.missing("an end of parentheses and signs within each other"));
        }
        let signed = match () {
            () if self.eat("-") => {
                let inner = self.signed()?;
                self.page.add(Node::Neg([inner]))
            }
            () if self.eat("+") => self.signed()?,
            () => self.power()?,
        };
        self.depth -= 1;
        Ok(signed)
    }

    /// −x^2 is −(x^2), and x^−2^2 is x^(−(2^2)).
    fn power(&mut self) -> Result<usize, Mistake> {
        let base = self.atom()?;
        if !self.eat("^") {
            return Ok(base);
        }
        let begun = self.next;
        let exponent = self.signed()?;
        Ok(match self.page.constant(exponent) {
            Some(p) if p.fract() == 0.0 && p.abs() <= 100.0 => self.page.add(Node::Integer([base], p as i32)),
            Some(p) if p.is_finite() => self.page.add(Node::Power([base], p.to_bits())),
            _ => {
                let (from, to) = (self.tokens[begun].from, self.tokens[self.next - 1].to);
                let message = "an exponent is a number; write exp(b*ln(a)) for a^b".to_owned();
                return Err(Mistake { message, from, to });
            }
        })
    }

    fn atom(&mut self) -> Result<usize, Mistake> {
        let Some(token) = self.peek().cloned() else {
            return Err(self.missing("a number, a variable or a function"));
        };
        match token.kind {
            Kind::Number => {
                self.next += 1;
                let value = token.text.parse().ok().filter(|v: &f64| v.is_finite());
                let mistake = || token.mistake(format!("{} is no number", token.text));
                value.map(|v| self.page.number(v)).ok_or_else(mistake)
            }
            Kind::Name => {
                self.next += 1;
                self.named(&token)
            }
            Kind::Sign if self.eat("(") => {
                let inner = self.sum()?;
                self.close(&token)?;
                Ok(inner)
            }
            Kind::Sign => Err(self.missing("a number, a variable or a function")),
        }
    }

    fn close(&mut self, opened: &Token) -> Result<(), Mistake> {
        match self.eat(")") {
            true => Ok(()),
            false if self.peek().is_none() => Err(opened.mistake(format!("{} is not closed", opened.text))),
            false => Err(self.missing("an operator or )")),
        }
    }

    fn named(&mut self, token: &Token) -> Result<usize, Mistake> {
        let name = token.text.as_str();
        if let Some(k) = self.names.variables.iter().position(|&v| v == name) {
            return Ok(self.page.add(Node::Variable(k)));
        }
        if let Some(&(_, value)) = self.names.constants.iter().find(|c| c.0 == name) {
            let mistake = || token.mistake(format!("the constant {name} is {value}, which is not finite"));
            return value
                .is_finite()
                .then(|| self.page.number(value))
                .ok_or_else(mistake);
        }
        let smooth = match name {
            "pi" | "π" => return Ok(self.page.number(std::f64::consts::PI)),
            "max" | "min" | "abs" => return self.kink(token),
            "log" => Some(Smooth::Ln),
            _ => Smooth::ALL.iter().find(|f| f.0 == name).map(|f| f.1),
        };
        let Some(smooth) = smooth else {
            return Err(token.mistake(format!(
                "{name} is unknown; there are {}, pi, max, min, abs, {}",
                (self.names.variables.iter().copied())
                    .chain(self.names.constants.iter().map(|c| c.0))
                    .collect::<Vec<_>>()
                    .join(", "),
                Smooth::ALL.map(|f| f.0).join(", ")
            )));
        };
        let mut arguments = self.arguments(token)?;
        match (arguments.pop(), arguments.pop()) {
            (Some(one), None) => Ok(self.page.add(Node::Of(smooth, [one]))),
            _ => Err(token.mistake(format!("{name} takes one argument"))),
        }
    }

    fn arguments(&mut self, function: &Token) -> Result<Vec<usize>, Mistake> {
        let Some(opened) = self.peek().filter(|t| t.text == "(").cloned() else {
            return Err(function.mistake(format!("{} needs its arguments in parentheses", function.text)));
        };
        self.next += 1;
        let mut arguments = Vec::new();
        loop {
            arguments.push(self.sum()?);
            if !self.eat(",") {
                self.close(&opened)?;
                return Ok(arguments);
            }
        }
    }

    fn kink(&mut self, token: &Token) -> Result<usize, Mistake> {
        let name = token.text.as_str();
        let arguments = self.arguments(token)?;
        match (name, arguments.as_slice()) {
            ("abs", &[a]) => Ok(self.page.add(Node::Abs([a]))),
            ("abs", _) => Err(token.mistake("abs takes one argument")),
            (_, &[first, ref rest @ ..]) if !rest.is_empty() => {
                Ok(rest.iter().fold(first, |value, &next| {
                    self.page.add(match name {
                        "max" => Node::Max([value, next]),
                        _ => Node::Min([value, next]),
                    })
                }))
            }
            _ => Err(token.mistake(format!("{name} takes two arguments or more"))),
        }
    }
}
