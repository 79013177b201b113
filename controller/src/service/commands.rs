//! Commands on their way from their senders to the loop, and the replies to them.
//!
//! A stop is a number that only rises: the loop obeys it whenever it runs again, and the reply says what is true when it is
//! sent. An order to reset or to change the speed is offered to the loop; one that it does not take in time is withdrawn
//! before it is answered "loop busy".

use std::{collections::VecDeque, sync::atomic::Ordering};

use shared_types::{
    PROTOCOL_VERSION,
    clock::mono_now_ns,
    codes::{CommandRefusal, CommandSender},
    ipc::CommandRequest,
    message::{self, ReasonText},
    valid::{Command, SignedCommand},
};

use super::explain;
use super::link::{Answer, GuardEnd, GuardEvent, NumberedOrder, NumberedOrigin, Order, Outcome};
use crate::executive::StopOrigin;

/// Longest wait for the loop to take a command, ns.
const COMMAND_TIMEOUT_NS: i64 = 50_000_000;

/// A command without a reply yet.
struct PendingCommand<R> {
    request: R,
    command_id: u64,
    signed: SignedCommand,
    received_ns: i64,
}

/// A request that a reply goes to: one in shared memory, or a test's.
pub(super) trait Request {
    /// Whether the request's sender still waits for the reply.
    fn is_awaited(&self) -> bool;
    /// Sends the reply, if the request's sender still waits for it.
    fn reply(&self, reply: message::CommandReply);
}

impl Request for CommandRequest {
    fn is_awaited(&self) -> bool {
        self.is_connected()
    }

    fn reply(&self, reply: message::CommandReply) {
        // The sender is gone, or runs into its own timeout.
        let _ = self.send_copy(reply);
    }
}

/// The commands under way between their senders and the loop.
pub(super) struct Commands<R> {
    pub(super) link: GuardEnd,
    /// Stops with their numbers, in order.
    stops: VecDeque<(u64, PendingCommand<R>)>,
    /// Orders to reset and to change the speed, in order.
    orders: VecDeque<(Order, PendingCommand<R>)>,
    /// The number under which the first order was offered to the loop; none where it was not yet.
    offered: Option<u64>,
    last_id: u64,
}

impl<R: Request> Commands<R> {
    pub(super) fn new(link: GuardEnd) -> Self {
        Self {
            link,
            stops: VecDeque::new(),
            orders: VecDeque::new(),
            offered: None,
            last_id: 0,
        }
    }

    /// Orders a stop whose outcome nobody waits for; returns its number.
    pub(super) fn stop(&mut self, origin: StopOrigin) -> u64 {
        let number = self.link.shared.stops() + 1;
        // Before the stop: the loop must find it. Where the ring is full the loop has not obeyed the first of so many stops yet.
        let _ = self
            .link
            .stop_origins
            .push(NumberedOrigin { number, origin });
        // The clock is read now, so that the stop is later than its cause.
        self.link
            .shared
            .order_stop(mono_now_ns(), is_of_daemon(&origin))
    }

    /// Orders what a command asks for, or replies to one that is invalid.
    pub(super) fn take(&mut self, request: R, wire: &message::Command, now_ns: i64) {
        let command_id = wire.command_id;
        let signed = match SignedCommand::try_from(wire) {
            Ok(signed) => signed,
            Err(invalid) => {
                let refusal = match invalid.field {
                    "protocol_version" => CommandRefusal::WrongVersion,
                    "speed" => CommandRefusal::InvalidSpeed,
                    _ => CommandRefusal::UnknownKind,
                };
                let outcome = self.not_taken(refusal);
                return request.reply(reply(command_id, outcome, &invalid.to_string()));
            }
        };
        let pending = PendingCommand {
            request,
            command_id,
            signed,
            received_ns: now_ns,
        };
        let SignedCommand { command, signature } = signed;
        match command {
            // The sender has given up or has ended.
            Command::ResetFault | Command::SetSpeed(_) | Command::Pause | Command::Resume
                if !pending.request.is_awaited() => {}
            Command::Stop => {
                let number = self.stop(StopOrigin::Command(signature));
                self.stops.push_back((number, pending));
            }
            Command::ResetFault => {
                // A reset is for the robot as it is now: trajectories that were requested before the fault must not begin.
                self.link.shared.forget_requests(mono_now_ns());
                self.orders.push_back((Order::Reset(signature), pending));
            }
            Command::SetSpeed(speed) => self.orders.push_back((Order::Speed(speed), pending)),
            Command::Pause => self.orders.push_back((Order::Pause, pending)),
            Command::Resume => self.orders.push_back((Order::Resume, pending)),
        }
    }

    /// Replies to commands that the loop has carried out or does not take in time, and offers it the next order.
    pub(super) fn attend(&mut self, now_ns: i64) {
        while let Ok(answer) = self.link.answers.pop() {
            match answer {
                Answer::Stops { up_to, outcome } => {
                    self.answer_stops(outcome, |number, _| number <= up_to);
                }
                Answer::Order { id, outcome } if self.offered == Some(id) => {
                    self.offered = None;
                    self.answer_first_order(outcome);
                }
                // Every order that is taken is the one offered.
                Answer::Order { .. } => {}
            }
        }
        self.give_up_late(now_ns);
        self.offer_next();
    }

    /// Replies to the first stops for which `wanted` is true.
    fn answer_stops(&mut self, outcome: Outcome, wanted: impl Fn(u64, &PendingCommand<R>) -> bool) {
        let is_wanted = |(number, pending): &(u64, PendingCommand<R>)| wanted(*number, pending);
        while self.stops.front().is_some_and(is_wanted) {
            if let Some((_, pending)) = self.stops.pop_front() {
                self.answer(&pending, outcome);
            }
        }
    }

    fn answer_first_order(&mut self, outcome: Outcome) {
        if let Some((_, pending)) = self.orders.pop_front() {
            self.answer(&pending, outcome);
        }
    }

    fn give_up_late(&mut self, now_ns: i64) {
        let late = |pending: &PendingCommand<R>| now_ns - pending.received_ns > COMMAND_TIMEOUT_NS;
        self.answer_stops(self.not_taken(CommandRefusal::StopPending), |_, pending| {
            late(pending)
        });
        while self
            .orders
            .front()
            .is_some_and(|(_, pending)| late(pending))
        {
            if let Some(id) = self.offered {
                if !self.link.shared.offer.take(id) {
                    // The loop has it, and answers.
                    return;
                }
                self.offered = None;
            }
            self.answer_first_order(self.not_taken(CommandRefusal::LoopBusy));
        }
    }

    fn offer_next(&mut self) {
        let Some((order, _)) = self.orders.front().filter(|_| self.offered.is_none()) else {
            return;
        };
        let (id, order) = (self.last_id + 1, *order);
        // Before it is in the ring: the loop must find it on offer. Where the ring is full of withdrawn orders the loop takes none.
        self.link.shared.offer.make(id);
        if self.link.orders.push(NumberedOrder { id, order }).is_ok() {
            (self.last_id, self.offered) = (id, Some(id));
        } else {
            self.link.shared.offer.take(id);
        }
    }

    fn not_taken(&self, reason: CommandRefusal) -> Outcome {
        Outcome {
            result: Err(reason),
            state: self.link.shared.loop_state(),
        }
    }

    fn answer(&mut self, pending: &PendingCommand<R>, outcome: Outcome) {
        let reason = explain::outcome(pending.signed.command, &outcome);
        let reply = reply(pending.command_id, outcome, &reason);
        pending.request.reply(reply);
        self.report_event(GuardEvent::Commanded(pending.signed, outcome));
    }

    pub(super) fn report_event(&mut self, event: GuardEvent) {
        if self.link.events.push(event).is_err() {
            self.link.shared.events_lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Whether the daemon itself stops a motion, which it may bring on its way again by itself.
fn is_of_daemon(origin: &StopOrigin) -> bool {
    matches!(origin, StopOrigin::Command(signature) if signature.sender != CommandSender::Program)
}

fn reply(command_id: u64, outcome: Outcome, reason: &str) -> message::CommandReply {
    message::CommandReply {
        command_id,
        protocol_version: PROTOCOL_VERSION,
        accepted: u32::from(outcome.result.is_ok()),
        refusal: outcome.result.err().unwrap_or(CommandRefusal::None).code(),
        state: outcome.state.code(),
        reason: ReasonText::new(reason),
    }
}

#[cfg(test)]
mod tests;
