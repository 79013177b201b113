//! Mixed requests whose answers depend on nothing but themselves, without a deadline: general scenes of 0 to 8 and of 16 balls and hard ones in
//! turn, all selection rules. Every 7th begins in motion, and every 13th asks for a configuration.

use datasets::scenes::{Setting, Target, draw_target};
use pcc_model::UnitRobot;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::codes::Selection;
use shared_types::message::Ball;
use shared_types::valid::{Goal, PlanRequest, SelectionRule};

use crate::stack::NO_DEADLINE;

/// Seed of the scenes: no data set was made with it.
const SEED: u64 = 9017;
/// Settings that take turns.
const SETTINGS: [Setting; 3] = [
    Setting::General(None),
    Setting::General(Some(16)),
    Setting::Hard,
];
/// Candidates of each.
const CANDIDATES: usize = 10;
/// Every so many requests begin in motion, and ask for a configuration.
const MOVING: usize = 7;
const TO_CONFIGURATION: usize = 13;
/// Largest velocity and acceleration of each bending component of a start in motion, rad/s and rad/s².
const START_SPEED: f64 = 0.1;
const START_ACCELERATION: f64 = 0.3;

/// So many requests; the seed of each is its index.
#[must_use]
pub fn mixed_requests(robot: &UnitRobot, count: usize) -> Vec<PlanRequest> {
    let mut rng = Pcg64::seed_from_u64(SEED);
    let robot = &robot
        .to_unit()
        .expect("the unit robot's sections are equally long");
    let mut kinds = SETTINGS.map(|setting| {
        let targets = (0..).filter_map(move |index| draw_target(robot, setting, SEED, index));
        targets.flat_map(pairs)
    });
    let request = |index: usize| {
        let (start, target) = kinds[index % SETTINGS.len()].next().unwrap();
        request(index, start, &target, &mut rng)
    };
    (0..count).map(request).collect()
}

/// A target with each of its starts.
fn pairs(target: Target) -> impl Iterator<Item = ([f64; 6], Target)> {
    let starts = target.starts.clone().into_iter();
    starts.map(move |start| (start.into(), target.clone()))
}

fn request(index: usize, start: [f64; 6], target: &Target, rng: &mut Pcg64) -> PlanRequest {
    let goal = if is_every(TO_CONFIGURATION, index) {
        Goal::Configuration(target.generator.into())
    } else {
        Goal::Tip {
            position_m: target.tip.into(),
            tolerance_m: None,
        }
    };
    let ball = |ball: &collision::Ball| Ball {
        centre_m: ball.centre.into(),
        radius_m: ball.radius,
    };
    let mut request = PlanRequest {
        seed: index as u64,
        candidate_count: CANDIDATES,
        deadline: Some(NO_DEADLINE),
        balls: target.scene.balls().iter().map(ball).collect(),
        selection: rule(index),
        ..PlanRequest::new(start, goal)
    };
    if is_every(MOVING, index) {
        let mut within = |limit: f64| std::array::from_fn(|_| rng.random_range(-limit..limit));
        request.start_velocity_rad_s = within(START_SPEED);
        request.start_acceleration_rad_s2 = within(START_ACCELERATION);
    }
    request
}

fn rule(index: usize) -> SelectionRule {
    match Selection::ALL[index % Selection::ALL.len()] {
        Selection::ByIndex => SelectionRule::Index(index % CANDIDATES),
        measure => SelectionRule::Best(measure),
    }
}

/// Whether it is the last one of `period`.
#[must_use]
pub fn is_every(period: usize, index: usize) -> bool {
    index % period == period - 1
}
