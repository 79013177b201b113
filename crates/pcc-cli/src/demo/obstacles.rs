//! The demonstration as a source of live scenes: it publishes its obstacles again and again while it runs, and signs off in the end,
//! however it ends.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use client::{ClientError, ScenePublisher};
use shared_types::codes::SceneRefusal;
use shared_types::ipc::{IpcOptions, JoinOnDrop};
use shared_types::message::MovingBall;

/// The name of the source.
const SOURCE: &str = "pcc demo";
/// How long a scene counts: should the demonstration be killed, the daemon stops the robot after that.
const LIFETIME: Duration = Duration::from_secs(5);
/// Interval at which the scene is published again.
const RENEWAL: Duration = Duration::from_secs(1);
/// How long a scene with something that moves counts; it is published again by who moves it.
const MOVING_LIFETIME: Duration = Duration::from_millis(100);
/// Longest wait for the daemon's confirmation of a scene.
const TIMEOUT: Duration = Duration::from_secs(5);

/// The obstacles that are shown, published again by a thread of its own; when dropped, the source signs off.
pub(super) struct Obstacles {
    shown: Arc<Mutex<Shown>>,
    /// The renewal ends once this is dropped: declared before its thread, which is joined when it is dropped, because fields are dropped
    /// in the order of their declaration.
    _quit: Sender<()>,
    _renewal: JoinOnDrop,
}

struct Shown {
    publisher: ScenePublisher,
    /// The obstacles; none before the first scene, and after signing off.
    balls: Option<Vec<MovingBall>>,
    /// Whether they stay where they are, and are published again.
    is_renewed: bool,
    /// The first error of publishing a scene again.
    failed: Option<ClientError>,
}

impl Obstacles {
    /// Joins the services; nothing is shown yet.
    pub(super) fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        let shown = Arc::new(Mutex::new(Shown {
            publisher: ScenePublisher::connect(options, SOURCE)?,
            balls: None,
            is_renewed: true,
            failed: None,
        }));
        let (quit, ended) = channel();
        let renewed = Arc::clone(&shown);
        let renewal = std::thread::spawn(move || renew(&renewed, &ended));
        Ok(Self {
            shown,
            _quit: quit,
            _renewal: renewal.into(),
        })
    }

    /// Shows `balls` in place of those before, from now on, and waits until the daemon has taken them in.
    pub(super) fn show(&self, balls: &[MovingBall]) -> Result<(), ClientError> {
        let mut shown = locked(&self.shown);
        if let Some(failed) = shown.failed.take() {
            return Err(failed);
        }
        shown.balls = Some(balls.to_vec());
        shown.is_renewed = true;
        shown.publisher.publish(balls, LIFETIME)?;
        shown.publisher.confirm(TIMEOUT)
    }

    /// Shows where balls are that move, in place of those before, at a time in nanoseconds of `CLOCK_MONOTONIC`; to be called again
    /// within [`MOVING_LIFETIME`], until `show` is. What a stalled machine sends too late does not count, and is no error.
    pub(super) fn move_to(
        &self,
        stamp_mono_ns: i64,
        balls: &[MovingBall],
    ) -> Result<(), ClientError> {
        let mut shown = locked(&self.shown);
        shown.balls = Some(balls.to_vec());
        shown.is_renewed = false;
        let sent = shown
            .publisher
            .publish_stamped(stamp_mono_ns, balls, MOVING_LIFETIME);
        match sent {
            Err(ClientError::SceneRefused {
                refusal: SceneRefusal::TooOld,
                ..
            }) => Ok(()),
            sent => sent,
        }
    }

    /// Removes the obstacles and signs the source off; does nothing where nothing is shown.
    pub(super) fn take_leave(&self) -> Result<(), ClientError> {
        let mut shown = locked(&self.shown);
        if shown.balls.take().is_none() {
            return Ok(());
        }
        shown.publisher.take_leave()?;
        shown.publisher.confirm(TIMEOUT)
    }
}

impl Drop for Obstacles {
    fn drop(&mut self) {
        // The renewal's thread still runs: it publishes nothing more, since leaving takes the obstacles away under the lock.
        // A caller that needs the error calls this before.
        let _ = self.take_leave();
    }
}

fn renew(shown: &Mutex<Shown>, ended: &Receiver<()>) {
    while ended.recv_timeout(RENEWAL) == Err(RecvTimeoutError::Timeout) {
        let shown = &mut *locked(shown);
        if let Some(balls) = &shown.balls
            && shown.is_renewed
            && let Err(error) = shown.publisher.publish(balls, LIFETIME)
        {
            shown.failed.get_or_insert(error);
        }
    }
}

fn locked(shown: &Mutex<Shown>) -> MutexGuard<'_, Shown> {
    shown.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_types::PROTOCOL_VERSION;
    use shared_types::ipc::{
        IpcNode, Publisher, Subscriber, publisher, scene_service, scene_status_service, subscriber,
    };
    use shared_types::message::{SceneMessage, SceneStatus};

    /// What a daemon does with scenes.
    struct PlayedDaemon {
        scenes: Subscriber<SceneMessage>,
        statuses: Publisher<SceneStatus>,
        _node: IpcNode,
    }

    impl PlayedDaemon {
        fn start(options: &IpcOptions) -> Self {
            let node = IpcNode::create(options, "daemon").unwrap();
            Self {
                scenes: subscriber(&node, &scene_service(&node).unwrap()).unwrap(),
                statuses: publisher(&node, &scene_status_service(&node).unwrap()).unwrap(),
                _node: node,
            }
        }

        /// Takes every scene in until one is a leave; their lifetimes, ns.
        fn serve(&self) -> Vec<i64> {
            let mut lifetimes = Vec::new();
            loop {
                let Some(scene) = self.scenes.receive().unwrap() else {
                    std::thread::sleep(Duration::from_millis(1));
                    continue;
                };
                let status = SceneStatus {
                    scene_stamp_mono_ns: scene.stamp_mono_ns,
                    source: scene.source,
                    sequence: scene.sequence,
                    protocol_version: PROTOCOL_VERSION,
                    ..SceneStatus::ZEROED
                };
                self.statuses.send_copy(status).unwrap();
                if scene.takes_leave == 1 {
                    return lifetimes;
                }
                lifetimes.push(scene.lifetime_ns);
            }
        }
    }

    #[test]
    fn obstacles_are_told_again_with_a_short_lifetime_and_signed_off_when_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let options = IpcOptions {
            prefix: "demo".to_owned(),
            root: folder.path().join("root"),
        };
        let served = options.clone();
        let daemon = std::thread::spawn(move || PlayedDaemon::start(&served).serve());
        let obstacles = Obstacles::connect(&options).unwrap();
        obstacles.show(&[]).unwrap();
        std::thread::sleep(2 * RENEWAL);
        drop(obstacles);
        let lifetimes = daemon.join().unwrap();
        assert!(lifetimes.len() > 1, "told once: {lifetimes:?}");
        let wanted = LIFETIME.as_nanos() as i64;
        assert!(lifetimes.iter().all(|lifetime| *lifetime == wanted));
    }
}
