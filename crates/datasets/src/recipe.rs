//! What a generator is asked for.

use crate::row::Split;
use crate::scenes::Setting;
use rand::RngExt;
use rand_pcg::Pcg64;

/// Split by target, 80 / 10 / 10 (docs/evaluation.md), from a generator of its own.
const SPLIT_SEED: u64 = 999;

/// What is generated.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    /// The kind of scenes.
    pub setting: Setting,
    /// Seed of everything random.
    pub seed: u64,
    /// Starts used of each target.
    pub starts: usize,
    /// Goal configurations used of each start.
    pub ends: usize,
    /// Trees grown where the straight segment leads the expert to no certified path; of what it makes of them the shortest
    /// is kept.
    pub trees: usize,
    /// Puts every row into the test split (for sets that are only evaluated on).
    pub test_only: bool,
}

impl Recipe {
    /// The split of all rows of a target.
    pub(crate) fn split_of(&self, target: u64) -> Split {
        if self.test_only {
            return Split::Test;
        }
        match Pcg64::new(u128::from(SPLIT_SEED), u128::from(target)).random_range(0..10) {
            0 => Split::Validation,
            1 => Split::Test,
            _ => Split::Train,
        }
    }
}
