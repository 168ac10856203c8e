//! Volumes and pressures of the particles, put on the grid.

use wide::f32x4;

use super::lanes::{PRESSURE, SHARING, VOLUME};
use crate::grid::{Grid, Stencils, Window};
use crate::linalg::{Kernel, LANES, Quad, run_wide};
use crate::material::Constitutive;
use crate::particles::{Block, MaterialGroup, Slab, for_each_slab, with_group};
use crate::substep::{for_each_row, scatter_row};
use threads::Team;

/// Adds what particles take part in to the active nodes: the volume of all of them if `with_volume`, and the
/// pressure of the groups that `shares` picks.
pub fn spread<const D: usize>(
    groups: &[MaterialGroup<D>],
    slabs: &[Slab],
    grid: &mut Grid<D>,
    team: &Team,
    with_volume: bool,
    shares: impl Fn(&MaterialGroup<D>) -> bool + Sync,
) {
    let per_cell = 1.0 / grid.layout.dx().powi(D as i32);
    for_each_slab(slabs, grid, team, |slab, window| {
        for group in groups {
            let sharing = shares(group);
            if !(with_volume || sharing) {
                continue;
            }
            with_group!(group, group => {
                for blocks in [group.awake.of_slab(slab), group.border.of_slab(slab)] {
                    run_wide(SpreadBlocks {
                        blocks,
                        material: &group.material,
                        volume_factor: if with_volume { per_cell } else { 0.0 },
                        sharing_factor: if sharing { per_cell } else { 0.0 },
                        window,
                    });
                }
            });
        }
    });
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
                    scatter_row(nodes, begin, f32x4::from(value), f32x4::ZERO, weight, &last);
                });
            }
        }
    }
}
