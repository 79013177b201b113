//! How far ahead a motion must be planned to begin.

use std::time::Duration;

use planning::ToBeDone;
use shared_types::codes::Sampler;

/// Time from a motion that is ready until the controller's loop has it, where that is not to be missed.
pub(super) const TO_THE_LOOP: Duration = Duration::from_micros(2_500);
/// The same of a motion that is published before its plan is whole: among obstacles that rest, where it is sent before its longest stop is found.
pub(super) const EARLY_TO_THE_LOOP: Duration = Duration::from_micros(2_200);
/// Lead of the first requests of a kind, before it is known how long they take.
const FIRST_LEAD: Duration = Duration::from_millis(15);
/// Plans by which the next one's duration is foreseen.
const REMEMBERED: usize = 32;
/// Plans from which on those that were made to warm up do not count any more.
const SOME: usize = 4;

/// What decides how long it takes until a plan's motion can be executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PlanKind {
    pub(crate) sampler: Sampler,
    pub(crate) has_several_goals: bool,
    pub(crate) work: Work,
}

/// What is done from the choice of a switch until a motion is handed over for publication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// The whole plan.
    WholePlan,
    /// The whole plan to the goal that stays.
    WholePlanToKeptGoal,
    /// Straight segments are joined to the motion that is left, of which the fastest motion mostly is one.
    StraightSegments,
    /// The fastest segment alone is joined again, where the switch has come too near meanwhile.
    SegmentAgain,
    /// The fastest path alone is joined again, likewise.
    PathAgain,
    /// The same, and a plan to its goal configuration.
    PathAgainAndPlanningAnew,
    /// A plan to the goal configuration of the fastest motion, which is known.
    PlanningAnew,
    /// Paths that are planned are joined to the motion that is left, until the fastest is known.
    Joining,
    /// The same, and a plan to the goal configuration of the fastest one.
    JoiningAndPlanningAnew,
}

impl From<ToBeDone> for Work {
    fn from(to_be_done: ToBeDone) -> Self {
        match to_be_done {
            ToBeDone::SegmentAgain => Self::SegmentAgain,
            ToBeDone::PathAgain => Self::PathAgain,
            ToBeDone::PathAgainAndPlanningAnew => Self::PathAgainAndPlanningAnew,
            ToBeDone::PlanningAnew => Self::PlanningAnew,
            ToBeDone::Joining => Self::Joining,
            ToBeDone::JoiningAndPlanningAnew => Self::JoiningAndPlanningAnew,
        }
    }
}

impl Work {
    /// What is done from a switch that is chosen while a plan is made.
    pub(super) const FROM_A_LATE_SWITCH: [Self; 6] = [
        Self::SegmentAgain,
        Self::PathAgain,
        Self::PathAgainAndPlanningAnew,
        Self::PlanningAnew,
        Self::Joining,
        Self::JoiningAndPlanningAnew,
    ];

    /// Other work, by the first of which that was done it is foreseen as long as it was not done itself: longer work, or what is most of it.
    fn foreseen_by(self) -> &'static [Self] {
        match self {
            Self::SegmentAgain => &[Self::StraightSegments],
            Self::PlanningAnew => &[Self::WholePlan],
            Self::PathAgain
            | Self::PathAgainAndPlanningAnew
            | Self::Joining
            | Self::JoiningAndPlanningAnew => &[Self::PlanningAnew, Self::WholePlan],
            Self::WholePlan | Self::WholePlanToKeptGoal | Self::StraightSegments => &[],
        }
    }

    /// How carefully the time of the work is foreseen. The goal that stays is followed the more closely the shorter its lead is, and planned
    /// anew all the time; segments and paths that take longer are followed by the fastest once more; any other switch is to be missed but rarely.
    fn foresight(self) -> Foresight {
        match self {
            Self::WholePlanToKeptGoal => Foresight {
                exceptional: 8,
                margin: 1.05,
                to_the_loop: Duration::from_micros(2_000),
            },
            Self::StraightSegments => Foresight {
                exceptional: 4,
                margin: 1.05,
                to_the_loop: EARLY_TO_THE_LOOP,
            },
            Self::PlanningAnew | Self::Joining | Self::JoiningAndPlanningAnew => Foresight {
                exceptional: 8,
                margin: 1.1,
                to_the_loop: EARLY_TO_THE_LOOP,
            },
            Self::SegmentAgain | Self::PathAgain | Self::PathAgainAndPlanningAnew => Foresight {
                exceptional: 32,
                margin: 1.2,
                to_the_loop: EARLY_TO_THE_LOOP,
            },
            Self::WholePlan => Foresight {
                exceptional: 32,
                margin: 1.2,
                to_the_loop: TO_THE_LOOP,
            },
        }
    }
}

/// How carefully a time is foreseen.
#[derive(Clone, Copy)]
struct Foresight {
    /// One in so many may take longer.
    exceptional: usize,
    /// Factor on the longest of the others.
    margin: f64,
    /// Time from a motion that is ready until the controller's loop has it.
    to_the_loop: Duration,
}

/// How long plans of each kind that began in motion took lately, from the choice of their switch until their motion was handed over for
/// publication.
#[derive(Debug, Default)]
pub(crate) struct LeadTimes {
    recent: Vec<(PlanKind, Times)>,
}

/// Times of plans of one kind.
#[derive(Debug, Default)]
struct Times {
    /// Of plans that were made to warm up, while a machine may be busy with its start.
    of_warm_up: Vec<Duration>,
    /// Of the last plans that were asked for, the oldest first.
    of_requests: Vec<Duration>,
    /// The same times, the shortest first.
    of_requests_ascending: Vec<Duration>,
}

impl LeadTimes {
    /// Remembers how long a plan took.
    pub(crate) fn note(&mut self, kind: PlanKind, took: Duration) {
        let times = self.times(kind);
        if times.of_requests.len() == REMEMBERED {
            times.of_requests.remove(0);
        }
        times.of_requests.push(took);
        times.of_requests_ascending.clone_from(&times.of_requests);
        times.of_requests_ascending.sort_unstable();
    }

    /// Remembers how long a plan took that was made to warm up: it counts until some were asked for.
    pub(crate) fn note_warm_up(&mut self, kind: PlanKind, took: Duration) {
        self.times(kind).of_warm_up.push(took);
    }

    fn times(&mut self, kind: PlanKind) -> &mut Times {
        let known = self.recent.iter().position(|(known, _)| *known == kind);
        let index = known.unwrap_or_else(|| {
            self.recent.push((kind, Times::default()));
            self.recent.len() - 1
        });
        &mut self.recent[index].1
    }

    /// How far ahead a plan of this kind is to begin, so that it is in the loop by then.
    pub(super) fn lead(&self, kind: PlanKind) -> Duration {
        let foresight = kind.work.foresight();
        let foreseen = |work| {
            let kind = PlanKind { work, ..kind };
            let known = self.recent.iter().find(|(known, _)| *known == kind);
            known.and_then(|(_, times)| times.longest_usual(foresight.exceptional))
        };
        let others = kind.work.foreseen_by().iter().copied();
        let foreseen = std::iter::once(kind.work).chain(others).find_map(foreseen);
        foreseen.map_or(FIRST_LEAD, |took| {
            took.mul_f64(foresight.margin) + foresight.to_the_loop
        })
    }
}

/// How far ahead a motion is to begin, usually by `usual`, for which work that took so long is done once more.
pub(super) fn lead_of_the_same_work(usual: Duration, took: Duration) -> Duration {
    usual.max(took + TO_THE_LOOP)
}

impl Times {
    /// The longest of the times that count but for one in so many, and for one in a few, which may have met a machine that was busy with
    /// something else.
    fn longest_usual(&self, exceptional: usize) -> Option<Duration> {
        let of_requests = &self.of_requests_ascending;
        if of_requests.len() >= SOME {
            let left_out = (of_requests.len() / exceptional).max(1);
            return of_requests.iter().rev().nth(left_out).copied();
        }
        let mut of_warm_up = self.of_warm_up.clone();
        of_warm_up.sort_unstable();
        of_warm_up.pop();
        of_requests.iter().chain(&of_warm_up).max().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lead_follows_what_plans_took_and_forgets_single_exceptions() {
        let ms = Duration::from_millis;
        for work in [
            Work::WholePlan,
            Work::WholePlanToKeptGoal,
            Work::StraightSegments,
            Work::SegmentAgain,
            Work::PathAgain,
            Work::PathAgainAndPlanningAnew,
            Work::PlanningAnew,
            Work::Joining,
            Work::JoiningAndPlanningAnew,
        ] {
            let Foresight {
                exceptional,
                margin,
                to_the_loop,
            } = work.foresight();
            let lead_of = |took: Duration| took.mul_f64(margin) + to_the_loop;
            let kind = |has_several_goals| PlanKind {
                sampler: Sampler::Default,
                has_several_goals,
                work,
            };
            let mut times = LeadTimes::default();
            assert_eq!(times.lead(kind(false)), FIRST_LEAD);
            for took in [3, 90] {
                times.note_warm_up(kind(false), ms(took));
            }
            assert_eq!(times.lead(kind(false)), lead_of(ms(3)));
            times.note(kind(false), ms(4));
            assert_eq!(times.lead(kind(false)), lead_of(ms(4)));
            for _ in 0..REMEMBERED {
                times.note(kind(false), ms(2));
            }
            for _ in 0..REMEMBERED / exceptional {
                times.note(kind(false), ms(90));
            }
            times.note(kind(true), ms(200));
            assert_eq!(times.lead(kind(false)), lead_of(ms(2)));
            times.note(kind(false), ms(80));
            assert!(times.lead(kind(false)) > ms(80));
        }
    }

    #[test]
    fn work_that_was_never_done_is_foreseen_by_other_work() {
        let kind = |work| PlanKind {
            sampler: Sampler::Default,
            has_several_goals: false,
            work,
        };
        let mut times = LeadTimes::default();
        let of_planning_anew = [
            Work::PathAgain,
            Work::PathAgainAndPlanningAnew,
            Work::Joining,
            Work::JoiningAndPlanningAnew,
        ];
        times.note_warm_up(kind(Work::WholePlan), Duration::from_millis(8));
        times.note_warm_up(kind(Work::WholePlan), Duration::from_millis(8));
        assert!(times.lead(kind(Work::PlanningAnew)) < FIRST_LEAD);
        for work in of_planning_anew {
            assert!(times.lead(kind(work)) < FIRST_LEAD, "{work:?}");
        }
        times.note(kind(Work::PlanningAnew), Duration::from_millis(3));
        for work in of_planning_anew {
            let foresight = work.foresight();
            let lead = Duration::from_millis(3).mul_f64(foresight.margin) + foresight.to_the_loop;
            assert_eq!(times.lead(kind(work)), lead, "{work:?}");
        }
        assert_eq!(times.lead(kind(Work::SegmentAgain)), FIRST_LEAD);
        times.note(kind(Work::Joining), Duration::from_millis(1));
        let known = times.lead(kind(Work::Joining));
        assert!(known < times.lead(kind(Work::PathAgain)));
    }
}
