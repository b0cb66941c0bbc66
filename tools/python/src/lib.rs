use pyo3::prelude::*;
#[pymodule]
mod photonmill_python {}
