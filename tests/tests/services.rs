//! `pcc services` tells of what is there what `wire.json` says of it, and who is daemon, controller and robot.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;

use serde_json::Value;
use tests::outside::pcc;
use tests::programs::repository;
use tests::stack::{Part, Stack};
use tests::world::{Settings, World};

const LIMIT: Duration = Duration::from_secs(10);

fn services(world: &World) -> Value {
    let said = pcc(world, &["services", "--json"], LIMIT);
    assert!(said.is_good(), "{}", said.summary());
    serde_json::from_str(&said.text).unwrap()
}

/// The type that each service carries, or that a request is, as `wire.json` has it; empty for events.
fn described() -> BTreeMap<String, String> {
    let file = repository().join("shared-types/wire.json");
    let wire: Value = serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap();
    let type_name = |service: &Value| {
        let message = service.get("payload").or(service.get("request"));
        let message = message.map(|name| &wire["messages"][name.as_str().unwrap()]);
        message
            .map_or("", |message| message["type_name"].as_str().unwrap())
            .to_owned()
    };
    let services = wire["services"].as_array().unwrap().iter();
    services
        .map(|service| {
            (
                service["name"].as_str().unwrap().to_owned(),
                type_name(service),
            )
        })
        .collect()
}

#[test]
fn what_is_there_is_what_wire_json_describes() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let told = services(&stack.world);
    let live = told["services"].as_array().unwrap().iter();
    let live: BTreeMap<String, String> = live
        .map(|service| {
            assert_eq!(service["fault"], Value::Null, "{service}");
            assert_ne!(service["users"], Value::Array(Vec::new()), "{service}");
            let text = |key: &str| service[key].as_str().unwrap().to_owned();
            (text("name"), text("type_name"))
        })
        .collect();
    assert_eq!(live, described());
    for (role, part) in [
        ("planner-daemon", Part::Daemon),
        ("controller", Part::Controller),
        ("robot", Part::Robot),
    ] {
        let roles = told["roles"].as_array().unwrap();
        let holder = roles.iter().find(|holder| holder["role"] == role).unwrap();
        assert_eq!(holder["pid"], stack.process(part).pid(), "{role}");
    }
}

#[test]
fn where_nothing_was_started_nothing_is_listed() {
    let world = World::new(&Settings::default());
    let told = services(&world);
    assert_eq!(told["services"], Value::Array(Vec::new()));
    let said = pcc(&world, &["services"], LIMIT);
    assert!(said.text.contains("no services"), "{}", said.text);
}
