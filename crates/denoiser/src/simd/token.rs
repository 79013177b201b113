//! Which vectors this processor has, and the proof of it.
//!
//! A value of [`Avx2`] or [`Avx512`] exists only where its features were detected, as its one field is private to this
//! file. Whatever asks for such a value can therefore use the features without looking for them again.

/// No vector extension: exists on every processor.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

/// Proof that this processor has AVX2 and FMA: only [`Avx2::detect`] makes one.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

/// Proof that this processor has AVX-512 F, VL, DQ, BW, AVX2 and FMA: only [`Avx512::detect`] makes one.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Avx512(());

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    /// The proof, where this processor has AVX2 and FMA.
    pub(super) fn detect() -> Option<Self> {
        let has_it = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        has_it.then_some(Self(()))
    }
}

#[cfg(target_arch = "x86_64")]
impl Avx512 {
    /// The proof, where this processor has AVX-512 F, VL, DQ, BW, AVX2 and FMA.
    pub(super) fn detect() -> Option<Self> {
        let has_it = Avx2::detect().is_some()
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw");
        has_it.then_some(Self(()))
    }
}
