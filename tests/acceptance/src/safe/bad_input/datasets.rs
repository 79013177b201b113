//! Data sets: the archive, its arrays, its meta data.

use std::fs;

use serde_json::{Map, Value, json};
use tests::programs::repository;

use super::damage::{self, Damaged};
use super::dataset_files::{ARCHIVE, META, ROWS, Set, members, text_of, write};
use super::npz::{archive, contents};
use super::rules::no_text;
use super::variant::{Expected, Fault, Variant};

/// The keys of the meta data that are read.
const READ: [&str; 4] = ["format", "version", "sphere_radius", "clearance_margin"];
/// The sample's metadata, with the counts of [`members`].
fn meta_of_two(sample: &[u8]) -> Vec<u8> {
    let mut meta: Map<String, Value> = serde_json::from_slice(sample).unwrap();
    let counts = serde_json::json!({ "train": 1, "validation": 0, "test": 1 });
    meta.insert("split_counts".to_owned(), counts);
    meta.insert("actual_paths".to_owned(), ROWS.into());
    text_of(&meta)
}

/// All that is tried of data sets.
pub(super) fn variants() -> Vec<Variant> {
    let sample = repository().join("tests/data/reference-mixed-sample");
    let read = |name: &str| fs::read(sample.join(name)).unwrap();
    let meta = read(META);
    let sample = Set::new("data set, compressed", read(ARCHIVE), meta.clone());
    let small = Set::new("data set, stored", archive(&members()), meta_of_two(&meta));
    let mut all = Vec::new();
    for (set, seed) in [(&sample, 1), (&small, 2)] {
        all.extend(set.damaged_archives(seed));
        all.extend(set.places());
        all.push(set.with(
            "undamaged".to_owned(),
            set.archive.clone(),
            set.meta.clone(),
            Expected::Taken,
        ));
    }
    all.extend(small.lying_arrays());
    all.extend(small.damaged_members());
    all.extend(small.metas());
    all
}

impl Set {
    /// A bit of an array's content is guarded by the archive's checksum; of what else there is, some has no meaning.
    fn damaged_archives(&self, seed: u64) -> Vec<Variant> {
        let contents = contents(&self.archive);
        let refused = || Expected::Refused(vec![Fault::file(ARCHIVE)]);
        let mut all: Vec<(Damaged, Expected)> = Vec::new();
        let mut add = |damaged: Vec<Damaged>, expected: &dyn Fn() -> Expected| {
            all.extend(damaged.into_iter().map(|d| (d, expected())));
        };
        add(damage::truncated(&self.archive, 80), &refused);
        add(damage::foreign(), &refused);
        add(damage::flipped(&self.archive, 100, seed), &|| {
            self.refused_or_same(ARCHIVE)
        });
        add(damage::with_surplus(&self.archive, false), &|| {
            self.refused_or_same(ARCHIVE)
        });
        let within = |damaged: Vec<Damaged>, place: &std::ops::Range<usize>| {
            let whole = |d: Damaged| Damaged {
                name: format!("content at {}: {}", place.start, d.name),
                content: [
                    &self.archive[..place.start],
                    &d.content,
                    &self.archive[place.end..],
                ]
                .concat(),
            };
            damaged.into_iter().map(whole).collect::<Vec<_>>()
        };
        for (index, (name, place)) in contents.iter().enumerate() {
            let array = name.trim_end_matches(".npy");
            let refused = || Expected::Refused(vec![Fault::key(ARCHIVE, array, "")]);
            let flipped = damage::flipped(&self.archive[place.clone()], 12, seed + index as u64);
            add(within(flipped, place), &refused);
        }
        let directory = contents.last().unwrap().1.end..self.archive.len();
        let flipped = damage::flipped(&self.archive[directory.clone()], 80, seed + 100);
        add(within(flipped, &directory), &|| {
            self.refused_or_same(ARCHIVE)
        });
        all.into_iter()
            .map(|(d, expected)| {
                self.with(
                    format!("{ARCHIVE} {}", d.name),
                    d.content,
                    self.meta.clone(),
                    expected,
                )
            })
            .collect()
    }

    fn places(&self) -> Vec<Variant> {
        let mut all = Vec::new();
        for file in [ARCHIVE, META] {
            for (name, make) in damage::PLACES {
                let (archive, meta) = (self.archive.clone(), self.meta.clone());
                all.push(Variant {
                    family: self.family,
                    name: format!("{file} {name}"),
                    make: Box::new(move |folder| {
                        let start = write(folder, &archive, &meta);
                        fs::remove_file(folder.join("set").join(file)).unwrap();
                        make(&folder.join("set").join(file));
                        start
                    }),
                    expected: Expected::Refused(vec![Fault::unreadable(file), Fault::file(file)]),
                });
            }
        }
        all
    }

    /// The meta data's keys, of which docs/evaluation.md names those that are read.
    fn metas(&self) -> Vec<Variant> {
        let good: Map<String, Value> = serde_json::from_slice(&self.meta).unwrap();
        let mut all = Vec::new();
        let mut add = |name: String, meta: Vec<u8>, expected: Expected| {
            all.push(self.with_meta(&name, meta, expected));
        };
        for key in READ {
            let mut fresh = good.clone();
            fresh.remove(key);
            let refused = |value: &str| Expected::Refused(vec![Fault::key(META, key, value)]);
            add(format!("without {key}"), text_of(&fresh), refused(""));
            for value in meta_values() {
                let is_radius = matches!(key, "sphere_radius" | "clearance_margin");
                let is_taken =
                    is_radius && value.as_f64().is_some_and(|v| (0.0..=1e7).contains(&v));
                let mut fresh = good.clone();
                fresh.insert(key.to_owned(), value.clone());
                let fault = vec![fault_of(key, &value)];
                let expected = Expected::refused_if(!is_taken, fault);
                add(format!("{key} = {value}"), text_of(&fresh), expected);
            }
        }
        for key in good.keys() {
            let mut fresh = good.clone();
            fresh.insert(key.clone(), json!({"foreign": [1]}));
            if !READ.contains(&key.as_str()) {
                add(
                    format!("{key} is foreign"),
                    text_of(&fresh),
                    self.refused_or_same(META),
                );
            }
        }
        all.extend(self.damaged_metas(&good));
        all
    }

    fn with_meta(&self, name: &str, meta: Vec<u8>, expected: Expected) -> Variant {
        self.with(
            format!("{META} {name}"),
            self.archive.clone(),
            meta,
            expected,
        )
    }

    /// Meta data cut, foreign, and with bits turned.
    fn damaged_metas(&self, good: &Map<String, Value>) -> Vec<Variant> {
        let mut all = Vec::new();
        let mut add = |d: Damaged, expected: Expected| {
            all.push(self.with_meta(&d.name, d.content, expected));
        };
        let end = self.meta.trim_ascii_end().len();
        for d in damage::truncated(&self.meta[..end], 40)
            .into_iter()
            .chain(damage::foreign())
        {
            let expected = Expected::Refused(faults_of_text(&d.content));
            add(d, expected);
        }
        for d in damage::flipped(&self.meta, 60, 5) {
            let expected = self.judge_meta(good, &d.content);
            add(d, expected);
        }
        all
    }

    /// What must come of meta data of which a bit is turned: a key that is read may then have another value that is allowed,
    /// which nothing tells.
    fn judge_meta(&self, good: &Map<String, Value>, content: &[u8]) -> Expected {
        let Ok(fresh) = serde_json::from_slice::<Map<String, Value>>(content) else {
            return Expected::Refused(faults_of_text(content));
        };
        let changed = READ
            .into_iter()
            .filter(|key| fresh.get(*key) != good.get(*key));
        let fault = |key: &str| match fresh.get(key) {
            Some(value) => fault_of(key, value),
            None => Fault::key(META, key, ""),
        };
        let faults: Vec<Fault> = changed.map(fault).collect();
        if faults.is_empty() {
            return self.refused_or_same(META);
        }
        let is_whole = READ.iter().all(|key| fresh.contains_key(*key));
        Expected::refused_if(!is_whole, faults)
    }
}

/// The key of the meta data, and its value or what a value of its type is called.
fn fault_of(key: &str, value: &Value) -> Fault {
    let told = match value {
        Value::String(text) if text.is_empty() => "\"\"".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(_) => "sequence".to_owned(),
        Value::Object(_) => "map".to_owned(),
        other => other.to_string(),
    };
    Fault::key(META, key, &told)
}

/// What a message must say of meta data that is no text, no JSON, or lacks keys: where, and which.
fn faults_of_text(content: &[u8]) -> Vec<Fault> {
    let text = match std::str::from_utf8(content) {
        Ok(text) => text,
        Err(error) => return vec![no_text(META, error)],
    };
    match serde_json::from_str::<Value>(text) {
        Ok(value) => {
            let missing = READ.into_iter().filter(|key| value.get(key).is_none());
            missing.map(|key| Fault::key(META, key, "")).collect()
        }
        Err(error) => {
            let told = Fault::file(META).and(&format!("line {}", error.line()));
            // Of two values, the first is refused before the second is seen.
            let column = |at: usize| format!("column {at}");
            let before = column(error.column().saturating_sub(1));
            vec![told.with_value(column(error.column())).or_value(before)]
        }
    }
}

fn meta_values() -> Vec<Value> {
    vec![
        json!(-1),
        json!(-0.5),
        json!(0),
        json!(1e308),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(24),
        json!(26.5),
        json!("25"),
        json!(""),
        json!(true),
        json!(null),
        json!([25]),
        json!({}),
        json!("x".repeat(5000)),
    ]
}
