//! Every key of a TOML file removed, doubled, renamed, of another type, extreme, too long or too short.

use toml::{Table, Value};

use super::rules::{Key, Opinion, Rule, holder, last_part, look_up, said};
use super::variant::{Expected, Fault};

/// A file's text after a change to one key, and what must come of it.
pub(super) struct Changed {
    pub(super) name: String,
    pub(super) text: String,
    pub(super) expected: Expected,
}

/// Every change to every key.
pub(super) fn changes(file: &str, keys: &[Key], table: &Table) -> Vec<Changed> {
    keys.iter()
        .filter(|key| look_up(table, key.path).is_some())
        .flat_map(|key| changes_of(file, *key, table))
        .collect()
}

fn changes_of(file: &str, key: Key, table: &Table) -> Vec<Changed> {
    let name = last_part(key.path);
    let mut all = vec![
        removed(file, key, table),
        doubled(file, name, key.path, table),
    ];
    all.extend(["x", "X", ""].map(|tail| renamed(file, key.path, tail, table)));
    for value in values_for(key.rule, look_up(table, key.path).unwrap()) {
        let mut changed = table.clone();
        let (place, last) = holder(&mut changed, key.path);
        place.insert(last, value.clone());
        all.push(Changed {
            name: format!("{} = {}", key.path, shortened(&value)),
            text: changed.to_string(),
            expected: expected(file, key, &value),
        });
    }
    all
}

fn removed(file: &str, key: Key, table: &Table) -> Changed {
    let mut changed = table.clone();
    let (place, last) = holder(&mut changed, key.path);
    place.remove(&last);
    let faults = vec![Fault::key(file, &last, "")];
    Changed {
        name: format!("without {}", key.path),
        text: changed.to_string(),
        expected: Expected::refused_if(key.is_required, faults),
    }
}

/// The key's line twice; where the same key is in several tables, that of the first.
fn doubled(file: &str, name: &str, path: &str, table: &Table) -> Changed {
    let text = table.to_string();
    let begin = format!("{name} = ");
    let mut lines: Vec<&str> = text.lines().collect();
    let at = lines.iter().position(|line| line.starts_with(&begin));
    let value = at.map_or(String::new(), |at| lines[at][begin.len()..].to_owned());
    // A table is doubled as a whole by its header.
    let header = format!("[{path}]");
    match at {
        Some(at) => lines.insert(at, lines[at]),
        None => lines.push(&header),
    }
    Changed {
        name: format!("{path} twice"),
        text: lines.join("\n"),
        expected: Expected::Refused(vec![Fault::key(file, name, &value).and("duplicate")]),
    }
}

/// The key under another name; nothing for an empty tail but a second, unknown key.
fn renamed(file: &str, path: &str, tail: &str, table: &Table) -> Changed {
    let mut changed = table.clone();
    let (place, last) = holder(&mut changed, path);
    let fresh = match tail {
        "" => "extra".to_owned(),
        "X" => last.to_uppercase(),
        tail => format!("{last}{tail}"),
    };
    let mut faults = Vec::new();
    if tail.is_empty() {
        let value = Value::Integer(1);
        faults.push(Fault::key(file, &fresh, &said(&value)));
        place.insert(fresh.clone(), value);
    } else {
        let value = place.remove(&last).unwrap();
        let shown = if value.is_array() || value.is_table() {
            String::new()
        } else {
            said(&value)
        };
        faults.push(Fault::key(file, &fresh, &shown));
        faults.push(Fault::key(file, &last, ""));
        place.insert(fresh.clone(), value);
    }
    Changed {
        name: format!("{path}: {fresh}"),
        text: changed.to_string(),
        expected: Expected::Refused(faults),
    }
}

fn expected(file: &str, key: Key, value: &Value) -> Expected {
    let must_be = key.rule.opinion(value) == Opinion::Refused;
    Expected::refused_if(must_be, key.faults(file, value))
}

fn shortened(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}… ({} bytes)", &text[..end], text.len()),
        None => text,
    }
}

/// Numbers that lie at ends of ranges and types.
const REALS: &[f64] = &[
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    -1.0,
    5e-324,
    1e-300,
    1e300,
    -1e308,
    1e7,
    1.5,
];
const WHOLES: &[i64] = &[
    i64::MIN,
    -4_294_967_295,
    -2,
    -1,
    0,
    1,
    100,
    256,
    257,
    65_537,
    1_000_000,
    4_294_967_297,
    i64::MAX,
];

fn values_for(rule: Rule, now: &Value) -> Vec<Value> {
    let texts = ["", "nan", "a\u{0}b", "ä ☃", "../../../../etc/passwd"].map(Value::from);
    let mut values: Vec<Value> = REALS.iter().map(|v| Value::Float(*v)).collect();
    values.extend(WHOLES.iter().map(|v| Value::Integer(*v)));
    values.extend(texts);
    values.push(Value::String("x".repeat(100_000)));
    values.extend([
        Value::Boolean(true),
        Value::Array(Vec::new()),
        Value::Table(Table::new()),
    ]);
    values.push(Value::Array(vec![now.clone(); 2]));
    values.push(
        "1979-05-27"
            .parse::<toml::value::Datetime>()
            .unwrap()
            .into(),
    );
    if let Value::Array(items) = now {
        values.extend(arrays_for(items));
    }
    values.retain(|value| value != now && !is_nothing_new(rule, value));
    values
}

/// Text for a free text, and numbers that only repeat what is tried anyway.
fn is_nothing_new(rule: Rule, value: &Value) -> bool {
    match (rule, value) {
        (Rule::Text | Rule::File | Rule::OneOf(_) | Rule::Truth, Value::Float(v)) => *v != 1.5,
        (Rule::Text | Rule::File | Rule::OneOf(_) | Rule::Truth, Value::Integer(v)) => *v != 1,
        (Rule::Reals(..) | Rule::Wholes(..), Value::Float(v)) => *v != 1.5,
        (Rule::Reals(..) | Rule::Wholes(..), Value::Integer(v)) => *v != -1,
        _ => false,
    }
}

/// An array too short, too long, nested, and with each extreme in its first and last place.
fn arrays_for(items: &[Value]) -> Vec<Value> {
    let filler = items.first().cloned().unwrap_or(Value::Integer(0));
    let mut all: Vec<Vec<Value>> = Vec::new();
    if !items.is_empty() {
        all.push(items[..items.len() - 1].to_vec());
        for extreme in [f64::NAN, f64::INFINITY, -1.0, 1e300, 5e-324].map(Value::Float) {
            let mut fresh = items.to_vec();
            fresh[0] = extreme.clone();
            all.push(fresh.clone());
            fresh[0] = items[0].clone();
            *fresh.last_mut().unwrap() = extreme;
            all.push(fresh);
        }
        let mut mixed = items.to_vec();
        mixed[0] = "text".into();
        all.push(mixed);
    }
    all.push([items, std::slice::from_ref(&filler)].concat());
    all.push(vec![filler; 5000]);
    all.push(vec![Value::Array(items.to_vec())]);
    all.into_iter().map(Value::Array).collect()
}
