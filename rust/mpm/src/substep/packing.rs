//! EXPERIMENT
use wide::f32x4;

use super::g2p::gather;
use crate::boundary::Bounds;
use crate::grid::{Grid, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, run_wide};
use crate::material::{Constitutive, Packing, State, tune};
use crate::particles::{Block, MaterialGroup, with_group};

pub fn pack<const D: usize>(
    groups: &mut [MaterialGroup<D>],
    grid: &mut Grid<D>,
    bounds: &Bounds<D>,
    dt: f32,
) {
    grid.clear();
    for group in groups.iter() {
        with_group!(group, group => {
            for blocks in [&group.awake.blocks, &group.border.blocks] {
                run_wide(Spread { blocks, material: &group.material, grid });
            }
        });
    }
    grid.mean_pressure();
    for _ in 0..tune()[11] as usize {
        grid.smooth();
    }
    for group in groups.iter_mut() {
        with_group!(group, group => {
            let Group { material, awake, .. } = group;
            run_wide(Compare { blocks: &mut awake.blocks, material: &*material, grid: &*grid, bounds, dt });
        });
    }
    grid.wipe();
}
use crate::particles::Group;

struct Spread<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a [Block<D, M::State>],
    material: &'a M,
    grid: &'a mut Grid<D>,
}

impl<const D: usize, M: Constitutive<D>> Kernel for Spread<'_, D, M> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let layout = self.grid.layout;
        let per_cell = (layout.resolution as f32).powi(D as i32);
        for block in self.blocks {
            let st = Stencils::at(&block.x, &layout);
            for i in 0..block.count.min(LANES) {
                let state = M::State::load(&block.state, i);
                let v = block.volume[i] * per_cell;
                let share = self.material.share(&state);
                let p = self.material.pressure(&state);
                let own = if p.is_some() { v } else { 0.0 };
                let value = f32x4::from([v * share, own, own * p.unwrap_or(0.0), v]);
                let start = st.start[i] as usize;
                for a in 0..3 {
                    for b in 0..(if D == 3 { 3 } else { 1 }) {
                        let w = st.weights[0][a][i] * if D == 3 { st.weights[1][b][i] } else { 1.0 };
                        let begin = start + layout.stencil_row([a, b]);
                        for c in 0..3 {
                            self.grid.nodes[begin + c] += value * f32x4::splat(w * st.weights[D - 1][c][i]);
                        }
                    }
                }
            }
        }
    }
}

struct Compare<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    grid: &'a Grid<D>,
    bounds: &'a Bounds<D>,
    dt: f32,
}

impl<const D: usize, M: Constitutive<D>> Kernel for Compare<'_, D, M> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let t = tune();
        for block in self.blocks {
            let st = Stencils::at(&block.x, &self.grid.layout);
            let count = block.count.min(LANES);
            let sums = gather(self.grid, &st, count);
            let (fill, moments) = self.bounds.fill_at(&block.x, &st);
            let mut packing = Packing { fill: [1.0; LANES], pressure: [0.0; LANES], strain_rate: [0.0; LANES], density: [0.0; LANES] };
            for i in 0..count {
                let s = sums.values[i].to_array();
                let mut d2 = 0.0;
                for axis in 0..D {
                    let m = sums.moments[axis][i].to_array()[0];
                    let d = m / s[0] - moments[axis][i];
                    d2 += d * d;
                }
                let density = s[0] / fill[i];
                packing.fill[i] = if t[10] > 0.0 && density > 1.0 { density } else { density + t[0] * d2 / (d2.sqrt() + t[1]) };
                packing.density[i] = density;
                let mut s2 = 0.0;
                for r in 0..D { for c in 0..D { let e = 0.5 * (block.affine[r][c][i] + block.affine[c][r][i]); s2 += e * e; } }
                packing.strain_rate[i] = s2.sqrt();
                packing.pressure[i] = s[2];
            }
            self.material.repack(&mut block.state, &packing, self.dt);
        }
    }
}
#[allow(unused)]
fn _unused(_: Lanes) {}
