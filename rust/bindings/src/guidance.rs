//! What guides particles to a goal: `FreeSpace`, `match_to_region`, `least_acceleration`, `Tracks`.

use ::guidance::{FreeSpace, GuidanceError, Law, Paths, Tracks};
use numpy::{
    IntoPyArray, Ix1, Ix2, IxDyn, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::convert::{array, slice_of};
use crate::error::config_error;

fn raised(error: GuidanceError) -> PyErr {
    config_error(error.to_string())
}

fn other_dimension(dim: usize) -> PyErr {
    config_error(format!("space must have the dimension of x, {dim}"))
}

/// Rows of D numbers.
fn rows<const D: usize, T: Copy>(numbers: &[T]) -> Vec<[T; D]> {
    numbers.as_chunks().0.to_vec()
}

fn fixed<const D: usize, T: Copy + std::fmt::Debug>(name: &str, numbers: &[T]) -> PyResult<[T; D]> {
    numbers
        .try_into()
        .map_err(|_| config_error(format!("{name} must have {D} numbers, got {numbers:?}")))
}

fn dim_of(name: &str, dim: usize) -> PyResult<usize> {
    if matches!(dim, 2 | 3) {
        return Ok(dim);
    }
    Err(config_error(format!(
        "{name} must be of shape (N, 2) or (N, 3), got {dim} numbers a row"
    )))
}

/// A float64 array (N, D) with the D of the others.
fn points<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    dim: usize,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let expected = format!("float64 of shape (N, {dim})");
    let points = array::<f64, Ix2>(name, &expected, value)?;
    if points.shape()[1] == dim {
        return Ok(points);
    }
    Err(config_error(format!(
        "{name} must be {expected}, got shape {:?}",
        points.shape()
    )))
}

enum AnySpace {
    Plane(FreeSpace<2>),
    Space(FreeSpace<3>),
}

/// The room between walls and obstacles.
#[pyclass(frozen, name = "FreeSpace", module = "hybridmpm._native")]
pub struct PyFreeSpace {
    inner: AnySpace,
}

#[pymethods]
impl PyFreeSpace {
    #[new]
    fn new(
        py: Python<'_>,
        lower: Vec<f64>,
        spacing: f64,
        distance: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let distance =
            array::<f64, IxDyn>("distance", "float64 with as many axes as lower", distance)?;
        let counts = distance.shape().to_vec();
        let numbers = slice_of("distance", &distance)?.to_vec();
        let inner = py.detach(|| match dim_of("lower", lower.len())? {
            2 => FreeSpace::new(
                fixed("lower", &lower)?,
                spacing,
                fixed("distance", &counts)?,
                numbers,
            )
            .map(AnySpace::Plane)
            .map_err(raised),
            _ => FreeSpace::new(
                fixed("lower", &lower)?,
                spacing,
                fixed("distance", &counts)?,
                numbers,
            )
            .map(AnySpace::Space)
            .map_err(raised),
        })?;
        Ok(Self { inner })
    }
}

/// What `match_to_region` found.
#[pyclass(frozen, get_all, name = "Matching", module = "hybridmpm._native")]
pub struct PyMatching {
    places: Py<PyArray2<f64>>,
    group: Py<PyArray1<u32>>,
    way_starts: Py<PyArray1<u32>>,
    ways: Py<PyArray2<f64>>,
    cut_off: Py<PyArray1<bool>>,
}

impl PyMatching {
    fn of<const D: usize>(py: Python<'_>, found: ::guidance::Matching<D>) -> PyResult<Self> {
        let mut starts = vec![0];
        starts.extend(found.ways.iter().scan(0, |end, way| {
            *end += way.len() as u32;
            Some(*end)
        }));
        let (places, ways) = (found.places.concat(), found.ways.concat().concat());
        let (place_count, corner_count) = (places.len() / D, ways.len() / D);
        Ok(Self {
            places: places.into_pyarray(py).reshape([place_count, D])?.unbind(),
            group: found.group.into_pyarray(py).unbind(),
            way_starts: starts.into_pyarray(py).unbind(),
            ways: ways.into_pyarray(py).reshape([corner_count, D])?.unbind(),
            cut_off: found.cut_off.into_pyarray(py).unbind(),
        })
    }
}

/// Gives each particle a place in a region.
#[pyfunction]
#[pyo3(signature = (x, cells, space=None))]
pub fn match_to_region(
    py: Python<'_>,
    x: &Bound<'_, PyAny>,
    cells: &Bound<'_, PyAny>,
    space: Option<PyRef<'_, PyFreeSpace>>,
) -> PyResult<PyMatching> {
    let x = array::<f64, Ix2>("x", "float64 of shape (N, D)", x)?;
    let dim = dim_of("x", x.shape()[1])?;
    let cells = points("cells", cells, dim)?;
    let (x, cells) = (slice_of("x", &x)?, slice_of("cells", &cells)?);
    let space = space.as_ref().map(|space| &space.inner);
    match (dim, space) {
        (2, None | Some(AnySpace::Plane(_))) => {
            let room = match space {
                Some(AnySpace::Plane(room)) => Some(room),
                _ => None,
            };
            let found =
                py.detach(|| ::guidance::match_to_region(&rows::<2, _>(x), &rows(cells), room));
            PyMatching::of(py, found.map_err(raised)?)
        }
        (3, None | Some(AnySpace::Space(_))) => {
            let room = match space {
                Some(AnySpace::Space(room)) => Some(room),
                _ => None,
            };
            let found =
                py.detach(|| ::guidance::match_to_region(&rows::<3, _>(x), &rows(cells), room));
            PyMatching::of(py, found.map_err(raised)?)
        }
        _ => Err(other_dimension(dim)),
    }
}

/// Times and velocities of the points of a way.
#[pyclass(frozen, get_all, name = "Timing", module = "hybridmpm._native")]
pub struct PyTiming {
    times: Py<PyArray1<f64>>,
    velocities: Py<PyArray2<f64>>,
}

/// Times a way through points.
#[pyfunction]
pub fn least_acceleration(
    py: Python<'_>,
    points: &Bound<'_, PyAny>,
    start_velocity: Vec<f64>,
    end_velocity: Vec<f64>,
    seconds: f64,
) -> PyResult<PyTiming> {
    fn timed<const D: usize>(
        numbers: &[f64],
        ends: [&[f64]; 2],
        seconds: f64,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let (start, end) = (
            fixed("start_velocity", ends[0])?,
            fixed("end_velocity", ends[1])?,
        );
        let timing = ::guidance::least_acceleration::<D>(&rows(numbers), start, end, seconds);
        let timing = timing.map_err(raised)?;
        Ok((timing.times, timing.velocities.concat()))
    }
    let points = array::<f64, Ix2>("points", "float64 of shape (K, D)", points)?;
    let shape = [points.shape()[0], dim_of("points", points.shape()[1])?];
    let numbers = slice_of("points", &points)?;
    let ends = [start_velocity.as_slice(), end_velocity.as_slice()];
    let (times, velocities) = py.detach(|| match shape[1] {
        2 => timed::<2>(numbers, ends, seconds),
        _ => timed::<3>(numbers, ends, seconds),
    })?;
    Ok(PyTiming {
        times: times.into_pyarray(py).unbind(),
        velocities: velocities.into_pyarray(py).reshape(shape)?.unbind(),
    })
}

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
        gravity: &[f32],
        settings: (f32, f32, u32, f32),
        space: Option<FreeSpace<D>>,
    ) -> PyResult<Tracks<D>> {
        let (shortest, ahead, cells, cap) = settings;
        let law = Law {
            gravity: fixed("gravity", gravity)?,
            shortest,
            ahead,
            cells,
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
    #[pyo3(signature = (*, starts, times, x, v, path, offset, gravity, shortest, ahead, cells, cap, space=None))]
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
            starts: slice_of("starts", &starts)?,
            times: slice_of("times", &times)?,
            x: slice_of("x", &x)?,
            v: slice_of("v", &v)?,
            path: slice_of("path", &path)?,
            offset: slice_of("offset", &offset)?,
        };
        let settings = (shortest, ahead, cells, cap);
        let space = space.as_ref().map(|space| &space.inner);
        let inner = match (dim, space) {
            (2, None) => AnyTracks::Plane(arrays.tracks(&gravity, settings, None)?),
            (2, Some(AnySpace::Plane(room))) => {
                AnyTracks::Plane(arrays.tracks(&gravity, settings, Some(room.clone()))?)
            }
            (3, None) => AnyTracks::Space(arrays.tracks(&gravity, settings, None)?),
            (3, Some(AnySpace::Space(room))) => {
                AnyTracks::Space(arrays.tracks(&gravity, settings, Some(room.clone()))?)
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
        let rows = rows
            .as_ref()
            .map(|rows| slice_of("rows", rows))
            .transpose()?;
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
        let (x, v, mass) = (
            slice_of("x", &x)?,
            slice_of("v", &v)?,
            slice_of("mass", &mass)?,
        );
        let force = py.detach(|| match &self.inner {
            AnyTracks::Plane(tracks) => tracks
                .force(x.as_chunks().0, v.as_chunks().0, mass, time, rows)
                .concat(),
            AnyTracks::Space(tracks) => tracks
                .force(x.as_chunks().0, v.as_chunks().0, mass, time, rows)
                .concat(),
        });
        force.into_pyarray(py).reshape([present, self.dim])
    }
}
