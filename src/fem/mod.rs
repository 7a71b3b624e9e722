//! Finite elements: where discrete contact problems come from.
//!
//! A [`Mesh`] of triangles, quadrilaterals, tetrahedra or hexahedra comes from a generator ([`Mesh::rectangle`], [`Mesh::block`]), a
//! file ([`read_gmsh`], [`read_getfem`]) or your own arrays; [`Elasticity`] holds materials and supports and assembles an [`ElasticSystem`]: the
//! stiffness matrix of the free displacements, loads, and [`ContactRows`], the normal and tangential traces of the nodes which may
//! touch a rigid foundation. Units are the caller's: metres and GPa give nodal forces in GN (per metre of depth in the plane).

mod assembly;
mod contact;
mod elasticity;
mod element;
mod error;
mod facet;
mod generate;
mod getfem;
mod gmsh;
mod material;
mod mesh;
mod multipliers;
mod nodal;
mod refine;
mod rigid;
mod stiffness;
mod tokens;
mod trace;

pub use assembly::ElasticSystem;
pub use contact::{ContactRows, Foundation};
pub use elasticity::Elasticity;
pub use element::CellKind;
pub use error::FemError;
pub use getfem::{parse_getfem, read_getfem};
pub use gmsh::{parse_gmsh, read_gmsh};
pub use material::{Material, PlaneModel};
pub use mesh::{BoundaryFacet, Mesh};
pub use multipliers::Multipliers;
pub use trace::TraceSpace;
