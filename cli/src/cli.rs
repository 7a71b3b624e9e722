//! The program: arguments, files, exit codes.

use std::ffi::OsString;
use std::fs;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use semismooth::complementarity::McpIteration;
use thiserror::Error;

use crate::commands;
use crate::model::Model;
use crate::names::Names;
use crate::nl::{self, NlError};
use crate::options::{OPTIONS, OptionError, Options};
use crate::solution::Solution;
use crate::solve::{SolveError, solve};

/// Name and version, as `-v` prints them.
pub const VERSION: &str = concat!("semismooth ", env!("CARGO_PKG_VERSION"));

/// The variable of the environment that holds options.
pub const ENVIRONMENT: &str = "semismooth_options";

/// Why a run ended without a result.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CliError {
    /// The command line cannot be understood.
    #[error("{0}")]
    Usage(String),
    /// An option of the command line.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// An option of the environment.
    #[error("in ${ENVIRONMENT}: {0}")]
    Environment(#[source] OptionError),
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// Why not.
        source: io::Error,
    },
    /// A file that is not a valid .nl file.
    #[error("{path}: {source}")]
    Nl {
        /// The file.
        path: String,
        /// The first fault.
        source: NlError,
    },
    /// A problem that this program cannot solve.
    #[error("{path}: {source}")]
    Solve {
        /// The file.
        path: String,
        /// Why it cannot be solved here.
        source: SolveError,
    },
    /// The result could not be printed.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
}

/// The parsed command line.
#[derive(Debug, Default)]
struct Request {
    stub: Option<PathBuf>,
    ampl: bool,
    write: bool,
    version: bool,
    help: bool,
    options: Vec<String>,
}

impl Request {
    fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Self, CliError> {
        let usage = |what: String| Err(CliError::Usage(format!("{what}; see --help")));
        let mut request = Self::default();
        let mut flags = true;
        for argument in arguments {
            match argument.to_str() {
                Some("--") => flags = false,
                Some("-v" | "--version") if flags => request.version = true,
                Some("-=" | "-?" | "-h" | "--help") if flags => request.help = true,
                Some("-AMPL") if flags => request.ampl = true,
                Some("-s") if flags => request.write = true,
                // Suppresses the echo of options, which this program never prints.
                Some("-e") if flags => {}
                Some(flag) if flags && flag.starts_with('-') && request.stub.is_none() => {
                    return usage(format!("{flag} is not known"));
                }
                _ if request.stub.is_none() => request.stub = Some(argument.into()),
                Some(option) => request.options.push(option.into()),
                None => return usage(format!("{argument:?} is no option")),
            }
        }
        Ok(request)
    }
}

/// Runs the program with its arguments (without the name of the program) and the options of the environment.
///
/// # Errors
/// A [`CliError`] if there is no result. A solve without a solution is no error: AMPL reads its status from the .sol file.
pub fn run(
    arguments: impl IntoIterator<Item = OsString>,
    environment: Option<&str>,
    out: &mut dyn Write,
) -> Result<(), CliError> {
    let request = match Request::parse(arguments)? {
        Request { version: true, .. } => return Ok(writeln!(out, "{VERSION}")?),
        Request { help: true, .. } => return help(out),
        request => request,
    };
    let Some(stub) = &request.stub else {
        return Err(CliError::Usage(
            "which problem? semismooth COMMAND FILE, or semismooth FILE.nl; see --help".into(),
        ));
    };
    if let Some(command) = meant(stub).filter(|_| !request.ampl) {
        return Err(CliError::Usage(format!(
            "there is no command and no file \"{}\"; did you mean {command}? See --help",
            stub.display()
        )));
    }
    let mut options = Options::default();
    options
        .take(environment.unwrap_or_default())
        .map_err(CliError::Environment)?;
    options.take(&request.options.join(" "))?;
    let (input, output) = files(stub);
    let model = read(&input)?;
    let solution = {
        let trace = &mut *out;
        let mut observe = |i: &McpIteration| match options.outlev > 1 && iteration(trace, i).is_err() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let solution = solve(&model, &options, &mut observe);
        solution.map_err(|source| CliError::Solve {
            path: input.display().to_string(),
            source,
        })?
    };
    let solution = Solution {
        message: format!("{VERSION}: {}", solution.message),
        ..solution
    };
    if request.ampl || request.write || options.wantsol & 1 != 0 {
        fs::write(&output, solution.to_sol(&model.header)).map_err(|source| file_error(&output, source))?;
    }
    report(&options, &solution, out)
}

/// The command that a word without a file of that name is a misspelling of, if it is one.
fn meant(stub: &Path) -> Option<String> {
    let word = stub
        .to_str()
        .filter(|_| !files(stub).0.exists() && stub.extension().is_none())?;
    let distances = commands::names()
        .into_iter()
        .map(|name| (misspelt(word, &name), name));
    let (distance, name) = distances.min()?;
    (distance <= 2 && distance < name.len() / 2).then_some(name)
}

/// The number of letters that are missing, too many or others, two that are exchanged being one (optimal string alignment).
fn misspelt(word: &str, name: &str) -> usize {
    let [a, b] = [word, name].map(|w| w.chars().collect::<Vec<_>>());
    let mut rows = vec![(0..=b.len()).collect::<Vec<_>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let same = usize::from(a[i - 1] != b[j - 1]);
            let mut least = (rows[i - 1][j] + 1)
                .min(row[j - 1] + 1)
                .min(rows[i - 1][j - 1] + same);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

/// The .nl and .sol files of a stub, which AMPL passes without extension and Pyomo with one.
fn files(stub: &Path) -> (PathBuf, PathBuf) {
    let base = match stub.extension() {
        Some(extension) if extension == "nl" => stub.with_extension(""),
        _ => stub.to_path_buf(),
    };
    let with = |extension: &str| {
        let mut name = base.clone().into_os_string();
        name.push(extension);
        PathBuf::from(name)
    };
    (with(".nl"), with(".sol"))
}

fn file_error(path: &Path, source: io::Error) -> CliError {
    CliError::File {
        path: path.display().to_string(),
        source,
    }
}

fn read(path: &Path) -> Result<Model, CliError> {
    let bytes = fs::read(path).map_err(|source| file_error(path, source))?;
    let mut model = nl::read(&bytes).map_err(|source| CliError::Nl {
        path: path.display().to_string(),
        source,
    })?;
    model.names = Names::beside(path, model.lower.len(), model.rows.len());
    Ok(model)
}

fn iteration(out: &mut dyn Write, i: &McpIteration) -> io::Result<()> {
    let (index, residual, damping) = (i.index, i.residual, i.damping);
    writeln!(
        out,
        "{index:6}  residual {residual:9.2e}  step {damping:8.1e}  {}",
        i.strategy.name()
    )
}

fn report(options: &Options, solution: &Solution, out: &mut dyn Write) -> Result<(), CliError> {
    if options.outlev > 0 && options.wantsol & 8 == 0 {
        writeln!(out, "{}", solution.message)?;
    }
    for (bit, name, values) in [(2, "x", &solution.x), (4, "dual", &solution.duals)] {
        if options.wantsol & bit != 0 {
            for (index, value) in values.iter().enumerate() {
                writeln!(out, "{name}[{index}] = {value:?}")?;
            }
        }
    }
    Ok(())
}

fn help(out: &mut dyn Write) -> Result<(), CliError> {
    writeln!(
        out,
        "{VERSION}: equations and structures with kinks: contact, friction, stops, switches.\n\n\
         semismooth COMMAND FILE.toml\n"
    )?;
    for (name, what) in commands::jobs() {
        writeln!(out, "  {name:12} {what}")?;
    }
    writeln!(
        out,
        "\n  semismooth init COMMAND         writes a commented FILE.toml to begin with\n  \
         semismooth help COMMAND         its arguments\n  \
         semismooth help                 all commands:\n  {}\n\n\
         As a solver for AMPL and Pyomo, of mixed complementarity problems, square systems,\n\
         first-order conditions of nonlinear programs, and programs with equilibrium constraints:\n\n\
         semismooth FILE[.nl] [-AMPL] [option=value …]\n\n  \
         -AMPL      write FILE.sol, as AMPL and Pyomo ask for\n  \
         -s         the same\n  \
         -v         print the version\n  \
         -=         print this list\n\n\
         Options, also from the environment variable {ENVIRONMENT}; the default in brackets:\n",
        commands::names().join(", ")
    )?;
    for (name, meaning) in OPTIONS {
        writeln!(out, "  {name:12} {meaning}")?;
    }
    writeln!(
        out,
        "\nsolve_result_num: 0 solved, 100 in doubt, 200 no solution (proven), 300 unbounded, 400 iterations,\n\
         401 time, 500 no progress, 501 stationary, 502 iterates tend to infinity, 503 no values,\n\
         504 no KKT point (proven), 505 interrupted. Exit code 1: the file or an option is not understood."
    )?;
    Ok(())
}
