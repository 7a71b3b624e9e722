//! What the examples share: exit status and files.
#![allow(dead_code)]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub(crate) mod bars;
pub(crate) mod squares;

pub(crate) type Outcome<T> = Result<T, Box<dyn Error>>;

/// Errors go to standard error, and the exit status tells.
pub(crate) fn exit(outcome: Outcome<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}

/// A file in a folder, which is made if need be.
pub(crate) fn file_in(folder: &Path, name: &str) -> Outcome<PathBuf> {
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("cannot make the folder {}: {e}", folder.display()))?;
    Ok(folder.join(name))
}

/// The folder with a discrete problem that comes with the repository.
pub(crate) fn shipped_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data/block_linear_10x20_F0.5")
}
