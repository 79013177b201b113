//! A service that another program has made, of another type or of another version: refused by name, with what is expected and what is found.

use std::fmt::Debug;

use anyhow::{anyhow, ensure};
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{FileName, Path, SemanticString, ServiceName, ZeroCopySend, ipc};
use shared_types::PROTOCOL_VERSION;
use shared_types::ipc::IpcNode;
use shared_types::message::{
    ControllerState, Knot, Layout, Payload, PlanReport, PlanRequest, SceneMessage, Setpoint,
    TrajectoryMessage,
};
use tests::world::{Settings, World};

use super::examples::{Examples, LIMIT};
use crate::report::Report;

const PLAN: [Layout; 3] = [PlanRequest::LAYOUT, Knot::LAYOUT, PlanReport::LAYOUT];
const STATE: [Layout; 1] = [ControllerState::LAYOUT];
const SCENE: [Layout; 1] = [SceneMessage::LAYOUT];
const SETPOINT: [Layout; 1] = [Setpoint::LAYOUT];
const TRAJECTORY: [Layout; 1] = [TrajectoryMessage::LAYOUT];

/// The message as another version of the protocol has it.
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("pcc.v5.ControllerState")]
#[repr(C)]
struct OldState([u64; 103]);

/// A message of somebody else's.
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("somebody.State")]
#[repr(C)]
struct ForeignState([u32; 3]);

/// An example, and a service that it joins.
struct Joined {
    example: &'static str,
    arguments: Vec<String>,
    service: &'static str,
    carries: &'static [Layout],
}

impl Joined {
    /// Each example of a world, with a service that is its own.
    fn all(world: &World) -> [Self; 5] {
        let file = |name| vec![world.config(name).display().to_string()];
        let words = |text: &str| text.split(' ').map(str::to_owned).collect();
        let joined = |example, arguments, service, carries| Self {
            example,
            arguments,
            service,
            carries,
        };
        [
            joined("plan", words("1 0.5 2.3"), "plan", &PLAN),
            joined("watch", words("1"), "controller_state", &STATE),
            joined("scene", words("3 0 1 0.1 0 0 0 2"), "scene", &SCENE),
            joined("drive", file("robots/unit.toml"), "setpoint", &SETPOINT),
            joined("follow", file("controller.toml"), "trajectory", &TRAJECTORY),
        ]
    }

    /// What is expected of the service, as each language says it of each message.
    fn expected(&self) -> Vec<String> {
        let message = |layout: &Layout| {
            format!(
                "{} ({} bytes, alignment {})",
                layout.type_name, layout.bytes, layout.alignment
            )
        };
        let version = format!("expected protocol version {PROTOCOL_VERSION}: ");
        let messages = self.carries.iter().map(message);
        std::iter::once(version).chain(messages).collect()
    }
}

/// The examples of a language beside such services.
pub(super) fn run(examples: &Examples, report: &mut Report) {
    let name = format!("{}: another type or version", examples.language);
    report.group(&name, examples.command, |report| refused(examples, report));
}

fn refused(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let world = World::new(&Settings::default());
    // Makes the folder of services as they are to find it.
    let _node = IpcNode::create(&world.options, "other-services")?;
    for joined in Joined::all(&world) {
        let old = "found protocol version 5: pcc.v5.ControllerState (824 bytes, alignment 8)";
        refused_of::<OldState>(examples, report, &world, &joined, old)?;
        let foreign = "found another protocol: somebody.State (12 bytes, alignment 4)";
        refused_of::<ForeignState>(examples, report, &world, &joined, foreign)?;
    }
    Ok(())
}

fn refused_of<T: Debug + ZeroCopySend>(
    examples: &Examples,
    report: &mut Report,
    world: &World,
    joined: &Joined,
    found: &str,
) -> anyhow::Result<()> {
    let (example, service) = (joined.example, joined.service);
    let other = other_node(world)?;
    let name = ServiceName::new(&world.options.service_name(service)).map_err(failed)?;
    let builder = other.service_builder(&name);
    let (mut published, mut answered) = (None, None);
    if service == "plan" {
        answered = Some(
            builder
                .request_response::<T, T>()
                .create()
                .map_err(failed)?,
        );
    } else {
        published = Some(builder.publish_subscribe::<T>().create().map_err(failed)?);
    }
    let arguments: Vec<&str> = joined.arguments.iter().map(String::as_str).collect();
    let mut joining = examples.start(world, example, &arguments)?;
    let status = joining.wait(LIMIT)?;
    drop((published, answered));
    let told = joining.log();
    ensure!(!told.is_empty(), "{example}: {status}, without a word");
    let has = |text: &str| told.contains(text) || told.contains(&in_a_field(text));
    let expected = joined.expected();
    let is_named = expected.iter().all(|text| has(text)) && has(found);
    let line = examples.line(&format!("{example} beside another `{service}`"));
    let bar = format!("refused: {}; {found}", expected.join(" "));
    let figure = format!("{status}: {}", told.trim());
    report.check(&line, figure, &bar, !status.success() && is_named);
    Ok(())
}

/// The same where a program in Rust shows its error as data: `found: "…"`.
fn in_a_field(text: &str) -> String {
    text.replacen(' ', ": \"", 1)
}

/// A node of a program that has nothing of this project but prefix and root.
fn other_node(world: &World) -> anyhow::Result<Node<ipc::Service>> {
    let mut config = Config::default();
    let root = world.options.root.as_os_str().as_encoded_bytes();
    config
        .global
        .set_root_path(&Path::new(root).map_err(failed)?);
    let prefix = format!("{}_", world.options.prefix);
    config.global.prefix = FileName::new(prefix.as_bytes()).map_err(failed)?;
    NodeBuilder::new().config(&config).create().map_err(failed)
}

fn failed(error: impl Debug) -> anyhow::Error {
    anyhow!("iceoryx2: {error:?}")
}
