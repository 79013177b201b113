//! The wire as JSON.

use serde_json::{Map, Value, json};
use shared_types::PROTOCOL_VERSION;
use shared_types::capacity::CAPACITIES;
use shared_types::codes::{CodeSet, SETS};
use shared_types::ipc::{
    COMMAND, EVENTS, EventDescription, LOANS, NODES, PlanServiceCapacity, RequestSettings, TOPICS,
    TopicDescription, plan_settings,
};
use shared_types::message::{
    Command, CommandReply, Field, Knot, LAYOUTS, Layout, NONE_SELECTED, Payload, PlanReport,
    PlanRequest,
};

use super::text::{code_of, plain};

/// All of it.
pub(crate) fn wire() -> Value {
    let capacity = PlanServiceCapacity::default();
    let mut plan = exchange(
        &plan_settings(&capacity),
        [&PlanRequest::LAYOUT, &Knot::LAYOUT],
        Some((&PlanReport::LAYOUT, capacity.knots_per_response())),
    );
    plan["made_by"] = plan["to"].clone();
    let command = exchange(&COMMAND, [&Command::LAYOUT, &CommandReply::LAYOUT], None);
    let topics = TOPICS.iter().map(topic);
    let events = EVENTS.iter().map(event);
    json!({
        "protocol_version": PROTOCOL_VERSION,
        "iceoryx2": "0.10.0",
        "clock": "CLOCK_MONOTONIC, nanoseconds",
        "names": {
            "service": "PREFIX/NAME",
            "iceoryx2_prefix": "PREFIX_",
            "role_lock": "ROOT/PREFIX.ROLE.lock",
            "default_prefix": "pcc",
            "default_roots": ["~/.pcc-services", "/dev/shm/pcc-UID"],
        },
        "services": Value::Array([plan, command].into_iter().chain(topics).chain(events).collect()),
        "messages": object(LAYOUTS.iter().map(|layout| (short(layout), message(layout)))),
        "codes": object(SETS.iter().map(|set| (set.name, code(set)))),
        "constants": constants(),
    })
}

/// A message's name without the protocol's.
pub(crate) fn short(layout: &Layout) -> &'static str {
    layout.type_name.rsplit('.').next().unwrap()
}

fn object<'a>(entries: impl Iterator<Item = (&'a str, Value)>) -> Value {
    Value::Object(
        entries
            .map(|(name, value)| (name.to_owned(), value))
            .collect::<Map<_, _>>(),
    )
}

fn message(layout: &Layout) -> Value {
    json!({
        "type_name": layout.type_name,
        "doc": plain(layout.doc),
        "bytes": layout.bytes,
        "alignment": layout.alignment,
        "fields": layout.fields.iter().map(field).collect::<Vec<_>>(),
    })
}

fn field(field: &Field) -> Value {
    let element = field.element.rsplit('.').next();
    let mut value = json!({
        "name": field.name,
        "type": element,
        "offset": field.offset,
        "bytes": field.bytes,
        "doc": plain(field.doc),
    });
    if let Some(count) = field.count {
        value["count"] = count.into();
    }
    if let Some(code) = code_of(field.doc) {
        value["code"] = code.into();
    }
    value
}

fn code(set: &CodeSet) -> Value {
    let values = set.values.iter().map(|value| {
        json!({ "code": value.code, "name": value.name, "text": value.text, "doc": plain(value.doc) })
    });
    json!({ "doc": plain(set.doc), "values": values.collect::<Vec<_>>() })
}

fn constants() -> Value {
    let capacities = CAPACITIES.iter();
    let mut all: Vec<(&str, Value)> = capacities
        .map(|it| (it.name, json!({ "value": it.value, "doc": plain(it.doc) })))
        .collect();
    let none = "No candidate is selected or named.";
    all.push((
        "NONE_SELECTED",
        json!({ "value": NONE_SELECTED, "doc": none }),
    ));
    object(all.into_iter())
}

fn topic(topic: &TopicDescription) -> Value {
    let settings = &topic.settings;
    json!({
        "name": settings.name,
        "pattern": "publish_subscribe",
        "purpose": topic.purpose,
        "from": settings.from,
        "payload": short(&topic.layout),
        "payload_is_slice": topic.is_slice,
        "max_slice_len": settings.slice,
        "safe_overflow": true,
        "max_publishers": settings.publishers,
        "reserved_publishers": settings.reserved_publishers,
        "max_subscribers": settings.subscribers,
        "reserved_subscribers": settings.reserved_subscribers,
        "history_size": settings.history,
        "subscriber_max_buffer_size": settings.buffer,
        "subscriber_max_borrowed_samples": LOANS,
        "max_nodes": NODES,
    })
}

fn exchange(
    settings: &RequestSettings,
    [request, response]: [&Layout; 2],
    slice: Option<(&Layout, usize)>,
) -> Value {
    let mut value = json!({
        "name": settings.name,
        "pattern": "request_response",
        "purpose": settings.purpose,
        "from": settings.from,
        "to": settings.to,
        "request": short(request),
        "response": short(response),
        "response_is_slice": slice.is_some(),
        "safe_overflow_for_requests": true,
        "safe_overflow_for_responses": true,
        "fire_and_forget_requests": settings.fire_and_forget,
        "max_servers": settings.servers,
        "max_clients": settings.clients,
        "reserved_clients": settings.reserved_clients,
        "max_active_requests_per_client": settings.active_requests,
        "max_loaned_requests": settings.request_loans,
        "max_response_buffer_size": settings.response_buffer,
        "max_borrowed_responses_per_pending_response": settings.held_responses,
        "max_nodes": NODES,
    });
    if let Some((header, length)) = slice {
        value["response_user_header"] = short(header).into();
        value["max_slice_len"] = length.into();
    }
    value
}

fn event(event: &EventDescription) -> Value {
    json!({
        "name": event.name,
        "pattern": "event",
        "purpose": event.purpose,
        "from": event.from,
        "to": event.to,
        "event_id": 0,
        "event_id_max_value": 0,
        "max_notifiers": event.notifiers,
        "max_listeners": event.listeners,
        "max_nodes": NODES,
    })
}
