//! `Obstacle`. Its dimension is that of the vectors it was built from.

use mpm::{Motion, Obstacle, Shape, Surface, Swing, Vector};
use numpy::{
    IntoPyArray, Ix2, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};

use crate::convert::{array, contact, slice_of, vector};
use crate::error::{NativeError, config_error};

#[derive(Clone)]
pub enum AnyObstacle {
    Plane(Obstacle<2>),
    Space(Obstacle<3>),
}

/// A solid.
#[pyclass(frozen, name = "Obstacle", module = "hybridmpm._native")]
pub struct PyObstacle {
    pub inner: AnyObstacle,
    /// The same, prepared for distances up to a reach [m].
    near: Mutex<Option<(f32, AnyObstacle)>>,
}

impl From<AnyObstacle> for PyObstacle {
    fn from(inner: AnyObstacle) -> Self {
        Self {
            inner,
            near: Mutex::new(None),
        }
    }
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
        Ok(inner.into())
    }};
}

/// Runs one expression on the obstacle of whichever dimension, as it is at a time.
macro_rules! with_placed {
    ($obstacle:expr, $time:expr, $placed:ident => $body:expr) => {
        match $obstacle {
            AnyObstacle::Plane(o) => {
                let $placed = o.at($time);
                $body
            }
            AnyObstacle::Space(o) => {
                let $placed = o.at($time);
                $body
            }
        }
    };
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
    #[pyo3(signature = (start, end, radius, *, contact="separating", friction=None))]
    fn cylinder(
        start: Vec<f64>,
        end: Vec<f64>,
        radius: f32,
        contact: &str,
        friction: Option<f32>,
    ) -> PyResult<Self> {
        build!(start.len(), contact, friction, D => Shape::Cylinder {
            start: vector::<D>("start", &start)?,
            end: vector::<D>("end", &end)?,
            radius,
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

    #[staticmethod]
    #[pyo3(signature = (vertices, *, contact="separating", friction=None))]
    fn polygon(
        vertices: &Bound<'_, PyAny>,
        contact: &str,
        friction: Option<f32>,
    ) -> PyResult<Self> {
        let corners = points::<2>("vertices", vertices)?;
        let outline = Surface::outline(&corners).map_err(NativeError)?;
        let surface = self::contact(contact, friction)?;
        let solid = Obstacle::new(Shape::Surface(outline), surface).map_err(NativeError)?;
        let inner = AnyObstacle::Plane(solid);
        Ok(inner.into())
    }

    #[staticmethod]
    #[pyo3(signature = (vertices, triangles, *, contact="separating", friction=None))]
    fn mesh(
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        contact: &str,
        friction: Option<f32>,
    ) -> PyResult<Self> {
        let vertices = points::<3>("vertices", vertices)?;
        let triangles = array::<u32, Ix2>("triangles", "uint32 of shape (T, 3)", triangles)?;
        if triangles.shape()[1] != 3 {
            return Err(config_error("triangles must be of shape (T, 3)"));
        }
        let corners = slice_of(&triangles).chunks_exact(3);
        let triangles = corners.map(|corner| [corner[0], corner[1], corner[2]]);
        let mesh = Surface::mesh(vertices, triangles.collect()).map_err(NativeError)?;
        let surface = self::contact(contact, friction)?;
        let solid = Obstacle::new(Shape::Surface(mesh), surface).map_err(NativeError)?;
        let inner = AnyObstacle::Space(solid);
        Ok(inner.into())
    }

    fn crossing(&self) -> Option<Vec<f32>> {
        let AnyObstacle::Space(solid) = &self.inner else {
            return None;
        };
        let Shape::Surface(surface) = &solid.shape else {
            return None;
        };
        let place = surface.crossing()?;
        Some(place.as_slice().to_vec())
    }

    #[pyo3(signature = (*, velocity=None, angular_velocity=None, center=None, period=None, phase=0.0))]
    fn moving(
        &self,
        velocity: Option<Vec<f64>>,
        angular_velocity: Option<Vec<f32>>,
        center: Option<Vec<f64>>,
        period: Option<f32>,
        phase: f32,
    ) -> PyResult<Self> {
        if angular_velocity.is_some() && center.is_none() {
            return Err(config_error(
                "angular_velocity needs a center to turn about",
            ));
        }
        let still = || vec![0.0; self.dim()];
        let velocity = velocity.unwrap_or_else(still);
        let center = center.unwrap_or_else(still);
        let turning = angular_velocity.unwrap_or_default();
        let swing = period.map(|period| Swing { period, phase });
        let inner = match self.inner.clone() {
            AnyObstacle::Plane(o) => {
                AnyObstacle::Plane(o.moving(motion(&velocity, &turning, &center, swing)?))
            }
            AnyObstacle::Space(o) => {
                AnyObstacle::Space(o.moving(motion(&velocity, &turning, &center, swing)?))
            }
        };
        Ok(inner.into())
    }

    #[pyo3(signature = (x, time=0.0, within=None))]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        time: f64,
        within: Option<f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let x = self.points(x)?;
        let points = slice_of(&x).chunks_exact(self.dim());
        let prepared = within.map(|reach| self.prepared(reach));
        let solid = prepared.as_ref().unwrap_or(&self.inner);
        let distances: Vec<f32> = with_placed!(solid, time, placed => {
            placed.distances(points.map(Vector::from_column_slice))
        });
        Ok(distances.into_pyarray(py))
    }

    fn moved<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        time: f64,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let x = self.points(x)?;
        let points = slice_of(&x).chunks_exact(self.dim());
        let moved: Vec<f32> = with_placed!(&self.inner, time, placed => {
            points.map(|x| placed.moved(&Vector::from_column_slice(x))).flat_map(|x| x.data.0[0]).collect()
        });
        moved.into_pyarray(py).reshape([x.shape()[0], self.dim()])
    }
}

impl PyObstacle {
    fn dim(&self) -> usize {
        match self.inner {
            AnyObstacle::Plane(_) => 2,
            AnyObstacle::Space(_) => 3,
        }
    }

    fn prepared(&self, reach: f32) -> AnyObstacle {
        let mut near = self.near.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, solid)) = &*near
            && *known == reach
        {
            return solid.clone();
        }
        let solid = match &self.inner {
            AnyObstacle::Plane(solid) => AnyObstacle::Plane(solid.within(reach)),
            AnyObstacle::Space(solid) => AnyObstacle::Space(solid.within(reach)),
        };
        *near = Some((reach, solid.clone()));
        solid
    }

    fn points<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray2<'py, f32>> {
        let dim = self.dim();
        let x = array::<f32, Ix2>("x", &format!("float32 of shape (N, {dim})"), x)?;
        if x.shape()[1] != dim {
            return Err(config_error(format!(
                "x must be of shape (N, {dim}), got {:?}",
                x.shape()
            )));
        }
        Ok(x)
    }
}

fn points<const D: usize>(name: &str, x: &Bound<'_, PyAny>) -> PyResult<Vec<Vector<D>>> {
    let expected = format!("float32 of shape (N, {D})");
    let x = array::<f32, Ix2>(name, &expected, x)?;
    if x.shape()[1] != D {
        let got = x.shape();
        return Err(config_error(format!(
            "{name} must be {expected}, got {got:?}"
        )));
    }
    let points = slice_of(&x).chunks_exact(D);
    Ok(points.map(Vector::from_column_slice).collect())
}

fn motion<const D: usize>(
    velocity: &[f64],
    angular_velocity: &[f32],
    center: &[f64],
    swing: Option<Swing>,
) -> PyResult<Motion<D>> {
    let velocity = vector::<D>("velocity", velocity)?;
    let center = vector::<D>("center", center)?;
    Ok(Motion::new(velocity, angular_velocity, center, swing).map_err(NativeError)?)
}
