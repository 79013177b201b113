//! Programs that watch take no place from those that stop, plan, or start again.

use std::time::{Duration, Instant};

use client::ControllerView;
use shared_types::codes::LoopState;
use tests::outside::{execute, pcc};
use tests::process::{Process, wait_for};
use tests::stack::Part;

use super::processes::{FAR, PATIENCE, Processes};
use crate::report::Report;
use crate::scale::Scale;

/// Watchers that must leave room for those who plan and stop.
const WATCHERS: usize = 10;
/// More than there are places for.
const CROWD: usize = 34;
/// As far from straight as [`FAR`], the other way: three motions have come near to that when the crowd is there.
const BACK: [f64; 6] = [-1.1, -0.4, 0.9, -0.7, -0.8, 1.0];
/// Time in which one that watches shows something.
const SHOWN_WITHIN: Duration = Duration::from_secs(2);
/// Time in which a process that is refused its place has ended.
const REFUSED_WITHIN: Duration = Duration::from_secs(3);

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut processes = Processes::shipped()?;
    let mut watchers = watch(&processes, WATCHERS);
    let name = "defect 5: watchers that watch";
    report.all_of(name, watching(&mut watchers), WATCHERS);
    let about = format!("defect 5: {WATCHERS} watchers");
    served(report, &mut processes, &about, &FAR)?;
    restarted(report, &mut processes, &about, Part::Daemon, &FAR)?;
    restarted(report, &mut processes, &about, Part::Controller, &FAR)?;
    let name = "defect 5: watchers that watch after the restarts";
    report.all_of(name, watching(&mut watchers), WATCHERS);
    if scale.full {
        crowd(report, &mut processes, watchers)?;
    }
    Ok(())
}

fn watch(processes: &Processes, count: usize) -> Vec<Process> {
    let start = |_| {
        let watcher = Process::start(&processes.world, "pcc", &["watch", "--rate-hz", "2"]);
        // One after the other: each joins in some milliseconds.
        std::thread::sleep(Duration::from_millis(100));
        watcher
    };
    let watchers = (0..count).map(start).collect();
    std::thread::sleep(REFUSED_WITHIN);
    watchers
}

/// Watchers that run, and show more than they did a moment ago.
fn watching(watchers: &mut [Process]) -> usize {
    let shown: Vec<usize> = watchers.iter().map(|watcher| watcher.log().len()).collect();
    std::thread::sleep(SHOWN_WITHIN);
    let watchers = watchers.iter_mut().zip(shown);
    let watch = watchers.filter_map(|(watcher, before)| {
        let watches = watcher.is_running() && watcher.log().len() > before;
        watches.then_some(())
    });
    watch.count()
}

/// `plan --execute`, and `stop` of what it began.
fn served(
    report: &mut Report,
    processes: &mut Processes,
    about: &str,
    goal: &[f64; 6],
) -> anyhow::Result<()> {
    let said = execute(&processes.world, goal, PATIENCE);
    let name = format!("{about}: `pcc plan --execute`");
    report.check(&name, said.summary(), "status 0", said.is_good());
    if !said.is_good() {
        return Ok(());
    }
    processes
        .robot()
        .wait_for_motion(super::processes::IN_MOTION, PATIENCE)?;
    let begun = Instant::now();
    let said = pcc(&processes.world, &["stop"], PATIENCE);
    let rest = processes
        .robot()
        .time_to_rest(begun, Duration::from_secs(4));
    let passed = said.is_good() && rest.is_some();
    let name = format!("{about}: `pcc stop`");
    report.check(&name, said.summary(), "status 0, at rest", passed);
    Ok(())
}

/// Kills a part and starts it again: it must find its places.
fn restarted(
    report: &mut Report,
    processes: &mut Processes,
    about: &str,
    part: Part,
    goal: &[f64; 6],
) -> anyhow::Result<()> {
    processes.of(part).kill9();
    processes.processes[part as usize] = part.start(&processes.world);
    std::thread::sleep(REFUSED_WITHIN);
    let process = processes.of(part);
    let (runs, log) = (process.is_running(), process.log());
    let name = format!("{about}: a restarted {}", part.program());
    let last = log.lines().last().unwrap_or_default().to_owned();
    report.check(&name, last, "runs", runs);
    if runs {
        // Not by another `pcc watch`: it would need a watcher's place.
        let mut controller = ControllerView::connect(&processes.world.options)?;
        wait_for("the controller is holding", PATIENCE, || {
            let state = controller.latest_state().ok().flatten()?;
            (state.state == LoopState::Holding).then_some(())
        })?;
        served(report, processes, &format!("{name}, then"), goal)?;
    }
    Ok(())
}

/// Watchers until there is no place left: who is refused is told what is full and who may be closed, and the robot still obeys.
fn crowd(
    report: &mut Report,
    processes: &mut Processes,
    mut watchers: Vec<Process>,
) -> anyhow::Result<()> {
    watchers.extend(watch(processes, CROWD - WATCHERS));
    let mut refused = Vec::new();
    wait_for("a watcher is refused", PATIENCE, || {
        let ended = watchers.iter_mut().filter_map(|watcher| {
            let ended = !watcher.is_running();
            ended.then(|| watcher.log())
        });
        refused = ended.collect();
        (!refused.is_empty()).then_some(())
    })?;
    let named = |log: &&String| {
        log.contains("controller_state has no free place") && log.contains("(process ")
    };
    let count = refused.iter().filter(named).count();
    let name = format!(
        "defect 5: {CROWD} watchers: refused ones are told what is full and who may be closed"
    );
    report.all_of(&name, count, refused.len());
    let about = format!("defect 5: {CROWD} watchers");
    served(report, processes, &about, &BACK)?;
    restarted(report, processes, &about, Part::Daemon, &BACK)?;
    restarted(report, processes, &about, Part::Controller, &BACK)
}
