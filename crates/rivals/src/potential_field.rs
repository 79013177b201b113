//! The artificial potential field: a straight tip path that repulsion pushes out of the balls.

use crate::query::Query;
use datasets::reference::{PathMaker, Surroundings};
use planning::Waypoints;
use rand_pcg::Pcg64;

/// The path to the goal configuration of least residual among those of 32 random seeds that are clear.
pub(crate) fn path(
    query: &Query,
    place: &Surroundings,
    maker: &mut PathMaker,
    rng: &mut Pcg64,
) -> Option<Waypoints> {
    let goal = place.best_terminal(&query.target, rng)?;
    maker
        .path(query.balls, &query.target, &query.start, &goal)
        .ok()
}
