//! Rigid motions that the supports leave free.

use super::springs::Attached;
use super::{FemError, Mesh};
use crate::sparse::{Place, Resistance, pieces};

/// Checks that the supports, springs and foundations leave no rigid motion of any connected part of the body free; a body of revolution resists all but that along
/// its axis.
pub(super) fn check_supports(
    mesh: &Mesh,
    fixed: &[bool],
    attached: &[Attached],
    revolved: bool,
) -> Result<(), FemError> {
    let dim = mesh.dim();
    let part = pieces(mesh.num_nodes(), |connect| {
        (0..mesh.num_cells()).for_each(|cell| connect(&mut mesh.cell(cell).iter().copied()));
    });
    let places = Place::of(mesh.points(), &part);
    let mut held = vec![Resistance::default(); places.len()];
    for (node, (p, &own)) in mesh.points().iter().zip(&part).enumerate() {
        let motions = places[own].motions(*p);
        for d in (0..dim).filter(|&d| fixed[dim * node + d]) {
            held[own].add(&motions.map(|m| m[d]));
        }
    }
    for &(node, way) in attached.iter().flat_map(|a| &a.held) {
        let motions = places[part[node]].motions(mesh.points()[node]);
        held[part[node]].add(&motions.map(|m| (0..dim).map(|d| m[d] * way[d]).sum()));
    }
    for (own, held) in held.iter().enumerate() {
        let free = match revolved {
            true => held.free_among(&[1]),
            false => held.free(dim),
        };
        if free.is_empty() {
            continue;
        }
        let mut modes = free.join(", ");
        if places.len() > 1 {
            let centre = places[own].centre;
            modes += &format!(
                " (of part {own} of {}, centred at ({:.3}, {:.3}, {:.3}))",
                places.len(),
                centre[0],
                centre[1],
                centre[2]
            );
        }
        let node = part.iter().position(|p| *p == own).unwrap_or(0);
        return Err(FemError::Floating { modes, node });
    }
    Ok(())
}
