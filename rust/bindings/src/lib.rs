//! `hybridmpm._native`: converts, calls, converts back. No physics here.
#![allow(
    clippy::needless_pass_by_value,
    reason = "pyo3 hands arguments over by value"
)]

mod cancel;
mod convert;
mod error;
mod graph;
mod guidance;
mod neural;
mod pools;
mod scene;
mod signals;
mod solver;

use numpy::{IntoPyArray, Ix1, Ix2, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use convert::{along_axes, array, cells_or_unit, slice_of};
use error::NativeError;

/// Mass of the nodes of a grid over the world, [0, 1]^D without `cells`.
#[pyfunction]
#[pyo3(signature = (x, mass, resolution, cells=None))]
fn grid_mass<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    mass: &Bound<'py, PyAny>,
    resolution: usize,
    cells: Option<Vec<usize>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let x = array::<f32, Ix2>("x", "float32 of shape (N, D)", x)?;
    let mass = array::<f32, Ix1>("mass", "float32 of shape (N,)", mass)?;
    let dim = x.shape()[1];
    let (x, mass) = (slice_of(&x), slice_of(&mass));
    let cells = cells_or_unit(cells, resolution, dim)?;
    let nodes = py
        .detach(|| match dim {
            2 => mpm::grid_mass::<2>(x, mass, resolution, along_axes(&cells)),
            3 => mpm::grid_mass::<3>(x, mass, resolution, along_axes(&cells)),
            _ => Err(mpm::MpmError::parameter(
                "x",
                "of shape (N, 2) or (N, 3)",
                dim,
            )),
        })
        .map_err(NativeError)?;
    nodes
        .into_pyarray(py)
        .reshape(cells.iter().map(|count| count + 1).collect::<Vec<_>>())
}

/// Instruction sets of this processor that matter for speed.
#[pyfunction]
fn cpu_features() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let features = vec![
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(target_arch = "aarch64")]
    let features = vec![("neon", std::arch::is_aarch64_feature_detected!("neon"))];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let features: Vec<(&'static str, bool)> = Vec::new();
    features
        .into_iter()
        .filter(|(_, present)| *present)
        .map(|(name, _)| name)
        .collect()
}

/// Lets solvers use no wider vector instructions from now on.
#[pyfunction]
fn limit_instructions(widest: &str) -> Result<&'static str, NativeError> {
    let mut sets = mpm::Instructions::ALL.into_iter();
    let Some(set) = sets.find(|&set| name_of(set) == widest) else {
        let allowed = "portable, avx2 or avx512";
        return Err(NativeError(mpm::MpmError::parameter(
            "widest", allowed, widest,
        )));
    };
    set.limit();
    Ok(name_of(mpm::Instructions::in_use()))
}

fn name_of(set: mpm::Instructions) -> &'static str {
    match set {
        mpm::Instructions::Portable => "portable",
        mpm::Instructions::Avx2 => "avx2",
        mpm::Instructions::Avx512 => "avx512",
    }
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("SOLVER_VERSION", mpm::SOLVER_VERSION)?;
    module.add("MAX_SUBSTEPS", mpm::MAX_SUBSTEPS)?;
    module.add("SNAPSHOT_VERSION", mpm::SNAPSHOT_VERSION)?;
    module.add("UPSAMPLER_VERSION", mpm::UPSAMPLER_VERSION)?;
    module.add("SHORTEST_FRAMES", ::guidance::SHORTEST_FRAMES)?;
    module.add("SEAMS_IN_3D", ::guidance::SEAMS[3])?;
    error::register(module)?;
    module.add_class::<scene::PyMaterial>()?;
    module.add_class::<scene::PyObstacle>()?;
    module.add_class::<scene::PyRigidBody>()?;
    module.add_class::<scene::PyEmitter>()?;
    module.add_class::<solver::PyDiagnostics>()?;
    module.add_class::<solver::PyFrameReport>()?;
    module.add_class::<solver::PyMotionReport>()?;
    module.add_class::<neural::PyAccelerationHistory>()?;
    module.add_class::<neural::PyAccelerationSignal>()?;
    module.add_class::<cancel::PyCancelFlag>()?;
    module.add_class::<solver::PySolver>()?;
    module.add_class::<solver::PyUpsampler>()?;
    module.add_class::<graph::PyRadiusGraph>()?;
    module.add_class::<guidance::PyFreeSpace>()?;
    module.add_class::<guidance::PyMatching>()?;
    module.add_class::<guidance::PyOutlines>()?;
    module.add_class::<guidance::PyTiming>()?;
    module.add_class::<guidance::PyWays>()?;
    module.add_function(wrap_pyfunction!(solver::advance_all, module)?)?;
    module.add_function(wrap_pyfunction!(solver::cfl_substeps, module)?)?;
    module.add_function(wrap_pyfunction!(cancel::raise_if_cancelled, module)?)?;
    module.add_function(wrap_pyfunction!(signals::after_signals, module)?)?;
    module.add_function(wrap_pyfunction!(grid_mass, module)?)?;
    module.add_function(wrap_pyfunction!(graph::py_radius_graph, module)?)?;
    module.add_function(wrap_pyfunction!(guidance::filled_solid, module)?)?;
    module.add_function(wrap_pyfunction!(guidance::match_to_region, module)?)?;
    module.add_function(wrap_pyfunction!(guidance::pressed, module)?)?;
    module.add_function(wrap_pyfunction!(guidance::least_acceleration, module)?)?;
    module.add_function(wrap_pyfunction!(guidance::push_force, module)?)?;
    module.add_function(wrap_pyfunction!(neural::answer_weights, module)?)?;
    module.add_function(wrap_pyfunction!(limit_instructions, module)?)?;
    module.add_function(wrap_pyfunction!(cpu_features, module)?)
}
