//! The network: its weights, its buffers and its prediction.

use super::block::{Entrance, ResidualBlock, Stage, StageTape, Work};
use super::dimensions::{ARCHITECTURE, FRAME, HORIZON, INPUTS, PATH, SCHEDULE, STAGES};
use super::embedding::{Embedding, EmbeddingWork};
use super::gradient_scratch::GradientScratch;
use super::graph::{Node, ObstacleGraph};
use super::normalisation::Normalisation;
use crate::diffusion::STEPS;
use crate::gemm::Precision;
use crate::layers::convolution::{Convolution, Kind, Rows};
use crate::layers::group_norm::{self, Affine, Statistics};
use crate::simd::lanes::LANES;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// Start, goal and balls of a request, embedded once for all its diffusion steps.
pub struct UnetCondition {
    /// Sum of the embeddings of start, goal and balls.
    request: Vec<f32>,
    prepared: Vec<Films>,
}

/// The factors and summands (FiLM) by which a diffusion step changes the second normalisation of every block.
pub(super) struct Films {
    step: f32,
    pub(super) films: [[Affine; 2]; STAGES],
}

impl Default for Films {
    fn default() -> Self {
        Self {
            step: f32::NAN,
            films: Default::default(),
        }
    }
}

/// Buffers of [`TemporalUnet::predict`] and its gradient; after the first call of a size nothing is allocated.
#[derive(Default)]
pub struct UnetScratch {
    embedding: EmbeddingWork,
    contexts: Vec<f32>,
    modulation: Vec<f32>,
    pub(super) films: Films,
    input: Rows,
    pub(super) tapes: [StageTape; STAGES],
    pub(super) work: Work,
    pub(super) statistics: Statistics,
    pub(super) noise: Rows,
    pub(super) gradient: GradientScratch,
}

/// The temporal U-Net with its weights.
pub struct TemporalUnet {
    normalisation: Normalisation,
    embedding: Embedding,
    graph: ObstacleGraph,
    pub(super) stages: [Stage; STAGES],
    pub(super) final_norm: Affine,
    pub(super) final_convolution: Convolution,
}

impl TemporalUnet {
    /// Takes the network from a weights file, for a robot with three equal sections and this bending limit (rad).
    ///
    /// # Errors
    /// [`WeightsError`]: another architecture, another robot, or a tensor that does not fit.
    pub fn load(file: &WeightsFile, bending_limit: f64) -> Result<Self, WeightsError> {
        file.expect("architecture", ARCHITECTURE)?;
        file.expect("horizon", &HORIZON.to_string())?;
        file.expect("steps", &STEPS.to_string())?;
        file.expect("schedule", SCHEDULE)?;
        file.expect_robot(bending_limit)?;
        let width = file.count("width")?;
        if width % LANES != 0 {
            return Err(file.refused_entry("width", format!("a multiple of {LANES}")));
        }
        let context = file.count("context")?;
        Ok(Self {
            normalisation: Normalisation::load(file)?,
            embedding: Embedding::load(file, width, context)?,
            graph: ObstacleGraph::load(file, file.count("graph_hidden")?, context)?,
            stages: load_stages(file, width, context)?,
            final_norm: Affine::load(file, "final.norm", width)?,
            final_convolution: Convolution::load(file, "final.conv", Kind::Same, width, FRAME)?,
        })
    }

    /// The map between physical quantities and the network's.
    #[must_use]
    pub fn normalisation(&self) -> &Normalisation {
        &self.normalisation
    }

    /// Packs the weights for a precision now, so that no prediction needs to.
    pub fn prepare_precision(&self, precision: Precision) {
        self.final_convolution.prepare(precision);
        for stage in &self.stages {
            stage.prepare(precision);
        }
    }

    /// Embeds a request: the start configuration, the target position and the balls (x, y, z, radius), all in the units
    /// of the data that the weights were trained on.
    #[must_use]
    pub fn condition(
        &self,
        start: &[f32; FRAME],
        target: &[f32; 3],
        balls: &[[f32; 4]],
    ) -> UnetCondition {
        let start = self.normalisation.configuration(start);
        let target = self.normalisation.position(*target);
        let nodes: Vec<Node> = balls.iter().map(|b| self.normalisation.ball(b)).collect();
        let mut request = self.embedding.ends(&start, &target);
        let graph = self.graph.apply(&nodes);
        request.iter_mut().zip(graph).for_each(|(r, g)| *r += g);
        UnetCondition {
            request,
            prepared: Vec::new(),
        }
    }

    /// Computes the condition's factors and summands for some diffusion steps (0..=999) at once, which [`Self::predict`]
    /// otherwise does in each call; its results do not depend on it, bit for bit.
    pub fn prepare(&self, condition: &mut UnetCondition, steps: &[f32]) {
        condition.prepared.clear();
        condition.prepared.resize_with(steps.len(), Films::default);
        let mut s = UnetScratch::default();
        self.modulate(&condition.request, steps, &mut s, &mut condition.prepared);
    }

    /// Estimates the noise (candidates × 64 × 6) in normalised paths of the same shape at a diffusion step (0..=999).
    ///
    /// # Panics
    /// If a length does not fit, or the precision is not [available](Precision::available).
    pub fn predict(
        &self,
        condition: &UnetCondition,
        step: f32,
        paths: &[f32],
        precision: Precision,
        scratch: &mut UnetScratch,
        noise: &mut [f32],
    ) {
        let s = scratch;
        assert_eq!(paths.len() % PATH, 0, "384 values a candidate");
        assert_eq!(noise.len(), paths.len(), "as much noise as paths");
        s.work.factors.set_precision(precision);
        self.set_films(condition, step, s);
        enter(paths, &mut s.input);
        for (index, stage) in self.stages.iter().enumerate() {
            let (before, tape) = s.tapes.split_at_mut(index);
            let films = &s.films.films[index];
            stage.apply(&s.input, before, films, &mut s.work, &mut tape[0]);
        }
        let out = s.tapes[STAGES - 1].out();
        let Work { factors, activated } = &mut s.work;
        group_norm::apply(out, &self.final_norm, &mut s.statistics, activated, None);
        self.final_convolution
            .forward
            .apply(activated, factors, &mut s.noise);
        for (noise, rows) in noise.chunks_exact_mut(PATH).zip(s.noise.each()) {
            noise.copy_from_slice(rows);
        }
    }

    fn set_films(&self, condition: &UnetCondition, step: f32, s: &mut UnetScratch) {
        match condition.prepared.iter().find(|p| p.step == step) {
            Some(prepared) => s.films.copy(prepared),
            None => {
                let mut films = std::mem::take(&mut s.films);
                let only = std::slice::from_mut(&mut films);
                self.modulate(&condition.request, &[step], s, only);
                s.films = films;
            }
        }
    }

    /// Writes the factors and summands of each step.
    fn modulate(&self, request: &[f32], steps: &[f32], s: &mut UnetScratch, films: &mut [Films]) {
        let (work, contexts) = (&mut s.embedding, &mut s.contexts);
        self.embedding.contexts(request, steps, work, contexts);
        for (films, step) in films.iter_mut().zip(steps) {
            films.step = *step;
        }
        for (index, stage) in self.stages.iter().enumerate() {
            for (half, block) in stage.blocks.iter().enumerate() {
                let films = films.iter_mut().map(|f| &mut f.films[index][half]);
                block.modulate(contexts, &mut s.modulation, films);
            }
        }
    }
}

impl Films {
    fn copy(&mut self, source: &Self) {
        self.step = source.step;
        let affines = self.films.as_flattened_mut().iter_mut();
        for (to, from) in affines.zip(source.films.as_flattened()) {
            to.gain.clone_from(&from.gain);
            to.offset.clone_from(&from.offset);
        }
    }
}

fn load_stages(
    file: &WeightsFile,
    width: usize,
    context: usize,
) -> Result<[Stage; STAGES], WeightsError> {
    let c = [width, 2 * width, 4 * width];
    let convolution =
        |name, kind, inputs, outputs| Convolution::load(file, name, kind, inputs, outputs);
    let shrink = |name, channels| {
        let convolution = convolution(name, Kind::Shrink, channels, channels)?;
        Ok::<_, WeightsError>(Entrance::Shrink(convolution))
    };
    let grow = |name, level: usize| {
        Ok::<_, WeightsError>(Entrance::Grow {
            convolution: convolution(name, Kind::Grow, c[level + 1], c[level])?,
            beside: level,
        })
    };
    let stage = |name: &str, entrance, inputs, outputs| {
        let block = |part, inputs| {
            ResidualBlock::load(file, &format!("{name}.{part}"), (inputs, outputs), context)
        };
        Ok::<_, WeightsError>(Stage {
            entrance,
            blocks: [block("block1", inputs)?, block("block2", outputs)?],
        })
    };
    let stem = Entrance::Stem(convolution("stem", Kind::Same, INPUTS, c[0])?);
    Ok([
        stage("down.0", stem, c[0], c[0])?,
        stage("down.1", shrink("down.0.shrink", c[0])?, c[0], c[1])?,
        stage("down.2", shrink("down.1.shrink", c[1])?, c[1], c[2])?,
        stage("middle", Entrance::Straight, c[2], c[2])?,
        stage("up.1", grow("up.1.grow", 1)?, 2 * c[1], c[1])?,
        stage("up.0", grow("up.0.grow", 0)?, 2 * c[0], c[0])?,
    ])
}

/// Copies the paths into the network's input and adds the mask channel: 1 at the first frame, 0 elsewhere.
fn enter(paths: &[f32], input: &mut Rows) {
    input.shape(paths.len() / PATH, HORIZON, INPUTS);
    for (rows, path) in input.each_mut().zip(paths.chunks_exact(PATH)) {
        for (row, frame) in rows.chunks_exact_mut(INPUTS).zip(path.chunks_exact(FRAME)) {
            row[..FRAME].copy_from_slice(frame);
            row[FRAME] = 0.0;
        }
        rows[FRAME] = 1.0;
    }
}

#[cfg(test)]
mod tests;
