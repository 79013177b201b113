//! A controller and a simulated robot as processes, with the test in the daemon's place.

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    process::{Child, Command as Program, ExitStatus, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use pcc_model::{Configuration, Robot};
use shared_types::{
    PROTOCOL_VERSION,
    clock::mono_now_ns,
    codes::{LoopState, ProcessKind, Refusal},
    ipc::{self, CommandClient, IpcNode, IpcOptions, Publisher},
    message::{
        ControllerState, Cycle, Heartbeat, Knot, MotionResult, RobotState, TrajectoryMessage,
    },
    valid::{self, CommandReply, SignedCommand},
};
use trajectory::{ParameterizationOptions, TimeParameterizer, Trajectory};

const MS: Duration = Duration::from_millis(1);

/// How long anything may take before the test gives up (not a bar: only so that a failure ends).
const PATIENCE: u32 = 20_000;

/// What a listening thread has seen.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) robot: Vec<RobotState>,
    pub(crate) cycles: Vec<Cycle>,
    pub(crate) controller: Option<ControllerState>,
    /// The results of all motions so far.
    pub(crate) results: Vec<MotionResult>,
}

/// The processes and everything the test says and hears.
pub(crate) struct Joined {
    /// Tolerance of the motions sent from now on, rad.
    pub(crate) path_tolerance_rad: f64,
    pub(crate) robot: Robot,
    folder: tempfile::TempDir,
    options: IpcOptions,
    seen: Arc<Mutex<Seen>>,
    daemon_beats: Arc<AtomicBool>,
    daemon_instance: Arc<AtomicU64>,
    quit: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    trajectory: Publisher<TrajectoryMessage>,
    commands: CommandClient,
    next_id: u32,
    _node: IpcNode,
}

/// A child that is killed when the test ends, however it ends.
pub(crate) struct Running(Child);

impl Running {
    pub(crate) fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    pub(crate) fn signal(&self, name: &str) {
        let pid = self.0.id().to_string();
        assert!(
            Program::new("kill")
                .args(["-s", name, &pid])
                .status()
                .unwrap()
                .success()
        );
    }

    pub(crate) fn wait(&mut self) -> ExitStatus {
        self.0.wait().unwrap()
    }

    pub(crate) fn stderr(&mut self) -> String {
        let mut text = String::new();
        self.0
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut text)
            .unwrap();
        text
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Joined {
    /// Services under a private root, and a robot file with ten times the unit robot's limits.
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir_in(if Path::new("/dev/shm").is_dir() {
            "/dev/shm"
        } else {
            "/tmp"
        })
        .unwrap();
        let robot = write_configurations(folder.path());
        let options = IpcOptions {
            prefix: "test-controller".to_owned(),
            root: folder.path().join("ipc"),
        };
        let node = IpcNode::create(&options, "test").unwrap();
        let (seen, quit) = (Arc::<Mutex<Seen>>::default(), Arc::<AtomicBool>::default());
        let daemon_beats = Arc::new(AtomicBool::new(true));
        let daemon_instance = Arc::new(AtomicU64::new(1));
        let threads = vec![
            listen(&options, &seen, &quit),
            beat(&options, &daemon_beats, &daemon_instance, &quit),
        ];
        Self {
            path_tolerance_rad: 0.2,
            robot,
            seen,
            daemon_beats,
            daemon_instance,
            quit,
            threads,
            trajectory: ipc::publisher(&node, &ipc::trajectory_service(&node).unwrap()).unwrap(),
            commands: ipc::command_client(&node, &ipc::command_service(&node).unwrap()).unwrap(),
            next_id: 1,
            options,
            folder,
            _node: node,
        }
    }

    pub(crate) fn start(&self, program: &str) -> Running {
        let (path, config) = match program {
            "controller" => (env!("CARGO_BIN_EXE_controller"), "controller.toml"),
            _ => (
                env!("CARGO_BIN_EXE_simulated-robot"),
                "simulated-robot.toml",
            ),
        };
        let child = Program::new(path)
            .arg("--config")
            .arg(self.folder.path().join(config))
            .env("PCC_PREFIX", &self.options.prefix)
            .env("PCC_ROOT", &self.options.root)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Running(child)
    }

    pub(crate) fn set_daemon_alive(&self, alive: bool) {
        self.daemon_beats.store(alive, Ordering::Relaxed);
    }

    /// Another daemon beats from now on, without a pause.
    pub(crate) fn replace_daemon(&self) {
        self.daemon_instance.fetch_add(1, Ordering::Relaxed);
    }

    /// Forgets what was heard so far.
    pub(crate) fn forget(&self) {
        let mut seen = self.seen.lock().unwrap();
        seen.robot.clear();
        seen.cycles.clear();
        seen.controller = None;
    }

    pub(crate) fn with_seen<T>(&self, look: impl FnOnce(&Seen) -> T) -> T {
        look(&self.seen.lock().unwrap())
    }

    pub(crate) fn wait_until(&self, what: &str, done: impl Fn(&Seen) -> bool) {
        for _ in 0..PATIENCE {
            if self.with_seen(&done) {
                return;
            }
            thread::sleep(MS);
        }
        let state = self.with_seen(|seen| {
            seen.controller
                .map(|state| (state.state, state.fault, state.refusal))
        });
        panic!("never {what}; controller (state, fault, refusal): {state:?}");
    }

    pub(crate) fn wait_for(&self, state: LoopState) {
        let is = |seen: &Seen| seen.controller.is_some_and(|now| now.state == state.code());
        self.wait_until(state.text(), is);
    }

    pub(crate) fn controller(&self) -> ControllerState {
        self.with_seen(|seen| seen.controller.unwrap())
    }

    /// Publishes a motion from the commanded configuration to `goal`; returns its id.
    pub(crate) fn send_motion(&mut self, goal: &Configuration) -> u32 {
        self.send(goal, |_| ())
    }

    fn send(&mut self, goal: &Configuration, change: impl Fn(&mut TrajectoryMessage)) -> u32 {
        let from = Configuration::from(self.controller().commanded_configuration_rad);
        let middle = (from + goal) * 0.5 + Configuration::repeat(0.1);
        let limits = &self.robot.tendon_limits;
        let options = ParameterizationOptions::default();
        let motion = TimeParameterizer::default()
            .parameterize(
                &[from, middle, *goal],
                &self.robot.tendons,
                limits,
                &options,
            )
            .unwrap();
        let id = self.next_id;
        self.next_id += 1;
        let mut sent = message(id, &motion);
        sent.robot_hash = self.robot.hash();
        sent.controller_instance = self.controller().instance;
        sent.daemon_instance = self.daemon_instance.load(Ordering::Relaxed);
        sent.path_tolerance_rad = self.path_tolerance_rad;
        change(&mut sent);
        self.trajectory.send_copy(sent).unwrap();
        id
    }

    /// Sends a motion to `goal` that another daemon has published.
    pub(crate) fn send_motion_of_another_daemon(&mut self, goal: &Configuration) -> u32 {
        self.send(goal, |message| message.daemon_instance += 1)
    }

    /// Sends a motion to `goal` that was published at `requested_ns`.
    pub(crate) fn send_motion_of(&mut self, requested_ns: i64, goal: &Configuration) -> u32 {
        self.send(goal, |message| message.requested_mono_ns = requested_ns)
    }

    /// Sends a motion to `goal` that begins so long after now, ns.
    pub(crate) fn send_motion_in(&mut self, ahead_ns: i64, goal: &Configuration) -> u32 {
        let begin_ns = mono_now_ns() + ahead_ns;
        self.send(goal, |message| message.begin_mono_ns = begin_ns)
    }

    /// Sends a motion of a millisecond that stays where the robot is and begins so long after now, ns.
    pub(crate) fn send_still_motion_in(&mut self, ahead_ns: i64) -> u32 {
        let begin_mono_ns = mono_now_ns() + ahead_ns;
        let rest = Knot {
            configuration_rad: self.controller().commanded_configuration_rad,
            ..Knot::ZEROED
        };
        let end = Knot {
            time_s: 1e-3,
            ..rest
        };
        self.send(&rest.configuration_rad.into(), |message| {
            message.begin_mono_ns = begin_mono_ns;
            message.knot_count = 2;
            message.knots[..2].copy_from_slice(&[rest, end]);
        })
    }

    /// Waits until the controller says that it refuses a motion, and why.
    pub(crate) fn wait_for_refusal(&self, id: u32, refusal: Refusal) {
        self.wait_until(refusal.text(), |seen| {
            seen.controller
                .is_some_and(|now| now.refused_trajectory_id == id && now.refusal == refusal.code())
        });
    }

    /// Waits until the controller says how a motion ended.
    pub(crate) fn wait_for_result(&self, id: u32) -> valid::MotionResult {
        let of_motion = |seen: &Seen| {
            let mut results = seen.results.iter();
            results.find(|result| result.trajectory_id == id).copied()
        };
        self.wait_until("a result", |seen| of_motion(seen).is_some());
        let result = self.with_seen(of_motion).unwrap();
        valid::MotionResult::try_from(&result).unwrap()
    }

    pub(crate) fn command(&self, command: impl Into<SignedCommand>) -> CommandReply {
        let command = command.into();
        let pending = self.commands.send_copy(command.to_wire(7)).unwrap();
        for _ in 0..PATIENCE {
            if let Some(reply) = pending.receive().unwrap() {
                return CommandReply::try_from(&*reply).unwrap();
            }
            thread::sleep(MS);
        }
        panic!("no reply to {command:?}");
    }

    pub(crate) fn files_left(&self) -> Vec<PathBuf> {
        fs::read_dir(&self.options.root)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect()
    }
}

impl Drop for Joined {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

fn write_configurations(folder: &Path) -> Robot {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
    let read = |name: &str| fs::read_to_string(shipped.join(name)).unwrap();
    let robot = read("robots/unit.toml");
    let mut fast = robot.clone();
    for (from, to) in [
        ("velocity_m_s = 0.0779", "velocity_m_s = 0.779"),
        ("acceleration_m_s2 = 0.39", "acceleration_m_s2 = 3.9"),
        ("jerk_m_s3 = 3.9", "jerk_m_s3 = 39.0"),
    ] {
        assert!(
            robot.contains(from),
            "the premise: the robot file has {from}"
        );
        fast = fast.replace(from, to);
    }
    fs::create_dir(folder.join("robots")).unwrap();
    fs::write(folder.join("robots/unit.toml"), &fast).unwrap();
    // A virtual machine can lose a processor for some 30 ms: that is not what these tests are about.
    for (name, key) in [
        ("controller.toml", "robot_lost_ms"),
        ("simulated-robot.toml", "lost_setpoint_ms"),
    ] {
        let (shipped, patient) = (format!("{key} = 20"), format!("{key} = 100"));
        let text = read(name);
        assert!(text.contains(&shipped), "{name} has {shipped}");
        fs::write(folder.join(name), text.replace(&shipped, &patient)).unwrap();
    }
    Robot::from_toml_str(&fast, Path::new("fast.toml")).unwrap()
}

fn message(id: u32, motion: &Trajectory) -> TrajectoryMessage {
    let mut message = TrajectoryMessage {
        protocol_version: PROTOCOL_VERSION,
        trajectory_id: id,
        plan_id: u64::from(id),
        requested_mono_ns: mono_now_ns(),
        begin_mono_ns: mono_now_ns() + 20_000_000,
        knot_count: u32::try_from(motion.knots().len()).unwrap(),
        path_tolerance_rad: 0.2,
        ..TrajectoryMessage::ZEROED
    };
    for (wire, knot) in message.knots.iter_mut().zip(motion.knots()) {
        *wire = Knot {
            time_s: knot.time,
            configuration_rad: knot.position.into(),
            velocity_rad_s: knot.velocity.into(),
            acceleration_rad_s2: knot.acceleration.into(),
        };
    }
    message
}

fn listen(options: &IpcOptions, seen: &Arc<Mutex<Seen>>, quit: &Arc<AtomicBool>) -> JoinHandle<()> {
    let (options, seen, quit) = (options.clone(), Arc::clone(seen), Arc::clone(quit));
    thread::spawn(move || {
        let node = IpcNode::create(&options, "test-listener").unwrap();
        let robot = ipc::subscriber(&node, &ipc::robot_state_service(&node).unwrap()).unwrap();
        let cycles = ipc::subscriber(&node, &ipc::cycle_service(&node).unwrap()).unwrap();
        let state = ipc::subscriber(&node, &ipc::controller_state_service(&node).unwrap()).unwrap();
        let results = ipc::subscriber(&node, &ipc::motion_result_service(&node).unwrap()).unwrap();
        while !quit.load(Ordering::Relaxed) {
            {
                let mut seen = seen.lock().unwrap();
                while let Ok(Some(sample)) = robot.receive() {
                    seen.robot.push(*sample);
                }
                while let Ok(Some(batch)) = cycles.receive() {
                    seen.cycles.extend_from_slice(&batch);
                }
                while let Ok(Some(sample)) = results.receive() {
                    seen.results.push(*sample);
                }
                while let Ok(Some(sample)) = state.receive() {
                    seen.controller = Some(*sample);
                }
            }
            thread::sleep(MS);
        }
    })
}

fn beat(
    options: &IpcOptions,
    alive: &Arc<AtomicBool>,
    instance: &Arc<AtomicU64>,
    quit: &Arc<AtomicBool>,
) -> JoinHandle<()> {
    let (options, alive, quit) = (options.clone(), Arc::clone(alive), Arc::clone(quit));
    let instance = Arc::clone(instance);
    thread::spawn(move || {
        let node = IpcNode::create(&options, "test-heart").unwrap();
        let heart = ipc::publisher(&node, &ipc::heartbeat_service(&node).unwrap()).unwrap();
        let mut sequence = 0;
        while !quit.load(Ordering::Relaxed) {
            if alive.load(Ordering::Relaxed) {
                sequence += 1;
                let beat = Heartbeat {
                    stamp_mono_ns: mono_now_ns(),
                    instance: instance.load(Ordering::Relaxed),
                    sequence,
                    kind: ProcessKind::Daemon.code(),
                    pid: std::process::id(),
                };
                let _ = heart.send_copy(beat);
            }
            thread::sleep(10 * MS);
        }
    })
}
