//! The tables of `docs/wire.md`.

use std::fmt::Write;

use serde_json::Value;

use super::json;

/// Services, messages, codes and constants, a section each.
pub(crate) fn tables() -> String {
    let wire = json::wire();
    let mut text = String::new();
    services(&mut text, &wire["services"]).unwrap();
    messages(&mut text, &wire["messages"]).unwrap();
    codes(&mut text, &wire["codes"]).unwrap();
    constants(&mut text, &wire["constants"]).unwrap();
    text
}

fn services(text: &mut String, services: &Value) -> std::fmt::Result {
    writeln!(text, "\n## Services and their settings")?;
    for service in services.as_array().unwrap() {
        writeln!(text, "\n### `{}`\n", plain(&service["name"]))?;
        writeln!(text, "{}\n", plain(&service["purpose"]))?;
        writeln!(text, "| setting | value |\n| --- | --- |")?;
        let settings = service.as_object().unwrap().iter();
        for (name, value) in
            settings.filter(|(name, _)| !["name", "purpose"].contains(&name.as_str()))
        {
            writeln!(text, "| {name} | {} |", plain(value))?;
        }
    }
    Ok(())
}

fn messages(text: &mut String, messages: &Value) -> std::fmt::Result {
    writeln!(text, "\n## Messages")?;
    for (name, message) in messages.as_object().unwrap() {
        writeln!(text, "\n### {name}\n")?;
        writeln!(
            text,
            "`{}`, {} bytes, aligned to {}. {}\n",
            plain(&message["type_name"]),
            message["bytes"],
            message["alignment"],
            plain(&message["doc"])
        )?;
        writeln!(
            text,
            "| offset | bytes | field | type | meaning |\n| --: | --: | --- | --- | --- |"
        )?;
        for field in message["fields"].as_array().unwrap() {
            let of_type = plain(&field["type"]);
            let of_type = match &field["count"] {
                Value::Null => of_type,
                count => format!("[{of_type}; {count}]"),
            };
            let [offset, bytes] = ["offset", "bytes"].map(|key| &field[key]);
            let [name, doc] = ["name", "doc"].map(|key| plain(&field[key]));
            writeln!(
                text,
                "| {offset} | {bytes} | `{name}` | {of_type} | {doc} |"
            )?;
        }
    }
    Ok(())
}

fn codes(text: &mut String, codes: &Value) -> std::fmt::Result {
    writeln!(text, "\n## Codes")?;
    for (name, code) in codes.as_object().unwrap() {
        writeln!(text, "\n### {name}\n\n{}\n", plain(&code["doc"]))?;
        writeln!(
            text,
            "| code | name | text | meaning |\n| --: | --- | --- | --- |"
        )?;
        for value in code["values"].as_array().unwrap() {
            let [name, words, doc] = ["name", "text", "doc"].map(|key| plain(&value[key]));
            writeln!(text, "| {} | {name} | {words} | {doc} |", value["code"])?;
        }
    }
    Ok(())
}

fn constants(text: &mut String, constants: &Value) -> std::fmt::Result {
    writeln!(
        text,
        "\n## Constants\n\n| name | value | meaning |\n| --- | --: | --- |"
    )?;
    for (name, constant) in constants.as_object().unwrap() {
        writeln!(
            text,
            "| `{name}` | {} | {} |",
            constant["value"],
            plain(&constant["doc"])
        )?;
    }
    Ok(())
}

/// A value without the quotes of a string.
fn plain(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}
