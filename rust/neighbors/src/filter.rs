//! Which of the points near one become edges.

use crate::scan::{Found, Reach};

/// What becomes an edge of what a scan found.
pub(crate) struct Filter<'a, const D: usize> {
    pub points: &'a [f32],
    pub fixed: Option<&'a [bool]>,
    pub reach: Reach,
}

impl<const D: usize> Filter<'_, D> {
    /// Moves the edges of a row to its front, in order, and returns their number.
    pub fn keep(&self, own: usize, found: Found, row: &mut [u32]) -> usize {
        let mut count = found.count;
        if found.doubtful {
            let x = &self.points[own * D..][..D];
            let joined = |other: usize| self.reach.joins(x, &self.points[other * D..][..D]);
            count = retain(&mut row[..count], joined);
        }
        match self.fixed {
            Some(fixed) if fixed[own] => {
                retain(&mut row[..count], |other| !fixed[other] || other == own)
            }
            _ => count,
        }
    }
}

/// Moves what is to be kept to the front, in order, and returns how many these are.
fn retain(row: &mut [u32], keep: impl Fn(usize) -> bool) -> usize {
    let mut count = 0;
    for index in 0..row.len() {
        let entry = row[index];
        row[count] = entry;
        count += usize::from(keep(entry as usize));
    }
    count
}
