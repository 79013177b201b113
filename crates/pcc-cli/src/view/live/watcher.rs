//! What is told to pages: what the controller commands and measures, the live scene, the motions, and who is there.

use super::hub::{Hub, Kept};
use super::sources::Sources;
use crate::view::page::{Body, Curves, Motion, View};
use crate::view::recorded::{Clock, components, foreseen, numbered, published};
use crate::view::samples::Samples;
use crate::view::surroundings::{BallTrack, Surroundings};
use anyhow::anyhow;
use client::{ControllerView, RobotView};
use iceoryx2::prelude::ZeroCopySend;
use serde::Serialize;
use shared_types::capacity::TENDONS;
use shared_types::clock::{STATE_LIFETIME_NS, mono_now_ns, wall_now_ns};
use shared_types::ipc::{self, IpcNode, IpcOptions, Subscriber};
use shared_types::message::{RobotDescription, SceneMessage, TrajectoryMessage};
use shared_types::valid::{ControllerState, RobotState, Scene, stamp_refusal};
use std::fmt::Debug;
use std::path::Path;

/// Age of the daemon's description of its robot, which comes each second, beyond which it is not there, ns.
const DESCRIPTION_LIFETIME_NS: i64 = 2_500_000_000;
/// Time between two statuses, ns.
const STATUS_PERIOD_NS: i64 = 500_000_000;

/// Ports that only watch, and what came of them.
pub(super) struct Watcher {
    controller: ControllerView,
    robot: RobotView,
    descriptions: Subscriber<RobotDescription>,
    trajectories: Subscriber<TrajectoryMessage>,
    scenes: Subscriber<SceneMessage>,
    node: IpcNode,
    clock: Clock,
    description: Option<RobotDescription>,
    around: Surroundings,
    sources: Sources,
    last_frame_ns: i64,
    last_status_ns: i64,
    absent: Vec<&'static str>,
}

/// What is commanded and measured at a time.
#[derive(Serialize)]
struct Frame {
    time_s: f64,
    /// Commanded, measured.
    configurations_rad: [[f64; 6]; 2],
    /// NaN without obstacles.
    clearances: [f64; 2],
    /// A list for each set of curves of the view.
    curves: [Vec<f64>; 4],
}

/// The balls of a source, in place of those that it told of before.
#[derive(Serialize)]
struct SourceBalls<'a> {
    source: &'a str,
    time_s: f64,
    balls: &'a [BallTrack],
}

#[derive(Serialize)]
struct NewMotion {
    begins_s: f64,
    motion: Motion,
}

#[derive(Serialize)]
struct Status {
    lines: Vec<String>,
}

impl Watcher {
    /// Joins the services; no process need run yet.
    pub(super) fn join(options: &IpcOptions, scene: Option<&Path>) -> anyhow::Result<Self> {
        let node = IpcNode::create(options, "pcc-view")?;
        Ok(Self {
            controller: ControllerView::watch(options)?,
            robot: RobotView::watch(options)?,
            descriptions: ipc::observer_subscriber(&node, &ipc::robot_description_service(&node)?)?,
            trajectories: ipc::observer_subscriber(&node, &ipc::trajectory_service(&node)?)?,
            scenes: ipc::observer_subscriber(&node, &ipc::scene_service(&node)?)?,
            node,
            clock: Clock(mono_now_ns()),
            description: None,
            around: Surroundings::of_file(scene, 1.0)?,
            sources: Sources::default(),
            last_frame_ns: 0,
            last_status_ns: 0,
            absent: Vec::new(),
        })
    }

    /// Tells what is new.
    pub(super) fn tell(&mut self, hub: &Hub) -> anyhow::Result<()> {
        let now_ns = mono_now_ns();
        let controller = self.controller.latest_state()?;
        let robot = self.robot.latest()?;
        self.tell_robot(hub)?;
        self.tell_scenes(hub)?;
        self.tell_motions(hub)?;
        self.tell_frame(hub, controller.as_ref(), robot.as_ref())?;
        if now_ns - self.last_status_ns >= STATUS_PERIOD_NS {
            self.last_status_ns = now_ns;
            self.node.clean_dead_nodes();
            self.tell_status(hub, now_ns, controller.as_ref(), robot.as_ref())?;
        }
        Ok(())
    }

    fn tell_robot(&mut self, hub: &Hub) -> anyhow::Result<()> {
        for description in received(&self.descriptions)? {
            let before = self.description.replace(description);
            if before.is_none_or(|before| before.robot_hash != description.robot_hash) {
                hub.forget(&Kept::Motion);
                hub.keep(Kept::View, &self.view(&description))?;
            }
        }
        Ok(())
    }

    /// A view to which pages add what they are told.
    fn view(&self, description: &RobotDescription) -> View {
        let body = body(description);
        let motion = |name: &str| Motion::new(name.to_owned(), &[], &body, &self.around);
        let tendons = numbered(tendon_count(description));
        let curves = |name, unit, labels: &[String]| Curves {
            name,
            unit,
            labels: labels.to_vec(),
            time_s: Samples::default(),
            values: labels.iter().map(|_| Samples::default()).collect(),
        };
        let room = body.tube_radii.iter().copied().fold(0.0, f64::max);
        View {
            title: "Live".to_owned(),
            unit: "m",
            robot: body,
            duration_s: 0.0,
            clearance_range: [0.0, room],
            balls: self.around.balls_of_file(),
            solids: self.around.solids(),
            motions: vec![
                Motion {
                    is_selected: true,
                    ..motion("commanded")
                },
                motion("measured"),
            ],
            curves: vec![
                curves("Set-points of the tendons", "m", &tendons),
                curves("Measured tendons", "m", &tendons),
                curves("Commanded configuration", "rad", &components()),
                curves("Measured configuration", "rad", &components()),
            ],
            marks: Vec::new(),
        }
    }

    fn tell_scenes(&mut self, hub: &Hub) -> anyhow::Result<()> {
        for message in received(&self.scenes)? {
            if let Some(source) = source_of(&message) {
                self.tell_scene(hub, source, &message)?;
            }
        }
        for source in self.sources.forget(self.clock.seconds(mono_now_ns())) {
            hub.forget(&Kept::Scene(source));
        }
        self.around.tracks = self.sources.tracks();
        Ok(())
    }

    fn tell_scene(
        &mut self,
        hub: &Hub,
        source: String,
        scene: &SceneMessage,
    ) -> anyhow::Result<()> {
        let time_s = self.clock.seconds(scene.stamp_mono_ns);
        if self.sources.is_outdated(&source, time_s) {
            return Ok(());
        }
        let balls = foreseen(scene, self.clock);
        let message = SourceBalls {
            source: &source,
            time_s,
            balls: &balls,
        };
        hub.keep(Kept::Scene(source.clone()), &message)?;
        self.sources.replace(source, &balls, time_s);
        Ok(())
    }

    fn tell_motions(&mut self, hub: &Hub) -> anyhow::Result<()> {
        for message in received(&self.trajectories)? {
            let Some(description) = &self.description else {
                continue;
            };
            let motion = published(&message, self.clock, &body(description), &self.around);
            let begins_s = self.clock.seconds(message.begin_mono_ns);
            match motion {
                Ok(motion) => hub.keep(Kept::Motion, &NewMotion { begins_s, motion })?,
                Err(error) => say!("a published motion is not shown: {error:#}"),
            }
        }
        Ok(())
    }

    fn tell_frame(
        &mut self,
        hub: &Hub,
        controller: Option<&ControllerState>,
        robot: Option<&RobotState>,
    ) -> anyhow::Result<()> {
        let Some((description, state)) = self.description.as_ref().zip(controller) else {
            return Ok(());
        };
        let state = &state.values;
        if state.stamp_mono_ns <= self.last_frame_ns {
            return Ok(());
        }
        self.last_frame_ns = state.stamp_mono_ns;
        let time_s = self.clock.seconds(state.stamp_mono_ns);
        let body = body(description);
        let configurations_rad = [
            state.commanded_configuration_rad,
            state.measured_configuration_rad,
        ];
        let clearances = configurations_rad
            .map(|configuration| body.clearance(&configuration.into(), &self.around, time_s));
        let tendons = tendon_count(description);
        let measured_m = robot.map_or([f64::NAN; TENDONS], |it| it.values.measured_tendon_m);
        let of_tendons = |lengths_m: [f64; TENDONS]| lengths_m[..tendons].to_vec();
        let frame = Frame {
            time_s,
            configurations_rad,
            clearances,
            curves: [
                of_tendons(state.commanded_tendon_m),
                of_tendons(measured_m),
                state.commanded_configuration_rad.to_vec(),
                state.measured_configuration_rad.to_vec(),
            ],
        };
        hub.tell("frame", &frame)
    }

    fn tell_status(
        &mut self,
        hub: &Hub,
        now_ns: i64,
        controller: Option<&ControllerState>,
        robot: Option<&RobotState>,
    ) -> anyhow::Result<()> {
        let is_fresh = |stamp_ns: i64| now_ns - stamp_ns <= STATE_LIFETIME_NS;
        let controller = controller.filter(|state| is_fresh(state.values.stamp_mono_ns));
        let robot = robot.filter(|state| is_fresh(state.values.stamp_mono_ns));
        let daemon = self.description.as_ref();
        let daemon = daemon.filter(|it| now_ns - it.stamp_mono_ns <= DESCRIPTION_LIFETIME_NS);
        let lines = [
            ("planner-daemon", daemon.map(|_| "there".to_owned())),
            ("controller", controller.map(|it| it.state.to_string())),
            ("robot", robot.map(|it| it.state.to_string())),
        ];
        let absent: Vec<_> = lines.iter().filter(|it| it.1.is_none()).collect();
        let absent: Vec<_> = absent.iter().map(|it| it.0).collect();
        if absent != self.absent {
            match absent.is_empty() {
                true => say!("planner-daemon, controller and robot are there"),
                false => say!("waiting for {}", absent.join(", ")),
            }
            self.absent = absent;
        }
        let line = |(name, state): (&str, Option<String>)| {
            format!("{name}: {}", state.as_deref().unwrap_or("not there"))
        };
        let lines = lines.map(line).to_vec();
        hub.keep(Kept::Status, &Status { lines })
    }
}

fn tendon_count(description: &RobotDescription) -> usize {
    (description.tendon_count as usize).min(TENDONS)
}

/// The name of a scene's source; none of a scene that the daemon refuses for what it holds, or for its stamp.
fn source_of(message: &SceneMessage) -> Option<String> {
    let scene = Scene::try_from(message).ok()?;
    let (stamp_ns, lifetime_ns) = (scene.stamp_mono_ns, scene.lifetime_ns);
    let refusal = stamp_refusal(stamp_ns, lifetime_ns, mono_now_ns(), wall_now_ns());
    refusal.is_none().then(|| scene.source.to_string())
}

fn body(description: &RobotDescription) -> Body {
    Body {
        section_lengths: description.section_lengths_m,
        tube_radii: description.tube_radii_m,
    }
}

/// The messages that have come, copied: shared memory can change under a reader.
fn received<T: Debug + ZeroCopySend + Copy>(subscriber: &Subscriber<T>) -> anyhow::Result<Vec<T>> {
    let mut messages = Vec::new();
    loop {
        let sample = subscriber.receive();
        match sample.map_err(|error| anyhow!("cannot receive: {error:?}"))? {
            Some(sample) => messages.push(*sample),
            None => return Ok(messages),
        }
    }
}
