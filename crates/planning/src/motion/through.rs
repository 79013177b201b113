//! One motion along all legs of a route: it passes the via configurations without rest where that is certified.

use crate::motion::along_polyline::append;
use crate::motion::constraints::MotionConstraints;
use crate::motion::route_path::RoutePath;
use crate::path::waypoints::Waypoints;
use crate::plan::{Certified, Failure, Passage};
use pcc_model::Configuration;
use trajectory::{Knot, ParameterizationOptions, Trajectory};

/// Parts of the legs beside a via that a smooth curve through it replaces, the same at all vias: the durations of these differ by some
/// percent, and the best is not always the same one. Wider curves than the first are slower.
const BLENDS: [f64; 3] = [0.5, 0.3, 0.15];
/// The same where each via gets its own, from the widest curve to the tightest.
const BLENDS_OF_A_VIA: [f64; 6] = [0.5, 0.3, 0.15, 0.07, 0.03, 0.012];
/// Distance from a via configuration that a motion may have at most where it passes, rad.
const MOST_MISS_RAD: f64 = 1e-3;
/// Distance from a via configuration below which a curve is not corrected any more, rad.
const NEAR_RAD: f64 = 1e-4;
/// Times that a curve is timed at most, until it passes its vias.
const ROUNDS: usize = 5;
/// Intervals on which the speed of each leg is planned.
const GRID_OF_A_LEG: usize = 48;

/// A leg of a route.
#[derive(Clone)]
pub(crate) struct Leg {
    /// The leg's path: 64 waypoints, radians.
    pub(crate) path: Waypoints,
    /// The leg's own motion from rest to rest.
    pub(crate) motion: Certified,
    /// How near to its place at the leg's end the tip must pass, section lengths.
    pub(crate) tip_tolerance: f64,
}

/// A certified motion along legs.
pub(crate) struct Through {
    pub(crate) motion: Certified,
    /// Where it passes the ends of all legs but the last.
    pub(crate) passages: Vec<Passage>,
}

/// A motion along legs that is not certified yet.
struct Timed {
    motion: Trajectory,
    passages: Vec<Passage>,
}

impl MotionConstraints<'_> {
    /// The shortest certified motion along legs of a few tried: without rest at the vias where there is one, else with rest at as few as
    /// are found; from rest, or from a state from which the robot can rest at the first leg's begin.
    pub(crate) fn through(&self, legs: &[Leg], state: Option<&Knot>) -> Result<Through, Failure> {
        let blends = BLENDS.map(|blend| vec![blend; legs.len() - 1]);
        let knots = state.map_or_else(|| self.knots_after_a_wait(), |_| self.knots);
        if let Some(smooth) = self.shortest(legs, &blends, state, knots) {
            return Ok(smooth);
        }
        let rests = self.among_resting().with_rests(legs, state)?;
        if self.moving.is_empty() {
            return Ok(rests);
        }
        let motion = rests.motion.trajectory.as_ref().clone();
        self.certified_through(motion, &rests.passages, state)
    }

    /// The same with rest at as few vias as are found.
    fn with_rests(&self, legs: &[Leg], state: Option<&Knot>) -> Result<Through, Failure> {
        let (mut whole, mut begin) = (None, 0);
        while begin < legs.len() {
            if (self.interrupt)() {
                return Err(Failure::Truncated);
            }
            let state = state.filter(|_| begin == 0);
            let (run, count) = self.longest_run(&legs[begin..], state, legs.len())?;
            whole = Some(match whole {
                None => run,
                Some(before) => self.after_rest(&before, &run),
            });
            begin += count;
        }
        let fits = |whole: &Through| whole.motion.trajectory.knots().len() <= self.knots;
        whole.filter(fits).ok_or(Failure::Time)
    }

    /// A motion along as many of the next legs as it finds one for that rests at none of their vias, and their number.
    fn longest_run(
        &self,
        legs: &[Leg],
        state: Option<&Knot>,
        of_legs: usize,
    ) -> Result<(Through, usize), Failure> {
        let mut run = self.single(&legs[0], state)?;
        let mut kept: Vec<f64> = Vec::new();
        for count in 2..=legs.len() {
            let tried = BLENDS_OF_A_VIA.map(|blend| [kept.as_slice(), &[blend]].concat());
            let knots = self.knots * count / of_legs;
            let found = tried.iter().find_map(|blends| {
                let blends = std::slice::from_ref(blends);
                let run = self.shortest(&legs[..count], blends, state, knots)?;
                Some((run, blends[0].clone()))
            });
            let Some((longer, blends)) = found else {
                return Ok((run, count - 1));
            };
            (run, kept) = (longer, blends);
        }
        Ok((run, legs.len()))
    }

    /// A motion along one leg.
    fn single(&self, leg: &Leg, state: Option<&Knot>) -> Result<Through, Failure> {
        let motion = match state {
            None => leg.motion.clone(),
            Some(state) => self.certified(self.time_from(state, &leg.path)?)?,
        };
        Ok(Through {
            motion,
            passages: Vec::new(),
        })
    }

    /// Two motions one after the other, with rest between them.
    fn after_rest(&self, before: &Through, next: &Through) -> Through {
        let [first, second] = [before, next].map(|through| &through.motion);
        let mut knots = first.trajectory.knots().to_vec();
        append(&mut knots, &second.trajectory);
        let whole = Trajectory::new(knots).expect("two motions one after the other are one");
        let clearance = first.metrics.clearance.min(second.metrics.clearance);
        let rest_s = first.trajectory.duration();
        let mut passages = before.passages.clone();
        passages.push(Passage {
            configuration: first.trajectory.end(),
            time_s: rest_s,
        });
        passages.extend(next.passages.iter().map(|passage| passage.later(rest_s)));
        Through {
            motion: self.describe(whole, clearance),
            passages,
        }
    }

    /// The shortest certified motion through all vias of these legs along a curve with one of these blends.
    fn shortest(
        &self,
        legs: &[Leg],
        blends: &[Vec<f64>],
        state: Option<&Knot>,
        knots: usize,
    ) -> Option<Through> {
        let paths: Vec<&Waypoints> = legs.iter().map(|leg| &leg.path).collect();
        let timed = blends.iter().filter_map(|blends| {
            let path = RoutePath::along(&paths, blends);
            let motion = self.time_curve(&path, state, legs.len(), knots).ok()?;
            (!(self.interrupt)()).then_some((motion, path))
        });
        let mut timed: Vec<(Trajectory, RoutePath)> = timed.collect();
        timed.sort_by(|a, b| a.0.duration().total_cmp(&b.0.duration()));
        timed.into_iter().find_map(|(motion, path)| {
            let Timed { motion, passages } = self.exact(motion, path, legs, state, knots)?;
            self.certified_through(motion, &passages, state).ok()
        })
    }

    /// The motion if it is certified, or, where it begins at rest, one that is when it begins later.
    fn certified_through(
        &self,
        motion: Trajectory,
        passages: &[Passage],
        state: Option<&Knot>,
    ) -> Result<Through, Failure> {
        let duration_s = motion.duration();
        let motion = match state {
            None => self.certified_or_waiting(motion)?,
            Some(_) => self.certified(motion)?,
        };
        let wait_s = motion.trajectory.duration() - duration_s;
        let passages = passages.iter().map(|passage| passage.later(wait_s));
        Ok(Through {
            motion,
            passages: passages.collect(),
        })
    }

    /// The motion along a curve that is moved until it passes the vias of these legs.
    fn exact(
        &self,
        mut motion: Trajectory,
        mut path: RoutePath,
        legs: &[Leg],
        state: Option<&Knot>,
        knots: usize,
    ) -> Option<Timed> {
        for round in 1..=ROUNDS {
            let passages = path.passages(&motion);
            let misses: Vec<Configuration> = passages
                .iter()
                .map(|passage| passage.configuration - motion.at(passage.time_s).position)
                .collect();
            let worst_rad = misses.iter().map(Configuration::norm).fold(0.0, f64::max);
            let is_near = self.keeps_tolerances(&motion, &passages, legs);
            if is_near && worst_rad <= NEAR_RAD || round == ROUNDS {
                let passes = is_near && worst_rad <= MOST_MISS_RAD;
                return passes.then_some(Timed { motion, passages });
            }
            path.correct(&misses);
            motion = self.time_curve(&path, state, legs.len(), knots).ok()?;
        }
        None
    }

    fn keeps_tolerances(&self, motion: &Trajectory, passages: &[Passage], legs: &[Leg]) -> bool {
        let miss = |passage: &Passage| {
            let tip = self.robot.tip(&motion.at(passage.time_s).position);
            (tip - self.robot.tip(&passage.configuration)).norm()
        };
        let mut both = passages.iter().zip(legs);
        both.all(|(passage, leg)| miss(passage) <= leg.tip_tolerance)
    }

    fn time_curve(
        &self,
        path: &RoutePath,
        state: Option<&Knot>,
        legs: usize,
        knots: usize,
    ) -> Result<Trajectory, Failure> {
        let options = ParameterizationOptions {
            knots,
            grid_intervals: GRID_OF_A_LEG * legs,
            spacing: f64::INFINITY,
        };
        self.timed(state, &path.nodes, &options)
    }
}
