//! What `pcc latency` tells of round trips, against what another program measures by the same requests.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::{Context, anyhow, bail, ensure};
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    EventListener, EventNotifier, IpcNode, IpcOptions, PlanClient, Subscriber, event_listener,
    event_notifier, observer_subscriber, open_plan_service, plan_answered_event, plan_asked_event,
    plan_client, plan_record_service,
};
use shared_types::message::{PlanRecord, PlanRequest};
use tests::world::{Settings, World};

use super::stamped_replies::{DIGITS, StampedReply};
use super::transport::{daemon, latency};
use crate::report::Report;
use crate::spread::{lower_median, median};

/// The other program looks for an answer at least so often, as `pcc` does.
const LONGEST_SLEEP: Duration = Duration::from_millis(2);
/// Turns of `pcc latency` and of the other program, and requests of each: many short ones, since the machine is not as fast in one tenth of a
/// second as in the next. They are never fewer: of 2,000 requests, or of 10,000 in 100 turns, the ratio is not known to 2 %.
const TURNS: u64 = 400;
const REQUESTS: usize = 25;
/// Requests of `pcc latency` before those that count.
const WARM_UP: usize = 50;
/// Difference of the seeds of two turns: more than there are requests in one, so that no request comes twice.
const SEEDS_APART: u64 = 1_000_000;
/// No record comes for so long once a turn is over.
const SILENCE: Duration = Duration::from_millis(100);
pub(super) fn run(report: &mut Report) {
    let command = "pcc latency --requests COUNT --json FILE --stamps FILE";
    report.group("latency: another program's stamps", command, stamps);
}

/// No message tells when a client sent its request or read its answer, so that the other program stamps its own round trips of the same requests,
/// turn by turn.
fn stamps(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    stack.disconnect_client();
    let records = Records::open(&stack.world.options)?;
    let mut other = OtherProgram::connect(&stack.world.options)?;
    let mut turns = Vec::new();
    for turn in 0..TURNS {
        let told = Told::of(&stack.world, turn * SEEDS_APART, REQUESTS, &records)?;
        let measured_ms = other.round_trips_ms(&told.requests)?;
        turns.push((told, measured_ms));
    }
    let count = REQUESTS * TURNS as usize;
    let told: usize = turns.iter().map(|(told, _)| told.planned).sum();
    let asked: usize = turns.iter().map(|(_, measured_ms)| measured_ms.len()).sum();
    report.all_of("latency: requests whose round trips it tells", told, count);
    let line = "latency: of the same requests, those that another program has asked afterwards";
    report.all_of(line, asked, count);
    let off = |told: &Told| (told.p50_ms / lower_median(&told.stamped_ms) - 1.0).abs();
    report.at_most(
        "latency: |p50 told ÷ lower median of its own stamps − 1|, largest of all turns",
        turns.iter().map(|(told, _)| off(told)).fold(0.0, f64::max),
        DIGITS,
    );
    let medians_ms =
        |(told, measured_ms): &(Told, Vec<f64>)| (told.p50_ms, lower_median(measured_ms));
    let medians_ms: Vec<(f64, f64)> = turns.iter().map(medians_ms).collect();
    report.shown(
        "latency: p50 that `pcc latency --json` tells and the other program's median of the same requests, turn by turn, ms",
        format!("{medians_ms:.4?}"),
    );
    let ratios: Vec<f64> = medians_ms.iter().map(|(a, b)| a / b).collect();
    let line = "latency: |told ÷ measured − 1| of the medians, in turns of the same requests, the median of all turns";
    report.at_most(line, (median(&ratios) - 1.0).abs(), 0.02);
    let pooled = |of: fn(&(Told, Vec<f64>)) -> &Vec<f64>| {
        let all: Vec<f64> = turns.iter().flat_map(of).copied().collect();
        lower_median(&all)
    };
    let pooled = pooled(|(told, _)| &told.stamped_ms) / pooled(|(_, measured_ms)| measured_ms);
    let line = "latency: |told ÷ measured − 1| of the medians of all turns together";
    report.at_most(line, (pooled - 1.0).abs(), 0.02);
    Ok(())
}

/// What a run of `pcc latency` tells.
struct Told {
    /// Median of the round trips, as `--json` has it, ms.
    p50_ms: f64,
    /// Requests that had candidates, of which that is.
    planned: usize,
    /// Round trips by its stamps, ms.
    stamped_ms: Vec<f64>,
    /// What it asked for, the warm-up first.
    requests: Vec<PlanRequest>,
}

impl Told {
    fn of(world: &World, seed: u64, count: usize, records: &Records) -> anyhow::Result<Self> {
        let file = world.folder().join("stamps.txt");
        let stamps = file.display().to_string();
        let [warm_up, count, first] = [WARM_UP.to_string(), count.to_string(), seed.to_string()];
        let load = [
            "--requests",
            &count,
            "--warm-up",
            &warm_up,
            "--seed",
            &first,
        ];
        let arguments = [&load[..], &["--stamps", &stamps]].concat();
        let measured = latency(world, &arguments)?;
        let requests = records.of_seeds(seed..seed + SEEDS_APART)?;
        ensure!(requests.len() > WARM_UP, "{} records came", requests.len());
        let plans = &measured["plans"];
        let p50_ms = plans["times_ms"]["round trip"]["p50"].as_f64();
        Ok(Self {
            p50_ms: p50_ms.context("no median")?,
            planned: plans["planned"].as_u64().context("no count")? as usize,
            stamped_ms: StampedReply::all(&std::fs::read_to_string(&file)?)
                .iter()
                .map(StampedReply::took_ms)
                .collect(),
            requests,
        })
    }
}

/// What the daemon says that it was asked for, received by a thread that also runs in the other program's turns: it takes as much from both.
struct Records {
    requests: Receiver<PlanRequest>,
    ends: Arc<AtomicBool>,
    listener: Option<JoinHandle<anyhow::Result<()>>>,
}

impl Records {
    fn open(options: &IpcOptions) -> anyhow::Result<Self> {
        let (received, requests) = mpsc::channel();
        let (is_open, opened) = mpsc::channel();
        let ends = Arc::<AtomicBool>::default();
        let (options, is_over) = (options.clone(), Arc::clone(&ends));
        let listener = thread::spawn(move || {
            let node = IpcNode::create(&options, "stamps-records")?;
            let records = observer_subscriber(&node, &plan_record_service(&node)?)?;
            is_open.send(())?;
            while !is_over.load(Ordering::Relaxed) {
                forward(&records, &received)?;
                thread::sleep(Duration::from_millis(1));
            }
            Ok(())
        });
        opened.recv().context("the records cannot be heard")?;
        Ok(Self {
            requests,
            ends,
            listener: Some(listener),
        })
    }

    /// The requests of these seeds that have come until none comes for a while.
    fn of_seeds(&self, seeds: Range<u64>) -> anyhow::Result<Vec<PlanRequest>> {
        let mut all = Vec::new();
        loop {
            match self.requests.recv_timeout(SILENCE) {
                Ok(request) if seeds.contains(&request.seed) => all.push(request),
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) => return Ok(all),
                Err(RecvTimeoutError::Disconnected) => bail!("the records are not heard any more"),
            }
        }
    }
}

impl Drop for Records {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        let ended = self.listener.take().map(JoinHandle::join);
        if let Some(Ok(Err(error))) = ended {
            eprintln!("records: {error}");
        }
    }
}

fn forward(records: &Subscriber<PlanRecord>, received: &Sender<PlanRequest>) -> anyhow::Result<()> {
    let next = || records.receive().map_err(|error| anyhow!("{error:?}"));
    while let Some(record) = next()? {
        received.send(record.request)?;
    }
    Ok(())
}

/// Another client, with nothing of ours but the ports: it sends bytes, and waits for events as `pcc` does.
struct OtherProgram {
    client: PlanClient,
    asked: EventNotifier,
    answered: EventListener,
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
            _node: node,
        })
    }

    /// Round trips of these requests, but for the warm-up, ms.
    fn round_trips_ms(&mut self, requests: &[PlanRequest]) -> anyhow::Result<Vec<f64>> {
        let all = requests.iter().map(|it| self.round_trip_ms(it));
        let mut all_ms = all.collect::<anyhow::Result<Vec<f64>>>()?;
        Ok(all_ms.split_off(WARM_UP))
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
