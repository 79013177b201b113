//! From a changed goal that stays to the first set-point of the motion to it.

use std::thread::sleep;
use std::time::Duration;

use client::{GoalSender, ScenePublisher};
use pcc_model::UnitRobot;
use rand_pcg::Pcg64;
use shared_types::clock::mono_now_ns;
use shared_types::message::MovingBall;
use shared_types::valid::Goal;
use tests::brute_force::Body;
use tests::geometry::seeded;
use tests::listener::{Heard, Listener};
use tests::replans::{ReplanScene, random_pause};
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::figures::{first_followed, is_on_its_way, quantile};
use super::moving_goal::apart;
use super::replan_run::wait_until_held;
use crate::report::Report;
use crate::scale::Scale;

/// Seed of scenes, tips and pauses: nothing was trained with it.
const SEED: u64 = 9_303;
/// Changes of the goal in one scene.
const IN_A_SCENE: usize = 10;
/// The next change comes at a random time between these after the last one.
const PAUSE: [Duration; 2] = [Duration::from_millis(150), Duration::from_millis(900)];
/// Lifetime of a scene that stays.
const LONG: Duration = Duration::from_secs(3600);
/// Distance from the tip within which a motion ends that is to it, m.
const TOLERANCE_M: f64 = 0.011;

/// A goal that was given in another one's place.
struct Change {
    given_ns: i64,
    tip_m: [f64; 3],
    /// When the next one was given, or the scene ended.
    until_ns: i64,
}

/// Goals in general scenes, changed while the robot moves.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "goals that stay, changed, to planner-daemon";
    report.group("goals, latency", command, |report| {
        let count = scale.pick(100, 1_000);
        let mut stack = Stack::running(&Settings::default())?;
        let (body, robot) = (stack.world.body(), stack.world.unit_robot());
        let listener = Listener::start(&stack.world.options);
        let mut scenes = ScenePublisher::connect(&stack.world.options, "general")?;
        let mut random = seeded(SEED);
        let (mut index, mut took_ms) = (0, Vec::new());
        while took_ms.len() < count {
            wait_until_held(&mut stack)?;
            let scene = ReplanScene::around(&robot, &stack.commanded(), SEED, &mut index);
            let balls = scene.balls.iter().map(|ball| MovingBall {
                centre_m: ball.centre_m,
                radius_m: ball.radius_m,
                velocity_m_s: [0.0; 3],
            });
            scenes.publish(&balls.collect::<Vec<_>>(), LONG)?;
            scenes.confirm(PATIENCE)?;
            let changes = change_goals(&mut stack, &scene, &robot, &mut random)?;
            wait_until_held(&mut stack)?;
            sleep(Duration::from_millis(50));
            let heard = listener.take();
            let in_motion = changes
                .iter()
                .filter(|change| found_in_motion(change, &heard));
            took_ms.extend(in_motion.map(|change| took_ms_of(change, &heard, &body)));
            println!("  {} of {count} goals", took_ms.len());
        }
        show(report, &took_ms);
        Ok(())
    });
}

/// Gives one tip after the other.
fn change_goals(
    stack: &mut Stack,
    scene: &ReplanScene,
    robot: &UnitRobot,
    random: &mut Pcg64,
) -> anyhow::Result<Vec<Change>> {
    let mut goal = GoalSender::connect(&stack.world.options)?;
    goal.wait_for_daemon(PATIENCE)?;
    goal.give(Goal::tip(scene.tip(robot, random).into()), 1.0)?;
    let mut changes: Vec<Change> = Vec::new();
    for _ in 0..IN_A_SCENE {
        sleep(random_pause(PAUSE[0], PAUSE[1], random));
        let tip_m = scene.tip(robot, random).into();
        let given_ns = mono_now_ns();
        goal.move_to(Goal::tip(tip_m), [0.0; 3])?;
        if let Some(last) = changes.last_mut() {
            last.until_ns = last.until_ns.min(given_ns);
        }
        changes.push(Change {
            given_ns,
            tip_m,
            until_ns: i64::MAX,
        });
    }
    sleep(PAUSE[1]);
    goal.withdraw()?;
    goal.confirm(PATIENCE)?;
    Ok(changes)
}

/// Whether the robot was in motion, by the cycle at the time at which the goal was given.
fn found_in_motion(change: &Change, heard: &Heard) -> bool {
    let before = heard
        .cycles
        .partition_point(|cycle| cycle.stamp_mono_ns <= change.given_ns);
    heard.cycles[..before].last().is_some_and(is_on_its_way)
}

/// Time from a goal to the first set-point of a motion that ends there, ms; infinite where none is followed before the next goal is given.
fn took_ms_of(change: &Change, heard: &Heard, body: &Body) -> f64 {
    let during = change.given_ns..change.until_ns;
    let firsts = heard.motions.iter().filter_map(|motion| {
        let tip_m = body.tip(&motion.knots.last()?.values[0]);
        let is_to_it = apart(tip_m, change.tip_m) <= TOLERANCE_M;
        let first_ns = first_followed(&heard.cycles, motion.id)?;
        (is_to_it && during.contains(&first_ns)).then_some(first_ns)
    });
    let first_ns = firsts.min();
    first_ns.map_or(f64::INFINITY, |it| (it - change.given_ns) as f64 * 1e-6)
}

fn show(report: &mut Report, took_ms: &[f64]) {
    let line = |what: &str| {
        format!(
            "goals, latency: goal that is changed in motion to first set-point of a motion to it: {what}"
        )
    };
    let never = took_ms.iter().filter(|it| it.is_infinite()).count();
    report.shown(
        &line("what was given"),
        format!(
            "{} goals found the robot in motion; {never} were followed by no motion to them before the next one; p90 {:.2} ms",
            took_ms.len(),
            quantile(took_ms, 0.9)
        ),
    );
    report.at_most(&line("median ms"), quantile(took_ms, 0.5), 6.0);
    report.at_most(&line("p99 ms"), quantile(took_ms, 0.99), 15.0);
}
