//! Selection of vector instructions for the inner loops.
//!
//! The compiler turns loops over `0..LANES` without branches or calls into vector instructions. It may use all
//! instructions of the processor, because every lane is computed by the same IEEE operations in the same order at any
//! width: nothing is fused, nothing is summed across lanes. Fused products and sums across lanes are explicit, in `Quad`.
//! So the bits do not depend on the processor.

use std::sync::atomic::{AtomicU8, Ordering};

#[cfg(not(target_arch = "wasm32"))]
use super::quad::Portable as Baseline;
use super::quad::Quad;
#[cfg(target_arch = "wasm32")]
use super::wasm::Simd128 as Baseline;
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};

/// Work that is compiled for each set of vector instructions.
pub trait Kernel {
    type Output;
    /// Has to be `#[inline(always)]`, like all that it calls in loops.
    fn run<Q: Quad>(self) -> Self::Output;
}

/// A set of vector instructions, the narrowest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Instructions {
    /// Instructions of every processor of the architecture.
    Portable,
    /// AVX2 with FMA.
    Avx2,
    /// AVX-512 F, VL, DQ and BW.
    Avx512,
}

/// The widest set that may be used.
static WIDEST: AtomicU8 = AtomicU8::new(Instructions::Avx512 as u8);

impl Instructions {
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Whether this processor has them.
    pub fn available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Uses none wider from now on, in the whole process, to compare speeds; the bits stay the same.
    pub fn limit(self) {
        WIDEST.store(self as u8, Ordering::Relaxed);
    }

    /// The widest that are allowed and that the processor has.
    pub fn in_use() -> Self {
        let allowed = |set: &Self| *set as u8 <= WIDEST.load(Ordering::Relaxed) && set.available();
        let widest = Self::ALL.into_iter().rev().find(allowed);
        widest.unwrap_or(Self::Portable)
    }
}

/// Whether products that are added are rounded once, on which the bits depend. WebAssembly leaves it to the processor.
pub fn products_are_fused() -> bool {
    #[cfg(target_arch = "wasm32")]
    return super::wasm::is_fused();
    #[cfg(not(target_arch = "wasm32"))]
    true
}

/// Runs a kernel with the instructions in use.
pub fn run_wide<K: Kernel>(kernel: K) -> K::Output {
    match Instructions::in_use() {
        Instructions::Portable => kernel.run::<Baseline>(),
        // SAFETY: the instructions in use are among those of the processor.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => unsafe { avx2(kernel) },
        // SAFETY: the instructions in use are among those of the processor.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => unsafe { avx512(kernel) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => unreachable!("no processor of this architecture has them"),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{LANES, Lanes, exp, ln};
    use wide::f32x4;

    /// Loops over lanes and all operations of quads.
    struct Mixed(Lanes);

    impl Kernel for Mixed {
        type Output = Lanes;
        #[inline(always)]
        fn run<Q: Quad>(self) -> Lanes {
            let lanes = self.0.map(|x| exp(x).sqrt() / (1.0 + ln(x)));
            let nodes = std::array::from_fn(|node| {
                f32x4::from(std::array::from_fn::<f32, 4, _>(|k| lanes[4 * node + k]))
            });
            let (a, b) = (Q::load(&nodes), Q::repeat(nodes[1]));
            let c = a.mul_add(b, Q::of_nodes([0.1, 0.2, 0.3, 0.4]));
            let d = b.add(Q::splat(0.7)).max(a).last_numbers();
            let d = d
                .with_last_node(nodes[2])
                .with_last_numbers([0.3, 0.6, 0.9, 1.2]);
            let sums = Q::sums([a, c, a.mul(c), d.div(c)]);
            let mut result = [0.0; LANES];
            for (four, sum) in result.chunks_mut(4).zip(sums) {
                four.copy_from_slice(&sum.to_array());
            }
            result
        }
    }

    #[test]
    fn bits_do_not_depend_on_the_instructions() {
        let x: Lanes = std::array::from_fn(|i| 0.37 + 0.61 * i as f32);
        let portable = Mixed(x).run::<Baseline>().map(f32::to_bits);
        for set in Instructions::ALL.into_iter().filter(|set| set.available()) {
            set.limit();
            assert_eq!(Instructions::in_use(), set);
            assert_eq!(run_wide(Mixed(x)).map(f32::to_bits), portable);
        }
    }
}
