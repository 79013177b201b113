//! What `pcc evaluate` wrote of its motions, beside what the data set asked for.

use std::collections::HashSet;
use std::path::Path;

use anyhow::ensure;
use collision::{Ball, Scene};
use datasets::{ArchiveReader, Dataset, Row, Split};
use pcc_model::{Configuration, Point, Robot};
use tests::brute_force;
use trajectory::{Knot, Trajectory};

use crate::second_look::{Demand, End, Judged, Suspect, TIP_TOLERANCE};

/// Who proposed a path, in the array `source` of `paths.npz`.
const LEARNED: u8 = 1;
const EXPLORED: u8 = 3;

/// What a planner was asked.
struct Asked {
    start: Configuration,
    target: Point,
    scene: Scene,
}

/// The arrays of `paths.npz` that say what would be executed, and the cases of the data set.
pub(crate) struct Motions {
    certified: Vec<u8>,
    /// Slots with a motion: the certified ones, and those that exploring filled.
    delivered: Vec<u8>,
    source: Vec<u8>,
    /// Draws of each case, those of exploring included.
    drawn: Vec<i64>,
    slots: usize,
    asked: Vec<Asked>,
    times: Vec<f64>,
    knots: Vec<f64>,
    width: usize,
}

impl Motions {
    /// Reads `paths.npz` of a folder: what it says of its cases must be what the data set has.
    pub(crate) fn read(out: &Path, dataset: &Path) -> anyhow::Result<Self> {
        let mut archive = ArchiveReader::open(&out.join("paths.npz"))?;
        let (certified, shape) = archive.read("certified")?;
        let (times, shape_of_times) = archive.read("knot_time")?;
        let motions = Self {
            certified,
            delivered: archive.read("delivered")?.0,
            source: archive.read("source")?.0,
            drawn: archive.read("drawn")?.0,
            slots: usize::try_from(shape[1])?,
            asked: asked(dataset, usize::try_from(shape[0])?)?,
            times,
            knots: archive.read("knots")?.0,
            width: usize::try_from(shape_of_times[2])?,
        };
        motions.compare(&mut archive)?;
        Ok(motions)
    }

    /// The cases of an archive are those of the data set, to the last bit.
    fn compare(&self, archive: &mut ArchiveReader) -> anyhow::Result<()> {
        let balls = || self.asked.iter().flat_map(|asked| asked.scene.balls());
        let starts = self.asked.iter().flat_map(|asked| asked.start.iter());
        let targets = self.asked.iter().flat_map(|asked| asked.target.iter());
        let centres = balls().flat_map(|ball| ball.centre.iter());
        let radii = balls().map(|ball| &ball.radius);
        let pairs: [(&str, Vec<&f64>); 4] = [
            ("starts", starts.collect()),
            ("target_tips", targets.collect()),
            ("obstacle_centres", centres.collect()),
            ("obstacle_radii", radii.collect()),
        ];
        let is_not = |array: &str| format!("paths.npz: {array} is not what the data set has");
        for (array, expected) in pairs {
            let found: Vec<f64> = archive.read(array)?.0;
            let is_same = found.iter().eq(expected);
            ensure!(is_same, is_not(array));
        }
        let offsets: Vec<i64> = archive.read("obstacle_offsets")?.0;
        let counts = offsets.windows(2).map(|pair| pair[1] - pair[0]);
        let expected = self.asked.iter().map(|asked| asked.scene.balls().len());
        let is_same = offsets.first() == Some(&0) && counts.eq(expected.map(|n| n as i64));
        ensure!(is_same, is_not("obstacle_offsets"));
        Ok(())
    }

    pub(crate) fn cases(&self) -> usize {
        self.asked.len()
    }

    /// Share of all candidates asked for that are certified, without what exploring adds.
    pub(crate) fn share(&self) -> f64 {
        self.count_certified() as f64 / self.certified.len() as f64
    }

    fn count_certified(&self) -> usize {
        self.certified.iter().filter(|c| **c == 1).count()
    }

    /// Draws that were made of those asked for, and the share of them that is certified: a planner may draw fewer than it is asked for.
    pub(crate) fn of_those_drawn(&self) -> (usize, f64) {
        let made = self.drawn.iter().map(|&drawn| drawn as usize);
        let made: usize = made.map(|drawn| drawn.min(self.slots)).sum();
        (made, self.count_certified() as f64 / made as f64)
    }

    /// The certified slots of a case, without those that exploring filled.
    pub(crate) fn certified(&self, case: usize) -> impl Iterator<Item = usize> {
        let slots = case * self.slots..(case + 1) * self.slots;
        slots.filter(|&slot| self.certified[slot] == 1)
    }

    /// The slots of a case with a motion, those that exploring filled included.
    fn delivered(&self, case: usize) -> impl Iterator<Item = usize> {
        let slots = case * self.slots..(case + 1) * self.slots;
        slots.filter(|&slot| self.delivered[slot] == 1)
    }

    /// Cases in which exploring drew more than was asked for, the motions that it found there, and what counts as certified there all
    /// the same: it begins only where no draw is certified.
    pub(crate) fn explored(&self) -> (usize, usize, Vec<String>) {
        let has_explored = |case: &usize| self.drawn[*case] > self.slots as i64;
        let cases: Vec<usize> = (0..self.cases()).filter(has_explored).collect();
        let found = cases.iter().flat_map(|&case| self.delivered(case));
        let found = found.filter(|&slot| self.source[slot] == EXPLORED).count();
        let certified = cases.iter().flat_map(|&case| self.certified(case));
        let certified = certified.map(|slot| self.name(slot));
        (cases.len(), found, certified.collect())
    }

    /// Whether a case has a candidate, be it one that exploring found.
    pub(crate) fn is_answered(&self, case: usize) -> bool {
        self.delivered(case).next().is_some()
    }

    /// Whether a case has a certified candidate of the learned sampler.
    pub(crate) fn has_learned(&self, case: usize) -> bool {
        self.certified(case)
            .any(|slot| self.source[slot] == LEARNED)
    }

    /// The motion of a slot.
    pub(crate) fn motion(&self, slot: usize) -> anyhow::Result<Trajectory> {
        let times = &self.times[slot * self.width..(slot + 1) * self.width];
        let knot = |(i, time): (usize, &f64)| {
            let at = (slot * self.width + i) * 18;
            let part = |k: usize| {
                Configuration::from_column_slice(&self.knots[at + 6 * k..at + 6 * k + 6])
            };
            Knot {
                time: *time,
                position: part(0),
                velocity: part(1),
                acceleration: part(2),
            }
        };
        let known = times
            .iter()
            .enumerate()
            .filter(|(_, time)| time.is_finite());
        Ok(Trajectory::new(known.map(knot).collect())?)
    }

    /// Judges the motions of all slots that are said to be certified or to have one: every `every`-th over its whole duration, the others
    /// where they start and end.
    pub(crate) fn judge(&self, robot: &Robot, every: usize) -> Judged {
        let has_motion = |slot: &usize| self.certified[*slot] == 1 || self.delivered[*slot] == 1;
        let slots: Vec<usize> = (0..self.certified.len()).filter(has_motion).collect();
        let mut judged = Judged::of(slots.len(), every, |index| Suspect {
            demand: self.asked[slots[index] / self.slots].demand(robot),
            motion: self.motion(slots[index]),
            name: self.name(slots[index]),
        });
        for &slot in &slots {
            if let Some(contradiction) = self.contradiction(slot) {
                judged.contradict(format!("{}: {contradiction}", self.name(slot)));
            }
        }
        judged
    }

    /// What the verdicts of a slot say against each other.
    fn contradiction(&self, slot: usize) -> Option<&'static str> {
        match (
            self.certified[slot],
            self.delivered[slot],
            self.source[slot],
        ) {
            (1, 0, _) => Some("certified, and not delivered"),
            (1, _, EXPLORED) => Some("certified, and found by exploring, which does not count"),
            _ => None,
        }
    }

    fn name(&self, slot: usize) -> String {
        let (case, candidate) = (slot / self.slots, slot % self.slots);
        format!("case {case}, candidate {candidate}")
    }

    /// The obstacles of a case.
    pub(crate) fn scene(&self, case: usize) -> &Scene {
        &self.asked[case].scene
    }

    /// Where the motions of a case start.
    pub(crate) fn start(&self, case: usize) -> Configuration {
        self.asked[case].start
    }
}

impl Asked {
    fn demand(&self, robot: &Robot) -> Demand {
        let ball = |ball: &Ball| brute_force::Ball::resting(ball.centre.into(), ball.radius);
        Demand {
            balls: self.scene.balls().iter().map(ball).collect(),
            start: [self.start.into(), [0.0; 6], [0.0; 6]],
            end: End::Tip {
                position: self.target.into(),
                tolerance: TIP_TOLERANCE,
            },
            limits: robot.tendon_limits,
        }
    }
}

/// The first `count` cases of a data set's test split, each of them the first row of its target and start, in file order.
fn asked(dataset: &Path, count: usize) -> anyhow::Result<Vec<Asked>> {
    let mut known = HashSet::new();
    let rows = Dataset::read(dataset)?.rows;
    let is_first = |row: &&Row| known.insert((row.target_index, row.start_index));
    let rows = rows.iter().filter(|row| row.split == Split::Test);
    let asked = |row: &Row| {
        Ok(Asked {
            start: row.path[0],
            target: row.target_tip,
            scene: Scene::new(row.balls.clone())?,
        })
    };
    let all: Vec<Asked> = rows
        .filter(is_first)
        .take(count)
        .map(asked)
        .collect::<anyhow::Result<_>>()?;
    let found = all.len();
    ensure!(
        found == count,
        "paths.npz has {count} cases, the data set {found}"
    );
    Ok(all)
}

#[cfg(test)]
mod unit {
    use tests::programs::repository;

    use super::*;

    fn robot() -> Robot {
        Robot::from_file(&repository().join("config/robots/unit.toml")).unwrap()
    }

    /// One case with two slots, in the first of which the robot stays straight.
    fn one_case() -> Motions {
        let resting = [0.0; 2 * 18];
        let none = [f64::NAN; 2 * 18];
        Motions {
            certified: vec![1, 0],
            delivered: vec![1, 0],
            source: vec![LEARNED, LEARNED],
            drawn: vec![1],
            slots: 2,
            asked: vec![Asked {
                start: Configuration::zeros(),
                target: Point::new(0.0, 0.0, 3.0),
                scene: Scene::default(),
            }],
            times: vec![0.0, 1.0, f64::NAN, f64::NAN],
            knots: [resting, none].concat(),
            width: 2,
        }
    }

    fn passes(motions: &Motions) -> bool {
        motions.judge(&robot(), 1).passes()
    }

    #[test]
    fn what_counts_has_a_motion_and_was_not_found_by_exploring() {
        assert!(passes(&one_case()));
        assert_eq!(one_case().of_those_drawn(), (1, 1.0));
        let mut without_motion = one_case();
        without_motion.certified[1] = 1;
        without_motion.delivered[1] = 1;
        assert!(!passes(&without_motion));
        let mut undelivered = one_case();
        undelivered.delivered[0] = 0;
        assert!(!passes(&undelivered));
        let mut explored = one_case();
        explored.source[0] = EXPLORED;
        assert!(!passes(&explored));
    }

    #[test]
    fn the_cases_of_the_data_set_are_its_first_rows() {
        let sample = repository().join("tests/data/reference-mixed-sample");
        let found = asked(&sample, 60).unwrap();
        let expected = Dataset::read(&sample).unwrap();
        let expected = expected.cases(Split::Test, None).unwrap();
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(
                (found.start, found.target),
                (expected.start, expected.target_tip)
            );
        }
        assert!(asked(&sample, 61).is_err());
    }
}
