//! Robot files: the shipped ones load, and what is wrong with others is said by name.
#![allow(clippy::unwrap_used)] // tests

mod shapes;

use input_files::SettingsError;
use pcc_model::{Robot, RobotFileError, TendonMap, TendonMapError};
use std::path::Path;

fn unit_text() -> String {
    std::fs::read_to_string(shapes::robot_file("unit.toml")).unwrap()
}

fn parse(text: &str) -> Result<Robot, RobotFileError> {
    Robot::from_toml_str(text, Path::new("unit.toml"))
}

/// The error of the unit robot's file after a replacement.
fn refused(what: &str, by: &str) -> RobotFileError {
    let text = unit_text();
    assert!(text.contains(what), "{what} is in the file");
    parse(&text.replacen(what, by, 1)).unwrap_err()
}

#[test]
fn shipped_files_load() {
    let (unit, authors) = (shapes::unit_robot(), shapes::authors_robot());
    assert_eq!(
        (unit.name.as_str(), authors.name.as_str()),
        ("unit", "authors-42mm")
    );
    assert_eq!(unit.section_lengths, [1.0; 3]);
    assert!((authors.section_lengths.iter().sum::<f64>() - 0.77).abs() < 1e-3);
    let limits = authors.tendon_limits;
    assert_eq!(
        (limits.velocity, limits.acceleration, limits.jerk),
        (0.02, 0.1, 1.0)
    );
}

#[test]
fn robots_that_differ_in_anything_differ_in_their_hash() {
    let unit = shapes::unit_robot();
    assert_eq!(unit.hash(), shapes::unit_robot().hash());
    let changes: [fn(&mut Robot); 9] = [
        |robot| robot.name.push('2'),
        |robot| robot.section_lengths[2] += 1e-12,
        |robot| robot.bending_limit += 1e-12,
        |robot| robot.tube_radii[1] += 1e-12,
        |robot| robot.spool_radius += 1e-12,
        |robot| robot.tendon_limits.velocity += 1e-12,
        |robot| robot.tendon_limits.acceleration += 1e-12,
        |robot| robot.tendon_limits.jerk += 1e-12,
        |robot| {
            let mut tendons = robot.tendons.tendons().to_vec();
            tendons[8].angle += 1e-12;
            robot.tendons = TendonMap::new(tendons).unwrap();
        },
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let mut changed = unit.clone();
        change(&mut changed);
        assert_ne!(changed.hash(), unit.hash(), "change {index}");
    }
}

#[test]
fn missing_file_is_named() {
    let error = Robot::from_file(Path::new("no/such-robot.toml")).unwrap_err();
    assert!(matches!(
        error,
        RobotFileError::Settings(SettingsError::File(_))
    ));
    assert!(error.to_string().contains("no/such-robot.toml"));
}

#[test]
fn keys_must_be_known_and_complete() {
    for (what, by, named) in [
        ("name =", "colour = 3\nname =", "colour"),
        ("tube_radius_m = 0.2", "", "tube_radius_m"),
        ("jerk_m_s3 = 3.9", "jerk_m_s3 = 3.9\nsnap = 1.0", "snap"),
        ("section = 1", "section = 1\ncolour = 3", "colour"),
        ("[1.0, 1.0, 1.0]", "[1.0, 1.0]", "section_lengths_m"),
        (
            "[1.0, 1.0, 1.0]",
            "[1.0, 1.0, 1.0, 1.0]",
            "invalid length 4, expected an array of exactly 3 numbers",
        ),
        ("name =", "name = =", "name"),
    ] {
        let error = refused(what, by);
        assert!(
            matches!(
                error,
                RobotFileError::Settings(SettingsError::Syntax { .. })
            ),
            "{error}"
        );
        assert!(error.to_string().contains(named), "{error}");
    }
}

#[test]
fn quantities_out_of_range_are_named_with_what_is_allowed() {
    for (what, by, named) in [
        ("[1.0, 1.0, 1.0]", "[1.0, nan, 1.0]", "section_lengths_m"),
        ("[1.0, 1.0, 1.0]", "[1.0, 0.0, 1.0]", "section_lengths_m"),
        ("[1.0, 1.0, 1.0]", "[1.0, inf, 1.0]", "section_lengths_m"),
        ("[1.0, 1.0, 1.0]", "[1.0, 1e-5, 1.0]", "section_lengths_m"),
        ("[1.0, 1.0, 1.0]", "[1.0, 1e300, 1.0]", "section_lengths_m"),
        (
            "radius_m = 0.1636",
            "radius_m = 1e200",
            "tendons[0].radius_m",
        ),
        ("rad = 1.57", "rad = 3.15", "bending_limit_rad"),
        ("rad = 1.57", "rad = -1.57", "bending_limit_rad"),
        (
            "tube_radius_m = 0.2",
            "tube_radius_m = -0.1",
            "tube_radius_m",
        ),
        (
            "tube_radius_m = 0.2",
            "tube_radius_m = 1e7",
            "tube_radius_m",
        ),
        ("rad = 1.57", "rad = 0.001", "bending_limit_rad"),
        ("jerk_m_s3 = 3.9", "jerk_m_s3 = 1e300", "jerk_m_s3"),
        (
            "spool_radius_m = 0.039",
            "spool_radius_m = 0.0",
            "spool_radius_m",
        ),
        (
            "velocity_m_s = 0.0779",
            "velocity_m_s = 0.0",
            "velocity_m_s",
        ),
        (
            "acceleration_m_s2 = 0.39",
            "acceleration_m_s2 = -1.0",
            "acceleration_m_s2",
        ),
        ("jerk_m_s3 = 3.9", "jerk_m_s3 = nan", "jerk_m_s3"),
    ] {
        let error = refused(what, by);
        let RobotFileError::Settings(SettingsError::Range { key, allowed, .. }) = &error else {
            panic!("{error}");
        };
        assert!(key.contains(named) && allowed.contains(" to "), "{error}");
        let text = error.to_string();
        assert!(text.contains(&**key) && text.contains(allowed), "{text}");
    }
}

#[test]
fn tendons_that_do_not_fit_are_named() {
    let tendons = |error| match error {
        RobotFileError::Tendons { source, .. } => source,
        other => panic!("{other}"),
    };
    let section = tendons(refused("section = 3", "section = 4"));
    assert_eq!(
        section,
        TendonMapError::Section {
            tendon: 4,
            section: 4
        }
    );
    assert!(section.to_string().contains("1 to 3"));
    assert!(matches!(
        tendons(refused("section = 1", "section = 0")),
        TendonMapError::Section {
            tendon: 1,
            section: 0
        }
    ));
    for (what, by, key) in [
        (
            "radius_m = 0.1636",
            "radius_m = 0.0",
            "tendons[0].radius_m = 0 ",
        ),
        ("deg = 0.0", "deg = nan", "tendons[0].angle_deg = NaN "),
    ] {
        let said = refused(what, by).to_string();
        assert!(said.contains(key) && said.contains("allowed"), "{said}");
    }
}

#[test]
fn tendons_must_determine_the_shape() {
    let text = unit_text().replace("section = 3", "section = 2");
    let error = parse(&text).unwrap_err();
    assert!(
        matches!(
            error,
            RobotFileError::Tendons {
                source: TendonMapError::Rank { rank: 4 },
                ..
            }
        ),
        "{error}"
    );
    assert!(error.to_string().contains("4 of the 6"), "{error}");
    let head = unit_text().split("[[tendons]]").next().unwrap().to_owned();
    let none = head.replacen("name =", "tendons = []\nname =", 1);
    assert!(matches!(
        parse(&none).unwrap_err(),
        RobotFileError::Tendons {
            source: TendonMapError::Rank { rank: 0 },
            ..
        }
    ));
}

#[test]
fn more_tendons_than_a_message_carries_are_refused() {
    let text = unit_text();
    let tendon = "\n[[tendons]]\nsection = 1\nradius_m = 0.1\nangle_deg = 10.0\n";
    let error = parse(&(text + tendon)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "robot file: \"unit.toml\": `tendons` are 10, at most 9 are allowed"
    );
}

#[test]
fn what_is_wrong_in_a_file_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("thick.toml");
    let text = unit_text().replace("tube_radius_m = 0.2", "tube_radius_m = 1e7");
    std::fs::write(&file, text).unwrap();
    let error = Robot::from_file(&file).unwrap_err().to_string();
    assert!(
        error.contains("thick.toml") && error.contains("tube_radius_m = 10000000"),
        "{error}"
    );
}
