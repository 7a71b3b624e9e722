//! Enough of `macro_rules` to see the items that macros of this crate write: several rules, any fragments and repetitions.

use std::collections::BTreeMap;
use std::rc::Rc;

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};
use quote::ToTokens;
use syn::parse::discouraged::Speculative;
use syn::parse::{ParseStream, Parser};

#[derive(Clone)]
enum Binding {
    One(TokenStream),
    Many(Rc<Vec<Bindings>>),
}
type Bindings = BTreeMap<String, Binding>;

enum Pattern {
    Token(String),
    Variable(String, String),
    Group(Delimiter, Vec<Pattern>),
    Repeat {
        inner: Vec<Pattern>,
        separator: Option<String>,
        once: bool,
    },
}

/// The expansion of the macro with the given rules (the body of its `macro_rules`) on `input`: by the first rule that matches it.
pub(crate) fn expand(rules: TokenStream, input: TokenStream) -> syn::Result<TokenStream> {
    let mut rules = rules.into_iter();
    let mut found = Err(syn::Error::new(proc_macro2::Span::call_site(), "not a rule"));
    // A rule is followed by a semicolon, which the last one may lack.
    while let (Some(TokenTree::Group(matcher)), _, _, Some(TokenTree::Group(body)), _) = (
        rules.next(),
        rules.next(),
        rules.next(),
        rules.next(),
        rules.next(),
    ) {
        let patterns = patterns(matcher.stream());
        let mut bindings = Bindings::new();
        found = (|input: ParseStream<'_>| matches(&patterns, input, &mut bindings))
            .parse2(input.clone())
            .map(|()| transcribe(body.stream(), &bindings));
        if found.is_ok() {
            break;
        }
    }
    found
}

fn is_punct(token: Option<&TokenTree>, c: char) -> bool {
    matches!(token, Some(TokenTree::Punct(p)) if p.as_char() == c)
}

/// Separator and operator of a repetition that begins after `$( … )`.
fn operator(tokens: &mut impl Iterator<Item = TokenTree>) -> (Option<TokenTree>, char) {
    let is_operator = |t: &TokenTree| match t {
        TokenTree::Punct(p) if "*+?".contains(p.as_char()) => Some(p.as_char()),
        _ => None,
    };
    let first = tokens.next().expect("a repetition has an operator");
    match is_operator(&first) {
        Some(c) => (None, c),
        None => {
            let next = tokens.next().expect("a repetition has an operator");
            (Some(first), is_operator(&next).expect("* or + or ?"))
        }
    }
}

fn patterns(stream: TokenStream) -> Vec<Pattern> {
    let mut tokens = stream.into_iter().peekable();
    let mut out = Vec::new();
    while let Some(token) = tokens.next() {
        out.push(match token {
            TokenTree::Punct(p) if p.as_char() == '$' => match tokens.next() {
                Some(TokenTree::Group(group)) => {
                    let (separator, c) = operator(&mut tokens);
                    Pattern::Repeat {
                        inner: patterns(group.stream()),
                        separator: separator.map(|s| s.to_string()),
                        once: c == '?',
                    }
                }
                name => {
                    assert!(is_punct(tokens.next().as_ref(), ':'), "a variable has a kind");
                    let kind = tokens.next().expect("a variable has a kind");
                    Pattern::Variable(name.expect("a variable").to_string(), kind.to_string())
                }
            },
            TokenTree::Group(group) => Pattern::Group(group.delimiter(), patterns(group.stream())),
            other => Pattern::Token(other.to_string()),
        });
    }
    out
}

fn names(patterns: &[Pattern], out: &mut Vec<String>) {
    for pattern in patterns {
        match pattern {
            Pattern::Token(_) => {}
            Pattern::Variable(name, _) => out.push(name.clone()),
            Pattern::Group(_, inner) | Pattern::Repeat { inner, .. } => names(inner, out),
        }
    }
}

fn matches(patterns: &[Pattern], input: ParseStream<'_>, bindings: &mut Bindings) -> syn::Result<()> {
    for pattern in patterns {
        match pattern {
            Pattern::Token(wanted) => {
                let found: TokenTree = input.parse()?;
                if found.to_string() != *wanted {
                    return Err(input.error(format!("expected {wanted}")));
                }
            }
            Pattern::Variable(name, kind) => {
                let tokens = match kind.as_str() {
                    "ident" => input.parse::<syn::Ident>()?.into_token_stream(),
                    "ty" => input.parse::<syn::Type>()?.into_token_stream(),
                    "expr" => input.parse::<syn::Expr>()?.into_token_stream(),
                    "meta" => input.parse::<syn::Meta>()?.into_token_stream(),
                    "tt" => input.parse::<TokenTree>()?.into_token_stream(),
                    "literal" => input.parse::<syn::Lit>()?.into_token_stream(),
                    other => panic!("add {other} to the expansion of macros"),
                };
                bindings.insert(name.clone(), Binding::One(tokens));
            }
            Pattern::Group(delimiter, inner) => {
                let TokenTree::Group(group) = input.parse()? else {
                    return Err(input.error("expected brackets"));
                };
                if group.delimiter() != *delimiter {
                    return Err(input.error("other brackets"));
                }
                (|stream: ParseStream<'_>| matches(inner, stream, bindings)).parse2(group.stream())?;
            }
            Pattern::Repeat {
                inner,
                separator,
                once,
            } => {
                let mut found = Vec::new();
                while !(input.is_empty() || *once && found.len() == 1) {
                    let fork = input.fork();
                    if let (Some(separator), false) = (separator, found.is_empty()) {
                        let between: TokenTree = fork.parse()?;
                        if between.to_string() != *separator {
                            break;
                        }
                    }
                    let mut one = Bindings::new();
                    if matches(inner, &fork, &mut one).is_err() {
                        break;
                    }
                    input.advance_to(&fork);
                    found.push(one);
                }
                let found = Rc::new(found);
                let mut inside = Vec::new();
                names(inner, &mut inside);
                for name in inside {
                    bindings.insert(name, Binding::Many(Rc::clone(&found)));
                }
            }
        }
    }
    Ok(())
}

fn transcribe(stream: TokenStream, bindings: &Bindings) -> TokenStream {
    let mut tokens = stream.into_iter().peekable();
    let mut out = TokenStream::new();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Punct(p) if p.as_char() == '$' => match tokens.next() {
                Some(TokenTree::Group(group)) => {
                    let (separator, _) = operator(&mut tokens);
                    for (i, one) in repeated(&group.stream(), bindings).iter().enumerate() {
                        if let (Some(separator), true) = (&separator, i > 0) {
                            out.extend([separator.clone()]);
                        }
                        let mut inner = bindings.clone();
                        inner.extend(one.iter().map(|(k, v)| (k.clone(), v.clone())));
                        out.extend(transcribe(group.stream(), &inner));
                    }
                }
                Some(name) => match bindings.get(&name.to_string()) {
                    Some(Binding::One(tokens)) => out.extend(tokens.clone()),
                    None if name.to_string() == "crate" => out.extend([name]),
                    _ => panic!("{name} is not bound here"),
                },
                None => {}
            },
            TokenTree::Group(group) => {
                let inner = transcribe(group.stream(), bindings);
                out.extend([TokenTree::Group(Group::new(group.delimiter(), inner))]);
            }
            other => out.extend([other]),
        }
    }
    out
}

/// The repetitions of the variables in `body`.
fn repeated(body: &TokenStream, bindings: &Bindings) -> Vec<Bindings> {
    fn find(body: TokenStream, bindings: &Bindings) -> Option<Rc<Vec<Bindings>>> {
        body.into_iter().find_map(|token| match token {
            TokenTree::Group(group) => find(group.stream(), bindings),
            TokenTree::Ident(name) => match bindings.get(&name.to_string()) {
                Some(Binding::Many(all)) => Some(Rc::clone(all)),
                _ => None,
            },
            _ => None,
        })
    }
    find(body.clone(), bindings).map_or(Vec::new(), |all| all.to_vec())
}
