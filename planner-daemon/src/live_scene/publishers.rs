//! The live publishers of scenes, and the status of each.

use shared_types::codes::SceneRefusal;
use shared_types::ipc::PresentPublisher;
use shared_types::valid::SourceName;

use super::absence::SceneAbsence;

/// Time within which a new publisher must send its first scene before a motion under way is stopped, nanoseconds.
///
/// A publisher that takes the name of a killed one is not refused within this time either: the dead one is cleaned up meanwhile.
pub(super) const FIRST_SCENE_TIMEOUT_NS: i64 = 200_000_000;

/// Status of a publisher.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PublisherStatus {
    /// The publisher has sent nothing yet.
    Nothing,
    /// The publisher has sent a scene that is kept under no name.
    Refused(SceneRefusal),
    /// The publisher's source tells what it knows, or it is signed off.
    Known,
}

/// A live publisher.
#[derive(Debug)]
struct KnownPublisher {
    publisher: PresentPublisher,
    /// When the publisher was there first, nanoseconds.
    since_mono_ns: i64,
    /// The first readable name under which the publisher has sent.
    name: Option<SourceName>,
    heard: PublisherStatus,
}

impl KnownPublisher {
    fn absence(&self, now_mono_ns: i64, first_scene_timeout_ns: i64) -> Option<SceneAbsence> {
        let pid = self.publisher.pid;
        match self.heard {
            PublisherStatus::Nothing
                if now_mono_ns - self.since_mono_ns >= first_scene_timeout_ns =>
            {
                Some(SceneAbsence::Unheard { pid })
            }
            PublisherStatus::Refused(refusal) => Some(SceneAbsence::Refused { pid, refusal }),
            PublisherStatus::Nothing | PublisherStatus::Known => None,
        }
    }
}

/// All live publishers.
#[derive(Debug, Default)]
pub(super) struct Publishers(Vec<KnownPublisher>);

impl Publishers {
    /// Adds new publishers and removes those that have ended.
    pub(super) fn attend(&mut self, present: &[PresentPublisher], now_mono_ns: i64) {
        self.0.retain(|port| present.contains(&port.publisher));
        for &publisher in present {
            if self.port(publisher.id).is_none() {
                self.0.push(KnownPublisher {
                    publisher,
                    since_mono_ns: now_mono_ns,
                    name: None,
                    heard: PublisherStatus::Nothing,
                });
            }
        }
    }

    /// Sets the status of a publisher, if it is still live. What it sends under one of several names never makes up for what
    /// it knows under another.
    pub(super) fn note(&mut self, publisher: u128, heard: PublisherStatus) {
        if let Some(port) = self.port_mut(publisher)
            && port.heard != PublisherStatus::Refused(SceneRefusal::SeveralNames)
        {
            port.heard = heard;
        }
    }

    /// Whether a publisher has sent under this name only; its first one is its own from then on.
    pub(super) fn is_its_name(&mut self, publisher: u128, name: SourceName) -> bool {
        let port = self.port_mut(publisher);
        port.is_none_or(|port| *port.name.get_or_insert(name) == name)
    }

    /// Status of a live publisher.
    pub(super) fn heard(&self, publisher: u128) -> Option<PublisherStatus> {
        self.port(publisher).map(|port| port.heard)
    }

    /// When a publisher was first seen, nanoseconds of `CLOCK_MONOTONIC`.
    pub(super) fn since_mono_ns(&self, publisher: u128) -> Option<i64> {
        self.port(publisher).map(|port| port.since_mono_ns)
    }

    /// Whether a publisher is live.
    pub(super) fn has(&self, publisher: u128) -> bool {
        self.port(publisher).is_some()
    }

    /// Whether a publisher was first seen less than [`FIRST_SCENE_TIMEOUT_NS`] ago.
    pub(super) fn is_new(&self, publisher: u128, now_mono_ns: i64) -> bool {
        let since = self.since_mono_ns(publisher);
        since.is_some_and(|since| now_mono_ns - since < FIRST_SCENE_TIMEOUT_NS)
    }

    /// What is missed of the first publisher that may see obstacles which do not count; a publisher that came less than
    /// `first_scene_timeout_ns` ago may still be silent.
    pub(super) fn absence(
        &self,
        now_mono_ns: i64,
        first_scene_timeout_ns: i64,
    ) -> Option<SceneAbsence> {
        let mut ports = self.0.iter();
        ports.find_map(|port| port.absence(now_mono_ns, first_scene_timeout_ns))
    }

    fn port_mut(&mut self, publisher: u128) -> Option<&mut KnownPublisher> {
        let mut ports = self.0.iter_mut();
        ports.find(|port| port.publisher.id == publisher)
    }

    fn port(&self, publisher: u128) -> Option<&KnownPublisher> {
        self.0.iter().find(|port| port.publisher.id == publisher)
    }
}
