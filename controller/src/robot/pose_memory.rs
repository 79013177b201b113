//! Where the simulated robot stands, kept in a file so that it survives the process.
//!
//! A real robot does not move back to straight when its driver is killed. The reference is written each cycle into a
//! mapped file (no system call); the next process goes on from there, finishing the ramp to rest if it was moving. A
//! clean exit removes the file: the simulated robot is gone.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use realtime::MappedFile;
use robot_driver::{TENDONS, TendonState};

const NUMBERS: usize = 2 * TENDONS;

/// One of two copies, written in turn: a process killed while it writes one leaves the other whole.
#[derive(Clone, Copy)]
struct PoseCopy<'memory> {
    /// Count of the write, stored after the numbers; 0 = never or half written.
    count: &'memory AtomicU64,
    numbers: &'memory [AtomicU64],
}

/// The mapped file.
pub struct PoseMemory {
    path: PathBuf,
    memory: MappedFile,
    count: u64,
}

impl PoseMemory {
    /// Opens or creates the file at `path` and maps it.
    ///
    /// # Errors
    /// The system's, where the file cannot be created, sized or mapped.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut memory = Self {
            path: path.to_owned(),
            memory: MappedFile::open(path, 2 * (1 + NUMBERS))?,
            count: 0,
        };
        let newest = memory.newest();
        memory.count = newest.map_or(0, |copy| copy.count.load(Ordering::Acquire));
        Ok(memory)
    }

    /// The pose of the last process, `None` in a new file or where the numbers are not finite.
    #[must_use]
    pub fn recall(&self) -> Option<TendonState> {
        let newest = self.newest()?;
        let number = |index: usize| f64::from_bits(newest.numbers[index].load(Ordering::Relaxed));
        let pose = TendonState {
            position_m: std::array::from_fn(number),
            velocity_m_s: std::array::from_fn(|tendon| number(TENDONS + tendon)),
        };
        let finite = (0..NUMBERS).all(|index| number(index).is_finite());
        finite.then_some(pose)
    }

    /// Writes the pose over the older of the two copies.
    pub fn remember(&mut self, pose: &TendonState) {
        self.count += 1;
        let copy = self.copies()[(self.count % 2) as usize];
        copy.count.store(0, Ordering::Release);
        let numbers = pose.position_m.iter().chain(&pose.velocity_m_s);
        for (stored, number) in copy.numbers.iter().zip(numbers) {
            stored.store(number.to_bits(), Ordering::Release);
        }
        copy.count.store(self.count, Ordering::Release);
    }

    /// Removes the file: the next robot starts where its configuration says.
    ///
    /// # Errors
    /// The system's, where the file cannot be removed.
    pub fn forget(self) -> io::Result<()> {
        fs::remove_file(&self.path)
    }

    fn copies(&self) -> [PoseCopy<'_>; 2] {
        let (first, second) = self.memory.words().split_at(1 + NUMBERS);
        [first, second].map(|words| PoseCopy {
            count: &words[0],
            numbers: &words[1..],
        })
    }

    fn newest(&self) -> Option<PoseCopy<'_>> {
        let count = |copy: &PoseCopy<'_>| copy.count.load(Ordering::Acquire);
        let newest = self.copies().into_iter().max_by_key(count)?;
        (count(&newest) > 0).then_some(newest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(number: f64) -> TendonState {
        TendonState {
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
        memory.copies()[1].count.store(0, Ordering::Release);
        memory.copies()[1].numbers[3].store(f64::NAN.to_bits(), Ordering::Release);
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
