//! A trajectory as the loop follows it.

use shared_types::capacity::MAX_KNOTS;
use trajectory::Knot;

/// A trajectory in memory of our own, made once and filled again and again.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Id of the trajectory, at least 1.
    pub id: u32,
    /// The plan that the trajectory was selected from.
    pub plan_id: u64,
    /// Instance of the daemon that has published the trajectory.
    pub daemon_instance: u64,
    /// When the motion was requested, ns of CLOCK_MONOTONIC.
    pub requested_ns: i64,
    /// When the motion begins, ns of CLOCK_MONOTONIC.
    pub begin_ns: i64,
    /// Tracking error that the trajectory's certificate covers, rad.
    pub path_tolerance_rad: f64,
    /// The motion that it leaves, and where; `None` where it begins at rest.
    pub leaves: Option<Departure>,
    /// The knots of the motion. Where it leaves another one, those of that motion come first that are ahead of the loop, at times
    /// below 0.
    pub knots: Vec<Knot>,
}

/// The place at which one motion goes over into another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Departure {
    /// Id of the motion that is left.
    pub trajectory_id: u32,
    /// Its path time there, s; the path time of the other one is 0.
    pub path_time_s: f64,
}

impl Motion {
    /// An empty motion with room for every trajectory.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            id: 0,
            plan_id: 0,
            daemon_instance: 0,
            requested_ns: 0,
            begin_ns: 0,
            path_tolerance_rad: 0.0,
            leaves: None,
            knots: Vec::with_capacity(2 * MAX_KNOTS),
        }
    }

    /// Duration, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.knots.last().map_or(0.0, |knot| knot.time)
    }
}
