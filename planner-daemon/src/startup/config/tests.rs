//! What configurations are read, and what is said of those that are refused.

use super::*;

const SHIPPED: &str = include_str!("../../../../config/planner-daemon.toml");

fn parse(text: &str) -> Result<Config, ConfigError> {
    Config::from_toml_str(text, Path::new("/etc/pcc/planner-daemon.toml"))
}

#[test]
fn the_shipped_file_states_the_defaults() {
    let shipped = parse(SHIPPED).unwrap();
    let sparse = "robot = \"robots/unit.toml\"\nweights = \"../weights\"";
    assert_eq!(shipped, parse(sparse).unwrap());
    assert_eq!(shipped.robot, Path::new("/etc/pcc/robots/unit.toml"));
    assert_eq!(shipped.capacity, PlanServiceCapacity::default());
    assert_eq!(shipped.default_deadline, Duration::from_millis(20));
    assert_eq!(shipped.realtime_priority, None);
    assert!(!shipped.scene_expected);
}

#[test]
fn who_polls_has_no_real_time_priority() {
    let with = |wait: &str| {
        let text = format!("robot = \"a\"\nrealtime_priority = 68\nwait = {wait:?}");
        parse(&text)
    };
    assert_eq!(with("event").unwrap().realtime_priority, Some(68));
    let error = with("poll").unwrap_err();
    assert!(
        matches!(error, ConfigError::PollsAtRealtimePriority { .. }),
        "{error}"
    );
}

#[test]
fn a_broken_file_an_unknown_key_and_a_missing_one_are_named() {
    for (text, named) in [
        ("robot = ", "line 1"),
        ("robot = \"a\"\nthread = 2", "unknown field `thread`"),
        ("threads = 2", "missing field `robot`"),
        ("robot = \"a\"\nthreads = \"two\"", "threads"),
        (
            "robot = \"a\"\nwait = \"sleep\"",
            "\"event\" or \"poll\" is needed",
        ),
    ] {
        let error = parse(text).unwrap_err();
        assert!(
            matches!(error, ConfigError::Settings(SettingsError::Syntax { .. })),
            "{error}"
        );
        assert!(error.to_string().contains(named), "{text}: {error}");
    }
}

#[test]
fn every_number_has_a_range() {
    for setting in [
        "threads = 0",
        "threads = 65",
        "candidates = 65",
        "knots_per_candidate = 257",
        "knots_per_candidate = 15",
        "clients = 0",
        "requests_per_client = 17",
        "queued_per_client = 0",
        "default_deadline_ms = 0.0",
        "default_deadline_ms = nan",
        "path_tolerance_rad = 0.0",
        "path_tolerance_rad = 0.0009",
        "path_tolerance_rad = inf",
        "begin_lead_ms = 9.0",
        "realtime_priority = 69",
        "realtime_priority = -1",
        "processors = [0, 1024]",
        "shared_memory_budget_mb = 0.0",
        "resident_memory_budget_mb = -1.0",
    ] {
        let error = parse(&format!("robot = \"a\"\n{setting}")).unwrap_err();
        let name = setting.split(' ').next().unwrap();
        assert!(
            matches!(error, ConfigError::Settings(SettingsError::Range { ref key, .. }) if key == name),
            "{setting}: {error}"
        );
    }
}

#[test]
fn a_diffusion_model_needs_a_folder_and_all_of_its_keys() {
    const KEYS: [&str; 4] = [
        "model = \"mixed\"",
        "solver = \"dpm-solver\"",
        "steps = 15",
        "precision = \"f32\"",
    ];
    let with = |weights, keys: &[&str]| {
        let keys = keys.join("\n");
        parse(&format!("robot = \"a\"\n{weights}\n[diffusion]\n{keys}"))
    };
    let weights = "weights = \"w\"";
    let read = with(weights, &KEYS).unwrap().diffusion.unwrap();
    assert_eq!((read.model.as_str(), read.steps), ("mixed", 15));
    let nowhere = with("", &KEYS).unwrap_err();
    assert!(
        matches!(nowhere, ConfigError::DiffusionWithoutWeights { .. }),
        "{nowhere}"
    );
    for left_out in KEYS {
        let keys: Vec<&str> = KEYS.into_iter().filter(|key| *key != left_out).collect();
        let error = with(weights, &keys).unwrap_err().to_string();
        let (name, _) = left_out.split_once(' ').unwrap();
        assert!(
            error.contains(&format!("missing field `{name}`")),
            "{error}"
        );
    }
    for (key, wrong, named) in [
        (0, "models = \"mixed\"", "unknown field `models`"),
        (1, "solver = \"euler\"", "`ddim` or `dpm-solver`"),
        (1, "solver = 1.5", "`1.5`, expected a string"),
        (2, "steps = 0", "diffusion.steps = 0"),
        (2, "steps = 1001", "diffusion.steps = 1001"),
        (3, "precision = \"f16\"", "`f32` or `bf16`"),
    ] {
        let mut keys = KEYS;
        keys[key] = wrong;
        let error = with(weights, &keys).unwrap_err().to_string();
        assert!(error.contains(named), "{wrong}: {error}");
    }
}

#[test]
fn a_static_scene_is_a_file_beside_the_configuration() {
    let scene = |text: &str| parse(&format!("robot = \"a\"\n[scene]\n{text}"));
    let config = scene("file = \"scenes/cell.toml\"").unwrap();
    assert_eq!(
        config.scene.unwrap(),
        Path::new("/etc/pcc/scenes/cell.toml")
    );
    assert_eq!(parse("robot = \"a\"").unwrap().scene, None);
    for (text, named) in [
        ("", "missing field `file`"),
        ("path = \"a\"", "unknown field `path`"),
    ] {
        let error = scene(text).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}

#[test]
fn a_live_scene_is_expected_only_where_the_file_says_so() {
    let table = |text: &str| parse(&format!("robot = \"a\"\n[live_scene]\n{text}"));
    assert!(!table("").unwrap().scene_expected);
    assert!(table("expected = true").unwrap().scene_expected);
    let error = table("expects = true").unwrap_err().to_string();
    assert!(error.contains("unknown field `expects`"), "{error}");
}

#[test]
fn a_missing_file_is_named() {
    let error = Config::from_file(Path::new("/nowhere/daemon.toml")).unwrap_err();
    assert!(
        error.to_string().contains("/nowhere/daemon.toml"),
        "{error}"
    );
}
