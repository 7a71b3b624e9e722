use std::fmt;
use std::sync::Arc;

use super::element::Reference;
use super::facet::integrate;
use super::vectors::{by_position, cross, dot, norm};
use super::{ElasticSystem, FemError};
use crate::input::check_length;
use crate::interface::LoadCase;
use crate::sparse::{Matrix, own_nodes};

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
    pub(super) fn gap_at(&self, at: [f64; 3]) -> Result<f64, FemError> {
        let value = (self.gap)(at);
        match value.is_finite() {
            true => Ok(value),
            false => Err(FemError::NotFinite {
                what: "the gap",
                at,
                value,
            }),
        }
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
    /// Tangents that are held, as on a plane of symmetry: the displacement along them is prescribed as 0, their row is 0, and so is the
    /// multiplier. Solutions are then those with that symmetry; others of the whole body are not among them.
    pub held: Vec<[bool; 2]>,
    /// Lumped length or area, of the whole ring in a body of revolution: nodal force / area is the mean traction.
    pub areas: Vec<f64>,
    /// Bν, p × n.
    pub normal: Matrix,
    /// Bt, p × n each: one in the plane; in space two, along t₁ and along t₂.
    pub tangential: Vec<Matrix>,
    /// Nodes and directions in which the rows leave out displacements that are prescribed as 0.
    pub(super) resting: Vec<(usize, [f64; 3])>,
}

impl ContactRows {
    pub(super) fn empty() -> Self {
        Self {
            nodes: Vec::new(),
            points: Vec::new(),
            gap: Vec::new(),
            normals: Vec::new(),
            tangents: Vec::new(),
            held: Vec::new(),
            areas: Vec::new(),
            normal: Matrix::identity(0),
            tangential: Vec::new(),
            resting: Vec::new(),
        }
    }

    /// Makes the matrices, normal and tangential, from their entries.
    pub(super) fn fill(
        &mut self,
        system: &ElasticSystem,
        entries: &[Vec<(usize, usize, f64)>; 3],
    ) -> Result<(), FemError> {
        let matrix = |k: usize| Matrix::from_triplets(self.nodes.len(), system.num_free(), &entries[k]);
        self.normal = matrix(0)?;
        self.tangential = (1..system.mesh().dim()).map(matrix).collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Whether each contact node is one node of the mesh with its own displacements, as it is on foundations unless multipliers are those of
    /// patches. Between two bodies it is not.
    #[must_use]
    pub fn is_nodal(&self, system: &ElasticSystem) -> bool {
        let node_of = nodes_of(system);
        let mut rows = std::iter::once(&self.normal).chain(&self.tangential);
        rows.all(|m| {
            m.triplets()
                .all(|(row, column, v)| v == 0.0 || node_of.get(column) == self.nodes.get(row))
        })
    }

    /// Whether each contact node is one node of the mesh with a share of at least a half in its rows, which is in no other row: what contact
    /// in the displacements alone ([`ReducedBody`](crate::contact::ReducedBody)) needs. So it is on foundations, and between two bodies with
    /// facets of first order.
    #[must_use]
    pub fn has_own_nodes(&self, system: &ElasticSystem) -> bool {
        let node_of = nodes_of(system);
        let traces: Vec<&Matrix> = std::iter::once(&self.normal).chain(&self.tangential).collect();
        let known = traces.iter().all(|m| m.ncols() == node_of.len());
        known && own_nodes(&traces, |k| node_of[k], system.mesh().num_nodes()).is_ok()
    }

    /// Number of contact nodes with a held tangent.
    #[must_use]
    pub fn num_held(&self) -> usize {
        self.held.iter().filter(|h| h.contains(&true)).count()
    }

    /// Checks that a load case leaves at rest all supports that the rows take to be so: those of [held](Self::held) tangents, and other
    /// nodes of supports on the boundaries in contact.
    ///
    /// # Errors
    /// [`FemError::ContactFixed`] with the node that moves; a load case with supports of another body.
    pub fn check_supports(&self, system: &ElasticSystem, case: &LoadCase) -> Result<(), FemError> {
        let (dim, moved) = (system.mesh().dim(), case.displacements());
        let all = dim * system.mesh().num_nodes();
        if moved.is_empty() {
            return Ok(());
        }
        check_length("the vector of displacements of the supports", moved.len(), all)?;
        for &(node, direction) in &self.resting {
            let own = &moved[dim * node..dim * (node + 1)];
            if own
                .iter()
                .zip(direction)
                .any(|(u, t)| t.abs() > NOTHING && *u != 0.0)
            {
                return Err(FemError::ContactFixed {
                    node,
                    at: system.mesh().points()[node],
                    direction: "normal or tangential",
                });
            }
        }
        Ok(())
    }
}

/// How the supports of a node restrict its displacement along a direction.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Along {
    Free,
    /// Prescribed as 0.
    Held,
    /// Prescribed as another value.
    Moved,
    /// Some components are free and others prescribed.
    Oblique,
}

/// Components of unit vectors below this are rounding.
pub(super) const NOTHING: f64 = 1e-14;

impl ElasticSystem {
    pub(super) fn along(&self, node: usize, direction: [f64; 3]) -> Along {
        let used = || (0..self.mesh().dim()).filter(|&d| direction[d].abs() > NOTHING);
        let fixed = |d: &usize| self.dof(node, *d).is_none();
        if !used().any(|d| fixed(&d)) {
            return Along::Free;
        }
        if used()
            .filter(fixed)
            .any(|d| self.prescribed_value(node, d) != 0.0)
        {
            return Along::Moved;
        }
        match used().all(|d| fixed(&d)) {
            true => Along::Held,
            false => Along::Oblique,
        }
    }

    /// The mean normal of the facets at a node: on a plane of symmetry that of the whole body, which lies in the plane.
    pub(super) fn symmetric_normal(&self, node: usize, sum: [f64; 3]) -> [f64; 3] {
        let held = |d: usize| {
            d < self.mesh().dim() && self.dof(node, d).is_none() && self.prescribed_value(node, d) == 0.0
        };
        std::array::from_fn(|d| if held(d) { 0.0 } else { sum[d] })
    }

    /// Adds v times the displacement of a node along a direction to row i; components prescribed as 0 are left out.
    pub(super) fn add_entries(
        &self,
        (i, node, v): (usize, usize, f64),
        direction: [f64; 3],
        name: &'static str,
        entries: &mut Vec<(usize, usize, f64)>,
        resting: &mut Vec<(usize, [f64; 3])>,
    ) -> Result<(), FemError> {
        let mut rests = false;
        for d in (0..self.mesh().dim()).filter(|&d| direction[d].abs() > NOTHING) {
            match self.dof(node, d) {
                Some(dof) => entries.push((i, dof, v * direction[d])),
                None if self.prescribed_value(node, d) == 0.0 => rests = true,
                None => {
                    return Err(FemError::ContactFixed {
                        node,
                        at: self.mesh().points()[node],
                        direction: name,
                    });
                }
            }
        }
        if rests {
            resting.push((node, direction));
        }
        Ok(())
    }
}

impl ElasticSystem {
    /// The nodes of a group of facets as contact nodes. Nodes with all components prescribed are left out.
    ///
    /// Facets of second order have multipliers at their corners alone, linear between them; their rows are means of the displacement,
    /// weighted by these functions.
    ///
    /// Planes of symmetry: nodes whose displacement along ν is prescribed as 0 are left out, and tangents along which it is are
    /// [held](ContactRows::held). There ν must lie in the plane, and so must each tangent, or be orthogonal to it; normals of the
    /// boundary are those of the whole body.
    ///
    /// ```
    /// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
    /// let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [4, 4])?;
    /// let half = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix_component("left", 0).fix("top").assemble()?;
    /// let rows = half.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    /// assert_eq!((rows.nodes.len(), rows.num_held()), (5, 1));
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    ///
    /// # Errors
    /// Groups that do not exist or, unless the mesh is a [part](super::Mesh::into_part), are empty or have no free nodes; nodes whose
    /// displacement along ν or a tangent is prescribed as another value than 0 ([`FemError::ContactFixed`]) or in part
    /// ([`FemError::ObliqueAxis`]), normals and tangents that are zero, not finite or
    /// parallel, gaps that are not finite.
    pub fn contact(&self, facets: &str, foundation: &Foundation) -> Result<ContactRows, FemError> {
        let mesh = self.mesh();
        let dim = mesh.dim();
        let group = mesh.facet_group(facets)?;
        let is_second = |f: &Vec<usize>| f.len() > Reference::of_facet(dim, f.len()).num_corners();
        if group.iter().any(is_second) {
            return self.contact_at_corners(facets, foundation);
        }
        let mut area = vec![0.0; mesh.num_nodes()];
        let mut normal = vec![[0.0; 3]; mesh.num_nodes()];
        for facet in group {
            integrate(mesh, facet, |at, shape, measure| {
                for (&node, s) in facet.iter().zip(shape) {
                    area[node] += s * measure * self.round(at);
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
        let mut entries = [Vec::new(), Vec::new(), Vec::new()];
        let mut rows = ContactRows::empty();
        let mut outward = false;
        for node in nodes {
            let (i, at) = (rows.nodes.len(), points[node]);
            let nu = match foundation.normal_at(at) {
                Some(nu) => nu,
                None => {
                    let (sum, own) = (normal[node], self.symmetric_normal(node, normal[node]));
                    if norm(own) <= NOTHING * norm(sum) && norm(sum) > 0.0 {
                        continue;
                    }
                    own
                }
            };
            let nu = unit(node, dim, nu, "its normal is zero or not finite")?;
            let gap = foundation.gap_at(at)?;
            outward |= dot(nu, normal[node]) >= 0.0;
            let frame = frame(node, dim, nu, foundation.tangent_at(at))?;
            if self.along(node, nu) == Along::Held {
                continue;
            }
            let mut held = [false; 2];
            for (d, direction) in [nu, frame[0], frame[1]].into_iter().enumerate().take(dim) {
                let name = if d == 0 { "normal" } else { "tangential" };
                let along = self.along(node, direction);
                if along == Along::Oblique {
                    return Err(FemError::ObliqueAxis {
                        node,
                        at,
                        direction: name,
                    });
                }
                if d > 0 {
                    held[d - 1] = along == Along::Held;
                }
                self.add_entries(
                    (i, node, 1.0),
                    direction,
                    name,
                    &mut entries[d],
                    &mut rows.resting,
                )?;
            }
            rows.nodes.push(node);
            rows.points.push(at);
            rows.areas.push(area[node]);
            rows.gap.push(gap);
            rows.normals.push(nu);
            rows.tangents.push(frame);
            rows.held.push(held);
        }
        let p = rows.nodes.len();
        if p == 0 && !mesh.is_part() {
            return Err(FemError::EmptyGroup {
                what: "facets with a node that is free along ν",
                name: facets.into(),
            });
        }
        if !outward && p > 0 {
            return Err(FemError::Frame {
                node: rows.nodes[0],
                what: INWARD.into(),
            });
        }
        rows.fill(self, &entries)?;
        Ok(rows)
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

/// The node of each free displacement.
fn nodes_of(system: &ElasticSystem) -> Vec<usize> {
    let dim = system.mesh().dim();
    let mut node_of = vec![usize::MAX; system.num_free()];
    for (node, component) in (0..system.mesh().num_nodes()).flat_map(|n| (0..dim).map(move |d| (n, d))) {
        if let Some(unknown) = system.dof(node, component) {
            node_of[unknown] = node;
        }
    }
    node_of
}
