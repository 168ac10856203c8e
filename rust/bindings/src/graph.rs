//! `radius_graph` and its record.

use nalgebra::SVector;
use neighbors::{GraphError, RadiusGraph, radius_graph};
use numpy::{IntoPyArray, Ix2, PyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array, slice_of};
use crate::error::config_error;

/// Edges between points at most a radius apart.
#[pyclass(frozen, name = "RadiusGraph", module = "hybridmpm._native")]
pub struct PyRadiusGraph {
    senders: Py<PyArray1<u32>>,
    receivers: Py<PyArray1<u32>>,
    starts: Py<PyArray1<u32>>,
    #[pyo3(get)]
    radius: f32,
}

#[pymethods]
impl PyRadiusGraph {
    #[getter]
    fn senders(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.senders.clone_ref(py)
    }

    #[getter]
    fn receivers(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.receivers.clone_ref(py)
    }

    #[getter]
    fn starts(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.starts.clone_ref(py)
    }
}

fn build<const D: usize>(x: &[f32], radius: f32) -> Result<RadiusGraph, GraphError> {
    let points: Vec<_> = x
        .chunks_exact(D)
        .map(SVector::<f32, D>::from_column_slice)
        .collect();
    radius_graph(&points, radius)
}

#[pyfunction(name = "radius_graph")]
pub fn py_radius_graph(
    py: Python<'_>,
    x: &Bound<'_, PyAny>,
    radius: f32,
) -> PyResult<PyRadiusGraph> {
    let expected = "float32 of shape (N, 2) or (N, 3)";
    let x = array::<f32, Ix2>("x", expected, x)?;
    let (dim, data) = (x.shape()[1], slice_of("x", &x)?);
    if !(2..=3).contains(&dim) {
        return Err(config_error(format!(
            "x must be {expected}, got shape {:?}",
            x.shape()
        )));
    }
    let (graph, receivers) = py
        .detach(|| {
            let graph = if dim == 2 {
                build::<2>(data, radius)
            } else {
                build::<3>(data, radius)
            }?;
            let receivers = (graph.starts.windows(2).zip(0u32..))
                .flat_map(|(range, receiver)| (range[0]..range[1]).map(move |_| receiver))
                .collect::<Vec<_>>();
            Ok((graph, receivers))
        })
        .map_err(|error: GraphError| config_error(error.to_string()))?;
    Ok(PyRadiusGraph {
        senders: graph.senders.into_pyarray(py).unbind(),
        receivers: receivers.into_pyarray(py).unbind(),
        starts: graph.starts.into_pyarray(py).unbind(),
        radius,
    })
}
