//! A recording of the demonstration, judged from its arrays alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use datasets::{ArchiveError, ArchiveReader};
use pcc_model::{Configuration, TendonLimits};
use serde::Deserialize;
use shared_types::codes::LoopState;

use crate::brute_force::{Ball, Body, Clearance, Tendons};
use crate::motion::{LimitsKept, TendonSample};

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
    /// Experiment 1 to 3; the fourth one has [`ToldFollowing`].
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

/// An order that was given on the way, as `demo.json` tells it.
#[derive(Clone, Debug, Deserialize)]
pub struct ToldOrder {
    /// The motion under way.
    pub trajectory_id: u32,
    /// When it was obeyed, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
    /// `stop` or `speed`.
    pub order: String,
    /// How long the motion would have taken, s.
    pub planned_s: f64,
}

/// How the target that moves was followed, as `demo.json` tells it.
#[derive(Clone, Debug, Deserialize)]
pub struct ToldFollowing {
    /// From when the daemon kept the robot on its way, ns of CLOCK_MONOTONIC.
    pub begin_ns: i64,
    /// Until when.
    pub end_ns: i64,
    /// Where the target rested in the end, m.
    pub requested_tip_m: [f64; 3],
    /// Tip as measured there, m.
    pub measured_tip_m: [f64; 3],
    /// Mean distance of the commanded tip to the target while that moved, m.
    pub mean_tip_error_m: f64,
    /// Least clearance to the ball, m.
    pub minimum_clearance_m: f64,
    /// Plans made.
    pub plans: u64,
    /// Motions published.
    pub motions: u64,
    /// How many motions ended with each outcome.
    pub outcomes: BTreeMap<String, usize>,
    /// Results of motions that did not arrive.
    pub missing_results: u64,
}

/// `demo.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Told {
    /// The motions in order.
    pub motions: Vec<ToldMotion>,
    /// Ids of the motions that the controller stopped on the way, and that were asked for again.
    pub interrupted: Vec<u32>,
    /// Stops and changes of speed that were ordered on the way of other motions.
    pub orders: Vec<ToldOrder>,
    /// How the impossible form of experiment 3 was answered.
    pub impossible_outcome: Option<String>,
    /// How the target that moves was followed.
    pub followed: Option<ToldFollowing>,
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
    velocities_m_s: Vec<[f64; 3]>,
}

impl Event {
    fn balls(&self) -> Vec<Ball> {
        let balls = self.balls.iter().zip(&self.velocities_m_s);
        let ball = |([x, y, z, radius], velocity): (&[f64; 4], &[f64; 3])| Ball {
            centre_m: [*x, *y, *z],
            radius_m: *radius,
            velocity_m_s: *velocity,
            stamp_ns: self.stamp_ns,
        };
        balls.map(ball).collect()
    }
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
    scenes: Vec<(i64, Vec<Ball>)>,
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
        let scenes = scene
            .events
            .iter()
            .map(|event| (event.stamp_ns, event.balls()));
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

    /// Limits at every set-point that was sent, and continuity from each to the next, however much later that is.
    ///
    /// What may not have been sent is judged like what was, but for the steps while the robot ramps by itself: see
    /// `Recording::mirrors_a_ramp`. Once the first motion has begun, nothing is left out.
    #[must_use]
    pub fn limits_kept(&self) -> LimitsKept {
        let mut kept = LimitsKept::default();
        let mut before: Option<usize> = None;
        let begun = self.first_motion();
        for index in 0..self.len() {
            let now = &self.samples[index];
            kept.add(now, &self.limits);
            if index < begun && self.mirrors_a_ramp(index) {
                continue;
            }
            match before {
                Some(before) if before + 1 == index => {
                    kept.add_neighbours(&self.samples[before], now, &self.limits);
                }
                Some(before) => kept.add_step(&self.samples[before], now, &self.limits),
                None => {}
            }
            before = Some(index);
        }
        kept
    }

    /// Whether nothing was sent for certain: a controller that the robot has let go of mirrors it, and takes hold only of one that
    /// rests. The stamps are then the controller's, not those of the robot's reference, so that steps over time mean nothing.
    fn mirrors_a_ramp(&self, index: usize) -> bool {
        self.is_detached(index) && self.samples[index].velocity.iter().any(|v| *v != 0.0)
    }

    /// Whether the controller begins or is in fault: it may send where the robot rests, to take hold of it or to stay.
    fn is_detached(&self, index: usize) -> bool {
        let detached = [LoopState::Starting, LoopState::Fault].map(LoopState::code);
        detached.contains(&self.state[index])
    }

    /// Samples, from the first motion on, of a controller that has no hold of the robot, or is in fault.
    #[must_use]
    pub fn mirrored(&self) -> usize {
        (self.first_motion()..self.len())
            .filter(|&index| self.is_detached(index))
            .count()
    }

    /// The first sample of the first motion; the number of samples where nothing moves.
    fn first_motion(&self) -> usize {
        (0..self.len())
            .find(|&index| self.is_moving(index))
            .unwrap_or(self.len())
    }

    /// Largest difference of the set-points from the tendon lengths that the commanded configurations mean, m.
    #[must_use]
    pub fn tendon_map_error(&self, body: &Body) -> f64 {
        let pairs = self.samples.iter().zip(&self.commanded);
        let error = |(sample, shape): (&TendonSample, &Configuration)| {
            let meant = body.tendons(&(*shape).into());
            let errors = meant.iter().zip(&sample.position);
            errors.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        pairs.map(error).fold(0.0, f64::max)
    }

    /// How long an ordered motion was under way, s.
    #[must_use]
    pub fn lasted_s(&self, trajectory_id: u32) -> f64 {
        let under_way =
            |&index: &usize| self.is_moving(index) && self.trajectory_id[index] == trajectory_id;
        let mut stamps = (0..self.len())
            .filter(under_way)
            .map(|index| self.samples[index].stamp_ns);
        let first = stamps.next();
        let last = stamps.next_back();
        first
            .zip(last)
            .map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9)
    }

    /// The trajectories that moved the robot.
    #[must_use]
    pub fn executed(&self) -> BTreeSet<u32> {
        let moving = (0..self.len()).filter(|index| self.is_moving(*index));
        moving.map(|index| self.trajectory_id[index]).collect()
    }

    /// Set-points on which the controller brakes along a motion.
    #[must_use]
    pub fn stopping(&self, trajectory_id: u32) -> usize {
        let stopping = |&index: &usize| {
            self.trajectory_id[index] == trajectory_id
                && self.state[index] == LoopState::Stopping.code()
        };
        (0..self.len()).filter(stopping).count()
    }

    fn is_moving(&self, index: usize) -> bool {
        self.trajectory_id[index] != 0 && self.samples[index].velocity.iter().any(|v| *v != 0.0)
    }

    /// First and last sample while the target that moves was followed; none where it was not.
    #[must_use]
    pub fn followed(&self) -> Option<(usize, usize)> {
        let told = self.told.followed.as_ref()?;
        let before = |stamp_ns: i64| {
            let samples = &self.samples;
            samples.partition_point(|sample| sample.stamp_ns < stamp_ns)
        };
        let (first, after) = (before(told.begin_ns), before(told.end_ns + 1));
        (first < after).then(|| (first, after - 1))
    }

    /// Commanded configuration at a sample.
    #[must_use]
    pub fn commanded(&self, index: usize) -> Configuration {
        self.commanded[index]
    }

    /// The motions to their ends, in order: not those that were cut short, those that orders were given on, or those to the target that
    /// moves.
    #[must_use]
    pub fn motions(&self) -> Vec<RecordedMotion> {
        let mut ranges: Vec<(u32, usize, usize)> = Vec::new();
        let followed = self.followed();
        let is_following =
            |index: usize| followed.is_some_and(|(first, last)| (first..=last).contains(&index));
        for i in (0..self.len()).filter(|&i| self.is_moving(i) && !is_following(i)) {
            match ranges.last_mut() {
                Some((id, _, last)) if *id == self.trajectory_id[i] => *last = i,
                _ => ranges.push((self.trajectory_id[i], i, i)),
            }
        }
        let ordered = |id: u32| {
            self.told
                .orders
                .iter()
                .any(|order| order.trajectory_id == id)
        };
        ranges.retain(|(id, ..)| !self.told.interrupted.contains(id) && !ordered(*id));
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

    /// Least clearance of the body over some set-points and between them, against the scene of each instant, by geometry that
    /// shares nothing with the certificate's.
    #[must_use]
    pub fn clearance(&self, body: &Body, range: (usize, usize)) -> Clearance {
        let setpoint = |sample: &TendonSample| (sample.stamp_ns, sample.position);
        let samples = &self.samples[range.0..=range.1];
        let setpoints: Vec<(i64, Tendons)> = samples.iter().map(setpoint).collect();
        body.least_clearance(&setpoints, |stamp_ns| {
            let known = self.scenes.iter().rev();
            let mut known = known.skip_while(|(since, _)| *since > stamp_ns);
            known.next().map_or(&[][..], |(_, balls)| balls)
        })
    }

    /// Largest tendon length that no configuration explains, m.
    #[must_use]
    pub fn unexplained_m(&self, body: &Body) -> f64 {
        let residual = |sample: &TendonSample| body.explain(&sample.position).residual_m;
        self.samples.iter().map(residual).fold(0.0, f64::max)
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
