//! The pages of the guide, which belongs to the reference documentation of the crate, as pages of the book: without the lines that only
//! tests need, and with links to each other and to lessons in place of those to items of the reference, which are named instead.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::Outcome;
use crate::compare::difference;

/// Writes the pages, or says which differ from those that there are.
///
/// # Errors
/// Pages that cannot be read or written.
pub(crate) fn pages(
    guide: &Path,
    folder: &Path,
    writes: bool,
) -> Outcome<Vec<String>> {
    let mut wrong = Vec::new();
    if writes {
        fs::create_dir_all(folder)?;
    }
    let mut sources = Vec::new();
    for entry in fs::read_dir(guide)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name == "mod.rs" || name.ends_with(".md") {
            sources.push(name);
        }
    }
    sources.sort();
    for name in sources {
        let text = fs::read_to_string(guide.join(&name))?;
        let (file, text) = match name.as_str() {
            "mod.rs" => ("README.md".to_owned(), documentation(&text)),
            _ => (name, text),
        };
        let fresh = page(&text);
        let path = folder.join(&file);
        if writes {
            fs::write(&path, &fresh)?;
        }
        let known = fs::read_to_string(&path).unwrap_or_default();
        if let Some(what) = difference(&file, &known, &fresh) {
            wrong.push(format!("guide/{file}: {what}"));
        }
    }
    Ok(wrong)
}

/// The documentation of a module, with a title.
fn documentation(module: &str) -> String {
    let lines = module.lines().map_while(|line| line.strip_prefix("//!"));
    let (mut text, mut code) = (Vec::new(), false);
    for line in lines {
        let line = line.strip_prefix(' ').unwrap_or(line);
        code ^= line.starts_with("```");
        // Its headings are below the title.
        let below = !code && line.starts_with("# ");
        text.push(format!("{}{line}", if below { "#" } else { "" }));
    }
    format!("# The guide\n\n{}\n", text.join("\n"))
}

/// A page as any renderer of Markdown shows it.
fn page(text: &str) -> String {
    let mut targets = BTreeMap::new();
    for line in text.lines() {
        if let Some((name, target)) = definition(line) {
            targets.insert(name, target);
        }
    }
    let mut fresh = String::with_capacity(text.len());
    let mut lines = text.lines();
    let mut prose = String::new();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            fresh += &linked(&std::mem::take(&mut prose), &targets);
            let body: Vec<&str> =
                lines.by_ref().take_while(|l| *l != "```").collect();
            // Blocks without a language are Rust in documentation, tests of which may not be run.
            let language = language.split(',').next().unwrap_or("");
            match ["", "rust", "no_run"].contains(&language) {
                true => fresh += &format!("```rust\n{}```\n", program(&body)),
                false => {
                    fresh += &format!("```{language}\n{}\n```\n", body.join("\n"))
                }
            }
        } else if definition(line).is_none() {
            // What was left out leaves no empty lines one after another.
            if !(line.is_empty() && prose.ends_with("\n\n")) {
                prose += line;
                prose.push('\n');
            }
        }
    }
    fresh += &linked(&prose, &targets);
    let mut fresh = fresh.trim_end().to_owned();
    fresh.push('\n');
    fresh
}

/// The program of a test in documentation, which has lines that are not shown and no `main`.
fn program(body: &[&str]) -> String {
    let is_hidden = |line: &&&str| {
        line.trim_start() == "#" || line.trim_start().starts_with("# ")
    };
    let shown: Vec<&str> = body.iter().filter(|l| !is_hidden(l)).copied().collect();
    let mut text = String::new();
    if shown.iter().any(|l| l.contains("fn main()")) {
        for line in shown {
            text += line;
            text.push('\n');
        }
        return text;
    }
    let fails = body.iter().any(|l| l.starts_with("# Ok::<"));
    text += match fails {
        true => "fn main() -> Result<(), Box<dyn std::error::Error>> {\n",
        false => "fn main() {\n",
    };
    for line in shown {
        if !line.is_empty() {
            text += "    ";
        }
        text += line;
        text.push('\n');
    }
    if fails {
        text += "    Ok(())\n";
    }
    text + "}\n"
}

/// The name and the target of a link that is defined in a line of its own.
fn definition(line: &str) -> Option<(&str, &str)> {
    let (name, target) = line.strip_prefix('[')?.split_once("]: ")?;
    (!target.contains(' ')).then_some((name, target))
}

/// A text with the links that lead somewhere outside of the reference.
fn linked(text: &str, targets: &BTreeMap<&str, &str>) -> String {
    let mut fresh = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(open) = rest.find('[') {
        fresh += &rest[..open];
        rest = &rest[open..];
        let Some(close) = rest.find(']') else { break };
        let (text, after) = (&rest[1..close], &rest[close + 1..]);
        // [text](target), [text][name], or [name] alone.
        let (target, length) =
            if let Some(target) = after.strip_prefix('(').and_then(closed) {
                (Some(target), target.len() + 2)
            } else if let Some((name, _)) =
                after.strip_prefix('[').and_then(|a| a.split_once(']'))
            {
                (targets.get(name).copied(), name.len() + 2)
            } else {
                (targets.get(text).copied(), 0)
            };
        let Some(target) = target else {
            fresh.push('[');
            rest = &rest[1..];
            continue;
        };
        fresh += &leading(text, target);
        rest = &after[length..];
    }
    fresh + rest
}

/// What is before the parenthesis that closes one already open.
fn closed(text: &str) -> Option<&str> {
    let mut depth = 1;
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Some(&text[..at]);
        }
    }
    None
}

/// A link to a target of the reference, where it is in the book.
fn leading(text: &str, target: &str) -> String {
    if let Some((_, lesson)) = target.split_once("../book/") {
        let page = match lesson.strip_suffix(".html") {
            Some("index") => "README.md".to_owned(),
            Some(page) => format!("{page}.md"),
            None => lesson.to_owned(),
        };
        return format!("[{text}](../{page})");
    }
    if let Some(page) = target.strip_prefix("crate::guide::") {
        return format!("[{text}]({page}.md)");
    }
    if let Some(item) = target.strip_prefix("crate::") {
        // A word in the text, and where it leads.
        let item = item.trim_end_matches("()");
        return match text.starts_with('`') {
            true => text.to_owned(),
            false => format!("{text} (`{item}`)"),
        };
    }
    match target.chars().all(|c| c.is_ascii_lowercase() || c == '_') {
        // From the index of the guide to its pages.
        true => format!("[{text}]({target}.md)"),
        false => format!("[{text}]({target})"),
    }
}

#[cfg(test)]
mod tests {
    use super::{documentation, page};

    #[test]
    fn programs_are_whole_and_lines_for_tests_are_left_out() {
        let text = "a\n\n```\n# #[cfg(x)] {\nlet x = f()?;\n\n#[derive(Debug)]\n# }\n# Ok::<(), E>(())\n```\n```text\n# shown\n```\n";
        assert_eq!(
            page(text),
            "a\n\n```rust\nfn main() -> Result<(), Box<dyn std::error::Error>> {\n    let x = f()?;\n\n    #[derive(Debug)]\n    \
             Ok(())\n}\n```\n```text\n# shown\n```\n"
        );
        let own = "```rust\nfn main() {\n    f();\n}\n```\n";
        assert_eq!(page(own), own);
    }

    #[test]
    fn links_lead_to_pages_and_items_are_named() {
        let text = "See [`f`](crate::a::f()), [kinds](crate::a::Kind), [next](crate::guide::solve), [`N`], [`k`][k1], [w](https://x.y) and \
                    v[0] [x].\n[lesson](../../../../book/01-kinks/lesson.html) in [the book](../../../book/index.html)\n\n\
                    [k1]: crate::b::k\n[`N`]: crate::b::N\n";
        assert_eq!(
            page(text),
            "See `f`, kinds (`a::Kind`), [next](solve.md), `N`, `k`, [w](https://x.y) and v[0] [x].\n\
             [lesson](../01-kinks/lesson.md) in [the book](../README.md)\n"
        );
    }

    #[test]
    fn the_index_is_the_documentation_of_the_module() {
        let text = documentation(
            "//! First.\n//!\n//! 1. [Solve](solve)\n//!\n//! # More\n//! of [it\n//! all](crate::a)\n\npub mod solve {}\n",
        );
        assert_eq!(
            page(&text),
            "# The guide\n\nFirst.\n\n1. [Solve](solve.md)\n\n## More\nof it\nall (`a`)\n"
        );
    }
}
