//! What came of the fourth experiment.

use std::collections::BTreeMap;

use anyhow::ensure;
use pcc_model::Point;
use serde::Serialize;

use super::motion::ALLOWED_ERROR;

/// What came of the experiment, as `demo.json` holds it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Followed {
    /// From when until when the daemon kept the robot on its way, nanoseconds of `CLOCK_MONOTONIC`.
    pub(super) begin_ns: i64,
    pub(super) end_ns: i64,
    /// Where the target rested in the end, and the tip of the commanded and of the mean measured configuration there.
    pub(super) requested_tip_m: [f64; 3],
    pub(super) reached_tip_m: [f64; 3],
    pub(super) measured_tip_m: [f64; 3],
    /// Mean distance of the commanded tip to the target while that moved.
    pub(super) mean_tip_error_m: f64,
    /// Least clearance of the commanded configurations to the ball.
    pub(super) minimum_clearance_m: f64,
    pub(super) plans: u64,
    pub(super) motions: u64,
    /// How many motions ended with each outcome.
    pub(super) outcomes: BTreeMap<&'static str, usize>,
    /// Results of motions that did not arrive.
    pub(super) missing_results: u64,
}

impl Followed {
    /// Tip errors where the target rests: commanded, and as measured.
    fn tip_errors_m(&self) -> [f64; 2] {
        let requested = Point::from(self.requested_tip_m);
        [self.reached_tip_m, self.measured_tip_m].map(|tip| (Point::from(tip) - requested).norm())
    }

    pub(super) fn print(&self, lasted_s: f64) {
        let [commanded, measured] = self.tip_errors_m();
        say!(
            "  tip error {:.4} m in the mean while the target moved, {commanded:.1e} m commanded and {measured:.4} m measured once it rested",
            self.mean_tip_error_m
        );
        say!(
            "  {} plans and {} motions in {lasted_s:.1} s: {:.0} plans a second; least clearance to the ball {:.4} m",
            self.plans,
            self.motions,
            self.plans as f64 / lasted_s,
            self.minimum_clearance_m
        );
    }

    /// An error where the robot met the ball, did not reach the target, or where results are missing.
    pub(super) fn check(&self, length_m: f64) -> anyhow::Result<()> {
        ensure!(
            self.minimum_clearance_m >= 0.0,
            "the robot met the ball: clearance {:.4} m, at least 0 is allowed",
            self.minimum_clearance_m
        );
        let errors = self.tip_errors_m().map(|error| error / length_m);
        let is_reached = errors
            .iter()
            .zip(ALLOWED_ERROR)
            .all(|(error, allowed)| *error <= allowed);
        ensure!(
            is_reached,
            "the target that moves: tip errors {errors:?} section lengths, {ALLOWED_ERROR:?} are allowed"
        );
        ensure!(
            self.missing_results == 0,
            "{} results of motions did not arrive",
            self.missing_results
        );
        Ok(())
    }
}
