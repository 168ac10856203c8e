//! Quadratic B-splines (Jiang et al. 2016, eq. 123).

use crate::math::Vector;

/// The 3^D nodes that one particle exchanges with.
#[derive(Debug, Clone, Copy)]
pub struct Stencil<const D: usize> {
    /// Lowest node.
    pub base: [usize; D],
    /// Distance from the lowest node in cells, in [0.5, 1.5].
    pub offset: Vector<D>,
    /// `weights[axis][step]`; those of an axis sum to one.
    pub weights: [[f32; 3]; D],
}

impl<const D: usize> Stencil<D> {
    /// `xi` is the position in cells from the grid's first node, from 0.5 to 2^21 on each axis.
    #[inline(always)]
    pub fn at(xi: &Vector<D>) -> Self {
        // Rounding xi - 1 to the nearest integer finds the lowest node. Adding 1.5 * 2^23 does so and
        // leaves the integer in the low bits: cheaper than a cast, which has to guard against overflow.
        const SHIFT: f32 = 12_582_912.0;
        let shifted = xi.map(|s| (s - 1.0) + SHIFT);
        let base = std::array::from_fn(|axis| {
            shifted[axis].to_bits().wrapping_sub(SHIFT.to_bits()) as usize
        });
        let offset = xi - shifted.map(|s| s - SHIFT);
        let weights = std::array::from_fn(|axis| spline(offset[axis]));
        Self {
            base,
            offset,
            weights,
        }
    }
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
