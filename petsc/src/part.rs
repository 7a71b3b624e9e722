use std::ops::Range;
use std::path::Path;

use semismooth::fem::{FemError, Mesh, read_gmsh};
use semismooth::output::OutputError;
use thiserror::Error;

use crate::ffi::Int;
use crate::scatter::{Cutter, Piece};
use crate::world::{Error, PetscError, World};

/// Errors of parts of meshes.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PartError {
    /// Fewer nodes than processes, along the directions that can be cut.
    #[error("a grid of {cells:?} cells cannot be cut for {processes} processes: use fewer")]
    TooManyProcesses {
        /// Cells along each axis.
        cells: Vec<usize>,
        /// Number of processes.
        processes: usize,
    },
    /// Fewer nodes than processes.
    #[error("{nodes} nodes cannot be spread over {processes} processes: use fewer")]
    TooFewNodes {
        /// Nodes of the mesh.
        nodes: usize,
        /// Number of processes.
        processes: usize,
    },
    /// More nodes or cells than can be numbered.
    #[error("a mesh of {nodes} nodes and {cells} cells is too large to be cut in one process")]
    TooLarge {
        /// Nodes of the mesh.
        nodes: usize,
        /// Cells of the mesh.
        cells: usize,
    },
    /// Process 0 has no mesh to cut.
    #[error("process 0 gives the mesh, and gave none")]
    NoMesh,
    /// An error of the mesh.
    #[error(transparent)]
    Mesh(#[from] FemError),
    /// A field that does not fit the part, or a file that cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// The part of a mesh on one process: all cells at the nodes that it owns, and hence some nodes that other processes own.
///
/// Loads, contact rows and stresses are computed on the mesh of the part with [`semismooth::fem`] as if it were the whole mesh; their
/// values at nodes of other processes are not used. Groups of facets and cells exist in all parts, possibly empty. To name cells use
/// [`Mesh::mark_cells`]; [`Mesh::mark_boundary`] would treat the cuts between parts as boundaries.
///
/// ```no_run
/// use semismooth_petsc::{Part, run};
/// fn main() -> std::process::ExitCode {
///     run([], |world| {
///         let part = Part::block(world, [0.0; 3], [2.0, 2.0, 1.0], [88, 84, 44])?;
///         println!("process {} of {}: {} nodes", world.rank(), world.size(), part.own().len());
///         Ok(())
///     })
/// }
/// ```
#[derive(Debug, Clone)]
pub struct Part {
    mesh: Mesh,
    /// Nodes of the mesh that this process owns.
    own: Vec<usize>,
    /// Number of each node of the mesh among those of all processes, which own consecutive ones.
    global: Vec<Int>,
    first: usize,
}

impl Part {
    /// This process's part of [`Mesh::rectangle`], which is cut into rectangles with about equal numbers of nodes. Only the layer of cells
    /// along the cuts is stored on more than one process.
    ///
    /// # Errors
    /// Those of the mesh; grids that cannot be cut into so many parts.
    pub fn rectangle(
        world: &World,
        lower: [f64; 2],
        upper: [f64; 2],
        cells: [usize; 2],
    ) -> Result<Self, Error> {
        world.agree(Self::grid(world.rank(), world.size(), &lower, &upper, &cells))
    }

    /// This process's part of [`Mesh::block`], as [`rectangle`](Self::rectangle).
    ///
    /// # Errors
    /// As [`rectangle`](Self::rectangle).
    pub fn block(world: &World, lower: [f64; 3], upper: [f64; 3], cells: [usize; 3]) -> Result<Self, Error> {
        world.agree(Self::grid(world.rank(), world.size(), &lower, &upper, &cells))
    }

    /// This process's part of the mesh in a Gmsh file, as [`scatter`](Self::scatter). Only process 0 reads the file.
    ///
    /// # Errors
    /// Those of [`read_gmsh`] and of [`scatter`](Self::scatter).
    pub fn read_gmsh(world: &World, path: impl AsRef<Path>) -> Result<Self, Error> {
        let read = match world.rank() {
            0 => read_gmsh(path).map(Some),
            _ => Ok(None),
        };
        Self::scatter(world, world.agree(read)?.as_ref())
    }

    /// This process's part of any mesh on process 0; `mesh` on other processes is ignored. The nodes are divided by recursive bisection of
    /// the longest side of the box around them, and the parts are sent one after another: meanwhile process 0 stores the mesh and one part
    /// more, the others only their own parts.
    ///
    /// Besides the cells at its own nodes a part has the cells at facets of groups that contain a neighbour of an own node, so that
    /// neighbours have the same supports as in the whole mesh. Results at nodes that share no cell with an own node must not be used.
    ///
    /// # Errors
    /// No mesh on process 0, fewer nodes than processes, more than 2³² nodes or cells or than `PetscInt` can number.
    pub fn scatter(world: &World, mesh: Option<&Mesh>) -> Result<Self, Error> {
        let mesh = mesh.filter(|_| world.rank() == 0);
        world.agree(match mesh {
            Some(mesh) => can_be_cut(mesh, world.size()),
            None if world.rank() == 0 => Err(PartError::NoMesh),
            None => Ok(()),
        })?;
        let piece = world.agree(Self::piece(world, mesh))?;
        let (mesh, own, global, first) = world.agree(piece.open())?;
        Ok(Self {
            mesh,
            own,
            global,
            first,
        })
    }

    fn piece(world: &World, mesh: Option<&Mesh>) -> Result<Piece, PetscError> {
        let Some(mesh) = mesh else {
            return Piece::receive(world, 0);
        };
        let cutter = Cutter::new(mesh, world.size());
        for rank in 1..world.size() {
            cutter.piece(rank).send(world, rank)?;
        }
        Ok(cutter.piece(0))
    }

    fn grid(
        rank: usize,
        size: usize,
        lower: &[f64],
        upper: &[f64],
        cells: &[usize],
    ) -> Result<Self, PartError> {
        let dim = cells.len();
        let cut = Cut {
            size,
            nodes: [0, 1, 2].map(|d| cells.get(d).map_or(1, |n| n.saturating_add(1))),
        };
        let (own, first) = cut.part(rank);
        let refuse = || PartError::TooManyProcesses {
            cells: cells.to_vec(),
            processes: size,
        };
        if (0..size).any(|r| cut.part(r).0.iter().any(Range::is_empty)) {
            return Err(refuse());
        }
        // A layer of cells around the own nodes.
        let held: [Range<usize>; 3] = std::array::from_fn(|d| {
            let last = cells.get(d).copied().unwrap_or(0);
            own[d].start.saturating_sub(1)..own[d].end.min(last) + 1
        });
        let line = |d: usize, i: usize| match i == cells[d] {
            true => upper[d],
            false => lower[d] + (upper[d] - lower[d]) * i as f64 / cells[d] as f64,
        };
        let lines: Vec<Vec<f64>> = (0..dim)
            .map(|d| held[d].clone().map(|i| line(d, i)).collect())
            .collect();
        let (grid, names): (_, &[[&str; 2]]) = match &lines[..] {
            [x, y] => (
                Mesh::rectangle_graded(x, y)?,
                &[["left", "right"], ["bottom", "top"]],
            ),
            [x, y, z] => (
                Mesh::block_graded(x, y, z)?,
                &[["left", "right"], ["front", "back"], ["bottom", "top"]],
            ),
            _ => return Err(refuse()),
        };
        let list = (0..grid.num_cells()).map(|c| (grid.kind(c), grid.cell(c).to_vec()));
        let mut mesh = Mesh::new(dim, grid.points().to_vec(), list)?;
        for (d, pair) in names.iter().enumerate() {
            let ends = [held[d].start == 0, held[d].end == cells[d] + 1];
            for (name, is_end) in pair.iter().zip(ends) {
                let facets = match is_end {
                    true => grid.facet_group(name)?.to_vec(),
                    false => Vec::new(),
                };
                mesh.add_facet_group(*name, facets)?;
            }
        }
        let mut part = Self {
            mesh: mesh.into_part(),
            own: Vec::new(),
            global: Vec::new(),
            first,
        };
        for k in held[2].clone() {
            for j in held[1].clone() {
                for i in held[0].clone() {
                    let at = [i, j, k];
                    if (0..3).all(|d| own[d].contains(&at[d])) {
                        part.own.push(part.global.len());
                    }
                    part.global.push(cut.number(at) as Int);
                }
            }
        }
        Ok(part)
    }

    /// The cells at the nodes that this process owns.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The nodes of the mesh that this process owns.
    #[must_use]
    pub fn own(&self) -> &[usize] {
        &self.own
    }

    /// Number of each node of the mesh among those of all processes: process 0 owns the first ones, then comes process 1.
    pub(crate) fn global(&self) -> &[Int] {
        &self.global
    }

    /// Number of the first node that this process owns.
    pub(crate) fn first(&self) -> usize {
        self.first
    }

    /// The nodes of the mesh that other processes own.
    pub(crate) fn others(&self) -> impl Iterator<Item = usize> + '_ {
        let own = self.first as Int..(self.first + self.own.len()) as Int;
        let global = self.global.iter().enumerate();
        global
            .filter(move |(_, g)| !own.contains(g))
            .map(|(node, _)| node)
    }
}

fn can_be_cut(mesh: &Mesh, processes: usize) -> Result<(), PartError> {
    let (nodes, cells) = (mesh.num_nodes(), mesh.num_cells());
    if nodes < processes {
        return Err(PartError::TooFewNodes { nodes, processes });
    }
    if Int::try_from(nodes).is_err() || [nodes, cells].iter().any(|n| *n >= u32::MAX as usize) {
        return Err(PartError::TooLarge { nodes, cells });
    }
    Ok(())
}

/// Nodes of a grid, cut into boxes by recursive bisection of the longest direction. Any process can compute the owner of a node without
/// communication.
struct Cut {
    size: usize,
    nodes: [usize; 3],
}

impl Cut {
    /// Bisects the box of all processes until one process is left; `low` chooses the half, from the direction of the cut, its position and
    /// the number of processes below it. Returns the process, its box, and the number of nodes of the processes before it.
    fn descend(
        &self,
        mut low: impl FnMut(usize, usize, Range<usize>, usize) -> bool,
    ) -> (usize, [Range<usize>; 3], usize) {
        let mut part: [Range<usize>; 3] = self.nodes.map(|n| 0..n);
        let (mut ranks, mut before) = (0..self.size, 0);
        while ranks.len() > 1 {
            let half = ranks.len() / 2;
            let axis = (1..3).fold(
                0,
                |best, d| {
                    if part[d].len() > part[best].len() { d } else { best }
                },
            );
            let length = part[axis].len();
            let at = part[axis].start + (length * half + ranks.len() / 2) / ranks.len();
            if low(axis, at, ranks.clone(), half) {
                part[axis].end = at;
                ranks.end = ranks.start + half;
            } else {
                before += part.iter().map(Range::len).product::<usize>() / length * (at - part[axis].start);
                part[axis].start = at;
                ranks.start += half;
            }
        }
        (ranks.start, part, before)
    }

    /// The box of a process, and the number of nodes in those of the processes before it.
    fn part(&self, rank: usize) -> ([Range<usize>; 3], usize) {
        let (_, part, before) = self.descend(|_, _, ranks, half| rank < ranks.start + half);
        (part, before)
    }

    /// Number of a node: box by box, with x fastest within a box.
    fn number(&self, node: [usize; 3]) -> usize {
        let (_, part, before) = self.descend(|axis, at, _, _| node[axis] < at);
        let inside = |d: usize| node[d] - part[d].start;
        before + inside(0) + part[0].len() * (inside(1) + part[1].len() * inside(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes cover a grid once, and numbers run through the boxes of the processes one after another.
    #[test]
    fn boxes_number_each_node_once() {
        for (size, nodes) in [(1, [4, 3, 2]), (2, [5, 5, 5]), (3, [7, 4, 1]), (7, [6, 9, 5])] {
            let cut = Cut { size, nodes };
            let mut seen = vec![false; nodes.iter().product()];
            let mut end = 0;
            for rank in 0..size {
                let (own, first) = cut.part(rank);
                assert_eq!(first, end);
                let [x, y, z] = own;
                for (k, j, i) in z.flat_map(|k| {
                    let x = x.clone();
                    y.clone().flat_map(move |j| x.clone().map(move |i| (k, j, i)))
                }) {
                    assert_eq!(cut.number([i, j, k]), end);
                    let at = i + nodes[0] * (j + nodes[1] * k);
                    assert!(!std::mem::replace(&mut seen[at], true));
                    end += 1;
                }
            }
            assert!(seen.iter().all(|s| *s));
        }
    }

    /// The parts have all cells at their own nodes, and the facets of the sides among these cells.
    #[test]
    fn parts_have_the_cells_at_their_nodes() {
        let whole = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [5, 4, 3]).unwrap();
        let mut cells = 0;
        for rank in 0..5 {
            let part = Part::grid(rank, 5, &[0.0; 3], &[2.0, 2.0, 1.0], &[5, 4, 3]).unwrap();
            let around = |mesh: &Mesh, at: [f64; 3]| {
                let mine = |c: &usize| mesh.cell(*c).iter().any(|n| mesh.points()[*n] == at);
                (0..mesh.num_cells()).filter(mine).count()
            };
            for &n in part.own() {
                let at = part.mesh().points()[n];
                assert_eq!(around(part.mesh(), at), around(&whole, at));
                cells += 1;
            }
            assert_eq!(part.own().len() + part.others().count(), part.mesh().num_nodes());
            for name in ["left", "right", "front", "back", "bottom", "top"] {
                let facets = part.mesh().facet_group(name).unwrap();
                let theirs = whole.facet_group(name).unwrap();
                let place =
                    |mesh: &Mesh, f: &[usize]| f.iter().map(|n| mesh.points()[*n]).collect::<Vec<_>>();
                for facet in facets {
                    let at = place(part.mesh(), facet);
                    assert!(theirs.iter().any(|f| place(&whole, f) == at));
                }
            }
        }
        assert_eq!(cells, whole.num_nodes());
        assert!(Part::grid(0, 9, &[0.0; 2], &[1.0; 2], &[1, 1]).is_err());
    }
}
