//! `pcc record`: everything that the processes tell each other, as an MCAP file.

mod file;
mod picture;

use std::fmt::Debug;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use bytemuck::{Pod, bytes_of};
use clap::Args;
use iceoryx2::prelude::ZeroCopySend;
use shared_types::ipc::{self, IpcError, IpcNode, IpcOptions, Subscriber, Topic};
use shared_types::message::{Cycle, MotionResult, Payload, PlanRecord, RobotState};
use signal_hook::consts::{SIGINT, SIGTERM};

pub(crate) use self::file::{COUNTS, ENCODING};
use self::file::{McapFile, RealTime};
use self::picture::Picture;
use crate::number::real;

/// Time between two looks for messages: what waits longer in the shortest buffers is lost.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Time between two pictures of the scene.
const PICTURE_PERIOD: Duration = Duration::from_millis(40);
/// Time between two writes of what is in memory: at most so much is lost where the recorder is killed.
const FLUSH_PERIOD: Duration = Duration::from_millis(250);

/// Arguments of `pcc record`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The MCAP file to write; a file that is there is not replaced.
    file: PathBuf,
    /// End after so many seconds (until interrupted, if it is not given).
    #[arg(long, value_parser = real(0.0, 1e9, " s"))]
    seconds: Option<f64>,
}

/// Records the messages of a service.
struct TopicRecorder {
    name: &'static str,
    /// Whether a message that is lost makes the record worthless.
    is_needed: bool,
    /// Writes what has come; shows it to the picture.
    drain: Drain,
    /// Messages, and those that were lost before they were read, where their numbers tell.
    count: u64,
    lost: u64,
}

type Drain = Box<dyn FnMut(&mut McapFile, &mut Picture) -> anyhow::Result<Drained>>;

/// What has come, and what was lost.
#[derive(Clone, Copy, Default)]
struct Drained {
    count: u64,
    lost: u64,
}

/// Gaps in numbers that rise by one.
#[derive(Default)]
struct SequenceGaps {
    last: Option<u64>,
    lost: u64,
}

impl SequenceGaps {
    /// Notes a number; one that does not rise is of another sender.
    fn note(&mut self, number: u64) {
        let expected = self.last.map_or(number, |last| last + 1);
        self.lost += number.saturating_sub(expected);
        self.last = Some(number);
    }
}

/// Records until it is told to end; fails where plans, results of motions or cycles were lost.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let options = IpcOptions::from_env();
    let node = IpcNode::create(&options, "pcc-record")?;
    let mut file = McapFile::create(&arguments.file)?;
    let mut all = topic_recorders(&node, &mut file)?;
    let mut picture = Picture::new(&mut file)?;
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
    }
    let begun = Instant::now();
    let is_over = || {
        let is_late = |seconds| begun.elapsed().as_secs_f64() >= seconds;
        interrupted.load(Ordering::Relaxed) || arguments.seconds.is_some_and(is_late)
    };
    say!("recording into {}", arguments.file.display());
    let (mut drawn, mut flushed) = (begun, begun);
    while !is_over() {
        sleep(POLL_INTERVAL);
        drain(&mut all, &mut file, &mut picture)?;
        if drawn.elapsed() >= PICTURE_PERIOD {
            picture.write(&mut file)?;
            drawn = Instant::now();
        }
        if flushed.elapsed() >= FLUSH_PERIOD {
            file.flush()?;
            node.clean_dead_nodes();
            flushed = Instant::now();
        }
    }
    drain(&mut all, &mut file, &mut picture)?;
    file.finish()?;
    for recorded in all.iter().filter(|it| it.count > 0) {
        say!(
            "{:>9} {}, {} lost",
            recorded.count,
            recorded.name,
            recorded.lost
        );
    }
    let needed = all.iter().filter(|it| it.is_needed);
    let lost: u64 = needed.map(|it| it.lost).sum();
    anyhow::ensure!(
        lost == 0,
        "{lost} messages came faster than they were recorded"
    );
    Ok(())
}

fn drain(
    all: &mut [TopicRecorder],
    file: &mut McapFile,
    picture: &mut Picture,
) -> anyhow::Result<()> {
    for recorded in all {
        let Drained { count, lost } = (recorded.drain)(file, picture)?;
        recorded.count += count;
        recorded.lost = lost;
    }
    Ok(())
}

/// A recorder of each service.
fn topic_recorders(node: &IpcNode, file: &mut McapFile) -> anyhow::Result<Vec<TopicRecorder>> {
    let mut all = numbered(node, file)?;
    let see = Picture::see_controller;
    let state = topic(
        node,
        "controller_state",
        ipc::controller_state_service,
        file,
        None,
        see,
    )?;
    let see = Picture::see_robot;
    let robot = topic(
        node,
        "robot_description",
        ipc::robot_description_service,
        file,
        None,
        see,
    )?;
    let scene = topic(
        node,
        "scene",
        ipc::scene_service,
        file,
        None,
        Picture::see_scene,
    )?;
    let verdicts = topic(
        node,
        "scene_status",
        ipc::scene_status_service,
        file,
        None,
        unseen,
    )?;
    let goals = topic(node, "goal", ipc::goal_service, file, None, unseen)?;
    let kept = topic(
        node,
        "goal_status",
        ipc::goal_status_service,
        file,
        None,
        unseen,
    )?;
    let motions = topic(
        node,
        "trajectory",
        ipc::trajectory_service,
        file,
        None,
        unseen,
    )?;
    all.extend([state, robot, scene, verdicts, goals, kept, motions]);
    Ok(all)
}

/// Services whose messages have numbers. All are needed but the robot's states, of which 32 ms wait at 1 kHz.
fn numbered(node: &IpcNode, file: &mut McapFile) -> anyhow::Result<Vec<TopicRecorder>> {
    let number = Some((|it| it.sequence) as fn(&PlanRecord) -> u64);
    let plans = topic(
        node,
        "plan_record",
        ipc::plan_record_service,
        file,
        number,
        unseen,
    )?;
    let number = Some((|it| it.sequence) as fn(&MotionResult) -> u64);
    let results = topic(
        node,
        "motion_result",
        ipc::motion_result_service,
        file,
        number,
        unseen,
    )?;
    let number = Some((|it| it.sequence) as fn(&RobotState) -> u64);
    let states = topic(
        node,
        "robot_state",
        ipc::robot_state_service,
        file,
        number,
        unseen,
    )?;
    let states = TopicRecorder {
        is_needed: false,
        ..states
    };
    Ok(vec![plans, results, states, cycles(node, file)?])
}

/// What the picture does not show.
fn unseen<T>(_: &mut Picture, _: &T) {}

/// A service of single messages, whose numbers rise by one where there are any.
fn topic<T>(
    node: &IpcNode,
    name: &'static str,
    open: fn(&IpcNode) -> Result<Topic<T>, IpcError>,
    file: &mut McapFile,
    number: Option<fn(&T) -> u64>,
    see: impl Fn(&mut Picture, &T) + 'static,
) -> anyhow::Result<TopicRecorder>
where
    T: Pod + Payload + ZeroCopySend + Debug,
{
    let subscriber: Subscriber<T> = ipc::observer_subscriber(node, &open(node)?)?;
    let channel = file.channel(name, &T::LAYOUT)?;
    let mut gaps = SequenceGaps::default();
    let drain = move |file: &mut McapFile, picture: &mut Picture| {
        let mut count = 0;
        let received = || {
            subscriber
                .receive()
                .map_err(|error| anyhow!("{name}: {error:?}"))
        };
        while let Some(sample) = received()? {
            // Shared memory can change under a reader, so only the copy is read.
            let copy = *sample;
            file.write(channel, RealTime::now(), bytes_of(&copy))?;
            if let Some(number) = number {
                gaps.note(number(&copy));
            }
            see(picture, &copy);
            count += 1;
        }
        Ok(Drained {
            count,
            lost: gaps.lost,
        })
    };
    Ok(TopicRecorder::of(name, Box::new(drain)))
}

/// Every cycle of the loop.
fn cycles(node: &IpcNode, file: &mut McapFile) -> anyhow::Result<TopicRecorder> {
    let name = "cycle";
    let subscriber = ipc::subscriber(node, &ipc::cycle_service(node)?)?;
    let channel = file.channel(name, &<Cycle as Payload>::LAYOUT)?;
    let mut gaps = SequenceGaps::default();
    let drain = move |file: &mut McapFile, _: &mut Picture| {
        let mut count = 0;
        let received = || {
            subscriber
                .receive()
                .map_err(|error| anyhow!("{name}: {error:?}"))
        };
        while let Some(batch) = received()? {
            for cycle in batch.payload() {
                let copy = *cycle;
                file.write(channel, RealTime::of(copy.stamp_mono_ns), bytes_of(&copy))?;
                gaps.note(copy.sequence);
                count += 1;
            }
        }
        Ok(Drained {
            count,
            lost: gaps.lost,
        })
    };
    Ok(TopicRecorder::of(name, Box::new(drain)))
}

impl TopicRecorder {
    fn of(name: &'static str, drain: Drain) -> Self {
        Self {
            name,
            is_needed: true,
            drain,
            count: 0,
            lost: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_left_out_are_lost_and_another_sender_begins_anew() {
        let mut gaps = SequenceGaps::default();
        for number in [5, 6, 7, 10, 11, 1, 2, 4] {
            gaps.note(number);
        }
        assert_eq!(gaps.lost, 3);
    }
}
