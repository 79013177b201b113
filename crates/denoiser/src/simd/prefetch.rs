//! Prefetching memory before it is read.
#![allow(unsafe_code)] // an instruction

/// Prefetches the cache line of an address into the first cache; the address need not be valid.
#[inline(always)]
pub(crate) fn prefetch(address: *const f32) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: prefetching has no effect but on time, whatever the address, and every x86-64 processor can.
    unsafe {
        std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}
