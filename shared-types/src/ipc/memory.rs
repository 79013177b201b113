//! How much shared memory the services take: iceoryx2's own chunk counts with this protocol's messages and settings.

use iceoryx2::service::header::{publish_subscribe, request_response};

use super::request::{COMMAND, PlanServiceCapacity, RequestSettings, plan_settings};
use super::topic::{HEARTBEAT, LOANS, TOPICS, TopicDescription};
use crate::message::{Command, CommandReply, Knot, Layout, Payload, PlanReport, PlanRequest};

/// Shared memory of each service with one daemon, one controller, one robot, one source of scenes, and as many clients
/// as the capacity allows: its short name and bytes. Payload memory only: the queues between the ports add a few per cent.
#[must_use]
pub fn shared_memory(capacity: &PlanServiceCapacity) -> Vec<(&'static str, usize)> {
    let exchanges = [
        ("plan", plan_bytes(capacity)),
        (COMMAND.name, command_bytes()),
    ];
    let topics = TOPICS
        .iter()
        .map(|topic| (topic.settings.name, topic_bytes(topic)));
    exchanges.into_iter().chain(topics).collect()
}

/// Shared memory of `plan`, bytes: the daemon's answers and every client's requests.
#[must_use]
pub fn plan_bytes(capacity: &PlanServiceCapacity) -> usize {
    let answer = chunk_bytes::<request_response::ResponseHeader, PlanReport>(
        &Knot::LAYOUT,
        capacity.knots_per_response(),
    );
    let request = chunk_bytes::<request_response::RequestHeader, ()>(&PlanRequest::LAYOUT, 1);
    exchange_bytes(&plan_settings(capacity), [answer, request])
}

fn command_bytes() -> usize {
    let answer = chunk_bytes::<request_response::ResponseHeader, ()>(&CommandReply::LAYOUT, 1);
    let request = chunk_bytes::<request_response::RequestHeader, ()>(&Command::LAYOUT, 1);
    exchange_bytes(&COMMAND, [answer, request])
}

/// One server's answers and all clients' requests. A client's requests count twice: the ones at work, and the ones that
/// it dropped and the server has not yet. Of the answers to one, some are prepared, some wait, and some are held by the
/// client.
fn exchange_bytes(settings: &RequestSettings, [answer, request]: [usize; 2]) -> usize {
    let requests = 2 * settings.active_requests;
    let answers_of_a_request = 2 * settings.response_buffer + settings.held_responses;
    let client_chunks = settings.servers * requests + settings.request_loans;
    settings.clients * (requests * answers_of_a_request * answer + client_chunks * request)
}

fn topic_bytes(topic: &TopicDescription) -> usize {
    let settings = &topic.settings;
    let publishers = if *settings == HEARTBEAT { 3 } else { 1 };
    let chunks = settings.subscribers * (settings.buffer + LOANS) + settings.history + LOANS;
    publishers
        * chunks
        * chunk_bytes::<publish_subscribe::Header, ()>(&topic.layout, settings.slice)
}

/// A chunk: iceoryx2's header, ours, the payload, each at its alignment.
fn chunk_bytes<Header, UserHeader>(payload: &Layout, elements: usize) -> usize {
    let user_header_begin = size_of::<Header>().next_multiple_of(align_of::<UserHeader>());
    let payload_begin =
        (user_header_begin + size_of::<UserHeader>()).next_multiple_of(payload.alignment);
    let alignment = align_of::<Header>()
        .max(align_of::<UserHeader>())
        .max(payload.alignment);
    (payload_begin + elements * payload.bytes).next_multiple_of(alignment)
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
