//! The certificates of the rest of a motion: the scenes and the timing for which each holds.

use pcc_model::{Configuration, UnitRobot};
use trajectory::Trajectory;

use super::moving_ball_cover::{Stretch, Timing};
use super::progress::Progress;

/// The rate at which a motion is assumed to go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum RateAssumption {
    /// The rate that the controller reported last.
    MeasuredRate,
    /// Full rate, of a motion that was slower.
    FullRate,
}

/// A certificate of the rest of a motion: the version of the scene and the timed stretch of path for which it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Certificate {
    /// Version of the scene.
    pub(super) version: u64,
    pub(super) rate: RateAssumption,
    pub(super) stretch: Stretch,
}

impl Certificate {
    fn is_for_same_scene(&self, other: &Self) -> bool {
        (self.version, self.rate) == (other.version, other.rate)
    }
}

/// The scenes for which a motion was certified.
#[derive(Clone, Debug, Default)]
pub(crate) struct Certificates(Vec<Certificate>);

impl Certificates {
    /// Forgets the certificates for scenes that are no longer kept.
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
            kept.is_for_same_scene(wanted)
                && (!balls_move || (is_long && is_near(kept.stretch.timing)))
        })
    }

    /// Keeps `certificate` in place of the one for the same scene and rate.
    pub(super) fn renew(&mut self, certificate: Certificate) {
        self.0.retain(|kept| !kept.is_for_same_scene(&certificate));
        self.0.push(certificate);
    }
}

/// The rest of a motion, to be certified.
#[derive(Clone, Copy)]
pub(crate) struct RemainingMotion<'a> {
    /// The robot in units of its section length, its tubes padded by what covers the path tolerance.
    pub(crate) padded: &'a UnitRobot,
    pub(crate) motion: &'a Trajectory,
    pub(crate) progress: Progress,
    /// Longest stop, with the time until it begins, s.
    pub(crate) stopping_s: f64,
    /// Delay behind its schedule that must be free of contact too, s.
    pub(crate) lag_allowance_s: f64,
}

impl RemainingMotion<'_> {
    /// Where the robot stands after the motion, rad, which the certificate at the measured rate takes in; none where the motion ends in
    /// motion.
    pub(super) fn place_of_standing(&self, rate: RateAssumption) -> Option<Configuration> {
        let end = self.motion.knots().last()?;
        let rests = end.velocity == Configuration::zeros();
        (rests && rate == RateAssumption::MeasuredRate).then_some(end.position)
    }

    /// The stretches to certify, with the rate that each assumes.
    pub(super) fn stretches(&self) -> impl Iterator<Item = (RateAssumption, Stretch)> {
        let duration_s = self.motion.duration();
        let whole = Stretch {
            timing: self.progress.timing(),
            until_s: duration_s,
        };
        let at_full_rate = self.progress.at_full_rate(self.stopping_s, duration_s);
        let at_full_rate = at_full_rate.map(|stretch| (RateAssumption::FullRate, stretch));
        std::iter::once((RateAssumption::MeasuredRate, whole)).chain(at_full_rate)
    }
}
