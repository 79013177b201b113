//! Plans before the first request: that finds code and memory as warm as the others, and it is known how long plans take that begin in motion.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use collision::{Ball, Scene, tracking_padding};
use pcc_model::{Configuration, Point, UnitRobot};
use planning::{
    EarlySelection, Goal, MOST_CORRECTIONS, MovingObstacles, Planner, PlannerError, Problem,
    Request, Sampler, StartMotion, Supervision, Told,
};
use trajectory::Trajectory;

use super::config::Config;
use crate::requests::{LeadTimes, PlanKind, Work};

/// Plans that begin in motion.
const IN_MOTION: u32 = 24;
/// The last ones of these, which are as fast as later plans.
const WARM: u32 = 16;

/// Where the ball of a plan in motion is, on which depends how the fastest motion becomes known.
#[derive(Clone, Copy)]
enum Obstacle {
    /// Beside the robot.
    Beside,
    /// In the way of a straight segment, which is pushed.
    Pushed,
    /// Likewise, and large: the fastest motion is planned anew.
    Detour,
}

const OBSTACLES: [Obstacle; 3] = [Obstacle::Beside, Obstacle::Pushed, Obstacle::Detour];

/// Plans once from rest with every sampler that has a model, and some times in motion; returns how long the latter took.
///
/// Of the diffusion samplers it is the guided one: it has the gradients' memory beside that of the others.
///
/// # Errors
/// [`PlannerError`] of a plan from rest.
pub(super) fn warm_up(planner: &Planner, config: &Config) -> Result<LeadTimes, PlannerError> {
    let main = match config.weights {
        Some(_) => Sampler::Default,
        None => Sampler::Straight,
    };
    let at_rest = Configuration::zeros();
    let from_rest = problem(planner.robot(), &at_rest, 0, Obstacle::Beside);
    if config.diffusion.is_some() {
        let request = request(planner, config, Sampler::DiffusionGuided);
        planner.plan(&from_rest, &request, &|| false)?;
    }
    let request = request(planner, config, main);
    let plan = planner.plan(&from_rest, &request, &|| false)?;
    let mut lead_times = LeadTimes::default();
    if let Some(candidate) = plan.candidates.first() {
        for index in 1..=IN_MOTION {
            let took = plan_in_motion(planner, &request, &candidate.trajectory, index);
            for (kind, took) in took.into_iter().filter(|_| index > IN_MOTION - WARM) {
                lead_times.note_warm_up(kind, took);
            }
        }
    }
    Ok(lead_times)
}

/// Plans from an instant of a motion; returns how long it takes until the plan is whole, and until its motion is selected, nothing where it fails.
fn plan_in_motion(
    planner: &Planner,
    request: &Request,
    motion: &Trajectory,
    index: u32,
) -> Vec<(PlanKind, Duration)> {
    let state = motion.at(motion.duration() * f64::from(index) / f64::from(IN_MOTION + 2));
    let obstacle = OBSTACLES[index as usize % OBSTACLES.len()];
    let problem = problem(planner.robot(), &state.position, index, obstacle);
    let request = Request {
        seed: index.into(),
        start_motion: Some(StartMotion {
            velocity: state.velocity,
            acceleration: state.acceleration,
        }),
        ..request.clone()
    };
    let (begun, late, selected) = (Instant::now(), OnceLock::new(), OnceLock::new());
    let early_selection = EarlySelection {
        begin: &|to_be_done, _| {
            if !to_be_done.is_known() {
                late.get_or_init(|| (Work::from(to_be_done), Instant::now()));
            }
        },
        selected: &|_| {
            selected.get_or_init(Instant::now);
            Told::InTime
        },
    };
    let supervision = Supervision {
        early_selection: Some(early_selection),
        ..Supervision::new(&|| false)
    };
    if planner
        .plan_supervised(&problem, &request, supervision)
        .is_err()
    {
        return Vec::new();
    }
    let kind = |work| PlanKind {
        sampler: request.sampler,
        has_several_goals: false,
        work,
    };
    let whole = (kind(Work::WholePlan), begun.elapsed());
    let early = selected.into_inner().map(|selected| match late.get() {
        Some((work, late)) => (kind(*work), selected - *late),
        None => (kind(Work::StraightSegments), selected - begun),
    });
    std::iter::once(whole).chain(early).collect()
}

/// To a place of the tip that many configurations reach, beside a ball, or to one configuration.
fn problem(robot: &UnitRobot, start: &Configuration, index: u32, obstacle: Obstacle) -> Problem {
    let bending = |row: usize| (f64::from(index) + row as f64 + 1.0).sin();
    let reached = Configuration::from_fn(|row, _| 0.5 * robot.bending_limit * bending(row));
    let half_way = robot.tip(&(0.5 * (start + reached)));
    let beside = Point::new(1.5 + robot.largest_tube_radius(), 0.0, 1.5);
    let (goal, centre, radius) = match obstacle {
        Obstacle::Beside => (Goal::Tip(robot.tip(&reached)), beside, 0.3),
        Obstacle::Pushed => (Goal::Configuration(reached), half_way, 0.1),
        Obstacle::Detour => (Goal::Configuration(reached), half_way, 0.25),
    };
    let ball = Ball { centre, radius };
    Problem {
        start: *start,
        goal,
        scene: Scene::new(vec![ball]).expect("one ball near the robot is a scene"),
        moving: MovingObstacles::default(),
    }
}

fn request(planner: &Planner, config: &Config, sampler: Sampler) -> Request {
    Request {
        candidates: config.capacity.candidates,
        seed: 0,
        sampler,
        limits_scale: 1.0,
        padding: tracking_padding(planner.robot(), config.path_tolerance_rad),
        knots: config.capacity.knots_per_candidate,
        corrections: MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use denoiser::{FastModel, Manifest};
    use pcc_model::Robot;
    use planning::Models;
    use std::path::Path;

    #[test]
    fn work_in_motion_is_done_before_the_first_request() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let robot = Robot::from_file(&root.join("config/robots/unit.toml")).unwrap();
        let robot = robot.to_unit().unwrap();
        let weights = Manifest::open(&root.join("weights"))
            .unwrap()
            .weights("fast");
        let fast = FastModel::from_weights(&weights.unwrap(), robot.bending_limit).unwrap();
        let models = Models {
            fast: Some(fast),
            ..Models::default()
        };
        let planner = Planner::new(robot, models, 2).unwrap();
        let config = Config::from_file(&root.join("config/planner-daemon.toml")).unwrap();
        let from_rest = problem(
            planner.robot(),
            &Configuration::zeros(),
            0,
            Obstacle::Beside,
        );
        let request = request(&planner, &config, Sampler::Default);
        let plan = planner.plan(&from_rest, &request, &|| false).unwrap();
        let motion = &plan.candidates[0].trajectory;
        let indices = IN_MOTION - WARM + 1..=IN_MOTION;
        let took = indices.flat_map(|index| plan_in_motion(&planner, &request, motion, index));
        let done: Vec<Work> = took.map(|(kind, _)| kind.work).collect();
        for work in [Work::WholePlan, Work::StraightSegments, Work::PlanningAnew] {
            let count = done.iter().filter(|it| **it == work).count();
            assert!(count >= 3, "{work:?}: {count} of {done:?}");
        }
    }
}
