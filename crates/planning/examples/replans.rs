//! Prints when motions that begin in motion arrive, against a stop followed by the fastest of ten motions to the same goal
//! configuration, and how long planning takes.
//!
//! Chains of requests in general scenes at random instants of the fastest motion, like the acceptance program's replans in other scenes. The
//! first argument is the number of replans (400 if none is given), the second one how much later than the request says the robot is left where
//! planning goes on before the fastest motion is known, ms (0), the third one how much later than that each time where it is known (0).
//! `cargo run --release -p planning --example replans`

use collision::{Scene, tracking_padding};
use datasets::scenes::{Setting, draw_target};
use denoiser::{FastModel, Manifest};
use pcc_model::{Configuration, Robot, UnitRobot};
use planning::{
    Candidate, EarlySelection, Goal, MOST_CORRECTIONS, Models, MovingObstacles, Plan, Planner,
    Problem, Request, Sampler, StartMotion, Supervision, Told, random_configuration,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::error::Error;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::Instant;
use trajectory::{Knot, STOPPING_KNOTS, Trajectory, stopping_motion};

/// Seed of scenes, tips and pauses.
const SEED: u64 = 9_111;
/// Replans in one scene.
const IN_A_SCENE: usize = 25;
/// Shortest pause between two requests, s; the longest is the motion that was asked for.
const SHORTEST_PAUSE_S: f64 = 0.06;
/// Knots of a motion from rest.
const KNOTS: usize = 96;
/// Room of starts and targets beside the tube, section lengths.
const ROOM: f64 = 0.1;

/// What replans showed.
#[derive(Default)]
struct Figures {
    /// (stop-then-go − joined) ÷ the shortest stop.
    won: Vec<f64>,
    /// Time of a request in motion, and until its fastest motion is known, ms.
    planned_ms: Vec<f64>,
    selected_ms: Vec<f64>,
    /// Requests in motion where planning went on before the fastest motion was known.
    selected_late: usize,
    /// Requests in motion without a motion.
    refused: usize,
}

/// A chain of requests in one scene.
struct Chain<'a> {
    planner: &'a Planner,
    scene: Scene,
    /// The motion under way, and how far it is, s.
    motion: Trajectory,
    time_s: f64,
    /// How much later it is left where planning goes on before the fastest motion is known, and each time where it is known, s.
    later_s: [f64; 2],
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

fn fastest(plan: &Plan) -> Option<&Candidate> {
    let duration_s = |c: &&Candidate| c.metrics.duration_s;
    let candidates = plan.candidates.iter();
    candidates.min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))
}

/// Whether a motion that won this share of a stop arrives later than after it, by more than rounding.
fn is_later(won: f64) -> bool {
    won < -1e-6
}

fn request(robot: &UnitRobot, seed: u64, start_motion: Option<StartMotion>) -> Request {
    Request {
        candidates: 10,
        seed,
        sampler: Sampler::Default,
        limits_scale: 1.0,
        padding: tracking_padding(robot, 0.01),
        knots: KNOTS + start_motion.map_or(0, |_| STOPPING_KNOTS),
        corrections: MOST_CORRECTIONS,
        start_motion,
        previous: None,
        end_to_move: None,
    }
}

impl Chain<'_> {
    fn problem(&self, start: Configuration, goal: Goal) -> Problem {
        Problem {
            start,
            goal,
            scene: self.scene.clone(),
            moving: MovingObstacles::default(),
        }
    }

    /// A random configuration with room around it.
    fn target(&self, random: &mut Pcg64) -> Configuration {
        let robot = self.planner.robot();
        loop {
            let configuration = random_configuration(robot, random);
            if self.scene.clearance_at(robot, &configuration) >= ROOM {
                return configuration;
            }
        }
    }

    /// Asks for another goal now; compares where the robot is in motion.
    fn replan(
        &mut self,
        seed: u64,
        random: &mut Pcg64,
        figures: &mut Figures,
    ) -> Result<(), Box<dyn Error>> {
        let robot = self.planner.robot();
        let goal = Goal::Tip(robot.tip(&self.target(random)));
        let state = self.motion.at(self.time_s);
        let is_moving = self.time_s < self.motion.duration();
        let start_motion = is_moving.then_some(StartMotion {
            velocity: state.velocity,
            acceleration: state.acceleration,
        });
        let problem = self.problem(state.position, goal);
        let clock = Instant::now();
        let request = request(robot, seed, start_motion);
        let (selected, is_late) = (OnceLock::new(), AtomicBool::new(false));
        let took_ms = || clock.elapsed().as_secs_f64() * 1e3;
        let later_s = Mutex::new(0.0);
        let early_selection = EarlySelection {
            begin: &|to_be_done, can_begin| {
                let mut later_s = later_s.lock().expect("no thread panics with it");
                let more_s = self.later_s[usize::from(to_be_done.is_known())];
                if !to_be_done.is_known() {
                    is_late.store(true, Ordering::Relaxed);
                }
                if more_s > 0.0 {
                    *later_s += more_s;
                    can_begin(&Knot::of(0.0, &self.motion.at(self.time_s + *later_s)));
                }
            },
            selected: &|candidate| {
                selected.get_or_init(|| (took_ms(), candidate));
                Told::InTime
            },
        };
        let supervision = Supervision {
            early_selection: Some(early_selection),
            ..Supervision::new(&|| false)
        };
        let plan = self
            .planner
            .plan_supervised(&problem, &request, supervision);
        let took_ms = took_ms();
        let told = selected.get().map(|(_, candidate)| candidate);
        let Some(best) = told.or_else(|| plan.as_ref().ok().and_then(fastest)) else {
            figures.refused += usize::from(is_moving);
            return Ok(());
        };
        if is_moving {
            figures.planned_ms.push(took_ms);
            figures.selected_ms.extend(selected.get().map(|it| it.0));
            figures.selected_late += usize::from(is_late.into_inner());
            self.compare(best, seed, figures)?;
        }
        (self.motion, self.time_s) = (Trajectory::clone(&best.trajectory), 0.0);
        Ok(())
    }

    /// Against a stop, and the fastest of ten motions to the same goal configuration.
    fn compare(
        &self,
        best: &Candidate,
        seed: u64,
        figures: &mut Figures,
    ) -> Result<(), Box<dyn Error>> {
        let robot = self.planner.robot();
        let first = best.trajectory.knots()[0];
        let state = Knot { time: 0.0, ..first };
        let stop = stopping_motion(&state, &robot.tendons, &robot.tendon_limits)?;
        let problem = self.problem(stop.end(), Goal::Configuration(best.end()));
        let request = request(robot, seed, None);
        let reference = self.planner.plan(&problem, &request, &|| false)?;
        if let Some(go) = fastest(&reference) {
            let won_s = stop.duration() + go.metrics.duration_s - best.metrics.duration_s;
            let won = won_s / stop.duration();
            if is_later(won) {
                println!(
                    "later: seed {seed}, {won:.3} of a stop of {:.3} s; {} took {:.3} s, alone {} {:.3} s",
                    stop.duration(),
                    best.source,
                    best.metrics.duration_s,
                    go.source,
                    go.metrics.duration_s
                );
            }
            figures.won.push(won);
        }
        Ok(())
    }
}

fn planner() -> Result<Planner, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let robot = Robot::from_file(&root.join("config/robots/unit.toml"))?;
    let weights = Manifest::open(&root.join("weights"))?.weights("fast")?;
    let models = Models {
        fast: Some(FastModel::from_weights(&weights, robot.bending_limit)?),
        ..Models::default()
    };
    let robot = robot.to_unit().ok_or("sections of equal length")?;
    Ok(Planner::new(robot, models, 2)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |index| std::env::args().nth(index);
    let count = argument(1).map_or(Ok(400), |count| count.parse())?;
    let seconds = |ms: String| ms.parse::<f64>().map(|ms| 1e-3 * ms);
    let later_s = |index| argument(index).map_or(Ok(0.0), seconds);
    let later_s = [later_s(2)?, later_s(3)?];
    let planner = planner()?;
    let mut random = Pcg64::seed_from_u64(SEED);
    let mut figures = Figures::default();
    let mut scenes = (0..).filter_map(|i| {
        draw_target(planner.robot(), Setting::General(None), SEED, i).map(|target| target.scene)
    });
    let mut seed = 0;
    while figures.won.len() < count {
        let scene = scenes.next().ok_or("scenes go on without end")?;
        let rest = Configuration::zeros();
        if scene.clearance_at(planner.robot(), &rest) < ROOM {
            continue;
        }
        let mut chain = Chain {
            planner: &planner,
            scene,
            motion: Trajectory::new(vec![Knot::resting(0.0, rest), Knot::resting(1e-3, rest)])?,
            time_s: 1.0,
            later_s,
        };
        for _ in 0..=IN_A_SCENE {
            chain.replan(seed, &mut random, &mut figures)?;
            seed += 1;
            let longest_s = chain.motion.duration().max(2.0 * SHORTEST_PAUSE_S);
            chain.time_s += random.random_range(SHORTEST_PAUSE_S..longest_s);
        }
    }
    let Figures {
        won,
        planned_ms,
        selected_ms,
        selected_late,
        refused,
    } = &mut figures;
    let later = won.iter().filter(|won| is_later(**won)).count();
    println!(
        "{} replans, {refused} refused: won {:.3} of the shortest stop in the median, p10 {:.3}, p1 {:.3}, least {:.3}; {later} later; \
         planned in {:.2} ms, p90 {:.2}, p99 {:.2}; the fastest known in {:.2} ms, p90 {:.2}, p99 {:.2}, {selected_late} of them late",
        won.len(),
        quantile(won, 0.5),
        quantile(won, 0.1),
        quantile(won, 0.01),
        quantile(won, 0.0),
        quantile(planned_ms, 0.5),
        quantile(planned_ms, 0.9),
        quantile(planned_ms, 0.99),
        quantile(selected_ms, 0.5),
        quantile(selected_ms, 0.9),
        quantile(selected_ms, 0.99),
    );
    Ok(())
}
