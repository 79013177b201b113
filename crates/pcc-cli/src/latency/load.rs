//! The load: clients in threads of their own, in a closed loop or at a fixed rate of arrivals.

use std::collections::VecDeque;
use std::fmt::Write as _;
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

/// How long an answer may be in coming.
const PATIENCE: Duration = Duration::from_secs(70);
/// Before a request is to be sent its thread stops sleeping: sleeps end late.
const AWAKE_NS: i64 = 200_000;
/// From the start of the threads until the first request of an open loop, nanoseconds.
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
    /// Asked for one after the other, again and again.
    pub(super) asked: Vec<PlanRequest>,
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
        let begin_ns = mono_now_ns() + SETTLING_NS;
        let of_clients = thread::scope(|scope| {
            let clients: Vec<_> = (0..self.clients)
                .map(|client| scope.spawn(move || self.client(client, options, begin_ns)))
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
        begin_ns: i64,
    ) -> anyhow::Result<Vec<Reply>> {
        let mut connection = Client::connect(options)?;
        connection.wait_for_daemon(PATIENCE).with_context(|| {
            format!("client {client}: the daemon's `clients` says how many it serves")
        })?;
        let (all, clients) = (self.requests, self.clients as u64);
        let count = all / clients + u64::from((client as u64) < all % clients) + self.warm_up;
        let mut replies = match self.pace {
            Pace::Closed => self.closed(client, &mut connection, count)?,
            Pace::Open(rate) => {
                let period_ns = 1e9 * self.clients as f64 / rate;
                let phase_ns = period_ns * client as f64 / self.clients as f64;
                let due_ns = |index: u64| begin_ns + (phase_ns + period_ns * index as f64) as i64;
                self.open(client, &mut connection, count, &due_ns)?
            }
        };
        Ok(replies.split_off(self.warm_up as usize))
    }

    fn request(&self, client: usize, index: u64) -> &PlanRequest {
        &self.asked[(client + index as usize * self.clients) % self.asked.len()]
    }

    fn closed(
        &self,
        client: usize,
        connection: &mut Client,
        count: u64,
    ) -> anyhow::Result<Vec<Reply>> {
        let mut replies = Vec::with_capacity(count as usize);
        for index in 0..count {
            let sent_ns = mono_now_ns();
            let answer = connection.plan(self.request(client, index), PATIENCE);
            replies.push(Reply::of(sent_ns, sent_ns, &answer));
        }
        Ok(replies)
    }

    /// A request that cannot be sent when it is due, because the client has as many under way as it may, is sent as soon as it can, and
    /// its time counts from when it was due.
    fn open(
        &self,
        client: usize,
        connection: &mut Client,
        count: u64,
        due_ns: &dyn Fn(u64) -> i64,
    ) -> anyhow::Result<Vec<Reply>> {
        let mut replies = Vec::with_capacity(count as usize);
        let mut under_way: VecDeque<(i64, i64, Pending)> = VecDeque::new();
        let mut next = 0;
        while replies.len() < count as usize {
            let is_due = next < count && mono_now_ns() >= due_ns(next);
            if is_due {
                let sent_ns = mono_now_ns();
                match connection.submit(self.request(client, next)) {
                    Ok(pending) => {
                        under_way.push_back((due_ns(next), sent_ns, pending));
                        next += 1;
                    }
                    Err(ClientError::TooManyRequests) if !under_way.is_empty() => {}
                    Err(error) => {
                        replies.push(Reply::of(due_ns(next), sent_ns, &Err(error)));
                        next += 1;
                    }
                }
            }
            let until_ns = if next < count { due_ns(next) } else { i64::MAX };
            let Some((due, sent, mut pending)) = under_way.pop_front() else {
                sleep_until(until_ns);
                continue;
            };
            // A client's requests are answered in their order.
            let wait_ns = (until_ns - mono_now_ns()).clamp(0, PATIENCE.as_nanos() as i64);
            let wait = Duration::from_nanos(wait_ns.unsigned_abs()).max(MIN_WAIT);
            match connection.next(&mut pending, wait) {
                Err(ClientError::TimedOut { .. }) if wait < PATIENCE => {
                    under_way.push_front((due, sent, pending));
                }
                answer => replies.push(Reply::of(due, sent, &answer)),
            }
        }
        Ok(replies)
    }

    pub(super) fn text(&self) -> String {
        let loops = match self.pace {
            Pace::Closed => "closed loop".to_owned(),
            Pace::Open(rate) => format!("open loop, {rate} requests/s"),
        };
        let candidates = self.asked[0].candidate_count;
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
            "candidates": self.asked[0].candidate_count,
        })
    }
}

/// Shortest wait for an answer while the next request is due: one look.
const MIN_WAIT: Duration = Duration::from_micros(1);

/// Sleeps until shortly before an instant, and looks at the clock from then on.
fn sleep_until(instant_ns: i64) {
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
