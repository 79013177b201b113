//! `pcc trace` as its users call it.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use datasets::ArchiveReader;
use pcc::{empty_folder, fixture, pcc, repository, said};
use std::path::Path;

/// A complete call with the small model of the parity test, writing into a folder of this name.
fn arguments(folder: &Path, more: &[&str]) -> Vec<String> {
    let out = folder.join("trace.npz").display().to_string();
    let robot = repository("config/robots/unit.toml");
    let weights = fixture();
    let mut words = vec!["trace", "--weights", &weights, "--model", "sampled"];
    words.extend(["--robot", &robot, "--steps", "3", "--out", &out]);
    words.extend(more);
    words.into_iter().map(str::to_owned).collect()
}

fn values(folder: &Path, name: &str, shape: &[u64]) -> Vec<f64> {
    let mut archive = ArchiveReader::open(&folder.join("trace.npz")).unwrap();
    let (values, found) = archive.read::<f64>(name).unwrap();
    assert_eq!(found, shape, "{name}");
    values
}

#[test]
fn a_trace_has_the_path_before_every_step_and_at_the_end() {
    let folder = empty_folder("trace");
    let more = [
        "--tip", "1.2", "0", "2.4", "--ball", "-1", "0", "1.5", "0.3",
    ];
    let output = pcc(&arguments(&folder, &more));
    assert!(output.status.success(), "{}", said(&output));
    let paths = values(&folder, "paths", &[4, 64, 6]);
    let tips = values(&folder, "tips", &[4, 64, 3]);
    assert!(paths.iter().chain(&tips).all(|value| value.is_finite()));
    for path in paths.chunks_exact(64 * 6) {
        assert!(
            path[..6].iter().all(|angle| angle.abs() < 1e-5),
            "it starts straight"
        );
    }
}

#[test]
fn a_random_start_is_that_of_the_seed() {
    let starts = ["1", "1", "2"].map(|seed| {
        let folder = empty_folder("trace-random");
        let more = ["--tip", "1.2", "0", "2.4", "--random-start", "--seed", seed];
        let output = pcc(&arguments(&folder, &more));
        assert!(output.status.success(), "{}", said(&output));
        values(&folder, "paths", &[4, 64, 6])[..6].to_vec()
    });
    assert_eq!(starts[0], starts[1]);
    assert_ne!(starts[0], starts[2]);
    assert!(
        starts[0].iter().any(|angle| angle.abs() > 0.05),
        "{starts:?}"
    );
}

#[test]
fn what_cannot_be_traced_is_refused_by_name() {
    let folder = empty_folder("trace-refused");
    let tip = ["--tip", "1.2", "0", "2.4"];
    let after_tip = |more: &[&'static str]| [&tip, more].concat();
    let far_balls = ["--ball", "5", "5", "5", "0.1"].repeat(65);
    for (more, status, named) in [
        (vec![], 2, "--tip"),
        (vec!["--tip", "1", "0"], 2, "--tip"),
        (
            vec!["--tip", "nan", "0", "2"],
            2,
            "a number from -1000 to 1000 section lengths is needed",
        ),
        (after_tip(&["--tip", "0", "1.2", "2.4"]), 2, "--tip"),
        (
            after_tip(&["--start", "0", "0", "0", "0", "0", "inf"]),
            2,
            "--start",
        ),
        (
            after_tip(&["--start", "0", "0", "0", "0", "0", "2"]),
            1,
            "start out of limits",
        ),
        (after_tip(&["--start", "0", "--random-start"]), 2, "--start"),
        (after_tip(&["--ball", "1", "2", "3"]), 2, "--ball"),
        (after_tip(&["--ball", "1", "2", "3", "-1"]), 1, "radius"),
        (after_tip(&far_balls), 1, "65 of --ball: at most 64"),
        (
            after_tip(&["--ball", "0", "0", "2", "0.3"]),
            1,
            "start in collision",
        ),
        (
            after_tip(&["--ball", "1.2", "0", "2.4", "0.3"]),
            1,
            "goal in collision",
        ),
        (vec!["--tip", "0", "0", "9"], 1, "goal out of reach"),
        (after_tip(&["--planner", "straight"]), 1, "diffusion-guided"),
    ] {
        let output = pcc(&arguments(&folder, &more));
        let said = said(&output);
        assert_eq!(output.status.code(), Some(status), "{more:?}: {said}");
        assert!(said.contains(named), "{more:?}: {said}");
        assert!(!said.contains("panicked"), "{more:?}: {said}");
    }
    assert!(!folder.join("trace.npz").exists());
}
