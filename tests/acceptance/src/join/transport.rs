//! What the transport costs, and that `pcc latency` tells the truth of it.

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, ensure};
use client::Client;
use serde_json::Value;
use shared_types::codes::Outcome;
use shared_types::message::{Knot, PlanReport};
use shared_types::valid;

use tests::fnv1a;
use tests::process::Process;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::examples::TIP_M;
use super::stamped_replies::{DIGITS, StampedReply};
use crate::machine::Pinned;
use crate::report::Report;
use crate::scale::Scale;

/// The longest that `pcc latency` may take.
const LIMIT: Duration = Duration::from_secs(900);
/// Clients of an open loop.
const CLIENTS: u32 = 4;
/// Requests a second that no daemon on two processors plans.
const OVERLOAD: u32 = 5_000;
/// How far the rate at which requests are due may be off: the clients do not begin at the same instant.
const RATE_OFF: f64 = 0.01;
/// Percentiles of an open loop, by their names.
const PERCENTILES: [(&str, f64); 4] = [("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("p99.9", 0.999)];
/// Round trips of each transport in each window.
const ROUND_TRIPS: &str = "20000";
/// What the planner `null` answers.
const CANDIDATES: usize = 10;
const KNOTS: usize = 64;

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "pcc latency --baselines COUNT, of a daemon with planner = \"null\"";
    report.group("transport", command, transport);
    report.group(
        "transport, all on one processor",
        command,
        transport_on_one_processor,
    );
    let command = "pcc plan, and /proc/PID/maps";
    report.group("transport: no copies", command, no_copies);
    let command = "pcc latency --rate RATE --requests COUNT --clients 4";
    report.group("latency: open loop", command, |report| {
        open_loop(report, scale)
    });
}

/// A stack of a daemon alone.
pub(super) fn daemon(settings: &Settings) -> anyhow::Result<Stack> {
    let mut stack = Stack::new(settings);
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    Ok(stack)
}

/// What `pcc latency` writes with these arguments.
pub(super) fn latency(world: &World, arguments: &[&str]) -> anyhow::Result<Value> {
    let file = world.folder().join("latency.json");
    let json = file.display().to_string();
    let all = [&["latency", "--json", &json], arguments].concat();
    let mut process = Process::start(world, "pcc", &all);
    let status = process.wait(LIMIT)?;
    ensure!(status.success(), "pcc latency: {}", process.log());
    Ok(serde_json::from_str(&fs::read_to_string(&file)?)?)
}

fn transport(report: &mut Report) -> anyhow::Result<()> {
    let baselines = &baselines(report, "transport")?;
    compared_with_one_hand_over(report, "transport", baselines)
}

/// Without the waking of processors, which is the most of a round trip where client and server are on two: what is left is work. No thread has
/// another processor to come from.
fn transport_on_one_processor(report: &mut Report) -> anyhow::Result<()> {
    let _pinned = Pinned::to_the_last()?;
    let group = "transport, all on one processor";
    let baselines = baselines(report, group)?;
    compared_with_one_hand_over(report, group, &baselines)
}

fn compared_with_one_hand_over(
    report: &mut Report,
    group: &str,
    baselines: &Value,
) -> anyhow::Result<()> {
    let bytes = size_of::<PlanReport>() + CANDIDATES * KNOTS * size_of::<Knot>();
    report.check(
        &format!("{group}: bytes of an answer of each transport"),
        baselines["bytes"].to_string(),
        &bytes.to_string(),
        baselines["bytes"] == bytes,
    );
    report.shown(
        &format!("{group}: round trips of each transport in each of five windows"),
        baselines["round_trips"].to_string(),
    );
    for (index, window) in array(&baselines["windows"])?.iter().enumerate() {
        report.shown(&format!("{group}: window {index}, µs"), text_of(window)?);
    }
    let quietest = &baselines["quietest"];
    report.shown(
        &format!("{group}: the quietest window, all together where several are, µs"),
        text_of(quietest)?,
    );
    let raw = &quietest["transports"]["raw iceoryx2, one hand-over to a thread"];
    for (percentile, bar) in [("p50", 1.2), ("p99", 1.5)] {
        let ratio = raw[percentile]["daemon_divided_by_it"].as_f64();
        let line = format!(
            "{group}: planner `null` ÷ raw iceoryx2 with one hand-over to a thread and back, quietest of five windows, {percentile}"
        );
        report.at_most(&line, ratio.context("no ratio")?, bar);
    }
    Ok(())
}

/// What `pcc latency` measures beside a daemon that answers from a store.
fn baselines(report: &mut Report, group: &str) -> anyhow::Result<Value> {
    let settings = Settings {
        daemon: vec![
            ("planner", "null".into()),
            ("wait", "event".into()),
            ("knots_per_candidate", (KNOTS as i64).into()),
        ],
        ..Settings::default()
    };
    let mut stack = daemon(&settings)?;
    let lengths = stored_answer(&mut stack.client)?;
    report.check(
        &format!("{group}: knots of each candidate that the planner `null` answers"),
        format!("{lengths:?}"),
        &format!("{CANDIDATES} candidates of {KNOTS} knots"),
        lengths == [KNOTS; CANDIDATES],
    );
    stack.disconnect_client();
    let arguments = ["--requests", "100", "--baselines", ROUND_TRIPS];
    Ok(latency(&stack.world, &arguments)?["baselines"].take())
}

/// Knots of each candidate of the second answer: the first one is planned, and answers all others.
fn stored_answer(client: &mut Client) -> anyhow::Result<Vec<usize>> {
    let request = valid::PlanRequest {
        candidate_count: CANDIDATES,
        ..valid::PlanRequest::new([0.0; 6], valid::Goal::tip(TIP_M))
    };
    client.plan(&request, PATIENCE)?;
    let answer = client.plan(&request, PATIENCE)?;
    Ok(answer.candidates().map(|it| it.knots.len()).collect())
}

fn array(value: &Value) -> anyhow::Result<&Vec<Value>> {
    value.as_array().context("no array")
}

/// A window's figures.
fn text_of(window: &Value) -> anyhow::Result<String> {
    let stolen = window["stolen_share"].as_f64().unwrap_or(f64::NAN);
    let transports = window["transports"].as_object().context("no transports")?;
    let of_one = |(name, figures): (&String, &Value)| {
        let part = |percentile: &str| {
            let [us, ratio] = ["us", "daemon_divided_by_it"]
                .map(|key| figures[percentile][key].as_f64().unwrap_or(f64::NAN));
            format!("{percentile} {us:.1} ({ratio:.2})")
        };
        format!("{name}: {}, {}", part("p50"), part("p99"))
    };
    let parts: Vec<String> = transports.iter().map(of_one).collect();
    Ok(format!(
        "{:.2} % stolen; {} (daemon ÷ it)",
        100.0 * stolen,
        parts.join("; ")
    ))
}

/// The reader's knots are those that the daemon has: the same place of the same shared file, by the addresses of both, and the daemon's memory
/// has these bytes there.
fn no_copies(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    let request = valid::PlanRequest {
        candidate_count: 10,
        ..valid::PlanRequest::new([0.0; 6], valid::Goal::tip(TIP_M))
    };
    let answer = stack.client.plan(&request, PATIENCE)?;
    let daemon = stack.process(Part::Daemon).pid();
    let (mut elsewhere, mut addresses) = (Vec::new(), Vec::new());
    for (index, candidate) in answer.candidates().enumerate() {
        let address = candidate.knots.as_ptr() as usize;
        let shared = Mapping::containing("self", address)?;
        let place = match shared.filter(|it| it.file.starts_with("/dev/shm/")) {
            Some(shared) => shared.place_in(daemon, address)?,
            None => None,
        };
        let Some(place) = place else {
            elsewhere.push(format!("candidate {index} at {address:#x}"));
            continue;
        };
        addresses.push(format!("{address:#x} = {place:#x}"));
        let expected: Vec<u8> = fnv1a::bytes_of(candidate.knots).collect();
        if memory_of(daemon, place, expected.len())? != expected {
            elsewhere.push(format!("candidate {index}: other bytes at {place:#x}"));
        }
    }
    report.shown(
        "transport: addresses of the candidates' knots, the reader's = the daemon's",
        addresses.join(", "),
    );
    let line = "transport: candidates of ten that lie elsewhere than in the daemon's own shared memory, by address";
    report.none_of(line, &elsewhere);
    report.all_of("transport: candidates looked at", addresses.len(), 10);
    Ok(())
}

/// A line of `/proc/PID/maps`.
struct Mapping {
    begin: usize,
    end: usize,
    /// Of the mapping's begin in the file.
    offset: usize,
    inode: String,
    file: String,
}

impl Mapping {
    fn all(process: &str) -> anyhow::Result<Vec<Self>> {
        let maps = fs::read_to_string(Path::new("/proc").join(process).join("maps"))?;
        let of_line = |line: &str| {
            let mut fields = line.split_whitespace();
            let (begin, end) = fields.next()?.split_once('-')?;
            Some(Self {
                begin: usize::from_str_radix(begin, 16).ok()?,
                end: usize::from_str_radix(end, 16).ok()?,
                offset: usize::from_str_radix(fields.nth(1)?, 16).ok()?,
                inode: fields.nth(1)?.to_owned(),
                file: fields.next().unwrap_or_default().to_owned(),
            })
        };
        Ok(maps.lines().filter_map(of_line).collect())
    }

    fn containing(process: &str, address: usize) -> anyhow::Result<Option<Self>> {
        let mut all = Self::all(process)?.into_iter();
        Ok(all.find(|it| (it.begin..it.end).contains(&address)))
    }

    /// The address in another process of what is at an address of this mapping; none where that has not mapped it.
    fn place_in(&self, process: u32, address: usize) -> anyhow::Result<Option<usize>> {
        let at = address - self.begin + self.offset;
        let all = Self::all(&process.to_string())?;
        let mut of_file = all
            .iter()
            .filter(|it| it.inode == self.inode && it.file == self.file);
        let mapped = of_file.find(|it| (it.offset..it.offset + it.end - it.begin).contains(&at));
        Ok(mapped.map(|it| it.begin + at - it.offset))
    }
}

/// What a process has at an address.
fn memory_of(process: u32, address: usize, count: usize) -> anyhow::Result<Vec<u8>> {
    let memory = File::open(Path::new("/proc").join(process.to_string()).join("mem"))?;
    let mut bytes = vec![0; count];
    memory.read_exact_at(&mut bytes, address as u64)?;
    Ok(bytes)
}

/// What a load that comes at a fixed rate is answered, and by when.
struct OpenLoop {
    /// Requests a second.
    rate: u32,
    lasts_s: u32,
    amount: Amount,
}

/// How much a load is for the daemon.
#[derive(Clone, Copy)]
enum Amount {
    /// It plans all of it.
    Planned,
    /// More than it plans; its queue is as shipped.
    TooMuch,
    /// The same, with a queue of one for each client.
    TooMuchForShortQueue,
}

fn open_loop(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for rate in [100, 500, 1_000] {
        let load = OpenLoop {
            rate,
            lasts_s: scale.pick(5, 60),
            amount: Amount::Planned,
        };
        load.run(report)?;
    }
    for amount in [Amount::TooMuch, Amount::TooMuchForShortQueue] {
        let load = OpenLoop {
            rate: OVERLOAD,
            lasts_s: scale.pick(2, 10),
            amount,
        };
        load.run(report)?;
    }
    Ok(())
}

impl OpenLoop {
    fn line(&self, what: &str) -> String {
        let queue = match self.amount {
            Amount::Planned | Amount::TooMuch => "",
            Amount::TooMuchForShortQueue => ", a queue of one for each client",
        };
        format!(
            "latency: open loop, {} requests a second{queue}: {what}",
            self.rate
        )
    }

    fn settings(&self) -> Settings {
        let daemon = match self.amount {
            Amount::Planned | Amount::TooMuch => Vec::new(),
            Amount::TooMuchForShortQueue => vec![("queued_per_client", 1.into())],
        };
        Settings {
            daemon,
            ..Settings::default()
        }
    }

    fn run(&self, report: &mut Report) -> anyhow::Result<()> {
        let mut stack = daemon(&self.settings())?;
        stack.disconnect_client();
        let file = stack.world.folder().join("stamps.txt");
        let stamps = file.display().to_string();
        let requests = self.rate * self.lasts_s;
        let [all, rate] = [requests, self.rate].map(|number| number.to_string());
        let clients = CLIENTS.to_string();
        let load = ["--clients", &clients, "--rate", &rate, "--requests", &all];
        let arguments = [&load[..], &["--stamps", &stamps]].concat();
        let measured = latency(&stack.world, &arguments)?;
        let replies = StampedReply::all(&fs::read_to_string(&file)?);
        let plans = &measured["plans"];
        self.percentiles(report, plans, "round trip", "round trips of plans, ms");
        self.percentiles(report, plans, "late to be sent", "late to be sent, ms");
        let outcomes = plans["outcomes"].as_object().context("no outcomes")?;
        let count = |outcome: &str| outcomes.get(outcome).and_then(Value::as_u64).unwrap_or(0);
        let told: u64 = outcomes.values().filter_map(Value::as_u64).sum();
        report.all_of(
            &self.line("requests whose outcome is told"),
            told as usize,
            requests as usize,
        );
        let overloaded = Outcome::Overloaded.to_string();
        let figure = plans["outcomes"].to_string();
        let line = self.line("outcomes by name");
        let stamped = self.line("requests that were answered, by their stamps");
        report.all_of(&stamped, replies.len(), requests as usize);
        self.arrivals(report, &replies);
        match self.amount {
            Amount::Planned => {
                let planned = plans["planned"].as_u64().unwrap_or(0);
                report.check(&line, figure, "all planned", planned == u64::from(requests));
                self.count_from_when_due(report, plans, &replies);
            }
            Amount::TooMuch => {
                report.shown(&line, figure);
                self.do_not_wait(report, &replies);
            }
            Amount::TooMuchForShortQueue => {
                let bar = format!("`{overloaded}` more than once");
                report.check(&line, figure, &bar, count(&overloaded) > 1);
            }
        }
        Ok(())
    }

    /// Whether requests were due at the rate, whatever became of those before.
    fn arrivals(&self, report: &mut Report, replies: &[StampedReply]) {
        let due = || replies.iter().map(|reply| reply.due_ns);
        let lasted_ns = due().max().unwrap_or(0) - due().min().unwrap_or(0);
        let rate = (replies.len() as f64 - 1.0) / (lasted_ns as f64 * 1e-9);
        let line = self.line("|rate at which they were due ÷ that asked for − 1|");
        report.at_most(&line, (rate / f64::from(self.rate) - 1.0).abs(), RATE_OFF);
    }

    /// Whether requests were sent while earlier ones of the same clients were not answered, as a loop that waits for answers never does.
    fn do_not_wait(&self, report: &mut Report, replies: &[StampedReply]) {
        let sent = replies.iter().map(|reply| (reply.sent_ns, 1));
        let answered = replies.iter().map(|reply| (reply.answered_ns, -1));
        let mut changes: Vec<(i64, i32)> = sent.chain(answered).collect();
        changes.sort_unstable();
        let (mut under_way, mut most) = (0, 0);
        for (_, change) in changes {
            under_way += change;
            most = most.max(under_way);
        }
        let clients = CLIENTS as i32;
        let line = self.line(&format!(
            "most requests under way at once, of {clients} clients"
        ));
        report.check(
            &line,
            most.to_string(),
            &format!("> {clients}"),
            most > clients,
        );
    }

    /// Whether percentiles are those of the time from when a request was due until it was answered, by the stamps of each.
    fn count_from_when_due(&self, report: &mut Report, plans: &Value, replies: &[StampedReply]) {
        let mut took_ms: Vec<f64> = replies.iter().map(StampedReply::took_ms).collect();
        took_ms.sort_by(f64::total_cmp);
        let off = PERCENTILES.map(|(name, share)| {
            let rank = (share * took_ms.len() as f64).ceil() as usize;
            let stamped_ms = took_ms.get(rank.saturating_sub(1));
            let told_ms = plans["times_ms"]["round trip"][name].as_f64();
            (told_ms.unwrap_or(f64::NAN) / stamped_ms.unwrap_or(&f64::NAN) - 1.0).abs()
        });
        let largest = off.into_iter().reduce(f64::max).unwrap_or(f64::NAN);
        let line = self.line(
            "|percentile told ÷ that of the stamps, from due to answered, − 1|, largest of all",
        );
        report.at_most(&line, largest, DIGITS);
    }

    /// Percentiles of a distribution, which must all be known and rise.
    fn percentiles(&self, report: &mut Report, plans: &Value, name: &str, what: &str) {
        let of = |percentile: &&str| plans["times_ms"][name][percentile].as_f64();
        let names = PERCENTILES.map(|(name, _)| name);
        let known: Vec<f64> = names.iter().filter_map(of).collect();
        let rise = known.windows(2).all(|pair| pair[0] <= pair[1]);
        let are_known = known.len() == names.len() && known.iter().all(|ms| ms.is_finite());
        report.check(
            &self.line(what),
            format!("{names:?}: {known:.3?}"),
            "all four, each at least the one before",
            rise && are_known,
        );
    }
}
