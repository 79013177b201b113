//! Watching over the motion that was published last: is it still to be executed, does it still hold?

use pcc_model::Robot;
use shared_types::codes::LoopState;
use shared_types::valid::ControllerState;
use trajectory::Trajectory;

use crate::live_scene::{LiveScene, Timing};

/// Age of the controller's state beyond which the controller counts as absent, nanoseconds.
pub(crate) const STATE_LIFETIME_NS: i64 = 200_000_000;
/// Time after a motion's begin within which the controller must have taken it up, nanoseconds.
const TAKE_UP_NS: i64 = 300_000_000;

/// The motion that was published last.
#[derive(Debug)]
pub(crate) struct Supervised {
    pub(crate) id: u32,
    pub(crate) motion: Trajectory,
    pub(crate) begin_mono_ns: i64,
    certified: Certified,
}

/// For which scene and rate what is left of the motion was certified.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Certified {
    scene_changes: u64,
    rate: f64,
}

/// Where a published motion stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Standing {
    /// The controller has not begun it yet.
    Awaited,
    /// The controller executes it; its own time, seconds, now.
    Executing { time_s: f64, rate: f64 },
    /// The controller brakes.
    Stopping,
    /// It is over, for this reason.
    Over(&'static str),
}

impl Supervised {
    /// A motion that was certified at full rate for the scene of `scene_changes`.
    pub(crate) fn new(id: u32, motion: Trajectory, begin_mono_ns: i64, scene_changes: u64) -> Self {
        let certified = Certified {
            scene_changes,
            rate: 1.0,
        };
        Self {
            id,
            motion,
            begin_mono_ns,
            certified,
        }
    }

    /// Where it stands by the controller's last word.
    pub(crate) fn standing(&self, state: Option<&ControllerState>, now_mono_ns: i64) -> Standing {
        let Some(state) = state.filter(|state| is_fresh(state, now_mono_ns)) else {
            return Standing::Over("the controller is gone");
        };
        let values = &state.values;
        if values.refused_trajectory_id == self.id {
            return Standing::Over(state.refusal.text());
        }
        if values.trajectory_id != self.id {
            return if now_mono_ns < self.begin_mono_ns.saturating_add(TAKE_UP_NS) {
                Standing::Awaited
            } else {
                Standing::Over("the controller did not take it up")
            };
        }
        match state.state {
            LoopState::Executing => {
                let age_s = (now_mono_ns - values.stamp_mono_ns) as f64 * 1e-9;
                Standing::Executing {
                    time_s: values.trajectory_time_s + values.rate * age_s,
                    rate: values.rate,
                }
            }
            LoopState::Stopping => Standing::Stopping,
            LoopState::Holding if values.stamp_mono_ns < self.begin_mono_ns => Standing::Awaited,
            LoopState::Holding => Standing::Over("the controller holds"),
            LoopState::Starting => Standing::Over("the controller started again"),
            LoopState::Fault => Standing::Over("the controller is in fault"),
        }
    }

    /// Whether what is left of it still keeps clear; computed only where scene or rate changed since the last time.
    pub(crate) fn still_holds(
        &mut self,
        standing: Standing,
        live: &LiveScene,
        grown: &Robot,
        now_mono_ns: i64,
    ) -> bool {
        let (from_time_s, timing) = match standing {
            Standing::Awaited => (0.0, Timing::from_begin(self.begin_mono_ns)),
            Standing::Executing { time_s, rate } => {
                (time_s, Timing::passing(time_s, now_mono_ns, rate))
            }
            Standing::Stopping | Standing::Over(_) => return true,
        };
        let asked = Certified {
            scene_changes: live.changes(),
            rate: timing.rate,
        };
        if asked == self.certified {
            return true;
        }
        let verdict = live.certify(grown, &self.motion, from_time_s, timing);
        if verdict.is_free() {
            self.certified = asked;
        }
        verdict.is_free()
    }
}

/// Whether a controller's state is recent enough to be believed; one from the future would never grow old, and is not.
pub(crate) fn is_fresh(state: &ControllerState, now_mono_ns: i64) -> bool {
    let age_ns = now_mono_ns.saturating_sub(state.values.stamp_mono_ns);
    (-STATE_LIFETIME_NS..=STATE_LIFETIME_NS).contains(&age_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{controller_state, motion, unit_robot};
    use shared_types::{message, valid};

    const BEGIN: i64 = 10_000_000_000;

    fn supervised() -> Supervised {
        Supervised::new(7, motion(), BEGIN, 0)
    }

    fn state(change: impl Fn(&mut message::ControllerState)) -> ControllerState {
        controller_state(|values| {
            values.stamp_mono_ns = BEGIN;
            values.trajectory_id = 7;
            values.state = LoopState::Executing.code();
            change(values);
        })
    }

    fn over(standing: Standing) -> bool {
        matches!(standing, Standing::Over(_))
    }

    #[test]
    fn the_time_on_the_motion_is_extrapolated_to_now() {
        let state = state(|values| (values.trajectory_time_s, values.rate) = (1.5, 0.5));
        let standing = supervised().standing(Some(&state), BEGIN + 100_000_000);
        let Standing::Executing { time_s, rate } = standing else {
            panic!("{standing:?}");
        };
        assert!((time_s - 1.55).abs() < 1e-12);
        assert_eq!(rate, 0.5);
    }

    #[test]
    fn a_motion_is_over_when_nobody_executes_it() {
        let standing = |state: &ControllerState, now| supervised().standing(Some(state), now);
        assert!(over(supervised().standing(None, BEGIN)));
        for age_ns in [STATE_LIFETIME_NS + 1, -STATE_LIFETIME_NS - 1] {
            assert!(over(standing(&state(|_| ()), BEGIN + age_ns)));
        }
        let refused = state(|values| (values.refused_trajectory_id, values.refusal) = (7, 5));
        assert_eq!(
            standing(&refused, BEGIN),
            Standing::Over("begins in the past")
        );
        for code in [LoopState::Holding, LoopState::Fault, LoopState::Starting] {
            assert!(over(standing(
                &state(|values| values.state = code.code()),
                BEGIN
            )));
        }
    }

    #[test]
    fn a_motion_that_is_not_taken_up_is_awaited_for_a_while() {
        let standing = |now| {
            let other = state(|values| {
                (values.trajectory_id, values.state) = (6, LoopState::Holding.code());
                values.stamp_mono_ns = now;
            });
            supervised().standing(Some(&other), now)
        };
        assert_eq!(standing(BEGIN - 1), Standing::Awaited);
        assert_eq!(standing(BEGIN + TAKE_UP_NS - 1), Standing::Awaited);
        assert!(over(standing(BEGIN + TAKE_UP_NS)));
    }

    #[test]
    fn a_ball_that_appears_ahead_breaks_the_motion_and_one_behind_does_not() {
        let (robot, mut live) = (unit_robot(), LiveScene::default());
        let executing = |time_s| Standing::Executing { time_s, rate: 1.0 };
        let mut supervised = supervised();
        assert!(supervised.still_holds(executing(0.1), &live, &robot, BEGIN));
        // At the tip of the straight shape, where the motion begins.
        let ball = message::MovingBall {
            centre_m: [0.0, 0.0, 3.2],
            radius_m: 0.1,
            velocity_m_s: [0.0; 3],
        };
        let scene = valid::Scene {
            stamp_mono_ns: BEGIN,
            balls: vec![ball],
        };
        live.replace(scene, 1.0);
        assert!(!supervised.still_holds(executing(0.0), &live, &robot, BEGIN));
        let end = motion().duration();
        assert!(supervised.still_holds(executing(0.9 * end), &live, &robot, BEGIN));
        assert!(supervised.still_holds(Standing::Stopping, &live, &robot, BEGIN));
    }
}
