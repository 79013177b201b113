//! Residual blocks, and the stages of two blocks that the network consists of.

use crate::gemm::{Precision, Store};
use crate::layers::convolution::{Convolution, Kind, Rows};
use crate::layers::factors::Factors;
use crate::layers::group_norm::{self, Affine, Statistics};
use crate::layers::linear::Linear;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// Two convolutions, each behind a normalisation and SiLU, beside a skip connection; the context scales and shifts the
/// second normalisation (FiLM: Perez et al., AAAI 2018).
pub(super) struct ResidualBlock {
    norm1: Affine,
    conv1: Convolution,
    film: Linear,
    norm2: Affine,
    conv2: Convolution,
    /// The convolution beside the block, where input and output differ in channels.
    skip: Option<Convolution>,
}

/// What a block's last forward pass stored for its gradient.
#[derive(Default)]
pub(super) struct BlockTape {
    statistics: [Statistics; 2],
    hidden: Rows,
    pub(super) out: Rows,
}

/// Buffers that all blocks use one after the other.
#[derive(Default)]
pub(super) struct Work {
    pub(super) factors: Factors,
    pub(super) activated: Rows,
}

/// Buffers of the gradient that all blocks use one after the other.
#[derive(Default)]
pub(super) struct GradientWork {
    inner: Rows,
    outer: Rows,
    pub(super) sums: [Vec<f32>; 2],
}

impl ResidualBlock {
    pub(super) fn load(
        file: &WeightsFile,
        name: &str,
        (inputs, outputs): (usize, usize),
        context: usize,
    ) -> Result<Self, WeightsError> {
        let part = |part: &str| format!("{name}.{part}");
        let same = |name, inputs| Convolution::load(file, name, Kind::Same, inputs, outputs);
        let skip = || Convolution::load(file, &part("skip"), Kind::Point, inputs, outputs);
        Ok(Self {
            norm1: Affine::load(file, &part("norm1"), inputs)?,
            conv1: same(&part("conv1"), inputs)?,
            film: Linear::load(file, &part("film"), context, 2 * outputs)?,
            norm2: Affine::load(file, &part("norm2"), outputs)?,
            conv2: same(&part("conv2"), outputs)?,
            skip: (inputs != outputs).then(skip).transpose()?,
        })
    }

    /// Writes the second normalisation's factors and summands for each of some contexts.
    pub(super) fn modulate<'a>(
        &self,
        contexts: &[f32],
        work: &mut Vec<f32>,
        films: impl ExactSizeIterator<Item = &'a mut Affine>,
    ) {
        let Affine { gain, offset } = &self.norm2;
        let channels = gain.len();
        work.resize(films.len() * 2 * channels, 0.0);
        self.film.apply(contexts, work);
        for (film, scale_and_shift) in films.zip(work.chunks_exact(2 * channels)) {
            let (scale, shift) = scale_and_shift.split_at(channels);
            film.gain.clear();
            film.gain
                .extend(gain.iter().zip(scale).map(|(g, s)| g * (1.0 + s)));
            film.offset.clear();
            let scaled = offset.iter().zip(scale).map(|(o, s)| o * (1.0 + s));
            film.offset.extend(scaled.zip(shift).map(|(o, s)| o + s));
        }
    }

    /// Computes `tape.out` from `x`.
    pub(super) fn apply(&self, x: &Rows, film: &Affine, work: &mut Work, tape: &mut BlockTape) {
        let Work { factors, activated } = work;
        let [first, second] = &mut tape.statistics;
        let straight = self.skip.is_none().then_some(&mut tape.out);
        group_norm::apply(x, &self.norm1, first, activated, straight);
        self.conv1
            .forward
            .apply(activated, factors, &mut tape.hidden);
        group_norm::apply(&tape.hidden, film, second, activated, None);
        if let Some(skip) = &self.skip {
            skip.forward.apply(x, factors, &mut tape.out);
        }
        self.conv2
            .forward
            .run(activated, factors, &mut tape.out, Store::Add);
    }

    /// Turns the gradient with respect to the output, in place, into that with respect to the input `x`.
    pub(super) fn pull_back(
        &self,
        x: &Rows,
        film: &Affine,
        tape: &BlockTape,
        factors: &mut Factors,
        work: &mut GradientWork,
        gradient: &mut Rows,
    ) {
        let GradientWork { inner, outer, sums } = work;
        let [first, second] = &tape.statistics;
        self.conv2.backward.apply(gradient, factors, inner);
        group_norm::pull_back(&tape.hidden, film, second, inner, None, sums);
        self.conv1.backward.apply(inner, factors, outer);
        let straight = self.skip.is_none().then_some(&*gradient);
        group_norm::pull_back(x, &self.norm1, first, outer, straight, sums);
        if let Some(skip) = &self.skip {
            skip.backward.run(gradient, factors, outer, Store::Add);
        }
        std::mem::swap(outer, gradient);
    }
}

/// How a stage gets its input from what is before it.
pub(super) enum Entrance {
    /// From the network's input.
    Stem(Convolution),
    /// From the stage before, at half its height.
    Shrink(Convolution),
    /// From the stage before as it is.
    Straight,
    /// From the stage before at twice its height, beside the output of an earlier stage of that height.
    Grow {
        convolution: Convolution,
        beside: usize,
    },
}

/// Two residual blocks at one height.
pub(super) struct Stage {
    pub(super) entrance: Entrance,
    pub(super) blocks: [ResidualBlock; 2],
}

/// What a stage's last forward pass stored for its gradient.
#[derive(Default)]
pub(super) struct StageTape {
    pub(super) entry: Rows,
    pub(super) blocks: [BlockTape; 2],
}

impl StageTape {
    pub(super) fn out(&self) -> &Rows {
        &self.blocks[1].out
    }
}

impl Stage {
    pub(super) fn prepare(&self, precision: Precision) {
        match &self.entrance {
            Entrance::Straight => {}
            Entrance::Stem(convolution)
            | Entrance::Shrink(convolution)
            | Entrance::Grow { convolution, .. } => convolution.prepare(precision),
        }
        for block in &self.blocks {
            let convolutions = [&block.conv1, &block.conv2].into_iter();
            convolutions
                .chain(&block.skip)
                .for_each(|convolution| convolution.prepare(precision));
        }
    }

    /// Computes this stage's tape from the network's input and the tapes of the stages before.
    pub(super) fn apply(
        &self,
        input: &Rows,
        before: &[StageTape],
        films: &[Affine; 2],
        work: &mut Work,
        tape: &mut StageTape,
    ) {
        self.enter(input, before, &mut work.factors, &mut tape.entry);
        let [first, second] = &mut tape.blocks;
        self.blocks[0].apply(&tape.entry, &films[0], work, first);
        self.blocks[1].apply(&first.out, &films[1], work, second);
    }

    fn enter(&self, input: &Rows, before: &[StageTape], factors: &mut Factors, entry: &mut Rows) {
        let previous = before.last().map(StageTape::out);
        let previous = || previous.expect("only a stem has nothing before it");
        match &self.entrance {
            Entrance::Stem(convolution) => convolution.forward.apply(input, factors, entry),
            Entrance::Shrink(convolution) => convolution.forward.apply(previous(), factors, entry),
            Entrance::Straight => entry.copy(previous()),
            Entrance::Grow {
                convolution,
                beside,
            } => {
                let beside = before[*beside].out();
                let channels = beside.channels();
                entry.shape(beside.candidates(), beside.height(), 2 * channels);
                convolution
                    .forward
                    .run(previous(), factors, entry, Store::Replace);
                entry.copy_channels(channels, beside, 0, channels);
            }
        }
    }

    /// Turns the gradient with respect to the output, in place, into that with respect to the entry.
    pub(super) fn pull_back(
        &self,
        films: &[Affine; 2],
        tape: &StageTape,
        factors: &mut Factors,
        work: &mut GradientWork,
        gradient: &mut Rows,
    ) {
        let [first, second] = &tape.blocks;
        self.blocks[1].pull_back(&first.out, &films[1], second, factors, work, gradient);
        self.blocks[0].pull_back(&tape.entry, &films[0], first, factors, work, gradient);
    }
}
