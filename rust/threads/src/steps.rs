//! Items that threads share, in one step or in several that follow each other item by item.

use std::hint::spin_loop;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};

use crate::shares::{Progress, Shares, Step};
use crate::team::Team;

impl Team {
    /// Calls `work` on each item, on all free threads.
    pub fn for_each<T: Send>(&self, items: &mut [T], work: impl Fn(&mut T) + Sync) {
        // Uncontended: each item is locked by the one thread that took its number.
        let items: Vec<Mutex<&mut T>> = items.iter_mut().map(Mutex::new).collect();
        self.in_steps(&vec![1; items.len()], &[Step::ALL], |_, item| {
            work(&mut items[item].lock().unwrap_or_else(PoisonError::into_inner));
        });
    }

    /// Calls `work` with the number of each of up to eight steps and of each of its items, on all free threads. `costs` has
    /// the cost of each item beside that of others.
    ///
    /// An item starts a step when it and its two neighbours have finished all earlier steps; items further away may be
    /// steps ahead or behind. A thread works on consecutive items of about its part of all costs, the same in each step and
    /// each call, so that their memory is still in its cache. Then it helps threads with more items left.
    ///
    /// # Panics
    /// Panics if `work` does.
    pub fn in_steps(&self, costs: &[usize], steps: &[Step], work: impl Fn(usize, usize) + Sync) {
        let count = costs.len();
        let items = |step: &Step| (step.first..count).step_by(step.stride);
        let Some(mut shares) = self.try_begin().filter(|_| count > 1 && self.size() > 1) else {
            for (number, step) in steps.iter().enumerate() {
                items(step).for_each(|item| work(number, item));
            }
            return;
        };
        shares.prepare(costs, self.size());
        let Shares {
            of_threads,
            progress,
        } = &*shares;
        self.run(&|thread| {
            of_threads[thread].present.store(true, Ordering::Relaxed);
            for (number, step) in steps.iter().enumerate() {
                for owner in (thread..of_threads.len()).chain(0..thread) {
                    while let Some(item) = of_threads[owner].take(number, *step, owner == thread) {
                        wait_for_neighbours(progress, &steps[..number], item);
                        let _through = Through(&progress[item], number + 1);
                        work(number, item);
                    }
                }
            }
        });
    }
}

/// Waits until an item and its neighbours have finished the steps before.
///
/// The thread that has taken one of them works on it or waits for a still earlier step, so that one thread always
/// proceeds.
fn wait_for_neighbours(progress: &[Progress], before: &[Step], item: usize) {
    let around = item.saturating_sub(1)..(item + 2).min(progress.len());
    for neighbour in around {
        let last = before.iter().rposition(|step| step.includes(neighbour));
        let needed = last.map_or(0, |number| number + 1);
        let mut spins = 0u32;
        while progress[neighbour].0.load(Ordering::Acquire) < needed {
            // Its thread may have lost its core to another process.
            spins += 1;
            if spins.is_multiple_of(4096) {
                std::thread::yield_now();
            }
            spin_loop();
        }
    }
}

/// Marks a step of an item as done when dropped, also by a panic: else others would wait for ever.
struct Through<'a>(&'a Progress, usize);

impl Drop for Through<'_> {
    fn drop(&mut self) {
        self.0.0.store(self.1, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn no_item_is_ahead_of_its_neighbours() {
        let steps = [Step::EVEN, Step::ODD, Step::ALL, Step::ALL];
        for (threads, count) in [(1, 5), (2, 1), (2, 2), (2, 16), (3, 7), (4, 16), (4, 3)] {
            let team = Team::new(threads).unwrap();
            for round in 0..300 {
                let costs: Vec<_> = (0..count).map(|item| item * round % 7).collect();
                // The steps that each item has been through, one bit each.
                let through: Vec<_> = (0..count).map(|_| AtomicUsize::new(0)).collect();
                team.in_steps(&costs, &steps, |number, item| {
                    let around = item.saturating_sub(1)..(item + 2).min(count);
                    for neighbour in around {
                        let expected = (0..number).filter(|&step| steps[step].includes(neighbour));
                        let expected = expected.fold(0, |bits, step| bits | 1 << step);
                        let bits = through[neighbour].load(Ordering::Relaxed);
                        assert_eq!(bits & expected, expected, "{item} in step {number}");
                    }
                    let bits = through[item].fetch_or(1 << number, Ordering::Relaxed);
                    assert_eq!(bits & 1 << number, 0, "twice");
                });
                for (item, bits) in through.iter().enumerate() {
                    let first = if item.is_multiple_of(2) { 1 } else { 2 };
                    assert_eq!(bits.load(Ordering::Relaxed), 0b1100 | first);
                }
            }
        }
    }

    #[test]
    fn a_panic_in_a_step_keeps_nobody_waiting() {
        let team = Team::new(2).unwrap();
        let attempt = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            team.in_steps(&[1; 8], &[Step::ALL, Step::ALL], |number, item| {
                assert!(number == 1 || item != 5, "on purpose");
            });
        }));
        assert!(attempt.is_err());
    }
}
