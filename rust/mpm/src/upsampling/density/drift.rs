//! Correction of the drift of shown particles away from coarse particles.
//!
//! Interpolation errors of displacements accumulate. After some seconds hills of shown particles would stand where the
//! coarse particles lie flat, and gaps would open at walls. At intervals, shown particles are therefore moved down the
//! gradient of the difference of both masses on the coarse grid.

use super::super::block::{Block, Shown, blocks};
use super::super::coarse::CoarseParticles;
use super::deposit::{Deposit, GROUP, ONE, any};
use super::descent::descend;
use crate::grid::{CHUNK, Layout};
use crate::linalg::Vector;
use threads::Team;

/// Displacement in each correction [cells] per full cell of excess and cell. It is small because most of the difference at
/// one instant is the coarser sampling of coarse particles: at four times the rate the error in a splash grows by 2 %, at
/// this rate it does not.
const RATE: f32 = 0.12;
/// Excess that is not corrected [full cells]: the sampling of coarse particles at rest is within it, so matter at rest
/// stays at rest.
const TOLERANCE: f32 = 0.1;

/// Difference of the masses of shown and coarse particles on the coarse grid.
#[derive(Debug, Clone)]
pub struct DriftCorrection<const D: usize> {
    layout: Layout<D>,
    shown: Deposit,
    coarse: Deposit,
    /// Difference beyond the tolerance [full cells].
    excess: Vec<f32>,
    /// Chunks of it that are not zero.
    dirty: Vec<bool>,
}

impl<const D: usize> DriftCorrection<D> {
    pub fn new(layout: Layout<D>, threads: usize) -> Self {
        let count = layout.row_count() * layout.row_length;
        Self {
            shown: Deposit::new(&layout, threads),
            coarse: Deposit::new(&layout, 1),
            excess: vec![0.0; count],
            dirty: vec![false; count / CHUNK],
            layout,
        }
    }

    /// Moves shown particles towards the mass of the coarse particles.
    ///
    /// `density` is the mean rest density of the shown particles [kg/m^D]; bodies of other densities move faster or more
    /// slowly.
    pub fn correct(
        &mut self,
        shown: &mut [Block<D>],
        coarse: &CoarseParticles<'_>,
        density: f32,
        team: &Team,
    ) {
        let per_mass = 1.0 / (density * self.layout.dx().powi(D as i32));
        let amounts = |block: &Block<D>| block.mass.map(|mass| mass * per_mass);
        self.shown.count(&self.layout, shown, amounts, team);
        let coarse = as_blocks(coarse);
        self.coarse.count(&self.layout, &coarse, amounts, team);
        self.compare();
        descend(shown, &self.layout, &self.excess, RATE, team);
    }

    fn compare(&mut self) {
        for group in (0..self.dirty.len()).step_by(GROUP) {
            let chunks = group..(group + GROUP).min(self.dirty.len());
            let (shown, coarse) = (&self.shown, &self.coarse);
            let has_any = |chunks: std::ops::Range<usize>| {
                shown.any_in(chunks.clone()) || coarse.any_in(chunks)
            };
            if !any(&self.dirty[chunks.clone()]) && !has_any(chunks.clone()) {
                continue;
            }
            for chunk in chunks {
                let counted = has_any(chunk..chunk + 1);
                if !counted && !self.dirty[chunk] {
                    continue;
                }
                self.dirty[chunk] = counted;
                let (shown, coarse) = (shown.in_chunk(chunk), coarse.in_chunk(chunk));
                let excess = &mut self.excess[chunk * CHUNK..(chunk + 1) * CHUNK];
                for k in 0..CHUNK {
                    let difference = (shown[k] as f32 - coarse[k] as f32) / ONE;
                    excess[k] =
                        (difference - TOLERANCE).max(0.0) + (difference + TOLERANCE).min(0.0);
                }
            }
        }
    }
}

/// Coarse particles as blocks, with their positions and masses only.
fn as_blocks<const D: usize>(coarse: &CoarseParticles<'_>) -> Vec<Block<D>> {
    let all: Vec<_> = (0..coarse.ids.len())
        .map(|index| Shown {
            x: Vector::from_column_slice(&coarse.x[index * D..][..D]),
            v: Vector::zeros(),
            mass: coarse.mass[index],
            volume: 0.0,
            material: 0,
        })
        .collect();
    blocks(&all)
}
