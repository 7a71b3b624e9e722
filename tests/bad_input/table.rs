//! Records which functions of a module are tried with bad input, and checks that all of them are.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use semismooth::sparse::Matrix;

/// Not finite.
pub(crate) const BAD: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

/// Finite, but invalid where a positive number is required.
pub(crate) const NOT_POSITIVE: [f64; 2] = [0.0, -1.0];

pub(crate) fn rows(rows: &[&[f64]]) -> Matrix {
    Matrix::from_rows(rows).unwrap()
}

thread_local! {
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// The panic of a call, with its location; printed once, by the table. Not generic, so that it is compiled once for all calls.
fn panic_of(call: &mut dyn FnMut()) -> Option<String> {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let loud = take_hook();
        set_hook(Box::new(move |info| {
            let mine = PANIC.with_borrow_mut(|text| {
                let waiting = text == "waiting";
                if waiting {
                    *text = info.to_string();
                }
                waiting
            });
            if !mine {
                loud(info);
            }
        }));
    });
    PANIC.with_borrow_mut(|text| *text = "waiting".to_owned());
    let result = catch_unwind(AssertUnwindSafe(call));
    let told = PANIC.with_borrow_mut(std::mem::take);
    result.err().map(|_| told.replace('\n', " "))
}

pub(crate) struct Table {
    module: &'static str,
    entries: BTreeSet<&'static str>,
    failures: Vec<String>,
}

impl Table {
    pub(crate) fn new(module: &'static str) -> Self {
        Self {
            module,
            entries: BTreeSet::new(),
            failures: Vec::new(),
        }
    }

    /// The call is refused, with a message that contains `names`. There are hundreds of calls: the generic part only erases their types.
    pub(crate) fn refuses<T, E: Error + Send + Sync + 'static>(
        &mut self,
        entry: &'static str,
        input: &str,
        names: &str,
        call: impl FnOnce() -> Result<T, E>,
    ) {
        let mut call = Some(call);
        self.refused(entry, input, names, &mut || match call.take()?() {
            Ok(_) => None,
            Err(e) => Some(Box::new(e)),
        });
    }

    fn refused(
        &mut self,
        entry: &'static str,
        input: &str,
        names: &str,
        call: &mut dyn FnMut() -> Option<Box<dyn Error>>,
    ) {
        self.entries.insert(entry);
        let mut message = None;
        let panic = panic_of(&mut || message = call().map(|e| e.to_string()));
        let failure = match (panic, message) {
            (Some(panic), _) => panic,
            (None, None) => "not refused".to_owned(),
            (None, Some(message)) if message.contains(names) => return,
            (None, Some(message)) => format!("the message does not name {names:?}: {message}"),
        };
        self.failures.push(format!("{entry} of {input}: {failure}"));
    }

    /// The call returns, whatever its result.
    pub(crate) fn survives<T>(&mut self, entry: &'static str, input: &str, call: impl FnOnce() -> T) {
        let mut call = Some(call);
        self.survived(entry, input, &mut || {
            if let Some(call) = call.take() {
                call();
            }
        });
    }

    fn survived(&mut self, entry: &'static str, input: &str, call: &mut dyn FnMut()) {
        self.entries.insert(entry);
        if let Some(panic) = panic_of(call) {
            self.failures.push(format!("{entry} of {input}: {panic}"));
        }
    }

    /// The call succeeds, and its outcome is as described.
    pub(crate) fn holds(&mut self, entry: &'static str, claim: &str, call: impl FnOnce() -> bool) {
        let mut call = Some(call);
        self.held(entry, claim, &mut || call.take().is_some_and(|call| call()));
    }

    fn held(&mut self, entry: &'static str, claim: &str, call: &mut dyn FnMut() -> bool) {
        self.entries.insert(entry);
        let mut holds = false;
        match panic_of(&mut || holds = call()) {
            None if holds => {}
            None => self
                .failures
                .push(format!("{entry}: it does not hold that {claim}")),
            Some(panic) => self.failures.push(format!("{entry}: {claim}: {panic}")),
        }
    }

    /// Functions whose input cannot be bad, or that are tested elsewhere.
    pub(crate) fn exempt(&mut self, entries: &[&'static str], _reason: &str) {
        self.entries.extend(entries);
    }

    /// Nothing failed, and every function of the module that returns a `Result` was tried.
    pub(crate) fn finish(mut self) {
        let public = fallible(self.module);
        for missing in public.difference(&self.entries) {
            self.failures.push(format!("{missing} is not in the table"));
        }
        assert!(self.failures.is_empty(), "\n{}\n", self.failures.join("\n"));
    }
}

/// The public functions of a module that return a `Result`, less those of features that are off.
fn fallible(module: &str) -> BTreeSet<&'static str> {
    let list = include_str!("../data/public_api.txt");
    let within = |path: &str| path.split("::").next() == Some(module);
    let off = |line: &str| {
        [("svg", cfg!(feature = "svg")), ("json", cfg!(feature = "json"))]
            .iter()
            .any(|(name, on)| !on && line.contains(&format!("[feature = \"{name}\"]")))
    };
    list.lines()
        .filter(|line| !off(line))
        .filter_map(|line| line.split_once(": "))
        .filter(|(path, line)| within(path) && line.contains("fn ") && line.contains("-> Result<"))
        .map(|(path, _)| path)
        .collect()
}

/// The check of completeness itself works.
#[test]
fn functions_are_found() {
    let found = fallible("sparse");
    assert!(found.contains("sparse::Matrix::from_rows") && found.contains("sparse::read_vector"));
    assert!(!found.contains("sparse::Matrix::get"));
}

#[test]
#[should_panic(expected = "sparse::read_vector is not in the table")]
fn what_is_left_out_is_named() {
    Table::new("sparse").finish();
}

#[test]
#[should_panic(expected = "x of a bad index: panicked at")]
fn panics_are_reported() {
    let mut table = Table::new("no module");
    let nothing: Vec<f64> = Vec::new();
    table.survives("x", "a bad index", || nothing[std::hint::black_box(1)]);
    table.finish();
}
