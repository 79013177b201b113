//! The few-step path sampler `both-ends-flow-v1`: flow matching on sine coefficients, given both ends and the scene.
//!
//! Balls are encoded one by one and pooled (maximum, and sum/4), joined with the ends into a context. From the state
//! x_t = (1 − t)·noise + t·data and the context a residual trunk estimates the data; the flow's velocity is then
//! (estimate − x_t) / (1 − t), which Euler steps integrate from t = 0 to 1. Flow matching: Lipman et al., "Flow
//! Matching for Generative Modeling", ICLR 2023; estimating the data instead of the velocity spares the network
//! carrying the noise through to its output. Trained by `scripts/train_fast.py`, whose layers have the same names.

use super::flow::{EvaluationsRefused, Flow};
use crate::gemm::{Precision, Store};
use crate::layers::activation::silu;
use crate::layers::factors::Factors;
use crate::layers::layer_norm::LayerNorm;
use crate::layers::linear::Linear;
use crate::simd::dispatch::{Level, detected};
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

const ARCHITECTURE: &str = "both-ends-flow-v1";
const END_FEATURES: usize = 36;
const BALL_FEATURES: usize = 28;
const BALL_WIDTH: usize = 128;
const COEFFICIENTS: usize = 72;

/// Frame in which a model's features and coefficients are given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeatureFrame {
    /// Turned about the base axis so that the goal has azimuth zero.
    #[default]
    Canonical,
    /// The robot's base.
    Base,
}

impl FeatureFrame {
    /// The frame that the metadata names; canonical where it names none.
    fn load(file: &WeightsFile) -> Result<Self, WeightsError> {
        match file.metadata("frame") {
            None | Some("canonical") => Ok(Self::Canonical),
            Some("base") => Ok(Self::Base),
            Some(_) => Err(file.refused_entry("frame", "`canonical` or `base`")),
        }
    }
}

/// What one candidate is conditioned on, and where its flow begins.
#[derive(Clone, Copy, Debug)]
pub struct CandidateInput<'a> {
    /// 36 numbers that describe the ends.
    pub ends: &'a [f32],
    /// 28 numbers for each ball, any number of balls.
    pub balls: &'a [f32],
    /// Coefficients near which the candidate is sought; without them the flow begins from noise alone.
    pub warm_start: Option<WarmStart<'a>>,
}

/// Coefficients near which a candidate is sought, such as those of an earlier plan.
#[derive(Clone, Copy, Debug)]
pub struct WarmStart<'a> {
    /// 72 coefficients, in the unit of the training data.
    pub coefficients: &'a [f32],
    /// Where the flow begins, in [0, 1], from (1 − time)·noise + time·coefficients: at 0 they do not matter, and at 1
    /// they are the result, with no evaluation.
    pub time: f32,
}

/// Buffers of [`FastModel::sample`]; after the first call of a size nothing is allocated.
#[derive(Default)]
pub struct FastScratch {
    factors: Factors,
    balls: Vec<f32>,
    ball_hidden: Vec<f32>,
    ball_encoded: Vec<f32>,
    joined: Vec<f32>,
    context: Vec<f32>,
    trunk: Vec<f32>,
    normed: Vec<f32>,
    inner: Vec<f32>,
    estimate: Vec<f32>,
}

struct Block {
    norm: LayerNorm,
    inner: Linear,
    outer: Linear,
}

/// Mean and standard deviation of some features.
struct Scale {
    mean: Vec<f32>,
    deviation: Vec<f32>,
}

/// The few-step flow model with its weights.
pub struct FastModel {
    precision: Precision,
    width: usize,
    frame: FeatureFrame,
    end_scale: Scale,
    ball_scale: Scale,
    coefficient_deviation: Vec<f32>,
    ball_inner: Linear,
    ball_outer: Linear,
    context: Linear,
    flow: Flow,
    input: Linear,
    blocks: Vec<Block>,
    norm: LayerNorm,
    output: Linear,
}

/// The number of blocks by the metadata, if the file has no tensors of more.
fn count_of_blocks(file: &WeightsFile) -> Result<usize, WeightsError> {
    let count = file.count("blocks")?;
    if !file.has_tensors(&format!("blocks.{count}.")) {
        return Ok(count);
    }
    Err(file.refused_entry(
        "blocks",
        "the count of all blocks that the file has tensors of",
    ))
}

impl FastModel {
    /// Takes the network from a weights file, for a robot with three equal sections and this bending limit (rad).
    ///
    /// It makes as many evaluations as the file says, in the precision that is fastest here.
    ///
    /// # Errors
    /// [`WeightsError`]: another architecture, another robot, or a tensor that does not fit.
    pub fn from_weights(file: &WeightsFile, bending_limit: f64) -> Result<Self, WeightsError> {
        file.expect("architecture", ARCHITECTURE)?;
        file.expect("end_features", &END_FEATURES.to_string())?;
        file.expect("ball_features", &BALL_FEATURES.to_string())?;
        file.expect("coefficients", &COEFFICIENTS.to_string())?;
        file.expect("estimates", "data")?;
        file.expect_robot(bending_limit)?;
        let width = file.count("width")?;
        let block = |i: usize| {
            let name = |part: &str| format!("blocks.{i}.{part}");
            Ok(Block {
                norm: LayerNorm::load(file, &name("norm"), width)?,
                inner: Linear::load(file, &name("inner"), width, width)?,
                outer: Linear::load(file, &name("outer"), width, width)?,
            })
        };
        let model = Self {
            precision: Precision::F32,
            width,
            frame: FeatureFrame::load(file)?,
            end_scale: Scale::load(file, "end", END_FEATURES)?,
            ball_scale: Scale::load(file, "ball", BALL_FEATURES)?,
            coefficient_deviation: file.vector("coefficient_std", COEFFICIENTS)?,
            ball_inner: Linear::load(file, "ball_inner", BALL_FEATURES, BALL_WIDTH)?,
            ball_outer: Linear::load(file, "ball_outer", BALL_WIDTH, BALL_WIDTH)?,
            context: Linear::load(file, "context", 2 * BALL_WIDTH + END_FEATURES, width)?,
            flow: Flow::load(file, width)?,
            input: Linear::load(file, "input", COEFFICIENTS, width)?,
            blocks: (0..count_of_blocks(file)?)
                .map(block)
                .collect::<Result<_, WeightsError>>()?,
            norm: LayerNorm::load(file, "norm", width)?,
            output: Linear::load(file, "output", width, COEFFICIENTS)?,
        };
        Ok(model.with_precision(Precision::fastest()))
    }

    /// This network, with its products computed in a certain precision.
    ///
    /// # Panics
    /// If the precision is not [available](Precision::available).
    #[must_use]
    pub fn with_precision(mut self, precision: Precision) -> Self {
        assert!(precision.available(), "{precision} is available");
        self.precision = precision;
        let blocks = self.blocks.iter().flat_map(|b| [&b.inner, &b.outer]);
        [&self.ball_inner, &self.ball_outer, &self.context]
            .into_iter()
            .chain([&self.input, &self.output])
            .chain(blocks)
            .for_each(|layer| layer.prepare(precision));
        self
    }

    /// This network, with a certain number of evaluations a sample: 1, 2, 4 or 8 Euler steps of the flow.
    ///
    /// # Errors
    /// [`EvaluationsRefused`] for any other number.
    pub fn with_evaluations(mut self, evaluations: usize) -> Result<Self, EvaluationsRefused> {
        self.flow.set_evaluations(evaluations)?;
        Ok(self)
    }

    /// Evaluations of the network that a sample from noise takes.
    #[must_use]
    pub fn evaluations(&self) -> usize {
        self.flow.evaluations()
    }

    /// The frame in which features and coefficients of this model are given.
    #[must_use]
    pub fn frame(&self) -> FeatureFrame {
        self.frame
    }

    /// Candidates that are worth a worker of their own: it computes with fewer sooner than it reads the weights.
    #[must_use]
    pub fn worth_a_worker(&self) -> usize {
        match detected() {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => 5,
            _ => 4,
        }
    }

    /// Samples coefficients (candidates × 72, the unit of the training data) from standard normal noise of the same shape.
    ///
    /// A candidate's result depends on its own input and noise alone, bit for bit.
    ///
    /// # Panics
    /// If a slice's length does not fit the number of candidates, or a warm start's time is not in [0, 1].
    pub fn sample(
        &self,
        candidates: &[CandidateInput],
        noise: &[f32],
        scratch: &mut FastScratch,
        out: &mut [f32],
    ) {
        let length = candidates.len() * COEFFICIENTS;
        assert_eq!(noise.len(), length, "72 noise values a candidate");
        assert_eq!(out.len(), length, "72 coefficients a candidate");
        scratch.factors.set_precision(self.precision);
        self.condition(candidates, scratch);
        out.copy_from_slice(noise);
        self.begin(candidates, out);
        for step in 0..self.flow.evaluations() {
            self.advance(candidates, step, scratch, out);
        }
        for row in out.chunks_exact_mut(COEFFICIENTS) {
            row.iter_mut()
                .zip(&self.coefficient_deviation)
                .for_each(|(x, d)| *x *= d);
        }
    }

    /// Moves the states of warm starts from their noise to where their flow begins.
    fn begin(&self, candidates: &[CandidateInput], x: &mut [f32]) {
        for (candidate, x) in candidates.iter().zip(x.chunks_exact_mut(COEFFICIENTS)) {
            let Some(WarmStart { coefficients, time }) = candidate.warm_start else {
                continue;
            };
            assert_eq!(coefficients.len(), COEFFICIENTS, "72 given coefficients");
            assert!((0.0..=1.0).contains(&time), "time {time} in [0, 1]");
            let data = coefficients.iter().zip(&self.coefficient_deviation);
            for (x, (c, d)) in x.iter_mut().zip(data) {
                *x = (1.0 - time) * *x + time * (c / d);
            }
        }
    }

    /// One Euler step of the states whose flow has begun when it ends.
    fn advance(
        &self,
        candidates: &[CandidateInput],
        step: usize,
        s: &mut FastScratch,
        x: &mut [f32],
    ) {
        let begins = |c: &CandidateInput| c.warm_start.map_or(0.0, |w| w.time);
        let share_of = |c: &CandidateInput| self.flow.share(step, begins(c));
        if candidates.iter().all(|c| share_of(c).is_none()) {
            return;
        }
        resize(&mut s.trunk, candidates.len() * self.width);
        let rows = s.trunk.chunks_exact_mut(self.width);
        for (row, candidate) in rows.zip(candidates) {
            self.flow.write_time(step, begins(candidate), row);
        }
        self.estimate(x, s);
        let estimates = s.estimate.chunks_exact(COEFFICIENTS);
        let rows = x.chunks_exact_mut(COEFFICIENTS).zip(estimates);
        for ((x, estimate), candidate) in rows.zip(candidates) {
            if let Some(share) = share_of(candidate) {
                let values = x.iter_mut().zip(estimate);
                values.for_each(|(x, e)| *x += (e - *x) * share);
            }
        }
    }

    /// Computes the context of every candidate.
    fn condition(&self, candidates: &[CandidateInput], s: &mut FastScratch) {
        self.encode_balls(candidates, s);
        s.joined.clear();
        let mut encoded = s.ball_encoded.as_slice();
        for candidate in candidates {
            assert_eq!(candidate.ends.len(), END_FEATURES, "36 end features");
            let length = candidate.balls.len() / BALL_FEATURES * BALL_WIDTH;
            let (own, others) = encoded.split_at(length);
            pool(own, &mut s.joined);
            self.end_scale.apply(candidate.ends, &mut s.joined);
            encoded = others;
        }
        resize(&mut s.context, candidates.len() * self.width);
        self.context
            .multiply(&s.joined, &mut s.factors, &mut s.context, Store::Replace);
    }

    /// Encodes the balls of all candidates, one after the other.
    fn encode_balls(&self, candidates: &[CandidateInput], s: &mut FastScratch) {
        s.balls.clear();
        for candidate in candidates {
            let rest = candidate.balls.len() % BALL_FEATURES;
            assert_eq!(rest, 0, "28 features a ball");
            self.ball_scale.apply(candidate.balls, &mut s.balls);
        }
        let length = s.balls.len() / BALL_FEATURES * BALL_WIDTH;
        resize(&mut s.ball_hidden, length);
        resize(&mut s.ball_encoded, length);
        self.ball_inner
            .multiply(&s.balls, &mut s.factors, &mut s.ball_hidden, Store::Replace);
        silu(&mut s.ball_hidden);
        self.ball_outer.multiply(
            &s.ball_hidden,
            &mut s.factors,
            &mut s.ball_encoded,
            Store::Replace,
        );
        silu(&mut s.ball_encoded);
    }

    /// Estimates the normalised coefficients from `x` (candidates × 72) and the times that stand in the trunk.
    fn estimate(&self, x: &[f32], s: &mut FastScratch) {
        self.enter_trunk(x, s);
        for block in &self.blocks {
            block.apply(s);
        }
        self.norm.apply(&s.trunk, &mut s.normed);
        silu(&mut s.normed);
        resize(&mut s.estimate, x.len());
        self.output
            .multiply(&s.normed, &mut s.factors, &mut s.estimate, Store::Replace);
    }

    /// Adds state and context to the times in the trunk.
    fn enter_trunk(&self, x: &[f32], s: &mut FastScratch) {
        for buffer in [&mut s.normed, &mut s.inner] {
            resize(buffer, s.trunk.len());
        }
        s.trunk
            .iter_mut()
            .zip(&s.context)
            .for_each(|(h, c)| *h += c);
        self.input
            .multiply(x, &mut s.factors, &mut s.trunk, Store::Add);
    }
}

impl Block {
    fn apply(&self, s: &mut FastScratch) {
        self.norm.apply(&s.trunk, &mut s.normed);
        self.inner
            .multiply(&s.normed, &mut s.factors, &mut s.inner, Store::Replace);
        silu(&mut s.inner);
        self.outer
            .multiply(&s.inner, &mut s.factors, &mut s.trunk, Store::Add);
    }
}

impl Scale {
    fn load(file: &WeightsFile, name: &str, width: usize) -> Result<Self, WeightsError> {
        Ok(Self {
            mean: file.vector(&format!("{name}_mean"), width)?,
            deviation: file.vector(&format!("{name}_std"), width)?,
        })
    }

    /// Appends the scaled rows to `out`.
    fn apply(&self, rows: &[f32], out: &mut Vec<f32>) {
        for row in rows.chunks_exact(self.mean.len()) {
            let scale = self.mean.iter().zip(&self.deviation);
            out.extend(row.iter().zip(scale).map(|(x, (m, d))| (x - m) / d));
        }
    }
}

/// Gives a buffer a length; what it holds is to be overwritten.
fn resize(buffer: &mut Vec<f32>, length: usize) {
    buffer.resize(length, 0.0);
}

/// Appends the largest value of each feature (0 without balls) and a quarter of the sum.
fn pool(encoded: &[f32], out: &mut Vec<f32>) {
    let mut largest = [f32::NEG_INFINITY; BALL_WIDTH];
    let mut total = [0.0_f32; BALL_WIDTH];
    for ball in encoded.chunks_exact(BALL_WIDTH) {
        for ((l, t), v) in largest.iter_mut().zip(&mut total).zip(ball) {
            *l = l.max(*v);
            *t += v;
        }
    }
    if encoded.is_empty() {
        largest.fill(0.0);
    }
    out.extend_from_slice(&largest);
    out.extend(total.iter().map(|t| t / 4.0));
}

#[cfg(test)]
mod tests;
