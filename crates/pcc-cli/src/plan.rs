//! `pcc plan`: asks the daemon for candidates, shows them, and can have one executed.

mod json;
mod table;

pub(crate) use self::table::print_answer;
use crate::follow::Follower;
use crate::number::{self, balls_of};
use crate::option_faults::MotionOptions;
use crate::sampler::{samplers, selections};
use anyhow::{anyhow, bail};
use clap::{ArgAction, ArgGroup, Args};
use client::{Client, PlanAnswer};
use shared_types::capacity::{DOF, MAX_CANDIDATES, MAX_GOALS};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{Outcome, Sampler, Selection, StartKind};
use shared_types::ipc::IpcOptions;
use shared_types::message::Ball;
use shared_types::valid::{Goal, MAX_LENGTH_M, PlanReport, PlanRequest, SelectionRule};
use std::time::{Duration, Instant};

/// How long a running daemon may take to show up or to reply.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Longest deadline, milliseconds.
const LONGEST_DEADLINE_MS: u64 = 60_000;

/// Longest time until the begin of a motion, seconds.
const LONGEST_BEGIN_IN_S: f64 = 600.0;

/// Arguments of `pcc plan`.
#[derive(Args)]
#[command(group(ArgGroup::new("goal").required(true)))]
pub(crate) struct Arguments {
    /// Tip position to reach, metres (-1000 to 1000), base frame; may be given up to 8 times: the tip passes the first ones, without rest
    /// where that is certified.
    #[arg(long, num_args = 3, action = ArgAction::Append, value_parser = number::metres(), value_names = ["X", "Y", "Z"], group = "goal")]
    tip: Option<Vec<f64>>,
    /// Configuration to reach instead, radians (-π to π, and within the robot's bending limit); may be given up to 8 times, as --tip.
    #[arg(
        long,
        num_args = 6,
        action = ArgAction::Append,
        value_parser = number::radians(),
        value_name = "RAD",
        group = "goal"
    )]
    configuration: Option<Vec<f64>>,
    /// Start configuration, radians (as --configuration); without it, where the robot is: where it holds, or on its motion.
    #[arg(long, num_args = 6, action = ArgAction::Set, value_parser = number::radians(), value_name = "RAD")]
    start: Option<Vec<f64>>,
    /// Reach the goals after those that are still ahead of the robot's motion, at most 8 in all.
    #[arg(long, conflicts_with = "start")]
    append: bool,
    /// An obstacle, metres (coordinates from -1000 to 1000, a radius from 0 to 1000); may be given up to 64 times.
    #[arg(long, num_args = 4, action = ArgAction::Append, value_parser = number::metres(), value_names = ["X", "Y", "Z", "RADIUS"])]
    ball: Vec<f64>,
    /// Candidates wanted (1 to 64).
    #[arg(long, default_value_t = 10, value_parser = number::candidates())]
    candidates: usize,
    /// Seed (0 to 2^64 - 1); the same request and seed give the same answer.
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    seed: u64,
    /// Who proposes paths.
    #[arg(long, value_parser = samplers(), default_value = "default")]
    sampler: Sampler,
    /// Which candidate is selected.
    #[arg(long, value_parser = selections(), default_value = "shortest-time")]
    select: Selection,
    /// Select the candidate with this index (as the table shows, below --candidates) instead.
    #[arg(long, conflicts_with = "select", value_parser = number::whole(0, MAX_CANDIDATES - 1))]
    index: Option<usize>,
    /// Deadline, milliseconds, at most 60000 (0: the daemon's default).
    #[arg(long, default_value_t = 0, value_parser = number::whole(0, LONGEST_DEADLINE_MS))]
    deadline_ms: u64,
    /// Share of the tendon limits to use (1e-9 to 1).
    #[arg(long, default_value_t = 1.0, value_parser = number::limits_scale())]
    limits_scale: f64,
    /// Have the selected candidate executed.
    #[arg(long)]
    execute: bool,
    /// Begin, or leave the robot's motion, not before so many seconds from now (0 to 600): time to look at the plan and to have it executed
    /// with pcc execute.
    #[arg(long, value_parser = number::real(0.0, LONGEST_BEGIN_IN_S, " s"), value_name = "SECONDS")]
    begin_in: Option<f64>,
    /// Wait until the motion has ended, and tell how; fails where it is not reached. Only with --execute.
    #[arg(long, requires = "execute")]
    wait: bool,
    /// Print one JSON object, with the knots of all candidates and the hash of the plan, in place of the table; whether the controller takes a
    /// motion that was published is not waited for.
    #[arg(long, conflicts_with = "wait")]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let begun_ns = mono_now_ns();
    let options = IpcOptions::from_env();
    let request = arguments.request(begun_ns)?;
    let mut client = Client::connect(&options)?;
    let follower =
        (arguments.execute && !arguments.json).then(|| Follower::connect(&options, arguments.wait));
    let mut follower = follower.transpose()?;
    let clock = Instant::now();
    let answer = plan(&mut client, &request)?;
    let round_trip = clock.elapsed();
    let report = answer.report();
    if arguments.json {
        json::print_json(&answer, round_trip);
    }
    if !report.outcome.has_candidates() || report.candidates.is_empty() {
        bail!("{}", arguments.explain(report));
    }
    if !arguments.json {
        print_answer(&answer, round_trip);
    }
    if report.outcome == Outcome::ExecutionRefused {
        bail!("not executed: {}", report.reason);
    }
    match (&mut follower, report.trajectory_id) {
        (Some(follower), Some(id)) => follower.follow(id),
        _ => Ok(()),
    }
}

/// Has a plan made; while the robot is not ready yet, as after a start of its controller, asks again.
fn plan(client: &mut Client, request: &PlanRequest) -> anyhow::Result<PlanAnswer> {
    let until = Instant::now() + TIMEOUT;
    loop {
        let answer = client.plan(request, TIMEOUT + request.deadline.unwrap_or_default())?;
        if answer.report().outcome != Outcome::RobotNotReady || Instant::now() >= until {
            return Ok(answer);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

impl Arguments {
    /// The request that the options describe; a stop that is ordered after `begun_ns` (nanoseconds of `CLOCK_MONOTONIC`) holds for it,
    /// too.
    fn request(&self, begun_ns: i64) -> anyhow::Result<PlanRequest> {
        if let Some(index) = self.index.filter(|index| *index >= self.candidates) {
            bail!(
                "--index {index}: 0 to {}, below --candidates, are allowed",
                self.candidates - 1
            );
        }
        let balls = balls_of(&self.ball, MAX_LENGTH_M, "m")?.into_iter();
        let balls = balls.map(|[x, y, z, radius_m]| Ball {
            centre_m: [x, y, z],
            radius_m,
        });
        let mut via = self.goals()?;
        let goal = via.pop();
        let goal = goal.ok_or_else(|| anyhow!("--tip or --configuration is needed"))?;
        let request = match &self.start {
            Some(values) => PlanRequest::new(six(values), goal),
            None if self.append => PlanRequest {
                start: StartKind::AfterGoals,
                ..PlanRequest::from_robot(goal)
            },
            None => PlanRequest::from_robot(goal),
        };
        Ok(PlanRequest {
            via,
            seed: self.seed,
            candidate_count: self.candidates,
            deadline: (self.deadline_ms > 0).then(|| Duration::from_millis(self.deadline_ms)),
            sampler: self.sampler,
            selection: self
                .index
                .map_or(SelectionRule::Best(self.select), SelectionRule::Index),
            execute: self.execute,
            requested_mono_ns: self.execute.then_some(begun_ns),
            begin_mono_ns: self
                .begin_in
                .map(|delay_s| begun_ns + (delay_s * 1e9) as i64),
            limits_scale: self.limits_scale,
            balls: balls.collect(),
            ..request
        })
    }

    /// The goals, in their order.
    fn goals(&self) -> anyhow::Result<Vec<Goal>> {
        let tips = self.tip.iter().flat_map(|tips| tips.chunks_exact(3));
        let tips = tips.map(|tip| Goal::tip([tip[0], tip[1], tip[2]]));
        let shapes = self
            .configuration
            .iter()
            .flat_map(|values| values.chunks_exact(6));
        let goals: Vec<Goal> = tips
            .chain(shapes.map(|values| Goal::Configuration(six(values))))
            .collect();
        if goals.len() > MAX_GOALS {
            bail!(
                "{} goals are given: 1 to {MAX_GOALS} are allowed",
                goals.len()
            );
        }
        Ok(goals)
    }

    /// The outcome of a request, its reason, which may begin with the outcome's own words, and the options that are at fault.
    fn explain(&self, report: &PlanReport) -> String {
        let reason = match report.reason.as_str() {
            "" => "no candidate",
            reason => reason,
        };
        let reason = report.outcome.explained(reason);
        let options = MotionOptions {
            start: self.start.as_deref(),
            tip: self.tip.as_deref(),
            configuration: self.configuration.as_deref(),
            balls: &self.ball,
        };
        match options.explain(report.outcome) {
            Some(fault) => format!("{reason} ({fault})"),
            None if report.outcome == Outcome::Truncated => {
                format!("{reason} (a longer --deadline-ms is needed)")
            }
            None => reason,
        }
    }
}

fn six(values: &[f64]) -> [f64; DOF] {
    std::array::from_fn(|i| values[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn tips_become_goals_in_their_order() {
        let line = |words: &str| <Line as clap::Parser>::try_parse_from(words.split(' '));
        let request = |words| line(words).unwrap().arguments.request(17);
        let several = request("pcc --tip 0 0 1 --tip 0 0 2 --tip 0 0 2.5 --append").unwrap();
        assert_eq!(several.start, StartKind::AfterGoals);
        let heights = several
            .via
            .iter()
            .chain([&several.goal])
            .map(|goal| match goal {
                Goal::Tip { position_m, .. } => position_m[2],
                Goal::Configuration(_) => f64::NAN,
            });
        assert_eq!(heights.collect::<Vec<_>>(), [1.0, 2.0, 2.5]);
        let shapes = " --configuration 0 0 0 0 0 0".repeat(9);
        let many = request(&format!("pcc{shapes}")).unwrap_err().to_string();
        assert!(many.contains("9 goals"), "{many}");
        assert!(line("pcc --tip 0 0 1 --start 0 0 0 0 0 0 --append").is_err());
    }

    #[test]
    fn a_motion_is_wanted_and_begins_counted_from_when_the_program_began() {
        let words = "pcc --start 0 0 0 0 0 0 --tip 0 0 1 --execute --begin-in 1.5".split(' ');
        let line = <Line as clap::Parser>::parse_from(words);
        let request = line.arguments.request(17).unwrap();
        assert_eq!(request.requested_mono_ns, Some(17));
        assert_eq!(request.begin_mono_ns, Some(1_500_000_017));
    }
}
