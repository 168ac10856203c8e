//! Volumes and pressures of the particles, put on the grid.

use std::ops::Range;

use wide::f32x4;

use super::lanes::{PRESSURE, SHARING, VOLUME};
use crate::grid::{CHUNK, Stencils, Window};
use crate::linalg::{Kernel, LANES, Quad, run_wide};
use crate::material::Constitutive;
use crate::particles::Block;
use crate::substep::{for_each_row, scatter_row};

/// Adds volume and pressure of the blocks of a group to the nodes.
pub fn spread<const D: usize, M: Constitutive<D>>(
    blocks: &[Block<D, M::State>],
    material: &M,
    with_volume: bool,
    with_pressure: bool,
    window: &mut Window<'_, D>,
) {
    let per_cell = 1.0 / window.layout.dx().powi(D as i32);
    run_wide(SpreadBlocks {
        blocks,
        material,
        volume_factor: if with_volume { per_cell } else { 0.0 },
        sharing_factor: if with_pressure { per_cell } else { 0.0 },
        window,
    });
}

/// Takes means of the pressures that were added to the nodes of a window.
pub fn take_means<const D: usize>(window: &mut Window<'_, D>) {
    for chunk in window.chunks(window.planes.clone()) {
        if window.dirty[chunk] {
            for node in &mut window.nodes[chunk * CHUNK..(chunk + 1) * CHUNK] {
                let [volume, sharing, pressure, smooth] = node.to_array();
                if sharing > 0.0 {
                    *node = [volume, sharing, pressure / sharing, smooth].into();
                }
            }
        }
    }
}

/// Empties the nodes of some planes, but for the volumes if they are `kept`.
pub fn empty<const D: usize>(window: &mut Window<'_, D>, planes: Range<usize>, kept: bool) {
    if !kept {
        window.clear(planes);
        return;
    }
    for chunk in window.chunks(planes) {
        for node in &mut window.nodes[chunk * CHUNK..(chunk + 1) * CHUNK] {
            let [volume, _, _, smooth] = node.to_array();
            *node = [volume, 0.0, 0.0, smooth].into();
        }
    }
}

/// The blocks of one group in one slab.
struct SpreadBlocks<'a, 'w, const D: usize, M: Constitutive<D>> {
    blocks: &'a [Block<D, M::State>],
    material: &'a M,
    /// One over the volume of a cell [1/m^D], or 0.
    volume_factor: f32,
    /// The same.
    sharing_factor: f32,
    window: &'a mut Window<'w, D>,
}

impl<const D: usize, M: Constitutive<D>> Kernel for SpreadBlocks<'_, '_, D, M> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let Window {
            layout,
            first,
            nodes,
            dirty,
            ..
        } = self.window;
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, layout);
            let held = self.material.volumes(&block.state);
            for i in 0..block.count.min(LANES) {
                let sharing = self.sharing_factor * block.volume[i];
                let mut value = [0.0; 4];
                value[VOLUME] = self.volume_factor * block.volume[i] * held.ratio[i];
                value[SHARING] = sharing;
                value[PRESSURE] = sharing * held.pressure[i];
                let start = stencils.start[i] as usize - *first;
                let last =
                    std::array::from_fn(|step| stencils.weights[D - 1][step][i]).map(f32x4::splat);
                for_each_row::<D>(|a, b| {
                    let across = if D == 3 {
                        stencils.weights[1][b][i]
                    } else {
                        1.0
                    };
                    let weight = stencils.weights[0][a][i] * across;
                    let begin = start + layout.stencil_row([a, b]);
                    dirty[begin / CHUNK] = true;
                    dirty[(begin + 2) / CHUNK] = true;
                    scatter_row(nodes, begin, f32x4::from(value), f32x4::ZERO, weight, &last);
                });
            }
        }
    }
}
