//! A case of an evaluation's `paths.npz`.

use super::page::{Body, Curves, Mark, Motion, View, clearance_range, sampled};
use super::samples::Samples;
use super::surroundings::{BallTrack, Surroundings};
use crate::robot::unit_robot;
use anyhow::ensure;
use datasets::ArchiveReader;
use pcc_model::{Configuration, DOF, Robot};
use std::path::Path;
use trajectory::{Knot, Trajectory};

/// Samples of a motion.
const SAMPLES: usize = 200;

/// Names of the sources by the number in `source`.
const SOURCES: [&str; 4] = ["nothing", "learned", "classical", "explored"];

pub(super) fn read(
    file: &Path,
    case: usize,
    robot: &Path,
    scene: Option<&Path>,
) -> anyhow::Result<View> {
    let robot = unit_robot(robot)?;
    let mut archive = ArchiveReader::open(file)?;
    let shape = archive.shape("knots")?.to_vec();
    let cases = shape.first().copied().unwrap_or(0) as usize;
    ensure!(
        case < cases,
        "--case {case}: {} has {cases} cases; the first is 0, and a number below {cases} is needed",
        file.display()
    );
    let (candidates, knots) = (shape[1] as usize, shape[2] as usize);
    archive.expect_shape("knots", &[cases, candidates, knots, 3, DOF])?;
    let times = archive.read::<f64>("knot_time")?.0;
    let states = archive.read::<f64>("knots")?.0;
    let sources = archive.read::<u8>("source")?.0;
    let offsets = archive.read::<i64>("obstacle_offsets")?.0;
    let centres = archive.read::<f64>("obstacle_centres")?.0;
    let radii = archive.read::<f64>("obstacle_radii")?.0;
    let [first, end] = [offsets[case], offsets[case + 1]].map(|offset| offset as usize);
    let mut motions = Vec::new();
    for candidate in 0..candidates {
        let at = case * candidates + candidate;
        let of_knots = at * knots..(at + 1) * knots;
        let whole = of_knots.filter(|&knot| times[knot].is_finite());
        let whole = whole.map(|knot| knot_of(times[knot], &states[3 * DOF * knot..]));
        let Ok(motion) = Trajectory::new(whole.collect()) else {
            continue;
        };
        let source = SOURCES.get(usize::from(sources[at])).unwrap_or(&"unknown");
        motions.push((
            format!("{candidate}: {source}, {:.2} s", motion.duration()),
            motion,
        ));
    }
    let duration_s = motions.iter().map(|it| it.1.duration()).fold(0.0, f64::max);
    let mut around = Surroundings::of_file(scene, robot.section_length_m())?;
    let balls = (first..end).map(|ball| BallTrack {
        centre: std::array::from_fn(|axis| centres[3 * ball + axis]),
        velocity: [0.0; 3],
        radius: radii[ball],
        from_s: 0.0,
        until_s: duration_s,
    });
    around.tracks.extend(balls);
    let body = Body {
        section_lengths: robot.section_lengths,
        tube_radii: robot.tube_radii,
    };
    let fastest = motions.iter().enumerate();
    let fastest = fastest.min_by(|a, b| a.1.1.duration().total_cmp(&b.1.1.duration()));
    let fastest = fastest.map(|(index, _)| index);
    let curves = fastest.map(|index| tendons(&robot, &motions[index].1));
    let shown = motions.iter().enumerate().map(|(index, (name, motion))| {
        let samples = sampled(motion, 0.0, SAMPLES);
        Motion {
            is_selected: Some(index) == fastest,
            ..Motion::new(name.clone(), &samples, &body, &around)
        }
    });
    let shown: Vec<Motion> = shown.collect();
    Ok(View {
        title: format!("{}, case {case}", file.display()),
        unit: "L",
        clearance_range: clearance_range(&shown, &body),
        robot: body,
        duration_s,
        balls: around.balls(),
        solids: around.solids(),
        motions: shown,
        curves: curves.into_iter().collect(),
        marks: Vec::<Mark>::new(),
    })
}

/// A knot from its position, velocity and acceleration.
fn knot_of(time: f64, state: &[f64]) -> Knot {
    let derivative =
        |order: usize| Configuration::from_column_slice(&state[order * DOF..(order + 1) * DOF]);
    Knot {
        time,
        position: derivative(0),
        velocity: derivative(1),
        acceleration: derivative(2),
    }
}

/// Length changes of the tendons in the fastest motion.
fn tendons(robot: &Robot, motion: &Trajectory) -> Curves {
    let count = robot.tendons.count();
    let mut values: Vec<Samples> = (0..count).map(|_| Samples::default()).collect();
    let mut lengths = vec![0.0; count];
    let samples = sampled(motion, 0.0, SAMPLES);
    for (_, configuration) in &samples {
        robot.tendons.lengths(configuration, &mut lengths);
        for (values, length) in values.iter_mut().zip(&lengths) {
            values.0.push(*length);
        }
    }
    Curves {
        name: "Tendons of the fastest motion",
        unit: "L",
        labels: (1..=count).map(|tendon| tendon.to_string()).collect(),
        time_s: samples.iter().map(|it| it.0).collect(),
        values,
    }
}
