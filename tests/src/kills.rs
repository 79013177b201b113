//! SIGKILL of the three processes at random instants, restarted in any order.

use std::thread;
use std::time::Duration;

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::codes::{LoopState, MotorState};
use shared_types::message::{Cycle, RobotState};
use shared_types::valid::Goal;

use crate::listener::{Heard, Listener};
use crate::motion::{LimitsKept, TendonSample, limits_kept};
use crate::process::{TimedOut, wait_for};
use crate::stack::{MOTION_ATTEMPTS, MoveError, PATIENCE, Part, Stack};

/// A robot state's stamp is that of the measurement, up to two cycles from the evaluation of its set-point, s.
pub const STAMP_SLACK_S: f64 = 2e-3;

/// What the kills did.
#[derive(Clone, Debug, Default)]
pub struct Survival {
    /// Kills by part: daemon, controller, robot.
    pub kills: [usize; 3],
    /// Rounds after which a whole motion was planned, executed and reached.
    pub recovered: usize,
    /// Rounds.
    pub rounds: usize,
    /// What went wrong in the others.
    pub failures: Vec<String>,
    /// Motions after the kills that were stopped and had to be asked for again: a machine that stalls for more than
    /// 20 ms makes the robot ramp to rest, which is as it should be.
    pub interruptions: Vec<String>,
    /// Rounds that killed the controller, and not the robot, while the robot moved.
    pub controller_killed_in_motion: usize,
    /// Those of them in which the robot was seen to ramp to rest.
    pub ramps_seen: usize,
    /// Largest steps of the robot's own reference, restarts included.
    pub reference: LimitsKept,
    /// Largest use of the limits by the robot's ramps to rest.
    pub ramps: LimitsKept,
    /// Largest use of the limits by the set-points in motion, stops included.
    pub setpoints: LimitsKept,
    /// States of the robot in fault: a set-point broke a rule while it followed. (Set-points are also refused while it
    /// ramps to rest; those are no fault.)
    pub robot_faults: usize,
    /// Largest tip error at the end of the motions after the kills, m.
    pub tip_error: f64,
}

/// Kills each part `times` times alone, and all three together `times / 3` (at least one) times.
///
/// # Errors
/// [`TimedOut`] if the processes do not even start before the first kill.
pub fn kill_and_restart(stack: &mut Stack, times: usize, seed: u64) -> Result<Survival, TimedOut> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut rounds: Vec<Vec<Part>> = Part::ALL
        .iter()
        .flat_map(|part| vec![vec![*part]; times])
        .collect();
    rounds.extend(vec![Part::ALL.to_vec(); times.div_ceil(3)]);
    rounds.shuffle(&mut rng);
    stack.wait_until_ready()?;
    let mut survival = Survival::default();
    for (round, mut victims) in rounds.into_iter().enumerate() {
        victims.shuffle(&mut rng);
        survival.rounds += 1;
        match kill_round(stack, &victims, &mut rng, &mut survival) {
            Ok(()) => survival.recovered += 1,
            Err(error) => survival
                .failures
                .push(format!("round {round}, {victims:?} killed: {error}")),
        }
    }
    Ok(survival)
}

fn kill_round(
    stack: &mut Stack,
    victims: &[Part],
    rng: &mut Pcg64,
    survival: &mut Survival,
) -> Result<(), MoveError> {
    // A round that failed must not spoil the next one.
    stack.wait_until_ready()?;
    let listener = Listener::start(&stack.world.options);
    begin_random_motion(stack, rng)?;
    thread::sleep(Duration::from_millis(rng.random_range(0..600)));
    let controller_alone = victims == [Part::Controller];
    let was_moving = is_moving(&listener);
    for part in victims {
        stack.kill9(*part);
        survival.kills[*part as usize] += 1;
        thread::sleep(Duration::from_millis(rng.random_range(0..120)));
    }
    if controller_alone && was_moving {
        survival.controller_killed_in_motion += 1;
        survival.ramps_seen += usize::from(comes_to_rest_by_itself(&listener)?);
    }
    let mut order = victims.to_vec();
    order.shuffle(rng);
    for part in order {
        stack.start(part);
        thread::sleep(Duration::from_millis(rng.random_range(0..80)));
    }
    let recovered = recover(stack, survival);
    survival.look_at(stack, &listener.take());
    recovered
}

fn recover(stack: &mut Stack, survival: &mut Survival) -> Result<(), MoveError> {
    for attempt in 1.. {
        stack.wait_until_ready()?;
        match stack.move_tip_once([0.0, -1.55, 2.25]) {
            Err(MoveError::CutShort(fault)) if attempt < MOTION_ATTEMPTS => {
                survival.interruptions.push(fault);
            }
            result => {
                let error = result?.commanded_tip_error;
                survival.tip_error = survival.tip_error.max(error);
                break;
            }
        }
    }
    Ok(())
}

/// Somewhere else, so that there is a motion to interrupt.
fn begin_random_motion(stack: &mut Stack, rng: &mut Pcg64) -> Result<(), MoveError> {
    // Far enough inside the bending limits that a ramp to rest off the path stays within them at ten times the speed.
    let bend = rng.random_range(0.4..0.8);
    let side = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let goal = [side * bend, bend, 0.5, side * 0.4, -0.6, 0.3];
    let id = stack.begin_motion(Goal::Configuration(goal))?;
    stack.wait_for_progress(id, 0.0)?;
    Ok(())
}

fn is_moving(listener: &Listener) -> bool {
    listener.with(|heard| {
        heard.robot.last().is_some_and(|state| {
            let speed = |velocity: &f64| velocity.abs() > 1e-3;
            state.accepted_velocity_m_s.iter().any(speed)
        })
    })
}

/// Whether the robot reports its ramp, waiting until it is at rest.
fn comes_to_rest_by_itself(listener: &Listener) -> Result<bool, TimedOut> {
    let is = |state: &RobotState, wanted: MotorState| state.state == wanted.code();
    wait_for("the robot rests after its loss", PATIENCE, || {
        listener.with(|heard| {
            let last = heard.robot.last()?;
            is(last, MotorState::AtRestAfterLoss).then_some(())
        })
    })?;
    Ok(listener.with(|heard| {
        heard
            .robot
            .iter()
            .any(|state| is(state, MotorState::RampingToRest))
    }))
}

/// Pairs of neighbours between which the robot ramps to rest.
pub fn ramp_pairs(states: &[RobotState]) -> impl Iterator<Item = (TendonSample, TendonSample)> {
    let ramping = |state: &RobotState| state.state == MotorState::RampingToRest.code();
    let pairs = states.windows(2);
    let pairs = pairs.filter(move |pair| ramping(&pair[0]) && ramping(&pair[1]));
    pairs.map(|pair| ((&pair[0]).into(), (&pair[1]).into()))
}

/// Pairs of successive set-points of one controller in motion.
pub fn motion_pairs(cycles: &[Cycle]) -> impl Iterator<Item = (TendonSample, TendonSample)> {
    let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
    let pairs = cycles.windows(2).filter(move |pair| {
        let in_motion = pair.iter().all(|cycle| moving.contains(&cycle.state));
        in_motion && pair[1].sequence == pair[0].sequence + 1
    });
    pairs.map(|pair| ((&pair[0]).into(), (&pair[1]).into()))
}

impl Survival {
    fn look_at(&mut self, stack: &Stack, heard: &Heard) {
        let samples: Vec<TendonSample> = heard.robot.iter().map(TendonSample::from).collect();
        let limits = &stack.world.robot.tendon_limits;
        let kept = limits_kept(&samples, limits, STAMP_SLACK_S);
        self.ramps
            .add_pairs(ramp_pairs(&heard.robot), limits, STAMP_SLACK_S);
        self.setpoints
            .add_pairs(motion_pairs(&heard.cycles), limits, 0.0);
        let all = &mut self.reference;
        all.samples += kept.samples;
        all.velocity = all.velocity.max(kept.velocity);
        all.difference_velocity = all.difference_velocity.max(kept.difference_velocity);
        all.largest_step_m = all.largest_step_m.max(kept.largest_step_m);
        let is_fault = |state: &&RobotState| state.state == MotorState::Fault.code();
        self.robot_faults += heard.robot.iter().filter(is_fault).count();
    }
}
