//! `PCC_PREFIX` and `PCC_ROOT` that no process can use.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::Path;

use tests::trial::Start;

use super::configurations::configured;
use super::variant::{Expected, Fault, Variant};

/// All four programs with each of them.
pub(super) fn variants() -> Vec<Variant> {
    let long = "x".repeat(33);
    let prefixes = ["", "a/b", "..", "ä", "a b", "a\nb", "-\u{fffd}", &long].map(OsString::from);
    let prefixes = prefixes
        .into_iter()
        .chain([OsString::from_vec(b"p\xff".to_vec())]);
    let path = format!("/dev/shm/{}", "x".repeat(200));
    let roots = [
        "/sys",
        "/proc/none",
        "/dev/null",
        "/dev/null/below",
        "/dev/full",
        &path,
        "/sys/kernel/none",
        "/dev/shm/a\nb",
        "/dev/shm/a*b",
        "relative/root",
        "",
    ];
    let roots = roots
        .map(OsString::from)
        .into_iter()
        .chain([OsString::from_vec(b"/dev/shm/\xff".to_vec())]);
    let settings = prefixes
        .map(|v| ("PCC_PREFIX", v))
        .chain(roots.map(|v| ("PCC_ROOT", v)));
    let mut all = Vec::new();
    for (name, value) in settings {
        for program in ["planner-daemon", "controller", "simulated-robot", "pcc"] {
            all.push(variant(program, name, value.clone()));
        }
    }
    all
}

fn variant(program: &'static str, name: &'static str, value: OsString) -> Variant {
    let shown = value.to_string_lossy().into_owned();
    // What is not UTF-8 is shown escaped.
    let said: String = shown.chars().take_while(char::is_ascii_graphic).collect();
    Variant {
        family: "environment",
        name: format!("{program} with {name} = {shown:?}"),
        make: Box::new(move |folder: &Path| {
            let mut start = match program {
                "pcc" => Start::new("pcc", &["watch", "--times", "1"]),
                program => configured(folder, program),
            };
            start.environment.push((name, value.clone()));
            start
        }),
        expected: Expected::Refused(vec![
            Fault::option(name, &said),
            Fault {
                is_unreadable: true,
                ..Fault::option(name, &said)
            },
        ]),
    }
}
