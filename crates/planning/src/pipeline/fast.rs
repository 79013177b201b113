//! The learned few-step sampler alone, beside what remains of the motion that is followed.

use crate::pipeline::context::{Drawn, RequestContext, share};
use crate::pipeline::exploring::explore;
use crate::pipeline::goal_set::GoalSet;
use crate::pipeline::learned::learned_and_kept;
use crate::pipeline::previous_plan::keep;
use crate::pipeline::straight_line::StraightLineCandidates;
use crate::plan::count_learned;
use crate::stage_times::StageTimes;
use std::time::Instant;

/// A learned path to each goal configuration; where no motion of these is certified, many more paths are drawn.
pub(crate) fn draw(context: &RequestContext, goals: &GoalSet, times: &mut StageTimes) -> Drawn {
    let clock = Instant::now();
    let without_segments = StraightLineCandidates::new(context, &[]);
    let (learned, kept) = learned_and_kept(context, goals, &without_segments);
    let wall_s = clock.elapsed().as_secs_f64();
    let [mut draws, kept] = share(times, wall_s, [learned, kept]);
    let learned = count_learned(&draws);
    keep(kept, &mut draws);
    Drawn {
        learned,
        explored: explore(context, goals, &mut draws, times),
        draws,
    }
}
