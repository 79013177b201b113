//! The load: clients in threads of their own, in a closed loop or at a fixed rate of arrivals.

use std::fmt::Write as _;
use std::sync::Barrier;
use std::thread;
use std::time::Duration;

use anyhow::Context;
use client::{Client, ClientError, Pending, PlanAnswer};
use serde_json::{Value, json};
use shared_types::capacity::STAGES;
use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::ipc::IpcOptions;
use shared_types::valid::PlanRequest;

use super::requests::Requests;

/// How long an answer may be in coming.
const PATIENCE: Duration = Duration::from_secs(70);
/// Before a request is to be sent its thread stops sleeping: sleeps end late.
const AWAKE_NS: i64 = 200_000;
/// Time between two looks for answers of an open loop: so much coarser are its times.
const LOOK: Duration = Duration::from_micros(20);
/// From when all clients are connected until the first request of an open loop, nanoseconds.
const SETTLING_NS: i64 = 50_000_000;

/// When requests are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pace {
    /// As soon as the client has the answer to the one before.
    Closed,
    /// So many per second of all clients, whatever is answered.
    Open(f64),
}

/// A load.
pub(super) struct Load {
    pub(super) clients: usize,
    /// Of all clients.
    pub(super) requests: u64,
    /// Of each client, before those that count.
    pub(super) warm_up: u64,
    pub(super) pace: Pace,
    /// What is asked for, in the order of its numbers.
    pub(super) asked: Requests,
}

/// What became of a request.
#[derive(Clone, Debug)]
pub(super) struct Reply {
    /// When it was to be sent, nanoseconds of `CLOCK_MONOTONIC`.
    pub(super) due_ns: i64,
    /// When it was sent.
    pub(super) sent_ns: i64,
    /// When its answer was there.
    pub(super) answered_ns: i64,
    pub(super) outcome: Result<Outcome, String>,
    pub(super) stages_ns: [u64; STAGES],
}

impl Reply {
    fn of(due_ns: i64, sent_ns: i64, answer: &Result<PlanAnswer, ClientError>) -> Self {
        let answered_ns = mono_now_ns();
        let report = answer.as_ref().map(PlanAnswer::report);
        Self {
            due_ns,
            sent_ns,
            answered_ns,
            stages_ns: report.as_ref().map_or([0; STAGES], |it| it.stages_ns),
            outcome: report.map(|it| it.outcome).map_err(ToString::to_string),
        }
    }
}

impl Load {
    /// Makes the load; the replies that count, in the order in which each client had them.
    pub(super) fn run(&self, options: &IpcOptions) -> anyhow::Result<Vec<Reply>> {
        let connected = Barrier::new(self.clients);
        let of_clients = thread::scope(|scope| {
            let connected = &connected;
            let clients: Vec<_> = (0..self.clients)
                .map(|client| scope.spawn(move || self.client(client, options, connected)))
                .collect();
            let joined = clients.into_iter().map(thread::ScopedJoinHandle::join);
            joined
                .map(|client| client.map_err(|_| anyhow::anyhow!("a client's thread panicked"))?)
                .collect::<anyhow::Result<Vec<_>>>()
        });
        Ok(of_clients?.into_iter().flatten().collect())
    }

    fn client(
        &self,
        client: usize,
        options: &IpcOptions,
        connected: &Barrier,
    ) -> anyhow::Result<Vec<Reply>> {
        let connection = Client::connect(options).and_then(|mut connection| {
            connection.wait_for_daemon(PATIENCE)?;
            Ok(connection)
        });
        connected.wait();
        let mut connection = connection.with_context(|| {
            format!("client {client}: the daemon's `clients` says how many it serves")
        })?;
        let begin_ns = mono_now_ns() + SETTLING_NS;
        let (all, clients) = (self.requests, self.clients as u64);
        let count = all / clients + u64::from((client as u64) < all % clients) + self.warm_up;
        let mut replies = match self.pace {
            Pace::Closed => self.closed(client, &mut connection, count),
            Pace::Open(rate) => {
                let period_ns = 1e9 * self.clients as f64 / rate;
                let phase_ns = period_ns * client as f64 / self.clients as f64;
                let due_ns = |index: u64| begin_ns + (phase_ns + period_ns * index as f64) as i64;
                self.open(client, &mut connection, count, &due_ns)
            }
        };
        let warm_up = replies.len().min(self.warm_up as usize);
        Ok(replies.split_off(warm_up))
    }

    fn request(&self, client: usize, index: u64) -> PlanRequest {
        self.asked
            .request(client as u64 + index * self.clients as u64)
    }

    /// Ends at the first request whose daemon is gone or does not answer.
    fn closed(&self, client: usize, connection: &mut Client, count: u64) -> Vec<Reply> {
        let mut replies = Vec::with_capacity(count as usize);
        for index in 0..count {
            let request = self.request(client, index);
            let sent_ns = mono_now_ns();
            let answer = connection.plan(&request, PATIENCE);
            let is_over = answer.is_err();
            replies.push(Reply::of(sent_ns, sent_ns, &answer));
            if is_over {
                break;
            }
        }
        replies
    }

    /// A request that cannot be sent when it is due, because the client has as many under way as it may, is sent as soon as it can, and
    /// its time counts from when it was due. Ends at the first request whose daemon is gone or does not answer.
    fn open(
        &self,
        client: usize,
        connection: &mut Client,
        count: u64,
        due_ns: &dyn Fn(u64) -> i64,
    ) -> Vec<Reply> {
        let mut replies = Vec::with_capacity(count as usize);
        let mut under_way: Vec<(i64, i64, Pending)> = Vec::new();
        let (mut next, mut is_full) = (0, false);
        let mut request = self.request(client, next);
        while replies.len() < count as usize {
            let sent_ns = mono_now_ns();
            if next < count && sent_ns >= due_ns(next) && !is_full {
                match connection.submit(&request) {
                    Ok(pending) => under_way.push((due_ns(next), sent_ns, pending)),
                    Err(ClientError::TooManyRequests) if !under_way.is_empty() => {
                        is_full = true;
                        continue;
                    }
                    Err(error) => {
                        replies.push(Reply::of(due_ns(next), sent_ns, &Err(error)));
                        break;
                    }
                }
                next += 1;
                request = self.request(client, next);
            }
            let before = replies.len();
            for (due, sent, mut pending) in std::mem::take(&mut under_way) {
                let timed_out = sent_ns - sent > PATIENCE.as_nanos() as i64;
                let answer = match connection.poll(&mut pending) {
                    Ok(None) if !timed_out => {
                        under_way.push((due, sent, pending));
                        continue;
                    }
                    Ok(None) => Err(ClientError::TimedOut {
                        server: "planner-daemon",
                        id: pending.id(),
                        waited: PATIENCE,
                        may_have_acted: false,
                    }),
                    Ok(Some(answer)) => Ok(answer),
                    Err(error) => Err(error),
                };
                replies.push(Reply::of(due, sent, &answer));
                if answer.is_err() {
                    return replies;
                }
            }
            is_full &= replies.len() == before;
            let until_ns = if next < count { due_ns(next) } else { i64::MAX };
            match under_way.is_empty() {
                true => sleep_until(until_ns),
                false if replies.len() == before => thread::sleep(LOOK),
                false => {}
            }
        }
        replies
    }

    pub(super) fn text(&self) -> String {
        let loops = match self.pace {
            Pace::Closed => "closed loop".to_owned(),
            Pace::Open(rate) => format!("open loop, {rate} requests/s"),
        };
        let candidates = self.asked.candidates;
        format!(
            "{loops}, {} clients, {} requests of {candidates} candidates",
            self.clients, self.requests
        )
    }

    pub(super) fn json(&self) -> Value {
        let rate = match self.pace {
            Pace::Closed => Value::Null,
            Pace::Open(rate) => json!(rate),
        };
        json!({
            "clients": self.clients,
            "requests": self.requests,
            "warm_up_each": self.warm_up,
            "requests_per_second": rate,
            "candidates": self.asked.candidates,
            "deadline_ms": self.asked.deadline_ms,
            "seed": self.asked.seed,
        })
    }
}

/// Sleeps until shortly before an instant, and looks at the clock from then on; not at all where there is none.
fn sleep_until(instant_ns: i64) {
    if instant_ns == i64::MAX {
        return;
    }
    let left_ns = instant_ns - mono_now_ns() - AWAKE_NS;
    if left_ns > 0 {
        thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
    }
    while mono_now_ns() < instant_ns {
        std::hint::spin_loop();
    }
}

/// The stamps of each reply, a line each.
pub(super) fn stamps(replies: &[Reply]) -> String {
    let mut text = String::from("due_ns sent_ns answered_ns\n");
    for reply in replies {
        let Reply {
            due_ns,
            sent_ns,
            answered_ns,
            ..
        } = reply;
        let _ = writeln!(text, "{due_ns} {sent_ns} {answered_ns}");
    }
    text
}
