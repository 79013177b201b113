//! Starts in motion: the robot brakes straight ahead, and every motion begins with that.

use crate::error::Infeasible;
use crate::motion::along_polyline::append;
use crate::motion::constraints::MotionConstraints;
use crate::path::metrics::PathMetrics;
use crate::plan::{Candidate, Certified, Plan};
use crate::request::StartMotion;
use codes::Stage;
use pcc_model::{Configuration, TendonLimits, UnitRobot};
use rayon::prelude::*;
use std::sync::Arc;
use trajectory::{Knot, Trajectory, limit_use, stopping_motion};

/// Relative amount by which a limit may be exceeded: the rounding of the measure.
const ROUNDING: f64 = 1e-6;

/// A certified motion to rest, from whose end a request is planned.
pub(super) struct Braking<'a> {
    robot: &'a UnitRobot,
    pub(super) motion: Trajectory,
    /// Smallest clearance of the body while it brakes, section lengths.
    clearance: f64,
}

impl<'a> Braking<'a> {
    /// Brakes from a state, within the robot's whole limits.
    pub(crate) fn new(
        constraints: &MotionConstraints<'a>,
        start: &Configuration,
        motion: &StartMotion,
    ) -> Result<Self, Infeasible> {
        let robot = constraints.robot;
        let state = Knot {
            time: 0.0,
            position: *start,
            velocity: motion.velocity,
            acceleration: motion.acceleration,
        };
        let limits: &TendonLimits = &robot.tendon_limits;
        let motion = stopping_motion(&state, &robot.tendons, limits).map_err(|_| {
            Infeasible::StartTooFast {
                share: f64::INFINITY,
            }
        })?;
        let share = limit_use(&motion, &robot.tendons, limits).largest();
        if share > 1.0 + ROUNDING {
            return Err(Infeasible::StartTooFast { share });
        }
        match constraints.certify(&motion) {
            Ok(clearance) => Ok(Self {
                robot,
                motion,
                clearance,
            }),
            Err(_) => Err(Infeasible::StartCannotStop),
        }
    }

    /// Knots that braking adds to a motion.
    pub(crate) fn knots(&self) -> usize {
        self.motion.knots().len() - 1
    }

    /// Braking, and then this motion.
    fn before(&self, motion: &Trajectory) -> Trajectory {
        let mut knots = self.motion.knots().to_vec();
        append(&mut knots, motion);
        Trajectory::new(knots).expect("two motions one after the other are one")
    }

    /// The candidate with braking before its motion.
    pub(crate) fn candidate(&self, candidate: &Candidate) -> Candidate {
        let trajectory = self.before(&candidate.trajectory);
        let clearance = self.clearance.min(candidate.metrics.clearance);
        Candidate {
            metrics: PathMetrics::of(self.robot, &trajectory, clearance),
            trajectory: trajectory.into(),
            source: candidate.source,
            draw: candidate.draw,
        }
    }

    /// The plan with braking before every motion, and the figures of the whole motions.
    pub(crate) fn plan(&self, mut plan: Plan) -> Plan {
        let Plan {
            candidates, stages, ..
        } = &mut plan;
        let whole = |candidate| self.candidate(candidate);
        *candidates = stages.measure(Stage::Select, || candidates.par_iter().map(whole).collect());
        for candidate in &plan.candidates {
            plan.draws[candidate.draw].outcome = Ok(Certified {
                trajectory: Arc::clone(&candidate.trajectory),
                metrics: candidate.metrics,
            });
        }
        plan
    }
}
