//! Quadratic B-splines (Jiang et al. 2016, eq. 123).

use super::layout::{Layout, PADDING};
use crate::linalg::{LANES, Lanes, Vector};

/// The 3^D nodes that one particle exchanges with.
#[derive(Debug, Clone, Copy)]
pub struct Stencil<const D: usize> {
    /// Lowest node.
    pub base: [usize; D],
    /// `weights[axis][step]`; those of an axis sum to one.
    pub weights: [[f32; 3]; D],
}

impl<const D: usize> Stencil<D> {
    /// `xi` is the position in cells from the grid's first node, from 0.5 to 2^21 on each axis.
    #[inline(always)]
    pub fn at(xi: &Vector<D>) -> Self {
        let lowest = xi.map(lowest_node);
        Self {
            base: std::array::from_fn(|axis| lowest[axis].0 as usize),
            weights: std::array::from_fn(|axis| spline(lowest[axis].1)),
        }
    }
}

/// The same for the particles of a block.
#[repr(C, align(64))]
pub struct Stencils<const D: usize> {
    /// Memory index of the lowest node.
    pub start: [u32; LANES],
    /// Coordinates of the lowest node.
    pub base: [[u32; LANES]; D],
    /// Distance from the lowest node in cells, in [0.5, 1.5].
    pub offset: [Lanes; D],
    /// `weights[axis][step]`; those of an axis sum to one.
    pub weights: [[Lanes; 3]; D],
}

impl<const D: usize> Stencils<D> {
    /// `x` are positions [m].
    #[inline(always)]
    pub fn at(x: &[Lanes; D], layout: &Layout<D>) -> Self {
        let mut stencils = Self {
            start: [0; LANES],
            base: [[0; LANES]; D],
            offset: [[0.0; LANES]; D],
            weights: [[[0.0; LANES]; 3]; D],
        };
        let resolution = layout.resolution as f32;
        for axis in 0..D {
            let length = if axis == D - 1 {
                layout.row_length
            } else {
                layout.extents[axis]
            } as u32;
            for i in 0..LANES {
                let (base, offset) = lowest_node(x[axis][i] * resolution + PADDING as f32);
                stencils.base[axis][i] = base;
                stencils.start[i] = stencils.start[i].wrapping_mul(length).wrapping_add(base);
                stencils.offset[axis][i] = offset;
                let weights = spline(offset);
                for step in 0..3 {
                    stencils.weights[axis][step][i] = weights[step];
                }
            }
        }
        stencils
    }
}

/// Lowest of the three nodes around `xi`, and the distance from it in cells.
#[inline(always)]
fn lowest_node(xi: f32) -> (u32, f32) {
    // Rounding xi - 1 to the nearest integer finds the lowest node. Adding 1.5 * 2^23 does so and
    // leaves the integer in the low bits: cheaper than a cast, which has to guard against overflow.
    const SHIFT: f32 = 12_582_912.0;
    let shifted = (xi - 1.0) + SHIFT;
    (
        shifted.to_bits().wrapping_sub(SHIFT.to_bits()),
        xi - (shifted - SHIFT),
    )
}

/// Weights of the three nodes at a distance of `offset` cells from the lowest.
#[inline(always)]
pub fn spline(offset: f32) -> [f32; 3] {
    let (a, b, c) = (1.5 - offset, offset - 1.0, offset - 0.5);
    [0.5 * a * a, 0.75 - b * b, 0.5 * c * c]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reproduces_constants_and_positions(x in 0.5f32..200.0, y in 0.5f32..200.0) {
            let stencil = Stencil::at(&Vector::<2>::new(x, y));
            for (axis, xi) in [x, y].into_iter().enumerate() {
                let w = stencil.weights[axis];
                let sum: f32 = w.iter().sum();
                let mean = w[1] + 2.0 * w[2] + stencil.base[axis] as f32;
                prop_assert!((sum - 1.0).abs() < 1e-6 && (mean - xi).abs() < 4e-5);
                prop_assert!(w.iter().all(|&w| w >= 0.0));
            }
        }
    }
}
