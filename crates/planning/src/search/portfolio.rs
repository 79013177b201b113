//! A portfolio of searches side by side for a first path to any goal configuration (decision 0018).

use crate::search::edges::{RrtSettings, Search};
use crate::search::tree::Tree;
use pcc_model::Configuration;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The budget of each search.
pub(crate) const PORTFOLIO_BUDGET: RrtSettings = RrtSettings {
    samples: 10_000,
    shortcuts: 120,
};
/// Searches side by side.
const SEARCHES: usize = 2;
/// Samples of a search between two looks at the number that the other one needed; even, as [`Search::grow`] wants it.
const LOOK_EVERY: usize = 32;

/// The polyline from `start` to one of `ends` (at least one) of the search that needs the fewest samples, the first of equal ones, and
/// the state of that search's random numbers; none where no search finds one within the budget, or if interrupted.
///
/// A search stops where it cannot come first any more, so the answer does not depend on how many workers there are.
pub(crate) fn search_portfolio(
    search: &Search,
    start: &Configuration,
    ends: &[Configuration],
    rng: impl Fn(usize) -> Pcg64 + Sync,
) -> Option<(Vec<Configuration>, Pcg64)> {
    let most = AtomicUsize::new(search.settings.samples);
    let seek = |number| {
        let mut rng = rng(number);
        let trees = [Tree::rooted(&[*start]), Tree::rooted(ends)];
        let (samples, polyline) = grow_within(search, trees, &most, &mut rng)?;
        Some(((samples, number), (polyline, rng)))
    };
    let numbers = (0..SEARCHES).into_par_iter().with_max_len(1);
    let first = numbers.filter_map(seek).min_by_key(|(key, _)| *key);
    first.map(|(_, found)| found)
}

/// Grows trees until they meet, within `most` samples, and lowers `most` to the number of samples taken. Returns that number and the
/// polyline.
fn grow_within(
    search: &Search,
    mut trees: [Tree; 2],
    most: &AtomicUsize,
    rng: &mut Pcg64,
) -> Option<(usize, Vec<Configuration>)> {
    let mut taken = 0;
    loop {
        let open = most.load(Ordering::Relaxed).saturating_sub(taken);
        if open == 0 || (search.interrupt)() {
            return None;
        }
        let turn = LOOK_EVERY.min(open);
        let mut left = turn;
        let polyline = search.grow(&mut trees, &mut left, rng);
        taken += turn - left;
        if let Some(polyline) = polyline {
            most.fetch_min(taken, Ordering::Relaxed);
            return Some((taken, polyline));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::request::Interrupt;
    use datasets::scenes::{Setting, Target, draw_target};
    use pcc_model::UnitRobot;
    use rand::SeedableRng;
    use rayon::ThreadPoolBuilder;
    use std::sync::atomic::AtomicBool;

    /// A target that both searches need some looks at each other for.
    fn target() -> Target {
        let draw = |index| draw_target(&unit_robot(), Setting::Hard, 1, index);
        let needs = |target: &Target, seed| alone(target, seed).map_or(0, |(samples, _)| samples);
        let is_hard = |target: &Target| [7, 8].iter().all(|&seed| needs(target, seed) > LOOK_EVERY);
        (0..).filter_map(draw).find(is_hard).unwrap()
    }

    fn search<'a>(
        robot: &'a UnitRobot,
        target: &'a Target,
        settings: &'a RrtSettings,
        interrupt: Interrupt<'a>,
    ) -> Search<'a> {
        Search {
            robot,
            scene: &target.scene,
            settings,
            interrupt,
        }
    }

    fn trees(target: &Target) -> [Tree; 2] {
        [target.starts[0], target.generator].map(|configuration| Tree::rooted(&[configuration]))
    }

    /// The polyline of searches with these seeds, each within so many samples.
    fn polyline(
        target: &Target,
        workers: usize,
        samples: usize,
        seeds: [u64; SEARCHES],
    ) -> Option<Vec<Configuration>> {
        let settings = RrtSettings {
            samples,
            ..PORTFOLIO_BUDGET
        };
        let robot = unit_robot();
        let search = search(&robot, target, &settings, &|| false);
        let rng = |number: usize| Pcg64::seed_from_u64(seeds[number]);
        let pool = ThreadPoolBuilder::new().num_threads(workers).build();
        let seek = || search_portfolio(&search, &target.starts[0], &[target.generator], rng);
        pool.unwrap().install(seek).map(|(polyline, _)| polyline)
    }

    /// The polyline of a single search with this seed, without looks at others, and its samples.
    fn alone(target: &Target, seed: u64) -> Option<(usize, Vec<Configuration>)> {
        let robot = unit_robot();
        let search = search(&robot, target, &PORTFOLIO_BUDGET, &|| false);
        let mut left = PORTFOLIO_BUDGET.samples;
        let mut rng = Pcg64::seed_from_u64(seed);
        let polyline = search.grow(&mut trees(target), &mut left, &mut rng)?;
        Some((PORTFOLIO_BUDGET.samples - left, polyline))
    }

    #[test]
    fn the_luckier_search_counts_whoever_makes_it() {
        let target = target();
        let found = [7, 8].map(|seed| alone(&target, seed).unwrap());
        assert_ne!(found[0].0, found[1].0);
        let (fewest, luckier) = found.into_iter().min_by_key(|(n, _)| *n).unwrap();
        for workers in [1, 2, 3] {
            for seeds in [[7, 8], [8, 7]] {
                let within = |samples| polyline(&target, workers, samples, seeds);
                assert_eq!(within(10_000).as_ref(), Some(&luckier), "{workers}");
                assert_eq!(within(fewest).as_ref(), Some(&luckier), "{workers}");
                assert_eq!(within(fewest - 1), None, "{workers}");
            }
        }
    }

    #[test]
    fn who_cannot_come_first_any_more_and_who_is_interrupted_stops() {
        let target = target();
        let is_interrupted = AtomicBool::new(false);
        let interrupt = || is_interrupted.load(Ordering::Relaxed);
        let robot = unit_robot();
        let search = search(&robot, &target, &PORTFOLIO_BUDGET, &interrupt);
        let grow = |most: usize| {
            let most = AtomicUsize::new(most);
            let mut rng = Pcg64::seed_from_u64(7);
            let found = grow_within(&search, trees(&target), &most, &mut rng);
            (found.map(|(samples, _)| samples), most.into_inner())
        };
        let (needed, _) = alone(&target, 7).unwrap();
        assert_eq!(grow(10_000), (Some(needed), needed));
        assert_eq!(grow(needed - 1), (None, needed - 1));
        is_interrupted.store(true, Ordering::Relaxed);
        assert_eq!(grow(10_000), (None, 10_000));
    }
}
