//! The extension module of the Python package `semismooth`; its docstrings are the documentation.

mod arrays;
mod batch;
mod body;
mod complementarity;
mod contact;
mod continuation;
mod derivatives;
mod diagram;
mod errors;
mod events;
mod expressions;
mod fields;
mod foundation;
mod friction;
mod functions;
mod given;
mod laws;
mod lists;
mod map;
mod mesh;
mod names;
mod optimise;
mod report;
mod saving;
mod sensitivity;
mod solution;
mod stability;
mod structure;
mod text;
mod transition_set;
mod variational;

use pyo3::prelude::*;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add(
        "SemismoothError",
        module.py().get_type::<errors::SemismoothError>(),
    )?;
    expressions::register(module)?;
    map::register(module)?;
    complementarity::register(module)?;
    batch::register(module)?;
    lists::register(module)?;
    continuation::register(module)?;
    transition_set::register(module)?;
    diagram::register(module)?;
    stability::register(module)?;
    sensitivity::register(module)?;
    variational::register(module)?;
    friction::register(module)?;
    mesh::register(module)?;
    body::register(module)?;
    laws::register(module)?;
    foundation::register(module)?;
    given::register(module)?;
    contact::register(module)?;
    solution::register(module)?;
    derivatives::register(module)?;
    optimise::register(module)?;
    report::register(module)?;
    saving::register(module)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
