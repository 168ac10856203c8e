//! `Tracks`: the force that keeps particles on their ways.

use ::guidance::{FreeSpace, Law, Paths, Tracks};
use numpy::{IntoPyArray, Ix1, Ix2, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{dim_of, fixed, other_dimension, raised, rows};
use super::free_space::{AnySpace, PyFreeSpace};
use crate::convert::{array, slice_of};
use crate::error::config_error;

enum AnyTracks {
    Plane(Tracks<2>),
    Space(Tracks<3>),
}

/// Particles on their ways.
#[pyclass(frozen, name = "Tracks", module = "hybridmpm._native")]
pub struct PyTracks {
    inner: AnyTracks,
    dim: usize,
}

/// The arrays of a constructor, as slices.
struct Arrays<'a> {
    starts: &'a [u32],
    times: &'a [f32],
    x: &'a [f32],
    v: &'a [f32],
    path: &'a [u32],
    offset: &'a [f32],
}

impl Arrays<'_> {
    fn tracks<const D: usize>(
        &self,
        [gravity, size]: [&[f32]; 2],
        settings: (f32, f32, u32, f32),
        space: Option<&FreeSpace<D>>,
    ) -> PyResult<Tracks<D>> {
        let (shortest, ahead, cells, cap) = settings;
        let law = Law {
            gravity: fixed("gravity", gravity)?,
            shortest,
            ahead,
            cells,
            size: fixed("size", size)?,
            cap,
        };
        let paths = Paths {
            starts: self.starts.to_vec(),
            times: self.times.to_vec(),
            x: rows(self.x),
            v: rows(self.v),
        };
        Tracks::new(paths, self.path.to_vec(), rows(self.offset), law, space).map_err(raised)
    }
}

#[pymethods]
impl PyTracks {
    #[new]
    #[pyo3(signature = (*, starts, times, x, v, path, offset, gravity, shortest, ahead, cells, cap, size=None, space=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python constructor"
    )]
    fn new(
        starts: &Bound<'_, PyAny>,
        times: &Bound<'_, PyAny>,
        x: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        path: &Bound<'_, PyAny>,
        offset: &Bound<'_, PyAny>,
        gravity: Vec<f32>,
        shortest: f32,
        ahead: f32,
        cells: u32,
        cap: f32,
        size: Option<Vec<f32>>,
        space: Option<PyRef<'_, PyFreeSpace>>,
    ) -> PyResult<Self> {
        let starts = array::<u32, Ix1>("starts", "uint32 of shape (P + 1,)", starts)?;
        let times = array::<f32, Ix1>("times", "float32 of shape (K,)", times)?;
        let x = array::<f32, Ix2>("x", "float32 of shape (K, D)", x)?;
        let v = array::<f32, Ix2>("v", "float32 of shape (K, D)", v)?;
        let path = array::<u32, Ix1>("path", "uint32 of shape (N,)", path)?;
        let offset = array::<f32, Ix2>("offset", "float32 of shape (N, D)", offset)?;
        let dim = dim_of("x", x.shape()[1])?;
        for (name, shape) in [("v", v.shape()), ("offset", offset.shape())] {
            if shape[1] != dim {
                return Err(config_error(format!(
                    "{name} must have {dim} columns as x has, got {shape:?}"
                )));
            }
        }
        let arrays = Arrays {
            starts: slice_of(&starts),
            times: slice_of(&times),
            x: slice_of(&x),
            v: slice_of(&v),
            path: slice_of(&path),
            offset: slice_of(&offset),
        };
        let settings = (shortest, ahead, cells, cap);
        let size = size.unwrap_or_else(|| vec![1.0; dim]);
        let vectors = [&gravity[..], &size[..]];
        let space = space.as_ref().map(|space| &space.inner);
        let inner = match (dim, space) {
            (2, None) => AnyTracks::Plane(arrays.tracks(vectors, settings, None)?),
            (2, Some(AnySpace::Plane(room))) => {
                AnyTracks::Plane(arrays.tracks(vectors, settings, Some(room))?)
            }
            (3, None) => AnyTracks::Space(arrays.tracks(vectors, settings, None)?),
            (3, Some(AnySpace::Space(room))) => {
                AnyTracks::Space(arrays.tracks(vectors, settings, Some(room))?)
            }
            _ => return Err(other_dimension(dim)),
        };
        Ok(Self { inner, dim })
    }

    #[pyo3(signature = (x, v, mass, time, rows=None))]
    fn force<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        mass: &Bound<'py, PyAny>,
        time: f32,
        rows: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let expected = format!("float32 of shape (N, {})", self.dim);
        let x = array::<f32, Ix2>("x", &expected, x)?;
        let v = array::<f32, Ix2>("v", &expected, v)?;
        let mass = array::<f32, Ix1>("mass", "float32 of shape (N,)", mass)?;
        let rows = rows
            .map(|rows| array::<u32, Ix1>("rows", "uint32 of shape (N,)", rows))
            .transpose()?;
        let count = match &self.inner {
            AnyTracks::Plane(tracks) => tracks.count(),
            AnyTracks::Space(tracks) => tracks.count(),
        };
        let rows = rows.as_ref().map(slice_of);
        let present = rows.map_or(count, <[u32]>::len);
        for (name, shape) in [("x", x.shape()), ("v", v.shape())] {
            if shape != [present, self.dim] {
                return Err(config_error(format!(
                    "{name} must be float32 of shape ({present}, {}), got {shape:?}",
                    self.dim
                )));
            }
        }
        if mass.len() != present {
            return Err(config_error(format!(
                "mass must be float32 of shape ({present},), got {:?}",
                mass.shape()
            )));
        }
        if let Some(row) = rows.and_then(|rows| rows.iter().find(|&&row| row as usize >= count)) {
            return Err(config_error(format!(
                "rows must be below {count}, got {row}"
            )));
        }
        let (x, v, mass) = (slice_of(&x), slice_of(&v), slice_of(&mass));
        let force = py.detach(|| match &self.inner {
            AnyTracks::Plane(tracks) => tracks
                .force(x.as_chunks().0, v.as_chunks().0, mass, time, rows)
                .into_flattened(),
            AnyTracks::Space(tracks) => tracks
                .force(x.as_chunks().0, v.as_chunks().0, mass, time, rows)
                .into_flattened(),
        });
        force.into_pyarray(py).reshape([present, self.dim])
    }
}
