//! A controller that a check plays: it says what it is told to say, true or not, and counts the stops that it is ordered.

use std::thread::sleep;
use std::time::{Duration, Instant};

use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::codes::LoopState;
use shared_types::ipc::{
    CommandServer, IpcError, IpcNode, IpcOptions, Publisher, command_server, command_service,
    controller_state_service, publisher,
};
use shared_types::message::{CommandReply, ControllerState};

/// Time between two states.
const EVERY: Duration = Duration::from_millis(2);

/// Its ports, and what it says.
#[derive(Debug)]
pub struct PlayedController {
    /// What it says from now on; stamped when it is sent.
    pub state: ControllerState,
    /// Stops ordered so far; all are said to be obeyed.
    pub stops: usize,
    states: Publisher<ControllerState>,
    commands: CommandServer,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl PlayedController {
    /// One of the robot with this hash that holds the straight shape.
    ///
    /// # Errors
    /// [`IpcError`].
    pub fn start(options: &IpcOptions, robot_hash: u64) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "played-controller")?;
        Ok(Self {
            state: ControllerState {
                state: LoopState::Holding.code(),
                rate: 1.0,
                instance: 5,
                robot_hash,
                ..ControllerState::ZEROED
            },
            stops: 0,
            states: publisher(&node, &controller_state_service(&node)?)?,
            commands: command_server(&node, &command_service(&node)?)?,
            _node: node,
        })
    }

    /// Speaks and hears until `done` gives something, at most for `limit`.
    pub fn play_until<T>(
        &mut self,
        limit: Duration,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<T> {
        let begin = Instant::now();
        while begin.elapsed() < limit {
            self.round();
            if let Some(found) = done(self) {
                return Some(found);
            }
            sleep(EVERY);
        }
        None
    }

    /// Speaks and hears for a while.
    pub fn play(&mut self, duration: Duration) {
        let _ = self.play_until(duration, |_| None::<()>);
    }

    fn round(&mut self) {
        self.state.stamp_mono_ns = mono_now_ns();
        let _ = self.states.send_copy(self.state);
        while let Ok(Some(request)) = self.commands.receive() {
            self.stops += 1;
            let reply = CommandReply {
                command_id: request.command_id,
                protocol_version: PROTOCOL_VERSION,
                accepted: 1,
                state: LoopState::Stopping.code(),
                ..CommandReply::ZEROED
            };
            let _ = request.send_copy(reply);
        }
    }
}
