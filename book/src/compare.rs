//! Whether a program still prints and draws what the book shows.

/// Coordinates of a picture may differ by this many pixels: machines round differently, and pictures have two decimals.
const PIXELS: f64 = 0.05;

/// Where two outputs differ, in words; `None` where they agree. Text must be the same; the numbers of a picture nearly so.
pub(crate) fn difference(name: &str, shown: &str, found: &str) -> Option<String> {
    let same = match name.ends_with(".svg") {
        true => same_picture,
        false => |a: &str, b: &str| a == b,
    };
    let (mut left, mut right) = (shown.lines(), found.lines());
    for line in 1.. {
        match (left.next(), right.next()) {
            (None, None) => break,
            (Some(a), Some(b)) if same(a, b) => {}
            (a, b) => {
                let text = |line: Option<&str>| {
                    line.map_or("(nothing)".to_owned(), |l| {
                        l.chars().take(160).collect()
                    })
                };
                return Some(format!(
                    "line {line}\n  in the book: {}\n  found now:   {}",
                    text(a),
                    text(b)
                ));
            }
        }
    }
    None
}

/// Numbers in tags are coordinates; those in texts are labels, which must be the same.
fn same_picture(a: &str, b: &str) -> bool {
    let (a, b) = (parts(a), parts(b));
    let near = |a: &str, b: &str| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(x), Ok(y)) => (x - y).abs() <= PIXELS,
        _ => false,
    };
    a.len() == b.len()
        && a.iter()
            .zip(&b)
            .all(|(a, b)| a == b || (a.1 && b.1 && near(a.0, b.0)))
}

/// Cuts a line into numbers and the text between them; with each part, whether it lies in a tag.
fn parts(line: &str) -> Vec<(&str, bool)> {
    let is_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let mut parts = Vec::new();
    let (mut from, mut tag) = (0, false);
    let mut before = None;
    for (at, c) in line.char_indices() {
        let number = is_number(c);
        if before.is_some_and(|was| was != number) {
            parts.push((&line[from..at], tag));
            from = at;
        }
        before = Some(number);
        tag = (tag || c == '<') && c != '>';
    }
    parts.push((&line[from..], tag));
    parts
}

#[cfg(test)]
mod tests {
    use super::difference;

    #[test]
    fn text_is_compared_as_it_is_and_pictures_within_a_fraction_of_a_pixel() {
        assert_eq!(difference("a.txt", "x 1.00\n", "x 1.00\n"), None);
        assert!(
            difference("a.txt", "x 1.00\n", "x 1.01\n")
                .is_some_and(|d| d.contains("line 1"))
        );
        assert!(
            difference("a.txt", "x\n", "x\ny\n")
                .is_some_and(|d| d.contains("line 2"))
        );
        let (a, b, far) = (
            "<path d=\"M 1.00 -2.5\"/>",
            "<path d=\"M 1.01 -2.5\"/>",
            "<path d=\"M 1.2 -2.5\"/>",
        );
        assert_eq!(difference("a.svg", a, b), None);
        assert!(difference("a.svg", a, far).is_some());
        assert!(difference("a.svg", a, "<path d=\"L 1.00 -2.5\"/>").is_some());
        assert!(difference("a.svg", a, "<path d=\"M 1.00\"/>").is_some());
        let label = |x: &str, text: &str| format!("<text x=\"{x}\">{text}</text>");
        assert_eq!(
            difference("a.svg", &label("1.00", "0.01"), &label("1.01", "0.01")),
            None
        );
        assert!(
            difference("a.svg", &label("1.00", "0.01"), &label("1.00", "0.02"))
                .is_some()
        );
    }
}
