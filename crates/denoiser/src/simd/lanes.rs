//! Sixteen values at a time, for element-wise work.
#![allow(unsafe_code)] // vector instructions

use super::token::Plain;
#[cfg(target_arch = "x86_64")]
use super::token::{Avx2, Avx512};
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// Values handled together.
pub(crate) const LANES: usize = 16;

/// Element-wise arithmetic of a level.
///
/// A value of the level is the proof that the processor has its features: only [`token`](super::token) makes one,
/// after it detected them, and every method asks for one. That is what makes the methods sound.
pub(crate) trait Lanes: Copy {
    /// [`LANES`] values in registers.
    type Values: Copy;
    fn get(self, values: &[f32; LANES]) -> Self::Values;
    fn put(self, values: Self::Values, to: &mut [f32; LANES]);
    fn splat(self, value: f32) -> Self::Values;
    fn add(self, a: Self::Values, b: Self::Values) -> Self::Values;
    fn sub(self, a: Self::Values, b: Self::Values) -> Self::Values;
    fn mul(self, a: Self::Values, b: Self::Values) -> Self::Values;
    fn min(self, a: Self::Values, b: Self::Values) -> Self::Values;
    fn max(self, a: Self::Values, b: Self::Values) -> Self::Values;
    /// a · b + c.
    fn fma(self, a: Self::Values, b: Self::Values, c: Self::Values) -> Self::Values;
    /// 1 / a within 2e-7 of it, for normal numbers with normal inverses.
    fn inverse(self, a: Self::Values) -> Self::Values;
    /// 2ⁿ, given n + 1.5 · 2²³ for an integer n in −126..=127.
    fn power_of_two(self, shifted: Self::Values) -> Self::Values;
}

/// Adding and subtracting 1.5 · 2²³ rounds to the nearest integer.
pub(crate) const ROUND: f32 = 12_582_912.0;

impl Lanes for Plain {
    type Values = [f32; LANES];

    #[inline(always)]
    fn get(self, values: &[f32; LANES]) -> Self::Values {
        *values
    }
    #[inline(always)]
    fn put(self, values: Self::Values, to: &mut [f32; LANES]) {
        *to = values;
    }
    #[inline(always)]
    fn splat(self, value: f32) -> Self::Values {
        [value; LANES]
    }
    #[inline(always)]
    fn add(self, a: Self::Values, b: Self::Values) -> Self::Values {
        std::array::from_fn(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(self, a: Self::Values, b: Self::Values) -> Self::Values {
        std::array::from_fn(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(self, a: Self::Values, b: Self::Values) -> Self::Values {
        std::array::from_fn(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn inverse(self, a: Self::Values) -> Self::Values {
        a.map(f32::recip)
    }
    #[inline(always)]
    fn min(self, a: Self::Values, b: Self::Values) -> Self::Values {
        std::array::from_fn(|i| a[i].min(b[i]))
    }
    #[inline(always)]
    fn max(self, a: Self::Values, b: Self::Values) -> Self::Values {
        std::array::from_fn(|i| a[i].max(b[i]))
    }
    #[inline(always)]
    fn fma(self, a: Self::Values, b: Self::Values, c: Self::Values) -> Self::Values {
        std::array::from_fn(|i| a[i] * b[i] + c[i])
    }
    #[inline(always)]
    fn power_of_two(self, shifted: Self::Values) -> Self::Values {
        let of = |v: f32| v.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127) << 23;
        shifted.map(|v| f32::from_bits(of(v)))
    }
}

#[cfg(target_arch = "x86_64")]
macro_rules! avx512 {
    ($($name:ident($($argument:ident),+) = $instruction:ident;)+) => {
        $(#[inline(always)]
        fn $name(self, $($argument: Self::Values),+) -> Self::Values {
            // SAFETY: `self` proves that AVX-512 was detected.
            unsafe { $instruction($($argument),+) }
        })+
    };
}

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx512 {
    type Values = __m512;

    #[inline(always)]
    fn get(self, values: &[f32; LANES]) -> Self::Values {
        // SAFETY: `self` proves that AVX-512 was detected; 16 values are read.
        unsafe { _mm512_loadu_ps(values.as_ptr()) }
    }
    #[inline(always)]
    fn put(self, values: Self::Values, to: &mut [f32; LANES]) {
        // SAFETY: `self` proves that AVX-512 was detected; 16 values are written.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), values) }
    }
    #[inline(always)]
    fn splat(self, value: f32) -> Self::Values {
        // SAFETY: `self` proves that AVX-512 was detected.
        unsafe { _mm512_set1_ps(value) }
    }
    avx512! {
        add(a, b) = _mm512_add_ps;
        sub(a, b) = _mm512_sub_ps;
        mul(a, b) = _mm512_mul_ps;
        min(a, b) = _mm512_min_ps;
        max(a, b) = _mm512_max_ps;
        fma(a, b, c) = _mm512_fmadd_ps;
    }
    #[inline(always)]
    fn inverse(self, a: Self::Values) -> Self::Values {
        // SAFETY: `self` proves that AVX-512 was detected.
        unsafe {
            // 14 bits, and a step of Newton's method
            let near = _mm512_rcp14_ps(a);
            let rest = _mm512_fnmadd_ps(a, near, _mm512_set1_ps(1.0));
            _mm512_fmadd_ps(near, rest, near)
        }
    }
    #[inline(always)]
    fn power_of_two(self, shifted: Self::Values) -> Self::Values {
        // SAFETY: `self` proves that AVX-512 was detected.
        unsafe {
            let n = _mm512_castps_si512(shifted);
            let bias = _mm512_set1_epi32(127_i32.wrapping_sub_unsigned(ROUND.to_bits()));
            _mm512_castsi512_ps(_mm512_slli_epi32::<23>(_mm512_add_epi32(n, bias)))
        }
    }
}

#[cfg(target_arch = "x86_64")]
macro_rules! avx2 {
    ($($name:ident($($argument:ident),+) = $instruction:ident;)+) => {
        $(#[inline(always)]
        fn $name(self, $($argument: Self::Values),+) -> Self::Values {
            // SAFETY: `self` proves that AVX2 and FMA were detected.
            [0, 1].map(|half| unsafe { $instruction($($argument[half]),+) })
        })+
    };
}

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx2 {
    type Values = [__m256; 2];

    #[inline(always)]
    fn get(self, values: &[f32; LANES]) -> Self::Values {
        // SAFETY: `self` proves that AVX2 was detected; each load reads 8 of the 16 values.
        [0, 8].map(|first| unsafe { _mm256_loadu_ps(values.as_ptr().add(first)) })
    }
    #[inline(always)]
    fn put(self, values: Self::Values, to: &mut [f32; LANES]) {
        for (chunk, half) in to.as_chunks_mut::<8>().0.iter_mut().zip(values) {
            // SAFETY: `self` proves that AVX2 was detected; the chunk has 8 values.
            unsafe { _mm256_storeu_ps(chunk.as_mut_ptr(), half) };
        }
    }
    #[inline(always)]
    fn splat(self, value: f32) -> Self::Values {
        // SAFETY: `self` proves that AVX2 was detected.
        [unsafe { _mm256_set1_ps(value) }; 2]
    }
    avx2! {
        add(a, b) = _mm256_add_ps;
        sub(a, b) = _mm256_sub_ps;
        mul(a, b) = _mm256_mul_ps;
        min(a, b) = _mm256_min_ps;
        max(a, b) = _mm256_max_ps;
        fma(a, b, c) = _mm256_fmadd_ps;
    }
    #[inline(always)]
    fn inverse(self, a: Self::Values) -> Self::Values {
        // SAFETY: `self` proves that AVX2 was detected.
        a.map(|half| unsafe { _mm256_div_ps(_mm256_set1_ps(1.0), half) })
    }
    #[inline(always)]
    fn power_of_two(self, shifted: Self::Values) -> Self::Values {
        // SAFETY: `self` proves that AVX2 was detected.
        shifted.map(|half| unsafe {
            let n = _mm256_castps_si256(half);
            let bias = _mm256_set1_epi32(127_i32.wrapping_sub_unsigned(ROUND.to_bits()));
            _mm256_castsi256_ps(_mm256_slli_epi32::<23>(_mm256_add_epi32(n, bias)))
        })
    }
}
