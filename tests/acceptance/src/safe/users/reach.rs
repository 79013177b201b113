//! What another user can open, read, lock or write of a robot's files.

use std::fs::{self, OpenOptions};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use tests::other_user::{OTHER, OwnersRobot, as_user};

use crate::report::Report;

/// The node counter's name after the prefix, as iceoryx2 0.10.0 makes it.
pub(super) const COUNTER: &str =
    "_9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";

/// Every name of the robot's, opened for reading, for writing, listed, locked.
pub(super) fn reach(report: &mut Report, robot: &OwnersRobot, about: &str) -> anyhow::Result<()> {
    let mut names = robot.root_files();
    names.extend(robot.shared_memory());
    // What the other user has made is its own.
    let is_others = |name: &PathBuf| fs::symlink_metadata(name).is_ok_and(|it| it.uid() == OTHER);
    names.retain(|name| !is_others(name));
    let open = as_user(OTHER, || {
        names.iter().filter(|name| opens(name)).collect::<Vec<_>>()
    })?;
    let shown: Vec<String> = open.iter().map(|name| name.display().to_string()).collect();
    let name = format!(
        "defect 9: of {} files and folders, opened by another user, {about}",
        names.len()
    );
    report.none_of(&name, &shown);
    let locks = names
        .iter()
        .filter(|name| name.extension().is_some_and(|end| end == "lock"));
    let locks: Vec<&PathBuf> = locks.collect();
    let held = as_user(OTHER, || {
        locks.iter().filter(|name| is_locked(name)).count()
    })?;
    let name = format!(
        "defect 9: lock files of {} that another user can hold, {about}",
        locks.len()
    );
    report.check(
        &name,
        held.to_string(),
        "0, of some",
        held == 0 && locks.len() >= 4,
    );
    let root = robot.root();
    let modes = names.iter().filter_map(|name| {
        let mode = fs::symlink_metadata(name).ok()?.mode() & 0o7777;
        let private = name.starts_with(&root) && name.is_dir();
        (!private && mode & 0o077 != 0).then(|| format!("{} {mode:04o}", name.display()))
    });
    report.none_of(
        &format!("defect 9: files with a right for others, {about}"),
        &modes.collect::<Vec<_>>(),
    );
    Ok(())
}

pub(super) fn opens(path: &Path) -> bool {
    let read = fs::read_dir(path).is_ok() || fs::File::open(path).is_ok();
    read || OpenOptions::new().write(true).open(path).is_ok()
}

fn is_locked(path: &Path) -> bool {
    fs::File::open(path).is_ok_and(|file| file.try_lock().is_ok())
}
