//! Memory for reading a file: a multiple of its size, whatever counts the file announces.

mod common;

use common::{header, to_binary};
use semismooth_cli::nl::read;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use std::alloc::System;

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Total bytes allocated while a file is read, per byte of the file.
fn factor(bytes: &[u8]) -> f64 {
    let region = Region::new(ALLOCATOR);
    let _ = read(bytes);
    let stats = region.change();
    stats.bytes_allocated as f64 / bytes.len() as f64
}

/// A single test, since all allocations of the process are counted.
#[test]
fn memory_is_a_multiple_of_the_bytes_read() {
    let n = 20_000;
    let announced = [
        format!("g3 1 1 0\n {n} 0 0\n"),
        format!("g3 1 1 0\n 1 {n} 0\n"),
        format!("g3 1 1 0\n 1 0 {n}\n"),
    ];
    let mut files: Vec<Vec<u8>> = Vec::new();
    // Announced counts that the rest of the file could hold, followed by other content.
    for head in announced {
        let head = head + " 0 0\n 0 0\n 0 0 0\n 0 0 0 1\n 0 0 0 0 0\n 0 0\n 0 0\n 0 0 0 0 0\n";
        files.push((head.clone() + &"#".repeat(n)).into_bytes());
        files.push((head + &"b\n".repeat(n / 2)).into_bytes());
    }
    // Defined variables that each refer to the one before, in every row; long lists of each kind; deep nesting.
    let mut text = header([2, 100, 0, 0, 100, 0, 100]);
    (0..100).for_each(|k| text += &format!("V{} 0 0\no2\nv{}\nn2\n", 2 + k, if k == 0 { 0 } else { 1 + k }));
    (0..100).for_each(|k| text += &format!("C{k}\nv{}\n", 101));
    text += &("r\n".to_owned() + &"3\n".repeat(100) + "b\n3\n3\n");
    (0..100).for_each(|k| text += &format!("J{k} 1\n0 0\n"));
    assert!(read(text.as_bytes()).is_ok());
    files.push(text.clone().into_bytes());
    files.push(to_binary(&text, false));
    for (operator, count) in [
        ("o54", true),
        ("o74", true),
        ("o60", true),
        ("o59", true),
        ("o41", false),
    ] {
        let (head, rest) = match count {
            true => (format!("{operator}\n{n}\n"), "v0\n".repeat(n)),
            false => (format!("{operator}\n").repeat(n), "v0\n".to_owned()),
        };
        let text = header([1, 1, 0, 0, 1, 0, 0]) + "C0\n" + &head + &rest + "r\n3\nb\n3\nJ0 1\n0 0\n";
        assert!(read(text.as_bytes()).is_ok(), "{operator}");
        files.push(text.clone().into_bytes());
        files.push(to_binary(&text, true));
        files.push(text.as_bytes()[..text.len() / 2].to_vec());
    }
    for bytes in files {
        let factor = factor(&bytes);
        let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).into_owned();
        assert!(
            factor < 100.0,
            "{factor} times the bytes of a file that begins with {shown}"
        );
    }
}
