//! A robot driven and judged from outside: orders are given by the program `pcc`, and where the robot stands is read from the
//! file in which the simulated robot keeps its pose. Nothing of the protocol, and no code of the product, has a part in the
//! judgement.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::disturbance::threads;
use crate::process::{Process, TimedOut, wait_for};
use crate::world::World;

/// The pose file: two copies, of which the newer counts, each a count and 2 × 9 numbers of 8 bytes.
const NUMBERS: usize = 18;
const COPY_BYTES: usize = 8 * (1 + NUMBERS);
const FIRST_VELOCITY: usize = 9;
/// Time without any motion of the reference after which the robot counts as resting.
const AT_REST: Duration = Duration::from_millis(30);
/// Pause between two looks at the robot.
const LOOK: Duration = Duration::from_millis(1);

/// What a program said, and how long it took.
#[derive(Clone, Debug)]
pub struct Said {
    /// Its status; none where it was killed for taking too long.
    pub status: Option<i32>,
    /// Everything that it wrote.
    pub text: String,
    /// From its start to its end.
    pub took: Duration,
}

impl Said {
    /// Whether it ended well.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.status == Some(0)
    }

    /// For a report.
    #[must_use]
    pub fn summary(&self) -> String {
        let last = self.text.lines().last().unwrap_or("(nothing)");
        let ended = self
            .status
            .map_or("killed".to_owned(), |status| format!("status {status}"));
        format!("{ended} after {:.2} s: {last}", self.took.as_secs_f64())
    }
}

/// Runs `pcc` to its end, at most for `limit`.
#[must_use]
pub fn pcc(world: &World, arguments: &[&str], limit: Duration) -> Said {
    let begun = Instant::now();
    let mut process = Process::start(world, "pcc", arguments);
    let ended = process.wait(limit);
    Said {
        status: ended.ok().and_then(|status| status.code()),
        text: process.log(),
        took: begun.elapsed(),
    }
}

/// Starts a motion by `pcc plan --execute`, straight in configuration space, from where the controller holds; a busy machine has a
/// second to plan it.
#[must_use]
pub fn execute(world: &World, goal: &[f64; 6], limit: Duration) -> Said {
    let goal: Vec<String> = goal.iter().map(f64::to_string).collect();
    let mut arguments = vec!["plan", "--sampler", "straight", "--candidates", "1"];
    arguments.extend(["--execute", "--deadline-ms", "1000", "--configuration"]);
    arguments.extend(goal.iter().map(String::as_str));
    pcc(world, &arguments, limit)
}

/// Looks until `pcc watch` says that the controller is in this state.
///
/// # Errors
/// [`TimedOut`] with what it said last.
pub fn wait_for_controller(world: &World, state: &str, limit: Duration) -> Result<(), TimedOut> {
    let line = format!("controller     {state} ");
    let mut last = String::new();
    let seen = wait_for(&format!("the controller is {state}"), limit, || {
        last = shown(world);
        last.contains(&line).then_some(())
    });
    seen.map_err(|timed_out| TimedOut {
        log: last,
        ..timed_out
    })
}

/// What `pcc watch` shows.
#[must_use]
pub fn shown(world: &World) -> String {
    let arguments = ["watch", "--rate-hz", "20", "--times", "1"];
    pcc(world, &arguments, Duration::from_secs(5)).text
}

/// The threads of a process by name; its first one where it has none of that name.
#[must_use]
pub fn thread_named(pid: u32, name: &str) -> u32 {
    let wanted = format!("/{name} 1");
    let found = threads("", pid)
        .into_iter()
        .find(|thread| thread.name == wanted);
    found.map_or(pid, |thread| thread.id)
}

/// Whether a process has ended, also where something keeps the kernel from forgetting it.
#[must_use]
pub fn has_ended(pid: u32) -> bool {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let state = text
        .rsplit_once(") ")
        .and_then(|(_, rest)| rest.chars().next());
    matches!(state, None | Some('Z' | 'X'))
}

/// Where the simulated robot's motors were told to be, read from the file that it keeps for its successor.
#[derive(Clone, Debug)]
pub struct PoseFile(PathBuf);

impl PoseFile {
    /// That of a world's robot.
    #[must_use]
    pub fn of(world: &World) -> Self {
        Self::of_root(&world.options.root, &world.options.prefix)
    }

    /// That of the robot with these services.
    #[must_use]
    pub fn of_root(root: &Path, prefix: &str) -> Self {
        Self(root.join(format!("{prefix}.robot.pose")))
    }

    /// Velocities of the tendons, m/s.
    ///
    /// # Errors
    /// Where there is no such file, or it has another form.
    pub fn velocities(&self) -> io::Result<[f64; 9]> {
        let bytes = fs::read(&self.0)?;
        if bytes.len() != 2 * COPY_BYTES {
            return Err(io::Error::other(format!("{} bytes", bytes.len())));
        }
        let number = |copy: &[u8], index: usize| {
            let at = 8 * index;
            u64::from_le_bytes(copy[at..at + 8].try_into().expect("eight bytes"))
        };
        let newer = bytes.chunks(COPY_BYTES).max_by_key(|copy| number(copy, 0));
        let newer = newer.expect("there are two");
        Ok(std::array::from_fn(|tendon| {
            f64::from_bits(number(newer, 1 + FIRST_VELOCITY + tendon))
        }))
    }

    /// Whether it moves now.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.velocities()
            .is_ok_and(|velocities| velocities.iter().any(|velocity| *velocity != 0.0))
    }

    /// Waits until the robot has moved for a while without a rest.
    ///
    /// # Errors
    /// [`TimedOut`].
    pub fn wait_for_motion(&self, duration: Duration, limit: Duration) -> Result<(), TimedOut> {
        let mut since = None;
        wait_for("the robot moves", limit, || {
            if self.moves() {
                let begin = *since.get_or_insert_with(Instant::now);
                (begin.elapsed() >= duration).then_some(())
            } else {
                since = None;
                None
            }
        })
    }

    /// Time from `begin` until the robot is at rest; none if it is not within `limit`.
    #[must_use]
    pub fn time_to_rest(&self, begin: Instant, limit: Duration) -> Option<Duration> {
        let mut resting_since: Option<Instant> = None;
        loop {
            let now = Instant::now();
            match resting_since {
                _ if self.moves() => resting_since = None,
                None => resting_since = Some(now),
                Some(since) if now - since >= AT_REST => return Some(since - begin),
                Some(_) => {}
            }
            if now - begin > limit {
                return None;
            }
            std::thread::sleep(LOOK);
        }
    }
}
