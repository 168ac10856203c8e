//! `Solver`: one Python class for both dimensions.

use mpm::{EmitterStatus, Force, MpmError, PrescribeOptions, Pull, Sleep};
use numpy::{
    IntoPyArray, Ix2, Ix3, IxDyn, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::any::{AnySolver, AnyUpsampler, with_any};
use super::build::{Arguments, Arrays, parse_substeps};
use super::force::checked_force;
use super::held::Held;
use super::report::{PyDiagnostics, PyFrameReport, PyMotionReport};
use super::shown::PyUpsampler;
use crate::convert::{
    ForWalls, array, cells_or_unit, read_only, slice_of, vector, vectors, wall_contacts, writable,
};
use crate::error::{NativeError, config_error};
use crate::scene::{PyEmitter, PyMaterial, PyObstacle, PyRigidBody};

/// MLS-MPM on one scene.
#[pyclass(frozen, name = "Solver", module = "hybridmpm._native")]
pub struct PySolver {
    held: Held<AnySolver>,
    dim: usize,
    resolution: usize,
    frame_dt: f64,
}

impl PySolver {
    pub fn count(&self) -> PyResult<usize> {
        with_any!(&*self.held.locked()?, solver => Ok(solver.count()))
    }

    /// Advances on the calling thread, without the GIL.
    pub fn run(&self, frames: usize, force: Force<'_>) -> PyResult<Result<(), MpmError>> {
        with_any!(&mut *self.held.locked()?, solver => Ok(solver.advance(frames, force, |_, _| ())))
    }

    pub fn dimension(&self) -> usize {
        self.dim
    }

    /// An independent solver in the same state.
    pub fn twin(&self, py: Python<'_>) -> PyResult<AnySolver> {
        self.held.detached(py, |any| any.clone())
    }

    /// The force of an array, checked against this solver's particles.
    pub fn force<'a>(
        &self,
        py: Python<'_>,
        name: &str,
        frames: usize,
        array: Option<&'a PyReadonlyArrayDyn<'_, f32>>,
    ) -> PyResult<Force<'a>> {
        let count = py.detach(|| self.count())?;
        checked_force(name, [frames, count, self.dim], array)
    }

    /// The N x `width` numbers that `write` fills in.
    fn read<T: Clone + Default + Send>(
        &self,
        py: Python<'_>,
        width: usize,
        write: impl Fn(&AnySolver, &mut [T]) + Sync,
    ) -> PyResult<Vec<T>> {
        let size = |any: &AnySolver| with_any!(any, solver => solver.count()) * width;
        self.held.read(py, size, write)
    }

    /// The same as an array (N, D) to read from.
    fn read_vectors<'py>(
        &self,
        py: Python<'py>,
        write: impl Fn(&AnySolver, &mut [f32]) + Sync,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        vectors(py, self.dim, self.read(py, self.dim, write)?).map(read_only)
    }
}

#[pymethods]
impl PySolver {
    #[new]
    #[pyo3(signature = (*, resolution, cells=None, frame_dt, gravity, wall_lower, wall_upper,
        wall_contact=ForWalls::All("separating".to_owned()), wall_friction=ForWalls::All(None), materials, obstacles=Vec::new(), rigid=Vec::new(), emitters=Vec::new(),
        sinks=Vec::new(), max_particles=None, x, v, material, mass,
        volume, volume_ratio=None, body=None, contact_friction=None, transfer_loss=None, substeps=None, cfl=None,
        allow_unstable=false, sleep_speed=None, sleep_frames=20, threads=1),
        text_signature = "(*, resolution, cells=None, frame_dt, gravity, wall_lower, wall_upper, \
        wall_contact='separating', wall_friction=None, materials, obstacles=(), rigid=(), emitters=(), sinks=(), \
        max_particles=None, x, v, material, mass, volume, volume_ratio=None, body=None, contact_friction=None, \
        transfer_loss=None, substeps='cfl', cfl=None, allow_unstable=False, sleep_speed=None, sleep_frames=20, threads=1)")]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python constructor"
    )]
    fn new(
        py: Python<'_>,
        resolution: usize,
        cells: Option<Vec<usize>>,
        frame_dt: f64,
        gravity: Vec<f64>,
        wall_lower: Vec<f64>,
        wall_upper: Vec<f64>,
        wall_contact: ForWalls<String>,
        wall_friction: ForWalls<Option<f32>>,
        materials: Vec<PyRef<'_, PyMaterial>>,
        obstacles: Vec<PyRef<'_, PyObstacle>>,
        rigid: Vec<PyRef<'_, PyRigidBody>>,
        emitters: Vec<PyRef<'_, PyEmitter>>,
        sinks: Vec<PyRef<'_, PyObstacle>>,
        max_particles: Option<usize>,
        x: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        material: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        volume: &Bound<'_, PyAny>,
        volume_ratio: Option<&Bound<'_, PyAny>>,
        body: Option<&Bound<'_, PyAny>>,
        contact_friction: Option<f32>,
        transfer_loss: Option<f32>,
        substeps: Option<Bound<'_, PyAny>>,
        cfl: Option<f32>,
        allow_unstable: bool,
        sleep_speed: Option<f32>,
        sleep_frames: u32,
        threads: usize,
    ) -> PyResult<Self> {
        let dim = gravity.len();
        let arrays = Arrays::new(dim, x, v, material, mass, volume, volume_ratio, body)?;
        let arguments = Arguments {
            resolution,
            cells: cells_or_unit(cells, resolution, dim)?,
            frame_dt,
            gravity,
            wall_lower,
            wall_upper,
            wall_contacts: wall_contacts(dim, &wall_contact, &wall_friction)?,
            contact_friction,
            transfer_loss,
            materials: materials.iter().map(|m| m.inner).collect(),
            obstacles,
            rigid,
            emitters,
            sinks,
            max_particles: max_particles.unwrap_or(usize::MAX),
            substeps: parse_substeps(substeps.as_ref(), cfl, allow_unstable)?,
            sleep: sleep_speed.map(|speed| Sleep {
                speed,
                frames: sleep_frames,
            }),
            threads,
        };
        Ok(Self {
            held: Held::new(arguments.build(py, &arrays)?),
            dim,
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
        out: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let count = py.detach(|| self.count())?;
        let per_frame = [frames, count, self.dim];
        let force = force
            .map(|force| array::<f32, IxDyn>("force", "float32", force))
            .transpose()?;
        let force = self.force(py, "force", frames, force.as_ref())?;
        let mut out = out
            .map(|out| writable::<f32, Ix3>("out", "float32", &per_frame, out))
            .transpose()?;
        let out: &mut [f32] = match &mut out {
            None => &mut [],
            Some(array) => array.as_slice_mut()?,
        };
        let size = count * self.dim;
        self.held.interruptible(py, |any| {
            with_any!(any, solver => {
                if !out.is_empty() && (solver.settings().openings.any() || solver.count() != count) {
                    return Err(config_error(
                        "out must be absent where emitters or sinks change the number of particles",
                    ));
                }
                let advanced = solver.advance(frames, force, |index, solver| {
                    if !out.is_empty() {
                        solver.write_positions(&mut out[index * size..][..size]);
                    }
                });
                advanced.map_err(|error| NativeError(error).into())
            })
        })
    }

    #[pyo3(signature = (x, v, frame, *, affine=true, deform=false))]
    fn prescribe(
        &self,
        py: Python<'_>,
        x: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        frame: u64,
        affine: bool,
        deform: bool,
    ) -> PyResult<PyMotionReport> {
        let count = py.detach(|| self.count())?;
        let expected = format!("float32 of shape ({count}, {})", self.dim);
        let x = array::<f32, Ix2>("x", &expected, x)?;
        let v = array::<f32, Ix2>("v", &expected, v)?;
        for (name, shape) in [("x", x.shape()), ("v", v.shape())] {
            if shape != [count, self.dim] {
                return Err(config_error(format!(
                    "{name} must be {expected}, got shape {shape:?}"
                )));
            }
        }
        let (x, v) = (slice_of(&x), slice_of(&v));
        let options = PrescribeOptions { affine, deform };
        let report = self.held.detached(
            py,
            |any| with_any!(any, solver => solver.prescribe(x, v, frame, options)),
        );
        Ok(PyMotionReport(report?.map_err(NativeError)?))
    }

    #[getter]
    fn dim(&self) -> usize {
        self.dim
    }

    #[getter]
    fn particle_count(&self, py: Python<'_>) -> PyResult<usize> {
        py.detach(|| self.count())
    }

    #[getter]
    fn resolution(&self) -> usize {
        self.resolution
    }

    #[getter]
    fn frame(&self, py: Python<'_>) -> PyResult<u64> {
        self.held
            .detached(py, |any| with_any!(any, solver => solver.frame()))
    }

    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.frame(py)? as f64 * self.frame_dt)
    }

    #[getter]
    fn is_open(&self, py: Python<'_>) -> PyResult<bool> {
        self.held
            .detached(py, |any| with_any!(any, s => s.settings().openings.any()))
    }

    #[getter]
    fn ids<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let ids = self
            .held
            .detached(py, |any| with_any!(any, s => s.ids().to_vec()))?;
        Ok(read_only(ids.into_pyarray(py)))
    }

    #[getter]
    fn material<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let out = self.read(
            py,
            1,
            |any, out| with_any!(any, s => s.write_materials(out)),
        );
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let out = self.read(py, 1, |any, out| with_any!(any, s => s.write_masses(out)));
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn rigid<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let numbers: Vec<f64> = self
            .held
            .detached(py, |any| with_any!(any, s => s.rigid().flatten().collect()))?;
        let count = numbers.len() / 13;
        numbers.into_pyarray(py).reshape([count, 13]).map(read_only)
    }

    #[pyo3(signature = (*, body, grip, target, reach, strength))]
    fn pull(
        &self,
        py: Python<'_>,
        body: usize,
        grip: Vec<f64>,
        target: Vec<f64>,
        reach: f32,
        strength: f32,
    ) -> PyResult<()> {
        self.held.detached(py, |any| {
            with_any!(any, solver => {
                let pull = Pull {
                    body,
                    grip: vector("grip", &grip)?,
                    target: vector("target", &target)?,
                    reach,
                    strength,
                };
                Ok(solver.pull(pull).map_err(NativeError)?)
            })
        })?
    }

    #[getter]
    fn rigid_energy(&self, py: Python<'_>) -> PyResult<[f64; 2]> {
        self.held
            .detached(py, |any| with_any!(any, s => s.rigid_energy()))
    }

    #[getter]
    fn emitters(&self, py: Python<'_>) -> PyResult<Vec<&'static str>> {
        self.held.detached(
            py,
            |any| with_any!(any, s => s.emitters().map(EmitterStatus::name).collect()),
        )
    }

    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.read_vectors(py, |any, out| with_any!(any, s => s.write_positions(out)))
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.read_vectors(py, |any, out| with_any!(any, s => s.write_velocities(out)))
    }

    #[getter]
    fn affine<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let width = self.dim * self.dim;
        let out = self.read(
            py,
            width,
            |any, out| with_any!(any, s => s.write_affine(out)),
        )?;
        let count = out.len() / width;
        let shape = [count, self.dim, self.dim];
        out.into_pyarray(py).reshape(shape).map(read_only)
    }

    #[getter]
    fn volume_ratio<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let out = self.read(
            py,
            1,
            |any, out| with_any!(any, s => s.write_volume_ratios(out)),
        );
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn pressure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let out = self.read(
            py,
            1,
            |any, out| with_any!(any, s => s.write_pressures(out)),
        );
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn asleep<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let out = self.read(py, 1, |any, out| with_any!(any, s => s.write_asleep(out)));
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn last_frame(&self, py: Python<'_>) -> PyResult<Option<PyFrameReport>> {
        let report = self
            .held
            .detached(py, |any| with_any!(any, solver => solver.last_frame()))?;
        let width = 3 * (self.dim - 1);
        Ok(report.map(|inner| PyFrameReport { inner, width }))
    }

    fn diagnostics(&self, py: Python<'_>) -> PyResult<PyDiagnostics> {
        let totals = self
            .held
            .detached(py, |any| with_any!(any, solver => solver.diagnostics()));
        totals.map(PyDiagnostics)
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let data = self
            .held
            .detached(py, |any| with_any!(any, solver => solver.snapshot()))?;
        Ok(PyBytes::new(py, &data))
    }

    #[pyo3(signature = (upsampler=None, *, redoes=false))]
    fn start<'py>(
        &self,
        py: Python<'py>,
        upsampler: Option<&PyUpsampler>,
        redoes: bool,
    ) -> PyResult<Bound<'py, PyBytes>> {
        // A copy: so no call has two locks.
        let shown = upsampler
            .map(|upsampler| upsampler.contents(py))
            .transpose()?;
        let data = self.held.detached(py, |any| match (any, &shown) {
            (AnySolver::Plane(solver), None) => Ok(solver.start(None, redoes)),
            (AnySolver::Space(solver), None) => Ok(solver.start(None, redoes)),
            (AnySolver::Plane(solver), Some(AnyUpsampler::Plane(shown))) => {
                Ok(solver.start(Some(&**shown), redoes))
            }
            (AnySolver::Space(solver), Some(AnyUpsampler::Space(shown))) => {
                Ok(solver.start(Some(&**shown), redoes))
            }
            _ => Err(config_error("upsampler must have the solver's dimension")),
        })?;
        Ok(PyBytes::new(py, &data?))
    }

    fn restore(&self, py: Python<'_>, data: &[u8]) -> PyResult<()> {
        let result = self
            .held
            .detached(py, |any| with_any!(any, solver => solver.restore(data)))?;
        Ok(result.map_err(NativeError)?)
    }

    fn __copy__(&self, py: Python<'_>) -> PyResult<Self> {
        self.copy(py)
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.copy(py)
    }

    fn keep_forces(&self, py: Python<'_>) -> PyResult<()> {
        self.held
            .detached(py, |any| with_any!(any, solver => solver.keep_forces()))
    }

    fn copy(&self, py: Python<'_>) -> PyResult<Self> {
        Ok(Self {
            held: Held::new(self.twin(py)?),
            dim: self.dim,
            resolution: self.resolution,
            frame_dt: self.frame_dt,
        })
    }
}
