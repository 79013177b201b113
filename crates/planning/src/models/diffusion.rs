//! The paper's sampler: the temporal U-Net's reverse process, refined by differential kinematics (section IV-D).
//!
//! Paths are those of the reference setting: not in the canonical frame, and the goal configuration is the network's choice.

use crate::models::few_step::noise;
use crate::models::sampled_collision::{REPULSION, deepest, way_out};
use crate::path::waypoints::{WAYPOINTS, Waypoints};
use crate::problem::Problem;
use crate::request::Guidance;
use collision::Scene;
use denoiser::{
    Denoiser, Held, Normalisation, Precision, Refinement, ReverseProcess, ReverseProcessScratch,
    Solver, TemporalUnet, UnetCondition, UnetScratch,
};
use pcc_model::{Backbone, Configuration, DOF, Point, UnitRobot};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use thiserror::Error;

/// Values of a path.
const PATH: usize = WAYPOINTS * DOF;

/// How a model is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiffusionSettings {
    /// Which solver; the paper's is DDIM.
    pub solver: Solver,
    /// Evaluations of the network, 1 to 1000; the paper has 50.
    pub steps: usize,
    /// Arithmetic of the products.
    pub precision: Precision,
}

/// The processor does not compute in the precision asked for.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("precision bf16: this processor has no products of 16 bits (AVX-512 BF16); f32 is allowed")]
pub struct PrecisionUnavailable;

/// A diffusion model, resident, with working memory for every worker.
pub struct DiffusionModel {
    unet: TemporalUnet,
    settings: DiffusionSettings,
    sampler: ReverseProcess,
    scratch: Vec<Mutex<Scratch>>,
}

#[derive(Default)]
struct Scratch {
    unet: UnetScratch,
    sampler: ReverseProcessScratch,
}

/// The problem that paths are sampled for.
pub(crate) struct Task<'a> {
    pub(crate) robot: &'a UnitRobot,
    pub(crate) problem: &'a Problem,
    pub(crate) guidance: Guidance,
    pub(crate) seed: u64,
}

impl DiffusionModel {
    /// Makes a network resident.
    ///
    /// # Errors
    /// [`PrecisionUnavailable`].
    pub fn new(
        unet: TemporalUnet,
        settings: DiffusionSettings,
    ) -> Result<Self, PrecisionUnavailable> {
        if !settings.precision.available() {
            return Err(PrecisionUnavailable);
        }
        unet.prepare_precision(settings.precision);
        Ok(Self {
            unet,
            settings,
            sampler: ReverseProcess::new(settings.solver, settings.steps),
            scratch: Vec::new(),
        })
    }

    /// Evaluations of the network that a path takes: fewer than the steps asked for where two of them coincide.
    #[must_use]
    pub fn evaluations(&self) -> usize {
        self.sampler.visited().count()
    }

    /// Makes room for each of `threads` workers.
    pub(crate) fn prepare(&mut self, threads: usize) {
        self.scratch.resize_with(threads, Mutex::default);
    }

    /// Draws `count` paths in equal parts on every worker; nothing of a part that was interrupted.
    ///
    /// A path depends on the seed and its index alone, so neither threads nor neighbours matter.
    pub(crate) fn sample(
        &self,
        task: &Task,
        count: usize,
        interrupt: &(dyn Fn() -> bool + Sync),
    ) -> Vec<Option<Waypoints>> {
        let mut condition = self.condition(task);
        let steps: Vec<f32> = self.sampler.visited().map(|step| step as f32).collect();
        self.unet.prepare(&mut condition, &steps);
        let share = count.div_ceil(self.scratch.len().max(1)).max(1);
        let parts: Vec<usize> = (0..count).step_by(share).collect();
        let part = |first: usize| {
            let mut paths: Vec<f32> = (first..count.min(first + share))
                .flat_map(|index| noise::<PATH>(task.seed, index))
                .collect();
            let mut observe = |_: &[f32]| match interrupt() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            let finished = self.run(task, &condition, &mut paths, &mut observe);
            self.physical(&paths, finished.is_continue())
        };
        let drawn: Vec<Vec<Option<Waypoints>>> = parts.into_par_iter().map(part).collect();
        drawn.into_iter().flatten().collect()
    }

    /// Draws one path and returns what it was before every step and at the end, for a picture of the process.
    pub(crate) fn trace(&self, task: &Task) -> Vec<Waypoints> {
        let condition = self.condition(task);
        let mut paths = noise::<PATH>(task.seed, 0).to_vec();
        let mut seen = Vec::new();
        let mut observe = |x: &[f32]| {
            seen.extend_from_slice(x);
            ControlFlow::Continue(())
        };
        // Nothing interrupts it.
        let _ = self.run(task, &condition, &mut paths, &mut observe);
        self.physical(&seen, true).into_iter().flatten().collect()
    }

    fn condition(&self, task: &Task) -> UnetCondition {
        let start = std::array::from_fn(|i| task.problem.start[i] as f32);
        let target = task.problem.goal_tip(task.robot);
        let balls = task.problem.scene.balls().iter().map(|ball| {
            let [x, y, z] = [0, 1, 2].map(|axis| ball.centre[axis] as f32);
            [x, y, z, ball.radius as f32]
        });
        let balls: Vec<[f32; 4]> = balls.collect();
        let target = [0, 1, 2].map(|axis| target[axis] as f32);
        self.unet.condition(&start, &target, &balls)
    }

    fn run(
        &self,
        task: &Task,
        condition: &UnetCondition,
        paths: &mut [f32],
        observe: &mut dyn FnMut(&[f32]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let worker = rayon::current_thread_index().unwrap_or(0);
        let mut own = Scratch::default();
        let mut shared = self.scratch.get(worker).map(|scratch| {
            // A worker that panicked left nothing that the next use reads.
            scratch.lock().unwrap_or_else(PoisonError::into_inner)
        });
        let scratch = shared.as_deref_mut().unwrap_or(&mut own);
        let forces = Forces::new(task, self.unet.normalisation());
        let start: [f32; DOF] = std::array::from_fn(|i| task.problem.start[i] as f32);
        let start = self.unet.normalisation().configuration(&start);
        let mut correct = |estimate: &mut [f32]| forces.correct(estimate);
        let mut slope = |estimate: &[f32], gradient: &mut [f32]| forces.slope(estimate, gradient);
        let refinement = match task.guidance {
            Guidance::Pure => Refinement::None,
            Guidance::Post => Refinement::Correct(&mut correct),
            Guidance::Guided => Refinement::Guide(&mut slope),
        };
        let mut network = Network {
            unet: &self.unet,
            condition,
            precision: self.settings.precision,
            scratch: &mut scratch.unet,
        };
        let held = Held {
            start: &start,
            frames: WAYPOINTS,
        };
        self.sampler.sample(
            &mut network,
            held,
            refinement,
            &mut scratch.sampler,
            paths,
            observe,
        )
    }

    /// The paths in radians; none if the process was interrupted.
    fn physical(&self, paths: &[f32], finished: bool) -> Vec<Option<Waypoints>> {
        let normalisation = self.unet.normalisation();
        let path = |values: &[f32]| {
            let frames = values.as_chunks::<DOF>().0.iter();
            finished.then(|| {
                frames
                    .map(|frame| configuration(normalisation, frame))
                    .collect()
            })
        };
        paths.chunks_exact(PATH).map(path).collect()
    }
}

/// The network at work on one request.
struct Network<'a> {
    unet: &'a TemporalUnet,
    condition: &'a UnetCondition,
    precision: Precision,
    scratch: &'a mut UnetScratch,
}

impl Denoiser for Network<'_> {
    fn predict(&mut self, paths: &[f32], step: usize, noise: &mut [f32]) {
        let (condition, precision) = (self.condition, self.precision);
        self.unet.predict(
            condition,
            step as f32,
            paths,
            precision,
            self.scratch,
            noise,
        );
    }

    fn pull_back(&mut self, cotangent: &[f32], gradient: &mut [f32]) {
        self.unet.pull_back(self.scratch, cotangent, gradient);
    }
}

/// Weights of the two energies, tip and repulsion, in one of the two refinements (docs/evaluation.md "Sampling").
#[derive(Clone, Copy)]
struct Weights {
    tip: f64,
    repulsion: f64,
}

const POST: Weights = Weights {
    tip: 0.1,
    repulsion: 5.0,
};
const GUIDED: Weights = Weights {
    tip: 50.0,
    repulsion: 50.0,
};

/// The energies' forces on the frames of normalised paths.
struct Forces<'a> {
    robot: &'a UnitRobot,
    scene: &'a Scene,
    target: Point,
    normalisation: &'a Normalisation,
}

impl<'a> Forces<'a> {
    fn new(task: &Task<'a>, normalisation: &'a Normalisation) -> Self {
        Self {
            robot: task.robot,
            scene: &task.problem.scene,
            target: task.problem.goal_tip(task.robot),
            normalisation,
        }
    }

    /// Post correction, eq. "post": every frame but the first moves along the forces.
    fn correct(&self, estimate: &mut [f32]) {
        for path in estimate.chunks_exact_mut(PATH) {
            for (h, frame) in path.as_chunks_mut::<DOF>().0.iter_mut().enumerate().skip(1) {
                let configuration = configuration(self.normalisation, frame);
                if let Some(force) = self.force(&configuration, h, POST) {
                    let moved: [f32; DOF] =
                        std::array::from_fn(|i| (configuration + force)[i] as f32);
                    *frame = self.normalisation.configuration(&moved);
                }
            }
        }
    }

    /// The energy's gradient with respect to normalised paths, for guided prediction.
    fn slope(&self, estimate: &[f32], gradient: &mut [f32]) {
        gradient.fill(0.0);
        let paths = estimate
            .chunks_exact(PATH)
            .zip(gradient.chunks_exact_mut(PATH));
        for (path, gradient) in paths {
            let frames = path.as_chunks::<DOF>().0.iter();
            let frames = frames.zip(gradient.as_chunks_mut::<DOF>().0);
            for (h, (frame, gradient)) in frames.enumerate().skip(1) {
                let configuration = configuration(self.normalisation, frame);
                if let Some(force) = self.force(&configuration, h, GUIDED) {
                    *gradient = std::array::from_fn(|i| -force[i] as f32 * self.radians(i));
                }
            }
        }
    }

    /// −(w₁ ∇E₁ + w₂ ∇E₂) at frame `h`, radians; nothing where no force acts.
    fn force(
        &self,
        configuration: &Configuration,
        h: usize,
        weights: Weights,
    ) -> Option<Configuration> {
        let is_last = h == WAYPOINTS - 1;
        if !is_last && self.scene.is_empty() {
            return None;
        }
        let backbone = self.robot.backbone(configuration);
        let repulsion = self.repulsion(&backbone).map(|f| f * weights.repulsion);
        let tip = is_last.then(|| self.attraction(&backbone) * weights.tip);
        match (repulsion, tip) {
            (Some(a), Some(b)) => Some(a + b),
            (a, b) => a.or(b),
        }
    }

    /// Radians of one normalised unit of a degree of freedom.
    fn radians(&self, i: usize) -> f32 {
        let Normalisation {
            configuration_low,
            configuration_high,
            ..
        } = self.normalisation;
        (configuration_high[i] - configuration_low[i]) / 2.0
    }

    fn attraction(&self, backbone: &Backbone) -> Configuration {
        backbone.tip_jacobian().transpose() * (self.target - backbone.tip())
    }

    /// Jᵀ times the vector from the deepest point to the safe boundary.
    fn repulsion(&self, backbone: &Backbone) -> Option<Configuration> {
        let margin = REPULSION * self.robot.largest_tube_radius();
        let deepest = deepest(backbone, self.scene.balls()).filter(|d| d.distance < margin)?;
        let out = way_out(
            &(deepest.point - deepest.ball.centre),
            deepest.ball.radius + margin,
        );
        let jacobian = backbone.point_jacobian(deepest.section, deepest.fraction);
        Some(jacobian.transpose() * out)
    }
}

fn configuration(normalisation: &Normalisation, frame: &[f32; DOF]) -> Configuration {
    let values = normalisation.physical_configuration(frame);
    Configuration::from_fn(|i, _| f64::from(values[i]))
}

#[cfg(test)]
mod tests;
