//! Disturbances to come, and the requests that they fall into.

use std::collections::BTreeMap;
use std::time::Duration;

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use shared_types::codes::Sampler;
use shared_types::message::Ball;
use shared_types::valid::{Goal, PlanRequest};

use crate::disturbance::Kind;
use crate::stack::Part;

/// Sections that bend more turn back, rad: the limit of the shipped robot is π/2.
const BENT_AT_MOST_RAD: f64 = 1.3;

/// What the disturbed process is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// A process has been started and is not ready.
    Starting,
    /// A request is being planned, or its motion waits for its begin.
    Planning,
    /// The robot holds, and nobody asks for anything.
    Resting,
    /// The robot moves.
    Moving,
}

impl Phase {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Starting, Self::Planning, Self::Resting, Self::Moving];
}

/// One disturbance to come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Round {
    pub(crate) phase: Phase,
    pub(crate) part: Part,
    pub(crate) kind: Kind,
    /// Whether a ball is put in the motion's way: somebody has to stop it then.
    pub(crate) has_ball: bool,
    /// How often its process was disturbed in its way and its phase before.
    pub(crate) visit: usize,
    /// The place of its instant in the phase, 0 to 1.
    pub(crate) place: f64,
}

/// Instants of the same way, process and phase are drawn from different ones of at least so many equal parts of the phase, the
/// first from the first part: a process that starts is certainly not ready then.
const LEAST_PARTS: usize = 4;

/// Every way with every process in turn, each in every phase equally often: half of them in motion, two thirds of these with a ball;
/// in random order.
pub(crate) fn rounds(kinds: &[Kind], count: usize, rng: &mut Pcg64) -> Vec<Round> {
    let moving = [false, true, true].map(|has_ball| (Phase::Moving, has_ball));
    let others = [Phase::Starting, Phase::Planning, Phase::Resting].map(|phase| (phase, false));
    let phases: Vec<(Phase, bool)> = moving.into_iter().chain(others).collect();
    let ways: Vec<(Part, Kind)> = Part::ALL
        .into_iter()
        .flat_map(|part| kinds.iter().map(move |&kind| (part, kind)))
        .collect();
    let mut rounds: Vec<Round> = Vec::new();
    for turn in 0.. {
        let each = ways.iter().enumerate().map(|(i, &(part, kind))| {
            let (phase, has_ball) = phases[(turn + i) % phases.len()];
            Round {
                phase,
                part,
                kind,
                has_ball,
                visit: 0,
                place: 0.0,
            }
        });
        let mut each: Vec<Round> = each.collect();
        each.shuffle(rng);
        rounds.extend(each);
        if rounds.len() >= count {
            break;
        }
    }
    rounds.truncate(count);
    place(&mut rounds, rng);
    rounds
}

/// Draws the instants, stratified: see [`LEAST_PARTS`].
fn place(rounds: &mut [Round], rng: &mut Pcg64) {
    let mut alike: BTreeMap<(Phase, usize, Kind), Vec<usize>> = BTreeMap::new();
    for (index, round) in rounds.iter().enumerate() {
        let key = (round.phase, round.part as usize, round.kind);
        alike.entry(key).or_default().push(index);
    }
    for indices in alike.values() {
        let count = indices.len().max(LEAST_PARTS);
        let mut parts: Vec<usize> = (1..count).collect();
        parts.shuffle(rng);
        let parts = std::iter::once(0).chain(parts);
        for (visit, (&index, part)) in indices.iter().zip(parts).enumerate() {
            let within: f64 = rng.random();
            rounds[index].visit = visit;
            rounds[index].place = (part as f64 + within) / count as f64;
        }
    }
}

/// A motion to be executed from a configuration to one nearby: each section bends by `bend_rad`, to the inside where it is bent far.
pub(crate) fn somewhere_near(start: [f64; 6], bend_rad: f64, rng: &mut Pcg64) -> PlanRequest {
    let mut goal = start;
    for section in goal.chunks_exact_mut(2) {
        let angle = rng.random_range(0.0..std::f64::consts::TAU);
        let change = [bend_rad * angle.cos(), bend_rad * angle.sin()];
        let bent = (section[0] + change[0]).hypot(section[1] + change[1]);
        let sign = if bent > BENT_AT_MOST_RAD { -1.0 } else { 1.0 };
        section[0] += sign * change[0];
        section[1] += sign * change[1];
    }
    PlanRequest {
        deadline: Some(Duration::from_secs(2)),
        // Checks of publication and supervision: nothing of the live scene is planned around.
        ignores_live_scene: true,
        execute: true,
        seed: rng.random(),
        ..PlanRequest::new(start, Goal::Configuration(goal))
    }
}

/// The configuration that a request asks for.
pub(crate) fn goal_of(request: &PlanRequest) -> Option<[f64; 6]> {
    match request.goal {
        Goal::Configuration(goal) => Some(goal),
        Goal::Tip { .. } => None,
    }
}

/// A request that keeps the daemon planning for long: a cage around the straight robot, and many configurations outside for each of its goals.
pub(crate) fn no_way_out() -> PlanRequest {
    let mut balls = Vec::new();
    for ring in 0..3 {
        for place in 0..12 {
            let angle = f64::from(place) * std::f64::consts::TAU / 12.0;
            balls.push(Ball {
                centre_m: [
                    0.65 * angle.cos(),
                    0.65 * angle.sin(),
                    1.3 + 0.7 * f64::from(ring),
                ],
                radius_m: 0.3,
            });
        }
    }
    PlanRequest {
        sampler: Sampler::RrtConnect,
        candidate_count: 16,
        via: vec![Goal::tip([1.8, 0.0, 1.5]), Goal::tip([0.0, 1.8, 1.5])],
        deadline: Some(Duration::from_millis(400)),
        // A ball of an earlier round at the straight robot would be answered at once.
        ignores_live_scene: true,
        balls,
        ..PlanRequest::new([0.0; 6], Goal::tip([-1.5, 0.0, 1.8]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_process_is_disturbed_in_every_way_and_half_of_them_in_motion() {
        let rounds = rounds(&Kind::ALL, 108, &mut Pcg64::seed_from_u64(1));
        for part in Part::ALL {
            for kind in Kind::ALL {
                let those = rounds.iter().filter(|r| r.part == part && r.kind == kind);
                assert_eq!(those.count(), 12);
            }
        }
        let moving = rounds.iter().filter(|round| round.phase == Phase::Moving);
        assert_eq!(moving.count(), 54);
        let with_ball = rounds.iter().filter(|round| round.has_ball);
        assert_eq!(with_ball.count(), 36);
    }

    #[test]
    fn every_combination_is_tried_and_its_instants_are_spread_over_the_phase() {
        for (count, least) in [(54, 1), (500, 9)] {
            let rounds = rounds(&Kind::ALL, count, &mut Pcg64::seed_from_u64(1));
            for (part, kind, phase) in Part::ALL.into_iter().flat_map(|part| {
                Kind::ALL.into_iter().flat_map(move |kind| {
                    Phase::ALL.into_iter().map(move |phase| (part, kind, phase))
                })
            }) {
                let those = rounds
                    .iter()
                    .filter(|r| (r.part, r.kind, r.phase) == (part, kind, phase));
                let places: Vec<f64> = those.map(|round| round.place).collect();
                assert!(places.len() >= least, "{part:?} {kind:?} {phase:?}");
                assert!(places[0] < 0.25 && places.iter().all(|p| (0.0..1.0).contains(p)));
                assert!(least == 1 || places.iter().any(|place| *place > 0.8));
            }
        }
    }

    #[test]
    fn motions_go_on_for_ever_without_leaving_the_inside() {
        let mut rng = Pcg64::seed_from_u64(1);
        let mut at = [0.0; 6];
        for _ in 0..1000 {
            let goal = goal_of(&somewhere_near(at, 0.25, &mut rng)).unwrap();
            let moved = at
                .iter()
                .zip(&goal)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>();
            assert!((moved - 3.0 * 0.25_f64.powi(2)).abs() < 1e-12);
            for section in goal.chunks_exact(2) {
                assert!(section[0].hypot(section[1]) <= 1.55);
            }
            at = goal;
        }
    }
}
