//! The messages for C and C++.

use std::fmt::Write;

use serde_json::Value;

use super::json;

/// The header `messages.h`: constants, codes, and the messages with assertions on their layout.
pub(crate) fn header() -> String {
    let wire = json::wire();
    let mut text = String::new();
    begin(&mut text, &wire["protocol_version"]).unwrap();
    constants(&mut text, &wire["constants"]).unwrap();
    codes(&mut text, &wire["codes"]).unwrap();
    let short = shared_types::message::LAYOUTS.iter().map(json::short);
    for name in short {
        message(&mut text, name, &wire["messages"][name]).unwrap();
    }
    text.push_str("#endif\n");
    text
}

fn begin(text: &mut String, version: &Value) -> std::fmt::Result {
    writeln!(
        text,
        "/* The messages of the planner, its controller and the robot: see docs/wire.md.\n   Written from shared-types by its test \
         `description`; edit there. */\n#ifndef PCC_MESSAGES_H\n#define PCC_MESSAGES_H\n\n#include <stddef.h>\n#include <stdint.h>\n\n\
         #ifdef __cplusplus\n#define PCC_ASSERT(condition) static_assert(condition, #condition)\n#else\n\
         #define PCC_ASSERT(condition) _Static_assert(condition, #condition)\n#endif\n\n#define PCC_PROTOCOL_VERSION {version}\n"
    )
}

fn constants(text: &mut String, constants: &Value) -> std::fmt::Result {
    for (name, constant) in constants.as_object().unwrap() {
        comment(text, "", &constant["doc"])?;
        writeln!(text, "#define PCC_{name} {}u", constant["value"])?;
    }
    writeln!(text)
}

fn codes(text: &mut String, codes: &Value) -> std::fmt::Result {
    for (name, code) in codes.as_object().unwrap() {
        comment(text, "", &code["doc"])?;
        writeln!(text, "typedef enum Pcc{name} {{")?;
        for value in code["values"].as_array().unwrap() {
            let variant = value["name"].as_str().unwrap();
            comment(text, "  ", &value["doc"])?;
            writeln!(
                text,
                "  PCC_{}_{} = {},",
                upper(name),
                upper(variant),
                value["code"]
            )?;
        }
        writeln!(text, "}} Pcc{name};\n")?;
    }
    Ok(())
}

fn message(text: &mut String, name: &str, message: &Value) -> std::fmt::Result {
    comment(text, "", &message["doc"])?;
    writeln!(text, "typedef struct Pcc{name} {{")?;
    let fields = message["fields"].as_array().unwrap();
    for field in fields {
        comment(text, "  ", &field["doc"])?;
        let count = match &field["count"] {
            Value::Null => String::new(),
            count => format!("[{count}]"),
        };
        let [element, field] = ["type", "name"].map(|key| field[key].as_str().unwrap());
        writeln!(text, "  {} {field}{count};", c_type(element))?;
    }
    writeln!(text, "}} Pcc{name};")?;
    writeln!(
        text,
        "PCC_ASSERT(sizeof(Pcc{name}) == {});",
        message["bytes"]
    )?;
    for field in fields {
        writeln!(
            text,
            "PCC_ASSERT(offsetof(Pcc{name}, {}) == {});",
            field["name"].as_str().unwrap(),
            field["offset"]
        )?;
    }
    writeln!(text)
}

fn comment(text: &mut String, indent: &str, doc: &Value) -> std::fmt::Result {
    writeln!(text, "{indent}/* {} */", doc.as_str().unwrap())
}

fn c_type(element: &str) -> String {
    match element {
        "u8" => "uint8_t".to_owned(),
        "u32" => "uint32_t".to_owned(),
        "u64" => "uint64_t".to_owned(),
        "i64" => "int64_t".to_owned(),
        "f64" => "double".to_owned(),
        message => format!("Pcc{message}"),
    }
}

/// A name in camel case as one in capitals, as `RobotState` as `ROBOT_STATE`.
fn upper(camel: &str) -> String {
    let mut text = String::new();
    for (index, letter) in camel.char_indices() {
        if index > 0 && letter.is_ascii_uppercase() {
            text.push('_');
        }
        text.push(letter.to_ascii_uppercase());
    }
    text
}
