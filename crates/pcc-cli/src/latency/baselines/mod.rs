//! What the transport costs: plans of the daemon beside raw iceoryx2 and a copying transport with the same payload, in turn, in five
//! windows.
//!
//! The servers are processes of their own, as the daemon is. Each answer is written by the server and read by the client, whole.

mod checksum;
mod copying;
mod raw;
mod server;

use std::time::Duration;

use anyhow::Context;
use client::{Client, PlanAnswer};
use hdrhistogram::Histogram;
use serde_json::{Value, json};
use shared_types::clock::mono_now_ns;
use shared_types::ipc::IpcOptions;
use shared_types::message::{Knot, PlanReport};
use shared_types::valid::PlanRequest;

use self::checksum::checksum;
use self::copying::CopyingClient;
use self::raw::RawClient;
pub(crate) use self::server::Arguments as ServerArguments;
pub(crate) use self::server::run as serve;
use self::server::{Server, Transport};
use super::machine::Machine;

/// Windows in which all transports are measured in turn.
const WINDOWS: usize = 5;
/// Round trips of a transport before it is another one's turn, and those before them, which do not count.
const TURN: u64 = 100;
const WARM_UP: u64 = 10;
/// Times beyond this count as this, ns.
const LONGEST_NS: u64 = 10_000_000_000;
/// How long an answer may be in coming.
const PATIENCE: Duration = Duration::from_secs(10);
/// The transports, in this order: the daemon's comes first, and is compared with the second one.
const TRANSPORTS: [&str; 4] = [
    "planner-daemon",
    "raw iceoryx2, one hand-over to a thread",
    "raw iceoryx2",
    "Unix socket, postcard",
];
/// Percentiles that are compared, by their names.
const PERCENTILES: [(&str, f64); 3] = [("p50", 50.0), ("p90", 90.0), ("p99", 99.0)];

/// Round trips of a transport, ns.
type Times = Histogram<u64>;

/// Asks, and reads the whole answer; its sum.
type RoundTrip<'a> = &'a mut dyn FnMut() -> anyhow::Result<u64>;

/// One window.
#[derive(Clone)]
struct Window {
    times: Vec<Times>,
    machine: super::machine::Figures,
}

/// What was measured.
pub(super) struct Baselines {
    windows: Vec<Window>,
    requests: u64,
    bytes: usize,
}

impl Baselines {
    /// Measures `requests` round trips (a multiple of [`TURN`], or the next one) of each transport in each window, of one request, in turns.
    ///
    /// # Errors
    /// Where the daemon does not answer with candidates, a server does not start, or an answer is not whole.
    pub(super) fn measure(
        options: &IpcOptions,
        request: &PlanRequest,
        requests: u64,
    ) -> anyhow::Result<Self> {
        let mut daemon = Client::connect(options)?;
        let knots = knots(&daemon.plan(request, PATIENCE)?);
        anyhow::ensure!(!knots.is_empty(), "the daemon has no plan for it");
        let start = |transport| Server::start(options, transport, &knots);
        let servers = [
            start(Transport::RawHandedOver)?,
            start(Transport::Raw)?,
            start(Transport::Copying)?,
        ];
        let [handed_over, raw, copying] = &servers;
        let mut handed_over = RawClient::connect(&handed_over.options)?;
        let mut raw = RawClient::connect(&raw.options)?;
        let mut copying = CopyingClient::connect(&copying.options)?;
        let expected = checksum(&knots);
        let mut windows = Vec::new();
        for _ in 0..WINDOWS {
            let machine = Machine::watch();
            let mut round_trips: [RoundTrip; TRANSPORTS.len()] = [
                &mut || read_answer(&daemon.plan(request, PATIENCE)?),
                &mut || handed_over.round_trip(PATIENCE),
                &mut || raw.round_trip(PATIENCE),
                &mut || copying.round_trip(),
            ];
            let mut times = Vec::new();
            for _ in TRANSPORTS {
                times.push(Times::new_with_bounds(1, LONGEST_NS, 3)?);
            }
            for turn in 0..requests.div_ceil(TURN) as usize {
                // Each begins as often as the others.
                for place in turn..turn + TRANSPORTS.len() {
                    let index = place % TRANSPORTS.len();
                    take_turn(&mut round_trips[index], expected, &mut times[index])
                        .context(TRANSPORTS[index])?;
                }
            }
            windows.push(Window {
                times,
                machine: machine.figures(),
            });
        }
        Ok(Self {
            windows,
            requests,
            bytes: size_of::<PlanReport>() + size_of_val(knots.as_slice()),
        })
    }

    /// The window in which the host took the least share of time; all of them as one where several are.
    fn quietest(&self) -> Window {
        let shares = self.windows.iter().map(Window::stolen_share);
        let least = shares.fold(f64::INFINITY, f64::min);
        let windows = self.windows.iter();
        let quietest = windows.filter(|it| it.stolen_share() <= least).cloned();
        let together = quietest.reduce(|mut all, window| {
            let both = all.times.iter_mut().zip(&window.times);
            both.for_each(|(times, more)| *times += more);
            all
        });
        together.expect("there are windows")
    }

    pub(super) fn show(&self) {
        say!(
            "transport: answers of {} bytes, written and read; {WINDOWS} windows of {} round trips of each in turn, µs; in the quietest, all together where several are:",
            self.bytes,
            self.requests
        );
        let quietest = self.quietest();
        let names = PERCENTILES.map(|(name, _)| format!("{name:>10}")).concat();
        say!("{:<40}{names}", "");
        for (name, times) in TRANSPORTS.iter().zip(&quietest.times) {
            let row = PERCENTILES.map(|(_, it)| format!("{:>10.1}", us(times, it)));
            say!("{name:<40}{}", row.concat());
        }
        for (name, ratios) in TRANSPORTS.iter().zip(quietest.ratios()).skip(1) {
            let row = ratios.map(|ratio| format!("{ratio:>10.2}")).concat();
            say!("{:<40}{row}", format!("planner-daemon ÷ {name}"));
        }
        quietest.machine.show();
    }

    pub(super) fn json(&self) -> Value {
        let quietest = self.quietest();
        json!({
            "bytes": self.bytes,
            "round_trips": self.requests,
            "windows": self.windows.iter().map(Window::json).collect::<Vec<_>>(),
            "quietest": quietest.json(),
        })
    }
}

impl Window {
    fn stolen_share(&self) -> f64 {
        self.machine.stolen_share().unwrap_or(f64::INFINITY)
    }

    /// The daemon's percentiles ÷ those of each transport.
    fn ratios(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let daemon = &self.times[0];
        let ratio = |times: &Times, it| us(daemon, it) / us(times, it);
        let times = self.times.iter();
        times.map(move |times| PERCENTILES.map(|(_, it)| ratio(times, it)))
    }

    fn json(&self) -> Value {
        let arms = TRANSPORTS.iter().zip(&self.times).zip(self.ratios());
        let arms = arms.map(|((name, times), ratios)| {
            let named = PERCENTILES.iter().zip(ratios);
            let percentiles = named.map(|((percentile, it), ratio)| {
                let figures = json!({ "us": us(times, *it), "daemon_divided_by_it": ratio });
                ((*percentile).to_owned(), figures)
            });
            let percentiles: serde_json::Map<String, Value> = percentiles.collect();
            ((*name).to_owned(), Value::from(percentiles))
        });
        json!({
            "stolen_share": self.machine.stolen_share(),
            "transports": arms.collect::<serde_json::Map<String, Value>>(),
        })
    }
}

fn us(times: &Times, percentile: f64) -> f64 {
    times.value_at_percentile(percentile) as f64 * 1e-3
}

/// Some round trips of a transport, each of whose answers is the one expected.
fn take_turn(round_trip: &mut RoundTrip, expected: u64, times: &mut Times) -> anyhow::Result<()> {
    for index in 0..WARM_UP + TURN {
        let begun_ns = mono_now_ns();
        let read = round_trip()?;
        let took_ns = (mono_now_ns() - begun_ns).max(0).unsigned_abs();
        anyhow::ensure!(read == expected, "another answer came");
        if index >= WARM_UP {
            times.saturating_record(took_ns);
        }
    }
    Ok(())
}

/// The knots of all candidates.
fn knots(answer: &PlanAnswer) -> Vec<Knot> {
    let of_all = answer.candidates().flat_map(|it| it.knots.iter().copied());
    of_all.collect()
}

fn read_answer(answer: &PlanAnswer) -> anyhow::Result<u64> {
    let parts = answer
        .candidates()
        .map(|candidate| checksum(candidate.knots));
    Ok(parts.fold(0, u64::wrapping_add))
}
