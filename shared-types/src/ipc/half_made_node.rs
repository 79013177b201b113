//! Removes what a node leaves whose process was killed before others could see that it lives, or who cleaned up after it while they did, or
//! where iceoryx2 could not clean up to the end.
//!
//! iceoryx2 0.10.0 makes the folder of a node (`nodes/<id>`) first, then three files that tell whether its process lives
//! (`nodes/<prefix>_<id>.node_monitor…`); the last step makes the context among them readable. It cleans up after those alone that came so far,
//! and removes the context last: where the process that cleans up is killed before that, the node counts as being cleaned up for ever
//! (`ProcessMonitor::state` in `iceoryx2-bb-posix/src/process_state.rs`). A tag in the folder that is not whole yet, of a port or a service, it
//! takes for none: it removes the details (`<prefix>node.details`), but not the folder, and knows without the details no more where
//! the node's files are.
//!
//! Whether the maker lives is asked of its process id: one of another pid namespace (a container) counts as dead. Its node is lost if it was
//! stopped for half a second between those steps, which take microseconds.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::io::Errno;
use rustix::process::{Pid, geteuid, test_kill_process};

/// The folder of nodes in the services' root, as in iceoryx2's configuration.
pub(super) const NODES: &str = "nodes";
const MONITOR: &str = ".node_monitor";
const OWNER_LOCK: &str = ".node_monitor_owner_lock";
const CONTEXT: &str = ".node_monitor_context";
/// How the names of a node's files end.
const ENDS: [&str; 3] = [MONITOR, OWNER_LOCK, CONTEXT];
/// How the name of the file ends that a node's folder has from first to last.
const DETAILS: &str = "node.details";
/// A context that its owner may read is whole.
const READABLE: u32 = 0o400;

/// The folders, there or not, of nodes that others cannot see alive or dead.
pub(super) fn half_made_nodes(root: &Path) -> BTreeSet<PathBuf> {
    let nodes = root.join(NODES);
    let names = names(&nodes);
    let ids = names.iter().map(|name| id_in(name));
    let ids = ids.filter(|id| maker(id).is_some());
    let folders = ids.map(|id| nodes.join(id));
    folders.filter(|folder| !is_whole(folder, &names)).collect()
}

/// Removes the folder and the files of a node that has been half-made for long, unless it was finished or its maker lives.
///
/// # Errors
/// What the system says; [`io::ErrorKind::WouldBlock`] for what is to stay: of a maker that lives, of another user, whole, or no node.
pub(super) fn remove_half_made_node(folder: &Path) -> io::Result<()> {
    let is_dead = id(folder)
        .and_then(maker)
        .is_some_and(|maker| !lives(maker));
    let names = folder.parent().map(names).unwrap_or_default();
    let files = ENDS.iter().flat_map(|end| files(folder, &names, end));
    let files: Vec<PathBuf> = files.collect();
    let is_own_folder = match fs::symlink_metadata(folder) {
        Ok(data) => data.is_dir() && data.uid() == geteuid().as_raw(),
        Err(error) => error.kind() == io::ErrorKind::NotFound,
    };
    if !is_own_folder
        || !files.iter().all(|path| is_own(path))
        || !is_dead
        || is_whole(folder, &names)
    {
        return Err(io::ErrorKind::WouldBlock.into());
    }
    if names.contains(id(folder).unwrap_or_default()) {
        fs::remove_dir_all(folder)?;
    }
    files.iter().try_for_each(fs::remove_file)
}

fn names(nodes: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(nodes).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().into_string());
    names.filter_map(Result::ok).collect()
}

fn id(folder: &Path) -> Option<&str> {
    folder.file_name()?.to_str()
}

/// The id of the node that the folder or the file of this name is of.
fn id_in(name: &str) -> &str {
    id_before(name, &ENDS).unwrap_or(name)
}

/// The id in a file's name that ends in one of these ways.
pub(super) fn id_before<'a>(name: &'a str, ends: &[&str]) -> Option<&'a str> {
    let stem = ends.iter().find_map(|end| name.strip_suffix(end))?;
    stem.rsplit('_').next()
}

/// Whether what has this name is this user's.
pub(super) fn is_own(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|data| data.uid() == geteuid().as_raw())
}

/// The files of a node whose names end so, whatever the prefix.
fn files(folder: &Path, names: &BTreeSet<String>, end: &str) -> Vec<PathBuf> {
    let end = format!("{}{end}", id(folder).unwrap_or_default());
    let of_node = names.iter().filter(|name| name.ends_with(&end));
    of_node.map(|name| folder.with_file_name(name)).collect()
}

fn is_whole(folder: &Path, names: &BTreeSet<String>) -> bool {
    let is_there = |end: &&str| !files(folder, names, end).is_empty();
    let is_readable = |path: &PathBuf| fs::metadata(path).is_ok_and(|it| it.mode() & READABLE != 0);
    let in_folder = self::names(folder);
    in_folder.iter().any(|name| name.ends_with(DETAILS))
        && [MONITOR, OWNER_LOCK].iter().all(is_there)
        && files(folder, names, CONTEXT).iter().any(is_readable)
}

/// The process that made the node or the port of this id: iceoryx2 joins seconds, nanoseconds, process and a count to a number of 128 bits, the first one
/// lowest. None where the name is no such number.
pub(super) fn maker(name: &str) -> Option<Pid> {
    let id: u128 = name.parse().ok()?;
    let process = i32::try_from((id >> 64) as u32).ok()?;
    Pid::from_raw(process).filter(|_| id.to_string() == name)
}

pub(super) fn lives(process: Pid) -> bool {
    test_kill_process(process) != Err(Errno::SRCH)
}

#[cfg(test)]
pub(super) mod fixtures {
    use std::process::Command;

    /// The id of a node or a port that a process made.
    pub(crate) fn id_of(pid: u32) -> String {
        ((u128::from(pid) << 64) | 7).to_string()
    }

    pub(crate) fn ended_process() -> u32 {
        let mut child = Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child.id()
    }
}

#[cfg(test)]
mod tests {
    use super::fixtures::{ended_process, id_of};
    use super::*;
    use crate::ipc::{IpcNode, IpcOptions};
    use std::os::unix::fs::PermissionsExt;
    use tempfile::TempDir;

    /// A node of which so many steps after its folder are done, of four.
    fn node(root: &Path, pid: u32, steps: usize) -> PathBuf {
        let folder = root.join(NODES).join(id_of(pid));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("any_node.details"), "details").unwrap();
        let file = |end: &str| root.join(NODES).join(format!("any_{}{end}", id_of(pid)));
        let ends = [CONTEXT, MONITOR, OWNER_LOCK];
        for end in ends.iter().take(steps) {
            fs::write(file(end), "").unwrap();
        }
        if steps > 0 {
            let mode = if steps > ends.len() { 0o400 } else { 0o200 };
            fs::set_permissions(file(CONTEXT), PermissionsExt::from_mode(mode)).unwrap();
        }
        folder
    }

    #[test]
    fn nothing_remains_of_a_maker_that_died_before_the_last_step() {
        for steps in 0..=3 {
            let root = TempDir::new().unwrap();
            let folder = node(root.path(), ended_process(), steps);
            let half_made = half_made_nodes(root.path());
            assert_eq!(half_made, BTreeSet::from([folder.clone()]), "{steps}");
            remove_half_made_node(&folder).unwrap();
            assert!(names(&root.path().join(NODES)).is_empty(), "{steps}");
        }
    }

    #[test]
    fn nothing_remains_where_who_cleaned_up_died_before_the_last_step() {
        for has_folder in [true, false] {
            let root = TempDir::new().unwrap();
            let folder = node(root.path(), ended_process(), 4);
            if !has_folder {
                fs::remove_dir_all(&folder).unwrap();
            }
            for end in [MONITOR, OWNER_LOCK] {
                let path = folder.with_file_name(format!("any_{}{end}", id(&folder).unwrap()));
                fs::remove_file(path).unwrap();
                let half_made = half_made_nodes(root.path());
                assert_eq!(half_made, BTreeSet::from([folder.clone()]), "{end}");
            }
            remove_half_made_node(&folder).unwrap();
            assert!(names(&root.path().join(NODES)).is_empty());
        }
    }

    #[test]
    fn nothing_remains_where_a_tag_was_not_whole() {
        let root = TempDir::new().unwrap();
        let folder = node(root.path(), ended_process(), 4);
        fs::write(folder.join("any_8.port_tag"), "").unwrap();
        assert!(
            half_made_nodes(root.path()).is_empty(),
            "it is cleaned up yet"
        );
        fs::remove_file(folder.join("any_node.details")).unwrap();
        let half_made = half_made_nodes(root.path());
        assert_eq!(half_made, BTreeSet::from([folder.clone()]));
        remove_half_made_node(&folder).unwrap();
        assert!(names(&root.path().join(NODES)).is_empty());
    }

    #[test]
    fn what_is_whole_or_no_node_or_whose_maker_lives_stays() {
        let root = TempDir::new().unwrap();
        let whole = node(root.path(), ended_process(), 4);
        let alive = node(root.path(), std::process::id(), 1);
        for name in ["something_else", "007", "+7", &u128::MAX.to_string()] {
            fs::create_dir(root.path().join(NODES).join(name)).unwrap();
        }
        let half_made = half_made_nodes(root.path());
        assert_eq!(half_made, BTreeSet::from([alive.clone()]));
        let before = names(&root.path().join(NODES));
        for folder in [alive, whole.with_file_name("007"), whole] {
            let refused = remove_half_made_node(&folder).unwrap_err();
            assert_eq!(refused.kind(), io::ErrorKind::WouldBlock);
        }
        assert_eq!(names(&root.path().join(NODES)), before);
    }

    #[test]
    fn a_node_of_iceoryx2_is_whole_and_bears_its_maker() {
        let folder = TempDir::new().unwrap();
        let options = IpcOptions {
            prefix: "test-half-made".to_owned(),
            root: folder.path().join("root"),
        };
        let node = IpcNode::create(&options, "whole").unwrap();
        let id = node.id().to_string();
        let process = i32::try_from(std::process::id()).unwrap();
        assert_eq!(maker(&id), Pid::from_raw(process));
        assert!(options.root.join(NODES).join(&id).is_dir());
        assert!(half_made_nodes(&options.root).is_empty());
    }
}
