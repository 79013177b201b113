//! Motions that the daemon answered with, kept to be judged when nothing is measured.

use client::PlanAnswer;
use pcc_model::{DOF, Robot};
use shared_types::message::{Ball, Knot};
use shared_types::valid::{Goal, PlanRequest};
use tests::brute_force;
use trajectory::Trajectory;

use crate::report::Report;
use crate::second_look::{Demand, End, Judged, Suspect, TIP_TOLERANCE};

/// A request and the motions of its answer.
pub(crate) struct Kept {
    pub(crate) request: PlanRequest,
    pub(crate) motions: Vec<Vec<Knot>>,
}

impl Kept {
    pub(crate) fn of(request: PlanRequest, answer: &PlanAnswer) -> Self {
        let motions = answer
            .candidates()
            .map(|candidate| candidate.knots.to_vec());
        Self {
            request,
            motions: motions.collect(),
        }
    }

    /// One of its motions.
    pub(crate) fn suspect(&self, robot: &Robot, index: usize) -> Suspect {
        let PlanRequest {
            seed,
            sampler,
            balls,
            ..
        } = &self.request;
        let count = balls.len();
        Suspect {
            demand: demand(robot, &self.request),
            motion: motion(&self.motions[index]),
            name: format!("seed {seed}, {sampler}, {count} balls, candidate {index}"),
        }
    }
}

/// Judges all motions that were kept, every so many-th over its whole duration.
pub(crate) fn check(report: &mut Report, of: &str, robot: &Robot, kept: &[Kept], every: usize) {
    let motions = kept
        .iter()
        .flat_map(|kept| (0..kept.motions.len()).map(move |index| (kept, index)));
    let motions: Vec<(&Kept, usize)> = motions.collect();
    let suspect = |which: usize| {
        let (kept, index) = motions[which];
        kept.suspect(robot, index)
    };
    Judged::of(motions.len(), every, suspect).check(report, of);
}

/// What every motion of an answer must keep: its request has all balls that stand in the way.
fn demand(robot: &Robot, request: &PlanRequest) -> Demand {
    let end = match request.goal {
        Goal::Tip {
            position_m,
            tolerance_m,
        } => End::Tip {
            position: position_m,
            tolerance: tolerance_m.unwrap_or(TIP_TOLERANCE),
        },
        Goal::Configuration(shape) => End::Configuration(shape),
    };
    let ball = |ball: &Ball| brute_force::Ball::resting(ball.centre_m, ball.radius_m);
    // Who starts in motion brakes within the whole limits.
    let is_resting = request.start_velocity_rad_s == [0.0; DOF];
    let scale = if is_resting {
        request.limits_scale
    } else {
        1.0
    };
    Demand {
        balls: request.balls.iter().map(ball).collect(),
        start: [
            request.start_configuration_rad,
            request.start_velocity_rad_s,
            request.start_acceleration_rad_s2,
        ],
        end,
        limits: robot.tendon_limits.scaled(scale),
    }
}

/// The motion that an answer's knots are.
fn motion(knots: &[Knot]) -> anyhow::Result<Trajectory> {
    let knot = |knot: &Knot| trajectory::Knot {
        time: knot.time_s,
        position: knot.configuration_rad.into(),
        velocity: knot.velocity_rad_s.into(),
        acceleration: knot.acceleration_rad_s2.into(),
    };
    Ok(Trajectory::new(knots.iter().map(knot).collect())?)
}
