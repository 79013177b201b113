//! A data set's files: a sample, a small one made here, and what `pcc features` makes of them.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value};
use tests::programs::repository;
use tests::trial::Start;

use super::npz::{Member, npy, reals, shape};
use super::variant::{Expected, Fault, LIMIT, Variant};

pub(super) const ARCHIVE: &str = "dataset.npz";
pub(super) const META: &str = "dataset_meta.json";
/// What `pcc features` makes of a data set.
const RESULT: &str = "features.npz";
/// Rows of the small set.
pub(super) const ROWS: usize = 2;

/// A data set's two files and what `pcc features` makes of them.
pub(super) struct Set {
    pub(super) family: &'static str,
    pub(super) archive: Vec<u8>,
    pub(super) meta: Vec<u8>,
    undamaged: Arc<Vec<u8>>,
}

impl Set {
    pub(super) fn new(family: &'static str, archive: Vec<u8>, meta: Vec<u8>) -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let start = write(folder.path(), &archive, &meta);
        let outcome = start.run(folder.path(), "undamaged", LIMIT);
        let undamaged = fs::read(folder.path().join(RESULT))
            .unwrap_or_else(|_| panic!("{family}: {}", outcome.text));
        Self {
            family,
            archive,
            meta,
            undamaged: Arc::new(undamaged),
        }
    }

    pub(super) fn with(
        &self,
        name: String,
        archive: Vec<u8>,
        meta: Vec<u8>,
        expected: Expected,
    ) -> Variant {
        Variant {
            family: self.family,
            name,
            make: Box::new(move |folder| write(folder, &archive, &meta)),
            expected,
        }
    }

    /// Refused, or with the result that the undamaged set has.
    pub(super) fn refused_or_same(&self, file: &str) -> Expected {
        Expected::RefusedOrSame {
            faults: vec![Fault::file(file), Fault::unreadable(file)],
            result: RESULT,
            undamaged: Arc::clone(&self.undamaged),
        }
    }
}

pub(super) fn text_of(meta: &Map<String, Value>) -> Vec<u8> {
    serde_json::to_vec_pretty(meta).unwrap()
}

/// The arrays of a set of two rows, each path straight up to a bend, one ball a row.
pub(super) fn members() -> Vec<Member> {
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

/// The undamaged sample, and what features are made of it.
pub(super) fn sample(folder: &Path) -> Start {
    let sample = repository().join("tests/data/reference-mixed-sample");
    let read = |name: &str| fs::read(sample.join(name)).unwrap();
    write(folder, &read(ARCHIVE), &read(META))
}

/// Writes a data set and says how features are made of it.
pub(super) fn write(folder: &Path, archive: &[u8], meta: &[u8]) -> Start {
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
