//! What became of the targets and paths asked for, as `dataset_meta.json` says it.

use crate::expert::report::BlockReport;
use crate::paper::report::PaperReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::AddAssign;

/// What became of the targets and paths asked for.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq, Eq)]
pub struct Counts {
    /// Targets asked for.
    pub requested_targets: usize,
    /// Targets with a path.
    pub actual_targets: usize,
    /// Paths asked for, those of dropped targets too.
    pub requested_paths: usize,
    /// Paths kept: the rows.
    pub actual_paths: usize,
    /// Why targets were dropped, and `total`.
    pub target_discarded_counts: BTreeMap<String, usize>,
    /// Why paths of targets that were not dropped at once are missing, and `total`.
    pub path_failure_counts: BTreeMap<String, usize>,
}

impl From<&PaperReport> for Counts {
    fn from(report: &PaperReport) -> Self {
        let (targets, paths) = (report.target_discarded_counts, report.path_failure_counts);
        Self {
            requested_targets: report.requested_targets,
            actual_targets: report.actual_targets,
            requested_paths: report.requested_paths,
            actual_paths: report.actual_paths,
            target_discarded_counts: with_total([
                ("terminal_ik", targets.terminal_ik),
                ("start_sampling", targets.start_sampling),
                ("zero_retained_paths", targets.zero_retained_paths),
            ]),
            path_failure_counts: with_total([
                ("workspace_ik", paths.workspace_ik),
                ("path_constraints", paths.path_constraints),
                ("collision_repair", paths.collision_repair),
            ]),
        }
    }
}

impl From<&BlockReport> for Counts {
    fn from(report: &BlockReport) -> Self {
        let drawn = report.targets - report.dropped_targets;
        Self {
            requested_targets: report.targets,
            actual_targets: report.targets_with_paths,
            requested_paths: report.requested_paths,
            actual_paths: report.kept,
            target_discarded_counts: with_total([
                ("target_or_start_sampling", report.dropped_targets),
                ("zero_retained_paths", drawn - report.targets_with_paths),
            ]),
            path_failure_counts: with_total([
                ("missing_starts", report.missing_starts),
                ("missing_end_shapes", report.missing_ends),
                ("not_certified", report.dropped_paths),
            ]),
        }
    }
}

fn with_total<const N: usize>(reasons: [(&str, usize); N]) -> BTreeMap<String, usize> {
    let total = ("total", reasons.iter().map(|(_, count)| count).sum());
    let all = reasons.into_iter().chain([total]);
    all.map(|(reason, count)| (reason.to_owned(), count))
        .collect()
}

impl AddAssign<&Counts> for Counts {
    fn add_assign(&mut self, other: &Self) {
        self.requested_targets += other.requested_targets;
        self.actual_targets += other.actual_targets;
        self.requested_paths += other.requested_paths;
        self.actual_paths += other.actual_paths;
        for (sums, more) in [
            (
                &mut self.target_discarded_counts,
                &other.target_discarded_counts,
            ),
            (&mut self.path_failure_counts, &other.path_failure_counts),
        ] {
            for (reason, count) in more {
                *sums.entry(reason.clone()).or_default() += count;
            }
        }
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |reasons: &BTreeMap<String, usize>| {
            let reasons = reasons.iter().filter(|(reason, _)| *reason != "total");
            let texts: Vec<_> = reasons.map(|(reason, n)| format!("{reason} {n}")).collect();
            texts.join(", ")
        };
        write!(
            f,
            "{} of {} targets have paths (dropped: {}); {} of {} paths kept (dropped: {})",
            self.actual_targets,
            self.requested_targets,
            list(&self.target_discarded_counts),
            self.actual_paths,
            self.requested_paths,
            list(&self.path_failure_counts)
        )
    }
}
