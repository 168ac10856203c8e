//! `Solver`: one Python class for both dimensions.

use std::sync::{Mutex, MutexGuard};

use mpm::{Force, MpmError, Obstacle, Particles, Settings, Sleep, Substeps, Walls};
use numpy::{
    IntoPyArray, Ix1, Ix2, IxDyn, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArrayDyn,
    PyReadwriteArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::convert::{array, contact, describe, slice_of, vector};
use crate::error::{NativeError, config_error};
use crate::material::PyMaterial;
use crate::obstacle::{AnyObstacle, PyObstacle};
use crate::report::{PyDiagnostics, PyFrameReport};

#[derive(Clone)]
enum AnySolver {
    Plane(mpm::Solver<2>),
    Space(mpm::Solver<3>),
}

/// Runs one expression on the solver of whichever dimension.
macro_rules! with_solver {
    ($any:expr, $solver:ident => $body:expr) => {
        match $any {
            AnySolver::Plane($solver) => $body,
            AnySolver::Space($solver) => $body,
        }
    };
}

/// MLS-MPM on one scene.
#[pyclass(frozen, name = "Solver", module = "hybridmpm._native")]
pub struct PySolver {
    inner: Mutex<AnySolver>,
    dim: usize,
    count: usize,
    resolution: usize,
    frame_dt: f64,
}

/// "cfl", "reference" or a count.
fn substeps(
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

fn obstacles<const D: usize>(
    list: &[PyRef<'_, PyObstacle>],
    pick: impl Fn(&AnyObstacle) -> Option<Obstacle<D>>,
) -> PyResult<Vec<Obstacle<D>>> {
    list.iter()
        .enumerate()
        .map(|(index, obstacle)| {
            pick(&obstacle.inner).ok_or_else(|| {
                config_error(format!("obstacles[{index}] must have {D} coordinates"))
            })
        })
        .collect()
}

/// What both dimensions share of the constructor's arguments.
struct Arguments<'a> {
    resolution: usize,
    frame_dt: f64,
    gravity: &'a [f64],
    wall_lower: &'a [f64],
    wall_upper: &'a [f64],
    wall_contact: mpm::Contact,
    materials: Vec<mpm::Material>,
    substeps: Substeps,
    sleep: Option<Sleep>,
    threads: usize,
}

impl Arguments<'_> {
    fn build<const D: usize>(
        self,
        obstacles: Vec<Obstacle<D>>,
        particles: Particles<'_>,
    ) -> PyResult<mpm::Solver<D>> {
        let settings = Settings {
            resolution: self.resolution,
            frame_dt: self.frame_dt as f32,
            gravity: vector("gravity", self.gravity)?,
            walls: Walls {
                lower: vector("wall_lower", self.wall_lower)?,
                upper: vector("wall_upper", self.wall_upper)?,
                contact: self.wall_contact,
            },
            materials: self.materials,
            obstacles,
            substeps: self.substeps,
            sleep: self.sleep,
            threads: self.threads,
        };
        Ok(mpm::Solver::new(settings, particles).map_err(NativeError)?)
    }
}

impl PySolver {
    pub fn count(&self) -> usize {
        self.count
    }

    /// Advances with the calling thread, which holds no GIL.
    pub fn run(&self, frames: usize, force: Force<'_>) -> Result<(), MpmError> {
        with_solver!(&mut *self.locked(), solver => solver.advance(frames, force, |_, _| ()))
    }

    fn locked(&self) -> MutexGuard<'_, AnySolver> {
        self.inner.lock().expect("no panic under the lock")
    }

    /// Takes the lock with the GIL released, so that a thread that waits for a solver stops no other.
    fn detached<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut AnySolver) -> T + Send,
    ) -> T {
        py.detach(|| work(&mut self.locked()))
    }

    /// The force of an array, checked against this solver's particles.
    pub fn force<'a>(
        &self,
        name: &str,
        frames: usize,
        array: Option<&'a PyReadonlyArrayDyn<'_, f32>>,
    ) -> PyResult<Force<'a>> {
        let (held, per_frame) = ([self.count, self.dim], [frames, self.count, self.dim]);
        match array {
            None => Ok(Force::None),
            Some(array) if array.shape() == held => Ok(Force::Held(slice_of(name, array)?)),
            Some(array) if array.shape() == per_frame => {
                Ok(Force::PerFrame(slice_of(name, array)?))
            }
            Some(array) => Err(config_error(format!(
                "{name} must be of shape {held:?} or {per_frame:?}, got {:?}",
                array.shape()
            ))),
        }
    }

    fn read(
        &self,
        py: Python<'_>,
        width: usize,
        write: impl Fn(&AnySolver, &mut [f32]) + Sync,
    ) -> Vec<f32> {
        self.detached(py, |any| {
            let mut out = vec![0.0; self.count * width];
            write(any, &mut out);
            out
        })
    }
}

#[pymethods]
impl PySolver {
    #[new]
    #[pyo3(signature = (*, resolution, frame_dt, gravity, wall_lower, wall_upper,
        wall_contact="separating", wall_friction=None, materials, obstacles=Vec::new(), x, v, material, mass,
        volume, volume_ratio=None, substeps=None, cfl=None,
        allow_unstable=false, sleep_speed=None, sleep_frames=20, threads=1),
        text_signature = "(*, resolution, frame_dt, gravity, wall_lower, wall_upper, \
        wall_contact='separating', wall_friction=None, materials, obstacles=(), x, v, material, mass, \
        volume, volume_ratio=None, substeps='cfl', cfl=None, allow_unstable=False, \
        sleep_speed=None, sleep_frames=20, threads=1)")]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python constructor"
    )]
    fn new(
        py: Python<'_>,
        resolution: usize,
        frame_dt: f64,
        gravity: Vec<f64>,
        wall_lower: Vec<f64>,
        wall_upper: Vec<f64>,
        wall_contact: &str,
        wall_friction: Option<f32>,
        materials: Vec<PyRef<'_, PyMaterial>>,
        obstacles: Vec<PyRef<'_, PyObstacle>>,
        x: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        material: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        volume: &Bound<'_, PyAny>,
        volume_ratio: Option<&Bound<'_, PyAny>>,
        substeps: Option<Bound<'_, PyAny>>,
        cfl: Option<f32>,
        allow_unstable: bool,
        sleep_speed: Option<f32>,
        sleep_frames: u32,
        threads: usize,
    ) -> PyResult<Self> {
        let dim = gravity.len();
        let vectors = format!("float32 of shape (N, {dim})");
        let scalars = "float32 of shape (N,)";
        let x = array::<f32, Ix2>("x", &vectors, x)?;
        let v = array::<f32, Ix2>("v", &vectors, v)?;
        let material = array::<u8, Ix1>("material", "uint8 of shape (N,)", material)?;
        let mass = array::<f32, Ix1>("mass", scalars, mass)?;
        let volume = array::<f32, Ix1>("volume", scalars, volume)?;
        let volume_ratio = volume_ratio
            .map(|ratio| array::<f32, Ix1>("volume_ratio", scalars, ratio))
            .transpose()?;
        for (name, shape) in [("x", x.shape()), ("v", v.shape())] {
            if shape[1] != dim {
                return Err(config_error(format!(
                    "{name} must be {vectors}, got shape {shape:?}"
                )));
            }
        }
        let arguments = Arguments {
            resolution,
            frame_dt,
            gravity: &gravity,
            wall_lower: &wall_lower,
            wall_upper: &wall_upper,
            wall_contact: contact(wall_contact, wall_friction)?,
            materials: materials.iter().map(|m| m.inner).collect(),
            substeps: self::substeps(substeps.as_ref(), cfl, allow_unstable)?,
            sleep: sleep_speed.map(|speed| Sleep {
                speed,
                frames: sleep_frames,
            }),
            threads,
        };
        let particles = Particles {
            x: slice_of("x", &x)?,
            v: slice_of("v", &v)?,
            material: slice_of("material", &material)?,
            mass: slice_of("mass", &mass)?,
            volume: slice_of("volume", &volume)?,
            volume_ratio: volume_ratio
                .as_ref()
                .map(|r| slice_of("volume_ratio", r))
                .transpose()?,
        };
        let inner = match dim {
            2 => {
                let list = self::obstacles(&obstacles, |o| match o {
                    AnyObstacle::Plane(o) => Some(*o),
                    AnyObstacle::Space(_) => None,
                })?;
                AnySolver::Plane(py.detach(|| arguments.build(list, particles))?)
            }
            3 => {
                let list = self::obstacles(&obstacles, |o| match o {
                    AnyObstacle::Space(o) => Some(*o),
                    AnyObstacle::Plane(_) => None,
                })?;
                AnySolver::Space(py.detach(|| arguments.build(list, particles))?)
            }
            _ => {
                return Err(config_error(format!(
                    "gravity must have 2 or 3 components, got {dim}"
                )));
            }
        };
        let count = with_solver!(&inner, solver => solver.count());
        Ok(Self {
            inner: Mutex::new(inner),
            dim,
            count,
            resolution,
            frame_dt,
        })
    }

    #[pyo3(signature = (frames=1, force=None, out=None))]
    fn advance(
        &self,
        py: Python<'_>,
        frames: usize,
        force: Option<&Bound<'_, PyAny>>,
        out: Option<PyReadwriteArray3<'_, f32>>,
    ) -> PyResult<()> {
        let per_frame = [frames, self.count, self.dim];
        let force = force
            .map(|force| array::<f32, IxDyn>("force", "float32", force))
            .transpose()?;
        let force = self.force("force", frames, force.as_ref())?;
        let mut out = out;
        let out: &mut [f32] = match &mut out {
            None => &mut [],
            Some(array) if array.shape() == per_frame => array
                .as_slice_mut()
                .map_err(|_| config_error("out must be C-contiguous and writable"))?,
            Some(array) => {
                return Err(config_error(format!(
                    "out must be of shape {per_frame:?}, got {:?}",
                    array.shape()
                )));
            }
        };
        let size = self.count * self.dim;
        let result: Result<(), MpmError> = self.detached(py, |any| {
            with_solver!(any, solver => solver.advance(frames, force, |index, solver| {
                if !out.is_empty() {
                    solver.write_positions(&mut out[index * size..][..size]);
                }
            }))
        });
        Ok(result.map_err(NativeError)?)
    }

    #[getter]
    fn dim(&self) -> usize {
        self.dim
    }

    #[getter]
    fn particle_count(&self) -> usize {
        self.count
    }

    #[getter]
    fn resolution(&self) -> usize {
        self.resolution
    }

    #[getter]
    fn frame(&self, py: Python<'_>) -> u64 {
        self.detached(py, |any| with_solver!(any, solver => solver.frame()))
    }

    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        self.frame(py) as f64 * self.frame_dt
    }

    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let out = self.read(
            py,
            self.dim,
            |any, out| with_solver!(any, s => s.write_positions(out)),
        );
        out.into_pyarray(py).reshape([self.count, self.dim])
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let out = self.read(
            py,
            self.dim,
            |any, out| with_solver!(any, s => s.write_velocities(out)),
        );
        out.into_pyarray(py).reshape([self.count, self.dim])
    }

    #[getter]
    fn affine<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let width = self.dim * self.dim;
        let out = self.read(
            py,
            width,
            |any, out| with_solver!(any, s => s.write_affine(out)),
        );
        out.into_pyarray(py)
            .reshape([self.count, self.dim, self.dim])
    }

    #[getter]
    fn volume_ratio<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        let out = self.read(
            py,
            1,
            |any, out| with_solver!(any, s => s.write_volume_ratios(out)),
        );
        out.into_pyarray(py)
    }

    #[getter]
    fn asleep<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        let count = self.count;
        let out = self.detached(py, |any| {
            let mut out = vec![false; count];
            with_solver!(any, s => s.write_asleep(&mut out));
            out
        });
        out.into_pyarray(py)
    }

    #[getter]
    fn last_frame(&self, py: Python<'_>) -> Option<PyFrameReport> {
        self.detached(py, |any| with_solver!(any, solver => solver.last_frame()))
            .map(PyFrameReport)
    }

    fn diagnostics(&self, py: Python<'_>) -> PyDiagnostics {
        PyDiagnostics(self.detached(py, |any| with_solver!(any, solver => solver.diagnostics())))
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let data = self.detached(py, |any| with_solver!(any, solver => solver.snapshot()));
        PyBytes::new(py, &data)
    }

    fn restore(&self, py: Python<'_>, data: &[u8]) -> PyResult<()> {
        let result = self.detached(py, |any| with_solver!(any, solver => solver.restore(data)));
        Ok(result.map_err(NativeError)?)
    }

    fn copy(&self, py: Python<'_>) -> Self {
        let inner = Mutex::new(self.detached(py, |any| any.clone()));
        Self {
            inner,
            dim: self.dim,
            count: self.count,
            resolution: self.resolution,
            frame_dt: self.frame_dt,
        }
    }
}
