//! Runs the programs of the lessons and compares what they print and draw with the files in `out` that the text includes; and the pages
//! of the guide with those of the crate's documentation.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Outcome;
use crate::compare::difference;
use crate::guide;
use crate::shown;

/// What is to be run.
pub struct Task {
    /// Whether outputs are put into the book, or compared with it.
    pub writes: bool,
    /// The Rust programs, LESSON/PROGRAM: this program runs them itself, called with their names.
    pub programs: Vec<&'static str>,
    /// An interpreter with the package `semismooth`.
    pub python: Option<PathBuf>,
    /// The program `semismooth`.
    pub cli: Option<PathBuf>,
    /// Folders of lessons; all when empty.
    pub lessons: Vec<String>,
}

/// A program of a lesson: LESSON/PROGRAM.EXTENSION.
struct Program {
    path: PathBuf,
    file: String,
}

/// The outputs of a run, by the name of their file in `out`.
type Outputs = BTreeMap<String, String>;

/// The results of all runs.
#[derive(Default)]
struct Tally {
    ran: usize,
    skipped: Vec<String>,
    wrong: Vec<String>,
}

/// Runs all programs of the lessons, and says what differs from the book.
///
/// # Errors
/// Differences, programs that fail, files that cannot be read or written.
pub fn all(task: &Task) -> Outcome<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("lessons");
    let mut lessons = Vec::new();
    for entry in fs::read_dir(&root)? {
        let entry = entry?;
        if entry.path().join("lesson.md").exists() {
            lessons.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    lessons.sort();
    if let Some(lesson) = task.lessons.iter().find(|l| !lessons.contains(l)) {
        return Err(format!(
            "there is no lesson {lesson}; there are {}",
            lessons.join(", ")
        )
        .into());
    }
    let mut tally = Tally::default();
    for lesson in lessons
        .iter()
        .filter(|l| task.lessons.is_empty() || task.lessons.contains(l))
    {
        one(task, &root.join(lesson), lesson, &mut tally)?;
    }
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/guide");
    tally
        .wrong
        .extend(guide::pages(&source, &root.join("guide"), task.writes)?);
    for name in &tally.skipped {
        println!("{name}: skipped, what runs it is not there");
    }
    let counts = [tally.ran, tally.skipped.len(), tally.wrong.len()];
    println!(
        "{} programs ran, {} skipped; {} differences from the book",
        counts[0], counts[1], counts[2]
    );
    match tally.wrong.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "{}\nif that is right: semismooth-book write",
            tally.wrong.join("\n")
        )
        .into()),
    }
}

fn one(task: &Task, folder: &Path, lesson: &str, tally: &mut Tally) -> Outcome<()> {
    let mut outputs = Outputs::new();
    let mut left_out = Vec::new();
    for program in programs(folder)? {
        let name = format!("{lesson}/{}", program.file);
        let begun = std::time::Instant::now();
        match run(task, lesson, &program) {
            Ok(Some(found)) => {
                println!("{name}: ran in {:.1} s", begun.elapsed().as_secs_f64());
                tally.ran += 1;
                outputs.extend(found);
            }
            Ok(None) => {
                left_out.push(format!("{}.txt", program.file));
                tally.skipped.push(name);
            }
            Err(e) => tally.wrong.push(format!("{name}: {e}")),
        }
    }
    let out = folder.join("out");
    if task.writes {
        fs::create_dir_all(&out)?;
        for entry in fs::read_dir(&out)? {
            let entry = entry?;
            if !left_out.contains(&entry.file_name().to_string_lossy().into_owned())
            {
                fs::remove_file(entry.path())?;
            }
        }
        for (name, text) in &outputs {
            fs::write(out.join(name), text)?;
        }
    }
    let path = folder.join("lesson.md");
    let mut text = fs::read_to_string(&path)?;
    let fresh = shown::refreshed(&text, folder)
        .map_err(|e| format!("{lesson}/lesson.md: {e}"))?;
    if task.writes && fresh != text {
        fs::write(&path, &fresh)?;
        text.clone_from(&fresh);
    }
    if let Some(what) = difference("lesson.md", &text, &fresh) {
        tally.wrong.push(format!("{lesson}/lesson.md: {what}"));
    }
    let wrong = judge(&out, &outputs, &left_out, &text)?;
    tally
        .wrong
        .extend(wrong.into_iter().map(|w| format!("{lesson}/{w}")));
    Ok(())
}

fn programs(folder: &Path) -> Outcome<Vec<Program>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let known = path
            .extension()
            .is_some_and(|e| e == "rs" || e == "py" || e == "sh");
        if let (true, Some(file)) = (known, path.file_name()) {
            let file = file.to_string_lossy().into_owned();
            found.push(Program { path, file });
        }
    }
    found.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(found)
}

/// Runs one program in an empty folder; `None` where the interpreter or program that it needs was not given.
fn run(task: &Task, lesson: &str, program: &Program) -> Outcome<Option<Outputs>> {
    let here = tempfile(lesson, &program.file)?;
    let mut command = match program.file.rsplit_once('.') {
        Some((name, "rs")) => {
            let name = format!("{lesson}/{name}");
            if !task.programs.contains(&name.as_str()) {
                return Err("is not in the list of book/src/programs.rs".into());
            }
            let mut command = Command::new(std::env::current_exe()?);
            command.args(["run", &name]);
            command
        }
        Some((_, "py")) => {
            let Some(python) = &task.python else {
                return Ok(None);
            };
            let mut command = Command::new(
                fs::canonicalize(python.parent().unwrap_or(Path::new(".")))?
                    .join(python.file_name().ok_or("no program")?),
            );
            command.arg("-B").arg(&program.path);
            command
        }
        _ => {
            let Some(cli) = &task.cli else {
                return Ok(None);
            };
            let cli = fs::canonicalize(cli)?;
            let folder = cli.parent().unwrap_or(Path::new("/")).to_owned();
            let path = std::env::var_os("PATH").unwrap_or_default();
            let path = std::env::join_paths(
                std::iter::once(folder).chain(std::env::split_paths(&path)),
            )?;
            let mut command = Command::new("sh");
            command.env("PATH", path).arg("-eu").arg(&program.path);
            inputs(&program.path, &here)?;
            command
        }
    };
    let ran = command.current_dir(&here).output()?;
    if !ran.status.success() {
        return Err(format!(
            "{}\n{}",
            ran.status,
            String::from_utf8_lossy(&ran.stderr)
        )
        .into());
    }
    let mut outputs = Outputs::from([(
        format!("{}.txt", program.file),
        String::from_utf8(ran.stdout)?,
    )]);
    for entry in fs::read_dir(&here)? {
        let path = entry?.path();
        // Commands leave files of the program, whose pictures are tested elsewhere.
        let drawn = !program.file.ends_with(".sh")
            && path.extension().is_some_and(|e| e == "svg");
        if let (true, Some(name)) = (drawn, path.file_name()) {
            outputs.insert(
                name.to_string_lossy().into_owned(),
                fs::read_to_string(&path)?,
            );
        }
    }
    fs::remove_dir_all(&here)?;
    Ok(Some(outputs))
}

/// Commands find the run files of their lesson in the folder in which they are started.
fn inputs(commands: &Path, here: &Path) -> Outcome<()> {
    for entry in fs::read_dir(commands.parent().unwrap_or(Path::new(".")))? {
        let path = entry?.path();
        let read = path.extension().is_some_and(|e| e == "toml" || e == "json");
        if let (true, Some(name)) = (read, path.file_name()) {
            fs::copy(&path, here.join(name))?;
        }
    }
    Ok(())
}

fn tempfile(lesson: &str, file: &str) -> Outcome<PathBuf> {
    let here = std::env::temp_dir()
        .join(format!("semismooth-book-{}", std::process::id()))
        .join(lesson)
        .join(file);
    if here.exists() {
        fs::remove_dir_all(&here)?;
    }
    fs::create_dir_all(&here)?;
    Ok(here)
}

/// What is wrong with a lesson: outputs that changed, that no program writes, or that its text does not show.
fn judge(
    out: &Path,
    outputs: &Outputs,
    left_out: &[String],
    text: &str,
) -> Outcome<Vec<String>> {
    let mut wrong = Vec::new();
    for (name, found) in outputs {
        let shown = fs::read_to_string(out.join(name)).unwrap_or_default();
        if let Some(what) = difference(name, &shown, found) {
            wrong.push(format!("out/{name}: {what}"));
        }
    }
    for entry in fs::read_dir(out)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if !outputs.contains_key(&name) && !left_out.contains(&name) {
            wrong.push(format!("out/{name}: no program makes it"));
        }
        let program = name.strip_suffix(".txt").unwrap_or(&name);
        if !text.contains(&format!("out/{name}")) {
            wrong.push(format!("out/{name}: the lesson does not show it"));
        }
        if program != name && !text.contains(&shown::mark(program)) {
            wrong.push(format!("{program}: the lesson does not show it"));
        }
    }
    Ok(wrong)
}
