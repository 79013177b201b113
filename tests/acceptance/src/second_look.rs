//! A second look at motions that were delivered as certified: by their knots alone, with kinematics, distances and a law of motion of its
//! own, none of which the certificate uses.

use std::sync::LazyLock;

use anyhow::{Context, ensure};
use pcc_model::TendonLimits;
use rayon::prelude::*;
use tests::brute_force::{self, Ball, Body};
use tests::knots;
use tests::programs::repository;
use tests::world::shipped_number;
use trajectory::{Knot, Trajectory};

use crate::report::Report;

/// Tip error that counts as reached, section lengths.
pub(crate) const TIP_TOLERANCE: f64 = 0.01;
/// How far from where it was asked to start a motion may start, rad.
const START_TOLERANCE_RAD: f64 = 1e-6;
/// How far from the configuration that was asked for a motion may end, rad: the rounding of sums.
const END_TOLERANCE_RAD: f64 = 1e-9;
/// How far velocity and acceleration may be from those asked for at the start, and from rest at the end, rad/s and rad/s².
const RATE_TOLERANCE: f64 = 1e-9;
/// How far beyond its limit, or beyond the start where that bends further, rounding may bend a section, rad.
const BENDING_ROUNDING_RAD: f64 = 1e-6;

/// The unit robot, which all of these motions are of.
pub(crate) static BODY: LazyLock<Body> = LazyLock::new(|| {
    let file = repository().join("config/robots/unit.toml");
    Body::from_robot_file(&std::fs::read_to_string(file).unwrap())
});

/// What its sections may bend by, rad.
static BENDING_LIMIT_RAD: LazyLock<f64> =
    LazyLock::new(|| shipped_number("robots/unit.toml", "bending_limit_rad"));

/// Where a motion has to end; lengths in section lengths.
#[derive(Clone, Copy)]
pub(crate) enum End {
    Tip { position: [f64; 3], tolerance: f64 },
    Configuration(brute_force::Configuration),
}

/// What a motion must keep; lengths in section lengths.
pub(crate) struct Demand {
    /// All that stands in the way.
    pub(crate) balls: Vec<Ball>,
    /// Configuration, velocity and acceleration.
    pub(crate) start: [brute_force::Configuration; 3],
    pub(crate) end: End,
    pub(crate) limits: TendonLimits,
}

/// The knots of a motion for [`tests::knots`].
pub(crate) fn plain(motion: &Trajectory) -> Vec<knots::Knot> {
    let knot = |knot: &Knot| knots::Knot {
        time_s: knot.time,
        values: [knot.position, knot.velocity, knot.acceleration].map(Into::into),
    };
    motion.knots().iter().map(knot).collect()
}

/// The limits for [`tests::knots`].
pub(crate) fn plain_limits(limits: &TendonLimits) -> knots::Limits {
    [limits.velocity, limits.acceleration, limits.jerk]
}

fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

impl Demand {
    /// Judges both ends, bending, tendon limits, and the least clearance of the whole motion.
    pub(crate) fn judge(&self, motion: &Trajectory) -> anyhow::Result<()> {
        let knots = plain(motion);
        self.judge_first_and_last(&knots)?;
        let bending_rad = knots::largest_bending_rad(&knots);
        let of_start = self.start[0].chunks(2).map(|it| it[0].hypot(it[1]));
        ensure!(
            bending_rad <= of_start.fold(*BENDING_LIMIT_RAD, f64::max) + BENDING_ROUNDING_RAD,
            "bends by {bending_rad} rad"
        );
        let used = knots::limit_use(&BODY, &knots, &plain_limits(&self.limits));
        let is_kept = used.iter().all(|used| *used <= 1.0 + 1e-6);
        ensure!(
            is_kept,
            "uses {used:?} of velocity, acceleration and jerk limits"
        );
        let clearance = knots::least_clearance_m(&BODY, &knots, &self.balls);
        ensure!(clearance >= -BODY.chord_error_m(), "clearance {clearance}");
        Ok(())
    }

    /// Judges the states in which it starts and ends.
    pub(crate) fn judge_ends(&self, motion: &Trajectory) -> anyhow::Result<()> {
        self.judge_first_and_last(&plain(motion))
    }

    fn judge_first_and_last(&self, knots: &[knots::Knot]) -> anyhow::Result<()> {
        let first = knots.first().context("it has no knots")?.values;
        let last = knots.last().context("it has no knots")?.values;
        let [away, rates @ ..] = [0, 1, 2].map(|i| distance(&first[i], &self.start[i]));
        ensure!(away <= START_TOLERANCE_RAD, "starts {away} rad away");
        let as_asked = rates.iter().all(|rate| *rate <= RATE_TOLERANCE);
        ensure!(
            as_asked,
            "its velocity and acceleration at the start are {rates:?} away from those asked for"
        );
        let rates = [1, 2].map(|i| distance(&last[i], &[0.0; 6]));
        let is_resting = rates.iter().all(|rate| *rate <= RATE_TOLERANCE);
        ensure!(
            is_resting,
            "ends with a velocity and an acceleration of {rates:?}"
        );
        self.end.judge(&last[0])
    }
}

impl End {
    fn judge(&self, last: &brute_force::Configuration) -> anyhow::Result<()> {
        match self {
            Self::Tip {
                position,
                tolerance,
            } => {
                let error = distance(&BODY.tip(last), position);
                ensure!(error <= *tolerance, "tip error {error}");
            }
            Self::Configuration(wanted) => {
                let away = distance(last, wanted);
                ensure!(
                    away <= END_TOLERANCE_RAD,
                    "ends {away} rad away from the configuration that was asked for"
                );
            }
        }
        Ok(())
    }
}

/// A motion to be judged.
pub(crate) struct Suspect {
    pub(crate) demand: Demand,
    pub(crate) motion: anyhow::Result<Trajectory>,
    /// The name that the report's lines call it by.
    pub(crate) name: String,
}

/// Motions that were looked at again.
#[derive(Default)]
pub(crate) struct Judged {
    /// Motions that were judged over their whole duration.
    whole: usize,
    /// Motions that were to be judged over their whole duration, had they all been motions.
    wanted: usize,
    /// Motions that were judged only where they start and end.
    at_ends: usize,
    /// What contradicts a motion, its knots or else, a line each.
    contradicted: Vec<String>,
}

impl Judged {
    /// Judges so many motions on all processors: every so many-th over its whole duration, the others where they start and end.
    pub(crate) fn of(
        count: usize,
        every: usize,
        suspect: impl Fn(usize) -> Suspect + Sync,
    ) -> Self {
        let one = |index: usize| {
            let mut judged = Self::default();
            judged.add(&suspect(index), index.is_multiple_of(every));
            judged
        };
        let each: Vec<Self> = (0..count).into_par_iter().map(one).collect();
        let mut all = Self::default();
        each.into_iter().for_each(|one| all.merge(one));
        all
    }

    /// Judges a motion over its whole duration, or where it starts and ends.
    pub(crate) fn add(&mut self, suspect: &Suspect, wholly: bool) {
        self.wanted += usize::from(wholly);
        let Suspect {
            demand,
            motion,
            name,
        } = suspect;
        let verdict = match motion {
            Err(error) => Err(format!("{error:#}")),
            Ok(motion) if wholly => {
                self.whole += 1;
                demand.judge(motion).map_err(|error| format!("{error:#}"))
            }
            Ok(motion) => {
                self.at_ends += 1;
                let verdict = demand.judge_ends(motion);
                verdict.map_err(|error| format!("{error:#}"))
            }
        };
        if let Err(error) = verdict {
            self.contradict(format!("{name}: {error}"));
        }
    }

    /// Adds what is contradicted by something else than a motion.
    pub(crate) fn contradict(&mut self, contradiction: String) {
        self.contradicted.push(contradiction);
    }

    pub(crate) fn merge(&mut self, other: Self) {
        self.whole += other.whole;
        self.wanted += other.wanted;
        self.at_ends += other.at_ends;
        self.contradicted.extend(other.contradicted);
    }

    /// Whether all that were to be judged over their whole duration were, at least one, and nothing is contradicted.
    pub(crate) fn passes(&self) -> bool {
        self.contradicted.is_empty() && self.whole >= self.wanted.max(1)
    }

    /// The check that no motion is contradicted; it needs one that was judged over its whole duration.
    pub(crate) fn check(&self, report: &mut Report, of: &str) {
        let Self {
            whole,
            at_ends,
            contradicted,
            ..
        } = self;
        let line = format!(
            "{of}: {whole} motions judged over their whole duration, {at_ends} where they start and end alone; contradicted by their knots"
        );
        let first: Vec<&str> = contradicted.iter().take(3).map(String::as_str).collect();
        let figure = format!("{} {}", contradicted.len(), first.join("; "));
        let wanted = self.wanted.max(1);
        let bar = format!("0, of at least {wanted} over their whole duration");
        report.check(&line, figure.trim().to_owned(), &bar, self.passes());
    }
}

#[cfg(test)]
mod unit {
    use super::*;

    const SWING: f64 = 0.4;

    /// From rest to rest in one component, in 20 s: slowly enough for all limits.
    fn swing() -> Trajectory {
        let knot = |time: f64, value: f64| {
            let mut knot = Knot::resting(time, [0.0; 6].into());
            knot.position[0] = value;
            knot
        };
        Trajectory::new(vec![knot(0.0, 0.0), knot(20.0, SWING)]).unwrap()
    }

    fn demand() -> Demand {
        Demand {
            balls: Vec::new(),
            start: [[0.0; 6]; 3],
            end: End::Configuration([SWING, 0.0, 0.0, 0.0, 0.0, 0.0]),
            limits: TendonLimits {
                velocity: 0.0779,
                acceleration: 0.390,
                jerk: 3.9,
            },
        }
    }

    fn judged(demand: Demand, motion: anyhow::Result<Trajectory>) -> Judged {
        let suspect = Suspect {
            demand,
            motion,
            name: String::new(),
        };
        let mut judged = Judged::default();
        judged.add(&suspect, true);
        judged
    }

    #[test]
    fn what_is_asked_for_passes_and_everything_else_is_contradicted() {
        assert!(judged(demand(), Ok(swing())).passes());
        let tip = |last: [f64; 6]| End::Tip {
            position: BODY.tip(&last),
            tolerance: TIP_TOLERANCE,
        };
        let end = |end| Demand { end, ..demand() };
        let reached = tip([SWING, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(judged(end(reached), Ok(swing())).passes());
        let mut moving = demand();
        moving.start[1][3] = 1e-6;
        let tight = TendonLimits {
            velocity: 1e-3,
            ..demand().limits
        };
        for wrong in [
            end(tip([SWING + 0.1, 0.0, 0.0, 0.0, 0.0, 0.0])),
            end(End::Configuration([SWING + 1e-6, 0.0, 0.0, 0.0, 0.0, 0.0])),
            moving,
            Demand {
                limits: tight,
                ..demand()
            },
            Demand {
                balls: vec![Ball::resting([0.0, 0.0, 1.0], 0.1)],
                ..demand()
            },
        ] {
            assert!(!judged(wrong, Ok(swing())).passes());
        }
    }

    #[test]
    fn what_does_not_rest_at_its_end_is_contradicted() {
        let mut knots = swing().knots().to_vec();
        knots[1].acceleration[2] = 1e-6;
        let motion = Trajectory::new(knots).unwrap();
        assert!(!judged(demand(), Ok(motion)).passes());
    }

    #[test]
    fn as_many_as_wanted_are_judged_over_their_whole_duration() {
        let suspect = |_| Suspect {
            demand: demand(),
            motion: Ok(swing()),
            name: String::new(),
        };
        let judged_of = |count| Judged::of(count, 2, suspect);
        let of_five = judged_of(5);
        assert_eq!([of_five.whole, of_five.wanted, of_five.at_ends], [3, 3, 2]);
        assert!(of_five.passes() && !judged_of(0).passes());
        assert!(!judged(demand(), Err(anyhow::anyhow!("none"))).passes());
    }
}
