//! `Emitter`. Its dimension is that of its velocity.

use mpm::{Emitter, Vector};
use numpy::{Element, Ix2, Ix3, PyReadonlyArray, PyUntypedArrayMethods, ndarray::Dimension};
use pyo3::prelude::*;

use crate::convert::{array, slice_of, vector};
use crate::error::config_error;

#[derive(Clone)]
pub enum AnyEmitter {
    Plane(Emitter<2>),
    Space(Emitter<3>),
}

/// An opening that material leaves.
#[pyclass(frozen, name = "Emitter", module = "hybridmpm._native")]
pub struct PyEmitter {
    pub inner: AnyEmitter,
}

/// Constructor arguments common to both dimensions.
struct Arguments<'a> {
    material: u8,
    velocity: &'a [f64],
    spacing: f32,
    sites: &'a [f32],
    jitter: &'a [f32],
    mass: f32,
    volume: f32,
    start: f64,
    stop: f64,
}

impl Arguments<'_> {
    fn build<const D: usize>(&self) -> PyResult<Emitter<D>> {
        let points = |numbers: &[f32]| {
            let points = numbers.chunks_exact(D);
            points.map(Vector::from_column_slice).collect()
        };
        Ok(Emitter {
            material: self.material,
            velocity: vector("velocity", self.velocity)?,
            spacing: self.spacing,
            sites: points(self.sites),
            jitter: points(self.jitter),
            mass: self.mass,
            volume: self.volume,
            start: self.start,
            stop: self.stop,
        })
    }
}

fn check_width<T: Element, N: Dimension>(
    name: &str,
    expected: &[usize],
    array: &PyReadonlyArray<'_, T, N>,
) -> PyResult<()> {
    if array.shape().ends_with(expected) {
        return Ok(());
    }
    Err(config_error(format!(
        "{name} must have a shape that ends in {expected:?}, got {:?}",
        array.shape()
    )))
}

#[pymethods]
impl PyEmitter {
    #[new]
    #[pyo3(signature = (*, material, velocity, spacing, sites, jitter, mass, volume, start=0.0, stop=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python constructor"
    )]
    fn new(
        material: u8,
        velocity: Vec<f64>,
        spacing: f32,
        sites: &Bound<'_, PyAny>,
        jitter: &Bound<'_, PyAny>,
        mass: f32,
        volume: f32,
        start: f64,
        stop: Option<f64>,
    ) -> PyResult<Self> {
        let dim = velocity.len();
        let sites = array::<f32, Ix2>("sites", "float32 of shape (n, D)", sites)?;
        let jitter = array::<f32, Ix3>("jitter", "float32 of shape (k, n, D)", jitter)?;
        check_width("sites", &[dim], &sites)?;
        check_width("jitter", &[sites.shape()[0], dim], &jitter)?;
        let arguments = Arguments {
            material,
            velocity: &velocity,
            spacing,
            sites: slice_of(&sites),
            jitter: slice_of(&jitter),
            mass,
            volume,
            start,
            stop: stop.unwrap_or(f64::INFINITY),
        };
        let inner = match dim {
            2 => AnyEmitter::Plane(arguments.build()?),
            3 => AnyEmitter::Space(arguments.build()?),
            _ => {
                return Err(config_error(format!(
                    "velocity must have 2 or 3 components, got {dim}"
                )));
            }
        };
        Ok(Self { inner })
    }
}
