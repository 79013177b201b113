//! A robot that moves along a motion through several goals, with another motion published that will leave it at the first of them.

use std::thread::sleep;
use std::time::Duration;

use anyhow::Context;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, MotionOutcome, Refusal, Sampler, StartKind};
use shared_types::message::MotionResult;
use shared_types::valid::{Goal, PlanRequest};
use tests::bridge::{Bridge, BridgeProcess};
use tests::judge::Judge;
use tests::knots::state_at;
use tests::listener::{Heard, Listener, Published};
use tests::process::wait_for;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

/// Configurations that the robot is to pass and to reach, rad.
const VIA: [f64; 6] = [0.9, -0.6, 0.5, 0.7, -0.7, 0.9];
const FIRST_END: [f64; 6] = [-0.2, 0.9, 0.8, -0.4, 0.3, 0.6];
const SECOND_END: [f64; 6] = [-0.8, 0.7, -0.6, -0.5, 0.8, -0.7];
/// Where the robot goes after the fault.
const AFTERWARDS: [f64; 6] = [0.3, 0.2, -0.4, 0.5, -0.2, 0.4];
/// From the request of the joining motion to the goal at which it leaves the first one, s: the daemon leaves a motion at a goal that is at
/// most 0.4 s ahead.
const AHEAD_S: f64 = 0.38;
/// Path time that is left until the switch where a fault is injected, s.
const LEAST_PENDING_S: f64 = 0.1;
/// A reference that moves slower rests, m/s.
const AT_REST_M_S: f64 = 1e-6;
/// So long it must rest, ns.
const RESTED_NS: i64 = 300_000_000;
/// The longest that anything here moves.
const SETTLES_WITHIN: Duration = Duration::from_secs(20);

/// The processes, and everything that is heard of them.
pub(super) struct Stand {
    pub(super) stack: Stack,
    /// Between daemon and controller, where their messages are to be changed.
    pub(super) bridge: Option<Bridge>,
    /// The same as a process of its own, which can be killed.
    pub(super) bridge_process: Option<BridgeProcess>,
    listener: Listener,
    judge: Judge,
    heard: Heard,
    notes: Vec<String>,
}

/// How daemon and controller speak with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Direct,
    /// Over a bridge, which can change and add messages.
    Bridge,
    /// Over a bridge that is a process.
    BridgeProcess,
}

/// The two motions.
pub(super) struct Joining {
    pub(super) left: u32,
    pub(super) joined: u32,
    /// Path time of the first one at which it is to be left, s.
    pub(super) switch_s: f64,
}

impl Stand {
    pub(super) fn new(way: Way) -> anyhow::Result<Self> {
        let settings = Settings::default();
        let mut stack = match way {
            Way::Direct => Stack::new(&settings),
            Way::Bridge | Way::BridgeProcess => Stack::in_two_worlds(&settings),
        };
        let [near, far] = stack.worlds().map(|world| world.options.clone());
        let bridge = (way == Way::Bridge).then(|| Bridge::start(&near, &far));
        let bridge_process = (way == Way::BridgeProcess).then(|| BridgeProcess::start(&near, &far));
        Part::ALL.into_iter().for_each(|part| stack.start(part));
        stack.wait_until_ready()?;
        Ok(Self {
            bridge_process,
            listener: Listener::start(&stack.world.options),
            judge: Judge::new(stack.world.robot.tendon_limits),
            heard: Heard::default(),
            notes: Vec::new(),
            stack,
            bridge,
        })
    }

    /// The bridge of a stand that has one.
    pub(super) fn bridge(&self) -> &Bridge {
        self.bridge.as_ref().expect("the row has a bridge")
    }

    /// Notes something for the report.
    pub(super) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// What was noted.
    pub(super) fn notes(&self) -> String {
        self.notes.iter().map(|note| format!("; {note}")).collect()
    }

    /// Waits until all these trajectories have a result, and notes how many are refused as expected.
    ///
    /// # Errors
    /// Those that are not.
    pub(super) fn are_refused(&mut self, expected: &[(u32, Refusal, &str)]) -> anyhow::Result<()> {
        let listener = &self.listener;
        let refusal_of = |heard: &Heard, id: u32| {
            let result = heard.results.iter().find(|it| it.trajectory_id == id)?;
            Refusal::try_from(result.refusal).ok()
        };
        let _ = wait_for("all are refused", Duration::from_secs(1), || {
            let told = |&(id, ..): &(u32, Refusal, &str)| {
                listener.with(|heard| refusal_of(heard, id)).is_some()
            };
            expected.iter().all(told).then_some(())
        });
        let mut wrong = Vec::new();
        for &(id, wanted, what) in expected {
            let refusal = listener.with(|heard| refusal_of(heard, id));
            if refusal != Some(wanted) {
                wrong.push(format!("{what}: {refusal:?} instead of {wanted:?}"));
            }
        }
        anyhow::ensure!(
            wrong.is_empty(),
            "not refused by name: {}",
            wrong.join("; ")
        );
        self.note(format!(
            "{} messages refused, each by its name",
            expected.len()
        ));
        Ok(())
    }

    /// How many trajectories from this id on were refused.
    pub(super) fn refused_from(&self, id: u32) -> usize {
        let is_one = |it: &&MotionResult| {
            it.trajectory_id >= id && it.outcome == MotionOutcome::Refused.code()
        };
        self.listener
            .with(|heard| heard.results.iter().filter(is_one).count())
    }

    /// Begins the first motion, and asks for the second one shortly before the goal at which it is to leave the first.
    pub(super) fn ask_for_joining(&mut self) -> anyhow::Result<Joining> {
        let first = PlanRequest {
            via: vec![Goal::Configuration(VIA)],
            ..PlanRequest::from_robot(Goal::Configuration(FIRST_END))
        };
        let left = self.publish(&first)?;
        let motion = self.published(left)?;
        let via_s = passes_at(&motion, &VIA);
        anyhow::ensure!(via_s > 2.0 * AHEAD_S, "the premise: the goal is far ahead");
        self.wait_until(left, via_s - AHEAD_S)?;
        let second = PlanRequest {
            start: StartKind::AfterGoals,
            ..PlanRequest::from_robot(Goal::Configuration(SECOND_END))
        };
        let joined = self.publish(&second)?;
        let leaves = self.joining_leaves(joined)?;
        anyhow::ensure!(leaves.0 == left, "the premise: it leaves the first motion");
        Ok(Joining {
            left,
            joined,
            switch_s: leaves.1,
        })
    }

    /// Waits until the controller has taken the joining motion, its switch being ahead.
    pub(super) fn wait_until_pending(&mut self, joining: &Joining) -> anyhow::Result<()> {
        let view = &mut self.stack.controller;
        let pending = wait_for("the motion is pending", Duration::from_millis(200), || {
            let state = view.latest_state().ok().flatten()?;
            (state.values.pending_trajectory_id == joining.joined).then_some(state)
        });
        let state = pending.context("the premise: a switch is pending")?;
        let left_s = joining.switch_s - state.values.trajectory_time_s;
        anyhow::ensure!(
            left_s > LEAST_PENDING_S,
            "the premise: the switch is ahead: {left_s:.3} s"
        );
        Ok(())
    }

    /// Asks for a motion that is executed; its id.
    pub(super) fn publish(&mut self, request: &PlanRequest) -> anyhow::Result<u32> {
        let request = PlanRequest {
            execute: true,
            sampler: Sampler::Default,
            deadline: Some(Duration::from_millis(500)),
            ..request.clone()
        };
        Ok(self.stack.try_motion(&request)?)
    }

    /// A motion to somewhere else is planned and reached.
    pub(super) fn executes_anew(&mut self) -> anyhow::Result<()> {
        let view = &mut self.stack.controller;
        wait_for("the controller holds", Duration::from_secs(5), || {
            let state = view.latest_state().ok().flatten()?;
            (state.state == LoopState::Holding).then_some(())
        })?;
        let id = self.publish(&PlanRequest::from_robot(Goal::Configuration(AFTERWARDS)))?;
        self.stack.wait_for_end(id)?;
        Ok(())
    }

    /// The last lines of daemon and controller.
    pub(super) fn last_words(&mut self) -> String {
        let logs = [Part::Daemon, Part::Controller].map(|part| self.stack.process(part).log());
        let last = |log: &String| {
            let lines: Vec<&str> = log.lines().collect();
            lines[lines.len().saturating_sub(12)..].join("\n")
        };
        logs.each_ref().map(last).join("\n")
    }

    /// Where the bridge has changed a motion, the listener hears another one than the daemon's: the switch is asked of either.
    fn joining_leaves(&mut self, id: u32) -> anyhow::Result<(u32, f64)> {
        let sent = self.bridge.as_ref().map(|bridge| {
            wait_for("the bridge has it", PATIENCE, || {
                let message = bridge.joining()?;
                (message.trajectory_id == id).then_some(message)
            })
        });
        match sent.transpose()? {
            Some(message) => Ok((message.leaves_trajectory_id, message.leaves_at_s)),
            None => self.published(id)?.leaves.context("it leaves no motion"),
        }
    }

    fn published(&mut self, id: u32) -> anyhow::Result<Published> {
        let listener = &self.listener;
        let found = wait_for("the motion is heard", PATIENCE, || {
            listener.with(|heard| heard.motions.iter().find(|it| it.id == id).cloned())
        });
        Ok(found?)
    }

    /// Waits until a motion is followed at this path time, s, at full rate.
    pub(super) fn wait_until(&mut self, id: u32, path_time_s: f64) -> anyhow::Result<()> {
        let state = wait_for("the motion is under way", PATIENCE, || {
            let state = self.stack.controller.latest_state().ok().flatten()?;
            let is_on_it = state.state == LoopState::Executing && state.values.trajectory_id == id;
            (is_on_it && state.values.rate == 1.0).then_some(state)
        })?;
        let passed_s = (mono_now_ns() - state.values.stamp_mono_ns) as f64 * 1e-9;
        let ahead_s = path_time_s - state.values.trajectory_time_s - passed_s;
        sleep(Duration::from_secs_f64(ahead_s.max(0.0)));
        Ok(())
    }

    /// Waits until nothing moves; everything that was heard from the start until then.
    pub(super) fn settle(&mut self) -> anyhow::Result<Heard> {
        // A process that goes on after the fault has told nothing yet.
        sleep(Duration::from_nanos(RESTED_NS.unsigned_abs()));
        let listener = &self.listener;
        wait_for("the robot rests", SETTLES_WITHIN, || {
            let now_ns = mono_now_ns();
            listener.with(|heard| rests(heard, now_ns)).then_some(())
        })?;
        self.hear();
        Ok(std::mem::take(&mut self.heard))
    }

    /// Judges everything that was sent until now; the offences, and the largest uses of the limits.
    pub(super) fn judged(&mut self) -> &tests::judge::Verdict {
        self.hear();
        self.judge.verdict()
    }

    fn hear(&mut self) {
        self.heard = self.listener.take();
        self.judge.look(&self.heard);
    }
}

/// Whether the robot's reference has rested for a while, or, where the robot says nothing, the set-points have.
fn rests(heard: &Heard, now_ns: i64) -> bool {
    let slow = |velocities: &[f64; 9]| velocities.iter().all(|it| it.abs() < AT_REST_M_S);
    let since_ns = now_ns - RESTED_NS;
    let mut states = heard.robot.iter().rev();
    let mut states = states.by_ref().take_while(|it| it.stamp_mono_ns > since_ns);
    let mut cycles = heard.cycles.iter().rev();
    let cycles = cycles.by_ref().take_while(|it| it.stamp_mono_ns > since_ns);
    let mut any = false;
    let robot_rests = states.all(|it| {
        any = true;
        slow(&it.accepted_velocity_m_s)
    });
    if any {
        return robot_rests;
    }
    let mut cycles = cycles.peekable();
    cycles.peek().is_some() && cycles.all(|it| slow(&it.setpoint_velocity_m_s))
}

/// The path time at which a motion is nearest to a configuration, s.
fn passes_at(motion: &Published, via: &[f64; 6]) -> f64 {
    let end_s = motion.knots.last().map_or(0.0, |knot| knot.time_s);
    let distance = |time_s: f64| {
        let at = state_at(&motion.knots, time_s).map_or([f64::INFINITY; 6], |state| state[0]);
        let squares = at.iter().zip(via).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>()
    };
    let times = (0..(end_s * 1e3) as u32).map(|ms| f64::from(ms) * 1e-3);
    let nearest = times.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    nearest.unwrap_or(0.0)
}
