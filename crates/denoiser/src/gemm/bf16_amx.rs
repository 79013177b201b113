//! bf16 products with the tiles of AMX.
//!
//! A tile register holds 16 rows of 64 bytes: 16 rows of x by 32 inputs, 16 pairs of inputs by 16 outputs of weights, or
//! 16 × 16 sums. Two tiles of rows and the two tiles of a panel make four independent sums, which hide the latency of
//! a multiply-add and use every loaded tile twice. The compiler knows nothing of tiles: each block is one piece of
//! assembly, from the loads of its first sums to their stores, and only the configuration lasts from one to the next.
//!
//! Every output starts from its bias and adds, for 32 inputs at a time in order, the sums of the products with the
//! even and with the odd inputs. The instruction takes subnormal numbers for zero.
#![allow(unsafe_code)] // tile instructions

use super::bf16::{Bf16, STEP_PAIRS};
use super::bf16_panels::{Bf16Panels, PairWeights};
use super::job::{Batch, Block, Job, PANEL, Store};
use std::arch::asm;

/// Rows of a tile.
const ROWS: usize = 16;
/// Inputs that are multiplied at a time.
const STEP: usize = 2 * STEP_PAIRS;

/// Whether the processor and the system let this process use tiles with bf16; asks the system for it.
/// The shapes of the tile registers, as LDTILECFG reads them.
#[repr(C, align(64))]
struct Configuration {
    palette: u8,
    start_row: u8,
    reserved: [u8; 14],
    row_bytes: [u16; 16],
    rows: [u8; 16],
}

impl Configuration {
    /// Eight tiles of rows of 64 bytes: sums and x, 0 to 5, with as many rows as are multiplied at a time, and weights.
    fn new(rows: usize) -> Self {
        let (few, all) = (rows as u8, ROWS as u8);
        Self {
            palette: 1,
            start_row: 0,
            reserved: [0; 14],
            row_bytes: [64, 64, 64, 64, 64, 64, 64, 64, 0, 0, 0, 0, 0, 0, 0, 0],
            rows: [
                few, few, few, few, few, few, all, all, 0, 0, 0, 0, 0, 0, 0, 0,
            ],
        }
    }
}

/// Sums of two tiles of rows and one panel.
#[repr(C, align(64))]
struct SumValues([[[f32; PANEL]; ROWS]; 2]);

/// The inputs of some tiles of rows in one step, with zeros for what is beyond the rows.
#[repr(C, align(64))]
struct StepValues<const N: usize>([[[Bf16; STEP]; ROWS]; N]);

/// Where some tiles of rows of x start, and the bytes from a row to the next.
#[derive(Clone, Copy)]
struct Rows<const N: usize> {
    tiles: [*const Bf16; N],
    stride: usize,
}

/// Where the sums of some tiles of rows start, and the bytes from a row to the next.
#[derive(Clone, Copy)]
#[repr(C)]
struct Sums<const N: usize> {
    tiles: [*mut f32; N],
    stride: usize,
}

/// Computes with tiles.
///
/// # Safety
///
/// [`available`](super::amx_available::available) must have been true, and AVX-512 F, BW and VL must have been detected.
#[target_feature(enable = "avx512f,avx512bw,avx512vl")]
pub(super) unsafe fn multiply(panels: &Bf16Panels, job: Job<'_, Bf16>) {
    let Batch {
        candidates, rows, ..
    } = job.batch;
    let per_candidate = rows.div_ceil(ROWS);
    let mut product = Product {
        panels,
        height: rows.min(ROWS),
        per_candidate,
        tiles: per_candidate * candidates,
        aside: SumValues([[[0.0; PANEL]; ROWS]; 2]),
        job,
    };
    if product.tiles == 0 {
        return;
    }
    let configuration = Configuration::new(product.height);
    // SAFETY: tiles are available, and the configuration is a valid one, which all blocks go by.
    unsafe {
        asm!("ldtilecfg [{}]", in(reg) &raw const configuration, options(nostack, readonly));
        for panel in 0..product.job.bias.len() {
            product.panel(panel);
        }
        asm!("tilerelease", options(nostack, nomem));
    }
}

struct Product<'a> {
    panels: &'a Bf16Panels,
    job: Job<'a, Bf16>,
    /// Rows of a tile.
    height: usize,
    /// Tiles of rows of each candidate; the last one may begin within the one before.
    per_candidate: usize,
    /// Tiles of rows of all candidates.
    tiles: usize,
    aside: SumValues,
}

// The unsafe functions need tiles that are available and configured for `height` rows.
impl Product<'_> {
    /// All rows times one panel.
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    unsafe fn panel(&mut self, panel: usize) {
        let in_place = self.has_whole_steps()
            && self.job.columns(panel).len() == PANEL
            && self.job.store == Store::Replace;
        for tile in (0..self.tiles).step_by(2) {
            // SAFETY: tiles are as the caller promises.
            unsafe {
                match (self.tiles - tile, in_place) {
                    (1, true) => self.in_place::<1>(panel, tile),
                    (_, true) => self.in_place::<2>(panel, tile),
                    (1, false) => self.aside::<1>(panel, tile),
                    (_, false) => self.aside::<2>(panel, tile),
                }
            }
        }
    }

    fn has_whole_steps(&self) -> bool {
        self.job.inputs.is_multiple_of(STEP)
    }

    fn block(&self, panel: usize, tile: usize) -> Block {
        let first_row = tile % self.per_candidate * ROWS;
        Block {
            panel,
            candidate: tile / self.per_candidate,
            first_row: first_row.min(self.job.batch.rows - self.height),
            rows: self.height,
        }
    }

    /// Rows of a tile that the tile before it has too.
    fn repeated(&self, tile: usize, block: Block) -> usize {
        tile % self.per_candidate * ROWS - block.first_row
    }

    /// Tiles of rows times full steps of a full panel, with the sums where they are to be in the end.
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    unsafe fn in_place<const N: usize>(&mut self, panel: usize, tile: usize) {
        let blocks: [Block; N] = std::array::from_fn(|i| self.block(panel, tile + i));
        let (out, to) = (self.job.out.as_mut_ptr(), self.job.batch.to);
        let first = |block| to.start(block) + panel * PANEL;
        let to = Sums {
            tiles: blocks.map(|block| out.wrapping_add(first(block))),
            stride: to.row * size_of::<f32>(),
        };
        let (x, weights) = (self.rows(blocks), self.panels.panel(panel));
        // SAFETY: tiles are as the caller promises. All rows of tiles are in the batch, whose rows lie within `x` and
        // `out`; full steps and panels lie within those rows.
        unsafe { add_products(x, weights, self.bias(panel), to) };
    }

    /// Any tiles of rows times a panel, with the sums set aside until the outputs are written.
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    unsafe fn aside<const N: usize>(&mut self, panel: usize, tile: usize) {
        let blocks: [Block; N] = std::array::from_fn(|i| self.block(panel, tile + i));
        let aside = self.aside.0.as_mut_ptr();
        let sums = Sums {
            tiles: std::array::from_fn(|i| aside.wrapping_add(i).cast()),
            stride: size_of::<[f32; PANEL]>(),
        };
        let (mut from, weights) = (self.bias(panel), self.panels.panel(panel));
        if self.has_whole_steps() {
            // SAFETY: tiles are as the caller promises; `x` as in `in_place`, and `aside` has room for two tiles of sums.
            unsafe { add_products(self.rows(blocks), weights, from, sums) };
        } else {
            for (i, weights) in weights.chunks(STEP_PAIRS).enumerate() {
                let step = StepValues::gather(&self.job, blocks, i * STEP);
                // SAFETY: as above; `step` has all inputs of a step.
                unsafe { add_products(step.rows(), weights, from, sums) };
                from = sums;
            }
        }
        for (i, (block, sums)) in blocks.into_iter().zip(&self.aside.0).enumerate() {
            let new = self.repeated(tile + i, block)..block.rows;
            for (row, sums) in new.clone().zip(&sums[new]) {
                self.job.write(block, row, sums);
            }
        }
    }

    /// The bias of a panel in every row; to be read alone.
    fn bias<const N: usize>(&self, panel: usize) -> Sums<N> {
        Sums {
            tiles: [self.job.bias[panel].0.as_ptr().cast_mut(); N],
            stride: 0,
        }
    }

    /// Where the rows of tiles lie.
    fn rows<const N: usize>(&self, blocks: [Block; N]) -> Rows<N> {
        let from = self.job.batch.from;
        let x = self.job.x.as_ptr();
        Rows {
            tiles: blocks.map(|block| x.wrapping_add(from.start(block))),
            stride: from.row * size_of::<Bf16>(),
        }
    }
}

impl<const N: usize> StepValues<N> {
    /// The inputs from `first` on.
    fn gather(job: &Job<'_, Bf16>, blocks: [Block; N], first: usize) -> Self {
        let mut step = Self([[[Bf16::default(); STEP]; ROWS]; N]);
        let count = STEP.min(job.inputs - first);
        for (block, tile) in blocks.into_iter().zip(&mut step.0) {
            for (row, values) in tile.iter_mut().enumerate().take(block.rows) {
                let x = &job.input(block, row)[first..];
                values[..count].copy_from_slice(&x[..count]);
            }
        }
        step
    }

    fn rows(&self) -> Rows<N> {
        Rows {
            tiles: self.0.each_ref().map(|tile| tile.as_ptr().cast()),
            stride: size_of::<[Bf16; STEP]>(),
        }
    }
}

/// The assembly for a number of tiles of rows: loads of the first sums, a step, and stores of the last sums.
macro_rules! add_products {
    (($x:ident, $weights:ident, $from:ident, $to:ident),
     from: $($from_line:literal)*, step: $($step_line:literal)*, to: $($to_line:literal)*,
     x: $($name:ident $index:literal)*) => {
        asm!(
            $($from_line,)*
            "2:",
            $($step_line,)*
            $(concat!("add {", stringify!($name), "}, 64"),)*
            "add {weights}, 2048",
            "dec {steps}",
            "jnz 2b",
            $($to_line,)*
            $($name = inout(reg) $x.tiles[$index] => _,)*
            x_stride = in(reg) $x.stride,
            weights = inout(reg) $weights.as_ptr() => _,
            weights_stride = in(reg) size_of::<PairWeights>(),
            steps = inout(reg) $weights.len() / STEP_PAIRS => _,
            from = in(reg) &raw const $from,
            to = in(reg) &raw const $to,
            sums = out(reg) _,
            sums_stride = out(reg) _,
            out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
            out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
            options(nostack),
        )
    };
}

/// Adds the products of x and the weights, at least of one step, to the sums in `from` and stores them in `to`.
///
/// # Safety
///
/// Tiles must be available and configured, and the rows of each valid that they are configured for: as many inputs as
/// there are weights to read in `x`, 32 sums to read in `from` and to write in `to`. `N` is 1 or 2.
unsafe fn add_products<const N: usize>(
    x: Rows<N>,
    weights: &[PairWeights],
    from: Sums<N>,
    to: Sums<N>,
) {
    // SAFETY: what is read and written is as the caller promises, and as many weights as there are.
    unsafe {
        match N {
            1 => add_products!((x, weights, from, to),
                from:
                    "mov {sums_stride}, [{from} + 8]"
                    "mov {sums}, [{from}]"
                    "tileloadd tmm0, [{sums} + {sums_stride}]"
                    "tileloadd tmm1, [{sums} + {sums_stride} + 64]",
                step:
                    "tileloadd tmm4, [{x0} + {x_stride}]"
                    "tileloadd tmm6, [{weights} + {weights_stride}]"
                    "tdpbf16ps tmm0, tmm4, tmm6"
                    "tileloadd tmm7, [{weights} + {weights_stride} + 64]"
                    "tdpbf16ps tmm1, tmm4, tmm7",
                to:
                    "mov {sums_stride}, [{to} + 8]"
                    "mov {sums}, [{to}]"
                    "tilestored [{sums} + {sums_stride}], tmm0"
                    "tilestored [{sums} + {sums_stride} + 64], tmm1",
                x: x0 0
            ),
            2 => add_products!((x, weights, from, to),
                from:
                    "mov {sums_stride}, [{from} + 16]"
                    "mov {sums}, [{from}]"
                    "tileloadd tmm0, [{sums} + {sums_stride}]"
                    "tileloadd tmm1, [{sums} + {sums_stride} + 64]"
                    "mov {sums}, [{from} + 8]"
                    "tileloadd tmm2, [{sums} + {sums_stride}]"
                    "tileloadd tmm3, [{sums} + {sums_stride} + 64]",
                step:
                    "tileloadd tmm6, [{weights} + {weights_stride}]"
                    "tileloadd tmm4, [{x0} + {x_stride}]"
                    "tdpbf16ps tmm0, tmm4, tmm6"
                    "tileloadd tmm7, [{weights} + {weights_stride} + 64]"
                    "tdpbf16ps tmm1, tmm4, tmm7"
                    "tileloadd tmm5, [{x1} + {x_stride}]"
                    "tdpbf16ps tmm2, tmm5, tmm6"
                    "tdpbf16ps tmm3, tmm5, tmm7",
                to:
                    "mov {sums_stride}, [{to} + 16]"
                    "mov {sums}, [{to}]"
                    "tilestored [{sums} + {sums_stride}], tmm0"
                    "tilestored [{sums} + {sums_stride} + 64], tmm1"
                    "mov {sums}, [{to} + 8]"
                    "tilestored [{sums} + {sums_stride}], tmm2"
                    "tilestored [{sums} + {sums_stride} + 64], tmm3",
                x: x0 0 x1 1
            ),
            _ => unreachable!("one or two tiles of rows, not {N}"),
        }
    }
}
