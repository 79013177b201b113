//! What every delivered motion promises, of each sampler: judged from its knots by geometry that shares nothing with the planner's.
#![allow(clippy::unwrap_used)]

use std::fs;

use datasets::scenes::{Setting, draw_target};
use denoiser::{FastModel, Manifest};
use pcc_model::{Robot, UnitRobot};
use planning::{
    Goal, MOST_CORRECTIONS, Models, MovingObstacles, Planner, Problem, Request, Sampler, Source,
};
use tests::brute_force::{Ball, Body, Configuration};
use tests::programs::repository;
use trajectory::Knot;

/// How much thicker the tube of each section must keep clear, section lengths.
const PADDING: [f64; 3] = [0.0, 0.01, 0.02];
/// Instants at which a motion is looked at.
const LOOKS: usize = 800;

struct Judge {
    robot: UnitRobot,
    body: Body,
}

impl Judge {
    fn new() -> Self {
        let file = repository().join("config/robots/unit.toml");
        Self {
            robot: Robot::from_file(&file).unwrap().to_unit().unwrap(),
            body: Body::from_robot_file(&fs::read_to_string(file).unwrap()),
        }
    }

    fn planner(&self) -> Planner {
        let manifest = Manifest::open(&repository().join("weights")).unwrap();
        let file = manifest.weights("fast").unwrap();
        let fast = FastModel::from_weights(&file, self.robot.bending_limit).unwrap();
        let models = Models {
            fast: Some(fast),
            ..Models::default()
        };
        Planner::new(self.robot.clone(), models, 2).unwrap()
    }

    /// Bending, clearance, and tendons' velocity and acceleration by differences.
    fn judge(&self, knots: &[Knot], balls: &[Ball]) {
        let duration = knots.last().unwrap().time;
        let step = duration / LOOKS as f64;
        let shapes: Vec<Configuration> = (0..=LOOKS).map(|i| at(knots, step * i as f64)).collect();
        let padded = self.body.padded(&PADDING);
        let (mut fastest, mut least) = (0.0_f64, f64::INFINITY);
        for shape in &shapes {
            least = least.min(padded.clearance(shape, balls, 0));
            for section in shape.chunks_exact(2) {
                let angle = section[0].hypot(section[1]);
                assert!(angle <= self.robot.bending_limit + 1e-6, "{angle}");
            }
        }
        assert!(least >= -self.body.chord_error_m(), "touches: {least}");
        let tendons: Vec<_> = shapes
            .iter()
            .map(|shape| self.body.tendons(shape))
            .collect();
        let limits = &self.robot.tendon_limits;
        for around in tendons.windows(3) {
            let neighbours = around[0].iter().zip(&around[1]).zip(&around[2]);
            for ((before, now), after) in neighbours {
                let velocity = (after - now).abs() / step / limits.velocity;
                let acceleration = (after - 2.0 * now + before).abs() / step.powi(2);
                fastest = fastest.max(velocity);
                assert!(velocity <= 1.0 + 1e-6, "{velocity}");
                assert!(
                    acceleration <= limits.acceleration * (1.0 + 1e-6),
                    "{acceleration}"
                );
            }
        }
        assert!(
            fastest > 0.3 || duration < 1.0,
            "the premise, it uses its limits: {fastest}"
        );
    }
}

/// A quintic through position, velocity and acceleration of both knots around an instant.
fn at(knots: &[Knot], time: f64) -> Configuration {
    let next = knots.partition_point(|knot| knot.time <= time);
    let next = next.clamp(1, knots.len() - 1);
    let (a, b) = (&knots[next - 1], &knots[next]);
    let h = b.time - a.time;
    let s = ((time - a.time) / h).clamp(0.0, 1.0);
    std::array::from_fn(|i| {
        let (p, v, w) = (a.position[i], h * a.velocity[i], h * h * a.acceleration[i]);
        let (q, u, x) = (b.position[i], h * b.velocity[i], h * h * b.acceleration[i]);
        let (d, e, f) = (q - p - v - 0.5 * w, u - v - w, x - w);
        let c3 = 10.0 * d - 4.0 * e + 0.5 * f;
        let c4 = -15.0 * d + 7.0 * e - f;
        let c5 = 6.0 * d - 3.0 * e + 0.5 * f;
        p + s * (v + s * (0.5 * w + s * (c3 + s * (c4 + s * c5))))
    })
}

#[test]
fn delivered_candidates_keep_every_promise() {
    let judge = Judge::new();
    let planner = judge.planner();
    let (mut learned, mut straight, mut trees) = (0, 0, 0);
    for index in 0..12 {
        let Some(target) = draw_target(&judge.robot, Setting::General(None), 11, index) else {
            continue;
        };
        let problem = Problem {
            start: target.starts[0],
            goal: Goal::Tip(target.tip),
            scene: target.scene.clone(),
            moving: MovingObstacles::default(),
        };
        let ball = |ball: &collision::Ball| Ball::resting(ball.centre.into(), ball.radius);
        let balls: Vec<Ball> = problem.scene.balls().iter().map(ball).collect();
        for sampler in [
            Sampler::Default,
            Sampler::Fast,
            Sampler::Straight,
            Sampler::StraightDrawn,
            Sampler::RrtConnect,
            Sampler::RrtSmooth,
        ] {
            let request = Request {
                candidates: 10,
                seed: index,
                sampler,
                limits_scale: 1.0,
                padding: PADDING,
                knots: 96,
                corrections: MOST_CORRECTIONS,
                start_motion: None,
                previous: None,
                end_to_move: None,
            };
            let answer = planner.plan(&problem, &request, &|| false).unwrap();
            for candidate in &answer.candidates {
                let knots = candidate.trajectory.knots();
                let (first, last) = (&knots[0], knots.last().unwrap());
                assert_eq!(first.position, problem.start);
                assert_eq!((first.velocity.norm(), last.velocity.norm()), (0.0, 0.0));
                let tip = judge.body.tip(&last.position.into());
                assert!((target.tip - pcc_model::Point::from(tip)).norm() < 1e-6);
                judge.judge(knots, &balls);
                match candidate.source {
                    Source::Learned | Source::Explored => learned += 1,
                    Source::StraightLine => straight += 1,
                    Source::Classical => trees += 1,
                    Source::Kept | Source::MovedEnd => panic!("there was no motion before"),
                }
            }
        }
    }
    let counts = [learned, straight, trees];
    assert!(counts.iter().all(|count| *count > 50), "{counts:?}");
}
