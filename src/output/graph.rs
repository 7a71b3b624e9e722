//! Explored diagrams as tables and JSON.

use std::io::Write;

use super::csv::quoted;
use super::{Column, OutputError};
use crate::continuation::{Diagram, DiagramEdge};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};

/// The kind of the k-th point of an edge.
fn event(diagram: &Diagram, edge: &DiagramEdge, k: usize) -> &'static str {
    let vertex = |v: usize| diagram.vertices()[v].kind.name();
    if k == 0 {
        vertex(edge.from.vertex)
    } else if k + 1 == edge.points.len() {
        vertex(edge.to.vertex)
    } else if edge.smooth_folds.contains(&k) {
        "smooth fold"
    } else {
        "point"
    }
}

/// Writes a diagram as comma-separated values (RFC 4180): a header, then one line per point, edge by edge; isolated vertices last.
///
/// The columns are the number of the edge (empty for isolated vertices), the arclength along it, the parameter α, the kind of point
/// ("point", "smooth fold", or that of the vertex), the sign of det ∇_yH (empty where unknown), those of `columns`, and the piece of each
/// site. Reading a number back gives the same `f64`.
///
/// # Errors
/// [`OutputError::Io`].
///
/// ```
/// use semismooth::continuation::{Diagram, DiagramOptions};
/// use semismooth::output::{Column, write_diagram_csv};
/// use semismooth::piecewise::MinMap;
/// // α = |y|
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
/// let diagram = Diagram::explore(&map, &[[0.5, 0.5]], &options)?;
/// let mut table = Vec::new();
/// write_diagram_csv(&mut table, &map, &diagram, &[Column::entry("y", 0)])?;
/// let table = String::from_utf8(table)?;
/// assert!(table.starts_with("edge,arclength,parameter,event,det,y,component 0\r\n0,0.0,0.5,start,-1,0.5,first\r\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_diagram_csv<P: PiecewiseSmooth + ?Sized>(
    out: &mut impl Write,
    map: &P,
    diagram: &Diagram,
    columns: &[Column<'_>],
) -> Result<(), OutputError> {
    write_table(out, &map, diagram, columns)
}

fn write_table(
    out: &mut dyn Write,
    map: &dyn PiecewiseSmooth,
    diagram: &Diagram,
    columns: &[Column<'_>],
) -> Result<(), OutputError> {
    write!(out, "edge,arclength,parameter,event,det")?;
    for column in columns {
        write!(out, ",{}", quoted(column.name()))?;
    }
    for site in 0..map.num_sites() {
        write!(out, ",{}", quoted(&map.site_name(site)))?;
    }
    write!(out, "\r\n")?;
    for (e, edge) in diagram.edges().iter().enumerate() {
        for (k, point) in edge.points.iter().enumerate() {
            let (s, alpha) = (point.arclength, point.parameter());
            let kind = quoted(event(diagram, edge, k));
            write!(out, "{e},{s:?},{alpha:?},{kind},")?;
            if let Some(sign) = point.det_sign {
                write!(out, "{sign}")?;
            }
            for column in columns {
                write!(out, ",{:?}", column.value(&point.x))?;
            }
            for (site, piece) in point.selection.pieces().enumerate() {
                write!(out, ",{}", quoted(&map.piece_name(site, piece)))?;
            }
            write!(out, "\r\n")?;
        }
    }
    for vertex in diagram.vertices() {
        if vertex.arms.iter().any(|a| a.edge.is_some()) {
            continue;
        }
        write!(out, ",,{:?},{},", vertex.parameter(), quoted(vertex.kind.name()))?;
        for column in columns {
            write!(out, ",{:?}", column.value(&vertex.x))?;
        }
        write!(out, "{}\r\n", ",".repeat(map.num_sites()))?;
    }
    Ok(out.flush()?)
}

#[cfg(feature = "json")]
pub use json::write_diagram_json;

#[cfg(feature = "json")]
mod json {
    use super::{Column, Diagram, OutputError, PiecewiseSmooth, PiecewiseSmoothExt, Write, event};
    use crate::continuation::{DiagramEdge, DiagramVertex, EdgeEnd};
    use crate::piecewise::Selection;
    use serde_json::{Map, Value, json};

    /// Writes a diagram as one JSON object: the range of the parameter, `complete` with the reasons if not, `vertices` with their arms,
    /// `edges` with their points, `branches` and `isolas` as lists of edges, `folds`. The values of `columns` are stored under their names.
    /// Numbers that are not finite (an unbounded range) are null.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn write_diagram_json<P: PiecewiseSmooth + ?Sized>(
        out: &mut impl Write,
        map: &P,
        diagram: &Diagram,
        columns: &[Column<'_>],
    ) -> Result<(), OutputError> {
        write_object(out, &map, diagram, columns)
    }

    fn write_object(
        out: &mut dyn Write,
        map: &dyn PiecewiseSmooth,
        diagram: &Diagram,
        columns: &[Column<'_>],
    ) -> Result<(), OutputError> {
        let list = |branches: Vec<crate::continuation::DiagramBranch>| -> Vec<Value> {
            let edges = branches.into_iter();
            edges
                .map(
                    |b| json!({"edges": b.edges.iter().map(|e| e.0).collect::<Vec<_>>(), "closed": b.closed}),
                )
                .collect()
        };
        let folds = diagram.folds();
        let folds = folds
            .iter()
            .map(|f| json!({"parameter": f.parameter(), "vertex": f.vertex, "edge": f.edge}));
        let (lower, upper) = diagram.parameter_range();
        let vertices = diagram.vertices().iter();
        let edges = diagram.edges().iter();
        let value = json!({
            "parameter_range": [lower, upper],
            "complete": diagram.completeness().is_complete(),
            "completeness": diagram.completeness().to_string(),
            "vertices": vertices.map(|v| vertex(map, v, columns)).collect::<Vec<_>>(),
            "edges": edges.map(|e| edge(map, diagram, e, columns)).collect::<Vec<_>>(),
            "branches": list(diagram.branches()),
            "isolas": list(diagram.isolas()),
            "folds": folds.collect::<Vec<_>>(),
        });
        serde_json::to_writer_pretty(&mut *out, &value).map_err(std::io::Error::from)?;
        writeln!(out)?;
        Ok(out.flush()?)
    }

    fn values(x: &[f64], columns: &[Column<'_>]) -> Value {
        let pairs = columns.iter().map(|c| (c.name().to_owned(), json!(c.value(x))));
        Value::Object(pairs.collect::<Map<_, _>>())
    }

    fn pieces(map: &dyn PiecewiseSmooth, selection: &Selection) -> Vec<String> {
        let names = selection.pieces().enumerate();
        names
            .map(|(site, k)| map.piece_name(site, k).into_owned())
            .collect()
    }

    fn vertex(map: &dyn PiecewiseSmooth, vertex: &DiagramVertex, columns: &[Column<'_>]) -> Value {
        let arm = |a: &crate::continuation::VertexArm| {
            json!({
                "tangent": a.arm.tangent,
                "pieces": pieces(map, &a.arm.selection),
                "grazing": a.arm.grazing,
                "edge": a.edge,
                "outside": a.outside,
            })
        };
        json!({
            "parameter": vertex.parameter(),
            "kind": vertex.kind.name(),
            "start": vertex.is_start,
            "x": vertex.x,
            "values": values(&vertex.x, columns),
            "arms": vertex.arms.iter().map(arm).collect::<Vec<_>>(),
            "arms_complete": vertex.complete,
        })
    }

    fn edge(
        map: &dyn PiecewiseSmooth,
        diagram: &Diagram,
        edge: &DiagramEdge,
        columns: &[Column<'_>],
    ) -> Value {
        let end = |e: EdgeEnd| json!({"vertex": e.vertex, "arm": e.arm});
        let points = edge.points.iter().enumerate().map(|(k, p)| {
            json!({
                "arclength": p.arclength,
                "parameter": p.parameter(),
                "event": event(diagram, edge, k),
                "det": p.det_sign,
                "values": values(&p.x, columns),
            })
        });
        let selection = edge.points.first().map(|p| pieces(map, &p.selection));
        let (lower, upper) = edge.interval();
        json!({
            "from": end(edge.from),
            "to": end(edge.to),
            "pieces": selection,
            "det_signs": edge.det_signs(),
            "vertical": edge.is_vertical(),
            "interval": [lower, upper],
            "arclength": edge.arclength(),
            "points": points.collect::<Vec<_>>(),
        })
    }
}
