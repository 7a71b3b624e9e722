//! Deserialised meshes, checked as by [`Mesh::new`].

use super::mesh::{CellGroups, FacetGroups, NodeGroups};
use super::{CellKind, FemError, Mesh};
use crate::input::check_length;

/// The fields of a [`Mesh`].
#[derive(serde::Deserialize)]
#[serde(rename = "Mesh")]
pub(super) struct Unchecked {
    dim: usize,
    points: Vec<[f64; 3]>,
    kinds: Vec<CellKind>,
    nodes: Vec<usize>,
    facet_groups: FacetGroups,
    cell_groups: CellGroups,
    #[serde(default)]
    node_groups: NodeGroups,
    is_part: bool,
}

impl TryFrom<Unchecked> for Mesh {
    type Error = FemError;

    fn try_from(read: Unchecked) -> Result<Self, FemError> {
        let expected = read.kinds.iter().map(|k| k.num_nodes()).sum();
        check_length("the list of the nodes of all cells", read.nodes.len(), expected)?;
        let mut rest = read.nodes.as_slice();
        let cells = read.kinds.into_iter().map(|kind| {
            let (nodes, after) = rest.split_at(kind.num_nodes());
            rest = after;
            (kind, nodes.to_vec())
        });
        let mut mesh = Self::new(read.dim, read.points, cells)?;
        for (name, facets) in read.facet_groups {
            mesh.add_facet_group(name, facets)?;
        }
        for (name, cells) in read.cell_groups {
            mesh.add_cell_group(name, cells)?;
        }
        for (name, nodes) in read.node_groups {
            mesh.add_node_group(name, nodes)?;
        }
        Ok(if read.is_part { mesh.into_part() } else { mesh })
    }
}
