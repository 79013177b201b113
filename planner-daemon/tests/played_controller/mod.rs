//! A controller that a test plays, and requests while it goes on.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test program uses the part of it that it needs"
)]

use std::path::Path;

use client::{Client, PlanAnswer};
use pcc_model::Robot;
use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandKind, LoopState};
use shared_types::ipc::*;
use shared_types::message::*;
use shared_types::valid::{self, PlanRequest, Signature, SignedCommand};

use crate::common::until;

/// A controller that does what it is told to have done.
pub struct PlayedController {
    states: Publisher<ControllerState>,
    trajectories: Subscriber<TrajectoryMessage>,
    pub heartbeats: Subscriber<Heartbeat>,
    commands: CommandServer,
    pub state: ControllerState,
    /// When the trajectory that it executes was begun, if one is, nanoseconds of `CLOCK_MONOTONIC`.
    pub begun_mono_ns: Option<i64>,
    /// Stops ordered.
    pub stops: usize,
    /// Who ordered the last one, and why.
    pub last_stop: Option<Signature>,
    _node: IpcNode,
}

/// Of the robot file that the daemons of these tests have.
fn robot_hash() -> u64 {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/unit.toml");
    Robot::from_file(&file).unwrap().hash()
}

impl PlayedController {
    pub fn start(options: &IpcOptions) -> Self {
        let node = IpcNode::create(options, "controller").unwrap();
        let state = ControllerState {
            state: LoopState::Holding.code(),
            rate: 1.0,
            instance: 5,
            robot_hash: robot_hash(),
            ..ControllerState::ZEROED
        };
        Self {
            states: publisher(&node, &controller_state_service(&node).unwrap()).unwrap(),
            trajectories: subscriber(&node, &trajectory_service(&node).unwrap()).unwrap(),
            heartbeats: subscriber(&node, &heartbeat_service(&node).unwrap()).unwrap(),
            commands: command_server(&node, &command_service(&node).unwrap()).unwrap(),
            state,
            begun_mono_ns: None,
            stops: 0,
            last_stop: None,
            _node: node,
        }
    }

    /// Publishes its state and accepts orders.
    pub fn cycle(&mut self) {
        self.state.stamp_mono_ns = mono_now_ns();
        if let Some(begun) = self.begun_mono_ns {
            self.state.trajectory_time_s = (self.state.stamp_mono_ns - begun) as f64 * 1e-9;
        }
        self.states.send_copy(self.state).unwrap();
        while let Some(request) = self.commands.receive().unwrap() {
            let command: Command = *request;
            assert_eq!(command.kind, CommandKind::Stop.code());
            self.stops += 1;
            let signed = SignedCommand::try_from(&command).unwrap();
            self.last_stop = Some(signed.signature);
            if self.state.state == LoopState::Executing.code() {
                self.state.state = LoopState::Stopping.code();
            }
            let reply = CommandReply {
                command_id: command.command_id,
                protocol_version: PROTOCOL_VERSION,
                accepted: 1,
                state: self.state.state,
                ..CommandReply::ZEROED
            };
            request.send_copy(reply).unwrap();
        }
    }

    /// Executes a trajectory from now on.
    pub fn begin(&mut self, trajectory: &valid::Trajectory) {
        self.state.trajectory_id = trajectory.id;
        self.state.state = LoopState::Executing.code();
        self.state.speed = 1.0;
        self.begun_mono_ns = Some(mono_now_ns());
    }

    pub fn trajectory(&self) -> Option<valid::Trajectory> {
        let message: TrajectoryMessage = *self.trajectories.receive().unwrap()?;
        Some(valid::Trajectory::try_from(&message).unwrap())
    }
}

/// Plans while the controller goes on.
pub fn plan(
    client: &mut Client,
    controller: &mut PlayedController,
    request: &PlanRequest,
) -> PlanAnswer {
    for _ in 0..10 {
        controller.cycle();
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let mut pending = client.submit(request).unwrap();
    until(|| {
        controller.cycle();
        client.poll(&mut pending).unwrap()
    })
}
