//! What the transport costs, and that `pcc latency` tells the truth of it.

use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, ensure};
use client::Client;
use serde_json::Value;
use shared_types::codes::Outcome;
use shared_types::message::{Knot, PlanReport};
use shared_types::valid;

use tests::process::Process;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::examples::TIP_M;
use crate::report::Report;
use crate::scale::Scale;

/// The longest that `pcc latency` may take.
const LIMIT: Duration = Duration::from_secs(900);
/// Clients of an open loop.
const CLIENTS: u32 = 4;
/// Requests a second that no daemon on two processors plans.
const OVERLOAD: u32 = 5_000;
/// What the planner `null` answers.
const CANDIDATES: usize = 10;
const KNOTS: usize = 64;

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "pcc latency --baselines COUNT, of a daemon with planner = \"null\"";
    report.group("transport", command, |report| transport(report, scale));
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

fn transport(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let settings = Settings {
        daemon: vec![
            ("planner", "null".into()),
            ("knots_per_candidate", (KNOTS as i64).into()),
        ],
        ..Settings::default()
    };
    let mut stack = daemon(&settings)?;
    let lengths = stored_answer(&mut stack.client)?;
    report.check(
        "transport: knots of each candidate that the planner `null` answers",
        format!("{lengths:?}"),
        &format!("{CANDIDATES} candidates of {KNOTS} knots"),
        lengths == [KNOTS; CANDIDATES],
    );
    stack.disconnect_client();
    let count = scale.pick("5000", "20000");
    let measured = latency(&stack.world, &["--requests", "100", "--baselines", count])?;
    let baselines = &measured["baselines"];
    let bytes = size_of::<PlanReport>() + CANDIDATES * KNOTS * size_of::<Knot>();
    report.check(
        "transport: bytes of an answer of each transport",
        baselines["bytes"].to_string(),
        &bytes.to_string(),
        baselines["bytes"] == bytes,
    );
    report.shown(
        "transport: round trips of each transport in each of five windows",
        baselines["round_trips"].to_string(),
    );
    for (index, window) in array(&baselines["windows"])?.iter().enumerate() {
        report.shown(&format!("transport: window {index}, µs"), text_of(window)?);
    }
    let quietest = &baselines["quietest"];
    report.shown(
        "transport: the quietest window, all together where several are, µs",
        text_of(quietest)?,
    );
    let raw = &quietest["transports"]["raw iceoryx2, one hand-over to a thread"];
    for (percentile, bar) in [("p50", 1.2), ("p99", 1.5)] {
        let ratio = raw[percentile]["daemon_divided_by_it"].as_f64();
        let line = format!(
            "transport: planner `null` ÷ raw iceoryx2 with one hand-over, quietest of five windows, {percentile}"
        );
        report.at_most(&line, ratio.context("no ratio")?, bar);
    }
    Ok(())
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

/// The reader's knots lie in a shared file at the place at which the daemon has them.
fn no_copies(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    let request = valid::PlanRequest {
        candidate_count: 10,
        ..valid::PlanRequest::new([0.0; 6], valid::Goal::tip(TIP_M))
    };
    let answer = stack.client.plan(&request, PATIENCE)?;
    let daemon = stack.process(Part::Daemon).pid();
    let mut copied = Vec::new();
    for (index, candidate) in answer.candidates().enumerate() {
        let address = candidate.knots.as_ptr() as usize;
        let Some(shared) = Mapping::containing("self", address)? else {
            copied.push(format!("candidate {index} lies in no mapping"));
            continue;
        };
        let is_shared = shared.file.starts_with("/dev/shm/");
        if !is_shared || !shared.is_mapped_by(daemon)? {
            copied.push(format!("candidate {index} lies in {:?}", shared.file));
        }
    }
    let line = "transport: candidates of ten that lie elsewhere than in shared memory that the daemon has mapped, by address";
    report.none_of(line, &copied);
    report.all_of(
        "transport: candidates looked at",
        answer.candidates().len(),
        10,
    );
    Ok(())
}

/// A line of `/proc/PID/maps`.
struct Mapping {
    begin: usize,
    end: usize,
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
                inode: fields.nth(3)?.to_owned(),
                file: fields.next().unwrap_or_default().to_owned(),
            })
        };
        Ok(maps.lines().filter_map(of_line).collect())
    }

    fn containing(process: &str, address: usize) -> anyhow::Result<Option<Self>> {
        let mut all = Self::all(process)?.into_iter();
        Ok(all.find(|it| (it.begin..it.end).contains(&address)))
    }

    fn is_mapped_by(&self, process: u32) -> anyhow::Result<bool> {
        let all = Self::all(&process.to_string())?;
        Ok(all
            .iter()
            .any(|it| it.inode == self.inode && it.file == self.file))
    }
}

/// What a load that comes at a fixed rate is answered, and by when.
struct OpenLoop {
    /// Requests a second.
    rate: u32,
    lasts_s: u32,
    daemon: Settings,
    /// Whether so much is more than the daemon serves.
    is_too_much: bool,
}

fn open_loop(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for rate in [100, 500, 1_000] {
        let load = OpenLoop {
            rate,
            lasts_s: scale.pick(5, 60),
            daemon: Settings::default(),
            is_too_much: false,
        };
        load.run(report)?;
    }
    let load = OpenLoop {
        rate: OVERLOAD,
        lasts_s: scale.pick(2, 10),
        daemon: Settings {
            daemon: vec![("queued_per_client", 1.into())],
            ..Settings::default()
        },
        is_too_much: true,
    };
    load.run(report)
}

impl OpenLoop {
    fn line(&self, what: &str) -> String {
        let queue = match self.is_too_much {
            true => ", a queue of one for each client",
            false => "",
        };
        format!(
            "latency: open loop, {} requests a second{queue}: {what}",
            self.rate
        )
    }

    fn run(&self, report: &mut Report) -> anyhow::Result<()> {
        let mut stack = daemon(&self.daemon)?;
        stack.disconnect_client();
        let requests = self.rate * self.lasts_s;
        let [all, rate] = [requests, self.rate].map(|number| number.to_string());
        let clients = CLIENTS.to_string();
        let load = ["--clients", &clients, "--rate", &rate, "--requests", &all];
        let measured = latency(&stack.world, &load)?;
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
        if self.is_too_much {
            let bar = format!("`{overloaded}` more than once");
            report.check(&line, figure, &bar, count(&overloaded) > 1);
        } else {
            report.shown(&line, figure);
        }
        Ok(())
    }

    /// Percentiles of a distribution, which must all be known and rise.
    fn percentiles(&self, report: &mut Report, plans: &Value, name: &str, what: &str) {
        let of = |percentile: &&str| plans["times_ms"][name][percentile].as_f64();
        let names = ["p50", "p90", "p99", "p99.9"];
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
