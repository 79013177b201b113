//! How a generator works inside, as the authors' `dataset_meta.json` tells it.

use serde::Serialize;
use serde_json::{Value, json};

use crate::paper::settings::{CONTINUITY, LARGEST_STEP};
use crate::scenes::{LAYOUT_RADIUS, Setting};
use planning::sampled_collision::REPULSION;

/// Keys that the authors' files have and nothing here reads: written for other programs, null where the generator has no such thing.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GeneratorNotes {
    /// Distance of the balls from the axis in the layouts of 2 and 4, section lengths; null for scenes drawn at random and for none.
    obstacle_layout_radius: Option<f64>,
    /// The steps of making a path without and with balls; null for the expert.
    planning_policy: Option<Value>,
    /// Which room the paper's repair leaves and demands; null for the expert, whose paths are certified.
    collision_policy: Option<Value>,
    /// Largest step between neighbouring waypoints, rad; null for the expert, which has no such limit.
    maximum_adjacent_configuration_step: Option<f64>,
    /// The device that computed: `cpu`.
    resolved_device: Option<&'static str>,
    /// The numbers that were computed with: `float64`.
    solver_dtype: Option<&'static str>,
    /// How the paper's generator has the tip follow a line; null for the expert.
    workspace_path_ik: Option<Value>,
}

impl GeneratorNotes {
    /// Of the generator of [`crate::generate_block`].
    #[must_use]
    pub fn of_expert(setting: Setting) -> Self {
        Self {
            obstacle_layout_radius: (matches!(setting, Setting::Reference(_)))
                .then_some(LAYOUT_RADIUS),
            resolved_device: Some("cpu"),
            solver_dtype: Some("float64"),
            ..Self::default()
        }
    }

    /// Of the generator of [`crate::generate_paper_block`].
    #[must_use]
    pub fn of_paper(setting: Setting) -> Self {
        let region = format!("sphere_radius + {REPULSION} * clearance_margin");
        Self {
            planning_policy: Some(json!({
                "obstacle_free": ["workspace_ik"],
                "obstacle": [
                    "workspace_ik",
                    "deepest_backbone_point_repulsion",
                    "douglas_peucker_control_selection",
                    "clamped_cubic_bspline_workspace_resampling",
                    "batched_continuity_aware_path_ik",
                ],
            })),
            collision_policy: Some(json!({
                "endpoint_region": region,
                "repair_region": region,
                "repulsion": "deepest_point_per_path_frame",
                "repulsion_plane": "xy_except_vertical_degeneracy",
                "acceptance_region": "sphere_radius + clearance_margin",
            })),
            maximum_adjacent_configuration_step: Some(LARGEST_STEP),
            workspace_path_ik: Some(json!({
                "primary_task": "tip_position",
                "secondary_task": "adjacent_configuration_continuity",
                "primary_method": "damped_Jacobian_pseudoinverse",
                "secondary_method": "Jacobian_null_space_projection",
                "continuity_gain": CONTINUITY,
                "convergence_check_interval": 1,
                "batch_axes": ["interior_frame"],
            })),
            ..Self::of_expert(setting)
        }
    }
}
