//! Deposit of particle volumes or masses on the nodes of a grid, in fixed point.
//!
//! Sums of integers do not depend on their order, so that particles need not be sorted, nor nodes divided among threads,
//! for equal bits.

use super::super::block::Block;
use crate::grid::{CHUNK, Layout, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide};
use threads::Team;

/// Count of one full cell. A node overflows beyond 65 535 cells.
pub const ONE: f32 = 65_536.0;

/// Chunks whose flags are tested together, since most chunks of a grid are clean.
pub const GROUP: usize = 64;

/// Counts of one thread.
#[derive(Debug, Clone)]
struct Counts {
    nodes: Vec<u32>,
    /// Chunks of nodes that are not zero.
    dirty: Vec<bool>,
}

/// Amounts on the nodes of a grid.
#[derive(Debug, Clone)]
pub struct Deposit {
    /// One for each thread.
    counts: Vec<Counts>,
}

impl Deposit {
    pub fn new<const D: usize>(layout: &Layout<D>, threads: usize) -> Self {
        let count = layout.row_count() * layout.row_length;
        let counts = Counts {
            nodes: vec![0; count],
            dirty: vec![false; count / CHUNK],
        };
        Self {
            counts: vec![counts; threads],
        }
    }

    /// Deposits `amounts` of the particles of each block [full cells] in place of earlier ones.
    pub fn count<const D: usize>(
        &mut self,
        layout: &Layout<D>,
        blocks: &[Block<D>],
        amounts: impl Fn(&Block<D>) -> Lanes + Sync + Copy,
        team: &Team,
    ) {
        let share = blocks.len().div_ceil(self.counts.len()).max(1);
        let mut shares = blocks.chunks(share);
        let mut parts: Vec<_> = self
            .counts
            .iter_mut()
            .map(|counts| (counts, shares.next().unwrap_or_default()))
            .collect();
        team.for_each(&mut parts, |(counts, blocks)| {
            counts.clear();
            run_wide(Count {
                blocks,
                amounts,
                layout,
                counts,
            });
        });
    }

    /// Whether any amount is in a range of chunks.
    #[inline(always)]
    pub fn any_in(&self, chunks: std::ops::Range<usize>) -> bool {
        let mut counts = self.counts.iter();
        counts.any(|counts| any(&counts.dirty[chunks.clone()]))
    }

    /// Sums of a chunk of nodes.
    #[inline(always)]
    pub fn in_chunk(&self, chunk: usize) -> [u32; CHUNK] {
        let mut sums = [0u32; CHUNK];
        for counts in &self.counts {
            let of_thread = &counts.nodes[chunk * CHUNK..(chunk + 1) * CHUNK];
            for k in 0..CHUNK {
                sums[k] = sums[k].wrapping_add(of_thread[k]);
            }
        }
        sums
    }
}

impl Counts {
    fn clear(&mut self) {
        for (group, flags) in self.dirty.chunks_mut(GROUP).enumerate() {
            if !any(flags) {
                continue;
            }
            for (k, dirty) in flags.iter_mut().enumerate() {
                if std::mem::take(dirty) {
                    let chunk = group * GROUP + k;
                    self.nodes[chunk * CHUNK..(chunk + 1) * CHUNK].fill(0);
                }
            }
        }
    }
}

/// Whether a flag is set; without an early exit, so that the loop is vectorised.
pub fn any(flags: &[bool]) -> bool {
    flags.iter().fold(false, |found, &flag| found | flag)
}

/// Adds the amounts of particles to the nodes.
struct Count<'a, F, const D: usize> {
    blocks: &'a [Block<D>],
    amounts: F,
    layout: &'a Layout<D>,
    counts: &'a mut Counts,
}

impl<F: Fn(&Block<D>) -> Lanes, const D: usize> Kernel for Count<'_, F, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        // Adding 1.5 * 2^23 rounds to an integer and leaves it in the low bits.
        const SHIFT: f32 = 12_582_912.0;
        let (nodes, dirty) = (&mut self.counts.nodes[..], &mut self.counts.dirty[..]);
        let rows: [[usize; 3]; 3] =
            std::array::from_fn(|a| std::array::from_fn(|b| self.layout.stencil_row([a, b])));
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, self.layout);
            let amount = (self.amounts)(block).map(|amount| amount * ONE);
            for i in 0..LANES {
                if amount[i] == 0.0 {
                    break;
                }
                let start = stencils.start[i] as usize;
                let last = &stencils.weights[D - 1];
                let last = [last[0][i], last[1][i], last[2][i], 0.0];
                for a in 0..3 {
                    for b in 0..if D == 3 { 3 } else { 1 } {
                        let across = if D == 3 {
                            stencils.weights[1][b][i]
                        } else {
                            1.0
                        };
                        let share = amount[i] * stencils.weights[0][a][i] * across;
                        let begin = start + rows[a][b];
                        let row: &mut [u32; 4] = (&mut nodes[begin..begin + 4])
                            .try_into()
                            .expect("four nodes");
                        for k in 0..4 {
                            let count = (last[k] * share + SHIFT).to_bits();
                            row[k] = row[k].wrapping_add(count.wrapping_sub(SHIFT.to_bits()));
                        }
                        dirty[begin / CHUNK] = true;
                        dirty[(begin + 2) / CHUNK] = true;
                    }
                }
            }
        }
    }
}
