//! The wire as data: `wire.json`, the tables of `docs/wire.md` and the messages for C are what the types say. `UPDATE_EXPECT=1` writes them
//! anew.
#![allow(clippy::unwrap_used)] // tests

mod description {
    pub(crate) mod c_header;
    pub(crate) mod json;
    pub(crate) mod markdown;
    pub(crate) mod text;
}

use std::fs;
use std::path::Path;

use description::{c_header, json, markdown};
use expect_test::expect_file;
use shared_types::PROTOCOL_VERSION;
use shared_types::ipc::{EVENTS, TOPICS};
use shared_types::message::{LAYOUTS, Layout};

/// Behind this line `docs/wire.md` is written by this test.
const GENERATED: &str =
    "<!-- Written from shared-types by its test `description`; edit there. -->\n";

fn layout(type_name: &str) -> Option<&'static Layout> {
    LAYOUTS.iter().find(|layout| layout.type_name == type_name)
}

#[test]
fn wire_json_is_what_the_types_say() {
    let json = serde_json::to_string_pretty(&json::wire()).unwrap();
    expect_file!["../wire.json"].assert_eq(&format!("{json}\n"));
}

#[test]
fn the_messages_for_c_are_what_the_types_say() {
    expect_file!["../../clients/c/include/pcc/messages.h"].assert_eq(&c_header::header());
}

#[test]
fn the_tables_of_the_document_are_what_the_types_say() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/wire.md");
    let document = fs::read_to_string(&file).unwrap();
    let (written_by_hand, _) = document.split_once(GENERATED).unwrap();
    let whole = format!("{written_by_hand}{GENERATED}{}", markdown::tables());
    expect_file![file].assert_eq(&whole);
    let version = format!("`pcc.v{PROTOCOL_VERSION}.Name` on the wire, {PROTOCOL_VERSION} being");
    assert!(written_by_hand.contains(&version), "{version}");
}

#[test]
fn everything_that_services_carry_is_described_whole() {
    let carried = TOPICS.iter().map(|topic| topic.layout.type_name);
    let mut reached: Vec<&str> = carried.collect();
    reached.extend(
        [
            "PlanRequest",
            "PlanReport",
            "Knot",
            "Command",
            "CommandReply",
        ]
        .map(|name| {
            let with_name = |layout: &&Layout| layout.type_name.ends_with(&format!(".{name}"));
            LAYOUTS.iter().find(with_name).unwrap().type_name
        }),
    );
    let mut next = 0;
    while next < reached.len() {
        let layout = layout(reached[next]).expect(reached[next]);
        let parts = layout.fields.iter().map(|field| field.element);
        let messages = parts.filter(|element| element.contains('.'));
        for message in messages {
            if !reached.contains(&message) {
                reached.push(message);
            }
        }
        next += 1;
    }
    reached.sort_unstable();
    reached.dedup();
    assert_eq!(reached.len(), LAYOUTS.len(), "{reached:?}");
}

#[test]
fn layouts_have_no_gaps_and_their_names_carry_the_version() {
    for layout in LAYOUTS {
        assert!(
            layout
                .type_name
                .starts_with(&format!("pcc.v{PROTOCOL_VERSION}."))
        );
        let mut end = 0;
        for field in layout.fields {
            assert_eq!(field.offset, end, "{} of {}", field.name, layout.type_name);
            end += field.bytes;
            assert!(
                !field.doc.trim().is_empty(),
                "{} is not explained",
                field.name
            );
        }
        assert_eq!(end, layout.bytes, "{}", layout.type_name);
    }
}

#[test]
fn services_have_names_of_their_own() {
    let topics = TOPICS.iter().map(|topic| topic.settings.name);
    let events = EVENTS.iter().map(|event| event.name);
    let mut names: Vec<&str> = topics.chain(events).chain(["plan", "command"]).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
}
