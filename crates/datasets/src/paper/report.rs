//! What became of the paths that the paper's generator was asked for.

/// Why targets were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DroppedTargets {
    /// No ten clear and distinct terminal solutions.
    pub terminal_ik: usize,
    /// Too few starts.
    pub start_sampling: usize,
    /// None of its paths was kept.
    pub zero_retained_paths: usize,
}

/// Why paths were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DroppedPaths {
    /// The straight way of the tip could not be followed.
    pub workspace_ik: usize,
    /// A step between neighbouring waypoints is too large, without a repair.
    pub path_constraints: usize,
    /// It collides, and the repair failed or left too large steps.
    pub collision_repair: usize,
}

/// What became of the paths asked for; as the authors' `dataset_meta.json` names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PaperReport {
    /// Targets drawn.
    pub requested_targets: usize,
    /// Targets with a path.
    pub actual_targets: usize,
    /// Paths asked for, those of dropped targets too.
    pub requested_paths: usize,
    /// Paths kept.
    pub actual_paths: usize,
    /// Targets dropped.
    pub target_discarded_counts: DroppedTargets,
    /// Paths dropped of targets that were not.
    pub path_failure_counts: DroppedPaths,
}

impl std::ops::AddAssign for PaperReport {
    fn add_assign(&mut self, other: Self) {
        self.requested_targets += other.requested_targets;
        self.actual_targets += other.actual_targets;
        self.requested_paths += other.requested_paths;
        self.actual_paths += other.actual_paths;
        let (sum, more) = (
            &mut self.target_discarded_counts,
            other.target_discarded_counts,
        );
        sum.terminal_ik += more.terminal_ik;
        sum.start_sampling += more.start_sampling;
        sum.zero_retained_paths += more.zero_retained_paths;
        let (sum, more) = (&mut self.path_failure_counts, other.path_failure_counts);
        sum.workspace_ik += more.workspace_ik;
        sum.path_constraints += more.path_constraints;
        sum.collision_repair += more.collision_repair;
    }
}
