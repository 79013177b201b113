//! What the transport costs, and that `pcc latency` tells the truth of it.

use std::path::Path;
use std::time::Duration;
use std::{fs, thread};

use anyhow::{Context, anyhow, ensure};
use serde_json::Value;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    EventListener, EventNotifier, IpcNode, IpcOptions, PlanClient, Subscriber, event_listener,
    event_notifier, observer_subscriber, open_plan_service, plan_answered_event, plan_asked_event,
    plan_client, plan_record_service,
};
use shared_types::message::{PlanRecord, PlanRequest};
use shared_types::valid;

use tests::process::Process;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::examples::TIP_M;
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::median;

/// The longest that `pcc latency` may take.
const LIMIT: Duration = Duration::from_secs(900);
/// The other program looks for an answer at least so often, as `pcc` does.
const LONGEST_SLEEP: Duration = Duration::from_millis(2);
/// Turns of `pcc latency` and of the other program.
const TURNS: usize = 5;

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
    let count = scale.pick("5000", "20000");
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

/// Round trips that `pcc latency` tells, against those that another program measures by the same requests, in turn.
fn stamps(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    stack.disconnect_client();
    let of_a_turn = scale.pick(400, 2_000);
    let records = Records::open(&stack.world.options)?;
    let mut other = OtherProgram::connect(&stack.world.options)?;
    let (mut told_ms, mut measured_ms) = (Vec::new(), Vec::new());
    for _ in 0..TURNS {
        told_ms.extend(told(
            &stack.world,
            of_a_turn,
            &records,
            &mut other.requests,
        )?);
        measured_ms.extend(other.round_trips_ms(of_a_turn)?);
    }
    let [told, measured] = [&told_ms, &measured_ms].map(|times_ms| median(times_ms));
    report.shown(
        "latency: medians that `pcc latency` and another program stamped, requests of each, different ones",
        format!(
            "{told:.4} and {measured:.4} ms, {} and {}, {}",
            told_ms.len(),
            measured_ms.len(),
            other.requests.len()
        ),
    );
    let line = "latency: |told ÷ measured − 1| of the medians";
    report.at_most(line, (told / measured - 1.0).abs(), 0.02);
    Ok(())
}

/// Round trips of a run of `pcc latency` by the stamps that it writes, ms; what it asks for is added to `requests` where it is not there yet.
fn told(
    world: &World,
    count: usize,
    records: &Records,
    requests: &mut Vec<PlanRequest>,
) -> anyhow::Result<Vec<f64>> {
    let file = world.folder().join("stamps.txt");
    let [stamps, count] = [file.display().to_string(), count.to_string()];
    let arguments = ["--requests", &count, "--stamps", &stamps];
    thread::scope(|scope| {
        let running = scope.spawn(|| latency(world, &arguments));
        while !running.is_finished() {
            records.take(requests)?;
            thread::sleep(Duration::from_millis(1));
        }
        running.join().expect("it does not panic")
    })?;
    let text = fs::read_to_string(&file)?;
    let of_line = |line: &str| {
        let stamps: Vec<f64> = line.split(' ').filter_map(|it| it.parse().ok()).collect();
        let [_due, sent, answered] = stamps.as_slice() else {
            return None;
        };
        Some((answered - sent) * 1e-6)
    };
    Ok(text.lines().filter_map(of_line).collect())
}

/// What the daemon says that it was asked for.
struct Records {
    records: Subscriber<PlanRecord>,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Records {
    fn open(options: &IpcOptions) -> anyhow::Result<Self> {
        let node = IpcNode::create(options, "stamps-records")?;
        Ok(Self {
            records: observer_subscriber(&node, &plan_record_service(&node)?)?,
            _node: node,
        })
    }

    /// Adds requests that are not there yet.
    fn take(&self, requests: &mut Vec<PlanRequest>) -> anyhow::Result<()> {
        let received = || self.records.receive().map_err(|error| anyhow!("{error:?}"));
        while let Some(record) = received()? {
            if !requests.iter().any(|it| it.seed == record.request.seed) {
                requests.push(record.request);
            }
        }
        Ok(())
    }
}

/// Another client, with nothing of ours but the ports: it sends bytes, and waits for events as `pcc` does.
struct OtherProgram {
    client: PlanClient,
    asked: EventNotifier,
    answered: EventListener,
    /// What it asks for, one after the other.
    requests: Vec<PlanRequest>,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl OtherProgram {
    fn connect(options: &IpcOptions) -> anyhow::Result<Self> {
        let node = IpcNode::create(options, "stamps")?;
        Ok(Self {
            client: plan_client(&node, &open_plan_service(&node)?)?,
            asked: event_notifier(&node, &plan_asked_event(&node)?)?,
            answered: event_listener(&node, &plan_answered_event(&node)?)?,
            requests: Vec::new(),
            _node: node,
        })
    }

    fn round_trips_ms(&mut self, count: usize) -> anyhow::Result<Vec<f64>> {
        ensure!(!self.requests.is_empty(), "no request was recorded");
        (0..count)
            .map(|index| self.round_trip_ms(&self.requests[index % self.requests.len()]))
            .collect()
    }

    fn round_trip_ms(&self, request: &PlanRequest) -> anyhow::Result<f64> {
        let begun_ns = mono_now_ns();
        let loan = self.client.loan_uninit();
        let loan = loan.map_err(|error| anyhow!("{error:?}"))?;
        let pending = loan.write_payload(*request).send();
        let pending = pending.map_err(|error| anyhow!("{error:?}"))?;
        self.asked.notify().map_err(|error| anyhow!("{error:?}"))?;
        loop {
            let received = pending.receive().map_err(|error| anyhow!("{error:?}"))?;
            if received.is_some() {
                return Ok((mono_now_ns() - begun_ns) as f64 * 1e-6);
            }
            self.answered.wait(None, LONGEST_SLEEP)?;
        }
    }
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
