//! A loop that is held up for a while: a reply is its own command's, and what was answered "loop busy" is not carried out.

use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use tests::outside::{pcc, shown, thread_named, wait_for_controller};
use tests::process::Process;
use tests::stack::Part;
use tests::system_calls::HeldThread;
use toml::{Table, Value};

use super::processes::{FAR, PATIENCE, Processes};
use crate::report::Report;
use crate::scale::Scale;

/// The speed that is ordered while the loop is held, and is not that of the motion.
const SPEED: &str = "0.2";
/// The speed of the motions in which the loop is held: what the motors go on by meanwhile is no fault.
const SLOW: &str = "0.10";
/// Replies of the loop come within 50 ms or never.
const REPLY: Duration = Duration::from_millis(150);
/// Looks at the rate of a motion after a speed that was answered "loop busy".
const LOOKS: usize = 5;
/// Keys with which a loop that stands still for a reply's time is no fault: as shipped, the robot lets go after 20 ms.
const PATIENT: [(Part, &[(&str, i64)]); 2] = [
    (Part::Robot, &[("lost_setpoint_ms", 1000)]),
    (Part::Controller, &[("late_run_ms", 1000)]),
];

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut processes = Processes::shipped()?;
    let controller = processes.of(Part::Controller).pid();
    let hard_loop = thread_named(controller, "hard-loop");
    others_replies(report, scale, &processes, hard_loop)?;
    withdrawn(report, scale, &processes, hard_loop)?;
    pending_stops(report, scale, &processes, hard_loop)?;
    withdrawn_in_motion(report, scale)
}

/// A robot and a controller that bear a loop which stands still for as long as the reply to a command takes.
fn patient() -> anyhow::Result<Processes> {
    Processes::start(|part, world| {
        if let Some(keys) = PATIENT
            .iter()
            .find_map(|(of, keys)| (*of == part).then_some(keys))
        {
            let file = world.config(&format!("{}.toml", part.program()));
            let mut table: Table = fs::read_to_string(&file)?.parse()?;
            for (key, value) in *keys {
                table.insert((*key).to_owned(), Value::Integer(*value));
            }
            fs::write(&file, table.to_string())?;
        }
        Ok(part.start(world))
    })
}

/// A speed that was answered "loop busy" while the robot moves must not be that of this motion.
fn withdrawn_in_motion(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut processes = patient()?;
    let controller = processes.of(Part::Controller).pid();
    let hard_loop = thread_named(controller, "hard-loop");
    let (mut wrong, tries) = (Vec::new(), scale.pick(3, 20));
    for turn in 0..tries {
        let world = &processes.world;
        let slow = pcc(world, &["speed", SLOW], PATIENCE);
        anyhow::ensure!(slow.is_good(), "speed {SLOW}: {}", slow.summary());
        processes.begin_motion(goal(turn))?;
        let held = HeldThread::hold(hard_loop)?;
        let busy = pcc(world, &["speed", SPEED], PATIENCE);
        held.release()?;
        let is_busy = busy.text.contains("loop busy");
        anyhow::ensure!(is_busy, "the premise: {}", busy.summary());
        sleep(REPLY);
        let moves = processes.robot().moves();
        anyhow::ensure!(moves, "the premise: it moves on: {}", shown(world));
        for look in 0..LOOKS {
            let shown = shown(world);
            let rate = rate(&shown);
            if !shown.contains("controller     executing ") || rate != SLOW {
                wrong.push(format!(
                    "try {turn}, look {look}: rate {rate}: {}",
                    first_line(&shown)
                ));
            }
        }
        stop(&processes)?;
    }
    let name = format!(
        "defect 8: looks at {tries} moving robots whose rate is not {SLOW} after a speed of {SPEED} that was answered \"loop busy\" in motion"
    );
    report.none_of(&name, &wrong);
    Ok(())
}

/// The rate that `pcc watch` shows.
fn rate(shown: &str) -> &str {
    let mut rates = shown.lines().filter_map(|line| line.split_once("rate "));
    let rate = rates.next().and_then(|(_, rate)| rate.split(',').next());
    rate.map_or("not shown", str::trim)
}

fn first_line(shown: &str) -> &str {
    let mut lines = shown.lines().filter(|line| line.contains("controller "));
    lines.next().unwrap_or_default()
}

/// `pcc speed` while the loop is held, then `pcc reset` around its release: without a fault a reset has nothing to do, so a reset
/// that is accepted got the speed's reply.
fn others_replies(
    report: &mut Report,
    scale: Scale,
    processes: &Processes,
    hard_loop: u32,
) -> anyhow::Result<()> {
    let (mut busy, mut mixed_up, mut answered) = (0, Vec::new(), 0);
    let tries = scale.pick(12, 60);
    for turn in 0..tries {
        let held = HeldThread::hold(hard_loop)?;
        let speed = pcc(&processes.world, &["speed", "1"], PATIENCE);
        busy += usize::from(speed.text.contains("loop busy"));
        let mut reset = Process::start(&processes.world, "pcc", &["reset"]);
        sleep(Duration::from_millis(10 + 5 * (turn % 12)));
        held.release()?;
        reset.wait(PATIENCE)?;
        let text = reset.log();
        answered += usize::from(text.contains("nothing to do") || text.contains("loop busy"));
        if text.contains("accepted") {
            mixed_up.push(text.trim().to_owned());
        }
        sleep(Duration::from_millis(100));
    }
    let tries = usize::try_from(tries)?;
    report.all_of(
        "defect 8: speeds answered \"loop busy\" by a held loop (the premise)",
        busy,
        tries,
    );
    report.none_of("defect 8: replies that were another command's", &mixed_up);
    report.all_of(
        "defect 8: resets with a reply of their own",
        answered,
        tries,
    );
    Ok(())
}

/// A speed that was answered "loop busy" must not be that of the next motion.
fn withdrawn(
    report: &mut Report,
    scale: Scale,
    processes: &Processes,
    hard_loop: u32,
) -> anyhow::Result<()> {
    let world = &processes.world;
    let tries = scale.pick(2, 10);
    let mut wrong = Vec::new();
    for turn in 0..tries {
        let first = pcc(world, &["speed", "1"], PATIENCE);
        anyhow::ensure!(first.is_good(), "speed 1: {}", first.summary());
        let held = HeldThread::hold(hard_loop)?;
        let busy = pcc(world, &["speed", SPEED], PATIENCE);
        sleep(REPLY);
        held.release()?;
        let is_busy = busy.text.contains("loop busy");
        anyhow::ensure!(is_busy, "the premise: {}", busy.summary());
        wait_for_controller(world, "holding", PATIENCE)?;
        processes.begin_motion(goal(turn))?;
        let shown = shown(world);
        let rate = rate(&shown);
        if rate != "1.00" {
            wrong.push(format!("try {turn}: {rate}"));
        }
        stop(processes)?;
    }
    let name = format!(
        "defect 8: motions of {tries} whose rate is not 1.00 after a speed of {SPEED} that was answered \"loop busy\""
    );
    report.none_of(&name, &wrong);
    Ok(())
}

/// Two places to go to in turn.
fn goal(turn: usize) -> &'static [f64; 6] {
    [&FAR, &[0.0; 6]][turn % 2]
}

/// Ends a motion that is under way.
fn stop(processes: &Processes) -> anyhow::Result<()> {
    let begin = Instant::now();
    let said = pcc(&processes.world, &["stop"], PATIENCE);
    anyhow::ensure!(said.is_good(), "pcc stop: {}", said.summary());
    let rest = processes.robot().time_to_rest(begin, PATIENCE);
    anyhow::ensure!(rest.is_some(), "it does not come to rest");
    wait_for_controller(&processes.world, "holding", PATIENCE)?;
    Ok(())
}

/// A stop is never withdrawn: its reply says that it stays in force. That it does is tried in `pending_stops.rs`.
fn pending_stops(
    report: &mut Report,
    scale: Scale,
    processes: &Processes,
    hard_loop: u32,
) -> anyhow::Result<()> {
    let (mut told, tries) = (0, scale.pick(3, 20));
    for _ in 0..tries {
        let held = HeldThread::hold(hard_loop)?;
        let stop = pcc(&processes.world, &["stop"], PATIENCE);
        held.release()?;
        told += usize::from(stop.text.contains("stop pending") && !stop.is_good());
        sleep(REPLY);
    }
    let name =
        "defect 8: stops that a held loop has not taken, answered as ones that stay in force";
    report.all_of(name, told, tries);
    Ok(())
}
