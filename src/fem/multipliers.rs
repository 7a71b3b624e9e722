use std::collections::BTreeMap;

use super::contact::{INWARD, NOTHING, frame, unit};
use super::element::Reference;
use super::facet::integrate_parts;
use super::partition::Place;
use super::vectors::{by_position, dot, norm};
use super::{ContactRows, ElasticSystem, FemError, Foundation, Partition};
use crate::tolerances::HALF_DIGITS;

/// The space in which contact forces are sought (Haslinger, Kučera, Vlach 2008).
///
/// In each of them the unknowns are forces: multiplier i is the density λ_i ψ_i / a_i with ψ_i ≥ 0 and a_i = ∫ψ_i, paired exactly with the
/// displacement, (Bν u)_i = ∫ψ_i u·ν / a_i, on curved boundaries, too. Densities are ≥ 0 where all λ_i are. Condition (1), that no non-zero
/// multiplier is orthogonal to all displacements, holds for nodal forces and dual cells; elements of a partition must be larger than the
/// facets for a stable space. [`check_multipliers`](crate::contact::check_multipliers) checks it for any pairing.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum MultiplierSpace {
    /// A force at each node (lumped).
    #[default]
    Nodal,
    /// Constant on the dual cell of each node: the part of the facets that lies nearest to it. Parts of nodes without a free displacement
    /// are assigned to their neighbours.
    DualCells,
    /// Polynomials of degree s on each element of a partition T_H.
    Piecewise {
        /// T_H.
        partition: Partition,
        /// s, and whether they are continuous.
        degree: Degree,
    },
}

/// The degree s of multipliers on each element of a partition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Degree {
    /// P₀: one multiplier an element.
    Constant,
    /// P₁, with jumps between elements: one multiplier a corner of each element, two on segments, three on triangles. Quadrilaterals have four
    /// (bilinear).
    Linear,
    /// P₁, continuous: one multiplier a corner, common to the elements around it.
    Continuous,
}

/// What one multiplier is paired with.
#[derive(Default)]
struct Part {
    /// ∫ ψ, and ∫ ψ of the positions, normals and gaps.
    area: f64,
    centre: [f64; 3],
    normal: [f64; 3],
    gap: f64,
    /// ∫ ψ φ ν of each node, and the same with the tangents.
    nodes: BTreeMap<usize, [[f64; 3]; 3]>,
    /// Whether ν points out of the body.
    outward: bool,
}

/// One function of those of a part, or a corner.
type Label = [usize; 2];

impl ElasticSystem {
    /// Contact rows for a space of multipliers. But for nodal forces, row k of Bν is the mean of u·ν weighted by ψ_k, with the normal of the
    /// boundary or the foundation at each point; `points` is the centroid of ψ_k, `nodes` the mesh node nearest to it, `normals` the mean.
    ///
    /// ```
    /// use semismooth::fem::{Degree, Elasticity, Foundation, Material, Mesh, MultiplierSpace, Partition};
    /// let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [8, 4])?;
    /// let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix("top").assemble()?;
    /// let space = |degree| MultiplierSpace::Piecewise { partition: Partition::Merged(2), degree };
    /// let rows = |degree| body.contact_with("bottom", &Foundation::gap(|_| 0.0), space(degree));
    /// for (degree, expected) in [
    ///     (Degree::Constant, &[0.5; 4][..]),
    ///     (Degree::Continuous, &[0.25, 0.5, 0.5, 0.5, 0.25]),
    ///     (Degree::Linear, &[0.25; 8]),
    /// ] {
    ///     let areas = rows(degree)?.areas;
    ///     assert_eq!(areas.len(), expected.len());
    ///     assert!(areas.iter().zip(expected).all(|(a, e)| (a - e).abs() < 1e-14));
    /// }
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    ///
    /// # Errors
    /// As [`contact`](Self::contact); partitions that do not cover the boundary once, or reach beyond it ([`FemError::Partition`]);
    /// prescribed displacements other than 0.
    pub fn contact_with(
        &self,
        facets: &str,
        foundation: &Foundation,
        multipliers: MultiplierSpace,
    ) -> Result<ContactRows, FemError> {
        let parts = match multipliers {
            MultiplierSpace::Nodal => return self.contact(facets, foundation),
            MultiplierSpace::DualCells => self.dual_cells(facets, foundation)?,
            MultiplierSpace::Piecewise { partition, degree } => {
                self.piecewise(facets, foundation, &partition, degree)?
            }
        };
        let dim = self.mesh().dim();
        let points = self.mesh().points();
        let mut entries = [Vec::new(), Vec::new(), Vec::new()];
        let mut rows = ContactRows::empty();
        for part in &parts {
            let (i, centre) = (rows.nodes.len(), part.centre.map(|x| x / part.area));
            let distance = |n: usize| -> f64 { (0..3).map(|d| (points[n][d] - centre[d]).powi(2)).sum() };
            let nearest = part.nodes.keys().copied();
            let node = nearest
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(0);
            let nu = unit(node, dim, part.normal, "its mean normal is zero")?;
            for d in 0..dim {
                let name = if d == 0 { "normal" } else { "tangential" };
                for (&node, integrals) in &part.nodes {
                    let (size, v) = (norm(integrals[d]), norm(integrals[d]) / part.area);
                    // Integrals of functions of second order may vanish up to rounding.
                    if v > NOTHING {
                        let direction = integrals[d].map(|x| x / size);
                        self.add_entries((i, node, v), direction, name, &mut entries[d], &mut rows.resting)?;
                    }
                }
            }
            rows.nodes.push(node);
            rows.points.push(centre);
            rows.gap.push(part.gap / part.area);
            rows.normals.push(nu);
            rows.tangents
                .push(frame(node, dim, nu, foundation.tangent_at(centre))?);
            // Means over parts with nodes at rest: the rows of the others remain.
            rows.held.push([false; 2]);
            rows.areas.push(part.area);
        }
        if parts.is_empty() {
            return Err(FemError::EmptyGroup {
                what: "facets with a free node",
                name: facets.into(),
            });
        }
        if !parts.iter().any(|p| p.outward) {
            return Err(FemError::Frame {
                node: rows.nodes[0],
                what: INWARD.into(),
            });
        }
        rows.fill(self, &entries)?;
        Ok(rows)
    }

    fn has_free(&self, node: usize) -> bool {
        (0..self.mesh().dim()).any(|d| self.dof(node, d).is_some())
    }

    /// P_s on a partition.
    fn piecewise(
        &self,
        facets: &str,
        foundation: &Foundation,
        partition: &Partition,
        degree: Degree,
    ) -> Result<Vec<Part>, FemError> {
        let mut parts: BTreeMap<Label, Part> = BTreeMap::new();
        let elements = partition.elements(self.mesh(), facets, degree != Degree::Constant)?;
        elements.integrate(self.mesh(), facets, |facet, place| {
            if degree == Degree::Constant {
                let part = parts.entry([place.element, 0]).or_default();
                return self.add_to(part, facet, foundation, &place, 1.0);
            }
            for (k, &corner) in elements.corners(place.element).iter().enumerate() {
                let label = match degree {
                    Degree::Continuous => [corner, 0],
                    _ => [place.element, k],
                };
                let part = parts.entry(label).or_default();
                self.add_to(part, facet, foundation, &place, place.hats[k])?;
            }
            Ok(())
        })?;
        // Where no displacement is free nothing is paired.
        let seen = |p: &Part| p.nodes.keys().any(|n| self.has_free(*n));
        Ok(sorted(parts.into_values().filter(seen)))
    }

    fn dual_cells(&self, facets: &str, foundation: &Foundation) -> Result<Vec<Part>, FemError> {
        let mesh = self.mesh();
        let mut parts: BTreeMap<Label, Part> = BTreeMap::new();
        for facet in mesh.facet_group(facets)? {
            if !facet.iter().any(|&n| self.has_free(n)) {
                continue;
            }
            let k = Reference::of_facet(mesh.dim(), facet.len()).num_corners();
            let mut failure = Ok(());
            integrate_parts(mesh, facet, |corner, at, shape, measure, normal| {
                // The nearest free corner around the facet.
                let owner = (0..k).flat_map(|s| [corner + s, corner + k - s]);
                let owner = owner.map(|a| facet[a % k]).find(|&n| self.has_free(n));
                let part = parts.entry([owner.unwrap_or(facet[corner]), 0]).or_default();
                let place = Place {
                    at,
                    normal,
                    measure,
                    shape,
                    element: 0,
                    hats: [0.0; 4],
                };
                if failure.is_ok() {
                    failure = self.add_to(part, facet, foundation, &place, 1.0);
                }
            });
            failure?;
        }
        Ok(sorted(parts.into_values()))
    }

    /// Adds a point of integration, with the value of ψ there.
    fn add_to(
        &self,
        part: &mut Part,
        facet: &[usize],
        foundation: &Foundation,
        place: &Place<'_>,
        psi: f64,
    ) -> Result<(), FemError> {
        let (node, dim, at) = (facet[0], self.mesh().dim(), place.at);
        let gap = foundation.gap_at(at)?;
        let nu = foundation.normal_at(at).unwrap_or(place.normal);
        let nu = unit(node, dim, nu, "its normal is zero or not finite")?;
        let [first, second] = frame(node, dim, nu, foundation.tangent_at(at))?;
        let measure = psi * place.measure * self.round(at);
        part.area += measure;
        part.gap += measure * gap;
        part.outward |= dot(nu, place.normal) >= 0.0;
        for d in 0..3 {
            part.centre[d] += measure * at[d];
            part.normal[d] += measure * nu[d];
        }
        for (&node, s) in facet.iter().zip(place.shape) {
            let sums = part.nodes.entry(node).or_default();
            for (sum, axis) in sums.iter_mut().zip([nu, first, second]) {
                (0..3).for_each(|d| sum[d] += measure * s * axis[d]);
            }
        }
        Ok(())
    }
}

/// By x, then y, then z of the centroids, up to their rounding.
fn sorted(parts: impl Iterator<Item = Part>) -> Vec<Part> {
    let mut parts: Vec<Part> = parts.collect();
    let centre = |p: &Part| p.centre.map(|x| x / p.area);
    let size = parts.iter().flat_map(centre).fold(0.0_f64, |m, x| m.max(x.abs()));
    let place = |p: &Part| centre(p).map(|x| (x / (HALF_DIGITS * size)).round());
    parts.sort_by(|a, b| by_position(place(a), place(b)));
    parts
}
