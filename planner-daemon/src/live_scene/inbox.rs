//! Arriving scenes: the newest of each publisher, examined in a fair order.

use std::mem;

use iceoryx2::port::ReceiveError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use shared_types::PROTOCOL_VERSION;
use shared_types::capacity::SOURCE_NAME_BYTES;
use shared_types::clock::mono_now_ns;
use shared_types::codes::SceneRefusal;
use shared_types::ipc::{
    IpcError, IpcNode, PresentPublisher, Publisher, Subscriber, Topic, publisher, scene_service,
    scene_status_service, subscriber,
};
use shared_types::message::{SceneMessage, SceneStatus};
use shared_types::valid::SourceName;

use super::scene_memory::MAX_SOURCES;
use super::verdict::SceneVerdict;

/// A publisher's next scene is examined after this many times the duration of its last one, so that it gets a quarter of the thread's
/// time at most.
const IDLE_FACTOR: i64 = 3;
/// Longest delay of a publisher's next scene on account of its last one, nanoseconds.
const MAX_IDLE_NS: i64 = 10_000_000;
/// Time until a scene without a verdict is examined again, nanoseconds.
const RETRY_NS: i64 = 10_000_000;

/// A scene that has waited for this long goes before smaller ones, nanoseconds.
const MAX_WAIT_NS: i64 = 20_000_000;
/// For how long a scene that waits to be looked at keeps its source from being missed when the last scene's lifetime ends, nanoseconds.
const PENDING_GRACE_NS: i64 = 100_000_000;

/// The newest scene of a publisher.
struct PendingScene {
    publisher: u128,
    scene: Box<SceneMessage>,
    /// Since when a scene waits to be looked at, nanoseconds; a newer one in its place has waited as long. None: it was looked at.
    new_since_mono_ns: Option<i64>,
    /// When the scene may be looked at, nanoseconds.
    not_before_mono_ns: i64,
    /// A scene that came under another name while this one waited: both names are of one publisher, which is refused for it.
    other: Option<SceneId>,
    /// The last verdict that was published and logged.
    said: SceneRefusal,
}

/// What identifies a scene to its publisher.
#[derive(Clone, Copy)]
struct SceneId {
    source: [u8; SOURCE_NAME_BYTES],
    sequence: u32,
    stamp_mono_ns: i64,
}

impl SceneId {
    fn of(scene: &SceneMessage) -> Self {
        Self {
            source: scene.source,
            sequence: scene.sequence,
            stamp_mono_ns: scene.stamp_mono_ns,
        }
    }
}

/// The port to `scene`, what has arrived, and the port that says what became of it.
pub(crate) struct SceneInbox {
    topic: Topic<SceneMessage>,
    scenes: Subscriber<SceneMessage>,
    /// Samples received in this call; kept for its allocation.
    received: Vec<Sample<ipc::Service, SceneMessage, ()>>,
    statuses: Publisher<SceneStatus>,
    waiting: Vec<PendingScene>,
    present: Vec<PresentPublisher>,
    receiving_fails: bool,
}

impl SceneInbox {
    /// Opens the services and makes the ports.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(crate) fn open(node: &IpcNode) -> Result<Self, IpcError> {
        let topic = scene_service(node)?;
        Ok(Self {
            scenes: subscriber(node, &topic)?,
            topic,
            received: Vec::new(),
            statuses: publisher(node, &scene_status_service(node)?)?,
            waiting: Vec::with_capacity(MAX_SOURCES),
            present: Vec::new(),
            receiving_fails: false,
        })
    }

    /// The publishers listed now, those that have sent nothing and those that cannot be received included.
    pub(crate) fn present(&mut self) -> &[PresentPublisher] {
        self.topic.list_publishers(&mut self.present);
        &self.present
    }

    /// Index of the publisher whose scene is to be looked at now: of those that have waited too long the first, else that with the
    /// fewest balls.
    pub(crate) fn next(&self, now_mono_ns: i64) -> Option<usize> {
        next(&self.waiting, now_mono_ns)
    }

    /// Whether a scene of this publisher has waited to be looked at for less than 100 ms.
    pub(crate) fn has_pending(&self, publisher: u128, now_mono_ns: i64) -> bool {
        let mut waiting = self.waiting.iter().filter(|w| w.publisher == publisher);
        let since = waiting.find_map(|waiting| waiting.new_since_mono_ns);
        since.is_some_and(|since| now_mono_ns - since < PENDING_GRACE_NS)
    }

    /// Takes in what has arrived, only once all is received: as long as two of a publisher's scenes are held, iceoryx2 passes over that
    /// publisher's others, so that a flooding publisher cannot keep out later ones, and the call ends.
    pub(crate) fn receive(&mut self) {
        let error = loop {
            match self.scenes.receive() {
                Ok(Some(sample)) => self.received.push(sample),
                Ok(None) | Err(ReceiveError::ExceedsMaxBorrows) => break None,
                Err(error) => break Some(error),
            }
        };
        if let Some(error) = &error
            && !self.receiving_fails
        {
            tracing::warn!("a publisher of scenes cannot be heard: {error:?}");
        }
        self.receiving_fails = error.is_some();
        let now = mono_now_ns();
        let mut received = mem::take(&mut self.received);
        for sample in received.drain(..) {
            self.keep(sample.origin().value(), &sample, now);
        }
        self.received = received;
    }

    /// Puts a scene in the place of its publisher's last one; not of one that was not looked at yet and is another source's.
    fn keep(&mut self, publisher: u128, scene: &SceneMessage, now_mono_ns: i64) {
        match self.waiting.iter_mut().find(|w| w.publisher == publisher) {
            Some(waiting)
                if waiting.new_since_mono_ns.is_some()
                    && waiting.scene.source != scene.source
                    && SourceName::try_from(&scene.source).is_ok() =>
            {
                waiting.other = Some(SceneId::of(scene));
            }
            Some(waiting) => {
                *waiting.scene = *scene;
                waiting.new_since_mono_ns.get_or_insert(now_mono_ns);
            }
            None => self.add_publisher(publisher, scene, now_mono_ns),
        }
    }

    /// Adds a new publisher, in place of an idle one where there are as many as are kept.
    fn add_publisher(&mut self, publisher: u128, scene: &SceneMessage, now_mono_ns: i64) {
        if self.waiting.len() == MAX_SOURCES {
            let is_idle = |waiting: &PendingScene| waiting.new_since_mono_ns.is_none();
            let Some(idle) = self.waiting.iter().position(is_idle) else {
                // It comes again, or the publishers before it are looked at first.
                return;
            };
            self.waiting.remove(idle);
        }
        self.waiting.push(PendingScene {
            publisher,
            scene: Box::new(*scene),
            new_since_mono_ns: Some(now_mono_ns),
            not_before_mono_ns: i64::MIN,
            other: None,
            said: SceneRefusal::None,
        });
    }

    /// The publisher whose scene is at an index, and whether it has sent one under another name meanwhile.
    pub(crate) fn publisher_of(&self, index: usize) -> (u128, bool) {
        let waiting = &self.waiting[index];
        (waiting.publisher, waiting.other.is_some())
    }

    /// Examines a publisher's scene with `judge` and publishes the verdict; without one (none) the scene is examined again after 10 ms.
    pub(crate) fn judge(
        &mut self,
        index: usize,
        now_mono_ns: i64,
        judge: impl FnOnce(&SceneMessage, u128) -> Option<SceneVerdict>,
    ) {
        let waiting = &mut self.waiting[index];
        let judged = judge(&waiting.scene, waiting.publisher);
        let Some(judged) = judged else {
            waiting.not_before_mono_ns = now_mono_ns + RETRY_NS;
            return;
        };
        waiting.new_since_mono_ns = None;
        let (head, other) = (SceneId::of(&waiting.scene), waiting.other.take());
        self.say(index, &head, &judged, now_mono_ns);
        if let Some(other) = other {
            let refused = SceneVerdict::refused(SceneRefusal::SeveralNames, None);
            self.say(index, &other, &refused, now_mono_ns);
        }
    }

    /// Publishes the verdict on a scene, and logs a refusal where it differs from the last one.
    fn say(&mut self, index: usize, scene: &SceneId, judged: &SceneVerdict, now_mono_ns: i64) {
        let status = SceneStatus {
            stamp_mono_ns: now_mono_ns,
            scene_stamp_mono_ns: scene.stamp_mono_ns,
            source: scene.source,
            sequence: scene.sequence,
            protocol_version: PROTOCOL_VERSION,
            refusal: judged.refusal.code(),
            ball_count: judged.balls as u32,
            reason: judged.reason(),
        };
        // Who has only just come hears of what it has sent before.
        let _ = self.statuses.update_connections();
        if let Err(error) = self.statuses.send_copy(status) {
            tracing::debug!("what became of a scene could not be said: {error:?}");
        }
        let waiting = &mut self.waiting[index];
        if judged.refusal != SceneRefusal::None && waiting.said != judged.refusal {
            let name = String::from_utf8_lossy(&scene.source);
            let name = name.trim_end_matches('\0');
            tracing::warn!("a scene of source {name:?} is refused: {}", status.reason);
        }
        // Who sends under two names would be told of again and again.
        if waiting.said != SceneRefusal::SeveralNames {
            waiting.said = judged.refusal;
        }
    }

    /// Delays a publisher's next scene in proportion to the time that its last one took.
    pub(crate) fn throttle(&mut self, index: usize, begun_mono_ns: i64, ended_mono_ns: i64) {
        let rest_ns = (IDLE_FACTOR * (ended_mono_ns - begun_mono_ns)).min(MAX_IDLE_NS);
        let waiting = &mut self.waiting[index];
        waiting.not_before_mono_ns = waiting.not_before_mono_ns.max(ended_mono_ns + rest_ns);
    }
}

/// Index of the scene to be looked at now: of those that have waited too long the first, else that with the fewest balls.
fn next(waiting: &[PendingScene], now_mono_ns: i64) -> Option<usize> {
    let rank = |waiting: &PendingScene| {
        let since = waiting.new_since_mono_ns?;
        let is_late = now_mono_ns - since >= MAX_WAIT_NS;
        let rank = if is_late {
            since
        } else {
            i64::from(waiting.scene.ball_count)
        };
        (now_mono_ns >= waiting.not_before_mono_ns).then_some((!is_late, rank))
    };
    let ranks = waiting.iter().enumerate();
    let ranks = ranks.filter_map(|(index, waiting)| Some((rank(waiting)?, index)));
    ranks.min().map(|(_, index)| index)
}

#[cfg(test)]
mod tests;
