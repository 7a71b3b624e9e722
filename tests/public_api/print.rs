//! Tokens as a person would write them.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};
use quote::ToTokens;

pub(crate) fn text(tokens: &impl ToTokens) -> String {
    let mut words = Vec::new();
    collect(tokens.to_token_stream(), &mut words);
    let mut out = String::new();
    for (i, word) in words.iter().enumerate() {
        if i > 0 && spaced(&words[i - 1], word, i.checked_sub(2).map(|k| words[k].as_str())) {
            out.push(' ');
        }
        out.push_str(word);
    }
    out.replace(",)", ")").replace(", }", " }")
}

fn collect(stream: TokenStream, words: &mut Vec<String>) {
    let mut joint = false;
    for token in stream {
        match token {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::None => ("", ""),
                };
                words.push(open.to_owned());
                collect(group.stream(), words);
                words.push(close.to_owned());
                words.retain(|w| !w.is_empty());
                joint = false;
            }
            TokenTree::Punct(punct) => {
                let c = punct.as_char();
                match words.last_mut() {
                    Some(last)
                        if joint && !(matches!(c, '>' | '<' | '&' | '\'') && last != "-" && last != "=") =>
                    {
                        last.push(c)
                    }
                    _ => words.push(c.to_string()),
                }
                joint = punct.spacing() == Spacing::Joint;
            }
            other => {
                match words.last_mut() {
                    Some(last) if last == "'" => last.push_str(&other.to_string()),
                    _ => words.push(other.to_string()),
                }
                joint = false;
            }
        }
    }
}

fn spaced(before: &str, word: &str, earlier: Option<&str>) -> bool {
    let name = |w: &str| w.chars().all(|c| c.is_alphanumeric() || c == '_');
    let keyword = matches!(
        before,
        "dyn"
            | "impl"
            | "mut"
            | "for"
            | "where"
            | "fn"
            | "const"
            | "in"
            | "as"
            | "pub"
            | "struct"
            | "enum"
            | "trait"
    );
    match (before, word) {
        (_, "," | ";" | ":" | "." | "?" | ")" | "]" | ">" | "::") => {
            before == "->" || (word == "?" && (before == "+" || before == ":"))
        }
        ("(" | "[" | "&" | "::" | "<" | "." | "#" | "!" | "?", _) => false,
        ("*", _) => false,
        ("impl" | "for", "<") => false,
        (_, "<") => before == "->" || before == "+",
        (">", "(") => false,
        (_, "(" | "[") => keyword || !name(before) && before != "'",
        (_, "!") => false,
        ("+", _) if earlier.is_none() => true,
        _ => true,
    }
}
