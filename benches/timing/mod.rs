//! Least times of calls, printed beside those of `benches/baseline.csv`; see `benches/README.md`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Calls are repeated in one measurement until it takes this long, so that the clock is fine enough.
const MEASUREMENT: Duration = Duration::from_millis(20);
/// Measurements go on for so long, but are this many at least.
const LONG: Duration = Duration::from_secs(1);
const ROUNDS: usize = 5;
/// A time longer than that of the baseline by this factor is marked.
const SLOWER: f64 = 1.1;

/// The measurements of one benchmark program.
pub struct Bench {
    program: &'static str,
    filters: Vec<String>,
    save: bool,
    known: BTreeMap<String, f64>,
    measured: BTreeMap<String, f64>,
}

impl Bench {
    /// The seconds of one call of `f`.
    pub fn time<R>(&mut self, name: &str, f: impl FnMut() -> R) {
        self.time_each(name, 1, f);
    }

    /// The seconds of each of the `count` like things that a call of `f` does.
    pub fn time_each<R>(&mut self, name: &str, count: u64, mut f: impl FnMut() -> R) {
        let key = format!("{}/{name}", self.program);
        if !self.filters.is_empty() && !self.filters.iter().any(|part| key.contains(part.as_str())) {
            return;
        }
        let begun = Instant::now();
        black_box(f());
        let calls =
            (MEASUREMENT.as_secs_f64() / begun.elapsed().as_secs_f64().max(1e-9)).clamp(1.0, 1e6) as u32;
        let (mut least, mut rounds, begun) = (f64::INFINITY, 0, Instant::now());
        while rounds < ROUNDS || begun.elapsed() < LONG {
            let round = Instant::now();
            for _ in 0..calls {
                black_box(f());
            }
            least = least.min(round.elapsed().as_secs_f64() / f64::from(calls));
            rounds += 1;
        }
        let seconds = least / count as f64;
        let beside = match self.known.get(&key) {
            Some(known) if seconds > SLOWER * known => {
                format!("{:6.2} of the baseline: slower", seconds / known)
            }
            Some(known) => format!("{:6.2} of the baseline", seconds / known),
            None => String::new(),
        };
        println!("{key:<70} {seconds:.3e} s {beside}");
        self.measured.insert(key, seconds);
    }
}

/// Runs the parts of a benchmark program. Arguments: parts of the names that are wanted, `--save` to write the times into the baseline.
pub fn run(program: &'static str, parts: &[fn(&mut Bench)]) {
    let mut bench = Bench {
        program,
        filters: Vec::new(),
        save: false,
        known: baseline().map(|text| read(&text)).unwrap_or_default(),
        measured: BTreeMap::new(),
    };
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--save" => bench.save = true,
            // What Cargo adds.
            "--bench" => {}
            _ => bench.filters.push(argument),
        }
    }
    for part in parts {
        part(&mut bench);
    }
    if bench.save {
        bench.known.append(&mut bench.measured);
        if let Err(error) = write(&bench.known) {
            eprintln!("error: {}: {error}", path().display());
            std::process::exit(1);
        }
    }
}

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("benches/baseline.csv")
}

fn baseline() -> Option<String> {
    std::fs::read_to_string(path()).ok()
}

/// Lines `name,seconds`; names have no commas. What begins with # is a remark.
fn read(text: &str) -> BTreeMap<String, f64> {
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let pairs = lines.filter_map(|line| line.split_once(','));
    pairs
        .filter_map(|(name, seconds)| Some((name.to_owned(), seconds.trim().parse().ok()?)))
        .collect()
}

/// Remarks stay as they are.
fn write(known: &BTreeMap<String, f64>) -> std::io::Result<()> {
    let old = baseline().unwrap_or_default();
    let mut text = String::new();
    for remark in old.lines().filter(|line| line.starts_with('#')) {
        text += remark;
        text += "\n";
    }
    for (name, seconds) in known {
        let _ = writeln!(text, "{},{seconds:.4e}", name.replace(',', ";"));
    }
    std::fs::write(path(), text)
}
