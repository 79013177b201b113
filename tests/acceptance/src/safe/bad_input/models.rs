//! Both models where `pcc evaluate` does not load them: the diffusion model by `pcc trace`, and each by the daemon.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value};
use tests::programs::repository;
use tests::trial::Start;
use tests::world::shipped;
use toml::Table;

use super::configurations::configured;
use super::damage;
use super::variant::{Expected, Fault, Variant};
use super::weights::{MANIFEST, differing, hash_of, parts, tensor_at, tensor_lies, with_header};

/// Metadata that the diffusion model must have (weights/README.md).
const NEEDED: [&str; 9] = [
    "architecture",
    "horizon",
    "steps",
    "schedule",
    "sections",
    "theta_max",
    "width",
    "context",
    "graph_hidden",
];

/// A model as it is shipped, and what loads it.
#[derive(Clone)]
struct Model {
    family: &'static str,
    /// Its name in the manifest.
    name: &'static str,
    file: &'static str,
    manifest: Table,
    content: Arc<Vec<u8>>,
    start: fn(&Path) -> Start,
}

/// Makes damaged content of the shipped one, only when it is tried: a model has 16 MB.
type Edit = Box<dyn Fn(&[u8]) -> Vec<u8> + Send + Sync>;

/// One thing that is done to a file of weights.
struct Edited {
    name: String,
    edit: Edit,
    /// Whether the manifest then fits it.
    is_signed: bool,
    expected: Expected,
}

/// All that is tried of the models.
pub(super) fn variants() -> Vec<Variant> {
    let traced = Model::new("weights, pcc trace", "mixed", trace);
    let mut all = traced.with(traced.damages(24));
    all.extend(traced.with(traced.wrong_metadata()));
    all.extend(traced.with(traced.wrong_tensors(12)));
    // A start of the daemon takes its time.
    for model in [
        Model::new("weights, planner-daemon", "fast", daemon),
        Model::new("weights, planner-daemon", "mixed", diffusing_daemon),
    ] {
        all.extend(model.with(model.damages(4)));
        all.extend(model.with(model.wrong_tensors(3)));
        all.extend(model.places());
    }
    all
}

impl Model {
    fn new(family: &'static str, name: &'static str, start: fn(&Path) -> Start) -> Self {
        let folder = repository().join("weights");
        let manifest = fs::read_to_string(folder.join(MANIFEST)).unwrap();
        let manifest: Table = manifest.parse().unwrap();
        let file = match name {
            "fast" => "fast.safetensors",
            _ => "mixed.safetensors",
        };
        Self {
            family,
            name,
            file,
            manifest,
            content: Arc::new(fs::read(folder.join(file)).unwrap()),
            start,
        }
    }

    /// Writes the folder of weights with a file of this content, which the manifest fits if it is signed; the others are as
    /// they are shipped, since the daemon with the diffusion model loads the fast one, too.
    fn write(&self, folder: &Path, content: &[u8], is_signed: bool) -> Start {
        let weights = folder.join("weights");
        fs::create_dir(&weights).unwrap();
        let mut manifest = self.manifest.clone();
        for entry in manifest.iter().filter(|(name, _)| *name != self.name) {
            let file = entry.1["file"].as_str().unwrap();
            symlink(repository().join("weights").join(file), weights.join(file)).unwrap();
        }
        if is_signed {
            let entry = manifest[self.name].as_table_mut().unwrap();
            entry.insert("sha256".into(), hash_of(content).into());
            entry.insert("bytes".into(), i64::try_from(content.len()).unwrap().into());
        }
        fs::write(weights.join(MANIFEST), manifest.to_string()).unwrap();
        fs::write(weights.join(self.file), content).unwrap();
        (self.start)(folder)
    }

    fn with(&self, all: Vec<Edited>) -> Vec<Variant> {
        let variant = |edited: Edited| {
            let model = self.clone();
            Variant {
                family: self.family,
                name: format!("{} {}", self.file, edited.name),
                make: Box::new(move |folder| {
                    let content = (edited.edit)(&model.content);
                    model.write(folder, &content, edited.is_signed)
                }),
                expected: edited.expected,
            }
        };
        all.into_iter().map(variant).collect()
    }

    /// Undamaged, cut and flipped at so many places each, and with values that are no numbers.
    fn damages(&self, count: usize) -> Vec<Edited> {
        let whole = Edited {
            name: "undamaged".to_owned(),
            edit: Box::new(<[u8]>::to_vec),
            is_signed: false,
            expected: Expected::Taken,
        };
        let length = self.content.len();
        let mut all = vec![whole];
        for at in (0..count).map(|i| i * length / count).chain([length - 1]) {
            let told = Fault::key(self.file, "bytes", &at.to_string());
            let edit = move |content: &[u8]| content[..at].to_vec();
            all.push(refused(format!("cut to {at} bytes"), edit, false, told));
        }
        for i in 0..count {
            let (at, bit) = (i * (length - 1) / count.max(2), (i % 8) as u32);
            let flipped = damage::flip(&self.content, at, bit);
            let told = differing(self.file, &self.content, &flipped.content);
            let edit = move |content: &[u8]| damage::flip(content, at, bit).content;
            all.push(refused(flipped.name, edit, false, told));
        }
        for value in [f32::NAN, f32::INFINITY] {
            let at = length - 4;
            let tensor = tensor_at(&self.content, at).unwrap();
            let told = Fault::key(self.file, &tensor, &value.to_string());
            let edit = move |content: &[u8]| [&content[..at], &value.to_le_bytes()].concat();
            all.push(refused(format!("{value} at {at}"), edit, true, told));
        }
        all
    }

    /// So many tensors, each with what is tried of one.
    fn wrong_tensors(&self, count: usize) -> Vec<Edited> {
        let (header, _) = parts(&self.content);
        let names: Vec<&String> = header.keys().filter(|n| *n != "__metadata__").collect();
        let chosen = names.iter().step_by(names.len() / count);
        let lies = chosen.flat_map(|name| tensor_lies(&header, name));
        lies.map(|lie| Edited {
            name: lie.name,
            edit: headed(lie.header),
            is_signed: true,
            expected: lie.expected,
        })
        .collect()
    }

    /// Each metadata that is needed missing, and of another value.
    fn wrong_metadata(&self) -> Vec<Edited> {
        let (header, _) = parts(&self.content);
        let mut all = Vec::new();
        for key in NEEDED {
            let mut fresh = header.clone();
            fresh["__metadata__"].as_object_mut().unwrap().remove(key);
            let told = Fault::key(self.file, key, "");
            all.push(refused(
                format!("metadata without {key}"),
                headed(fresh),
                true,
                told,
            ));
            for value in [
                "",
                "nan",
                "-1",
                "0",
                "1e308",
                "18446744073709551616",
                "another",
            ] {
                let mut fresh = header.clone();
                fresh["__metadata__"][key] = value.into();
                let told = Fault::key(self.file, key, value);
                let name = format!("metadata {key} = {value:?}");
                all.push(refused(name, headed(fresh), true, told));
            }
        }
        all
    }

    /// Something else in the place of the file and of the manifest.
    fn places(&self) -> Vec<Variant> {
        let mut all = Vec::new();
        for file in [MANIFEST, self.file] {
            for (name, make) in damage::PLACES {
                let model = self.clone();
                all.push(Variant {
                    family: self.family,
                    name: format!("{} with {file} that {name}", self.name),
                    make: Box::new(move |folder| {
                        let start = model.write(folder, &model.content, false);
                        let path = folder.join("weights").join(file);
                        fs::remove_file(&path).unwrap();
                        make(&path);
                        start
                    }),
                    expected: Expected::Refused(vec![Fault::unreadable(file), Fault::file(file)]),
                });
            }
        }
        all
    }
}

fn refused(
    name: String,
    edit: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + 'static,
    is_signed: bool,
    told: Fault,
) -> Edited {
    Edited {
        name,
        edit: Box::new(edit),
        is_signed,
        expected: Expected::Refused(vec![told]),
    }
}

/// The same values behind another header.
fn headed(header: Map<String, Value>) -> Edit {
    Box::new(move |content| with_header(&header, parts(content).1))
}

/// Draws from the diffusion model.
fn trace(_: &Path) -> Start {
    let robot = repository().join("config/robots/unit.toml");
    let mut start = Start::new(
        "pcc",
        &[
            "trace",
            "--tip",
            "0.9",
            "0.3",
            "2.4",
            "--planner",
            "diffusion",
            "--steps",
            "1",
            "--weights",
            "weights",
            "--out",
            "trace.npz",
            "--robot",
        ],
    );
    start.arguments.push(robot.into_os_string());
    start
}

/// The daemon with the fast model.
fn daemon(folder: &Path) -> Start {
    let start = configured(folder, "planner-daemon");
    let mut table = shipped("planner-daemon.toml");
    table.insert("robot".into(), "robot.toml".into());
    table.insert("weights".into(), "weights".into());
    fs::write(folder.join("planner-daemon.toml"), table.to_string()).unwrap();
    start
}

/// The daemon with the diffusion model.
fn diffusing_daemon(folder: &Path) -> Start {
    let start = daemon(folder);
    let path = folder.join("planner-daemon.toml");
    let mut table: Table = fs::read_to_string(&path).unwrap().parse().unwrap();
    let model = "model = \"mixed\"\nsolver = \"ddim\"\nprecision = \"f32\"\nsteps = 1\n";
    table.insert("diffusion".into(), model.parse::<Table>().unwrap().into());
    fs::write(path, table.to_string()).unwrap();
    start
}
