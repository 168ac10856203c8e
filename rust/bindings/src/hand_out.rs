//! `hand_out_times`: what it costs to share short work between threads, by our team and by rayon.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

use pyo3::prelude::*;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use threads::{Pool, Team};

use crate::error::config_error;
use crate::pools;

/// Calls that are timed together.
const CALLS: usize = 200;
/// Items for each thread, as a stage of a substep has them.
const ITEMS: usize = 4;

/// Mean seconds of a call, the lower quartile over the repetitions, for each way to share its work.
#[pyfunction]
#[pyo3(signature = (*, threads=2, work=20e-6, pause=0.0, repeats=40))]
pub fn hand_out_times(
    py: Python<'_>,
    threads: usize,
    work: f64,
    pause: f64,
    repeats: usize,
) -> PyResult<BTreeMap<&'static str, f64>> {
    if threads < 2 || repeats == 0 {
        return Err(config_error(format!(
            "threads must be at least 2 and repeats at least 1, got {threads} and {repeats}"
        )));
    }
    if !(0.0..=1e-3).contains(&work) || !(0.0..=1e-3).contains(&pause) {
        return Err(config_error(format!(
            "work and pause must be in [0, 1e-3] s, got {work} and {pause}"
        )));
    }
    let refused = |error: String| config_error(format!("threads must be granted: {error}"));
    let ways = Ways {
        team: Team::new(threads).map_err(|error| refused(error.to_string()))?,
        rayon: (ThreadPoolBuilder::new().num_threads(threads).build())
            .map_err(|error| refused(error.to_string()))?,
        pool: pools::pool(threads)?,
    };
    Ok(py.detach(|| ways.times(threads, work, pause, repeats)))
}

struct Ways {
    team: Team,
    rayon: ThreadPool,
    pool: Pool,
}

/// What each call does: turns on the calling thread, then turns for each of some items.
#[derive(Clone, Copy)]
struct Load {
    pause: u32,
    item: u32,
}

impl Ways {
    fn times(
        &self,
        threads: usize,
        work: f64,
        pause: f64,
        repeats: usize,
    ) -> BTreeMap<&'static str, f64> {
        let per_second = turns_per_second();
        let load = Load {
            pause: (pause * per_second) as u32,
            item: (work * per_second / ITEMS as f64) as u32,
        };
        let mut items = vec![0.0f32; ITEMS * threads];
        let mut found: BTreeMap<_, Vec<f64>> = BTreeMap::new();
        // By turns, so that what disturbs the machine disturbs all.
        for _ in 0..repeats {
            let items = items.as_mut_slice();
            let times = [
                (
                    "alone",
                    load.timed(|| items.iter_mut().for_each(|item| load.work(item))),
                ),
                (
                    "team",
                    load.timed(|| self.team.for_each(items, |item| load.work(item))),
                ),
                (
                    "pool",
                    load.timed(|| self.pool.for_each(items, |item| load.work(item))),
                ),
                ("rayon", self.within_rayon(load, items)),
            ];
            for (way, seconds) in times {
                found.entry(way).or_default().push(seconds);
            }
        }
        let quartile = |mut seconds: Vec<f64>| {
            seconds.sort_by(f64::total_cmp);
            seconds[seconds.len() / 4]
        };
        found
            .into_iter()
            .map(|(way, seconds)| (way, quartile(seconds)))
            .collect()
    }

    /// All calls within one job of the pool, as a whole frame would be: cheaper than to enter it for each.
    fn within_rayon(&self, load: Load, items: &mut [f32]) -> f64 {
        self.rayon.install(|| {
            load.timed(|| {
                let shared = items.par_iter_mut().with_max_len(1);
                shared.for_each(|item| load.work(item));
            })
        })
    }
}

impl Load {
    /// Mean seconds of a call with what the calling thread does before it.
    fn timed(self, mut call: impl FnMut()) -> f64 {
        let start = Instant::now();
        for _ in 0..CALLS {
            black_box(turns(self.pause));
            call();
        }
        start.elapsed().as_secs_f64() / CALLS as f64
    }

    fn work(self, item: &mut f32) {
        *item = turns(self.item);
    }
}

/// Arithmetic that takes a time in proportion to `count`.
fn turns(count: u32) -> f32 {
    (0..count).fold(1.0, |x, _| black_box(x * 1.000_001 + 1.0e-9))
}

fn turns_per_second() -> f64 {
    const TURNS: u32 = 100_000;
    let seconds = (0..20).map(|_| {
        let start = Instant::now();
        black_box(turns(TURNS));
        start.elapsed().as_secs_f64()
    });
    f64::from(TURNS) / seconds.fold(f64::INFINITY, f64::min)
}
