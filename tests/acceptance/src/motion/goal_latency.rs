//! From a changed goal that stays to the first set-point of the motion to it.

use std::collections::BTreeMap;
use std::thread::sleep;
use std::time::{Duration, Instant};

use client::{GoalSender, ScenePublisher};
use pcc_model::UnitRobot;
use rand_pcg::Pcg64;
use shared_types::capacity::STAGES;
use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::message::{MovingBall, PlanRecord};
use shared_types::valid::Goal;
use tests::brute_force::Body;
use tests::geometry::seeded;
use tests::listener::{Heard, Listener};
use tests::replans::{ReplanScene, random_pause};
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

use super::fault_resets::Faults;
use super::figures::{first_followed, is_on_its_way, stages_ms, stages_text};
use super::moving_goal::apart;
use super::replan_run::made_again;
use super::windows::{WINDOWS, quantiles_text, show_slowest, show_windows};
use crate::report::Report;
use crate::scale::Scale;
use crate::stolen::StolenTimes;

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
    given_at: Instant,
    given_ns: i64,
    tip_m: [f64; 3],
    /// When the next one was given, or the scene ended.
    until_ns: i64,
}

/// How a goal was followed.
struct Followed {
    given_at: Instant,
    /// Until the first set-point of a motion to it, ms; infinite where none is followed before the next goal is given.
    took_ms: f64,
    /// Until the switch to that motion.
    lead_ms: f64,
    /// The stages of its plan, nanoseconds.
    stages_ns: Option<[u64; STAGES]>,
    /// What became of other plans meanwhile.
    others: Vec<String>,
}

/// Goals in general scenes, changed while the robot moves.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "goals that stay, changed, to planner-daemon";
    report.group("goals, latency", command, |report| {
        let stolen = StolenTimes::watch()?;
        let count = WINDOWS * scale.pick(20, 200);
        let mut stack = Stack::running(&Settings::default())?;
        let (body, robot) = (stack.world.body(), stack.world.unit_robot());
        let listener = Listener::start_with_plans(&stack.world.options);
        let mut scenes = ScenePublisher::connect(&stack.world.options, "general")?;
        let (mut random, mut faults) = (seeded(SEED), Faults::default());
        let (mut index, mut scenes_used, mut given, mut goals) = (0, 0, 0, Vec::new());
        let mut not_begun = 0;
        while goals.len() < count {
            faults.rest(&mut stack, given)?;
            let scene = ReplanScene::around(&robot, &stack.commanded(), SEED, &mut index);
            let balls = scene.balls.iter().map(|ball| MovingBall {
                centre_m: ball.centre_m,
                radius_m: ball.radius_m,
                velocity_m_s: [0.0; 3],
            });
            scenes.publish(&balls.collect::<Vec<_>>(), LONG)?;
            scenes.confirm(PATIENCE)?;
            let changes = change_goals(&mut stack, &scene, &robot, &mut random)?;
            faults.rest(&mut stack, given)?;
            sleep(Duration::from_millis(50));
            let heard = listener.take();
            not_begun += heard
                .motions
                .iter()
                .filter(|it| it.leaves.is_some() && first_followed(&heard.cycles, it.id).is_none())
                .count();
            let in_motion = changes
                .iter()
                .filter(|change| found_in_motion(change, &heard));
            goals.extend(in_motion.map(|change| followed(change, &heard, &body)));
            given += changes.len();
            scenes_used += 1;
            println!("  {} of {count} goals", goals.len());
        }
        let population = format!(
            "{} of {given} changes found the robot in motion, by the cycle at that time, the others are left out; tips of configurations with room, \
             0.15 to 0.9 s after each other; {scenes_used} scenes in which the robot had room, of {index} drawn; four candidates, as the goal \
             that stays has them",
            goals.len()
        );
        report.shown(&line("what was asked for"), population);
        faults.show(report, &line);
        let made_again = made_again(&stack.process(Part::Daemon).log());
        report.check(
            &line("switches missed, of goals in motion and at rest"),
            format!(
                "{} of {given}: {made_again:?}; and {not_begun} published and not begun",
                made_again.len()
            ),
            "<= 2 %",
            50 * (made_again.len() + not_begun) <= given,
        );
        show(report, &goals, &stolen);
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
        let (given_at, given_ns) = (Instant::now(), mono_now_ns());
        goal.move_to(Goal::tip(tip_m), [0.0; 3])?;
        if let Some(last) = changes.last_mut() {
            last.until_ns = last.until_ns.min(given_ns);
        }
        changes.push(Change {
            given_at,
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

/// How soon a motion that ends at the goal is followed.
fn followed(change: &Change, heard: &Heard, body: &Body) -> Followed {
    let during = change.given_ns..change.until_ns;
    let firsts = heard.motions.iter().filter_map(|motion| {
        let tip_m = body.tip(&motion.knots.last()?.values[0]);
        let is_to_it = apart(tip_m, change.tip_m) <= TOLERANCE_M;
        let first_ns = first_followed(&heard.cycles, motion.id)?;
        (is_to_it && during.contains(&first_ns)).then_some((first_ns, motion))
    });
    let ms = |until_ns: i64| (until_ns - change.given_ns) as f64 * 1e-6;
    let first = firsts.min_by_key(|(first_ns, _)| *first_ns);
    let plan = first.and_then(|(_, motion)| {
        let mut plans = heard.plans.iter();
        plans.find(|plan| plan.report.plan_id == motion.plan_id)
    });
    let until_ns = first.map_or(change.until_ns, |(first_ns, _)| first_ns);
    let others = heard.plans.iter().filter(|plan| {
        let is_other = first.is_none_or(|(_, motion)| motion.plan_id != plan.report.plan_id);
        is_other && (change.given_ns..until_ns).contains(&plan.stamp_mono_ns)
    });
    Followed {
        given_at: change.given_at,
        others: others.map(said_of).collect(),
        took_ms: first.map_or(f64::INFINITY, |(first_ns, _)| ms(first_ns)),
        lead_ms: first.map_or(f64::INFINITY, |(_, motion)| ms(motion.begin_mono_ns)),
        stages_ns: plan.map(|plan| plan.report.stages_ns),
    }
}

/// Outcome and reason of a plan.
fn said_of(plan: &PlanRecord) -> String {
    let outcome = Outcome::try_from(plan.report.outcome);
    let outcome = outcome.map_or("unknown", Outcome::text);
    format!("{outcome}: {}", plan.report.reason.text())
}

fn line(what: &str) -> String {
    format!("goals, latency: goal that is changed in motion: {what}")
}

fn show(report: &mut Report, goals: &[Followed], stolen: &StolenTimes) {
    let never = goals.iter().filter(|goal| goal.took_ms.is_infinite());
    report.check(
        &line("followed by no motion to it before the next one is given"),
        format!("{} of {}", never.clone().count(), goals.len()),
        "<= 2 %",
        50 * never.count() <= goals.len(),
    );
    for (name, of) in [
        (
            "lead, from the goal to the switch",
            (|it| it.lead_ms) as fn(&Followed) -> f64,
        ),
        ("goal to first set-point, all windows", |it| it.took_ms),
    ] {
        let times_ms: Vec<f64> = goals.iter().map(of).collect();
        let what = format!("time until or of: {name}");
        report.shown(&line(&what), quantiles_text(&times_ms));
    }
    show_stages(report, goals);
    let took_ms: Vec<(Instant, f64)> = goals.iter().map(|it| (it.given_at, it.took_ms)).collect();
    show_windows(report, &line, &took_ms, stolen);
}

/// Shows the stages of the plans that were followed, of all and of the slowest.
fn show_stages(report: &mut Report, goals: &[Followed]) {
    let mut of_stages: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (name, took_ms) in goals
        .iter()
        .filter_map(|it| it.stages_ns.as_ref())
        .flat_map(stages_ms)
    {
        of_stages.entry(name).or_default().push(took_ms);
    }
    for (name, times_ms) in of_stages {
        let what = format!("time of: {name}, of {} plans", times_ms.len());
        report.shown(&line(&what), quantiles_text(&times_ms));
    }
    let each = goals.iter().map(|goal| {
        let stages = goal.stages_ns.as_ref().map(stages_text);
        let stages = stages.unwrap_or_else(|| "no record".to_owned());
        let words = format!("{stages}; other plans meanwhile: {:?}", goal.others);
        (goal.took_ms, goal.lead_ms, words)
    });
    show_slowest(report, &line, each.collect());
}
