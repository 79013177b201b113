//! The vector–Jacobian product of the network with respect to its input paths.

use super::block::Entrance;
use super::dimensions::{FRAME, PATH, STAGES};
use super::network::{TemporalUnet, UnetScratch};
use crate::gemm::Store;
use crate::layers::convolution::Rows;
use crate::layers::factors::Factors;
use crate::layers::group_norm;

impl TemporalUnet {
    /// The gradient of Σ cotangent · noise with respect to the paths of the last [`Self::predict`] with this scratch.
    ///
    /// Both are candidates × 64 × 6.
    ///
    /// # Panics
    /// If the lengths are not those of the last [`Self::predict`].
    pub fn pull_back(&self, scratch: &mut UnetScratch, cotangent: &[f32], gradient: &mut [f32]) {
        let length = scratch.noise.candidates() * PATH;
        assert_eq!(cotangent.len(), length, "a cotangent for each noise value");
        assert_eq!(gradient.len(), length, "a gradient for each path value");
        self.leave(scratch, cotangent);
        for index in (0..STAGES).rev() {
            let s = &mut *scratch;
            let g = &mut s.gradient;
            let (before, own) = g.stages.split_at_mut(index);
            let (films, tape) = (&s.films.films[index], &s.tapes[index]);
            let stage = &self.stages[index];
            let factors = &mut s.work.factors;
            stage.pull_back(films, tape, factors, &mut g.work, &mut own[0]);
            pull_back_entrance(
                &stage.entrance,
                &own[0],
                factors,
                before,
                (&mut g.grown, &mut g.input),
            );
        }
        let rows = scratch.gradient.input.each();
        for (gradient, rows) in gradient.chunks_exact_mut(PATH).zip(rows) {
            let channels = rows.len() * FRAME / PATH;
            let frames = gradient.chunks_exact_mut(FRAME);
            for (gradient, row) in frames.zip(rows.chunks_exact(channels)) {
                gradient.copy_from_slice(&row[..FRAME]);
            }
        }
    }

    /// Carries the gradient from the noise back to the output of the last stage.
    fn leave(&self, s: &mut UnetScratch, cotangent: &[f32]) {
        let g = &mut s.gradient;
        g.cotangent
            .shape(s.noise.candidates(), s.noise.height(), FRAME);
        for (rows, cotangent) in g.cotangent.each_mut().zip(cotangent.chunks_exact(PATH)) {
            rows.copy_from_slice(cotangent);
        }
        let last = &mut g.stages[STAGES - 1];
        self.final_convolution
            .backward
            .apply(&g.cotangent, &mut s.work.factors, last);
        let out = s.tapes[STAGES - 1].out();
        group_norm::pull_back(
            out,
            &self.final_norm,
            &s.statistics,
            last,
            None,
            &mut g.work.sums,
        );
    }
}

/// Carries the gradient from a stage's entry back to the outputs of the stages that it comes from.
fn pull_back_entrance(
    entrance: &Entrance,
    entry: &Rows,
    factors: &mut Factors,
    before: &mut [Rows],
    (grown, input): (&mut Rows, &mut Rows),
) {
    match entrance {
        Entrance::Stem(convolution) => convolution.backward.apply(entry, factors, input),
        // the stage before has a gradient already, from where its output was taken beside
        Entrance::Shrink(convolution) => {
            let output = &mut before[before.len() - 1];
            convolution.backward.run(entry, factors, output, Store::Add);
        }
        Entrance::Straight => before[before.len() - 1].copy(entry),
        Entrance::Grow {
            convolution,
            beside,
        } => {
            let channels = entry.channels() / 2;
            for (rows, first) in [(&mut *grown, 0), (&mut before[*beside], channels)] {
                rows.shape(entry.candidates(), entry.height(), channels);
                rows.copy_channels(0, entry, first, channels);
            }
            convolution
                .backward
                .apply(grown, factors, &mut before[before.len() - 1]);
        }
    }
}
