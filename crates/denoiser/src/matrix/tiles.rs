//! bf16 products with the tiles of AMX.
//!
//! A tile register holds 16 rows of 64 bytes: 16 rows of x by 32 inputs, 16 pairs of inputs by 16 outputs of weights, or
//! 16 × 16 sums. Two tiles of rows and the two tiles of a panel make four independent sums, which hide the latency of
//! a multiply-add and use every loaded tile twice. The compiler knows nothing of tiles: each block is one piece of
//! assembly, from the loads of its first sums to their stores, and only the configuration lasts from one to the next.
//!
//! Every output starts from its bias and adds, for 32 inputs at a time in order, the sums of the products with the
//! even and with the odd inputs. The instruction takes subnormal numbers for zero.
#![allow(unsafe_code)] // tile instructions, asking the kernel and the processor for them

use super::brain::{Brain, BrainPanels, PairWeights, STEP_PAIRS};
use super::{Batch, Block, Job, PANEL, Store};
use std::arch::asm;
use std::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};

/// Rows of a tile.
const ROWS: usize = 16;
/// Inputs that are multiplied at a time.
const STEP: usize = 2 * STEP_PAIRS;

/// Whether the processor and the system let this process use tiles with bf16; asks the system for it.
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

/// The shapes of the tile registers, as LDTILECFG reads them.
#[repr(C, align(64))]
struct Configuration {
    palette: u8,
    start_row: u8,
    reserved: [u8; 14],
    row_bytes: [u16; 16],
    rows: [u8; 16],
}

/// Eight tiles of 16 rows of 64 bytes.
static CONFIGURATION: Configuration = Configuration {
    palette: 1,
    start_row: 0,
    reserved: [0; 14],
    row_bytes: [64, 64, 64, 64, 64, 64, 64, 64, 0, 0, 0, 0, 0, 0, 0, 0],
    rows: [16, 16, 16, 16, 16, 16, 16, 16, 0, 0, 0, 0, 0, 0, 0, 0],
};

/// Sums of two tiles of rows and one panel.
#[repr(C, align(64))]
struct SumValues([[[f32; PANEL]; ROWS]; 2]);

/// The inputs of two tiles of rows in one step, with zeros for what is beyond the rows.
#[repr(C, align(64))]
struct StepValues([[[Brain; STEP]; ROWS]; 2]);

/// Computes with tiles.
///
/// # Safety
///
/// [`available`] must have said that there are any.
pub(super) unsafe fn multiply(panels: &BrainPanels, mut job: Job<'_, Brain>) {
    // SAFETY: tiles are available, and the configuration is a valid one.
    unsafe { asm!("ldtilecfg [{}]", in(reg) &raw const CONFIGURATION, options(nostack, readonly)) };
    let Batch {
        candidates, rows, ..
    } = job.batch;
    let per_candidate = rows.div_ceil(ROWS);
    let tiles = per_candidate * candidates;
    for panel in 0..job.bias.len().div_ceil(PANEL) {
        let block = |tile: usize| {
            let first_row = tile % per_candidate * ROWS;
            Block {
                panel,
                candidate: tile / per_candidate,
                first_row,
                rows: ROWS.min(rows - first_row),
            }
        };
        for first in (0..tiles).step_by(2) {
            let blocks = [first, (first + 1).min(tiles - 1)].map(block);
            // SAFETY: tiles are available, and configured as `CONFIGURATION`.
            unsafe { pair(panels, &mut job, blocks) };
        }
    }
    // SAFETY: tiles are available; nothing is expected to stay in them.
    unsafe { asm!("tilerelease", options(nostack, nomem)) };
}

/// Two tiles of rows, which may be the same one, times one panel.
///
/// # Safety
///
/// Tiles must be available and configured as [`CONFIGURATION`].
unsafe fn pair(panels: &BrainPanels, job: &mut Job<'_, Brain>, blocks: [Block; 2]) {
    let columns = job.columns(blocks[0].panel);
    let weights = panels.panel(blocks[0].panel);
    let mut bias = [0.0; PANEL];
    bias[..columns.len()].copy_from_slice(&job.bias[columns.clone()]);
    let whole_rows = blocks.iter().all(|block| block.rows == ROWS);
    let whole_steps = if whole_rows { panels.inputs / STEP } else { 0 };
    let (weights, rest) = weights.split_at(whole_steps * STEP_PAIRS);
    let x = Rows {
        tiles: blocks.map(|block| job.x.as_ptr().wrapping_add(job.batch.from.start(block))),
        stride: job.batch.from.row * size_of::<Brain>(),
    };
    if rest.is_empty() && columns.len() == PANEL && job.store == Store::Replace {
        let from = Sums {
            tiles: [bias.as_mut_ptr(); 2],
            stride: 0,
        };
        let out = job.out.as_mut_ptr();
        let first = |block| job.batch.to.start(block) + columns.start;
        let to = Sums {
            tiles: blocks.map(|block| out.wrapping_add(first(block))),
            stride: job.batch.to.row * size_of::<f32>(),
        };
        // SAFETY: tiles are as the caller promises. All 16 rows of both blocks are in the batch, whose rows lie within
        // `x` and `out`; the inputs of whole steps and the columns lie within those rows.
        unsafe { add_products(x, weights, from, to) };
        return;
    }
    let mut sums = SumValues([[bias; ROWS]; 2]);
    let place = Sums {
        tiles: sums.0.each_mut().map(|tile| tile.as_mut_ptr().cast()),
        stride: size_of::<[f32; PANEL]>(),
    };
    if whole_steps > 0 {
        // SAFETY: as above, and `sums` has place for all sums.
        unsafe { add_products(x, weights, place, place) };
    }
    for (i, weights) in rest.chunks_exact(STEP_PAIRS).enumerate() {
        let step = StepValues::gather(job, blocks, panels.inputs, (whole_steps + i) * STEP);
        let x = Rows {
            tiles: step.0.each_ref().map(|tile| tile.as_ptr().cast()),
            stride: size_of::<[Brain; STEP]>(),
        };
        // SAFETY: tiles are as the caller promises; `step` has all inputs of a step, and `sums` place for all sums.
        unsafe { add_products(x, weights, place, place) };
    }
    let different = if blocks[0] == blocks[1] { 1 } else { 2 };
    for (block, sums) in blocks.into_iter().zip(&sums.0).take(different) {
        for (row, sums) in sums.iter().enumerate().take(block.rows) {
            job.write(block, row, sums);
        }
    }
}

impl StepValues {
    /// The inputs from `first` on.
    fn gather(job: &Job<'_, Brain>, blocks: [Block; 2], inputs: usize, first: usize) -> Self {
        let mut step = Self([[[Brain::default(); STEP]; ROWS]; 2]);
        let count = STEP.min(inputs - first);
        for (block, tile) in blocks.into_iter().zip(&mut step.0) {
            for (row, values) in tile.iter_mut().enumerate().take(block.rows) {
                let x = &job.input(block, row, inputs)[first..];
                values[..count].copy_from_slice(&x[..count]);
            }
        }
        step
    }
}

/// Where two tiles of rows of x start, and the bytes from a row to the next.
#[derive(Clone, Copy)]
struct Rows {
    tiles: [*const Brain; 2],
    stride: usize,
}

/// Where the sums of two tiles of rows start, and the bytes from a row to the next.
#[derive(Clone, Copy)]
struct Sums {
    tiles: [*mut f32; 2],
    stride: usize,
}

/// Adds the products of x and whole steps of weights, at least one, to the sums in `from` and stores them in `to`.
///
/// # Safety
///
/// Tiles must be available and configured as [`CONFIGURATION`]. 16 rows of each tile must be valid: as many inputs as
/// there are weights to read in `x`, 32 sums to read in `from` and to write in `to`.
unsafe fn add_products(x: Rows, weights: &[PairWeights], from: Sums, to: Sums) {
    // SAFETY: what is read and written is as the caller promises, and as many weights as there are.
    unsafe {
        asm!(
            "tileloadd tmm0, [{from0} + {from_stride}]",
            "tileloadd tmm1, [{from0} + {from_stride} + 64]",
            "tileloadd tmm2, [{from1} + {from_stride}]",
            "tileloadd tmm3, [{from1} + {from_stride} + 64]",
            "2:",
            "tileloadd tmm6, [{weights} + {weights_stride}]",
            "tileloadd tmm4, [{x0} + {x_stride}]",
            "tdpbf16ps tmm0, tmm4, tmm6",
            "tileloadd tmm7, [{weights} + {weights_stride} + 64]",
            "tdpbf16ps tmm1, tmm4, tmm7",
            "tileloadd tmm5, [{x1} + {x_stride}]",
            "tdpbf16ps tmm2, tmm5, tmm6",
            "tdpbf16ps tmm3, tmm5, tmm7",
            "add {x0}, 64",
            "add {x1}, 64",
            "add {weights}, 2048",
            "dec {steps}",
            "jnz 2b",
            "tilestored [{to0} + {to_stride}], tmm0",
            "tilestored [{to0} + {to_stride} + 64], tmm1",
            "tilestored [{to1} + {to_stride}], tmm2",
            "tilestored [{to1} + {to_stride} + 64], tmm3",
            x0 = inout(reg) x.tiles[0] => _,
            x1 = inout(reg) x.tiles[1] => _,
            x_stride = in(reg) x.stride,
            weights = inout(reg) weights.as_ptr() => _,
            weights_stride = in(reg) size_of::<PairWeights>(),
            steps = inout(reg) weights.len() / STEP_PAIRS => _,
            from0 = in(reg) from.tiles[0],
            from1 = in(reg) from.tiles[1],
            from_stride = in(reg) from.stride,
            to0 = in(reg) to.tiles[0],
            to1 = in(reg) to.tiles[1],
            to_stride = in(reg) to.stride,
            out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
            out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
            options(nostack),
        );
    }
}
