//! The sources of obstacles and their scenes, kept in a mapped file for the next daemon, however this one ends.

use std::fmt::Display;
use std::fs;
use std::io;
use std::ops::Range;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use realtime::{MappedFile, is_in_ram};
use shared_types::PROTOCOL_VERSION;
use shared_types::capacity::{MAX_SCENE_BALLS, SOURCE_NAME_BYTES};
use shared_types::clock::{Suspension, mono_now_ns};
use shared_types::ipc::IpcOptions;
use shared_types::message::{MovingBall, SceneMessage};
use shared_types::valid::{self, SourceName};

/// Most sources that are kept, and most publishers whose scenes are received, at once: those that may live at once, and as many
/// that were restarted.
pub(crate) const MAX_SOURCES: usize = 8;

/// First word of the file: a number that is another one whenever the layout of the file or of a scene is.
const FORMAT_ID: u64 = u64::from_le_bytes(*b"scenes\x03\x00") + PROTOCOL_VERSION as u64;
/// A folder whose files lie in memory alone.
const SHARED_MEMORY: &str = "/dev/shm";
/// Words before the first slot: [`FORMAT_ID`], the [`boot_id`] since which the stamps count, for how long the machine had been suspended
/// since, and when that was noticed last.
const HEADER_WORDS: usize = 5;
const SUSPENDED: usize = 3;
const RESUMED: usize = 4;
/// Words of a ball: centre, radius and velocity.
const BALL_WORDS: usize = 7;
/// Where the words of a slot lie: its state ([`FREE`], [`UNKNOWN`] or [`COMPLETE`]), whether its source takes its leave, the publisher,
/// the name of the source.
const STATE: usize = 0;
const LEAVES: usize = 1;
const PUBLISHER: Range<usize> = 2..4;
const NAME: Range<usize> = 4..4 + SOURCE_NAME_BYTES / 8;
/// Stamp, nanoseconds; lifetime, nanoseconds; number of balls.
const SCENE: Range<usize> = NAME.end..NAME.end + 3;
const BALLS: usize = SCENE.end;
const SLOT_WORDS: usize = BALLS + MAX_SCENE_BALLS * BALL_WORDS;

/// State of a slot without a source.
const FREE: u64 = 0;
/// State of a slot with a source, but no scene of it: its obstacles are unknown.
const UNKNOWN: u64 = 1;
/// State of a slot with a source and its scene.
const COMPLETE: u64 = 2;

/// The file in which the daemon keeps the sources of obstacles cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("the live scene cannot be kept for the next daemon in {path:?}: {source}")]
pub struct SceneMemoryError {
    /// The file.
    path: PathBuf,
    /// The system's answer.
    #[source]
    source: io::Error,
}

/// A source of obstacles as the file has it, and its scene; none where none of it counted, or the daemon was killed while it wrote one.
pub(super) type RetainedSource = (SourceRecord, Option<valid::Scene>);

/// Record of a source by which the file is compared with the present; the scene is identified by stamp and version.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SourceRecord {
    pub(super) name: SourceName,
    pub(super) publisher: u128,
    pub(super) leaves: bool,
    /// Stamp and lifetime, nanoseconds, and version of the source's scene; none of a scene that an earlier daemon has kept.
    pub(super) scene: Option<(i64, i64, u64)>,
}

/// The file, with a slot for each source, and the record that each slot holds now.
pub(crate) struct SceneMemory {
    memory: MappedFile,
    records: [Option<SourceRecord>; MAX_SOURCES],
}

impl SceneMemory {
    /// Opens the file, or makes it: in the root folder, or, where a disk would have to be waited for there, in shared memory. What a
    /// daemon with another [`FORMAT_ID`] has written, or one that ran before the machine was started, is forgotten; what was written before
    /// the machine was suspended is unknown.
    ///
    /// # Errors
    /// [`SceneMemoryError`]: the system's refusal.
    pub(crate) fn open(options: &IpcOptions, suspended_ns: i64) -> Result<Self, SceneMemoryError> {
        let path = options
            .root
            .join(format!("{}.daemon.scenes", options.prefix));
        if !is_in_ram(&options.root).unwrap_or(false) {
            match Self::in_shared_memory(options, suspended_ns) {
                Ok(memory) => return Ok(memory),
                Err(error) => tracing::warn!(
                    "the live scene is kept for the next daemon in {path:?}, where a disk can delay orders to stop: {SHARED_MEMORY} cannot be used: {error}"
                ),
            }
        }
        Self::map(&path, suspended_ns).map_err(|source| SceneMemoryError { path, source })
    }

    /// The memory in a file of this root directory's own in [`SHARED_MEMORY`].
    fn in_shared_memory(options: &IpcOptions, suspended_ns: i64) -> io::Result<Self> {
        let root = fs::metadata(&options.root)?;
        let (prefix, device, inode) = (&options.prefix, root.dev(), root.ino());
        let name = format!("{prefix}.{device:x}-{inode:x}.daemon.scenes");
        Self::map(&Path::new(SHARED_MEMORY).join(name), suspended_ns)
    }

    fn map(path: &Path, suspended_ns: i64) -> io::Result<Self> {
        let words = HEADER_WORDS + MAX_SOURCES * SLOT_WORDS;
        let memory = Self {
            memory: MappedFile::open(path, words)?,
            records: [None; MAX_SOURCES],
        };
        let head = &memory.memory.words()[..HEADER_WORDS];
        let [low, high] = halves(boot_id()?);
        let own = [FORMAT_ID, low, high, 0, 0];
        if !head[..SUSPENDED]
            .iter()
            .map(load)
            .eq(own[..SUSPENDED].iter().copied())
        {
            for index in 0..MAX_SOURCES {
                memory.slot(index).set_state(FREE);
            }
            // The first words last: a daemon that is killed before has written nothing that counts.
            for (word, value) in head.iter().zip(own).rev() {
                word.store(value, Ordering::Release);
            }
        }
        memory.notice_suspension(suspended_ns, mono_now_ns());
        Ok(memory)
    }

    /// Makes what was written before the machine was suspended unknown: `suspended_ns` in all since its start. Whether that is news.
    pub(super) fn notice_suspension(&self, suspended_ns: i64, now_mono_ns: i64) -> bool {
        let noticed = load(&self.memory.words()[SUSPENDED]).cast_signed();
        let is_longer = Suspension::noticed(noticed).is_longer(suspended_ns);
        if is_longer {
            for index in 0..MAX_SOURCES {
                self.slot(index).forget_scene();
            }
            // In this order: a daemon that is killed between the two leaves news to the next one.
            let words = self.memory.words();
            words[RESUMED].store(now_mono_ns.cast_unsigned(), Ordering::Release);
            words[SUSPENDED].store(suspended_ns.cast_unsigned(), Ordering::Release);
        }
        is_longer
    }

    /// When it was noticed last that the machine had been suspended, by this daemon or one before it, nanoseconds of `CLOCK_MONOTONIC`,
    /// which stands meanwhile; 0 where it never was.
    pub(super) fn resumed_mono_ns(&self) -> i64 {
        load(&self.memory.words()[RESUMED]).cast_signed()
    }

    /// The sources that the file has.
    pub(super) fn recall(&mut self) -> Vec<RetainedSource> {
        let mut sources = Vec::new();
        for index in 0..MAX_SOURCES {
            let slot = self.slot(index);
            let source = slot.recall();
            if source.is_none() {
                slot.set_state(FREE);
            }
            self.records[index] = source.as_ref().map(|(record, _)| *record);
            sources.extend(source);
        }
        sources
    }

    /// Keeps these sources, each with its scene, and no others.
    pub(super) fn keep<'scene>(
        &mut self,
        sources: impl Iterator<Item = (SourceRecord, Option<&'scene valid::Scene>)> + Clone,
    ) {
        let is_of = |kept: &Option<SourceRecord>, record: &SourceRecord| {
            kept.is_some_and(|kept| kept.name == record.name && kept.publisher == record.publisher)
        };
        for index in 0..MAX_SOURCES {
            let kept = self.records[index];
            if kept.is_some() && !sources.clone().any(|(record, _)| is_of(&kept, &record)) {
                self.slot(index).set_state(FREE);
                self.records[index] = None;
            }
        }
        for (record, scene) in sources {
            let own = self.records.iter().position(|kept| is_of(kept, &record));
            let slot = own.or_else(|| self.records.iter().position(Option::is_none));
            if let Some(slot) = slot.filter(|&slot| self.records[slot] != Some(record)) {
                self.slot(slot).keep(&record, scene);
                self.records[slot] = Some(record);
            }
        }
    }

    fn slot(&self, index: usize) -> Slot<'_> {
        let begin = HEADER_WORDS + index * SLOT_WORDS;
        Slot(&self.memory.words()[begin..begin + SLOT_WORDS])
    }
}

/// The words of one source.
struct Slot<'memory>(&'memory [AtomicU64]);

impl Slot<'_> {
    fn set_state(&self, state: u64) {
        self.0[STATE].store(state, Ordering::Release);
    }

    fn forget_scene(&self) {
        if load(&self.0[STATE]) != FREE {
            self.set_state(UNKNOWN);
        }
    }

    /// Writes a source. Until its scene is whole its state is [`UNKNOWN`], also where the daemon is killed meanwhile.
    fn keep(&self, record: &SourceRecord, scene: Option<&valid::Scene>) {
        if load(&self.0[STATE]) == FREE {
            store(&self.0[PUBLISHER], halves(record.publisher));
            let name = record.name.to_wire();
            let words = name
                .chunks_exact(8)
                .map(|bytes| u64::from_le_bytes(bytes.try_into().unwrap_or_default()));
            store(&self.0[NAME], words);
        }
        self.0[LEAVES].store(u64::from(record.leaves), Ordering::Release);
        self.set_state(UNKNOWN);
        let Some(scene) = scene else {
            return;
        };
        let times = [scene.stamp_mono_ns, scene.lifetime_ns].map(i64::cast_unsigned);
        let count = scene.balls.len() as u64;
        store(&self.0[SCENE], times.into_iter().chain([count]));
        let places = self.0[BALLS..].chunks_exact(BALL_WORDS);
        for (words, ball) in places.zip(&scene.balls) {
            let [x, y, z] = ball.centre_m;
            let [u, v, w] = ball.velocity_m_s;
            store(words, [x, y, z, ball.radius_m, u, v, w].map(f64::to_bits));
        }
        self.set_state(COMPLETE);
    }

    fn recall(&self) -> Option<RetainedSource> {
        let state = load(&self.0[STATE]);
        let mut name = [0; SOURCE_NAME_BYTES];
        for (bytes, word) in name.chunks_exact_mut(8).zip(&self.0[NAME]) {
            bytes.copy_from_slice(&load(word).to_le_bytes());
        }
        let name = SourceName::try_from(&name).ok().filter(|_| state != FREE)?;
        let [low, high] = [0, 1].map(|half| u128::from(load(&self.0[PUBLISHER][half])));
        let record = SourceRecord {
            name,
            publisher: low | high << 64,
            leaves: load(&self.0[LEAVES]) != 0,
            scene: None,
        };
        let scene = (state == COMPLETE).then(|| self.scene(name)).flatten();
        Some((record, scene))
    }

    /// The scene, if a source may publish such a one.
    fn scene(&self, source: SourceName) -> Option<valid::Scene> {
        let [stamp, lifetime, count] = [0, 1, 2].map(|index| load(&self.0[SCENE][index]));
        let ball = |words: &[AtomicU64]| {
            let number = |index: usize| f64::from_bits(load(&words[index]));
            MovingBall {
                centre_m: [0, 1, 2].map(number),
                radius_m: number(3),
                velocity_m_s: [4, 5, 6].map(number),
            }
        };
        let count = usize::try_from(count)
            .ok()
            .filter(|&count| count <= MAX_SCENE_BALLS)?;
        let balls = self.0[BALLS..].chunks_exact(BALL_WORDS).take(count);
        let scene = valid::Scene {
            source,
            sequence: 0,
            stamp_mono_ns: stamp.cast_signed(),
            lifetime_ns: lifetime.cast_signed(),
            takes_leave: false,
            balls: balls.map(ball).collect(),
        };
        let mut wire = Box::new(SceneMessage::ZEROED);
        scene.write(&mut wire).ok().map(|()| scene)
    }
}

fn load(word: &AtomicU64) -> u64 {
    word.load(Ordering::Acquire)
}

fn store(words: &[AtomicU64], values: impl IntoIterator<Item = u64>) {
    for (word, value) in words.iter().zip(values) {
        word.store(value, Ordering::Release);
    }
}

fn halves(value: u128) -> [u64; 2] {
    [value as u64, (value >> 64) as u64]
}

/// A number that Linux draws anew at each start of the machine: clocks that count from there begin again.
fn boot_id() -> io::Result<u128> {
    let path = "/proc/sys/kernel/random/boot_id";
    let named = |error: &dyn Display| io::Error::other(format!("{path}: {error}"));
    let text = fs::read_to_string(path).map_err(|error| named(&error))?;
    let digits = text.trim().replace('-', "");
    u128::from_str_radix(&digits, 16).map_err(|error| named(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(name: &str, publisher: u128, balls: usize) -> RetainedSource {
        let name = SourceName::new(name).unwrap();
        let ball = |index: usize| MovingBall {
            centre_m: [index as f64 * 1e-3, 2.0, 3.0],
            radius_m: 0.1,
            velocity_m_s: [0.0, -1.0, 0.5],
        };
        let scene = valid::Scene {
            source: name,
            sequence: 0,
            stamp_mono_ns: 17,
            lifetime_ns: 1_000_000,
            takes_leave: false,
            balls: (0..balls).map(ball).collect(),
        };
        let record = SourceRecord {
            name,
            publisher,
            leaves: balls == 0,
            scene: None,
        };
        (record, Some(scene))
    }

    fn keep(memory: &mut SceneMemory, sources: &[RetainedSource], version: u64) {
        let kept = sources.iter().map(|(record, scene)| {
            let scene = scene.as_ref();
            let times = scene.map(|scene| (scene.stamp_mono_ns, scene.lifetime_ns, version));
            let record = SourceRecord {
                scene: times,
                ..*record
            };
            (record, scene)
        });
        memory.keep(kept);
    }

    fn options(folder: &tempfile::TempDir) -> IpcOptions {
        IpcOptions {
            prefix: "test".to_owned(),
            root: folder.path().to_owned(),
        }
    }

    #[test]
    fn the_next_daemon_knows_the_sources_that_were_kept_last() {
        let folder = tempfile::tempdir_in(SHARED_MEMORY).unwrap();
        let options = options(&folder);
        let mut memory = SceneMemory::open(&options, 0).unwrap();
        assert_eq!(memory.recall(), []);
        let all: Vec<RetainedSource> = (0..MAX_SOURCES)
            .map(|index| {
                source(
                    &format!("camera {index}"),
                    u128::MAX - index as u128,
                    index * 100,
                )
            })
            .collect();
        keep(&mut memory, &all, 1);
        let mut memory = SceneMemory::open(&options, 0).unwrap();
        assert_eq!(memory.recall(), all);
        let fewer = [
            source("camera 3", u128::MAX - 3, 2),
            source("new", 5, MAX_SCENE_BALLS),
        ];
        keep(&mut memory, &fewer, 2);
        let mut recalled = SceneMemory::open(&options, 0).unwrap().recall();
        recalled.sort_by_key(|(record, _)| record.publisher != u128::MAX - 3);
        assert_eq!(recalled, fewer);
        keep(&mut memory, &[], 3);
        assert_eq!(SceneMemory::open(&options, 0).unwrap().recall(), []);
    }

    #[test]
    fn a_scene_that_was_half_kept_is_a_source_whose_obstacles_are_unknown() {
        let folder = tempfile::tempdir_in(SHARED_MEMORY).unwrap();
        let mut memory = SceneMemory::open(&options(&folder), 0).unwrap();
        keep(&mut memory, &[source("camera", 7, 3)], 1);
        let spoil: [fn(&Slot<'_>); 3] = [
            |slot| slot.set_state(UNKNOWN),
            |slot| slot.0[BALLS].store(f64::NAN.to_bits(), Ordering::Release),
            |slot| slot.0[SCENE][2].store(u64::MAX, Ordering::Release),
        ];
        for spoil in spoil {
            spoil(&memory.slot(0));
            let recalled = SceneMemory::open(&options(&folder), 0).unwrap().recall();
            let [(record, scene)] = &recalled[..] else {
                panic!("{recalled:?}");
            };
            assert_eq!((record.publisher, scene), (7, &None));
            keep(&mut memory, &[], 2);
            keep(&mut memory, &[source("camera", 7, 3)], 3);
        }
    }

    #[test]
    fn what_was_kept_before_the_machine_was_suspended_is_unknown() {
        let folder = tempfile::tempdir_in(SHARED_MEMORY).unwrap();
        let mut memory = SceneMemory::open(&options(&folder), 0).unwrap();
        keep(&mut memory, &[source("camera", 7, 3)], 1);
        assert!(!memory.notice_suspension(99_000_000, 5));
        let known = |folder| SceneMemory::open(&options(folder), 0).unwrap().recall();
        assert_eq!(known(&folder), [source("camera", 7, 3)]);
        assert!(memory.notice_suspension(1_000_000_000, 7));
        let [(record, scene)] = &known(&folder)[..] else {
            panic!("the source is known");
        };
        assert_eq!((record.publisher, scene), (7, &None));
        let next = SceneMemory::open(&options(&folder), 0).unwrap();
        assert_eq!(next.resumed_mono_ns(), 7);
    }

    #[test]
    fn two_root_directories_have_two_memories_in_shared_memory() {
        let folders = [(); 2].map(|()| tempfile::tempdir_in(SHARED_MEMORY).unwrap());
        let open = |folder| SceneMemory::in_shared_memory(&options(folder), 0).unwrap();
        keep(&mut open(&folders[0]), &[source("camera", 7, 3)], 1);
        assert_eq!(open(&folders[0]).recall(), [source("camera", 7, 3)]);
        assert_eq!(open(&folders[1]).recall(), []);
        for folder in &folders {
            let inode = fs::metadata(folder.path()).unwrap().ino();
            for file in fs::read_dir(SHARED_MEMORY).unwrap().map(Result::unwrap) {
                let name = file.file_name().into_string().unwrap();
                if name.ends_with(&format!("-{inode:x}.daemon.scenes")) {
                    fs::remove_file(file.path()).unwrap();
                }
            }
        }
    }

    #[test]
    fn a_place_without_a_readable_name_is_free() {
        let folder = tempfile::tempdir_in(SHARED_MEMORY).unwrap();
        let mut memory = SceneMemory::open(&options(&folder), 0).unwrap();
        keep(&mut memory, &[source("camera", 7, 3)], 1);
        memory.slot(0).0[NAME.start].store(u64::MAX, Ordering::Release);
        let mut memory = SceneMemory::open(&options(&folder), 0).unwrap();
        assert_eq!(memory.recall(), []);
        let other = [source("another", 8, 1)];
        keep(&mut memory, &other, 2);
        let recalled = SceneMemory::open(&options(&folder), 0).unwrap().recall();
        assert_eq!(recalled, other);
    }

    #[test]
    fn what_was_kept_before_the_machine_was_started_is_forgotten() {
        let folder = tempfile::tempdir_in(SHARED_MEMORY).unwrap();
        let mut memory = SceneMemory::open(&options(&folder), 0).unwrap();
        keep(&mut memory, &[source("camera", 7, 3)], 1);
        memory.memory.words()[1].fetch_add(1, Ordering::Release);
        memory.memory.words()[SUSPENDED].store(u64::MAX >> 1, Ordering::Release);
        let mut memory = SceneMemory::open(&options(&folder), 0).unwrap();
        assert_eq!(memory.recall(), []);
        assert!(memory.notice_suspension(1_000_000_000, 7));
    }
}
