//! Weights of the paper's denoiser that the daemon and `pcc evaluate` must refuse to start with.

use std::path::Path;

use toml::{Table, Value};

use crate::process::{Process, wait_for};
use crate::programs::repository;
use crate::stack::{PATIENCE, Part};
use crate::starts::{BadStarts, Weights, edit, set};
use crate::world::{Settings, World};

/// A damage, and what the refusal must name.
type Damage = (&'static str, fn(&mut Weights), &'static str);

const DAMAGES: [Damage; 5] = [
    ("truncated", Weights::truncate, "has bytes"),
    ("wrong hash", Weights::flip_a_bit, "sha256"),
    (
        "wrong shape",
        // The stem takes 7 channels in windows of 3.
        |weights| weights.replace(",7,3]", ",3,7]"),
        "stem.weight",
    ),
    (
        "another robot's",
        |weights| weights.replace("\"theta_max\":\"1.5", "\"theta_max\":\"1.2"),
        "another robot",
    ),
    ("NaN", Weights::put_nan, "has the value NaN"),
];

/// Tries every damage of the weights that a folder has under a name.
///
/// # Panics
/// If they are not there.
#[must_use]
pub fn bad_diffusion_weights(folder: &Path, name: &str) -> BadStarts {
    let mut starts = BadStarts::default();
    for (damage_name, damage, named) in DAMAGES {
        let world = World::new(&Settings::default());
        let mut weights = read(folder, name);
        damage(&mut weights);
        configure(&world, weights, name);
        let config = world.config("planner-daemon.toml");
        let daemon = ["--config", config.to_str().unwrap()];
        starts.refuse_with(&world, ("planner-daemon", &daemon), damage_name, named);
        let evaluate = evaluation(&world, name);
        let evaluate: Vec<&str> = evaluate.iter().map(String::as_str).collect();
        starts.refuse_with(&world, ("pcc", &evaluate), damage_name, named);
    }
    starts
}

/// Starts both with the weights as they are, and says what did not go well.
///
/// # Panics
/// If they are not there.
#[must_use]
pub fn undamaged_start(folder: &Path, name: &str) -> Vec<String> {
    let mut failures = Vec::new();
    let world = World::new(&Settings::default());
    configure(&world, read(folder, name), name);
    let mut daemon = Part::Daemon.start(&world);
    let ready = wait_for("the daemon is ready", PATIENCE, || {
        let ended = !daemon.is_running();
        (ended || daemon.log().contains("ready")).then_some(!ended)
    });
    if !ready.is_ok_and(|is_ready| is_ready) {
        failures.push(format!("planner-daemon: {}", daemon.log()));
    }
    let evaluate = evaluation(&world, name);
    let evaluate: Vec<&str> = evaluate.iter().map(String::as_str).collect();
    let mut pcc = Process::start(&world, "pcc", &evaluate);
    if !pcc.wait(PATIENCE).is_ok_and(|status| status.success()) {
        failures.push(format!("pcc: {}", pcc.log()));
    }
    failures
}

fn read(folder: &Path, name: &str) -> Weights {
    Weights::read(folder, name)
        .unwrap_or_else(|| panic!("{} has no weights {name}", folder.display()))
}

/// Writes the weights beside the shipped ones of the few-step model, and has the daemon load both.
fn configure(world: &World, mut weights: Weights, name: &str) {
    let fast = read(&repository().join("weights"), "fast");
    weights.add(&fast);
    fast.write(world);
    let folder = weights.write(world);
    edit(&world.config("planner-daemon.toml"), &|daemon| {
        set(daemon, "weights", folder.to_str().unwrap());
        let mut diffusion = Table::new();
        for (key, value) in [("model", name), ("solver", "ddim"), ("precision", "f32")] {
            set(&mut diffusion, key, value);
        }
        set(&mut diffusion, "steps", 2);
        set(daemon, "diffusion", Value::Table(diffusion));
    });
}

/// `pcc evaluate` on a single case, with the weights in the world's folder.
fn evaluation(world: &World, name: &str) -> Vec<String> {
    let repository = repository();
    let in_repository = |path: &str| repository.join(path).display().to_string();
    let in_world = |path: &str| world.folder().join(path).display().to_string();
    let pairs = [
        (
            "--dataset",
            in_repository("tests/data/reference-mixed-sample"),
        ),
        ("--robot", in_repository("config/robots/unit.toml")),
        ("--planner", "diffusion".to_owned()),
        ("--weights", in_world("weights")),
        ("--model", name.to_owned()),
        ("--steps", "2".to_owned()),
        ("--candidates", "1".to_owned()),
        ("--cases", "1".to_owned()),
        ("--out", in_world("evaluation")),
    ];
    let words = pairs.map(|(key, value)| [key.to_owned(), value]);
    let command = std::iter::once("evaluate".to_owned());
    command.chain(words.into_iter().flatten()).collect()
}
