//! `pcc dataset` as its users call it.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use pcc::{empty_folder, pcc, repository, said};
use planning::dataset::Dataset;
use std::fs;
use std::path::Path;

/// Two blocks of the paper's generator, or a shard of them.
fn dataset(out: &Path, shard: &str, robot: &str) -> std::process::Output {
    let out = out.display().to_string();
    let mut words = vec!["dataset", "--method", "paper", "--setting", "obstacle-free"];
    words.extend([
        "--targets",
        "40",
        "--starts",
        "1",
        "--ends",
        "1",
        "--seed",
        "3",
    ]);
    words.extend([
        "--threads",
        "1",
        "--robot",
        robot,
        "--shard",
        shard,
        "--out",
        &out,
    ]);
    let words: Vec<String> = words.into_iter().map(str::to_owned).collect();
    pcc(&words)
}

#[test]
fn shards_together_make_the_same_files_as_one_run() {
    let robot = repository("config/robots/unit.toml");
    let folders = ["whole", "sharded"].map(|name| empty_folder(&format!("dataset-{name}")));
    for (folder, shard) in [(0, "0/1"), (1, "1/2"), (1, "0/2")] {
        let output = dataset(&folders[folder], shard, &robot);
        assert!(output.status.success(), "{}", said(&output));
        let merged = folders[folder].join("dataset.npz").exists();
        assert_eq!(
            merged,
            shard != "1/2",
            "{shard}: the shard that ends last merges"
        );
    }
    let rows = Dataset::read(&folders[0]).unwrap().rows;
    assert!(rows.len() > 20, "only {} rows", rows.len());
    for file in ["dataset.npz", "dataset_meta.json", "recipe.json"] {
        let [whole, sharded] = folders.each_ref().map(|f| fs::read(f.join(file)).unwrap());
        assert!(whole == sharded, "{file} differs");
    }
}
