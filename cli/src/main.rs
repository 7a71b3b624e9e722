//! See `semismooth --help` and `semismooth help`.

use std::io::{ErrorKind, Write};
use std::process::ExitCode;

use semismooth_cli::cli::{self, CliError, ENVIRONMENT};
use semismooth_cli::commands;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let mut out = std::io::stdout().lock();
    if commands::is_command(&arguments) {
        let result = commands::run(arguments, &mut out).and_then(|()| Ok(out.flush()?));
        return match result {
            Err(e) if e.is_closed_pipe() => ExitCode::SUCCESS,
            other => ended(other.map_err(|e| (e.code(), e.to_string()))),
        };
    }
    let environment = std::env::var_os(ENVIRONMENT).map(|v| v.to_string_lossy().into_owned());
    let result = cli::run(arguments, environment.as_deref(), &mut out).and_then(|()| Ok(out.flush()?));
    match result {
        // The reader of the output has closed the pipe (`| head`), which is no failure.
        Err(CliError::Output(e)) if e.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        other => ended(other.map_err(|e| (1, e.to_string()))),
    }
}

fn ended(result: Result<(), (u8, String)>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err((code, error)) => {
            eprintln!("semismooth: {error}");
            ExitCode::from(code)
        }
    }
}
