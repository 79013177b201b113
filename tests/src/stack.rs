//! The three processes of one robot, and how to make them move.

mod readiness;

use std::path::Path;
use std::process::Stdio;
use std::thread::{scope, sleep};
use std::time::Duration;

use client::{Candidate, Client, ClientError, ControllerView, RobotView};
use pcc_model::Configuration;
use realtime::use_fifo_priority;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, Outcome};
use shared_types::valid::{ControllerState, Goal, PlanRequest};
use trajectory::{Knot, Trajectory};

use crate::priority::OF_A_SENTRY;
use crate::process::{Process, TimedOut, wait_for};
use crate::retries;
use crate::world::{Settings, World};

/// Long enough for everything that should happen at all.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Deadline of requests whose answers are compared: never reached.
pub const NO_DEADLINE: Duration = Duration::from_secs(60);
/// How often a motion that was refused because something is not ready yet is asked for.
const ATTEMPTS: usize = 40;
const PAUSE: Duration = Duration::from_millis(250);
/// How often a motion that was cut short is asked for.
pub const MOTION_ATTEMPTS: usize = 3;
/// A motion that has not begun so long after it was published, ns, was let go of: the robot had ramped to rest.
const BEGINS_WITHIN_NS: i64 = 2_000_000_000;

/// One of the three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The planner daemon.
    Daemon,
    /// The controller.
    Controller,
    /// The simulated robot.
    Robot,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Daemon, Self::Controller, Self::Robot];

    /// Its program's name.
    #[must_use]
    pub const fn program(self) -> &'static str {
        match self {
            Self::Daemon => "planner-daemon",
            Self::Controller => "controller",
            Self::Robot => "simulated-robot",
        }
    }

    /// Starts it.
    #[must_use]
    pub fn start(self, world: &World) -> Process {
        let config = self.config(world);
        Process::start(world, self.program(), &["--config", &config])
    }

    /// Starts it as a folder's build of it.
    #[must_use]
    pub fn start_built(self, world: &World, folder: &Path) -> Process {
        let (program, config) = (folder.join(self.program()), self.config(world));
        Process::start_program(world, &program, &["--config", &config])
    }

    /// Starts it with another standard error.
    #[must_use]
    pub fn start_onto(self, world: &World, errors: Stdio) -> Process {
        let config = self.config(world);
        Process::start_onto(world, self.program(), &["--config", &config], errors)
    }

    fn config(self, world: &World) -> String {
        let file = world.config(&format!("{}.toml", self.program()));
        file.to_str().unwrap().to_owned()
    }
}

/// Why a motion did not come about.
#[derive(Debug, thiserror::Error)]
pub enum MoveError {
    /// A process did not do its part in time.
    #[error(transparent)]
    TimedOut(#[from] TimedOut),
    /// The client failed.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The daemon said no, or published nothing.
    #[error("not executed: {outcome}: {reason}")]
    Refused {
        /// The daemon's outcome.
        outcome: Outcome,
        /// Its text.
        reason: String,
    },
    /// The controller did not finish it.
    #[error("the motion was cut short: {0}")]
    CutShort(String),
}

/// What a motion did.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Its id.
    pub trajectory_id: u32,
    /// Tip error of the commanded configuration at its end, m.
    pub commanded_tip_error: f64,
    /// Tip error of the measured configuration at its end, m.
    pub measured_tip_error: f64,
    /// Its duration, s.
    pub duration_s: f64,
}

/// The running processes and the test's own connections to them.
#[derive(Debug)]
pub struct Stack {
    /// Asks for plans.
    pub client: Client,
    /// Watches and commands the controller.
    pub controller: ControllerView,
    /// Watches the robot.
    pub robot: RobotView,
    processes: [Option<Process>; 3],
    /// Where controller and robot run, and the daemon, unless it has a world of its own; dropped last.
    pub world: World,
    /// Where the daemon runs that speaks with the others over a [`crate::bridge::Bridge`].
    daemon_world: Option<World>,
}

impl Stack {
    /// Connects to a world in which nothing runs yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self::within(World::new(settings))
    }

    /// Connects to a world in which nothing runs yet and that was prepared before.
    #[must_use]
    pub fn within(world: World) -> Self {
        Self::within_worlds(world, None)
    }

    fn within_worlds(world: World, daemon_world: Option<World>) -> Self {
        let options = &world.options;
        let of_daemon = daemon_world.as_ref().unwrap_or(&world);
        Self {
            client: Client::connect(&of_daemon.options).unwrap(),
            controller: ControllerView::connect(options).unwrap(),
            robot: RobotView::connect(options).unwrap(),
            processes: [None, None, None],
            world,
            daemon_world,
        }
    }

    /// Connects to two worlds in which nothing runs yet: the daemon's own, and that of controller and robot. A
    /// [`crate::bridge::Bridge`] carries what they say to each other.
    #[must_use]
    pub fn in_two_worlds(settings: &Settings) -> Self {
        let [world, daemon_world] = [(); 2].map(|()| World::new(settings));
        Self::within_worlds(world, Some(daemon_world))
    }

    /// The daemon's world, and that of controller and robot: mostly the same.
    #[must_use]
    pub fn worlds(&self) -> [&World; 2] {
        [
            self.daemon_world.as_ref().unwrap_or(&self.world),
            &self.world,
        ]
    }

    /// Starts all three and waits until they are ready.
    ///
    /// # Errors
    /// [`TimedOut`] with the log of the one that is not.
    pub fn running(settings: &Settings) -> Result<Self, TimedOut> {
        let mut stack = Self::new(settings);
        for part in Part::ALL {
            stack.start(part);
        }
        stack.wait_until_ready()?;
        Ok(stack)
    }

    /// Gives the place at the daemon back that this stack's own client has taken.
    pub fn disconnect_client(&mut self) {
        self.client = Client::connect(&self.world.options).unwrap();
    }

    /// Starts a part, in place of the one that ran.
    pub fn start(&mut self, part: Part) {
        self.processes[part as usize] = None;
        let [of_daemon, of_others] = self.worlds();
        let world = if part == Part::Daemon {
            of_daemon
        } else {
            of_others
        };
        let process = part.start(world);
        self.processes[part as usize] = Some(process);
    }

    /// Starts a part, in place of the one that ran, with another standard error.
    pub fn start_onto(&mut self, part: Part, errors: Stdio) {
        self.processes[part as usize] = None;
        self.processes[part as usize] = Some(part.start_onto(&self.world, errors));
    }

    /// The running process of a part.
    #[must_use]
    pub fn process(&mut self, part: Part) -> &mut Process {
        self.processes[part as usize]
            .as_mut()
            .expect("the test started it")
    }

    /// SIGKILL.
    pub fn kill9(&mut self, part: Part) {
        self.process(part).kill9();
    }

    /// Holds all three, as when a whole machine pauses, and lets them go on at the same time.
    pub fn pause(&mut self, pause: Duration, meanwhile: impl FnOnce()) {
        self.signal_at_once(libc::SIGSTOP);
        sleep(pause);
        meanwhile();
        self.signal_at_once(libc::SIGCONT);
    }

    /// Sends a signal to all three from above their own threads, so that none goes on while another still waits for its signal.
    pub fn signal_at_once(&mut self, signal: libc::c_int) {
        let processes: &[_] = &self.processes;
        let send = || {
            // A refusal makes them apart in time, and nothing else.
            let _ = use_fifo_priority(OF_A_SENTRY);
            let running = processes.iter().flatten();
            running.for_each(|process| process.signal(signal));
        };
        scope(|scope| {
            scope.spawn(send);
        });
    }

    /// The newest state of the controller.
    #[must_use]
    pub fn controller_state(&mut self) -> ControllerState {
        let view = &mut self.controller;
        wait_for("a controller state", PATIENCE, || {
            view.latest_state().unwrap()
        })
        .unwrap()
    }

    /// The configuration commanded now.
    #[must_use]
    pub fn commanded(&mut self) -> Configuration {
        Configuration::from(self.controller_state().values.commanded_configuration_rad)
    }

    /// Plans a motion from where the robot is and has it executed; returns its id without waiting for its end.
    ///
    /// # Errors
    /// [`MoveError`].
    pub fn begin_motion(&mut self, goal: Goal) -> Result<u32, MoveError> {
        self.begin_known_motion(goal).map(|(id, _)| id)
    }

    /// The same, with the trajectory that was planned.
    ///
    /// # Errors
    /// [`MoveError`].
    pub fn begin_known_motion(&mut self, goal: Goal) -> Result<(u32, Trajectory), MoveError> {
        let mut refused = None;
        for _ in 0..ATTEMPTS {
            let request = PlanRequest {
                sampler: self.world.sampler(),
                deadline: Some(Duration::from_secs(10)),
                // Checks of publication and supervision: nothing of the live scene is planned around.
                ignores_live_scene: true,
                execute: true,
                seed: 3,
                ..PlanRequest::new(self.commanded().into(), goal)
            };
            match self.try_known_motion(&request) {
                Err(MoveError::Refused { outcome, reason })
                    if outcome == Outcome::ExecutionRefused =>
                {
                    let error = MoveError::Refused { outcome, reason };
                    retries::note(&error.to_string());
                    refused = Some(error);
                    sleep(PAUSE);
                }
                result => return result,
            }
        }
        Err(refused.expect("there was an attempt"))
    }

    /// Has a request executed.
    ///
    /// # Errors
    /// [`MoveError`].
    pub fn try_motion(&mut self, request: &PlanRequest) -> Result<u32, MoveError> {
        self.try_known_motion(request).map(|(id, _)| id)
    }

    fn try_known_motion(&mut self, request: &PlanRequest) -> Result<(u32, Trajectory), MoveError> {
        let answer = self.client.plan(request, PATIENCE)?;
        let report = answer.report();
        let id = report.trajectory_id.ok_or_else(|| MoveError::Refused {
            outcome: report.outcome,
            reason: report.reason.clone(),
        })?;
        let selected = answer.selected().expect("what is executed was selected");
        Ok((id, trajectory_of(&selected)))
    }

    /// The motion that a request is answered with, without executing it; none where nothing was planned.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn planned(&mut self, wanted: &PlanRequest) -> Result<Option<Trajectory>, ClientError> {
        let only_planned = PlanRequest {
            execute: false,
            ..wanted.clone()
        };
        let answer = self.client.plan(&only_planned, PATIENCE)?;
        Ok(answer.selected().as_ref().map(trajectory_of))
    }

    /// Waits until the controller is on its way along a trajectory, at least for `seconds`.
    ///
    /// # Errors
    /// [`TimedOut`].
    pub fn wait_for_progress(&mut self, id: u32, seconds: f64) -> Result<(), TimedOut> {
        let view = &mut self.controller;
        let moving = wait_for("the robot is on its way", PATIENCE, || {
            let state = view.latest_state().ok().flatten()?;
            let on_it =
                state.values.trajectory_id == id && state.values.trajectory_time_s >= seconds;
            (on_it && state.state == LoopState::Executing).then_some(())
        });
        moving.map_err(|_| self.not_ready(Part::Controller, "no progress"))
    }

    /// Waits until the controller holds at the end of a trajectory.
    ///
    /// # Errors
    /// [`MoveError::CutShort`] if it holds elsewhere or is in fault.
    pub fn wait_for_end(&mut self, id: u32) -> Result<ControllerState, MoveError> {
        let (view, asked_ns) = (&mut self.controller, mono_now_ns());
        let end = wait_for("the motion ends", PATIENCE, || {
            let state = view.latest_state().ok().flatten()?;
            let values = &state.values;
            let is_over = matches!(state.state, LoopState::Holding | LoopState::Fault);
            let known = values.trajectory_id == id || values.refused_trajectory_id == id;
            let never_begun = values.stamp_mono_ns > asked_ns + BEGINS_WITHIN_NS;
            (is_over && (known || never_begun)).then_some(state)
        });
        let state = end.map_err(|_| self.not_ready(Part::Controller, "the motion does not end"))?;
        if state.state == LoopState::Fault || state.values.trajectory_id != id {
            let text = format!("fault {}, refusal {}", state.fault, state.refusal);
            return Err(MoveError::CutShort(text));
        }
        Ok(state)
    }

    /// A whole motion to a tip, base frame, m; asked for again where a machine that stalled has cut it short.
    ///
    /// # Errors
    /// [`MoveError`].
    pub fn move_tip(&mut self, tip: [f64; 3]) -> Result<Motion, MoveError> {
        for _ in 1..MOTION_ATTEMPTS {
            match self.move_tip_once(tip) {
                Err(error @ MoveError::CutShort(_)) => {
                    retries::note(&error.to_string());
                    self.clear_fault()?;
                }
                result => return result,
            }
        }
        self.move_tip_once(tip)
    }

    /// A whole motion to a tip, base frame, m.
    ///
    /// # Errors
    /// [`MoveError`].
    pub fn move_tip_once(&mut self, tip: [f64; 3]) -> Result<Motion, MoveError> {
        let goal = Goal::tip(tip);
        let id = self.begin_motion(goal)?;
        let end = self.wait_for_end(id)?;
        // The motors have settled and the noise of one measurement is not the figure.
        sleep(Duration::from_millis(200));
        let measured = self
            .robot
            .latest()?
            .map_or([0.0; 6], |state| state.values.measured_configuration_rad);
        let body = self.world.body();
        Ok(Motion {
            trajectory_id: id,
            commanded_tip_error: body.tip_error(&end.values.commanded_configuration_rad, &tip),
            measured_tip_error: body.tip_error(&measured, &tip),
            duration_s: end.values.trajectory_time_s,
        })
    }
}

fn trajectory_of(candidate: &Candidate<'_>) -> Trajectory {
    let knots = candidate.knots.iter().map(|knot| Knot {
        time: knot.time_s,
        position: Configuration::from(knot.configuration_rad),
        velocity: Configuration::from(knot.velocity_rad_s),
        acceleration: Configuration::from(knot.acceleration_rad_s2),
    });
    Trajectory::new(knots.collect()).expect("an answer is a trajectory")
}
