//! Robot files, configurations of the three processes, and scene files.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use tests::programs::repository;
use tests::trial::Start;
use tests::world::shipped;
use toml::{Table, Value};

use super::damage::{self, Damaged};
use super::keys::changes;
use super::rules::{Key, Rule, gaps, judge_text, needed, of_table, optional, real};
use super::variant::{Expected, Fault, Variant};

/// Distances of a tendon from the backbone.
const TENDON_RADIUS: Rule = real(1e-6, 1e3);
/// Angles of a tendon around the backbone.
const TENDON_ANGLE: Rule = real(-360.0, 360.0);

/// `config/robots/unit.toml`: the ranges that the file's comments document.
const ROBOT: &[Key] = &[
    needed("name", Rule::Text),
    needed("section_lengths_m", Rule::Reals(3, 1e-4, 1e3)),
    needed("bending_limit_rad", real(0.01, std::f64::consts::PI)),
    // The length of the shortest section.
    needed("tube_radius_m", real(0.0, 1.0)),
    needed("spool_radius_m", real(1e-6, 1e3)),
    needed("tendon_limits.velocity_m_s", real(1e-7, 1e4)),
    needed("tendon_limits.acceleration_m_s2", real(1e-7, 1e5)),
    needed("tendon_limits.jerk_m_s3", real(1e-7, 1e6)),
    needed("tendons.0.section", Rule::Whole(1, 3)),
    needed("tendons.0.radius_m", TENDON_RADIUS),
    needed("tendons.0.angle_deg", TENDON_ANGLE),
    needed("tendons.1.section", Rule::Whole(1, 3)),
    needed("tendons.1.radius_m", TENDON_RADIUS),
    needed("tendons.1.angle_deg", TENDON_ANGLE),
    needed("tendons.2.section", Rule::Whole(1, 3)),
    needed("tendons.2.radius_m", TENDON_RADIUS),
    needed("tendons.2.angle_deg", TENDON_ANGLE),
    needed("tendons.3.section", Rule::Whole(1, 3)),
    needed("tendons.3.radius_m", TENDON_RADIUS),
    needed("tendons.3.angle_deg", TENDON_ANGLE),
    needed("tendons.4.section", Rule::Whole(1, 3)),
    needed("tendons.4.radius_m", TENDON_RADIUS),
    needed("tendons.4.angle_deg", TENDON_ANGLE),
    needed("tendons.5.section", Rule::Whole(1, 3)),
    needed("tendons.5.radius_m", TENDON_RADIUS),
    needed("tendons.5.angle_deg", TENDON_ANGLE),
    needed("tendons.6.section", Rule::Whole(1, 3)),
    needed("tendons.6.radius_m", TENDON_RADIUS),
    needed("tendons.6.angle_deg", TENDON_ANGLE),
    needed("tendons.7.section", Rule::Whole(1, 3)),
    needed("tendons.7.radius_m", TENDON_RADIUS),
    needed("tendons.7.angle_deg", TENDON_ANGLE),
    needed("tendons.8.section", Rule::Whole(1, 3)),
    needed("tendons.8.radius_m", TENDON_RADIUS),
    needed("tendons.8.angle_deg", TENDON_ANGLE),
];

/// `config/controller.toml`.
const CONTROLLER: &[Key] = &[
    needed("robot", Rule::File),
    optional("rate_hz", Rule::Whole(100, 4000)),
    optional("realtime_priority", Rule::Whole(0, 99)),
    optional("processor", Rule::Whole(-1, 9999)),
    optional("lock_memory", Rule::Truth),
    optional("step_cap_ms", real(2.0, 100.0)),
    optional("late_run_ms", Rule::Whole(10, 1000)),
    optional("robot_lost_ms", Rule::Whole(5, 1000)),
    optional("tracking_filter_ms", real(0.0, 1000.0)),
    optional(
        "hold_tolerance_rad",
        real(f64::from_bits(1), 1.0 - f64::EPSILON),
    ),
    optional("begin_past_ms", Rule::Whole(0, 1000)),
    optional("begin_ahead_s", Rule::Whole(1, 3600)),
    // 1 to 39 are refused, too.
    optional("daemon_lost_ms", Rule::Whole(0, 10_000)),
];

/// `config/simulated-robot.toml`.
const SIMULATED: &[Key] = &[
    needed("robot", Rule::File),
    optional("rate_hz", Rule::Whole(100, 4000)),
    optional("realtime_priority", Rule::Whole(0, 99)),
    optional("lost_setpoint_ms", Rule::Whole(5, 1000)),
    optional("limit_allowance", real(1.0, 2.0)),
    optional("motor_margin", real(1.0, 10.0)),
    optional("natural_frequency_rad_s", real(1.0, 500.0)),
    optional("backlash", real(0.0, 0.01)),
    optional("noise", real(0.0, 0.01)),
    optional("seed", Rule::Whole(0, i64::MAX)),
    optional("start_configuration_rad", Rule::Reals(6, -1.58, 1.58)),
    optional("remembers_pose", Rule::Truth),
    optional("stuck_tendon", Rule::Whole(0, 8)),
];

/// `config/planner-daemon.toml`, with its tables.
const DAEMON: &[Key] = &[
    needed("robot", Rule::File),
    optional("threads", Rule::Whole(1, 64)),
    optional("candidates", Rule::Whole(1, 64)),
    optional("knots_per_candidate", Rule::Whole(16, 256)),
    optional("clients", Rule::Whole(1, 64)),
    optional("requests_per_client", Rule::Whole(1, 16)),
    optional("queued_per_client", Rule::Whole(1, 16)),
    optional("default_deadline_ms", real(f64::MIN_POSITIVE, 60_000.0)),
    optional("path_tolerance_rad", real(0.001, 0.1)),
    optional("begin_lead_ms", real(10.0, 1000.0)),
    optional("wait", Rule::OneOf(&["event", "poll"])),
    optional("planner", Rule::OneOf(&["pcc", "null"])),
    optional("realtime_priority", Rule::Whole(0, 68)),
    optional("processors", Rule::Wholes(0, 1023)),
    optional("lock_memory", Rule::Truth),
    optional("shared_memory_budget_mb", real(1.0, 100_000.0)),
    optional("resident_memory_budget_mb", real(1.0, 100_000.0)),
    of_table("scene.file", Rule::File),
    optional("live_scene.expected", Rule::Truth),
];

/// The daemon's model of the paper.
const DIFFUSION: &[Key] = &[
    optional("weights", Rule::File),
    needed("diffusion.model", Rule::OneOf(&["mixed"])),
    needed("diffusion.solver", Rule::OneOf(&["ddim", "dpm-solver"])),
    needed("diffusion.steps", Rule::Whole(1, 1000)),
    needed("diffusion.precision", Rule::OneOf(&["f32", "bf16"])),
];

/// Coordinates within the extent of a scene, 1e7.
const PLACE: Rule = Rule::Reals(3, -1e7, 1e7);
/// Radii that are above 0.
const RADIUS: Rule = real(f64::MIN_POSITIVE, 1e7);

/// `tests/data/scenes/workshop.toml`.
const SCENE: &[Key] = &[
    of_table("balls.0.centre_m", PLACE),
    of_table("balls.0.radius_m", real(0.0, 1e7)),
    of_table("balls.1.centre_m", PLACE),
    of_table("balls.1.radius_m", real(0.0, 1e7)),
    of_table("capsules.0.from_m", PLACE),
    of_table("capsules.0.to_m", PLACE),
    of_table("capsules.0.radius_m", RADIUS),
    of_table("boxes.0.sides_m", Rule::Reals(3, f64::MIN_POSITIVE, 1e7)),
    of_table("boxes.0.position_m", PLACE),
    optional(
        "boxes.0.rotation_vector_rad",
        Rule::Reals(3, f64::MIN, f64::MAX),
    ),
    of_table("meshes.0.file", Rule::File),
    optional("meshes.0.unit_m", RADIUS),
    of_table("meshes.0.position_m", PLACE),
    optional("meshes.0.quaternion_xyzw", Rule::Reals(4, -1.001, 1.001)),
    of_table("meshes.1.file", Rule::File),
    of_table("meshes.1.position_m", PLACE),
    of_table("voxels.0.file", Rule::File),
    of_table("voxels.0.voxel_m", real(1e-9, 1e6)),
    of_table("voxels.0.position_m", PLACE),
];

/// A program, the file of its that is damaged, and what lies beside it.
#[derive(Clone)]
struct Subject {
    family: &'static str,
    file: &'static str,
    keys: &'static [Key],
    content: Vec<u8>,
    start: Arc<dyn Fn(&Path) -> Start + Send + Sync>,
}

/// All that is tried of these files.
pub(super) fn variants() -> Vec<Variant> {
    let mut all = Vec::new();
    for (index, program) in ["controller", "simulated-robot", "planner-daemon", "pcc"]
        .into_iter()
        .enumerate()
    {
        all.extend(robot_file(program).variants(index as u64));
    }
    all.extend(configuration("controller", CONTROLLER).variants(10));
    all.extend(configuration("simulated-robot", SIMULATED).variants(11));
    all.extend(configuration("planner-daemon", DAEMON).variants(12));
    all.extend(diffusion().key_variants());
    all.extend(scene().variants(13));
    all.extend(numbers_of_tendons());
    all
}

/// Rules of which a file has no key, and keys of a file that no rule is for.
pub(super) fn all_gaps() -> Vec<String> {
    let mut subjects = vec![robot_file("pcc"), scene()];
    subjects.push(configuration("controller", CONTROLLER));
    subjects.push(configuration("simulated-robot", SIMULATED));
    subjects.push(configuration("planner-daemon", DAEMON));
    let of = |subject: &Subject| gaps(subject.file, subject.keys, &[], &subject.table());
    let mut all: Vec<String> = subjects.iter().flat_map(of).collect();
    let diffusion = diffusion();
    all.extend(gaps(
        diffusion.family,
        DIFFUSION,
        DAEMON,
        &diffusion.table(),
    ));
    all
}

impl Subject {
    fn table(&self) -> Table {
        std::str::from_utf8(&self.content).unwrap().parse().unwrap()
    }

    fn variants(&self, seed: u64) -> Vec<Variant> {
        let mut all = self.key_variants();
        let mut bytes: Vec<Damaged> = damage::truncated(&self.content, 40);
        bytes.extend(damage::flipped(&self.content, 60, seed));
        bytes.extend(damage::with_surplus(&self.content, true));
        bytes.extend(damage::foreign());
        bytes.push(Damaged {
            name: "undamaged".to_owned(),
            content: self.content.clone(),
        });
        let table = self.table();
        all.extend(bytes.into_iter().map(|damaged| {
            let expected = judge_text(self.file, self.keys, &table, &damaged.content);
            self.with(damaged.name, damaged.content, expected)
        }));
        all.extend(self.places());
        all
    }

    fn key_variants(&self) -> Vec<Variant> {
        let changed = changes(self.file, self.keys, &self.table());
        let variant = |c: super::keys::Changed| self.with(c.name, c.text.into_bytes(), c.expected);
        changed.into_iter().map(variant).collect()
    }

    fn with(&self, mut name: String, content: Vec<u8>, expected: Expected) -> Variant {
        let (file, start) = (self.file, Arc::clone(&self.start));
        name.insert_str(0, &format!("{file} "));
        Variant {
            family: self.family,
            name,
            make: Box::new(move |folder| {
                let start = start(folder);
                fs::write(folder.join(file), &content).unwrap();
                start
            }),
            expected,
        }
    }

    fn places(&self) -> Vec<Variant> {
        let place = |&(name, make): &(&str, fn(&Path))| {
            let (file, start) = (self.file, Arc::clone(&self.start));
            Variant {
                family: self.family,
                name: format!("{file} {name}"),
                make: Box::new(move |folder| {
                    let start = start(folder);
                    let _ = fs::remove_file(folder.join(file));
                    make(&folder.join(file));
                    start
                }),
                expected: Expected::Refused(vec![Fault::unreadable(file), Fault::file(file)]),
            }
        };
        damage::PLACES.iter().map(place).collect()
    }
}

fn text_of(file: &str) -> Vec<u8> {
    fs::read(repository().join(file)).unwrap()
}

/// Writes a program's configuration, which names `robot.toml` beside it, and says how it is started.
pub(super) fn configured(folder: &Path, program: &'static str) -> Start {
    let file = format!("{program}.toml");
    let mut table = shipped(&file);
    table.insert("robot".into(), "robot.toml".into());
    table.remove("weights");
    fs::write(folder.join(&file), table.to_string()).unwrap();
    fs::copy(
        repository().join("config/robots/unit.toml"),
        folder.join("robot.toml"),
    )
    .unwrap();
    Start::new(program, &["--config", &file])
}

fn robot_file(program: &'static str) -> Subject {
    Subject {
        family: match program {
            "pcc" => "robot file, pcc",
            "controller" => "robot file, controller",
            "simulated-robot" => "robot file, simulated-robot",
            _ => "robot file, planner-daemon",
        },
        file: "robot.toml",
        keys: ROBOT,
        content: text_of("config/robots/unit.toml"),
        start: Arc::new(move |folder| match program {
            "pcc" => Start::new(
                "pcc",
                &[
                    "dataset",
                    "--setting",
                    "obstacle-free",
                    "--targets",
                    "1",
                    "--starts",
                    "1",
                    "--ends",
                    "1",
                    "--robot",
                    "robot.toml",
                    "--out",
                    "out",
                ],
            ),
            program => configured(folder, program),
        }),
    }
}

fn configuration(program: &'static str, keys: &'static [Key]) -> Subject {
    let (family, file) = match program {
        "controller" => ("controller.toml", "controller.toml"),
        "simulated-robot" => ("simulated-robot.toml", "simulated-robot.toml"),
        _ => ("planner-daemon.toml", "planner-daemon.toml"),
    };
    let mut text = String::from_utf8(text_of(&format!("config/{file}"))).unwrap();
    text = text
        .replace("robots/unit.toml", "robot.toml")
        .replace("weights = \"../weights\"\n", "");
    if program == "planner-daemon" {
        text.push_str("[scene]\nfile = \"scene.toml\"\n");
    }
    Subject {
        family,
        file,
        keys,
        content: text.into_bytes(),
        start: Arc::new(move |folder| {
            fs::write(
                folder.join("scene.toml"),
                "[[balls]]\ncentre_m = [9.0, 9.0, 9.0]\nradius_m = 0.1\n",
            )
            .unwrap();
            configured(folder, program)
        }),
    }
}

/// A daemon with the paper's model, whose keys are damaged.
fn diffusion() -> Subject {
    let mut table = shipped("planner-daemon.toml");
    table.insert("robot".into(), "robot.toml".into());
    let weights = repository().join("weights");
    table.insert("weights".into(), weights.to_str().unwrap().into());
    let mut model = Table::new();
    for (key, value) in [("model", "mixed"), ("solver", "ddim"), ("precision", "f32")] {
        model.insert(key.into(), value.into());
    }
    model.insert("steps".into(), Value::Integer(1));
    table.insert("diffusion".into(), model.into());
    Subject {
        family: "planner-daemon.toml [diffusion]",
        file: "planner-daemon.toml",
        keys: DIFFUSION,
        content: table.to_string().into_bytes(),
        start: Arc::new(|folder| configured(folder, "planner-daemon")),
    }
}

/// Writes a daemon's configuration with a scene of every kind of obstacle beside it.
pub(super) fn daemon_with_scene(folder: &Path) -> Start {
    let start = configured(folder, "planner-daemon");
    let path = folder.join("planner-daemon.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        format!("{text}\n[scene]\nfile = \"workshop.toml\"\n"),
    )
    .unwrap();
    for file in ["workshop.toml", "bracket.stl", "pyramid.obj", "heap.npy"] {
        let from = repository().join("tests/data/scenes").join(file);
        fs::copy(from, folder.join(file)).unwrap();
    }
    start
}

fn scene() -> Subject {
    Subject {
        family: "scene file",
        file: "workshop.toml",
        keys: SCENE,
        content: text_of("tests/data/scenes/workshop.toml"),
        start: Arc::new(daemon_with_scene),
    }
}

/// Robots with another number of tendons than messages carry or than determine the shape.
fn numbers_of_tendons() -> Vec<Variant> {
    let mut all = Vec::new();
    for program in ["controller", "simulated-robot", "planner-daemon"] {
        let subject = robot_file(program);
        for count in [0, 1, 5, 9, 10, 12, 100, 1998] {
            let mut table = subject.table();
            let tendons = table["tendons"].as_array().unwrap().clone();
            let many: Vec<Value> = tendons.iter().cycle().take(count).cloned().collect();
            table.insert("tendons".into(), many.into());
            let value = if count > 9 {
                count.to_string()
            } else {
                String::new()
            };
            let expected = match count {
                9 => Expected::Taken,
                _ => Expected::Refused(vec![Fault::key("robot.toml", "tendons", &value)]),
            };
            all.push(subject.with(
                format!("{count} tendons"),
                table.to_string().into_bytes(),
                expected,
            ));
        }
    }
    all
}
