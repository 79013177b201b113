//! Where the simulated robot stands, kept in a file so that it survives the process.
//!
//! A real robot does not move back to straight when its driver is killed. The reference is written each cycle into a
//! mapped file (no system call); the next process goes on from there, finishing the ramp to rest if it was moving. A
//! clean exit removes the file: the simulated robot is gone.

#![allow(unsafe_code, reason = "a mapped file that outlives the process")]

use std::{
    fs::OpenOptions,
    io,
    os::fd::AsRawFd,
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
    ptr::NonNull,
    sync::atomic::{AtomicU64, Ordering},
};

use crate::{TENDONS, TendonVector};

/// The reference at the last cycle of the process that wrote it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RememberedPose {
    /// Tendon lengths relative to straight, m.
    pub position_m: TendonVector,
    /// Their rates, m/s.
    pub velocity_m_s: TendonVector,
}

const NUMBERS: usize = 2 * TENDONS;

/// Two copies, written in turn: a process killed while it writes one leaves the other whole.
#[repr(C)]
struct Slot {
    /// Count of the write, stored after the numbers; 0 = never or half written.
    count: AtomicU64,
    numbers: [AtomicU64; NUMBERS],
}

/// The mapped file.
pub struct PoseMemory {
    path: PathBuf,
    slots: NonNull<[Slot; 2]>,
    count: u64,
}

impl PoseMemory {
    /// Opens or creates the file at `path` and maps it.
    ///
    /// # Errors
    /// The system's, where the file cannot be created, sized or mapped.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(path)?;
        let bytes = size_of::<[Slot; 2]>();
        // Its memory is taken now: a page that a full disk has none left for would end the process when it is written.
        // SAFETY: takes numbers only.
        let refused = unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, bytes as libc::off_t) };
        if refused != 0 {
            return Err(io::Error::from_raw_os_error(refused));
        }
        // SAFETY: a new shared mapping of a file that is `bytes` long; failure is checked.
        let address = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                bytes,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED,
                file.as_raw_fd(),
                0,
            )
        };
        if address == libc::MAP_FAILED {
            return Err(io::Error::last_os_error());
        }
        let slots = NonNull::new(address.cast()).ok_or(io::ErrorKind::AddrNotAvailable)?;
        let mut memory = Self {
            path: path.to_owned(),
            slots,
            count: 0,
        };
        memory.count = memory
            .newest()
            .map_or(0, |slot| slot.count.load(Ordering::Acquire));
        Ok(memory)
    }

    /// The pose of the last process, `None` in a new file or where the numbers are not finite.
    #[must_use]
    pub fn recall(&self) -> Option<RememberedPose> {
        let slot = self.newest()?;
        let number = |index: usize| f64::from_bits(slot.numbers[index].load(Ordering::Relaxed));
        let pose = RememberedPose {
            position_m: std::array::from_fn(number),
            velocity_m_s: std::array::from_fn(|tendon| number(TENDONS + tendon)),
        };
        let finite = (0..NUMBERS).all(|index| number(index).is_finite());
        finite.then_some(pose)
    }

    /// Writes the pose over the older of the two copies.
    pub fn remember(&mut self, pose: &RememberedPose) {
        self.count += 1;
        let slot = &self.slots()[(self.count % 2) as usize];
        slot.count.store(0, Ordering::Release);
        let numbers = pose.position_m.iter().chain(&pose.velocity_m_s);
        for (stored, number) in slot.numbers.iter().zip(numbers) {
            stored.store(number.to_bits(), Ordering::Release);
        }
        slot.count.store(self.count, Ordering::Release);
    }

    /// Removes the file: the next robot starts where its configuration says.
    ///
    /// # Errors
    /// The system's, where the file cannot be removed.
    pub fn forget(self) -> io::Result<()> {
        std::fs::remove_file(&self.path)
    }

    fn slots(&self) -> &[Slot; 2] {
        // SAFETY: mapped for as long as `self` lives, page-aligned, and made of atomics only, for which every bit
        // pattern is valid.
        unsafe { self.slots.as_ref() }
    }

    fn newest(&self) -> Option<&Slot> {
        let count = |slot: &&Slot| slot.count.load(Ordering::Acquire);
        self.slots()
            .iter()
            .max_by_key(count)
            .filter(|slot| count(slot) > 0)
    }
}

impl Drop for PoseMemory {
    fn drop(&mut self) {
        // SAFETY: the mapping made in `open`, given back once.
        unsafe { libc::munmap(self.slots.as_ptr().cast(), size_of::<[Slot; 2]>()) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(number: f64) -> RememberedPose {
        RememberedPose {
            position_m: std::array::from_fn(|tendon| number + tendon as f64),
            velocity_m_s: [-number; TENDONS],
        }
    }

    #[test]
    fn the_last_whole_pose_is_recalled_by_the_next_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pose");
        let mut memory = PoseMemory::open(&path).unwrap();
        assert_eq!(memory.recall(), None);
        for number in 1..=5 {
            memory.remember(&pose(f64::from(number)));
        }
        drop(memory);
        let mut memory = PoseMemory::open(&path).unwrap();
        assert_eq!(memory.recall(), Some(pose(5.0)));
        memory.remember(&pose(6.0));
        // Killed while writing the seventh: the sixth is still whole.
        memory.slots()[1].count.store(0, Ordering::Release);
        memory.slots()[1].numbers[3].store(f64::NAN.to_bits(), Ordering::Release);
        drop(memory);
        assert_eq!(PoseMemory::open(&path).unwrap().recall(), Some(pose(6.0)));
    }

    #[test]
    fn a_forgotten_or_spoilt_pose_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pose");
        let mut memory = PoseMemory::open(&path).unwrap();
        memory.remember(&pose(f64::INFINITY));
        assert_eq!(memory.recall(), None);
        memory.forget().unwrap();
        assert_eq!(PoseMemory::open(&path).unwrap().recall(), None);
    }
}
