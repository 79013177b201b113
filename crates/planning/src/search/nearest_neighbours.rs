//! The nearest of many configurations: distances to four at a time (decision 0019).

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4};
use pcc_model::{Configuration, DOF, LANES};

/// Configurations in the order in which they were added.
#[derive(Default)]
pub(super) struct Neighbours {
    count: usize,
    /// Groups of four configurations, component by component; infinitely far away in lanes that are not taken yet.
    groups: Vec<[[f64; LANES]; DOF]>,
}

impl Neighbours {
    pub(crate) fn push(&mut self, configuration: &Configuration) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.groups.push([[f64::INFINITY; LANES]; DOF]);
        }
        let last = self.groups.len() - 1;
        for (row, component) in self.groups[last].iter_mut().zip(configuration.iter()) {
            row[lane] = *component;
        }
        self.count += 1;
    }

    /// The place of the nearest configuration, the first of equally near ones; 0 where there is none.
    pub(crate) fn nearest(&self, configuration: &Configuration) -> usize {
        let (squares, groups) =
            dispatch!(Level::new(), simd => self.nearest_at(simd, configuration));
        let place = |lane: usize| groups[lane] as usize * LANES + lane;
        let order = |a: &usize, b: &usize| {
            let by_distance = squares[*a].total_cmp(&squares[*b]);
            by_distance.then(place(*a).cmp(&place(*b)))
        };
        (0..LANES).min_by(order).map_or(0, place)
    }

    /// The least squared distance in each lane, and its group.
    #[inline(always)]
    fn nearest_at<S: Simd>(
        &self,
        simd: S,
        configuration: &Configuration,
    ) -> ([f64; LANES], [f64; LANES]) {
        let mut least = f64x4::splat(simd, f64::INFINITY);
        let mut nearest = f64x4::splat(simd, 0.0);
        let mut number = nearest;
        for rows in &self.groups {
            let mut square = f64x4::splat(simd, 0.0);
            for (row, component) in rows.iter().zip(configuration.iter()) {
                let difference = f64x4::from_slice(simd, row) - *component;
                square += difference * difference;
            }
            let is_nearer = square.simd_lt(least);
            least = is_nearer.select(square, least);
            nearest = is_nearer.select(number, nearest);
            number += 1.0;
        }
        (least.into(), nearest.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_nearest_is_the_first_of_the_least_distances() {
        let mut rng = rand_pcg::Pcg64::seed_from_u64(5);
        // Few different ones, so that many are equally near.
        let mut configuration = || Configuration::from_fn(|_, _| f64::from(rng.random_range(0..3)));
        let (mut neighbours, mut configurations) = (Neighbours::default(), Vec::new());
        for _ in 0..300 {
            configurations.push(configuration());
            neighbours.push(&configurations[configurations.len() - 1]);
            let wanted = configuration();
            let square = |i: &usize| (configurations[*i] - wanted).norm_squared();
            let nearest = (0..configurations.len()).min_by(|a, b| square(a).total_cmp(&square(b)));
            assert_eq!(Some(neighbours.nearest(&wanted)), nearest);
        }
    }
}
