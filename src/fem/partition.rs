//! Partitions T_H of a boundary in contact into elements of their own.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use super::element::Reference;
use super::overlap::{Meeting, Side};
use super::vectors::{by_position, cross, dot, mean, norm};
use super::{FemError, Mesh};
use crate::tolerances::SAME;

/// A partition T_H of the boundary in contact into elements R, of mesh width H, on which multipliers are polynomials.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Partition {
    /// k facets one after another in the plane; k × k quadrilaterals, which must form rows and columns, in space. Where k does not divide
    /// their number, the last elements have fewer.
    Merged(usize),
    /// The facets of each of these groups of the body's mesh are one element.
    Groups(Vec<String>),
    /// The facets of a group of another mesh, which must lie on the boundary, along its normals; its elements may cut facets of the body.
    Coarse {
        /// The mesh.
        mesh: Box<Mesh>,
        /// The group.
        facets: String,
    },
}

/// The elements of a partition.
pub(super) struct Elements<'a> {
    /// The mesh that has their corners.
    mesh: &'a Mesh,
    /// In the order of the facets of that mesh; none for elements that are neither segments nor quadrilaterals nor triangles.
    corners: Vec<Vec<usize>>,
    /// The element that each facet of the body is part of; none where elements are facets of another mesh.
    owner: Vec<usize>,
}

/// A point of integration in an element.
pub(super) struct Place<'a> {
    pub(super) at: [f64; 3],
    pub(super) normal: [f64; 3],
    pub(super) measure: f64,
    /// Shape values of the facet.
    pub(super) shape: &'a [f64],
    pub(super) element: usize,
    /// The linear functions of the corners of the element, ≥ 0 and 1 in sum.
    pub(super) hats: [f64; 4],
}

impl Partition {
    pub(super) fn elements<'a>(
        &'a self,
        mesh: &'a Mesh,
        group: &str,
        linear: bool,
    ) -> Result<Elements<'a>, FemError> {
        let facets = mesh.facet_group(group)?;
        let refused = |what: String| FemError::Partition {
            facets: group.into(),
            what,
        };
        let elements = match self {
            Self::Merged(k) => {
                let (owner, corners) = blocks(mesh, facets, *k).map_err(refused)?;
                Elements { mesh, corners, owner }
            }
            Self::Groups(names) => {
                let name = |facet: &[usize]| facet.iter().copied().collect::<BTreeSet<_>>();
                let place: BTreeMap<_, _> = facets.iter().enumerate().map(|(k, f)| (name(f), k)).collect();
                let mut owner = vec![usize::MAX; facets.len()];
                let mut corners = Vec::new();
                for (e, own) in names.iter().enumerate() {
                    let members = mesh.facet_group(own)?;
                    for facet in members {
                        let at = || middle(mesh, facet);
                        let Some(&k) = place.get(&name(facet)) else {
                            let at = at();
                            return Err(refused(format!(
                                "its element \"{own}\" has a facet at {at:?} that is none of the boundary's"
                            )));
                        };
                        if owner[k] != usize::MAX {
                            let (at, other) = (at(), &names[owner[k]]);
                            return Err(refused(format!(
                                "the facet at {at:?} is in two elements, \"{other}\" and \"{own}\""
                            )));
                        }
                        owner[k] = e;
                    }
                    // Groups of other shapes are elements for constants.
                    let whole = blocks(mesh, members, usize::MAX).ok();
                    let one = whole.filter(|(_, list)| list.len() == 1);
                    corners.push(one.map_or_else(Vec::new, |(_, mut list)| list.swap_remove(0)));
                }
                if let Some(k) = owner.iter().position(|e| *e == usize::MAX) {
                    let at = middle(mesh, &facets[k]);
                    return Err(refused(format!("no element covers the facet at {at:?}")));
                }
                Elements { mesh, corners, owner }
            }
            Self::Coarse {
                mesh: coarse,
                facets: own,
            } => {
                if coarse.dim() != mesh.dim() {
                    return Err(FemError::Dimension { dim: coarse.dim() });
                }
                // Against the order of the facets, as those opposite each other are.
                let corners = |f: &Vec<usize>| {
                    let count = Reference::of_facet(mesh.dim(), f.len()).num_corners();
                    f[..count].iter().rev().copied().collect()
                };
                Elements {
                    mesh: coarse,
                    corners: coarse.facet_group(own)?.iter().map(corners).collect(),
                    owner: Vec::new(),
                }
            }
        };
        match elements.corners.iter().position(Vec::is_empty) {
            Some(e) if linear => Err(refused(format!(
                "element {e} is neither a chain of edges nor made of quadrilaterals in rows and columns: it has constants alone"
            ))),
            _ => Ok(elements),
        }
    }
}

impl Elements<'_> {
    /// The corners of an element, numbered alike in elements that share them.
    pub(super) fn corners(&self, element: usize) -> &[usize] {
        &self.corners[element]
    }

    /// Calls `f` with each facet of the group at points of integration, exactly for straight facets.
    ///
    /// # Errors
    /// Parts of the boundary without an element or with several, elements that reach beyond it; those of `f`.
    pub(super) fn integrate(
        &self,
        mesh: &Mesh,
        group: &str,
        mut f: impl FnMut(&[usize], Place<'_>) -> Result<(), FemError>,
    ) -> Result<(), FemError> {
        let refused = |what: String| FemError::Partition {
            facets: group.into(),
            what,
        };
        let sides: Vec<Option<Side<'_>>> = (self.corners.iter())
            .map(|c| (!c.is_empty()).then(|| Side::new(self.mesh, c)))
            .collect();
        let mut rest: Vec<[f64; 2]> = (sides.iter().flatten())
            .map(|s| [s.measure, SAME * s.measure])
            .collect();
        for (k, facet) in mesh.facet_group(group)?.iter().enumerate() {
            let own = Side::new(mesh, facet);
            let mut failure = Ok(());
            if let Some(&element) = self.owner.get(k) {
                super::facet::integrate_with_normals(mesh, facet, |at, shape, measure, normal| {
                    let hats = sides[element].as_ref().map_or([0.0; 4], |s| s.hats_at(at));
                    if failure.is_ok() {
                        failure = f(
                            facet,
                            Place {
                                at,
                                normal,
                                measure,
                                shape,
                                element,
                                hats,
                            },
                        );
                    }
                });
                failure?;
                continue;
            }
            let (mut met, mut covered, mut slack) = (Vec::new(), 0.0, SAME * own.measure);
            for (element, other) in sides.iter().enumerate() {
                // Elements further away than their own size are none of this boundary.
                let Some(other) = other.as_ref().filter(|s| own.may_face(s, 0.0)) else {
                    continue;
                };
                let (first, mut height) = (met.len(), 0.0_f64);
                own.meet(other, &mut [false; 4], |m: Meeting| {
                    height = height.max(dot(m.way, own.normal).abs());
                    met.push((element, m));
                });
                let measure: f64 = met[first..].iter().map(|m| m.1.weight).sum();
                covered += measure;
                // Edges at a distance from the facet are seen displaced by as much as both are inclined to each
                // other; around the whole facet.
                let edge = if mesh.dim() == 2 { 2.0 } else { TAU * own.radius };
                let turned = norm(cross(own.normal, other.normal)) / dot(own.normal, other.normal).abs();
                slack += edge * height * turned;
                rest[element][0] -= measure;
                rest[element][1] += edge * height * turned;
            }
            if (covered - own.measure).abs() > slack {
                let (at, word) = (
                    own.centre,
                    if covered < own.measure {
                        "no"
                    } else {
                        "more than one"
                    },
                );
                return Err(refused(format!(
                    "{word} element covers a part of the facet at {at:?}"
                )));
            }
            let whole = own.measure / covered;
            for (element, m) in &met {
                let (normal, stretch) = own.stretched(m.x);
                let hats = sides[*element].as_ref().map_or([0.0; 4], |s| s.hats(&m.other));
                let (at, shape) = (m.at, &m.own[..facet.len()]);
                let measure = m.weight * whole * stretch;
                f(
                    facet,
                    Place {
                        at,
                        normal,
                        measure,
                        shape,
                        element: *element,
                        hats,
                    },
                )?;
            }
        }
        if self.owner.is_empty()
            && let Some(e) = rest.iter().position(|[missing, slack]| missing > slack)
        {
            let at = middle(self.mesh, &self.corners[e]);
            return Err(refused(format!(
                "its element at {at:?} reaches beyond the boundary"
            )));
        }
        Ok(())
    }
}

/// The block that each facet belongs to, and the corners of the blocks.
type Blocks = (Vec<usize>, Vec<Vec<usize>>);

/// Merges k facets, or k × k, or all there are.
fn blocks(mesh: &Mesh, facets: &[Vec<usize>], k: usize) -> Result<Blocks, String> {
    if k == 0 {
        return Err("elements of k = 0 facets".into());
    }
    if mesh.dim() == 2 {
        chains(mesh, facets, k)
    } else {
        grids(facets, k)
    }
}

fn middle(mesh: &Mesh, nodes: &[usize]) -> [f64; 3] {
    mean(nodes.iter().map(|&n| mesh.points()[n]))
}

fn too_large(k: usize, found: usize) -> Result<(), String> {
    match k > found && k != usize::MAX {
        true => Err(format!(
            "elements of k = {k} facets in a direction are larger than the boundary, which has {found}"
        )),
        false => Ok(()),
    }
}

/// Edges in the plane, one after another.
fn chains(mesh: &Mesh, facets: &[Vec<usize>], k: usize) -> Result<Blocks, String> {
    let mut at_node: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (f, nodes) in facets.iter().enumerate() {
        nodes[..2]
            .iter()
            .for_each(|n| at_node.entry(*n).or_default().push(f));
    }
    if let Some(node) = at_node.iter().find(|(_, f)| f.len() > 2).map(|(n, _)| *n) {
        let at = mesh.points()[node];
        return Err(format!("more than two facets meet at {at:?}"));
    }
    // Chains begin at their ends, closed ones at their first node.
    let mut starts: Vec<usize> = at_node.keys().copied().collect();
    starts.sort_by(|a, b| {
        let ends = at_node[a].len().cmp(&at_node[b].len());
        ends.then_with(|| by_position(mesh.points()[*a], mesh.points()[*b]))
    });
    let (mut owner, mut corners) = (vec![usize::MAX; facets.len()], Vec::new());
    for start in starts {
        let (mut node, mut length) = (start, 0);
        while let Some(&f) = at_node[&node].iter().find(|f| owner[**f] == usize::MAX) {
            if length % k == 0 {
                corners.push(vec![node, node]);
            }
            owner[f] = corners.len() - 1;
            node = facets[f][usize::from(facets[f][0] == node)];
            if let Some(last) = corners.last_mut() {
                last[1] = node;
            }
            length += 1;
        }
        if length > 0 {
            too_large(k, length)?;
        }
    }
    if corners.iter().any(|c| c[0] == c[1]) {
        // A closed chain is an element without corners.
        corners.iter_mut().filter(|c| c[0] == c[1]).for_each(Vec::clear);
    }
    Ok((owner, corners))
}

/// Quadrilaterals in space, in rows and columns.
fn grids(facets: &[Vec<usize>], k: usize) -> Result<Blocks, String> {
    const SHAPE: &str = "facets to be merged in space are quadrilaterals in rows and columns; these are not: name groups, or give a coarser mesh";
    let mut at_edge: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    for (f, nodes) in facets.iter().enumerate() {
        if Reference::of_facet(3, nodes.len()).num_corners() != 4 {
            return Err(SHAPE.into());
        }
        for a in 0..4 {
            // Twice in one direction: sides of a surface that is none, or facets numbered against each other.
            if at_edge.insert([nodes[a], nodes[(a + 1) % 4]], f).is_some() {
                return Err(SHAPE.into());
            }
        }
    }
    let mut place: BTreeMap<usize, [i64; 2]> = BTreeMap::new();
    let mut seen = vec![false; facets.len()];
    let (mut owner, mut corners) = (vec![0; facets.len()], Vec::new());
    for first in 0..facets.len() {
        if seen[first] {
            continue;
        }
        place.clear();
        let (mut surface, mut next) = (vec![first], 0);
        seen[first] = true;
        let unit = [[0, 0], [1, 0], [1, 1], [0, 1]];
        place.extend((0..4).map(|a| (facets[first][a], unit[a])));
        while let Some(&f) = surface.get(next) {
            next += 1;
            for a in 0..4 {
                let (from, to) = (facets[f][a], facets[f][(a + 1) % 4]);
                let Some(&g) = at_edge.get(&[to, from]) else {
                    continue;
                };
                // The neighbour goes along the edge the other way, and lies on its right.
                let (p, q) = (place[&from], place[&to]);
                let right = [q[1] - p[1], p[0] - q[0]];
                let at = |b: usize| facets[g].iter().take(4).position(|n| *n == b).unwrap_or(0);
                let beyond = [
                    (facets[g][(at(from) + 1) % 4], p),
                    (facets[g][(at(to) + 3) % 4], q),
                ];
                for (node, base) in beyond {
                    let here = [base[0] + right[0], base[1] + right[1]];
                    if *place.entry(node).or_insert(here) != here {
                        return Err(SHAPE.into());
                    }
                }
                if !std::mem::replace(&mut seen[g], true) {
                    surface.push(g);
                }
            }
        }
        let end = |d: usize, sign: i64| place.values().map(|p| sign * p[d]).max().unwrap_or(0) * sign;
        let (low, high) = ([0, 1].map(|d| end(d, -1)), [0, 1].map(|d| end(d, 1)));
        let extent = [0, 1].map(|d| (high[d] - low[d]) as usize);
        too_large(k, extent[0].min(extent[1]))?;
        let width = i64::try_from(k).unwrap_or(i64::MAX);
        let node_at: BTreeMap<[i64; 2], usize> = place.iter().map(|(n, p)| (*p, *n)).collect();
        let mut block: BTreeMap<[i64; 2], (usize, i64)> = BTreeMap::new();
        for f in surface {
            let least = |d: usize| facets[f][..4].iter().map(|n| place[n][d]).min().unwrap_or(0);
            let own = [0, 1].map(|d| (least(d) - low[d]) / width);
            let number = block.len() + corners.len();
            let entry = block.entry(own).or_insert((number, 0));
            entry.1 += 1;
            owner[f] = entry.0;
        }
        let mut list = vec![Vec::new(); block.len()];
        for (own, (number, count)) in block {
            let begin = [0, 1].map(|d| low[d] + own[d] * width);
            let ends = [0, 1].map(|d| begin[d].saturating_add(width).min(high[d]));
            // An element with a part missing has no corners.
            if count == (ends[0] - begin[0]) * (ends[1] - begin[1]) {
                let at = |i: i64, j: i64| node_at.get(&[i, j]).copied();
                let [[i, j], [k, l]] = [begin, ends];
                let four = [at(i, j), at(k, j), at(k, l), at(i, l)];
                list[number - corners.len()] = four.into_iter().flatten().collect();
            }
        }
        corners.append(&mut list);
    }
    Ok((owner, corners))
}
