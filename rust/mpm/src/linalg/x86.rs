//! Sixteen numbers in the registers of AVX2 and AVX-512.
//!
//! Only `run_wide` uses these types, after a check that the processor has their instructions.

use std::arch::x86_64::{
    __m256, __m512, _mm_loadu_ps, _mm_set1_ps, _mm256_add_ps, _mm256_blend_ps, _mm256_div_ps,
    _mm256_fmadd_ps, _mm256_insertf128_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_mul_ps,
    _mm256_permute_ps, _mm256_permute2f128_ps, _mm256_set_m128, _mm256_set1_ps, _mm256_storeu_ps,
    _mm512_add_epi32, _mm512_add_ps, _mm512_broadcast_f32x4, _mm512_castps128_ps512,
    _mm512_castps256_ps512, _mm512_castps512_ps256, _mm512_div_ps, _mm512_fmadd_ps,
    _mm512_insertf32x4, _mm512_insertf32x8, _mm512_loadu_ps, _mm512_mask_permutexvar_ps,
    _mm512_max_ps, _mm512_mul_ps, _mm512_permute_ps, _mm512_permutex2var_ps, _mm512_permutexvar_ps,
    _mm512_set_epi32, _mm512_set1_epi32, _mm512_set1_ps, _mm512_shuffle_f32x4, _mm512_storeu_ps,
};

use super::lanes::{LANES, Lanes};
use super::quad::Quad;
use wide::f32x4;

/// AVX2 and FMA: two nodes a register.
#[derive(Clone, Copy)]
pub struct Avx2(__m256, __m256);

impl Quad for Avx2 {
    #[inline(always)]
    fn load(nodes: &[f32x4; 4]) -> Self {
        let numbers = nodes.as_ptr().cast::<f32>();
        // SAFETY: `run_wide` checked for AVX2 and FMA; the arrays have the length of the registers.
        unsafe { Self(_mm256_loadu_ps(numbers), _mm256_loadu_ps(numbers.add(8))) }
    }
    #[inline(always)]
    fn of_numbers(numbers: &[f32; 16]) -> Self {
        let numbers = numbers.as_ptr();
        // SAFETY: `run_wide` checked for AVX2 and FMA; the array has the length of the registers.
        unsafe { Self(_mm256_loadu_ps(numbers), _mm256_loadu_ps(numbers.add(8))) }
    }
    #[inline(always)]
    fn store(self) -> [f32x4; 4] {
        let mut nodes = [f32x4::ZERO; 4];
        let numbers = nodes.as_mut_ptr().cast::<f32>();
        // SAFETY: `run_wide` checked for AVX2 and FMA; the arrays have the length of the registers.
        unsafe {
            _mm256_storeu_ps(numbers, self.0);
            _mm256_storeu_ps(numbers.add(8), self.1);
        }
        nodes
    }
    #[inline(always)]
    fn splat(number: f32) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        let all = unsafe { _mm256_set1_ps(number) };
        Self(all, all)
    }
    #[inline(always)]
    fn repeat(numbers: f32x4) -> Self {
        let numbers = numbers.to_array();
        // SAFETY: `run_wide` checked for AVX2 and FMA; the arrays have the length of the registers.
        let both = unsafe {
            let one = _mm_loadu_ps(numbers.as_ptr());
            _mm256_set_m128(one, one)
        };
        Self(both, both)
    }
    #[inline(always)]
    fn of_nodes([a, b, c, d]: [f32; 4]) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_set_m128(_mm_set1_ps(b), _mm_set1_ps(a)),
                _mm256_set_m128(_mm_set1_ps(d), _mm_set1_ps(c)),
            )
        }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_add_ps(self.0, other.0),
                _mm256_add_ps(self.1, other.1),
            )
        }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_mul_ps(self.0, other.0),
                _mm256_mul_ps(self.1, other.1),
            )
        }
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_div_ps(self.0, other.0),
                _mm256_div_ps(self.1, other.1),
            )
        }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_max_ps(self.0, other.0),
                _mm256_max_ps(self.1, other.1),
            )
        }
    }
    #[inline(always)]
    fn last_numbers(self) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_permute_ps::<0b11_11_11_11>(self.0),
                _mm256_permute_ps::<0b11_11_11_11>(self.1),
            )
        }
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_fmadd_ps(self.0, factor.0, summand.0),
                _mm256_fmadd_ps(self.1, factor.1, summand.1),
            )
        }
    }
    #[inline(always)]
    fn with_last_node(self, numbers: f32x4) -> Self {
        let numbers = numbers.to_array();
        // SAFETY: `run_wide` checked for AVX2 and FMA; the array has the length of the register.
        unsafe {
            let node = _mm_loadu_ps(numbers.as_ptr());
            Self(self.0, _mm256_insertf128_ps::<1>(self.1, node))
        }
    }
    #[inline(always)]
    fn with_last_numbers(self, numbers: [f32; 4]) -> Self {
        let numbers = Self::of_nodes(numbers);
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            Self(
                _mm256_blend_ps::<0b1000_1000>(self.0, numbers.0),
                _mm256_blend_ps::<0b1000_1000>(self.1, numbers.1),
            )
        }
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self; 4]) -> [f32x4; 4] {
        // SAFETY: `run_wide` checked for AVX2 and FMA.
        unsafe {
            let pair = |a: Self, b: Self| {
                let (a, b) = (_mm256_add_ps(a.0, a.1), _mm256_add_ps(b.0, b.1));
                let even = _mm256_permute2f128_ps::<0x20>(a, b);
                _mm256_add_ps(even, _mm256_permute2f128_ps::<0x31>(a, b))
            };
            Self(pair(a, b), pair(c, d)).store()
        }
    }
}

/// AVX-512: all nodes in one register.
#[derive(Clone, Copy)]
pub struct Avx512(__m512);

// SAFETY: as above.
impl Quad for Avx512 {
    #[inline(always)]
    fn load(nodes: &[f32x4; 4]) -> Self {
        // SAFETY: `run_wide` checked for AVX-512; the arrays have the length of the registers.
        unsafe { Self(_mm512_loadu_ps(nodes.as_ptr().cast::<f32>())) }
    }
    #[inline(always)]
    fn of_numbers(numbers: &[f32; 16]) -> Self {
        // SAFETY: `run_wide` checked for AVX-512; the array has the length of the register.
        unsafe { Self(_mm512_loadu_ps(numbers.as_ptr())) }
    }
    #[inline(always)]
    fn store(self) -> [f32x4; 4] {
        let mut nodes = [f32x4::ZERO; 4];
        // SAFETY: `run_wide` checked for AVX-512; the arrays have the length of the registers.
        unsafe { _mm512_storeu_ps(nodes.as_mut_ptr().cast::<f32>(), self.0) };
        nodes
    }
    #[inline(always)]
    fn splat(number: f32) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_set1_ps(number)) }
    }
    #[inline(always)]
    fn repeat(numbers: f32x4) -> Self {
        let numbers = numbers.to_array();
        // SAFETY: `run_wide` checked for AVX-512; the arrays have the length of the registers.
        unsafe { Self(_mm512_broadcast_f32x4(_mm_loadu_ps(numbers.as_ptr()))) }
    }
    #[inline(always)]
    fn of_nodes(numbers: [f32; 4]) -> Self {
        // SAFETY: `run_wide` checked for AVX-512; the arrays have the length of the registers.
        unsafe {
            let node = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
            let numbers = _mm512_castps128_ps512(_mm_loadu_ps(numbers.as_ptr()));
            Self(_mm512_permutexvar_ps(node, numbers))
        }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_add_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_mul_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_div_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_max_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn last_numbers(self) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_permute_ps::<0b11_11_11_11>(self.0)) }
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe { Self(_mm512_fmadd_ps(self.0, factor.0, summand.0)) }
    }
    #[inline(always)]
    fn with_last_node(self, numbers: f32x4) -> Self {
        let numbers = numbers.to_array();
        // SAFETY: `run_wide` checked for AVX-512; the array has the length of the register.
        unsafe {
            let node = _mm_loadu_ps(numbers.as_ptr());
            Self(_mm512_insertf32x4::<3>(self.0, node))
        }
    }
    #[inline(always)]
    fn with_last_numbers(self, numbers: [f32; 4]) -> Self {
        // SAFETY: `run_wide` checked for AVX-512; the array has the length of the register.
        unsafe {
            let node = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
            let numbers = _mm512_castps128_ps512(_mm_loadu_ps(numbers.as_ptr()));
            Self(_mm512_mask_permutexvar_ps(
                self.0,
                0b1000_1000_1000_1000,
                node,
                numbers,
            ))
        }
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self; 4]) -> [f32x4; 4] {
        // SAFETY: `run_wide` checked for AVX-512.
        unsafe {
            let pair = |a: Self, b: Self| {
                let low = _mm512_shuffle_f32x4::<0b01_00_01_00>(a.0, b.0);
                _mm512_add_ps(low, _mm512_shuffle_f32x4::<0b11_10_11_10>(a.0, b.0))
            };
            let (ab, cd) = (pair(a, b), pair(c, d));
            let even = _mm512_shuffle_f32x4::<0b10_00_10_00>(ab, cd);
            let odd = _mm512_shuffle_f32x4::<0b11_01_11_01>(ab, cd);
            Self(_mm512_add_ps(even, odd)).store()
        }
    }
    #[inline(always)]
    fn column(nodes: [&[f32x4; 8]; 2], k: usize) -> Lanes {
        // Number k of the node at each place of the result; the upper half is not used.
        let mut lanes = [0.0; LANES];
        // SAFETY: `run_wide` checked for AVX-512; the arrays have the length of the registers.
        unsafe {
            let first = _mm512_set_epi32(0, 0, 0, 0, 0, 0, 0, 0, 28, 24, 20, 16, 12, 8, 4, 0);
            let places = _mm512_add_epi32(first, _mm512_set1_epi32(k as i32));
            let [one, other] = nodes.map(|nodes| {
                let numbers = nodes.as_ptr().cast::<f32>();
                let (low, high) = (_mm512_loadu_ps(numbers), _mm512_loadu_ps(numbers.add(16)));
                _mm512_castps512_ps256(_mm512_permutex2var_ps(low, places, high))
            });
            let both = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(one), other);
            _mm512_storeu_ps(lanes.as_mut_ptr(), both);
        }
        lanes
    }
    #[inline(always)]
    fn set_column(nodes: &mut [f32x4; 8], k: usize, numbers: &[f32; 8]) {
        // SAFETY: `run_wide` checked for AVX-512; the arrays have the length of the registers.
        unsafe {
            let replaced = 0b0001_0001_0001_0001 << k;
            let values = _mm512_castps256_ps512(_mm256_loadu_ps(numbers.as_ptr()));
            let first = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
            for half in 0..2 {
                let places = _mm512_add_epi32(first, _mm512_set1_epi32(4 * half));
                let four = nodes.as_mut_ptr().add(4 * half as usize).cast::<f32>();
                let old = _mm512_loadu_ps(four);
                let new = _mm512_mask_permutexvar_ps(old, replaced, places, values);
                _mm512_storeu_ps(four, new);
            }
        }
    }
}
