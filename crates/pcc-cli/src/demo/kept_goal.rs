//! The goal that the daemon keeps the robot on its way to, as the demonstration gives it: what becomes of it, and how the motions to
//! it end.

use super::controller_state::TIMEOUT;
use client::{ClientError, GoalSender, ResultView};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{GoalState, MotionOutcome};
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, GoalStatus, MotionResult};
use std::collections::BTreeMap;
use std::time::Instant;

/// Changes of the goal's state that are printed.
const SHOWN: usize = 16;

/// A goal, its states with times, and the results of motions since it was given.
pub(super) struct KeptGoal {
    sender: GoalSender,
    results: ResultView,
    begun: Instant,
    begun_ns: i64,
    states: Vec<(f64, GoalState, String)>,
    latest: Option<GoalStatus>,
    ended: Vec<MotionResult>,
}

impl KeptGoal {
    /// Joins the services; no goal is given yet.
    pub(super) fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        Ok(Self {
            sender: GoalSender::connect(options)?,
            results: ResultView::connect(options)?,
            begun: Instant::now(),
            begun_ns: mono_now_ns(),
            states: Vec::new(),
            latest: None,
            ended: Vec::new(),
        })
    }

    /// Gives the goal at the whole limits.
    pub(super) fn give(&mut self, goal: Goal) -> Result<(), ClientError> {
        (self.begun, self.begun_ns) = (Instant::now(), mono_now_ns());
        self.sender.give(goal, 1.0)?;
        self.sender.confirm(TIMEOUT).map(drop)
    }

    /// Says where the goal is, and how fast (m/s).
    pub(super) fn move_to(
        &mut self,
        goal: Goal,
        velocity_m_s: [f64; 3],
    ) -> Result<(), ClientError> {
        self.sender.move_to(goal, velocity_m_s)
    }

    /// Takes in what the daemon and the controller have told; returns what becomes of the goal as it was sent last, none before the
    /// daemon has heard that. Call it at least once in the time of sixteen motions.
    pub(super) fn look(&mut self) -> Result<Option<GoalStatus>, ClientError> {
        self.results.drain(&mut self.ended)?;
        let begun_ns = self.begun_ns;
        // Those of motions before come first.
        self.ended
            .retain(|ended| ended.values.stamp_mono_ns >= begun_ns);
        let status = self.sender.status()?;
        self.latest = status.or(self.latest);
        if let Some(status) = status
            && self.states.last().map(|(_, state, _)| *state) != Some(status.state)
        {
            let after_s = self.begun.elapsed().as_secs_f64();
            self.states
                .push((after_s, status.state, status.to_string()));
        }
        Ok(status.filter(|status| self.sender.has_heard_last(status)))
    }

    /// The newest status of the goal, also of where it was before.
    pub(super) fn latest(&self) -> Option<&GoalStatus> {
        self.latest.as_ref()
    }

    /// Gives the goal up.
    pub(super) fn withdraw(&mut self) -> Result<(), ClientError> {
        self.sender.withdraw()?;
        self.sender.confirm(TIMEOUT).map(drop)
    }

    /// Whether a trajectory has ended.
    pub(super) fn has_ended(&self, trajectory_id: u32) -> bool {
        let mut ended = self.ended.iter();
        ended.any(|result| result.values.trajectory_id == trajectory_id)
    }

    /// How the motions have ended.
    pub(super) fn results(&self) -> Results<'_> {
        Results(&self.ended)
    }

    /// Prints the goal's states with their times, seconds since it was given.
    pub(super) fn print_states(&self) {
        for (after_s, _, text) in self.states.iter().take(SHOWN) {
            say!("    {after_s:6.2} s  {text}");
        }
        if self.states.len() > SHOWN {
            say!("    and {} changes more", self.states.len() - SHOWN);
        }
    }
}

/// Results of motions in the order in which they came.
pub(super) struct Results<'a>(&'a [MotionResult]);

impl Results<'_> {
    /// How many motions had each outcome.
    pub(super) fn counts(&self) -> BTreeMap<&'static str, usize> {
        let mut counts = BTreeMap::new();
        for result in self.0 {
            *counts.entry(result.outcome.text()).or_default() += 1;
        }
        counts
    }

    /// Results of one controller that did not arrive.
    pub(super) fn missing(&self) -> u64 {
        let gap = |pair: &[MotionResult]| {
            let [before, after] = [&pair[0].values, &pair[1].values];
            let is_same = before.instance == after.instance;
            let gap = after.sequence.saturating_sub(before.sequence + 1);
            if is_same { gap } else { 0 }
        };
        self.0.windows(2).map(gap).sum()
    }

    /// Prints how many motions had each outcome, and the result of each; of those that follow each other, each joined by the next, in one line.
    pub(super) fn print(&self) {
        let counts = self.counts();
        let text = |(outcome, count): (&&str, &usize)| format!("{count} {outcome}");
        let counts: Vec<String> = counts.iter().map(text).collect();
        say!("  motions: {}", counts.join(", "));
        let is_next = |before: &MotionResult, after: &MotionResult| {
            let is_joined = before.outcome == MotionOutcome::Joined;
            is_joined && before.values.joined_by == after.values.trajectory_id
        };
        for chain in self.0.chunk_by(is_next) {
            let Some((last, joined)) = chain.split_last() else {
                continue;
            };
            if !joined.is_empty() {
                let ids = joined.iter().map(|it| it.values.trajectory_id);
                let ids: Vec<u32> = ids.collect();
                say!(
                    "    trajectories {}: each joined by the next one",
                    ranges(&ids)
                );
            }
            say!("    trajectory {} {last}", last.values.trajectory_id);
        }
    }
}

/// Numbers in their order, those that follow each other as a range.
fn ranges(numbers: &[u32]) -> String {
    let runs = numbers.chunk_by(|before, after| before.checked_add(1) == Some(*after));
    let text = |run: &[u32]| match run {
        [first, .., last] => format!("{first} to {last}"),
        run => run.iter().map(u32::to_string).collect(),
    };
    runs.map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_types::message;

    fn ended(instance: u64, sequence: u64, outcome: MotionOutcome) -> MotionResult {
        let joined_by = u32::from(outcome == MotionOutcome::Joined);
        MotionResult::try_from(&message::MotionResult {
            instance,
            sequence,
            outcome: outcome.code(),
            joined_by,
            ..message::MotionResult::ZEROED
        })
        .unwrap()
    }

    #[test]
    fn outcomes_are_counted_and_what_did_not_arrive_is_missing() {
        use MotionOutcome::{Joined, Reached};
        let all = [
            ended(7, 4, Joined),
            ended(7, 5, Joined),
            ended(7, 8, Reached),
        ];
        let counts = Results(&all).counts();
        assert_eq!(counts["joined by another trajectory"], 2);
        assert_eq!(counts["reached"], 1);
        assert_eq!(Results(&all).missing(), 2);
        assert_eq!(Results(&all[..2]).missing(), 0);
        let other = [ended(7, 9, Joined), ended(8, 1, Reached)];
        assert_eq!(Results(&other).missing(), 0);
        assert_eq!(Results(&[]).missing(), 0);
    }
}
