//! Five tips passed by one motion, beside stopping at each of them.

use std::collections::BTreeMap;
use std::time::Instant;

use client::PlanAnswer;
use rand_pcg::Pcg64;
use shared_types::valid::{Goal, PlanRequest};
use tests::brute_force::Body;
use tests::geometry::seeded;
use tests::judge::SENT_USE;
use tests::knots::{Knot, limit_use, states, stops_between};
use tests::motion::raise;
use tests::passages::{Position, passages};
use tests::replans::random_configuration;
use tests::stack::{NO_DEADLINE, PATIENCE, Part, Stack};
use tests::world::Settings;

use super::figures::quantile;
use super::replan_run::refusal;
use crate::report::Report;
use crate::scale::Scale;

/// Seed of starts and tips.
const SEED: u64 = 9_201;
/// Tips of a set.
const TIPS: usize = 5;
/// Candidates of every request.
const CANDIDATES: usize = 10;
/// Distance from a tip that counts as passed where a request does not say, m: a hundredth of the unit robot's section length.
pub(super) const TIP_TOLERANCE_M: f64 = 0.01;
/// Looks at the tip in each segment.
const LOOKS_AT_TIP: usize = 40;

/// What the sets showed.
#[derive(Default)]
struct Figures {
    sets: usize,
    /// Sets without a motion through all tips, by cause.
    refused: BTreeMap<String, usize>,
    /// Tips passed in their order.
    passed: usize,
    /// Largest distance of a passed tip, m.
    miss_m: f64,
    /// Times at which a motion stands still between its begin and its end.
    stops: usize,
    /// Least speed between begin and end ÷ peak, of each motion.
    least_speeds: Vec<f64>,
    limits: [f64; 3],
    /// Duration ÷ that of stopping at each tip; infinite without a motion.
    ratios: Vec<f64>,
    /// The same, where the stops are at the configurations that the motion has at the tips.
    same_configurations: Vec<f64>,
    /// Sets whose tips cannot all be reached by requests one after the other.
    without_reference: usize,
    took_ms: Vec<f64>,
}

/// Sets of five tips without balls.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "requests with five tips to planner-daemon, and with one each";
    report.group("via tips", command, |report| {
        show(report, &measure(scale.pick(20, 100))?);
        Ok(())
    });
}

fn measure(sets: usize) -> anyhow::Result<Figures> {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let body = stack.world.body();
    let mut random = seeded(SEED);
    let mut figures = Figures::default();
    for set in 0..sets {
        let set = Set::draw(&stack, &body, set as u64, &mut random);
        figures.look_at(&mut stack, &body, &set)?;
    }
    Ok(figures)
}

/// A start at rest, and the tips.
struct Set {
    seed: u64,
    start_rad: [f64; 6],
    tips_m: [Position; TIPS],
}

impl Set {
    fn draw(stack: &Stack, body: &Body, seed: u64, random: &mut Pcg64) -> Self {
        let robot = stack.world.unit_robot();
        let mut configuration = || random_configuration(&robot, random).into();
        Self {
            seed,
            start_rad: configuration(),
            tips_m: std::array::from_fn(|_| body.tip(&configuration())),
        }
    }

    /// The fastest of ten candidates from a start through goals.
    fn request(&self, start_rad: [f64; 6], mut via: Vec<Goal>) -> PlanRequest {
        let goal = via.pop().expect("there is a goal");
        PlanRequest {
            via,
            candidate_count: CANDIDATES,
            seed: self.seed,
            deadline: Some(NO_DEADLINE),
            ..PlanRequest::new(start_rad, goal)
        }
    }

    fn tips(&self) -> Vec<Goal> {
        let tip = |position_m: &Position| Goal::tip(*position_m);
        self.tips_m.iter().map(tip).collect()
    }

    /// Seconds of stopping at each goal, by the fastest motion to each from where the one before ended; none where one has no motion.
    fn one_after_the_other(
        &self,
        stack: &mut Stack,
        goals: &[Goal],
    ) -> anyhow::Result<Option<f64>> {
        let (mut start_rad, mut total_s) = (self.start_rad, 0.0);
        for goal in goals {
            let request = self.request(start_rad, vec![*goal]);
            let answer = stack.client.plan(&request, PATIENCE)?;
            let Some(knots) = selected(&answer) else {
                return Ok(None);
            };
            let end = &knots[knots.len() - 1];
            (start_rad, total_s) = (end.values[0], total_s + end.time_s);
        }
        Ok(Some(total_s))
    }
}

/// The knots of the selected candidate.
fn selected(answer: &PlanAnswer) -> Option<Vec<Knot>> {
    let knots = answer.selected()?.knots.iter();
    Some(knots.map(Knot::from).collect())
}

impl Figures {
    fn look_at(&mut self, stack: &mut Stack, body: &Body, set: &Set) -> anyhow::Result<()> {
        self.sets += 1;
        let tips = set.tips();
        let clock = Instant::now();
        let request = set.request(set.start_rad, tips.clone());
        let answer = stack.client.plan(&request, PATIENCE)?;
        self.took_ms.push(1e3 * clock.elapsed().as_secs_f64());
        let apart_s = set.one_after_the_other(stack, &tips)?;
        let Some(knots) = selected(&answer) else {
            let cause = refusal(answer.report().outcome, &answer.report().reason);
            *self.refused.entry(cause).or_default() += 1;
            self.ratios.push(f64::INFINITY);
            return Ok(());
        };
        drop(answer);
        let duration_s = knots.last().map_or(f64::NAN, |knot| knot.time_s);
        match apart_s {
            Some(apart_s) => self.ratios.push(duration_s / apart_s),
            None => self.without_reference += 1,
        }
        self.look_at_speed(&knots);
        self.look_at_limits(stack, body, &knots);
        let goals = self.look_at_tips(body, &knots, &set.tips_m);
        let apart_s = if goals.len() == TIPS {
            set.one_after_the_other(stack, &goals)?
        } else {
            None
        };
        let ratio = apart_s.map(|apart_s| duration_s / apart_s);
        self.same_configurations.extend(ratio);
        Ok(())
    }

    fn look_at_speed(&mut self, knots: &[Knot]) {
        let stops = stops_between(knots);
        self.stops += stops.count;
        self.least_speeds.push(stops.least_speed);
    }

    fn look_at_limits(&mut self, stack: &Stack, body: &Body, knots: &[Knot]) {
        let limits = &stack.world.robot.tendon_limits;
        let limits = [limits.velocity, limits.acceleration, limits.jerk];
        let used = limit_use(body, knots, &limits);
        for (figure, used) in self.limits.iter_mut().zip(used) {
            raise(figure, used);
        }
    }

    /// Looks whether the tips are passed in their order; the configurations there.
    fn look_at_tips(&mut self, body: &Body, knots: &[Knot], tips_m: &[Position]) -> Vec<Goal> {
        let shapes: Vec<_> = states(knots, LOOKS_AT_TIP).map(|[it, _]| it).collect();
        let positions: Vec<Position> = shapes.iter().map(|shape| body.tip(shape)).collect();
        let passed = passages(&positions, tips_m, TIP_TOLERANCE_M);
        let passed = passed.into_iter().flatten();
        passed
            .map(|passage| {
                self.passed += 1;
                raise(&mut self.miss_m, passage.miss_m);
                Goal::Configuration(shapes[passage.at.round() as usize])
            })
            .collect()
    }
}

fn show(report: &mut Report, figures: &Figures) {
    let line = |what: &str| format!("via tips, sets of five without balls: {what}");
    let sets = figures.sets;
    let answered = figures.least_speeds.len();
    let asked = format!(
        "{answered} of {sets}, ten candidates, deadline {} s; refused: {:?}; {:.0} ms a request in the median",
        NO_DEADLINE.as_secs(),
        figures.refused,
        quantile(&figures.took_ms, 0.5)
    );
    report.check(
        &line("one motion through all"),
        asked,
        "all",
        answered == sets,
    );
    let slowest = format!(
        "{} in {answered} motions; the least speed on the way ÷ peak: {:.4} in the median, {:.4} at least",
        figures.stops,
        quantile(&figures.least_speeds, 0.5),
        quantile(&figures.least_speeds, 0.0)
    );
    let stops = line("stops between begin and end (speed below 1e-3 of the motion's own peak)");
    report.check(&stops, slowest, "0", figures.stops == 0);
    let (passed, all) = (figures.passed, TIPS * sets);
    let figure = format!(
        "{passed} of {all}, missed by {:.2e} m at most",
        figures.miss_m
    );
    let passes = line("tips passed within 0.01 m in their order");
    report.check(&passes, figure, "all", passed == all);
    for (used, kind) in figures
        .limits
        .iter()
        .zip(["velocity", "acceleration", "jerk"])
    {
        let name = line(&format!("largest use of the {kind} limit, dense sampling"));
        report.at_most(&name, *used, SENT_USE);
    }
    let ratios = &figures.ratios;
    let figure = format!(
        "median {:.3}, p10 {:.3}, p90 {:.3}, worst {:.3}; {} compared",
        quantile(ratios, 0.5),
        quantile(ratios, 0.1),
        quantile(ratios, 0.9),
        quantile(ratios, 1.0),
        ratios.len()
    );
    let what = "duration ÷ the fastest of ten candidates to each tip, one after the other";
    report.check(
        &line(what),
        figure,
        "median <= 0.9",
        quantile(ratios, 0.5) <= 0.9,
    );
    report.at_most(
        &line("sets of which a tip by itself has no motion"),
        figures.without_reference as f64,
        0.0,
    );
    let same = &figures.same_configurations;
    let what = "duration ÷ stopping at each in the configuration in which it is passed";
    let figure = format!(
        "median {:.3} of {}; of the other {sets} sets one of these configurations by itself has no motion, or a tip was not passed",
        quantile(same, 0.5),
        same.len(),
        sets = sets - same.len()
    );
    report.shown(&line(what), figure);
}
