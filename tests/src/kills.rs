//! Processes that are killed and stopped, and threads that are held, at random instants: what the robot was sent meanwhile, whether
//! the motion was watched over again, and whether everything goes on.

mod proof;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;
use std::thread;
use std::time::{Duration, Instant};

use client::{Pending, ScenePublisher};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, MotorState};
use shared_types::message::{MovingBall, RobotState};
use shared_types::valid::Command;

use crate::disturbance::{Kind, Ongoing, threads};
use crate::judge::{Judge, Verdict};
use crate::listener::{Heard, Listener};
use crate::process::{TimedOut, wait_for};
use crate::rounds::{Phase, Round, goal_of, no_way_out, rounds};
use crate::stack::{Part, Stack};
use crate::supervision::{Since, Watch, Watched};
use crate::world::shipped_number;

/// Of each scene that is shown: no round lasts so long, so that no motion is stopped for a scene that has grown old.
const SCENE_LIFETIME: Duration = Duration::from_secs(600);
/// Everything is ready again so long after a disturbance has ended, or a motion under way then: a controller gives a lost daemon
/// 0.2 s and stops in less than 0.4 s, a daemon loads its weights in less than 1 s.
pub const READY_WITHIN: Duration = Duration::from_secs(5);
/// A controller that holds for so long has no motion to begin any more: 50 ms of lead, and 300 ms in which it may be taken up.
const QUIET_NS: i64 = 400_000_000;
/// A process that was started is disturbed at most so long after, ms.
const STARTING_MS: f64 = 120.0;
/// The shipped `begin_lead_ms`: a motion begins so long after it was published.
static BEGIN_LEAD_MS: LazyLock<f64> =
    LazyLock::new(|| shipped_number("planner-daemon.toml", "begin_lead_ms"));
/// The longest motion asked for here takes less than 4 s.
const MOTION_WITHIN: Duration = Duration::from_secs(8);

/// What the disturbances did.
#[derive(Clone, Debug, Default)]
pub struct Survival {
    /// Disturbances by process and kind.
    pub disturbances: BTreeMap<String, usize>,
    /// Disturbances by kind, process and what was going on at their instant, as seen from outside.
    pub phases: BTreeMap<String, usize>,
    /// Threads that the ready processes have.
    pub threads_seen: BTreeSet<String>,
    /// How often each thread was held.
    pub threads_held: BTreeMap<String, usize>,
    /// Disturbances.
    pub rounds: usize,
    /// Those after which everything was ready in time and a motion was planned, executed and reached when first asked for.
    pub recovered: usize,
    /// Why it was not after the others.
    pub failures: Vec<String>,
    /// Motions that had to be asked for again, by cause.
    pub asked_again: BTreeMap<String, usize>,
    /// Faults that the controller had latched and that one reset cleared.
    pub faults: BTreeMap<String, usize>,
    /// Motions under way at a disturbance that did not come to their end, by what was disturbed.
    pub cut_short: BTreeMap<String, usize>,
    /// Longest time until everything was ready again, s.
    pub ready_s: f64,
    /// Largest tip error at the end of the motions after the disturbances, m.
    pub tip_error_m: f64,
    /// Balls put in the way, and what came of them.
    pub watched: Watched,
    /// Balls put in the way of motions that were made after a daemon was killed, stopped or held.
    pub watched_anew: Watched,
    /// Times that a controller was killed in motion and the robot's ramp to rest was looked for, and those that it was seen.
    pub ramps: (usize, usize),
    /// What the robot was sent, and made of it.
    pub verdict: Verdict,
}

impl Survival {
    /// Disturbances of the daemon.
    #[must_use]
    pub fn daemons_disturbed(&self) -> usize {
        let each = self.disturbances.iter();
        let daemons = each.filter(|(name, _)| name.ends_with(Part::Daemon.program()));
        daemons.map(|(_, count)| count).sum()
    }
}

/// Disturbs each process in each way, `count` times in all.
///
/// # Errors
/// [`TimedOut`] if the processes do not even start before the first disturbance.
pub fn disturb(
    stack: &mut Stack,
    kinds: &[Kind],
    count: usize,
    seed: u64,
) -> Result<Survival, TimedOut> {
    stack.wait_until_ready()?;
    let mut experiment = Experiment {
        listener: Listener::start(&stack.world.options),
        scenes: ScenePublisher::connect(&stack.world.options, "disturbances").unwrap(),
        judge: Judge::new(stack.world.robot.tendon_limits),
        rng: Pcg64::seed_from_u64(seed),
        held: [0; 3],
        survival: Survival::default(),
        stack,
    };
    experiment.wait_until_heard()?;
    experiment.note_threads();
    for round in rounds(kinds, count, &mut experiment.rng) {
        experiment.carry_out(round);
    }
    let mut survival = experiment.survival;
    survival.verdict = experiment.judge.verdict().clone();
    Ok(survival)
}

/// A motion or a plan that a disturbance falls into.
#[derive(Debug, Default)]
struct Underway {
    pending: Option<Pending>,
    motion: Option<u32>,
    /// Where the motion ends.
    goal: Option<[f64; 6]>,
    /// The process that was started, and when.
    starting: Option<(Part, i64)>,
}

struct Experiment<'a> {
    listener: Listener,
    scenes: ScenePublisher,
    judge: Judge,
    rng: Pcg64,
    /// Holds of each part so far.
    held: [usize; 3],
    survival: Survival,
    stack: &'a mut Stack,
}

impl Experiment<'_> {
    /// The first disturbance must not come before anybody listens: what was sent until then would not be judged.
    fn wait_until_heard(&self) -> Result<(), TimedOut> {
        wait_for("everything is heard", READY_WITHIN, || {
            let is_heard = self.listener.with(|heard| {
                let robot_and_cycles = !heard.robot.is_empty() && !heard.cycles.is_empty();
                robot_and_cycles && !heard.setpoints.is_empty() && !heard.controller.is_empty()
            });
            is_heard.then_some(())
        })
    }

    fn carry_out(&mut self, round: Round) {
        let number = self.survival.rounds;
        self.survival.rounds += 1;
        let result = self.try_round(round);
        let heard = self.listener.take();
        self.judge.look(&heard);
        match result {
            Ok(()) => self.survival.recovered += 1,
            Err(error) => {
                let Round {
                    phase, part, kind, ..
                } = round;
                let what = format!("{number}: {kind:?} of {} while {phase:?}", part.program());
                self.survival.failures.push(format!("{what}: {error}"));
                // The next round must not pay for this one.
                self.start_all_anew();
            }
        }
    }

    fn start_all_anew(&mut self) {
        for part in Part::ALL {
            self.stack.start(part);
        }
        // What failed has been counted.
        let cleared = self.stack.clear_fault().map_err(|error| error.to_string());
        if let Err(error) = cleared.and_then(|_| self.show(&[])) {
            self.survival.failures.push(format!("anew: {error}"));
        }
    }

    fn try_round(&mut self, round: Round) -> Result<(), String> {
        let mut underway = self.enter(round)?;
        let phase = self.observed_phase(&mut underway);
        let phase = format!("{:?} of {} while {phase}", round.kind, round.part.program());
        *self.survival.phases.entry(phase).or_default() += 1;
        let begun_ns = mono_now_ns();
        let was_moving = self.moves();
        let shown_ns = self.disturb(round, &underway)?;
        let ended_ns = mono_now_ns();
        if let Some((part, _)) = underway.starting
            && !self.stack.process(part).is_running()
        {
            return Err(format!("{} has ended by itself", part.program()));
        }
        let is_killed_daemon = (round.part, round.kind) == (Part::Daemon, Kind::Kill);
        if let Some(shown_ns) = shown_ns {
            self.watch(&Watch {
                part: round.part,
                kind: round.kind,
                since: if is_killed_daemon {
                    Since::NextDaemon
                } else {
                    Since::FreshState
                },
                begun_ns,
                shown_ns,
                ended_ns,
            });
        }
        drop(underway.pending.take());
        self.recover(ended_ns)?;
        if was_moving {
            self.look_at_motion(round, underway.motion, begun_ns);
        }
        if round.part == Part::Daemon {
            self.prove_supervision(round.kind)?;
        }
        self.prove()
    }

    /// Brings about what the disturbance is to fall into, and lets a random time of it pass.
    fn enter(&mut self, round: Round) -> Result<Underway, String> {
        let mut underway = Underway::default();
        let within = |least_ms: f64, most_ms: f64| least_ms + round.place * (most_ms - least_ms);
        let mut pause_ms = within(0.0, 100.0);
        match round.phase {
            Phase::Resting => {}
            Phase::Starting => {
                let part = round.part;
                self.stack.kill9(part);
                underway.starting = Some((part, mono_now_ns()));
                self.stack.start(part);
                // Every order of magnitude alike: a robot is ready sooner than a daemon.
                pause_ms = within(0.0, STARTING_MS.ln()).exp();
            }
            Phase::Planning if round.visit.is_multiple_of(2) => {
                let submitted = self.stack.client.submit(&no_way_out());
                underway.pending = Some(submitted.map_err(|error| error.to_string())?);
                pause_ms = within(0.0, 250.0);
            }
            Phase::Planning => {
                let request = self.motion_request(0.25);
                let submitted = self.stack.client.submit(&request);
                underway.pending = Some(submitted.map_err(|error| error.to_string())?);
                pause_ms = within(0.0, 50.0);
            }
            Phase::Moving => {
                let request = self.motion_request(0.25);
                underway.goal = goal_of(&request);
                let (id, duration_s) = self.ask_until_taken(&request)?;
                underway.motion = Some(id);
                pause_ms = within(*BEGIN_LEAD_MS, *BEGIN_LEAD_MS + 1e3 * duration_s);
            }
        }
        thread::sleep(Duration::from_secs_f64(1e-3 * pause_ms));
        Ok(underway)
    }

    /// What goes on now, as an onlooker sees it.
    fn observed_phase(&mut self, underway: &mut Underway) -> String {
        if let Some((part, since_ns)) = underway.starting
            && !self.is_ready(part, since_ns)
        {
            return format!("starting {}", part.program());
        }
        let state = self
            .listener
            .with(|heard| heard.cycles.last().map(|cycle| cycle.state));
        let is = |wanted: LoopState| state == Some(wanted.code());
        if is(LoopState::Executing) || is(LoopState::Stopping) {
            return "moving".to_owned();
        }
        let answered = |pending| !matches!(self.stack.client.poll(pending), Ok(None));
        let phase = match underway.pending.as_mut().map(answered) {
            Some(false) => "planning",
            Some(true) => "awaiting its begin",
            None => "resting",
        };
        phase.to_owned()
    }

    fn is_ready(&mut self, part: Part, since_ns: i64) -> bool {
        let anew = |state: &RobotState| state.stamp_mono_ns > since_ns;
        match part {
            Part::Robot => self.listener.with(|heard| heard.robot.iter().any(anew)),
            Part::Daemon => self.stack.process(part).log().contains(" ready"),
            Part::Controller => self.listener.with(|heard| {
                let held = |cycle: &shared_types::message::Cycle| {
                    cycle.stamp_mono_ns > since_ns && cycle.state == LoopState::Holding.code()
                };
                heard.cycles.iter().any(held)
            }),
        }
    }

    fn moves(&self) -> bool {
        self.listener.with(|heard| {
            let last = heard.robot.last();
            last.is_some_and(|state| state.accepted_velocity_m_s.iter().any(|v| v.abs() > 1e-3))
        })
    }

    /// Disturbs a process for a random time. A ball in the way is there just before that is over; says when, ns.
    fn disturb(&mut self, round: Round, underway: &Underway) -> Result<Option<i64>, String> {
        let Round { part, kind, .. } = round;
        let name = format!("{kind:?} {}", part.program());
        *self.survival.disturbances.entry(name).or_default() += 1;
        let turn = self.held[part as usize];
        let trace = |error: crate::system_calls::TraceError| error.to_string();
        let ongoing = Ongoing::begin(self.stack, part, kind, turn).map_err(trace)?;
        if let Ongoing::Held(_, thread) = &ongoing {
            self.held[part as usize] += 1;
            let held = &mut self.survival.threads_held;
            *held.entry(thread.name.clone()).or_default() += 1;
        }
        thread::sleep(kind.draw_duration(&mut self.rng));
        let goal = underway.goal.filter(|_| round.has_ball);
        let shown_ns = goal.map(|_| mono_now_ns());
        if let Some(goal) = goal {
            self.show_ball_at(&goal)?;
        }
        ongoing.end(self.stack, part).map_err(trace)?;
        Ok(shown_ns)
    }

    /// Where the tip comes to.
    fn show_ball_at(&mut self, goal: &[f64; 6]) -> Result<(), String> {
        let tip = self.stack.world.robot.tip(&(*goal).into());
        self.show(&[MovingBall {
            centre_m: tip.into(),
            radius_m: 0.05,
            velocity_m_s: [0.0; 3],
        }])
    }

    fn show(&mut self, balls: &[MovingBall]) -> Result<(), String> {
        let shown = self.scenes.publish(balls, SCENE_LIFETIME);
        shown.map_err(|error| format!("no scene: {error}"))
    }

    /// Whether somebody stops the motion for the ball, once that can be known.
    fn watch(&mut self, watch: &Watch) {
        thread::sleep(watch.patience());
        let reaction = self.listener.with(|heard| watch.judge(heard));
        self.survival.watched.add(watch, &reaction);
    }

    /// Waits until everything is ready; a fault that was latched is reset once.
    fn recover(&mut self, ended_ns: i64) -> Result<(), String> {
        self.show(&[])?;
        let begin = Instant::now();
        let mut reset = None;
        loop {
            if begin.elapsed() > READY_WITHIN + MOTION_WITHIN {
                return Err(self.not_ready());
            }
            if self.is_quiet(ended_ns) && self.stack.client.wait_for_daemon(Duration::ZERO).is_ok()
            {
                break;
            }
            let state = self.stack.controller.latest_state().ok().flatten();
            if let Some(state) = state
                && state.state == LoopState::Fault
                && state.values.stamp_mono_ns > ended_ns
                && reset.is_none()
            {
                let fault = state.fault.to_string();
                *self.survival.faults.entry(fault.clone()).or_default() += 1;
                let reply = self
                    .stack
                    .controller
                    .command(Command::ResetFault, READY_WITHIN);
                reply.map_err(|error| format!("no reset: {error}"))?;
                reset = Some(fault);
            }
            thread::sleep(Duration::from_millis(2));
        }
        // A motion may have gone on to its end first.
        let since_rest_s = self.rested_s(ended_ns);
        self.survival.ready_s = self.survival.ready_s.max(since_rest_s);
        for part in Part::ALL {
            if !self.stack.process(part).is_running() {
                return Err(format!("{} has ended by itself", part.program()));
            }
        }
        if since_rest_s > READY_WITHIN.as_secs_f64() {
            return Err(format!("ready after {since_rest_s:.2} s"));
        }
        Ok(())
    }

    /// Whether the controller has held without a word for a while, up to now.
    fn is_quiet(&self, ended_ns: i64) -> bool {
        let now_ns = mono_now_ns();
        self.listener.with(|heard| {
            let holding = LoopState::Holding.code();
            let last = heard.cycles.last();
            let rested = heard.cycles.iter().rev();
            let since = rested.take_while(|cycle| cycle.state == holding).last();
            let long = since.is_some_and(|since| {
                now_ns - since.stamp_mono_ns.max(ended_ns - QUIET_NS / 2) > QUIET_NS
            });
            long && last.is_some_and(|last| now_ns - last.stamp_mono_ns < QUIET_NS / 4)
        })
    }

    /// Time from the end of the disturbance, or of the motion after it, until now, s.
    fn rested_s(&self, ended_ns: i64) -> f64 {
        let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
        let last_moved = self.listener.with(|heard| {
            let mut moved = heard.cycles.iter().rev();
            moved
                .find(|cycle| moving.contains(&cycle.state))
                .map(|cycle| cycle.stamp_mono_ns)
        });
        let since_ns = last_moved.map_or(ended_ns, |moved| moved.max(ended_ns));
        (mono_now_ns() - since_ns) as f64 * 1e-9
    }

    fn not_ready(&mut self) -> String {
        let state = self.stack.controller.latest_state().ok().flatten();
        let state = state.map(|state| (state.state, state.fault, state.refusal));
        let robot = self
            .listener
            .with(|heard| heard.robot.last().map(|state| (state.state, state.fault)));
        let logs = Part::ALL.map(|part| last_line(&self.stack.process(part).log()));
        format!("not ready: controller {state:?}, robot {robot:?}; {logs:?}")
    }

    /// What became of the motion that the disturbance fell into.
    fn look_at_motion(&mut self, round: Round, motion: Option<u32>, begun_ns: i64) {
        let state = self.stack.controller.latest_state().ok().flatten();
        let reached = state.is_some_and(|state| Some(state.values.trajectory_id) == motion);
        let stopped = self.listener.with(|heard| {
            let stopping = |cycle: &shared_types::message::Cycle| {
                cycle.stamp_mono_ns > begun_ns && cycle.state == LoopState::Stopping.code()
            };
            heard.cycles.iter().any(stopping)
        });
        if !reached || stopped {
            let name = format!("{:?} {}", round.kind, round.part.program());
            *self.survival.cut_short.entry(name).or_default() += 1;
        }
        if (round.part, round.kind) == (Part::Controller, Kind::Kill) {
            let ramps = &mut self.survival.ramps;
            let ramping = |state: &RobotState| {
                state.stamp_mono_ns > begun_ns && state.state == MotorState::RampingToRest.code()
            };
            let seen = |heard: &Heard| heard.robot.iter().any(ramping);
            ramps.0 += 1;
            ramps.1 += usize::from(self.listener.with(seen));
        }
    }

    fn note_threads(&mut self) {
        for part in Part::ALL {
            let pid = self.stack.process(part).pid();
            let names = threads(part.program(), pid).into_iter();
            self.survival
                .threads_seen
                .extend(names.map(|thread| thread.name));
        }
    }
}

fn last_line(log: &str) -> String {
    log.lines().last().unwrap_or_default().to_owned()
}
