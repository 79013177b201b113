//! Changing over from one motion to another while the robot moves.
//!
//! The motion that is joined begins with the knots of the one that is left ([`Motion::lead_in_from`]), so both are the same curve up to
//! the switch and the loop follows the new one from the moment that it takes it: nothing steps at the switch, whatever the rate, a
//! pause or a late cycle. Until the switch is passed the motion that is left is kept: whatever stops the robot before that
//! stops it on the old path, and the new motion is set aside.

use shared_types::codes::LoopState;
use trajectory::{Knot, evaluate};

use super::refusal::TrajectoryRefusal;
use super::{Ending, Executive, Motion, StopOrigin};

/// Two motions agree where position, rad, velocity, rad/s, and acceleration, rad/s², differ by no more.
const CONTINUITY: f64 = 1e-9;
/// Least path time between a switch and a knot of the motion that is left, s: in a shorter segment the rounding of positions would
/// show in the acceleration.
const LEAST_SEGMENT_S: f64 = 4e-4;

impl Motion {
    /// Path time of the motion that it leaves at which it does so, s; `None` where it begins at rest.
    pub(super) fn switch_s(&self) -> Option<f64> {
        self.leaves.map(|departure| departure.path_time_s)
    }

    /// Puts the knots of the motion that this one leaves before its own, from `path_time_s` of that motion on.
    ///
    /// # Errors
    /// [`TrajectoryRefusal::LeavesAnother`], [`TrajectoryRefusal::SwitchMissed`] where the switch is not ahead,
    /// [`TrajectoryRefusal::SwitchAtKnot`] where it is too near to a knot or beyond the end, [`TrajectoryRefusal::Discontinuous`] where
    /// the two do not agree there.
    pub fn lead_in_from(&mut self, left: &Self, path_time_s: f64) -> Result<(), TrajectoryRefusal> {
        let Some(departure) = self.leaves.filter(|it| it.trajectory_id == left.id) else {
            return Err(TrajectoryRefusal::LeavesAnother);
        };
        let switch_s = departure.path_time_s;
        if path_time_s >= switch_s {
            let late_s = path_time_s - switch_s;
            return Err(TrajectoryRefusal::SwitchMissed { late_s });
        }
        let first = left.knots.partition_point(|knot| knot.time <= path_time_s);
        let ahead = left.knots.partition_point(|knot| knot.time < switch_s);
        let is_near = |knot: &Knot| (knot.time - switch_s).abs() < LEAST_SEGMENT_S;
        let between = left.knots.get(ahead.wrapping_sub(1)..=ahead);
        if first == 0 || between.is_none_or(|knots| knots.iter().any(is_near)) {
            return Err(TrajectoryRefusal::SwitchAtKnot);
        }
        let error = self.discontinuity(left, switch_s);
        if error.is_nan() || error > CONTINUITY {
            return Err(TrajectoryRefusal::Discontinuous { error });
        }
        let lead_in = left.knots[first - 1..ahead].iter().map(|knot| Knot {
            time: knot.time - switch_s,
            ..*knot
        });
        self.knots.splice(0..0, lead_in);
        Ok(())
    }

    /// The largest difference of position, velocity or acceleration between the first knot and another motion at a path time of that.
    fn discontinuity(&self, left: &Self, switch_s: f64) -> f64 {
        let at = evaluate(&left.knots, &mut 0, switch_s);
        self.knots.first().map_or(f64::INFINITY, |first| {
            let position = (first.position - at.position).amax();
            let velocity = (first.velocity - at.velocity).amax();
            let acceleration = (first.acceleration - at.acceleration).amax();
            [velocity, acceleration]
                .into_iter()
                .fold(
                    position,
                    |most, error| {
                        if error <= most { most } else { error }
                    },
                )
        })
    }
}

/// What is followed, as it is told outside: until the switch the motion that is left.
pub(super) struct Followed {
    /// 0 for none.
    pub(super) trajectory_id: u32,
    pub(super) path_time_s: f64,
    /// The trajectory that is joined at the switch; 0 for none.
    pub(super) pending_trajectory_id: u32,
}

impl Executive {
    pub(super) fn followed_motion(&self) -> Followed {
        let motion = self.motion.as_ref().filter(|_| self.is_moving());
        let id = motion.map_or(0, |motion| motion.id);
        let path_time_s = self.pace.time_s;
        match &self.left {
            None => Followed {
                trajectory_id: id,
                path_time_s,
                pending_trajectory_id: 0,
            },
            Some(left) => Followed {
                trajectory_id: left.id,
                path_time_s: path_time_s + motion.and_then(Motion::switch_s).unwrap_or(0.0),
                pending_trajectory_id: id,
            },
        }
    }

    /// Takes a motion that leaves the one that is executed.
    ///
    /// # Errors
    /// The motion back, and why the loop does not change over to it.
    #[expect(
        clippy::result_large_err,
        reason = "the trajectory goes back by value: boxing it would allocate in the loop"
    )]
    pub(super) fn join(&mut self, motion: Motion) -> Result<(), (TrajectoryRefusal, Motion)> {
        let refusal = match (self.state, &self.motion, motion.leaves) {
            (LoopState::Executing, ..) if self.left.is_some() => TrajectoryRefusal::Waiting,
            (LoopState::Executing, Some(left), Some(departure))
                if left.id == departure.trajectory_id =>
            {
                let time_s = self.pace.time_s - departure.path_time_s;
                let reaches_back = motion.knots.first().is_some_and(|it| it.time <= time_s);
                if time_s < 0.0 && reaches_back {
                    self.pace.change_over(time_s);
                    self.left = self.motion.replace(motion);
                    return Ok(());
                }
                TrajectoryRefusal::SwitchMissed { late_s: time_s }
            }
            (LoopState::Executing, ..) => TrajectoryRefusal::LeavesAnother,
            (state, ..) => TrajectoryRefusal::State(state),
        };
        Err((refusal, motion))
    }

    /// Gives back the motion that was left, once the switch is passed.
    pub(super) fn finish_join(&mut self) {
        if self.pace.time_s >= 0.0
            && let Some(left) = self.left.take()
            && let Some(motion) = &self.motion
        {
            self.path_tolerance_rad = motion.path_tolerance_rad;
            let (joined_by, switch_s) = (motion.id, motion.switch_s().unwrap_or(0.0));
            self.note_end(left, Ending::Joined(joined_by), switch_s);
        }
    }

    /// Goes on with the motion that was to be left, if the switch is still ahead; the one that was to be joined is set aside.
    pub(super) fn give_up_join(&mut self, origin: StopOrigin) {
        let Some(left) = self.left.take() else {
            return;
        };
        if let Some(joined) = self.motion.replace(left) {
            let switch_s = joined.switch_s().unwrap_or(0.0);
            self.pace.change_over(self.pace.time_s + switch_s);
            self.note_end(joined, Ending::SetAside(origin), 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::executive::{
        AcceptanceContext, BeginWindow, CycleOutput, Departure, GuardState, check,
    };
    use crate::fixtures::{MS, World, curved_motion, joined_motion, target_configuration};
    use pcc_model::Configuration;
    use shared_types::codes::Refusal;

    const OTHER: [f64; 6] = [-0.3, 0.5, 0.2, -0.4, 0.6, -0.1];

    /// A world that executes motion 4 since `cycles` milliseconds, and that motion.
    fn executing(cycles: u64) -> (World, Motion) {
        let mut world = World::holding();
        world.begin_motion(4);
        let motion = world.executive.motion.clone().unwrap();
        world.run(cycles);
        assert_eq!(world.executive.state(), LoopState::Executing, "the premise");
        (world, motion)
    }

    fn context(last: &CycleOutput) -> AcceptanceContext {
        AcceptanceContext {
            state: last.state,
            commanded_rad: last.commanded.position,
            trajectory_id: last.trajectory_id,
            path_time_s: last.path_time_s,
            now_ns: last.stamp_ns,
            guard: GuardState::default(),
        }
    }

    /// Checks and takes a motion, as the relay and the loop do.
    fn take(
        world: &mut World,
        mut motion: Motion,
        left: &Motion,
    ) -> Result<Motion, TrajectoryRefusal> {
        let window = BeginWindow {
            past_ns: 20 * MS,
            ahead_ns: 1_000 * MS,
        };
        let context = context(&world.last.unwrap());
        motion.requested_ns = 1;
        check(&mut motion, left, &context, &world.robot, &window)?;
        let taken = motion.clone();
        world
            .executive
            .execute(motion)
            .map_err(|(reason, _)| reason)?;
        Ok(taken)
    }

    /// Joins `left` `ahead_s` of path time from now on.
    fn join(
        world: &mut World,
        left: &Motion,
        id: u32,
        ahead_s: f64,
    ) -> Result<Motion, TrajectoryRefusal> {
        let switch_s = world.last.unwrap().path_time_s + ahead_s;
        let to = if id % 2 == 1 {
            Configuration::from(OTHER)
        } else {
            target_configuration()
        };
        let motion = joined_motion(id, left, switch_s, to);
        take(world, motion, left)
    }

    #[test]
    fn motions_are_joined_one_after_the_other_at_any_rate_over_late_cycles_and_pauses() {
        for (speed, late_ms) in [(1.0, 1), (0.3, 1), (1.0, 15), (0.7, 20)] {
            let (mut world, mut followed) = executing(400);
            world.executive.set_speed(speed).unwrap();
            for id in 5..12 {
                let pauses = id == 8;
                followed = join(&mut world, &followed, id, 0.02).unwrap();
                let pending = world.cycle(MS);
                assert_eq!(pending.pending_trajectory_id, id);
                if pauses {
                    world.executive.pause().unwrap();
                    world.run(300);
                    assert_eq!(world.last.unwrap().rate, 0.0);
                    world.executive.resume().unwrap();
                }
                while world.last.unwrap().pending_trajectory_id != 0 {
                    world.cycle(late_ms * MS);
                    world.run(3);
                }
                assert_eq!(world.last.unwrap().trajectory_id, id);
                world.run(150);
            }
            world.run(20_000);
            let last = world.last.unwrap();
            assert_eq!(last.state, LoopState::Holding);
            let end = followed.knots.last().unwrap().position;
            assert!((last.commanded.position - end).norm() < 1e-9);
        }
    }

    #[test]
    fn a_stop_before_the_switch_stays_on_the_old_path_and_sets_the_new_motion_aside() {
        let (mut world, left) = executing(400);
        join(&mut world, &left, 5, 0.05).unwrap();
        world.run(10);
        assert_eq!(world.executive.stop(StopOrigin::Signal), Ok(()));
        assert_eq!(
            world.executive.take_finished().map(|ended| ended.motion.id),
            Some(5)
        );
        while world.executive.state() != LoopState::Holding {
            let output = world.cycle(MS);
            assert!(output.trajectory_id == 4 || output.state == LoopState::Holding);
        }
        let at = evaluate(&left.knots, &mut 0, world.last.unwrap().path_time_s).position;
        assert!((world.commanded() - at).norm() < 1e-9);
    }

    #[test]
    fn a_stop_after_the_switch_stays_on_the_new_path() {
        let (mut world, left) = executing(400);
        let joined = join(&mut world, &left, 5, 0.01).unwrap();
        world.run(40);
        assert_eq!(world.last.unwrap().trajectory_id, 5);
        world.executive.stop(StopOrigin::Signal).unwrap();
        world.run(1_000);
        let last = world.last.unwrap();
        assert_eq!(last.state, LoopState::Holding);
        let at = evaluate(&joined.knots, &mut 0, last.path_time_s).position;
        assert!((last.commanded.position - at).norm() < 1e-9);
    }

    #[test]
    fn what_cannot_be_joined_is_refused_by_name_and_the_old_motion_goes_on() {
        let (mut world, left) = executing(400);
        let now_s = world.last.unwrap().path_time_s;
        let to = Configuration::from(OTHER);
        let refused = |world: &mut World, motion: Motion, code: Refusal| {
            let reason = take(world, motion, &left).unwrap_err();
            assert_eq!(reason.code(), code, "{reason}");
        };
        let good = joined_motion(5, &left, now_s + 0.02, to);
        let mut stepped = good.clone();
        stepped.knots[0].acceleration[2] += 2e-9;
        refused(&mut world, stepped, Refusal::Discontinuous);
        let mut other = good.clone();
        other.leaves = Some(Departure {
            trajectory_id: 3,
            path_time_s: now_s + 0.02,
        });
        refused(&mut world, other, Refusal::LeavesAnother);
        let late = joined_motion(5, &left, now_s - 0.001, to);
        refused(&mut world, late, Refusal::SwitchMissed);
        let knot = left
            .knots
            .iter()
            .find(|knot| knot.time > now_s + 0.01)
            .unwrap();
        let at_knot = joined_motion(5, &left, knot.time + 1e-4, to);
        refused(&mut world, at_knot, Refusal::SwitchAtKnot);
        world.executive.stop(StopOrigin::Signal).unwrap();
        world.cycle(MS);
        refused(&mut world, good, Refusal::Busy);
        world.run(1_000);
        assert_eq!(world.last.unwrap().state, LoopState::Holding);
    }

    #[test]
    fn a_second_switch_waits_for_the_first() {
        let (mut world, left) = executing(400);
        let first = join(&mut world, &left, 5, 0.05).unwrap();
        world.run(1);
        let second = joined_motion(6, &first, 0.03, target_configuration());
        let reason = take(&mut world, second.clone(), &first).unwrap_err();
        assert_eq!(reason, TrajectoryRefusal::Waiting);
        while world.last.unwrap().pending_trajectory_id != 0 {
            world.run(1);
        }
        take(&mut world, second, &first).unwrap();
        world.run(100);
        assert_eq!(world.last.unwrap().trajectory_id, 6);
    }

    #[test]
    fn a_fault_before_the_switch_brings_the_robot_to_rest_on_the_old_path() {
        let (mut world, left) = executing(400);
        join(&mut world, &left, 5, 0.05).unwrap();
        world.run(5);
        world.guard_held_up = true;
        world.executive.pause().unwrap();
        world.run(200);
        let last = world.last.unwrap();
        assert_eq!(last.state, LoopState::Fault);
        let at = evaluate(&left.knots, &mut 0, last.path_time_s).position;
        assert!((last.commanded.position - at).norm() < 1e-9);
    }

    #[test]
    fn a_motion_at_rest_is_not_taken_in_motion() {
        let (mut world, left) = executing(400);
        let from = world.commanded();
        let motion = curved_motion(5, world.now_ns, from, Configuration::from(OTHER));
        let reason = take(&mut world, motion, &left).unwrap_err();
        assert_eq!(reason.code(), Refusal::Busy);
    }
}
