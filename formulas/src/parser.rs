//! Reads formulas as people type them.

use crate::expression::{Expression, Operator, Smooth};

/// Largest number of characters in an equation.
const LONGEST: usize = 400;
/// Largest depth of nested parentheses, signs and powers.
const DEEPEST: usize = 40;

/// What is wrong with a formula, and where: the characters from `from` to before `to` in UTF-16, as browsers count them.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Mistake {
    /// What is wrong.
    pub message: String,
    /// The first character of the mistake.
    pub from: usize,
    /// The character after its last.
    pub to: usize,
}

/// A site of a formula, as text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Site {
    /// The pieces, in the order of the library.
    pub pieces: [String; 2],
}

/// An equation, expression = 0, with its sites in the order in which they are evaluated.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Equation {
    pub(crate) expression: Expression,
    pub(crate) sites: Vec<Site>,
}

/// Reads `formula` or `left = right` in the given variables.
pub(crate) fn read(text: &str, variables: &[(&str, usize)]) -> Result<Equation, Mistake> {
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
        variables,
        sites: Vec::new(),
    };
    let mut expression = reader.sum()?;
    if reader.eat("=") {
        let right = reader.sum()?;
        expression = two(Operator::Minus, expression, right);
    }
    match reader.peek() {
        None => Ok(Equation {
            expression,
            sites: reader.sites,
        }),
        Some(t) if t.text == "=" => Err(t.mistake("an equation has one sign =")),
        Some(t) if t.text == ")" => Err(t.mistake("nothing was opened that this ) closes")),
        Some(t) if t.text == "," => Err(t.mistake("a comma belongs between the arguments of max or min")),
        Some(t) => Err(t.mistake(format!("an operator is missing before {}", t.text))),
    }
}

fn two(operator: Operator, a: Expression, b: Expression) -> Expression {
    Expression::Two(operator, Box::new(a), Box::new(b))
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

struct Reader<'a> {
    tokens: Vec<Token>,
    next: usize,
    depth: usize,
    /// The position after the last character.
    end: usize,
    variables: &'a [(&'a str, usize)],
    sites: Vec<Site>,
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

    /// The text read since a token.
    fn words(&self, since: usize) -> String {
        let mut words = String::new();
        for t in &self.tokens[since..self.next] {
            let spaced = t.kind == Kind::Sign && matches!(t.text.as_str(), "+" | "-") && !words.is_empty();
            match spaced && !words.ends_with('(') {
                true => words.push_str(&format!(" {} ", t.text)),
                false => words.push_str(&t.text),
            }
        }
        words.replace('-', "−")
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

    fn sum(&mut self) -> Result<Expression, Mistake> {
        let mut sum = self.product()?;
        loop {
            let operator = match () {
                () if self.eat("+") => Operator::Plus,
                () if self.eat("-") => Operator::Minus,
                () => return Ok(sum),
            };
            sum = two(operator, sum, self.product()?);
        }
    }

    fn product(&mut self) -> Result<Expression, Mistake> {
        let mut product = self.signed()?;
        loop {
            let operator = match () {
                () if self.eat("*") => Operator::Times,
                () if self.eat("/") => Operator::Over,
                () => return Ok(product),
            };
            product = two(operator, product, self.signed()?);
        }
    }

    /// All recursion goes through here, where its depth is limited.
    fn signed(&mut self) -> Result<Expression, Mistake> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.missing("an end of parentheses and signs within each other"));
        }
        let signed = match () {
            () if self.eat("-") => Expression::Negative(Box::new(self.signed()?)),
            () if self.eat("+") => self.signed()?,
            () => self.power()?,
        };
        self.depth -= 1;
        Ok(signed)
    }

    /// −x^2 is −(x^2), and x^−2^2 is x^(−(2^2)).
    fn power(&mut self) -> Result<Expression, Mistake> {
        let base = self.atom()?;
        if !self.eat("^") {
            return Ok(base);
        }
        let begun = self.next;
        let exponent = self.signed()?;
        Ok(match number(&exponent) {
            Some(p) if p.fract() == 0.0 && p.abs() <= 100.0 => Expression::Whole(Box::new(base), p as i32),
            Some(p) if p.is_finite() => Expression::Power(Box::new(base), p),
            _ => {
                let (from, to) = (self.tokens[begun].from, self.tokens[self.next - 1].to);
                let message = "an exponent is a number; write exp(b*ln(a)) for a^b".to_owned();
                return Err(Mistake { message, from, to });
            }
        })
    }

    fn atom(&mut self) -> Result<Expression, Mistake> {
        let Some(token) = self.peek().cloned() else {
            return Err(self.missing("a number, a variable or a function"));
        };
        match token.kind {
            Kind::Number => {
                self.next += 1;
                let value = token.text.parse().ok().filter(|v: &f64| v.is_finite());
                let mistake = || token.mistake(format!("{} is no number", token.text));
                value.map(Expression::Number).ok_or_else(mistake)
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

    fn named(&mut self, token: &Token) -> Result<Expression, Mistake> {
        let name = token.text.as_str();
        if let Some((_, k)) = self.variables.iter().find(|v| v.0 == name) {
            return Ok(Expression::Variable(*k));
        }
        let smooth = match name {
            "pi" | "π" => return Ok(Expression::Number(std::f64::consts::PI)),
            "max" | "min" | "abs" => return self.kink(token),
            "sqrt" => Smooth::Sqrt,
            "exp" => Smooth::Exp,
            "ln" | "log" => Smooth::Ln,
            "sin" => Smooth::Sin,
            "cos" => Smooth::Cos,
            "tan" => Smooth::Tan,
            "atan" => Smooth::Atan,
            "sinh" => Smooth::Sinh,
            "cosh" => Smooth::Cosh,
            "tanh" => Smooth::Tanh,
            _ => {
                let names: Vec<&str> = self.variables.iter().map(|v| v.0).collect();
                return Err(token.mistake(format!(
                    "{name} is unknown; there are {}, pi, max, min, abs, sqrt, exp, ln, sin, cos, tan, atan, sinh, cosh, tanh",
                    names.join(", ")
                )));
            }
        };
        let (mut arguments, _) = self.arguments(token)?;
        match (arguments.pop(), arguments.pop()) {
            (Some(one), None) => Ok(Expression::Of(smooth, Box::new(one))),
            _ => Err(token.mistake(format!("{name} takes one argument"))),
        }
    }

    /// The arguments of a function, with their text.
    fn arguments(&mut self, function: &Token) -> Result<(Vec<Expression>, Vec<String>), Mistake> {
        let Some(opened) = self.peek().filter(|t| t.text == "(").cloned() else {
            return Err(function.mistake(format!("{} needs its arguments in parentheses", function.text)));
        };
        self.next += 1;
        let (mut arguments, mut words) = (Vec::new(), Vec::new());
        loop {
            let begun = self.next;
            arguments.push(self.sum()?);
            words.push(self.words(begun));
            if !self.eat(",") {
                self.close(&opened)?;
                return Ok((arguments, words));
            }
        }
    }

    fn kink(&mut self, token: &Token) -> Result<Expression, Mistake> {
        let name = token.text.as_str();
        let (arguments, words) = self.arguments(token)?;
        let mut rest = arguments.into_iter().zip(words);
        let first = rest.next();
        let (Some((mut value, mut said)), is_abs) = (first, name == "abs") else {
            return Err(token.mistake(format!("{name} needs an argument")));
        };
        match (is_abs, rest.len()) {
            (true, 0) => {
                let pieces = [format!("{said} ≥ 0"), format!("{said} ≤ 0")];
                self.sites.push(Site { pieces });
                return Ok(Expression::Abs(Box::new(value)));
            }
            (true, _) => return Err(token.mistake("abs takes one argument")),
            (false, 0) => return Err(token.mistake(format!("{name} takes two arguments or more"))),
            (false, _) => {}
        }
        for (next, words) in rest {
            let pieces = [said.clone(), words.clone()];
            self.sites.push(Site { pieces });
            said = format!("{name}({said}, {words})");
            let (a, b) = (Box::new(value), Box::new(next));
            value = match name {
                "max" => Expression::Max(a, b),
                _ => Expression::Min(a, b),
            };
        }
        Ok(value)
    }
}

/// The value of a constant expression; exponents must be constant.
fn number(expression: &Expression) -> Option<f64> {
    match expression {
        Expression::Number(v) => Some(*v),
        Expression::Negative(a) => number(a).map(|v| -v),
        Expression::Two(operator, a, b) => {
            let (a, b) = (number(a)?, number(b)?);
            Some(match operator {
                Operator::Plus => a + b,
                Operator::Minus => a - b,
                Operator::Times => a * b,
                Operator::Over => a / b,
            })
        }
        Expression::Whole(a, n) => number(a).map(|v| v.powi(*n)),
        Expression::Power(a, p) => number(a).map(|v| v.powf(*p)),
        _ => None,
    }
}
