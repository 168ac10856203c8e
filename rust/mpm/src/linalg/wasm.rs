//! Sixteen numbers in four registers of WebAssembly.

use std::arch::wasm32::{
    f32x4_add, f32x4_div, f32x4_mul, f32x4_pmax, f32x4_replace_lane, f32x4_splat, i32x4_shuffle,
    v128, v128_load, v128_store,
};

use super::quad::Quad;
use wide::f32x4 as Node;

/// One node a register.
#[derive(Clone, Copy)]
pub struct Simd128([v128; 4]);

impl Simd128 {
    #[inline(always)]
    fn both(self, other: Self, f: impl Fn(v128, v128) -> v128) -> Self {
        Self(std::array::from_fn(|node| f(self.0[node], other.0[node])))
    }
}

#[inline(always)]
fn load(numbers: &Node) -> v128 {
    // SAFETY: a node has the length of a register.
    unsafe { v128_load(std::ptr::from_ref(numbers).cast()) }
}

#[inline(always)]
fn store(register: v128) -> Node {
    let mut numbers = Node::ZERO;
    // SAFETY: a node has the length of a register.
    unsafe { v128_store(std::ptr::from_mut(&mut numbers).cast(), register) };
    numbers
}

impl Quad for Simd128 {
    #[inline(always)]
    fn load(nodes: &[Node; 4]) -> Self {
        Self(std::array::from_fn(|node| load(&nodes[node])))
    }
    #[inline(always)]
    fn of_numbers(numbers: &[f32; 16]) -> Self {
        // SAFETY: four numbers have the length of a register.
        let four = |node: usize| unsafe { v128_load(numbers.as_ptr().add(4 * node).cast()) };
        Self(std::array::from_fn(four))
    }
    #[inline(always)]
    fn store(self) -> [Node; 4] {
        self.0.map(store)
    }
    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self([f32x4_splat(number); 4])
    }
    #[inline(always)]
    fn repeat(numbers: Node) -> Self {
        Self([load(&numbers); 4])
    }
    #[inline(always)]
    fn of_nodes(numbers: [f32; 4]) -> Self {
        Self(numbers.map(|number| f32x4_splat(number)))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_add(a, b))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_mul(a, b))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_div(a, b))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_pmax(b, a))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(std::array::from_fn(|node| {
            fused(self.0[node], factor.0[node], summand.0[node])
        }))
    }
    #[inline(always)]
    fn last_numbers(self) -> Self {
        Self(self.0.map(|node| i32x4_shuffle::<3, 3, 3, 3>(node, node)))
    }
    #[inline(always)]
    fn with_last_node(mut self, numbers: Node) -> Self {
        self.0[3] = load(&numbers);
        self
    }
    #[inline(always)]
    fn with_last_numbers(self, numbers: [f32; 4]) -> Self {
        Self(std::array::from_fn(|node| {
            f32x4_replace_lane::<3>(self.0[node], numbers[node])
        }))
    }
    #[inline(always)]
    fn sums(quads: [Self; 4]) -> [Node; 4] {
        quads.map(|Self([a, b, c, d])| store(f32x4_add(f32x4_add(a, c), f32x4_add(b, d))))
    }
}

/// a b + c, rounded once where the processor has such an instruction, which `is_fused` finds out.
#[cfg(target_feature = "relaxed-simd")]
#[inline(always)]
fn fused(a: v128, b: v128, c: v128) -> v128 {
    std::arch::wasm32::f32x4_relaxed_madd(a, b, c)
}

/// a b + c, rounded once.
///
/// The product is exact in 64 bits. Their sum with c is rounded to odd there, with the error of the sum by
/// Knuth (1969), so that rounding it again gives what rounding once does (Boldo and Melquiond 2008).
#[cfg(not(target_feature = "relaxed-simd"))]
#[inline(always)]
fn fused(a: v128, b: v128, c: v128) -> v128 {
    use std::arch::wasm32::{
        f32x4_demote_f64x2_zero, f64x2_add, f64x2_gt, f64x2_lt, f64x2_mul, f64x2_promote_low_f32x4,
        f64x2_splat, f64x2_sub, i64x2_add, i64x2_eq, i64x2_splat, v128_and, v128_andnot, v128_or,
        v128_xor,
    };
    let half = |a: v128, b: v128, c: v128| {
        let (a, b, c) = (
            f64x2_promote_low_f32x4(a),
            f64x2_promote_low_f32x4(b),
            f64x2_promote_low_f32x4(c),
        );
        let product = f64x2_mul(a, b);
        let sum = f64x2_add(product, c);
        let back = f64x2_sub(sum, product);
        let error = f64x2_add(f64x2_sub(product, f64x2_sub(sum, back)), f64x2_sub(c, back));
        let zero = f64x2_splat(0.0);
        let (above, below) = (f64x2_gt(error, zero), f64x2_lt(error, zero));
        let is_even = i64x2_eq(v128_and(sum, i64x2_splat(1)), i64x2_splat(0));
        let inexact_and_even = v128_and(v128_or(above, below), is_even);
        // One unit away from zero where the error has the sign of the sum, else one unit towards it.
        let towards_zero = v128_xor(below, f64x2_lt(sum, zero));
        let unit = v128_or(towards_zero, v128_andnot(i64x2_splat(1), towards_zero));
        f32x4_demote_f64x2_zero(i64x2_add(sum, v128_and(unit, inexact_and_even)))
    };
    let upper = |v: v128| i32x4_shuffle::<2, 3, 0, 1>(v, v);
    let (low, high) = (half(a, b, c), half(upper(a), upper(b), upper(c)));
    i32x4_shuffle::<0, 1, 4, 5>(low, high)
}

/// Whether products that are added are rounded once, on which the bits depend: the standard leaves it open.
pub fn is_fused() -> bool {
    // (1 + e)^2 - (1 + 2 e) is e^2 where the product is not rounded, else 0.
    let e = f32::EPSILON;
    let (a, c) = (f32x4_splat(1.0 + e), f32x4_splat(-1.0 - 2.0 * e));
    let hidden = std::hint::black_box([a, a, c]);
    store(fused(hidden[0], hidden[1], hidden[2])) == Node::splat(e * e)
}
