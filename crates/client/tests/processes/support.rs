//! A private world of services, and a daemon that does not plan: a process of its own, so that it can be killed.

use std::fs;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use shared_types::PROTOCOL_VERSION;
use shared_types::codes::{Outcome, Source};
use shared_types::ipc::*;
use shared_types::message::{
    CandidateSummary, Knot, NONE_SELECTED, PlanReport, PlanRequest, Setpoint,
};

/// Long enough for everything that should happen.
pub(crate) const LONG: Duration = Duration::from_secs(20);
/// Knots of each of the daemon's candidates.
pub(crate) const KNOTS: usize = 3;

/// What the daemon does with a request, by its seed.
pub(crate) mod seed {
    /// Answers.
    pub(crate) const ANSWER: u64 = 0;
    /// Keeps it and never answers.
    pub(crate) const HANG: u64 = 1;
    /// Lets go of it without an answer.
    pub(crate) const DROP: u64 = 2;
    /// Dies of it, unless the daemon was started as an immune one.
    pub(crate) const POISON: u64 = 3;
    /// Answers with knots that are not there.
    pub(crate) const GARBAGE: u64 = 4;
}

/// A root and a prefix of one test, gone with it.
pub(crate) struct World {
    pub(crate) options: IpcOptions,
    _directory: tempfile::TempDir,
}

impl World {
    pub(crate) fn new() -> Self {
        let directory = tempfile::tempdir_in("/dev/shm").unwrap();
        let prefix = directory
            .path()
            .file_name()
            .unwrap()
            .to_str()
            .unwrap()
            .replace('.', "t");
        let options = IpcOptions {
            prefix,
            root: directory.path().join("root"),
        };
        Self {
            options,
            _directory: directory,
        }
    }

    /// Runs one of this test binary's processes.
    pub(crate) fn process(&self, name: &str, mode: &str) -> Process {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", name, "--ignored", "--nocapture"]);
        command
            .env("PCC_PREFIX", &self.options.prefix)
            .env("PCC_ROOT", &self.options.root)
            .env("MODE", mode);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        Process(command.spawn().unwrap())
    }

    pub(crate) fn daemon(&self) -> Process {
        self.process("daemon_process", "")
    }
}

impl Drop for World {
    /// What the killed have left; nobody else uses this prefix.
    fn drop(&mut self) {
        for file in fs::read_dir("/dev/shm").unwrap().map(Result::unwrap) {
            if file
                .file_name()
                .to_str()
                .unwrap()
                .starts_with(&self.options.prefix)
                && file.path().is_file()
            {
                fs::remove_file(file.path()).unwrap();
            }
        }
    }
}

/// A process that does not outlive its test.
pub(crate) struct Process(Child);

impl Process {
    /// SIGKILL, and gone when this returns.
    pub(crate) fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    /// Waits until it ends by itself; what it wrote to its error output.
    pub(crate) fn error_output(mut self) -> String {
        let mut text = String::new();
        std::io::Read::read_to_string(&mut self.0.stderr.take().unwrap(), &mut text).unwrap();
        assert!(!self.0.wait().unwrap().success(), "{text}");
        text
    }

    /// Whether it still runs.
    pub(crate) fn is_running(&mut self) -> bool {
        self.0.try_wait().unwrap().is_none()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if self.is_running() {
            self.kill();
        }
    }
}

/// The daemon's main; `MODE` is `immune`, or a number of clients to have capacity for.
pub(crate) fn serve() {
    let options = IpcOptions::from_env();
    let mode = std::env::var("MODE").unwrap();
    let capacity = PlanServiceCapacity {
        clients: mode.parse().unwrap_or(2),
        ..Default::default()
    };
    let _role =
        RoleLock::acquire(&options, Role::PlannerDaemon).unwrap_or_else(|error| panic!("{error}"));
    let node = IpcNode::create(&options, "test-daemon").unwrap();
    let service = plan_service(&node, &capacity).unwrap_or_else(|error| panic!("{error}"));
    let server = plan_server(&node, &service, &capacity).unwrap();
    let mut kept = Vec::new();
    for turn in 0.. {
        while let Some(active) = server.receive().unwrap() {
            match active.payload().seed {
                seed::HANG => kept.push(active),
                seed::DROP => drop(active),
                seed::POISON if mode != "immune" => std::process::abort(),
                _ => answer(&active),
            }
        }
        kept.retain(|active: &PlanActiveRequest| active.is_connected());
        if turn % 50 == 0 {
            node.clean_dead_nodes();
        }
        thread::sleep(Duration::from_millis(1));
    }
}

fn answer(active: &PlanActiveRequest) {
    let request: PlanRequest = *active.payload();
    let count = request.candidate_count as usize;
    let mut response = active.loan_slice_uninit(count * KNOTS).unwrap();
    let report = response.user_header_mut();
    *report = PlanReport {
        protocol_version: PROTOCOL_VERSION,
        outcome: Outcome::Ok.code(),
        request_id: request.request_id,
        candidate_count: request.candidate_count,
        selected: if request.execute == 1 {
            0
        } else {
            NONE_SELECTED
        },
        ..PlanReport::ZEROED
    };
    for (index, candidate) in report.candidates[..count].iter_mut().enumerate() {
        let first_knot = (index * KNOTS) as u32 + if request.seed == seed::GARBAGE { 1 } else { 0 };
        let source = Source::Learned.code();
        *candidate = CandidateSummary {
            first_knot,
            knot_count: KNOTS as u32,
            source,
            ..CandidateSummary::ZEROED
        };
    }
    let response = response.write_from_fn(|index| Knot {
        time_s: index as f64,
        ..Knot::ZEROED
    });
    response.send().unwrap();
}

/// A controller that does not control: publishes set-points forever.
pub(crate) fn publish_setpoints() {
    let node = IpcNode::create(&IpcOptions::from_env(), "test-controller").unwrap();
    let setpoints = publisher(&node, &setpoint_service(&node).unwrap()).unwrap();
    for sequence in 1.. {
        setpoints
            .send_copy(Setpoint {
                sequence,
                ..Setpoint::ZEROED
            })
            .unwrap();
        thread::sleep(Duration::from_millis(1));
    }
}
