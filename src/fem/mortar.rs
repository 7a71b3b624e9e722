//! Contact between two deformable boundaries by the mortar method with dual multipliers.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::contact::{Along, INWARD, NOTHING, frame, unit};
use super::facet::integrate;
use super::overlap::{Meeting, Side};
use super::vectors::{by_position, dot};
use super::{ContactRows, ElasticSystem, FemError, Foundation};
use crate::tolerances::SAME;

type GapFunction = Arc<dyn Fn([f64; 3]) -> f64 + Send + Sync>;
type Direction = Arc<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>;

/// How two boundaries of [`ElasticSystem::contact_between`] face each other, beside what their meshes say.
#[derive(Clone, Default)]
pub struct Mortar {
    gap: Option<GapFunction>,
    tangent: Option<Direction>,
    reach: Option<f64>,
}

impl fmt::Debug for Mortar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mortar")
            .field("reach", &self.reach)
            .finish_non_exhaustive()
    }
}

impl Mortar {
    /// Adds `gap(x)`, x on the slave boundary, to the distance between the meshes: of curved boundaries meshed as flat ones, or negative
    /// for an interference.
    #[must_use]
    pub fn with_gap(mut self, gap: impl Fn([f64; 3]) -> f64 + Send + Sync + 'static) -> Self {
        self.gap = Some(Arc::new(gap));
        self
    }

    /// Sets the first tangent t₁(x) in space, as [`Foundation::with_tangent`](super::Foundation::with_tangent) does.
    #[must_use]
    pub fn with_tangent(mut self, tangent: impl Fn([f64; 3]) -> [f64; 3] + Send + Sync + 'static) -> Self {
        self.tangent = Some(Arc::new(tangent));
        self
    }

    /// Facets further apart than this, along the normal of the slave, do not face each other; unless set, all distances count.
    #[must_use]
    pub fn with_reach(mut self, reach: f64) -> Self {
        self.reach = Some(reach);
        self
    }
}

/// What the multiplier of a slave node is paired with.
#[derive(Default)]
struct Multiplier {
    /// ∫ ψ.
    area: f64,
    /// ∫ ψ φ of nodes of the slave, and of the master.
    own: BTreeMap<usize, f64>,
    other: BTreeMap<usize, f64>,
    /// ∫ ψ (x_master − x_slave), and ∫ ψ gap.
    way: [f64; 3],
    gap: f64,
}

impl ElasticSystem {
    /// Two boundaries of the body, or of two bodies in one mesh, that may touch each other. Their meshes need not match. Multipliers belong
    /// to the nodes of `slave`; with the dual basis ψ_i of B. Wohlmuth (SIAM J. Numer. Anal. 38 (2000)) row i is
    ///
    /// ```text
    /// (Σ_k D_ik u_k − Σ_j M_ij u_j) / a_i,   D_ik = ∫ ψ_i φ_k on the slave,  M_ij = ∫ ψ_i φ_j on the master,  a_i = Σ_k D_ik
    /// ```
    ///
    /// along ν and the tangents of the slave, so that λ_i is a nodal force, as in [`contact`](Self::contact), and `areas` are the a_i. D
    /// and M are integrated over the same pieces, exactly for facets on a common plane; points face each other along the normal of the
    /// slave facet, and the basis is rebuilt on facets that the master covers in part. Slave nodes without a free displacement, without a
    /// point of the master opposite, or that belong to the master as well (as at a crack tip) carry no multiplier: their share is that of
    /// their neighbours. Elsewhere D is diagonal.
    ///
    /// Take the side with the larger facets as slave: in the problem of Cattaneo and Mindlin pressures are wrong by 0.3 % of the largest
    /// where the slave is coarser, by 4 % where it is twice as fine, because neighbouring multipliers then act on one node of the master.
    ///
    /// A tangent is [held](ContactRows::held) where it is on the slave and at a node of the master opposite.
    ///
    /// # Errors
    /// Groups that do not exist or are empty; no part of `master` opposite `slave` ([`FemError::NoneOpposite`]); parts of the master that
    /// cover a facet twice ([`FemError::CoveredTwice`]); nodes of either side that are prescribed as another value than 0; axes oblique to
    /// a plane of symmetry; gaps and tangents that are not finite.
    ///
    /// ```
    /// use semismooth::fem::{CellKind, Elasticity, Material, Mesh, Mortar};
    /// // One square above another, with an edge of two halves below.
    /// let points = [[0.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 1.0], [1.0, 1.0]];
    /// let cells = [vec![0, 1, 2, 3], vec![4, 5, 8, 7], vec![5, 6, 9, 8]];
    /// let cells = cells.map(|nodes| (CellKind::Quadrilateral, nodes));
    /// let mut mesh = Mesh::new(2, points.map(|p| [p[0], p[1], 0.0]).to_vec(), cells)?;
    /// mesh.add_facet_group("upper", vec![vec![0, 1]])?;
    /// mesh.add_facet_group("lower", vec![vec![8, 7], vec![9, 8]])?;
    /// mesh.mark_boundary("top", |f| f.centre[1] > 1.9);
    /// mesh.mark_boundary("base", |f| f.centre[1] < 0.1);
    /// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix("base").fix("top").assemble()?;
    /// let rows = system.contact_between("upper", "lower", &Mortar::default())?;
    /// assert_eq!(rows.nodes, [0, 1]);
    /// assert!(rows.gap[0].abs() < 1e-14 && (rows.areas[0] - 0.5).abs() < 1e-14);
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    pub fn contact_between(
        &self,
        slave: &str,
        master: &str,
        mortar: &Mortar,
    ) -> Result<ContactRows, FemError> {
        let mesh = self.mesh();
        let sides = |group: &str| -> Result<Vec<Side<'_>>, FemError> {
            let facets = mesh.facet_group(group)?.iter();
            Ok(facets.map(|f| Side::new(mesh, f)).collect())
        };
        let (own, other) = (sides(slave)?, sides(master)?);
        let reach = mortar.reach.unwrap_or(f64::INFINITY);
        let mut shared = vec![false; mesh.num_nodes()];
        other.iter().flat_map(|f| f.nodes).for_each(|&n| shared[n] = true);
        let mut opposite = Vec::with_capacity(own.len());
        let mut active = vec![false; mesh.num_nodes()];
        let free = |node: usize| !shared[node] && (0..mesh.dim()).any(|d| self.dof(node, d).is_some());
        for side in &own {
            let mut met = meetings(side, &other, reach)?;
            met.0.iter_mut().for_each(|(_, m)| m.weight *= self.round(m.at));
            let covered = side.nodes.iter().zip(met.1).filter(|c| c.1);
            covered.for_each(|(&node, _)| active[node] = free(node));
            opposite.push(met);
        }
        // Parts of the master between the corners of one facet.
        for (side, (met, _)) in own.iter().zip(&opposite) {
            let corners = &side.nodes[..side.num_corners()];
            if !met.is_empty() && corners.iter().all(|&n| !active[n]) {
                corners.iter().for_each(|&n| active[n] = free(n));
            }
        }
        let mut normal: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        let mut multipliers: BTreeMap<usize, Multiplier> = BTreeMap::new();
        for (side, met) in own.iter().zip(&opposite) {
            for &node in side.nodes {
                let sum = normal.entry(node).or_default();
                (0..3).for_each(|d| sum[d] += side.measure * side.normal[d]);
            }
            pair(side, met, &active, mortar, &mut multipliers)?;
        }
        let mut list: Vec<(usize, Multiplier)> = multipliers.into_iter().filter(|m| m.1.area > 0.0).collect();
        if list.is_empty() {
            return Err(FemError::NoneOpposite {
                slave: slave.into(),
                master: master.into(),
            });
        }
        list.sort_by(|a, b| by_position(mesh.points()[a.0], mesh.points()[b.0]));
        let axes = |node: usize, at: [f64; 3]| {
            let sum = normal.get(&node).copied().unwrap_or_default();
            (
                self.symmetric_normal(node, sum),
                mortar.tangent.as_ref().map(|f| f(at)),
            )
        };
        self.rows_of(&list, axes)
    }

    /// The contact rows of facets of second order against a foundation: multipliers are the linear functions of the corners, to which those
    /// of corners without a free displacement are added.
    pub(super) fn contact_at_corners(
        &self,
        facets: &str,
        foundation: &Foundation,
    ) -> Result<ContactRows, FemError> {
        let mesh = self.mesh();
        let mut normal: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        let mut multipliers: BTreeMap<usize, Multiplier> = BTreeMap::new();
        for facet in mesh.facet_group(facets)? {
            let side = Side::new(mesh, facet);
            let free = |k: &usize| (0..mesh.dim()).any(|d| self.dof(facet[*k], d).is_some());
            let active: Vec<usize> = (0..side.num_corners()).filter(free).collect();
            let mut failure = None;
            integrate(mesh, facet, |at, shape, measure| {
                let measure = measure * self.round(at);
                let psi = extended(&side.hats(shape), &active);
                let gap = foundation.gap_at(at).unwrap_or_else(|e| {
                    failure = Some(e);
                    f64::NAN
                });
                for (&k, psi) in active.iter().zip(psi) {
                    let multiplier = multipliers.entry(facet[k]).or_default();
                    multiplier.area += measure * psi;
                    multiplier.gap += measure * psi * gap;
                    for (&node, s) in facet.iter().zip(shape) {
                        *multiplier.own.entry(node).or_insert(0.0) += measure * psi * s;
                    }
                }
            });
            if let Some(e) = failure {
                return Err(e);
            }
            for k in active {
                let sum = normal.entry(facet[k]).or_default();
                (0..3).for_each(|d| sum[d] += side.measure * side.normal[d]);
            }
        }
        let sum_at = |node: usize| normal.get(&node).copied().unwrap_or_default();
        let axes = |node: usize, at: [f64; 3]| {
            let nu = foundation.normal_at(at);
            let nu = nu.unwrap_or_else(|| self.symmetric_normal(node, sum_at(node)));
            (nu, foundation.tangent_at(at))
        };
        let mut list: Vec<(usize, Multiplier)> = multipliers.into_iter().collect();
        list.retain(|(node, _)| self.along(*node, axes(*node, mesh.points()[*node]).0) != Along::Held);
        let Some(&(first, _)) = list.first() else {
            return match mesh.is_part() {
                true => self.rows_of(&list, axes),
                false => Err(FemError::EmptyGroup {
                    what: "facets with a free node",
                    name: facets.into(),
                }),
            };
        };
        list.sort_by(|a, b| by_position(mesh.points()[a.0], mesh.points()[b.0]));
        let rows = self.rows_of(&list, axes)?;
        if rows
            .nodes
            .iter()
            .zip(&rows.normals)
            .all(|(n, nu)| dot(*nu, sum_at(*n)) < 0.0)
        {
            return Err(FemError::Frame {
                node: first,
                what: INWARD.into(),
            });
        }
        Ok(rows)
    }

    fn rows_of(
        &self,
        list: &[(usize, Multiplier)],
        axes: impl Fn(usize, [f64; 3]) -> ([f64; 3], Option<[f64; 3]>),
    ) -> Result<ContactRows, FemError> {
        let (dim, points) = (self.mesh().dim(), self.mesh().points());
        let mut rows = ContactRows::empty();
        let mut entries = [Vec::new(), Vec::new(), Vec::new()];
        for (i, (node, multiplier)) in list.iter().enumerate() {
            let (node, at) = (*node, points[*node]);
            let (nu, tangent) = axes(node, at);
            let nu = unit(node, dim, nu, "its normal is zero or not finite")?;
            let tangents = frame(node, dim, nu, tangent)?;
            let mut held = [false; 2];
            for (d, direction) in [nu, tangents[0], tangents[1]].into_iter().enumerate().take(dim) {
                let name = if d == 0 { "normal" } else { "tangential" };
                let others = &multiplier.other;
                let at_rest = |n: &usize| self.along(*n, direction) == Along::Held;
                let own = self.along(node, direction);
                if own == Along::Oblique {
                    return Err(FemError::ObliqueAxis {
                        node,
                        at,
                        direction: name,
                    });
                }
                if d > 0 && own == Along::Held && (others.is_empty() || others.keys().any(at_rest)) {
                    held[d - 1] = true;
                    rows.resting.push((node, direction));
                    continue;
                }
                // Biorthogonal functions make many entries zero up to rounding.
                let own = multiplier.own.iter().map(|(n, v)| (*n, v / multiplier.area));
                let other = multiplier.other.iter().map(|(n, v)| (*n, -v / multiplier.area));
                for (n, v) in own.chain(other).filter(|e| e.1.abs() > NOTHING) {
                    self.add_entries((i, n, v), direction, name, &mut entries[d], &mut rows.resting)?;
                }
            }
            rows.nodes.push(node);
            rows.points.push(at);
            rows.areas.push(multiplier.area);
            rows.gap
                .push((dot(multiplier.way, nu) + multiplier.gap) / multiplier.area + 0.0);
            rows.normals.push(nu);
            rows.tangents.push(tangents);
            rows.held.push(held);
        }
        rows.fill(self, &entries)?;
        Ok(rows)
    }
}

/// The points of integration of a facet with the facets opposite, and its corners that these cover.
type Met<'a> = Vec<(&'a Side<'a>, Meeting)>;

fn meetings<'a>(
    side: &Side<'_>,
    other: &'a [Side<'a>],
    reach: f64,
) -> Result<(Met<'a>, [bool; 4]), FemError> {
    let (mut met, mut covered, mut measure) = (Vec::new(), [false; 4], 0.0);
    for facet in other.iter().filter(|f| side.may_face(f, reach)) {
        let mut corners = [false; 4];
        let first = met.len();
        side.meet(facet, &mut corners, |m| met.push((facet, m)));
        if met[first..]
            .iter()
            .any(|m| dot(m.1.way, side.normal).abs() > reach)
        {
            met.truncate(first);
            continue;
        }
        measure += met[first..].iter().map(|m| m.1.weight).sum::<f64>();
        (0..4).for_each(|k| covered[k] |= corners[k]);
    }
    if measure > (1.0 + SAME) * side.measure {
        return Err(FemError::CoveredTwice { at: side.centre });
    }
    Ok((met, covered))
}

/// Adds the contributions of one facet to the multipliers of its active nodes.
///
/// With φ̃ the shape functions of the active nodes, to which those of the others are added in equal parts, ψ = E N⁻¹ φ̃ with
/// N_jl = ∫ φ̃_j φ_l and E_l = ∫ φ_l over the covered part: ∫ ψ_i φ_l = δ_il E_l for active nodes, and Σ ψ_i = 1. On facets of second
/// order ψ are the linear functions of the corners, extended in the same way.
fn pair(
    side: &Side<'_>,
    (met, covered): &(Met<'_>, [bool; 4]),
    active: &[bool],
    mortar: &Mortar,
    multipliers: &mut BTreeMap<usize, Multiplier>,
) -> Result<(), FemError> {
    let mut own: Vec<usize> = (0..side.num_corners())
        .filter(|&k| active[side.nodes[k]])
        .collect();
    // A part at one corner does not determine functions of the others.
    if own.iter().any(|&k| covered[k]) {
        own.retain(|&k| covered[k]);
    }
    if own.is_empty() || met.is_empty() {
        return Ok(());
    }
    let count = own.len();
    let extended = |shape: &[f64]| extended(&side.hats(shape), &own);
    let (mut n, mut e) = ([[0.0; 4]; 4], [0.0; 4]);
    let is_dual = side.num_corners() == side.nodes.len();
    for (_, m) in met.iter().filter(|_| is_dual) {
        let tilde = extended(&m.own);
        for (l, &k) in own.iter().enumerate() {
            e[l] += m.weight * m.own[k];
            (0..count).for_each(|j| n[j][l] += m.weight * tilde[j] * m.own[k]);
        }
    }
    // A part that is a point up to rounding contributes nothing.
    let inverse = match is_dual {
        true => inverse(&n, count),
        false => Some([[0.0; 4]; 4]),
    };
    let Some(inverse) = inverse else {
        return Ok(());
    };
    for (facet, m) in met {
        let tilde = extended(&m.own);
        let gap = mortar.gap.as_ref().map_or(0.0, |f| f(m.at));
        if !gap.is_finite() {
            return Err(FemError::NotFinite {
                what: "the gap",
                at: m.at,
                value: gap,
            });
        }
        for (i, &k) in own.iter().enumerate() {
            let psi = match is_dual {
                true => e[i] * (0..count).map(|j| inverse[i][j] * tilde[j]).sum::<f64>(),
                false => tilde[i],
            };
            let weight = m.weight * psi;
            let multiplier = multipliers.entry(side.nodes[k]).or_default();
            multiplier.area += weight;
            multiplier.gap += weight * gap;
            (0..3).for_each(|d| multiplier.way[d] += weight * m.way[d]);
            for (&node, s) in side.nodes.iter().zip(&m.own) {
                *multiplier.own.entry(node).or_insert(0.0) += weight * s;
            }
            for (&node, s) in facet.nodes.iter().zip(&m.other) {
                *multiplier.other.entry(node).or_insert(0.0) += weight * s;
            }
        }
    }
    Ok(())
}

/// Functions of the active corners, to which those of the others are added in equal parts, so that their sum remains 1.
fn extended(hats: &[f64; 4], active: &[usize]) -> [f64; 4] {
    let of_active: f64 = active.iter().map(|&k| hats[k]).sum();
    let share = (1.0 - of_active) / active.len() as f64;
    std::array::from_fn(|j| active.get(j).map_or(0.0, |&k| hats[k] + share))
}

/// The inverse of the leading block of a matrix; `None` where it is singular.
fn inverse(m: &[[f64; 4]; 4], count: usize) -> Option<[[f64; 4]; 4]> {
    let mut a = *m;
    let mut b: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for k in 0..count {
        let pivot = (k..count).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        if a[pivot][k] == 0.0 || !a[pivot][k].is_finite() {
            return None;
        }
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in (0..count).filter(|i| *i != k) {
            let factor = a[i][k] / a[k][k];
            for j in 0..count {
                a[i][j] -= factor * a[k][j];
                b[i][j] -= factor * b[k][j];
            }
        }
    }
    for k in 0..count {
        b[k] = b[k].map(|v| v / a[k][k]);
    }
    Some(b)
}
