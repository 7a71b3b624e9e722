//! Shapes as a page of PDF 1.7, with two of the fonts that every reader has: Helvetica, and Symbol for Greek letters and signs.

use pdf_writer::types::LineJoinStyle;
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};

use super::label::{Level, length};
use super::shape::{Anchor, BASE_LINE, Bend, DASHES, Pixel, Shape};
use crate::output::diagram::Colour;

/// A pixel of CSS in points.
const POINT: f64 = 0.75;

const TEXT: Name<'static> = Name(b"F0");
const SYMBOLS: Name<'static> = Name(b"F1");

/// The code of a character in one of the fonts.
#[derive(Clone, Copy, PartialEq)]
enum Glyph {
    Text(u8),
    Symbol(u8),
}

fn glyph(c: char) -> Glyph {
    const GREEK: &str = "αβχδεφγηιϕκλμνοπθρστυϖωξψζ";
    const SMALL: &[u8] = b"abcdefghijklmnopqrstuvwxyz";
    const CAPITAL: [(char, u8); 11] = [
        ('Γ', b'G'),
        ('Δ', b'D'),
        ('Θ', b'Q'),
        ('Λ', b'L'),
        ('Ξ', b'X'),
        ('Π', b'P'),
        ('Σ', b'S'),
        ('Υ', b'U'),
        ('Φ', b'F'),
        ('Ψ', b'Y'),
        ('Ω', b'W'),
    ];
    const SIGNS: [(char, u8); 12] = [
        ('−', 0x2d),
        ('≤', 0xa3),
        ('∞', 0xa5),
        ('≥', 0xb3),
        ('∂', 0xb6),
        ('≠', 0xb9),
        ('≈', 0xbb),
        ('→', 0xae),
        ('∈', 0xce),
        ('∇', 0xd1),
        ('√', 0xd6),
        ('∫', 0xf2),
    ];
    if let Some(k) = GREEK.chars().position(|g| g == c) {
        return Glyph::Symbol(SMALL[k]);
    }
    if let Some((_, code)) = CAPITAL.iter().chain(&SIGNS).find(|(s, _)| *s == c) {
        return Glyph::Symbol(*code);
    }
    match c {
        // WinAnsiEncoding is Latin-1 in these ranges.
        ' '..='~' | '\u{a1}'..='\u{ff}' => Glyph::Text(c as u8),
        '‖' => Glyph::Text(b'|'),
        '–' => Glyph::Text(0x96),
        '—' => Glyph::Text(0x97),
        '‘' => Glyph::Text(0x91),
        '’' => Glyph::Text(0x92),
        '…' => Glyph::Text(0x85),
        _ => Glyph::Text(b'?'),
    }
}

/// Unicode subscript and superscript digits, as in x₁, become runs of digits.
fn spelled(runs: &[(Level, String)]) -> Vec<(Level, String)> {
    let mut out: Vec<(Level, String)> = Vec::new();
    for (level, run) in runs {
        for c in run.chars() {
            let (level, c) = match c {
                '₀'..='₉' => (Level::Subscript, digit(c as u32 - '₀' as u32)),
                '⁰' | '⁴'..='⁹' => (Level::Superscript, digit(c as u32 - '⁰' as u32)),
                'ᵀ' => (Level::Superscript, 'T'),
                '₊' => (Level::Subscript, '+'),
                'ⁿ' => (Level::Superscript, 'n'),
                c => (*level, c),
            };
            match out.last_mut() {
                Some((last, text)) if *last == level => text.push(c),
                _ => out.push((level, c.to_string())),
            }
        }
    }
    out
}

fn digit(value: u32) -> char {
    char::from_digit(value, 10).unwrap_or('?')
}

struct Page {
    content: Content,
    height: f64,
}

impl Page {
    fn place(&self, (x, y): Pixel) -> (f32, f32) {
        ((POINT * x) as f32, (POINT * (self.height - y)) as f32)
    }

    fn path(&mut self, points: &[Pixel], bends: &[Bend]) {
        for (k, &p) in points.iter().enumerate() {
            let (x, y) = self.place(p);
            let bend = k
                .checked_sub(1)
                .and_then(|before| bends.get(before))
                .copied()
                .flatten();
            match bend {
                _ if k == 0 => self.content.move_to(x, y),
                None => self.content.line_to(x, y),
                Some(controls) => {
                    let [a, b] = controls.map(|c| self.place(c));
                    self.content.cubic_to(a.0, a.1, b.0, b.1, x, y)
                }
            };
        }
    }

    /// Four cubic Bézier curves, accurate to 3e-4 of the radius.
    fn circle(&mut self, centre: Pixel, radius: f64) {
        const KAPPA: f64 = 0.5523;
        let (r, k) = (radius, KAPPA * radius);
        let at = |page: &Self, dx: f64, dy: f64| page.place((centre.0 + dx, centre.1 + dy));
        let (x, y) = at(self, r, 0.0);
        self.content.move_to(x, y);
        let quarters = [
            [(r, k), (k, r), (0.0, r)],
            [(-k, r), (-r, k), (-r, 0.0)],
            [(-r, -k), (-k, -r), (0.0, -r)],
            [(k, -r), (r, -k), (r, 0.0)],
        ];
        for [a, b, c] in quarters {
            let [a, b, c] = [a, b, c].map(|(dx, dy)| at(self, dx, dy));
            self.content.cubic_to(a.0, a.1, b.0, b.1, c.0, c.1);
        }
    }

    fn stroke(&mut self, c: Colour, width: f64) {
        let [r, g, b] = [c.red, c.green, c.blue].map(|v| f32::from(v) / 255.0);
        self.content.set_stroke_rgb(r, g, b);
        self.content.set_line_width((POINT * width) as f32);
    }

    fn fill(&mut self, c: Colour) {
        let [r, g, b] = [c.red, c.green, c.blue].map(|v| f32::from(v) / 255.0);
        self.content.set_fill_rgb(r, g, b);
    }

    /// Fills the path drawn by `path`; PDF requires the colour to be set before a path begins.
    fn filled(&mut self, fill: Colour, outline: Option<(Colour, f64)>, path: impl FnOnce(&mut Self)) {
        self.fill(fill);
        if let Some((colour, width)) = outline {
            self.stroke(colour, width);
        }
        path(self);
        self.content.close_path();
        match outline {
            Some(_) => self.content.fill_nonzero_and_stroke(),
            None => self.content.fill_nonzero(),
        };
    }

    fn text(&mut self, at: Pixel, size: f64, anchor: Anchor, upwards: bool, runs: &[(Level, String)]) {
        let runs = spelled(runs);
        let share = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5,
            Anchor::End => 1.0,
        };
        let back = share * size * length(&runs);
        let base = BASE_LINE * size;
        let start = match upwards {
            true => (at.0 + base, at.1 + back),
            false => (at.0 - back, at.1 + base),
        };
        let (x, y) = self.place(start);
        let (c, s) = if upwards { (0.0, 1.0) } else { (1.0, 0.0) };
        self.fill(super::shape::BLACK);
        self.content.begin_text();
        self.content.set_text_matrix([c, s, -s, c, x, y]);
        for (level, run) in &runs {
            self.content.set_rise((POINT * level.rise() * size) as f32);
            let letters: Vec<Glyph> = run.chars().map(glyph).collect();
            let same_font = |a: &Glyph, b: &Glyph| {
                matches!(
                    (a, b),
                    (Glyph::Text(_), Glyph::Text(_)) | (Glyph::Symbol(_), Glyph::Symbol(_))
                )
            };
            for part in letters.chunk_by(same_font) {
                let font = match part[0] {
                    Glyph::Text(_) => TEXT,
                    Glyph::Symbol(_) => SYMBOLS,
                };
                let codes: Vec<u8> = part
                    .iter()
                    .map(|g| match g {
                        Glyph::Text(code) | Glyph::Symbol(code) => *code,
                    })
                    .collect();
                self.content.set_font(font, (POINT * level.scale() * size) as f32);
                self.content.show(Str(&codes));
            }
        }
        self.content.end_text();
    }
}

pub(super) fn write(shapes: &[Shape], (width, height): (u32, u32)) -> Vec<u8> {
    let mut page = Page {
        content: Content::new(),
        height: f64::from(height),
    };
    page.content.set_line_join(LineJoinStyle::RoundJoin);
    for shape in shapes {
        match shape {
            Shape::Line {
                points,
                bends,
                colour,
                width,
                dashed,
            } => {
                page.stroke(*colour, *width);
                let dashes = [DASHES.0, DASHES.1].map(|d| (POINT * d) as f32);
                if *dashed {
                    page.content.set_dash_pattern(dashes, 0.0);
                }
                page.path(points, bends);
                page.content.stroke();
                if *dashed {
                    page.content.set_dash_pattern([], 0.0);
                }
            }
            Shape::Polygon {
                corners,
                fill,
                outline,
            } => {
                page.filled(*fill, *outline, |page| page.path(corners, &[]));
            }
            Shape::Circle {
                centre,
                radius,
                fill,
                outline,
            } => {
                page.filled(*fill, *outline, |page| page.circle(*centre, *radius));
            }
            Shape::Text {
                at,
                size,
                anchor,
                upwards,
                runs,
            } => page.text(*at, *size, *anchor, *upwards, runs),
        }
    }
    let [catalog, tree, sheet, content, text, symbols] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(tree);
    pdf.pages(tree).kids([sheet]).count(1);
    let mut out = pdf.page(sheet);
    let size = [width, height].map(|v| (POINT * f64::from(v)) as f32);
    out.media_box(Rect::new(0.0, 0.0, size[0], size[1]))
        .parent(tree)
        .contents(content);
    out.resources().fonts().pair(TEXT, text).pair(SYMBOLS, symbols);
    out.finish();
    pdf.type1_font(text)
        .base_font(Name(b"Helvetica"))
        .encoding_predefined(Name(b"WinAnsiEncoding"));
    pdf.type1_font(symbols).base_font(Name(b"Symbol"));
    pdf.stream(content, &page.content.finish());
    pdf.finish()
}
