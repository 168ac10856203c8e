//! Displacement of particles down the gradient of a scalar on a grid.

use wide::f32x4;

use super::super::block::Block;
use crate::grid::{Layout, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide};
use threads::Team;

/// Largest displacement in one call [cells].
const MAX_STEP: f32 = 0.25;

/// Moves particles down the gradient of `height`, by `rate` cells for a gradient of 1 per cell.
pub fn descend<const D: usize>(
    blocks: &mut [Block<D>],
    layout: &Layout<D>,
    height: &[f32],
    rate: f32,
    team: &Team,
) {
    let share = blocks.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = blocks.chunks_mut(share).collect();
    team.for_each(&mut parts, |blocks| {
        run_wide(Descend {
            blocks,
            layout,
            rate,
            height,
        });
    });
}

/// Kernel of `descend`.
struct Descend<'a, const D: usize> {
    blocks: &'a mut [Block<D>],
    layout: &'a Layout<D>,
    rate: f32,
    height: &'a [f32],
}

impl<const D: usize> Kernel for Descend<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let dx = self.layout.dx();
        let (layout, rate, height) = (self.layout, self.rate, self.height);
        for block in self.blocks {
            let gradient = gradient(layout, height, &block.x);
            let mut squared = [0.0; LANES];
            for axis in 0..D {
                for i in 0..LANES {
                    squared[i] += gradient[axis][i] * gradient[axis][i];
                }
            }
            let mut step = [0.0; LANES];
            for i in 0..LANES {
                let length = rate * squared[i].sqrt();
                step[i] = dx * rate * MAX_STEP / length.max(MAX_STEP);
            }
            for axis in 0..D {
                for i in 0..LANES {
                    block.x[axis][i] -= gradient[axis][i] * step[i];
                }
            }
        }
    }
}

/// Gradient at each place of a block [1/cell].
#[inline(always)]
fn gradient<const D: usize>(layout: &Layout<D>, height: &[f32], x: &[Lanes; D]) -> [Lanes; D] {
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
            let of_particle = products(layout, height, &stencils, &slopes, four + k);
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

/// Slope along each axis, not yet summed along the last axis.
#[inline(always)]
fn products<const D: usize>(
    layout: &Layout<D>,
    height: &[f32],
    stencils: &Stencils<D>,
    slopes: &[[Lanes; 3]; D],
    i: usize,
) -> [f32x4; D] {
    let start = stencils.start[i] as usize;
    // One check for all rows of the stencil.
    let nodes = &height[start..start + layout.stencil_row([2, 2]) + 4];
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
