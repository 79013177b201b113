//! Robot files, scenes and settings, given to the processes that read them.

use std::fs;
use std::time::Duration;

use tests::process::{Process, wait_for};
use tests::programs::repository;
use tests::world::{Settings, World};
use toml::{Table, Value};

use super::outcome::{PATIENCE, edit, text};
use crate::report::Report;

/// Who reads a robot file.
const PROGRAMS: [&str; 3] = ["planner-daemon", "controller", "simulated-robot"];
const ROBOT: &str = "robots/unit.toml";

pub(super) fn run(report: &mut Report) -> anyhow::Result<()> {
    refusals(report);
    tendons(report);
    small_bending(report);
    defaults(report);
    solid_header(report)
}

/// How a program of a world takes its configuration.
enum Start {
    /// It ended: whether with status 1, and what it said.
    Ended(bool, String),
    /// It got ready.
    Serves,
    /// It neither ended nor got ready.
    Hung(String),
}

fn start(world: &World, name: &str, limit: Duration) -> Start {
    let config = world.config(&format!("{name}.toml"));
    let mut process = Process::start(world, name, &["--config", text(&config)]);
    let ended = wait_for("the program ends or is ready", limit, || {
        if !process.is_running() {
            return Some(true);
        }
        serves(&process.log()).then_some(false)
    });
    match ended {
        Ok(true) => {
            let status = process.wait(PATIENCE);
            Start::Ended(status.is_ok_and(|s| s.code() == Some(1)), process.log())
        }
        Ok(false) => Start::Serves,
        Err(_) => Start::Hung(process.log()),
    }
}

/// Whether a program says that it serves; each says it in its own words.
fn serves(log: &str) -> bool {
    ["ready", "loop begins", "robot begins"]
        .iter()
        .any(|text| log.contains(text))
}

impl Start {
    /// What it said, unless it serves.
    fn unless_served(self) -> Option<String> {
        match self {
            Self::Serves => None,
            Self::Hung(log) => Some(format!("hangs: {}", log.trim())),
            Self::Ended(_, log) => Some(log.trim().to_owned()),
        }
    }
}

/// One file changed, who reads it, and what the refusal must name.
struct Bad {
    what: &'static str,
    file: &'static str,
    change: fn(&mut Table),
    programs: &'static [&'static str],
    names: &'static [&'static str],
}

fn set(table: &mut Table, key: &str, value: impl Into<Value>) {
    table.insert(key.to_owned(), value.into());
}

const BAD: &[Bad] = &[
    Bad {
        what: "a tube of 10000 km",
        file: ROBOT,
        change: |robot| set(robot, "tube_radius_m", 1e7),
        programs: &PROGRAMS,
        names: &["unit.toml", "tube_radius_m = 10000000", " to "],
    },
    Bad {
        what: "four section lengths",
        file: ROBOT,
        change: |robot| set(robot, "section_lengths_m", vec![1.0; 4]),
        programs: &PROGRAMS,
        names: &["unit.toml", "section_lengths_m", "length 4", "exactly 3"],
    },
    Bad {
        what: "seven start angles",
        file: "simulated-robot.toml",
        change: |robot| set(robot, "start_configuration_rad", vec![0.0; 7]),
        programs: &["simulated-robot"],
        names: &["start_configuration_rad", "length 7", "exactly 6"],
    },
    Bad {
        what: "a start angle NaN",
        file: "simulated-robot.toml",
        change: |robot| set(robot, "start_configuration_rad", vec![f64::NAN; 6]),
        programs: &["simulated-robot"],
        names: &["start_configuration_rad = NaN", "finite"],
    },
    Bad {
        what: "a ball's centre of four numbers",
        file: "planner-daemon.toml",
        change: |daemon| {
            let scene = "[[balls]]\ncentre_m = [0.0, 1.0, 4.0, 7.0]\nradius_m = 0.1\n";
            set_scene(daemon, scene);
        },
        programs: &["planner-daemon"],
        names: &["input-scene", "centre_m", "length 4", "exactly 3"],
    },
    Bad {
        what: "voxels of 5e-324 m",
        file: "planner-daemon.toml",
        change: |daemon| {
            let heap = repository().join("tests/data/scenes/heap.npy");
            let scene = format!(
                "[[voxels]]\nfile = {heap:?}\nvoxel_m = 5e-324\nposition_m = [0.0, 0.0, -9.0]\n"
            );
            set_scene(daemon, &scene);
        },
        programs: &["planner-daemon"],
        names: &["input-scene", "voxels[0]", "voxel_m is 0.000", " to "],
    },
];

/// Writes a scene file beside the programs' temporary files and has the daemon read it.
fn set_scene(daemon: &mut Table, scene: &str) {
    let file = std::env::temp_dir().join(format!("input-scene-{}.toml", std::process::id()));
    fs::write(&file, scene).unwrap();
    let mut table = Table::new();
    set(&mut table, "file", text(&file));
    set(daemon, "scene", table);
}

fn refusals(report: &mut Report) {
    for bad in BAD {
        let mut taken = Vec::new();
        for program in bad.programs {
            let world = World::new(&Settings::default());
            edit(&world.config(bad.file), bad.change);
            taken.extend(unless_refused(&world, program, bad.names));
        }
        let name = format!("defect 11: {}: not refused with {:?}", bad.what, bad.names);
        report.none_of(&name, &taken);
    }
}

fn unless_refused(world: &World, program: &str, names: &[&str]) -> Option<String> {
    match start(world, program, Duration::from_secs(20)) {
        Start::Serves => Some(format!("{program} serves")),
        Start::Hung(log) => Some(format!("{program} neither ends nor serves: {}", log.trim())),
        Start::Ended(is_refusal, log) => {
            let missing: Vec<_> = names.iter().filter(|n| !log.contains(**n)).collect();
            let is_good = is_refusal && missing.is_empty() && !log.contains("panicked");
            (!is_good).then(|| format!("{program} does not name {missing:?}: {}", log.trim()))
        }
    }
}

/// Ten tendons: none serves them, and all say the same.
fn tendons(report: &mut Report) {
    let message = "`tendons` are 10, at most 9 are allowed";
    let mut taken = Vec::new();
    for program in PROGRAMS {
        let world = World::new(&Settings::default());
        edit(&world.config(ROBOT), |robot| {
            let tendons = robot["tendons"].as_array_mut().unwrap();
            let mut tenth = tendons[0].clone();
            set(tenth.as_table_mut().unwrap(), "angle_deg", 10.0);
            tendons.push(tenth);
        });
        taken.extend(unless_refused(&world, program, &["unit.toml", message]));
    }
    report.none_of(
        "defect 11: ten tendons, not refused with one message",
        &taken,
    );
}

/// A limit of 0.1 rad is one that a robot may have.
fn small_bending(report: &mut Report) {
    let settings = Settings {
        without_weights: true,
        ..Settings::default()
    };
    let world = World::new(&settings);
    edit(&world.config(ROBOT), |robot| {
        set(robot, "bending_limit_rad", 0.1);
    });
    let served = start(&world, "planner-daemon", PATIENCE)
        .unless_served()
        .unwrap_or_else(|| "serves".to_owned());
    let is_served = served == "serves";
    let name = "defect 11: bending_limit_rad = 0.1, a daemon without weights";
    report.check(name, served, "serves", is_served);
}

/// "Values shown are the defaults": a file of the robot alone is a configuration.
fn defaults(report: &mut Report) {
    let mut refused = Vec::new();
    for program in PROGRAMS {
        let world = World::new(&Settings::default());
        let config = world.config(&format!("{program}.toml"));
        fs::write(config, "robot = \"robots/unit.toml\"\n").unwrap();
        if let Some(said) = start(&world, program, PATIENCE).unless_served() {
            refused.push(format!("{program}: {said}"));
        }
    }
    report.none_of(
        "defect 11: files of the robot alone that are refused",
        &refused,
    );
}

/// A binary mesh whose header begins with `solid` is a binary mesh, with and without zeros in the header.
fn solid_header(report: &mut Report) -> anyhow::Result<()> {
    let mut refused = Vec::new();
    for (header, filling) in [
        ("solid part", b' '),
        ("solid", b'\0'),
        ("solid part\n", b'x'),
    ] {
        let world = World::new(&Settings::default());
        fs::write(world.config("part.stl"), tetrahedron(header, filling))?;
        let scene = "[[meshes]]\nfile = \"part.stl\"\nposition_m = [0.0, 0.0, -9.0]\n";
        fs::write(world.config("scene.toml"), scene)?;
        edit(&world.config("planner-daemon.toml"), |daemon| {
            let mut table = Table::new();
            set(&mut table, "file", "scene.toml");
            set(daemon, "scene", table);
        });
        if let Some(said) = start(&world, "planner-daemon", PATIENCE).unless_served() {
            refused.push(format!("{header:?}: {said}"));
        }
    }
    let name = "defect 10: binary STL files whose header begins with `solid`, refused";
    report.none_of(name, &refused);
    Ok(())
}

/// A closed mesh as a binary STL file has it: 80 bytes, the number of triangles, and for each of them a normal, three corners, m, and
/// two bytes.
fn tetrahedron(header: &str, filling: u8) -> Vec<u8> {
    let corners = [
        [0.0_f32, 0.0, 0.0],
        [0.1, 0.0, 0.0],
        [0.0, 0.1, 0.0],
        [0.0, 0.0, 0.1],
    ];
    let mut file = header.as_bytes().to_vec();
    file.resize(80, filling);
    file.extend(4_u32.to_le_bytes());
    for triangle in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        file.extend([0; 12]);
        let numbers = triangle.iter().flat_map(|corner: &usize| corners[*corner]);
        file.extend(numbers.flat_map(f32::to_le_bytes));
        file.extend([0; 2]);
    }
    file
}
