//! The scene as Foxglove and Rerun show it: the robot's backbone as it is commanded, and the obstacles of the live scene.

use std::collections::BTreeMap;

use foxglove::Encode;
use foxglove::messages::{
    Color, LinePrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive,
    Timestamp, Vector3, line_primitive,
};
use pcc_model::{Backbone, Configuration, SECTIONS};
use shared_types::capacity::SOURCE_NAME_BYTES;
use shared_types::clock::{mono_now_ns, seconds};
use shared_types::message::{ControllerState, RobotDescription, SceneMessage};

use super::file::{Channel, McapFile, RealTime};

/// The frame of all points: the robot's base.
const FRAME: &str = "base";
/// Points of a section's line.
const POINTS: usize = 16;
const ROBOT: Color = Color {
    r: 0.15,
    g: 0.45,
    b: 0.85,
    a: 1.0,
};
const OBSTACLE: Color = Color {
    r: 0.85,
    g: 0.3,
    b: 0.2,
    a: 0.6,
};

/// What is shown.
pub(super) struct Picture {
    channel: Channel,
    robot: Option<RobotDescription>,
    commanded_rad: Option<[f64; 6]>,
    /// The newest scene of each source, by its name.
    scenes: BTreeMap<[u8; SOURCE_NAME_BYTES], SceneMessage>,
}

impl Picture {
    pub(super) fn new(file: &mut McapFile) -> anyhow::Result<Self> {
        Ok(Self {
            channel: file.foxglove::<SceneUpdate>("/picture")?,
            robot: None,
            commanded_rad: None,
            scenes: BTreeMap::new(),
        })
    }

    pub(super) fn see_robot(&mut self, robot: &RobotDescription) {
        self.robot = Some(*robot);
    }

    pub(super) fn see_controller(&mut self, state: &ControllerState) {
        self.commanded_rad = Some(state.commanded_configuration_rad);
    }

    pub(super) fn see_scene(&mut self, scene: &SceneMessage) {
        self.scenes.insert(scene.source, *scene);
    }

    /// Writes what is known of now.
    pub(super) fn write(&mut self, file: &mut McapFile) -> anyhow::Result<()> {
        let now_ns = mono_now_ns();
        self.scenes.retain(|_, scene| is_alive(scene, now_ns));
        let robot = self.robot.zip(self.commanded_rad);
        let robot = robot.map(|(robot, commanded_rad)| body(&robot, &commanded_rad));
        let update = SceneUpdate {
            deletions: Vec::new(),
            entities: robot.into_iter().chain([self.obstacles(now_ns)]).collect(),
        };
        let mut bytes = Vec::new();
        update.encode(&mut bytes)?;
        file.write(self.channel, RealTime::now(), &bytes)
    }

    /// Every ball where it is now.
    fn obstacles(&self, now_ns: i64) -> SceneEntity {
        let mut spheres = Vec::new();
        for scene in self.scenes.values() {
            let since_s = seconds(now_ns.saturating_sub(scene.stamp_mono_ns));
            let count = (scene.ball_count as usize).min(scene.balls.len());
            for ball in &scene.balls[..count] {
                let at = |axis: usize| ball.centre_m[axis] + since_s * ball.velocity_m_s[axis];
                let size = 2.0 * ball.radius_m;
                spheres.push(SpherePrimitive {
                    pose: Some(pose([at(0), at(1), at(2)])),
                    size: Some(Vector3 {
                        x: size,
                        y: size,
                        z: size,
                    }),
                    color: Some(OBSTACLE),
                });
            }
        }
        SceneEntity {
            spheres,
            ..entity("obstacles")
        }
    }
}

fn is_alive(scene: &SceneMessage, now_ns: i64) -> bool {
    scene.takes_leave == 0 && now_ns.saturating_sub(scene.stamp_mono_ns) <= scene.lifetime_ns
}

/// The backbone, as thick as the body.
fn body(robot: &RobotDescription, commanded_rad: &[f64; 6]) -> SceneEntity {
    let shape = Backbone::new(
        &robot.section_lengths_m,
        &Configuration::from(*commanded_rad),
    );
    let line = |section: usize| {
        let point = |index: usize| {
            let point = shape.point(section, index as f64 / (POINTS - 1) as f64);
            Point3 {
                x: point.x,
                y: point.y,
                z: point.z,
            }
        };
        LinePrimitive {
            r#type: line_primitive::Type::LineStrip.into(),
            pose: Some(pose([0.0; 3])),
            thickness: 2.0 * robot.tube_radii_m[section],
            scale_invariant: false,
            points: (0..POINTS).map(point).collect(),
            color: Some(ROBOT),
            colors: Vec::new(),
            indices: Vec::new(),
        }
    };
    SceneEntity {
        lines: (0..SECTIONS).map(line).collect(),
        ..entity("robot")
    }
}

fn pose([x, y, z]: [f64; 3]) -> Pose {
    Pose {
        position: Some(Vector3 { x, y, z }),
        orientation: Some(Quaternion {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }),
    }
}

/// An entity of now, which takes the place of the one with its name.
fn entity(id: &str) -> SceneEntity {
    let (seconds, rest) = RealTime::now().seconds_and_rest();
    SceneEntity {
        timestamp: Some(Timestamp::new(seconds, rest)),
        frame_id: FRAME.to_owned(),
        id: id.to_owned(),
        ..SceneEntity::default()
    }
}
