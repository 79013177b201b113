//! The link between loop, guard and relay: bounded rings, and a few atomics that all three share. None waits for another: a ring
//! that is full loses reports and events, never orders.
//!
//! ```text
//! guard ── stops (a number that rises), orders ──▶ loop ── reports, trajectories done with ──▶ relay
//!   ▲ ◀──────────────── answers ────────────────── │  ◀───────────── trajectories ─────────────┘
//!   └──────────────────────────────── events, for the log ────────────────────────────────────▶ relay
//! ```

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, Ordering},
};

use rtrb::{Consumer, Producer, RingBuffer};
use shared_types::{
    clock::mono_now_ns,
    codes::{CommandRefusal, LoopState},
    valid::{Signature, SignedCommand},
};

use crate::{
    arena::MemoryCounts,
    executive::{CycleOutput, EndedMotion, GuardState, Motion, StopOrigin, TrajectoryRefusal},
};

/// Cycles that fit while the relay thread is kept from running: a second at 4 kHz.
const REPORTS: usize = 4096;

/// Orders, answers and trajectories that fit. The guard has one order at the loop at a time; withdrawn ones stay in the
/// ring until the loop runs again.
const ORDERS: usize = 16;

/// Origins of stops that fit until the loop obeys them: where more come the first ones are known, and the first one counts.
const STOP_ORIGINS: usize = 64;

/// Events that fit while the relay thread is kept from running.
const EVENTS: usize = 256;

/// An order of the guard to the loop that may be withdrawn. (A stop cannot be withdrawn, and is a number instead.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Order {
    Reset(Signature),
    Speed(f64),
    Pause,
    Resume,
}

/// An order with its number, which is in [`Offer`] for as long as it is to be carried out.
pub(super) struct NumberedOrder {
    pub(super) id: u64,
    pub(super) order: Order,
}

/// What has ordered the stop with this number.
pub(super) struct NumberedOrigin {
    pub(super) number: u64,
    pub(super) origin: StopOrigin,
}

/// The result of an order or of a stop, and the state of the loop after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Outcome {
    pub(super) result: Result<(), CommandRefusal>,
    pub(super) state: LoopState,
}

/// An answer of the loop to the guard.
pub(super) enum Answer {
    /// The answer to the order with this number.
    Order { id: u64, outcome: Outcome },
    /// The answer to all stops up to this number.
    Stops { up_to: u64, outcome: Outcome },
}

/// A trajectory that the loop gives back to the relay.
pub(super) enum Return {
    Refused(TrajectoryRefusal, Motion),
    Ended(EndedMotion),
}

/// The report of one cycle, for the relay.
pub(super) struct Report {
    pub(super) sequence: u64,
    pub(super) output: CycleOutput,
    /// How long after its deadline the cycle began, ns.
    pub(super) lateness_ns: u64,
    pub(super) setpoints_sent: u64,
    pub(super) memory: MemoryCounts,
}

/// An event that the guard reports, for the log.
#[derive(Clone, Copy, Debug)]
pub(super) enum GuardEvent {
    Commanded(SignedCommand, Outcome),
    DaemonLost(LoopState),
    DaemonFound,
    DaemonReplaced,
    Signalled,
    Suspended,
    ShuttingDown(LoopState),
    PriorityRefused(u8),
}

/// The number of the one order that may be carried out; 0: none. Of the loop, which takes it, and the guard, which
/// withdraws it after waiting in vain, exactly one succeeds: an order that is answered "loop busy" is never carried out.
#[derive(Default)]
pub(super) struct Offer(AtomicU64);

impl Offer {
    /// Offers order `id` (not 0) instead of the one before.
    pub(super) fn make(&self, id: u64) {
        self.0.store(id, Ordering::Release);
    }

    /// Takes order `id` (the loop) or takes it back (the guard); false where the other one was first.
    pub(super) fn take(&self, id: u64) -> bool {
        self.0
            .compare_exchange(id, 0, Ordering::AcqRel, Ordering::Acquire)
            .is_ok()
    }
}

/// Atomics shared by loop, guard and relay.
#[derive(Default)]
pub(super) struct Shared {
    /// Whether the daemon's heartbeats arrive (written by the guard).
    pub(super) daemon_alive: AtomicBool,
    /// Instance of the daemon that sent the newest heartbeat; 0: none yet (written by the guard).
    daemon_instance: AtomicU64,
    /// Trajectories that were requested up to this time are refused, ns of CLOCK_MONOTONIC (written by the guard).
    wanted_from_ns: AtomicI64,
    /// Goals that were given up to this time are over, ns of CLOCK_MONOTONIC (written by the guard).
    goals_from_ns: AtomicI64,
    /// Number of the newest stop (written by the guard); the loop carries a stop out when it sees a new number. A number cannot be
    /// lost, delayed by a full ring, or withdrawn.
    stops: AtomicU64,
    /// The order that may be carried out.
    pub(super) offer: Offer,
    /// Rounds of the guard: the loop stops a motion where they do not go on (read by the loop).
    pub(super) guard_rounds: AtomicU64,
    /// [`LoopState`] of the last cycle (written by the loop).
    loop_state: AtomicU32,
    /// Cycles of the loop (written by the loop).
    pub(super) cycles: AtomicU64,
    /// The loop makes no cycle any more, and has given everything back (written by the loop thread).
    pub(super) loop_has_ended: AtomicBool,
    /// The process ends although the robot moves: the loop makes no cycles (written by the guard).
    pub(super) is_abandoned: AtomicBool,
    /// Linux thread id of the loop, 0 before it runs.
    pub(super) loop_thread_id: AtomicU32,
    /// All threads are to end (written by the guard, once the robot is at rest).
    pub(super) quit: AtomicBool,
    /// Reports that found no room (written by the loop).
    pub(super) reports_lost: AtomicU64,
    /// Events that found no room (written by the guard).
    pub(super) events_lost: AtomicU64,
}

impl Shared {
    pub(super) fn set_loop_state(&self, state: LoopState) {
        self.loop_state.store(state.code(), Ordering::Relaxed);
    }

    pub(super) fn loop_state(&self) -> LoopState {
        LoopState::try_from(self.loop_state.load(Ordering::Relaxed)).unwrap_or(LoopState::Starting)
    }

    /// Orders a stop, which ends goals too unless the daemon itself has ordered it; returns its number.
    pub(super) fn order_stop(&self, now_ns: i64, is_of_daemon: bool) -> u64 {
        // Before the number: a thread that sees the stop must refuse trajectories requested before it.
        if is_of_daemon {
            self.wanted_from_ns.store(now_ns, Ordering::Release);
        } else {
            self.forget_requests(now_ns);
        }
        self.stops.fetch_add(1, Ordering::AcqRel) + 1
    }

    /// Has trajectories refused that were requested up to `now_ns`, and goals given up that were given until then.
    pub(super) fn forget_requests(&self, now_ns: i64) {
        // In this order: whoever reads the other one's new value after it must find this one's.
        self.goals_from_ns.store(now_ns, Ordering::Release);
        self.wanted_from_ns.store(now_ns, Ordering::Release);
    }

    /// Goals that were given up to this time are over, ns of CLOCK_MONOTONIC; to be read after [`Self::guard_state`].
    pub(super) fn goals_from_ns(&self) -> i64 {
        self.goals_from_ns.load(Ordering::Acquire)
    }

    /// Number of the newest stop.
    pub(super) fn stops(&self) -> u64 {
        self.stops.load(Ordering::Acquire)
    }

    pub(super) fn set_daemon(&self, instance: u64) {
        self.daemon_instance.store(instance, Ordering::Release);
    }

    /// What the guard knows of orders and of the daemon, for which trajectories are refused.
    pub(super) fn guard_state(&self) -> GuardState {
        let daemon = self.daemon_instance.load(Ordering::Acquire);
        GuardState {
            wanted_from_ns: self.wanted_from_ns.load(Ordering::Acquire),
            daemon_instance: Some(daemon).filter(|daemon| *daemon != 0),
        }
    }

    pub(super) fn is_quitting(&self) -> bool {
        self.quit.load(Ordering::Relaxed)
    }
}

/// The loop's ends.
pub(super) struct LoopEnd {
    pub(super) orders: Consumer<NumberedOrder>,
    pub(super) stop_origins: Consumer<NumberedOrigin>,
    pub(super) answers: Producer<Answer>,
    pub(super) motions: Consumer<Motion>,
    pub(super) returns: Producer<Return>,
    pub(super) reports: Producer<Report>,
    pub(super) shared: Arc<Shared>,
}

/// The guard's ends.
pub(super) struct GuardEnd {
    pub(super) orders: Producer<NumberedOrder>,
    pub(super) stop_origins: Producer<NumberedOrigin>,
    pub(super) answers: Consumer<Answer>,
    pub(super) events: Producer<GuardEvent>,
    pub(super) shared: Arc<Shared>,
}

/// The relay's ends.
pub(super) struct RelayEnd {
    pub(super) motions: Producer<Motion>,
    pub(super) returns: Consumer<Return>,
    pub(super) reports: Consumer<Report>,
    pub(super) events: Consumer<GuardEvent>,
    pub(super) shared: Arc<Shared>,
}

/// Makes a link; returns the ends of loop, guard and relay.
pub(super) fn link() -> (LoopEnd, GuardEnd, RelayEnd) {
    let (send_order, orders) = RingBuffer::new(ORDERS);
    let (send_origin, stop_origins) = RingBuffer::new(STOP_ORIGINS);
    let (answers, take_answer) = RingBuffer::new(ORDERS);
    let (send_motion, motions) = RingBuffer::new(ORDERS);
    let (returns, take_return) = RingBuffer::new(ORDERS);
    let (reports, take_report) = RingBuffer::new(REPORTS);
    let (events, take_event) = RingBuffer::new(EVENTS);
    let shared = Arc::<Shared>::default();
    shared.forget_requests(mono_now_ns());
    let for_loop = LoopEnd {
        orders,
        stop_origins,
        answers,
        motions,
        returns,
        reports,
        shared: Arc::clone(&shared),
    };
    let for_guard = GuardEnd {
        orders: send_order,
        stop_origins: send_origin,
        answers: take_answer,
        events,
        shared: Arc::clone(&shared),
    };
    let for_relay = RelayEnd {
        motions: send_motion,
        returns: take_return,
        reports: take_report,
        events: take_event,
        shared,
    };
    (for_loop, for_guard, for_relay)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_taken_once_and_one_that_was_taken_back_never() {
        let offer = Offer::default();
        assert!(!offer.take(1), "nothing is offered");
        offer.make(1);
        assert!(offer.take(1) && !offer.take(1));
        offer.make(2);
        assert!(!offer.take(1), "the one before is no longer offered");
        assert!(offer.take(2));
    }

    #[test]
    fn of_two_threads_exactly_one_takes_an_order() {
        let offer = Offer::default();
        for id in 1..2_000 {
            offer.make(id);
            let both = std::thread::scope(|scope| {
                let other = scope.spawn(|| offer.take(id));
                [offer.take(id), other.join().unwrap()]
            });
            assert!(both[0] != both[1], "order {id}: {both:?}");
        }
    }
}
