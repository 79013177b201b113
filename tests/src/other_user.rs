//! Two more users of this machine: one who owns a robot's processes, and another who has nothing to do with them.
//!
//! A user is a number; it needs no entry anywhere. The test must be root to act as one.

use std::fs::{self, File};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Gid, Uid};
use rustix::thread::{set_thread_groups, set_thread_res_gid, set_thread_res_uid};
use shared_types::codes::LoopFault;

use crate::outside::PoseFile;
use crate::process::{TimedOut, wait_for};
use crate::programs::program;
use crate::retries;
use crate::world::{Settings, World};

/// The user whose robot it is.
pub const OWNER: u32 = 54_322;
/// The user who tries what is possible.
pub const OTHER: u32 = 54_321;

/// Until a motion that was published moves the robot.
const BEGINS_WITHIN: Duration = Duration::from_secs(2);
const PROGRAMS: [&str; 4] = ["planner-daemon", "controller", "simulated-robot", "pcc"];

/// Does something in a thread that acts as `user`, without any privilege.
///
/// # Errors
/// Where this process may not become that user.
pub fn as_user<T: Send>(user: u32, act: impl FnOnce() -> T + Send) -> rustix::io::Result<T> {
    let become_and_act = || {
        let (uid, gid) = (Uid::from_raw(user), Gid::from_raw(user));
        set_thread_groups(&[])?;
        set_thread_res_gid(gid, gid, gid)?;
        set_thread_res_uid(uid, uid, uid)?;
        Ok(act())
    };
    thread::scope(|scope| scope.spawn(become_and_act).join().unwrap())
}

/// Tries until one succeeded.
#[derive(Clone, Copy, Debug)]
pub struct Tried {
    /// From the first one's start to the last one's end.
    pub took: Duration,
    /// Those that failed.
    pub failed: usize,
}

/// What became of the one `pcc stop` that was given to a robot in motion.
#[derive(Clone, Debug)]
pub struct StopInMotion {
    /// How long the program took.
    pub took: Duration,
    /// From its start to the robot's rest; none where it went on.
    pub to_rest: Option<Duration>,
    /// What the program said where it failed.
    pub refusal: Option<String>,
    /// Motions asked for before it moved whose `pcc plan --execute` failed.
    pub failed_motions: usize,
}

/// A robot whose processes belong to [`OWNER`], on programs of its own that both users can read.
#[derive(Debug)]
pub struct OwnersRobot {
    /// Prefix, root and configuration.
    pub world: World,
    /// Whether the programs are told where their root folder is.
    with_root: bool,
    umask: &'static str,
    running: Vec<(&'static str, Child)>,
}

impl OwnersRobot {
    /// Nothing runs yet. `umask` is what the owner's shell has, in octal digits; without a root of its own it uses the
    /// default one.
    #[must_use]
    pub fn new(umask: &'static str, with_root: bool) -> Self {
        let world = World::new(&Settings {
            without_weights: true,
            ..Settings::default()
        });
        let (folder, programs) = (world.folder(), world.folder().join("bin"));
        fs::create_dir(&programs).unwrap();
        for name in PROGRAMS {
            fs::copy(program(name), programs.join(name)).unwrap();
        }
        let readable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(folder, readable).unwrap();
        chown(folder, Some(OWNER), Some(OWNER)).unwrap();
        Self {
            world,
            with_root,
            umask,
            running: Vec::new(),
        }
    }

    /// The owner's home folder, for the programs' sake.
    #[must_use]
    pub fn home(&self) -> &Path {
        self.world.folder()
    }

    fn command(&self, name: &str, arguments: &[&str]) -> Command {
        let umask = format!("umask {}; exec \"$0\" \"$@\"", self.umask);
        let mut command = Command::new("/bin/sh");
        command.arg("-c").arg(umask);
        command.arg(self.world.folder().join("bin").join(name));
        command.args(arguments).uid(OWNER).gid(OWNER);
        command.env("HOME", self.home()).env("NO_COLOR", "1");
        command.env("PCC_PREFIX", &self.world.options.prefix);
        command.env_remove("PCC_ROOT").current_dir("/");
        if self.with_root {
            command.env("PCC_ROOT", &self.world.options.root);
        }
        command.stdin(Stdio::null());
        command
    }

    /// Starts one of the three processes, in place of the one that ran, which is killed without warning.
    pub fn start(&mut self, name: &'static str) {
        self.kill(name);
        let config = self.world.config(&format!("{name}.toml"));
        let log = File::create(self.world.folder().join(format!("{name}.log"))).unwrap();
        let mut command = self.command(name, &["--config", config.to_str().unwrap()]);
        command.stdout(log.try_clone().unwrap()).stderr(log);
        self.running.push((name, command.spawn().unwrap()));
    }

    fn kill(&mut self, name: &str) {
        for (_, child) in self.running.iter_mut().filter(|(other, _)| *other == name) {
            let _ = child.kill();
            child.wait().unwrap();
        }
        self.running.retain(|(other, _)| *other != name);
    }

    /// Process ids of what was started.
    #[must_use]
    pub fn pids(&self) -> Vec<u32> {
        self.running.iter().map(|(_, child)| child.id()).collect()
    }

    /// Those that have ended by themselves.
    pub fn ended(&mut self) -> Vec<String> {
        let mut ended = Vec::new();
        for (name, child) in &mut self.running {
            if child.try_wait().unwrap().is_some() {
                ended.push((*name).to_owned());
            }
        }
        ended
    }

    /// What a process has written.
    #[must_use]
    pub fn log(&self, name: &str) -> String {
        let log = self.world.folder().join(format!("{name}.log"));
        fs::read_to_string(log).unwrap_or_default()
    }

    /// Runs `pcc` to its end.
    #[must_use]
    pub fn pcc(&self, arguments: &[&str], limit: Duration) -> Output {
        self.run("pcc", arguments, limit)
    }

    /// Runs one program to its end, or kills it at the limit.
    #[must_use]
    pub fn run(&self, name: &str, arguments: &[&str], limit: Duration) -> Output {
        let limit = limit.as_secs_f64().to_string();
        let own = self.command(name, arguments);
        let mut command = Command::new("timeout");
        command.args(["--signal=KILL", &limit]).arg("/bin/sh");
        command.args(own.get_args()).uid(OWNER).gid(OWNER);
        for (key, value) in own.get_envs() {
            match value {
                Some(value) => command.env(key, value),
                None => command.env_remove(key),
            };
        }
        command.stdin(Stdio::null()).output().unwrap()
    }

    /// How long until `pcc` with these arguments succeeds, tried again and again, and how often it failed.
    ///
    /// # Errors
    /// [`TimedOut`] with what it said last.
    pub fn until_it_works(&self, arguments: &[&str], limit: Duration) -> Result<Tried, TimedOut> {
        let begin = Instant::now();
        let (mut said, mut tries) = (String::new(), 0);
        let works = || {
            let output = self.pcc(arguments, limit);
            tries += 1;
            said = String::from_utf8_lossy(&output.stderr).into_owned();
            succeeded(output.status)
        };
        let name = format!("pcc {}", arguments.join(" "));
        match wait_for(&name, limit, works) {
            Ok(()) => Ok(Tried {
                took: begin.elapsed(),
                failed: tries - 1,
            }),
            Err(timed_out) => Err(TimedOut {
                log: said,
                ..timed_out
            }),
        }
    }

    /// Has motions to two places executed in turn until the robot moves, and stops it there: what each `pcc stop` took that was given
    /// while it moved.
    ///
    /// # Errors
    /// [`TimedOut`] with what was said to the motions, where the robot never moves, or does not come to rest.
    pub fn stop_in_motion(
        &self,
        motions: [&[&str]; 2],
        limit: Duration,
    ) -> Result<StopInMotion, TimedOut> {
        let pose = PoseFile::of_root(&self.root(), &self.world.options.prefix);
        let mut in_turn = motions.into_iter().cycle();
        let mut executing = self.execute(in_turn.next().unwrap());
        let (mut failed_motions, mut published) = (0, None);
        let moving = wait_for("the robot moves", limit, || {
            if pose.moves() {
                return Some(());
            }
            if let Some(status) = executing.try_wait().unwrap()
                && !pose.moves()
            {
                let since: &mut Instant = published.get_or_insert_with(Instant::now);
                // One that was published begins in a moment.
                if status.success() && since.elapsed() < BEGINS_WITHIN {
                    return None;
                }
                published = None;
                failed_motions += usize::from(!status.success());
                executing = self.execute(in_turn.next().unwrap());
            }
            None
        });
        let stopped = moving.map(|()| {
            let begin = Instant::now();
            let output = self.pcc(&["stop"], limit);
            let took = begin.elapsed();
            let is_obeyed = output.status.success();
            StopInMotion {
                took,
                to_rest: pose.time_to_rest(begin, limit),
                failed_motions,
                refusal: (!is_obeyed)
                    .then(|| String::from_utf8_lossy(&output.stderr).trim().to_owned()),
            }
        });
        let _ = executing.kill();
        executing.wait().unwrap();
        stopped.map_err(|timed_out| TimedOut {
            log: self.log("execute"),
            ..timed_out
        })
    }

    /// Waits until `pcc watch` shows that the controller holds the robot. A latched fault is reset; it counts as a retry unless it is one
    /// of `by_right`, those that had to come.
    ///
    /// # Errors
    /// [`TimedOut`] with what was shown last.
    pub fn until_holding(&self, limit: Duration, by_right: &[LoopFault]) -> Result<(), TimedOut> {
        let (mut shown, mut noted) = (String::new(), None);
        let holds = || {
            let output = self.pcc(&["watch", "--rate-hz", "20", "--times", "1"], limit);
            shown = String::from_utf8_lossy(&output.stdout).into_owned();
            if shown.contains("controller     fault ") {
                let fault = latched(&shown);
                if noted.as_ref() != Some(&fault) && !by_right.iter().any(|it| it.text() == fault) {
                    retries::note(&format!("a fault was reset: {fault}"));
                }
                noted = Some(fault);
                let _ = self.pcc(&["reset"], limit);
            }
            shown.contains("controller     holding ").then_some(())
        };
        let held = wait_for("the controller holds", limit, holds);
        held.map_err(|timed_out| TimedOut {
            log: shown,
            ..timed_out
        })
    }

    /// The root folder that its programs use: without one of its own, the default one or what takes its place.
    #[must_use]
    pub fn root(&self) -> PathBuf {
        let own = self.home().join(".pcc-services");
        match self.with_root {
            true => self.world.options.root.clone(),
            false if own.is_dir() => own,
            false => PathBuf::from(format!("/dev/shm/pcc-{OWNER}")),
        }
    }

    fn execute(&self, motion: &[&str]) -> Child {
        let log = File::create(self.world.folder().join("execute.log")).unwrap();
        let mut command = self.command("pcc", motion);
        command.stdout(Stdio::null()).stderr(log);
        command.spawn().unwrap()
    }

    /// All names of this robot in shared memory.
    #[must_use]
    pub fn shared_memory(&self) -> Vec<PathBuf> {
        let prefix = format!("{}_", self.world.options.prefix);
        let entries = fs::read_dir("/dev/shm").unwrap().flatten();
        let own = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix));
        own.map(|entry| entry.path()).collect()
    }

    /// Everything below its root folder, and that folder.
    #[must_use]
    pub fn root_files(&self) -> Vec<PathBuf> {
        let mut found = vec![self.root()];
        let mut next = 0;
        while next < found.len() {
            let entries = fs::read_dir(&found[next]).into_iter().flatten().flatten();
            let inside: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
            found.extend(inside);
            next += 1;
        }
        found
    }
}

/// The fault that `pcc watch` shows.
fn latched(shown: &str) -> String {
    let mut lines = shown.lines();
    let fault = lines.find_map(|line| line.strip_prefix("FAULT "));
    fault.unwrap_or_default().trim().to_owned()
}

fn succeeded(status: ExitStatus) -> Option<()> {
    status.success().then_some(())
}

impl Drop for OwnersRobot {
    fn drop(&mut self) {
        for (_, child) in &mut self.running {
            let _ = child.kill();
            let _ = child.wait();
        }
        for path in self.shared_memory() {
            let _ = fs::remove_file(path);
        }
    }
}
