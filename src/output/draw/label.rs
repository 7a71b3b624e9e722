//! Labels: `u_t` and `10^{-3}` as runs of text, and their widths.

/// The level of a run of text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Base,
    Subscript,
    Superscript,
}

impl Level {
    /// Size of letters relative to those of the label.
    pub(super) fn scale(self) -> f64 {
        match self {
            Self::Base => 1.0,
            Self::Subscript | Self::Superscript => 0.7,
        }
    }

    /// Height above the base line relative to the size of the label.
    pub(super) fn rise(self) -> f64 {
        match self {
            Self::Base => 0.0,
            Self::Subscript => -0.22,
            Self::Superscript => 0.38,
        }
    }
}

/// Splits a label. `_` and `^` after a single letter or a bracket, and `^` also after a number, make a subscript or superscript of the
/// letters, digits and signs that follow, or of the text in braces; elsewhere, as in `first_point`, they are ordinary characters. Control
/// characters, which XML cannot represent, are left out.
pub(super) fn runs(label: &str) -> Vec<(Level, String)> {
    let text: Vec<char> = label
        .chars()
        .filter(|c| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}'))
        .collect();
    let mut runs: Vec<(Level, String)> = vec![(Level::Base, String::new())];
    let mut k = 0;
    while k < text.len() {
        let level = match text[k] {
            '_' => Level::Subscript,
            '^' => Level::Superscript,
            _ => Level::Base,
        };
        let moved = match level {
            Level::Base => None,
            Level::Superscript if k > 0 && text[k - 1].is_numeric() => moved(&text[k + 1..]),
            _ if is_symbol(&text[..k]) => moved(&text[k + 1..]),
            _ => None,
        };
        match moved {
            Some((content, length)) => {
                runs.push((level, content));
                runs.push((Level::Base, String::new()));
                k += 1 + length;
            }
            None => {
                if let Some((_, base)) = runs.last_mut() {
                    base.push(text[k]);
                }
                k += 1;
            }
        }
    }
    runs.retain(|(_, run)| !run.is_empty());
    runs
}

/// Whether a text ends with a single letter, or with `‖` or a bracket.
fn is_symbol(text: &[char]) -> bool {
    match text {
        [] => false,
        [.., ')' | ']' | '|' | '‖'] => true,
        [c] => c.is_alphabetic(),
        [.., before, c] => c.is_alphabetic() && !before.is_alphanumeric(),
    }
}

/// The subscript or superscript at the beginning of a text, and the number of characters that it takes.
fn moved(text: &[char]) -> Option<(String, usize)> {
    if text.first() == Some(&'{') {
        let end = text.iter().position(|c| *c == '}')?;
        return (end > 1).then(|| (text[1..end].iter().collect(), end + 1));
    }
    let sign = usize::from(matches!(text.first(), Some('-' | '−' | '+')));
    let length = text[sign..].iter().take_while(|c| c.is_alphanumeric()).count();
    (length > 0).then(|| (text[..sign + length].iter().collect(), sign + length))
}

/// Width of a label in letters of the given size: that in Helvetica and Arial, plus a tenth for other fonts.
pub(super) fn width(label: &str, size: f64) -> f64 {
    1.1 * size * length(&runs(label))
}

/// Width of a text in Helvetica, relative to its size.
pub(super) fn length(runs: &[(Level, String)]) -> f64 {
    let run = |(level, run): &(Level, String)| run.chars().map(advance).sum::<f64>() * level.scale();
    1e-3 * runs.iter().map(run).sum::<f64>()
}

/// Advance width of a letter of Helvetica, in thousandths of the size (Adobe Font Metrics).
fn advance(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | '\'' => 222.0,
        '|' => 260.0,
        ' ' | '!' | ',' | '.' | '/' | ':' | ';' | '[' | ']' | '\\' | 'f' | 't' | 'I' | '·' => 278.0,
        '(' | ')' | '-' | '`' | 'r' | '{' | '}' | '"' => 350.0,
        '*' => 389.0,
        'J' | 'c' | 'k' | 's' | 'v' | 'x' | 'y' | 'z' => 500.0,
        '+' | '<' | '=' | '>' | '~' | '−' | '×' => 584.0,
        'F' | 'T' | 'Z' => 611.0,
        'A' | 'B' | 'E' | 'K' | 'P' | 'S' | 'V' | 'X' | 'Y' | '&' => 667.0,
        'C' | 'D' | 'H' | 'N' | 'R' | 'U' | 'w' => 722.0,
        'G' | 'O' | 'Q' => 778.0,
        'M' | 'm' => 833.0,
        '%' => 889.0,
        'W' => 944.0,
        '@' | '—' | '…' => 1015.0,
        c if c.is_ascii() => 556.0,
        _ => 600.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(label: &str) -> Vec<(Level, String)> {
        runs(label)
    }

    #[test]
    fn symbols_have_scripts_and_words_do_not() {
        let (base, sub, sup) = (Level::Base, Level::Subscript, Level::Superscript);
        let is = |label: &str, expected: &[(Level, &str)]| {
            let expected: Vec<_> = expected.iter().map(|(l, t)| (*l, (*t).to_owned())).collect();
            assert_eq!(split(label), expected, "{label}");
        };
        is("u_t", &[(base, "u"), (sub, "t")]);
        is("f_ν over α", &[(base, "f"), (sub, "ν"), (base, " over α")]);
        is("2×10^{-3} m", &[(base, "2×10"), (sup, "-3"), (base, " m")]);
        is("10^−3", &[(base, "10"), (sup, "−3")]);
        is("‖u‖_{L¹}", &[(base, "‖u‖"), (sub, "L¹")]);
        is("first_point", &[(base, "first_point")]);
        is("block_10x20_F0.5", &[(base, "block_10x20_F0.5")]);
        is("a_", &[(base, "a_")]);
        is("_b ^c u_{} u_{t", &[(base, "_b ^c u_{} u_{t")]);
        is("\u{1}a\u{ffff}", &[(base, "a")]);
        is("", &[]);
    }

    #[test]
    fn scripts_are_narrower() {
        assert!(width("u_t", 10.0) < width("ut", 10.0));
        assert!(width("iii", 10.0) < width("mmm", 10.0));
        assert!((width("mm", 20.0) - 4.0 * width("m", 10.0)).abs() < 1e-12);
    }
}
