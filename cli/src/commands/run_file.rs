//! Run files: their contents, their text (for the line numbers of errors), and their paths.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use clap::Args;
use semismooth::output::OutputError;
use serde::de::DeserializeOwned;
use toml::Spanned;

use super::error::CommandError;

/// The arguments of commands that read a run file.
#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// The run, a TOML file; `semismooth init` writes one as a starting point
    pub(super) run: PathBuf,
    /// JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    /// No table, no progress
    #[arg(long, short)]
    pub(super) quiet: bool,
    /// Folder for the results, instead of the one in the run file
    #[arg(long)]
    pub(super) out: Option<PathBuf>,
    /// Pictures as PDF in addition to SVG
    #[arg(long)]
    pub(super) pdf: bool,
}

impl RunArgs {
    /// The files of a picture.
    pub(super) fn pictures(&self, name: &str) -> Vec<String> {
        let kinds = if self.pdf { &["svg", "pdf"][..] } else { &["svg"] };
        kinds.iter().map(|kind| format!("{name}.{kind}")).collect()
    }

    /// Writes a picture into a folder.
    pub(super) fn draw(
        &self,
        folder: &Path,
        name: &str,
        write: impl Fn(PathBuf) -> Result<(), OutputError>,
    ) -> Result<(), CommandError> {
        for file in self.pictures(name) {
            write(folder.join(file)).map_err(|e| CommandError::failed("the picture", e))?;
        }
        Ok(())
    }
}

/// A run file and its parsed contents.
pub(super) struct RunFile<I> {
    path: PathBuf,
    text: String,
    pub(super) input: I,
}

impl<I: DeserializeOwned> RunFile<I> {
    pub(super) fn read(path: &Path) -> Result<Self, CommandError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| CommandError::File {
            path: name.clone(),
            source,
        })?;
        let input = toml::from_str(&text).map_err(|source| CommandError::Toml {
            path: name,
            source: Box::new(source),
        })?;
        Ok(Self {
            path: path.into(),
            text,
            input,
        })
    }

    /// Resolves a path relative to the run file.
    pub(super) fn relative(&self, path: &str) -> PathBuf {
        self.path
            .parent()
            .map_or_else(|| path.into(), |folder| folder.join(path))
    }

    /// The error of a value, with its line.
    pub(super) fn wrong<T>(
        &self,
        place: &Spanned<T>,
        key: &str,
        what: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> CommandError {
        let before = self.text.get(..place.span().start).unwrap_or_default();
        CommandError::Value {
            path: self.path.display().to_string(),
            line: before.matches('\n').count() + 1,
            key: key.to_owned(),
            source: what.into(),
        }
    }

    /// Creates the folder for results, that of the command line or else that of the run file.
    pub(super) fn results(&self, asked: Option<&PathBuf>, own: &str) -> Result<PathBuf, CommandError> {
        let folder = asked.cloned().unwrap_or_else(|| self.relative(own));
        std::fs::create_dir_all(&folder).map_err(write_failed(&folder))?;
        Ok(folder)
    }
}

pub(super) fn create(path: &Path) -> Result<BufWriter<File>, CommandError> {
    Ok(BufWriter::new(File::create(path).map_err(write_failed(path))?))
}

pub(super) fn write_failed(path: &Path) -> impl FnOnce(std::io::Error) -> CommandError {
    let path = path.display().to_string();
    move |source| CommandError::File { path, source }
}
