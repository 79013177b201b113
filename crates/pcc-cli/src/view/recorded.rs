//! A record: what was commanded and measured, the motions that were published, and the balls of the live scenes.

use super::page::{Body, Curves, Mark, Motion, View, clearance_range, sampled};
use super::samples::Samples;
use super::surroundings::{BallTrack, Surroundings};
use crate::replay::{Recording, motion};
use anyhow::Context;
use pcc_model::Configuration;
use shared_types::message::{
    Ball, Cycle, MovingBall, PlanRequest, SceneMessage, TrajectoryMessage,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Most samples of what was commanded, and of a curve.
const MOST_SAMPLES: usize = 6000;
/// Samples of a published motion.
const SAMPLES: usize = 100;
/// Distance by which a ball may be beside where it was foreseen and still move evenly, m.
const SAME_WAY_M: f64 = 1e-4;

pub(super) fn read(file: &Path, scene: Option<&Path>) -> anyhow::Result<View> {
    let recording = Recording::read(file)?;
    if let Some(reason) = &recording.cut_off {
        say!("the record ends before its end: {reason}");
    }
    let name = file.display();
    let robot = recording.robots.first();
    let robot = robot.with_context(|| format!("{name} has no robot_description"))?;
    let cycles = &recording.cycles;
    let (first, last) = cycles
        .first()
        .zip(cycles.last())
        .with_context(|| format!("{name} has no cycles"))?;
    let clock = Clock(first.stamp_mono_ns);
    let duration_s = clock.seconds(last.stamp_mono_ns);
    let body = Body {
        section_lengths: robot.section_lengths_m,
        tube_radii: robot.tube_radii_m,
    };
    let mut around = Surroundings::of_file(scene, 1.0)?;
    around.tracks = tracks(&recording.scenes, clock, duration_s);
    for message in &recording.trajectories {
        let mut plans = recording.plans.iter();
        let plan = plans.rfind(|plan| plan.report.plan_id == message.plan_id);
        if let Some(plan) = plan {
            let tracks = requested(&plan.request, message, clock)?;
            around.tracks.extend(tracks);
        }
    }
    let every = cycles.len().div_ceil(MOST_SAMPLES);
    let shown: Vec<&Cycle> = cycles.iter().step_by(every).collect();
    let moved = |of: fn(&Cycle) -> [f64; 6]| -> Vec<(f64, Configuration)> {
        let sample = |cycle: &&Cycle| (clock.seconds(cycle.stamp_mono_ns), of(cycle).into());
        shown.iter().map(sample).collect()
    };
    let commanded = moved(|cycle| cycle.commanded_configuration_rad);
    let measured = moved(|cycle| cycle.measured_configuration_rad);
    let mut motions = vec![
        Motion {
            is_selected: true,
            ..Motion::new("commanded".to_owned(), &commanded, &body, &around)
        },
        Motion::new("measured".to_owned(), &measured, &body, &around),
    ];
    for message in &recording.trajectories {
        motions.push(published(message, clock, &body, &around)?);
    }
    let switches = cycles.windows(2);
    let is_other = |pair: &&[Cycle]| ![0, pair[0].trajectory_id].contains(&pair[1].trajectory_id);
    let switches = switches.filter(is_other);
    let marks = switches.map(|pair| Mark {
        time_s: clock.seconds(pair[1].stamp_mono_ns),
    });
    Ok(View {
        title: name.to_string(),
        unit: "m",
        clearance_range: clearance_range(&motions, &body),
        robot: body,
        duration_s,
        balls: around.balls(),
        solids: around.solids(),
        curves: curves(&shown, clock, robot.tendon_count as usize),
        marks: marks.collect(),
        motions,
    })
}

/// The balls that a request named, while the motion lasts that it was answered with.
fn requested(
    request: &PlanRequest,
    message: &TrajectoryMessage,
    clock: Clock,
) -> anyhow::Result<Vec<BallTrack>> {
    let from_s = clock.seconds(message.begin_mono_ns);
    let until_s = from_s + motion(message)?.duration();
    let count = (request.ball_count as usize).min(request.balls.len());
    let track = |ball: &Ball| BallTrack {
        centre: ball.centre_m,
        velocity: [0.0; 3],
        radius: ball.radius_m,
        from_s,
        until_s,
    };
    Ok(request.balls[..count].iter().map(track).collect())
}

/// A motion that was published, from its begin to its end.
pub(super) fn published(
    message: &TrajectoryMessage,
    clock: Clock,
    body: &Body,
    around: &Surroundings,
) -> anyhow::Result<Motion> {
    let begins_s = clock.seconds(message.begin_mono_ns);
    let motion = motion(message)?;
    let samples = sampled(&motion, begins_s, SAMPLES);
    let (id, ends_s) = (message.trajectory_id, begins_s + motion.duration());
    let name = format!("{id}: {begins_s:.2} to {ends_s:.2} s");
    Ok(Motion {
        stays: false,
        ..Motion::new(name, &samples, body, around)
    })
}

/// Seconds since the first cycle, or since pages are served, by its time (ns of `CLOCK_MONOTONIC`).
#[derive(Clone, Copy)]
pub(super) struct Clock(pub(super) i64);

impl Clock {
    pub(super) fn seconds(self, mono_ns: i64) -> f64 {
        shared_types::clock::seconds(mono_ns.saturating_sub(self.0))
    }
}

/// The balls of the scenes: those of a source that go on as they were foreseen are one.
fn tracks(scenes: &[SceneMessage], clock: Clock, duration_s: f64) -> Vec<BallTrack> {
    let mut done = Vec::new();
    let mut current: BTreeMap<_, Vec<BallTrack>> = BTreeMap::new();
    for scene in scenes {
        let now_s = clock.seconds(scene.stamp_mono_ns);
        let seen = foreseen(scene, clock).into_iter();
        let before = current.remove(&scene.source).unwrap_or_default();
        let mut before: Vec<Option<BallTrack>> = before.into_iter().map(Some).collect();
        let mut tracks = Vec::with_capacity(seen.len());
        for (index, ball) in seen.enumerate() {
            let goes_on = before
                .get_mut(index)
                .and_then(|before| before.take_if(|before| is_foreseen(before, &ball)));
            let until_s = ball.until_s;
            tracks.push(goes_on.map_or(ball, |track| BallTrack { until_s, ..track }));
        }
        done.extend(before.into_iter().flatten().map(|track| BallTrack {
            until_s: track.until_s.min(now_s),
            ..track
        }));
        current.insert(scene.source, tracks);
    }
    let last = current.into_values().flatten();
    done.extend(last.map(|track| BallTrack {
        until_s: track.until_s.min(duration_s),
        ..track
    }));
    done.retain(|track| track.until_s > track.from_s && track.until_s > 0.0);
    done
}

/// The balls of a scene from its stamp until its lifetime ends; none where its source takes its leave.
pub(super) fn foreseen(scene: &SceneMessage, clock: Clock) -> Vec<BallTrack> {
    let from_s = clock.seconds(scene.stamp_mono_ns);
    let count = match scene.takes_leave {
        0 => (scene.ball_count as usize).min(scene.balls.len()),
        _ => 0,
    };
    let track = |ball: &MovingBall| BallTrack {
        centre: ball.centre_m,
        velocity: ball.velocity_m_s,
        radius: ball.radius_m,
        from_s,
        until_s: from_s + shared_types::clock::seconds(scene.lifetime_ns),
    };
    scene.balls[..count].iter().map(track).collect()
}

fn is_foreseen(before: &BallTrack, ball: &BallTrack) -> bool {
    let there = before.at(ball.from_s);
    there.is_some_and(|there| {
        let off = (there.centre - pcc_model::Point::from(ball.centre)).norm();
        off <= SAME_WAY_M && before.velocity == ball.velocity && before.radius == ball.radius
    })
}

/// Labels of tendons.
pub(super) fn numbered(tendons: usize) -> Vec<String> {
    (1..=tendons).map(|tendon| tendon.to_string()).collect()
}

/// Labels of a configuration's components.
pub(super) fn components() -> Vec<String> {
    let name = |d: usize| format!("ζ{} {}", d / 2 + 1, ["x", "y"][d % 2]);
    (0..6).map(name).collect()
}

fn curves(cycles: &[&Cycle], clock: Clock, tendons: usize) -> Vec<Curves> {
    let curves = |name, unit, labels: &[String], of: &dyn Fn(&Cycle, usize) -> f64| Curves {
        name,
        unit,
        labels: labels.to_vec(),
        time_s: cycles
            .iter()
            .map(|cycle| clock.seconds(cycle.stamp_mono_ns))
            .collect(),
        values: (0..labels.len())
            .map(|index| {
                cycles
                    .iter()
                    .map(|cycle| of(cycle, index))
                    .collect::<Samples>()
            })
            .collect(),
    };
    let (tendons, components) = (numbered(tendons), components());
    vec![
        curves("Set-points of the tendons", "m", &tendons, &|cycle, i| {
            cycle.setpoint_m[i]
        }),
        curves("Velocities of the tendons", "m/s", &tendons, &|cycle, i| {
            cycle.setpoint_velocity_m_s[i]
        }),
        curves("Measured tendons", "m", &tendons, &|cycle, i| {
            cycle.measured_tendon_m[i]
        }),
        curves(
            "Commanded configuration",
            "rad",
            &components,
            &|cycle, i| cycle.commanded_configuration_rad[i],
        ),
        curves("Measured configuration", "rad", &components, &|cycle, i| {
            cycle.measured_configuration_rad[i]
        }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn scene(stamp_s: f64, x_m: f64, velocity_m_s: f64) -> SceneMessage {
        let mut scene = SceneMessage::zeroed();
        scene.stamp_mono_ns = (stamp_s * 1e9) as i64;
        scene.lifetime_ns = 100_000_000;
        scene.ball_count = 1;
        scene.balls[0].centre_m = [x_m, 0.0, 0.0];
        scene.balls[0].velocity_m_s = [velocity_m_s, 0.0, 0.0];
        scene.balls[0].radius_m = 0.1;
        scene
    }

    #[test]
    fn a_ball_that_goes_on_as_foreseen_is_one_and_one_that_turns_is_two() {
        let scenes = [
            scene(1.0, 0.0, 1.0),
            scene(1.05, 0.05, 1.0),
            scene(1.1, 0.1, -1.0),
        ];
        let mut tracks = tracks(&scenes, Clock(0), 10.0);
        tracks.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        assert_eq!(tracks.len(), 2);
        assert!((tracks[0].from_s - 1.0).abs() < 1e-9 && (tracks[0].until_s - 1.1).abs() < 1e-9);
        assert!((tracks[1].from_s - 1.1).abs() < 1e-9 && (tracks[1].until_s - 1.2).abs() < 1e-9);
    }
}
