//! Whether AMX may be used.
#![allow(unsafe_code)] // asking the system and the processor for tiles

#[cfg(target_os = "linux")]
use std::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};

#[cfg(target_os = "linux")]
pub(super) fn available() -> bool {
    const TILE_AND_BF16: u32 = 1 << 24 | 1 << 22;
    const OSXSAVE: u32 = 1 << 27;
    if __cpuid(0).eax < 7 || __cpuid(1).ecx & OSXSAVE == 0 {
        return false;
    }
    __cpuid_count(7, 0).edx & TILE_AND_BF16 == TILE_AND_BF16
        // SAFETY: the system has enabled XGETBV, as OSXSAVE tells.
        && unsafe { tile_state_enabled() }
        && permitted()
}

#[cfg(not(target_os = "linux"))]
pub(super) fn available() -> bool {
    false
}

/// Whether the system saves the tiles of a thread.
#[cfg(target_os = "linux")]
#[target_feature(enable = "xsave")]
fn tile_state_enabled() -> bool {
    const CONFIGURATION_AND_DATA: u64 = 1 << 17 | 1 << 18;
    // SAFETY: register 0 exists where XGETBV does.
    unsafe { _xgetbv(0) & CONFIGURATION_AND_DATA == CONFIGURATION_AND_DATA }
}

/// Asks Linux to let this process use tiles: `arch_prctl(ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA)`, see the kernel's
/// documentation, "Using XSTATE features in user space applications".
#[cfg(target_os = "linux")]
fn permitted() -> bool {
    const ARCH_REQ_XCOMP_PERM: libc::c_ulong = 0x1023;
    const XFEATURE_XTILEDATA: libc::c_ulong = 18;
    // SAFETY: the call takes two numbers and touches no memory of ours.
    let result = unsafe {
        libc::syscall(
            libc::SYS_arch_prctl,
            ARCH_REQ_XCOMP_PERM,
            XFEATURE_XTILEDATA,
        )
    };
    result == 0
}
