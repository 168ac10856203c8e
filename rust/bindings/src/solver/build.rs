//! From the arguments of Python's constructor to a solver.

use mpm::{
    Contact, Material, MpmError, Openings, Particles, Sleep, SolverSettings, Substeps, Walls,
};
use numpy::{Ix1, Ix2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::any::AnySolver;
use crate::convert::{along_axes, array, describe, slice_of, vector};
use crate::error::{NativeError, config_error};
use crate::scene::{
    AnyEmitter, AnyObstacle, AnyRigidBody, PyEmitter, PyMaterial, PyObstacle, PyRigidBody,
};
use crate::signals::interruptible;

/// "cfl", "reference" or a count.
pub fn parse_substeps(
    argument: Option<&Bound<'_, PyAny>>,
    cfl: Option<f32>,
    allow_unstable: bool,
) -> PyResult<Substeps> {
    let by_cfl = Substeps::Cfl(cfl);
    let Some(argument) = argument else {
        return Ok(by_cfl);
    };
    if let Ok(count) = argument.extract::<u32>() {
        return Ok(Substeps::Fixed {
            count,
            allow_unstable,
        });
    }
    match argument.extract::<&str>() {
        Ok("cfl") => Ok(by_cfl),
        Ok("reference") => Ok(Substeps::Reference),
        _ => Err(config_error(format!(
            "substeps must be \"cfl\", \"reference\" or an integer >= 1, got {}",
            describe(argument)
        ))),
    }
}

/// Number of substeps of a frame that the CFL law gives.
#[pyfunction]
#[pyo3(signature = (materials, *, dim, resolution, frame_dt, speed=0.0, cfl=None))]
pub fn cfl_substeps(
    materials: Vec<PyRef<'_, PyMaterial>>,
    dim: usize,
    resolution: usize,
    frame_dt: f32,
    speed: f32,
    cfl: Option<f32>,
) -> Result<u64, NativeError> {
    let refused = |name, allowed, value: &dyn std::fmt::Debug| {
        Err(NativeError(MpmError::parameter(name, allowed, value)))
    };
    if !matches!(dim, 2 | 3) {
        return refused("dim", "2 or 3", &dim);
    }
    if resolution == 0 {
        return refused("resolution", "at least 1", &resolution);
    }
    if !(frame_dt > 0.0 && frame_dt.is_finite()) {
        return refused("frame_dt", "finite and > 0 s", &frame_dt);
    }
    if !(speed >= 0.0 && speed.is_finite()) {
        return refused("speed", "finite and >= 0 m/s", &speed);
    }
    let materials: Vec<Material> = materials.iter().map(|material| material.inner).collect();
    let count = mpm::cfl_substeps(frame_dt, resolution, dim, &materials, speed, cfl);
    Ok(count.map_err(NativeError)? as u64)
}

/// Arrays of the initial particles, of the right types and numbers of axes.
pub struct Arrays<'py> {
    x: PyReadonlyArray2<'py, f32>,
    v: PyReadonlyArray2<'py, f32>,
    material: PyReadonlyArray1<'py, u8>,
    mass: PyReadonlyArray1<'py, f32>,
    volume: PyReadonlyArray1<'py, f32>,
    volume_ratio: Option<PyReadonlyArray1<'py, f32>>,
    body: Option<PyReadonlyArray1<'py, u32>>,
}

impl<'py> Arrays<'py> {
    #[expect(
        clippy::too_many_arguments,
        reason = "one for each array of a Python constructor"
    )]
    pub fn new(
        dim: usize,
        x: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        material: &Bound<'py, PyAny>,
        mass: &Bound<'py, PyAny>,
        volume: &Bound<'py, PyAny>,
        volume_ratio: Option<&Bound<'py, PyAny>>,
        body: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let vectors = format!("float32 of shape (N, {dim})");
        let scalars = "float32 of shape (N,)";
        let arrays = Self {
            x: array::<f32, Ix2>("x", &vectors, x)?,
            v: array::<f32, Ix2>("v", &vectors, v)?,
            material: array::<u8, Ix1>("material", "uint8 of shape (N,)", material)?,
            mass: array::<f32, Ix1>("mass", scalars, mass)?,
            volume: array::<f32, Ix1>("volume", scalars, volume)?,
            volume_ratio: volume_ratio
                .map(|ratio| array::<f32, Ix1>("volume_ratio", scalars, ratio))
                .transpose()?,
            body: body
                .map(|body| array::<u32, Ix1>("body", "uint32 of shape (N,)", body))
                .transpose()?,
        };
        for (name, shape) in [("x", arrays.x.shape()), ("v", arrays.v.shape())] {
            if shape[1] != dim {
                return Err(config_error(format!(
                    "{name} must be {vectors}, got shape {shape:?}"
                )));
            }
        }
        Ok(arrays)
    }

    pub fn particles(&self) -> Particles<'_> {
        let ratio = self.volume_ratio.as_ref();
        Particles {
            x: slice_of(&self.x),
            v: slice_of(&self.v),
            material: slice_of(&self.material),
            mass: slice_of(&self.mass),
            volume: slice_of(&self.volume),
            volume_ratio: ratio.map(slice_of),
            body: self.body.as_ref().map(slice_of),
        }
    }
}

/// Constructor arguments besides the particles.
pub struct Arguments<'py> {
    pub resolution: usize,
    pub cells: Vec<usize>,
    pub frame_dt: f64,
    pub gravity: Vec<f64>,
    pub wall_lower: Vec<f64>,
    pub wall_upper: Vec<f64>,
    /// Of the lower and the upper wall across each axis.
    pub wall_contacts: Vec<[Contact; 2]>,
    pub contact_friction: Option<f32>,
    pub transfer_loss: Option<f32>,
    pub materials: Vec<Material>,
    pub obstacles: Vec<PyRef<'py, PyObstacle>>,
    pub rigid: Vec<PyRef<'py, PyRigidBody>>,
    pub emitters: Vec<PyRef<'py, PyEmitter>>,
    pub sinks: Vec<PyRef<'py, PyObstacle>>,
    pub max_particles: usize,
    pub substeps: Substeps,
    pub sleep: Option<Sleep>,
    pub threads: usize,
}

impl Arguments<'_> {
    /// Builds the solver with the GIL released; a signal or a flag may end it early.
    pub fn build(self, py: Python<'_>, arrays: &Arrays<'_>) -> PyResult<AnySolver> {
        /// The settings in the dimension of one variant of the enumerations.
        macro_rules! build {
            ($variant:ident) => {{
                let solid = |o: &PyObstacle| match &o.inner {
                    AnyObstacle::$variant(o) => Some(o.clone()),
                    _ => None,
                };
                let opening = |e: &PyEmitter| match &e.inner {
                    AnyEmitter::$variant(e) => Some(e.clone()),
                    _ => None,
                };
                let dim = self.gravity.len();
                let obstacles = same_dim("obstacles", dim, &self.obstacles, solid)?;
                let body = |b: &PyRigidBody| match &b.inner {
                    AnyRigidBody::$variant(b) => Some(b.clone()),
                    _ => None,
                };
                let rigid = same_dim("rigid", dim, &self.rigid, body)?;
                let emitters = same_dim("emitters", dim, &self.emitters, opening)?;
                let sinks = same_dim("sinks", dim, &self.sinks, solid)?;
                let settings = SolverSettings {
                    resolution: self.resolution,
                    cells: along_axes(&self.cells),
                    frame_dt: self.frame_dt as f32,
                    gravity: vector("gravity", &self.gravity)?,
                    walls: Walls {
                        lower: vector("wall_lower", &self.wall_lower)?,
                        upper: vector("wall_upper", &self.wall_upper)?,
                        contacts: std::array::from_fn(|axis| self.wall_contacts[axis]),
                    },
                    contact_friction: self.contact_friction,
                    transfer_loss: self.transfer_loss,
                    materials: self.materials,
                    obstacles,
                    rigid,
                    openings: Openings {
                        emitters,
                        sinks: sinks.into_iter().map(|sink| sink.shape).collect(),
                        max_particles: self.max_particles,
                    },
                    substeps: self.substeps,
                    sleep: self.sleep,
                    threads: self.threads,
                };
                let particles = arrays.particles();
                let solver = interruptible(py, || {
                    mpm::Solver::new(settings, particles).map_err(|error| NativeError(error).into())
                })?;
                Ok(AnySolver::$variant(solver))
            }};
        }
        match self.gravity.len() {
            2 => build!(Plane),
            3 => build!(Space),
            dim => Err(config_error(format!(
                "gravity must have 2 or 3 components, got {dim}"
            ))),
        }
    }
}

/// The items of a list, all of which must have the scene's dimension.
pub fn same_dim<'a, T: pyo3::PyClass, U>(
    name: &str,
    dim: usize,
    list: &'a [PyRef<'_, T>],
    pick: impl Fn(&'a T) -> Option<U>,
) -> PyResult<Vec<U>> {
    list.iter()
        .enumerate()
        .map(|(index, item)| {
            pick(item)
                .ok_or_else(|| config_error(format!("{name}[{index}] must have {dim} coordinates")))
        })
        .collect()
}
