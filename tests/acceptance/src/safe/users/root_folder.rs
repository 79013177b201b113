//! The folder of a robot's services: one that others can enter, and one whose name another user has taken.

use std::fs;
use std::os::unix::fs::{PermissionsExt, chown};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use tests::other_user::{OTHER, OWNER, OwnersRobot, as_user};

use super::reach::{COUNTER, reach};
use super::times::{MOTIONS, PARTS, PATIENCE, PLAN, Times};
use crate::report::Report;

/// A root folder that others can enter is refused by what is wrong and what is allowed.
pub(super) fn open(report: &mut Report) -> anyhow::Result<()> {
    let robot = OwnersRobot::new("022", true);
    let root = &robot.world.options.root;
    fs::create_dir(root)?;
    chown(root, Some(OWNER), Some(OWNER))?;
    let mut wrong = Vec::new();
    let mut named = 0;
    let modes = [0o755, 0o711, 0o750, 0o777];
    let configs = PARTS.map(|part| robot.world.config(&format!("{part}.toml")));
    let starts = PARTS.iter().zip(&configs);
    let starts = starts.map(|(part, config)| (*part, vec!["--config", config.to_str().unwrap()]));
    let unit = robot.world.config("robots/unit.toml");
    let demo = ["demo", "--robot", unit.to_str().unwrap()];
    let orders = [
        &["stop"][..],
        &["reset"],
        PLAN,
        MOTIONS[0],
        &["watch", "--times", "1"],
        &["speed", "1"],
        &["scene", "leave", "camera"],
        &demo,
    ];
    let orders = orders.map(|words| ("pcc", words.to_vec()));
    let runs: Vec<(&str, Vec<&str>)> = starts.chain(orders).collect();
    for mode in modes {
        fs::set_permissions(root, fs::Permissions::from_mode(mode))?;
        for (part, arguments) in &runs {
            let output = robot.run(part, arguments, Duration::from_secs(5));
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            let mode = format!("{mode:04o}");
            let parts = [root.to_str().unwrap(), &mode, "0700", &OWNER.to_string()];
            if output.status.code() == Some(1) && parts.iter().all(|part| said.contains(part)) {
                named += 1;
            } else {
                let (word, status) = (arguments[0], output.status.code());
                wrong.push(format!("{part} {word}, {mode}: {status:?} {said}"));
            }
        }
    }
    let name = "defect 9: starts and orders in an open root folder, refused by path, owner, mode and what is allowed";
    report.all_of(name, named, modes.len() * runs.len());
    report.none_of("defect 9: starts and orders not refused so", &wrong);
    Ok(())
}

/// A robot without another user's doing, in the default root folder: how often the steps fail that are tried again later.
fn undisturbed(report: &mut Report) -> anyhow::Result<(usize, Times)> {
    let mut robot = OwnersRobot::new("022", false);
    let usual = PathBuf::from(format!("/dev/shm/pcc-{OWNER}"));
    // What an earlier run left that was killed; nobody else has this number.
    let _ = fs::remove_dir_all(&usual);
    PARTS.into_iter().for_each(|part| robot.start(part));
    let first = robot.until_it_works(PLAN, PATIENCE)?;
    robot.until_holding(PATIENCE, &[])?;
    let is_default = robot.root() == usual && usual.is_dir();
    let name = "defect 9: the default root folder is used where nobody has taken it (the premise)";
    report.check(
        name,
        robot.root().display().to_string(),
        "it is",
        is_default,
    );
    reach(report, &robot, "default root folder")?;
    let times = Times::measure(&mut robot)?;
    let _ = fs::remove_dir_all(&usual);
    Ok((first.failed, times))
}

/// The default root folder's name and the node counter's, taken by another user before the first start.
pub(super) fn taken(report: &mut Report) -> anyhow::Result<()> {
    let (usually_failed, undisturbed) = undisturbed(report)?;
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
        "defect 9: root folder and node counter taken by another user",
        made.to_string(),
        "true",
        made,
    );
    let begin = Instant::now();
    PARTS.into_iter().for_each(|part| robot.start(part));
    let works = robot.until_it_works(PLAN, Duration::from_secs(20));
    let seconds = begin.elapsed().as_secs_f64();
    if let Ok(tried) = &works {
        let name = format!(
            "defect 9: first plans that failed in a taken folder (usual: {usually_failed})"
        );
        report.at_most(&name, tried.failed as f64, usually_failed as f64);
    }
    reach(report, &robot, "folder in the home")?;
    fs::remove_dir_all(&usual)?;
    let said = works
        .as_ref()
        .map_or_else(ToString::to_string, |_| format!("{seconds:.3} s"));
    report.check(
        "defect 9: the robot starts all the same",
        said,
        "it plans",
        works.is_ok(),
    );
    let times = Times::measure(&mut robot);
    let works = times
        .as_ref()
        .is_ok_and(|times| times.not_stopped.is_empty());
    if let Ok(times) = &times {
        let about = "when the other user's folder is gone";
        times.tell_failed(report, about, &undisturbed);
    }
    let said = times.map_or_else(|error| format!("{error:#}"), |times| format!("{times:?}"));
    let _ = fs::remove_dir_all(&usual);
    let name = "defect 9: everything works when the other user's folder is gone";
    report.check(name, said, "it does", works);
    Ok(())
}
