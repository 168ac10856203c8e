//! The items of several steps, shared out to threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Work on the items `first`, `first + stride` and so on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    pub first: usize,
    pub stride: usize,
}

impl Step {
    pub const ALL: Self = Self {
        first: 0,
        stride: 1,
    };
    pub const EVEN: Self = Self {
        first: 0,
        stride: 2,
    };
    pub const ODD: Self = Self {
        first: 1,
        stride: 2,
    };

    pub fn includes(self, item: usize) -> bool {
        item >= self.first && (item - self.first).is_multiple_of(self.stride)
    }

    /// Number of its items before this one.
    fn count_before(self, item: usize) -> usize {
        item.saturating_sub(self.first).div_ceil(self.stride)
    }
}

/// Most steps of one call.
const MAX_STEPS: usize = 8;

/// Consecutive items that belong to one thread. On cache lines of its own, so that threads that count do not disturb
/// each other.
#[derive(Debug, Default)]
#[repr(align(128))]
pub struct Share {
    first: usize,
    end: usize,
    /// Whether its thread has come.
    pub present: AtomicBool,
    /// Number of items of each step that have been taken.
    taken: [AtomicUsize; MAX_STEPS],
}

/// Number of the last step that an item is through with, from 1 on.
#[derive(Debug, Default)]
#[repr(align(128))]
pub struct Progress(pub AtomicUsize);

/// What threads share out and where they are; kept to reuse its memory.
#[derive(Debug, Default)]
pub struct Shares {
    pub of_threads: Vec<Share>,
    pub progress: Vec<Progress>,
}

impl Shares {
    /// Shares items out anew.
    pub fn prepare(&mut self, costs: &[usize], threads: usize) {
        self.of_threads.clear();
        self.of_threads.resize_with(threads, Share::default);
        share_out(costs, &mut self.of_threads);
        self.progress.clear();
        self.progress.resize_with(costs.len(), Progress::default);
    }
}

/// Cuts consecutive items where the shares have the most equal costs.
fn share_out(costs: &[usize], shares: &mut [Share]) {
    let total: usize = costs.iter().sum();
    let (threads, mut item, mut before) = (shares.len(), 0, 0);
    for (thread, share) in shares.iter_mut().enumerate() {
        share.first = item;
        let wanted = (thread + 1) * total / threads;
        // An item that lies on the cut belongs to where more of it is.
        while item < costs.len() && (before + costs[item] / 2 < wanted || thread + 1 == threads) {
            before += costs[item];
            item += 1;
        }
        share.end = item;
    }
}

impl Share {
    /// Takes a free item of a step; None if there is none, or if its own thread will take the last one.
    pub fn take(&self, number: usize, step: Step, mine: bool) -> Option<usize> {
        let before = step.count_before(self.first);
        let count = step.count_before(self.end) - before;
        let taken = &self.taken[number];
        // Moving the memory of the last item to another core costs more than waiting.
        let left = count.saturating_sub(taken.load(Ordering::Relaxed));
        if !mine && left < 2 && self.present.load(Ordering::Relaxed) {
            return None;
        }
        let index = taken.fetch_add(1, Ordering::Relaxed);
        // The first item comes last: it waits for the last one of another thread.
        let place = before + (index + 1) % count.max(1);
        (index < count).then_some(step.first + place * step.stride)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_have_about_the_same_costs() {
        let ends = |costs: &[usize], threads| {
            let mut shares = Shares::default();
            shares.prepare(costs, threads);
            let ends = shares.of_threads.iter().map(|share| share.end);
            ends.collect::<Vec<_>>()
        };
        assert_eq!(ends(&[1; 8], 2), [4, 8]);
        assert_eq!(ends(&[1; 15], 2), [7, 15]);
        assert_eq!(ends(&[3, 2, 2, 2, 2, 3, 14], 2), [6, 7]);
        assert_eq!(ends(&[14, 1, 1, 1], 2), [1, 4]);
        assert_eq!(ends(&[2, 9, 9, 2, 2, 0], 3), [2, 3, 6]);
        assert_eq!(ends(&[5, 0], 4), [0, 0, 1, 2]);
        assert_eq!(ends(&[0, 0], 2), [0, 2]);
    }
}
