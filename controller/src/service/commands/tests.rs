//! Commands between a sender and a loop that is held up for a while.

use std::{cell::RefCell, rc::Rc};

use super::*;
use crate::service::link::{LoopEnd, link};
use shared_types::codes::LoopState;
use shared_types::valid::Signature;

const MS: i64 = 1_000_000;

type Replies = Rc<RefCell<Vec<message::CommandReply>>>;

struct Asker {
    replies: Replies,
    awaited: bool,
}

impl Request for Asker {
    fn is_awaited(&self) -> bool {
        self.awaited
    }

    fn reply(&self, reply: message::CommandReply) {
        self.replies.borrow_mut().push(reply);
    }
}

/// The guard's commands, a loop that runs only when it is told to, and everything that was replied.
struct Bench {
    commands: Commands<Asker>,
    at_loop: LoopEnd,
    carried_out: Vec<Order>,
    stops_seen: u64,
    replies: Replies,
}

impl Bench {
    fn new() -> Self {
        let (at_loop, guard, _relay) = link();
        at_loop.shared.set_loop_state(LoopState::Executing);
        Self {
            commands: Commands::new(guard),
            at_loop,
            carried_out: Vec::new(),
            stops_seen: 0,
            replies: Replies::default(),
        }
    }

    fn ask(&mut self, command: Command, id: u64, now_ns: i64) {
        self.ask_and(true, command, id, now_ns);
    }

    /// Asks, and waits for the reply or not.
    fn ask_and(&mut self, awaited: bool, command: Command, id: u64, now_ns: i64) {
        let asker = Asker {
            replies: Rc::clone(&self.replies),
            awaited,
        };
        let wire = SignedCommand::from(command).to_wire(id);
        self.commands.take(asker, &wire, now_ns);
    }

    /// A cycle of the loop: it takes what is on offer, in the order of the hard loop.
    fn cycle(&mut self) {
        let outcome = |state| Outcome {
            result: Ok(()),
            state,
        };
        while let Ok(NumberedOrder { id, order }) = self.at_loop.orders.pop() {
            if self.at_loop.shared.offer.take(id) {
                self.carried_out.push(order);
                let outcome = outcome(LoopState::Executing);
                let answer = Answer::Order { id, outcome };
                assert!(self.at_loop.answers.push(answer).is_ok());
            }
        }
        let up_to = self.at_loop.shared.stops();
        if up_to > self.stops_seen {
            self.stops_seen = up_to;
            let outcome = outcome(LoopState::Stopping);
            let answer = Answer::Stops { up_to, outcome };
            assert!(self.at_loop.answers.push(answer).is_ok());
        }
    }

    /// Command id, accepted, reason of every reply so far.
    fn replies(&self) -> Vec<(u64, bool, u32)> {
        let replies = self.replies.borrow();
        let row =
            |reply: &message::CommandReply| (reply.command_id, reply.accepted == 1, reply.refusal);
        replies.iter().map(row).collect()
    }
}

const NONE: u32 = CommandRefusal::None.code();
const BUSY: u32 = CommandRefusal::LoopBusy.code();
const PENDING: u32 = CommandRefusal::StopPending.code();

#[test]
fn every_reply_is_its_own_commands_whatever_the_loop_takes_first() {
    let mut bench = Bench::new();
    bench.ask(Command::SetSpeed(0.5), 7, 0);
    bench.ask(Command::Stop, 8, 0);
    bench.ask(Command::ResetFault, 9, 0);
    for round in 1..4 {
        bench.commands.attend(round * MS);
        bench.cycle();
    }
    bench.commands.attend(5 * MS);
    let mut replies = bench.replies();
    replies.sort_unstable();
    assert_eq!(replies, [(7, true, NONE), (8, true, NONE), (9, true, NONE)]);
    assert_eq!(bench.carried_out.len(), 2);
    assert_eq!(bench.carried_out[0], Order::Speed(0.5));
    assert!(matches!(bench.carried_out[1], Order::Reset(_)));
}

#[test]
fn what_is_answered_busy_is_never_carried_out_and_a_stop_always_is() {
    let mut bench = Bench::new();
    bench.ask(Command::SetSpeed(0.1), 1, 0);
    bench.ask(Command::SetSpeed(0.2), 2, 0);
    bench.ask(Command::Stop, 3, 0);
    bench.commands.attend(0);
    bench.commands.attend(COMMAND_TIMEOUT_NS);
    assert_eq!(bench.replies(), [], "nothing is late yet");
    bench.commands.attend(COMMAND_TIMEOUT_NS + 1);
    let mut replies = bench.replies();
    replies.sort_unstable();
    assert_eq!(
        replies,
        [(1, false, BUSY), (2, false, BUSY), (3, false, PENDING)]
    );
    // The loop runs again; the command that comes now gets its own answer.
    bench.ask(Command::SetSpeed(0.3), 4, COMMAND_TIMEOUT_NS + MS);
    bench.commands.attend(COMMAND_TIMEOUT_NS + MS);
    bench.cycle();
    bench.commands.attend(COMMAND_TIMEOUT_NS + 2 * MS);
    assert_eq!(bench.carried_out, [Order::Speed(0.3)]);
    assert_eq!(bench.stops_seen, 1);
    assert_eq!(bench.replies()[3..], [(4, true, NONE)]);
}

#[test]
fn what_was_requested_before_the_start_a_stop_or_a_reset_is_not_wanted() {
    let started_ns = mono_now_ns();
    let mut bench = Bench::new();
    let wanted_from_ns = |bench: &Bench| bench.at_loop.shared.guard_state().wanted_from_ns;
    assert!((started_ns..=mono_now_ns()).contains(&wanted_from_ns(&bench)));
    for (id, command) in [(1, Command::Stop), (2, Command::ResetFault)] {
        let ordered_ns = mono_now_ns();
        bench.ask(command, id, 0);
        assert!((ordered_ns..=mono_now_ns()).contains(&wanted_from_ns(&bench)));
    }
    let reset_ns = wanted_from_ns(&bench);
    bench.ask(Command::SetSpeed(0.5), 3, 0);
    assert_eq!(wanted_from_ns(&bench), reset_ns);
}

#[test]
fn an_order_that_the_loop_has_taken_is_answered_however_late() {
    let mut bench = Bench::new();
    bench.ask(Command::ResetFault, 1, 0);
    bench.commands.attend(0);
    bench.cycle();
    bench.commands.attend(10 * COMMAND_TIMEOUT_NS);
    assert_eq!(bench.replies(), [(1, true, NONE)]);
}

#[test]
fn a_loop_that_is_held_for_long_fills_no_ring_for_good() {
    let mut bench = Bench::new();
    for id in 1..100 {
        let now_ns = i64::try_from(id).unwrap() * 2 * COMMAND_TIMEOUT_NS;
        bench.ask(Command::SetSpeed(0.5), id, now_ns);
        bench.commands.attend(now_ns);
        bench.commands.attend(now_ns + COMMAND_TIMEOUT_NS + 1);
    }
    assert!(bench.replies().iter().all(|reply| reply.2 == BUSY));
    bench.cycle();
    assert_eq!(bench.carried_out, []);
    bench.ask(Command::SetSpeed(0.7), 100, 0);
    bench.commands.attend(0);
    bench.cycle();
    assert_eq!(bench.carried_out, [Order::Speed(0.7)]);
}

#[test]
fn a_command_of_another_version_is_refused_at_once_by_its_own_number() {
    let mut bench = Bench::new();
    let asker = Asker {
        replies: Rc::clone(&bench.replies),
        awaited: true,
    };
    let wire = message::Command {
        protocol_version: 0,
        ..SignedCommand::from(Command::Stop).to_wire(5)
    };
    bench.commands.take(asker, &wire, 0);
    assert_eq!(
        bench.replies(),
        [(5, false, CommandRefusal::WrongVersion.code())]
    );
    assert_eq!(bench.at_loop.shared.stops(), 0);
}

#[test]
fn a_stop_counts_when_nobody_waits_for_its_reply_and_another_order_does_not() {
    let mut bench = Bench::new();
    bench.ask_and(false, Command::SetSpeed(0.1), 1, 0);
    bench.ask_and(false, Command::ResetFault, 2, 0);
    bench.ask_and(false, Command::Stop, 3, 0);
    bench.commands.attend(0);
    bench.cycle();
    assert_eq!(bench.carried_out, []);
    assert_eq!(bench.stops_seen, 1);
}

#[test]
fn goals_outlive_the_stops_that_the_daemon_orders_and_no_others() {
    let mut bench = Bench::new();
    let from_ns = |bench: &Bench| {
        let shared = &bench.at_loop.shared;
        [shared.guard_state().wanted_from_ns, shared.goals_from_ns()]
    };
    let [wanted_ns, started_ns] = from_ns(&bench);
    assert_eq!(wanted_ns, started_ns);
    for sender in [CommandSender::Supervision, CommandSender::GoalKeeper] {
        let before_ns = from_ns(&bench);
        let signature = Signature {
            sender,
            ..SignedCommand::from(Command::Stop).signature
        };
        bench.commands.stop(StopOrigin::Command(signature));
        let [wanted_ns, goals_ns] = from_ns(&bench);
        assert!(wanted_ns > before_ns[0]);
        assert_eq!(goals_ns, started_ns);
    }
    let ended_ns = started_ns;
    let program = SignedCommand::from(Command::Stop).signature;
    for origin in [
        StopOrigin::Command(program),
        StopOrigin::Signal,
        StopOrigin::OtherDaemon,
        StopOrigin::Suspension,
    ] {
        bench.commands.stop(origin);
        let [wanted_ns, goals_ns] = from_ns(&bench);
        assert_eq!(wanted_ns, goals_ns);
        assert!(goals_ns > ended_ns, "{origin:?}");
    }
    let stopped_ns = from_ns(&bench)[1];
    bench.ask(Command::ResetFault, 1, 0);
    assert!(from_ns(&bench)[1] > stopped_ns);
}
