use std::fmt;
use std::sync::Arc;

use super::facet::integrate;
use super::mesh::{by_position, cross, dot, norm};
use super::{ElasticSystem, FemError};
use crate::sparse::Matrix;

/// Message for normals that point into the body at all nodes.
pub(super) const INWARD: &str = "its ν, like that of all others, points into the body: the normal of a plane foundation points to the \
                                 body, that of `with_normal` out of it";

type GapFunction = Arc<dyn Fn([f64; 3]) -> f64 + Send + Sync>;
type Direction = Arc<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>;

/// A rigid foundation: the gap below each contact node, the direction ν in which it is measured (out of the body, towards the
/// foundation) and, in space, the tangents.
#[derive(Clone)]
pub struct Foundation {
    gap: GapFunction,
    /// The outward normals of the boundary if none.
    normal: Option<Direction>,
    /// The projected x axis if none (the y axis where ν is nearly parallel to x).
    tangent: Option<Direction>,
}

impl fmt::Debug for Foundation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Foundation")
    }
}

impl Foundation {
    /// The half-space below the plane through `point` with the normal `normal`, which points to the body and is normalised. ν = −normal,
    /// gap = (x − point)·normal.
    #[must_use]
    pub fn plane(point: [f64; 3], normal: [f64; 3]) -> Self {
        let length = norm(normal);
        let n = normal.map(|x| x / length);
        Self {
            gap: Arc::new(move |x| (0..3).map(|d| (x[d] - point[d]) * n[d]).sum()),
            normal: Some(Arc::new(move |_| n.map(|x| -x))),
            tangent: None,
        }
    }

    /// A foundation at distance `gap(x)` along the outward normal of the body's boundary (at nodes: the mean of the facets', weighted
    /// by their size).
    #[must_use]
    pub fn gap(gap: impl Fn([f64; 3]) -> f64 + Send + Sync + 'static) -> Self {
        Self {
            gap: Arc::new(gap),
            normal: None,
            tangent: None,
        }
    }

    /// Sets the direction ν(x), out of the body; it is normalised.
    #[must_use]
    pub fn with_normal(mut self, normal: impl Fn([f64; 3]) -> [f64; 3] + Send + Sync + 'static) -> Self {
        self.normal = Some(Arc::new(normal));
        self
    }

    /// Sets the first tangent t₁(x) in space, as the first principal axis of orthotropic friction: its part orthogonal to ν is
    /// normalised; t₂ = t₁ × ν.
    #[must_use]
    pub fn with_tangent(mut self, tangent: impl Fn([f64; 3]) -> [f64; 3] + Send + Sync + 'static) -> Self {
        self.tangent = Some(Arc::new(tangent));
        self
    }
}

impl Foundation {
    pub(super) fn gap_at(&self, x: [f64; 3]) -> f64 {
        (self.gap)(x)
    }

    pub(super) fn normal_at(&self, x: [f64; 3]) -> Option<[f64; 3]> {
        self.normal.as_ref().map(|f| f(x))
    }

    pub(super) fn tangent_at(&self, x: [f64; 3]) -> Option<[f64; 3]> {
        self.tangent.as_ref().map(|f| f(x))
    }
}

/// The contact nodes with their traces: multipliers are nodal forces (lumped), one normal and one or two tangential a node. Other
/// multipliers come from [`ElasticSystem::contact_with`].
///
/// Row i of Bν is ν(xᵢ) at the displacements of node i, so (Bν u)ᵢ = u_ν(xᵢ); with λν = −(nodal contact force)·ν ≥ 0 the
/// equilibrium is A u + Bνᵀ λν + Btᵀ λt = f.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ContactRows {
    /// Mesh node of each contact node, ordered by x, then y, then z.
    pub nodes: Vec<usize>,
    /// Their positions.
    pub points: Vec<[f64; 3]>,
    /// Initial gap: u_ν ≤ gap.
    pub gap: Vec<f64>,
    /// Unit normal ν, out of the body.
    pub normals: Vec<[f64; 3]>,
    /// Unit tangents: in the plane the first is ν turned by +90° (the x axis below a body on the ground), the second is 0.
    pub tangents: Vec<[[f64; 3]; 2]>,
    /// Lumped length or area: nodal force / area is the mean traction.
    pub areas: Vec<f64>,
    /// Bν, p × n.
    pub normal: Matrix,
    /// Bt, p × n; in space along t₁.
    pub tangential: Matrix,
    /// In space, the tangential trace along t₂.
    pub tangential2: Option<Matrix>,
}

impl ContactRows {
    pub(super) fn empty() -> Self {
        let nothing = || Matrix::identity(0);
        Self {
            nodes: Vec::new(),
            points: Vec::new(),
            gap: Vec::new(),
            normals: Vec::new(),
            tangents: Vec::new(),
            areas: Vec::new(),
            normal: nothing(),
            tangential: nothing(),
            tangential2: None,
        }
    }
}

impl ElasticSystem {
    /// The nodes of a group of facets as contact nodes. Nodes with all components prescribed are left out.
    ///
    /// # Errors
    /// Groups that do not exist or, unless the mesh is a [part](super::Mesh::into_part), are empty or have no free nodes; nodes with some
    /// of the components used by contact prescribed ([`FemError::ContactFixed`]), normals and tangents that are zero, not finite or
    /// parallel, gaps that are not finite.
    pub fn contact(&self, facets: &str, foundation: &Foundation) -> Result<ContactRows, FemError> {
        let mesh = self.mesh();
        let dim = mesh.dim();
        let group = mesh.facet_group(facets)?;
        let mut area = vec![0.0; mesh.num_nodes()];
        let mut normal = vec![[0.0; 3]; mesh.num_nodes()];
        for facet in group {
            integrate(mesh.points(), facet, |_, shape, measure| {
                for (&node, s) in facet.iter().zip(shape) {
                    area[node] += s * measure;
                }
            });
            let vector = mesh.area_vector(facet);
            for &node in facet {
                for d in 0..3 {
                    normal[node][d] += vector[d];
                }
            }
        }
        let mut nodes: Vec<usize> = group.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes.retain(|&n| (0..dim).any(|d| self.dof(n, d).is_some()));
        if nodes.is_empty() && !mesh.is_part() {
            return Err(FemError::EmptyGroup {
                what: "facets with a free node",
                name: facets.into(),
            });
        }
        let points = mesh.points();
        nodes.sort_by(|&a, &b| by_position(points[a], points[b]));
        let p = nodes.len();
        let mut rows = [Vec::new(), Vec::new(), Vec::new()];
        let (mut gaps, mut normals, mut tangents) = (Vec::new(), Vec::new(), Vec::new());
        let mut outward = false;
        for (i, &node) in nodes.iter().enumerate() {
            let at = points[node];
            let nu = foundation.normal_at(at).unwrap_or(normal[node]);
            let nu = unit(node, dim, nu, "its normal is zero or not finite")?;
            let gap = foundation.gap_at(at);
            if !gap.is_finite() {
                return Err(FemError::NotFinite {
                    what: "the gap",
                    at,
                    value: gap,
                });
            }
            outward |= dot(nu, normal[node]) >= 0.0;
            let frame = frame(node, dim, nu, foundation.tangent_at(at))?;
            for (row, direction) in rows.iter_mut().zip([nu, frame[0], frame[1]]) {
                for (d, &v) in direction.iter().enumerate().take(dim) {
                    if v.abs() <= 1e-14 {
                        continue;
                    }
                    match self.dof(node, d) {
                        Some(dof) => row.push((i, dof, v)),
                        None => {
                            return Err(FemError::ContactFixed {
                                node,
                                at,
                                direction: if direction == nu { "normal" } else { "tangential" },
                            });
                        }
                    }
                }
            }
            gaps.push(gap);
            normals.push(nu);
            tangents.push(frame);
        }
        if !outward && p > 0 {
            return Err(FemError::Frame {
                node: nodes[0],
                what: INWARD.into(),
            });
        }
        let matrix = |row: &[(usize, usize, f64)]| Matrix::from_triplets(p, self.num_free(), row);
        Ok(ContactRows {
            points: nodes.iter().map(|&n| points[n]).collect(),
            areas: nodes.iter().map(|&n| area[n]).collect(),
            gap: gaps,
            normals,
            tangents,
            normal: matrix(&rows[0])?,
            tangential: matrix(&rows[1])?,
            tangential2: (dim == 3).then(|| matrix(&rows[2])).transpose()?,
            nodes,
        })
    }
}

pub(super) fn frame(
    node: usize,
    dim: usize,
    nu: [f64; 3],
    wish: Option<[f64; 3]>,
) -> Result<[[f64; 3]; 2], FemError> {
    if dim == 2 {
        return Ok([[-nu[1], nu[0], 0.0], [0.0; 3]]);
    }
    let wish = wish.unwrap_or(if nu[0].abs() < 0.9 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    });
    let along = dot(wish, nu);
    let t = std::array::from_fn(|d| wish[d] - along * nu[d]);
    let t1 = if norm(t) > 1e-8 * norm(wish) {
        unit(node, dim, t, "its tangent is not finite")?
    } else {
        return Err(FemError::Frame {
            node,
            what: format!("its tangent {wish:?} is parallel to its normal {nu:?}"),
        });
    };
    Ok([t1, cross(t1, nu)])
}

pub(super) fn unit(node: usize, dim: usize, mut v: [f64; 3], what: &str) -> Result<[f64; 3], FemError> {
    if dim == 2 {
        v[2] = 0.0;
    }
    let length = norm(v);
    if length > 0.0 && length.is_finite() {
        // Adding 0 turns −0 into 0.
        Ok(v.map(|x| x / length + 0.0))
    } else {
        Err(FemError::Frame {
            node,
            what: what.into(),
        })
    }
}
