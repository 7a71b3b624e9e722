//! The public interface is what `tests/data/public_api.txt` lists: one line per public item, found by reading `src` from `lib.rs` on
//! (modules, re-exports, macros that write items; all features). A change shows as a difference of that file:
//!
//!     UPDATE_PUBLIC_API=1 cargo test --test public_api

mod crate_tree;
mod expand;
mod lines;
mod print;

use std::collections::BTreeSet;
use std::path::Path;

const LIST: &str = "tests/data/public_api.txt";

#[test]
fn public_api_is_the_one_on_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found = lines::all(&crate_tree::Crate::read(&root.join("src")));
    let text: String = found.iter().map(|line| format!("{line}\n")).collect();
    if std::env::var_os("UPDATE_PUBLIC_API").is_some() {
        std::fs::write(root.join(LIST), text).unwrap();
        return;
    }
    let filed = std::fs::read_to_string(root.join(LIST)).unwrap();
    let filed: BTreeSet<&str> = filed.lines().collect();
    let found: BTreeSet<&str> = text.lines().collect();
    let mut changes: Vec<(&str, char)> = filed.difference(&found).map(|line| (*line, '-')).collect();
    changes.extend(found.difference(&filed).map(|line| (*line, '+')));
    changes.sort_unstable();
    let shown: String = changes
        .iter()
        .map(|(line, sign)| format!("{sign} {line}\n"))
        .collect();
    assert!(
        changes.is_empty(),
        "the public interface is not that of {LIST}:\n{shown}if this is meant, run: UPDATE_PUBLIC_API=1 cargo test --test public_api"
    );
}

/// Options can be written as one chain: each field of each `…Options` has a builder, and each `…Options` a check of its ranges.
#[test]
fn every_option_has_a_builder() {
    let filed = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(LIST)).unwrap();
    let names: BTreeSet<&str> = filed
        .lines()
        .filter_map(|line| line.split_once(": "))
        .map(|(name, _)| name)
        .collect();
    // Two fields share one builder.
    let together = [
        "newton::NewtonOptions.absolute_tolerance",
        "newton::NewtonOptions.relative_tolerance",
    ];
    assert!(names.contains("newton::NewtonOptions::with_tolerances"));
    // Its only conditions depend on the problem.
    let unchecked = ["complementarity::pivoting::LemkeOptions"];
    let mut missing = Vec::new();
    for (options, field) in names.iter().filter_map(|name| name.split_once('.')) {
        if !options.ends_with("Options") {
            continue;
        }
        let builder = format!("{options}::with_{field}");
        if !names.contains(&builder[..]) && !together.contains(&&format!("{options}.{field}")[..]) {
            missing.push(builder);
        }
        let check = format!("{options}::validate");
        if !names.contains(&check[..]) && !unchecked.contains(&options) {
            missing.push(check);
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

/// The walk finds each way in which an item becomes public, and no private item.
#[test]
fn the_list_follows_modules_uses_and_macros() {
    let source = r#"
        mod a {
            macro_rules! make { ($(#[$doc:meta])* $name:ident($($arg:ident: $ty:ty),*)) => {
                $(#[$doc])* pub struct $name($(pub $ty),*);
                impl $name { pub fn new($($arg: $ty),*) -> Self { Self($($arg),*) } fn hidden() {} }
            } }
            make! { /// Made.
                Made(x: f64, y: &'static [usize]) }
            macro_rules! each {
                (@one $name:ident) => { pub struct $name; };
                ($($name:ident)*) => { $($crate::a::each!(@one $name);)* };
            }
            each! { One }
            #[derive(Debug, Clone)]
            pub struct Renamed { pub shown: Vec<f64>, hidden: u8 }
            pub struct Unreachable;
            pub trait Law { const N: usize; fn law(&self) -> f64; fn more(&mut self) {} }
            impl<L: Law + ?Sized> Law for &L { const N: usize = 1; fn law(&self) -> f64 { 0.0 } }
            impl From<u8> for Renamed { fn from(_: u8) -> Self { loop {} } }
            impl From<u8> for Unreachable { fn from(_: u8) -> Self { loop {} } }
            #[non_exhaustive]
            pub enum Error { #[error("x")] A(#[from] std::fmt::Error), B { index: usize } }
            #[cfg(test)]
            pub fn test_only() {}
        }
        pub mod b {
            pub use super::a::{Law, Made, One};
            pub use crate::a::Renamed as Known;
            pub(crate) fn hidden() {}
            #[cfg(feature = "json")]
            pub fn free<T: Law>(x: &mut [T], f: impl Fn(f64) -> Result<(), Error>) -> Option<usize> { None }
        }
        mod c { pub use crate::a::Error; }
        pub use c::*;
        pub mod prelude { pub use crate::b::Known; }
    "#;
    let found = lines::all(&crate_tree::Crate::parse(source));
    let expected = [
        "Error: #[non_exhaustive] enum Error",
        "Error: impl From<std::fmt::Error> for Error",
        "Error::A: variant (std::fmt::Error)",
        "Error::B: variant { index: usize }",
        "b: mod",
        "b::Known: #[derive] impl Clone",
        "b::Known: #[derive] impl Debug",
        "b::Known: impl From<u8> for Renamed",
        "b::Known: struct Renamed { .. }",
        "b::Known.shown: Vec<f64>",
        "b::Law: impl<L: Law + ?Sized> Law for &L",
        "b::Law: trait Law",
        "b::Law::N: const N: usize",
        "b::Law::law: fn law(&self) -> f64",
        "b::Law::more: provided fn more(&mut self)",
        "b::Made: struct Made",
        "b::Made.0: f64",
        "b::Made.1: &'static [usize]",
        "b::Made::new: fn new(x: f64, y: &'static [usize]) -> Self",
        "b::One: struct One",
        "b::free: [feature = \"json\"] fn free<T: Law>(x: &mut [T], f: impl Fn(f64) -> Result<(), Error>) -> Option<usize>",
        "prelude: mod",
        "prelude::Known: use b::Known",
    ];
    let found: BTreeSet<&str> = found.iter().map(String::as_str).collect();
    assert_eq!(found, BTreeSet::from(expected));
}
