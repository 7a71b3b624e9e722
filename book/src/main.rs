//! The programs of the lessons in one, and the commands that check the book against them.

mod programs;

use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use semismooth_book::{Outcome, formulas, record};

const USAGE: &str = "usage:
  semismooth-book check [--python PROGRAM] [--cli PROGRAM] [LESSON…]   run all programs, compare with the book
  semismooth-book write [--python PROGRAM] [--cli PROGRAM] [LESSON…]   run all programs, put their outputs into the book
  semismooth-book run LESSON/PROGRAM                                   run one program in the current folder
  semismooth-book formulas                                             a preprocessor that mdBook starts";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match answer(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}

fn answer(arguments: &[String]) -> Outcome<()> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["run", name] => programs::run(name),
        // mdBook asks first whether its renderer is supported.
        ["formulas", "supports", renderer] => match *renderer {
            "html" => Ok(()),
            other => Err(format!("no formulas for {other}").into()),
        },
        ["formulas"] => {
            let mut book = String::new();
            std::io::stdin().read_to_string(&mut book)?;
            let book = formulas::typeset_book(&book)?;
            Ok(std::io::stdout().write_all(book.as_bytes())?)
        }
        [mode @ ("check" | "write"), rest @ ..] => {
            let mut task = record::Task {
                writes: *mode == "write",
                programs: programs::PROGRAMS
                    .iter()
                    .map(|(name, _)| *name)
                    .collect(),
                python: None,
                cli: None,
                lessons: Vec::new(),
            };
            let mut rest = rest.iter();
            while let Some(word) = rest.next() {
                let mut program = || rest.next().map(PathBuf::from).ok_or(USAGE);
                match *word {
                    "--python" => task.python = Some(program()?),
                    "--cli" => task.cli = Some(program()?),
                    flag if flag.starts_with('-') => return Err(USAGE.into()),
                    lesson => task.lessons.push(lesson.to_owned()),
                }
            }
            record::all(&task)
        }
        _ => Err(USAGE.into()),
    }
}
