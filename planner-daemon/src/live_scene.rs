//! The obstacles that there are now, told by several sources, and whether a motion keeps clear of them.

use collision::{Ball, MovingBall, Scene, Verdict, certify_moving, certify_trajectory};
use pcc_model::{Point, Robot};
use shared_types::codes::SceneRefusal;
use shared_types::message::{self, SceneMessage};
use shared_types::valid::{self, Invalid, SourceName, stamp_refusal};
use trajectory::Trajectory;

use crate::moving_cover::{Cover, Timing};

/// Publishers of scenes that are kept at once: those that may live at once, and as many that were restarted.
pub(crate) const MOST_SOURCES: usize = 8;

/// Why nothing may be executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SceneAbsence {
    /// A scene is expected and nobody has told of one.
    #[error(
        "no live scene: one is expected ([live_scene] expected = true), and no source has told of any"
    )]
    Missing,
    /// The daemon has only just started, and a source has not handed on yet what it had told of before.
    #[error(
        "no live scene yet: a source that was there before the daemon started has not handed on its scene; it has half a second"
    )]
    Awaited,
    /// A source has fallen silent without taking its leave.
    #[error(
        "the live scene of source {source_name:?} has ended: it must publish again, or take its leave (`pcc scene leave NAME`)",
        source_name = .source_name.to_string()
    )]
    Ended {
        /// Which.
        source_name: SourceName,
    },
}

/// What became of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Judged {
    pub(crate) refusal: SceneRefusal,
    /// What is wrong with a malformed one.
    pub(crate) invalid: Option<Invalid>,
    /// Balls of it that count.
    pub(crate) balls: usize,
}

impl Judged {
    fn refused(refusal: SceneRefusal, invalid: Option<Invalid>) -> Self {
        Self {
            refusal,
            invalid,
            balls: 0,
        }
    }

    fn accepted(balls: usize) -> Self {
        Self {
            refusal: SceneRefusal::None,
            invalid: None,
            balls,
        }
    }
}

/// When a scene came, by both clocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    pub(crate) mono_ns: i64,
    pub(crate) wall_ns: i64,
}

/// For which version of a source's scene, and for which times on its path, what is left of a motion was certified.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Certificate {
    version: u64,
    timing: Timing,
}

/// The scenes for which a motion was certified.
#[derive(Clone, Debug, Default)]
pub(crate) struct Certificates(Vec<Certificate>);

impl Certificates {
    fn hold(&self, told: &Told, timing: Timing, rest: &Rest) -> bool {
        self.0.iter().any(|certificate| {
            certificate.version == told.version
                && (told.moving.is_empty()
                    || certificate
                        .timing
                        .is_near(timing, [rest.from_s, rest.end_s()]))
        })
    }

    fn renew(&mut self, told: &Told, timing: Timing) {
        self.0.retain(|kept| kept.version != told.version);
        self.0.push(Certificate {
            version: told.version,
            timing,
        });
    }
}

/// What is left of a motion.
#[derive(Clone, Copy)]
pub(crate) struct Rest<'a> {
    /// In units of the section length, its tubes grown by what covers the path tolerance.
    pub(crate) grown: &'a Robot,
    pub(crate) motion: &'a Trajectory,
    /// Path time that has passed for certain, s.
    pub(crate) from_s: f64,
    /// When it will be where, as far as can be told.
    pub(crate) timing: Timing,
    /// Longest stop, with the time until it begins, s.
    pub(crate) stopping_s: f64,
    /// How much later than that it must be able to come, s.
    pub(crate) lag_allowance_s: f64,
}

impl Rest<'_> {
    fn end_s(&self) -> f64 {
        self.motion.duration()
    }
}

/// The newest scene of a source, in the planner's units (lengths in sections).
#[derive(Debug)]
struct Told {
    scene: valid::Scene,
    resting: Scene,
    /// At the stamp of the message.
    moving: Vec<MovingBall>,
    /// Another number for each content.
    version: u64,
}

/// A publisher of scenes.
#[derive(Debug)]
struct Source {
    name: SourceName,
    publisher: u128,
    /// None where all that it has sent was refused.
    told: Option<Told>,
}

impl Source {
    fn is_live(&self, now_mono_ns: i64) -> bool {
        let told = self.told.as_ref();
        told.is_some_and(|told| now_mono_ns < told.scene.end_mono_ns())
    }
}

/// The newest scenes of all sources.
#[derive(Debug)]
pub(crate) struct LiveScene {
    sources: Vec<Source>,
    section_length_m: f64,
    expected: bool,
    versions: u64,
}

impl LiveScene {
    /// No scene yet; `expected`: nothing may be executed without one.
    pub(crate) fn new(section_length_m: f64, expected: bool) -> Self {
        Self {
            sources: Vec::new(),
            section_length_m,
            expected,
            versions: 0,
        }
    }

    /// Takes a publisher's scene in, in place of the one before, or says why not.
    ///
    /// A publisher whose scene is refused counts as a source all the same: there are obstacles that nobody knows.
    /// Once a publisher's scene is taken in, those of publishers before it under the same name count no longer, unless they are
    /// `there`.
    pub(crate) fn take(
        &mut self,
        wire: &SceneMessage,
        publisher: u128,
        now: Arrival,
        there: impl Fn(u128) -> bool,
    ) -> Judged {
        let scene = match valid::Scene::try_from(wire) {
            Ok(scene) => scene,
            Err(invalid) if invalid.field == "protocol_version" => {
                return Judged::refused(SceneRefusal::WrongVersion, Some(invalid));
            }
            Err(invalid) => {
                if let Ok(name) = SourceName::try_from(&wire.source) {
                    self.source(name, publisher, now.mono_ns);
                }
                return Judged::refused(SceneRefusal::Malformed, Some(invalid));
            }
        };
        let (stamp, lifetime) = (scene.stamp_mono_ns, scene.lifetime_ns);
        let refusal = stamp_refusal(stamp, lifetime, now.mono_ns, now.wall_ns);
        if refusal.is_none() && scene.takes_leave {
            self.take_leave(scene.source, publisher, now.mono_ns);
            return Judged::accepted(0);
        }
        let Some(index) = self.source(scene.source, publisher, now.mono_ns) else {
            return Judged::refused(SceneRefusal::TooManySources, None);
        };
        match refusal {
            Some(refusal) => Judged::refused(refusal, None),
            None => {
                let name = scene.source;
                let judged = self.replace(index, scene);
                if judged.refusal == SceneRefusal::None {
                    self.succeed(name, publisher, now.mono_ns, there);
                }
                judged
            }
        }
    }

    fn take_leave(&mut self, name: SourceName, publisher: u128, now_mono_ns: i64) {
        self.sources.retain(|source| {
            source.name != name || (source.publisher != publisher && source.is_live(now_mono_ns))
        });
    }

    /// The place of a publisher, a new one if need be; none where there is no room.
    fn source(&mut self, name: SourceName, publisher: u128, now_mono_ns: i64) -> Option<usize> {
        let known = |source: &Source| source.name == name && source.publisher == publisher;
        if let Some(index) = self.sources.iter().position(known) {
            return Some(index);
        }
        // A publisher that was restarted takes the place of the one that died.
        self.sources
            .retain(|source| source.name != name || source.is_live(now_mono_ns));
        if self.sources.len() == MOST_SOURCES {
            return None;
        }
        self.sources.push(Source {
            name,
            publisher,
            told: None,
        });
        Some(self.sources.len() - 1)
    }

    fn succeed(
        &mut self,
        name: SourceName,
        publisher: u128,
        now_mono_ns: i64,
        there: impl Fn(u128) -> bool,
    ) {
        self.sources.retain(|other| {
            let is_another = other.name == name && other.publisher != publisher;
            !is_another || (other.is_live(now_mono_ns) && there(other.publisher))
        });
    }

    fn replace(&mut self, index: usize, scene: valid::Scene) -> Judged {
        let source = &mut self.sources[index];
        let count = scene.balls.len();
        if let Some(told) = &mut source.told {
            if scene.stamp_mono_ns < told.scene.stamp_mono_ns {
                return Judged::refused(SceneRefusal::Superseded, None);
            }
            if told.scene.balls == scene.balls
                && (told.moving.is_empty() || told.scene.stamp_mono_ns == scene.stamp_mono_ns)
            {
                told.scene = scene;
                return Judged::accepted(count);
            }
        }
        self.versions += 1;
        source.told = Some(Told::new(scene, self.section_length_m, self.versions));
        Judged::accepted(count)
    }

    /// Why nothing may be executed now, if that is so; `has_told`: whether a publisher's next scene has arrived and is still to be looked
    /// at, as after a pause of the whole machine, at whose end the scene before it may be over.
    pub(crate) fn absence(
        &self,
        now_mono_ns: i64,
        has_told: impl Fn(u128) -> bool,
    ) -> Option<SceneAbsence> {
        if self.sources.is_empty() {
            return self.expected.then_some(SceneAbsence::Missing);
        }
        let is_heard = |name| {
            let mut publishers = self.sources.iter().filter(|source| source.name == name);
            publishers.any(|source| source.is_live(now_mono_ns) || has_told(source.publisher))
        };
        let ended = self.sources.iter().find(|source| !is_heard(source.name));
        ended.map(|source| SceneAbsence::Ended {
            source_name: source.name,
        })
    }

    /// Certifies what is left of a motion against every source's scene, those that it was not certified for yet; small scenes
    /// first, so that a large one does not delay what they have to say.
    pub(crate) fn certify(&self, rest: &Rest, certificates: &mut Certificates) -> Verdict {
        let told = || {
            self.sources
                .iter()
                .filter_map(|source| source.told.as_ref())
        };
        certificates
            .0
            .retain(|kept| told().any(|told| told.version == kept.version));
        let mut open: Vec<&Told> = told()
            .filter(|told| !certificates.hold(told, rest.timing, rest))
            .collect();
        open.sort_by_key(|told| told.scene.balls.len());
        for told in open {
            let verdict = told.certify(rest);
            if !verdict.is_free() {
                return verdict;
            }
            certificates.renew(told, rest.timing);
        }
        Verdict::Free
    }
}

impl Told {
    fn new(scene: valid::Scene, section_length_m: f64, version: u64) -> Self {
        let (mut resting, mut moving) = (Vec::new(), Vec::new());
        for ball in &scene.balls {
            let ball = moving_ball(ball, section_length_m);
            if ball.velocity == Point::zeros() {
                resting.push(ball.ball);
            } else {
                moving.push(ball);
            }
        }
        Self {
            scene,
            // Its balls have been checked: they are finite and their radii not negative.
            resting: Scene::new(resting).unwrap_or_default(),
            moving,
            version,
        }
    }

    fn certify(&self, rest: &Rest) -> Verdict {
        let resting = certify_trajectory(rest.grown, &self.resting, rest.motion, rest.from_s);
        if !resting.is_free() || self.moving.is_empty() {
            return resting;
        }
        let cover = Cover {
            timing: rest.timing,
            stamp_mono_ns: self.scene.stamp_mono_ns,
            lifetime_s: self.scene.lifetime_ns as f64 * 1e-9,
            stopping_s: rest.stopping_s,
            lag_allowance_s: rest.lag_allowance_s,
        };
        let balls = cover.of_all(&self.moving, rest.grown, [rest.from_s, rest.end_s()]);
        certify_moving(rest.grown, &balls, rest.motion, rest.from_s)
    }
}

fn moving_ball(ball: &message::MovingBall, section_length_m: f64) -> MovingBall {
    MovingBall {
        ball: Ball {
            centre: Point::from(ball.centre_m) / section_length_m,
            radius: ball.radius_m / section_length_m,
        },
        velocity: Point::from(ball.velocity_m_s) / section_length_m,
    }
}

#[cfg(test)]
mod tests;
