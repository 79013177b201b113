//! A loop that is held up for a while: a reply is its own command's, and what was answered "loop busy" is not carried out.

use std::thread::sleep;
use std::time::Duration;

use tests::outside::{pcc, shown, thread_named};
use tests::process::Process;
use tests::stack::Part;
use tests::system_calls::HeldThread;

use super::{FAR, PATIENCE, Processes};
use crate::{Report, Scale};

/// The speed that is ordered while the loop is held, and is not that of the motion.
const SPEED: &str = "0.2";
/// Replies of the loop come within 50 ms or never.
const REPLY: Duration = Duration::from_millis(150);

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut processes = Processes::shipped()?;
    let controller = processes.of(Part::Controller).pid();
    let hard_loop = thread_named(controller, "hard-loop");
    others_replies(report, scale, &processes, hard_loop)?;
    withdrawn(report, &processes, hard_loop)
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
fn withdrawn(report: &mut Report, processes: &Processes, hard_loop: u32) -> anyhow::Result<()> {
    let first = pcc(&processes.world, &["speed", "1"], PATIENCE);
    anyhow::ensure!(first.is_good(), "speed 1: {}", first.summary());
    let held = HeldThread::hold(hard_loop)?;
    let busy = pcc(&processes.world, &["speed", SPEED], PATIENCE);
    sleep(REPLY);
    held.release()?;
    let is_busy = busy.text.contains("loop busy");
    anyhow::ensure!(is_busy, "the premise: {}", busy.summary());
    tests::outside::wait_for_controller(&processes.world, "holding", PATIENCE)?;
    processes.begin_motion(&FAR)?;
    let shown = shown(&processes.world);
    let rate = shown
        .lines()
        .find_map(|line| line.split_once("rate "))
        .map(|(_, rate)| rate);
    let rate = rate.unwrap_or("not shown").trim().to_owned();
    let name = format!(
        "defect 8: rate of the motion after a speed of {SPEED} that was answered \"loop busy\""
    );
    let passed = rate == "1.00";
    report.check(&name, rate, "1.00", passed);
    pending_stop(report, processes, hard_loop)
}

/// A stop is never withdrawn: its reply says that it stays in force, and it does.
fn pending_stop(report: &mut Report, processes: &Processes, hard_loop: u32) -> anyhow::Result<()> {
    let held = HeldThread::hold(hard_loop)?;
    let stop = pcc(&processes.world, &["stop"], PATIENCE);
    held.release()?;
    let told = stop.text.contains("stop pending") && !stop.is_good();
    let name =
        "defect 8: a stop that a held loop has not taken is answered as one that stays in force";
    report.check(name, stop.summary(), "stop pending", told);
    Ok(())
}
