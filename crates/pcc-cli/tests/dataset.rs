//! `pcc dataset` as its users call it.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use datasets::Dataset;
use pcc::{empty_folder, pcc, repository, said};
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

#[test]
fn a_folder_of_another_generator_or_of_another_robot_is_refused() {
    let folder = empty_folder("dataset-stale");
    let shipped = repository("config/robots/unit.toml");
    let made = dataset(&folder, "0/9", &shipped);
    assert!(made.status.success(), "{}", said(&made));
    let refused = |robot: &str| {
        let output = dataset(&folder, "0/9", robot);
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        assert!(
            said(&output).contains("another recipe"),
            "{}",
            said(&output)
        );
    };
    let thicker = folder.join("unit.toml");
    let text = fs::read_to_string(&shipped).unwrap();
    assert!(text.contains("tube_radius_m = 0.2"));
    let text = text.replace("tube_radius_m = 0.2", "tube_radius_m = 0.21");
    fs::write(&thicker, text).unwrap();
    refused(thicker.to_str().unwrap());
    let recipe = folder.join("recipe.json");
    let text = fs::read_to_string(&recipe).unwrap();
    let older = text.replace("\"generator\": 1", "\"generator\": 0");
    assert_ne!(older, text);
    fs::write(&recipe, older).unwrap();
    refused(&shipped);
}
