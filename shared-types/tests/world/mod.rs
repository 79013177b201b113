//! A place of its own for each test.

use std::fs;

use shared_types::ipc::{IpcNode, IpcOptions};

/// A private root on tmpfs, gone with the test.
pub(crate) struct World {
    _directory: tempfile::TempDir,
    pub(crate) options: IpcOptions,
}

impl Drop for World {
    /// iceoryx2 keeps one small file a prefix for ever; nobody else uses this prefix.
    fn drop(&mut self) {
        for file in files_of(&self.options) {
            fs::remove_file(file.path()).unwrap();
        }
    }
}

/// This prefix's files in /dev/shm.
pub(crate) fn files_of(options: &IpcOptions) -> impl Iterator<Item = fs::DirEntry> {
    let files = fs::read_dir("/dev/shm").unwrap().map(Result::unwrap);
    files.filter(|file| {
        let name = file.file_name().into_string().unwrap();
        name.starts_with(&options.prefix) && file.file_type().unwrap().is_file()
    })
}

pub(crate) fn world() -> World {
    let directory = tempfile::tempdir_in("/dev/shm").unwrap();
    let unique = directory
        .path()
        .file_name()
        .unwrap()
        .to_str()
        .unwrap()
        .replace('.', "t");
    let options = IpcOptions {
        prefix: unique,
        root: directory.path().join("root"),
    };
    World {
        _directory: directory,
        options,
    }
}

/// Two processes' nodes: a daemon's and a user's.
pub(crate) fn daemon_and_user(world: &World) -> [IpcNode; 2] {
    ["daemon", "user"].map(|name| IpcNode::create(&world.options, name).unwrap())
}
