//! Finite elements: discrete contact problems from meshes.
//!
//! A [`Mesh`] of triangles, quadrilaterals, tetrahedra or hexahedra, of first or second order, comes from a generator ([`Mesh::rectangle`], [`Mesh::block`]), a file
//! ([`read_gmsh`]) or your own arrays; [`Elasticity`] holds materials and supports and assembles an [`ElasticSystem`]: the
//! stiffness matrix of the free displacements, loads, and [`ContactRows`], the normal and tangential traces of the nodes that may touch a
//! rigid foundation or [each other](ElasticSystem::contact_between). [`PlasticBody`] is a body of [`VonMises`] material under a history of
//! loads. Units are the caller's: metres and GPa give nodal forces in GN (per metre of depth in the plane, of whole rings in bodies
//! [of revolution](PlaneModel::Axisymmetric)).

mod assembly;
mod cell_points;
mod contact;
mod derivatives;
mod elasticity;
mod element;
mod element_matrix;
mod error;
mod facet;
#[cfg(feature = "serde")]
mod file;
mod folding;
mod functions;
mod generate;
mod gmsh;
mod material;
mod mesh;
mod mortar;
mod multipliers;
mod nodal;
mod node_groups;
mod notes;
mod order;
mod overlap;
mod partition;
mod place;
mod plastic;
mod refine;
mod rigid;
mod springs;
mod stiffness;
mod tokens;
mod trace;
mod vectors;
mod von_mises;

pub use assembly::ElasticSystem;
pub use contact::{ContactRows, Foundation};
pub use elasticity::{Dilatation, Elasticity};
pub use element::CellKind;
pub use error::FemError;
pub use gmsh::{parse_gmsh, read_gmsh};
pub use material::{Material, MaterialConstant, PlaneModel};
pub use mesh::{BoundaryFacet, Mesh};
pub use mortar::Mortar;
pub use multipliers::{Degree, MultiplierSpace};
pub use partition::Partition;
pub use plastic::{PlasticBody, PlasticEnergies};
pub use springs::Spring;
pub use trace::TraceSpace;
pub use von_mises::{PlasticResponse, PlasticState, VonMises, von_mises_stress};
