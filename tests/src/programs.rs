//! Where the programs under test are, and building them where they are missing or older than their source.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Once;
use std::time::SystemTime;

/// The programs, with the package that each is built from.
const PROGRAMS: [(&str, &str); 5] = [
    ("planner-daemon", "planner-daemon"),
    ("controller", "controller"),
    ("simulated-robot", "controller"),
    ("dynamixel-robot", "dynamixel-robot"),
    ("pcc", "pcc-cli"),
];
const SOURCES: [&str; 4] = ["shared-types", "planner-daemon", "controller", "crates"];
/// Folders in these with nothing that a program is built from.
const NO_SOURCES: [&str; 2] = ["tests", "node_modules"];

/// The repository's root folder.
#[must_use]
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_owned()
}

/// The path of a program, built in the profile of the program that asks.
///
/// `cargo test --workspace` builds them before the tests begin; what is missing or old is built here, once.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    static BUILT: Once = Once::new();
    BUILT.call_once(build_if_old);
    profile_folder().join(name)
}

/// `target/<profile>`: tests run from its `deps`.
fn profile_folder() -> PathBuf {
    let folder = env::current_exe().unwrap().parent().unwrap().to_owned();
    if folder.ends_with("deps") {
        folder.parent().unwrap().to_owned()
    } else {
        folder
    }
}

fn build_if_old() {
    let folder = profile_folder();
    let programs = PROGRAMS.map(|(name, _)| folder.join(name));
    if programs.iter().any(|program| is_old(program)) {
        build(&folder);
    }
}

/// Whether a program or one of its sources is missing, or the source is newer.
fn is_old(program: &Path) -> bool {
    let (built, newest) = (modified(program), newest_source(program));
    !matches!((built, newest), (Some(built), Some(newest)) if built >= newest)
}

/// When the newest source of a program was changed: of the files that Cargo notes beside what it was asked for, if none is missing. Beside a
/// program that was built for tests it notes none, and every source of the programs counts.
fn newest_source(program: &Path) -> Option<SystemTime> {
    let Ok(noted) = fs::read_to_string(program.with_extension("d")) else {
        let folders = SOURCES.iter().map(|folder| repository().join(folder));
        return folders
            .filter_map(|folder| newest_source_file(&folder))
            .max();
    };
    let sources = noted.split_once(": ").map_or("", |(_, sources)| sources);
    // A space in a path is noted with a backslash before it.
    let sources = sources.trim_end().replace("\\ ", "\0");
    let time = |source: &str| modified(Path::new(&source.replace('\0', " ")));
    let times: Option<Vec<SystemTime>> = sources.split(' ').map(time).collect();
    times?.into_iter().max()
}

fn build(folder: &Path) {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(repository()).arg("build").arg("--locked");
    for (_, package) in PROGRAMS {
        cargo.args(["-p", package]);
    }
    if folder.ends_with("release") {
        // With the features that scripts/acceptance builds them with, so that nothing is built twice.
        cargo.args(["--release", "-p", "acceptance", "-p", "tests"]);
    }
    cargo.arg("--target-dir").arg(folder.parent().unwrap());
    assert!(
        cargo.status().unwrap().success(),
        "the programs under test do not build"
    );
}

fn modified(file: &Path) -> Option<SystemTime> {
    fs::metadata(file).ok()?.modified().ok()
}

fn newest_source_file(folder: &Path) -> Option<SystemTime> {
    let entries = fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let time = |entry: fs::DirEntry| {
        let path = entry.path();
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("rs" | "toml" | "html" | "css" | "js") => modified(&path),
            _ if path.is_dir() && !NO_SOURCES.iter().any(|it| entry.file_name() == *it) => {
                newest_source_file(&path)
            }
            _ => None,
        }
    };
    entries.filter_map(time).max()
}
