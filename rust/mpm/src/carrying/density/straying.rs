//! Carried particles that have strayed from the few are led back.
//!
//! The many move as the few around them do, but what they miss of it adds up, and nothing in the motion tells. After some
//! seconds hills of the many would stand where the few lie flat, and gaps would open at walls. Every so often the many
//! therefore slide down the gradient of what their mass exceeds that of the few by, on the grid of the few.

use super::super::block::{Block, Carried, blocks};
use super::super::few::Few;
use super::slide::slide;
use super::tally::{GROUP, ONE, Tally, any};
use crate::grid::{CHUNK, Layout};
use crate::linalg::Vector;
use threads::Team;

/// How far the many slide each time [cells] per full cell in excess and cell. Slow, for the difference of the present is
/// mostly that the few are lumps and the many are not: at four times the rate the error in a splash grows by 2 %, and at
/// this one by nothing.
const RATE: f32 = 0.12;
/// Excess that is left alone [full cells]: lumps of few at rest are within it, and so matter at rest lies still.
const LEFT_ALONE: f32 = 0.1;

/// The difference of the mass of the many to that of the few, on the grid of the few.
#[derive(Debug, Clone)]
pub struct Straying<const D: usize> {
    layout: Layout<D>,
    many: Tally,
    few: Tally,
    /// What of the difference is not left alone [full cells].
    excess: Vec<f32>,
    /// Chunks of it that are not zero.
    dirty: Vec<bool>,
}

impl<const D: usize> Straying<D> {
    pub fn new(layout: Layout<D>, threads: usize) -> Self {
        let count = layout.row_count() * layout.row_length;
        Self {
            many: Tally::new(&layout, threads),
            few: Tally::new(&layout, 1),
            excess: vec![0.0; count],
            dirty: vec![false; count / CHUNK],
            layout,
        }
    }

    /// Leads the many back towards the few.
    ///
    /// `density` is the mean one of the many [kg/m^D]. Bodies of other densities are led faster or more slowly.
    pub fn lead_back(&mut self, many: &mut [Block<D>], few: &Few<'_>, density: f32, team: &Team) {
        let per_mass = 1.0 / (density * self.layout.dx().powi(D as i32));
        let amounts = |block: &Block<D>| block.mass.map(|mass| mass * per_mass);
        self.many.count(&self.layout, many, amounts, team);
        let few = as_blocks(few);
        self.few.count(&self.layout, &few, amounts, team);
        self.compare();
        slide(many, &self.layout, &self.excess, RATE, team);
    }

    fn compare(&mut self) {
        for group in (0..self.dirty.len()).step_by(GROUP) {
            let chunks = group..(group + GROUP).min(self.dirty.len());
            let (many, few) = (&self.many, &self.few);
            let holds_any =
                |chunks: std::ops::Range<usize>| many.any_in(chunks.clone()) || few.any_in(chunks);
            if !any(&self.dirty[chunks.clone()]) && !holds_any(chunks.clone()) {
                continue;
            }
            for chunk in chunks {
                let counted = holds_any(chunk..chunk + 1);
                if !counted && !self.dirty[chunk] {
                    continue;
                }
                self.dirty[chunk] = counted;
                let (many, few) = (many.in_chunk(chunk), few.in_chunk(chunk));
                let excess = &mut self.excess[chunk * CHUNK..(chunk + 1) * CHUNK];
                for k in 0..CHUNK {
                    let difference = (many[k] as f32 - few[k] as f32) / ONE;
                    excess[k] =
                        (difference - LEFT_ALONE).max(0.0) + (difference + LEFT_ALONE).min(0.0);
                }
            }
        }
    }
}

/// The few as if they were carried, with their masses alone.
fn as_blocks<const D: usize>(few: &Few<'_>) -> Vec<Block<D>> {
    let all: Vec<_> = (0..few.ids.len())
        .map(|index| Carried {
            x: Vector::from_column_slice(&few.x[index * D..][..D]),
            v: Vector::zeros(),
            mass: few.mass[index],
            volume: 0.0,
            material: 0,
        })
        .collect();
    blocks(&all)
}
