//! Out of the way of obstacles that move: where no path to the goal is certified, a robot at rest goes to where it can stay clear of them, the
//! nearer to the goal the better.

use crate::motion::along_polyline::append;
use crate::motion::among_moving_balls::resting;
use crate::path::waypoints::straight_path;
use crate::pipeline::context::RequestContext;
use crate::pipeline::goal_set::goal_set;
use crate::plan::{Candidate, Certified, Failure};
use crate::search::random_configuration::random_configuration;
use codes::Source;
use pcc_model::Configuration;
use rayon::prelude::*;
use trajectory::Trajectory;

/// Shares of the straight ways to the goal configurations at which the robot may stay.
const SHARES_OF_THE_WAY: [f64; 5] = [0.15, 0.3, 0.5, 0.7, 0.9];
/// Shares of the straight ways to random configurations at which it may stay.
const SHARES_OF_RANDOM_WAYS: [f64; 2] = [0.15, 0.4];
/// Random configurations.
const RANDOM: usize = 24;
/// Time for which the robot must be able to stay, s: a slow ball takes so long to pass.
const STAY_S: f64 = 20.0;
/// Time by which another place must be nearer to the goal than one where the robot can stay, s.
const WORTH_A_MOTION_S: f64 = 0.3;
/// Places that are tried at once.
const AT_ONCE: usize = 8;

/// A certified motion from rest to the place nearest to the goal, of some, where the robot can stay; none where it may as well stay where it is.
pub(crate) fn evade(context: &RequestContext) -> Option<Candidate> {
    let (constraints, start) = (&context.constraints, context.problem.start);
    if constraints
        .moving
        .may_touch_at_once(constraints.padded, &start)
    {
        return None;
    }
    let goals = goal_set(context).ok()?.distinct;
    let remaining_s = |place: &Configuration| {
        let least_s = |goal: &Configuration| constraints.least_duration_s(&[*place, *goal]);
        goals.iter().map(least_s).fold(f64::INFINITY, f64::min)
    };
    let stays = resting(&start, STAY_S).is_some_and(|rest| constraints.certify(&rest).is_ok());
    let least_s = if stays {
        remaining_s(&start) - WORTH_A_MOTION_S
    } else {
        f64::INFINITY
    };
    let with_remaining = places(context, &goals).into_iter();
    let with_remaining = with_remaining.map(|place| (remaining_s(&place), place));
    let mut places: Vec<_> = with_remaining.filter(|(s, _)| *s < least_s).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let motion = |(_, place): &(f64, Configuration)| to_stay(context, place).ok();
    let motion = places.chunks(AT_ONCE).find_map(|some| {
        let motions: Vec<_> = some.par_iter().map(motion).collect();
        motions.into_iter().flatten().next()
    })?;
    Some(Candidate::of(0, Source::StraightLine, &motion))
}

/// Places where the robot may stay: on the way to goal configurations and to random ones.
fn places(context: &RequestContext, goals: &[Configuration]) -> Vec<Configuration> {
    let start = context.problem.start;
    let mut rng = context.tree_rng(0);
    let mut places = Vec::new();
    for goal in goals {
        places.extend(SHARES_OF_THE_WAY.map(|share| start.lerp(goal, share)));
    }
    for _ in 0..RANDOM {
        let other = random_configuration(&context.resources.robot, &mut rng);
        places.extend(SHARES_OF_RANDOM_WAYS.map(|share| start.lerp(&other, share)));
    }
    places
}

/// The straight motion to a place, certified with the stay there.
fn to_stay(context: &RequestContext, place: &Configuration) -> Result<Certified, Failure> {
    let constraints = &context.constraints;
    if (constraints.interrupt)() {
        return Err(Failure::Truncated);
    }
    let motion = constraints.time(&straight_path(&context.problem.start, place))?;
    let mut knots = motion.knots().to_vec();
    append(&mut knots, &resting(place, STAY_S).ok_or(Failure::Time)?);
    let with_stay = Trajectory::new(knots).map_err(|_| Failure::Time)?;
    let clearance = constraints.certify(&with_stay)?;
    Ok(constraints.describe(motion, clearance))
}
