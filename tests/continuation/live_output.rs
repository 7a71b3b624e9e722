//! Tables of runs that are killed: everything except the current step has been written.

use crate::common;
use crate::maps::two_pieces;
use std::cell::RefCell;
use std::io::Write;
use std::rc::Rc;

use semismooth::contact::{FullContact, PlanarCoulomb};
use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction, Event};
use semismooth::output::{Column, CsvWriter, OutputError, write_csv};
use semismooth::piecewise::{Description, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// A file as another process sees it: the flushed part. Writing fails from a given size on.
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

fn problem() -> (FullContact<PlanarCoulomb>, Vec<f64>) {
    let case = common::cases().into_iter().find(|c| c.name == "p2_ex1").unwrap();
    let x = case
        .problem
        .solve(8.0, Some(&case.problem.stick_start(8.0).unwrap()))
        .unwrap();
    (case.problem, x)
}

fn run<'a>(map: &'a FullContact<PlanarCoulomb>, x: &[f64]) -> Continuation<'a, FullContact<PlanarCoulomb>> {
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
fn a_full_disk_is_reported_at_once() {
    let (map, x) = problem();
    let disk = Disk::new(1000);
    let mut writer = CsvWriter::new(disk, &map, columns()).unwrap();
    let failed = run(&map, &x)
        .map(|e| writer.write(&e.unwrap()))
        .find(Result::is_err);
    assert!(matches!(failed, Some(Err(OutputError::Io { .. }))));
}

/// Wherever a file is cut, its complete lines are those of the first events.
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
        // A cut right before the end of a line loses nothing.
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

/// (α − y³ + 3 y + 8 max(y − 3/2, 0)) (y + 3/2) = 0. On its first factor: a branch point at y = −3/2, smooth folds at y = −1, 1 and
/// √(11/3), a fold at the kink y = 3/2.
struct Crossing;

impl PiecewiseSmooth for Crossing {
    two_pieces!(self, [negative, positive], 2, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - 1.5;
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = (x[1] - alpha(s.piece(0), x[0])) * (x[0] + 1.5);
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let slope = 3.0 * x[0] * x[0] - 3.0 - [0.0, 8.0][s.piece(0)];
        jac.add(0, 0, x[1] - alpha(s.piece(0), x[0]) - slope * (x[0] + 1.5));
        jac.add(0, 1, x[0] + 1.5);
    }
    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl Description for Crossing {
    fn piece_name(&self, _: usize, piece: usize) -> std::borrow::Cow<'_, str> {
        ["below, \"smooth\"", "above"][piece].into()
    }
}

/// The parameter on the first factor.
fn alpha(piece: usize, y: f64) -> f64 {
    y * y * y - 3.0 * y - [0.0, 8.0 * (y - 1.5)][piece]
}

/// Every kind of event, in JSON Lines and in a table, where it is known to be.
#[cfg(feature = "json")]
#[test]
fn every_kind_of_event_is_written() {
    use semismooth::output::JsonLinesWriter;
    let options = || ContinuationOptions::default().with_parameter_range((-20.0, 20.0));
    let start = [-3.0, alpha(0, -3.0)];
    let curve = Continuation::new(&Crossing, &start, Direction::Increasing, options()).unwrap();
    let events: Vec<Event> = curve
        .with_monitor("middle, here", |x| x[0])
        .map(Result::unwrap)
        .collect();
    let (mut lines, mut table) = (Vec::new(), Vec::new());
    let mut json = JsonLinesWriter::new(&mut lines, &Crossing);
    let mut csv = CsvWriter::new(&mut table, &Crossing, vec![Column::entry("y", 0)]).unwrap();
    for event in &events {
        json.write(event).unwrap();
        csv.write(event).unwrap();
    }
    drop((json, csv));
    let lines = String::from_utf8(lines).unwrap();
    let table = String::from_utf8(table).unwrap();
    assert!(table.starts_with("arclength,parameter,event,y,site 0\r\n"));
    let rows = table.split_terminator("\r\n").skip(1);
    assert_eq!(
        (lines.lines().count(), rows.clone().count()),
        (events.len(), events.len())
    );
    let mut special = Vec::new();
    for ((line, row), event) in lines.lines().zip(rows).zip(&events) {
        let value: serde_json::Value = serde_json::from_str(line).unwrap();
        let numbers = |key: &str| -> Vec<f64> { common::numbers(&value[key]) };
        assert_eq!(numbers("x"), event.x());
        assert_eq!(value["parameter"].as_f64(), Some(event.x()[1]));
        assert_eq!(value["arclength"].as_f64(), Some(event.arclength()));
        let name = value["event"].as_str().unwrap();
        // A unit tangent of α = α(y), y increasing, and the sign of ∂H/∂y where that is not zero.
        let y = event.x()[0];
        let above = usize::from(value["pieces"][0] == "above");
        let slope = 3.0 * y * y - 3.0 - [0.0, 8.0][above];
        let size = slope.hypot(1.0);
        let t = numbers("tangent");
        let off = (t[0] - 1.0 / size).hypot(t[1] - slope / size);
        assert!(off < 1e-6, "{name} at {y}: {t:?}");
        if name == "point" {
            let det = -slope * (y + 1.5);
            assert_eq!(value["det"].as_i64(), Some(det.signum() as i64), "at {y}");
        }
        assert!(value["residual"].as_f64().unwrap() < 1e-8);
        assert_eq!(value["grazing"], serde_json::json!([]));
        let fields = [
            format!("{:?}", event.arclength()),
            format!("{:?}", event.x()[1]),
            if name.contains(',') {
                format!("\"{name}\"")
            } else {
                name.to_owned()
            },
            format!("{y:?}"),
            ["\"below, \"\"smooth\"\"\"", "above"][above].to_owned(),
        ];
        assert_eq!(row, fields.join(","));
        let arms = value.get("arms").map(|a| a.as_u64().unwrap());
        assert_eq!(arms.is_some(), value.get("complete").is_some());
        if name != "point" {
            special.push((name.to_owned(), y, arms));
        }
    }
    let last = (11.0_f64 / 3.0).sqrt();
    let expected = [
        ("branch point", -1.5, Some(3)),
        ("smooth fold", -1.0, None),
        ("middle, here", 0.0, None),
        ("smooth fold", 1.0, None),
        ("fold", 1.5, Some(1)),
        ("smooth fold", last, None),
    ];
    assert_eq!(special.len(), expected.len(), "{special:?}");
    for ((name, y, arms), (known, at, leaving)) in special.iter().zip(expected) {
        assert_eq!((name.as_str(), *arms), (known, leaving));
        assert!((y - at).abs() < 1e-6, "{name}: {y}");
    }
    // The table of the branch as a whole has the same rows.
    let curve = Continuation::new(&Crossing, &start, Direction::Increasing, options()).unwrap();
    let curve = curve.with_monitor("middle, here", |x| x[0]);
    let branch = Branch::collect(curve, |_| std::ops::ControlFlow::Continue(())).unwrap();
    let mut whole = Vec::new();
    write_csv(&mut whole, &Crossing, &branch, &[Column::entry("y", 0)]).unwrap();
    assert_eq!(String::from_utf8(whole).unwrap(), table);
}

/// Killed, read back, resumed: the table is that of the uninterrupted run.
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
