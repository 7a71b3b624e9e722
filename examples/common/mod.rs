//! Common parts of the examples: exit status, files, random numbers.
#![allow(dead_code)]

use std::error::Error;
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use semismooth::contact::{FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::sparse::Matrix;

/// As the standard one, but a closed or full output ends the program without a panic.
macro_rules! println {
    ($($arguments:tt)*) => {
        $crate::common::print_line(format_args!($($arguments)*))
    };
}

pub(crate) mod bars;
pub(crate) mod squares;

pub(crate) type Outcome<T> = Result<T, Box<dyn Error>>;

/// Exit status of a program that Ctrl-C ended.
pub(crate) const INTERRUPTED: u8 = 130;

/// Ctrl-C ended the program before its work was done; the text describes the partial results.
#[derive(Debug)]
pub(crate) struct Interrupted(pub(crate) String);

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "interrupted: {}", self.0)
    }
}

impl Error for Interrupted {}

/// The arguments; failing to write the help is an error, as for all output.
pub(crate) fn parse<A: clap::Parser>() -> A {
    A::try_parse().unwrap_or_else(|e| {
        if !e.use_stderr() {
            written(e.print().and_then(|()| std::io::stdout().flush()));
            std::process::exit(e.exit_code());
        }
        e.exit()
    })
}

/// Prints errors to standard error, and returns the exit status.
pub(crate) fn exit(outcome: Outcome<()>) -> ExitCode {
    let code = match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) if e.is::<Interrupted>() => {
            eprintln!("{e}");
            ExitCode::from(INTERRUPTED)
        }
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    };
    written(std::io::stdout().flush());
    code
}

pub(crate) fn print_line(text: fmt::Arguments<'_>) {
    written(writeln!(std::io::stdout(), "{text}"));
}

/// A reader that closes the pipe early (`| head`) is no failure; a full disk is.
fn written(outcome: std::io::Result<()>) {
    match outcome {
        Ok(()) => {}
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => std::process::exit(0),
        Err(e) => {
            eprintln!("error: cannot write the output: {e}");
            std::process::exit(1);
        }
    }
}

/// An example ends with an error where one of its claims does not hold.
pub(crate) fn ensure(holds: bool, claim: &str) -> Outcome<()> {
    match holds {
        true => Ok(()),
        false => Err(format!("this does not hold: {claim}").into()),
    }
}

/// Numbers with so many decimals, separated by commas.
pub(crate) fn list(values: &[f64], decimals: usize) -> String {
    let words: Vec<String> = values.iter().map(|v| format!("{v:.decimals$}")).collect();
    words.join(", ")
}

/// "1 solution", "2 solutions".
pub(crate) fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// A file in a folder, which is created if necessary.
pub(crate) fn file_in(folder: &Path, name: &str) -> Outcome<PathBuf> {
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("cannot make the folder {}: {e}", folder.display()))?;
    Ok(folder.join(name))
}

/// The folder with a discrete problem that comes with the repository.
pub(crate) fn shipped_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data/block_linear_10x20_F0.5")
}

/// The problems in a folder of `tests/data`.
fn shipped(folder: &str) -> Outcome<Vec<PathBuf>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(folder);
    let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "json") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// The files given, or the problems in a folder of `tests/data`.
pub(crate) fn files_or_shipped(files: &[PathBuf], folder: &str) -> Outcome<Vec<PathBuf>> {
    match files {
        [] => shipped(folder),
        files => Ok(files.to_vec()),
    }
}

/// The argument `--max-time`.
pub(crate) fn time_limit(seconds: Option<f64>) -> Outcome<Option<Duration>> {
    let limit = |s| Duration::try_from_secs_f64(s).map_err(|e| format!("--max-time {s}: {e}"));
    Ok(seconds.map(limit).transpose()?)
}

/// The largest difference of two points; infinite where their lengths differ.
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    match a.len() == b.len() {
        true => a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
        false => f64::INFINITY,
    }
}

/// The beginning of a list of numbers.
pub(crate) fn short_list(x: &[f64]) -> String {
    const SHOWN: usize = 5;
    let head: Vec<_> = x.iter().take(SHOWN).map(|v| format!("{:.6}", v + 0.0)).collect();
    let more = if x.len() > SHOWN { ", …" } else { "" };
    format!("({}{more})", head.join(", "))
}

/// The largest excess of the numbers, of Newton steps on finer and finer grids, over the first of them.
pub(crate) fn growth(counts: &[usize]) -> usize {
    let first = counts.first().copied().unwrap_or_default();
    counts.iter().max().map_or(0, |most| most - first)
}

/// A small generator of reproducible random numbers (xorshift64*, Vigna 2016).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        // 0 would stay 0; neighbouring seeds are spread by an odd factor.
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Uniform in [−1, 1).
    pub(crate) fn symmetric(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        bits as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Three contact nodes, weakly coupled, under the load f(α) = f0 + α f1: 17 solutions at α = 0, five branches, four of them closed.
pub(crate) fn five_branches() -> Outcome<FullContact<PlanarCoulomb>> {
    let stiffness = Matrix::from_rows(&[
        [2.0, -1.3, -0.2, 0.0, 0.0, -0.3],
        [-1.3, 2.1, -0.3, 0.1, -0.2, 0.2],
        [-0.2, -0.3, 1.9, -0.8, 0.2, 0.1],
        [0.0, 0.1, -0.8, 1.9, 0.0, -0.1],
        [0.0, -0.2, 0.2, 0.0, 2.0, -1.1],
        [-0.3, 0.2, 0.1, -0.1, -1.1, 2.3],
    ])?;
    let pick = |first: usize| -> Outcome<Matrix> {
        let entries: Vec<_> = (0..3).map(|i| (i, 2 * i + first, 1.0)).collect();
        Ok(Matrix::from_triplets(3, 6, &entries)?)
    };
    let load = LoadPath::affine(
        vec![1.6, -2.3, 0.7, -1.9, 1.5, -3.1],
        vec![-0.2, -0.6, -0.9, 0.4, 0.9, -0.2],
    );
    let friction = FrictionCoefficient::nodal(vec![5.5, 7.75, 8.75])?;
    Ok(FullContact::planar(
        stiffness,
        pick(0)?,
        pick(1)?,
        load,
        friction,
    )?)
}
