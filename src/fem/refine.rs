//! Uniform refinement by bisection of all edges.

use std::collections::{BTreeMap, HashMap};

use super::vectors::{key, mean};
use super::{CellKind, FemError, Mesh};

impl Mesh {
    /// Every edge halved: triangles and quadrilaterals become four cells, tetrahedra, hexahedra and wedges eight, pyramids six
    /// pyramids and four tetrahedra. New nodes follow the old
    /// ones; groups are inherited.
    ///
    /// # Errors
    /// Cells so distorted that a child is folded; cells of second order ([`FemError::Order`]).
    pub fn refined(&self) -> Result<Self, FemError> {
        self.check_first_order()?;
        let mut refiner = Refiner {
            points: self.points().to_vec(),
            middle: HashMap::new(),
        };
        let mut cells = Vec::new();
        let mut children = Vec::with_capacity(self.num_cells());
        for cell in 0..self.num_cells() {
            let begin = cells.len();
            let kind = self.kind(cell);
            if kind == CellKind::Pyramid {
                cells.extend(refiner.split_pyramid(self.cell(cell)));
            } else {
                let own = refiner.split(kind, self.cell(cell)).into_iter();
                cells.extend(own.map(|child| (kind, child)));
            }
            children.push(begin..cells.len());
        }
        let facets: BTreeMap<_, _> = self
            .groups()
            .0
            .iter()
            .map(|(name, list)| {
                let fine = list.iter().flat_map(|f| refiner.split_facet(f)).collect();
                (name.clone(), fine)
            })
            .collect();
        let groups = self.refined_cell_groups(&children);
        let mut mesh = Self::new(self.dim(), refiner.points, cells)?;
        mesh.set_groups(facets, groups);
        Ok(mesh.with_node_groups(self.node_groups()))
    }
}

struct Refiner {
    points: Vec<[f64; 3]>,
    /// The midpoint node of an edge, a face or a cell, keyed by its (up to four) first nodes in increasing order.
    middle: HashMap<[usize; 4], usize>,
}

impl Refiner {
    fn mid(&mut self, nodes: &[usize]) -> usize {
        let points = &mut self.points;
        *self.middle.entry(key(nodes.iter().copied())).or_insert_with(|| {
            points.push(mean(
                nodes.iter().map(|&n| points[n]).collect::<Vec<_>>().into_iter(),
            ));
            points.len() - 1
        })
    }

    fn split(&mut self, kind: CellKind, n: &[usize]) -> Vec<Vec<usize>> {
        match kind {
            CellKind::Tetrahedron => self.split_tetrahedron(n),
            CellKind::Hexahedron => self.split_hexahedron(n),
            CellKind::Wedge => self.split_wedge(n),
            _ => self.split_face(n),
        }
    }

    fn split_facet(&mut self, n: &[usize]) -> Vec<Vec<usize>> {
        if n.len() == 2 {
            let m = self.mid(n);
            vec![vec![n[0], m], vec![m, n[1]]]
        } else {
            self.split_face(n)
        }
    }

    fn split_face(&mut self, n: &[usize]) -> Vec<Vec<usize>> {
        if n.len() == 3 {
            let (a, b, c) = (
                self.mid(&[n[0], n[1]]),
                self.mid(&[n[1], n[2]]),
                self.mid(&[n[2], n[0]]),
            );
            return vec![
                vec![n[0], a, c],
                vec![a, n[1], b],
                vec![c, b, n[2]],
                vec![a, b, c],
            ];
        }
        let centre = self.mid(n);
        let edge: [usize; 4] = std::array::from_fn(|i| self.mid(&[n[i], n[(i + 1) % 4]]));
        (0..4)
            .map(|i| {
                // Oriented so that all children have the corner sequence of the parent.
                let mut child = vec![n[i], edge[i], centre, edge[(i + 3) % 4]];
                child.rotate_right(i);
                child
            })
            .collect()
    }

    fn split_wedge(&mut self, n: &[usize]) -> Vec<Vec<usize>> {
        const TRIANGLES: [[usize; 3]; 4] = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]];
        // Corners of three triangles one above the other, then the middles of their edges.
        let mut layers = [[0; 6]; 3];
        for k in 0..3 {
            let (m, [a, b]) = ((k + 1) % 3, [k, k + 3]);
            layers[0][a] = n[k];
            layers[1][a] = self.mid(&[n[k], n[k + 3]]);
            layers[2][a] = n[k + 3];
            layers[0][b] = self.mid(&[n[k], n[m]]);
            layers[1][b] = self.mid(&[n[k], n[m], n[m + 3], n[k + 3]]);
            layers[2][b] = self.mid(&[n[k + 3], n[m + 3]]);
        }
        let between = |low: usize| {
            TRIANGLES.map(|t| {
                let layer = |l: usize| t.map(|k| layers[l][k]);
                [layer(low), layer(low + 1)].concat()
            })
        };
        between(0).into_iter().chain(between(1)).collect()
    }

    fn split_pyramid(&mut self, n: &[usize]) -> Vec<(CellKind, Vec<usize>)> {
        let centre = self.mid(&n[..4]);
        let below: [usize; 4] = std::array::from_fn(|k| self.mid(&[n[k], n[(k + 1) % 4]]));
        let above: [usize; 4] = std::array::from_fn(|k| self.mid(&[n[k], n[4]]));
        let mut children = vec![
            (
                CellKind::Pyramid,
                vec![above[0], above[1], above[2], above[3], n[4]],
            ),
            (
                CellKind::Pyramid,
                vec![above[0], above[3], above[2], above[1], centre],
            ),
        ];
        for k in 0..4 {
            let (before, after) = ((k + 3) % 4, (k + 1) % 4);
            let corner = vec![n[k], below[k], centre, below[before], above[k]];
            children.push((CellKind::Pyramid, corner));
            let side = vec![below[k], centre, above[k], above[after]];
            children.push((CellKind::Tetrahedron, side));
        }
        children
    }

    fn split_tetrahedron(&mut self, n: &[usize]) -> Vec<Vec<usize>> {
        let mut m = |a: usize, b: usize| self.mid(&[n[a], n[b]]);
        let (e01, e02, e03, e12, e13, e23) = (m(0, 1), m(0, 2), m(0, 3), m(1, 2), m(1, 3), m(2, 3));
        let mut children = vec![
            vec![n[0], e01, e02, e03],
            vec![e01, n[1], e12, e13],
            vec![e02, e12, n[2], e23],
            vec![e03, e13, e23, n[3]],
        ];
        // The octahedron inside, cut along its shortest diagonal (Bey 1995): ring of the four other nodes, in order.
        let length = |a: usize, b: usize| -> f64 {
            (0..3)
                .map(|d| (self.points[a][d] - self.points[b][d]).powi(2))
                .sum()
        };
        let diagonals = [
            (e02, e13, [e01, e12, e23, e03]),
            (e01, e23, [e02, e03, e13, e12]),
            (e03, e12, [e01, e02, e23, e13]),
        ];
        let mut best = diagonals[0];
        for d in &diagonals[1..] {
            if length(d.0, d.1) < length(best.0, best.1) * (1.0 - 1e-12) {
                best = *d;
            }
        }
        let (a, b, ring) = best;
        for i in 0..4 {
            let mut child = vec![a, b, ring[i], ring[(i + 1) % 4]];
            if self.volume(&child) < 0.0 {
                child.swap(2, 3);
            }
            children.push(child);
        }
        children
    }

    fn volume(&self, n: &[usize]) -> f64 {
        use super::vectors::{cross, difference, dot};
        let p = |a: usize| difference(self.points[n[a]], self.points[n[0]]);
        dot(cross(p(1), p(2)), p(3))
    }

    fn split_hexahedron(&mut self, n: &[usize]) -> Vec<Vec<usize>> {
        // Node at (i, j, k) of the 3 × 3 × 3 grid: the midpoint of the corners whose coordinates agree with those of (i, j, k) that are not
        // 1.
        const CORNERS: [[usize; 3]; 8] = [
            [0, 0, 0],
            [2, 0, 0],
            [2, 2, 0],
            [0, 2, 0],
            [0, 0, 2],
            [2, 0, 2],
            [2, 2, 2],
            [0, 2, 2],
        ];
        let mut grid = [0; 27];
        for (place, node) in grid.iter_mut().enumerate() {
            let at = [place % 3, place / 3 % 3, place / 9];
            let corners: Vec<usize> = (0..8)
                .filter(|&c| (0..3).all(|d| at[d] == 1 || CORNERS[c][d] == at[d]))
                .map(|c| n[c])
                .collect();
            *node = match corners.len() {
                1 => corners[0],
                2 | 4 => self.mid(&corners),
                _ => {
                    let centre = mean(
                        corners
                            .iter()
                            .map(|&c| self.points[c])
                            .collect::<Vec<_>>()
                            .into_iter(),
                    );
                    self.points.push(centre);
                    self.points.len() - 1
                }
            };
        }
        let mut children = Vec::with_capacity(8);
        for k in 0..2 {
            for j in 0..2 {
                for i in 0..2 {
                    children.push(
                        CORNERS
                            .iter()
                            .map(|c| grid[(i + c[0] / 2) + 3 * (j + c[1] / 2) + 9 * (k + c[2] / 2)])
                            .collect(),
                    );
                }
            }
        }
        children
    }
}
