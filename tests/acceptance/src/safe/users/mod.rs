//! Another user of the machine, who acts before, between and after the starts of a robot's processes.

mod reach;
mod root_folder;
mod times;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, NodeBuilder, Path as IoxPath, SemanticString, ipc};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::{Pid, Signal, kill_process};
use tests::other_user::{OTHER, OWNER, OwnersRobot, as_user};

use self::reach::{COUNTER, opens, reach};
use self::times::{PARTS, PATIENCE, PLAN, Times};
use crate::report::Report;
use crate::scale::Scale;

const COMMAND: &str = "acceptance safe, users";

pub(crate) fn run(report: &mut Report, scale: Scale) {
    report.group("another user, running processes", COMMAND, |report| {
        running(report, scale)
    });
    report.group("another user, open root folder", COMMAND, root_folder::open);
    report.group(
        "another user, names taken beforehand",
        COMMAND,
        root_folder::taken,
    );
}

fn running(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    confirm_other_user(report)?;
    for umask in ["000", "022", "077"] {
        let mut robot = OwnersRobot::new(umask, true);
        PARTS.into_iter().for_each(|part| robot.start(part));
        robot.until_it_works(PLAN, PATIENCE)?;
        reach(report, &robot, &format!("umask {umask}"))?;
        if umask == "000" {
            counter_is_known(report, &robot);
        }
        harm(report, &mut robot)?;
        if umask == "000" {
            false_names(report, &mut robot, scale.pick(1, 5))?;
            write_counter(report, &robot)?;
        }
    }
    Ok(())
}

/// That the name which is taken beforehand elsewhere is the one that iceoryx2 gives.
fn counter_is_known(report: &mut Report, robot: &OwnersRobot) {
    let names = robot.shared_memory();
    let count = names
        .iter()
        .filter(|name| name.to_string_lossy().ends_with(COUNTER))
        .count();
    let name = "defect 9: node counters of the robot's processes named as expected (the premise)";
    report.check(
        name,
        format!("{count} of {} files", names.len()),
        ">= 1",
        count > 0,
    );
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
    let name = "defect 9: another Linux user could be made, and is one";
    report.check(name, figure, "Ok(true)", refused == Ok(true));
    Ok(())
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
        "defect 9: processes that another user can neither signal nor look into",
        refused,
        3,
    );
    report.none_of("defect 9: processes that ended meanwhile", &robot.ended());
    Ok(())
}

/// Sixteen bytes into the node counter, then new processes: the product's, and one by iceoryx2's own rules.
fn write_counter(report: &mut Report, robot: &OwnersRobot) -> anyhow::Result<()> {
    let names = robot.shared_memory();
    let is_own = |name: &PathBuf| fs::symlink_metadata(name).is_ok_and(|it| it.uid() == OWNER);
    let counters = names
        .iter()
        .filter(|name| name.to_string_lossy().ends_with(".global_mgmt") && is_own(name));
    let counters: Vec<&PathBuf> = counters.collect();
    let written = as_user(OTHER, || {
        let write = |name: &&&PathBuf| {
            let file = OpenOptions::new().write(true).open(name);
            file.is_ok_and(|mut file| file.write_all(&[0xff; 16]).is_ok())
        };
        counters.iter().filter(write).count()
    })?;
    let name = "defect 9: node counters written by another user";
    report.check(
        name,
        format!("{written} of {}", counters.len()),
        "0, of some",
        written == 0 && !counters.is_empty(),
    );
    let output = robot.pcc(PLAN, PATIENCE);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let name = "defect 9: pcc plan after another user wrote to the node counter";
    report.check(name, said, "success", output.status.success());
    let node = as_user(OWNER, || other_language(robot))?;
    report.check(
        "defect 9: a client by iceoryx2's own rules after it",
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

/// Files of another user's that are named like what the robot's processes have in shared memory, and in their root folder.
fn false_names(report: &mut Report, robot: &mut OwnersRobot, rounds: usize) -> anyhow::Result<()> {
    let mut usual = Times::measure(robot)?;
    for _ in 1..rounds {
        usual = usual.longest(Times::measure(robot)?);
    }
    let name = "defect 9: pcc stop while the robot moves, without false names: failed";
    report.none_of(name, &usual.not_stopped);
    let name = "defect 9: processes that ended by themselves without false names";
    report.none_of(name, &usual.ended);
    let (mut slowest, mut failed) = (Times::default(), Vec::new());
    let mut made = BTreeMap::<String, usize>::new();
    let mut in_root = 0;
    for _ in 0..rounds {
        let names = foreseeable_names(robot);
        let kinds = as_user(OTHER, || {
            let made = names.iter().enumerate().filter(|(i, n)| fake(*i, n));
            made.map(|(_, name)| ending(name)).collect::<Vec<_>>()
        })?;
        kinds
            .into_iter()
            .for_each(|kind| *made.entry(kind).or_default() += 1);
        let folders = robot.root_files();
        in_root += as_user(OTHER, || {
            let inside = folders.iter().filter(|path| path.is_dir());
            let made = |folder: &&PathBuf| fs::write(folder.join("false"), "").is_ok();
            inside.filter(made).count()
        })?;
        match Times::measure(robot) {
            Ok(times) => slowest = slowest.longest(times),
            Err(error) => failed.push(format!("{error:#}")),
        }
    }
    let kinds = ["connection", "data", "dynamic", "event_mgmt"];
    let all_kinds = kinds.iter().all(|kind| made.contains_key(*kind));
    let name = "defect 9: false names made by another user";
    let bar = format!("of each kind: {}", kinds.join(", "));
    report.check(name, format!("{made:?}"), &bar, all_kinds);
    let name =
        "defect 9: files made by another user below the root folder (services, nodes, events)";
    report.check(name, in_root.to_string(), "0", in_root == 0);
    let name = "defect 9: rounds with them in which something stayed blocked";
    report.none_of(name, &failed);
    let name = "defect 9: pcc stop while the robot moves, among them: failed";
    report.none_of(name, &slowest.not_stopped);
    for ((name, time, more), (_, usual, _)) in slowest.all().into_iter().zip(usual.all()) {
        let usual_s = usual.as_secs_f64();
        let name = format!("defect 9: {name} among them, s (usual: {usual_s:.3})");
        report.at_most(&name, time.as_secs_f64(), (usual + more).as_secs_f64());
    }
    slowest.tell_failed(report, "among them", &usual);
    let name = "defect 9: processes that ended among them";
    report.none_of(name, &robot.ended());
    Ok(())
}

fn ending(path: &Path) -> String {
    let end = path.extension().unwrap_or_default();
    end.to_string_lossy().into_owned()
}

/// Names that nothing has, of every kind that there is: with an invented number in the place of each number that shows, and with
/// those that the same process would draw next.
fn foreseeable_names(robot: &OwnersRobot) -> BTreeSet<PathBuf> {
    /// The number of a process's next port is this much larger.
    const NEXT: u128 = 1 << 96;
    let prefix = format!("{}_", robot.world.options.prefix);
    let mut names = BTreeSet::new();
    for path in robot.shared_memory() {
        let (name, end) = (path.file_name().unwrap().to_string_lossy(), ending(&path));
        let stem = name.strip_prefix(&prefix);
        let stem = stem.and_then(|stem| stem.strip_suffix(&format!(".{end}")));
        let parts: Vec<&str> = stem.unwrap_or_default().split('_').collect();
        for place in 1..parts.len() {
            let Ok(number) = parts[place].parse::<u128>() else {
                continue;
            };
            let next = (1..=3).map(|step| number.wrapping_add(step * NEXT));
            for number in next.chain([1_234_567_890_123_456_789]) {
                let number = number.to_string();
                let mut parts = parts.clone();
                parts[place] = &number;
                let false_name = format!("{prefix}{}.{end}", parts.join("_"));
                names.insert(Path::new("/dev/shm").join(false_name));
            }
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
