//! Asking the daemon for plans.

use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::port::LoanError;
use iceoryx2::port::client::RequestSendError;
use iceoryx2::prelude::PortFactory;
use shared_types::codes::Outcome;
use shared_types::ipc::{
    EventListener, EventNotifier, IpcError, IpcNode, IpcOptions, PlanClient, PlanPending,
    PlanService, Role, event_listener, event_notifier, open_plan_service, plan_answered_event,
    plan_asked_event, plan_client,
};
use shared_types::message;
use shared_types::valid::{Invalid, PlanRequest, PlannedExecution};

use crate::waiting::{CLEANUP_TIMEOUT, Cleaner, POLL_INTERVAL, TimeLimit, wait};
use crate::{ClientError, PlanAnswer};

const DAEMON: &str = "planner-daemon";
/// Longest time between two polls for an answer: its event may have been lost.
const MAX_POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Time between two polls for a daemon.
const DAEMON_POLL_INTERVAL: Duration = Duration::from_millis(5);

/// A connection to the planner daemon that outlives the daemon's restarts.
#[derive(Debug)]
pub struct Client {
    port: Option<PlanPort>,
    asked: EventNotifier,
    answered: EventListener,
    cleaner: Cleaner,
    last_request_id: u64,
    /// The robot that this program is set up for; 0: it does not say.
    robot_hash: u64,
    node: IpcNode,
}

/// Dropped in this order: the port before its service.
#[derive(Debug)]
struct PlanPort {
    client: PlanClient,
    service: PlanService,
}

/// A request in its wire form.
struct Outgoing {
    wire: message::PlanRequest,
    /// Whether a motion may be executed by it.
    execute: bool,
    deadline: Option<Duration>,
}

impl TryFrom<&PlanRequest> for Outgoing {
    type Error = Invalid;

    fn try_from(request: &PlanRequest) -> Result<Self, Invalid> {
        Ok(Self {
            wire: request.try_into()?,
            execute: request.execute,
            deadline: request.deadline,
        })
    }
}

/// A request without its whole answer yet; dropping it cancels it.
#[derive(Debug)]
pub struct Pending {
    response: PlanPending,
    id: u64,
    execute: bool,
    /// When its answer must be there, as the request says.
    due: Option<Instant>,
}

impl Pending {
    /// The number under which it was sent.
    #[must_use]
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Looks for the answer; see [`Client::poll`].
    fn receive(&mut self) -> Result<Option<PlanAnswer>, ClientError> {
        // Asked before the answer is: a daemon that answers and lets go in between has not gone away.
        let connected = self.response.is_connected();
        let received = self
            .response
            .receive()
            .map_err(|reason| ClientError::transport("receive an answer", reason))?;
        match received {
            Some(response) => {
                let bad = |invalid| ClientError::BadMessage {
                    sender: DAEMON,
                    invalid,
                };
                PlanAnswer::new(response).map(Some).map_err(bad)
            }
            None if connected => Ok(None),
            None => Err(ClientError::ServerLost {
                server: DAEMON,
                id: self.id,
                may_have_acted: self.execute,
            }),
        }
    }
}

impl Client {
    /// Joins the services; the daemon need not run yet.
    ///
    /// # Errors
    /// [`ClientError::Ipc`]: the options are not usable, or so many processes have joined that no place is left.
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-client")?;
        let asked = event_notifier(&node, &plan_asked_event(&node)?)?;
        let answered = event_listener(&node, &plan_answered_event(&node)?)?;
        Ok(Self {
            port: None,
            asked,
            answered,
            cleaner: Cleaner::new(options, Role::PlannerDaemon),
            last_request_id: 0,
            robot_hash: 0,
            node,
        })
    }

    /// States, in every request from now on that does not say itself, which robot this program is set up for: the hash of its robot file, as in
    /// [`message::RobotDescription::robot_hash`]. A daemon that plans for another robot refuses it (outcome wrong robot). 0: it does not say.
    pub fn state_robot(&mut self, robot_hash: u64) {
        self.robot_hash = robot_hash;
    }

    /// Waits until a daemon serves.
    ///
    /// # Errors
    /// [`ClientError::NoServer`] if none does in time, [`ClientError::Ipc`] if its service cannot be joined.
    pub fn wait_for_daemon<'program>(
        &mut self,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<(), ClientError> {
        self.wait_for_port(&timeout.into()).map(drop)
    }

    /// Plans: sends the request and waits for the answer, `timeout` in all.
    ///
    /// `request.request_id` 0 is replaced by a number of the client's own. If the daemon dies meanwhile, the request is
    /// sent once more to its successor, unless it is one to execute, which might then be executed twice.
    ///
    /// # Errors
    /// Any [`ClientError`]; an answer with another outcome than ok is no error.
    pub fn plan<'program>(
        &mut self,
        request: &PlanRequest,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<PlanAnswer, ClientError> {
        let limit = timeout.into();
        let first = self.plan_once(request, &limit);
        match first {
            Err(ClientError::ServerLost {
                may_have_acted: false,
                ..
            }) => self.plan_once(request, &limit),
            result => result,
        }
    }

    /// Has a candidate of an earlier plan executed, exactly as it was answered, and waits for the answer, `timeout` in all.
    ///
    /// The answer's only candidate is what is executed; it tells the trajectory's id, or why nothing is (outcome execution refused: as for
    /// every execution, and where the robot has gone on since the plan was made; outcome invalid request: the daemon does not have the plan
    /// or the candidate). It is never sent twice.
    ///
    /// # Errors
    /// As [`Client::plan`].
    pub fn execute_planned<'program>(
        &mut self,
        execution: &PlannedExecution,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<PlanAnswer, ClientError> {
        let limit = timeout.into();
        let outgoing = Outgoing {
            wire: execution.try_into().map_err(ClientError::InvalidRequest)?,
            execute: true,
            deadline: None,
        };
        let pending = self.send_within(&outgoing, &limit)?;
        self.wait_within(pending, &limit)
    }

    /// Sends the request to the daemon that serves now and returns at once.
    ///
    /// # Errors
    /// [`ClientError::InvalidRequest`], [`ClientError::NoServer`] if none serves,
    /// [`ClientError::TooManyRequests`], or [`ClientError::Ipc`] and [`ClientError::Transport`].
    pub fn submit(&mut self, request: &PlanRequest) -> Result<Pending, ClientError> {
        self.submit_within(request, &TimeLimit::new(Duration::ZERO))
    }

    /// Looks for the next answer to a request (see [`Client::next`]), without waiting (but for the clean-up, when its daemon has died).
    ///
    /// # Errors
    /// [`ClientError::ServerLost`] if there will be no answer, [`ClientError::BadMessage`], [`ClientError::Transport`].
    pub fn poll(&mut self, pending: &mut Pending) -> Result<Option<PlanAnswer>, ClientError> {
        let received = pending.receive();
        if let Ok(None) = received {
            self.cleaner.clean_if_due(&self.node);
        }
        self.cleanup_dead_nodes(&received);
        received
    }

    /// Waits for the next answer to a request: the early one, if that was asked for and comes, then the whole one.
    ///
    /// # Errors
    /// As [`Client::poll`], and [`ClientError::TimedOut`]; the request goes on.
    pub fn next<'program>(
        &mut self,
        pending: &mut Pending,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<PlanAnswer, ClientError> {
        self.next_within(pending, &timeout.into())
    }

    /// Waits for the whole answer to a request, passing over an early one; without it in time the request is cancelled.
    ///
    /// # Errors
    /// As [`Client::poll`], and [`ClientError::TimedOut`].
    pub fn wait<'program>(
        &mut self,
        pending: Pending,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<PlanAnswer, ClientError> {
        self.wait_within(pending, &timeout.into())
    }

    fn plan_once(
        &mut self,
        request: &PlanRequest,
        limit: &TimeLimit<'_>,
    ) -> Result<PlanAnswer, ClientError> {
        let pending = self.submit_within(request, limit)?;
        self.wait_within(pending, limit)
    }

    fn wait_within(
        &mut self,
        mut pending: Pending,
        limit: &TimeLimit<'_>,
    ) -> Result<PlanAnswer, ClientError> {
        loop {
            let answer = self.next_within(&mut pending, limit)?;
            if answer.report().outcome != Outcome::Early {
                return Ok(answer);
            }
        }
    }

    fn next_within(
        &mut self,
        pending: &mut Pending,
        limit: &TimeLimit<'_>,
    ) -> Result<PlanAnswer, ClientError> {
        let (answered, cleaner) = (&self.answered, &mut self.cleaner);
        let due = pending.due;
        let rest = |left: Duration| {
            let pause = left.min(poll_interval(due, Instant::now()));
            if answered.wait(None, pause).is_err() {
                thread::sleep(pause.min(POLL_INTERVAL));
            }
        };
        let received = wait(limit, cleaner, &self.node, rest, || pending.receive());
        self.cleanup_dead_nodes(&received);
        let received = received?;
        if received.is_none() {
            self.cleaner.make_due();
        }
        received.ok_or(ClientError::TimedOut {
            server: DAEMON,
            id: pending.id,
            waited: limit.duration(),
            may_have_acted: pending.execute,
        })
    }

    /// After the loss of a server, waits until its node is cleaned up, so that the next request cannot go to the same dead server.
    fn cleanup_dead_nodes<T>(&self, received: &Result<T, ClientError>) {
        if matches!(received, Err(ClientError::ServerLost { .. })) {
            self.node.finish_cleaning(CLEANUP_TIMEOUT);
        }
    }

    fn submit_within(
        &mut self,
        request: &PlanRequest,
        limit: &TimeLimit<'_>,
    ) -> Result<Pending, ClientError> {
        let outgoing = Outgoing::try_from(request).map_err(ClientError::InvalidRequest)?;
        self.send_within(&outgoing, limit)
    }

    fn send_within(
        &mut self,
        outgoing: &Outgoing,
        limit: &TimeLimit<'_>,
    ) -> Result<Pending, ClientError> {
        let Outgoing {
            mut wire,
            execute,
            deadline,
        } = *outgoing;
        if wire.request_id == 0 {
            self.last_request_id += 1;
            wire.request_id = self.last_request_id;
        }
        if wire.robot_hash == 0 {
            wire.robot_hash = self.robot_hash;
        }
        loop {
            // Such a request is not sent twice: its server should live.
            if execute {
                self.cleaner.clean_if_due(&self.node);
            }
            let sent = Instant::now();
            let response = self.wait_for_port(limit)?.send(&wire)?;
            if response.number_of_server_connections() > 0 {
                // A daemon that is not told looks within a millisecond.
                let _ = self.asked.notify();
                // Whether who has it still lives is asked when the answer is long in coming: cleaning takes as long as a plan.
                self.cleaner.begin_period();
                return Ok(Pending {
                    response,
                    id: wire.request_id,
                    execute,
                    due: deadline.map(|deadline| sent + deadline),
                });
            }
            // The daemon left between the look and the sending: nobody has the request.
            if limit.is_over() {
                return Err(no_daemon(limit));
            }
            thread::sleep(DAEMON_POLL_INTERVAL);
        }
    }

    /// A port on a service with a living server.
    fn wait_for_port(&mut self, limit: &TimeLimit<'_>) -> Result<&PlanPort, ClientError> {
        loop {
            if self.port.is_none() {
                self.cleaner.clean_if_due(&self.node);
            }
            self.refresh_port()?;
            if self.port.is_some() {
                break;
            }
            if limit.is_over() {
                return Err(no_daemon(limit));
            }
            thread::sleep(DAEMON_POLL_INTERVAL);
        }
        Ok(self.port.as_ref().expect("the loop ends only with a port"))
    }

    /// Opens the service if a daemon serves it, and lets go of it if none does, so that a daemon with another capacity
    /// may make it anew.
    fn refresh_port(&mut self) -> Result<(), ClientError> {
        if self.port.as_ref().is_some_and(PlanPort::is_served) {
            return Ok(());
        }
        self.port = None;
        let service = match open_plan_service(&self.node) {
            Ok(service) => service,
            Err(IpcError::Missing { .. }) => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        if service.dynamic_config().number_of_servers() > 0 {
            self.port = Some(PlanPort {
                client: plan_client(&self.node, &service)?,
                service,
            });
        }
        Ok(())
    }
}

fn no_daemon(limit: &TimeLimit<'_>) -> ClientError {
    ClientError::NoServer {
        server: DAEMON,
        waited: limit.duration(),
    }
}

/// Time until the next poll for an answer: short once the answer is due, since a thread that an event wakes may wait for a processor.
fn poll_interval(due: Option<Instant>, now: Instant) -> Duration {
    let until = due.map(|due| due.saturating_duration_since(now));
    until.map_or(MAX_POLL_INTERVAL, |until| {
        until.clamp(POLL_INTERVAL, MAX_POLL_INTERVAL)
    })
}

impl PlanPort {
    fn is_served(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    fn send(&self, wire: &message::PlanRequest) -> Result<PlanPending, ClientError> {
        let request = self.client.loan_uninit().map_err(|reason| match reason {
            LoanError::ExceedsMaxLoans => ClientError::TooManyRequests,
            reason => ClientError::transport("prepare a request", reason),
        })?;
        request
            .write_payload(*wire)
            .send()
            .map_err(|reason| match reason {
                RequestSendError::ExceedsMaxActiveRequests => ClientError::TooManyRequests,
                reason => ClientError::transport("send a request", reason),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_looked_for_when_it_is_due_and_often_from_then_on() {
        let now = Instant::now();
        let rest = |due: Duration| poll_interval(Some(now + due), now);
        assert_eq!(poll_interval(None, now), MAX_POLL_INTERVAL);
        assert_eq!(rest(10 * MAX_POLL_INTERVAL), MAX_POLL_INTERVAL);
        assert_eq!(rest(MAX_POLL_INTERVAL / 2), MAX_POLL_INTERVAL / 2);
        assert_eq!(rest(Duration::ZERO), POLL_INTERVAL);
        assert_eq!(
            poll_interval(Some(now), now + MAX_POLL_INTERVAL),
            POLL_INTERVAL
        );
    }
}
