//! Figures of a planner over some cases, and of pairs of planners case by case.

use super::case_log::{CaseRecord, MotionRecord};
use crate::averages::{mean, median};
use crate::bootstrap::{Interval, interval};
use serde::Serialize;
use std::collections::BTreeMap;

/// Figures of a planner over some cases, each with its interval over targets.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Figures {
    pub(super) cases: usize,
    /// Share of the candidates asked for that succeed by the paper's criterion as they were drawn.
    pub(super) success: Interval,
    /// Share of the candidates asked for that are certified motions.
    pub(super) certified: Interval,
    /// Share of the cases with a certified motion.
    pub(super) answered: Interval,
    /// Median time of a request, s.
    pub(super) request_s: Interval,
    /// Time of all requests, until the drawn paths were there, ÷ those that succeed by the paper's criterion, s.
    pub(super) seconds_a_success: Interval,
    /// Time of all requests ÷ certified motions, s.
    pub(super) seconds_a_certified: Interval,
    /// Medians over certified motions.
    pub(super) tip_length_ratio: Interval,
    pub(super) tip_smoothness: Interval,
    pub(super) duration_s: Interval,
    /// Mean number of terminal modes of a case's certified motions.
    pub(super) modes: Interval,
}

/// A planner's figures on a set, of all cases and of those with so many balls.
#[derive(Debug, Serialize)]
pub(super) struct ByBalls {
    pub(super) all: Figures,
    pub(super) by_balls: BTreeMap<usize, Figures>,
}

/// A planner against another one, case by case.
#[derive(Debug, Serialize)]
pub(super) struct Paired {
    /// Certified share less the other's.
    pub(super) certified_ahead: Interval,
    /// Success by the paper's criterion less the other's.
    pub(super) success_ahead: Interval,
    /// Mean time of a request less the other's, s.
    pub(super) request_longer_s: Interval,
    /// Mean number of terminal modes less the other's.
    pub(super) modes_ahead: Interval,
    /// Of the cases in which both have certified motions, the share in which its median is less than the other's.
    pub(super) tip_shorter: Interval,
    pub(super) tip_smoother: Interval,
    pub(super) faster: Interval,
    /// The share in which both tip length and smoothness are less.
    pub(super) tip_shorter_and_smoother: Interval,
    /// The share in which it is more.
    pub(super) tip_longer: Interval,
    pub(super) tip_rougher: Interval,
    pub(super) slower: Interval,
    /// Mean over those cases of the median tip length ÷ the other's.
    pub(super) tip_length_ratio: Interval,
    /// The smallest and the largest of those ratios; none where there is none.
    pub(super) shortest_tip: Option<f64>,
    pub(super) longest_tip: Option<f64>,
    /// Cases in which both have certified motions.
    pub(super) both: usize,
    /// Cases in which only the other one has.
    pub(super) only_other: usize,
}

impl ByBalls {
    pub(super) fn of(records: &[CaseRecord]) -> Self {
        let mut groups: BTreeMap<usize, Vec<CaseRecord>> = BTreeMap::new();
        for record in records {
            groups.entry(record.balls).or_default().push(record.clone());
        }
        let of_group = |(balls, records): (usize, Vec<CaseRecord>)| (balls, Figures::of(&records));
        Self {
            all: Figures::of(records),
            by_balls: groups.into_iter().map(of_group).collect(),
        }
    }
}

impl Figures {
    pub(super) fn of(records: &[CaseRecord]) -> Self {
        let target = |record: &CaseRecord| record.target;
        let a_case = |figure: fn(&CaseRecord) -> f64| {
            interval(records, target, move |records| {
                mean(records.iter().map(|record| figure(record)))
            })
        };
        let median_of = |figure: fn(&MotionRecord) -> f64| {
            interval(records, target, move |records| {
                let motions = records.iter().flat_map(|record| &record.motions);
                median(motions.map(figure))
            })
        };
        let seconds_of_one = |seconds: fn(&CaseRecord) -> f64, count: fn(&CaseRecord) -> usize| {
            interval(records, target, move |records| {
                let made: usize = records.iter().map(|record| count(record)).sum();
                let seconds: f64 = records.iter().map(|record| seconds(record)).sum();
                (made > 0).then(|| seconds / made as f64)
            })
        };
        Self {
            cases: records.len(),
            success: a_case(success),
            certified: a_case(certified),
            answered: a_case(|record| f64::from(u8::from(!record.motions.is_empty()))),
            request_s: interval(records, target, |records| {
                median(records.iter().map(|record| record.seconds))
            }),
            seconds_a_success: seconds_of_one(|record| record.drawing_s, |record| record.successes),
            seconds_a_certified: seconds_of_one(
                |record| record.seconds,
                |record| record.motions.len(),
            ),
            tip_length_ratio: median_of(|motion| motion.tip_length_ratio),
            tip_smoothness: median_of(|motion| motion.tip_smoothness),
            duration_s: median_of(|motion| motion.duration_s),
            modes: a_case(|record| record.modes as f64),
        }
    }
}

impl Paired {
    /// Two planners' records of the same cases in the same order.
    pub(super) fn of(records: &[CaseRecord], others: &[CaseRecord]) -> Self {
        let pairs: Vec<(&CaseRecord, &CaseRecord)> = records.iter().zip(others).collect();
        let target = |pair: &(&CaseRecord, &CaseRecord)| pair.0.target;
        let ahead = |share: fn(&CaseRecord) -> f64| {
            interval(&pairs, target, move |pairs| {
                mean(pairs.iter().map(|(own, other)| share(own) - share(other)))
            })
        };
        let have_both = |pair: &&(&CaseRecord, &CaseRecord)| {
            !pair.0.motions.is_empty() && !pair.1.motions.is_empty()
        };
        let both: Vec<_> = pairs.iter().filter(have_both).copied().collect();
        let share = |figure: fn(&MotionRecord) -> f64, is: fn(&f64, &f64) -> bool| {
            interval(&both, target, move |pairs| {
                let medians = pairs.iter().filter_map(|pair| medians(pair, figure));
                mean(medians.map(|[own, other]| f64::from(u8::from(is(&own, &other)))))
            })
        };
        let tip_length: fn(&MotionRecord) -> f64 = |motion| motion.tip_length_ratio;
        let tip_smoothness: fn(&MotionRecord) -> f64 = |motion| motion.tip_smoothness;
        let duration_s: fn(&MotionRecord) -> f64 = |motion| motion.duration_s;
        Self {
            certified_ahead: ahead(certified),
            success_ahead: ahead(success),
            request_longer_s: ahead(|record| record.seconds),
            modes_ahead: ahead(|record| record.modes as f64),
            tip_shorter: share(tip_length, f64::lt),
            tip_smoother: share(tip_smoothness, f64::lt),
            faster: share(duration_s, f64::lt),
            tip_shorter_and_smoother: interval(&both, target, move |pairs| {
                let is_less = |pair: &_, figure| {
                    medians(pair, figure).is_some_and(|[own, other]| own < other)
                };
                let are_both = pairs
                    .iter()
                    .map(|pair| is_less(pair, tip_length) && is_less(pair, tip_smoothness));
                mean(are_both.map(|are_both| f64::from(u8::from(are_both))))
            }),
            tip_longer: share(tip_length, f64::gt),
            tip_rougher: share(tip_smoothness, f64::gt),
            slower: share(duration_s, f64::gt),
            tip_length_ratio: interval(&both, target, |pairs| {
                mean(pairs.iter().filter_map(|pair| tip_ratio(pair)))
            }),
            shortest_tip: both.iter().filter_map(tip_ratio).min_by(f64::total_cmp),
            longest_tip: both.iter().filter_map(tip_ratio).max_by(f64::total_cmp),
            both: both.len(),
            only_other: pairs.iter().filter(|it| is_only_other(it)).count(),
        }
    }
}

fn is_only_other((own, other): &(&CaseRecord, &CaseRecord)) -> bool {
    own.motions.is_empty() && !other.motions.is_empty()
}

/// Median tip length of a case ÷ the other planner's.
fn tip_ratio(pair: &(&CaseRecord, &CaseRecord)) -> Option<f64> {
    let [own, other] = medians(pair, |motion| motion.tip_length_ratio)?;
    Some(own / other)
}

fn success(record: &CaseRecord) -> f64 {
    record.successes as f64 / record.asked as f64
}

fn certified(record: &CaseRecord) -> f64 {
    record.motions.len().min(record.asked) as f64 / record.asked as f64
}

/// Medians of a figure over both planners' certified motions of a case.
fn medians(
    (own, other): &(&CaseRecord, &CaseRecord),
    figure: fn(&MotionRecord) -> f64,
) -> Option<[f64; 2]> {
    let own = median(own.motions.iter().map(figure))?;
    Some([own, median(other.motions.iter().map(figure))?])
}
