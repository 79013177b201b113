//! A first way to any goal shape, where nothing is known.

use crate::rrt_connect::{Search, Tree};
use pcc_model::Configuration;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Searches side by side: the luckier one of two takes three quarters of the samples of one alone, that of four still half.
const SEARCHES: usize = 2;
/// Samples of a search between two looks at what the others took, even: the trees grow in turn.
const TURN: usize = 32;

/// The polyline from `start` to one of `ends` that a search found with the fewest samples, shortened; nothing within the budget
/// of each search, or if interrupted.
///
/// Each search has random numbers of its own. One stops as soon as another has found a way with fewer samples than it has
/// taken, so the answer does not depend on how many workers there are.
pub(crate) fn first_way(
    search: &Search,
    start: &Configuration,
    ends: &[Configuration],
    rng: impl Fn(usize) -> Pcg64 + Sync,
) -> Option<Vec<Configuration>> {
    let fewest = AtomicUsize::new(search.settings.samples);
    let seek = |number| {
        let mut rng = rng(number);
        let trees = [Tree::rooted(&[*start]), Tree::rooted(ends)];
        let (samples, polyline) = grow_within(search, trees, &fewest, &mut rng)?;
        Some(((samples, number), polyline, rng))
    };
    let numbers = (0..SEARCHES).into_par_iter().with_max_len(1);
    let found = numbers.filter_map(seek);
    let (_, polyline, mut rng) = found.min_by_key(|(key, ..)| *key)?;
    Some(search.shorten(polyline, &mut rng))
}

/// Grows trees until they meet, as long as no other search has found a way with `fewest` samples; with how many they did.
fn grow_within(
    search: &Search,
    mut trees: [Tree; 2],
    fewest: &AtomicUsize,
    rng: &mut Pcg64,
) -> Option<(usize, Vec<Configuration>)> {
    let mut taken = 0;
    loop {
        let most = fewest.load(Ordering::Relaxed);
        if taken >= most || (search.interrupt)() {
            return None;
        }
        let turn = TURN.min(most - taken);
        let mut left = turn;
        let polyline = search.grow(&mut trees, &mut left, rng);
        taken += turn - left;
        if let Some(polyline) = polyline {
            fewest.fetch_min(taken, Ordering::Relaxed);
            return Some((taken, polyline));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rrt_connect::RrtSettings;
    use crate::scenes::{Setting, draw_target, unit_robot};
    use rand::SeedableRng;
    use rayon::ThreadPoolBuilder;

    /// The way of searches with these two seeds through a scene in which straight segments collide.
    fn way(workers: usize, samples: usize, seeds: [u64; 2]) -> Option<Vec<Configuration>> {
        let robot = unit_robot();
        let target = (0..).find_map(|index| draw_target(&robot, Setting::Hard, 1, index));
        let target = target.unwrap();
        let settings = RrtSettings {
            samples,
            ..RrtSettings::default()
        };
        let search = Search {
            robot: &robot,
            scene: &target.scene,
            settings: &settings,
            interrupt: &|| false,
        };
        let rng = |number: usize| Pcg64::seed_from_u64(seeds[number]);
        let pool = ThreadPoolBuilder::new().num_threads(workers).build();
        let seek = || first_way(&search, &target.starts[0], &[target.generator], rng);
        let way = pool.unwrap().install(seek)?;
        let is_free = |w: &[Configuration]| search.edge_is_free(&w[0], &w[1]);
        assert!(way.windows(2).all(is_free));
        let ends = [way[0], way[way.len() - 1]];
        assert_eq!(ends, [target.starts[0], target.generator]);
        Some(way)
    }

    #[test]
    fn the_luckier_search_counts_whoever_makes_it() {
        let one = way(1, 10_000, [7, 8]);
        assert!(one.is_some());
        for workers in [1, 2, 3] {
            for seeds in [[7, 8], [8, 7]] {
                assert_eq!(way(workers, 10_000, seeds), one, "{workers} {seeds:?}");
            }
        }
    }

    #[test]
    fn no_way_is_found_within_few_samples() {
        assert_eq!(way(2, 0, [7, 8]), None);
        assert_eq!(way(2, 2, [7, 8]), None);
    }
}
