//! `Obstacle`. Its dimension is that of the vectors it was built from.

use mpm::{Obstacle, Shape, Vector};
use numpy::{IntoPyArray, Ix2, PyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array, contact, slice_of, vector};
use crate::error::{NativeError, config_error};

#[derive(Clone, Copy)]
pub enum AnyObstacle {
    Plane(Obstacle<2>),
    Space(Obstacle<3>),
}

/// A fixed solid.
#[pyclass(frozen, name = "Obstacle", module = "hybridmpm._native")]
pub struct PyObstacle {
    pub inner: AnyObstacle,
}

/// The shape in the dimension of its first vector, named by `$length`.
macro_rules! build {
    ($length:expr, $contact:expr, $friction:expr, $D:ident => $shape:expr) => {{
        let surface = contact($contact, $friction)?;
        let inner = match $length {
            2 => {
                const $D: usize = 2;
                AnyObstacle::Plane(Obstacle::new($shape, surface).map_err(NativeError)?)
            }
            3 => {
                const $D: usize = 3;
                AnyObstacle::Space(Obstacle::new($shape, surface).map_err(NativeError)?)
            }
            other => {
                return Err(config_error(format!(
                    "an obstacle has 2 or 3 coordinates, got {other}"
                )));
            }
        };
        Ok(Self { inner })
    }};
}

#[pymethods]
impl PyObstacle {
    #[staticmethod]
    #[pyo3(signature = (center, radius, *, contact="separating", friction=None))]
    fn ball(center: Vec<f64>, radius: f32, contact: &str, friction: Option<f32>) -> PyResult<Self> {
        build!(center.len(), contact, friction, D => Shape::Ball {
            center: vector::<D>("center", &center)?,
            radius,
        })
    }

    #[staticmethod]
    #[pyo3(name = "box", signature = (lower, upper, *, contact="separating", friction=None))]
    fn box_(
        lower: Vec<f64>,
        upper: Vec<f64>,
        contact: &str,
        friction: Option<f32>,
    ) -> PyResult<Self> {
        build!(lower.len(), contact, friction, D => Shape::Box {
            lower: vector::<D>("lower", &lower)?,
            upper: vector::<D>("upper", &upper)?,
        })
    }

    #[staticmethod]
    #[pyo3(signature = (start, end, thickness, *, contact="separating", friction=None))]
    fn segment(
        start: Vec<f64>,
        end: Vec<f64>,
        thickness: f32,
        contact: &str,
        friction: Option<f32>,
    ) -> PyResult<Self> {
        build!(start.len(), contact, friction, D => Shape::Segment {
            start: vector::<D>("start", &start)?,
            end: vector::<D>("end", &end)?,
            thickness,
        })
    }

    #[staticmethod]
    #[pyo3(signature = (point, normal, *, contact="separating", friction=None))]
    fn half_space(
        point: Vec<f64>,
        normal: Vec<f64>,
        contact: &str,
        friction: Option<f32>,
    ) -> PyResult<Self> {
        build!(point.len(), contact, friction, D => Shape::HalfSpace {
            point: vector::<D>("point", &point)?,
            normal: {
                let normal = vector::<D>("normal", &normal)?;
                // A zero or non-finite normal stays as it is and is refused with the others.
                normal.try_normalize(1.0e-12).unwrap_or(normal)
            },
        })
    }

    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let dim = match self.inner {
            AnyObstacle::Plane(_) => 2,
            AnyObstacle::Space(_) => 3,
        };
        let x = array::<f32, Ix2>("x", &format!("float32 of shape (N, {dim})"), x)?;
        if x.shape()[1] != dim {
            return Err(config_error(format!(
                "x must be of shape (N, {dim}), got {:?}",
                x.shape()
            )));
        }
        let points = slice_of("x", &x)?.chunks_exact(dim);
        let distances: Vec<f32> = match &self.inner {
            AnyObstacle::Plane(o) => points
                .map(|x| o.shape.distance(&Vector::from_column_slice(x)).0)
                .collect(),
            AnyObstacle::Space(o) => points
                .map(|x| o.shape.distance(&Vector::from_column_slice(x)).0)
                .collect(),
        };
        Ok(distances.into_pyarray(py))
    }
}
