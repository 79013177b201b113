//! What passes between the loop thread and the relay thread: bounded rings, nothing shared but two flags.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU64},
};

use rtrb::{Consumer, Producer, RingBuffer};
use shared_types::codes::CommandRefusal;

use crate::{
    arena::MemoryCounts,
    executive::{CycleOutput, Motion, Unacceptable},
};

/// Cycles that fit while the relay thread is kept from running: a second at 4 kHz.
const REPORTS: usize = 4096;

/// Orders and answers that fit; the relay sends one command at a time.
const ORDERS: usize = 16;

/// What the relay thread asks of the loop.
pub(super) enum Order {
    Stop,
    Reset,
    Speed(f64),
    Execute(Motion),
}

/// What the loop answers, in the order of the orders, and the trajectories that it is done with.
pub(super) enum Answer {
    Command(Result<(), CommandRefusal>),
    Refused(Unacceptable, Motion),
    Finished(Motion),
}

/// One cycle, for everyone outside.
pub(super) struct Report {
    pub(super) sequence: u64,
    pub(super) output: CycleOutput,
    /// How long after its deadline the cycle began, ns.
    pub(super) lateness_ns: u64,
    pub(super) setpoints_sent: u64,
    pub(super) memory: MemoryCounts,
}

/// Flags and counters that both threads see.
pub(super) struct Shared {
    /// The daemon's heart beats (written by the relay).
    pub(super) daemon_alive: AtomicBool,
    /// The loop is to end (written by the relay).
    pub(super) quit: AtomicBool,
    /// Reports that found no room (written by the loop).
    pub(super) reports_lost: AtomicU64,
}

/// The loop's ends.
pub(super) struct LoopEnd {
    pub(super) orders: Consumer<Order>,
    pub(super) answers: Producer<Answer>,
    pub(super) reports: Producer<Report>,
    pub(super) shared: Arc<Shared>,
}

/// The relay's ends.
pub(super) struct RelayEnd {
    pub(super) orders: Producer<Order>,
    pub(super) answers: Consumer<Answer>,
    pub(super) reports: Consumer<Report>,
    pub(super) shared: Arc<Shared>,
}

/// Both ends of a new link.
pub(super) fn link() -> (LoopEnd, RelayEnd) {
    let (send_order, orders) = RingBuffer::new(ORDERS);
    let (answers, take_answer) = RingBuffer::new(ORDERS);
    let (reports, take_report) = RingBuffer::new(REPORTS);
    let shared = Arc::new(Shared {
        daemon_alive: AtomicBool::new(false),
        quit: AtomicBool::new(false),
        reports_lost: AtomicU64::new(0),
    });
    let for_loop = LoopEnd {
        orders,
        answers,
        reports,
        shared: Arc::clone(&shared),
    };
    let for_relay = RelayEnd {
        orders: send_order,
        answers: take_answer,
        reports: take_report,
        shared,
    };
    (for_loop, for_relay)
}
