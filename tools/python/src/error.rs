//! Errors of the library as exceptions.

use photonmill::error::Error as Failure;
use photonmill::render::names::spelled;
use photonmill::text::echo;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};

create_exception!(photonmill, Error, PyException, "What went wrong, in one line: what, which value, what is allowed.");
create_exception!(photonmill, RunWarning, PyUserWarning, "What the user should know of a scene or a run, in one line.");

static ARGUMENT_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();

pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("Error", py.get_type::<Error>())?;
    module.add("RunWarning", py.get_type::<RunWarning>())?;
    module.add("ArgumentError", argument_error_type(py)?)
}

/// An [`Error`] that is a ValueError, too, which no macro makes.
fn argument_error_type(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
    let make = || -> PyResult<Py<PyType>> {
        let content = PyDict::new(py);
        content.set_item("__module__", "photonmill")?;
        content.set_item("__doc__", "An argument has a value that is not allowed.")?;
        let bases = (py.get_type::<Error>(), py.get_type::<PyValueError>());
        Ok(py.get_type::<PyType>().call1(("ArgumentError", bases, content))?.cast_into::<PyType>()?.unbind())
    };
    Ok(ARGUMENT_ERROR.get_or_try_init(py, make)?.bind(py))
}

/// The exception for an argument that is not allowed.
pub fn argument(py: Python<'_>, message: impl Into<String>) -> PyErr {
    match argument_error_type(py) {
        Ok(of) => PyErr::from_type(of.clone(), message.into()),
        Err(error) => error,
    }
}

/// The exception for what the library says.
pub fn of(py: Python<'_>, failure: &Failure) -> PyErr {
    let message = match failure {
        Failure::Setting { option, value, allowed } => format!("{}={}: {}", keyword(option), echo(value), in_python(allowed)),
        Failure::DeviceAbsent { wanted, present } => {
            format!("device={}: must match exactly one Vulkan device; available: {present}", echo(wanted))
        }
        other => in_python(&other.to_string()),
    };
    match failure {
        Failure::Setting { .. } | Failure::DeviceAbsent { .. } => argument(py, message),
        _ => Error::new_err(message),
    }
}

/// The keyword that stands for a field: Python has words and names of its own.
pub fn keyword(field: &str) -> &str {
    match field {
        "with" => "with_",
        "output" => "path",
        "SCENE" => "scene",
        other => other,
    }
}

/// A message in which fields are named as keyword arguments.
pub fn in_python(message: &str) -> String {
    spelled(message, |field| format!("{}=", keyword(field)))
}

/// Issues warnings, as Python's filters want them.
pub fn warn(py: Python<'_>, warnings: &[String]) -> PyResult<()> {
    let category = py.get_type::<RunWarning>();
    warnings.iter().try_for_each(|line| {
        let text = std::ffi::CString::new(in_python(line).replace('\0', " ")).expect("no zero byte is left");
        PyErr::warn(py, &category, &text, 1)
    })
}
