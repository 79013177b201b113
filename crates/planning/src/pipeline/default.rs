//! The default planner: learned candidates, beside which straight segments compete, and trees for what is missing.

use crate::pipeline::context::{Drawn, RequestContext, share};
use crate::pipeline::goal_set::GoalSet;
use crate::pipeline::learned::learned_and_kept;
use crate::pipeline::missing_goals::reach_missing;
use crate::pipeline::previous_plan::keep;
use crate::pipeline::straight_line::StraightLineCandidates;
use crate::pipeline::trees::first_motion;
use crate::plan::{Draw, count_learned};
use crate::stage_times::StageTimes;
use codes::Stage;
use std::time::Instant;

/// A learned path to each goal configuration; where a straight segment is the fastest motion of all, it takes the place of the learned
/// path to the same configuration; draws without a motion are then filled.
///
/// What is delivered does not depend on the selection rule.
pub(crate) fn draw(context: &RequestContext, goals: &GoalSet, times: &mut StageTimes) -> Drawn {
    let clock = Instant::now();
    let candidates = StraightLineCandidates::new(context, &goals.distinct);
    let (learned, kept) = learned_and_kept(context, goals, &candidates);
    let (segments, winner) = candidates.decide(&learned);
    let wall_s = clock.elapsed().as_secs_f64();
    let [mut draws, kept, mut segments] = share(times, wall_s, [learned, kept, segments]);
    let learned = count_learned(&draws);
    if let Some((goal, segment)) = winner {
        draws[goal] = segments.swap_remove(segment);
    }
    keep(kept, &mut draws);
    times.measure(Stage::Select, || fill(context, goals, &mut draws));
    Drawn {
        draws,
        learned,
        explored: 0,
    }
}

/// Reaches the goal configurations that no motion reaches yet from the motions of the others, where nothing moves; where no draw has a motion, trees find a
/// first one.
fn fill(context: &RequestContext, goals: &GoalSet, draws: &mut [Draw]) {
    if draws.iter().all(|draw| draw.outcome.is_err()) {
        if let Some((i, draw)) = first_motion(context, goals) {
            context.report(i, &draw);
            draws[i] = draw;
        }
        context.note_truncation(&mut draws[0]);
    }
    // Where balls move, most of what is missing is in their way, whatever the path.
    if context.constraints.moving.is_empty() {
        reach_missing(context, &goals.of_each_draw, draws);
    }
}
