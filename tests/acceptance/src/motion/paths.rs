//! Whether each set-point in motion is on the path of the motion that it is said to follow.

use std::collections::BTreeMap;

use pcc_model::{Configuration, Robot};
use tests::listener::{Heard, Published};
use trajectory::{Knot, Trajectory};

use super::figures::is_on_its_way;
use crate::safe::on_path::Along;

/// The farthest of all.
#[derive(Default)]
pub(super) struct OffPath {
    pub(super) farthest_rad: f64,
    pub(super) place: String,
    pub(super) looked_at: usize,
}

impl OffPath {
    /// Looks at all cycles in which the robot moves on a motion.
    pub(super) fn look(&mut self, robot: &Robot, heard: &Heard) {
        let paths: BTreeMap<u32, Trajectory> = heard.motions.iter().filter_map(path).collect();
        let mut along = BTreeMap::new();
        for cycle in heard.cycles.iter().filter(|cycle| is_on_its_way(cycle)) {
            let id = cycle.trajectory_id;
            self.looked_at += 1;
            let Some(path) = paths.get(&id) else {
                self.note(f64::INFINITY, format!("trajectory {id} was not published"));
                continue;
            };
            let along = along.entry(id).or_insert_with(|| Along::new(robot, path));
            let nearest = along.nearest(cycle);
            let place = format!("trajectory {id} at {:.4} s", nearest.time_s);
            self.note(nearest.distance_rad, place);
        }
    }

    fn note(&mut self, distance_rad: f64, place: String) {
        if distance_rad.is_nan() || distance_rad > self.farthest_rad {
            (self.farthest_rad, self.place) = (distance_rad, place);
        }
    }
}

/// A motion as it was published, by its id.
pub(super) fn path(motion: &Published) -> Option<(u32, Trajectory)> {
    let knots = motion.knots.iter().map(|knot| {
        let [position, velocity, acceleration] = knot.values.map(Configuration::from);
        Knot {
            time: knot.time_s,
            position,
            velocity,
            acceleration,
        }
    });
    Some((motion.id, Trajectory::new(knots.collect()).ok()?))
}
