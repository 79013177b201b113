//! The paper's hardware experiments on the simulated robot, from a record: measured configurations beside commanded ones.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use super::processes::{self, Processes};
use super::solutions::component_name;
use crate::compare::drawing::{Axis, COLOURS, Camera, GREY, INK, Line, Lines, Scene3d, blend};
use crate::compare::figure_name::FigureName;
use crate::demo;
use crate::replay::Recording;
use crate::sampler::PlannerName;
use anyhow::{Context, ensure};
use collision::Ball;
use pcc_model::{Configuration, DOF, Point};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use std::f64::consts::PI;
use std::fs;
use std::thread::sleep;
use std::time::Duration;

/// Bodies of a motion.
pub(super) const SNAPSHOTS: usize = 5;
/// Samples of a run.
const SAMPLES: usize = 300;
/// What is shown before the first motion and after the last one, ns.
const BEFORE_NS: i64 = 300_000_000;
const AFTER_NS: i64 = 900_000_000;
/// Time for the recorder to listen.
const RECORDER_STARTS: Duration = Duration::from_secs(1);
const AZIMUTH: f64 = -0.36 * PI;
const ELEVATION: f64 = 0.1 * PI;

/// What was recorded of the demonstration's first three experiments.
#[derive(Deserialize, Serialize)]
pub(super) struct Hardware {
    consecutive: Run,
    solutions: [Run; 2],
    pub(super) obstacle: Run,
}

/// Motions one after the other.
#[derive(Deserialize, Serialize)]
pub(super) struct Run {
    /// Tips asked for, section lengths.
    targets: Vec<[f64; 3]>,
    /// Begin and end of each motion, s.
    motions_s: Vec<[f64; 2]>,
    samples: Vec<Sample>,
}

#[derive(Deserialize, Serialize)]
struct Sample {
    time_s: f64,
    commanded: [f64; DOF],
    measured: [f64; DOF],
}

/// The ball of the demonstration's third experiment.
pub(super) fn ball_that_appears() -> Ball {
    let (centre, radius) = demo::BALL;
    Ball {
        centre: centre.into(),
        radius,
    }
}

impl Hardware {
    /// Carries out the demonstration and records it, where it is not kept already.
    pub(super) fn read(bench: &Bench) -> anyhow::Result<Self> {
        let records = bench.planner(PlannerName::Default)?.records;
        let settings = json!({ "samples": SAMPLES, "processes": processes::identity()? });
        bench.keep("hardware", &records, &settings, || {
            let folder = bench.arguments.out.join("demo");
            if folder.exists() {
                fs::remove_dir_all(&folder)?;
            }
            let mut processes = Processes::start(bench.arguments, &folder)?;
            let (record, demo) = (folder.join("experiments.mcap"), folder.join("files"));
            let [record_text, demo_text, robot_text] = [&record, &demo, &bench.arguments.robot]
                .map(|it| it.to_str().context("a path that is no text"));
            let seed = bench.arguments.seed.to_string();
            processes.spawn_pcc(&["record", record_text?])?;
            sleep(RECORDER_STARTS);
            processes.pcc(&[
                "demo",
                "--record",
                demo_text?,
                "--robot",
                robot_text?,
                "--seed",
                &seed,
            ])?;
            processes.end_last()?;
            drop(processes);
            let told = fs::read_to_string(demo.join("demo.json"))?;
            Self::of(&Recording::read(&record)?, &serde_json::from_str(&told)?)
        })
    }

    fn of(recording: &Recording, told: &Value) -> anyhow::Result<Self> {
        let robot = recording.robots.first().context("no robot in the record")?;
        let length_m = robot.section_lengths_m[0];
        let run = |experiment: u32, names: &[&str]| {
            let motions = names
                .iter()
                .map(|name| Told::find(told, experiment, name, length_m));
            Run::of(
                &recording.cycles,
                &motions.collect::<anyhow::Result<Vec<_>>>()?,
            )
        };
        Ok(Self {
            consecutive: run(1, &["first target", "second target"])?,
            solutions: [run(2, &["first solution"])?, run(2, &["second solution"])?],
            obstacle: run(3, &["around the ball"])?,
        })
    }

    /// Two targets, one after the other.
    pub(super) fn consecutive(&self, bench: &Bench) -> anyhow::Result<Figure> {
        let run = &self.consecutive;
        let mut pictures = Vec::new();
        for (motion, name) in ["to the first target", "on to the second target"]
            .into_iter()
            .enumerate()
        {
            pictures.push(run.bodies_of(bench, &[], motion, name)?);
        }
        pictures[0].id = Some("consecutive-bodies");
        pictures.push(run.curves()?.with_id("consecutive-curves"));
        Ok(figure(
            FigureName::Consecutive,
            "Consecutive planning to two targets",
            "The robot moves from straight to the first target, waits, and moves to the second.",
            pictures,
        ))
    }

    /// Two motions to one target.
    pub(super) fn two_solutions(&self, bench: &Bench) -> anyhow::Result<Figure> {
        let mut pictures = Vec::new();
        let ids = [
            ("executed-solutions-bodies", "executed-solutions-curves"),
            ("executed-second-bodies", "executed-second-curves"),
        ];
        for (run, ((bodies, curves), name)) in self
            .solutions
            .iter()
            .zip(ids.into_iter().zip(["first solution", "second solution"]))
        {
            pictures.push(
                run.bodies_of(bench, &[], 0, name)?
                    .in_new_row()
                    .with_id(bodies),
            );
            let drawn = run.curves()?.with_id(curves);
            pictures.push(Picture {
                caption: format!("{name}: {}", drawn.caption),
                ..drawn
            });
        }
        Ok(figure(
            FigureName::ExecutedSolutions,
            "Two solutions of one target, executed",
            "Two of ten candidates of the same start and target.",
            pictures,
        ))
    }

    /// A motion around a ball.
    pub(super) fn obstacle(&self, bench: &Bench) -> anyhow::Result<Figure> {
        let ball = ball_that_appears();
        Ok(figure(
            FigureName::Obstacle,
            "Avoiding a ball, executed",
            "A ball of radius 0.4 L appears between two targets, and the robot goes around it.",
            vec![
                self.obstacle.bodies(bench, &[ball])?,
                self.obstacle.curves()?,
            ],
        ))
    }
}

fn figure(name: FigureName, title: &'static str, text: &str, pictures: Vec<Picture>) -> Figure {
    let caption = format!(
        "{text} Planned by <code>default</code>. Recorded from daemon, controller and simulated robot, whose motors lag and whose sensors are noisy: bodies as measured at {SNAPSHOTS} \
         instants from first (grey) to last (blue), and configurations as measured (colour) and commanded (thin, black). Vertical lines: a motion begins \
         or ends."
    );
    Figure {
        name,
        title,
        pictures,
        caption,
        made_by: None,
    }
}

/// A motion as `demo.json` tells it.
struct Told {
    id: u64,
    /// Section lengths.
    target: [f64; 3],
}

impl Told {
    fn find(told: &Value, experiment: u32, name: &str, length_m: f64) -> anyhow::Result<Self> {
        let motions = told["motions"].as_array().into_iter().flatten();
        let mut named = motions.filter(|it| it["experiment"] == experiment && it["name"] == name);
        let missing = || format!("demo.json has no motion {experiment}, {name}");
        let motion = named.next_back().with_context(missing)?;
        let id = motion["trajectory_id"].as_u64().with_context(missing)?;
        let metres: [f64; 3] = serde_json::from_value(motion["requested_tip_m"].clone())?;
        Ok(Self {
            id,
            target: metres.map(|it| it / length_m),
        })
    }
}

impl Run {
    fn of(cycles: &[Cycle], motions: &[Told]) -> anyhow::Result<Self> {
        let ends_ns = |told: &Told| {
            let executing = |cycle: &&Cycle| {
                u64::from(cycle.trajectory_id) == told.id
                    && cycle.state == LoopState::Executing.code()
            };
            let first = cycles.iter().find(executing);
            let last = cycles.iter().rfind(executing);
            let found = first
                .zip(last)
                .with_context(|| format!("motion {} is not in the record", told.id))?;
            anyhow::Ok([found.0.stamp_mono_ns, found.1.stamp_mono_ns])
        };
        let ends = motions
            .iter()
            .map(ends_ns)
            .collect::<anyhow::Result<Vec<_>>>()?;
        let (first, last) = ends.first().zip(ends.last()).context("no motion")?;
        let (from_ns, until_ns) = (first[0] - BEFORE_NS, last[1] + AFTER_NS);
        let seconds = |ns: i64| shared_types::clock::seconds(ns - from_ns);
        let shown: Vec<&Cycle> = cycles
            .iter()
            .filter(|cycle| (from_ns..=until_ns).contains(&cycle.stamp_mono_ns))
            .collect();
        ensure!(!shown.is_empty(), "no cycle in the record");
        let sample = |cycle: &&Cycle| Sample {
            time_s: seconds(cycle.stamp_mono_ns),
            commanded: cycle.commanded_configuration_rad,
            measured: cycle.measured_configuration_rad,
        };
        Ok(Self {
            targets: motions.iter().map(|it| it.target).collect(),
            motions_s: ends.iter().map(|it| it.map(seconds)).collect(),
            samples: shown
                .iter()
                .step_by(shown.len().div_ceil(SAMPLES))
                .map(sample)
                .collect(),
        })
    }

    /// Where the first motion begins.
    pub(super) fn start(&self) -> Configuration {
        let start = self
            .samples
            .first()
            .map(|it| Configuration::from(it.commanded));
        start.unwrap_or_default()
    }

    /// What the last motion is to reach, section lengths.
    pub(super) fn target(&self) -> Point {
        self.targets
            .last()
            .map_or_else(Point::zeros, |it| Point::from(*it))
    }

    /// The first motion's bodies.
    pub(super) fn bodies(&self, bench: &Bench, balls: &[Ball]) -> anyhow::Result<Picture> {
        self.bodies_of(bench, balls, 0, "the motion that was executed")
    }

    fn bodies_of(
        &self,
        bench: &Bench,
        balls: &[Ball],
        motion: usize,
        name: &str,
    ) -> anyhow::Result<Picture> {
        let [begin_s, end_s] = self.motions_s[motion];
        let during: Vec<Configuration> = self
            .samples
            .iter()
            .filter(|it| (begin_s..=end_s + 0.2).contains(&it.time_s))
            .map(|it| Configuration::from(it.measured))
            .collect();
        ensure!(!during.is_empty(), "no sample of a motion");
        let tips = bench.robot.tips(&during);
        let room = tips.iter().map(|tip| (*tip, 0.25));
        let balls_room = balls.iter().map(|ball| (ball.centre, ball.radius));
        let camera = Camera::fitting(AZIMUTH, ELEVATION, room.chain(balls_room));
        let mut scene = Scene3d::new(&bench.robot, camera);
        balls.iter().for_each(|ball| scene.ball(ball));
        scene.path(&tips, COLOURS[1], 4);
        for index in 0..SNAPSHOTS {
            let share = index as f64 / (SNAPSHOTS - 1) as f64;
            let at = (share * (during.len() - 1) as f64).round() as usize;
            scene.body(&during[at], blend(GREY, COLOURS[0], share));
        }
        scene.ends(&tips[0], &Point::from(self.targets[motion]));
        let text = format!("{name}, {:.1} s", end_s - begin_s);
        Ok(Picture::new(scene.svg()?, text))
    }

    fn curves(&self) -> anyhow::Result<Picture> {
        let line = |component: usize, of: fn(&Sample) -> &[f64; DOF]| -> Vec<(f64, f64)> {
            self.samples
                .iter()
                .map(|it| (it.time_s, of(it)[component]))
                .collect()
        };
        let measured = (0..DOF).map(|component| Line {
            width: 4,
            ..Line::curve(
                &component_name(component),
                line(component, |it| &it.measured),
                COLOURS[component],
            )
        });
        let commanded = (0..DOF).map(|component| Line {
            width: 1,
            ..Line::curve("", line(component, |it| &it.commanded), INK)
        });
        let chart = Lines {
            x: Axis::linear("time, s"),
            y: Axis::linear("configuration, rad"),
            lines: measured.chain(commanded).collect(),
            marks: self.motions_s.iter().flatten().copied().collect(),
        };
        Ok(Picture::new(
            chart.svg()?,
            "measured (colour) and commanded (black)",
        ))
    }
}
