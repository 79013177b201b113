//! Removes what a node leaves whose process was killed before others could see that it lives.
//!
//! iceoryx2 0.10.0 makes the folder of a node (`nodes/<id>`) before the file that tells whether its process lives
//! (`nodes/<prefix>_<id>.node_monitor`), and cleans up after those alone that have such a file.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::io::Errno;
use rustix::process::{Pid, geteuid, test_kill_process};

/// The folder of nodes in the services' root, as in iceoryx2's configuration.
const NODES: &str = "nodes";
/// Ends the name of the file that tells of its process.
const MONITOR: &str = ".node_monitor";

/// The folders of nodes of which no file tells whether their process lives.
pub(super) fn half_made_nodes(root: &Path) -> Vec<PathBuf> {
    let folder = root.join(NODES);
    let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
    let names: BTreeSet<String> = entries
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    let of_monitor = |name: &str| Some(name.strip_suffix(MONITOR)?.rsplit('_').next()?.to_owned());
    let monitored: BTreeSet<String> = names.iter().filter_map(|name| of_monitor(name)).collect();
    let half_made = names
        .iter()
        .filter(|name| maker(name).is_some() && !monitored.contains(*name));
    half_made.map(|name| folder.join(name)).collect()
}

/// Removes the folder of a node that has been half-made for long, unless its maker lives.
///
/// # Errors
/// What the system says; [`io::ErrorKind::WouldBlock`] where its maker lives.
pub(super) fn remove_half_made_node(path: &Path) -> io::Result<()> {
    let name = path.file_name().and_then(|name| name.to_str());
    let data = fs::symlink_metadata(path)?;
    let is_own = data.is_dir() && data.uid() == geteuid().as_raw();
    match name.and_then(maker) {
        Some(maker) if is_own && !lives(maker) => fs::remove_dir_all(path),
        _ => Err(io::ErrorKind::WouldBlock.into()),
    }
}

/// The process that made the node of this id, which is the folder's name: iceoryx2 joins seconds, nanoseconds, process and a count to a number
/// of 128 bits, the first one lowest.
fn maker(name: &str) -> Option<Pid> {
    let id: u128 = name.parse().ok()?;
    Pid::from_raw((id >> 64) as u32 as i32)
}

fn lives(process: Pid) -> bool {
    test_kill_process(process) != Err(Errno::SRCH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ipc::{IpcNode, IpcOptions};
    use std::process::Command;

    /// The id of a node that a process made.
    fn id(pid: u32) -> String {
        ((u128::from(pid) << 64) | 7).to_string()
    }

    fn ended_process() -> u32 {
        let mut child = Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child.id()
    }

    #[test]
    fn only_what_a_dead_process_left_half_made_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("root");
        let options = IpcOptions {
            prefix: format!("halfmade{}", std::process::id()),
            root: root.clone(),
        };
        let node = IpcNode::create(&options, "whole").unwrap();
        let nodes = root.join(NODES);
        let whole = nodes.join(node.id().to_string());
        assert!(whole.is_dir());
        assert_eq!(
            maker(&node.id().to_string()),
            Pid::from_raw(std::process::id() as i32)
        );
        let [dead, alive] = [ended_process(), std::process::id()].map(|pid| nodes.join(id(pid)));
        for path in [&dead, &alive] {
            fs::create_dir(path).unwrap();
            fs::write(path.join("halfmade_node.details"), "details").unwrap();
        }
        fs::create_dir(nodes.join("something_else")).unwrap();
        let half_made: BTreeSet<PathBuf> = half_made_nodes(&root).into_iter().collect();
        assert_eq!(half_made, BTreeSet::from([dead.clone(), alive.clone()]));
        assert!(remove_half_made_node(&dead).is_ok());
        let refused = remove_half_made_node(&alive).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::WouldBlock);
        assert!(!dead.exists() && alive.is_dir() && whole.is_dir());
    }

    #[test]
    fn a_node_of_another_prefix_in_the_same_root_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let other = nodes_with(&folder, "another_", ended_process());
        assert!(
            half_made_nodes(folder.path()).is_empty(),
            "{}",
            other.display()
        );
    }

    /// A node in a root folder, whose monitor has this prefix.
    fn nodes_with(folder: &tempfile::TempDir, prefix: &str, pid: u32) -> PathBuf {
        let nodes = folder.path().join(NODES);
        let node = nodes.join(id(pid));
        fs::create_dir_all(&node).unwrap();
        fs::write(nodes.join(format!("{prefix}{}{MONITOR}", id(pid))), "").unwrap();
        node
    }
}
