//! A recording of the demonstration, judged from its arrays alone.

use std::fs;
use std::path::Path;

use collision::{Ball, Scene};
use pcc_model::{Configuration, Point, Robot, TendonLimits};
use planning::dataset::{ArchiveError, ArchiveReader};
use serde::Deserialize;
use shared_types::codes::LoopState;

use crate::motion::{LimitsKept, TendonSample, limits_kept};

/// Age of the robot's reference in a set-point that mirrors it, at most: two cycles and their jitter, s.
const MIRROR_SLACK_S: f64 = 3e-3;

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// `recording.npz`.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// A text file is not there.
    #[error(transparent)]
    File(#[from] std::io::Error),
    /// `scene.json` or `demo.json`.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// An array has another shape.
    #[error("array `{array}` has shape {shape:?}")]
    Shape {
        /// Its name.
        array: String,
        /// Its shape.
        shape: Vec<u64>,
    },
}

/// One motion as `demo.json` tells it.
#[derive(Clone, Debug, Deserialize)]
pub struct ToldMotion {
    /// Experiment 1 to 3.
    pub experiment: u32,
    /// Its name.
    pub name: String,
    /// Tip asked for, m.
    pub requested_tip_m: [f64; 3],
    /// Duration, s.
    pub duration_s: f64,
    /// Least clearance, m; none without obstacles.
    pub minimum_clearance_m: Option<f64>,
    /// Largest set-point step, m.
    pub largest_setpoint_step_m: f64,
    /// Late cycles.
    pub late_cycles: u32,
    /// Configuration at the end, rad.
    pub end_configuration_rad: [f64; 6],
}

/// `demo.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Told {
    /// The motions in order.
    pub motions: Vec<ToldMotion>,
    /// Ids of the motions that the controller stopped on the way, and that were asked for again.
    pub interrupted: Vec<u32>,
    /// How the impossible form of experiment 3 was answered.
    pub impossible_outcome: Option<String>,
}

#[derive(Deserialize)]
struct Limits {
    velocity_m_s: f64,
    acceleration_m_s2: f64,
    jerk_m_s3: f64,
}

#[derive(Deserialize)]
struct Event {
    stamp_ns: i64,
    balls: Vec<[f64; 4]>,
}

#[derive(Deserialize)]
struct SceneFile {
    robot: String,
    limits: Limits,
    events: Vec<Event>,
}

/// The recording in memory.
pub struct Recording {
    /// Name of the robot.
    pub robot: String,
    /// The limits it states.
    pub limits: TendonLimits,
    /// What the program itself told.
    pub told: Told,
    /// The set-points.
    pub samples: Vec<TendonSample>,
    commanded: Vec<Configuration>,
    measured: Vec<Configuration>,
    trajectory_id: Vec<u32>,
    state: Vec<u32>,
    scenes: Vec<(i64, Scene)>,
}

/// A motion as the recording shows it.
#[derive(Clone, Copy, Debug)]
pub struct RecordedMotion {
    /// Its id.
    pub trajectory_id: u32,
    /// First and last sample in motion.
    pub range: (usize, usize),
    /// Commanded configuration at its end.
    pub end: Configuration,
    /// Mean measured configuration over the hold after it.
    pub measured_end: Configuration,
}

impl Recording {
    /// Reads `recording.npz`, `scene.json` and `demo.json`.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn read(folder: &Path) -> Result<Self, RecordingError> {
        let scene: SceneFile =
            serde_json::from_str(&fs::read_to_string(folder.join("scene.json"))?)?;
        let told = serde_json::from_str(&fs::read_to_string(folder.join("demo.json"))?)?;
        let mut archive = ArchiveReader::open(&folder.join("recording.npz"))?;
        let scenes = scene.events.iter().map(|event| {
            let ball = |ball: &[f64; 4]| Ball {
                centre: Point::new(ball[0], ball[1], ball[2]),
                radius: ball[3],
            };
            let balls = event.balls.iter().map(ball).collect();
            (event.stamp_ns, Scene::new(balls).unwrap())
        });
        Ok(Self {
            robot: scene.robot,
            limits: TendonLimits {
                velocity: scene.limits.velocity_m_s,
                acceleration: scene.limits.acceleration_m_s2,
                jerk: scene.limits.jerk_m_s3,
            },
            told,
            samples: samples(&mut archive)?,
            commanded: rows::<6>(&mut archive, "commanded_configuration")?
                .into_iter()
                .map(Configuration::from)
                .collect(),
            measured: rows::<6>(&mut archive, "measured_configuration")?
                .into_iter()
                .map(Configuration::from)
                .collect(),
            trajectory_id: archive.read("trajectory_id")?.0,
            state: archive.read("state")?.0,
            scenes: scenes.collect(),
        })
    }

    /// Limits at every sample, and continuity between neighbours.
    ///
    /// A controller that the robot has let go of sends nothing: its set-point is then the robot's own reference, of up to
    /// `MIRROR_SLACK_S` before.
    #[must_use]
    pub fn limits_kept(&self) -> LimitsKept {
        let samples = &self.samples;
        let mut kept = limits_kept(samples, &self.limits, MIRROR_SLACK_S);
        kept.forget_steps();
        let pairs = |mirrored: bool| {
            let pairs = (1..samples.len()).filter(move |&i| self.is_mirrored(i) == mirrored);
            pairs.map(|i| (samples[i - 1], samples[i]))
        };
        kept.add_pairs(pairs(false), &self.limits, 0.0);
        kept.add_pairs(pairs(true), &self.limits, MIRROR_SLACK_S);
        kept
    }

    /// Whether a sample or the one before it is the robot's own reference.
    fn is_mirrored(&self, index: usize) -> bool {
        let detached = [LoopState::Starting, LoopState::Fault].map(LoopState::code);
        self.state[index - 1..=index]
            .iter()
            .any(|state| detached.contains(state))
    }

    /// Samples of a controller that the robot had let go of.
    #[must_use]
    pub fn mirrored(&self) -> usize {
        (1..self.state.len())
            .filter(|&i| self.is_mirrored(i))
            .count()
    }

    /// Largest difference of the set-points from the tendon lengths that the commanded configurations mean, m.
    #[must_use]
    pub fn tendon_map_error(&self, robot: &Robot) -> f64 {
        let pairs = self.samples.iter().zip(&self.commanded);
        let mut lengths = [0.0; 9];
        let mut error = |(sample, shape): (&TendonSample, &Configuration)| {
            robot.tendons.lengths(shape, &mut lengths);
            let errors = lengths.iter().zip(&sample.position);
            errors.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        pairs.map(&mut error).fold(0.0, f64::max)
    }

    /// The motions in order, without those that were cut short.
    #[must_use]
    pub fn motions(&self) -> Vec<RecordedMotion> {
        let moving = |i: usize| {
            self.trajectory_id[i] != 0 && self.samples[i].velocity.iter().any(|v| *v != 0.0)
        };
        let mut ranges: Vec<(u32, usize, usize)> = Vec::new();
        for i in (0..self.samples.len()).filter(|&i| moving(i)) {
            match ranges.last_mut() {
                Some((id, _, last)) if *id == self.trajectory_id[i] => *last = i,
                _ => ranges.push((self.trajectory_id[i], i, i)),
            }
        }
        ranges.retain(|(id, ..)| !self.told.interrupted.contains(id));
        ranges.into_iter().map(|range| self.motion(range)).collect()
    }

    /// What holds after a motion: the 300 ms from 500 ms after it.
    fn motion(&self, (trajectory_id, first, last): (u32, usize, usize)) -> RecordedMotion {
        let end_ns = self.samples[last].stamp_ns;
        let at = |after_ns: i64| {
            self.samples
                .partition_point(|sample| sample.stamp_ns < end_ns + after_ns)
        };
        let hold = &self.measured[at(500_000_000)..at(800_000_000)];
        let after = (last + 1).min(self.commanded.len() - 1);
        RecordedMotion {
            trajectory_id,
            range: (first, last),
            end: self.commanded[after],
            measured_end: hold.iter().sum::<Configuration>() / hold.len().max(1) as f64,
        }
    }

    /// Least clearance of the commanded body over some samples, against the scene of each instant, m.
    #[must_use]
    pub fn clearance(&self, robot: &Robot, range: (usize, usize)) -> f64 {
        let clearance = |i: usize| {
            let stamp = self.samples[i].stamp_ns;
            let known = self.scenes.iter().rev().find(|(since, _)| *since <= stamp);
            known.map_or(f64::INFINITY, |(_, scene)| {
                scene.clearance(&robot.backbone(&self.commanded[i]), &robot.tube_radii)
            })
        };
        (range.0..=range.1)
            .map(clearance)
            .fold(f64::INFINITY, f64::min)
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether nothing was recorded.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}

fn samples(archive: &mut ArchiveReader) -> Result<Vec<TendonSample>, RecordingError> {
    let stamps: Vec<i64> = archive.read("stamp_ns")?.0;
    let position = rows::<9>(archive, "setpoint_m")?;
    let velocity = rows::<9>(archive, "setpoint_velocity_m_s")?;
    let acceleration = rows::<9>(archive, "setpoint_acceleration_m_s2")?;
    rows::<9>(archive, "measured_tendon_m")?;
    let sample = |(i, stamp_ns): (usize, i64)| TendonSample {
        stamp_ns,
        position: position[i],
        velocity: velocity[i],
        acceleration: acceleration[i],
    };
    Ok(stamps.into_iter().enumerate().map(sample).collect())
}

/// An `[N, WIDTH]` array by rows.
fn rows<const WIDTH: usize>(
    archive: &mut ArchiveReader,
    array: &str,
) -> Result<Vec<[f64; WIDTH]>, RecordingError> {
    let (values, shape) = archive.read::<f64>(array)?;
    let stamps = archive.read::<i64>("stamp_ns")?.1;
    if shape != [stamps[0], WIDTH as u64] {
        return Err(RecordingError::Shape {
            array: array.to_owned(),
            shape,
        });
    }
    let row = |row: &[f64]| <[f64; WIDTH]>::try_from(row).unwrap();
    Ok(values.chunks_exact(WIDTH).map(row).collect())
}
