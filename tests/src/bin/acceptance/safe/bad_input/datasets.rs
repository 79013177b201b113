//! Data sets: the archive, its arrays, its meta data; and the archive of paths that another program proposes.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value, json};
use tests::programs::repository;
use tests::trial::Start;

use super::damage::{self, Damaged};
use super::npz::{Member, archive, contents, npy, reals, shape};
use super::variant::{Expected, Fault, Variant};

const ARCHIVE: &str = "dataset.npz";
const META: &str = "dataset_meta.json";
/// The keys of the meta data that are read.
const READ: [&str; 4] = ["format", "version", "sphere_radius", "clearance_margin"];
/// What `pcc features` makes of a data set.
const RESULT: &str = "features.npz";
/// Rows of the small set.
const ROWS: usize = 2;

/// A data set's two files and what `pcc features` makes of them.
struct Set {
    family: &'static str,
    archive: Vec<u8>,
    meta: Vec<u8>,
    undamaged: Arc<Vec<u8>>,
}

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
    fn new(family: &'static str, archive: Vec<u8>, meta: Vec<u8>) -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let start = write(folder.path(), &archive, &meta);
        let outcome = start.run(folder.path(), "undamaged", super::LIMIT);
        let undamaged = fs::read(folder.path().join(RESULT))
            .unwrap_or_else(|_| panic!("{family}: {}", outcome.text));
        Self {
            family,
            archive,
            meta,
            undamaged: Arc::new(undamaged),
        }
    }

    fn with(&self, name: String, archive: Vec<u8>, meta: Vec<u8>, expected: Expected) -> Variant {
        Variant {
            family: self.family,
            name,
            make: Box::new(move |folder| write(folder, &archive, &meta)),
            expected,
        }
    }

    /// Refused, or with the result that the undamaged set has.
    fn refused_or_same(&self, file: &str) -> Expected {
        Expected::RefusedOrSame {
            faults: vec![Fault::file(file), Fault::unreadable(file)],
            result: RESULT,
            undamaged: Arc::clone(&self.undamaged),
        }
    }

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
        for (index, (_, place)) in contents.iter().enumerate() {
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

    /// Each array with a header that lies, and too little or too much behind it.
    fn lying_arrays(&self) -> Vec<Variant> {
        let members = members();
        let mut all = Vec::new();
        for (index, member) in members.iter().enumerate() {
            for (name, npy, is_refused) in lies(&member.npy) {
                let mut fresh = members.clone();
                fresh[index].npy = npy;
                let expected = if is_refused {
                    Expected::Refused(vec![Fault::key(ARCHIVE, &member.name, "")])
                } else {
                    self.refused_or_same(ARCHIVE)
                };
                let name = format!("array {} {name}", member.name);
                all.push(self.with(name, archive(&fresh), self.meta.clone(), expected));
            }
        }
        all.extend(self.wrong_values());
        all
    }

    /// Numbers that no row may have.
    fn wrong_values(&self) -> Vec<Variant> {
        let (wrong, bent) = (
            [f32::NAN, f32::INFINITY, f32::NEG_INFINITY],
            [1e30_f32, -1e30],
        );
        let mut all = Vec::new();
        let mut add = |array: &str, index: usize, bytes: &[u8], text: String, is_refused: bool| {
            let mut fresh = members();
            let member = fresh.iter_mut().find(|m| m.name == array).unwrap();
            let begin = 128 + index * bytes.len();
            member.npy[begin..begin + bytes.len()].copy_from_slice(bytes);
            let fault = vec![Fault::key(ARCHIVE, "row", &text)];
            let expected = if is_refused {
                Expected::Refused(fault)
            } else {
                Expected::Either(fault)
            };
            all.push(self.with(
                format!("{array}[{index}] = {text}"),
                archive(&fresh),
                self.meta.clone(),
                expected,
            ));
        };
        for value in wrong.into_iter().chain(bent) {
            for index in [0, 5, ROWS * 64 * 6 - 1] {
                add(
                    "paths",
                    index,
                    &value.to_le_bytes(),
                    value.to_string(),
                    !value.is_finite(),
                );
            }
            for index in [0, 2, ROWS * 3 - 1] {
                add(
                    "target_tips",
                    index,
                    &value.to_le_bytes(),
                    value.to_string(),
                    !value.is_finite(),
                );
                add(
                    "obstacle_centres",
                    index,
                    &value.to_le_bytes(),
                    value.to_string(),
                    !value.is_finite(),
                );
            }
        }
        for code in [-1_i8, 3, i8::MIN, i8::MAX] {
            add(
                "split_indices",
                1,
                &code.to_le_bytes(),
                code.to_string(),
                true,
            );
        }
        for offset in [-1_i64, 3, i64::MAX, i64::MIN, 1 << 62] {
            for index in [0, 1, ROWS] {
                add(
                    "obstacle_offsets",
                    index,
                    &offset.to_le_bytes(),
                    offset.to_string(),
                    true,
                );
            }
        }
        all
    }

    /// Arrays missing, twice, foreign, and others in their place.
    fn damaged_members(&self) -> Vec<Variant> {
        let members = members();
        let mut all = Vec::new();
        for (index, member) in members.iter().enumerate() {
            let mut add = |name: &str, fresh: &[Member], expected: Expected| {
                let name = format!("array {} {name}", member.name);
                all.push(self.with(name, archive(fresh), self.meta.clone(), expected));
            };
            let refused = || Expected::Refused(vec![Fault::key(ARCHIVE, &member.name, "")]);
            let mut fresh = members.clone();
            fresh.remove(index);
            add("is missing", &fresh, refused());
            for name in [
                member.name.to_uppercase(),
                format!("../{}", member.name),
                String::new(),
            ] {
                let mut fresh = members.clone();
                fresh[index].name.clone_from(&name);
                add(&format!("is called {name:?}"), &fresh, refused());
            }
            let mut fresh = members.clone();
            fresh.push(member.clone());
            add("is there twice", &fresh, self.refused_or_same(ARCHIVE));
            let mut fresh = members.clone();
            fresh[index].npy = b"not an array".to_vec();
            add("is none", &fresh, refused());
            let mut fresh = members.clone();
            fresh[index].npy = members[(index + 1) % members.len()].npy.clone();
            add("is another", &fresh, refused());
        }
        all
    }

    /// The meta data's keys, of which docs/evaluation.md names those that are read.
    fn metas(&self) -> Vec<Variant> {
        let good: Map<String, Value> = serde_json::from_slice(&self.meta).unwrap();
        let mut all = Vec::new();
        let mut add = |name: String, meta: Vec<u8>, expected: Expected| {
            all.push(self.with(
                format!("{META} {name}"),
                self.archive.clone(),
                meta,
                expected,
            ));
        };
        for key in READ {
            let mut fresh = good.clone();
            fresh.remove(key);
            let refused = |value: &str| Expected::Refused(vec![Fault::key(META, key, value)]);
            add(format!("without {key}"), text_of(&fresh), refused(""));
            for value in meta_values() {
                let is_radius = matches!(key, "sphere_radius" | "clearance_margin");
                let is_taken = is_radius && value.as_f64().is_some_and(|v| v >= 0.0);
                let mut fresh = good.clone();
                fresh.insert(key.to_owned(), value.clone());
                let said = if value.is_number() {
                    value.to_string()
                } else {
                    String::new()
                };
                let fault = vec![Fault::key(META, key, &said)];
                let expected = if is_taken {
                    Expected::Either(fault)
                } else {
                    Expected::Refused(fault)
                };
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
        let refused = || Expected::Refused(vec![Fault::file(META), Fault::unreadable(META)]);
        let end = self.meta.trim_ascii_end().len();
        for d in damage::truncated(&self.meta[..end], 40)
            .into_iter()
            .chain(damage::foreign())
        {
            add(d.name, d.content, refused());
        }
        for d in damage::flipped(&self.meta, 60, 5) {
            let expected = self.judge_meta(&good, &d.content);
            add(d.name, d.content, expected);
        }
        all
    }

    /// What must come of meta data of which a bit is turned: a key that is read may then have another value that is allowed,
    /// which nothing tells.
    fn judge_meta(&self, good: &Map<String, Value>, content: &[u8]) -> Expected {
        let faults = vec![Fault::file(META), Fault::unreadable(META)];
        let Ok(fresh) = serde_json::from_slice::<Map<String, Value>>(content) else {
            return Expected::Refused(faults);
        };
        if READ.iter().all(|key| fresh.get(*key) == good.get(*key)) {
            return self.refused_or_same(META);
        }
        match READ.iter().all(|key| fresh.contains_key(*key)) {
            true => Expected::Either(faults),
            false => Expected::Refused(faults),
        }
    }
}

fn text_of(meta: &Map<String, Value>) -> Vec<u8> {
    serde_json::to_vec_pretty(meta).unwrap()
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

/// Writes a data set and says how features are made of it.
fn write(folder: &Path, archive: &[u8], meta: &[u8]) -> Start {
    fs::create_dir(folder.join("set")).unwrap();
    fs::write(folder.join("set").join(ARCHIVE), archive).unwrap();
    fs::write(folder.join("set").join(META), meta).unwrap();
    let robot = repository().join("config/robots/unit.toml");
    Start::new(
        "pcc",
        &[
            "features",
            "--dataset",
            "set",
            "--robot",
            robot.to_str().unwrap(),
            "--out",
            RESULT,
        ],
    )
}

/// Headers that lie about an array; whether each must be refused.
fn lies(good: &[u8]) -> Vec<(String, Vec<u8>, bool)> {
    let header = String::from_utf8_lossy(&good[10..128]).into_owned();
    let field = |name: &str, end: char| {
        let begin = header.find(name).unwrap() + name.len();
        header[begin..].split(end).next().unwrap().to_owned()
    };
    let (descr, counts) = (field("'descr': '", '\''), field("'shape': (", ')'));
    let (shape_text, content) = (format!("({counts})"), &good[128..]);
    let with_shape = |text: &str| npy(&descr, false, text, content);
    let mut all: Vec<(String, Vec<u8>, bool)> = [
        "()",
        "(0, )",
        "(0, 3)",
        "(1, )",
        "(2, 64)",
        "(2, 64, 6, 1)",
        "(6148914691236517206, 3)",
        "(18446744073709551615, )",
        "(4294967296, 4294967296)",
        "(9223372036854775807, 2)",
        "(-1, 3)",
        "(1000000000, 64, 6)",
        "(1.5, )",
        "('a', )",
        "(3",
    ]
    .iter()
    .map(|text| (format!("has shape {text}"), with_shape(text), true))
    .collect();
    for other in [
        "<f8", ">f4", "<f2", "<c8", "|O", "<i8", "|b1", "<U4", "|S1", "nonsense", "",
    ] {
        if other != descr {
            all.push((
                format!("has type {other}"),
                npy(other, false, &shape_text, content),
                true,
            ));
        }
    }
    let is_vector = counts.trim_end_matches([',', ' ']).find(',').is_none();
    all.push((
        "is column-major".to_owned(),
        npy(&descr, true, &shape_text, content),
        !is_vector,
    ));
    all.push((
        "lacks its last byte".to_owned(),
        good[..good.len() - 1].to_vec(),
        true,
    ));
    all.push(("lacks its content".to_owned(), good[..128].to_vec(), true));
    all.push((
        "has a byte too many".to_owned(),
        [good, &[0]].concat(),
        true,
    ));
    all.push((
        "is there twice over".to_owned(),
        [good, content].concat(),
        true,
    ));
    all.push((
        "has an endless header".to_owned(),
        [&good[..8], &[0xff, 0xff], &good[10..]].concat(),
        true,
    ));
    all.push((
        "has another magic".to_owned(),
        [b"\x93NUMPX", &good[6..]].concat(),
        true,
    ));
    all.push((
        "is of version 9".to_owned(),
        [&good[..6], &[9], &good[7..]].concat(),
        true,
    ));
    all
}

/// The arrays of a set of two rows, each path straight up to a bend, one ball a row.
fn members() -> Vec<Member> {
    let member = |name: &str, descr: &str, counts: &[usize], content: Vec<u8>| Member {
        name: name.to_owned(),
        npy: npy(descr, false, &shape(counts), &content),
    };
    let angle = |i: usize| (i / 6 % 64) as f32 * 0.01 * if i.is_multiple_of(6) { 1.0 } else { 0.2 };
    let path: Vec<f32> = (0..ROWS * 64 * 6).map(angle).collect();
    let tips = [0.9, 0.3, 2.4, 0.9, 0.3, 2.4];
    let numbers = |values: &[i64], size: usize| -> Vec<u8> {
        values
            .iter()
            .flat_map(|v| v.to_le_bytes()[..size].to_vec())
            .collect()
    };
    vec![
        member("paths", "<f4", &[ROWS, 64, 6], reals(&path)),
        member("target_tips", "<f4", &[ROWS, 3], reals(&tips)),
        member("target_indices", "<i4", &[ROWS], numbers(&[0, 1], 4)),
        member("start_indices", "<i2", &[ROWS], numbers(&[0, 0], 2)),
        member("ik_indices", "<i2", &[ROWS], numbers(&[0, 0], 2)),
        member("split_indices", "|i1", &[ROWS], numbers(&[0, 2], 1)),
        member(
            "obstacle_centres",
            "<f4",
            &[ROWS, 3],
            reals(&[-1.5, 0.0, 1.0, -1.5, 0.2, 1.0]),
        ),
        member(
            "obstacle_offsets",
            "<i8",
            &[ROWS + 1],
            numbers(&[0, 1, 2], 8),
        ),
    ]
}
