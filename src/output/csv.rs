use std::borrow::Cow;
use std::fmt;
use std::io::Write;

use super::OutputError;
use crate::continuation::{Branch, BranchVertex};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};

type Scalar<'a> = dyn Fn(&[f64]) -> f64 + 'a;

/// A column of a table: a name and a scalar function of x = (y, α).
pub struct Column<'a> {
    name: Cow<'a, str>,
    value: Box<Scalar<'a>>,
}

impl<'a> Column<'a> {
    /// A column with any scalar of x.
    pub fn new(name: impl Into<Cow<'a, str>>, value: impl Fn(&[f64]) -> f64 + 'a) -> Self {
        Self {
            name: name.into(),
            value: Box::new(value),
        }
    }

    /// The column of one entry of x (NaN where x has no such entry).
    pub fn entry(name: impl Into<Cow<'a, str>>, index: usize) -> Self {
        Self::new(name, move |x| x.get(index).copied().unwrap_or(f64::NAN))
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its value at x.
    #[must_use]
    pub fn value(&self, x: &[f64]) -> f64 {
        (self.value)(x)
    }
}

impl fmt::Debug for Column<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Column")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Writes a branch as comma-separated values (RFC 4180): a header, then one line per point, in order of arclength.
///
/// The columns are the arclength, the parameter α, the kind of point ("point", or that of the event), those of `columns`, and for each site
/// the piece in which the curve leaves the point. Reading a number back gives the same `f64`.
///
/// # Errors
/// [`OutputError::Io`].
///
/// ```
/// use semismooth::continuation::{Branch, ContinuationOptions, Direction};
/// use semismooth::output::{Column, write_csv};
/// use semismooth::piecewise::MinMap;
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Decreasing, options)?;
/// let mut table = Vec::new();
/// write_csv(&mut table, &map, &branch, &[Column::entry("y", 0)])?;
/// let table = String::from_utf8(table)?;
/// assert!(table.starts_with("arclength,parameter,event,y,component 0\r\n0.0,0.5,point,0.5,first\r\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_csv<P: PiecewiseSmooth + ?Sized>(
    out: &mut impl Write,
    map: &P,
    branch: &Branch,
    columns: &[Column<'_>],
) -> Result<(), OutputError> {
    write_header(out, &map, columns)?;
    for v in branch.vertices() {
        write_row(out, &map, &v, columns)?;
    }
    Ok(out.flush()?)
}

pub(super) fn write_header(
    out: &mut dyn Write,
    map: &dyn PiecewiseSmooth,
    columns: &[Column<'_>],
) -> std::io::Result<()> {
    write!(out, "arclength,parameter,event")?;
    for column in columns {
        write!(out, ",{}", quoted(&column.name))?;
    }
    for site in 0..map.num_sites() {
        write!(out, ",{}", quoted(&map.site_name(site)))?;
    }
    write!(out, "\r\n")
}

pub(super) fn write_row(
    out: &mut dyn Write,
    map: &dyn PiecewiseSmooth,
    v: &BranchVertex<'_>,
    columns: &[Column<'_>],
) -> std::io::Result<()> {
    let parameter = v.x.last().copied().unwrap_or(f64::NAN);
    write!(out, "{:?},{parameter:?},{}", v.arclength, quoted(v.event))?;
    for column in columns {
        write!(out, ",{:?}", (column.value)(v.x))?;
    }
    for (site, piece) in v.selection.pieces().enumerate() {
        write!(out, ",{}", quoted(&map.piece_name(site, piece)))?;
    }
    write!(out, "\r\n")
}

pub(super) fn quoted(field: &str) -> Cow<'_, str> {
    if field.contains([',', '"', '\r', '\n']) {
        Cow::Owned(format!("\"{}\"", field.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::{ContinuationOptions, Direction};
    use crate::piecewise::MinMap;

    #[test]
    fn numbers_come_back_as_they_were() {
        let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[1] - x[0] / 3.0;
            b[0] = x[1] + x[0] * x[0] * x[0];
        });
        let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
        let branch = Branch::follow(&map, &[0.9, 0.3], Direction::Decreasing, options).unwrap();
        assert_eq!(branch.transitions.len(), 1);
        let mut table = Vec::new();
        let columns = [
            Column::entry("y, \"quoted\"", 0),
            Column::new("none", |_| f64::NAN),
        ];
        write_csv(&mut table, &map, &branch, &columns).unwrap();
        let table = String::from_utf8(table).unwrap();
        let lines: Vec<&str> = table.split_terminator("\r\n").collect();
        assert_eq!(
            lines[0],
            "arclength,parameter,event,\"y, \"\"quoted\"\"\",none,component 0"
        );
        let walk = branch.vertices();
        assert_eq!(lines.len(), 1 + walk.len());
        for (line, vertex) in lines[1..].iter().zip(&walk) {
            let fields: Vec<&str> = line.split(',').collect();
            assert_eq!(fields[0].parse::<f64>().unwrap(), vertex.arclength);
            assert_eq!(fields[1].parse::<f64>().unwrap(), vertex.x[1]);
            assert_eq!(fields[2], vertex.event);
            assert_eq!(fields[3].parse::<f64>().unwrap(), vertex.x[0]);
            assert!(fields[4].parse::<f64>().unwrap().is_nan());
        }
    }

    #[test]
    fn a_full_disk_is_an_error() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] - x[1];
            b[0] = 1e9;
        });
        let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
        let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Increasing, options).unwrap();
        assert!(matches!(
            write_csv(&mut Full, &map, &branch, &[]),
            Err(OutputError::Io { .. })
        ));
    }
}
