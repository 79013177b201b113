//! Outputs that hold whoever writes to them: a pipe that nobody reads, a terminal that was stopped with Ctrl-S, a disk that stands
//! still, a full one.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, PipeReader, PipeWriter, Write, pipe};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::mount::{MountFlags, UnmountFlags, mount, unmount};
use rustix::pipe::fcntl_setpipe_size;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use tempfile::TempDir;

/// The smallest pipe there is, bytes.
const PIPE_BYTES: usize = 4096;
/// Ctrl-S.
const STOP: u8 = 0x13;

/// What a process may write to, and what stalls it.
#[derive(Debug)]
pub enum StalledOutput {
    /// A pipe with nobody at its other end who reads.
    Pipe {
        /// Kept open: a pipe without a reader is an error for its writers, not a stall.
        _reader: PipeReader,
        /// The end that processes write to.
        writer: PipeWriter,
    },
    /// A terminal: our side, and the side that processes write to.
    Terminal {
        /// Where a person sits.
        person: File,
        /// Where programs write to.
        programs: File,
    },
    /// A file on a disk that stands still: who writes to it waits, and not even a signal ends that.
    Disk {
        /// Where processes write to.
        log: File,
        /// Goes on when dropped.
        disk: FreezingDisk,
    },
}

impl StalledOutput {
    /// A pipe; it takes what is written to it until [`StalledOutput::stall`].
    ///
    /// # Errors
    /// The system's.
    pub fn pipe() -> io::Result<Self> {
        let (reader, writer) = pipe()?;
        fcntl_setpipe_size(&writer, PIPE_BYTES)?;
        Ok(Self::Pipe {
            _reader: reader,
            writer,
        })
    }

    /// A terminal; it takes what is written to it until [`StalledOutput::stall`].
    ///
    /// # Errors
    /// The system's.
    pub fn terminal() -> io::Result<Self> {
        let person = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&person)?;
        unlockpt(&person)?;
        let name = ptsname(&person, Vec::new())?;
        let programs = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(libc::O_NOCTTY)
            .open(name.to_str().map_err(io::Error::other)?)?;
        Ok(Self::Terminal {
            person: person.into(),
            programs,
        })
    }

    /// A file on a disk of its own.
    ///
    /// # Errors
    /// The system's: only root may.
    pub fn disk() -> io::Result<Self> {
        let disk = FreezingDisk::mount()?;
        let log = OpenOptions::new()
            .append(true)
            .create(true)
            .open(disk.place("log"))?;
        Ok(Self::Disk { log, disk })
    }

    /// What a process is started with.
    ///
    /// # Errors
    /// The system's.
    pub fn stdio(&self) -> io::Result<Stdio> {
        let programs: OwnedFd = match self {
            Self::Pipe { writer, .. } => writer.try_clone()?.into(),
            Self::Terminal { programs, .. } => programs.try_clone()?.into(),
            Self::Disk { log, .. } => log.try_clone()?.into(),
        };
        Ok(programs.into())
    }

    /// Takes nothing more from now on.
    ///
    /// # Errors
    /// The system's.
    pub fn stall(&mut self) -> io::Result<()> {
        match self {
            Self::Pipe { writer, .. } => fill(writer),
            Self::Terminal { person, .. } => person.write_all(&[STOP]),
            Self::Disk { disk, .. } => disk.freeze(),
        }
    }

    /// Whether a write would wait.
    ///
    /// # Errors
    /// The system's.
    pub fn is_stalled(&self) -> io::Result<bool> {
        let file = match self {
            Self::Pipe { writer, .. } => writer.as_fd(),
            Self::Terminal { programs, .. } => programs.as_fd(),
            Self::Disk { disk, .. } => return Ok(disk.is_frozen),
        };
        let mut files = [PollFd::from_borrowed_fd(file, PollFlags::OUT)];
        Ok(poll(&mut files, Some(&Timespec::default()))? == 0)
    }
}

/// A file system of its own on a file in memory, whose writers can be made to wait; gone when dropped.
#[derive(Debug)]
pub struct FreezingDisk {
    folder: TempDir,
    is_frozen: bool,
}

impl FreezingDisk {
    const BYTES: u64 = 8 << 20;

    fn mount() -> io::Result<Self> {
        let folder = tempfile::Builder::new().tempdir_in("/dev/shm")?;
        let image = folder.path().join("image");
        File::create(&image)?.set_len(Self::BYTES)?;
        let disk = Self {
            folder,
            is_frozen: false,
        };
        fs::create_dir(disk.place(""))?;
        run("mkfs.ext4", &["-q".as_ref(), "-F".as_ref(), image.as_ref()])?;
        let place = disk.place("");
        run(
            "mount",
            &[
                "-o".as_ref(),
                "loop".as_ref(),
                image.as_ref(),
                place.as_ref(),
            ],
        )?;
        Ok(disk)
    }

    fn place(&self, name: &str) -> PathBuf {
        self.folder.path().join("mounted").join(name)
    }

    fn freeze(&mut self) -> io::Result<()> {
        run("fsfreeze", &["--freeze".as_ref(), self.place("").as_ref()])?;
        self.is_frozen = true;
        Ok(())
    }
}

impl Drop for FreezingDisk {
    fn drop(&mut self) {
        let place = self.place("");
        if self.is_frozen {
            let _ = run("fsfreeze", &["--unfreeze".as_ref(), place.as_ref()]);
        }
        // Processes may have files open there.
        let _ = unmount(&place, UnmountFlags::DETACH);
    }
}

fn run(program: &str, arguments: &[&OsStr]) -> io::Result<()> {
    let output = Command::new(program).args(arguments).output()?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(io::Error::other(format!("{program}: {}", said.trim())))
}

/// Writes until nothing more goes in, through a file of its own: the processes' must go on waiting.
fn fill(writer: &PipeWriter) -> io::Result<()> {
    let mut own = OpenOptions::new()
        .write(true)
        .custom_flags(libc::O_NONBLOCK)
        .open(format!("/proc/self/fd/{}", writer.as_raw_fd()))?;
    loop {
        match own.write(&[b'.'; 64]) {
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
            Err(error) => return Err(error),
        }
    }
}

/// A small disk of its own, in memory; gone when dropped.
#[derive(Debug)]
pub struct SmallDisk {
    folder: PathBuf,
}

impl SmallDisk {
    /// Mounts one over a folder that is there.
    ///
    /// # Errors
    /// The system's: only root may.
    pub fn mount(folder: &Path, bytes: usize) -> io::Result<Self> {
        let options = format!("size={bytes},mode=700");
        let options = std::ffi::CString::new(options).map_err(io::Error::other)?;
        let flags = MountFlags::NOSUID | MountFlags::NODEV;
        mount("tmpfs", folder, "tmpfs", flags, options.as_c_str())?;
        Ok(Self {
            folder: folder.to_owned(),
        })
    }

    /// Fills it to the last byte.
    ///
    /// # Errors
    /// Any but that the disk is full.
    pub fn fill(&self) -> io::Result<()> {
        let mut ballast = File::create(self.folder.join("ballast"))?;
        for size in [1 << 16, 1] {
            let block = vec![0; size];
            loop {
                match ballast.write_all(&block) {
                    Ok(()) => {}
                    Err(error) if error.kind() == io::ErrorKind::StorageFull => break,
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }

    /// Whether not a byte more goes onto it.
    #[must_use]
    pub fn is_full(&self) -> bool {
        let file = self.folder.join("probe");
        let written = fs::write(&file, [0]);
        let _ = fs::remove_file(&file);
        written.is_err_and(|error| error.kind() == io::ErrorKind::StorageFull)
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = unmount(&self.folder, UnmountFlags::DETACH);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_and_a_terminal_take_lines_until_they_stall() {
        for mut output in [
            StalledOutput::pipe().unwrap(),
            StalledOutput::terminal().unwrap(),
        ] {
            assert!(!output.is_stalled().unwrap(), "{output:?}");
            output.stall().unwrap();
            assert!(output.is_stalled().unwrap(), "{output:?}");
        }
    }
}
