use std::fmt;

use super::Diagram;

/// A table of vertices and edges.
impl fmt::Display for Diagram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |n: usize, one: &str, many: &str| format!("{n} {}", if n == 1 { one } else { many });
        writeln!(
            f,
            "{}, {}, {}, {}, {}",
            count(self.components().len(), "component", "components"),
            count(self.branches().len(), "branch", "branches"),
            count(self.edges.len(), "edge", "edges"),
            count(self.vertices.len(), "vertex", "vertices"),
            self.completeness
        )?;
        writeln!(f, "{:>6}  {:>20}  {:<24}  edges", "vertex", "parameter", "kind")?;
        for (v, vertex) in self.vertices.iter().enumerate() {
            let edges: Vec<String> = vertex
                .arms
                .iter()
                .filter_map(|a| a.edge)
                .map(|e| e.to_string())
                .collect();
            // Rounding errors print as 0.
            let alpha = vertex.parameter();
            let alpha = if alpha.abs() < 5e-13 { 0.0 } else { alpha };
            writeln!(
                f,
                "{v:>6}  {alpha:>20.12}  {:<24}  {}",
                vertex.kind.name(),
                edges.join(" ")
            )?;
        }
        writeln!(
            f,
            "{:>6}  {:>6}  {:>6}  {:>8}  det",
            "edge", "from", "to", "points"
        )?;
        for (e, edge) in self.edges.iter().enumerate() {
            let signs: Vec<&str> = edge
                .det_signs()
                .iter()
                .map(|s| match s {
                    1 => "+",
                    -1 => "-",
                    _ => "0",
                })
                .collect();
            writeln!(
                f,
                "{e:>6}  {:>6}  {:>6}  {:>8}  {}",
                edge.from.vertex,
                edge.to.vertex,
                edge.points.len(),
                signs.join(" ")
            )?;
        }
        Ok(())
    }
}
