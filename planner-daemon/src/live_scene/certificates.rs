//! For which scenes, and at which times on its path, what is left of a motion was certified.

use pcc_model::UnitRobot;
use trajectory::Trajectory;

use crate::moving_cover::{Stretch, Timing};

/// How fast a motion is taken to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// As it has gone.
    Expected,
    /// At full rate, where it has gone more slowly.
    Hurried,
}

/// For which version of a source's scene, and for which times on its path, what is left of a motion was certified.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Certificate {
    /// Of the scene.
    pub(super) version: u64,
    pub(super) kind: Kind,
    pub(super) stretch: Stretch,
}

impl Certificate {
    fn is_of_the_same(&self, other: &Self) -> bool {
        (self.version, self.kind) == (other.version, other.kind)
    }
}

/// The scenes for which a motion was certified.
#[derive(Clone, Debug, Default)]
pub(crate) struct Certificates(Vec<Certificate>);

impl Certificates {
    /// Forgets those for scenes that are no longer kept.
    pub(super) fn keep_only(&mut self, is_kept: impl Fn(u64) -> bool) {
        self.0.retain(|certificate| is_kept(certificate.version));
    }

    /// Whether one of them is as good as this one from this time of the path on. Times do not matter
    /// where no ball of the scene moves.
    pub(super) fn hold(&self, wanted: &Certificate, balls_move: bool, from_s: f64) -> bool {
        let until_s = wanted.stretch.until_s;
        let is_near = |timing: Timing| timing.is_near(wanted.stretch.timing, [from_s, until_s]);
        let mut kept = self.0.iter();
        kept.any(|kept| {
            let is_long = kept.stretch.until_s >= until_s;
            kept.is_of_the_same(wanted)
                && (!balls_move || (is_long && is_near(kept.stretch.timing)))
        })
    }

    /// Keeps this one in place of the one before.
    pub(super) fn renew(&mut self, certificate: Certificate) {
        self.0.retain(|kept| !kept.is_of_the_same(&certificate));
        self.0.push(certificate);
    }
}

/// What is left of a motion.
#[derive(Clone, Copy)]
pub(crate) struct RemainingMotion<'a> {
    /// In units of the section length, its tubes padded by what covers the path tolerance.
    pub(crate) padded: &'a UnitRobot,
    pub(crate) motion: &'a Trajectory,
    /// Path time that has passed for certain, s.
    pub(crate) from_s: f64,
    /// When it will be where, as far as can be told.
    pub(crate) timing: Timing,
    /// Where it may be sooner.
    pub(crate) hurried: Option<Stretch>,
    /// Longest stop, with the time until it begins, s.
    pub(crate) stopping_s: f64,
    /// How much later than that it must be able to come, s.
    pub(crate) lag_allowance_s: f64,
}

impl RemainingMotion<'_> {
    /// All of it, at this timing.
    fn whole(&self, timing: Timing) -> Stretch {
        Stretch {
            timing,
            until_s: self.motion.duration(),
        }
    }

    /// What is to be certified.
    pub(super) fn stretches(&self) -> impl Iterator<Item = (Kind, Stretch)> {
        let expected = (Kind::Expected, self.whole(self.timing));
        let hurried = self.hurried.map(|hurried| (Kind::Hurried, hurried));
        std::iter::once(expected).chain(hurried)
    }
}
