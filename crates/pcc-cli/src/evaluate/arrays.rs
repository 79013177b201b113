//! `paths.npz`: the drawn paths, the verdicts, and the executed curves (docs/evaluation.md "The command").

use super::answer::Answer;
use datasets::{ArchiveError, ArchiveWriter};
use pcc_model::{Configuration, DOF};
use planning::{Draw, Plan, Source, WAYPOINTS, Waypoints};
use std::path::Path;
use trajectory::{Knot, Trajectory};

/// Writes every array; `slots` candidates were asked for in each case.
pub(super) fn write(file: &Path, answers: &[Answer], slots: usize) -> Result<(), ArchiveError> {
    let cases = answers.len();
    let mut archive = ArchiveWriter::create(file)?;
    write_cases(&mut archive, answers)?;
    let draws: Vec<Option<&Draw>> = answers.iter().flat_map(|a| draws_of(a, slots)).collect();
    let shape = [cases, slots, WAYPOINTS, DOF];
    archive.write("paths", &shape, draws.iter().flat_map(|d| path_values(*d)))?;
    let sampled = draws.iter().map(|d| d.and_then(|d| d.sampled.as_ref()));
    archive.write("sampled", &shape, sampled.flat_map(values_of))?;
    write_verdicts(&mut archive, &draws, &shape[..2])?;
    let drawn = |plan: &Plan| (plan.draws.len() + plan.explored) as i64;
    let drawn = answers.iter().map(|a| a.plan.as_ref().map_or(0, drawn));
    archive.write("drawn", &[cases], drawn)?;
    archive.write("seconds", &[cases], answers.iter().map(|a| a.seconds))?;
    let motions = draws.iter().filter_map(|d| motion(*d));
    let knots = motions.map(|t| t.knots().len()).max().unwrap_or(0);
    let times = draws.iter().flat_map(|d| knot_times(*d, knots));
    archive.write("knot_time", &[cases, slots, knots], times)?;
    let values = draws.iter().flat_map(|d| knot_values(*d, knots));
    archive.write("knots", &[cases, slots, knots, 3, DOF], values)?;
    archive.finish()
}

fn write_verdicts(
    archive: &mut ArchiveWriter,
    draws: &[Option<&Draw>],
    shape: &[usize],
) -> Result<(), ArchiveError> {
    let certified = draws.iter().map(|d| u8::from(d.is_some_and(is_certified)));
    archive.write("certified", shape, certified)?;
    let delivered = draws.iter().map(|d| u8::from(motion(*d).is_some()));
    archive.write("delivered", shape, delivered)?;
    archive.write("source", shape, draws.iter().map(|d| source_code(*d)))
}

fn write_cases(archive: &mut ArchiveWriter, answers: &[Answer]) -> Result<(), ArchiveError> {
    let cases = answers.len();
    let starts = answers
        .iter()
        .flat_map(|a| <[f64; DOF]>::from(a.case.start));
    archive.write("starts", &[cases, DOF], starts)?;
    let tips = answers
        .iter()
        .flat_map(|a| <[f64; 3]>::from(a.case.target_tip));
    archive.write("target_tips", &[cases, 3], tips)?;
    archive.write_balls(answers.iter().map(|a| a.case.scene.balls()), |v| v)
}

fn draws_of(answer: &Answer, slots: usize) -> Vec<Option<&Draw>> {
    let draws = answer.plan.as_ref().map_or(&[][..], |p| p.draws.as_slice());
    (0..slots).map(|i| draws.get(i)).collect()
}

fn motion(draw: Option<&Draw>) -> Option<&Trajectory> {
    draw.and_then(|d| d.outcome.as_ref().ok())
        .map(|motion| &*motion.trajectory)
}

/// The executed curve's samples where there is one, else the path that was drawn.
fn path_values(draw: Option<&Draw>) -> Vec<f64> {
    let executed = motion(draw).map(|t| t.sample(WAYPOINTS));
    let drawn = || draw.and_then(|d| d.path.clone());
    values_of(executed.or_else(drawn).as_ref())
}

fn values_of(path: Option<&Waypoints>) -> Vec<f64> {
    match path {
        Some(path) => path.iter().flat_map(|q| <[f64; DOF]>::from(*q)).collect(),
        None => vec![f64::NAN; WAYPOINTS * DOF],
    }
}

/// Whether a draw is certified and was asked for or filled in; motions found by exploring come in addition and do not count.
fn is_certified(draw: &Draw) -> bool {
    draw.outcome.is_ok() && draw.source != Source::Explored
}

fn source_code(draw: Option<&Draw>) -> u8 {
    let source = draw.filter(|draw| draw.path.is_some()).map(|d| d.source);
    match source {
        Some(Source::Learned) => 1,
        Some(Source::StraightLine | Source::Classical) => 2,
        Some(Source::Explored) => 3,
        Some(Source::Kept | Source::MovedEnd) | None => 0,
    }
}

fn knot_times(draw: Option<&Draw>, count: usize) -> Vec<f64> {
    let known = motion(draw).map_or(&[][..], Trajectory::knots);
    (0..count)
        .map(|i| known.get(i).map_or(f64::NAN, |k| k.time))
        .collect()
}

fn knot_values(draw: Option<&Draw>, count: usize) -> Vec<f64> {
    let known = motion(draw).map_or(&[][..], Trajectory::knots);
    let missing = Configuration::repeat(f64::NAN);
    let triple = |knot: Option<&Knot>| {
        knot.map_or([missing; 3], |k| [k.position, k.velocity, k.acceleration])
    };
    (0..count)
        .flat_map(|i| triple(known.get(i)))
        .flat_map(<[f64; DOF]>::from)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use planning::{Certified, Failure, PathMetrics};

    fn motion_at_rest() -> Certified {
        let knot = |time| Knot {
            time,
            position: Configuration::zeros(),
            velocity: Configuration::zeros(),
            acceleration: Configuration::zeros(),
        };
        Certified {
            trajectory: Trajectory::new(vec![knot(0.0), knot(1.0)]).unwrap().into(),
            metrics: PathMetrics {
                duration_s: 1.0,
                tip_length: 0.0,
                tip_distance: 0.0,
                tip_smoothness: 0.0,
                clearance: 1.0,
                configuration_length: 0.0,
            },
        }
    }

    #[test]
    fn what_exploring_found_is_delivered_and_not_certified() {
        let draw = |source, outcome| Draw {
            sampled: None,
            path: Some(vec![Configuration::zeros(); WAYPOINTS]),
            source,
            outcome,
        };
        for (source, code, counts) in [
            (Source::Learned, 1, true),
            (Source::StraightLine, 2, true),
            (Source::Classical, 2, true),
            (Source::Explored, 3, false),
        ] {
            let found = draw(source, Ok(motion_at_rest()));
            assert_eq!(is_certified(&found), counts);
            assert!(motion(Some(&found)).is_some());
            assert_eq!(source_code(Some(&found)), code);
            let failed = draw(source, Err(Failure::Collision));
            assert!(!is_certified(&failed) && motion(Some(&failed)).is_none());
        }
    }
}
