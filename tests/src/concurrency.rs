//! Many requests of several clients at once while the controller runs: every answer is its own request's.

use std::collections::BTreeMap;
use std::thread;

use client::{Client, ControllerView, PlanAnswer};
use datasets::scenes::{Setting, draw_target};
use pcc_model::{Configuration, Point, Robot};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::codes::{LoopState, Sampler};
use shared_types::message::{Ball, Knot};
use shared_types::valid::{Goal, PlanRequest};

use crate::fnv1a;
use crate::process::wait_for;
use crate::stack::{NO_DEADLINE, PATIENCE};
use crate::world::World;

/// Clients at once: what the shipped configuration allows.
pub const CLIENTS: usize = 4;
/// Every so many requests the first client also has a motion executed, if the robot rests.
const EXECUTE_EVERY: usize = 5;

/// A motion ends at its goal but for rounding, rad.
const REACHED_RAD: f64 = 1e-9;

/// What came of the requests.
#[derive(Clone, Debug, Default)]
pub struct Answers {
    /// Requests sent.
    pub sent: usize,
    /// Answers with at least one candidate.
    pub with_candidates: usize,
    /// Requests without an answer, with the reason.
    pub lost: Vec<String>,
    /// Answers that belong to another request, with what differs.
    pub mixed_up: Vec<String>,
    /// Answers that differ from another one to the same request.
    pub differing: usize,
    /// Motions executed on the side to their ends.
    pub executed: usize,
    /// Motions on the side that the daemon refused, with its reason.
    pub refused: Vec<String>,
    /// Motions on the side that did not reach their goals.
    pub cut_short: Vec<String>,
    /// Fingerprint of the answer to each distinct request.
    pub fingerprints: BTreeMap<u64, u64>,
}

/// Distinct feasible requests of general scenes for the unit robot; the seed of each is its index.
#[must_use]
pub fn general_requests(robot: &Robot, count: usize, sampler: Sampler) -> Vec<PlanRequest> {
    let unit_robot = robot
        .to_unit()
        .expect("the unit robot's sections are equally long");
    let targets = (0..).filter_map(|i| draw_target(&unit_robot, Setting::General(None), 4242, i));
    let requests = targets.flat_map(|target| {
        let balls = target.scene.balls().iter().map(|ball| Ball {
            centre_m: ball.centre.into(),
            radius_m: ball.radius,
        });
        let balls: Vec<Ball> = balls.collect();
        let goal = Goal::Tip {
            position_m: target.tip.into(),
            tolerance_m: None,
        };
        target.starts.into_iter().map(move |start| PlanRequest {
            balls: balls.clone(),
            ..PlanRequest::new(start.into(), goal)
        })
    });
    let numbered = (0..count as u64)
        .zip(requests)
        .map(|(seed, request)| PlanRequest {
            seed,
            sampler,
            candidate_count: 1 + (seed % 4) as usize,
            deadline: Some(NO_DEADLINE),
            ..request
        });
    numbered.collect()
}

/// Each of [`CLIENTS`] clients asks for every request of `pool` `rounds` times, in an order of its own.
#[must_use]
pub fn ask_at_once(world: &World, pool: &[PlanRequest], rounds: usize) -> Answers {
    let ask = |client| move || ClientRun::new(world, pool, client).run(rounds);
    let parts: Vec<Answers> = thread::scope(|scope| {
        let clients: Vec<_> = (0..CLIENTS).map(|i| scope.spawn(ask(i))).collect();
        clients.into_iter().map(|c| c.join().unwrap()).collect()
    });
    parts.into_iter().fold(Answers::default(), merge)
}

fn merge(mut all: Answers, part: Answers) -> Answers {
    all.sent += part.sent;
    all.with_candidates += part.with_candidates;
    all.lost.extend(part.lost);
    all.mixed_up.extend(part.mixed_up);
    all.differing += part.differing;
    all.executed += part.executed;
    all.refused.extend(part.refused);
    all.cut_short.extend(part.cut_short);
    for (seed, fingerprint) in part.fingerprints {
        note(&mut all.fingerprints, &mut all.differing, seed, fingerprint);
    }
    all
}

fn note(known: &mut BTreeMap<u64, u64>, differing: &mut usize, seed: u64, fingerprint: u64) {
    let first = *known.entry(seed).or_insert(fingerprint);
    *differing += usize::from(first != fingerprint);
}

struct ClientRun<'a> {
    world: &'a World,
    pool: &'a [PlanRequest],
    index: usize,
    client: Client,
    controller: ControllerView,
    answers: Answers,
    /// The motion on the side that is under way, and its goal.
    underway: Option<(u32, [f64; 6])>,
}

impl<'a> ClientRun<'a> {
    fn new(world: &'a World, pool: &'a [PlanRequest], index: usize) -> Self {
        Self {
            world,
            pool,
            index,
            client: Client::connect(&world.options).unwrap(),
            controller: ControllerView::connect(&world.options).unwrap(),
            answers: Answers::default(),
            underway: None,
        }
    }

    fn run(mut self, rounds: usize) -> Answers {
        let mut rng = Pcg64::seed_from_u64(self.index as u64);
        let mut order: Vec<usize> = (0..self.pool.len()).collect();
        for round in 0..rounds {
            order.shuffle(&mut rng);
            for (turn, &which) in order.iter().enumerate() {
                let number = ((self.index * rounds + round) * self.pool.len() + turn) as u64 + 1;
                self.ask(which, number);
                if self.index == 0 && turn % EXECUTE_EVERY == 0 {
                    self.execute(rng.random_range(-0.6..0.6));
                }
            }
        }
        self.await_last();
        self.answers
    }

    fn ask(&mut self, which: usize, number: u64) {
        let pool = self.pool;
        let request = PlanRequest {
            request_id: number,
            ..pool[which].clone()
        };
        self.answers.sent += 1;
        let answer = match self.client.plan(&request, PATIENCE) {
            Ok(answer) => answer,
            Err(error) => return self.answers.lost.push(error.to_string()),
        };
        let answers = &mut self.answers;
        answers.with_candidates += usize::from(!answer.report().candidates.is_empty());
        if let Err(difference) = belongs_to(&self.world.robot, &request, &answer) {
            answers.mixed_up.push(difference);
        }
        let print = fingerprint(&answer);
        note(
            &mut answers.fingerprints,
            &mut answers.differing,
            request.seed,
            print,
        );
    }

    /// Sends the robot to a configuration in the plane, if it has come to the end of the motion before.
    fn execute(&mut self, bend: f64) {
        if !self.has_ended() {
            return;
        }
        let Ok(Some(state)) = self.controller.latest_state() else {
            return;
        };
        if state.state != LoopState::Holding {
            return;
        }
        let goal = [bend, 0.3 * bend, bend, 0.0, -bend, 0.2];
        let request = PlanRequest {
            sampler: Sampler::Straight,
            execute: true,
            deadline: Some(NO_DEADLINE),
            ..PlanRequest::new(
                state.values.commanded_configuration_rad,
                Goal::Configuration(goal),
            )
        };
        match self.client.plan(&request, PATIENCE) {
            Ok(answer) => match answer.report().trajectory_id {
                Some(id) => self.underway = Some((id, goal)),
                None => self.refuse(format!(
                    "{}: {}",
                    answer.report().outcome,
                    answer.report().reason
                )),
            },
            Err(error) => self.refuse(error.to_string()),
        }
    }

    /// Nobody else has anything executed, so that nothing is a reason to refuse.
    fn refuse(&mut self, why: String) {
        self.answers.refused.push(why);
    }

    /// Whether no motion on the side is under way any more; one that has just ended is counted by how.
    fn has_ended(&mut self) -> bool {
        let Some((id, goal)) = self.underway else {
            return true;
        };
        let Ok(Some(state)) = self.controller.latest_state() else {
            return false;
        };
        let values = &state.values;
        let is_over = matches!(state.state, LoopState::Holding | LoopState::Fault);
        let known = values.trajectory_id == id || values.refused_trajectory_id == id;
        if !(is_over && known) {
            return false;
        }
        self.underway = None;
        let at = Configuration::from(values.commanded_configuration_rad);
        let away_rad = (at - Configuration::from(goal)).norm();
        if values.trajectory_id == id && away_rad <= REACHED_RAD {
            self.answers.executed += 1;
        } else {
            self.answers.cut_short.push(format!(
                "motion {id}: {away_rad:.4} rad from its goal, fault {}, refusal {}",
                state.fault, state.refusal
            ));
        }
        true
    }

    fn await_last(&mut self) {
        let ended = wait_for("the last motion ends", PATIENCE, || {
            self.has_ended().then_some(())
        });
        if let Err(error) = ended {
            self.answers.cut_short.push(error.what);
        }
    }
}

/// Whether an answer is this request's: number, start to the bit, tip.
fn belongs_to(robot: &Robot, request: &PlanRequest, answer: &PlanAnswer) -> Result<(), String> {
    let report = answer.report();
    if report.request_id != request.request_id {
        return Err(format!(
            "number {} instead of {}",
            report.request_id, request.request_id
        ));
    }
    if report.candidates.len() > request.candidate_count {
        return Err(format!("{} candidates", report.candidates.len()));
    }
    answer
        .candidates()
        .try_for_each(|candidate| joins_ends(robot, request, candidate.knots))
}

fn joins_ends(robot: &Robot, request: &PlanRequest, knots: &[Knot]) -> Result<(), String> {
    let (first, last) = (&knots[0], &knots[knots.len() - 1]);
    if first.configuration_rad.map(f64::to_bits)
        != request.start_configuration_rad.map(f64::to_bits)
    {
        return Err(format!("starts at {:?}", first.configuration_rad));
    }
    let Goal::Tip { position_m, .. } = request.goal else {
        return Ok(());
    };
    let tip = robot.tip(&Configuration::from(last.configuration_rad));
    let error = (tip - Point::from(position_m)).norm();
    let tolerance = 0.01 * robot.section_lengths[0];
    if error <= tolerance {
        Ok(())
    } else {
        Err(format!("ends {error} m from its goal"))
    }
}

/// A hash of every byte of the knots and of the daemon's own hash.
fn fingerprint(answer: &PlanAnswer) -> u64 {
    let of_daemon = answer.report().plan_hash.to_ne_bytes();
    fnv1a::add(fnv1a::of_knots(answer), of_daemon)
}
