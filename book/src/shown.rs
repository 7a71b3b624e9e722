//! Files that a lesson shows: a comment with the name of a file, then its text between fences, so that the lesson is whole wherever
//! Markdown is rendered.

use std::fs;
use std::path::Path;

use crate::Outcome;

const FENCE: &str = "```";

/// The comment before the text of a file.
pub(crate) fn mark(file: &str) -> String {
    format!("<!-- {file} -->")
}

/// A lesson with the texts of its files as they are now.
///
/// # Errors
/// Marked files that cannot be read, marks without fences.
pub(crate) fn refreshed(lesson: &str, folder: &Path) -> Outcome<String> {
    let mut fresh = String::with_capacity(lesson.len());
    let mut lines = lesson.lines();
    while let Some(line) = lines.next() {
        fresh += line;
        fresh.push('\n');
        let file = line
            .strip_prefix("<!-- ")
            .and_then(|rest| rest.strip_suffix(" -->"));
        let Some(file) = file else { continue };
        let open = lines.next().filter(|l| l.starts_with(FENCE));
        let open =
            open.ok_or_else(|| format!("no {FENCE} after the mark of {file}"))?;
        if !lines.by_ref().any(|l| l == FENCE) {
            return Err(format!("no {FENCE} after the text of {file}").into());
        }
        let text = fs::read_to_string(folder.join(file))
            .map_err(|e| format!("{file}: {e}"))?;
        fresh += &format!("{open}\n{}\n{FENCE}\n", text.trim_end_matches('\n'));
    }
    Ok(fresh)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::refreshed;

    /// This file shows a file beside it: the list of modules.
    #[test]
    fn texts_of_marked_files_are_replaced_and_nothing_else() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let old = "before\n\n<!-- lib.rs -->\n```rust\nold\n\nlines\n```\n\n```text\nafter\n```\n";
        let fresh = refreshed(old, &folder).unwrap();
        let own = include_str!("lib.rs");
        assert_eq!(
            fresh,
            format!(
                "before\n\n<!-- lib.rs -->\n```rust\n{own}```\n\n```text\nafter\n```\n"
            )
        );
        assert_eq!(refreshed(&fresh, &folder).unwrap(), fresh);
        for wrong in [
            "<!-- lib.rs -->\ntext\n",
            "<!-- lib.rs -->\n```\ntext\n",
            "<!-- none.rs -->\n```\n```\n",
        ] {
            assert!(refreshed(wrong, &folder).is_err(), "{wrong}");
        }
    }
}
