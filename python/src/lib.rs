//! The Python package `semismooth`: what it holds is documented where Python sees it.

mod arrays;
mod complementarity;
mod continuation;
mod diagram;
mod errors;
mod expressions;
mod friction;
mod variational;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add(
        "SemismoothError",
        module.py().get_type::<errors::SemismoothError>(),
    )?;
    expressions::register(module)?;
    complementarity::register(module)?;
    continuation::register(module)?;
    diagram::register(module)?;
    variational::register(module)?;
    friction::register(module)
}
