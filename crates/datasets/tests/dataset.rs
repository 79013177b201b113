//! The authors' format: a set of theirs, a set of ours, and broken ones.
#![allow(clippy::unwrap_used)] // tests

use datasets::scenes::{Setting, reference_layout};
use datasets::{
    ArchiveReader, ArchiveWriter, Counts, Dataset, DatasetError, GeneratorNotes, Meta, Recipe,
    Split, generate_block, training_rows,
};
use pcc_model::{Robot, UnitRobot};
use planning::FeatureFrame;
use std::path::{Path, PathBuf};

fn project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

fn robot() -> UnitRobot {
    let robot = Robot::from_file(&project("config/robots/unit.toml")).unwrap();
    robot.to_unit().unwrap()
}

fn recipe(setting: Setting) -> Recipe {
    Recipe {
        setting,
        seed: 3,
        starts: 2,
        ends: 3,
        trees: 1,
        test_only: false,
    }
}

#[test]
fn the_authors_sample_is_read_and_its_layouts_are_ours() {
    let robot = robot();
    let sample = Dataset::read(&project("tests/data/reference-mixed-sample")).unwrap();
    assert_eq!(sample.rows.len(), 170);
    assert_eq!(sample.cases(Split::Test, None).unwrap().len(), 60);
    assert_eq!(sample.cases(Split::Test, Some(7)).unwrap().len(), 7);
    assert!(sample.cases(Split::Train, None).unwrap().is_empty());
    for row in &sample.rows {
        let miss = (robot.tip(&row.path[63]) - row.target_tip).norm();
        assert!(miss < 2e-3, "their tips are ours: {miss}");
        let layout = reference_layout(row.balls.len());
        assert!(row.balls.iter().all(|b| {
            layout
                .iter()
                .any(|l| (l.centre - b.centre).norm() < 1e-6 && (l.radius - b.radius).abs() < 1e-6)
        }));
    }
}

#[test]
fn a_generated_set_survives_writing_and_reading() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, counts) = generate_block(&robot(), &recipe(Setting::General(Some(3))), 0..12);
    assert!(
        counts.actual_paths == rows.len() && rows.len() > 30,
        "{counts}"
    );
    Dataset {
        rows: rows.clone(),
        meta: Meta::new(serde_json::json!({})),
    }
    .write(folder.path())
    .unwrap();
    let read = Dataset::read(folder.path()).unwrap();
    assert_eq!(read.rows.len(), rows.len());
    for (a, b) in read.rows.iter().zip(&rows) {
        assert_eq!(
            (a.target_index, a.start_index, a.ik_index, a.split),
            (b.target_index, b.start_index, b.ik_index, b.split)
        );
        assert!(
            (a.path[40] - b.path[40]).norm() < 1e-6
                && (a.balls[2].radius - b.balls[2].radius).abs() < 1e-7
        );
    }
}

#[test]
fn blocks_do_not_depend_on_how_targets_are_divided() {
    let recipe = recipe(Setting::Reference(None));
    let (whole, _) = generate_block(&robot(), &recipe, 0..6);
    let (first, _) = generate_block(&robot(), &recipe, 0..2);
    let (second, _) = generate_block(&robot(), &recipe, 2..6);
    let parts: Vec<_> = first.into_iter().chain(second).map(|r| r.path).collect();
    assert_eq!(whole.into_iter().map(|r| r.path).collect::<Vec<_>>(), parts);
}

#[test]
fn broken_sets_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let meta = folder.path().join("dataset_meta.json");
    assert!(matches!(
        Dataset::read(folder.path()),
        Err(DatasetError::File(_))
    ));
    std::fs::write(&meta, r#"{"format": "pcc_diffuser_npz", "version": 24, "sphere_radius": 0.4, "clearance_margin": 0.2}"#).unwrap();
    assert!(
        Dataset::read(folder.path())
            .unwrap_err()
            .to_string()
            .contains("and 25 are needed")
    );
    std::fs::copy(
        project("tests/data/reference-mixed-sample/dataset_meta.json"),
        &meta,
    )
    .unwrap();
    assert!(matches!(
        Dataset::read(folder.path()),
        Err(DatasetError::Archive(_))
    ));
    let whole = std::fs::read(project("tests/data/reference-mixed-sample/dataset.npz")).unwrap();
    std::fs::write(folder.path().join("dataset.npz"), &whole[..whole.len() / 2]).unwrap();
    assert!(
        Dataset::read(folder.path())
            .unwrap_err()
            .to_string()
            .contains("not a readable NumPy archive")
    );
}

#[test]
fn a_set_without_balls_is_a_set_and_one_without_rows_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let counts = Counts {
        requested_targets: 2,
        ..Counts::default()
    };
    let meta = Meta {
        counts: Some(counts),
        ..Meta::new(serde_json::json!({}))
    };
    let nothing = Dataset {
        rows: Vec::new(),
        meta,
    };
    let error = nothing.write(&folder.path().join("none")).unwrap_err();
    assert!(matches!(error, DatasetError::Empty { .. }), "{error}");
    assert!(error.to_string().contains("0 of 2 targets"), "{error}");
    assert!(!folder.path().join("none").exists(), "nothing is written");
    let (rows, _) = generate_block(&robot(), &recipe(Setting::ObstacleFree), 0..2);
    let written = Dataset {
        rows,
        meta: Meta::new(serde_json::json!({})),
    };
    written.write(folder.path()).unwrap();
    let read = Dataset::read(folder.path()).unwrap();
    assert_eq!(read.rows.len(), written.rows.len());
    assert!(read.rows.iter().all(|row| row.balls.is_empty()));
    assert!(training_rows(&robot(), &read.rows, 0, FeatureFrame::Canonical).is_ok());
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 2, "nothing half-written is left");
}

#[test]
fn the_meta_data_has_every_key_of_the_authors() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, counts) = generate_block(&robot(), &recipe(Setting::General(Some(3))), 0..3);
    let meta = Meta {
        counts: Some(counts),
        generator: GeneratorNotes::of_paper(Setting::Reference(None)),
        ..Meta::new(serde_json::json!({}))
    };
    Dataset { rows, meta }.write(folder.path()).unwrap();
    let read = |folder: &Path| -> serde_json::Value {
        let text = std::fs::read_to_string(folder.join("dataset_meta.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let ours = read(folder.path());
    let theirs = read(&project("tests/data/reference-mixed-sample"));
    for (key, value) in theirs.as_object().unwrap() {
        let same = match &ours[key] {
            serde_json::Value::Null => panic!("{key} is missing"),
            other => std::mem::discriminant(other) == std::mem::discriminant(value),
        };
        assert!(same, "{key} is {}, theirs is {value}", ours[key]);
    }
    assert_eq!(ours["split_codes"], theirs["split_codes"]);
    let total = |key: &str| ours[key]["total"].as_u64().unwrap();
    let number = |key: &str| ours[key].as_u64().unwrap();
    assert_eq!(
        number("requested_targets") - number("actual_targets"),
        total("target_discarded_counts")
    );
    assert_eq!(
        number("requested_paths") - number("actual_paths"),
        total("path_failure_counts")
    );
}

/// A copy of the authors' sample of which some bytes of the archive are changed.
fn damaged(change: impl FnOnce(&mut Vec<u8>)) -> Result<Dataset, DatasetError> {
    let folder = tempfile::tempdir().unwrap();
    let sample = project("tests/data/reference-mixed-sample");
    let meta = "dataset_meta.json";
    std::fs::copy(sample.join(meta), folder.path().join(meta)).unwrap();
    let mut archive = std::fs::read(sample.join("dataset.npz")).unwrap();
    change(&mut archive);
    std::fs::write(folder.path().join("dataset.npz"), archive).unwrap();
    Dataset::read(folder.path())
}

#[test]
fn every_flipped_bit_of_the_values_and_every_surplus_byte_is_seen() {
    assert!(damaged(|_| ()).is_ok());
    for place in (1000..230_000).step_by(4787) {
        let read = damaged(|bytes| bytes[place] ^= 1 << (place % 8));
        assert!(read.is_err(), "bit {} of byte {place}", place % 8);
    }
    assert!(damaged(|bytes| bytes.push(0)).is_err(), "behind");
    assert!(damaged(|bytes| bytes.insert(0, 0)).is_err(), "before");
    let inside = |bytes: &mut Vec<u8>| {
        let directory = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        let end = bytes.len() - 6;
        let start = u32::from_le_bytes(bytes[end..end + 4].try_into().unwrap());
        assert_eq!(start as usize, directory, "the premise");
        bytes[end..end + 4].copy_from_slice(&(start + 3).to_le_bytes());
        bytes.splice(directory..directory, *b"abc");
    };
    assert!(damaged(inside).is_err(), "between");
}

#[test]
fn a_set_of_ours_knows_its_own_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, _) = generate_block(&robot(), &recipe(Setting::ObstacleFree), 0..2);
    let meta = Meta::new(serde_json::json!({}));
    Dataset { rows, meta }.write(folder.path()).unwrap();
    let file = folder.path().join("dataset.npz");
    let whole = std::fs::read(&file).unwrap();
    for place in (0..whole.len()).step_by(whole.len() / 40) {
        let mut flipped = whole.clone();
        flipped[place] ^= 0x10;
        std::fs::write(&file, flipped).unwrap();
        let error = Dataset::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("arrays_sha256"), "{place}: {error}");
    }
}

/// One row with a ball, in the widths that NumPy makes by itself.
fn write_wide(file: &Path, path_shape: &[usize], tip: f64) {
    let mut archive = ArchiveWriter::create(file).unwrap();
    archive
        .write(
            "paths",
            path_shape,
            vec![0.0_f64; path_shape.iter().product()],
        )
        .unwrap();
    archive
        .write("target_tips", &[1, 3], [1.5, 0.0, tip])
        .unwrap();
    for array in ["target_indices", "start_indices", "ik_indices"] {
        archive.write(array, &[1], [0_i64]).unwrap();
    }
    archive.write("split_indices", &[1], [2_i64]).unwrap();
    let centre = [0.5_f64, 0.0, 1.5];
    archive.write("obstacle_centres", &[1, 3], centre).unwrap();
    archive.write("obstacle_radii", &[1], [0.25_f64]).unwrap();
    archive.write("obstacle_offsets", &[2], [0_i32, 1]).unwrap();
    archive.finish().unwrap();
}

#[test]
fn arrays_of_any_width_are_read_and_shapes_and_values_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    Meta::new(serde_json::json!({}))
        .write(folder.path())
        .unwrap();
    let file = folder.path().join("dataset.npz");
    write_wide(&file, &[1, 64, 6], 2.4);
    let read = Dataset::read(folder.path()).unwrap();
    assert_eq!(read.rows[0].balls[0].radius, 0.25);
    assert_eq!(read.cases(Split::Test, None).unwrap().len(), 1);
    for (path_shape, tip, named) in [
        (&[][..], 2.4, "paths"),
        (&[1, 64], 2.4, "paths"),
        (&[2, 64, 6], 2.4, "target_tips"),
        (&[1, 64, 6], f64::NAN, "target_tips"),
    ] {
        write_wide(&file, path_shape, tip);
        let error = Dataset::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}

#[test]
fn more_trees_leave_fewer_ends_without_a_path() {
    let not_certified = |trees| {
        let hard = Recipe {
            trees,
            ..recipe(Setting::Hard)
        };
        generate_block(&robot(), &hard, 0..64).1.path_failure_counts["not_certified"]
    };
    let (one, four) = (not_certified(1), not_certified(4));
    assert!(one > 0, "some need more than one tree");
    assert!(four < one);
}

#[test]
fn training_arrays_hold_each_path_both_ways_and_their_mirror_images() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, _) = generate_block(&robot(), &recipe(Setting::General(Some(2))), 0..4);
    let arrays = training_rows(&robot(), &rows, 100, FeatureFrame::Canonical).unwrap();
    let file = folder.path().join("shard-0000.npz");
    arrays.write(&file).unwrap();
    let mut archive = ArchiveReader::open(&file).unwrap();
    let (coefficients, shape) = archive.read::<f32>("coefficients").unwrap();
    assert_eq!(shape, [4 * rows.len() as u64, 72]);
    assert_eq!(
        archive.read::<f32>("balls").unwrap().1,
        [8 * rows.len() as u64, 28]
    );
    assert!(
        archive
            .read::<i64>("group")
            .unwrap()
            .0
            .iter()
            .all(|g| (100..104).contains(g))
    );
    for pair in coefficients.chunks_exact(144) {
        let mirrored = |i: usize| {
            if i.is_multiple_of(2) {
                -pair[i]
            } else {
                pair[i]
            }
        };
        assert!((0..72).all(|i| (mirrored(i) - pair[72 + i]).abs() < 1e-5));
    }
    assert!(
        coefficients.iter().any(|c| c.abs() > 0.05),
        "the paths are not straight segments"
    );
}

#[test]
fn a_path_backwards_has_the_same_waves_from_its_other_end() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, _) = generate_block(&robot(), &recipe(Setting::General(Some(2))), 0..1);
    let file = folder.path().join("shard-0000.npz");
    let arrays = training_rows(&robot(), &rows, 0, FeatureFrame::Base).unwrap();
    arrays.write(&file).unwrap();
    let mut archive = ArchiveReader::open(&file).unwrap();
    let ends = archive.read::<f32>("ends").unwrap().0;
    assert_eq!(ends[..6], ends[2 * 36 + 6..][..6], "the start is the end");
    assert_eq!(ends[6..12], ends[2 * 36..][..6]);
    let tips = [15..18, 2 * 36 + 12..2 * 36 + 15].map(|place| ends[place].to_vec());
    assert_eq!(tips[0], tips[1], "its target is where it begins backwards");
    let coefficients = archive.read::<f32>("coefficients").unwrap().0;
    let backwards = &coefficients[2 * 72..];
    for (i, forwards) in coefficients[..72].iter().enumerate() {
        let sign = [1.0, -1.0][i / 6 % 2];
        assert!((forwards - sign * backwards[i]).abs() < 1e-6, "{i}");
    }
}

#[test]
fn training_arrays_are_in_the_frame_that_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, _) = generate_block(&robot(), &recipe(Setting::General(Some(2))), 0..1);
    let read = |frame| {
        let file = folder.path().join("shard-0000.npz");
        let arrays = training_rows(&robot(), &rows, 0, frame).unwrap();
        arrays.write(&file).unwrap();
        let mut archive = ArchiveReader::open(&file).unwrap();
        let ends = archive.read::<f32>("ends").unwrap().0;
        (archive.read::<u8>("frame").unwrap().0, ends)
    };
    let (canonical, base) = (read(FeatureFrame::Canonical), read(FeatureFrame::Base));
    assert_eq!((canonical.0, base.0), (vec![0], vec![1]));
    let start = |i: usize| rows[0].path[0][i] as f32;
    assert!((0..6).all(|i| base.1[i] == start(i)));
    let tip_y = 16; // 6 + 6 shapes, the start's tip, then the end's
    assert!(base.1[tip_y].abs() > 0.1 && canonical.1[tip_y].abs() < 1e-3);
}
