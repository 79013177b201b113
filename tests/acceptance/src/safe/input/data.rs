//! Data sets: damaged, foreign, empty, and too large.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use datasets::ArchiveWriter;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use tempfile::TempDir;
use tests::programs::repository;

use super::outcome::{Outcome, pcc, pcc_within, text};
use crate::report::Report;
use crate::scale::Scale;

/// How many times as many bytes as its file the arrays of an archive may have.
const MAX_EXPANSION: u64 = 100;

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    flipped_bits(report, scale.pick(25, 1000))?;
    surplus_bytes(report)?;
    metadata(report)?;
    counted_shape(report)?;
    zeros(report, scale.pick(150_000, 1_300_000))?;
    foreign_blocks(report)?;
    nothing_kept(report)?;
    authors_keys(report)?;
    options(report);
    Ok(())
}

/// A copy of the authors' sample.
fn sample() -> anyhow::Result<TempDir> {
    let folder = tempfile::tempdir()?;
    let from = repository().join("tests/data/reference-mixed-sample");
    for file in ["dataset.npz", "dataset_meta.json"] {
        fs::copy(from.join(file), folder.path().join(file))?;
    }
    Ok(folder)
}

/// Has `pcc` read a data set.
fn read(folder: &Path) -> Outcome {
    let out = folder.join("features/rows.npz");
    pcc(&["features", "--dataset", text(folder), "--out", text(&out)])
}

fn flipped_bits(report: &mut Report, count: usize) -> anyhow::Result<()> {
    let folder = sample()?;
    let file = folder.path().join("dataset.npz");
    let whole = fs::read(&file)?;
    let good = read(folder.path());
    ensure!(good.status == Some(0), "the sample: {}", good.said);
    let mut rng = Pcg64::seed_from_u64(18);
    let mut taken = Vec::new();
    for _ in 0..count {
        let (byte, bit) = (rng.random_range(0..whole.len()), rng.random_range(0..8));
        let mut damaged = whole.clone();
        damaged[byte] ^= 1 << bit;
        fs::write(&file, damaged)?;
        let what = format!("bit {bit} of byte {byte}");
        taken.extend(read(folder.path()).unless_refused(&what, &["dataset.npz"]));
    }
    let name =
        format!("defect 11: {count} flipped bits of dataset.npz: not refused by the file's name");
    report.none_of(&name, &taken);
    Ok(())
}

fn surplus_bytes(report: &mut Report) -> anyhow::Result<()> {
    let folder = sample()?;
    let file = folder.path().join("dataset.npz");
    let whole = fs::read(&file)?;
    let mut taken = Vec::new();
    for (what, content) in [
        ("before", [b"more bytes", &whole[..]].concat()),
        ("behind", [&whole[..], b"more bytes"].concat()),
    ] {
        fs::write(&file, content)?;
        taken.extend(read(folder.path()).unless_refused(what, &["dataset.npz"]));
    }
    let name = "defect 11: surplus bytes in dataset.npz: not refused by the file's name";
    report.none_of(name, &taken);
    Ok(())
}

fn metadata(report: &mut Report) -> anyhow::Result<()> {
    let folder = sample()?;
    let file = folder.path().join("dataset_meta.json");
    let good: Value = serde_json::from_str(&fs::read_to_string(&file)?)?;
    let mut taken = Vec::new();
    for (key, value) in [
        ("clearance_margin", json!(-1.0)),
        ("sphere_radius", json!(-0.4)),
        ("sphere_radius", json!(1e300)),
        ("complete", json!(false)),
        ("actual_paths", json!(171)),
    ] {
        let mut bad = good.clone();
        bad[key] = value.clone();
        fs::write(&file, bad.to_string())?;
        let what = format!("{key} {value}");
        taken.extend(read(folder.path()).unless_refused(&what, &["dataset_meta.json", key]));
    }
    let name = "defect 11: metadata that cannot be: not refused by file and key";
    report.none_of(name, &taken);
    Ok(())
}

/// An array whose shape has more values than can be counted.
fn counted_shape(report: &mut Report) -> anyhow::Result<()> {
    let folder = sample()?;
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (6148914691236517206, 3), }";
    let header = format!("{header:117}\n");
    let array = [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes()].concat();
    ensure!(array.len() == 128, "a header of 128 bytes");
    fs::write(
        folder.path().join("dataset.npz"),
        stored_zip("paths.npy", &array),
    )?;
    let outcome = read(folder.path());
    let taken = outcome.unless_refused(
        "the shape",
        &["dataset.npz", "paths", "6148914691236517206"],
    );
    let name = "defect 11: a shape of 2^64 + 2 values: not refused by file, array and value";
    report.none_of(name, &Vec::from_iter(taken));
    Ok(())
}

/// A zip file of one member that is not compressed.
fn stored_zip(name: &str, content: &[u8]) -> Vec<u8> {
    let (size, length) = (content.len() as u32, name.len() as u16);
    let mut about = Vec::new();
    about.extend([20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0]);
    for number in [crc32(content), size, size] {
        about.extend(number.to_le_bytes());
    }
    about.extend(length.to_le_bytes());
    about.extend([0, 0]);
    let mut zip = [b"PK\x03\x04", &about[..], name.as_bytes(), content].concat();
    let start = zip.len() as u32;
    let directory = [b"PK\x01\x02\x14\x00", &about[..], &[0; 14], name.as_bytes()].concat();
    zip.extend(&directory);
    zip.extend(b"PK\x05\x06\x00\x00\x00\x00\x01\x00\x01\x00");
    zip.extend((directory.len() as u32).to_le_bytes());
    zip.extend(start.to_le_bytes());
    zip.extend([0, 0]);
    zip
}

fn crc32(content: &[u8]) -> u32 {
    let step = |sum: u32, _| (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg());
    !content.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), step)
    })
}

/// Rows of zeros, of which a small file has many, beside an array of another length.
fn zeros(report: &mut Report, rows: usize) -> anyhow::Result<()> {
    let folder = sample()?;
    let file = folder.path().join("dataset.npz");
    let mut archive = ArchiveWriter::create(&file)?;
    let numbers = rows * 64 * 6;
    archive.write(
        "paths",
        &[rows, 64, 6],
        std::iter::repeat_n(0.0_f32, numbers),
    )?;
    archive.write("target_tips", &[1, 3], [0.0_f32; 3])?;
    for array in [
        "target_indices",
        "start_indices",
        "ik_indices",
        "split_indices",
    ] {
        archive.write(array, &[rows], std::iter::repeat_n(0_i8, rows))?;
    }
    archive.write("obstacle_centres", &[0, 3], [0.0_f32; 0])?;
    archive.write(
        "obstacle_offsets",
        &[rows + 1],
        std::iter::repeat_n(0_i64, rows + 1),
    )?;
    archive.finish()?;
    let outcome = read(folder.path());
    let size = fs::metadata(&file)?.len();
    let is_endless = 4 * numbers as u64 > MAX_EXPANSION * size;
    let (by, words) = if is_endless {
        ("size and what is allowed", ["times as many", "are allowed"])
    } else {
        ("array and shape", ["target_tips", "[1, 3]"])
    };
    let taken = outcome.unless_refused("zeros", &[&["dataset.npz"][..], &words].concat());
    let mb = size as f64 * 1e-6;
    let name = format!("defect 11: {mb:.1} MB that hold {rows} rows of zeros: not refused by {by}");
    report.none_of(&name, &Vec::from_iter(taken));
    let name = "defect 11: memory that their refusal takes, MB";
    report.at_most(name, outcome.peak_mb, 60.0);
    let name = "defect 11: processor time that it takes, s";
    report.at_most(name, outcome.processor_s, 1.0);
    let name = "defect 11: time that it takes, s";
    report.at_most(name, outcome.took_s, 5.0);
    Ok(())
}

/// Makes paths by the paper's generator.
fn generate(out: &Path, words: &[&str]) -> Outcome {
    let mut all = vec!["dataset", "--method", "paper", "--setting", "obstacle-free"];
    all.extend([
        "--starts",
        "1",
        "--ends",
        "1",
        "--threads",
        "1",
        "--out",
        text(out),
    ]);
    all.extend(words);
    pcc(&all)
}

/// Blocks of another seed are not this one's, whether recipe.json is there or not.
fn foreign_blocks(report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let first = generate(
        folder.path(),
        &["--targets", "64", "--seed", "1", "--shard", "0/2"],
    );
    ensure!(first.status == Some(0), "{}", first.said);
    fs::remove_file(folder.path().join("recipe.json"))?;
    let second = generate(folder.path(), &["--targets", "64", "--seed", "2"]);
    let taken = second.unless_refused("seed 2", &["block-000000", "seed"]);
    let name = "defect 11: a block of another seed: not refused by the block's name";
    report.none_of(name, &Vec::from_iter(taken));
    Ok(())
}

/// A set of which nothing was kept is none.
fn nothing_kept(report: &mut Report) -> anyhow::Result<()> {
    let (mut refused, mut taken) = (0, Vec::new());
    for seed in 0..12 {
        let folder = tempfile::tempdir()?;
        let outcome = generate(
            folder.path(),
            &["--targets", "1", "--seed", &seed.to_string()],
        );
        let is_written = folder.path().join("dataset.npz").exists();
        let says_none = outcome.said.contains(": 0 paths");
        if outcome.status == Some(0) && !says_none {
            continue;
        }
        let names = ["0 of 1 targets", "dropped", "0 of 1 paths"];
        match outcome.unless_refused(&format!("seed {seed}"), &names) {
            None if !is_written => refused += 1,
            other => taken.push(other.unwrap_or_else(|| format!("seed {seed}: it is written"))),
        }
    }
    ensure!(refused + taken.len() > 0, "of every seed a path was kept");
    let name = format!("defect 10: sets without a path, {refused} refused: others");
    report.none_of(&name, &taken);
    Ok(())
}

/// What the expert has not, which makes no paths by steps of the tip: null in its sets, as docs/evaluation.md says.
const NOT_THE_EXPERTS: [&str; 4] = [
    "planning_policy",
    "collision_policy",
    "maximum_adjacent_configuration_step",
    "workspace_path_ik",
];

/// The metadata of both methods has the authors' keys, and their numbers add up.
fn authors_keys(report: &mut Report) -> anyhow::Result<()> {
    let meta = |folder: PathBuf| -> anyhow::Result<Value> {
        let file = folder.join("dataset_meta.json");
        Ok(serde_json::from_str(&fs::read_to_string(file)?)?)
    };
    let theirs = meta(repository().join("tests/data/reference-mixed-sample"))?;
    let mut wrong = Vec::new();
    for method in ["paper", "expert"] {
        let folder = tempfile::tempdir()?;
        let mut words = vec!["dataset", "--method", method, "--setting", "reference"];
        words.extend([
            "--targets",
            "8",
            "--starts",
            "2",
            "--ends",
            "2",
            "--seed",
            "3",
        ]);
        words.extend(["--out", text(folder.path())]);
        let made = pcc(&words);
        ensure!(made.status == Some(0), "{method}: {}", made.said);
        let ours = meta(folder.path().into())?;
        for (key, value) in theirs.as_object().context("an object")? {
            let is_same_kind = match ours.get(key) {
                None => false,
                Some(Value::Null) => method == "expert" && NOT_THE_EXPERTS.contains(&key.as_str()),
                Some(ours) => std::mem::discriminant(ours) == std::mem::discriminant(value),
            };
            if !is_same_kind {
                wrong.push(format!("{method}: {key} is {:?}", ours.get(key)));
            }
        }
        let number = |value: &Value| value.as_u64().unwrap_or(u64::MAX);
        let splits =
            ["train", "validation", "test"].map(|split| number(&ours["split_counts"][split]));
        let dropped = number(&ours["target_discarded_counts"]["total"]);
        let rows = number(&ours["actual_paths"]);
        for (what, is_so) in [
            ("split codes", ours["split_codes"] == theirs["split_codes"]),
            (
                "split counts",
                splits.iter().fold(0_u64, |a, b| a.wrapping_add(*b)) == rows,
            ),
            (
                "targets",
                number(&ours["requested_targets"])
                    == number(&ours["actual_targets"]).wrapping_add(dropped),
            ),
            ("requested paths", number(&ours["requested_paths"]) == 8 * 4),
            ("paths", number(&ours["arrays"]["paths"][0]) == rows),
        ] {
            if !is_so {
                wrong.push(format!("{method}: {what} do not add up"));
            }
        }
    }
    report.none_of(
        "defect 10: keys of the authors' metadata missing or of another kind, and counts that do not add up",
        &wrong,
    );
    Ok(())
}

fn options(report: &mut Report) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let many = u64::MAX.to_string();
    let words = ["dataset", "--targets", &many, "--out", text(&out)];
    let outcome = pcc_within(&words, Duration::from_secs(10));
    let taken = outcome.unless_refused("--targets", &["--targets", &many, "10000000"]);
    report.none_of(
        "defect 11: --targets 2^64 - 1: not refused within 10 s",
        &Vec::from_iter(taken),
    );
    let sample = repository().join("tests/data/reference-mixed-sample");
    let mut taken = Vec::new();
    for group in [i64::MAX.to_string(), "4294967296".to_owned()] {
        let group = format!("--first-group={group}");
        let words = [
            "features",
            "--dataset",
            text(&sample),
            &group,
            "--out",
            text(&out),
        ];
        taken.extend(pcc(&words).unless_refused(&group, &["--first-group", "4294967295"]));
    }
    report.none_of(
        "defect 11: groups that would wrap: not refused by what is allowed",
        &taken,
    );
}
