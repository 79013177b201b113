//! Three publishers that send full scenes as fast as they can.

use std::collections::BTreeMap;
use std::thread;
use std::time::{Duration, Instant};

use shared_types::clock::mono_now_ns;
use shared_types::codes::{Outcome, ProcessKind};
use shared_types::ipc::{IpcNode, Subscriber, heartbeat_service, subscriber};
use shared_types::message::Heartbeat;
use shared_types::valid::PlanRequest;
use tests::listener::Listener;
use tests::raw_scene::{Flood, RawScenes};
use tests::stack::{MoveError, PATIENCE, Stack};

use super::executed::wait_for_braking;
use super::scenario::{SECOND_NS, comes_to, execute, on_the_body, request, settings};
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::Spread;

/// Publishers of the flood.
const PUBLISHERS: usize = 3;
/// Deadline of a plan in the flood, the shipped `default_deadline_ms`.
const DEADLINE: Duration = Duration::from_millis(20);
/// How much later than at its deadline a plan may be back, ms: its client waits for a processor as long as any program does, with
/// the three of the flood and the daemon on two.
const REST_MS: f64 = 40.0;
/// Half of what the controller takes for a lost daemon, ms.
const BEAT_MS: f64 = 100.0;
/// From a ball to the first cycle that brakes, ms: in 95 of 100 tries, and in all.
const BRAKED_MS: [f64; 2] = [20.0, 100.0];

/// Heartbeats of the daemon, and the longest gap between them.
struct Heart {
    beats: Subscriber<Heartbeat>,
    last_ns: Option<i64>,
    gap_ms: f64,
    _node: IpcNode,
}

impl Heart {
    fn listen(stack: &Stack) -> anyhow::Result<Self> {
        let node = IpcNode::create(&stack.world.options, "heart-listener")?;
        Ok(Self {
            beats: subscriber(&node, &heartbeat_service(&node)?)?,
            last_ns: None,
            gap_ms: 0.0,
            _node: node,
        })
    }

    fn hear(&mut self) -> anyhow::Result<()> {
        while let Some(beat) = self.beats.receive()? {
            if beat.kind == ProcessKind::Daemon.code() {
                let gap_ns = beat.stamp_mono_ns - self.last_ns.unwrap_or(beat.stamp_mono_ns);
                self.gap_ms = self.gap_ms.max(gap_ns as f64 * 1e-6);
                self.last_ns = Some(beat.stamp_mono_ns);
            }
        }
        Ok(())
    }
}

/// Publishers that have not sent anything since the last look.
struct Flow {
    looked: Instant,
    sent: Vec<u64>,
    dry: Vec<String>,
}

impl Flow {
    fn of(flood: &Flood) -> Self {
        Self {
            looked: Instant::now(),
            sent: flood.sent_each(),
            dry: Vec::new(),
        }
    }

    /// Looks once a second at most: a publisher waits for its processor like any program.
    fn look(&mut self, flood: &Flood, when: &str) {
        if self.looked.elapsed() < Duration::from_secs(1) {
            return;
        }
        self.looked = Instant::now();
        let now = flood.sent_each();
        for (index, (before, now)) in self.sent.iter().zip(&now).enumerate() {
            if now <= before {
                self.dry.push(format!("publisher {index}, {when}"));
            }
        }
        if flood.alive() < PUBLISHERS {
            self.dry.push(format!("{} live, {when}", flood.alive()));
        }
        self.sent = now;
    }
}

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&settings(false))?;
    let flood = Flood::start(&stack.world.options, PUBLISHERS);
    thread::sleep(Duration::from_millis(300));
    // iceoryx2 hears who came first first: who comes last is heard all the same.
    let mut camera = RawScenes::connect(&stack.world.options, "camera");
    camera.send(mono_now_ns(), 600 * SECOND_NS, &[]);
    let mut flow = Flow::of(&flood);
    plans(report, scale, &mut stack, &flood, &mut flow)?;
    stops(report, scale, &mut stack, &mut camera, (&flood, &mut flow))?;
    let name = "defect 6: 3 flooding publishers: one that did not send, or has ended";
    report.none_of(name, &flow.dry);
    Ok(())
}

fn plans(
    report: &mut Report,
    scale: Scale,
    stack: &mut Stack,
    flood: &Flood,
    flow: &mut Flow,
) -> anyhow::Result<()> {
    let mut heart = Heart::listen(stack)?;
    let (mut plans_ms, mut with_candidates) = (Vec::new(), 0);
    let (mut outcomes, mut without) = (BTreeMap::<String, usize>::new(), Vec::new());
    let (begun, sent) = (Instant::now(), flood.sent());
    while begun.elapsed() < Duration::from_secs(scale.pick(5, 60)) {
        let wanted = PlanRequest {
            execute: false,
            deadline: Some(DEADLINE),
            ..request(stack)
        };
        let asked = Instant::now();
        let answer = stack.client.plan(&wanted, PATIENCE)?;
        let (said, took) = (answer.report(), asked.elapsed());
        *outcomes.entry(said.outcome.to_string()).or_default() += 1;
        let named = is_deadline(said.outcome, &said.reason) && took >= DEADLINE;
        if said.outcome.has_candidates() && answer.selected().is_some() {
            with_candidates += 1;
        } else if !named {
            let (outcome, reason) = (said.outcome, &said.reason);
            without.push(format!("{outcome}: {reason}, after {took:?}"));
        }
        plans_ms.push(took.as_secs_f64() * 1e3);
        heart.hear()?;
        thread::sleep(Duration::from_millis(100));
        flow.look(flood, "plans");
    }
    let name =
        "defect 6: 3 flooding publishers: plans without a candidate, and not for the deadline";
    report.none_of(name, &without);
    let name = "defect 6: 3 flooding publishers: plans with candidates, and all outcomes";
    let count = plans_ms.len();
    let figure = format!("{with_candidates} of {count}: {outcomes:?}");
    report.check(name, figure, ">= 1", with_candidates > 0);
    let rate = (flood.sent() - sent) as f64 / begun.elapsed().as_secs_f64();
    report.shown(
        "defect 6: scenes of 1024 balls sent, a second",
        format!("{rate:.0}"),
    );
    let name = "defect 6: 3 flooding publishers: longest plan after its deadline of 20 ms, ms";
    let longest_ms = plans_ms.iter().copied().fold(0.0, f64::max);
    report.at_most(name, longest_ms - DEADLINE.as_secs_f64() * 1e3, REST_MS);
    let name = "defect 6: 3 flooding publishers: time of a plan, ms";
    report.shown(name, Spread::of(&plans_ms).to_string());
    let name = "defect 6: 3 flooding publishers: longest gap between heartbeats, ms";
    report.at_most(name, heart.gap_ms, BEAT_MS);
    Ok(())
}

/// Whether a plan has nothing because its time was over, and says so.
fn is_deadline(outcome: Outcome, reason: &str) -> bool {
    outcome == Outcome::Truncated || reason.contains("deadline")
}

/// From the arrival of a ball on the body to the first cycle that brakes.
fn stops(
    report: &mut Report,
    scale: Scale,
    stack: &mut Stack,
    camera: &mut RawScenes,
    (flood, flow): (&Flood, &mut Flow),
) -> anyhow::Result<()> {
    let (mut ms, mut failed) = (Vec::new(), Vec::new());
    for _ in 0..scale.pick(10, 100) {
        camera.send(mono_now_ns(), 600 * SECOND_NS, &[]);
        thread::sleep(Duration::from_millis(50));
        stack.wait_until_ready()?;
        let listener = Listener::start(&stack.world.options);
        let id = match execute(stack) {
            Ok(id) => id,
            Err(MoveError::Refused { reason, .. }) => {
                failed.push(reason);
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        if !comes_to(stack, id, 0.3)? {
            let state = stack.controller_state();
            failed.push(format!("not begun: {}, {}", state.fault, state.refusal));
            continue;
        }
        let ball = on_the_body(stack);
        let sent_ns = mono_now_ns();
        camera.send(sent_ns, 600 * SECOND_NS, &[ball]);
        match wait_for_braking(&listener, sent_ns, Duration::from_secs(4)) {
            Ok(at_ns) => ms.push((at_ns - sent_ns) as f64 * 1e-6),
            Err(error) => failed.push(error.to_string()),
        }
        let ended = stack.wait_for_end(id);
        if let Err(MoveError::CutShort(text)) = ended {
            failed.push(text);
        } else {
            ended?;
        }
        flow.look(flood, "stops");
    }
    let name =
        "defect 6: 3 flooding publishers: balls on the body that stopped nothing, and faults";
    report.none_of(name, &failed);
    let [usual_ms, latest_ms] = BRAKED_MS;
    let soon = ms.iter().filter(|ms| **ms <= usual_ms).count();
    let name = "defect 6: 3 flooding publishers: from a ball to the first cycle that brakes, ms";
    let passed = 100 * soon >= 95 * (ms.len() + failed.len());
    let bar = "<= 20 in 95 of 100";
    report.check(name, Spread::of(&ms).to_string(), bar, passed);
    let latest = ms.iter().copied().fold(0.0, f64::max);
    report.at_most(&format!("{name}, the latest"), latest, latest_ms);
    Ok(())
}
