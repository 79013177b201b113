//! Three publishers that send full scenes as fast as they can.

use std::thread;
use std::time::{Duration, Instant};

use shared_types::clock::mono_now_ns;
use shared_types::codes::ProcessKind;
use shared_types::ipc::{IpcNode, heartbeat_service, subscriber};
use shared_types::valid::PlanRequest;
use tests::listener::Listener;
use tests::raw_scene::{Flood, RawScenes};
use tests::stack::{MoveError, PATIENCE, Stack};

use super::executed::wait_for_braking;
use super::{SECOND_NS, execute, on_the_body, request, settings};
use crate::spread::Spread;
use crate::{Report, Scale};

/// Publishers of the flood.
const PUBLISHERS: usize = 3;
/// How long a plan may take in the flood, ms: its deadline is 20 ms, its client and the flood share two processors with it.
const PLAN_MS: f64 = 200.0;
/// Half of what the controller takes for a lost daemon, ms.
const BEAT_MS: f64 = 100.0;

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&settings(false))?;
    let node = IpcNode::create(&stack.world.options, "heart-listener")?;
    let beats = subscriber(&node, &heartbeat_service(&node)?)?;
    let mut camera = RawScenes::connect(&stack.world.options, "camera");
    camera.send(mono_now_ns(), 600 * SECOND_NS, &[]);
    let flood = Flood::start(&stack.world.options, PUBLISHERS);
    let (mut plans_ms, mut gap_ms, mut last_ns) = (Vec::new(), 0.0_f64, None);
    thread::sleep(Duration::from_millis(300));
    while beats.receive()?.is_some() {}
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(scale.pick(5, 60)) {
        let wanted = PlanRequest {
            execute: false,
            deadline: None,
            ..request(&mut stack)
        };
        let asked = Instant::now();
        stack.client.plan(&wanted, PATIENCE)?;
        plans_ms.push(asked.elapsed().as_secs_f64() * 1e3);
        while let Some(beat) = beats.receive()? {
            if beat.kind == ProcessKind::Daemon.code() {
                let gap_ns = beat.stamp_mono_ns - last_ns.unwrap_or(beat.stamp_mono_ns);
                gap_ms = gap_ms.max(gap_ns as f64 * 1e-6);
                last_ns = Some(beat.stamp_mono_ns);
            }
        }
        thread::sleep(Duration::from_millis(20));
    }
    let rate = flood.sent() as f64 / begun.elapsed().as_secs_f64();
    report.shown("scenes of 1024 balls sent, a second", format!("{rate:.0}"));
    let name = "3 flooding publishers: longest plan, ms";
    report.at_most(name, plans_ms.iter().copied().fold(0.0, f64::max), PLAN_MS);
    report.at_most(
        "3 flooding publishers: longest gap between heartbeats, ms",
        gap_ms,
        BEAT_MS,
    );
    stops(report, scale, &mut stack, &mut camera)
}

/// From the arrival of a ball on the body to the first cycle that brakes.
fn stops(
    report: &mut Report,
    scale: Scale,
    stack: &mut Stack,
    camera: &mut RawScenes,
) -> anyhow::Result<()> {
    let (mut ms, mut failed) = (Vec::new(), Vec::new());
    for _ in 0..scale.pick(5, 100) {
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
        stack.wait_for_progress(id, 0.3)?;
        let ball = on_the_body(stack);
        let sent_ns = mono_now_ns();
        camera.send(sent_ns, 600 * SECOND_NS, &[ball]);
        match wait_for_braking(&listener, sent_ns, Duration::from_secs(4)) {
            Ok(at_ns) => ms.push((at_ns - sent_ns) as f64 * 1e-6),
            Err(error) => failed.push(error.to_string()),
        }
        stack.wait_for_end(id)?;
    }
    report.none_of(
        "3 flooding publishers: balls on the body that stopped nothing",
        &failed,
    );
    let spread = Spread::of(&ms);
    report.shown(
        "3 flooding publishers: from a ball to the first cycle that brakes, ms",
        spread.to_string(),
    );
    Ok(())
}
