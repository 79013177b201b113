//! Goals that stay, as a record tells of them: they are not given again, since what is planned for them depends on when.

use std::collections::{BTreeMap, BTreeSet};

use shared_types::codes::GoalState;
use shared_types::message::{GoalStatus, StandingGoal};

use super::recording::Recording;

/// What programs have said of goals, and what has become of these.
#[derive(Debug, Default, PartialEq)]
struct Goals {
    given: usize,
    moved: usize,
    withdrawn: usize,
    /// Changes of the status, counted by what it has become.
    changes: BTreeMap<String, usize>,
}

/// Says what of a record is not replayed; nothing where there were no goals.
pub(super) fn report(recording: &Recording) {
    let goals = Goals::of(&recording.goals, &recording.goal_statuses);
    if goals == Goals::default() {
        return;
    }
    say!(
        "left out: {} goals that stay, {} times moved, {} withdrawn; plans to them are plans as all others",
        goals.given,
        goals.moved,
        goals.withdrawn
    );
    for (state, count) in goals.changes {
        say!("left out: {count} times a goal's status became: {state}");
    }
}

impl Goals {
    fn of(goals: &[StandingGoal], statuses: &[GoalStatus]) -> Self {
        let (mut all, mut known) = (Self::default(), BTreeSet::new());
        for goal in goals {
            let is_new = known.insert(goal.given_mono_ns);
            *match (goal.is_withdrawn, is_new) {
                (0, true) => &mut all.given,
                (0, false) => &mut all.moved,
                _ => &mut all.withdrawn,
            } += 1;
        }
        let mut before = None;
        for status in statuses {
            let now = (status.given_mono_ns, status.state);
            if before.replace(now) != Some(now) {
                let state = GoalState::try_from(status.state);
                let text = state.map_or_else(|unknown| unknown.to_string(), |it| it.to_string());
                *all.changes.entry(text).or_default() += 1;
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn goal(given_mono_ns: i64, is_withdrawn: u32) -> StandingGoal {
        StandingGoal {
            given_mono_ns,
            is_withdrawn,
            ..StandingGoal::ZEROED
        }
    }

    fn status(given_mono_ns: i64, state: GoalState) -> GoalStatus {
        GoalStatus {
            given_mono_ns,
            state: state.code(),
            ..GoalStatus::ZEROED
        }
    }

    #[test]
    fn goals_are_counted_by_what_was_said_of_them_and_statuses_by_their_changes() {
        let heard = [goal(1, 0), goal(1, 0), goal(1, 0), goal(2, 0), goal(2, 1)];
        let told = [
            status(1, GoalState::Planning),
            status(1, GoalState::Underway),
            status(1, GoalState::Underway),
            status(2, GoalState::Underway),
            status(2, GoalState::Ended),
        ];
        let expected = [("ended", 1), ("on the way", 2), ("planning", 1)];
        assert_eq!(
            Goals::of(&heard, &told),
            Goals {
                given: 2,
                moved: 2,
                withdrawn: 1,
                changes: expected
                    .map(|(state, count)| (state.to_owned(), count))
                    .into(),
            }
        );
        assert_eq!(Goals::of(&[], &[]), Goals::default());
    }
}
