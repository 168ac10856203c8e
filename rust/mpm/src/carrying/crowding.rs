//! Carried particles that have become too dense part.
//!
//! The motion of few particles brings many together: it has no divergence that the few can see, but between them it
//! has. At a carry, particles therefore slide down the gradient of what the density on the scene's grid exceeds rest
//! by. The few may bring many together faster than these slide apart in one pass, so passes are repeated while too much
//! of the matter is crowded. The density is counted in integers, whose sums do not depend on their order, so neither
//! particles have to be sorted nor nodes to be shared out among threads.

use wide::f32x4;

use super::block::Block;
use crate::boundary::{Obstacles, WallFill, Walls};
use crate::grid::{CHUNK, Layout, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide};
use threads::Team;

/// Particles slide at most so far [cells].
const FARTHEST: f32 = 0.25;
/// Counts of one cell's volume. A node holds 65 535 cells' volumes before it overflows.
const ONE: f32 = 65_536.0;
/// Nodes with less room [-] between walls and outside of obstacles count as if they had this.
const LEAST_ROOM: f32 = 0.25;

/// A node is crowded where its density exceeds rest by more than this [-].
///
/// This density is that of all its volume, room or not: near walls and obstacles it is below the density that particles
/// part by, and as `metrics` and pictures show it. Passes for what nobody sees would be most of them in 3D.
const CROWDED: f32 = 0.3;
/// Another pass follows one that found more than one part in so many of the matter on crowded nodes.
const CROWDED_PART: u64 = 100;

/// Chunks whose flags are looked at together: of all chunks of a grid few are dirty.
const GROUP: usize = 64;

/// Counts of one thread.
#[derive(Debug, Clone)]
struct Counts {
    nodes: Vec<u32>,
    /// Chunks of nodes that are not zero.
    dirty: Vec<bool>,
}

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
    /// One for each thread.
    counts: Vec<Counts>,
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
        let counts = Counts {
            nodes: vec![0; count],
            dirty: vec![false; count / CHUNK],
        };
        Self {
            layout,
            rate,
            weight,
            counts: vec![counts; threads],
            excess: vec![0.0; count],
            dirty: vec![false; count / CHUNK],
        }
    }

    /// Moves all particles from where they are too dense to where they are less so, in one pass; returns whether there
    /// was so much matter on crowded nodes that another should follow.
    pub fn relax(&mut self, blocks: &mut [Block<D>], team: &Team) -> bool {
        self.count(blocks, team);
        let matter = self.compare(team);
        let share = blocks.len().div_ceil(4 * team.size()).max(1);
        let mut parts: Vec<_> = blocks.chunks_mut(share).collect();
        team.for_each(&mut parts, |blocks| {
            run_wide(Slide {
                blocks,
                layout: &self.layout,
                rate: self.rate,
                excess: &self.excess,
            });
        });
        matter.crowded * CROWDED_PART > matter.all
    }

    fn count(&mut self, blocks: &[Block<D>], team: &Team) {
        let share = blocks.len().div_ceil(self.counts.len()).max(1);
        let mut shares = blocks.chunks(share);
        let mut parts: Vec<_> = self
            .counts
            .iter_mut()
            .map(|counts| (counts, shares.next().unwrap_or_default()))
            .collect();
        let layout = &self.layout;
        team.for_each(&mut parts, |(counts, blocks)| {
            for (group, flags) in counts.dirty.chunks_mut(GROUP).enumerate() {
                if !any(flags) {
                    continue;
                }
                for (k, dirty) in flags.iter_mut().enumerate() {
                    if std::mem::take(dirty) {
                        let chunk = group * GROUP + k;
                        counts.nodes[chunk * CHUNK..(chunk + 1) * CHUNK].fill(0);
                    }
                }
            }
            run_wide(Count {
                blocks,
                layout,
                counts,
            });
        });
    }

    /// From counts to what they exceed rest by; returns how much matter was counted.
    fn compare(&mut self, team: &Team) -> Matter {
        let counts = &self.counts;
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
                let counted_in = |counts: &Counts| any(&counts.dirty[first..][chunks.clone()]);
                if !any(&dirty[chunks.clone()]) && !counts.iter().any(counted_in) {
                    continue;
                }
                for chunk in chunks {
                    let counted = counts.iter().any(|counts| counts.dirty[first + chunk]);
                    if !counted && !dirty[chunk] {
                        continue;
                    }
                    dirty[chunk] = counted;
                    let nodes = chunk * CHUNK..(chunk + 1) * CHUNK;
                    let mut sums = [0u32; CHUNK];
                    for counts in counts {
                        let of_thread = &counts.nodes[first * CHUNK..][nodes.clone()];
                        for k in 0..CHUNK {
                            sums[k] = sums[k].wrapping_add(of_thread[k]);
                        }
                    }
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

/// Whether a flag is set. Without an early end the compiler looks at many at once.
fn any(flags: &[bool]) -> bool {
    flags.iter().fold(false, |found, &flag| found | flag)
}

/// Adds the volumes of particles to the nodes.
struct Count<'a, const D: usize> {
    blocks: &'a [Block<D>],
    layout: &'a Layout<D>,
    counts: &'a mut Counts,
}

impl<const D: usize> Kernel for Count<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        // Adding 1.5 * 2^23 rounds to an integer and leaves it in the low bits.
        const SHIFT: f32 = 12_582_912.0;
        let (nodes, dirty) = (&mut self.counts.nodes, &mut self.counts.dirty);
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, self.layout);
            let volume = block.volume.map(|volume| volume * ONE);
            for i in 0..LANES {
                if volume[i] == 0.0 {
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
                        let share = volume[i] * stencils.weights[0][a][i] * across;
                        let begin = start + self.layout.stencil_row([a, b]);
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

/// Moves particles down the gradient.
struct Slide<'a, const D: usize> {
    blocks: &'a mut [Block<D>],
    layout: &'a Layout<D>,
    rate: f32,
    excess: &'a [f32],
}

impl<const D: usize> Kernel for Slide<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let dx = self.layout.dx();
        let (layout, rate, excess) = (self.layout, self.rate, self.excess);
        for block in self.blocks {
            let gradient = gradient(layout, excess, &block.x);
            let mut squared = [0.0; LANES];
            for axis in 0..D {
                for i in 0..LANES {
                    squared[i] += gradient[axis][i] * gradient[axis][i];
                }
            }
            let mut step = [0.0; LANES];
            for i in 0..LANES {
                let length = rate * squared[i].sqrt();
                step[i] = dx * rate * FARTHEST / length.max(FARTHEST);
            }
            for axis in 0..D {
                for i in 0..LANES {
                    block.x[axis][i] -= gradient[axis][i] * step[i];
                }
            }
        }
    }
}

/// Gradient of the excess at each place of a block [1/cell].
#[inline(always)]
fn gradient<const D: usize>(layout: &Layout<D>, excess: &[f32], x: &[Lanes; D]) -> [Lanes; D] {
    let stencils = Stencils::at(x, layout);
    let mut slopes = [[[0.0; LANES]; 3]; D];
    for axis in 0..D {
        for i in 0..LANES {
            // Derivatives of the spline's weights.
            let offset = stencils.offset[axis][i];
            slopes[axis][0][i] = offset - 1.5;
            slopes[axis][1][i] = 2.0 - 2.0 * offset;
            slopes[axis][2][i] = offset - 0.5;
        }
    }
    let mut gradient = [[0.0; LANES]; D];
    for four in (0..LANES).step_by(4) {
        let mut slopes_of = [[f32x4::ZERO; 4]; D];
        for k in 0..4 {
            let of_particle = products(layout, excess, &stencils, &slopes, four + k);
            for axis in 0..D {
                slopes_of[axis][k] = of_particle[axis];
            }
        }
        for axis in 0..D {
            let [a, b, c, _] = f32x4::transpose(slopes_of[axis]);
            gradient[axis][four..four + 4].copy_from_slice(&((a + b) + c).to_array());
        }
    }
    gradient
}

/// For each axis the slope along it, still to be summed over the last axis.
#[inline(always)]
fn products<const D: usize>(
    layout: &Layout<D>,
    excess: &[f32],
    stencils: &Stencils<D>,
    slopes: &[[Lanes; 3]; D],
    i: usize,
) -> [f32x4; D] {
    let start = stencils.start[i] as usize;
    // One check for all rows of the stencil.
    let nodes = &excess[start..start + layout.stencil_row([2, 2]) + 4];
    let (mut value, mut first, mut second) = (f32x4::ZERO, f32x4::ZERO, f32x4::ZERO);
    for a in 0..3 {
        let (weight, slope) = (
            f32x4::splat(stencils.weights[0][a][i]),
            f32x4::splat(slopes[0][a][i]),
        );
        let mut plane = load_row(nodes, layout.stencil_row([a, 0]));
        if D == 3 {
            let rows = [
                plane,
                load_row(nodes, layout.stencil_row([a, 1])),
                load_row(nodes, layout.stencil_row([a, 2])),
            ];
            let mut across = f32x4::ZERO;
            plane = f32x4::ZERO;
            for b in 0..3 {
                plane += rows[b] * f32x4::splat(stencils.weights[1][b][i]);
                across += rows[b] * f32x4::splat(slopes[1][b][i]);
            }
            second += across * weight;
        }
        value += plane * weight;
        first += plane * slope;
    }
    let last = load_last(&stencils.weights[D - 1], i);
    let last_slope = load_last(&slopes[D - 1], i);
    std::array::from_fn(|axis| match axis {
        _ if axis == D - 1 => value * last_slope,
        0 => first * last,
        _ => second * last,
    })
}

#[inline(always)]
fn load_row(nodes: &[f32], begin: usize) -> f32x4 {
    let row: [f32; 4] = nodes[begin..begin + 4].try_into().expect("four nodes");
    f32x4::from(row)
}

#[inline(always)]
fn load_last(weights: &[Lanes; 3], i: usize) -> f32x4 {
    f32x4::from([weights[0][i], weights[1][i], weights[2][i], 0.0])
}
