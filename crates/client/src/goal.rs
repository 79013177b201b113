//! A goal that the daemon keeps the robot on its way to.

use std::thread;
use std::time::Duration;

use shared_types::clock::mono_now_ns;
use shared_types::codes::GoalState;
use shared_types::ipc::{
    EventNotifier, IpcNode, IpcOptions, Publisher, Role, RoleHolder, Subscriber, Topic,
    event_notifier, goal_service, goal_status_service, guest_publisher, guest_subscriber,
    observer_subscriber, plan_asked_event,
};
use shared_types::message;
use shared_types::valid::{Goal, GoalStatus, StandingGoal};

use crate::ClientError;
use crate::view::{checked, newest, receive};
use crate::waiting::{Cleaner, TimeLimit, wait};

const DAEMON: &str = "planner-daemon";
/// Time between two looks for a status.
const LOOK_INTERVAL: Duration = Duration::from_micros(500);

/// Gives the daemon a goal, moves it, and hears what becomes of it.
///
/// The daemon keeps the robot on its way to the goal that was given last, by whomever, until that is withdrawn, or ended by a stop, a reset,
/// a fault, or a plan that a client executes. Dropping this value neither moves nor ends the goal.
#[derive(Debug)]
pub struct GoalSender {
    goals: Publisher<message::StandingGoal>,
    statuses: Subscriber<message::GoalStatus>,
    /// Where the daemon alone publishes, as soon as it hears goals.
    daemons: Topic<message::GoalStatus>,
    asked: EventNotifier,
    /// The robot that this program is set up for, if it says.
    robot_hash: Option<u64>,
    /// What was sent last.
    sent: Option<StandingGoal>,
    /// The newest status of the goal that was given last.
    latest: Option<GoalStatus>,
    /// The daemon to which a goal was sent last, where it can be told.
    daemon: Option<RoleHolder>,
    cleaner: Cleaner,
    node: IpcNode,
}

impl GoalSender {
    /// Joins the services; the daemon need not run yet.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-goal")?;
        let daemons = goal_status_service(&node)?;
        Ok(Self {
            goals: guest_publisher(&node, &goal_service(&node)?)?,
            statuses: guest_subscriber(&node, &daemons)?,
            daemons,
            asked: event_notifier(&node, &plan_asked_event(&node)?)?,
            robot_hash: None,
            sent: None,
            latest: None,
            daemon: None,
            cleaner: Cleaner::new(options, Role::PlannerDaemon),
            node,
        })
    }

    /// States, in every goal given from now on, which robot this program is set up for: the hash of its robot file, as in
    /// [`message::RobotDescription::robot_hash`]. A daemon that plans for another robot refuses it (state refused).
    pub fn state_robot(&mut self, robot_hash: u64) {
        self.robot_hash = Some(robot_hash);
    }

    /// Waits until a daemon hears goals.
    ///
    /// # Errors
    /// [`ClientError::NoServer`] where none does in time.
    pub fn wait_for_daemon<'program>(
        &mut self,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<(), ClientError> {
        let daemons = &self.daemons;
        let is_heard = || Ok::<_, ClientError>((daemons.number_of_publishers() > 0).then_some(()));
        let pause = |left: Duration| thread::sleep(LOOK_INTERVAL.min(left));
        let limit = timeout.into();
        let heard = wait(&limit, &mut self.cleaner, &self.node, pause, is_heard)?;
        heard.ok_or(ClientError::NoServer {
            server: DAEMON,
            waited: limit.duration(),
        })
    }

    /// Gives another goal, to be reached with a share of the tendon limits (1e-9 to 1); it takes the place of every earlier one.
    ///
    /// # Errors
    /// [`ClientError::NoServer`] where no daemon hears it, [`ClientError::InvalidRequest`] or [`ClientError::Transport`].
    pub fn give(&mut self, goal: Goal, limits_scale: f64) -> Result<(), ClientError> {
        let now = mono_now_ns();
        self.latest = None;
        self.send(StandingGoal {
            given_mono_ns: now,
            stamp_mono_ns: now,
            goal,
            tip_velocity_m_s: [0.0; 3],
            limits_scale,
            robot_hash: self.robot_hash,
            is_withdrawn: false,
        })
    }

    /// Says where the goal that was given last is now, and with which velocity it moves where it is a tip (base frame, m/s; believed for
    /// half a second): the tip then lags less behind it. Gives it at the whole limits where there was none, or it was withdrawn.
    ///
    /// # Errors
    /// As [`GoalSender::give`].
    pub fn move_to(&mut self, goal: Goal, tip_velocity_m_s: [f64; 3]) -> Result<(), ClientError> {
        if self.sent.is_none_or(|sent| sent.is_withdrawn) {
            self.give(goal, 1.0)?;
        }
        self.sent.map_or(Ok(()), |sent| {
            self.send(StandingGoal {
                stamp_mono_ns: mono_now_ns(),
                goal,
                tip_velocity_m_s,
                ..sent
            })
        })
    }

    /// Gives the goal up: the robot brakes along its path. Nothing to do where none was given.
    ///
    /// # Errors
    /// As [`GoalSender::give`].
    pub fn withdraw(&mut self) -> Result<(), ClientError> {
        let Some(sent) = self.sent else {
            return Ok(());
        };
        self.send(StandingGoal {
            stamp_mono_ns: mono_now_ns(),
            is_withdrawn: true,
            ..sent
        })
    }

    fn send(&mut self, goal: StandingGoal) -> Result<(), ClientError> {
        let wire = goal.to_wire();
        StandingGoal::try_from(&wire).map_err(ClientError::InvalidRequest)?;
        self.look_for_daemon();
        let mut sent = self.send_wire(wire);
        // A daemon that is found dead may have been the only one that heard it.
        if self.cleaner.clean_if_due(&self.node) {
            self.look_for_daemon();
            sent = self.send_wire(wire);
        }
        sent?;
        self.sent = Some(goal);
        Ok(())
    }

    /// Notes the daemon that is to hear a goal, before it does: the one that is there afterwards may be another.
    fn look_for_daemon(&mut self) {
        if !self.daemon.as_ref().is_some_and(RoleHolder::lives) {
            self.daemon = RoleHolder::find(self.node.options(), Role::PlannerDaemon);
        }
    }

    /// Sends a goal to the daemon that is there.
    fn send_wire(&self, wire: message::StandingGoal) -> Result<(), ClientError> {
        if self.daemons.number_of_publishers() == 0 {
            return Err(ClientError::NoServer {
                server: DAEMON,
                waited: Duration::ZERO,
            });
        }
        self.goals
            .send_copy(wire)
            .map_err(|reason| ClientError::transport("send a goal", reason))?;
        self.asked
            .notify()
            .map_err(|reason| ClientError::transport("tell the daemon of a goal", reason))?;
        Ok(())
    }

    /// The newest status of the goal that was given last; none until the daemon has heard it, and none once that daemon has ended before the goal:
    /// the robot stops then, and the next daemon does not know the goal.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn status(&mut self) -> Result<Option<GoalStatus>, ClientError> {
        take_in(
            &self.statuses,
            self.sent,
            &mut self.latest,
            self.daemon.as_ref(),
        )
    }

    /// Waits until the goal's status is one that is waited for, at most for `timeout`; none where it was not.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn wait_for<'program>(
        &mut self,
        timeout: impl Into<TimeLimit<'program>>,
        mut is_waited_for: impl FnMut(&GoalStatus) -> bool,
    ) -> Result<Option<GoalStatus>, ClientError> {
        let pause = |left: Duration| thread::sleep(LOOK_INTERVAL.min(left));
        let limit = timeout.into();
        let (statuses, sent, latest) = (&self.statuses, self.sent, &mut self.latest);
        let daemon = self.daemon.as_ref();
        wait(&limit, &mut self.cleaner, &self.node, pause, || {
            let status = take_in(statuses, sent, latest, daemon)?;
            Ok(status.filter(|status| is_waited_for(status)))
        })
    }

    /// Whether a status is of the goal as it was sent last, and not of where it was before.
    #[must_use]
    pub fn has_heard_last(&self, status: &GoalStatus) -> bool {
        is_of_last(self.sent, status)
    }

    /// Waits until the daemon has heard what was sent last, at most for `timeout`.
    ///
    /// # Errors
    /// [`ClientError::NoServer`] where no daemon has, [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn confirm(&mut self, timeout: Duration) -> Result<GoalStatus, ClientError> {
        let sent = self.sent;
        let heard = self.wait_for(timeout, |status| is_of_last(sent, status))?;
        heard.ok_or(ClientError::NoServer {
            server: DAEMON,
            waited: timeout,
        })
    }
}

/// Takes in the statuses that have arrived; returns the newest one of the goal that was given last, unless the daemon that kept it has ended.
fn take_in(
    statuses: &Subscriber<message::GoalStatus>,
    sent: Option<StandingGoal>,
    latest: &mut Option<GoalStatus>,
    daemon: Option<&RoleHolder>,
) -> Result<Option<GoalStatus>, ClientError> {
    let given_mono_ns = sent.map_or(0, |sent| sent.given_mono_ns);
    while let Some(sample) = receive(|| statuses.receive())? {
        let status = checked(DAEMON, GoalStatus::try_from(&*sample))?;
        if status.values.given_mono_ns == given_mono_ns {
            *latest = Some(status);
        }
    }
    let is_kept = |it: &GoalStatus| !matches!(it.state, GoalState::Ended | GoalState::Refused);
    if latest.as_ref().is_some_and(is_kept) && daemon.is_some_and(|daemon| !daemon.lives()) {
        *latest = None;
    }
    Ok(*latest)
}

fn is_of_last(sent: Option<StandingGoal>, status: &GoalStatus) -> bool {
    status.values.goal_stamp_mono_ns >= sent.map_or(0, |sent| sent.stamp_mono_ns)
}

/// What becomes of the goal that stays, for a program that only watches.
#[derive(Debug)]
pub struct GoalView {
    statuses: Subscriber<message::GoalStatus>,
    latest: Option<GoalStatus>,
    _node: IpcNode,
}

impl GoalView {
    /// Joins the service; the daemon need not run yet. It leaves places free for programs that act.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn watch(options: &IpcOptions) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-goal-view")?;
        Ok(Self {
            statuses: observer_subscriber(&node, &goal_status_service(&node)?)?,
            latest: None,
            _node: node,
        })
    }

    /// The newest status received, however old: look at its stamp. None where the daemon has told nothing of a goal since this value was
    /// made; it tells at each change, and every 100 ms while there is a goal.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn latest(&mut self) -> Result<Option<GoalStatus>, ClientError> {
        if let Some(wire) = newest(&self.statuses)? {
            self.latest = Some(checked(DAEMON, GoalStatus::try_from(&wire))?);
        }
        Ok(self.latest)
    }
}
