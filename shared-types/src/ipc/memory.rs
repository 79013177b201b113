//! How much shared memory the services take: iceoryx2's own chunk counts with this protocol's messages and settings.

use iceoryx2::service::header::{publish_subscribe, request_response};

use super::PlanServiceCapacity;
use super::request::{
    COMMAND_CLIENTS, COMMANDS_PER_CLIENT, HELD_ANSWERS, HELD_REPLIES, REQUEST_LOANS, RESPONSES,
    SERVERS,
};
use super::topic::{
    CONTROLLER_STATE, CYCLE, GOAL, GOAL_STATUS, HEARTBEAT, LOANS, MOTION_RESULT, ROBOT_STATE,
    SCENE, SCENE_STATUS, SETPOINT, TRAJECTORY, TopicSettings,
};
use crate::message::{
    Command, CommandReply, ControllerState, Cycle, GoalStatus, Heartbeat, Knot, MotionResult,
    PlanReport, PlanRequest, RobotState, SceneMessage, SceneStatus, Setpoint, StandingGoal,
    TrajectoryMessage,
};

/// Shared memory of each service with one daemon, one controller, one robot, one source of scenes, and as many clients
/// as the capacity allows: its short name and bytes. Payload memory only: the queues between the ports add a few per cent.
#[must_use]
pub fn shared_memory(capacity: &PlanServiceCapacity) -> [(&'static str, usize); 13] {
    [
        ("plan", plan_bytes(capacity)),
        ("command", command_bytes()),
        topic::<TrajectoryMessage>(&TRAJECTORY, 1),
        topic::<Setpoint>(&SETPOINT, 1),
        topic::<RobotState>(&ROBOT_STATE, 1),
        topic::<ControllerState>(&CONTROLLER_STATE, 1),
        topic::<MotionResult>(&MOTION_RESULT, 1),
        topic::<StandingGoal>(&GOAL, 1),
        topic::<GoalStatus>(&GOAL_STATUS, 1),
        topic::<Cycle>(&CYCLE, 1),
        topic::<SceneMessage>(&SCENE, 1),
        topic::<SceneStatus>(&SCENE_STATUS, 1),
        topic::<Heartbeat>(&HEARTBEAT, 3),
    ]
}

/// Shared memory of `plan`, bytes: the daemon's answers and every client's requests.
#[must_use]
pub fn plan_bytes(capacity: &PlanServiceCapacity) -> usize {
    let answer = chunk_bytes::<request_response::ResponseHeader, PlanReport, Knot>(
        capacity.knots_per_response(),
    );
    let request = chunk_bytes::<request_response::RequestHeader, (), PlanRequest>(1);
    exchange_bytes(
        capacity.clients,
        capacity.active_requests_per_client,
        HELD_ANSWERS,
        [answer, request],
    )
}

fn command_bytes() -> usize {
    let answer = chunk_bytes::<request_response::ResponseHeader, (), CommandReply>(1);
    let request = chunk_bytes::<request_response::RequestHeader, (), Command>(1);
    exchange_bytes(
        COMMAND_CLIENTS,
        COMMANDS_PER_CLIENT,
        HELD_REPLIES,
        [answer, request],
    )
}

/// One server's answers and all clients' requests. A client's requests count twice: the ones at work, and the ones that
/// it dropped and the server has not yet. Of the answers to one, some are prepared, some wait, and some are held by the
/// client.
fn exchange_bytes(
    clients: usize,
    requests_per_client: usize,
    held: usize,
    [answer, request]: [usize; 2],
) -> usize {
    let requests = 2 * requests_per_client;
    let answers = clients * requests * (2 * RESPONSES + held);
    let client_chunks = SERVERS * requests + REQUEST_LOANS;
    answers * answer + clients * client_chunks * request
}

fn topic<T>(settings: &TopicSettings, publishers: usize) -> (&'static str, usize) {
    let chunks = settings.subscribers * (settings.buffer + LOANS) + settings.history + LOANS;
    let chunk = chunk_bytes::<publish_subscribe::Header, (), T>(settings.slice);
    (settings.name, publishers * chunks * chunk)
}

/// A chunk: iceoryx2's header, ours, the payload, each at its alignment.
fn chunk_bytes<Header, UserHeader, Element>(elements: usize) -> usize {
    let user_header_begin = size_of::<Header>().next_multiple_of(align_of::<UserHeader>());
    let payload_begin =
        (user_header_begin + size_of::<UserHeader>()).next_multiple_of(align_of::<Element>());
    let alignment = align_of::<Header>()
        .max(align_of::<UserHeader>())
        .max(align_of::<Element>());
    (payload_begin + elements * size_of::<Element>()).next_multiple_of(alignment)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_stay_within_48_megabytes() {
        let services = shared_memory(&PlanServiceCapacity::default());
        let total: usize = services.iter().map(|(_, bytes)| bytes).sum();
        assert!(total < 48_000_000, "{total}: {services:?}");
        assert!(services.iter().all(|(_, bytes)| *bytes > 0));
    }

    #[test]
    fn more_of_anything_takes_more() {
        let base = PlanServiceCapacity::default();
        for larger in [
            PlanServiceCapacity { clients: 5, ..base },
            PlanServiceCapacity {
                active_requests_per_client: 5,
                ..base
            },
            PlanServiceCapacity {
                candidates: 17,
                ..base
            },
            PlanServiceCapacity {
                knots_per_candidate: 97,
                ..base
            },
        ] {
            assert!(plan_bytes(&larger) > plan_bytes(&base), "{larger:?}");
        }
    }
}
