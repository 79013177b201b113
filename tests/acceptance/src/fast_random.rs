//! Random requests of all kinds: feasible and not, well formed and not.

use std::f64::consts::TAU;
use std::time::Duration;

use datasets::scenes::{Setting, Target, draw_target};
use pcc_model::{Configuration, UnitRobot};
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_pcg::Pcg64;
use shared_types::codes::{Sampler, Selection};
use shared_types::message::{self, Ball};
use shared_types::valid::{Goal, PlanRequest, SelectionRule};

use crate::fast_scenes::wire_balls;

/// Seed of the scenes: no data set was made with it.
const SEED: u64 = 9014;
/// Scenes of the pool, and how many of each.
const SCENES: [(Setting, usize); 4] = [
    (Setting::General(None), 150),
    (Setting::General(Some(16)), 30),
    (Setting::General(Some(32)), 10),
    (Setting::Hard, 20),
];
/// Samplers and their weights.
const SAMPLERS: [(Sampler, u32); 6] = [
    (Sampler::Default, 4),
    (Sampler::Fast, 2),
    (Sampler::Straight, 1),
    (Sampler::StraightDrawn, 1),
    (Sampler::RrtConnect, 1),
    (Sampler::RrtSmooth, 1),
];
/// Ranges of the number of candidates and their weights: most ask for few.
const CANDIDATES: [([usize; 2], u32); 4] =
    [([1, 1], 40), ([2, 4], 35), ([5, 10], 15), ([11, 64], 10)];
/// Deadlines are between these, evenly in their logarithms, s.
const DEADLINES: [f64; 2] = [0.2e-3, 50e-3];
/// Balls that fill a request up are farther away than the robot reaches, m.
const FAR: f64 = 4.0;
const MOST_BALLS: usize = 64;

/// What is done with a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Treatment {
    /// Its answer is waited for.
    Ask,
    /// It is dropped so long after it was sent.
    Drop(Duration),
    /// A field of it is spoiled: it must be refused.
    Spoil,
}

/// Problems to make requests of.
pub(crate) struct Pool {
    targets: Vec<Target>,
    /// That a request asks for.
    most_candidates: usize,
}

impl Pool {
    pub(crate) fn draw(robot: &UnitRobot, most_candidates: usize) -> Self {
        let targets = SCENES.iter().flat_map(|&(setting, count)| {
            let drawn = (0..).filter_map(move |index| draw_target(robot, setting, SEED, index));
            drawn.take(count)
        });
        Self {
            targets: targets.collect(),
            most_candidates,
        }
    }

    /// That a request of this pool asks for.
    pub(crate) fn most_candidates(&self) -> usize {
        self.most_candidates
    }

    /// A well-formed request; some have no answer.
    pub(crate) fn request(&self, rng: &mut Pcg64) -> PlanRequest {
        let target = self.targets.choose(rng).expect("the pool is not empty");
        let start = *target.starts.choose(rng).expect("a target has starts");
        let mut request = PlanRequest::new(start.into(), goal(target, rng));
        request.balls = wire_balls(&target.scene);
        let free = MOST_BALLS - request.balls.len();
        if rng.random_bool(0.3) {
            let more = rng.random_range(0..=free);
            request.balls.extend((0..more).map(|_| far_ball(rng)));
        }
        request.seed = rng.random();
        request.candidate_count = candidates(rng).min(self.most_candidates);
        request.sampler = weighted(&SAMPLERS, rng);
        let [least, most] = DEADLINES.map(f64::ln);
        let deadline = rng.random_range(least..most).exp();
        request.deadline = Some(Duration::from_secs_f64(deadline));
        request.selection = selection(request.candidate_count, rng);
        if rng.random_bool(0.2) {
            request.limits_scale = rng.random_range(0.05..1.0);
        }
        if rng.random_bool(0.1) {
            request.early_candidate_count = Some(rng.random_range(1..=request.candidate_count));
        }
        if rng.random_bool(0.05) {
            let speed_rad_s = rng.random_range(0.0..0.5);
            request.start_velocity_rad_s =
                std::array::from_fn(|_| rng.random_range(-speed_rad_s..=speed_rad_s));
        }
        if rng.random_bool(0.08) {
            make_infeasible(&mut request, rng);
        }
        request
    }
}

/// What is done with the next request.
pub(crate) fn treatment(rng: &mut Pcg64) -> Treatment {
    match rng.random_range(0..100) {
        0..5 => Treatment::Spoil,
        5..9 => Treatment::Drop(Duration::from_micros(rng.random_range(0..3000))),
        _ => Treatment::Ask,
    }
}

fn weighted<T: Copy>(choices: &[(T, u32)], rng: &mut Pcg64) -> T {
    let chosen = choices.choose_weighted(rng, |choice| choice.1);
    chosen.expect("the weights are positive").0
}

fn candidates(rng: &mut Pcg64) -> usize {
    let [least, most] = weighted(&CANDIDATES, rng);
    rng.random_range(least..=most)
}

fn goal(target: &Target, rng: &mut Pcg64) -> Goal {
    if rng.random_bool(0.15) {
        return Goal::Configuration(target.generator.into());
    }
    Goal::Tip {
        position_m: target.tip.into(),
        tolerance_m: rng.random_bool(0.1).then(|| rng.random_range(0.01..0.03)),
    }
}

fn selection(candidates: usize, rng: &mut Pcg64) -> SelectionRule {
    match *Selection::ALL.choose(rng).expect("there are some") {
        Selection::ByIndex => SelectionRule::Index(rng.random_range(0..candidates)),
        rule => SelectionRule::Best(rule),
    }
}

fn far_ball(rng: &mut Pcg64) -> Ball {
    let (sine, cosine) = rng.random_range(0.0..TAU).sin_cos();
    Ball {
        centre_m: [FAR * cosine, FAR * sine, rng.random_range(-1.0..4.0)],
        radius_m: rng.random_range(0.0..0.5),
    }
}

/// Out of reach, in collision at one end, or bent too far.
pub(crate) fn make_infeasible(request: &mut PlanRequest, rng: &mut Pcg64) {
    let ball = |centre_m| Ball {
        centre_m,
        radius_m: 0.3,
    };
    let has_room = request.balls.len() < MOST_BALLS;
    match (rng.random_range(0..4), request.goal) {
        // The base stands in it, wherever the robot is bent to.
        (0, _) if has_room => request.balls.push(ball([0.0, 0.0, 0.3])),
        (1, Goal::Tip { position_m, .. }) if has_room => request.balls.push(ball(position_m)),
        (2, _) => request.start_configuration_rad = Configuration::repeat(1.5).into(),
        _ => {
            request.goal = Goal::Tip {
                position_m: [0.3, 0.2, 3.4],
                tolerance_m: None,
            }
        }
    }
}

/// Makes one field of a request one that no request may have.
pub(crate) fn spoil(wire: &mut message::PlanRequest, rng: &mut Pcg64) {
    let bad = *[f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300]
        .choose(rng)
        .expect("there are some");
    let component = rng.random_range(0..3);
    let goal = &mut wire.goals[0];
    match rng.random_range(0..15) {
        0 => wire.start_configuration_rad[component] = bad,
        1 => (goal.kind, goal.tip_m[component]) = (0, bad),
        2 => (goal.kind, goal.configuration_rad[component]) = (1, bad),
        3 => wire.limits_scale = bad,
        4 => (goal.kind, goal.tip_tolerance_m) = (0, bad),
        5 => {
            wire.ball_count = wire.ball_count.max(1);
            wire.balls[0].centre_m[component] = bad;
        }
        6 => wire.candidate_count = *[0, 65, u32::MAX].choose(rng).expect("there are some"),
        7 => wire.ball_count = rng.random_range(65..=u32::MAX),
        8 => wire.sampler = rng.random_range(9..=u32::MAX),
        11 => wire.early_candidate_count = rng.random_range(wire.candidate_count + 1..=u32::MAX),
        12 => wire.start_velocity_rad_s[component] = bad,
        13 => (wire.sampler, wire.previous_plan_id) = (2, rng.random_range(1..=u64::MAX)),
        14 => wire.execute = rng.random_range(2..=u32::MAX),
        9 => wire.deadline_ns = rng.random_range(60_000_000_001..=u64::MAX),
        _ => wire.begin_mono_ns = rng.random_range(i64::MIN..0),
    }
}

#[cfg(test)]
mod unit {
    use rand::SeedableRng;
    use tests::programs::repository;

    use super::*;
    use pcc_model::Robot;

    #[test]
    fn requests_are_well_formed_until_they_are_spoiled() {
        let robot = Robot::from_file(&repository().join("config/robots/unit.toml")).unwrap();
        let robot = robot.to_unit().unwrap();
        let target = (0..).find_map(|i| draw_target(&robot, Setting::General(Some(4)), SEED, i));
        let pool = Pool {
            most_candidates: 64,
            targets: vec![target.unwrap()],
        };
        let mut rng = Pcg64::seed_from_u64(1);
        let mut most_balls = 0;
        for _ in 0..2000 {
            let request = pool.request(&mut rng);
            most_balls = most_balls.max(request.balls.len());
            let mut wire = message::PlanRequest::try_from(&request).unwrap();
            assert_eq!(PlanRequest::try_from(&wire), Ok(request));
            spoil(&mut wire, &mut rng);
            assert!(PlanRequest::try_from(&wire).is_err());
        }
        assert!(most_balls > 60, "{most_balls}");
    }
}
