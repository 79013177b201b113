//! The live scene: the newest scene of each source, and whether a motion keeps clear of all.

use std::sync::Arc;

use pcc_model::{Configuration, UnitRobot};
use shared_types::codes::SceneRefusal;
use shared_types::ipc::PresentPublisher;
use shared_types::message::SceneMessage;
use shared_types::valid::{self, Invalid, SourceName, stamp_refusal};

use super::absence::SceneAbsence;
use super::certificates::{Certificate, Certificates, RateAssumption, RemainingMotion};
use super::in_the_way::InTheWay;
use super::planned_scene::{SceneSnapshot, SourceSnapshot};
use super::publishers::{FIRST_SCENE_TIMEOUT_NS, PublisherStatus, Publishers};
use super::retained_scene::RetainedScene;
use super::scene_memory::{MAX_SOURCES, RetainedSource, SceneMemory, SourceRecord};
use super::verdict::SceneVerdict;

/// When a scene came, by both clocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    pub(crate) mono_ns: i64,
    pub(crate) wall_ns: i64,
}

/// A source of scenes: a name and its publisher, which may have died.
#[derive(Debug)]
struct Source {
    name: SourceName,
    publisher: u128,
    /// The source's newest accepted scene; none where all were refused.
    latest: Option<RetainedScene>,
    /// Whether the source is signed off: it is forgotten once its scene's lifetime is over.
    leaves: bool,
}

impl Source {
    fn is_live(&self, now_mono_ns: i64) -> bool {
        let latest = self.latest.as_ref();
        latest.is_some_and(|latest| now_mono_ns < latest.scene.end_mono_ns())
    }

    /// The source's record and scene for [`SceneMemory::keep`].
    fn for_memory(&self) -> (SourceRecord, Option<&valid::Scene>) {
        let latest = self.latest.as_ref();
        let record = SourceRecord {
            name: self.name,
            publisher: self.publisher,
            leaves: self.leaves,
            scene: latest.map(|RetainedScene { scene, version, .. }| {
                (scene.stamp_mono_ns, scene.lifetime_ns, *version)
            }),
        };
        (record, latest.map(|latest| &latest.scene))
    }

    fn has_spoken_since(&self, mono_ns: i64) -> bool {
        let latest = self.latest.as_ref();
        latest.is_some_and(|latest| latest.scene.stamp_mono_ns >= mono_ns)
    }
}

/// The newest scene of each source, those that the daemon before this one received included.
pub(crate) struct LiveScene {
    sources: Vec<Source>,
    memory: SceneMemory,
    publishers: Publishers,
    /// The robot, whose section length is the planner's unit.
    robot: UnitRobot,
    expected: bool,
    /// When this daemon began, nanoseconds: what was sent before may have been meant for another one.
    begun_mono_ns: i64,
    versions: u64,
}

impl LiveScene {
    /// The scenes that the daemon before this one has left in `memory`; `expected`: nothing may be executed without a scene.
    pub(crate) fn recall(
        mut memory: SceneMemory,
        robot: UnitRobot,
        expected: bool,
        begun_mono_ns: i64,
    ) -> Self {
        let recalled = memory.recall();
        let mut live = Self {
            sources: Vec::with_capacity(MAX_SOURCES),
            memory,
            publishers: Publishers::default(),
            robot,
            expected,
            begun_mono_ns,
            versions: 0,
        };
        for source in recalled {
            live.restore(source);
        }
        live
    }

    /// Adds a source that the previous daemon had heard, with its scene if that was written to its end and is valid; whether its lifetime
    /// is over is looked at where scenes are counted.
    fn restore(&mut self, (record, scene): RetainedSource) {
        let name = record.name.to_string();
        tracing::info!("source {name:?} of the live scene was heard by the daemon before this one");
        self.versions += 1;
        let latest = scene.and_then(|scene| {
            RetainedScene::new(scene, &self.robot, self.versions)
                .inspect_err(|error| tracing::error!("a scene of source {name:?}: {error}"))
                .ok()
        });
        self.sources.push(Source {
            name: record.name,
            publisher: record.publisher,
            latest,
            leaves: record.leaves,
        });
    }

    /// Writes all sources to the file for the next daemon.
    fn save(&mut self) {
        self.memory
            .keep(self.sources.iter().map(Source::for_memory));
    }

    /// Forgets every scene after a suspension of the machine (`suspended_ns` in all since it was booted): obstacles may have moved. The
    /// sources stay, so that nothing is executed until each publishes again or takes its leave.
    pub(crate) fn notice_suspension(&mut self, suspended_ns: i64, now_mono_ns: i64) {
        if !self.memory.notice_suspension(suspended_ns, now_mono_ns) {
            return;
        }
        tracing::warn!("the machine was suspended: no scene from before counts");
        for source in &mut self.sources {
            source.latest = None;
        }
        self.save();
    }

    /// Updates the list of publishers, and forgets signed-off sources whose lifetime is over.
    pub(crate) fn attend(&mut self, present: &[PresentPublisher], now_mono_ns: i64) {
        self.publishers.attend(present, now_mono_ns);
        self.sources
            .retain(|source| !source.leaves || source.is_live(now_mono_ns));
        self.save();
    }

    /// Counts a publisher's scenes no more until it is gone: it has sent some under another name than that of its first one.
    pub(crate) fn refuse_names_of(&mut self, publisher: u128) {
        let heard = PublisherStatus::Refused(SceneRefusal::SeveralNames);
        self.publishers.note(publisher, heard);
    }

    /// Whether a publisher may not use this name because it has used another one.
    fn has_another_name(&mut self, publisher: u128, name: SourceName) -> bool {
        let mut own = self.sources.iter();
        let tells_more = own.any(|own| own.publisher == publisher && own.name != name);
        !self.publishers.is_its_name(publisher, name) || tells_more
    }

    /// Accepts a publisher's scene in place of its last one, or refuses it; none where it is too early to say which publisher has the name.
    ///
    /// A publisher whose scene is refused counts as a source all the same, because it may see obstacles that the daemon does not know:
    /// under its name where that is valid, else for as long as the publisher is there. A name belongs to one publisher. Another
    /// publisher gets the name once the first is gone, and only if the first has said nothing since the other came.
    pub(crate) fn take(
        &mut self,
        wire: &SceneMessage,
        publisher: u128,
        now: Arrival,
    ) -> Option<SceneVerdict> {
        let verdict = self.judge(wire, publisher, now);
        self.save();
        verdict
    }

    /// The verdict on a scene, which is accepted or refused; none where it is too early to say which publisher has the name.
    fn judge(
        &mut self,
        wire: &SceneMessage,
        publisher: u128,
        now: Arrival,
    ) -> Option<SceneVerdict> {
        let scene = match valid::Scene::try_from(wire) {
            Ok(scene) => scene,
            Err(invalid) => return Some(self.miss(wire, publisher, now.mono_ns, invalid)),
        };
        if self.has_another_name(publisher, scene.source) {
            self.refuse_names_of(publisher);
            return Some(SceneVerdict::refused(SceneRefusal::SeveralNames, None));
        }
        let (stamp, lifetime) = (scene.stamp_mono_ns, scene.lifetime_ns);
        let refusal = stamp_refusal(stamp, lifetime, now.mono_ns, now.wall_ns)
            .or_else(|| (stamp < self.memory.resumed_mono_ns()).then_some(SceneRefusal::TooOld));
        // A daemon that starts again hears leaves of any age.
        if scene.takes_leave && matches!(refusal, None | Some(SceneRefusal::TooOld)) {
            return Some(self.take_leave(&scene, publisher, now.mono_ns));
        }
        let index = match self.slot(scene.source, publisher, now.mono_ns) {
            Ok(index) => index,
            Err(SceneRefusal::NameTaken) if self.publishers.is_new(publisher, now.mono_ns) => {
                return None;
            }
            Err(refusal) => {
                self.publishers
                    .note(publisher, PublisherStatus::Refused(refusal));
                return Some(SceneVerdict::refused(refusal, None));
            }
        };
        self.publishers.note(publisher, PublisherStatus::Known);
        Some(match refusal {
            Some(refusal) => SceneVerdict::refused(refusal, None),
            None => self.replace(index, scene),
        })
    }

    /// Counts the publisher of an unreadable scene as a source that is missing.
    fn miss(
        &mut self,
        wire: &SceneMessage,
        publisher: u128,
        now_mono_ns: i64,
        invalid: Invalid,
    ) -> SceneVerdict {
        let refusal = if invalid.field == "protocol_version" {
            SceneRefusal::WrongVersion
        } else {
            SceneRefusal::Malformed
        };
        let name = SourceName::try_from(&wire.source);
        if name.is_ok_and(|name| self.has_another_name(publisher, name)) {
            self.refuse_names_of(publisher);
            return SceneVerdict::refused(SceneRefusal::SeveralNames, Some(invalid));
        }
        let has_place = name.is_ok_and(|name| self.slot(name, publisher, now_mono_ns).is_ok());
        let heard = if has_place {
            PublisherStatus::Known
        } else {
            PublisherStatus::Refused(refusal)
        };
        self.publishers.note(publisher, heard);
        SceneVerdict::refused(refusal, Some(invalid))
    }

    /// Signs off a name: those of its publishers that have published nothing since the leave. The scene of another publisher than the
    /// leaving one counts until its lifetime ends. A publisher that was refused the name signs off only itself. A leave from before this daemon began is one even
    /// where nobody has the name.
    fn take_leave(
        &mut self,
        leave: &valid::Scene,
        publisher: u128,
        now_mono_ns: i64,
    ) -> SceneVerdict {
        let (name, stamp) = (leave.source, leave.stamp_mono_ns);
        let heard = self.publishers.heard(publisher);
        self.publishers.note(publisher, PublisherStatus::Known);
        if heard == Some(PublisherStatus::Refused(SceneRefusal::NameTaken)) {
            return SceneVerdict::accepted(0);
        }
        let is_of_before =
            matches!(heard, None | Some(PublisherStatus::Nothing)) && stamp < self.begun_mono_ns;
        if !is_of_before && !self.sources.iter().any(|source| source.name == name) {
            return SceneVerdict::refused(SceneRefusal::NoSuchSource, None);
        }
        let is_own = |source: &Source| source.publisher == publisher;
        let leaves = |source: &Source| {
            source.name == name && (is_own(source) || !source.has_spoken_since(stamp + 1))
        };
        for source in &mut self.sources {
            source.leaves |= leaves(source);
        }
        self.sources
            .retain(|source| !leaves(source) || (!is_own(source) && source.is_live(now_mono_ns)));
        SceneVerdict::accepted(0)
    }

    /// Index of a publisher's source, added where it is new.
    ///
    /// # Errors
    /// Why it gets none.
    fn slot(
        &mut self,
        name: SourceName,
        publisher: u128,
        now_mono_ns: i64,
    ) -> Result<usize, SceneRefusal> {
        let known = |source: &Source| source.name == name && source.publisher == publisher;
        if let Some(index) = self.sources.iter().position(known) {
            return Ok(index);
        }
        let since = self
            .publishers
            .since_mono_ns(publisher)
            .unwrap_or(now_mono_ns);
        let has_it = |source: &Source| {
            source.name == name
                && (self.publishers.has(source.publisher) || source.has_spoken_since(since))
        };
        if self.sources.iter().any(has_it) {
            return Err(SceneRefusal::NameTaken);
        }
        // A publisher that was restarted takes the place of the one that died.
        self.sources
            .retain(|source| source.name != name || source.is_live(now_mono_ns));
        if self.sources.len() == MAX_SOURCES {
            return Err(SceneRefusal::TooManySources);
        }
        self.sources.push(Source {
            name,
            publisher,
            latest: None,
            leaves: false,
        });
        Ok(self.sources.len() - 1)
    }

    /// Replaces a publisher's last scene; scenes of earlier publishers under the same name are dropped.
    fn replace(&mut self, index: usize, scene: valid::Scene) -> SceneVerdict {
        let source = &mut self.sources[index];
        let count = scene.balls.len();
        if let Some(latest) = &mut source.latest {
            if scene.stamp_mono_ns < latest.scene.stamp_mono_ns {
                return SceneVerdict::refused(SceneRefusal::Superseded, None);
            }
            if latest.has_same_meaning(&scene) {
                latest.scene = scene;
                source.leaves = false;
                return SceneVerdict::accepted(count);
            }
        }
        self.versions += 1;
        match RetainedScene::new(scene, &self.robot, self.versions) {
            Ok(latest) => source.latest = Some(latest),
            Err(error) => {
                // Nobody knows its obstacles: it has no living scene.
                source.latest = None;
                tracing::error!("a scene of source {:?}: {error}", source.name.to_string());
                return SceneVerdict::refused(SceneRefusal::Malformed, None);
            }
        }
        source.leaves = false;
        let (name, publisher) = (source.name, source.publisher);
        self.sources
            .retain(|other| other.name != name || other.publisher == publisher);
        SceneVerdict::accepted(count)
    }

    /// The newest scene of each source, for planning.
    pub(crate) fn snapshot(&self) -> SceneSnapshot {
        let latest = self
            .sources
            .iter()
            .filter_map(|source| source.latest.as_ref());
        let snapshot = |latest: &RetainedScene| SourceSnapshot {
            balls: Arc::clone(latest.balls()),
            stamp_mono_ns: latest.scene.stamp_mono_ns,
            end_mono_ns: latest.scene.end_mono_ns(),
        };
        SceneSnapshot(latest.map(snapshot).collect())
    }

    /// Whether an obstacle moves, by the newest scene of its source.
    pub(crate) fn moves(&self) -> bool {
        let mut latest = self.sources.iter().filter_map(|it| it.latest.as_ref());
        latest.any(RetainedScene::moves)
    }

    /// Why no motion may be published now; none where one may.
    pub(crate) fn absence(&self, now_mono_ns: i64) -> Option<SceneAbsence> {
        self.missing(now_mono_ns, 0, |_| false)
    }

    /// Why the motion under way must stop now; none where it may go on.
    ///
    /// Two things that keep a motion from being begun ([`LiveScene::absence`]) do not stop one: a publisher that came less than
    /// [`FIRST_SCENE_TIMEOUT_NS`] ago and is still silent, and a scene that has ended while its publisher `has_pending`, a newer one not yet
    /// examined (as after a pause of the whole machine).
    pub(crate) fn absence_in_motion(
        &self,
        now_mono_ns: i64,
        has_pending: impl Fn(u128) -> bool,
    ) -> Option<SceneAbsence> {
        self.missing(now_mono_ns, FIRST_SCENE_TIMEOUT_NS, has_pending)
    }

    fn missing(
        &self,
        now_mono_ns: i64,
        first_scene_timeout_ns: i64,
        has_pending: impl Fn(u128) -> bool,
    ) -> Option<SceneAbsence> {
        if self.expected && self.sources.is_empty() {
            return Some(SceneAbsence::Missing);
        }
        let is_missed = |source: &&Source| {
            !source.leaves && !source.is_live(now_mono_ns) && !has_pending(source.publisher)
        };
        let ended = self.sources.iter().find(is_missed);
        let ended = ended.map(|source| SceneAbsence::Ended {
            source_name: source.name,
        });
        ended.or_else(|| self.publishers.absence(now_mono_ns, first_scene_timeout_ns))
    }

    /// Certifies what is left of a motion, and standing at its end, against every source's scene, those that it was not certified for yet; small
    /// scenes first, so that a large one does not delay their verdicts. What is in the way before the end is told first.
    pub(crate) fn certify(
        &self,
        rest: &RemainingMotion,
        certificates: &mut Certificates,
    ) -> Result<(), InTheWay> {
        let latest = || {
            self.sources
                .iter()
                .filter_map(|source| source.latest.as_ref())
        };
        certificates.keep_only(|version| latest().any(|latest| latest.version == version));
        let from_s = rest.progress.passed_s();
        let mut at_the_end = Ok(());
        for (rate, stretch) in rest.stretches() {
            let certificate = |latest: &RetainedScene, stretch| Certificate {
                version: latest.version,
                rate,
                stretch,
            };
            let is_open = |latest: &&RetainedScene| {
                let wanted = certificate(latest, stretch);
                let depends = latest.moves() || rate == RateAssumption::MeasuredRate;
                depends && !certificates.hold(&wanted, latest.moves(), from_s)
            };
            let mut open: Vec<&RetainedScene> = latest().filter(is_open).collect();
            open.sort_by_key(|latest| latest.scene.balls.len());
            for latest in open {
                match latest.certify(rest, rate, stretch) {
                    Ok(stretch) => certificates.renew(certificate(latest, stretch)),
                    Err(InTheWay::AtTheEnd) => at_the_end = Err(InTheWay::AtTheEnd),
                    on_the_way => return on_the_way.map(|_| ()),
                }
            }
        }
        at_the_end
    }

    /// Whether a robot that stands in a configuration, rad, keeps clear of all obstacles that move, as far as these keep their velocities.
    pub(crate) fn stands_clear(
        &self,
        padded: &UnitRobot,
        configuration: &Configuration,
        now_mono_ns: i64,
    ) -> bool {
        let latest = self
            .sources
            .iter()
            .filter_map(|source| source.latest.as_ref());
        let mut scenes = latest.filter(|latest| latest.moves());
        scenes.all(|latest| latest.stands_clear(padded, configuration, now_mono_ns))
    }
}

#[cfg(test)]
mod tests;
