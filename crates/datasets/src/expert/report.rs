//! What became of the paths that the expert was asked for.

/// What became of the paths asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockReport {
    /// Targets drawn.
    pub targets: usize,
    /// Targets without a valid tip or start.
    pub dropped_targets: usize,
    /// Targets with a path.
    pub targets_with_paths: usize,
    /// Paths asked for, those of dropped targets too.
    pub requested_paths: usize,
    /// Paths missing because a target that was not dropped has fewer starts than asked for.
    pub missing_starts: usize,
    /// Paths missing because a start has fewer clear goal configurations than asked for.
    pub missing_ends: usize,
    /// Starts without a clear goal configuration.
    pub dropped_starts: usize,
    /// Paths the expert could not certify.
    pub dropped_paths: usize,
    /// Paths that needed the tree.
    pub from_tree: usize,
    /// Paths kept.
    pub kept: usize,
}

impl std::ops::AddAssign for BlockReport {
    fn add_assign(&mut self, other: Self) {
        self.targets += other.targets;
        self.dropped_targets += other.dropped_targets;
        self.targets_with_paths += other.targets_with_paths;
        self.requested_paths += other.requested_paths;
        self.missing_starts += other.missing_starts;
        self.missing_ends += other.missing_ends;
        self.dropped_starts += other.dropped_starts;
        self.dropped_paths += other.dropped_paths;
        self.from_tree += other.from_tree;
        self.kept += other.kept;
    }
}
