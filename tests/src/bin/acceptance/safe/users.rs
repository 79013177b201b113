//! Another user of the machine, who acts before, between and after the starts of a robot's processes.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, NodeBuilder, Path as IoxPath, SemanticString, ipc};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::{Pid, Signal, kill_process};
use tests::other_user::{OTHER, OWNER, OwnersRobot, as_user};

use crate::{Report, Scale};

const COMMAND: &str = "acceptance safe, users";
const PARTS: [&str; 3] = ["planner-daemon", "controller", "simulated-robot"];
const PATIENCE: Duration = Duration::from_secs(60);
const PLAN: &[&str] = &[
    "plan",
    "--tip",
    "0.8",
    "0.2",
    "2.7",
    "--sampler",
    "straight",
];
const MOTIONS: [&[&str]; 2] = [
    &[
        "plan",
        "--tip",
        "0.8",
        "0.2",
        "2.7",
        "--sampler",
        "straight",
        "--execute",
    ],
    &[
        "plan",
        "--tip",
        "-0.8",
        "0.4",
        "2.6",
        "--sampler",
        "straight",
        "--execute",
    ],
];
const STOP: &[&str] = &["stop"];
/// The node counter's name after the prefix, as iceoryx2 0.10.0 makes it.
const COUNTER: &str = "_9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";

pub(crate) fn run(report: &mut Report, scale: Scale) {
    report.group("another user, running processes", COMMAND, |report| {
        running(report, scale)
    });
    report.group("another user, open root folder", COMMAND, open_root);
    report.group("another user, names taken beforehand", COMMAND, taken);
}

/// What `pcc` and restarts take.
#[derive(Clone, Copy, Debug, Default)]
struct Times {
    stop: Duration,
    plan: Duration,
    watch: Duration,
    restarts: [Duration; 3],
}

impl Times {
    fn measure(robot: &mut OwnersRobot) -> anyhow::Result<Self> {
        let mut times = Self {
            plan: robot.until_it_works(PLAN, PATIENCE)?,
            stop: robot.stop_in_motion(MOTIONS, STOP, PATIENCE)?,
            watch: robot
                .until_it_works(&["watch", "--rate-hz", "100", "--times", "3"], PATIENCE)?,
            restarts: [Duration::ZERO; 3],
        };
        for (part, time) in PARTS.into_iter().zip(&mut times.restarts) {
            let begin = Instant::now();
            robot.start(part);
            robot.until_it_works(PLAN, PATIENCE)?;
            *time = begin.elapsed();
        }
        Ok(times)
    }

    fn all(self) -> [(&'static str, Duration); 6] {
        let [daemon, controller, robot] = self.restarts;
        [
            ("pcc stop", self.stop),
            ("pcc plan", self.plan),
            ("a new pcc watch", self.watch),
            ("restart of the daemon", daemon),
            ("restart of the controller", controller),
            ("restart of the robot", robot),
        ]
    }
}

fn running(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    confirm_other_user(report)?;
    for umask in ["000", "022"] {
        let mut robot = OwnersRobot::new(umask, true);
        PARTS.into_iter().for_each(|part| robot.start(part));
        robot.until_it_works(PLAN, PATIENCE)?;
        reach(report, &robot, umask)?;
        harm(report, &mut robot)?;
        if umask == "000" {
            false_names(report, &mut robot, scale.pick(1, 5))?;
            write_counter(report, &robot)?;
        }
    }
    Ok(())
}

/// That the tries are another user's: a file of the superuser's is closed to it.
fn confirm_other_user(report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755))?;
    let file = folder.path().join("closed");
    fs::write(&file, "")?;
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600))?;
    let refused = as_user(OTHER, || fs::read(&file).is_err());
    let figure = format!("{refused:?}");
    let name = "another Linux user could be made, and is one";
    report.check(name, figure, "Ok(true)", refused == Ok(true));
    Ok(())
}

/// Every name of the robot's, opened for reading, for writing, listed, locked.
fn reach(report: &mut Report, robot: &OwnersRobot, umask: &str) -> anyhow::Result<()> {
    let mut names = robot.root_files();
    names.extend(robot.shared_memory());
    let open = as_user(OTHER, || {
        names.iter().filter(|name| opens(name)).collect::<Vec<_>>()
    })?;
    let shown: Vec<String> = open.iter().map(|name| name.display().to_string()).collect();
    let name = format!(
        "of {} files and folders, opened by another user, umask {umask}",
        names.len()
    );
    report.none_of(&name, &shown);
    let locks = names
        .iter()
        .filter(|name| name.extension().is_some_and(|end| end == "lock"));
    let locks: Vec<&PathBuf> = locks.collect();
    let held = as_user(OTHER, || {
        locks.iter().filter(|name| is_locked(name)).count()
    })?;
    let name = format!(
        "lock files of {} that another user can hold, umask {umask}",
        locks.len()
    );
    report.check(
        &name,
        held.to_string(),
        "0, of some",
        held == 0 && locks.len() >= 4,
    );
    let modes = names.iter().filter_map(|name| {
        let mode = fs::symlink_metadata(name).ok()?.mode() & 0o7777;
        let private = name.starts_with(&robot.world.options.root) && name.is_dir();
        (!private && mode & 0o077 != 0).then(|| format!("{} {mode:04o}", name.display()))
    });
    report.none_of(
        &format!("files with a right for others, umask {umask}"),
        &modes.collect::<Vec<_>>(),
    );
    Ok(())
}

fn opens(path: &Path) -> bool {
    let read = fs::read_dir(path).is_ok() || fs::File::open(path).is_ok();
    read || OpenOptions::new().write(true).open(path).is_ok()
}

fn is_locked(path: &Path) -> bool {
    fs::File::open(path).is_ok_and(|file| file.try_lock().is_ok())
}

/// Signals, and the processes' memory and environment.
fn harm(report: &mut Report, robot: &mut OwnersRobot) -> anyhow::Result<()> {
    let pids = robot.pids();
    let refused = as_user(OTHER, || {
        let refused = |pid: &u32| {
            let target = Pid::from_raw(pid.cast_signed()).unwrap();
            let signals = [Signal::STOP, Signal::KILL, Signal::TERM, Signal::HUP];
            let signalled = signals.map(|signal| kill_process(target, signal).is_ok());
            let read = ["mem", "environ", "maps", "fd"]
                .map(|file| opens(Path::new(&format!("/proc/{pid}/{file}"))));
            usize::from(!signalled.contains(&true) && !read.contains(&true))
        };
        pids.iter().map(refused).sum::<usize>()
    })?;
    report.all_of(
        "processes that another user can neither signal nor look into",
        refused,
        3,
    );
    report.none_of("processes that ended meanwhile", &robot.ended());
    Ok(())
}

/// Sixteen bytes into the node counter, then new processes: the product's, and one by iceoryx2's own rules.
fn write_counter(report: &mut Report, robot: &OwnersRobot) -> anyhow::Result<()> {
    let names = robot.shared_memory();
    let counters = names
        .iter()
        .filter(|name| name.to_string_lossy().ends_with(".global_mgmt"));
    let counters: Vec<&PathBuf> = counters.collect();
    let written = as_user(OTHER, || {
        let write = |name: &&&PathBuf| {
            let file = OpenOptions::new().write(true).open(name);
            file.is_ok_and(|mut file| file.write_all(&[0xff; 16]).is_ok())
        };
        counters.iter().filter(write).count()
    })?;
    let name = "node counters written by another user";
    report.check(
        name,
        format!("{written} of {}", counters.len()),
        "0",
        written == 0,
    );
    let output = robot.pcc(PLAN, PATIENCE);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let name = "pcc plan after another user wrote to the node counter";
    report.check(name, said, "success", output.status.success());
    let node = as_user(OWNER, || other_language(robot))?;
    report.check(
        "a client by iceoryx2's own rules after it",
        format!("{node:?}"),
        "Ok",
        node.is_ok(),
    );
    Ok(())
}

/// A node as a client in another language makes one: iceoryx2's prefix and root, and nothing of this project.
fn other_language(robot: &OwnersRobot) -> Result<(), String> {
    let options = &robot.world.options;
    let mut config = Config::default();
    let root = IoxPath::new(options.root.to_str().unwrap().as_bytes());
    config
        .global
        .set_root_path(&root.map_err(|error| format!("{error:?}"))?);
    let prefix = FileName::new(format!("{}_", options.prefix).as_bytes());
    config.global.prefix = prefix.map_err(|error| format!("{error:?}"))?;
    let node = NodeBuilder::new().config(&config).create::<ipc::Service>();
    node.map(drop).map_err(|error| format!("{error:?}"))
}

/// Files of another user's that are named like connections of the robot's processes.
fn false_names(report: &mut Report, robot: &mut OwnersRobot, rounds: usize) -> anyhow::Result<()> {
    let before = Times::measure(robot)?;
    let mut slowest = Times::default().all();
    let (mut made, mut failed) = (0, Vec::new());
    for _ in 0..rounds {
        let names = connection_names(robot);
        made += as_user(OTHER, || {
            names
                .iter()
                .enumerate()
                .filter(|(i, n)| fake(*i, n))
                .count()
        })?;
        match Times::measure(robot) {
            Ok(times) => {
                for ((_, slowest), (_, time)) in slowest.iter_mut().zip(times.all()) {
                    *slowest = time.max(*slowest);
                }
            }
            Err(error) => {
                slowest.iter_mut().for_each(|(_, time)| *time = PATIENCE);
                failed.push(format!("{error:#}"));
            }
        }
    }
    let name = "false connections made by another user";
    report.check(name, made.to_string(), "> 0", made > 0);
    report.none_of(
        "rounds with them in which something stayed blocked",
        &failed,
    );
    for ((name, time), (_, usual)) in slowest.into_iter().zip(before.all()) {
        let usual = usual.as_secs_f64();
        let name = format!("{name} among them, s (usual: {usual:.3})");
        report.at_most(&name, time.as_secs_f64(), 2.0 * usual + 1.0);
    }
    report.none_of("processes that ended among them", &robot.ended());
    Ok(())
}

/// Connections that do not exist, of every port whose number shows.
fn connection_names(robot: &OwnersRobot) -> BTreeSet<PathBuf> {
    let prefix = format!("{}_", robot.world.options.prefix);
    let mut names = BTreeSet::new();
    for path in robot.shared_memory() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let parts = name
            .strip_prefix(&prefix)
            .and_then(|name| name.strip_suffix(".connection"));
        let Some([hash, from, to]) = parts
            .map(|name| name.split('_').collect::<Vec<_>>())
            .and_then(|parts| <[&str; 3]>::try_from(parts).ok())
        else {
            continue;
        };
        for (from, to) in [(from, "1234567890123456789"), ("1234567890123456789", to)] {
            names.insert(
                Path::new("/dev/shm").join(format!("{prefix}{hash}_{from}_{to}.connection")),
            );
        }
    }
    names
}

/// Makes a file that is in the way in one of five manners; whether it could be made.
fn fake(index: usize, path: &Path) -> bool {
    let create = |mode, content: &[u8]| {
        let mut options = OpenOptions::new();
        let file = options.write(true).create_new(true).mode(mode).open(path);
        file.is_ok_and(|mut file| file.write_all(content).is_ok())
    };
    match index % 5 {
        0 => create(0o666, &[]),
        1 => create(0o666, &[0xff; 8192]),
        2 => create(0o000, &[0; 64]),
        3 => symlink("/etc/passwd", path).is_ok(),
        _ => mknodat(CWD, path, FileType::Fifo, Mode::from_raw_mode(0o666), 0).is_ok(),
    }
}

/// A root folder that others can enter is refused by what is wrong and what is allowed.
fn open_root(report: &mut Report) -> anyhow::Result<()> {
    let robot = OwnersRobot::new("022", true);
    let root = &robot.world.options.root;
    fs::create_dir(root)?;
    chown(root, Some(OWNER), Some(OWNER))?;
    let mut wrong = Vec::new();
    let mut named = 0;
    let modes = [0o755, 0o711, 0o750, 0o777];
    for mode in modes {
        fs::set_permissions(root, fs::Permissions::from_mode(mode))?;
        for part in PARTS {
            let config = robot.world.config(&format!("{part}.toml"));
            let arguments = ["--config", config.to_str().unwrap()];
            let output = robot.run(part, &arguments, Duration::from_secs(5));
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            let mode = format!("{mode:04o}");
            let parts = [root.to_str().unwrap(), &mode, "0700", &OWNER.to_string()];
            if output.status.code() == Some(1) && parts.iter().all(|part| said.contains(part)) {
                named += 1;
            } else {
                wrong.push(format!("{part}, {mode}: {:?} {said}", output.status.code()));
            }
        }
    }
    let name = "starts in an open root folder, refused by path, owner, mode and what is allowed";
    report.all_of(name, named, modes.len() * PARTS.len());
    report.none_of("starts not refused so", &wrong);
    Ok(())
}

/// The default root folder's name and the node counter's, taken by another user before the first start.
fn taken(report: &mut Report) -> anyhow::Result<()> {
    let mut robot = OwnersRobot::new("022", false);
    let usual = PathBuf::from(format!("/dev/shm/pcc-{OWNER}"));
    let counter = format!("/dev/shm/{}{COUNTER}", robot.world.options.prefix);
    // What an earlier run left that was killed; nobody else has this number.
    let _ = fs::remove_dir_all(&usual);
    let made = as_user(OTHER, || {
        let folder = fs::create_dir(&usual).is_ok();
        folder && fs::write(&counter, [0xff; 16]).is_ok()
    })?;
    report.check(
        "root folder and node counter taken by another user",
        made.to_string(),
        "true",
        made,
    );
    let begin = Instant::now();
    PARTS.into_iter().for_each(|part| robot.start(part));
    let works = robot.until_it_works(PLAN, Duration::from_secs(20));
    let seconds = begin.elapsed().as_secs_f64();
    fs::remove_dir_all(&usual)?;
    let said = works
        .as_ref()
        .map_or_else(ToString::to_string, |_| format!("{seconds:.3} s"));
    report.check(
        "the robot starts all the same",
        said,
        "it plans",
        works.is_ok(),
    );
    let times = Times::measure(&mut robot);
    let said = times
        .as_ref()
        .map_or_else(|error| format!("{error:#}"), |times| format!("{times:?}"));
    let _ = fs::remove_dir_all(&usual);
    let name = "everything works when the other user's folder is gone";
    report.check(name, said, "it does", times.is_ok());
    Ok(())
}
