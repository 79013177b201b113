//! Removes what a listener leaves whose process was killed before others could see the listener.
//!
//! iceoryx2 0.10.0 makes a listener's tag first (`nodes/<id of its node>/<prefix><id>.port_tag`), then memory and a socket, and registers the
//! listener last. It cleans up after registered listeners alone, and removes the tags of the others without what they are for
//! (`remove_stale_port_resources` in `iceoryx2/src/service/stale_resource_cleanup.rs`).

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::half_made_node::{NODES, id_before, is_own, lives, maker};

/// How the names of a listener's memory and socket end.
const ENDS: [&str; 2] = [".event_mgmt", ".event"];
const TAG: &str = ".port_tag";

/// Memory in `folder` and sockets in `root` of listeners of dead processes that have no tag any more.
pub(super) fn left_by_listeners(prefix: &str, root: &Path, folder: &Path) -> BTreeSet<PathBuf> {
    let of_listeners = [root, folder].into_iter().flat_map(entries);
    let of_listeners = of_listeners.filter(|path| is_of_dead_listener(prefix, path));
    let mut left: BTreeSet<PathBuf> = of_listeners.collect();
    if !left.is_empty() {
        let nodes = entries(&root.join(NODES));
        let tags: BTreeSet<PathBuf> = nodes.flat_map(|node| entries(&node)).collect();
        let tagged: BTreeSet<&str> = tags
            .iter()
            .filter_map(|tag| id_before(name(tag), &[TAG]))
            .collect();
        left.retain(|path| listener(path).is_some_and(|id| !tagged.contains(id)));
    }
    left
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path())
}

fn is_of_dead_listener(prefix: &str, path: &Path) -> bool {
    let is_dead = || listener(path).and_then(maker).is_some_and(|it| !lives(it));
    name(path).starts_with(prefix) && is_dead() && is_own(path)
}

/// The id of the listener that a file is of.
fn listener(path: &Path) -> Option<&str> {
    id_before(name(path), &ENDS)
}

fn name(path: &Path) -> &str {
    path.file_name().and_then(OsStr::to_str).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::half_made_node::fixtures::{ended_process, id_of};
    use super::*;
    use tempfile::TempDir;

    /// Memory and socket of a listener that a process made.
    fn listener_of(root: &Path, folder: &Path, pid: u32) -> BTreeSet<PathBuf> {
        let id = id_of(pid);
        let memory = folder.join(format!("any_33c1_{id}.event_mgmt"));
        let paths = BTreeSet::from([memory, root.join(format!("any_{id}.event"))]);
        paths.iter().for_each(|path| fs::write(path, "").unwrap());
        paths
    }

    #[test]
    fn a_dead_listener_without_a_tag_has_left_what_it_made() {
        let (root, folder) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        let (root, folder) = (root.path(), folder.path());
        let dead = ended_process();
        let made = listener_of(root, folder, dead);
        listener_of(root, folder, std::process::id());
        fs::write(folder.join("any_33c1_7.event_mgmt"), "").unwrap();
        assert_eq!(left_by_listeners("any_", root, folder), made);
        assert!(left_by_listeners("other_", root, folder).is_empty());
        let node = root.join(NODES).join("of_any_node");
        fs::create_dir_all(&node).unwrap();
        let tag = node.join(format!("any_{}{TAG}", id_of(dead)));
        fs::write(&tag, "").unwrap();
        assert!(
            left_by_listeners("any_", root, folder).is_empty(),
            "it is cleaned up yet"
        );
        fs::remove_file(tag).unwrap();
        assert_eq!(left_by_listeners("any_", root, folder), made);
    }
}
