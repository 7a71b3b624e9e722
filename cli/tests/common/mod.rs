//! Files made for tests: a text file and its binary form.

use std::fmt::Write;

/// The header of a file: counts of variables, rows, objectives, functions, entries of the Jacobian, of gradients, and defined variables.
#[allow(dead_code)]
pub fn header(
    [
        variables,
        rows,
        objectives,
        functions,
        entries,
        gradients,
        defined,
    ]: [usize; 7],
) -> String {
    format!(
        "g3 1 1 0\t# problem of a test\n {variables} {rows} {objectives} 0 0 0\n 0 0 0 0 0 0\n 0 0\n 0 0 0\n 0 {functions} 0 1\n \
         0 0 0 0 0\n {entries} {gradients}\n 0 0\n {defined} 0 0 0 0\n"
    )
}

/// The binary form of a well-formed text file.
#[allow(dead_code)]
pub fn to_binary(text: &str, big_endian: bool) -> Vec<u8> {
    let mut writer = Writer {
        bytes: Vec::new(),
        big_endian,
    };
    let mut lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or("").trim());
    for k in 0..10 {
        let line = lines.next().expect("ten lines of a header");
        let line = match k {
            0 => line.replacen('g', "b", 1),
            5 => {
                let mut words: Vec<&str> = line.split_whitespace().collect();
                words[2] = if big_endian { "2" } else { "1" };
                words.join(" ")
            }
            _ => line.to_owned(),
        };
        let mut own = String::new();
        writeln!(own, "{line}").expect("a string takes all");
        writer.bytes.extend(own.bytes());
    }
    while let Some(line) = lines.next() {
        writer.segment(line, &mut lines);
    }
    writer.bytes
}

struct Writer {
    bytes: Vec<u8>,
    big_endian: bool,
}

impl Writer {
    fn put<const N: usize>(&mut self, mut bytes: [u8; N]) {
        if self.big_endian {
            bytes.reverse();
        }
        self.bytes.extend(bytes);
    }

    fn integer(&mut self, word: &str) -> i32 {
        let value: i32 = word.parse().expect("an integer");
        self.put(value.to_le_bytes());
        value
    }

    fn number(&mut self, word: &str) {
        let value: f64 = word.parse().expect("a number");
        self.put(value.to_le_bytes());
    }

    fn name(&mut self, name: &str) {
        self.put((name.len() as i32).to_le_bytes());
        self.bytes.extend(name.bytes());
    }

    fn pairs<'a>(&mut self, count: i32, real: bool, lines: &mut impl Iterator<Item = &'a str>) {
        for _ in 0..count {
            let mut words = lines.next().expect("a pair").split_whitespace();
            self.integer(words.next().expect("an index"));
            let value = words.next().expect("a value");
            match real {
                true => self.number(value),
                false => {
                    self.integer(value);
                }
            }
        }
    }

    /// A line, with those that belong to it.
    fn segment<'a>(&mut self, line: &str, lines: &mut impl Iterator<Item = &'a str>) {
        let mut words = line.split_whitespace();
        let first = words.next().expect("a tag");
        let (tag, rest) = first.split_at(1);
        let mut words: Vec<&str> = words.collect();
        if !rest.is_empty() {
            words.insert(0, rest);
        }
        self.bytes.extend(tag.bytes());
        match tag {
            "n" => self.number(words[0]),
            "s" => self.put(words[0].parse::<i16>().expect("a short").to_le_bytes()),
            "o" => {
                let code = self.integer(words[0]);
                if [11, 12, 54, 59, 60, 64, 70, 71, 74, 75].contains(&code) {
                    self.integer(lines.next().expect("a count"));
                }
            }
            "F" | "S" => {
                let (name, integers) = words.split_last().expect("a name");
                let integers: Vec<i32> = integers.iter().map(|w| self.integer(w)).collect();
                self.name(name);
                if tag == "S" {
                    self.pairs(integers[1], integers[0] & 4 != 0, lines);
                }
            }
            "x" | "d" | "J" | "G" | "V" => {
                let integers: Vec<i32> = words.iter().map(|w| self.integer(w)).collect();
                let count = if "xd".contains(tag) {
                    integers[0]
                } else {
                    integers[1]
                };
                self.pairs(count, true, lines);
            }
            "k" | "K" => {
                for _ in 0..self.integer(words[0]) {
                    self.integer(lines.next().expect("a column count"));
                }
            }
            "0" | "1" | "2" | "3" | "4" => words.iter().for_each(|w| self.number(w)),
            _ => words.iter().for_each(|w| {
                self.integer(w);
            }),
        }
    }
}
