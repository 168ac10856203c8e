//! Threads of rayon for coarse work.

use std::mem::ManuallyDrop;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, TryLockError};
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::ThreadError;
use crate::watch::{interrupted, is_watched, watched};

/// Time from one look of a watched caller at its watch to the next.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Threads of rayon that work while their caller waits.
///
/// A forked process has no threads but the one that forked: there a pool of the parent leaves all work to its caller.
#[derive(Debug)]
pub struct Pool {
    /// None where the caller works alone.
    workers: Option<ManuallyDrop<ThreadPool>>,
    threads: usize,
    /// The process that the workers live in.
    process: u32,
    /// Held while work is handed out; a second caller then works alone instead of waiting for the first.
    caller: Mutex<()>,
}

impl Pool {
    /// Number of threads, at least 1; a single one is the caller's own.
    pub fn new(threads: usize) -> Result<Self, ThreadError> {
        let start = || {
            let builder = ThreadPoolBuilder::new().num_threads(threads);
            let named = builder.thread_name(|index| format!("pool-{index}"));
            named.build().map(ManuallyDrop::new)
        };
        let workers = (threads > 1).then(start).transpose();
        Ok(Self {
            workers: workers.map_err(|error| ThreadError {
                threads,
                source: std::io::Error::other(error),
            })?,
            threads,
            process: process::id(),
            caller: Mutex::new(()),
        })
    }

    /// Threads that work at a time.
    pub fn size(&self) -> usize {
        self.threads
    }

    /// Whether the workers live in this process, which is not so after a fork.
    pub fn is_ours(&self) -> bool {
        self.process == process::id()
    }

    /// Calls `work` on each item, on all free threads; items start in their order.
    ///
    /// # Panics
    /// Where `work` does, once all threads are done.
    pub fn for_each<T: Send>(&self, items: &mut [T], work: impl Fn(&mut T) + Sync) {
        let caller = match self.caller.try_lock() {
            Ok(caller) => Some(caller),
            // The lock guards no data that a panic could have left half done.
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        };
        let workers = self.workers.as_ref().filter(|_| items.len() > 1);
        let (Some(workers), Some(_caller), true) = (workers, caller, self.is_ours()) else {
            items.iter_mut().for_each(work);
            return;
        };
        let work = &work;
        if !is_watched() {
            workers.scope_fifo(|scope| {
                for item in items {
                    scope.spawn_fifo(move |_| work(item));
                }
            });
            return;
        }
        // The workers' watch is a flag that the caller, who only waits, sets.
        let (stop, left) = (Arc::new(AtomicBool::new(false)), Left::new(items.len()));
        workers.in_place_scope_fifo(|scope| {
            for item in items {
                let (stop, left) = (Arc::clone(&stop), &left);
                scope.spawn_fifo(move |_| {
                    let _done = Done(left);
                    watched(move || stop.load(Ordering::Relaxed), || work(item));
                });
            }
            while !left.wait() {
                if interrupted() {
                    stop.store(true, Ordering::Relaxed);
                }
            }
        });
    }
}

/// Number of items that are not done yet.
struct Left {
    count: AtomicUsize,
    lock: Mutex<()>,
    none: Condvar,
}

impl Left {
    fn new(count: usize) -> Self {
        Self {
            count: AtomicUsize::new(count),
            lock: Mutex::new(()),
            none: Condvar::new(),
        }
    }

    /// Waits for a while; whether all are done.
    fn wait(&self) -> bool {
        let lock = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        let is_left = |(): &mut ()| self.count.load(Ordering::Acquire) > 0;
        let waited = self.none.wait_timeout_while(lock, LOOK_EVERY, is_left);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }
}

/// Counts an item as done when dropped, also by a panic.
struct Done<'a>(&'a Left);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        if self.0.count.fetch_sub(1, Ordering::AcqRel) == 1 {
            drop(self.0.lock.lock().unwrap_or_else(PoisonError::into_inner));
            self.0.none.notify_all();
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        if self.is_ours()
            && let Some(workers) = self.workers.take()
        {
            drop(ManuallyDrop::into_inner(workers));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;

    #[test]
    fn every_item_is_worked_on_once_whoever_calls() {
        let pool = Pool::new(3).unwrap();
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    for round in 0..500 {
                        let mut items: Vec<usize> = (0..round % 37).collect();
                        pool.for_each(&mut items, |item| *item = *item * 2 + 1);
                        assert!(items.iter().enumerate().all(|(i, &item)| item == 2 * i + 1));
                    }
                });
            }
        });
    }

    #[test]
    fn items_are_begun_in_order_by_several_threads() {
        let pool = Pool::new(2).unwrap();
        let begun = AtomicUsize::new(0);
        let mut items = [(0, None); 16];
        pool.for_each(&mut items, |(turn, thread)| {
            *turn = begun.fetch_add(1, Ordering::Relaxed);
            *thread = Some(std::thread::current().id());
            std::thread::sleep(Duration::from_millis(10));
        });
        // Two threads may overtake each other between taking an item and counting it.
        assert!((0..16).all(|place| items[place].0.abs_diff(place) <= 1));
        assert!(items.iter().any(|(_, thread)| *thread != items[0].1));
    }

    #[test]
    fn a_watch_of_the_caller_reaches_all_workers() {
        let pool = Pool::new(2).unwrap();
        let mut items = [false; 8];
        watched(
            || true,
            || {
                pool.for_each(&mut items, |item| {
                    while !interrupted() {
                        std::thread::yield_now();
                    }
                    *item = true;
                });
            },
        );
        assert_eq!(items, [true; 8]);
    }

    #[test]
    fn a_panic_reaches_the_caller_and_the_pool_goes_on() {
        let pool = Pool::new(2).unwrap();
        let attempt = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            pool.for_each(&mut [0; 64], |_| panic!("on purpose"));
        }));
        assert!(attempt.is_err());
        let mut items = [0; 64];
        pool.for_each(&mut items, |item| *item = 1);
        assert_eq!(items, [1; 64]);
    }
}
