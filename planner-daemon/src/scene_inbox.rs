//! Scenes as they arrive: the newest of each publisher, taken in turn, however many there are.

use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::PROTOCOL_VERSION;
use shared_types::codes::SceneRefusal;
use shared_types::ipc::{
    IpcError, IpcNode, Publisher, Subscriber, Topic, publisher, scene_service,
    scene_status_service, subscriber,
};
use shared_types::message::{SceneMessage, SceneStatus};

use crate::live_scene::Judged;

/// Scenes that are received before those that wait are looked at.
const MOST_RECEIVED: usize = 16;
/// A publisher's next scene is looked at after so many times what the last one took, so that it has a quarter of the thread's time at
/// most,
const REST_FACTOR: i64 = 3;
/// ... but no later than after this, nanoseconds.
const MOST_REST_NS: i64 = 10_000_000;
/// Time after the start within which publishers that were there before hand on their last scenes: they look for a new daemon every
/// 5 ms. Who has said nothing by then has nothing to tell.
const HANDED_ON_WITHIN: Duration = Duration::from_millis(500);

/// The newest scene of a publisher.
struct Waiting {
    publisher: u128,
    scene: Box<SceneMessage>,
    /// It was not looked at yet.
    is_new: bool,
    /// When it may be looked at, nanoseconds.
    not_before_mono_ns: i64,
    /// What was said of the last one, and logged.
    said: SceneRefusal,
}

/// The port to `scene`, what has arrived, and the port that says what became of it.
pub(crate) struct SceneInbox {
    topic: Topic<SceneMessage>,
    scenes: Subscriber<SceneMessage>,
    statuses: Publisher<SceneStatus>,
    waiting: Vec<Waiting>,
    /// Publishers that were there before this, and have not been heard yet: each hands its last scene on, if it has sent any.
    unheard: Vec<u128>,
    opened: Instant,
}

impl SceneInbox {
    /// Publishers that are listened to at once: twice as many as can live at once.
    pub(crate) const PUBLISHERS: usize = 8;

    /// Opens the services and makes the ports.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(crate) fn open(node: &IpcNode) -> Result<Self, IpcError> {
        let topic = scene_service(node)?;
        // Before the list is made: who joins later finds it.
        let scenes = subscriber(node, &topic)?;
        Ok(Self {
            scenes,
            unheard: topic.publisher_ids(),
            opened: Instant::now(),
            topic,
            statuses: publisher(node, &scene_status_service(node)?)?,
            waiting: Vec::with_capacity(Self::PUBLISHERS),
        })
    }

    /// The place of the publisher whose scene is to be looked at now, that with the fewest balls first.
    pub(crate) fn next(&self, now_mono_ns: i64) -> Option<usize> {
        let due = |waiting: &Waiting| waiting.is_new && now_mono_ns >= waiting.not_before_mono_ns;
        let due = self.waiting.iter().enumerate().filter(|(_, w)| due(w));
        let smallest = due.min_by_key(|(_, waiting)| waiting.scene.ball_count);
        smallest.map(|(index, _)| index)
    }

    /// Whether a publisher that was there before this may still hand on what it has told of.
    pub(crate) fn awaits_scenes(&mut self) -> bool {
        let topic = &self.topic;
        self.unheard
            .retain(|publisher| topic.has_publisher(*publisher));
        !self.unheard.is_empty() && self.opened.elapsed() < HANDED_ON_WITHIN
    }

    /// Whether a scene of this publisher has arrived that was not looked at yet.
    pub(crate) fn has_new(&self, publisher: u128) -> bool {
        let mut waiting = self.waiting.iter();
        waiting.any(|waiting| waiting.publisher == publisher && waiting.is_new)
    }

    /// Takes in what has arrived.
    pub(crate) fn receive(&mut self) {
        for _ in 0..MOST_RECEIVED {
            let Ok(Some(sample)) = self.scenes.receive() else {
                return;
            };
            let publisher = sample.origin().value();
            self.unheard.retain(|unheard| *unheard != publisher);
            match self.waiting.iter_mut().find(|w| w.publisher == publisher) {
                Some(waiting) => {
                    *waiting.scene = *sample;
                    waiting.is_new = true;
                }
                None => self.welcome(publisher, &sample),
            }
        }
    }

    /// A publisher that was not heard before; it takes the place of one that has had nothing to say, where there are too many.
    fn welcome(&mut self, publisher: u128, scene: &SceneMessage) {
        if self.waiting.len() == Self::PUBLISHERS {
            let Some(idle) = self.waiting.iter().position(|waiting| !waiting.is_new) else {
                // It comes again, or the publishers before it are looked at first.
                return;
            };
            self.waiting.remove(idle);
        }
        self.waiting.push(Waiting {
            publisher,
            scene: Box::new(*scene),
            is_new: true,
            not_before_mono_ns: i64::MIN,
            said: SceneRefusal::None,
        });
    }

    /// Has a publisher's scene judged, and says what became of it, to the publisher too.
    pub(crate) fn judge(
        &mut self,
        index: usize,
        now_mono_ns: i64,
        judge: impl FnOnce(&SceneMessage, u128, &dyn Fn(u128) -> bool) -> Judged,
    ) {
        let waiting = &mut self.waiting[index];
        waiting.is_new = false;
        let scene = &waiting.scene;
        let there = |publisher| self.topic.has_publisher(publisher);
        let judged = judge(scene, waiting.publisher, &there);
        let status = SceneStatus {
            stamp_mono_ns: now_mono_ns,
            scene_stamp_mono_ns: scene.stamp_mono_ns,
            source: scene.source,
            sequence: scene.sequence,
            protocol_version: PROTOCOL_VERSION,
            refusal: judged.refusal.code(),
            ball_count: judged.balls as u32,
        };
        // Who has only just come hears of what it has sent before.
        let _ = self.statuses.update_connections();
        if let Err(error) = self.statuses.send_copy(status) {
            tracing::debug!("what became of a scene could not be said: {error:?}");
        }
        if judged.refusal != SceneRefusal::None && waiting.said != judged.refusal {
            let name = String::from_utf8_lossy(&scene.source);
            let name = name.trim_end_matches('\0');
            let detail = judged.invalid.map(|invalid| format!(" ({invalid})"));
            let detail = detail.unwrap_or_default();
            let refusal = judged.refusal;
            tracing::warn!("a scene of source {name:?} is refused: {refusal}{detail}");
        }
        waiting.said = judged.refusal;
    }

    /// Says how long the work on a publisher's scene took: its next one waits in proportion.
    pub(crate) fn has_cost(&mut self, index: usize, begun_mono_ns: i64, ended_mono_ns: i64) {
        let rest_ns = (REST_FACTOR * (ended_mono_ns - begun_mono_ns)).min(MOST_REST_NS);
        self.waiting[index].not_before_mono_ns = ended_mono_ns + rest_ns;
    }
}
