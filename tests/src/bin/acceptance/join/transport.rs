//! What the transport costs, and that `pcc latency` tells the truth of it.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use std::{fs, thread};

use anyhow::{Context, ensure};
use serde_json::Value;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    IpcNode, IpcOptions, event_listener, plan_answered_event, plan_asked_event,
};
use shared_types::valid::{Goal, PlanRequest};
use tests::process::Process;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::examples::TIP_M;
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::median;

/// The longest that `pcc latency` may take.
const LIMIT: Duration = Duration::from_secs(900);
/// How long the other program waits for an answer's event.
const LONGEST_SILENCE: Duration = Duration::from_millis(100);

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "pcc latency --baselines COUNT, of a daemon with planner = \"null\"";
    report.group("transport", command, |report| transport(report, scale));
    let command = "pcc plan, and /proc/PID/maps";
    report.group("transport: no copies", command, no_copies);
    let command = "pcc latency --stamps FILE";
    report.group("latency: another program's stamps", command, |report| {
        stamps(report, scale)
    });
    let command = "pcc latency --rate RATE --clients 4";
    report.group("latency: open loop", command, |report| {
        open_loop(report, scale)
    });
}

/// A stack of a daemon alone.
fn daemon(settings: &Settings) -> anyhow::Result<Stack> {
    let mut stack = Stack::new(settings);
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    Ok(stack)
}

/// What `pcc latency` writes with these arguments.
fn latency(world: &World, arguments: &[&str]) -> anyhow::Result<Value> {
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
            ("knots_per_candidate", 64.into()),
        ],
        ..Settings::default()
    };
    let mut stack = daemon(&settings)?;
    stack.disconnect_client();
    let count = scale.pick("2000", "10000");
    let measured = latency(&stack.world, &["--requests", "100", "--baselines", count])?;
    let baselines = &measured["baselines"];
    report.shown(
        "transport: bytes of an answer, and round trips of each transport in each of five windows",
        format!("{}, {}", baselines["bytes"], baselines["round_trips"]),
    );
    for (index, window) in array(&baselines["windows"])?.iter().enumerate() {
        report.shown(&format!("transport: window {index}, µs"), text_of(window)?);
    }
    let quietest = &baselines["quietest"];
    report.shown("transport: the quietest window, µs", text_of(quietest)?);
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
    let request = PlanRequest {
        candidate_count: 10,
        ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
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

/// Round trips by the events of requests and answers, which another program hears, against those that `pcc latency` tells.
fn stamps(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    stack.disconnect_client();
    let requests = scale.pick("2000", "10000");
    let (world, is_over) = (&stack.world, AtomicBool::new(false));
    let (measured, heard_ns) = thread::scope(|scope| {
        let hearing = scope.spawn(|| round_trips(&world.options, &is_over));
        // It hears from the first request on.
        thread::sleep(Duration::from_millis(500));
        let measured = latency(world, &["--requests", requests, "--warm-up", "0"]);
        is_over.store(true, Ordering::Relaxed);
        let heard = hearing.join().expect("it does not panic");
        anyhow::Ok((measured?, heard?))
    })?;
    let told_ms = measured["plans"]["times_ms"]["round trip"]["p50"].as_f64();
    let told_ms = told_ms.context("no median")?;
    let heard_ms = median(&heard_ns) * 1e-6;
    report.shown(
        "latency: medians of the round trip told and heard, and requests heard",
        format!("{told_ms:.4} and {heard_ms:.4} ms, {}", heard_ns.len()),
    );
    let off = (told_ms / heard_ms - 1.0).abs();
    report.at_most("latency: |told ÷ heard − 1| of the medians", off, 0.02);
    let all: usize = requests.parse()?;
    // An event may be lost where several are sent at the same instant.
    let line = "latency: requests of which another program heard both events";
    let figure = format!("{} of {all}", heard_ns.len());
    report.check(line, figure, ">= 99 %", heard_ns.len() * 100 >= all * 99);
    Ok(())
}

/// Times from a request's event to the event of its answer, of one client in a closed loop, until it is over, ns. Requests are looked for without
/// sleeping, since they come at once after answers; of an answer it learns as the client does, asleep.
fn round_trips(options: &IpcOptions, is_over: &AtomicBool) -> anyhow::Result<Vec<f64>> {
    let node = IpcNode::create(options, "stamps")?;
    let asked = event_listener(&node, &plan_asked_event(&node)?)?;
    let answered = event_listener(&node, &plan_answered_event(&node)?)?;
    let mut times_ns = Vec::new();
    while !is_over.load(Ordering::Relaxed) {
        if !asked.wait(None, Duration::ZERO)? {
            continue;
        }
        let asked_ns = mono_now_ns();
        if answered.wait(None, LONGEST_SILENCE)? {
            times_ns.push((mono_now_ns() - asked_ns) as f64);
        }
    }
    Ok(times_ns)
}

fn open_loop(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    stack.disconnect_client();
    for rate in [100_u32, 500, 1_000] {
        let requests = rate * scale.pick(5, 60);
        let [requests_text, rate_text] = [requests, rate].map(|number| number.to_string());
        let measured = latency(
            &stack.world,
            &[
                "--clients",
                "4",
                "--rate",
                &rate_text,
                "--requests",
                &requests_text,
            ],
        )?;
        let plans = &measured["plans"];
        let of = |percentile: &str| {
            let ms = plans["times_ms"]["round trip"][percentile].as_f64();
            format!("{percentile} {:.3}", ms.unwrap_or(f64::NAN))
        };
        let percentiles = ["p50", "p90", "p99", "p99.9"].map(of).join(", ");
        let outcomes = plans["outcomes"].as_object().context("no outcomes")?;
        let counts = outcomes.values().filter_map(Value::as_u64);
        let told: u64 = counts.sum();
        let line = |what: &str| format!("latency: open loop, {rate} requests a second: {what}");
        let figure = format!("{percentiles} ms; {}", plans["outcomes"]);
        report.shown(&line("round trips of plans, and outcomes by name"), figure);
        report.all_of(
            &line("requests whose outcome is told"),
            told as usize,
            requests as usize,
        );
    }
    Ok(())
}
