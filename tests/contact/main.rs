//! Contact with friction: bodies, laws, meshes, interfaces; all routes to a solution.

#[path = "../dense/mod.rs"]
mod dense;
#[path = "../maps/mod.rs"]
mod maps;
#[path = "../common/random.rs"]
mod random;
#[path = "../../examples/common/squares.rs"]
mod squares;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

mod bars;
mod coupled;
mod evolution;
mod exported;
mod fem_families;
mod floating;
mod folders;
mod forms;
mod friction_laws;
mod friction_properties;
mod hild_renard;
mod history;
mod interface;
mod interface_laws;
mod large_paths;
mod multiplier_spaces;
mod robustness;
mod routes;
mod scale_of_r;
mod scaling;
mod supports;
mod symmetry;
mod touching;
mod two_bodies;
mod unequal_nodes;
mod uniqueness_constants;
mod unloaded;
