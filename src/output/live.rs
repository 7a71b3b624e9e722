//! Tables written during a run, so that a run that is killed loses at most the current step.

use std::io::{BufWriter, Write};

use super::csv::{write_header, write_row};
use super::{Column, OutputError};
use crate::continuation::{BranchVertex, Event};
use crate::piecewise::PiecewiseSmooth;

/// Writes the events of a run as comma-separated values as they occur, in the format of [`write_csv`](super::write_csv); each line is
/// flushed before the next event.
///
/// ```
/// use semismooth::continuation::{Continuation, ContinuationOptions, Direction};
/// use semismooth::output::{Column, CsvWriter};
/// use semismooth::piecewise::MinMap;
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let mut table = Vec::new();
/// let mut writer = CsvWriter::new(&mut table, &map, vec![Column::entry("y", 0)])?;
/// for event in Continuation::new(&map, &[0.5, 0.5], Direction::Decreasing, options)? {
///     writer.write(&event?)?;
/// }
/// drop(writer);
/// assert!(String::from_utf8(table)?.starts_with("arclength,parameter,event,y,component 0\r\n0.0,0.5,point,0.5,first\r\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct CsvWriter<'a, P: ?Sized, W: Write> {
    out: BufWriter<W>,
    map: &'a P,
    columns: Vec<Column<'a>>,
}

impl<'a, P: PiecewiseSmooth + ?Sized, W: Write> CsvWriter<'a, P, W> {
    /// Writes the header.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn new(out: W, map: &'a P, columns: Vec<Column<'a>>) -> Result<Self, OutputError> {
        let mut this = Self::appending(out, map, columns);
        write_header(&mut this.out, &map, &this.columns)?;
        this.out.flush()?;
        Ok(this)
    }

    /// Continues a table with an existing header, that of a resumed run. An incomplete last line must have been removed.
    pub fn appending(out: W, map: &'a P, columns: Vec<Column<'a>>) -> Self {
        Self {
            out: BufWriter::new(out),
            map,
            columns,
        }
    }

    /// Writes one event and flushes.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn write(&mut self, event: &Event) -> Result<(), OutputError> {
        write_row(
            &mut self.out,
            &self.map,
            &BranchVertex::from(event),
            &self.columns,
        )?;
        Ok(self.out.flush()?)
    }
}

#[cfg(feature = "json")]
pub use json::JsonLinesWriter;

#[cfg(feature = "json")]
mod json {
    use super::{BranchVertex, BufWriter, Event, OutputError, PiecewiseSmooth, Write};
    use crate::piecewise::PiecewiseSmoothExt;
    use serde_json::json;

    /// Writes the events of a run as JSON Lines as they occur: one object per line with `event`, `arclength`, `parameter`, `x`, `tangent`,
    /// `pieces`, `grazing`, `det` (null where unknown), `residual`, and for transitions and branch points the number of `arms` and whether
    /// they are `complete`. Each line is flushed before the next event; an incomplete last line is not valid JSON.
    #[derive(Debug)]
    pub struct JsonLinesWriter<'a, P: ?Sized, W: Write> {
        out: BufWriter<W>,
        map: &'a P,
    }

    impl<'a, P: PiecewiseSmooth + ?Sized, W: Write> JsonLinesWriter<'a, P, W> {
        /// A writer; nothing is written yet.
        pub fn new(out: W, map: &'a P) -> Self {
            let out = BufWriter::new(out);
            Self { out, map }
        }

        /// Writes one event and flushes.
        ///
        /// # Errors
        /// [`OutputError::Io`].
        pub fn write(&mut self, event: &Event) -> Result<(), OutputError> {
            write_line(&mut self.out, &self.map, event)
        }
    }

    fn write_line(out: &mut dyn Write, map: &dyn PiecewiseSmooth, event: &Event) -> Result<(), OutputError> {
        let vertex = BranchVertex::from(event);
        let names = vertex.selection.pieces().enumerate();
        let pieces: Vec<_> = names.map(|(site, k)| map.piece_name(site, k)).collect();
        let (tangent, residual, det, arms, complete) = match event {
            Event::Transition(t) => (
                &t.tangent_after,
                t.residual_norm,
                None,
                Some(t.arms.len()),
                Some(t.complete),
            ),
            Event::BranchPoint(b) => (
                &b.point.tangent,
                b.point.residual_norm,
                b.point.det_sign,
                Some(b.arms.len()),
                Some(b.complete),
            ),
            Event::SmoothFold(f) => (&f.tangent, f.residual_norm, f.det_sign, None, None),
            Event::Monitor(m) => (
                &m.point.tangent,
                m.point.residual_norm,
                m.point.det_sign,
                None,
                None,
            ),
            Event::Point(p) => (&p.tangent, p.residual_norm, p.det_sign, None, None),
        };
        let mut object = json!({
            "event": vertex.event,
            "arclength": vertex.arclength,
            "parameter": event.parameter(),
            "x": vertex.x,
            "tangent": tangent,
            "pieces": pieces,
            "grazing": vertex.grazing,
            "det": det,
            "residual": residual,
        });
        if let (Some(arms), Some(complete)) = (arms, complete) {
            object["arms"] = arms.into();
            object["complete"] = complete.into();
        }
        serde_json::to_writer(&mut *out, &object).map_err(std::io::Error::from)?;
        out.write_all(b"\n")?;
        Ok(out.flush()?)
    }
}
