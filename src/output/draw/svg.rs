//! Shapes as Scalable Vector Graphics 1.1.

use std::fmt::Write;

use super::label::{Level, runs};
use super::shape::{Anchor, BASE_LINE, Bend, DASHES, Pixel, Shape};
use crate::output::diagram::Colour;

/// A number with at most two decimals.
fn number(out: &mut String, value: f64) {
    let start = out.len();
    let _ = write!(out, "{value:.2}");
    let kept = out[start..].trim_end_matches('0').trim_end_matches('.').len();
    out.truncate(start + kept);
    if &out[start..] == "-0" {
        out.replace_range(start.., "0");
    }
}

fn attribute(out: &mut String, name: &str, value: f64) {
    let _ = write!(out, " {name}=\"");
    number(out, value);
    out.push('"');
}

fn paint(out: &mut String, name: &str, c: Colour) {
    let _ = write!(out, " {name}=\"#{:02x}{:02x}{:02x}\"", c.red, c.green, c.blue);
}

fn outline(out: &mut String, outline: Option<(Colour, f64)>) {
    if let Some((colour, width)) = outline {
        paint(out, "stroke", colour);
        attribute(out, "stroke-width", width);
    }
}

fn pixel(out: &mut String, (x, y): Pixel) {
    number(out, x);
    out.push(',');
    number(out, y);
}

fn points(out: &mut String, points: &[Pixel]) {
    out.push_str(" points=\"");
    for (k, &p) in points.iter().enumerate() {
        if k > 0 {
            out.push(' ');
        }
        pixel(out, p);
    }
    out.push('"');
}

/// The commands of a path of lines and cubics.
fn path(out: &mut String, points: &[Pixel], bends: &[Bend]) {
    out.push_str(" d=\"");
    for (k, &p) in points.iter().enumerate() {
        let bend = k
            .checked_sub(1)
            .and_then(|before| bends.get(before))
            .copied()
            .flatten();
        match bend {
            _ if k == 0 => out.push('M'),
            None => out.push('L'),
            Some(controls) => {
                out.push('C');
                for control in controls {
                    pixel(out, control);
                    out.push(' ');
                }
            }
        }
        pixel(out, p);
    }
    out.push('"');
}

fn escaped(out: &mut String, text: &str) {
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
}

/// Subscripts and superscripts shift the base line, and the next run shifts it back.
fn text_runs(out: &mut String, runs: &[(Level, String)], size: f64) {
    let mut rise = 0.0;
    for (level, run) in runs {
        if *level == Level::Base && rise == 0.0 {
            escaped(out, run);
            continue;
        }
        out.push_str("<tspan");
        attribute(out, "dy", (rise - level.rise()) * size);
        if *level != Level::Base {
            attribute(out, "font-size", level.scale() * size);
        }
        out.push('>');
        escaped(out, run);
        out.push_str("</tspan>");
        rise = level.rise();
    }
}

pub(super) fn write(shapes: &[Shape], (width, height): (u32, u32), title: &str) -> String {
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" xml:space=\"preserve\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\">\n"
    );
    if !title.is_empty() {
        out.push_str("<title>");
        for (_, run) in runs(title) {
            escaped(&mut out, &run);
        }
        out.push_str("</title>\n");
    }
    let _ = writeln!(
        out,
        "<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>"
    );
    for shape in shapes {
        match shape {
            Shape::Line {
                points: line,
                bends,
                colour,
                width,
                dashed,
            } => {
                let bent = bends.iter().any(Option::is_some);
                out.push_str(if bent { "<path" } else { "<polyline" });
                out.push_str(" fill=\"none\" stroke-linejoin=\"round\"");
                paint(&mut out, "stroke", *colour);
                attribute(&mut out, "stroke-width", *width);
                if *dashed {
                    let _ = write!(out, " stroke-dasharray=\"{} {}\"", DASHES.0, DASHES.1);
                }
                if bent {
                    path(&mut out, line, bends);
                } else {
                    points(&mut out, line);
                }
                out.push_str("/>\n");
            }
            Shape::Polygon {
                corners,
                fill,
                outline: line,
            } => {
                out.push_str("<polygon");
                paint(&mut out, "fill", *fill);
                outline(&mut out, *line);
                points(&mut out, corners);
                out.push_str("/>\n");
            }
            Shape::Circle {
                centre,
                radius,
                fill,
                outline: line,
            } => {
                out.push_str("<circle");
                attribute(&mut out, "cx", centre.0);
                attribute(&mut out, "cy", centre.1);
                attribute(&mut out, "r", *radius);
                paint(&mut out, "fill", *fill);
                outline(&mut out, *line);
                out.push_str("/>\n");
            }
            Shape::Text {
                at,
                size,
                anchor,
                upwards,
                runs,
            } => {
                out.push_str("<text");
                let base = BASE_LINE * size;
                if *upwards {
                    out.push_str(" transform=\"translate(");
                    number(&mut out, at.0 + base);
                    out.push(' ');
                    number(&mut out, at.1);
                    out.push_str(") rotate(-90)\"");
                } else {
                    attribute(&mut out, "x", at.0);
                    attribute(&mut out, "y", at.1 + base);
                }
                attribute(&mut out, "font-size", *size);
                match anchor {
                    Anchor::Start => {}
                    Anchor::Middle => out.push_str(" text-anchor=\"middle\""),
                    Anchor::End => out.push_str(" text-anchor=\"end\""),
                }
                out.push('>');
                text_runs(&mut out, runs, *size);
                out.push_str("</text>\n");
            }
        }
    }
    out.push_str("</svg>\n");
    out
}
