//! `RigidBody`. Its dimension is that of the vectors it was built from.

use mpm::{RigidBody, Shape, Vector};
use numpy::{IntoPyArray, Ix2, PyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{array, slice_of, vector};
use crate::error::{NativeError, config_error};

#[derive(Clone)]
pub enum AnyRigidBody {
    Plane(RigidBody<2>),
    Space(RigidBody<3>),
}

/// A rigid body at the start.
#[pyclass(frozen, name = "RigidBody", module = "hybridmpm._native")]
pub struct PyRigidBody {
    pub inner: AnyRigidBody,
}

/// What bodies of all shapes have, as keyword arguments.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Common {
    rotation: Vec<f64>,
    density: f32,
    velocity: Vec<f64>,
    angular_velocity: Vec<f64>,
    friction: f32,
    restitution: f32,
}

impl Common {
    fn body<const D: usize>(&self, shape: Shape<D>) -> PyResult<RigidBody<D>> {
        Ok(RigidBody {
            shape,
            turn: about(D, "rotation", &self.rotation)?,
            density: self.density,
            velocity: vector("velocity", &self.velocity)?,
            spin: about(D, "angular_velocity", &self.angular_velocity)?,
            friction: self.friction,
            restitution: self.restitution,
        })
    }
}

fn common_of(given: Option<Bound<'_, PyDict>>) -> PyResult<Common> {
    let given = given.ok_or_else(|| config_error("a rigid body needs its density and motion"))?;
    given.extract()
}

/// A vector along an axis of rotation from its one number in 2D, or three.
fn about(dim: usize, name: &str, numbers: &[f64]) -> PyResult<[f32; 3]> {
    match (dim, numbers) {
        (2, [z]) => Ok([0.0, 0.0, *z as f32]),
        (3, [x, y, z]) => Ok([*x as f32, *y as f32, *z as f32]),
        _ => Err(config_error(format!(
            "{name} must have one number in 2D and three in 3D"
        ))),
    }
}

/// Corners [m] of a surface, and three of them for each triangle.
type Triangles = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// The body in the dimension of its first vector.
macro_rules! build {
    ($length:expr, $common:expr, $D:ident => $shape:expr) => {{
        let inner = match $length {
            2 => {
                const $D: usize = 2;
                AnyRigidBody::Plane($common.body($shape)?)
            }
            3 => {
                const $D: usize = 3;
                AnyRigidBody::Space($common.body($shape)?)
            }
            other => {
                return Err(config_error(format!(
                    "a rigid body has 2 or 3 coordinates, got {other}"
                )));
            }
        };
        Ok(Self { inner })
    }};
}

#[pymethods]
impl PyRigidBody {
    #[staticmethod]
    #[pyo3(signature = (center, radius, **common))]
    fn ball(center: Vec<f64>, radius: f32, common: Option<Bound<'_, PyDict>>) -> PyResult<Self> {
        let common = common_of(common)?;
        build!(center.len(), common, D => Shape::Ball {
            center: vector::<D>("center", &center)?,
            radius,
        })
    }

    #[staticmethod]
    #[pyo3(name = "box", signature = (lower, upper, **common))]
    fn box_(lower: Vec<f64>, upper: Vec<f64>, common: Option<Bound<'_, PyDict>>) -> PyResult<Self> {
        let common = common_of(common)?;
        build!(lower.len(), common, D => Shape::Box {
            lower: vector::<D>("lower", &lower)?,
            upper: vector::<D>("upper", &upper)?,
        })
    }

    #[staticmethod]
    #[pyo3(signature = (start, end, radius, **common))]
    fn cylinder(
        start: Vec<f64>,
        end: Vec<f64>,
        radius: f32,
        common: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let common = common_of(common)?;
        build!(start.len(), common, D => Shape::Cylinder {
            start: vector::<D>("start", &start)?,
            end: vector::<D>("end", &end)?,
            radius,
        })
    }

    #[staticmethod]
    #[pyo3(signature = (points, **common))]
    fn hull(points: Vec<Vec<f64>>, common: Option<Bound<'_, PyDict>>) -> PyResult<Self> {
        let common = common_of(common)?;
        build!(points.first().map_or(0, Vec::len), common, D => {
            let corners = points.iter().map(|point| vector::<D>("points", point));
            let corners: PyResult<Vec<_>> = corners.collect();
            mpm::hull(&corners?).map_err(NativeError)?
        })
    }

    #[getter]
    fn mass(&self) -> f64 {
        match &self.inner {
            AnyRigidBody::Plane(body) => body.mass(),
            AnyRigidBody::Space(body) => body.mass(),
        }
    }

    #[getter]
    fn center(&self) -> Vec<f32> {
        match &self.inner {
            AnyRigidBody::Plane(body) => body.center().as_slice().to_vec(),
            AnyRigidBody::Space(body) => body.center().as_slice().to_vec(),
        }
    }

    /// Corners and triangles of a hull in space; None of other bodies.
    fn surface(&self) -> Option<Triangles> {
        let AnyRigidBody::Space(body) = &self.inner else {
            return None;
        };
        let surface = body.surface()?;
        let corners = surface.vertices().iter().map(|v| [v.x, v.y, v.z]).collect();
        Some((corners, surface.facets().to_vec()))
    }

    /// Distances are exact, whatever `within`.
    #[pyo3(signature = (x, *, within=None))]
    #[expect(unused_variables, reason = "obstacles have it")]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        within: Option<f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let dim = match self.inner {
            AnyRigidBody::Plane(_) => 2,
            AnyRigidBody::Space(_) => 3,
        };
        let expected = format!("float32 of shape (N, {dim})");
        let x = array::<f32, Ix2>("x", &expected, x)?;
        if x.shape()[1] != dim {
            let got = x.shape();
            return Err(config_error(format!("x must be {expected}, got {got:?}")));
        }
        let points = slice_of(&x).chunks_exact(dim);
        let distances: Vec<f32> = match &self.inner {
            AnyRigidBody::Plane(body) => body.distances(points.map(Vector::from_column_slice)),
            AnyRigidBody::Space(body) => body.distances(points.map(Vector::from_column_slice)),
        };
        Ok(distances.into_pyarray(py))
    }
}
