//! What a planner keeps from request to request.

use crate::error::PlannerError;
use crate::models::diffusion::DiffusionModel;
use crate::optimize::smooth_update::PushKernel;
use crate::optimize::tip_path::TipPaths;
use crate::path::sine_basis::SineBasis;
use codes::Sampler;
use denoiser::FastModel;
use pcc_model::UnitRobot;

/// The learned models of a planner; a request for one that is not loaded is refused.
#[derive(Default)]
pub struct Models {
    /// The few-step model.
    pub fast: Option<FastModel>,
    /// The paper's diffusion model.
    pub diffusion: Option<DiffusionModel>,
}

impl Models {
    /// Checks that the model which a sampler needs is loaded.
    pub(crate) fn check_loaded(&self, sampler: Sampler) -> Result<(), PlannerError> {
        let (name, loaded) = match sampler {
            Sampler::Default | Sampler::Fast => ("fast", self.fast.is_some()),
            Sampler::Diffusion | Sampler::DiffusionPost | Sampler::DiffusionGuided => {
                ("diffusion", self.diffusion.is_some())
            }
            Sampler::Straight
            | Sampler::StraightDrawn
            | Sampler::RrtConnect
            | Sampler::RrtSmooth => return Ok(()),
        };
        loaded
            .then_some(())
            .ok_or(PlannerError::ModelNotLoaded(name))
    }
}

/// The unit robot, the models and tables, shared by all requests.
pub(crate) struct Resources {
    pub(crate) robot: UnitRobot,
    pub(crate) models: Models,
    pub(crate) basis: SineBasis,
    pub(crate) kernel: PushKernel,
    pub(crate) tip_paths: TipPaths,
}

impl Resources {
    /// For a robot whose sections have length 1.
    pub(crate) fn new(robot: UnitRobot, models: Models) -> Self {
        let basis = SineBasis::default();
        Self {
            robot,
            models,
            kernel: PushKernel::new(&basis),
            tip_paths: TipPaths::new(),
            basis,
        }
    }
}
