//! Folders of weights: the manifest, the files, and tensors that are not what the network needs.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};
use tests::programs::repository;
use tests::trial::Start;
use toml::Table;

use super::damage::{self, Damaged};
use super::keys::changes;
use super::rules::{Key, Rule, gaps, judge_text, needed, optional};
use super::variant::{Expected, Fault, Variant};

pub(super) const MANIFEST: &str = "MANIFEST.toml";
const FILE: &str = "fast.safetensors";
/// The smallest model that there is, of the ablations, is damaged: what is checked is the same.
const SOURCE: &str = "fast-width-96";

/// What the manifest says of a file, by weights/README.md.
const KEYS: &[Key] = &[
    needed("fast.file", Rule::File),
    needed("fast.sha256", Rule::OneOf(&[])),
    needed("fast.bytes", Rule::Whole(i64::MAX, i64::MIN)),
    needed("fast.architecture", Rule::OneOf(&[])),
    needed("fast.description", Rule::Text),
    needed("fast.updates", Rule::Whole(0, i64::MAX)),
    needed("fast.training_seconds", Rule::Whole(0, i64::MAX)),
    optional("fast.training_seeds", Rule::Wholes(0, i64::MAX)),
    optional("fast.measured", Rule::OneOf(&[])),
];

/// The metadata that is read.
const READ: [&str; 11] = [
    "architecture",
    "end_features",
    "ball_features",
    "coefficients",
    "estimates",
    "sections",
    "theta_max",
    "width",
    "blocks",
    "evaluations",
    "frame",
];
/// Values that no metadata which is read may have.
const VALUES: &[&str] = &[
    "",
    "nan",
    "-1",
    "0",
    "1e308",
    "18446744073709551616",
    "another",
];

/// A manifest with one file.
#[derive(Clone)]
struct Weights {
    entry: Table,
    content: Arc<Vec<u8>>,
}

/// All that is tried of weights.
pub(super) fn variants() -> Vec<Variant> {
    let weights = Weights::smallest();
    let mut all = weights.manifests();
    all.extend(weights.files());
    all.extend(weights.tensors());
    all.extend(weights.places());
    all.push(weights.clone().variant("undamaged", Expected::Taken));
    all
}

impl Weights {
    fn smallest() -> Self {
        let folder = repository().join("tests/data/ablation-weights");
        let manifest: Table = fs::read_to_string(folder.join(MANIFEST))
            .unwrap()
            .parse()
            .unwrap();
        let mut entry = manifest[SOURCE].as_table().unwrap().clone();
        let content = fs::read(folder.join(entry["file"].as_str().unwrap())).unwrap();
        entry.insert("file".into(), FILE.into());
        Self {
            entry,
            content: Arc::new(content),
        }
    }

    fn manifest(&self) -> Table {
        Table::from_iter([("fast".to_owned(), self.entry.clone().into())])
    }

    /// With other content, which the manifest then fits.
    fn signed(&self, content: Vec<u8>) -> Self {
        let mut entry = self.entry.clone();
        entry.insert("sha256".into(), hash_of(&content).into());
        entry.insert("bytes".into(), i64::try_from(content.len()).unwrap().into());
        Self {
            entry,
            content: Arc::new(content),
        }
    }

    fn variant(self, name: &str, expected: Expected) -> Variant {
        let manifest = self.manifest().to_string().into_bytes();
        self.with_manifest(name.to_owned(), manifest, expected)
    }

    fn with_manifest(&self, name: String, manifest: Vec<u8>, expected: Expected) -> Variant {
        let content = Arc::clone(&self.content);
        Variant {
            family: "weights",
            name,
            make: Box::new(move |folder| {
                fs::create_dir(folder.join("weights")).unwrap();
                fs::write(folder.join("weights").join(MANIFEST), &manifest).unwrap();
                fs::write(folder.join("weights").join(FILE), &*content).unwrap();
                start()
            }),
            expected,
        }
    }

    fn manifests(&self) -> Vec<Variant> {
        let table = self.manifest();
        let text = table.to_string().into_bytes();
        let mut all: Vec<Variant> = changes(MANIFEST, KEYS, &table)
            .into_iter()
            .map(|c| {
                self.with_manifest(
                    format!("{MANIFEST} {}", c.name),
                    c.text.into_bytes(),
                    c.expected,
                )
            })
            .collect();
        let mut bytes = damage::truncated(&text, 30);
        bytes.extend(damage::flipped(&text, 60, 31));
        bytes.extend(damage::with_surplus(&text, true));
        bytes.extend(damage::foreign());
        all.extend(bytes.into_iter().map(|d| {
            let expected = judge_manifest(&table, &d.content);
            self.with_manifest(format!("{MANIFEST} {}", d.name), d.content, expected)
        }));
        all
    }

    /// What the manifest's size and hash must find.
    fn files(&self) -> Vec<Variant> {
        let mut bytes: Vec<Damaged> = damage::truncated(&self.content, 30);
        bytes.extend(damage::flipped(&self.content, 40, 32));
        bytes.extend((0..16).map(|i| damage::flip(&self.content, i * 7, i as u32 % 8)));
        bytes.extend(damage::with_surplus(&self.content, false));
        bytes.extend(damage::foreign());
        let refused = |d: Damaged| {
            let told = differing(FILE, &self.content, &d.content);
            let weights = Self {
                content: Arc::new(d.content),
                ..self.clone()
            };
            let name = format!("{FILE} {}", d.name);
            weights.variant(&name, Expected::Refused(vec![told]))
        };
        bytes.into_iter().map(refused).collect()
    }

    /// Content that the manifest fits, and that is not what the network needs.
    fn tensors(&self) -> Vec<Variant> {
        let (header, data) = parts(&self.content);
        let names = header.keys().filter(|name| *name != "__metadata__");
        let lies = names.flat_map(|name| tensor_lies(&header, name));
        let mut all: Vec<Variant> = lies
            .map(|lie| {
                let content = with_header(&lie.header, data);
                self.signed(content).variant(&lie.name, lie.expected)
            })
            .collect();
        all.extend(self.metadata(&header, data));
        all.extend(self.wrong_content());
        all
    }

    /// Metadata with a key missing or of another value: what is read must be refused.
    fn metadata(&self, header: &Map<String, Value>, data: &[u8]) -> Vec<Variant> {
        let mut all = Vec::new();
        let mut add = |name: String, fresh: &Map<String, Value>, expected: Expected| {
            let weights = self.signed(with_header(fresh, data));
            all.push(weights.variant(&name, expected));
        };
        let expected = |key: &str, value: &str, is_refused: bool| {
            Expected::refused_if(is_refused, vec![Fault::key(FILE, key, value)])
        };
        let metadata = header["__metadata__"].as_object().unwrap();
        for key in metadata.keys() {
            let is_read = READ.contains(&key.as_str());
            let mut fresh = header.clone();
            fresh["__metadata__"].as_object_mut().unwrap().remove(key);
            // Without a frame, it is the canonical one.
            let is_refused = is_read && key != "frame";
            add(
                format!("metadata without {key}"),
                &fresh,
                expected(key, "", is_refused),
            );
            for value in VALUES {
                let mut fresh = header.clone();
                fresh["__metadata__"][key] = (*value).into();
                let name = format!("metadata {key} = {value:?}");
                add(name, &fresh, expected(key, value, is_read));
            }
        }
        for (key, value) in [("frame", "tool"), ("frame", "Canonical"), ("blocks", "3")] {
            let mut fresh = header.clone();
            fresh["__metadata__"][key] = value.into();
            let name = format!("metadata {key} = {value:?}");
            add(name, &fresh, expected(key, value, true));
        }
        all
    }

    /// A header whose length lies, and values that are not numbers.
    fn wrong_content(&self) -> Vec<Variant> {
        let mut all = Vec::new();
        let mut add = |name: String, at: usize, bytes: &[u8], fault: Fault| {
            let mut content = self.content.to_vec();
            content[at..at + bytes.len()].copy_from_slice(bytes);
            let expected = Expected::Refused(vec![fault]);
            all.push(self.signed(content).variant(&name, expected));
        };
        for length in [0_u64, 1, 2, 100_000_000, 1 << 40, u64::MAX, u64::MAX / 2] {
            let told = Fault::file(FILE).with_value(length.to_string());
            let name = format!("header of {length} bytes");
            add(name, 0, &length.to_le_bytes(), told);
        }
        let end = self.content.len();
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for at in [end - 4, end / 2 / 4 * 4 + end % 4] {
                let tensor = tensor_at(&self.content, at).unwrap();
                let told = Fault::key(FILE, &tensor, &value.to_string());
                add(format!("{value} at {at}"), at, &value.to_le_bytes(), told);
            }
        }
        all
    }

    fn places(&self) -> Vec<Variant> {
        let mut all = Vec::new();
        for file in [MANIFEST, FILE] {
            for (name, make) in damage::PLACES {
                let weights = self.clone();
                all.push(Variant {
                    family: "weights",
                    name: format!("{file} {name}"),
                    make: Box::new(move |folder| {
                        let start = (weights.clone().variant("", Expected::Taken).make)(folder);
                        fs::remove_file(folder.join("weights").join(file)).unwrap();
                        make(&folder.join("weights").join(file));
                        start
                    }),
                    expected: Expected::Refused(vec![Fault::unreadable(file), Fault::file(file)]),
                });
            }
        }
        for (name, make) in damage::PLACES {
            all.push(Variant {
                family: "weights",
                name: format!("the folder {name}"),
                make: Box::new(move |folder| {
                    make(&folder.join("weights"));
                    start()
                }),
                expected: Expected::Refused(vec![Fault::unreadable("weights")]),
            });
        }
        all.push(other_robot());
        all
    }
}

/// What a message must say of a file that its manifest does not fit: the key in which they differ, and what the file has.
pub(super) fn differing(file: &str, before: &[u8], after: &[u8]) -> Fault {
    match before.len() == after.len() {
        true => Fault::key(file, "sha256", &hash_of(after)),
        false => Fault::key(file, "bytes", &after.len().to_string()),
    }
}

/// The hash that the manifest tells of a file.
pub(super) fn hash_of(content: &[u8]) -> String {
    let digest = Sha256::digest(content);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The header and the values of a safetensors file.
pub(super) fn parts(content: &[u8]) -> (Map<String, Value>, &[u8]) {
    let (length, rest) = content.split_first_chunk().unwrap();
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap();
    let (header, data) = rest.split_at(length);
    (serde_json::from_slice(header).unwrap(), data)
}

/// The tensor that has the byte of a file, if the byte is no part of the header.
pub(super) fn tensor_at(content: &[u8], at: usize) -> Option<String> {
    let (header, data) = parts(content);
    let at = at.checked_sub(content.len() - data.len())? as u64;
    let is_there = |entry: &Value| {
        let place = entry["data_offsets"].as_array();
        place.is_some_and(|p| (p[0].as_u64()..p[1].as_u64()).contains(&Some(at)))
    };
    let mut tensors = header.into_iter();
    let found = tensors.find(|(_, entry)| is_there(entry));
    found.map(|(name, _)| name)
}

/// A header with one tensor that is not what the network needs.
pub(super) struct TensorLie {
    pub(super) name: String,
    pub(super) header: Map<String, Value>,
    pub(super) expected: Expected,
}

/// What may be wrong in the entry of a tensor: in words, the key, its value, and how a message must show that.
fn wrong_entries() -> [(&'static str, &'static str, Value, &'static str); 6] {
    [
        ("is of type F16", "dtype", json!("F16"), "F16"),
        ("is of type I32", "dtype", json!("I32"), "I32"),
        ("has shape [1]", "shape", json!([1]), "[1]"),
        ("has shape []", "shape", json!([]), "[]"),
        (
            "has an endless shape",
            "shape",
            json!([u64::MAX, 2]),
            "[18446744073709551615,2]",
        ),
        (
            "lies outside",
            "data_offsets",
            json!([0, 1_u64 << 60]),
            "[0,1152921504606846976]",
        ),
    ]
}

/// All that is tried of one tensor's entry.
pub(super) fn tensor_lies(header: &Map<String, Value>, name: &str) -> Vec<TensorLie> {
    let mut all = Vec::new();
    let mut add = |what: String, header: Map<String, Value>, told: &str, is_refused: bool| {
        let fault = vec![Fault::key("safetensors", name, told)];
        all.push(TensorLie {
            name: format!("tensor {name} {what}"),
            header,
            expected: Expected::refused_if(is_refused, fault),
        });
    };
    let mut fresh = header.clone();
    let tensor = fresh.remove(name).unwrap();
    fresh.insert(format!("{name}x"), tensor);
    add(format!("is called {name}x"), fresh, "", true);
    for (what, key, value, told) in wrong_entries() {
        let mut fresh = header.clone();
        fresh[name][key] = value;
        add(what.to_owned(), fresh, told, true);
    }
    let mut fresh = header.clone();
    let counts = fresh[name]["shape"].as_array_mut().unwrap();
    counts.reverse();
    let words: Vec<String> = counts.iter().map(Value::to_string).collect();
    let told = format!("[{}]", words.join(", "));
    let is_another = fresh[name]["shape"] != header[name]["shape"];
    add(
        "has its shape reversed".to_owned(),
        fresh,
        &told,
        is_another,
    );
    all
}

/// The bytes of a safetensors file.
pub(super) fn with_header(header: &Map<String, Value>, data: &[u8]) -> Vec<u8> {
    let text = serde_json::to_vec(header).unwrap();
    [&(text.len() as u64).to_le_bytes()[..], &text, data].concat()
}

/// Rules of which the manifest has no key, and keys of it that no rule is for.
pub(super) fn manifest_gaps() -> Vec<String> {
    gaps(MANIFEST, KEYS, &[], &Weights::smallest().manifest())
}

/// Of the manifest only what it says of the file in use is read; what it tells people about it may change.
fn judge_manifest(before: &Table, after: &[u8]) -> Expected {
    match judge_text(MANIFEST, KEYS, before, after) {
        Expected::Refused(mut faults) => {
            // The file or the name that the manifest now leads to is told.
            faults.extend([
                Fault::file(MANIFEST),
                Fault::file(FILE),
                Fault::unreadable("safetensors"),
                Fault::unreadable(MANIFEST),
            ]);
            Expected::Refused(faults)
        }
        other => other,
    }
}

/// Undamaged weights, and one case that is judged with them.
pub(super) fn undamaged(folder: &Path) -> Start {
    (Weights::smallest().variant("", Expected::Taken).make)(folder)
}

/// Judges one case with the model.
fn start() -> Start {
    let repository = repository();
    let file = |path: &str| repository.join(path).to_str().unwrap().to_owned();
    let (set, robot) = (
        file("tests/data/reference-mixed-sample"),
        file("config/robots/unit.toml"),
    );
    Start::new(
        "pcc",
        &[
            "evaluate",
            "--dataset",
            &set,
            "--planner",
            "fast",
            "--cases",
            "1",
            "--candidates",
            "1",
            "--threads",
            "1",
            "--robot",
            &robot,
            "--weights",
            "weights",
            "--out",
            "out",
        ],
    )
}

/// The shipped weights with a robot that bends less.
fn other_robot() -> Variant {
    Variant {
        family: "weights",
        name: "of a robot with another bending limit".to_owned(),
        make: Box::new(|folder: &Path| {
            symlink(repository().join("weights"), folder.join("weights")).unwrap();
            let robot = fs::read_to_string(repository().join("config/robots/unit.toml")).unwrap();
            fs::write(
                folder.join("robot.toml"),
                robot.replace("1.5707963267948966", "1.2"),
            )
            .unwrap();
            let mut start = start();
            let at = start.arguments.iter().position(|a| a == "--robot").unwrap();
            start.arguments[at + 1] = "robot.toml".into();
            start
        }),
        expected: Expected::Refused(vec![Fault::key("safetensors", "theta_max", "1.2")]),
    }
}
