//! The paper's three experiments: consecutive planning, two solutions of one target, avoiding an obstacle; and a fourth one: following
//! a target that moves while a ball crosses its way.

use super::followed::Followed;
use super::motion::{ALLOWED_ERROR, Execution, Order, Proposal, Report, Task};
use super::obstacles::Obstacles;
use super::recording::Recording;
use super::session::{MotionOrder, Session};
use crate::foreign_orders::{ForeignOrders, Overruled};
use crate::output_files::write_whole;
use anyhow::{Context, bail};
use client::{Client, ControllerView, ResultView};
use collision::{Ball, Scene};
use pcc_model::{Configuration, Point, Robot, SECTIONS};
use serde_json::json;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, Outcome};
use shared_types::ipc::IpcOptions;
use shared_types::message::MovingBall;
use shared_types::valid::Goal;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Tip targets in section lengths (the paper, "Real-World Evaluation").
const CONSECUTIVE: [[f64; 3]; 2] = [[0.0, -1.55, 2.25], [1.5, 0.0, 2.4]];
const MULTI_SOLUTION: [f64; 3] = [1.55, -0.07, 2.33];
const AVOIDANCE: [[f64; 3]; 2] = [[-1.45, 0.0, 2.25], [1.35, 0.0, 2.45]];
/// The ball that appears in the third experiment: centre and radius in section lengths.
pub(crate) const BALL: ([f64; 3], f64) = ([0.0, 0.0, 1.5], 0.4);
/// Distance between goal configurations that count as two solutions, rad.
const DISTINCT_RAD: f64 = 0.5;
/// Distance of the backbone from the later ball's surface that the chosen goal configuration must keep, section lengths.
const KEPT_CLEAR: f64 = 0.3;
/// How often a motion is tried: a machine that stalls for more than the robot's 20 ms makes the controller stop it.
const ATTEMPTS: usize = 4;
/// Faults that a stalled machine causes: they are reset, and the motion is tried again. Every other fault is the operator's to reset.
const STALL_FAULTS: [LoopFault; 4] = [
    LoopFault::RobotLost,
    LoopFault::RobotRampedToRest,
    LoopFault::TooLate,
    LoopFault::GuardHeldUp,
];

/// A demonstration under way.
pub(super) struct Mission<'a> {
    session: Session<'a>,
    obstacles: Obstacles,
    recording: Recording,
    length: f64,
    reports: Vec<Report>,
    interrupted: Vec<u32>,
    orders: Vec<Order>,
    impossible: Option<String>,
    followed: Option<Followed>,
    options: IpcOptions,
}

impl<'a> Mission<'a> {
    pub(super) fn begin(robot: &'a Robot, options: &IpcOptions, seed: u64) -> anyhow::Result<Self> {
        let foreign_orders = ForeignOrders::since(mono_now_ns());
        let length = robot
            .equal_section_length()
            .context("the three sections must be equally long")?;
        let mut client = Client::connect(options)?;
        client.state_robot(robot.hash());
        client.wait_for_daemon(Duration::from_secs(20))?;
        let mut mission = Self {
            session: Session {
                robot,
                client,
                controller: ControllerView::connect(options)?,
                results: ResultView::connect(options)?,
                interrupted: termination_flag()?,
                seed,
                foreign_orders,
                last_id: None,
                speed_order: None,
            },
            obstacles: Obstacles::connect(options)?,
            recording: Recording::begin(options),
            length,
            reports: Vec::new(),
            interrupted: Vec::new(),
            orders: Vec::new(),
            impossible: None,
            followed: None,
            options: options.clone(),
        };
        mission.show(&[])?;
        mission.session.begin()?;
        Ok(mission)
    }

    pub(super) fn carry_out(&mut self) -> anyhow::Result<()> {
        say!("experiment 1: two targets, one after the other");
        self.home(1)?;
        for (name, tip) in ["first target", "second target"]
            .into_iter()
            .zip(CONSECUTIVE)
        {
            self.go(1, name, tip, &[], |_| Ok(0))?;
        }
        say!("experiment 2: two solutions of one target");
        self.home(2)?;
        self.go(2, "first solution", MULTI_SOLUTION, &[], |_| Ok(0))?;
        let first = self.last_end()?;
        self.home(2)?;
        self.go(2, "second solution", MULTI_SOLUTION, &[], |all| {
            distinct_from(&first, all)
        })?;
        say!(
            "  terminal shapes {:.3} rad apart",
            (self.last_end()? - first).norm()
        );
        say!("orders on the way");
        self.give_orders()?;
        say!("experiment 3: a ball appears");
        self.home(3)?;
        self.avoid()?;
        say!("experiment 4: a target that moves, and a ball that crosses its way");
        self.follow_target()?;
        let missed = self.recording.end()?;
        say!(
            "{} motions, {} stopped on the way, {missed} cycles missed by the recorder",
            self.reports.len(),
            self.interrupted.len()
        );
        self.check_tip_errors()
    }

    /// Removes the demonstration's obstacles and signs its source of scenes off.
    pub(super) fn take_leave(&self) -> anyhow::Result<()> {
        Ok(self.obstacles.take_leave()?)
    }

    /// Halves and restores the speed during one motion, and stops the next.
    fn give_orders(&mut self) -> anyhow::Result<()> {
        let slower = [
            (0.3, MotionOrder::HalveSpeed),
            (0.6, MotionOrder::RestoreSpeed),
        ];
        self.perform_with_orders(
            "slower, and faster again",
            self.tip(CONSECUTIVE[0]),
            &slower,
        )?;
        let home = Goal::Configuration([0.0; 6]);
        self.perform_with_orders("stopped half-way", home, &[(0.5, MotionOrder::Stop)])
    }

    fn perform_with_orders(
        &mut self,
        name: &str,
        goal: Goal,
        orders: &[(f64, MotionOrder)],
    ) -> anyhow::Result<()> {
        let task = Task {
            experiment: 2,
            name,
            goal,
            balls: &[],
        };
        let obeyed = self
            .session
            .perform_with_orders(&task, orders)
            .context(name.to_owned())?;
        say!(
            "  {name}: {} of {} orders obeyed",
            obeyed.len(),
            orders.len()
        );
        self.orders.extend(obeyed);
        Ok(())
    }

    fn avoid(&mut self) -> anyhow::Result<()> {
        let ball = Ball {
            centre: self.point(BALL.0),
            radius: BALL.1 * self.length,
        };
        self.ask_the_impossible(ball)?;
        let (robot, kept) = (self.session.robot, KEPT_CLEAR * self.length);
        let later = Scene::new(vec![ball])?;
        self.go(3, "before the ball", AVOIDANCE[0], &[], |all| {
            clearest(robot, &later, kept, all)
        })?;
        self.show(&[ball])?;
        self.go(3, "around the ball", AVOIDANCE[1], &[ball], |_| Ok(0))
    }

    /// Plans the third experiment as printed in the paper, with the ball there from the start, where it touches the straight robot.
    fn ask_the_impossible(&mut self, ball: Ball) -> anyhow::Result<()> {
        let task = Task {
            experiment: 3,
            name: "as printed",
            goal: self.tip(AVOIDANCE[0]),
            balls: &[ball],
        };
        let answer = self.session.plan(Configuration::zeros(), &task)?;
        let report = answer.report();
        say!(
            "  with the ball there from the start: {} ({})",
            report.outcome,
            report.reason
        );
        self.impossible = Some(report.outcome.text().into());
        if report.outcome != Outcome::StartInCollision {
            bail!(
                "a start inside the ball was answered with {}",
                report.outcome
            );
        }
        Ok(())
    }

    fn home(&mut self, experiment: u32) -> anyhow::Result<()> {
        let held = self.session.hold()?.values.commanded_configuration_rad;
        if Configuration::from(held).norm() < 1e-9 {
            return Ok(());
        }
        let task = Task {
            experiment,
            name: "home",
            goal: Goal::Configuration([0.0; 6]),
            balls: &[],
        };
        self.perform(&task, |_| Ok(0))
    }

    fn go(
        &mut self,
        experiment: u32,
        name: &str,
        tip: [f64; 3],
        balls: &[Ball],
        choose: impl Fn(&[Proposal]) -> anyhow::Result<usize>,
    ) -> anyhow::Result<()> {
        let task = Task {
            experiment,
            name,
            goal: self.tip(tip),
            balls,
        };
        self.perform(&task, choose)
    }

    fn perform(
        &mut self,
        task: &Task,
        choose: impl Fn(&[Proposal]) -> anyhow::Result<usize>,
    ) -> anyhow::Result<()> {
        for _ in 0..ATTEMPTS {
            let context = || format!("{}, {}", task.experiment, task.name);
            let execution = self
                .session
                .perform(task, &self.recording, &choose)
                .with_context(context)?;
            match execution {
                Execution::Done(report) => {
                    print_report(&report);
                    self.reports.push(report);
                    return Ok(());
                }
                Execution::Stopped {
                    trajectory_id,
                    fault,
                } => {
                    if !STALL_FAULTS.contains(&fault) {
                        let (experiment, name) = (task.experiment, &task.name);
                        bail!("{experiment}, {name}: {}", end_of_demonstration(fault));
                    }
                    say!(
                        "  {}: the controller stopped on the way ({fault}); reset, and asked again",
                        task.name
                    );
                    self.interrupted.push(trajectory_id);
                    self.session.reset()?;
                }
            }
        }
        bail!(
            "{}, {}: stopped on the way {ATTEMPTS} times",
            task.experiment,
            task.name
        )
    }

    /// Stops the robot where the demonstration has failed, and restores the speed that it found. Where somebody else has given an
    /// order, only the demonstration's own motion is stopped.
    pub(super) fn end(&mut self, outcome: &anyhow::Result<()>) {
        match outcome {
            Err(error) if error.is::<Overruled>() => self.session.stop_own(),
            Err(_) => self.session.stop(),
            Ok(()) => {}
        }
        self.session.restore_speed();
    }

    fn point(&self, section_lengths: [f64; 3]) -> Point {
        Point::from(section_lengths) * self.length
    }

    fn tip(&self, section_lengths: [f64; 3]) -> Goal {
        Goal::tip(self.point(section_lengths).into())
    }

    fn last_end(&self) -> anyhow::Result<Configuration> {
        let last = self.reports.last().context("nothing was executed yet")?;
        Ok(Configuration::from(last.end_configuration_rad))
    }

    fn show(&mut self, balls: &[Ball]) -> anyhow::Result<()> {
        let moving = |b: &Ball| MovingBall {
            centre_m: b.centre.into(),
            radius_m: b.radius,
            velocity_m_s: [0.0; 3],
        };
        let balls: Vec<MovingBall> = balls.iter().map(moving).collect();
        self.obstacles.show(&balls)?;
        self.recording.note_scene(mono_now_ns(), &balls);
        Ok(())
    }

    /// Checks that every motion ended at its goal.
    fn check_tip_errors(&self) -> anyhow::Result<()> {
        for report in &self.reports {
            let errors = errors(report).map(|e| e / self.length);
            if errors
                .iter()
                .zip(ALLOWED_ERROR)
                .any(|(error, allowed)| *error > allowed)
            {
                bail!(
                    "{}, {}: tip errors {errors:?} section lengths, {ALLOWED_ERROR:?} are allowed",
                    report.experiment,
                    report.name
                );
            }
        }
        say!(
            "every tip within {} (commanded) and {} (measured) section lengths",
            ALLOWED_ERROR[0],
            ALLOWED_ERROR[1]
        );
        Ok(())
    }

    /// Writes `recording.npz`, `scene.json` and `demo.json`.
    pub(super) fn save(&mut self, folder: &Path) -> anyhow::Result<()> {
        self.recording.end()?;
        self.recording.save(folder, self.session.robot)?;
        let summary = json!({
            "motions": self.reports,
            "interrupted": self.interrupted,
            "orders": self.orders,
            "impossible_outcome": self.impossible,
            "followed": self.followed,
        });
        write_whole(
            &folder.join("demo.json"),
            &serde_json::to_string_pretty(&summary)?,
        )
    }
}

/// A flag that SIGINT and SIGTERM set; the second of them ends the process at once.
fn termination_flag() -> anyhow::Result<Arc<AtomicBool>> {
    let interrupted = Arc::<AtomicBool>::default();
    for signal in [SIGINT, SIGTERM] {
        flag::register_conditional_shutdown(signal, 1, Arc::clone(&interrupted))?;
        flag::register(signal, Arc::clone(&interrupted))?;
    }
    Ok(interrupted)
}

/// The reason why the demonstration ends after a stop that no stall of the machine explains.
fn end_of_demonstration(fault: LoopFault) -> String {
    match fault {
        LoopFault::None => "the controller stopped on the way without a fault: the daemon ordered it, or was not heard for a while (both logs say so)".into(),
        fault => format!("the controller stopped on the way ({fault}); look at the robot, then `pcc reset`"),
    }
}

fn errors(report: &Report) -> [f64; 2] {
    let requested = Point::from(report.requested_tip_m);
    [report.reached_tip_m, report.measured_tip_m].map(|tip| (Point::from(tip) - requested).norm())
}

fn print_report(r: &Report) {
    let tip = |t: [f64; 3]| format!("({:.4}, {:.4}, {:.4})", t[0], t[1], t[2]);
    let clearance = r
        .minimum_clearance_m
        .map_or("no obstacle".to_owned(), |c| format!("clearance {c:.4} m"));
    let [commanded, measured] = errors(r);
    say!(
        "  {}: asked {} m, reached {} m",
        r.name,
        tip(r.requested_tip_m),
        tip(r.reached_tip_m)
    );
    say!(
        "    tip error {commanded:.1e} m commanded, {measured:.4} m measured; {:.2} s; {clearance}; largest step {:.1e} m; {} late cycles",
        r.duration_s,
        r.largest_setpoint_step_m,
        r.late_cycles
    );
}

fn distinct_from(first: &Configuration, all: &[Proposal]) -> anyhow::Result<usize> {
    all.iter()
        .position(|p| (p.end - first).norm() >= DISTINCT_RAD)
        .context("no second solution among the candidates")
}

fn clearest(robot: &Robot, later: &Scene, kept: f64, all: &[Proposal]) -> anyhow::Result<usize> {
    let clearance = |p: &Proposal| later.clearance(&robot.backbone(&p.end), &[0.0; SECTIONS]);
    let best = all
        .iter()
        .max_by(|a, b| clearance(a).total_cmp(&clearance(b)))
        .context("no candidate")?;
    if clearance(best) < kept {
        bail!("no goal configuration keeps {kept} m from where the ball will be");
    }
    Ok(best.index)
}

mod following;

#[cfg(test)]
mod tests;
