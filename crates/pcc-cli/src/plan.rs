//! `pcc plan`: asks the daemon for candidates, shows them, and can have one executed.

use crate::asked::{Asked, Wrong};
use crate::known_orders::KnownOrders;
use crate::number::{self, balls_of};
use crate::order::STANDS_STILL;
use anyhow::{Context, bail};
use clap::{ArgAction, Args, ValueEnum};
use client::{Client, ControllerView, PlanAnswer};
use shared_types::capacity::DOF;
use shared_types::clock::{STATE_LIFETIME_NS, mono_now_ns};
use shared_types::codes::{LoopState, Outcome, Sampler, Selection, Source, Stage, Waiting};
use shared_types::ipc::IpcOptions;
use shared_types::message::Ball;
use shared_types::valid::{
    ControllerState, Goal, MAX_LENGTH_M, PlanReport, PlanRequest, SelectionRule,
};
use std::time::{Duration, Instant};

/// How long a running daemon and controller are looked for.
const PATIENCE: Duration = Duration::from_secs(5);

#[derive(Clone, Copy, ValueEnum)]
enum SamplerName {
    /// The learned sampler, filled by classical candidates where it does not deliver.
    Default,
    /// The learned sampler alone.
    Fast,
    /// Straight segments in configuration space.
    Straight,
    /// Straight segments with everything that a learned path gets after sampling.
    StraightDrawn,
    /// A tree of certified edges.
    RrtConnect,
    /// The tree, whose paths get everything that a learned path gets after sampling.
    RrtSmooth,
    /// The paper's diffusion model; ask for a deadline of some hundred milliseconds.
    Diffusion,
    /// The paper's diffusion model with post correction in its last steps.
    DiffusionPost,
    /// The paper's diffusion model with guided prediction in its last steps.
    DiffusionGuided,
}

#[derive(Clone, Copy, ValueEnum)]
enum SelectionName {
    /// Shortest duration.
    ShortestTime,
    /// Shortest path of the tip.
    ShortestTipPath,
    /// Largest clearance over the motion.
    LargestClearance,
    /// Smallest third derivative of the tip's path.
    Smoothest,
    /// Goal configuration nearest to the start.
    NearestGoalConfiguration,
}

/// Arguments of `pcc plan`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Tip position to reach, metres (-1000 to 1000), base frame.
    #[arg(long, num_args = 3, action = ArgAction::Set, value_parser = number::metres(), value_names = ["X", "Y", "Z"], required_unless_present = "configuration")]
    tip: Option<Vec<f64>>,
    /// Configuration to reach instead, radians (-π to π, and within the robot's bending limit).
    #[arg(
        long,
        num_args = 6,
        action = ArgAction::Set,
        value_parser = number::radians(),
        value_name = "RAD",
        conflicts_with = "tip"
    )]
    configuration: Option<Vec<f64>>,
    /// Start configuration, radians (as --configuration); without it, where the controller holds the robot.
    #[arg(long, num_args = 6, action = ArgAction::Set, value_parser = number::radians(), value_name = "RAD")]
    start: Option<Vec<f64>>,
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
    #[arg(long, value_enum, default_value = "default")]
    sampler: SamplerName,
    /// Which candidate is selected.
    #[arg(long, value_enum, default_value = "shortest-time")]
    select: SelectionName,
    /// Select the candidate with this index (as the table shows, below --candidates) instead.
    #[arg(long, conflicts_with = "select", value_parser = number::candidate_index())]
    index: Option<usize>,
    /// Deadline, milliseconds, at most 60000 (0: the daemon's default).
    #[arg(long, default_value_t = 0, value_parser = number::deadline_ms())]
    deadline_ms: u64,
    /// Share of the tendon limits to use (1e-9 to 1).
    #[arg(long, default_value_t = 1.0, value_parser = number::limits_scale())]
    limits_scale: f64,
    /// Have the selected candidate executed.
    #[arg(long)]
    execute: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let begun_ns = mono_now_ns();
    let options = IpcOptions::from_env();
    let request = arguments.request(&options, begun_ns)?;
    let mut client = Client::connect(&options)?;
    let controller = arguments.execute.then(|| ControllerView::connect(&options));
    let mut controller = controller.transpose()?;
    let clock = Instant::now();
    let answer = client.plan(&request, PATIENCE + request.deadline.unwrap_or_default())?;
    let round_trip = clock.elapsed();
    let report = answer.report();
    if !report.outcome.has_candidates() || report.candidates.is_empty() {
        bail!("{}", arguments.explain(report));
    }
    print_answer(&answer, round_trip);
    if report.outcome == Outcome::ExecutionRefused {
        bail!("not executed: {}", report.reason);
    }
    match (&mut controller, report.trajectory_id) {
        (Some(controller), Some(id)) => wait_until_taken(controller, id),
        _ => Ok(()),
    }
}

/// Waits until the controller says that it executes a trajectory.
fn wait_until_taken(controller: &mut ControllerView, id: u32) -> anyhow::Result<()> {
    let until = Instant::now() + PATIENCE;
    while Instant::now() < until {
        let state = controller.latest_state()?;
        match state {
            Some(state) if state.values.trajectory_id == id => {
                say!("the controller executes it");
                if let Some(note) = speed_note(state.values.speed) {
                    say!("{note}");
                }
                return Ok(());
            }
            Some(state) if state.values.refused_trajectory_id == id => {
                let refusal = state.refusal;
                bail!("not executed: the controller refuses trajectory {id}: {refusal}");
            }
            _ => std::thread::sleep(Duration::from_millis(2)),
        }
    }
    bail!(
        "the controller has not said within {PATIENCE:?} whether it executes trajectory {id}: it may have begun it (`pcc watch` shows what it does)"
    )
}

/// What an ordered speed below 1 means for a motion; none where the motion is followed at its own rate.
fn speed_note(speed: f64) -> Option<String> {
    if speed <= 0.0 {
        return Some(STANDS_STILL.into());
    }
    (speed < 1.0).then(|| format!("the controller follows it at speed {speed} of its own rate"))
}

impl Arguments {
    /// `begun_ns`: a stop that is ordered later is meant for this request, too; ns of CLOCK_MONOTONIC.
    fn request(&self, options: &IpcOptions, begun_ns: i64) -> anyhow::Result<PlanRequest> {
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
        let (start, requested_mono_ns) = match &self.start {
            Some(values) => (six(values), begun_ns),
            None => {
                let held = held_state(options, begun_ns)?.values;
                (held.commanded_configuration_rad, held.stamp_mono_ns)
            }
        };
        Ok(PlanRequest {
            seed: self.seed,
            candidate_count: self.candidates,
            deadline: (self.deadline_ms > 0).then(|| Duration::from_millis(self.deadline_ms)),
            sampler: self.sampler.code(),
            selection: self.index.map_or(
                SelectionRule::Best(self.select.code()),
                SelectionRule::Index,
            ),
            execute: self.execute,
            requested_mono_ns: self.execute.then_some(requested_mono_ns),
            limits_scale: self.limits_scale,
            balls: balls.collect(),
            ..PlanRequest::new(start, self.goal()?)
        })
    }

    fn goal(&self) -> anyhow::Result<Goal> {
        match (&self.tip, &self.configuration) {
            (Some(tip), _) => Ok(Goal::Tip {
                position_m: [tip[0], tip[1], tip[2]],
                tolerance_m: None,
            }),
            (None, Some(shape)) => Ok(Goal::Configuration(six(shape))),
            (None, None) => bail!("--tip or --configuration is needed"),
        }
    }
}

impl Arguments {
    /// The outcome, its reason, which may begin with the outcome's own words, and the options that it is about.
    fn explain(&self, report: &PlanReport) -> String {
        let outcome = report.outcome.text();
        let reason = match report.reason.as_str() {
            "" => format!("{outcome}: no candidate"),
            reason if reason.starts_with(outcome) => reason.to_owned(),
            reason => format!("{outcome}: {reason}"),
        };
        let asked = Asked {
            start: self.start.as_deref(),
            tip: self.tip.as_deref(),
            configuration: self.configuration.as_deref(),
            balls: &self.ball,
        };
        match Wrong::of_outcome(report.outcome) {
            Some(wrong) => format!("{reason} ({})", asked.blamed(&wrong)),
            None if report.outcome == Outcome::Truncated => {
                format!("{reason} (a longer --deadline-ms is needed)")
            }
            None => reason,
        }
    }
}

impl SamplerName {
    fn code(self) -> Sampler {
        match self {
            Self::Default => Sampler::Default,
            Self::Fast => Sampler::Fast,
            Self::Straight => Sampler::Straight,
            Self::StraightDrawn => Sampler::StraightDrawn,
            Self::RrtConnect => Sampler::RrtConnect,
            Self::RrtSmooth => Sampler::RrtSmooth,
            Self::Diffusion => Sampler::Diffusion,
            Self::DiffusionPost => Sampler::DiffusionPost,
            Self::DiffusionGuided => Sampler::DiffusionGuided,
        }
    }
}

impl SelectionName {
    fn code(self) -> Selection {
        match self {
            Self::ShortestTime => Selection::ShortestTime,
            Self::ShortestTipPath => Selection::ShortestTipPath,
            Self::LargestClearance => Selection::LargestClearance,
            Self::Smoothest => Selection::Smoothest,
            Self::NearestGoalConfiguration => Selection::NearestGoalConfiguration,
        }
    }
}

fn six(values: &[f64]) -> [f64; DOF] {
    std::array::from_fn(|i| values[i])
}

/// Waits for the state of a controller that holds the robot at rest.
///
/// # Errors
/// A stop or a reset that was ordered after `begun_ns` (CLOCK_MONOTONIC): who orders it wants the robot to stay where it is. And a
/// controller that does not hold.
fn held_state(options: &IpcOptions, begun_ns: i64) -> anyhow::Result<ControllerState> {
    let mut known = KnownOrders::until(begun_ns);
    let mut controller = ControllerView::connect(options)?;
    let until = Instant::now() + PATIENCE;
    let mut last = None;
    while Instant::now() < until {
        if let Some(state) = controller.latest_state()? {
            // A state whose stamp is old tells of new orders all the same.
            let checked = known.check(&state.values);
            checked.context("ask again if the robot is to move")?;
            let is_fresh = mono_now_ns() - state.values.stamp_mono_ns < STATE_LIFETIME_NS;
            if is_fresh && is_held(&state) {
                return Ok(state);
            }
            last = is_fresh.then_some((state.state, state.waiting)).or(last);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    match last {
        None => bail!(
            "no controller within {PATIENCE:?}: start it, set PCC_PREFIX and PCC_ROOT to where it runs, or give --start"
        ),
        Some((state, waiting)) => bail!(
            "the controller holds no robot at rest: it is {state} (it waits for: {waiting}); wait until it is holding, or give --start"
        ),
    }
}

/// Whether a motion may be planned from where this state has the robot: it is held at rest, and no stop, reset or start of the controller
/// is newer than the state.
fn is_held(state: &ControllerState) -> bool {
    let values = &state.values;
    matches!(state.state, LoopState::Holding | LoopState::Fault)
        && state.waiting == Waiting::None
        && values.stamp_mono_ns > values.wanted_from_mono_ns
}

fn print_answer(answer: &PlanAnswer, round_trip: Duration) {
    let report = answer.report();
    say!(
        "{}: {} candidates, {:.2} ms round trip",
        report.outcome,
        report.candidates.len(),
        1e3 * round_trip.as_secs_f64()
    );
    if report.outcome == Outcome::Ok && !report.reason.is_empty() {
        say!("{}", report.reason);
    }
    say!("  #  source         duration s  tip path m  clearance m  smoothness  tip error m  knots");
    for (index, c) in report.candidates.iter().enumerate() {
        let mark = if report.selected == Some(index) {
            '*'
        } else {
            ' '
        };
        let source = Source::try_from(c.source).map_or("unknown", Source::text);
        say!(
            "{mark} {index:2} {source:14} {:10.3} {:11.4} {:12.4} {:11.3e} {:12.2e} {:6}",
            c.duration_s,
            c.tip_path_m,
            c.clearance_m,
            c.smoothness,
            c.tip_error_m,
            c.knot_count
        );
    }
    say!("{}", stage_times(&report.stages_ns));
    if let Some(id) = report.trajectory_id {
        say!("published for execution as trajectory {id}");
    }
}

fn stage_times(stages_ns: &[u64]) -> String {
    let stage = |(stage, ns): (&Stage, &u64)| format!("{stage} {:.2}", *ns as f64 * 1e-6);
    let parts: Vec<String> = Stage::ALL.iter().zip(stages_ns).map(stage).collect();
    format!("stages, ms: {}", parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_types::ipc::{IpcNode, controller_state_service, publisher};
    use shared_types::message;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread::{sleep, spawn};

    const MS: i64 = 1_000_000;

    #[test]
    fn a_speed_below_one_is_said() {
        assert_eq!(speed_note(1.0), None);
        let half = "the controller follows it at speed 0.5 of its own rate";
        assert_eq!(speed_note(0.5).as_deref(), Some(half));
        assert_eq!(speed_note(0.0).as_deref(), Some(STANDS_STILL));
    }

    fn holding(stamp_mono_ns: i64, wanted_from_mono_ns: i64) -> message::ControllerState {
        message::ControllerState {
            stamp_mono_ns,
            wanted_from_mono_ns,
            instance: 1,
            state: LoopState::Holding.code(),
            ..message::ControllerState::ZEROED
        }
    }

    #[test]
    fn a_motion_from_a_named_start_is_wanted_since_the_program_began() {
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            arguments: Arguments,
        }
        let words = "pcc --start 0 0 0 0 0 0 --tip 0 0 1 --execute".split(' ');
        let line = <Line as clap::Parser>::parse_from(words);
        let options = IpcOptions {
            prefix: "plan-start".into(),
            root: "/nowhere".into(),
        };
        let request = line.arguments.request(&options, 17).unwrap();
        assert_eq!(request.requested_mono_ns, Some(17));
    }

    #[test]
    fn a_state_of_before_the_last_order_is_not_asked_from() {
        let is_held = |values| is_held(&ControllerState::try_from(&values).unwrap());
        assert!(is_held(holding(8, 7)));
        assert!(!is_held(holding(7, 7)));
        assert!(!is_held(holding(6, 7)));
        let state = LoopState::Executing.code();
        let executing = message::ControllerState {
            state,
            ..holding(8, 7)
        };
        assert!(!is_held(executing));
    }

    /// What [`held_state`] returns where a controller publishes `told(begin_ns, now_ns)` again and again.
    fn found_where(
        name: &str,
        told: impl Fn(i64, i64) -> message::ControllerState + Send + 'static,
    ) -> anyhow::Result<ControllerState> {
        let folder = tempfile::tempdir().unwrap();
        let options = IpcOptions {
            prefix: format!("plan-{name}"),
            root: folder.path().join("root"),
        };
        let (here, quit) = (options.clone(), Arc::<AtomicBool>::default());
        let quits = Arc::clone(&quit);
        let controller = spawn(move || {
            let node = IpcNode::create(&here, "controller").unwrap();
            let states = publisher(&node, &controller_state_service(&node).unwrap()).unwrap();
            let begin_ns = mono_now_ns();
            while !quits.load(Ordering::Relaxed) {
                states.send_copy(told(begin_ns, mono_now_ns())).unwrap();
                sleep(Duration::from_millis(5));
            }
        });
        let found = held_state(&options, mono_now_ns());
        quit.store(true, Ordering::Relaxed);
        controller.join().unwrap();
        found
    }

    #[test]
    fn a_stop_that_is_ordered_while_states_are_old_is_not_overruled() {
        let found = found_where("stop", |begin_ns, now_ns| {
            if now_ns < begin_ns + 600 * MS {
                holding(begin_ns - 1_000 * MS, 1)
            } else {
                holding(now_ns, begin_ns + 500 * MS)
            }
        });
        let error = format!("{:#}", found.unwrap_err());
        assert!(error.starts_with("ask again if the robot"), "{error}");
        assert!(error.contains("a stop or a reset"), "{error}");
    }

    #[test]
    fn orders_of_before_keep_nobody_from_asking() {
        let found = found_where("before", |begin_ns, now_ns| {
            holding(now_ns, begin_ns - 2_000 * MS)
        });
        assert_eq!(found.unwrap().state, LoopState::Holding);
    }
}
