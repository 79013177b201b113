//! Prints how many requests among 1 to 4 moving balls are certified, how, and how long they take.
//!
//! Balls cross the workspace at up to the speed given as the first argument, section lengths a second (0.5 if none is given), as the live
//! scene of a sensor of 30 Hz tells them (a lifetime of 0.2 s). `cargo run --release -p planning --example moving_balls`

use collision::{Ball, MovingBall, Scene, TimeSpread, tracking_padding};
use denoiser::{FastModel, Manifest};
use pcc_model::{Point, Robot};
use planning::{
    Candidate, Goal, MOST_CORRECTIONS, Models, MovingBalls, MovingObstacles, Plan, Planner,
    PlannerError, Problem, Request, Sampler, random_configuration,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::error::Error;
use std::path::Path;
use std::time::Instant;
use trajectory::{BRAKING_SHARE, RateLaw};

/// Requests for each number of balls.
const REQUESTS: u64 = 100;
/// By how much a ball may be behind or ahead: a lifetime of 0.2 s, 0.35 s without supervision, 0.05 s for the order, 0.01 s of tolerance; and
/// 0.2 s later.
const SPREAD: TimeSpread = TimeSpread {
    earliest: -0.61,
    latest: 0.81,
    seen: f64::NEG_INFINITY,
};

/// A ball that passes near a point of the workspace at some time of the first seconds.
fn crossing(random: &mut Pcg64, fastest: f64) -> MovingBall {
    let mut unit = || {
        let v = Point::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
        v / v.norm().max(1e-9)
    };
    let (direction, aside) = (unit(), unit());
    let velocity = direction * fastest * random.random_range(0.5..1.0);
    let through =
        Point::new(0.0, 0.0, random.random_range(1.0..2.8)) + aside * random.random_range(0.2..1.5);
    let met_s = random.random_range(0.5..4.0);
    MovingBall {
        ball: Ball {
            centre: through - velocity * met_s,
            radius: random.random_range(0.1..0.25),
        },
        velocity,
    }
}

/// What became of the requests with so many balls.
#[derive(Default)]
struct Figures {
    /// Requests whose start a ball does not leave for 6 s.
    unable: usize,
    /// Requests that begin later than they could, so that no ball can be at their start.
    delayed: usize,
    /// Requests with a certified motion.
    solved: usize,
    /// Requests with fewer candidates than asked for.
    incomplete: usize,
    /// Requests whose fastest motion waits at its start.
    waits: usize,
    /// Times of the answers, ms.
    times_ms: Vec<f64>,
    /// Duration of the fastest motion by that of the fastest without balls.
    longer: Vec<f64>,
}

/// The value below which this share of the values lies.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

fn fastest(plan: &Plan) -> Option<&Candidate> {
    let duration_s = |c: &&Candidate| c.metrics.duration_s;
    plan.candidates
        .iter()
        .min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))
}

impl Figures {
    fn add(&mut self, planner: &Planner, problem: Problem, seed: u64) -> Result<(), PlannerError> {
        let padding = tracking_padding(planner.robot(), 0.01);
        let padded = planner.robot().with_tube_padding(&padding);
        let Some(delay_s) = problem.moving.delay_of_begin_s(&padded, &problem.start) else {
            self.unable += 1;
            return Ok(());
        };
        let problem = Problem {
            moving: problem.moving.after(delay_s),
            ..problem
        };
        let still = Problem {
            moving: MovingObstacles::default(),
            ..problem.clone()
        };
        let request = request(seed, padding);
        let among_none = planner.plan(&still, &request, &|| false)?;
        let clock = Instant::now();
        let plan = planner.plan(&problem, &request, &|| false)?;
        self.times_ms.push(clock.elapsed().as_secs_f64() * 1e3);
        self.delayed += usize::from(delay_s > 0.0);
        self.incomplete += usize::from(plan.candidates.len() < request.candidates);
        if let (Some(best), Some(without)) = (fastest(&plan), fastest(&among_none)) {
            self.solved += 1;
            let knots = best.trajectory.knots();
            self.waits += usize::from(knots[0].position == knots[1].position);
            self.longer
                .push(best.metrics.duration_s / without.metrics.duration_s);
        }
        Ok(())
    }

    fn print(&mut self, count: usize) {
        let Self {
            unable,
            delayed,
            solved,
            incomplete,
            waits,
            ..
        } = self;
        let asked = self.times_ms.len();
        println!(
            "{count} balls: {unable} begin where a ball is or comes again and again; of {asked} others ({delayed} begin later) {solved} are \
             certified, {incomplete} with fewer than ten; the fastest waits in {waits} and takes {:.2} (p90 {:.2}) times as long as \
             without balls; {:.1} ms (p90 {:.1}, p99 {:.1})",
            quantile(&mut self.longer, 0.5),
            quantile(&mut self.longer, 0.9),
            quantile(&mut self.times_ms, 0.5),
            quantile(&mut self.times_ms, 0.9),
            quantile(&mut self.times_ms, 0.99)
        );
    }
}

fn request(seed: u64, padding: [f64; 3]) -> Request {
    Request {
        candidates: 10,
        seed,
        sampler: Sampler::Default,
        limits_scale: 1.0,
        padding,
        knots: 96,
        corrections: MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let speed = std::env::args().nth(1);
    let speed = speed.map_or(Ok(0.5), |speed| speed.parse())?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let robot = Robot::from_file(&root.join("config/robots/unit.toml"))?;
    let weights = Manifest::open(&root.join("weights"))?.weights("fast")?;
    let models = Models {
        fast: Some(FastModel::from_weights(&weights, robot.bending_limit)?),
        ..Models::default()
    };
    let planner = Planner::new(
        robot.to_unit().ok_or("sections of equal length")?,
        models,
        2,
    )?;
    let acceleration = robot.tendon_limits.acceleration * BRAKING_SHARE;
    let law = RateLaw::new(&robot.tendons, acceleration);
    for count in 0..=4 {
        let mut figures = Figures::default();
        for seed in 0..REQUESTS {
            let mut random = Pcg64::seed_from_u64(seed);
            let mut configuration = || random_configuration(planner.robot(), &mut random);
            let (start, goal) = (configuration(), configuration());
            let balls = (0..count).map(|_| crossing(&mut random, speed)).collect();
            let problem = Problem {
                start,
                goal: Goal::Tip(planner.robot().tip(&goal)),
                scene: Scene::default(),
                moving: MovingObstacles {
                    sources: vec![MovingBalls {
                        balls,
                        spread: SPREAD,
                    }],
                    braking: Some(law.clone()),
                },
            };
            figures.add(&planner, problem, seed)?;
        }
        figures.print(count);
    }
    Ok(())
}
