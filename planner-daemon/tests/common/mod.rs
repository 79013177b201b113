//! A private world for a daemon: its own root, prefix and configuration, gone with the test.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test program uses the part of it that it needs"
)]

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use shared_types::codes::Outcome;
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, PlanReport, PlanRequest};

/// Longer than anything takes that does not hang.
pub const PATIENCE: Duration = Duration::from_secs(60);

pub struct World {
    directory: tempfile::TempDir,
    pub options: IpcOptions,
}

impl World {
    pub fn new() -> Self {
        let directory = tempfile::tempdir_in("/dev/shm").unwrap();
        let name = directory.path().file_name().unwrap().to_str().unwrap();
        let options = IpcOptions {
            prefix: name.replace('.', "t"),
            root: directory.path().join("root"),
        };
        Self { directory, options }
    }

    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    /// A configuration without weights for the shipped unit robot, with more settings.
    pub fn configuration(&self, settings: &str) -> PathBuf {
        let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/unit.toml");
        let path = self.path().join("daemon.toml");
        fs::write(&path, format!("robot = {robot:?}\n{settings}\n")).unwrap();
        path
    }

    /// Runs the daemon until it ends by itself; its exit status and what it said.
    pub fn run(&self, configuration: &Path) -> (ExitStatus, String) {
        let output = self.command(configuration).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        (output.status, said)
    }

    /// Starts the daemon and waits until it is ready.
    pub fn start(&self, configuration: &Path) -> Daemon {
        let log = self.path().join("log");
        let child = self
            .command(configuration)
            .stderr(File::create(&log).unwrap())
            .spawn()
            .unwrap();
        let mut daemon = Daemon { child, log };
        until(|| {
            let ended = daemon.child.try_wait().unwrap();
            assert!(ended.is_none(), "{}", daemon.said());
            daemon.said().contains("ready").then_some(())
        });
        daemon
    }

    fn command(&self, configuration: &Path) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_planner-daemon"));
        command
            .arg("--config")
            .arg(configuration)
            .env("PCC_PREFIX", &self.options.prefix)
            .env("PCC_ROOT", &self.options.root)
            .env("RUST_LOG", "debug")
            .env("NO_COLOR", "1")
            .stdin(Stdio::null());
        command
    }
}

impl Drop for World {
    /// iceoryx2 keeps one small file a prefix for ever; nobody else uses this prefix.
    fn drop(&mut self) {
        for file in fs::read_dir("/dev/shm").unwrap().map(Result::unwrap) {
            let name = file.file_name().into_string().unwrap();
            if name.starts_with(&self.options.prefix) && file.file_type().unwrap().is_file() {
                // Another process may be cleaning up the same file.
                let _ = fs::remove_file(file.path());
            }
        }
    }
}

/// A running daemon; killed with this value.
pub struct Daemon {
    child: Child,
    log: PathBuf,
}

impl Daemon {
    pub fn said(&self) -> String {
        fs::read_to_string(&self.log).unwrap()
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    pub fn is_alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// SIGKILL, and waits until it is gone.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM; its exit status.
    pub fn terminate(mut self) -> ExitStatus {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, Signal::TERM).unwrap();
        until(|| self.child.try_wait().unwrap())
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Asks again and again; what it gets in the end.
pub fn until<T>(mut ask: impl FnMut() -> Option<T>) -> T {
    let begin = Instant::now();
    loop {
        if let Some(value) = ask() {
            return value;
        }
        assert!(begin.elapsed() < PATIENCE, "waited for too long");
        sleep(Duration::from_millis(2));
    }
}

/// From the straight shape to a tip that the unit robot reaches, with a ball beside the way.
pub fn request() -> PlanRequest {
    let goal = Goal::Tip {
        position_m: [1.2, 0.3, 2.3],
        tolerance_m: None,
    };
    PlanRequest {
        candidate_count: 4,
        seed: 5,
        deadline: Some(Duration::from_secs(30)),
        sampler: shared_types::codes::Sampler::Straight,
        balls: vec![shared_types::message::Ball {
            centre_m: [-1.0, 0.5, 1.5],
            radius_m: 0.3,
        }],
        ..PlanRequest::new([0.0; 6], goal)
    }
}

/// The same, to be executed.
pub fn executed() -> PlanRequest {
    PlanRequest {
        execute: true,
        ..request()
    }
}

/// That it was planned, and is not executed for this reason.
pub fn assert_refused(report: &PlanReport, reason: &str) {
    assert_eq!(report.outcome, Outcome::ExecutionRefused, "{report:?}");
    assert!(report.reason.contains(reason), "{}", report.reason);
    assert_eq!(report.trajectory_id, None);
    assert!(!report.candidates.is_empty(), "planned all the same");
}
