use crate::InputError;
use crate::piecewise::{PiecewiseError, carries_maps};

use thiserror::Error;

/// What can be wrong with a mesh, a material, supports, loads or a contact boundary. Nodes, cells and facets count from 0.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FemError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A structured mesh would have more nodes than indices and memory allow.
    #[error("a grid of {cells:?} cells has too many nodes; refine where it matters instead")]
    TooLarge {
        /// Numbers of cells along the axes.
        cells: Vec<usize>,
    },
    /// A mesh without cells, or a generator called with none.
    #[error("the mesh is empty: {what}")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A cell, a facet or a list refers to a node that does not exist.
    #[error("{what} {index} refers to node {node}; nodes are counted from 0, and there are {nodes}")]
    NoSuchNode {
        /// "cell" or "facet".
        what: &'static str,
        /// Which one.
        index: usize,
        /// The node.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// A group has a cell that does not exist.
    #[error("cell {cell} does not exist: cells are counted from 0, and there are {cells}")]
    CellNumber {
        /// Its number.
        cell: usize,
        /// Number of cells.
        cells: usize,
    },
    /// A cell or facet has the wrong number of nodes.
    #[error("{what} {index} has {found} nodes, expected {expected}")]
    CellNodes {
        /// "cell" or "facet".
        what: &'static str,
        /// Which one.
        index: usize,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A cell of another dimension than the mesh.
    #[error("cell {cell} is a {kind}, which does not fit into a mesh of dimension {dim}")]
    CellDimension {
        /// The cell.
        cell: usize,
        /// Its kind.
        kind: &'static str,
        /// Dimension of the mesh.
        dim: usize,
    },
    /// A cell of second order, which is not divided.
    #[error(
        "cell {cell} is a {kind}, which is not divided: only cells of first order are; wedges and pyramids not into simplices"
    )]
    Order {
        /// The cell.
        cell: usize,
        /// Its kind.
        kind: &'static str,
    },
    /// A dimension other than 2 or 3.
    #[error("a mesh has dimension 2 or 3, not {dim}")]
    Dimension {
        /// The dimension requested.
        dim: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} lies at {point:?}; coordinates must be finite")]
    Coordinate {
        /// The node.
        node: usize,
        /// Its position.
        point: [f64; 3],
    },
    /// A node of a body of revolution has a negative radius.
    #[error(
        "node {node} lies at {at:?}: in a body of revolution about x = 0, x is the radius and must not be negative"
    )]
    Radius {
        /// The node.
        node: usize,
        /// Its position.
        at: [f64; 3],
    },
    /// A radial displacement is prescribed on the axis of a body of revolution.
    #[error(
        "the radial displacement of node {node}, on the axis of revolution, is prescribed as {value}; it can only be 0"
    )]
    OnAxis {
        /// The node.
        node: usize,
        /// The value.
        value: f64,
    },
    /// The Jacobian of a cell is not positive.
    #[error(
        "cell {cell} (nodes {nodes:?}) has Jacobian determinant {determinant:e} at ({}, {}, {}): it is turned inside out, folded or flat; \
         number its nodes counter-clockwise, or mesh anew",
        .at[0], .at[1], .at[2]
    )]
    Jacobian {
        /// The cell.
        cell: usize,
        /// Its nodes.
        nodes: Vec<usize>,
        /// The smallest determinant found.
        determinant: f64,
        /// Where.
        at: [f64; 3],
    },
    /// Neighbours that do not share all nodes of the facet between them.
    #[error(
        "cells {} and {} have the corners of the facet around ({}, {}, {}) in common, but not its other nodes: neighbours must have the \
         same order",
        .cells[0], .cells[1], .at[0], .at[1], .at[2]
    )]
    Neighbours {
        /// The cells.
        cells: [usize; 2],
        /// The mean of the nodes of the second one.
        at: [f64; 3],
    },
    /// A node belongs to no cell.
    #[error("node {node} belongs to no cell: its displacement is free of any stiffness; remove it")]
    LooseNode {
        /// The node.
        node: usize,
    },
    /// A grading or partition that does not increase.
    #[error("grid lines along {axis} must increase and be finite: line {line} is {value}")]
    Grading {
        /// "x", "y" or "z".
        axis: &'static str,
        /// The offending line.
        line: usize,
        /// Its coordinate.
        value: f64,
    },
    /// A group that the mesh does not have.
    #[error("there is no group \"{name}\" of {what}; the mesh has {known}")]
    NoSuchGroup {
        /// "facets", "cells", "nodes", or "facets or nodes".
        what: &'static str,
        /// The name given.
        name: String,
        /// The names of the groups that exist.
        known: String,
    },
    /// A node that a group would hold twice.
    #[error("the group \"{group}\" of nodes has node {node} already")]
    NodeTwice {
        /// Its name.
        group: String,
        /// The node.
        node: usize,
    },
    /// Springs between two groups of nodes that have different numbers of them.
    #[error(
        "springs join the nodes of \"{first}\" and \"{second}\" one by one, but these have {} and {} nodes",
        .nodes[0], .nodes[1]
    )]
    Pairs {
        /// The first group.
        first: String,
        /// The second one.
        second: String,
        /// Their numbers of nodes.
        nodes: [usize; 2],
    },
    /// Derivatives in the positions of nodes of a body on an elastic foundation, whose area changes with them.
    #[error(
        "derivatives in positions leave out what changes of elastic foundations: the body must have none"
    )]
    FoundationMoves,
    /// A group without members.
    #[error("the group \"{name}\" of {what} is empty")]
    EmptyGroup {
        /// "facets" or "cells".
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// Material constants out of range.
    #[error("{what} = {value}: {rule}")]
    Material {
        /// Which constant.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range allowed.
        rule: &'static str,
    },
    /// An elasticity tensor without the symmetries c_ijkl = c_jikl = c_klij.
    #[error("the elasticity tensor is not symmetric: c_{}{}{}{} = {first}, c_{}{}{}{} = {second}",
        .indices[0] + 1, .indices[1] + 1, .indices[2] + 1, .indices[3] + 1, .other[0] + 1, .other[1] + 1, .other[2] + 1, .other[3] + 1)]
    TensorSymmetry {
        /// i, j, k, l from 0.
        indices: [usize; 4],
        /// The indices of the entry it should equal.
        other: [usize; 4],
        /// The first entry.
        first: f64,
        /// The second entry.
        second: f64,
    },
    /// An elasticity tensor that is not positive definite.
    #[error("the elasticity tensor is not positive definite: pivot {pivot} of its 6 x 6 matrix is {value:e}")]
    TensorDefinite {
        /// Number of the pivot, from 0, in the order 11, 22, 33, 12, 23, 13.
        pivot: usize,
        /// Its value.
        value: f64,
    },
    /// A component beyond the dimension.
    #[error("component {component} of the displacement does not exist in dimension {dim}")]
    Component {
        /// From 0.
        component: usize,
        /// Dimension of the mesh.
        dim: usize,
    },
    /// A motion is given for a component that is not prescribed.
    #[error(
        "component {component} of node {node} at ({}, {}, {}) is not prescribed: prescribe it (0, say), so that it may move",
        .at[0], .at[1], .at[2]
    )]
    NotPrescribed {
        /// The node of the mesh.
        node: usize,
        /// Its position.
        at: [f64; 3],
        /// The component, from 0.
        component: usize,
    },
    /// A user-defined function returned NaN or infinity.
    #[error("{what} at ({}, {}, {}) is {value}; it must be finite", .at[0], .at[1], .at[2])]
    NotFinite {
        /// Which function.
        what: &'static str,
        /// Where.
        at: [f64; 3],
        /// Its value.
        value: f64,
    },
    /// No displacement is free.
    #[error("all displacements are prescribed: nothing is left to solve for")]
    NothingFree,
    /// The supports let the body move without strain.
    #[error(
        "the body floats: nothing resists {modes}; the stiffness matrix is singular. Fix more of the boundary of the part that node {node} belongs to, or accept that contact alone holds it (`floating`)"
    )]
    Floating {
        /// The free rigid modes, in words.
        modes: String,
        /// The first node of the unsupported part.
        node: usize,
    },
    /// A contact node whose displacement is prescribed, as another value than 0, in the normal direction or in a tangential one.
    #[error(
        "contact node {node} at ({}, {}, {}): its {direction} displacement is prescribed as another value than 0, so that its contact force is not determined; leave the facets at this node out of the contact group, or the support there at rest",
        .at[0], .at[1], .at[2]
    )]
    ContactFixed {
        /// The node.
        node: usize,
        /// Its position.
        at: [f64; 3],
        /// "normal", "tangential", or either.
        direction: &'static str,
    },
    /// Two boundaries of which no part lies opposite the other.
    #[error(
        "no facet of \"{master}\" lies opposite a free node of \"{slave}\": their outward normals must point against each other, along the normals of \"{slave}\", within the reach if one is given"
    )]
    NoneOpposite {
        /// The group with the multipliers.
        slave: String,
        /// The other group.
        master: String,
    },
    /// A slave facet that faces two layers of the master.
    #[error(
        "the facet around ({}, {}, {}) faces several parts of the other boundary, one behind another; set a reach",
        .at[0], .at[1], .at[2]
    )]
    CoveredTwice {
        /// Its centre.
        at: [f64; 3],
    },
    /// An axis of a contact node that is oblique to a plane of symmetry.
    #[error(
        "contact node {node} at ({}, {}, {}): its {direction} axis is oblique to a component that is prescribed as 0; on a plane of symmetry the normal must lie in the plane, and each tangent in it or at right angles to it, because the mirror image has the same law of friction",
        .at[0], .at[1], .at[2]
    )]
    ObliqueAxis {
        /// The node.
        node: usize,
        /// Its position.
        at: [f64; 3],
        /// "normal" or "tangential".
        direction: &'static str,
    },
    /// A [`Partition`](super::Partition) that does not cover the boundary once, or has elements that are too large or of no use.
    #[error("the partition of \"{facets}\" into elements of multipliers: {what}")]
    Partition {
        /// The boundary.
        facets: String,
        /// What is wrong.
        what: String,
    },
    /// A normal or tangent that is zero, not finite, or a tangent that is not orthogonal to the normal.
    #[error("contact node {node}: {what}")]
    Frame {
        /// The node.
        node: usize,
        /// What is wrong.
        what: String,
    },
    /// A body that cannot be a [`PlasticBody`](super::PlasticBody).
    #[error("the body cannot be plastic: {what}")]
    PlasticBody {
        /// Why.
        what: &'static str,
    },
    /// A load case or a vector does not fit.
    #[error(transparent)]
    Map(PiecewiseError),
}

carries_maps!(FemError);
