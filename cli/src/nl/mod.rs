//! AMPL's .nl files, text and binary (D. M. Gay, 2005: "Writing .nl files").
//!
//! Input is checked: indices, counts against the size of the file, finite numbers, references to defined variables that come later, rows
//! that depend on variables outside their J segment. The memory used is a small multiple of the bytes read.

mod binary;
mod error;
mod expression;
mod header;
mod segments;
mod source;
mod text;

pub use binary::Binary;
pub use error::{Fault, NlError, Position};
pub use header::Header;
pub use source::Source;
pub use text::Text;

use crate::graph::{Gradient, Graph};
use crate::model::Model;
use segments::Reader;

/// Reads a file, text or binary.
///
/// # Errors
/// The first fault, with its line (text) or byte (binary).
///
/// ```
/// // 0 ≤ x ⟂ x² − 2 ≥ 0.
/// let text = "g3 1 1 0\n 1 1 0 0 0\n 1 0 0 1 0 0\n 0 0\n 1 0 0\n 0 0 0 1\n 0 0 0 0 0\n 1 0\n 0 0\n 0 0 0 0 0\n\
///             C0\no0\no5\nv0\nn2\nn-2\nr\n5 1 1\nb\n2 0\nk0\nJ0 1\n0 0\n";
/// let model = semismooth_cli::nl::read(text.as_bytes()).unwrap();
/// assert_eq!((model.lower.len(), model.rows.len()), (1, 1));
/// let error = semismooth_cli::nl::read(text.replace("o5", "o999").as_bytes()).unwrap_err();
/// assert_eq!(error.to_string(), "line 13: operator o999 is not supported");
/// ```
pub fn read(bytes: &[u8]) -> Result<Model, NlError> {
    let mut text = Text::new(bytes);
    let header = Header::read(&mut text)?;
    let graph = Graph::new(header.variables, header.defined);
    let mut graph = graph.map_err(|e| text.out_of_range("the number of variables", header.variables, e))?;
    let parts = if header.binary {
        let mut source = Binary::new(bytes, text.offset(), header.big_endian);
        Reader::new(&mut source, &header, &mut graph).read()?
    } else {
        Reader::new(&mut text, &header, &mut graph).read()?
    };
    let model = parts.into_model(header, graph);
    check_jacobian(&model)?;
    Ok(model)
}

/// Checks that each row depends only on the variables of its J segment.
fn check_jacobian(model: &Model) -> Result<(), NlError> {
    let mut sweeps = Gradient::new(&model.graph);
    let mut listed = vec![usize::MAX; model.lower.len()];
    for (index, row) in model.rows.iter().enumerate() {
        let Some(expression) = &row.expression else {
            continue;
        };
        for (variable, _) in &row.linear {
            listed[*variable as usize] = index;
        }
        let mut unlisted = None;
        sweeps.variables(&model.graph, expression, &mut |variable| {
            if listed[variable] != index {
                unlisted = Some(variable);
            }
        });
        if let Some(variable) = unlisted {
            return Err(NlError {
                at: row.at,
                fault: Fault::Unlisted { row: index, variable },
            });
        }
    }
    Ok(())
}
