//! What is ordered while the demonstration waits for a daemon.

use super::*;
use shared_types::PROTOCOL_VERSION;
use shared_types::codes::LoopState;
use shared_types::ipc::{
    IpcNode, PlanServiceCapacity, controller_state_service, plan_server, plan_service, publisher,
    scene_service, scene_status_service, subscriber,
};
use shared_types::message::{ControllerState, SceneMessage, SceneStatus};
use std::sync::atomic::Ordering;
use std::thread::{sleep, spawn};

const MS: i64 = 1_000_000;
/// When the stop is ordered, and when the daemon comes, ns after the begin.
const STOPPED_NS: i64 = 400 * MS;
const DAEMON_NS: i64 = 600 * MS;

/// A controller that holds, and is ordered to stop meanwhile; and a daemon that comes late and takes every scene in. Until `quit`.
fn play(options: &IpcOptions, quit: &AtomicBool) {
    let node = IpcNode::create(options, "played").unwrap();
    let states = publisher(&node, &controller_state_service(&node).unwrap()).unwrap();
    let scenes = subscriber::<SceneMessage>(&node, &scene_service(&node).unwrap()).unwrap();
    let statuses = publisher(&node, &scene_status_service(&node).unwrap()).unwrap();
    let (begin_ns, mut daemon) = (mono_now_ns(), None);
    while !quit.load(Ordering::Relaxed) {
        let now_ns = mono_now_ns();
        let stopped_ns = begin_ns + STOPPED_NS;
        let state = ControllerState {
            stamp_mono_ns: now_ns,
            instance: 1,
            state: LoopState::Holding.code(),
            speed: 1.0,
            wanted_from_mono_ns: if now_ns < stopped_ns { 1 } else { stopped_ns },
            ..ControllerState::ZEROED
        };
        states.send_copy(state).unwrap();
        if daemon.is_none() && now_ns > begin_ns + DAEMON_NS {
            let capacity = PlanServiceCapacity::default();
            let service = plan_service(&node, &capacity).unwrap();
            daemon = Some((plan_server(&node, &service, &capacity).unwrap(), service));
        }
        while let Some(scene) = scenes.receive().unwrap() {
            let status = SceneStatus {
                scene_stamp_mono_ns: scene.stamp_mono_ns,
                source: scene.source,
                sequence: scene.sequence,
                protocol_version: PROTOCOL_VERSION,
                ..SceneStatus::ZEROED
            };
            statuses.send_copy(status).unwrap();
        }
        sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_stop_that_is_ordered_while_a_daemon_is_waited_for_ends_the_demonstration() {
    let folder = tempfile::tempdir().unwrap();
    let options = IpcOptions {
        prefix: "demo-stopped".to_owned(),
        root: folder.path().join("root"),
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots/unit.toml");
    let robot = Robot::from_file(&file).unwrap();
    let (here, quit) = (options.clone(), Arc::<AtomicBool>::default());
    let quits = Arc::clone(&quit);
    let played = spawn(move || play(&here, &quits));
    let begun = Mission::begin(&robot, &options, 0).map(|_| ());
    quit.store(true, Ordering::Relaxed);
    played.join().unwrap();
    let error = begun.unwrap_err();
    assert!(error.is::<Overruled>(), "{error:#}");
}
