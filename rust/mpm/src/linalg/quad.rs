//! Four nodes of four numbers each, in the registers of one set of vector instructions.
//!
//! All sets compute the same bits: each product that is added is fused (rounded once), and the sum over nodes has one
//! order. Portable code fuses too, in software where the processor cannot: correct, but many times slower. Every
//! processor with AVX2 and all of aarch64 can.

use super::lanes::Lanes;
use wide::f32x4;

/// Sixteen numbers, node by node.
pub trait Quad: Copy {
    fn load(nodes: &[f32x4; 4]) -> Self;
    /// The same, of numbers side by side.
    fn of_numbers(numbers: &[f32; 16]) -> Self;
    fn store(self) -> [f32x4; 4];
    /// The same number everywhere.
    fn splat(number: f32) -> Self;
    /// The same numbers at each node.
    fn repeat(numbers: f32x4) -> Self;
    /// One number for each node.
    fn of_nodes(numbers: [f32; 4]) -> Self;
    fn add(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// The larger number of each two; the one of `other` where one is NaN.
    fn max(self, other: Self) -> Self;
    /// self * factor + summand, rounded once.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// The last number of each node in all of its places.
    fn last_numbers(self) -> Self;
    /// The same with other numbers at the last node.
    fn with_last_node(self, numbers: f32x4) -> Self;
    /// The same with one other number at each node, in the last place.
    fn with_last_numbers(self, numbers: [f32; 4]) -> Self;
    /// The sums over the nodes of four quads, (0 + 2) + (1 + 3).
    fn sums(quads: [Self; 4]) -> [f32x4; 4];
    /// Number `k` of two times eight nodes.
    #[inline(always)]
    fn column(nodes: [&[f32x4; 8]; 2], k: usize) -> Lanes {
        std::array::from_fn(|i| nodes[i / 8][i % 8].as_array()[k])
    }
    /// Replaces number `k` of eight nodes.
    #[inline(always)]
    fn set_column(nodes: &mut [f32x4; 8], k: usize, numbers: &[f32; 8]) {
        for (node, number) in nodes.iter_mut().zip(numbers) {
            node.as_mut_array()[k] = *number;
        }
    }

    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
}

/// For any processor.
#[cfg(not(target_arch = "wasm32"))]
#[derive(Clone, Copy)]
pub struct Portable([[f32; 4]; 4]);

#[cfg(not(target_arch = "wasm32"))]
impl Portable {
    #[inline(always)]
    fn each(f: impl Fn(usize, usize) -> f32) -> Self {
        let mut quad = [[0.0; 4]; 4];
        for node in 0..4 {
            for k in 0..4 {
                quad[node][k] = f(node, k);
            }
        }
        Self(quad)
    }
}

#[cfg(not(target_arch = "wasm32"))]
impl Quad for Portable {
    #[inline(always)]
    fn load(nodes: &[f32x4; 4]) -> Self {
        Self(nodes.map(f32x4::to_array))
    }
    #[inline(always)]
    fn of_numbers(numbers: &[f32; 16]) -> Self {
        Self::each(|node, k| numbers[4 * node + k])
    }
    #[inline(always)]
    fn store(self) -> [f32x4; 4] {
        self.0.map(f32x4::from)
    }
    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self([[number; 4]; 4])
    }
    #[inline(always)]
    fn repeat(numbers: f32x4) -> Self {
        Self([numbers.to_array(); 4])
    }
    #[inline(always)]
    fn of_nodes(numbers: [f32; 4]) -> Self {
        Self(numbers.map(|number| [number; 4]))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::each(|node, k| self.0[node][k] + other.0[node][k])
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::each(|node, k| self.0[node][k] * other.0[node][k])
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self::each(|node, k| self.0[node][k] / other.0[node][k])
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::each(|node, k| {
            let (a, b) = (self.0[node][k], other.0[node][k]);
            if a > b { a } else { b }
        })
    }
    #[inline(always)]
    fn last_numbers(self) -> Self {
        Self::each(|node, _| self.0[node][3])
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self::each(|node, k| self.0[node][k].mul_add(factor.0[node][k], summand.0[node][k]))
    }
    #[inline(always)]
    fn with_last_node(mut self, numbers: f32x4) -> Self {
        self.0[3] = numbers.to_array();
        self
    }
    #[inline(always)]
    fn with_last_numbers(mut self, numbers: [f32; 4]) -> Self {
        for node in 0..4 {
            self.0[node][3] = numbers[node];
        }
        self
    }
    #[inline(always)]
    fn sums(quads: [Self; 4]) -> [f32x4; 4] {
        let sum = |quad: Self| {
            let [a, b, c, d] = quad.store();
            (a + c) + (b + d)
        };
        quads.map(sum)
    }
}
