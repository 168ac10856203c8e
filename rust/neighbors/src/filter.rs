//! Selection of edges among the points near one.

use crate::scan::{Found, Reach};

/// Selects edges among the results of a scan.
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

/// Moves the entries to keep to the front, in order, and returns their number.
fn retain(row: &mut [u32], keep: impl Fn(usize) -> bool) -> usize {
    let mut count = 0;
    for index in 0..row.len() {
        let entry = row[index];
        row[count] = entry;
        count += usize::from(keep(entry as usize));
    }
    count
}
