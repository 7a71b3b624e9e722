//! Text for terminals of 100 columns.

/// Largest width of a line.
const WIDTH: usize = 100;

/// "1 fold", "2 folds".
pub(super) fn counted(count: usize, what: &str) -> String {
    match (count, what.strip_suffix("ch")) {
        (1, _) => format!("1 {what}"),
        (_, Some(_)) => format!("{count} {what}es"),
        _ => format!("{count} {what}s"),
    }
}

/// A number for the terminal, with twelve digits; files have all of them.
pub(super) fn short(value: f64) -> String {
    let digits = format!("{value:.11e}");
    let rounded: f64 = digits.parse().unwrap_or(value);
    match rounded != 0.0 && !(1e-5..1e15).contains(&rounded.abs()) {
        true => format!("{rounded:e}"),
        false => rounded.to_string(),
    }
}

/// Part of the numbers that it stands with below which a sum of them is their rounding: some thousand terms of the solver's accuracy.
const ROUNDING: f64 = 1e-12;

/// A number, or 0 where it is rounding beside numbers of the size `beside`.
pub(super) fn rounded(value: f64, beside: f64) -> f64 {
    if value.abs() <= ROUNDING * beside {
        0.0
    } else {
        value
    }
}

/// A result for a table in the terminal, with five digits.
pub(super) fn result(value: f64, beside: f64) -> String {
    match rounded(value, beside) {
        0.0 => "0".to_owned(),
        value => format!("{value:.4e}"),
    }
}

/// A cell of a table (RFC 4180).
pub(super) fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// `line` followed by `end`; `line` is cut if both do not fit (the files have all of it).
pub(super) fn fitted(line: &str, end: &str) -> String {
    let room = WIDTH.saturating_sub(end.chars().count());
    if line.chars().count() <= room {
        return format!("{line}{end}");
    }
    let cut: String = line.chars().take(room.saturating_sub(2)).collect();
    format!("{cut} …{end}")
}

/// Wraps a sentence, with all lines but the first indented; a word longer than a line is not split.
pub(super) fn wrapped(text: &str) -> String {
    const INDENT: &str = "    ";
    let (mut lines, mut line) = (Vec::new(), String::new());
    for word in text.split(' ') {
        if !line.trim().is_empty() && line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines.push(std::mem::replace(&mut line, INDENT.to_owned()));
        } else if !lines.is_empty() || !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.push(line);
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_of_zero_is_zero_beside_other_numbers() {
        assert_eq!(result(-3.1e-18, 0.05), "0");
        assert_eq!(result(0.0, 0.0), "0");
        assert_eq!(result(-3.1e-18, 4e-18), "-3.1000e-18");
        assert_eq!(
            (short(0.1 + 0.2), short(-2e-7)),
            ("0.3".to_owned(), "-2e-7".to_owned())
        );
    }

    #[test]
    fn lines_end_before_the_hundred_and_first_column() {
        let long = ["αβγδε"; 30].join(" ");
        let lines: Vec<_> = wrapped(&long).lines().map(str::to_owned).collect();
        assert!(lines.iter().all(|l| l.chars().count() <= WIDTH));
        assert!(lines.len() == 2 && lines[1].starts_with("    α"), "{lines:?}");
        let words: Vec<_> = lines.iter().flat_map(|l| l.split_whitespace()).collect();
        assert_eq!(words.join(" "), long);
        assert_eq!(fitted(&long, "  index +1").chars().count(), WIDTH);
        assert!(fitted(&long, "  index +1").ends_with(" …  index +1"));
        assert_eq!(
            (fitted("short", " end"), wrapped("short")),
            ("short end".into(), "short".into())
        );
    }

    #[test]
    fn one_is_singular() {
        assert_eq!(counted(1, "branch"), "1 branch");
        assert_eq!(counted(0, "branch"), "0 branches");
        assert_eq!(counted(2, "fold"), "2 folds");
    }
}
