//! From noise to paths: DDIM (Song et al., ICLR 2021, η = 0) and DPM-Solver++(2M) (Lu et al., 2022) on the same network.

use super::schedule::{Amplitudes, STEPS, Schedule};
use serde::Deserialize;
use std::fmt;
use std::ops::ControlFlow;

/// Share of the steps, the last ones, in which a path is refined.
const REFINED_SHARE: f64 = 0.4;

/// A network that predicts noise, with the request's conditions and its own scratch memory.
pub trait Denoiser {
    /// Predicts the noise in `paths` (candidates × frames × degrees of freedom, normalised) at a step 0..999.
    fn predict(&mut self, paths: &[f32], step: usize, noise: &mut [f32]);

    /// The product of a cotangent of the noise with the Jacobian of the last prediction with respect to the paths.
    fn pull_back(&mut self, cotangent: &[f32], gradient: &mut [f32]);
}

/// The solver that takes the reverse diffusion from one step to the next.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Deterministic DDIM.
    Ddim,
    /// DPM-Solver++(2M): second order, on the clean estimates.
    DpmSolver,
}

impl fmt::Display for Solver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ddim => "ddim",
            Self::DpmSolver => "dpm-solver",
        })
    }
}

/// What is done to the clean estimate in the last 40 % of the steps (the paper, section IV-D); in one at least.
pub enum Refinement<'a> {
    /// No refinement.
    None,
    /// Post correction: the estimate (normalised) is moved.
    Correct(&'a mut dyn FnMut(&mut [f32])),
    /// Guided prediction: the energy's gradient with respect to the unclipped estimate (normalised) is written to the
    /// second argument, and goes through the network to the noise.
    Guide(&'a mut dyn FnMut(&[f32], &mut [f32])),
}

/// The reverse diffusion process from noise to paths: its solver, and the steps at which it evaluates the network.
#[derive(Clone, Debug)]
pub struct ReverseProcess {
    schedule: Schedule,
    solver: Solver,
    visited: Vec<usize>,
}

/// Working memory of a [`ReverseProcess`], reused from request to request.
#[derive(Default)]
pub struct ReverseProcessScratch {
    noise: Vec<f32>,
    estimate: Vec<f32>,
    previous: Vec<f32>,
    gradient: Vec<f32>,
    pulled: Vec<f32>,
}

impl ReverseProcess {
    /// A process of `steps` evaluations of the network (1 to 1000; more are 1000): evenly over the steps for DDIM, evenly
    /// over the logarithm of the ratio of signal to noise for DPM-Solver++.
    #[must_use]
    pub fn new(solver: Solver, steps: usize) -> Self {
        let (schedule, steps) = (Schedule::new(), steps.clamp(1, STEPS));
        let visited = match solver {
            Solver::Ddim => Schedule::evenly(steps),
            Solver::DpmSolver => schedule.by_log_ratio(steps),
        };
        Self {
            schedule,
            solver,
            visited,
        }
    }

    /// The diffusion steps at which the network is evaluated, in order.
    pub fn visited(&self) -> impl Iterator<Item = usize> {
        self.visited.iter().copied()
    }

    /// Turns `paths` (candidates × frames × degrees of freedom, normalised) from standard normal noise into samples, in
    /// place.
    ///
    /// `observe` sees the noisy paths before each evaluation, and the result; it may break off the work, and then the
    /// paths are not finished.
    pub fn sample(
        &self,
        denoiser: &mut impl Denoiser,
        held: Held,
        mut refinement: Refinement,
        scratch: &mut ReverseProcessScratch,
        paths: &mut [f32],
        observe: &mut dyn FnMut(&[f32]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        scratch.fit(paths.len());
        held.restore(paths);
        let refined_from = self.visited.len() - self.refined_steps();
        let mut before: Option<f64> = None;
        for (index, step) in self.visited.iter().copied().enumerate() {
            observe(paths)?;
            let at = self.schedule.amplitudes(step);
            let next = self.visited.get(index + 1);
            let next = next.map_or(Amplitudes::CLEAN, |s| self.schedule.amplitudes(*s));
            let active = index >= refined_from;
            scratch.estimate(denoiser, paths, step, at, active, &mut refinement);
            match self.solver {
                Solver::Ddim => scratch.ddim(next, paths),
                Solver::DpmSolver => scratch.dpm_solver(at, next, before, paths),
            }
            before = Some(at.log_ratio());
            std::mem::swap(&mut scratch.estimate, &mut scratch.previous);
            held.restore(paths);
        }
        observe(paths)
    }

    fn refined_steps(&self) -> usize {
        ((self.visited.len() as f64 * REFINED_SHARE).round() as usize).max(1)
    }
}

/// The first frame that every path keeps throughout the reverse diffusion.
#[derive(Clone, Copy)]
pub struct Held<'a> {
    /// The first frame, normalised.
    pub start: &'a [f32],
    /// How many frames a path has.
    pub frames: usize,
}

impl Held<'_> {
    fn restore(&self, paths: &mut [f32]) {
        let length = self.start.len();
        for path in paths.chunks_exact_mut(self.frames * length) {
            path[..length].copy_from_slice(self.start);
        }
    }
}

impl ReverseProcessScratch {
    fn fit(&mut self, length: usize) {
        for buffer in [
            &mut self.noise,
            &mut self.estimate,
            &mut self.previous,
            &mut self.gradient,
            &mut self.pulled,
        ] {
            buffer.resize(length, 0.0);
        }
    }

    /// Predicts the noise and from it the clean path, refined if `active`.
    fn estimate(
        &mut self,
        denoiser: &mut impl Denoiser,
        paths: &[f32],
        step: usize,
        at: Amplitudes,
        active: bool,
        refinement: &mut Refinement,
    ) {
        denoiser.predict(paths, step, &mut self.noise);
        if let (true, Refinement::Guide(energy)) = (active, &mut *refinement) {
            self.clean(paths, at, f32::INFINITY);
            energy(&self.estimate, &mut self.gradient);
            self.guide(denoiser, at);
        }
        self.clean(paths, at, 1.0);
        if let (true, Refinement::Correct(correct)) = (active, refinement) {
            correct(&mut self.estimate);
        }
    }

    /// x̂₀ = (x − √(1−ᾱ) ε) / √ᾱ, within ± `bound`.
    fn clean(&mut self, paths: &[f32], at: Amplitudes, bound: f32) {
        let (scale, noise) = ((1.0 / at.signal) as f32, (at.noise / at.signal) as f32);
        let terms = paths.iter().zip(&self.noise);
        for (estimate, (x, e)) in self.estimate.iter_mut().zip(terms) {
            *estimate = (scale * x - noise * e).clamp(-bound, bound);
        }
    }

    /// ε += √(1−ᾱ) ∇ₓE with ∇ₓE = (g − √(1−ᾱ) (∂ε/∂x)ᵀ g) / √ᾱ, g the gradient at the clean estimate.
    fn guide(&mut self, denoiser: &mut impl Denoiser, at: Amplitudes) {
        denoiser.pull_back(&self.gradient, &mut self.pulled);
        let (noise, scale) = (at.noise as f32, (at.noise / at.signal) as f32);
        let terms = self.gradient.iter().zip(&self.pulled);
        for (e, (g, p)) in self.noise.iter_mut().zip(terms) {
            *e += scale * (g - noise * p);
        }
    }

    /// x ← √ᾱ' x̂₀ + √(1−ᾱ') ε.
    fn ddim(&self, next: Amplitudes, paths: &mut [f32]) {
        let (signal, noise) = (next.signal as f32, next.noise as f32);
        let terms = self.estimate.iter().zip(&self.noise);
        for (x, (estimate, e)) in paths.iter_mut().zip(terms) {
            *x = signal * estimate + noise * e;
        }
    }

    /// x ← (σ'/σ) x − α' (e^(−h) − 1) D with h = λ' − λ and D extrapolated from the last two estimates; the first and the
    /// last step are of first order. `before`: λ of the step before this one.
    fn dpm_solver(&self, at: Amplitudes, next: Amplitudes, before: Option<f64>, paths: &mut [f32]) {
        let is_last = next.noise == 0.0;
        let h = next.log_ratio() - at.log_ratio();
        let extrapolation = match before {
            Some(before) if !is_last => 0.5 * h / (at.log_ratio() - before),
            _ => 0.0,
        } as f32;
        let keep = (next.noise / at.noise) as f32;
        let take = (next.signal * -(-h).exp_m1()) as f32;
        let terms = self.estimate.iter().zip(&self.previous);
        for (x, (estimate, previous)) in paths.iter_mut().zip(terms) {
            *x = keep * *x + take * (estimate + extrapolation * (estimate - previous));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gemm::Precision;

    const MEAN: f32 = 0.3;
    const DEVIATION: f64 = 0.05;

    /// The exact noise of normally distributed data.
    struct Gaussian {
        schedule: Schedule,
        last: usize,
    }

    impl Gaussian {
        fn new() -> Self {
            Self {
                schedule: Schedule::new(),
                last: 0,
            }
        }

        fn slope(&self, step: usize) -> f32 {
            let at = self.schedule.amplitudes(step);
            (at.noise / ((at.signal * DEVIATION).powi(2) + at.noise.powi(2))) as f32
        }
    }

    impl Denoiser for Gaussian {
        fn predict(&mut self, paths: &[f32], step: usize, noise: &mut [f32]) {
            self.last = step;
            let (slope, signal) = (
                self.slope(step),
                self.schedule.amplitudes(step).signal as f32,
            );
            for (n, x) in noise.iter_mut().zip(paths) {
                *n = slope * (x - signal * MEAN);
            }
        }

        fn pull_back(&mut self, cotangent: &[f32], gradient: &mut [f32]) {
            let slope = self.slope(self.last);
            for (g, c) in gradient.iter_mut().zip(cotangent) {
                *g = slope * c;
            }
        }
    }

    fn run(solver: Solver, steps: usize, refinement: Refinement, noise: &[f32]) -> Vec<f32> {
        let mut paths = noise.to_vec();
        let process = ReverseProcess::new(solver, steps);
        let mut scratch = ReverseProcessScratch::default();
        let finished = process.sample(
            &mut Gaussian::new(),
            Held {
                start: &[0.7],
                frames: noise.len(),
            },
            refinement,
            &mut scratch,
            &mut paths,
            &mut |_| ControlFlow::Continue(()),
        );
        assert!(finished.is_continue());
        paths
    }

    const NOISE: [f32; 6] = [0.0, -1.5, -0.5, 0.0, 0.5, 1.5];

    /// Largest distance from the data that belongs to the noise.
    fn error(solver: Solver, steps: usize) -> f32 {
        let paths = run(solver, steps, Refinement::None, &NOISE);
        assert_eq!(paths[0], 0.7, "the start is held");
        let exact = NOISE.map(|noise| MEAN + DEVIATION as f32 * noise);
        let errors = paths[1..]
            .iter()
            .zip(&exact[1..])
            .map(|(x, e)| (x - e).abs());
        errors.fold(0.0, f32::max)
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for solver in [Solver::Ddim, Solver::DpmSolver] {
            let name = serde_json::Value::String(solver.to_string());
            assert_eq!(serde_json::from_value::<Solver>(name).unwrap(), solver);
        }
        for precision in [Precision::F32, Precision::Bf16] {
            let name = serde_json::Value::String(precision.to_string());
            assert_eq!(
                serde_json::from_value::<Precision>(name).unwrap(),
                precision
            );
        }
    }

    #[test]
    fn both_solvers_carry_noise_to_the_data_that_belongs_to_it() {
        use Solver::{Ddim, DpmSolver};
        for (solver, steps, allowed) in [
            (Ddim, 50, 0.02),
            (Ddim, 1000, 0.002),
            (DpmSolver, 8, 0.005),
            (DpmSolver, 50, 0.001),
        ] {
            let error = error(solver, steps);
            assert!(error < allowed, "{solver:?} {steps}: {error}");
        }
    }

    #[test]
    fn a_correction_of_the_last_step_is_what_comes_out() {
        let mut calls = 0;
        let mut correct = |estimate: &mut [f32]| {
            calls += 1;
            estimate[1..].fill(0.25);
        };
        let paths = run(Solver::Ddim, 50, Refinement::Correct(&mut correct), &NOISE);
        assert!(
            paths[1..].iter().all(|x| (x - 0.25).abs() < 1e-6),
            "{paths:?}"
        );
        assert_eq!(calls, 20, "the last 40 % of 50 steps");
    }

    #[test]
    fn guidance_moves_samples_down_the_energy() {
        let mut slope = |_: &[f32], gradient: &mut [f32]| gradient.fill(2.0);
        let plain = run(Solver::Ddim, 50, Refinement::None, &NOISE);
        let guided = run(Solver::Ddim, 50, Refinement::Guide(&mut slope), &NOISE);
        let pairs = guided.iter().zip(&plain).skip(1);
        assert!(pairs.clone().all(|(g, p)| g < p), "{guided:?} {plain:?}");
        assert_eq!(guided[0], 0.7);
    }

    #[test]
    fn an_observer_sees_every_step_and_the_result() {
        let mut paths = NOISE.to_vec();
        let mut seen = Vec::new();
        let _ = ReverseProcess::new(Solver::DpmSolver, 7).sample(
            &mut Gaussian::new(),
            Held {
                start: &[0.7],
                frames: NOISE.len(),
            },
            Refinement::None,
            &mut ReverseProcessScratch::default(),
            &mut paths,
            &mut |x| {
                seen.push(x.to_vec());
                ControlFlow::Continue(())
            },
        );
        assert_eq!(seen.len(), 8);
        assert_eq!(seen[7], paths);
        assert!(seen[0][1] == NOISE[1] && seen[0][0] == 0.7);
    }
}
