//! Density relaxation of shown particles.
//!
//! Interpolated motion compresses shown particles: it is free of divergence on the coarse grid, not on the scene's. In an
//! update, shown particles are therefore moved down the gradient of the excess density on the scene's grid. One pass may
//! not undo the compression, so passes are repeated while too much of the mass is on dense nodes.

use super::super::block::Block;
use super::deposit::{Deposit, GROUP, ONE, any};
use super::descent::descend;
use crate::boundary::{Obstacles, WallFill, Walls};
use crate::grid::{CHUNK, Layout};
use threads::Team;

/// Least part of a node's spline [-] that counts as free of walls and obstacles.
const MIN_ROOM: f32 = 0.25;

/// Excess density [-] above which a node is dense.
///
/// This density refers to the whole volume of a node, including walls and obstacles, as `metrics` and pictures show it.
/// The density of the relaxation refers to the free part; by that measure most passes in 3D would correct invisible
/// differences near walls.
const DENSE: f32 = 0.3;
/// Inverse of the part of the mass on dense nodes above which another pass follows.
const DENSE_PART: u64 = 100;

/// Counts, summed over nodes.
#[derive(Debug, Clone, Copy, Default)]
struct Matter {
    all: u64,
    /// On dense nodes.
    dense: u64,
}

/// Density of shown particles on the scene's grid.
#[derive(Debug, Clone)]
pub struct Relaxation<const D: usize> {
    pub layout: Layout<D>,
    /// Displacement [cells] per excess density and cell.
    rate: f32,
    /// Inverse of the free part of each node's spline, over `ONE`.
    weight: Vec<f32>,
    deposit: Deposit,
    /// Excess density on the nodes [-].
    excess: Vec<f32>,
    /// Chunks of it that are not zero.
    dirty: Vec<bool>,
}

impl<const D: usize> Relaxation<D> {
    /// `rate` is the displacement [cells] per excess density and cell; `resting` are the obstacles that never move.
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
            for (column, weight) in weights.iter_mut().enumerate().take(layout.columns()) {
                node[D - 1] = column;
                let taken = if resting.any() {
                    resting.fill(node)
                } else {
                    0.0
                };
                *weight = 1.0 / (fill.at_node(node) - taken).max(MIN_ROOM) / ONE;
            }
        }
        Self {
            deposit: Deposit::new(&layout, threads),
            layout,
            rate,
            weight,
            excess: vec![0.0; count],
            dirty: vec![false; count / CHUNK],
        }
    }

    /// Moves particles down the gradient of the excess density, in one pass; returns whether so much mass was on dense
    /// nodes that another pass should follow.
    pub fn relax(&mut self, blocks: &mut [Block<D>], team: &Team) -> bool {
        self.deposit
            .count(&self.layout, blocks, |block| block.volume, team);
        let matter = self.compare(team);
        descend(blocks, &self.layout, &self.excess, self.rate, team);
        matter.dense * DENSE_PART > matter.all
    }

    /// Computes excess densities from counts; returns the sums of counts.
    fn compare(&mut self, team: &Team) -> Matter {
        let deposit = &self.deposit;
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
                if !any(&dirty[chunks.clone()]) && !deposit.any_in(counted) {
                    continue;
                }
                for chunk in chunks {
                    let counted = deposit.any_in(first + chunk..first + chunk + 1);
                    if !counted && !dirty[chunk] {
                        continue;
                    }
                    dirty[chunk] = counted;
                    let nodes = chunk * CHUNK..(chunk + 1) * CHUNK;
                    let sums = deposit.in_chunk(first + chunk);
                    let (excess, weight) = (&mut excess[nodes.clone()], &weight[nodes]);
                    let dense = (1.0 + DENSE) * ONE;
                    for k in 0..CHUNK {
                        excess[k] = (sums[k] as f32 * weight[k] - 1.0).max(0.0);
                    }
                    for k in 0..CHUNK {
                        matter.all += u64::from(sums[k]);
                        matter.dense += u64::from(if sums[k] as f32 > dense { sums[k] } else { 0 });
                    }
                }
            }
        });
        let mut total = Matter::default();
        for (_, (_, matter)) in &parts {
            total.all += matter.all;
            total.dense += matter.dense;
        }
        total
    }
}
