//! `Ways`: the force that keeps particles on their ways.

use std::sync::{Mutex, PoisonError};

use ::guidance::{Forces, GuidanceError, Plan, Present, Room, Settings, Settling, Ways};
use numpy::{
    IntoPyArray, Ix1, Ix2, IxDyn, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::arrays::{dim_of, fixed, points, raised, rows};
use crate::convert::{array, slice_of};
use crate::error::config_error;
use crate::signals::interruptible;

enum AnyWays {
    Plane(Mutex<Ways<2>>),
    Space(Mutex<Ways<3>>),
}

/// Particles on their ways. Places that are found anew are kept, behind a lock.
#[pyclass(frozen, name = "Ways", module = "hybridmpm._native")]
pub struct PyWays {
    inner: AnyWays,
    dim: usize,
}

/// First node, distance of the nodes, their numbers, and signed distances of the nearest obstacle.
type Grid<'a> = (&'a [f64], f64, &'a [usize], &'a [f64]);

/// What the constructor takes, as slices.
struct Given<'a> {
    ids: &'a [u64],
    weight: &'a [f64],
    starts: &'a [u32],
    times: &'a [f64],
    corners: &'a [f64],
    v: &'a [f64],
    group: &'a [u32],
    places: &'a [f64],
    end: Option<&'a [f64]>,
    gravity: &'a [f64],
    room: Option<Grid<'a>>,
    cells: &'a [f64],
}

/// Numbers of the constructor.
struct Numbers {
    frame_dt: f64,
    smoothing: u32,
    cap: f64,
    ahead: u32,
    unit: f64,
    settling: Option<(f64, [u64; 2])>,
}

impl Given<'_> {
    fn ways<const D: usize>(&self, numbers: &Numbers) -> PyResult<Mutex<Ways<D>>> {
        let end = self.end.map(|end| fixed("end", end)).transpose()?;
        let plan = Plan {
            starts: self.starts.to_vec(),
            times: self.times.to_vec(),
            corners: rows(self.corners),
            v: rows(self.v),
            group: self.group.to_vec(),
            places: rows(self.places),
            end,
        };
        let gravity: [f64; D] = fixed("gravity", self.gravity)?;
        let room = self.room.map(|(lower, spacing, counts, distance)| {
            Ok::<_, PyErr>(Room {
                lower: fixed("lower", lower)?,
                spacing,
                counts: fixed("distance", counts)?,
                distance: distance.to_vec(),
            })
        });
        let settings = Settings {
            gravity: gravity.map(|along| along as f32),
            frame_dt: numbers.frame_dt,
            cells: numbers.smoothing,
            cap: numbers.cap,
            ahead: numbers.ahead,
            unit: numbers.unit,
            room: room.transpose()?,
        };
        let settling = numbers
            .settling
            .map(|(side, times)| Settling::new(rows(self.cells), side, times, end).map_err(raised));
        let weight = self.weight.iter().map(|&one| one as f32).collect();
        let settling = settling.transpose()?;
        Ways::new(self.ids.to_vec(), weight, plan, settings, settling)
            .map(Mutex::new)
            .map_err(raised)
    }
}

/// Calls a function on the ways of either dimension, behind their lock.
macro_rules! with {
    ($any:expr, $ways:ident => $done:expr) => {
        match $any {
            AnyWays::Plane(inner) => {
                #[allow(unused_mut)]
                let mut $ways = inner.lock().unwrap_or_else(PoisonError::into_inner);
                $done
            }
            AnyWays::Space(inner) => {
                #[allow(unused_mut)]
                let mut $ways = inner.lock().unwrap_or_else(PoisonError::into_inner);
                $done
            }
        }
    };
}

/// Rows and accelerations of one frame, as Python gets them.
type Led<'py> = (
    Option<Bound<'py, PyArray1<usize>>>,
    Bound<'py, PyArray2<f32>>,
);

/// A function and its arguments, which make the law anew.
type Made<'py> = (Bound<'py, PyAny>, (Bound<'py, PyBytes>, usize));

#[pymethods]
impl PyWays {
    #[new]
    #[pyo3(signature = (*, ids, weight, starts, times, corners, v, group, places, end, gravity, frame_dt, smoothing, cap, ahead, unit, lower=None, spacing=0.0, distance=None, cells=None, side=0.0, settling=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python constructor"
    )]
    fn new(
        py: Python<'_>,
        ids: &Bound<'_, PyAny>,
        weight: &Bound<'_, PyAny>,
        starts: &Bound<'_, PyAny>,
        times: &Bound<'_, PyAny>,
        corners: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        group: &Bound<'_, PyAny>,
        places: &Bound<'_, PyAny>,
        end: Option<Vec<f64>>,
        gravity: Vec<f64>,
        frame_dt: f64,
        smoothing: u32,
        cap: f64,
        ahead: u32,
        unit: f64,
        lower: Option<Vec<f64>>,
        spacing: f64,
        distance: Option<&Bound<'_, PyAny>>,
        cells: Option<&Bound<'_, PyAny>>,
        side: f64,
        settling: Option<[u64; 2]>,
    ) -> PyResult<Self> {
        let ids = array::<u64, Ix1>("ids", "uint64 of shape (N,)", ids)?;
        let weight = array::<f64, Ix1>("weight", "float64 of shape (N,)", weight)?;
        let starts = array::<u32, Ix1>("starts", "uint32 of shape (P + 1,)", starts)?;
        let times = array::<f64, Ix1>("times", "float64 of shape (K,)", times)?;
        let corners = array::<f64, Ix2>("corners", "float64 of shape (K, D)", corners)?;
        let dim = dim_of("corners", corners.shape()[1])?;
        let v = points("v", v, dim)?;
        let group = array::<u32, Ix1>("group", "uint32 of shape (N,)", group)?;
        let places = points("places", places, dim)?;
        let distance = distance
            .map(|distance| array::<f64, IxDyn>("distance", "float64", distance))
            .transpose()?;
        let cells = cells.map(|cells| points("cells", cells, dim)).transpose()?;
        let given = Given {
            ids: slice_of(&ids),
            weight: slice_of(&weight),
            starts: slice_of(&starts),
            times: slice_of(&times),
            corners: slice_of(&corners),
            v: slice_of(&v),
            group: slice_of(&group),
            places: slice_of(&places),
            end: end.as_deref(),
            gravity: &gravity,
            room: lower
                .as_ref()
                .zip(distance.as_ref())
                .map(|(lower, distance)| {
                    (&lower[..], spacing, distance.shape(), slice_of(distance))
                }),
            cells: cells.as_ref().map_or(&[], |cells| slice_of(cells)),
        };
        let numbers = Numbers {
            frame_dt,
            smoothing,
            cap,
            ahead,
            unit,
            settling: settling.map(|times| (side, times)),
        };
        let inner = py.detach(|| match dim {
            2 => given.ways(&numbers).map(AnyWays::Plane),
            _ => given.ways(&numbers).map(AnyWays::Space),
        })?;
        Ok(Self { inner, dim })
    }

    #[staticmethod]
    fn from_bytes(data: &[u8], dim: usize) -> PyResult<Self> {
        let inner = match dim_of("dim", dim)? {
            2 => AnyWays::Plane(Mutex::new(Ways::from_bytes(data).map_err(raised)?)),
            _ => AnyWays::Space(Mutex::new(Ways::from_bytes(data).map_err(raised)?)),
        };
        Ok(Self { inner, dim })
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        with!(&self.inner, ways => PyBytes::new(py, &ways.to_bytes()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Made<'py>> {
        let made = py.get_type::<Self>().getattr("from_bytes")?;
        Ok((made, (self.to_bytes(py), self.dim)))
    }

    #[getter]
    fn dim(&self) -> usize {
        self.dim
    }

    #[getter]
    fn count(&self) -> usize {
        with!(&self.inner, ways => ways.ids().len())
    }

    #[getter]
    fn settles(&self) -> bool {
        with!(&self.inner, ways => ways.settles())
    }

    #[getter]
    fn places<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let places = with!(&self.inner, ways => ways.places().into_flattened());
        let count = places.len() / self.dim;
        places.into_pyarray(py).reshape([count, self.dim])
    }

    fn force<'py>(
        &self,
        py: Python<'py>,
        index: u64,
        ids: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> PyResult<Led<'py>> {
        fn flat<const D: usize>(
            found: Result<Forces<D>, GuidanceError>,
        ) -> PyResult<(Option<Vec<usize>>, Vec<f32>)> {
            let (rows, force) = found.map_err(raised)?;
            Ok((rows, force.into_flattened()))
        }
        let ids = array::<u64, Ix1>("ids", "uint64 of shape (N,)", ids)?;
        let expected = format!("float32 of shape ({}, {})", ids.len(), self.dim);
        let x = array::<f32, Ix2>("x", &expected, x)?;
        let v = array::<f32, Ix2>("v", &expected, v)?;
        for (name, shape) in [("x", x.shape()), ("v", v.shape())] {
            if shape != [ids.len(), self.dim] {
                return Err(config_error(format!(
                    "{name} must be {expected}, got {shape:?}"
                )));
            }
        }
        let (ids, x, v) = (slice_of(&ids), slice_of(&x), slice_of(&v));
        let (rows, force) = interruptible(py, || {
            with!(&self.inner, ways => {
                let (x, v) = (x.as_chunks().0, v.as_chunks().0);
                flat(ways.force(index, Present { ids, x, v }))
            })
        })?;
        let count = force.len() / self.dim;
        let force = force.into_pyarray(py).reshape([count, self.dim])?;
        Ok((rows.map(|rows| rows.into_pyarray(py)), force))
    }
}
