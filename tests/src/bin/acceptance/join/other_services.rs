//! A service that another program has made, of another type or of another version: refused by name, with what is expected and what is found.

use std::fmt::Debug;

use anyhow::{anyhow, ensure};
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{FileName, Path, SemanticString, ServiceName, ZeroCopySend, ipc};
use shared_types::PROTOCOL_VERSION;
use shared_types::ipc::IpcNode;
use shared_types::message::{ControllerState, Payload};
use tests::world::{Settings, World};

use super::examples::{Examples, LIMIT};
use crate::report::Report;

/// What the example `watch` joins.
const SERVICE: &str = "controller_state";

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

/// The example `watch` of a language beside such services.
pub(super) fn run(examples: &Examples, report: &mut Report) {
    let name = format!("{}: another type or version", examples.language);
    report.group(&name, examples.command, |report| refused(examples, report));
}

fn refused(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let old = "found protocol version 5: pcc.v5.ControllerState (824 bytes, alignment 8)";
    refused_of::<OldState>(examples, report, "another version", old)?;
    let foreign = "found another protocol: somebody.State (12 bytes, alignment 4)";
    refused_of::<ForeignState>(examples, report, "another type", foreign)
}

fn refused_of<T: Debug + ZeroCopySend>(
    examples: &Examples,
    report: &mut Report,
    of: &str,
    found: &str,
) -> anyhow::Result<()> {
    let world = World::new(&Settings::default());
    // Makes the folder of services as they are to find it.
    let _node = IpcNode::create(&world.options, "other-services")?;
    let other = other_node(&world)?;
    let name = ServiceName::new(&world.options.service_name(SERVICE)).map_err(failed)?;
    let service = other.service_builder(&name).publish_subscribe::<T>();
    let service = service.create().map_err(failed)?;
    let mut watching = examples.start(&world, "watch", &["1"])?;
    let status = watching.wait(LIMIT)?;
    drop(service);
    let told = watching.log();
    let layout = <ControllerState as Payload>::LAYOUT;
    let expected = format!(
        "protocol version {PROTOCOL_VERSION}: {} ({} bytes, alignment {})",
        layout.type_name, layout.bytes, layout.alignment
    );
    let has = |text: &str| told.contains(text) || told.contains(&in_a_field(text));
    let named = has(&format!("expected {expected}")) && has(found);
    let line = examples.line(&format!("a service of {of}"));
    let bar = format!("refused: expected {expected}, {found}");
    ensure!(!told.is_empty(), "watch: {status}, without a word");
    let figure = format!("{status}: {}", told.trim());
    report.check(&line, figure, &bar, !status.success() && named);
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
