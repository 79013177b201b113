//! The balls of each source of live scenes over a short time: a state is compared with the scenes of its own time.

use crate::view::surroundings::BallTrack;
use std::collections::BTreeMap;

/// Time for which balls are known that are there no longer, s: states that come are younger.
const PAST_S: f64 = 0.3;
/// Time before a source's first scene for which its balls are taken to have moved evenly already, s: states of that time may come yet.
const BEFORE_S: f64 = 0.1;

/// Balls by the name of their source.
#[derive(Default)]
pub(super) struct Sources(BTreeMap<String, Source>);

#[derive(Default)]
struct Source {
    /// Time of its newest scene, s.
    newest_s: f64,
    tracks: Vec<BallTrack>,
}

impl Sources {
    /// Whether a source has told of a later time already.
    pub(super) fn is_outdated(&self, source: &str, from_s: f64) -> bool {
        let known = self.0.get(source);
        known.is_some_and(|known| from_s < known.newest_s)
    }

    /// From a time on a source has these balls, in place of those before.
    pub(super) fn replace(&mut self, source: String, balls: &[BallTrack], from_s: f64) {
        let Source { newest_s, tracks } = self.0.entry(source).or_default();
        *newest_s = from_s;
        let goes_on = tracks.iter().any(|track| track.until_s >= from_s);
        for track in &mut *tracks {
            track.until_s = track.until_s.min(from_s);
        }
        tracks.extend(
            balls
                .iter()
                .map(|ball| if goes_on { *ball } else { earlier(ball) }),
        );
    }

    /// Forgets balls that are gone, and sources of which none is left; returns the names of these.
    pub(super) fn forget(&mut self, now_s: f64) -> Vec<String> {
        let mut gone = Vec::new();
        self.0.retain(|source, Source { tracks, .. }| {
            tracks.retain(|track| track.until_s >= (now_s - PAST_S).max(track.from_s));
            if tracks.is_empty() {
                gone.push(source.clone());
            }
            !tracks.is_empty()
        });
        gone
    }

    /// The balls of all sources.
    pub(super) fn tracks(&self) -> Vec<BallTrack> {
        let tracks = self.0.values().flat_map(|source| &source.tracks);
        tracks.copied().collect()
    }
}

fn earlier(ball: &BallTrack) -> BallTrack {
    BallTrack {
        centre: std::array::from_fn(|axis| ball.centre[axis] - BEFORE_S * ball.velocity[axis]),
        from_s: ball.from_s - BEFORE_S,
        ..*ball
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(from_s: f64, x: f64) -> BallTrack {
        BallTrack {
            centre: [x, 0.0, 0.0],
            velocity: [1.0, 0.0, 0.0],
            radius: 0.1,
            from_s,
            until_s: from_s + 0.5,
        }
    }

    /// Where balls are at a time.
    fn places(sources: &Sources, time_s: f64) -> Vec<f64> {
        let tracks = sources.tracks().into_iter();
        tracks
            .filter_map(|track| Some(track.at(time_s)?.centre.x))
            .collect()
    }

    #[test]
    fn a_state_meets_the_scene_of_its_own_time_also_where_a_newer_one_is_there() {
        let mut sources = Sources::default();
        sources.replace("camera".to_owned(), &[ball(1.0, 0.0)], 1.0);
        sources.replace("camera".to_owned(), &[ball(1.05, 5.0)], 1.05);
        assert!((places(&sources, 1.04)[0] - 0.04).abs() < 1e-12);
        assert!((places(&sources, 1.06)[0] - 5.01).abs() < 1e-12);
        assert_eq!(places(&sources, 1.04).len(), 1);
        assert_eq!(places(&sources, 1.06).len(), 1);
    }

    #[test]
    fn a_scene_that_came_late_is_outdated_until_its_source_is_forgotten() {
        let mut sources = Sources::default();
        sources.replace("camera".to_owned(), &[ball(1.0, 0.0)], 1.0);
        assert!(sources.is_outdated("camera", 0.9));
        assert!(!sources.is_outdated("camera", 1.0) && !sources.is_outdated("other", 0.9));
        sources.forget(2.0);
        assert!(!sources.is_outdated("camera", 0.9));
    }

    #[test]
    fn the_first_scene_of_a_source_holds_for_the_states_just_before_it() {
        let mut sources = Sources::default();
        sources.replace("camera".to_owned(), &[ball(1.0, 0.0)], 1.0);
        assert!((places(&sources, 0.98)[0] + 0.02).abs() < 1e-12);
        assert!(places(&sources, 0.8).is_empty());
    }

    #[test]
    fn a_source_whose_lifetime_is_over_or_that_has_left_is_forgotten() {
        let mut sources = Sources::default();
        for name in 0..100 {
            sources.replace(name.to_string(), &[ball(1.0, 0.0)], 1.0);
        }
        sources.replace("left".to_owned(), &[ball(1.0, 0.0)], 1.0);
        sources.replace("left".to_owned(), &[], 1.2);
        assert!(sources.forget(1.4).is_empty());
        assert_eq!(sources.forget(1.6), ["left"]);
        assert_eq!(sources.forget(2.0).len(), 100);
        assert!(sources.tracks().is_empty() && sources.0.is_empty());
    }
}
