//! The Euler steps of the flow: their times, and what the network is given of them.

use crate::layers::linear::Linear;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;
use std::f32::consts::TAU;
use thiserror::Error;

const TIME_FEATURES: usize = 32;
/// Numbers of evaluations: the steps of each are exact in f32.
const ALLOWED: [usize; 4] = [1, 2, 4, 8];

/// A number of evaluations that is not allowed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("{0} evaluations of the few-step model's network a sample: 1, 2, 4 and 8 are allowed")]
pub struct EvaluationsRefused(pub usize);

/// The steps of a sample.
pub(super) struct Flow {
    layer: Linear,
    width: usize,
    evaluations: usize,
    /// The layer's output for the time at which each step begins (steps × width).
    times: Vec<f32>,
}

impl Flow {
    pub(super) fn load(file: &WeightsFile, width: usize) -> Result<Self, WeightsError> {
        let mut flow = Self {
            layer: Linear::load(file, "time", TIME_FEATURES, width)?,
            width,
            evaluations: 0,
            times: Vec::new(),
        };
        let evaluations = file.count("evaluations")?;
        flow.set_evaluations(evaluations)
            .map_err(|_| file.refused_entry("evaluations", format!("one of {ALLOWED:?}")))?;
        Ok(flow)
    }

    pub(super) fn set_evaluations(&mut self, evaluations: usize) -> Result<(), EvaluationsRefused> {
        if !ALLOWED.contains(&evaluations) {
            return Err(EvaluationsRefused(evaluations));
        }
        self.evaluations = evaluations;
        let begins = (0..evaluations).map(|step| self.boundary(step));
        let features: Vec<f32> = begins.flat_map(time_features).collect();
        self.times.resize(evaluations * self.width, 0.0);
        self.layer.apply(&features, &mut self.times);
        Ok(())
    }

    pub(super) fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// The time at which a step begins.
    fn boundary(&self, step: usize) -> f32 {
        step as f32 / self.evaluations as f32
    }

    /// The share (0..=1) of the distance from the state to the estimate that a step goes, in a flow that begins at time
    /// `begins`; none if that is after the step.
    pub(super) fn share(&self, step: usize, begins: f32) -> Option<f32> {
        let (from, to) = (self.boundary(step).max(begins), self.boundary(step + 1));
        // velocity · (to − from), with velocity = (estimate − x) / (1 − from)
        (from < to).then(|| (to - from) / (1.0 - from))
    }

    /// Writes what the network is given of a step's time (`width` values), in a flow that begins at time `begins`.
    pub(super) fn write_time(&self, step: usize, begins: f32, out: &mut [f32]) {
        if begins <= self.boundary(step) {
            out.copy_from_slice(&self.times[step * self.width..][..self.width]);
        } else {
            self.layer.apply(&time_features(begins), out);
        }
    }
}

/// sin and cos of 2π t f with f = 0.5, 1, …, 8.
fn time_features(t: f32) -> [f32; TIME_FEATURES] {
    let half = TIME_FEATURES / 2;
    std::array::from_fn(|i| {
        let angle = TAU * t * 0.5 * (i % half + 1) as f32;
        if i < half { angle.sin() } else { angle.cos() }
    })
}
