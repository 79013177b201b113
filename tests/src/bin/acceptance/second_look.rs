//! A second look at motions that were delivered as certified: by their knots alone, with kinematics, distances and a law of motion of its
//! own, none of which the certificate uses.

use std::sync::LazyLock;

use anyhow::{Context, ensure};
use collision::{Ball, Scene};
use datasets::ArchiveReader;
use pcc_model::{Configuration, Point, Robot, TendonLimits};
use tests::brute_force::{self, Body};
use tests::knots;
use tests::programs::repository;
use tests::world::shipped_number;
use trajectory::{Knot, Trajectory};

use crate::report::Report;

/// Who proposed a path, in the array `source` of `paths.npz`.
const LEARNED: u8 = 1;
const EXPLORED: u8 = 3;
/// Tip error that counts as reached, section lengths.
pub(crate) const TIP_TOLERANCE: f64 = 0.01;
/// How far beyond its limit a section may bend, rad.
const BENDING_SLACK_RAD: f64 = 5e-3;

/// The unit robot, which all of these motions are of.
static BODY: LazyLock<Body> = LazyLock::new(|| {
    let file = repository().join("config/robots/unit.toml");
    Body::from_robot_file(&std::fs::read_to_string(file).unwrap())
});

/// What its sections may bend by, rad.
static BENDING_LIMIT_RAD: LazyLock<f64> =
    LazyLock::new(|| shipped_number("robots/unit.toml", "bending_limit_rad"));

/// What a motion must keep; lengths in section lengths.
pub(crate) struct Demand<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) start: Configuration,
    pub(crate) target: Point,
    pub(crate) tip_tolerance: f64,
    pub(crate) limits: TendonLimits,
}

fn plain(motion: &Trajectory) -> Vec<knots::Knot> {
    let knot = |knot: &Knot| knots::Knot {
        time_s: knot.time,
        values: [knot.position, knot.velocity, knot.acceleration].map(Into::into),
    };
    motion.knots().iter().map(knot).collect()
}

fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

impl Demand<'_> {
    /// Judges start, tip, bending, tendon limits, and the least clearance of the whole motion.
    pub(crate) fn judge(&self, motion: &Trajectory) -> anyhow::Result<()> {
        let knots = plain(motion);
        self.judge_first_and_last(&knots)?;
        let bending_rad = knots::largest_bending_rad(&knots);
        ensure!(
            bending_rad <= *BENDING_LIMIT_RAD + BENDING_SLACK_RAD,
            "bends by {bending_rad} rad"
        );
        let limits = &self.limits;
        let limits = [limits.velocity, limits.acceleration, limits.jerk];
        let used = knots::limit_use(&BODY, &knots, &limits);
        let is_kept = used.iter().all(|used| *used <= 1.0 + 1e-6);
        ensure!(
            is_kept,
            "uses {used:?} of velocity, acceleration and jerk limits"
        );
        self.judge_clearance(&knots)
    }

    /// Against balls: other obstacles have checks of their own.
    fn judge_clearance(&self, knots: &[knots::Knot]) -> anyhow::Result<()> {
        ensure!(
            self.scene.solids().is_empty(),
            "the premise: balls alone stand in the way"
        );
        let balls = self.scene.balls().iter();
        let balls: Vec<brute_force::Ball> = balls
            .map(|ball| brute_force::Ball::resting(ball.centre.into(), ball.radius))
            .collect();
        let clearance = knots::least_clearance_m(&BODY, knots, &balls);
        ensure!(clearance >= -BODY.chord_error_m(), "clearance {clearance}");
        Ok(())
    }

    /// Judges where it starts and where its tip ends.
    pub(crate) fn judge_ends(&self, motion: &Trajectory) -> anyhow::Result<()> {
        self.judge_first_and_last(&plain(motion))
    }

    fn judge_first_and_last(&self, knots: &[knots::Knot]) -> anyhow::Result<()> {
        let first = knots.first().context("it has no knots")?.values[0];
        let last = knots.last().context("it has no knots")?.values[0];
        let away = distance(&first, &self.start.into());
        ensure!(away <= 1e-6, "starts {away} rad away");
        let error = distance(&BODY.tip(&last), &self.target.into());
        ensure!(error <= self.tip_tolerance, "tip error {error}");
        Ok(())
    }
}

/// The arrays of `paths.npz` that say what was asked and what would be executed.
pub(crate) struct Motions {
    certified: Vec<u8>,
    /// Those that were certified in addition by exploring, too.
    delivered: Vec<u8>,
    source: Vec<u8>,
    /// Draws of each case, those of exploring included.
    drawn: Vec<i64>,
    slots: usize,
    starts: Vec<f64>,
    targets: Vec<f64>,
    scenes: Vec<Scene>,
    times: Vec<f64>,
    knots: Vec<f64>,
    width: usize,
}

impl Motions {
    pub(crate) fn read(archive: &mut ArchiveReader) -> anyhow::Result<Self> {
        let centres: Vec<f64> = archive.read("obstacle_centres")?.0;
        let radii: Vec<f64> = archive.read("obstacle_radii")?.0;
        let offsets: Vec<i64> = archive.read("obstacle_offsets")?.0;
        let ball = |i: usize| Ball {
            centre: Point::from_column_slice(&centres[3 * i..3 * i + 3]),
            radius: radii[i],
        };
        let scene = |pair: &[i64]| {
            Ok(Scene::new(
                (pair[0] as usize..pair[1] as usize).map(ball).collect(),
            )?)
        };
        let (certified, shape) = archive.read("certified")?;
        let (times, shape_of_times) = archive.read("knot_time")?;
        Ok(Self {
            certified,
            delivered: archive.read("delivered")?.0,
            source: archive.read("source")?.0,
            drawn: archive.read("drawn")?.0,
            slots: usize::try_from(shape[1])?,
            starts: archive.read("starts")?.0,
            targets: archive.read("target_tips")?.0,
            scenes: offsets
                .windows(2)
                .map(scene)
                .collect::<anyhow::Result<_>>()?,
            times,
            knots: archive.read("knots")?.0,
            width: usize::try_from(shape_of_times[2])?,
        })
    }

    pub(crate) fn cases(&self) -> usize {
        self.certified.len() / self.slots
    }

    /// Share of all candidates asked for that are certified, without what exploring adds.
    pub(crate) fn share(&self) -> f64 {
        let certified = self.certified.iter().filter(|c| **c == 1).count();
        certified as f64 / self.certified.len() as f64
    }

    /// The certified slots of a case, without those that exploring filled.
    pub(crate) fn certified(&self, case: usize) -> impl Iterator<Item = usize> {
        let slots = case * self.slots..(case + 1) * self.slots;
        slots.filter(|&slot| self.certified[slot] == 1)
    }

    /// The slots of a case with a motion, those that exploring filled included.
    pub(crate) fn delivered(&self, case: usize) -> impl Iterator<Item = usize> {
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
        let certified = cases
            .iter()
            .flat_map(|&case| self.certified(case).map(move |slot| (case, slot)));
        let name = |(case, slot): (usize, usize)| format!("case {case}, slot {slot}");
        (cases.len(), found, certified.map(name).collect())
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

    /// The motion of a delivered slot.
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

    /// Judges every so many-th delivered motion over its whole duration, the others where they start and end.
    pub(crate) fn judge(&self, robot: &Robot, every: usize) -> Judged {
        let mut judged = Judged::default();
        let slots = (0..self.cases()).flat_map(|case| self.delivered(case).map(move |s| (case, s)));
        for (index, (case, slot)) in slots.enumerate() {
            let demand = Demand {
                scene: self.scene(case),
                start: self.start(case),
                target: Point::from_column_slice(&self.targets[3 * case..3 * case + 3]),
                tip_tolerance: TIP_TOLERANCE,
                limits: robot.tendon_limits,
            };
            let wholly = index.is_multiple_of(every);
            let name = || format!("case {case}, candidate {}", slot % self.slots);
            judged.add(&demand, self.motion(slot), wholly, name);
        }
        judged
    }

    /// The obstacles of a case.
    pub(crate) fn scene(&self, case: usize) -> &Scene {
        &self.scenes[case]
    }

    /// Where the motions of a case start.
    pub(crate) fn start(&self, case: usize) -> Configuration {
        Configuration::from_column_slice(&self.starts[6 * case..6 * case + 6])
    }
}

/// Motions that were looked at again.
#[derive(Default)]
pub(crate) struct Judged {
    /// Over their whole duration.
    whole: usize,
    /// Where they start and end alone.
    at_ends: usize,
    /// What their knots contradict.
    contradicted: Vec<String>,
}

impl Judged {
    /// Judges a motion over its whole duration, or where it starts and ends.
    pub(crate) fn add(
        &mut self,
        demand: &Demand,
        motion: anyhow::Result<Trajectory>,
        wholly: bool,
        name: impl FnOnce() -> String,
    ) {
        self.whole += usize::from(wholly);
        self.at_ends += usize::from(!wholly);
        let verdict = motion.and_then(|motion| match wholly {
            true => demand.judge(&motion),
            false => demand.judge_ends(&motion),
        });
        if let Err(error) = verdict {
            self.contradicted.push(format!("{}: {error:#}", name()));
        }
    }

    pub(crate) fn merge(&mut self, other: Self) {
        self.whole += other.whole;
        self.at_ends += other.at_ends;
        self.contradicted.extend(other.contradicted);
    }

    /// The check that no motion is contradicted; it needs one that was judged over its whole duration.
    pub(crate) fn check(&self, report: &mut Report, of: &str) {
        let Self {
            whole,
            at_ends,
            contradicted,
        } = self;
        let line = format!(
            "{of}: {whole} motions judged over their whole duration, {at_ends} where they start and end alone; contradicted by their knots"
        );
        let first: Vec<&str> = contradicted.iter().take(3).map(String::as_str).collect();
        let figure = format!("{} {}", contradicted.len(), first.join("; "));
        let passed = contradicted.is_empty() && *whole > 0;
        let bar = "0, of at least one over its whole duration";
        report.check(&line, figure.trim().to_owned(), bar, passed);
    }
}
