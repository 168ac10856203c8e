//! `Upsampler`: all particles of a scene, moved with coarse particles.

use mpm::{CoarseParticles, EmitterStatus, Openings, Upsampler, UpsamplingConstants};
use numpy::{
    IntoPyArray, Ix1, Ix2, Ix3, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::any::{AnySolver, AnyUpsampler, with_any};
use super::build::{Arrays, same_dim};
use super::class::PySolver;
use super::held::Held;
use super::shown::PyUpsampler;
use crate::convert::{along_axes, array, cells_or_unit, read_only, slice_of, vectors};
use crate::error::{NativeError, config_error};
use crate::scene::{AnyEmitter, PyEmitter};

/// Arrays of coarse particles.
struct CoarseArrays<'py> {
    ids: PyReadonlyArray1<'py, u64>,
    x: PyReadonlyArray2<'py, f32>,
    affine: Option<PyReadonlyArray3<'py, f32>>,
    mass: PyReadonlyArray1<'py, f32>,
    rigid: Vec<[f64; 13]>,
}

impl<'py> CoarseArrays<'py> {
    fn new(
        dim: usize,
        ids: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        affine: Option<&Bound<'py, PyAny>>,
        mass: &Bound<'py, PyAny>,
        rigid: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let vectors = format!("float32 of shape (N, {dim})");
        let matrices = format!("float32 of shape (N, {dim}, {dim})");
        let arrays = Self {
            ids: array::<u64, Ix1>("ids", "uint64 of shape (N,)", ids)?,
            x: array::<f32, Ix2>("x", &vectors, x)?,
            affine: affine
                .map(|affine| array::<f32, Ix3>("affine", &matrices, affine))
                .transpose()?,
            mass: array::<f32, Ix1>("mass", "float32 of shape (N,)", mass)?,
            rigid: rigid.map(bodies).transpose()?.unwrap_or_default(),
        };
        if arrays.x.shape()[1] != dim {
            let got = arrays.x.shape();
            return Err(config_error(format!(
                "x must be {vectors}, got shape {got:?}"
            )));
        }
        Ok(arrays)
    }

    fn coarse(&self) -> CoarseParticles<'_> {
        let affine = self.affine.as_ref();
        CoarseParticles {
            ids: slice_of(&self.ids),
            x: slice_of(&self.x),
            affine: affine.map(slice_of),
            mass: slice_of(&self.mass),
            rigid: &self.rigid,
        }
    }
}

/// Numbers of rigid bodies, a row each.
fn bodies(rows: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 13]>> {
    let expected = "float64 of shape (B, 13)";
    let rows = array::<f64, Ix2>("rigid", expected, rows)?;
    if rows.shape()[1] != 13 {
        let got = rows.shape();
        return Err(config_error(format!(
            "rigid must be {expected}, got shape {got:?}"
        )));
    }
    Ok(slice_of(&rows).as_chunks().0.to_vec())
}

impl PyUpsampler {
    /// A number for each particle, written by `write`.
    fn read<T: Clone + Default + Send>(
        &self,
        py: Python<'_>,
        write: impl Fn(&AnyUpsampler, &mut [T]) + Sync,
    ) -> PyResult<Vec<T>> {
        let size = |any: &AnyUpsampler| with_any!(any, upsampler => upsampler.count());
        self.held.read(py, size, write)
    }
}

#[pymethods]
impl PyUpsampler {
    #[new]
    #[pyo3(signature = (solver, *, resolution, cells=None, affine_share=0.5, relaxation=2.0, emitters=Vec::new(), max_particles=None, x, v, material, mass, volume),
        text_signature = "(solver, *, resolution, cells=None, affine_share=0.5, relaxation=2.0, emitters=(), max_particles=None, x, v, material, mass, volume)")]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python constructor"
    )]
    fn new(
        py: Python<'_>,
        solver: &PySolver,
        resolution: usize,
        cells: Option<Vec<usize>>,
        affine_share: f32,
        relaxation: f32,
        emitters: Vec<PyRef<'_, PyEmitter>>,
        max_particles: Option<usize>,
        x: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        material: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        volume: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let dim = solver.dimension();
        let arrays = Arrays::new(dim, x, v, material, mass, volume, None, None)?;
        let cells = cells_or_unit(cells, resolution, dim)?;
        let particles = arrays.particles();
        let constants = UpsamplingConstants {
            affine_share,
            relaxation,
        };
        /// Builds the upsampler in the dimension of one variant of the enumerations.
        macro_rules! build {
            ($variant:ident, $coarse:ident) => {{
                let opening = |e: &PyEmitter| match &e.inner {
                    AnyEmitter::$variant(e) => Some(e.clone()),
                    _ => None,
                };
                let emitters = same_dim("emitters", dim, &emitters, opening)?;
                let mut settings = $coarse.settings().clone();
                let coarse_grid = (settings.resolution, settings.cells);
                (settings.resolution, settings.cells) = (resolution, along_axes(&cells));
                settings.openings = Openings {
                    emitters,
                    max_particles: max_particles.unwrap_or(usize::MAX),
                    ..settings.openings
                };
                let count = $coarse.count();
                let (mut x, mut mass) = (vec![0.0; count * dim], vec![0.0; count]);
                $coarse.write_positions(&mut x);
                $coarse.write_masses(&mut mass);
                let coarse = CoarseParticles {
                    ids: $coarse.ids(),
                    x: &x,
                    affine: None,
                    mass: &mass,
                    rigid: &[],
                };
                let upsampler = py.detach(|| {
                    Upsampler::new(&settings, coarse_grid, constants, particles, &coarse)
                });
                AnyUpsampler::$variant(Box::new(upsampler.map_err(NativeError)?))
            }};
        }
        let inner = match &solver.twin(py)? {
            AnySolver::Plane(coarse) => build!(Plane, coarse),
            AnySolver::Space(coarse) => build!(Space, coarse),
        };
        let every = with_any!(&inner, upsampler => upsampler.every());
        Ok(Self {
            held: Held::new(inner),
            dim,
            every,
        })
    }

    #[getter]
    fn every(&self) -> u64 {
        self.every
    }

    #[getter]
    fn frame(&self, py: Python<'_>) -> PyResult<u64> {
        self.held
            .detached(py, |any| with_any!(any, upsampler => upsampler.frame()))
    }

    #[getter]
    fn particle_count(&self, py: Python<'_>) -> PyResult<usize> {
        self.held
            .detached(py, |any| with_any!(any, upsampler => upsampler.count()))
    }

    #[getter]
    fn ids<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let ids = self
            .held
            .detached(py, |any| with_any!(any, c => c.ids().to_vec()))?;
        Ok(read_only(ids.into_pyarray(py)))
    }

    #[getter]
    fn mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let out = self.read(py, |any, out| with_any!(any, c => c.write_masses(out)));
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn material<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let out = self.read(py, |any, out| with_any!(any, c => c.write_materials(out)));
        Ok(read_only(out?.into_pyarray(py)))
    }

    #[getter]
    fn emitters(&self, py: Python<'_>) -> PyResult<Vec<&'static str>> {
        self.held.detached(
            py,
            |any| with_any!(any, c => c.emitters().map(EmitterStatus::name).collect()),
        )
    }

    #[pyo3(signature = (frame, *, ids, x, affine=None, mass, rigid=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python method"
    )]
    fn update<'py>(
        &self,
        py: Python<'py>,
        frame: u64,
        ids: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        affine: Option<&Bound<'py, PyAny>>,
        mass: &Bound<'py, PyAny>,
        rigid: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<()> {
        let arrays = CoarseArrays::new(self.dim, ids, x, affine, mass, rigid)?;
        let coarse = arrays.coarse();
        self.held.interruptible(py, |any| {
            let updated = with_any!(any, upsampler => upsampler.update(&coarse, frame));
            updated.map_err(|error| NativeError(error).into())
        })
    }

    #[pyo3(signature = (frame, *, ids, x, affine=None, mass, rigid=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python method"
    )]
    fn positions<'py>(
        &self,
        py: Python<'py>,
        frame: u64,
        ids: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        affine: Option<&Bound<'py, PyAny>>,
        mass: &Bound<'py, PyAny>,
        rigid: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let arrays = CoarseArrays::new(self.dim, ids, x, affine, mass, rigid)?;
        let coarse = arrays.coarse();
        let shown = self.held.detached(py, |any| {
            with_any!(any, upsampler => {
                let mut out = vec![0.0; upsampler.count() * self.dim];
                upsampler.write_positions(&coarse, frame, &mut out).map(|()| out)
            })
        });
        vectors(py, self.dim, shown?.map_err(NativeError)?)
    }

    #[pyo3(signature = (frame, *, ids, x, v, affine=None, mass, rigid=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python method"
    )]
    fn velocities<'py>(
        &self,
        py: Python<'py>,
        frame: u64,
        ids: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        affine: Option<&Bound<'py, PyAny>>,
        mass: &Bound<'py, PyAny>,
        rigid: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let arrays = CoarseArrays::new(self.dim, ids, x, affine, mass, rigid)?;
        let coarse = arrays.coarse();
        let v = array::<f32, Ix2>("v", &format!("float32 of shape (N, {})", self.dim), v)?;
        let v = slice_of(&v);
        let shown = self.held.detached(py, |any| {
            with_any!(any, upsampler => {
                let mut out = vec![0.0; upsampler.count() * self.dim];
                upsampler.write_velocities(&coarse, v, frame, &mut out).map(|()| out)
            })
        });
        vectors(py, self.dim, shown?.map_err(NativeError)?)
    }

    fn gather_force<'py>(
        &self,
        py: Python<'py>,
        force: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let force = array::<f32, Ix2>(
            "force",
            &format!("float32 of shape (N, {})", self.dim),
            force,
        )?;
        let force = slice_of(&force);
        let gathered = self.held.detached(
            py,
            |any| with_any!(any, upsampler => upsampler.gather_force(force)),
        );
        vectors(py, self.dim, gathered?.map_err(NativeError)?)
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let data = self
            .held
            .detached(py, |any| with_any!(any, upsampler => upsampler.snapshot()))?;
        Ok(PyBytes::new(py, &data))
    }

    fn restore(&self, py: Python<'_>, data: &[u8]) -> PyResult<()> {
        let restored = self.held.detached(
            py,
            |any| with_any!(any, upsampler => upsampler.restore(data)),
        );
        Ok(restored?.map_err(NativeError)?)
    }

    fn __copy__(&self, py: Python<'_>) -> PyResult<Self> {
        self.copy(py)
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.copy(py)
    }

    fn copy(&self, py: Python<'_>) -> PyResult<Self> {
        Ok(Self {
            held: Held::new(self.contents(py)?),
            ..*self
        })
    }
}
