//! Tables of runs that are killed: all but the step under way is there.

mod common;

use std::cell::RefCell;
use std::io::Write;
use std::rc::Rc;

use semismooth::contact::{FrictionProblem, FrictionStart, first_point};
use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction, Event};
use semismooth::output::{Column, CsvWriter, OutputError, write_csv};

/// A file as another process sees it: what has been flushed. Fails from a given size on.
#[derive(Clone)]
struct Disk {
    buffer: Rc<RefCell<Vec<u8>>>,
    durable: Rc<RefCell<Vec<u8>>>,
    room: usize,
}

impl Disk {
    fn new(room: usize) -> Self {
        Self {
            buffer: Rc::default(),
            durable: Rc::default(),
            room,
        }
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.buffer.borrow().len() + bytes.len() > self.room {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        self.buffer.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.durable.borrow_mut().clone_from(&self.buffer.borrow());
        Ok(())
    }
}

fn problem() -> (FrictionProblem, Vec<f64>) {
    let case = common::cases().into_iter().find(|c| c.name == "p2_ex1").unwrap();
    let x = first_point(&case.problem, 8.0, &FrictionStart::Stick).unwrap();
    (case.problem, x)
}

fn run<'a>(map: &'a FrictionProblem, x: &[f64]) -> Continuation<'a, FrictionProblem> {
    let options = ContinuationOptions::default().with_parameter_range((0.0, 12.0));
    Continuation::new(map, x, Direction::Decreasing, options).unwrap()
}

fn columns<'a>() -> Vec<Column<'a>> {
    vec![Column::entry("u_nu1", 0), Column::entry("u_t1", 1)]
}

#[test]
fn every_event_is_flushed_before_the_next() {
    let (map, x) = problem();
    let disk = Disk::new(usize::MAX);
    let mut writer = CsvWriter::new(disk.clone(), &map, columns()).unwrap();
    let mut events = 0;
    for event in run(&map, &x) {
        writer.write(&event.unwrap()).unwrap();
        events += 1;
        let text = String::from_utf8(disk.durable.borrow().clone()).unwrap();
        assert!(text.ends_with("\r\n"));
        assert_eq!(text.lines().count(), 1 + events);
    }
    assert!(events > 20);
    // The same table as that of the whole branch.
    let branch = Branch::collect(run(&map, &x), |_| std::ops::ControlFlow::Continue(())).unwrap();
    let mut whole = Vec::new();
    write_csv(&mut whole, &map, &branch, &columns()).unwrap();
    assert_eq!(*disk.durable.borrow(), whole);
}

#[test]
fn a_full_disk_is_told_at_once() {
    let (map, x) = problem();
    let disk = Disk::new(1000);
    let mut writer = CsvWriter::new(disk, &map, columns()).unwrap();
    let failed = run(&map, &x)
        .map(|e| writer.write(&e.unwrap()))
        .find(Result::is_err);
    assert!(matches!(failed, Some(Err(OutputError::Io { .. }))));
}

/// Wherever a file is cut, the lines that are whole are those of the first events.
#[cfg(feature = "json")]
#[test]
fn a_file_that_is_cut_off_loses_its_last_line() {
    use semismooth::output::JsonLinesWriter;
    let (map, x) = problem();
    let mut file = Vec::new();
    let mut writer = JsonLinesWriter::new(&mut file, &map);
    let events: Vec<Event> = run(&map, &x).map(Result::unwrap).collect();
    for event in &events {
        writer.write(event).unwrap();
    }
    drop(writer);
    let mut ends: Vec<usize> = (0..file.len()).filter(|&k| file[k] == b'\n').collect();
    assert_eq!(ends.len(), events.len());
    ends.push(usize::MAX);
    let parse = |line: &str| serde_json::from_str::<serde_json::Value>(line);
    for cut in (0..=file.len()).step_by(7).chain([file.len()]) {
        let text = String::from_utf8_lossy(&file[..cut]);
        let whole = ends.iter().filter(|e| **e < cut).count();
        let read: Vec<_> = text.lines().map_while(|l| parse(l).ok()).collect();
        // A cut right before the end of a line costs nothing.
        assert!(read.len() == whole || (read.len() == whole + 1 && ends[whole] == cut));
    }
    for (line, event) in String::from_utf8(file).unwrap().lines().zip(&events) {
        let value = parse(line).unwrap();
        let x: Vec<f64> = value["x"]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap())
            .collect();
        assert_eq!(x, event.x(), "every bit comes back");
        assert_eq!(value["arclength"].as_f64(), Some(event.arclength()));
        match event {
            Event::Transition(t) => {
                assert_eq!(value["event"], t.kind.name());
                assert_eq!(value["arms"], t.arms.len());
            }
            Event::Point(p) => assert_eq!(value["det"].as_i64(), p.det_sign.map(i64::from)),
            _ => {}
        }
    }
}

/// Killed, read back, resumed: the table is that of the run that was never killed.
#[cfg(feature = "serde")]
#[test]
fn table_and_state_together() {
    let (map, x) = problem();
    let mut whole = Vec::new();
    let mut writer = CsvWriter::new(&mut whole, &map, columns()).unwrap();
    run(&map, &x).for_each(|e| writer.write(&e.unwrap()).unwrap());
    drop(writer);
    for killed in [0, 1, 5, 17] {
        let mut table = Vec::new();
        let mut first = run(&map, &x);
        let mut writer = CsvWriter::new(&mut table, &map, columns()).unwrap();
        let mut state = serde_json::to_string(&first.save().unwrap()).unwrap();
        for _ in 0..killed {
            writer.write(&first.next().unwrap().unwrap()).unwrap();
            state = serde_json::to_string(&first.save().unwrap()).unwrap();
        }
        drop((writer, first));
        let saved = serde_json::from_str(&state).unwrap();
        let mut writer = CsvWriter::appending(&mut table, &map, columns());
        for event in Continuation::resume(&map, &saved).unwrap() {
            writer.write(&event.unwrap()).unwrap();
        }
        drop(writer);
        assert_eq!(table, whole, "killed after {killed} events");
    }
}
