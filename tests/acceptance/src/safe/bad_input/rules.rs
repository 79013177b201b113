//! What the documentation of each file allows, key by key: the judge of damaged configurations, apart from the programs' own checks.

use std::str::Utf8Error;

use toml::{Table, Value};

use super::variant::{Expected, Fault};

/// What a key may hold.
#[derive(Clone, Copy, Debug)]
pub(super) enum Rule {
    /// A number from the first to the second.
    Real(f64, f64),
    /// A whole number in the range.
    Whole(i64, i64),
    /// So many numbers in the range.
    Reals(usize, f64, f64),
    /// Any number of whole numbers in the range.
    Wholes(i64, i64),
    /// true or false.
    Truth,
    /// One of these texts.
    OneOf(&'static [&'static str]),
    /// Any text.
    Text,
    /// A file or folder that is read.
    File,
}

/// A number that must be in a closed range.
pub(super) const fn real(least: f64, most: f64) -> Rule {
    Rule::Real(least, most)
}

/// A key of a file, by its path (`tendon_limits.jerk_m_s3`, `tendons.0.radius_m`).
#[derive(Clone, Copy, Debug)]
pub(super) struct Key {
    pub(super) path: &'static str,
    pub(super) rule: Rule,
    pub(super) is_required: bool,
    /// Whether the table that it is in may be left out, and the key with it.
    pub(super) is_table_optional: bool,
}

/// A required key.
pub(super) const fn needed(path: &'static str, rule: Rule) -> Key {
    Key {
        path,
        rule,
        is_required: true,
        is_table_optional: false,
    }
}

/// A required key of a table or an entry that may be left out.
pub(super) const fn of_table(path: &'static str, rule: Rule) -> Key {
    Key {
        is_table_optional: true,
        ..needed(path, rule)
    }
}

/// A key that may be left out.
pub(super) const fn optional(path: &'static str, rule: Rule) -> Key {
    Key {
        is_required: false,
        ..needed(path, rule)
    }
}

/// What a rule says of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opinion {
    Allowed,
    Refused,
    Undocumented,
}

impl Rule {
    pub(super) fn opinion(self, value: &Value) -> Opinion {
        match (self, value) {
            (Self::Real(least, most), Value::Float(_) | Value::Integer(_)) => {
                yes(within(number_of(value), [least, most]))
            }
            (Self::Whole(least, most), Value::Integer(value)) => {
                yes((least..=most).contains(value))
            }
            (Self::Reals(count, least, most), Value::Array(values)) => yes(values.len() == count
                && values.iter().all(|v| {
                    matches!(v, Value::Float(_) | Value::Integer(_))
                        && within(number_of(v), [least, most])
                })),
            (Self::Wholes(least, most), Value::Array(values)) => yes(values
                .iter()
                .all(|v| v.as_integer().is_some_and(|v| (least..=most).contains(&v)))),
            (Self::Truth, Value::Boolean(_)) => Opinion::Allowed,
            (Self::OneOf(names), Value::String(name)) => yes(names.contains(&name.as_str())),
            (Self::Text, Value::String(_)) => Opinion::Undocumented,
            // Whether there is such a file is not for the text to say: none of the names tried exists.
            (Self::File, Value::String(_)) => Opinion::Refused,
            _ => Opinion::Refused,
        }
    }

    /// What a message must show one of, of an array: its length where that is wrong, an element that is not allowed, or what an
    /// array is called.
    pub(super) fn wrong_in(self, values: &[Value]) -> Vec<String> {
        let of_type = ["sequence", "array", "list"].map(str::to_owned);
        let (element, mut told) = match self {
            Self::Reals(count, least, most) if values.len() != count => {
                let lengths = [values.len(), values.len() + 1].map(|n| n.to_string());
                (Self::Real(least, most), Vec::from(lengths))
            }
            Self::Reals(_, least, most) => (Self::Real(least, most), Vec::new()),
            Self::Wholes(least, most) => (Self::Whole(least, most), Vec::new()),
            _ => return of_type.into(),
        };
        let said = |value: &Value| match value {
            Value::String(text) => vec![text.clone()],
            Value::Array(_) => of_type.to_vec(),
            other => vec![other.to_string()],
        };
        let wrong = values
            .iter()
            .filter(|value| element.opinion(value) == Opinion::Refused);
        told.extend(wrong.flat_map(said));
        told
    }
}

impl Key {
    /// What a message must say of a value that is refused: the key and, of an array or a table, what is wrong in it.
    pub(super) fn faults(self, file: &str, value: &Value) -> Vec<Fault> {
        let told = match value {
            Value::Array(values) => self.rule.wrong_in(values),
            Value::Table(_) => ["map", "table"].map(str::to_owned).into(),
            other => vec![said(other)],
        };
        let fault = Fault::key_one_of(file, last_part(self.path), &told);
        match (self.rule, value) {
            // The file that is named does not exist: the message may speak of that file.
            (Rule::File, Value::String(_)) => {
                let unreadable = Fault {
                    is_unreadable: true,
                    ..fault.clone()
                };
                vec![unreadable, fault]
            }
            _ => vec![fault],
        }
    }
}

/// The part of a value that a message must show.
pub(super) fn said(value: &Value) -> String {
    match value {
        // What follows is shown escaped, or as it is.
        Value::String(text) => text
            .chars()
            // One more than a message must show of a long one.
            .take(13)
            .take_while(char::is_ascii_graphic)
            .collect(),
        other => other.to_string(),
    }
}

fn yes(is_allowed: bool) -> Opinion {
    if is_allowed {
        Opinion::Allowed
    } else {
        Opinion::Refused
    }
}

fn within(number: f64, [least, most]: [f64; 2]) -> bool {
    (least..=most).contains(&number)
}

fn number_of(value: &Value) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "ranges are wide")]
    let whole = |v: i64| v as f64;
    value
        .as_float()
        .or_else(|| value.as_integer().map(whole))
        .unwrap_or(f64::NAN)
}

/// The value at a path in a table, where numbers are places in arrays.
pub(super) fn look_up<'a>(table: &'a Table, path: &str) -> Option<&'a Value> {
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    descend(table.get(first)?, rest)
}

fn descend<'a>(value: &'a Value, path: &str) -> Option<&'a Value> {
    if path.is_empty() {
        return Some(value);
    }
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    let next = match value {
        Value::Table(table) => table.get(first)?,
        Value::Array(values) => values.get(first.parse::<usize>().ok()?)?,
        _ => return None,
    };
    descend(next, rest)
}

/// The table that holds the last part of a path, and that part.
pub(super) fn holder<'a>(table: &'a mut Table, path: &str) -> (&'a mut Table, String) {
    let mut parts: Vec<&str> = path.split('.').collect();
    let last = parts.pop().unwrap().to_owned();
    let mut parts = parts.into_iter();
    let Some(first) = parts.next() else {
        return (table, last);
    };
    let mut value = table.get_mut(first).unwrap();
    for part in parts {
        value = match value {
            Value::Table(table) => table.get_mut(part).unwrap(),
            Value::Array(values) => values.get_mut(part.parse::<usize>().unwrap()).unwrap(),
            _ => panic!("{path} is not in the file"),
        };
    }
    (value.as_table_mut().unwrap(), last)
}

/// The last part of a path: what a message must name.
pub(super) fn last_part(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// What must become of a file whose text was damaged in some place: judged by what it holds afterwards.
pub(super) fn judge_text(file: &str, keys: &[Key], before: &Table, after: &[u8]) -> Expected {
    let text = match std::str::from_utf8(after) {
        Ok(text) => text,
        Err(error) => return Expected::Refused(vec![no_text(file, error)]),
    };
    let table = match text.parse::<Table>() {
        Ok(table) => table,
        Err(error) => {
            let at = error.span().map_or(text.len(), |span| span.start);
            return Expected::Refused(vec![no_table(file, text, at)]);
        }
    };
    if table == *before {
        return Expected::Taken;
    }
    let mut faults: Vec<Fault> = keys
        .iter()
        .flat_map(|key| faults_of(file, *key, before, &table))
        .collect();
    faults.extend(unknown_keys(file, keys, before, &table));
    if faults.is_empty() {
        // A name that was damaged is that of a file that is not there.
        Expected::Either(vec![Fault::file(file), Fault::unreadable(file)])
    } else {
        // Which of several faults is told first is the program's choice.
        Expected::Refused(faults)
    }
}

/// A file that is not UTF-8 from some byte on, which must be told.
pub(super) fn no_text(file: &str, error: Utf8Error) -> Fault {
    Fault::unreadable(file).with_value(error.valid_up_to().to_string())
}

/// A file that is not TOML from some byte on: the line must be told by its number, and by what it holds up to there.
fn no_table(file: &str, text: &str, at: usize) -> Fault {
    let before = text.get(..at).unwrap_or(text);
    let number = before.matches('\n').count() + 1;
    let begin = before.rfind('\n').map_or(0, |end| end + 1);
    let line = text[begin..].lines().next().unwrap_or_default();
    let mut shown = line.trim_start().split(|c: char| c.is_control());
    let shown = shown.next().unwrap_or_default().trim_end();
    let told = Fault::file(file).and(&format!("line {number}"));
    told.with_value(shown)
}

fn faults_of(file: &str, key: Key, before: &Table, after: &Table) -> Vec<Fault> {
    let Some(value) = look_up(after, key.path) else {
        let was_there = look_up(before, key.path).is_some();
        let table = key.path.rsplit_once('.').map_or("", |(table, _)| table);
        let is_left_out = key.is_table_optional && look_up(after, table).is_none();
        let is_missing = key.is_required && was_there && !is_left_out;
        let fault = is_missing.then(|| Fault::key(file, first_missing_part(after, key.path), ""));
        return fault.into_iter().collect();
    };
    let is_wrong =
        Some(value) != look_up(before, key.path) && key.rule.opinion(value) == Opinion::Refused;
    match is_wrong {
        true => key.faults(file, value),
        false => Vec::new(),
    }
}

/// The name in a path at which a table has nothing: where a list is too short, that of the list.
fn first_missing_part<'a>(table: &Table, path: &'a str) -> &'a str {
    let ends = path.match_indices('.').map(|(at, _)| at);
    let mut begins = ends.chain([path.len()]).map(|end| &path[..end]);
    let missing = begins.find(|begin| look_up(table, begin).is_none());
    let mut parts = missing.unwrap_or(path).rsplit('.');
    let is_name = |part: &&str| part.parse::<usize>().is_err();
    parts.find(is_name).unwrap_or(path)
}

/// Keys that no undamaged file has, in whatever table: every file refuses them.
fn unknown_keys(file: &str, keys: &[Key], before: &Table, after: &Table) -> Vec<Fault> {
    let known = paths(keys, before);
    let unknown = paths(keys, after);
    let unknown = unknown.iter().filter(|path| {
        let path = any_entry(path);
        !known.iter().any(|known| any_entry(known) == path)
    });
    let fault = |path: &String| {
        let part = first_unknown_part(&known, path);
        // What an array or a table holds is not told, nor what lies deeper than the first unknown name.
        let value = look_up(after, path).filter(|value| !value.is_array() && !value.is_table());
        let value = value.filter(|_| path.ends_with(part)).map(said);
        Fault::key(file, part, &value.unwrap_or_default())
    };
    unknown.map(fault).collect()
}

/// The part of a path at which it leaves all known ones: an unknown table is refused before what is in it.
fn first_unknown_part<'a>(known: &[String], path: &'a str) -> &'a str {
    let is_known = |begin: &str| {
        let begin = any_entry(begin);
        let mut known = known.iter().map(|path| any_entry(path));
        known.any(|path| path == begin || path.starts_with(&format!("{begin}.")))
    };
    let ends = path.match_indices('.').map(|(at, _)| at);
    let begins = ends.map(|end| &path[..end]);
    last_part(
        begins
            .into_iter()
            .find(|begin| !is_known(begin))
            .unwrap_or(path),
    )
}

/// A path with every place in an array left open: an entry more is not an unknown key.
fn any_entry(path: &str) -> String {
    let parts = path.split('.').map(|part| match part.parse::<usize>() {
        Ok(_) => "*",
        Err(_) => part,
    });
    parts.collect::<Vec<_>>().join(".")
}

/// The paths of all values of a table; a value that has a rule, or that is neither a table nor a list of tables, is one.
fn paths(keys: &[Key], table: &Table) -> Vec<String> {
    let mut all = Vec::new();
    for (key, value) in table {
        collect(keys, key.clone(), value, &mut all);
    }
    all
}

fn collect(keys: &[Key], path: String, value: &Value, all: &mut Vec<String>) {
    let has_rule = keys.iter().any(|key| key.path == path);
    match value {
        Value::Table(table) if !has_rule && !table.is_empty() => {
            for (key, value) in table {
                collect(keys, format!("{path}.{key}"), value, all);
            }
        }
        Value::Array(values) if !has_rule && values.iter().any(Value::is_table) => {
            for (i, value) in values.iter().enumerate() {
                collect(keys, format!("{path}.{i}"), value, all);
            }
        }
        _ => all.push(path),
    }
}

/// Rules of which the file has no key, and keys of the file that no rule is for.
pub(super) fn gaps(file: &str, keys: &[Key], others: &[Key], table: &Table) -> Vec<String> {
    let without_key = keys
        .iter()
        .filter(|key| look_up(table, key.path).is_none())
        .map(|key| format!("{file}: the rule for {} has no key", key.path));
    let has_rule = |path: &String| keys.iter().chain(others).any(|key| key.path == *path);
    let without_rule = paths(keys, table)
        .into_iter()
        .filter(|path| !has_rule(path))
        .map(|path| format!("{file}: the key {path} has no rule"));
    without_key.chain(without_rule).collect()
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn rules_have_the_opinions_that_are_documented() {
        assert_eq!(real(0.0, 1.0).opinion(&Value::Float(1.0)), Opinion::Allowed);
        assert_eq!(
            real(0.0, 1.0).opinion(&Value::Float(f64::NAN)),
            Opinion::Refused
        );
        assert_eq!(
            Rule::Whole(0, 9).opinion(&Value::Float(1.0)),
            Opinion::Refused
        );
        let four = Value::Array(vec![Value::Float(1.0); 4]);
        assert_eq!(Rule::Reals(3, 0.0, 2.0).opinion(&four), Opinion::Refused);
    }

    #[test]
    fn of_an_array_its_length_or_a_wrong_element_is_told() {
        let rule = Rule::Reals(3, 0.0, 2.0);
        let three = [0.5, 1.0, 1.5].map(Value::Float);
        assert!(rule.wrong_in(&three).is_empty());
        assert_eq!(rule.wrong_in(&three[..2]), ["2", "3"]);
        let nested = [Value::Array(three.to_vec())];
        let told = rule.wrong_in(&nested);
        assert_eq!(told, ["1", "2", "sequence", "array", "list"]);
        assert_eq!(
            rule.wrong_in(&[1.0, 9.5].map(Value::Float)),
            ["2", "3", "9.5"]
        );
    }

    #[test]
    fn an_unknown_key_is_that_at_which_a_path_leaves_the_known_ones() {
        let known = ["balls.0.radius_m", "robot"].map(str::to_owned);
        assert_eq!(first_unknown_part(&known, "Balls.0.radius_m"), "Balls");
        assert_eq!(first_unknown_part(&known, "balls.7.Radius_m"), "Radius_m");
        assert_eq!(first_unknown_part(&known, "ball.0.radius_m"), "ball");
        assert_eq!(first_unknown_part(&known, "robots"), "robots");
    }

    #[test]
    fn damaged_text_is_judged_by_what_it_holds_afterwards() {
        let keys = [needed("a", real(0.0, 1.0)), needed("b", Rule::Text)];
        let before: Table = "a = 0.5\nb = \"x\" # c".parse().unwrap();
        let class = |text: &str| judge_text("f", &keys, &before, text.as_bytes()).class();
        assert_eq!(class("a = 0.5\nb = \"x\" # d"), "must be taken");
        assert_eq!(class("a = 0.4\nb = \"x\""), "either");
        assert_eq!(class("a = 2.5\nb = \"x\""), "must be refused");
        assert_eq!(class("c = 0.5\nb = \"x\""), "must be refused");
        assert_eq!(class("a = 0.5"), "must be refused");
        assert_eq!(class("a = "), "must be refused");
        let nested: Table = "a = 0.5\nb = \"x\"\n[[c]]\nd = 1".parse().unwrap();
        let class = |text: &str| judge_text("f", &keys, &nested, text.as_bytes()).class();
        let begin = "a = 0.5\nb = \"x\"\n[[c]]\n";
        assert_eq!(class(&format!("{begin}e = 1")), "must be refused");
        assert_eq!(class(&format!("{begin}d = 2")), "either");
    }
}
