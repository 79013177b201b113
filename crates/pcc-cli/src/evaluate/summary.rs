//! `result.json`: every figure of merit, the settings, the machine.

use super::answer::Answer;
use super::arguments::Arguments;
use crate::averages::{mean, percentile};
use crate::bootstrap::{Interval, interval};
use crate::planner::ModelRecords;
use crate::sampler::name_of;
use pcc_model::{Configuration, UnitRobot};
use planning::{
    Candidate, Draw, Failure, Plan, SampledVerdict, SetMetrics, Source, Stage, Waypoints,
    set_metrics,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// The content of `result.json`: shares of requests and candidates, figures of merit, times.
#[derive(Serialize)]
pub(super) struct Summary {
    planner: String,
    #[serde(flatten)]
    models: ModelRecords,
    dataset: String,
    /// The file of records whose paths were followed; times are then without the drawing.
    records: Option<String>,
    split: String,
    robot: String,
    cases: usize,
    candidates: usize,
    seed: u64,
    threads: usize,
    machine: String,
    /// Requests refused as infeasible, by reason.
    infeasible: BTreeMap<String, usize>,
    #[serde(flatten)]
    shares: Shares,
    /// Figures of the sampled paths by the paper's criterion.
    sampled: Sampled,
    failures: BTreeMap<String, usize>,
    #[serde(flatten)]
    paths: PathFigures,
    #[serde(flatten)]
    sets: SetFigures,
    seconds: Spread,
    stage_seconds: BTreeMap<&'static str, Spread>,
}

/// Figures of the sampled paths by the paper's criterion, before any correction outside of the sampler.
#[derive(Serialize)]
struct Sampled {
    /// Sampled paths; none where the planner samples nothing.
    paths: usize,
    /// Share of all candidates asked for that succeed.
    success: f64,
    /// Share of all candidates asked for that succeed after correction.
    success_corrected: f64,
    /// Share of the requests with a candidate that succeeds.
    success_any: f64,
    /// `success` of the cases with so many balls.
    success_by_balls: BTreeMap<usize, f64>,
    /// The same with its 95 % interval by the bootstrap over targets.
    success_by_balls_interval: BTreeMap<usize, Interval>,
    /// Tip error, section lengths.
    tip_error: Spread,
    /// Tip error ÷ 3 L, the robot's length, over the candidates that succeed.
    tip_error_of_robot_length: Spread,
    /// Time of sampling alone ÷ candidates, s.
    seconds_per_candidate: Spread,
}

impl Sampled {
    fn of(robot: &UnitRobot, arguments: &Arguments, answers: &[Answer]) -> Self {
        let length: f64 = robot.section_lengths.iter().sum();
        let sampled = verdicts(robot, answers, |draw| draw.sampled.as_ref());
        let corrected = verdicts(robot, answers, |draw| draw.path.as_ref());
        let successes = |verdicts: &[Vec<SampledVerdict>]| {
            let all = verdicts.iter().flatten();
            all.filter(|v| v.is_success()).count() as f64
                / (answers.len() * arguments.candidates) as f64
        };
        let any = |case: &&Vec<SampledVerdict>| case.iter().any(SampledVerdict::is_success);
        let all = sampled.iter().flatten();
        let successful = all.clone().filter(|v| v.is_success());
        let plans = answers.iter().filter_map(|a| a.plan.as_ref().ok());
        let by_balls = success_by_balls(answers, &sampled, arguments.candidates);
        let of_cases = |cases: &[&(i32, f64)]| mean(cases.iter().map(|it| it.1));
        let intervals = by_balls
            .iter()
            .map(|(balls, cases)| (*balls, interval(cases, |it| it.0, of_cases)));
        let intervals: BTreeMap<usize, Interval> = intervals.collect();
        let shares = intervals
            .iter()
            .filter_map(|(balls, it)| Some((*balls, it.value?)));
        Self {
            paths: sampled.iter().map(Vec::len).sum(),
            success: successes(&sampled),
            success_corrected: successes(&corrected),
            success_any: sampled.iter().filter(any).count() as f64 / answers.len() as f64,
            success_by_balls: shares.collect(),
            success_by_balls_interval: intervals,
            tip_error: Spread::of(all.map(|v| v.tip_error)),
            tip_error_of_robot_length: Spread::of(successful.map(|v| v.tip_error / length)),
            seconds_per_candidate: Spread::of(
                plans.map(|p| p.stages[Stage::Sample] / arguments.candidates as f64),
            ),
        }
    }
}

/// The share of each case's candidates that succeed, with the case's target, by number of balls.
fn success_by_balls(
    answers: &[Answer],
    sampled: &[Vec<SampledVerdict>],
    candidates: usize,
) -> BTreeMap<usize, Vec<(i32, f64)>> {
    let mut shares: BTreeMap<usize, Vec<(i32, f64)>> = BTreeMap::new();
    for (answer, verdicts) in answers.iter().zip(sampled) {
        let balls = answer.case.scene.balls().len();
        let successes = verdicts.iter().filter(|v| v.is_success()).count();
        let of_balls = shares.entry(balls).or_default();
        let share = successes as f64 / candidates as f64;
        of_balls.push((answer.case.target_index, share));
    }
    shares
}

/// Order statistics of one figure.
#[derive(Serialize)]
struct Spread {
    mean: f64,
    p5: f64,
    median: f64,
    p90: f64,
    p95: f64,
    p99: f64,
    max: f64,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share| percentile(&sorted, share).unwrap_or(f64::NAN);
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        Self {
            mean,
            p5: at(0.05),
            median: at(0.5),
            p90: at(0.9),
            p95: at(0.95),
            p99: at(0.99),
            max: at(1.0),
        }
    }
}

/// How many requests and candidates are certified, and how many were delivered.
#[derive(Serialize)]
struct Shares {
    /// Share of the requests with at least one certified candidate, those found by exploring left out.
    success_any: f64,
    /// Share of the requests with at least one candidate, what exploring found included.
    answered_any: f64,
    /// Share of the requests whose first draw is certified.
    success_first: f64,
    /// Share of all draws certified (for the learned sampler: before anything is filled).
    share_before_fallback: f64,
    /// Share of all candidates asked for that were delivered, what exploring found included.
    share_delivered: f64,
    /// Share of the requests with at least one certified learned candidate.
    learned_any: f64,
}

impl Shares {
    fn of(plans: &[&Plan], cases: usize, candidates: usize) -> Self {
        let requests = |holds: fn(&Plan) -> bool| {
            plans.iter().filter(|plan| holds(plan)).count() as f64 / cases as f64
        };
        let asked = (cases * candidates) as f64;
        let delivered: usize = plans.iter().map(|plan| plan.candidates.len()).sum();
        Self {
            success_any: requests(|plan| certified(plan).next().is_some()),
            answered_any: requests(|plan| !plan.candidates.is_empty()),
            success_first: requests(|plan| certified(plan).any(|c| c.draw == 0)),
            share_before_fallback: before_fallback(plans) as f64 / asked,
            share_delivered: delivered as f64 / asked,
            learned_any: requests(|plan| plan.learned_certified > 0),
        }
    }
}

/// Figures of merit over all certified candidates.
#[derive(Serialize)]
struct PathFigures {
    /// Distance of the tip's end from the target, section lengths.
    tip_error: Spread,
    /// Distance of the tip's end from the target ÷ 3 L, the robot's length.
    tip_error_of_robot_length: Spread,
    clearance: Spread,
    tip_length_ratio: Spread,
    tip_smoothness: Spread,
    configuration_length_rad: Spread,
    duration_s: Spread,
}

impl PathFigures {
    fn of(robot: &UnitRobot, answers: &[Answer]) -> Self {
        let all: Vec<(&Answer, &Candidate)> = answers.iter().flat_map(certified_of).collect();
        let path =
            |figure: fn(&Candidate) -> f64| Spread::of(all.iter().map(move |(_, c)| figure(c)));
        let tip_error =
            |(a, c): &(&Answer, &Candidate)| (robot.tip(&c.end()) - a.case.target_tip).norm();
        let robot_length: f64 = robot.section_lengths.iter().sum();
        Self {
            tip_error: Spread::of(all.iter().map(tip_error)),
            tip_error_of_robot_length: Spread::of(all.iter().map(|c| tip_error(c) / robot_length)),
            clearance: path(|c| c.metrics.clearance),
            tip_length_ratio: path(|c| c.metrics.tip_length / c.metrics.tip_distance),
            tip_smoothness: path(|c| c.metrics.tip_smoothness),
            configuration_length_rad: path(|c| c.metrics.configuration_length),
            duration_s: path(|c| c.metrics.duration_s),
        }
    }
}

/// Figures of the goal configurations of a request's certified candidates, over all requests.
#[derive(Serialize)]
struct SetFigures {
    modes: Spread,
    mean_distance_rad: Spread,
    min_distance_rad: Spread,
    vendi: Spread,
}

impl SetFigures {
    fn of(plans: &[&Plan]) -> Self {
        let figures = |plan: &&Plan| {
            let ends: Vec<Configuration> = certified(plan).map(Candidate::end).collect();
            set_metrics(&ends)
        };
        let sets: Vec<SetMetrics> = plans.iter().map(figures).collect();
        Self {
            modes: Spread::of(sets.iter().map(|s| s.modes as f64)),
            mean_distance_rad: Spread::of(sets.iter().map(|s| s.mean_distance_rad)),
            min_distance_rad: Spread::of(sets.iter().map(|s| s.min_distance_rad)),
            vendi: Spread::of(sets.iter().map(|s| s.vendi)),
        }
    }
}

pub(super) fn summarise(
    robot: &UnitRobot,
    arguments: &Arguments,
    models: ModelRecords,
    answers: &[Answer],
) -> Summary {
    let plans = answers.iter().filter_map(|a| a.plan.as_ref().ok());
    let plans: Vec<&Plan> = plans.collect();
    let refused = answers.iter().filter_map(|a| a.plan.as_ref().err());
    let draws = plans.iter().flat_map(|p| &p.draws);
    let failed = draws.filter_map(|d| d.outcome.as_ref().err());
    Summary {
        planner: name_of(&arguments.planner),
        models,
        dataset: arguments.dataset.display().to_string(),
        records: arguments
            .records
            .as_ref()
            .map(|it| it.display().to_string()),
        split: name_of(&arguments.split),
        robot: robot.name.clone(),
        cases: answers.len(),
        candidates: arguments.candidates,
        seed: arguments.seed,
        threads: arguments.threads,
        machine: machine(),
        infeasible: count(refused.map(|reason| first_words(&reason.to_string()))),
        shares: Shares::of(&plans, answers.len(), arguments.candidates),
        sampled: Sampled::of(robot, arguments, answers),
        failures: count(failed.map(Failure::to_string)),
        paths: PathFigures::of(robot, answers),
        sets: SetFigures::of(&plans),
        seconds: Spread::of(answers.iter().map(|a| a.seconds)),
        stage_seconds: stages(&plans),
    }
}

/// The certified candidates of a plan: those that were drawn or filled in, not those that exploring found in addition.
fn certified(plan: &Plan) -> impl Iterator<Item = &Candidate> {
    let candidates = plan.candidates.iter();
    candidates.filter(|candidate| candidate.source != Source::Explored)
}

/// The certified candidates of an answer, each with the answer.
fn certified_of(answer: &Answer) -> impl Iterator<Item = (&Answer, &Candidate)> {
    let candidates = answer.plan.iter().flat_map(certified);
    candidates.map(move |candidate| (answer, candidate))
}

/// Verdicts by the paper's criterion on one path of each draw that was asked for, case by case; draws without the path are left out.
fn verdicts(
    robot: &UnitRobot,
    answers: &[Answer],
    path: impl Fn(&Draw) -> Option<&Waypoints>,
) -> Vec<Vec<SampledVerdict>> {
    let case = |answer: &Answer| {
        let paths = answer
            .plan
            .iter()
            .flat_map(|plan| &plan.draws)
            .filter(|draw| draw.source != Source::Explored)
            .filter_map(&path);
        let judge = |path: &Waypoints| {
            SampledVerdict::of(robot, &answer.case.scene, &answer.case.target_tip, path)
        };
        paths.map(judge).collect()
    };
    answers.iter().map(case).collect()
}

/// Certified draws before anything was filled: the learned ones where there are any, else all.
fn before_fallback(plans: &[&Plan]) -> usize {
    let certified = |p: &&Plan| match p.learned_drawn {
        0 => p.candidates.len(),
        _ => p.learned_certified,
    };
    plans.iter().map(certified).sum()
}

fn stages(plans: &[&Plan]) -> BTreeMap<&'static str, Spread> {
    let planned = |stage: &&Stage| !matches!(stage, Stage::Wait | Stage::Write);
    let times = |stage: &Stage| {
        let seconds = plans.iter().map(|plan| plan.stages[*stage]);
        (stage.text(), Spread::of(seconds))
    };
    Stage::ALL.iter().filter(planned).map(times).collect()
}

fn count(names: impl Iterator<Item = String>) -> BTreeMap<String, usize> {
    names.fold(BTreeMap::new(), |mut counts, name| {
        *counts.entry(name).or_insert(0) += 1;
        counts
    })
}

fn first_words(reason: &str) -> String {
    reason.split(':').next().unwrap_or(reason).to_owned()
}

/// The processor and how many of it there are.
pub(crate) fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text
        .lines()
        .find_map(|l| l.strip_prefix("model name"))
        .unwrap_or("unknown")
        .trim_start_matches(['\t', ' ', ':']);
    format!(
        "{model}, {} cores",
        std::thread::available_parallelism().map_or(0, std::num::NonZero::get)
    )
}

pub(super) fn print(s: &Summary) {
    say!(
        "{} on {}: {} cases, {} candidates each",
        s.planner,
        s.dataset,
        s.cases,
        s.candidates
    );
    if let Some(records) = &s.records {
        say!("  what was drawn in {records} is followed: times are without the drawing");
    }
    say!(
        "  certified before fallback {:6.2} %   delivered {:6.2} %",
        100.0 * s.shares.share_before_fallback,
        100.0 * s.shares.share_delivered
    );
    let corrected = 100.0 * s.sampled.success_corrected;
    if s.sampled.paths > 0 {
        say!(
            "  paper's criterion, sampled {:5.2} %   corrected {corrected:6.2} %   tip error {:.4} mean",
            100.0 * s.sampled.success,
            s.sampled.tip_error.mean
        );
    } else {
        say!("  paper's criterion         {corrected:6.2} %   (nothing is sampled)");
    }
    say!(
        "  requests answered         {:6.2} %   with a learned candidate {:6.2} %",
        100.0 * s.shares.answered_any,
        100.0 * s.shares.learned_any
    );
    say!(
        "  tip length / distance     {:6.3} median   duration {:.2} s median",
        s.paths.tip_length_ratio.median,
        s.paths.duration_s.median
    );
    say!(
        "  terminal modes            {:6.1} mean     Vendi {:.2} mean",
        s.sets.modes.mean,
        s.sets.vendi.mean
    );
    say!(
        "  time per request          {:6.2} ms median, {:.2} ms p99",
        1e3 * s.seconds.median,
        1e3 * s.seconds.p99
    );
    for (reason, times) in s.failures.iter().chain(&s.infeasible) {
        say!("  {times:6} × {reason}");
    }
}
