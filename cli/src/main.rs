//! See `semismooth --help`.

use std::io::Write;
use std::process::ExitCode;

use semismooth_cli::cli::{ENVIRONMENT, run};

fn main() -> ExitCode {
    let environment = std::env::var_os(ENVIRONMENT).map(|v| v.to_string_lossy().into_owned());
    let mut out = std::io::stdout().lock();
    let result = run(std::env::args_os().skip(1), environment.as_deref(), &mut out);
    match result.and_then(|()| Ok(out.flush()?)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("semismooth: {error}");
            ExitCode::FAILURE
        }
    }
}
