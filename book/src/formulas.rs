//! Formulas, $…$ and $$…$$ in the text, become MathML: browsers show it without scripts, fonts or a network.

use pulldown_latex::config::DisplayMode;
use pulldown_latex::{Parser, RenderConfig, Storage, push_mathml};
use serde_json::Value;

use crate::Outcome;

/// mdBook's protocol: [context, book] comes in, the book goes out.
///
/// # Errors
/// Messages that are not mdBook's, formulas that are not understood.
pub fn typeset_book(message: &str) -> Outcome<String> {
    let mut message: Value = serde_json::from_str(message)?;
    let book = message
        .get_mut(1)
        .ok_or("mdBook gives a context and a book")?;
    chapters(book)?;
    Ok(book.to_string())
}

/// Chapters are nested, under keys that differ between versions of mdBook; each has its text in `content`.
fn chapters(value: &mut Value) -> Outcome<()> {
    match value {
        Value::Array(list) => list.iter_mut().try_for_each(chapters),
        Value::Object(fields) => {
            for (name, value) in fields.iter_mut() {
                match value {
                    Value::String(text) if name == "content" => {
                        *text = typeset(text)?
                    }
                    other => chapters(other)?,
                }
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

/// A chapter with its formulas typeset; code stays as it is.
///
/// # Errors
/// Formulas that are not understood or not closed.
pub fn typeset(text: &str) -> Outcome<String> {
    let mut out = String::with_capacity(2 * text.len());
    let mut prose = String::new();
    let mut fence = None;
    for line in text.split_inclusive('\n') {
        let mark = line.trim_start().chars().take_while(|c| *c == '`').count();
        match fence {
            None if mark >= 3 => {
                out.push_str(&typeset_prose(&prose)?);
                prose.clear();
                fence = Some(mark);
                out.push_str(line);
            }
            None => prose.push_str(line),
            Some(opened) => {
                if mark >= opened {
                    fence = None;
                }
                out.push_str(line);
            }
        }
    }
    out.push_str(&typeset_prose(&prose)?);
    Ok(out)
}

/// Text without blocks of code; `code in a line` stays as it is, \$ is a dollar.
fn typeset_prose(mut rest: &str) -> Outcome<String> {
    let mut out = String::new();
    while let Some(at) = rest.find(['`', '$', '\\']) {
        let (before, from) = rest.split_at(at);
        out.push_str(before);
        let end_of = |open: &str| {
            let end = from[open.len()..].find(open).map(|end| end + open.len());
            end.ok_or_else(|| {
                let start: String = from.chars().take(60).collect();
                format!("{open} is not closed: {start}")
            })
        };
        if from.starts_with("$$") {
            let end = end_of("$$")?;
            out.push_str(&mathml(&from[2..end], DisplayMode::Block)?);
            rest = &from[end + 2..];
        } else if from.starts_with('$') {
            let end = end_of("$")?;
            out.push_str(&mathml(&from[1..end], DisplayMode::Inline)?);
            rest = &from[end + 1..];
        } else if from.starts_with('`') {
            let end = end_of("`")?;
            out.push_str(&from[..=end]);
            rest = &from[end + 1..];
        } else {
            let length = 1 + from[1..].chars().next().map_or(0, char::len_utf8);
            out.push_str(&from[..length]);
            rest = &from[length..];
        }
    }
    out.push_str(rest);
    Ok(out)
}

fn mathml(formula: &str, display_mode: DisplayMode) -> Outcome<String> {
    let storage = Storage::new();
    let events: Result<Vec<_>, _> = Parser::new(formula, &storage).collect();
    let events = events.map_err(|e| format!("{formula}: {e}"))?;
    let config = RenderConfig {
        display_mode,
        ..RenderConfig::default()
    };
    let mut out = String::new();
    let whole = events.into_iter().map(Ok::<_, std::convert::Infallible>);
    push_mathml(&mut out, whole, config)?;
    Ok(protect(&out))
}

/// Escapes what Markdown would interpret within a formula: its special characters, ends of lines and of table cells.
fn protect(mathml: &str) -> String {
    let mut out = String::with_capacity(mathml.len());
    let mut inside_tag = false;
    for c in mathml.chars() {
        match c {
            '<' => inside_tag = true,
            '>' => inside_tag = false,
            _ => {}
        }
        match c {
            '\n' => out.push(' '),
            '*' | '_' | '|' | '[' | ']' | '\\' | '`' | '~' if !inside_tag => {
                out.push_str(&format!("&#{};", u32::from(c)))
            }
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{typeset, typeset_book};

    #[test]
    fn formulas_are_typeset_and_code_is_left_alone() {
        let text = "a $x^2$ `$y$`\n```sh\necho $HOME $$\n```\n$$\\begin{cases}1\\\\2\\end{cases}$$\n";
        let out = typeset(text).unwrap();
        assert!(
            out.contains("<msup>")
                && out.contains("`$y$`")
                && out.contains("echo $HOME $$\n")
        );
        assert!(out.contains("display=\"block\"") && !out.contains("begin"));
    }

    #[test]
    fn signs_of_markdown_in_formulas_are_hidden() {
        let out = typeset("$|a| * [b]$").unwrap();
        assert!(!out.contains(['|', '*', '[']), "{out}");
    }

    #[test]
    fn wrong_formulas_are_refused() {
        assert!(typeset("an open $x").is_err());
        assert!(typeset("$\\frac{1$").is_err());
    }

    #[test]
    fn chapters_in_chapters_are_found() {
        let chapter = |inner: &str| {
            format!(
                r#"{{"Chapter":{{"name":"$n$","content":"$x$","sub_items":[{inner}]}}}}"#
            )
        };
        let message = format!(
            r#"[{{"root":"."}},{{"items":[{}]}}]"#,
            chapter(&chapter(""))
        );
        let out = typeset_book(&message).unwrap();
        assert_eq!(out.matches("<math").count(), 2);
        assert_eq!(out.matches("\"$n$\"").count(), 2);
    }
}
