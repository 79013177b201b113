//! Data sets that are gone on with: the blocks that lie there already are damaged, or were made by another recipe.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tests::programs::repository;
use tests::trial::Start;

use super::damage::{self, Damaged};
use super::variant::{Expected, Fault, LIMIT, Variant};

const FAMILY: &str = "data set, gone on with";
/// The second of the two blocks.
const BLOCK: &str = "blocks/block-000001";
const OTHER_BLOCK: &str = "blocks/block-000000";
const RECIPE: &str = "recipe.json";
const FILES: [&str; 2] = ["dataset.npz", "dataset_meta.json"];
/// What becomes of the blocks.
const RESULT: &str = "set/dataset.npz";

/// All that is tried of blocks.
pub(super) fn variants() -> Vec<Variant> {
    let (made, other) = (Made::of_seed(1), Made::of_seed(2));
    let mut all = vec![made.with("undamaged", Vec::new(), Expected::Taken)];
    for (file, told) in [
        (format!("{BLOCK}/{}", FILES[0]), "dataset.npz"),
        (format!("{BLOCK}/{}", FILES[1]), "dataset_meta.json"),
        (RECIPE.to_owned(), RECIPE),
    ] {
        all.extend(made.damaged(&file, told));
        all.extend(made.places(&file, told));
    }
    let refused = |told| Expected::Refused(vec![Fault::file(told)]);
    let foreign = other.files_of(BLOCK, BLOCK);
    all.push(made.with(
        "with a block of another seed",
        foreign.clone(),
        refused("block-000001"),
    ));
    let mut alone = made.without(RECIPE);
    alone.replace(foreign);
    all.push(alone.with(
        "with a block of another seed and no recipe",
        Vec::new(),
        refused("block-000001"),
    ));
    let twice = made.files_of(OTHER_BLOCK, BLOCK);
    all.push(made.with("with one block as two", twice, refused("block-000001")));
    let recipe = other.files_of(RECIPE, RECIPE);
    all.push(made.with("with the recipe of another seed", recipe, refused(RECIPE)));
    all.push(made.without(RECIPE).with(
        "without a recipe",
        Vec::new(),
        made.refused_or_same(RECIPE),
    ));
    all
}

/// A set of two blocks that was interrupted before they were joined, and what they give.
#[derive(Clone)]
struct Made {
    /// Paths within the set, and contents.
    files: Vec<(String, Vec<u8>)>,
    result: Arc<Vec<u8>>,
}

impl Made {
    fn of_seed(seed: u64) -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let outcome = start(seed).run(folder.path(), "undamaged", LIMIT);
        let set = folder.path().join("set");
        let read = |file: &str| {
            let content = fs::read(set.join(file)).unwrap_or_else(|_| panic!("{}", outcome.text));
            (file.to_owned(), content)
        };
        let blocks = [OTHER_BLOCK, BLOCK].into_iter();
        let in_blocks = blocks.flat_map(|block| FILES.map(|file| format!("{block}/{file}")));
        let mut files: Vec<_> = in_blocks.map(|file| read(&file)).collect();
        files.push(read(RECIPE));
        Self {
            files,
            result: Arc::new(read(FILES[0]).1),
        }
    }

    /// The files below a path, as they would be called below another one.
    fn files_of(&self, path: &str, called: &str) -> Vec<(String, Vec<u8>)> {
        let files = self.files.iter();
        let below = files.filter_map(|(file, content)| {
            let rest = file.strip_prefix(path)?;
            Some((format!("{called}{rest}"), content.clone()))
        });
        below.collect()
    }

    fn content(&self, file: &str) -> &[u8] {
        let found = self.files.iter().find(|(name, _)| name == file);
        &found.unwrap().1
    }

    fn without(&self, file: &str) -> Self {
        let mut fresh = self.clone();
        fresh.files.retain(|(name, _)| name != file);
        fresh
    }

    fn replace(&mut self, files: Vec<(String, Vec<u8>)>) {
        for (file, content) in files {
            self.files.retain(|(name, _)| *name != file);
            self.files.push((file, content));
        }
    }

    /// Goes on with the blocks after some files were replaced.
    fn with(&self, name: &str, files: Vec<(String, Vec<u8>)>, expected: Expected) -> Variant {
        let mut fresh = self.clone();
        fresh.replace(files);
        Variant {
            family: FAMILY,
            name: name.to_owned(),
            make: Box::new(move |folder| {
                fresh.write(folder);
                start(1)
            }),
            expected,
        }
    }

    fn write(&self, folder: &Path) {
        for (file, content) in &self.files {
            let path: PathBuf = folder.join("set").join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, content).unwrap();
        }
    }

    fn refused_or_same(&self, told: &str) -> Expected {
        Expected::RefusedOrSame {
            faults: vec![Fault::file(told), Fault::unreadable(told)],
            result: RESULT,
            undamaged: Arc::clone(&self.result),
        }
    }

    fn damaged(&self, file: &str, told: &str) -> Vec<Variant> {
        let content = self.content(file);
        let mut bytes: Vec<Damaged> = damage::truncated(content, 20);
        bytes.extend(damage::flipped(content, 40, 51));
        bytes.extend(damage::with_surplus(content, false));
        bytes.extend(damage::foreign());
        let variant = |d: Damaged| {
            let name = format!("{file} {}", d.name);
            self.with(
                &name,
                vec![(file.to_owned(), d.content)],
                self.refused_or_same(told),
            )
        };
        bytes.into_iter().map(variant).collect()
    }

    fn places(&self, file: &str, told: &str) -> Vec<Variant> {
        let variant = |&(name, make): &(&'static str, fn(&Path))| {
            let (left, path) = (self.without(file), Path::new("set").join(file));
            Variant {
                family: FAMILY,
                name: format!("{file} {name}"),
                make: Box::new(move |folder| {
                    left.write(folder);
                    make(&folder.join(&path));
                    start(1)
                }),
                expected: self.refused_or_same(told),
            }
        };
        damage::PLACES.iter().map(variant).collect()
    }
}

/// Makes a set of two blocks, or goes on with it.
fn start(seed: u64) -> Start {
    let robot = repository().join("config/robots/unit.toml");
    let mut start = Start::new(
        "pcc",
        &[
            "dataset",
            "--setting",
            "obstacle-free",
            "--targets",
            "40",
            "--starts",
            "1",
            "--ends",
            "1",
            "--threads",
            "1",
            "--robot",
            robot.to_str().unwrap(),
            "--out",
            "set",
            "--seed",
        ],
    );
    start.arguments.push(seed.to_string().into());
    start
}
