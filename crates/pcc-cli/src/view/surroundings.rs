//! What is around the robot: balls that come, move and go, and what a scene file has.

use super::samples::Samples;
use anyhow::Context;
use collision::{Ball, Scene, SceneError};
use serde::Serialize;
use std::path::Path;

/// From here to its negative lasts what always is there, s.
const ALWAYS_S: f64 = 1e9;

/// A ball that moves evenly from one time to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct BallTrack {
    /// At `from_s`.
    pub(super) centre: [f64; 3],
    /// A second.
    pub(super) velocity: [f64; 3],
    pub(super) radius: f64,
    pub(super) from_s: f64,
    pub(super) until_s: f64,
}

/// The surface of a solid.
#[derive(Serialize)]
pub(super) struct Surface {
    /// Three numbers each.
    vertices: Samples,
    triangles: Vec<[u32; 3]>,
}

/// Obstacles over time.
pub(super) struct Surroundings {
    pub(super) tracks: Vec<BallTrack>,
    /// What always is there.
    file: Scene,
}

impl Surroundings {
    /// Those of a scene file, whose lengths are divided by the unit (m); none without a file.
    pub(super) fn of_file(file: Option<&Path>, unit_m: f64) -> anyhow::Result<Self> {
        let scene = file.map(|file| Scene::from_file(file, unit_m));
        Ok(Self {
            tracks: Vec::new(),
            file: scene.transpose().context("--scene")?.unwrap_or_default(),
        })
    }

    /// The obstacles that are there at a time.
    pub(super) fn at(&self, time_s: f64) -> Result<Scene, SceneError> {
        let there = self.tracks.iter().filter_map(|ball| ball.at(time_s));
        self.file.with_balls(there.collect())
    }

    /// All balls, with those of the file.
    pub(super) fn balls(&self) -> Vec<BallTrack> {
        let mut balls = self.balls_of_file();
        balls.extend(&self.tracks);
        balls
    }

    /// What always is there.
    pub(super) fn balls_of_file(&self) -> Vec<BallTrack> {
        let balls = self.file.balls().iter().map(|ball| BallTrack {
            centre: ball.centre.into(),
            velocity: [0.0; 3],
            radius: ball.radius,
            from_s: -ALWAYS_S,
            until_s: ALWAYS_S,
        });
        balls.collect()
    }

    /// The solids of the file.
    pub(super) fn solids(&self) -> Vec<Surface> {
        let surface = |solid: &collision::Solid| {
            let (vertices, triangles) = solid.surface();
            let numbers = vertices.iter().flat_map(|it| it.iter().copied());
            Surface {
                vertices: numbers.collect(),
                triangles,
            }
        };
        let solids = self.file.solids().iter();
        solids.map(|solid| surface(solid)).collect()
    }
}

impl BallTrack {
    /// The ball at a time; none while it is not there.
    pub(super) fn at(&self, time_s: f64) -> Option<Ball> {
        let is_there = (self.from_s..=self.until_s).contains(&time_s);
        let since_s = time_s - self.from_s;
        let centre = |axis| self.centre[axis] + since_s * self.velocity[axis];
        is_there.then(|| Ball {
            centre: std::array::from_fn(centre).into(),
            radius: self.radius,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    #[test]
    fn a_ball_is_where_it_moves_to_while_it_is_there() {
        let track = BallTrack {
            centre: [1.0, 0.0, 0.0],
            velocity: [0.0, 2.0, 0.0],
            radius: 0.1,
            from_s: 1.0,
            until_s: 2.0,
        };
        assert_eq!(track.at(1.5).unwrap().centre.as_slice(), [1.0, 1.0, 0.0]);
        assert!(track.at(0.9).is_none() && track.at(2.1).is_none());
    }

    #[test]
    fn every_obstacle_of_a_scene_file_is_shown() {
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/scenes");
        let file: PathBuf = scenes.join("workshop.toml");
        let shown = Surroundings::of_file(Some(&file), 1.0).unwrap();
        assert_eq!((shown.balls().len(), shown.solids().len()), (2, 5));
        for solid in shown.solids() {
            let vertices = solid.vertices.0.len() / 3;
            let indices = solid.triangles.as_flattened();
            assert!(indices.iter().all(|index| (*index as usize) < vertices));
            assert!(solid.vertices.0.iter().all(|it| it.abs() < 3.0));
        }
    }
}
