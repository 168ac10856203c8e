//! Carried particles that have become too dense part.
//!
//! The motion of few particles brings many together: it has no divergence that the few can see, but between them it
//! has. At a carry, particles therefore slide down the gradient of what the density on the scene's grid exceeds rest
//! by. The few may bring many together faster than these slide apart in one pass, so passes are repeated while too much
//! of the matter is crowded.

use super::super::block::Block;
use super::slide::slide;
use super::tally::{GROUP, ONE, Tally, any};
use crate::boundary::{Obstacles, WallFill, Walls};
use crate::grid::{CHUNK, Layout};
use threads::Team;

/// Nodes with less room [-] between walls and outside of obstacles count as if they had this.
const LEAST_ROOM: f32 = 0.25;

/// A node is crowded where its density exceeds rest by more than this [-].
///
/// This density is that of all its volume, room or not: near walls and obstacles it is below the density that particles
/// part by, and as `metrics` and pictures show it. Passes for what nobody sees would be most of them in 3D.
const CROWDED: f32 = 0.3;
/// Another pass follows one that found more than one part in so many of the matter on crowded nodes.
const CROWDED_PART: u64 = 100;

/// Counts, summed over nodes.
#[derive(Debug, Clone, Copy, Default)]
struct Matter {
    all: u64,
    /// On crowded nodes.
    crowded: u64,
}

/// The density of carried particles on the scene's grid.
#[derive(Debug, Clone)]
pub struct Crowding<const D: usize> {
    pub layout: Layout<D>,
    /// How far particles slide [cells] per density in excess and cell.
    rate: f32,
    /// One over the part of each node's spline that may be full, over `ONE`.
    weight: Vec<f32>,
    tally: Tally,
    /// What the density on the nodes exceeds rest by [-].
    excess: Vec<f32>,
    /// Chunks of it that are not zero.
    dirty: Vec<bool>,
}

impl<const D: usize> Crowding<D> {
    /// `rate` is how far particles slide [cells] per density in excess and cell; `resting` are the obstacles that
    /// never move.
    pub fn new(
        layout: Layout<D>,
        rate: f32,
        walls: &Walls<D>,
        resting: &Obstacles<D>,
        threads: usize,
    ) -> Self {
        let count = layout.row_count() * layout.row_length;
        let fill = WallFill::new(walls, &layout);
        let mut weight = vec![0.0; count];
        for (row, weights) in weight.chunks_mut(layout.row_length).enumerate() {
            let mut node = layout.row_coordinates(row);
            for (column, weight) in weights.iter_mut().enumerate().take(layout.extent) {
                node[D - 1] = column;
                let taken = if resting.any() {
                    resting.fill(node)
                } else {
                    0.0
                };
                *weight = 1.0 / (fill.at_node(node) - taken).max(LEAST_ROOM) / ONE;
            }
        }
        Self {
            tally: Tally::new(&layout, threads),
            layout,
            rate,
            weight,
            excess: vec![0.0; count],
            dirty: vec![false; count / CHUNK],
        }
    }

    /// Moves all particles from where they are too dense to where they are less so, in one pass; returns whether there
    /// was so much matter on crowded nodes that another should follow.
    pub fn relax(&mut self, blocks: &mut [Block<D>], team: &Team) -> bool {
        self.tally
            .count(&self.layout, blocks, |block| block.volume, team);
        let matter = self.compare(team);
        slide(blocks, &self.layout, &self.excess, self.rate, team);
        matter.crowded * CROWDED_PART > matter.all
    }

    /// From counts to what they exceed rest by; returns how much matter was counted.
    fn compare(&mut self, team: &Team) -> Matter {
        let tally = &self.tally;
        let share = self.dirty.len().div_ceil(4 * team.size()).max(1);
        let parts = self.dirty.chunks_mut(share);
        let parts = parts.zip(self.excess.chunks_mut(share * CHUNK));
        let parts = parts.zip(self.weight.chunks(share * CHUNK));
        let parts = parts.map(|part| (part, Matter::default()));
        let mut parts: Vec<_> = parts.enumerate().collect();
        team.for_each(&mut parts, |(part, (((dirty, excess), weight), matter))| {
            let first = *part * share;
            for group in (0..dirty.len()).step_by(GROUP) {
                let chunks = group..(group + GROUP).min(dirty.len());
                let counted = first + chunks.start..first + chunks.end;
                if !any(&dirty[chunks.clone()]) && !tally.any_in(counted) {
                    continue;
                }
                for chunk in chunks {
                    let counted = tally.any_in(first + chunk..first + chunk + 1);
                    if !counted && !dirty[chunk] {
                        continue;
                    }
                    dirty[chunk] = counted;
                    let nodes = chunk * CHUNK..(chunk + 1) * CHUNK;
                    let sums = tally.in_chunk(first + chunk);
                    let (excess, weight) = (&mut excess[nodes.clone()], &weight[nodes]);
                    let crowded = (1.0 + CROWDED) * ONE;
                    for k in 0..CHUNK {
                        excess[k] = (sums[k] as f32 * weight[k] - 1.0).max(0.0);
                    }
                    for k in 0..CHUNK {
                        matter.all += u64::from(sums[k]);
                        matter.crowded +=
                            u64::from(if sums[k] as f32 > crowded { sums[k] } else { 0 });
                    }
                }
            }
        });
        let mut total = Matter::default();
        for (_, (_, matter)) in &parts {
            total.all += matter.all;
            total.crowded += matter.crowded;
        }
        total
    }
}
