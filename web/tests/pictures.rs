//! Colours and marks of the pictures of the page, as defined in its script.

#[path = "../../tests/support/vision.rs"]
mod vision;

const SCRIPT: &str = include_str!("../page/drawing.js");
const CRATE: &str = include_str!("../../src/output/diagram.rs");

/// The text between two marks.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let rest = text.split_once(from).unwrap_or_else(|| panic!("no {from}")).1;
    rest.split_once(to).unwrap_or_else(|| panic!("no {to}")).0
}

fn channels(hex: &str) -> [u8; 3] {
    [0, 2, 4].map(|k| u8::from_str_radix(&hex[k..k + 2], 16).unwrap())
}

/// A colour of a palette by its name.
fn colour(palette: &str, name: &str) -> [u8; 3] {
    channels(&between(palette, &format!("{name}: '#"), "'")[..6])
}

fn cycle(palette: &str) -> Vec<[u8; 3]> {
    let list = between(palette, "cycle: [", "]");
    list.split('#').skip(1).map(|c| channels(&c[..6])).collect()
}

/// A colour of the crate.
fn constant(name: &str) -> [u8; 3] {
    let list = between(CRATE, &format!("pub const {name}: Self = Self::new("), ")");
    let channel: Vec<u8> = list
        .split(", ")
        .map(|c| u8::from_str_radix(c.trim_start_matches("0x"), 16).unwrap())
        .collect();
    channel.try_into().unwrap()
}

#[test]
fn light_colours_are_those_of_the_crate() {
    let light = between(SCRIPT, "light: {", "},");
    for (name, of_crate) in [
        ("open", "RED"),
        ("stick", "GREEN"),
        ("slip", "BLUE"),
        ("grazing", "GREY"),
        ("fold", "PURPLE"),
    ] {
        assert_eq!(colour(light, name), constant(of_crate), "{name}");
    }
    let names = ["BLUE", "RED", "GREEN", "PURPLE", "ORANGE"];
    assert_eq!(cycle(light), names.map(constant));
}

/// Colours in one picture differ from each other and from the background by at least 20 in CIELAB, also for colour-blind readers.
#[test]
fn colours_of_both_palettes_differ_for_every_reader() {
    for name in ["light: {", "dark: {"] {
        let palette = between(SCRIPT, name, "},");
        let grey = colour(palette, "grazing");
        let states = ["open", "stick", "slip", "fold"].map(|n| colour(palette, n));
        for mut colours in [states.to_vec(), cycle(palette)] {
            colours.extend([grey, colour(palette, "paper")]);
            for (k, a) in colours.iter().enumerate() {
                for b in &colours[..k] {
                    assert!(vision::distance(*a, *b) > 20.0, "{name} {a:?} {b:?}");
                }
            }
        }
    }
}

/// The names of marks are those that the crate writes into legends, and each kind of vertex has one.
#[test]
fn kinds_of_events_have_the_marks_of_the_crate() {
    let legend = between(CRATE, "pub const fn name(self) -> &'static str {", "impl From");
    let mut expected: Vec<&str> = legend
        .split("=> \"")
        .skip(1)
        .map(|l| l.split('"').next().unwrap())
        // The page is not told which equations are those of equilibria, so that its curves have no stability.
        .filter(|name| *name != "Hopf point")
        .collect();
    expected.push("these data");
    let marks = between(SCRIPT, "const marks = {\n", "\n};");
    let name = |line: &str| {
        line.split_once(": (r)")
            .unwrap()
            .0
            .trim()
            .trim_matches('\'')
            .to_owned()
    };
    assert_eq!(marks.lines().map(name).collect::<Vec<_>>(), expected);
    let events = between(SCRIPT, "const events = {", "};");
    let of_vertex = |kind: &str| {
        let quoted = events
            .split_once(&format!("'{kind}': '"))
            .or_else(|| events.split_once(&format!(" {kind}: '")));
        quoted.map(|(_, rest)| rest.split('\'').next().unwrap())
    };
    for (kind, mark) in [
        ("pass-through", "transition"),
        ("fold", "fold"),
        ("vertical segment", "vertical segment"),
        ("branching", "branching"),
        ("branch point", "branching"),
        ("end", "end"),
        ("isolated", "isolated solution"),
    ] {
        assert_eq!(of_vertex(kind), Some(mark));
    }
}
