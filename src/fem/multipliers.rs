use std::collections::BTreeMap;

use super::contact::{INWARD, frame, unit};
use super::element::Reference;
use super::facet::integrate_parts;
use super::vectors::{by_position, dot, norm};
use super::{ContactRows, ElasticSystem, FemError, Foundation};

/// The space in which contact forces are sought (Haslinger, Kučera, Vlach 2008).
///
/// In each of them the unknowns are forces: resultants of constant densities, paired with mean displacements. Condition (1), that no
/// non-zero multiplier is orthogonal to all displacements, holds for nodal forces and dual cells; patches must be larger than the facets
/// for a stable space. [`check_multipliers`](crate::contact::check_multipliers) checks it for any pairing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum MultiplierSpace {
    /// A force at each node (lumped).
    #[default]
    Nodal,
    /// Constant on the dual cell of each node: the part of the facets that lies nearest to it. Parts of nodes without a free displacement
    /// are assigned to their neighbours.
    DualCells,
    /// Constant on merged facets: those whose centroids lie in one box of a grid of mesh width H, with its origin at the lowest corner of
    /// the group. H = k h merges k (in space k²) facets.
    Patches {
        /// H > 0.
        size: f64,
    },
}

/// A set of parts of facets with one multiplier.
#[derive(Default)]
struct Patch {
    area: f64,
    centre: [f64; 3],
    normal: [f64; 3],
    gap: f64,
    /// ∫ of the shape function of each node.
    nodes: BTreeMap<usize, f64>,
}

impl ElasticSystem {
    /// Contact rows for a space of multipliers. For patches and dual cells row k of Bν is the mean of u·ν, ν the unit normal of the
    /// patch, `nodes` is the mesh node nearest to its centroid and `points` that centroid.
    ///
    /// # Errors
    /// As [`contact`](Self::contact); [`FemError::PatchSize`]; prescribed displacements other than 0 on patches.
    pub fn contact_with(
        &self,
        facets: &str,
        foundation: &Foundation,
        multipliers: MultiplierSpace,
    ) -> Result<ContactRows, FemError> {
        let size = match multipliers {
            MultiplierSpace::Nodal => return self.contact(facets, foundation),
            MultiplierSpace::DualCells => None,
            MultiplierSpace::Patches { size } if size > 0.0 && size.is_finite() => Some(size),
            MultiplierSpace::Patches { size } => return Err(FemError::PatchSize { size }),
        };
        let patches = self.patches(facets, foundation, size)?;
        if patches.is_empty() {
            return Err(FemError::EmptyGroup {
                what: "facets with a free node",
                name: facets.into(),
            });
        }
        let dim = self.mesh().dim();
        let points = self.mesh().points();
        let mut entries = [Vec::new(), Vec::new(), Vec::new()];
        let mut rows = ContactRows::empty();
        let mut outward = false;
        for (i, patch) in patches.iter().enumerate() {
            let centre = patch.centre.map(|x| x / patch.area);
            let distance = |n: usize| -> f64 { (0..3).map(|d| (points[n][d] - centre[d]).powi(2)).sum() };
            let nearest = patch.nodes.keys().copied();
            let node = nearest
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(0);
            let nu = foundation.normal_at(centre).unwrap_or(patch.normal);
            let nu = unit(node, dim, nu, "its normal is zero or not finite")?;
            outward |= dot(nu, patch.normal) >= 0.0;
            let tangents = frame(node, dim, nu, foundation.tangent_at(centre))?;
            for (d, direction) in [nu, tangents[0], tangents[1]].into_iter().enumerate().take(dim) {
                let name = if d == 0 { "normal" } else { "tangential" };
                for (&node, integral) in &patch.nodes {
                    let entry = (i, node, integral / patch.area);
                    self.add_entries(entry, direction, name, &mut entries[d], &mut rows.resting)?;
                }
            }
            rows.nodes.push(node);
            rows.points.push(centre);
            rows.gap.push(patch.gap / patch.area);
            rows.normals.push(nu);
            rows.tangents.push(tangents);
            // Means over patches with nodes at rest: the rows of the others remain.
            rows.held.push([false; 2]);
            rows.areas.push(patch.area);
        }
        if !outward {
            return Err(FemError::Frame {
                node: rows.nodes[0],
                what: INWARD.into(),
            });
        }
        rows.fill(self, &entries)?;
        Ok(rows)
    }

    fn patches(
        &self,
        facets: &str,
        foundation: &Foundation,
        size: Option<f64>,
    ) -> Result<Vec<Patch>, FemError> {
        let mesh = self.mesh();
        let (dim, points) = (mesh.dim(), mesh.points());
        let group = mesh.facet_group(facets)?;
        let mut low = [f64::INFINITY; 3];
        for &node in group.iter().flatten() {
            low = std::array::from_fn(|d| low[d].min(points[node][d]));
        }
        let free = |node: usize| (0..dim).any(|d| self.dof(node, d).is_some());
        let mut patches: BTreeMap<[usize; 3], Patch> = BTreeMap::new();
        for facet in group {
            if !facet.iter().any(|&n| free(n)) {
                continue;
            }
            let vector = mesh.area_vector(facet);
            let length = norm(vector);
            let k = Reference::of_facet(dim, facet.len()).num_corners();
            let middle: [f64; 3] = std::array::from_fn(|d| {
                facet.iter().map(|&n| points[n][d]).sum::<f64>() / facet.len() as f64
            });
            let mut failure = None;
            integrate_parts(mesh, facet, |corner, at, shape, measure| {
                let label = match size {
                    Some(h) => std::array::from_fn(|d| ((middle[d] - low[d]) / h) as usize),
                    None => {
                        // The nearest free corner around the facet.
                        let owner = (0..k).flat_map(|s| [corner + s, corner + k - s]);
                        let owner = owner.map(|a| facet[a % k]).find(|&n| free(n));
                        [owner.unwrap_or(facet[corner]), 0, 0]
                    }
                };
                let gap = foundation.gap_at(at);
                if !gap.is_finite() {
                    failure = Some(FemError::NotFinite {
                        what: "the gap",
                        at,
                        value: gap,
                    });
                }
                let measure = measure * self.round(at);
                let patch = patches.entry(label).or_default();
                patch.area += measure;
                patch.gap += measure * gap;
                for (&node, s) in facet.iter().zip(shape) {
                    *patch.nodes.entry(node).or_insert(0.0) += measure * s;
                }
                for d in 0..3 {
                    patch.centre[d] += measure * at[d];
                    patch.normal[d] += measure * vector[d] / length;
                }
            });
            if let Some(e) = failure {
                return Err(e);
            }
        }
        let mut patches: Vec<Patch> = patches.into_values().collect();
        patches.sort_by(|a, b| by_position(a.centre.map(|x| x / a.area), b.centre.map(|x| x / b.area)));
        Ok(patches)
    }
}
