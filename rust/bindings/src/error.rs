//! One Python exception for each kind of failure.

use mpm::MpmError;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

create_exception!(
    hybridmpm._native,
    SimulationError,
    PyException,
    "Parent of every error of hybridmpm."
);
create_exception!(
    hybridmpm._native,
    DomainError,
    SimulationError,
    "A particle left the domain."
);
create_exception!(
    hybridmpm._native,
    NonFiniteError,
    SimulationError,
    "A particle became NaN or infinite."
);
create_exception!(
    hybridmpm._native,
    InvertedError,
    SimulationError,
    "A particle reached J <= 0."
);
create_exception!(
    hybridmpm._native,
    StepSizeError,
    SimulationError,
    "A substep above the stability limit."
);

create_exception!(
    hybridmpm._native,
    FrameCancelledError,
    SimulationError,
    "A frame was cancelled."
);

create_exception!(
    hybridmpm._native,
    GraphSizeError,
    SimulationError,
    "A neighbour graph would be larger than allowed."
);

create_exception!(
    hybridmpm._native,
    BatchError,
    SimulationError,
    "Scenes of a batch failed."
);

/// Parents (SimulationError, ValueError): `create_exception!` takes one only.
fn value_error(py: Python<'_>, name: &str, doc: &str) -> PyResult<Py<PyAny>> {
    let bases = PyTuple::new(
        py,
        [
            py.get_type::<SimulationError>(),
            py.get_type::<PyValueError>(),
        ],
    )?;
    let namespace = PyDict::new(py);
    namespace.set_item("__module__", "hybridmpm._native")?;
    namespace.set_item("__doc__", doc)?;
    let metaclass = py.get_type::<pyo3::types::PyType>();
    Ok(metaclass.call1((name, bases, namespace))?.unbind())
}

static CONFIG_ERROR: std::sync::OnceLock<Py<PyAny>> = std::sync::OnceLock::new();
static SNAPSHOT_ERROR: std::sync::OnceLock<Py<PyAny>> = std::sync::OnceLock::new();

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let config = value_error(py, "ConfigError", "A parameter is outside its range.")?;
    config.setattr(py, "fault", py.None())?;
    let snapshot = value_error(
        py,
        "SnapshotError",
        "Bytes that are no snapshot of this scene.",
    )?;
    module.add("ConfigError", CONFIG_ERROR.get_or_init(|| config))?;
    module.add("SnapshotError", SNAPSHOT_ERROR.get_or_init(|| snapshot))?;
    module.add("SimulationError", py.get_type::<SimulationError>())?;
    module.add("DomainError", py.get_type::<DomainError>())?;
    module.add("NonFiniteError", py.get_type::<NonFiniteError>())?;
    module.add("FrameCancelledError", py.get_type::<FrameCancelledError>())?;
    module.add("GraphSizeError", py.get_type::<GraphSizeError>())?;
    module.add("InvertedError", py.get_type::<InvertedError>())?;
    module.add("BatchError", py.get_type::<BatchError>())?;
    module.add("StepSizeError", py.get_type::<StepSizeError>())
}

fn raise(class: &std::sync::OnceLock<Py<PyAny>>, message: String) -> PyErr {
    Python::attach(|py| {
        let class = class
            .get()
            .expect("classes exist once the module is loaded");
        match class.call1(py, (message,)) {
            Ok(error) => PyErr::from_value(error.into_bound(py)),
            Err(error) => error,
        }
    })
}

/// A `ConfigError` that the bindings themselves raise.
pub fn config_error(message: impl Into<String>) -> PyErr {
    raise(&CONFIG_ERROR, message.into())
}

/// A `ConfigError` with the part of the scene that is at fault, and what is wrong with it.
fn scene_fault(message: String, part: String, problem: String) -> PyErr {
    let error = config_error(message);
    Python::attach(
        |py| match error.value(py).setattr("fault", (part, problem)) {
            Ok(()) => error,
            Err(failed) => failed,
        },
    )
}

/// A `SnapshotError` of bytes that fit nothing here.
pub fn snapshot_error(message: impl Into<String>) -> PyErr {
    raise(&SNAPSHOT_ERROR, message.into())
}

/// Local wrapper, because neither `MpmError` nor `PyErr` belongs to this crate.
pub struct NativeError(pub MpmError);

impl From<NativeError> for PyErr {
    fn from(NativeError(error): NativeError) -> PyErr {
        let message = error.to_string();
        // No `_` arm: a new variant must choose its exception to compile.
        match error {
            MpmError::Parameter { .. } | MpmError::Length { .. } => config_error(message),
            MpmError::Overlap { part, problem } => scene_fault(message, part, problem),
            MpmError::NonFinite { .. } => NonFiniteError::new_err(message),
            MpmError::LeftDomain { .. } => DomainError::new_err(message),
            MpmError::Inverted { .. } => InvertedError::new_err(message),
            MpmError::UnstableStep { .. } | MpmError::TooFast { .. } => {
                StepSizeError::new_err(message)
            }
            MpmError::Cancelled { .. } | MpmError::BuildCancelled => {
                FrameCancelledError::new_err(message)
            }
            MpmError::Snapshot { .. } | MpmError::Start { .. } => snapshot_error(message),
        }
    }
}

/// A `BatchError` with each failure by the index of its scene.
pub fn batch_error(py: Python<'_>, failures: Vec<(usize, MpmError)>) -> PyErr {
    let messages: Vec<String> = failures
        .iter()
        .map(|(index, error)| format!("scene {index}: {error}"))
        .collect();
    let error = BatchError::new_err(messages.join("; "));
    let by_index = PyDict::new(py);
    let filled: PyResult<()> = failures.into_iter().try_for_each(|(index, failure)| {
        by_index.set_item(index, PyErr::from(NativeError(failure)).into_value(py))
    });
    match filled.and_then(|()| error.value(py).setattr("failures", by_index)) {
        Ok(()) => error,
        Err(problem) => problem,
    }
}
