//! Files that the user of the program may not read.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use tests::trial::{AS_USER, Start};

use super::configurations::daemon_with_scene;
use super::dataset_files;
use super::variant::{Expected, Fault, Variant};
use super::weights;

/// A user whom nothing belongs to.
const NOBODY: u32 = 65534;

/// Writes undamaged files and says what is started with them.
type Make = fn(&Path) -> Start;

/// Why none of this can be tried here, if so.
pub(super) fn obstacle() -> Option<&'static str> {
    if !rustix::process::geteuid().is_root() {
        return Some("none: only root becomes another user");
    }
    (!Path::new(AS_USER).exists()).then_some("none: there is no /usr/bin/setpriv")
}

/// One file of each kind, closed to the user that reads it, and with none closed; nothing where there is an [`obstacle`],
/// which is a failed check.
pub(super) fn variants() -> Vec<Variant> {
    if obstacle().is_some() {
        return Vec::new();
    }
    let files: [(Make, &'static [&'static str]); 3] = [
        (
            daemon_with_scene,
            &[
                "planner-daemon.toml",
                "robot.toml",
                "workshop.toml",
                "bracket.stl",
                "pyramid.obj",
                "heap.npy",
            ],
        ),
        (
            weights::undamaged,
            &[
                "weights/MANIFEST.toml",
                "weights/fast.safetensors",
                "weights",
            ],
        ),
        (
            dataset_files::sample,
            &["set/dataset.npz", "set/dataset_meta.json", "set"],
        ),
    ];
    let of = |(make, names): (Make, &'static [&'static str])| {
        let closed = names.iter().map(move |name| closed(make, name));
        closed.chain([open(make, names[0])])
    };
    files.into_iter().flat_map(of).collect()
}

/// The premise of the others: what is closed to nobody is taken.
fn open(make: Make, file: &str) -> Variant {
    Variant {
        family: "closed to the user",
        name: format!("{file} and the others, all open"),
        make: Box::new(move |folder| {
            let start = make(folder);
            fs::set_permissions(folder, Permissions::from_mode(0o1777)).unwrap();
            by_nobody(start)
        }),
        expected: Expected::Taken,
    }
}

fn closed(make: Make, file: &'static str) -> Variant {
    let name = file.rsplit('/').next().unwrap_or(file);
    Variant {
        family: "closed to the user",
        name: file.to_owned(),
        make: Box::new(move |folder| {
            let start = make(folder);
            // The user may write results beside what it reads, and nobody may replace what is another's.
            fs::set_permissions(folder, Permissions::from_mode(0o1777)).unwrap();
            fs::set_permissions(folder.join(file), Permissions::from_mode(0o000)).unwrap();
            by_nobody(start)
        }),
        expected: Expected::Refused(vec![Fault::unreadable(name)]),
    }
}

/// The same start, as a user whom nothing belongs to.
fn by_nobody(start: Start) -> Start {
    Start {
        user: Some(NOBODY),
        ..start
    }
}
