//! In the daemon's place: a heart that beats, and trajectories that nobody has checked.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::codes::ProcessKind;
use shared_types::ipc::{
    IpcError, IpcNode, IpcOptions, Publisher, heartbeat_service, publisher, trajectory_service,
};
use shared_types::message::{Heartbeat, Knot, TrajectoryMessage};

/// Its instance, by which trajectories and heartbeats name it.
const INSTANCE: u64 = 4711;
/// Time between two heartbeats.
const BEAT: Duration = Duration::from_millis(10);
/// From the sending of a motion to its begin, ns.
const AHEAD_NS: i64 = 50_000_000;

/// The port on `trajectory`, and the heart's thread; ends when dropped.
#[derive(Debug)]
pub struct RawDaemon {
    trajectories: Publisher<TrajectoryMessage>,
    robot_hash: u64,
    last_id: u32,
    quit: Arc<AtomicBool>,
    heart: Option<JoinHandle<Result<(), IpcError>>>,
    _node: IpcNode,
}

impl RawDaemon {
    /// Joins the services of a world in which no daemon runs, as one of the robot with this hash.
    ///
    /// # Errors
    /// [`IpcError::Full`] where one does.
    pub fn connect(options: &IpcOptions, robot_hash: u64) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "raw-daemon")?;
        let (quit, options) = (Arc::<AtomicBool>::default(), options.clone());
        let stop = Arc::clone(&quit);
        Ok(Self {
            trajectories: publisher(&node, &trajectory_service(&node)?)?,
            robot_hash,
            last_id: 0,
            quit,
            heart: Some(thread::spawn(move || beat(&options, &stop))),
            _node: node,
        })
    }

    /// Sends a motion from rest to rest in `seconds`, for one controller, with this path tolerance, rad; returns its id.
    pub fn send(
        &mut self,
        controller_instance: u64,
        [from, to]: [[f64; 6]; 2],
        seconds: f64,
        path_tolerance_rad: f64,
    ) -> u32 {
        self.last_id += 1;
        let mut message = TrajectoryMessage {
            protocol_version: PROTOCOL_VERSION,
            trajectory_id: self.last_id,
            plan_id: u64::from(self.last_id),
            controller_instance,
            daemon_instance: INSTANCE,
            robot_hash: self.robot_hash,
            requested_mono_ns: mono_now_ns(),
            begin_mono_ns: mono_now_ns() + AHEAD_NS,
            knot_count: 2,
            path_tolerance_rad,
            ..TrajectoryMessage::ZEROED
        };
        for (knot, (time_s, configuration_rad)) in
            message.knots.iter_mut().zip([(0.0, from), (seconds, to)])
        {
            *knot = Knot {
                time_s,
                configuration_rad,
                ..Knot::ZEROED
            };
        }
        self.trajectories.send_copy(message).unwrap();
        self.last_id
    }
}

impl Drop for RawDaemon {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        if let Some(heart) = self.heart.take() {
            let _ = heart.join();
        }
    }
}

fn beat(options: &IpcOptions, quit: &AtomicBool) -> Result<(), IpcError> {
    let node = IpcNode::create(options, "raw-heart")?;
    let heart = publisher(&node, &heartbeat_service(&node)?)?;
    for sequence in 1.. {
        if quit.load(Ordering::Relaxed) {
            break;
        }
        let beat = Heartbeat {
            stamp_mono_ns: mono_now_ns(),
            instance: INSTANCE,
            sequence,
            kind: ProcessKind::Daemon.code(),
            pid: std::process::id(),
        };
        heart.send_copy(beat).unwrap();
        thread::sleep(BEAT);
    }
    Ok(())
}
