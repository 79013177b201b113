//! What became of the targets and paths asked for, as `dataset_meta.json` says it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::AddAssign;

/// The key of the sum over all reasons.
const TOTAL: &str = "total";

/// What became of the targets and paths that a generator was asked for.
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

impl Counts {
    /// Nothing counted yet; these are the reasons for which targets and paths may be missing.
    pub(crate) fn with_reasons(of_targets: &[&str], of_paths: &[&str]) -> Self {
        let none = |reasons: &[&str]| {
            let all = reasons.iter().chain(&[TOTAL]);
            all.map(|reason| ((*reason).to_owned(), 0)).collect()
        };
        Self {
            target_discarded_counts: none(of_targets),
            path_failure_counts: none(of_paths),
            ..Self::default()
        }
    }

    /// Counts a target that is dropped.
    pub(crate) fn drop_target(&mut self, reason: &str) {
        add(&mut self.target_discarded_counts, reason, 1);
    }

    /// Counts paths that are missing.
    pub(crate) fn drop_paths(&mut self, reason: &str, count: usize) {
        add(&mut self.path_failure_counts, reason, count);
    }
}

fn add(counts: &mut BTreeMap<String, usize>, reason: &str, count: usize) {
    for key in [reason, TOTAL] {
        *counts.entry(key.to_owned()).or_default() += count;
    }
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
            let reasons = reasons.iter().filter(|(reason, _)| *reason != TOTAL);
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
