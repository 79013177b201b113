//! The heartbeat thread and the cleaning thread, which no plan delays.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{Builder, sleep};
use std::time::Duration;

use iceoryx2::port::SendError;
use iceoryx2::port::update_connections::UpdateConnections;
use realtime::{RealtimeError, use_fifo_priority, use_idle_policy};
use shared_types::clock::mono_now_ns;
use shared_types::codes::ProcessKind;
use shared_types::ipc::{
    IpcError, IpcNode, IpcOptions, JoinOnDrop, Publisher, heartbeat_service, publisher,
    robot_description_service, spawn_with_ports,
};
use shared_types::message::{Heartbeat, RobotDescription};

use crate::live_scene::SceneMemoryError;

/// Time between two heartbeats.
const BEAT_PERIOD: Duration = Duration::from_millis(10);
/// Beats from one description of the robot to the next: 1 s.
const DESCRIBED_EVERY: u64 = 100;
/// Beats without progress of supervision after which the heart stops: 100 ms.
const STALL_BEATS: u32 = 10;
/// From the last progress of supervision to the last heartbeat, at most, nanoseconds.
pub(crate) const STALL_NS: i64 = STALL_BEATS as i64 * BEAT_PERIOD.as_nanos() as i64;

/// Why the background threads did not start.
#[derive(Debug, thiserror::Error)]
pub enum BackgroundError {
    /// The services are not available.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The system has no more threads.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] io::Error),
    /// The system takes a priority back that it granted.
    #[error(transparent)]
    Priority(#[from] RealtimeError),
    /// The file that keeps the live scene for the next daemon cannot be used.
    #[error(transparent)]
    SceneMemory(#[from] SceneMemoryError),
}

/// Detects that the count of the rounds of supervision stands still. Time is counted in heartbeats, so that a pause of the whole machine is no stall.
#[derive(Debug, Default)]
struct StallWatch {
    seen_rounds: u64,
    beats_without: u32,
}

impl StallWatch {
    /// Whether supervision goes on.
    fn sees(&mut self, supervision_rounds: &AtomicU64) -> bool {
        let rounds = supervision_rounds.load(Ordering::Relaxed);
        if rounds == self.seen_rounds {
            self.beats_without = self.beats_without.saturating_add(1);
        } else {
            (self.seen_rounds, self.beats_without) = (rounds, 0);
        }
        self.beats_without < STALL_BEATS
    }
}

/// The background threads; they end with this value.
pub(crate) struct BackgroundThreads {
    ended: Arc<AtomicBool>,
    threads: Vec<JoinOnDrop>,
}

impl BackgroundThreads {
    /// Starts both threads, each with a node of its own; the heart beats for the instance of the daemon that describes its robot, at a
    /// real-time priority if there is one.
    pub(crate) fn start(
        options: &IpcOptions,
        description: RobotDescription,
        supervision_rounds: &Arc<AtomicU64>,
        realtime_priority: Option<u8>,
    ) -> Result<Self, BackgroundError> {
        let mut background = Self {
            ended: Arc::default(),
            threads: Vec::new(),
        };
        let node = IpcNode::create(options, "planner-daemon heartbeat")?;
        let (supervision_rounds, ended) = (
            Arc::clone(supervision_rounds),
            Arc::clone(&background.ended),
        );
        let heart = spawn_with_ports(
            "heartbeat",
            move || Heart::open(&node, description, realtime_priority),
            move |mut heart| heart.beat_until(&supervision_rounds, &ended),
        )??;
        background.threads.push(heart.into());
        let node = IpcNode::create(options, "planner-daemon cleaning")?;
        let ended = Arc::clone(&background.ended);
        let cleaning = Builder::new().name("cleaning".to_owned());
        let cleaning = cleaning.spawn(move || clean(&node, &ended))?;
        background.threads.push(cleaning.into());
        Ok(background)
    }
}

impl Drop for BackgroundThreads {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

/// The heart: its ports, and what it says.
struct Heart {
    heartbeats: Publisher<Heartbeat>,
    descriptions: Publisher<RobotDescription>,
    description: RobotDescription,
    beats: u64,
    /// Whether the last heartbeat and the last description were not sent: each is logged once, until it is sent again.
    are_failing: [bool; 2],
}

impl Heart {
    fn open(
        node: &IpcNode,
        description: RobotDescription,
        realtime_priority: Option<u8>,
    ) -> Result<Self, BackgroundError> {
        if let Some(priority) = realtime_priority {
            use_fifo_priority(priority)?;
        }
        Ok(Self {
            heartbeats: publisher(node, &heartbeat_service(node)?)?,
            descriptions: publisher(node, &robot_description_service(node)?)?,
            description,
            beats: 0,
            are_failing: [false; 2],
        })
    }

    fn beat_until(&mut self, supervision_rounds: &AtomicU64, ended: &AtomicBool) {
        let mut stall_watch = StallWatch::default();
        while !ended.load(Ordering::Relaxed) {
            if stall_watch.sees(supervision_rounds) {
                self.beat();
            }
            sleep(BEAT_PERIOD);
        }
    }

    fn beat(&mut self) {
        self.beats += 1;
        let stamp_mono_ns = mono_now_ns();
        let beat = self.heartbeats.send_copy(Heartbeat {
            stamp_mono_ns,
            instance: self.description.instance,
            sequence: self.beats,
            kind: ProcessKind::Daemon.code(),
            pid: std::process::id(),
        });
        note_sent("heartbeat", &beat, &mut self.are_failing[0]);
        if self.beats % DESCRIBED_EVERY == 1 {
            self.description.stamp_mono_ns = stamp_mono_ns;
            let described = self.descriptions.send_copy(self.description);
            note_sent("robot description", &described, &mut self.are_failing[1]);
        } else {
            // Who comes late gets the last one.
            let _ = self.descriptions.update_connections();
        }
    }
}

/// Logs what was not sent, unless that failed the last time, too.
fn note_sent(what: &str, sent: &Result<usize, SendError>, is_failing: &mut bool) {
    if let Err(error) = sent
        && !*is_failing
    {
        tracing::warn!("a {what} was not sent: {error:?}");
    }
    *is_failing = sent.is_err();
}

/// Removes what dead processes leave, while nobody else wants the processor.
fn clean(node: &IpcNode, ended: &AtomicBool) {
    if let Err(error) = use_idle_policy() {
        tracing::warn!("answers may be some milliseconds late now and then: {error}");
    }
    node.keep_clean(
        || ended.load(Ordering::Relaxed),
        |removed| tracing::info!("cleaned up after {removed} dead nodes"),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heart_stops_when_supervision_does_and_beats_again_when_it_goes_on() {
        let (supervision_rounds, mut stall_watch) = (AtomicU64::new(0), StallWatch::default());
        supervision_rounds.fetch_add(1, Ordering::Relaxed);
        assert!((0..STALL_BEATS).all(|_| stall_watch.sees(&supervision_rounds)));
        assert!(!stall_watch.sees(&supervision_rounds));
        supervision_rounds.fetch_add(1, Ordering::Relaxed);
        assert!(stall_watch.sees(&supervision_rounds));
    }
}
