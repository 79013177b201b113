//! The validated report of an answer.

use std::fmt::{self, Display, Formatter};
use std::ops::Range;

use super::check::{check_code, check_count, check_version, check_within};
use super::invalid::{Invalid, Reason, invalid, invalid_at};
use crate::capacity::{MAX_CANDIDATES, MAX_KNOTS, STAGES};
use crate::codes::{MotionStart, Outcome, PlanField, Source, Stage};
use crate::message::{self, CandidateSummary, NONE_SELECTED};

/// A plan's report whose counts and ranges fit its knots.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanReport {
    /// The request's number.
    pub request_id: u64,
    /// The daemon's number of this plan.
    pub plan_id: u64,
    /// Hash of all candidates' knots.
    pub plan_hash: u64,
    /// The robot that is planned for ([`message::RobotDescription::robot_hash`]).
    pub robot_hash: u64,
    /// The daemon's weights ([`message::RobotDescription::weights_hash`]).
    pub weights_hash: u64,
    /// What became of the request.
    pub outcome: Outcome,
    /// The text that explains the outcome.
    pub reason: String,
    /// How the candidates begin.
    pub start: MotionStart,
    /// The field that was wrong, if the request was invalid.
    pub invalid_field: PlanField,
    /// Index of the selected candidate, if one is.
    pub selected: Option<usize>,
    /// Id under which the selected candidate was published for execution, if it was.
    pub trajectory_id: Option<u32>,
    /// Draws of the learned sampler.
    pub learned_drawn: u32,
    /// Draws of the learned sampler that were certified.
    pub learned_certified: u32,
    /// Candidates that the classical planner filled in.
    pub classical_certified: u32,
    /// Time of each stage, nanoseconds.
    pub stages_ns: [u64; STAGES],
    /// The candidates' summaries.
    pub candidates: Vec<CandidateSummary>,
}

impl PlanReport {
    /// Copies and checks a report whose answer carries `knot_total` knots.
    ///
    /// # Errors
    /// [`Invalid`]: the sender is no daemon of this version.
    pub fn try_new(wire: &message::PlanReport, knot_total: usize) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let count = check_count("candidate_count", wire.candidate_count, 0, MAX_CANDIDATES)?;
        let candidates = wire.candidates[..count].to_vec();
        for (index, candidate) in candidates.iter().enumerate() {
            check_candidate(candidate, knot_total)
                .map_err(|reason| invalid_at("candidates", index, reason))?;
        }
        Ok(Self {
            request_id: wire.request_id,
            plan_id: wire.plan_id,
            plan_hash: wire.plan_hash,
            robot_hash: wire.robot_hash,
            weights_hash: wire.weights_hash,
            outcome: check_code("outcome", wire.outcome)?,
            reason: wire.reason.to_string(),
            start: check_code("start", wire.start)?,
            invalid_field: check_code("invalid_field", wire.invalid_field)?,
            selected: selected(wire.selected, count)?,
            trajectory_id: (wire.trajectory_id != 0).then_some(wire.trajectory_id),
            learned_drawn: wire.learned_drawn,
            learned_certified: wire.learned_certified,
            classical_certified: wire.classical_certified,
            stages_ns: wire.stages_ns,
            candidates,
        })
    }

    /// Time of one stage, nanoseconds.
    #[must_use]
    pub fn stage_ns(&self, stage: Stage) -> u64 {
        self.stages_ns[stage.code() as usize]
    }

    /// Where a candidate's knots are in the answer's slice.
    #[must_use]
    pub fn knot_range(&self, candidate: usize) -> Range<usize> {
        let first = self.candidates[candidate].first_knot as usize;
        first..first + self.candidates[candidate].knot_count as usize
    }
}

/// As in `no path: the goal is enclosed; hash 5f3a9c0112345678`.
impl Display for PlanReport {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.outcome)?;
        if !self.reason.is_empty() {
            write!(formatter, ": {}", self.reason)?;
        }
        write!(formatter, "; hash {:016x}", self.plan_hash)
    }
}

fn selected(selected: u32, count: usize) -> Result<Option<usize>, Invalid> {
    match selected {
        NONE_SELECTED => Ok(None),
        index if (index as usize) < count => Ok(Some(index as usize)),
        index => {
            let most = count.saturating_sub(1) as u64;
            Err(invalid(
                "selected",
                Reason::Count {
                    count: u64::from(index),
                    least: 0,
                    most,
                },
            ))
        }
    }
}

fn check_candidate(candidate: &CandidateSummary, knot_total: usize) -> Result<(), Reason> {
    Source::try_from(candidate.source).map_err(Reason::Code)?;
    let (first, count) = (
        u64::from(candidate.first_knot),
        u64::from(candidate.knot_count),
    );
    check_within(count, 2, MAX_KNOTS as u64)?;
    check_within(first + count, 2, knot_total as u64)?;
    // The clearance may be infinite, so only NaN is wrong.
    let figures = [
        candidate.duration_s,
        candidate.tip_path_m,
        candidate.clearance_m,
        candidate.smoothness,
        candidate.tip_error_m,
    ];
    match figures.into_iter().find(|figure| figure.is_nan()) {
        Some(value) => Err(Reason::NotFinite { value }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PROTOCOL_VERSION;
    use crate::valid::BadCase;

    const KNOTS: usize = 20;

    fn wire() -> message::PlanReport {
        let mut wire = message::PlanReport {
            protocol_version: PROTOCOL_VERSION,
            candidate_count: 2,
            selected: 1,
            ..message::PlanReport::ZEROED
        };
        for (index, candidate) in wire.candidates[..2].iter_mut().enumerate() {
            *candidate = CandidateSummary {
                first_knot: 10 * index as u32,
                knot_count: 10,
                source: 1,
                clearance_m: f64::INFINITY,
                ..CandidateSummary::ZEROED
            };
        }
        wire
    }

    #[test]
    fn a_good_report_is_read_as_it_was_written() {
        let report = PlanReport::try_new(&wire(), KNOTS).unwrap();
        assert_eq!(report.selected, Some(1));
        assert_eq!(report.trajectory_id, None);
        assert_eq!(report.knot_range(1), 10..20);
        let none = message::PlanReport {
            selected: NONE_SELECTED,
            ..wire()
        };
        assert_eq!(PlanReport::try_new(&none, KNOTS).unwrap().selected, None);
    }

    #[test]
    fn a_report_that_leads_outside_its_knots_is_refused() {
        let changes: &[BadCase<message::PlanReport>] = &[
            (|r| r.protocol_version = 0, "protocol_version"),
            (|r| r.candidate_count = 65, "candidate_count"),
            (|r| r.outcome = 99, "outcome"),
            (|r| r.invalid_field = 99, "invalid_field"),
            (|r| r.start = 2, "start"),
            (|r| r.selected = 2, "selected"),
            (|r| r.candidates[1].first_knot = 11, "candidates[1]"),
            (|r| r.candidates[0].first_knot = u32::MAX, "candidates[0]"),
            (|r| r.candidates[0].knot_count = 1, "candidates[0]"),
            (|r| r.candidates[0].knot_count = u32::MAX, "candidates[0]"),
            (|r| r.candidates[0].source = 0, "candidates[0]"),
            (|r| r.candidates[1].duration_s = f64::NAN, "candidates[1]"),
        ];
        for (change, field) in changes {
            let mut wire = wire();
            change(&mut wire);
            let error = PlanReport::try_new(&wire, KNOTS).expect_err(field);
            assert!(
                error.to_string().starts_with(field),
                "{error} does not name {field}"
            );
        }
    }
}
