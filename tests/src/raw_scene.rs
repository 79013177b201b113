//! Sources of live scenes that send whatever they are told to, as fast as they are told to.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use iceoryx2::port::update_connections::UpdateConnections;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::PROTOCOL_VERSION;
use shared_types::capacity::MAX_SCENE_BALLS;
use shared_types::clock::mono_now_ns;
use shared_types::codes::SceneRefusal;
use shared_types::ipc::{
    IpcNode, IpcOptions, Publisher, Subscriber, publisher, scene_service, scene_status_service,
    subscriber,
};
use shared_types::message::{MovingBall, SceneMessage, SceneStatus};
use shared_types::valid::SourceName;

use crate::process::{TimedOut, wait_for};

/// A port on `scene` without any check; dropped, it is as dead as a killed publisher: it takes no leave.
#[derive(Debug)]
pub struct RawScenes {
    scenes: Publisher<SceneMessage>,
    statuses: Subscriber<SceneStatus>,
    source: SourceName,
    sequence: u32,
    _node: IpcNode,
}

impl RawScenes {
    /// Joins the services under a source's name.
    #[must_use]
    pub fn connect(options: &IpcOptions, source: &str) -> Self {
        let node = IpcNode::create(options, "raw-scenes").unwrap();
        Self {
            statuses: subscriber(&node, &scene_status_service(&node).unwrap()).unwrap(),
            scenes: publisher(&node, &scene_service(&node).unwrap()).unwrap(),
            source: SourceName::new(source).unwrap(),
            sequence: 0,
            _node: node,
        }
    }

    /// Sends balls with this stamp and lifetime; returns the scene's sequence.
    pub fn send(&mut self, stamp_mono_ns: i64, lifetime_ns: i64, balls: &[MovingBall]) -> u32 {
        self.sequence += 1;
        let mut sample = self.scenes.loan().unwrap();
        let wire = sample.payload_mut();
        wire.stamp_mono_ns = stamp_mono_ns;
        wire.lifetime_ns = lifetime_ns;
        wire.source = self.source.to_wire();
        wire.sequence = self.sequence;
        wire.protocol_version = PROTOCOL_VERSION;
        wire.ball_count = u32::try_from(balls.len()).unwrap();
        wire.takes_leave = 0;
        wire.balls[..balls.len()].copy_from_slice(balls);
        sample.send().unwrap();
        self.sequence
    }

    /// What the daemon says of a scene, waited for.
    ///
    /// # Errors
    /// [`TimedOut`] if it says nothing.
    pub fn verdict(&self, sequence: u32, limit: Duration) -> Result<SceneRefusal, TimedOut> {
        wait_for("the daemon judges a scene", limit, || {
            let _ = self.scenes.update_connections();
            while let Ok(Some(sample)) = self.statuses.receive() {
                if sample.source == self.source.to_wire() && sample.sequence == sequence {
                    return SceneRefusal::try_from(sample.refusal).ok();
                }
            }
            None
        })
    }
}

/// Publishers that send full scenes as fast as they can, each in a thread of its own, until dropped.
#[derive(Debug)]
pub struct Flood {
    quit: Arc<AtomicBool>,
    /// Of each publisher.
    sent: Arc<[AtomicU64]>,
    threads: Vec<JoinHandle<()>>,
}

impl Flood {
    /// Starts them; their balls are out of the robot's way, and every scene is another one.
    #[must_use]
    pub fn start(options: &IpcOptions, publishers: usize) -> Self {
        let quit = Arc::<AtomicBool>::default();
        let sent: Arc<[AtomicU64]> = (0..publishers).map(|_| AtomicU64::new(0)).collect();
        let threads = (0..publishers).map(|index| {
            let (options, quit, sent) = (options.clone(), Arc::clone(&quit), Arc::clone(&sent));
            thread::spawn(move || {
                let mut scenes = RawScenes::connect(&options, &format!("flood {index}"));
                let mut rng = Pcg64::seed_from_u64(index as u64);
                let mut balls = harmless_balls(&mut rng);
                while !quit.load(Ordering::Relaxed) {
                    let changed = rng.random_range(0..balls.len());
                    balls[changed].radius_m = rng.random_range(0.04..0.05);
                    scenes.send(mono_now_ns(), 60_000_000_000, &balls);
                    sent[index].fetch_add(1, Ordering::Relaxed);
                }
            })
        });
        let threads = threads.collect();
        Self {
            quit,
            sent,
            threads,
        }
    }

    /// Scenes sent so far.
    #[must_use]
    pub fn sent(&self) -> u64 {
        self.sent_each().iter().sum()
    }

    /// Scenes that each publisher has sent so far.
    #[must_use]
    pub fn sent_each(&self) -> Vec<u64> {
        let sent = self.sent.iter();
        sent.map(|count| count.load(Ordering::Relaxed)).collect()
    }

    /// Publishers whose threads still run: one that could not send has panicked.
    #[must_use]
    pub fn alive(&self) -> usize {
        let ended = |thread: &&JoinHandle<()>| !thread.is_finished();
        self.threads.iter().filter(ended).count()
    }
}

impl Drop for Flood {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Balls that no motion of the tests meets: three of four rest in a ring beyond its reach; the fourth moves within its reach, below
/// the plane of its base, so that it has to be certified.
fn harmless_balls(rng: &mut Pcg64) -> Vec<MovingBall> {
    let ball = |index| {
        let moves = index % 4 == 0;
        let (distances, heights) = if moves {
            (0.2..1.0, -3.0..-2.4)
        } else {
            (3.6..5.0, 0.0..2.0)
        };
        let [place, course]: [f64; 2] = rng.random();
        let (place, course) = (place * TAU, course * TAU);
        let distance = rng.random_range(distances);
        // Over the scenes' minute it stays below the base.
        let speed_m_s = if moves { 0.005 } else { 0.0 };
        MovingBall {
            centre_m: [
                distance * place.cos(),
                distance * place.sin(),
                rng.random_range(heights),
            ],
            radius_m: 0.05,
            velocity_m_s: [speed_m_s * course.cos(), speed_m_s * course.sin(), 0.0],
        }
    };
    (0..MAX_SCENE_BALLS).map(ball).collect()
}
