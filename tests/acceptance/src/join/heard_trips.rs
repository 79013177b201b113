//! What `pcc latency` tells of round trips, against what another program hears of the same requests: an event when each was sent, and one when
//! its answer was.

use std::fs;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use realtime::use_fifo_priority;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    EventService, IpcError, IpcNode, IpcOptions, event_listener, plan_answered_event,
    plan_asked_event,
};
use tests::world::Settings;

use super::ends::Ends;
use super::stamped_replies::StampedReply;
use super::transport::{daemon, latency};
use crate::report::Report;
use crate::spread::lower_median;

/// Requests whose round trips count.
const REQUESTS: usize = 10_000;
/// Of these, heard at least: two events are one where the machine takes a listener's processor away for a round trip.
const LEAST_HEARD: usize = 9_900;
/// Of the listeners: no program that plans keeps them from a processor.
const PRIORITY: u8 = 50;
/// A listener looks whether all is over at least so often.
const LONGEST_SLEEP: Duration = Duration::from_millis(100);

pub(super) fn run(report: &mut Report) {
    let command = "pcc latency --requests 10000 --json FILE --stamps FILE";
    report.group("latency: heard by another program", command, round_trips);
}

/// The requests' own round trips as told, beside those from event to event. What only the client sees is more: that it makes its request, and that
/// it reads its answer.
fn round_trips(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = daemon(&Settings::default())?;
    stack.disconnect_client();
    let file = stack.world.folder().join("stamps.txt");
    let [count, stamps] = [REQUESTS.to_string(), file.display().to_string()];
    let arguments = ["--requests", &count, "--stamps", &stamps];
    let (measured, heard) =
        heard_beside(&stack.world.options, || latency(&stack.world, &arguments))?;
    let replies = StampedReply::all(&fs::read_to_string(&file)?);
    let heard_ms = heard.round_trips_ms(&replies);
    report.check(
        "latency: of 10,000 requests, those that another program heard sent and answered",
        heard_ms.len().to_string(),
        &format!(">= {LEAST_HEARD}"),
        heard_ms.len() >= LEAST_HEARD,
    );
    let told_ms = measured?["plans"]["times_ms"]["round trip"]["p50"].as_f64();
    let told_ms = told_ms.context("no median")?;
    let heard_ms = lower_median(&heard_ms);
    let line = "latency: median told and median from event to event of these requests, ms";
    report.shown(line, format!("{told_ms:.4} and {heard_ms:.4}"));
    report.check(
        "latency: median told ÷ median from event to event, which is less than a round trip",
        format!("{:.4}", told_ms / heard_ms),
        "1 to 1.1",
        (heard_ms..=1.1 * heard_ms).contains(&told_ms),
    );
    Ok(())
}

/// When events were heard, in their order, ns.
struct Heard {
    asked_ns: Vec<i64>,
    answered_ns: Vec<i64>,
}

impl Heard {
    /// From the event that a request was sent to the event that it was answered, ms, of the requests of which both were heard. What `pcc latency`
    /// stamps says which event is of which request, no more: that it was sent is heard before the next request, that it was answered is heard
    /// from half-way to that to half-way of the next one, since the client may ask again before this program hears of the answer.
    fn round_trips_ms(&self, replies: &[StampedReply]) -> Vec<f64> {
        let half_way_ns = |it: &StampedReply| it.due_ns + (it.answered_ns - it.due_ns) / 2;
        let trip = |index: usize, reply: &StampedReply| {
            let next = replies.get(index + 1);
            let until = |of: &dyn Fn(&StampedReply) -> i64| next.map_or(i64::MAX, of);
            let asked_ns = first_within(&self.asked_ns, reply.due_ns..until(&|it| it.due_ns))?;
            let answered = half_way_ns(reply)..until(&half_way_ns);
            let answered_ns = first_within(&self.answered_ns, answered)?;
            Some((answered_ns - asked_ns) as f64 * 1e-6)
        };
        let trips = replies.iter().enumerate();
        trips
            .filter_map(|(index, reply)| trip(index, reply))
            .collect()
    }
}

fn first_within(sorted_ns: &[i64], range_ns: Range<i64>) -> Option<i64> {
    let first = sorted_ns.partition_point(|it| *it < range_ns.start);
    sorted_ns
        .get(first)
        .copied()
        .filter(|it| range_ns.contains(it))
}

/// What two listeners hear while something runs, each in a thread that does nothing else.
fn heard_beside<T>(options: &IpcOptions, run: impl FnOnce() -> T) -> anyhow::Result<(T, Heard)> {
    let is_over = AtomicBool::new(false);
    let is_over = &is_over;
    let (opened, is_open) = channel();
    thread::scope(|scope| {
        let hear = |service| {
            let opened = opened.clone();
            scope.spawn(move || listen(options, service, opened, is_over))
        };
        let over = Ends(is_over);
        let [asked, answered] = [hear(plan_asked_event), hear(plan_answered_event)];
        drop(opened);
        let are_open = is_open.iter().take(2).count() == 2;
        let result = are_open.then(run);
        drop(over);
        let ended = |it: thread::ScopedJoinHandle<'_, anyhow::Result<Vec<i64>>>| {
            it.join().expect("a listener's thread does not panic")
        };
        let (asked_ns, answered_ns) = (ended(asked)?, ended(answered)?);
        let heard = Heard {
            asked_ns,
            answered_ns,
        };
        Ok((result.context("the events cannot be heard")?, heard))
    })
}

/// When each of a service's events was heard until all is over, ns.
fn listen(
    options: &IpcOptions,
    service: fn(&IpcNode) -> Result<EventService, IpcError>,
    opened: Sender<()>,
    is_over: &AtomicBool,
) -> anyhow::Result<Vec<i64>> {
    let node = IpcNode::create(options, "stamps")?;
    let listener = event_listener(&node, &service(&node)?)?;
    use_fifo_priority(PRIORITY)?;
    opened.send(())?;
    drop(opened);
    let mut all_ns = Vec::with_capacity(2 * REQUESTS);
    while !is_over.load(Ordering::Relaxed) {
        if listener.wait(None, LONGEST_SLEEP)? {
            all_ns.push(mono_now_ns());
        }
    }
    Ok(all_ns)
}
