//! The shared memory from which iceoryx2 takes a number for each node, kept out of other users' reach.
//!
//! iceoryx2 0.10.0 makes it under one name a prefix, writable by everybody, and no node can be made any more once somebody
//! has written to it. The number only has to differ between nodes of one process id (containers). So each node of ours gets
//! memory of its own, under a name that nobody can guess, with a number that begins at random, and the name is removed once
//! the node is made. The name that the rule of iceoryx2 gives, which clients in other languages use, is made beforehand for
//! this user alone.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use rustix::process::geteuid;

use super::shm_override::FOLDER;

/// The name after the prefix: SHA-1 of `iceoryx2::node::global_management_segment::State`, iceoryx2's name, its version.
const NAME: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0";
/// Ends the name.
const SUFFIX: &str = ".global_mgmt";
/// Version 0.10.0 as iceoryx2 writes it at the begin of all that it shares.
const VERSION: u64 = 10 << 16;
/// Version, number, and what fills it up to a multiple of 8.
const BYTES: usize = 16;

/// The memory of one node, whose name is removed when this is dropped.
#[derive(Debug)]
pub(super) struct NodeCounter {
    path: PathBuf,
    suffix: String,
    /// Open as long as it is needed: what nobody has open is a dead process's.
    _file: File,
}

impl NodeCounter {
    /// Makes the memory for the next node of this process.
    ///
    /// # Errors
    /// What the system says.
    pub(super) fn make(prefix: &str) -> io::Result<Self> {
        let suffix = format!(".{:032x}{SUFFIX}", random()?);
        let path = Path::new(FOLDER).join(format!("{prefix}{NAME}{suffix}"));
        let mut file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&path)?;
        let written = next_number().and_then(|number| file.write_all(&contents(number)));
        // Dropped where it could not be written.
        let counter = Self {
            path,
            suffix,
            _file: file,
        };
        written.map(|()| counter)
    }

    /// The suffix with which iceoryx2 must be configured to use this memory.
    pub(super) fn suffix(&self) -> &str {
        &self.suffix
    }
}

impl Drop for NodeCounter {
    fn drop(&mut self) {
        // Gone already where a sweeper took it for a dead process's.
        let _ = fs::remove_file(&self.path);
    }
}

/// Makes the memory that clients in other languages take for this user alone, where it is missing, open to others, or
/// damaged. Another user's stays: those clients fail then, and have to set another suffix.
///
/// # Errors
/// What the system says.
pub(super) fn protect_shared(prefix: &str) -> io::Result<()> {
    let path = shared(prefix);
    match fs::symlink_metadata(&path) {
        Ok(data) if data.uid() != geteuid().as_raw() => return Ok(()),
        Ok(data) if data.mode() & 0o777 == 0o600 && is_whole(&path) => return Ok(()),
        _ => {}
    }
    let fresh = NodeCounter::make(prefix)?;
    fs::rename(&fresh.path, &path)
}

/// Removes the memory that clients in other languages take under a prefix that nobody uses any more.
pub(super) fn remove_shared(prefix: &str) {
    // Never made, perhaps.
    let _ = fs::remove_file(shared(prefix));
}

/// The name that the rule of iceoryx2 gives.
fn shared(prefix: &str) -> PathBuf {
    Path::new(FOLDER).join(format!("{prefix}{NAME}{SUFFIX}"))
}

/// Whether a name in the folder of shared memory is one that [`NodeCounter`] makes for a moment.
pub(super) fn is_of_one_node(prefix: &str, name: &str) -> bool {
    let rest = name
        .strip_prefix(prefix)
        .and_then(|rest| rest.strip_prefix(NAME));
    let random = rest.and_then(|rest| rest.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == 33)
}

fn is_whole(path: &Path) -> bool {
    let bytes = fs::read(path).unwrap_or_default();
    bytes.len() == BYTES && bytes.starts_with(&VERSION.to_ne_bytes())
}

fn contents(number: u32) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    bytes[..8].copy_from_slice(&VERSION.to_ne_bytes());
    bytes[8..12].copy_from_slice(&number.to_ne_bytes());
    bytes
}

/// No two nodes of a process get the same; two processes of one id, in two containers, begin at random.
fn next_number() -> io::Result<u32> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    static MADE: AtomicU32 = AtomicU32::new(0);
    let drawn = random()?;
    let first = FIRST.get_or_init(|| drawn as u32);
    Ok(first.wrapping_add(MADE.fetch_add(1, Ordering::Relaxed)))
}

fn random() -> io::Result<u128> {
    let mut bytes = [0; 16];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(u128::from_ne_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::ipc::{IpcNode, IpcOptions};

    fn options(folder: &Path) -> IpcOptions {
        IpcOptions {
            prefix: folder
                .file_name()
                .unwrap()
                .to_str()
                .unwrap()
                .replace('.', "t"),
            root: folder.join("root"),
        }
    }

    #[test]
    fn iceoryx2_takes_the_number_that_it_was_given_and_the_name_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let options = options(folder.path());
        let before = next_number().unwrap();
        let node = IpcNode::create(&options, "test").unwrap();
        let number = (node.id() >> 96) as u32;
        let after = next_number().unwrap();
        assert!((1..after.wrapping_sub(before)).contains(&number.wrapping_sub(before)));
        let prefix = options.file_prefix();
        let names = fs::read_dir(FOLDER).unwrap().flatten();
        let mut names = names.map(|entry| entry.file_name().into_string().unwrap());
        assert!(!names.any(|name| is_of_one_node(&prefix, &name)));
        assert!(is_of_one_node(
            &prefix,
            &format!("{prefix}{NAME}.{:032x}{SUFFIX}", 1)
        ));
        fs::remove_file(shared(&options.file_prefix())).unwrap();
    }

    #[test]
    fn the_memory_of_other_languages_is_made_private_and_mended() {
        let folder = tempfile::tempdir().unwrap();
        let options = options(folder.path());
        let path = shared(&options.file_prefix());
        let spoil: [fn(&Path); 4] = [
            |_| (),
            |path| fs::set_permissions(path, fs::Permissions::from_mode(0o666)).unwrap(),
            |path| fs::write(path, [0xff; BYTES]).unwrap(),
            |path| fs::write(path, []).unwrap(),
        ];
        for spoil in spoil {
            spoil(&path);
            let node = IpcNode::create(&options, "test").unwrap();
            assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
            assert!(is_whole(&path));
            drop(node);
        }
        fs::remove_file(path).unwrap();
    }
}
