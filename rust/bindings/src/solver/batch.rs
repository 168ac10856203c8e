//! `advance_all`: independent scenes in parallel.

use std::thread;

use mpm::{Force, MpmError};
use numpy::{IxDyn, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use threads::{Pool, interrupted};

use super::class::PySolver;
use crate::convert::array;
use crate::error::{batch_error, config_error};
use crate::pools::pool;
use crate::signals::interruptible;

/// Each scene on one thread. A solver that stands in the list twice advances twice.
#[pyfunction]
#[pyo3(signature = (solvers, frames=1, force=None, threads=None))]
pub fn advance_all(
    py: Python<'_>,
    solvers: Vec<Bound<'_, PySolver>>,
    frames: usize,
    force: Option<Vec<Option<Bound<'_, PyAny>>>>,
    threads: Option<usize>,
) -> PyResult<()> {
    if threads == Some(0) {
        return Err(config_error("threads must be at least 1, got 0"));
    }
    let arrays = arrays(force, solvers.len())?;
    let mut jobs = Vec::with_capacity(solvers.len());
    for (index, (solver, array)) in solvers.iter().zip(&arrays).enumerate() {
        let solver = solver.get();
        let force = solver.force(py, &format!("force[{index}]"), frames, array.as_ref())?;
        jobs.push(Job {
            index,
            solver,
            force,
            outcome: Ok(Ok(())),
        });
    }
    let available = || thread::available_parallelism().map_or(1, usize::from);
    let threads = threads.unwrap_or_else(available).min(jobs.len());
    // A pool of its own: a shared one would leave a second batch at the same time to a single thread.
    let pool = pool(threads.max(1))?;
    let failures = interruptible(py, || run(jobs, frames, &pool))?;
    if failures.is_empty() {
        return Ok(());
    }
    Err(batch_error(py, failures))
}

/// The forces as arrays, None for scenes without.
fn arrays<'py>(
    forces: Option<Vec<Option<Bound<'py, PyAny>>>>,
    count: usize,
) -> PyResult<Vec<Option<PyReadonlyArrayDyn<'py, f32>>>> {
    let Some(forces) = forces else {
        return Ok((0..count).map(|_| None).collect());
    };
    if forces.len() != count {
        return Err(config_error(format!(
            "force must have one entry a solver, {count}, got {}",
            forces.len()
        )));
    }
    let one = |(index, force): (usize, &Option<Bound<'py, PyAny>>)| {
        let convert = |force| array::<f32, IxDyn>(&format!("force[{index}]"), "float32", force);
        force.as_ref().map(convert).transpose()
    };
    forces.iter().enumerate().map(one).collect()
}

struct Job<'a> {
    index: usize,
    solver: &'a PySolver,
    force: Force<'a>,
    outcome: PyResult<Result<(), MpmError>>,
}

/// Runs all jobs and returns the failures by index.
fn run(mut jobs: Vec<Job<'_>>, frames: usize, pool: &Pool) -> PyResult<Vec<(usize, MpmError)>> {
    // The largest first, so that no thread is left alone with it at the end.
    jobs.sort_by_cached_key(|job| std::cmp::Reverse(job.solver.count().unwrap_or_default()));
    pool.for_each(&mut jobs, |job| {
        if !interrupted() {
            job.outcome = job.solver.run(frames, job.force);
        }
    });
    jobs.sort_by_key(|job| job.index);
    let mut failures = Vec::new();
    for job in jobs {
        if let Err(error) = job.outcome? {
            failures.push((job.index, error));
        }
    }
    Ok(failures)
}
