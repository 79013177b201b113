//! Commands over real shared memory, each test under a root and a prefix of its own.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod world;

use shared_types::ipc::*;
use shared_types::message::*;
use world::{daemon_and_user, world};

/// Both ends of `command`, each on a node of its own.
fn command_ends([server, client]: &[IpcNode; 2]) -> (CommandServer, CommandClient) {
    (
        command_server(server, &command_service(server).unwrap()).unwrap(),
        command_client(client, &command_service(client).unwrap()).unwrap(),
    )
}

#[test]
fn commands_are_answered() {
    let world = world();
    let nodes = daemon_and_user(&world);
    let (server, client) = command_ends(&nodes);
    let pending = client
        .send_copy(Command {
            command_id: 7,
            kind: 1,
            ..Command::ZEROED
        })
        .unwrap();
    let active = server.receive().unwrap().unwrap();
    active
        .send_copy(CommandReply {
            command_id: active.command_id,
            accepted: 1,
            ..CommandReply::ZEROED
        })
        .unwrap();
    let reply = pending.receive().unwrap().unwrap();
    assert_eq!((reply.command_id, reply.accepted), (7, 1));
}

#[test]
fn a_command_arrives_whose_sender_waits_for_no_reply() {
    let world = world();
    let nodes = daemon_and_user(&world);
    let (server, client) = command_ends(&nodes);
    let stop = Command {
        command_id: 7,
        kind: 1,
        ..Command::ZEROED
    };
    drop(client.send_copy(stop).unwrap());
    let active = server.receive().unwrap().unwrap();
    assert_eq!(active.command_id, 7);
    assert!(!active.is_connected());
}
