//! `pcc stop`, SIGTERM and the loss of the daemon, while the controller's output stalls or one of its threads is held.

use std::time::{Duration, Instant};

use tests::outside::{has_ended, pcc, thread_named, wait_for_controller};
use tests::process::{Process, wait_for};
use tests::stack::Part;
use tests::stalled_output::StalledOutput;
use tests::system_calls::HeldThread;
use tests::world::shipped_number;

use super::processes::{FAR, PATIENCE, Processes};
use crate::report::Report;
use crate::scale::Scale;

/// How much longer than the longest of those without a stall a stop may take.
const ALLOWANCE_MS: f64 = 100.0;
/// After so long without the guard the loop stops by itself (decision 0021).
const GUARD_HELD_MS: f64 = 100.0;
/// Two heartbeats of the daemon, ms.
const TWO_HEARTBEATS_MS: f64 = 20.0;
/// How long the robot is looked at: far less than what is left of the motion, and more than any stop.
const LOOK: Duration = Duration::from_secs(4);
/// Time in which a process that is to stall meets its stall.
const SETTLE: Duration = Duration::from_millis(300);

/// What holds the controller up.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stall {
    Nothing,
    /// Nobody reads what any of the three processes writes.
    Pipe,
    /// The terminals of the three processes were stopped with Ctrl-S.
    Terminal,
    /// The disk that the controller's standard error is on stands still.
    Disk,
    /// The thread that takes trajectories and publishes the state.
    Relay,
    /// The thread that hears commands.
    Guard,
    /// The thread that writes the log.
    Log,
}

/// What is to stop the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    Stop,
    Sigterm,
    DaemonKilled,
    /// The stall itself.
    Nothing,
}

impl Stall {
    fn text(self) -> &'static str {
        match self {
            Self::Nothing => "nothing stalls",
            Self::Pipe => "nobody reads stderr",
            Self::Terminal => "terminal stopped",
            Self::Disk => "disk stands still",
            Self::Relay => "relay thread held",
            Self::Guard => "guard thread held",
            Self::Log => "log thread held",
        }
    }
}

impl Event {
    fn text(self) -> &'static str {
        match self {
            Self::Stop => "`pcc stop`",
            Self::Sigterm => "SIGTERM",
            Self::DaemonKilled => "daemon killed",
            Self::Nothing => "the loop stops by itself",
        }
    }
}

const CASES: [(Stall, Event); 16] = [
    (Stall::Pipe, Event::Stop),
    (Stall::Pipe, Event::Sigterm),
    (Stall::Pipe, Event::DaemonKilled),
    (Stall::Terminal, Event::Stop),
    (Stall::Terminal, Event::Sigterm),
    (Stall::Terminal, Event::DaemonKilled),
    (Stall::Disk, Event::Stop),
    (Stall::Disk, Event::Sigterm),
    (Stall::Disk, Event::DaemonKilled),
    (Stall::Relay, Event::Stop),
    (Stall::Relay, Event::Sigterm),
    (Stall::Relay, Event::DaemonKilled),
    (Stall::Log, Event::Stop),
    (Stall::Log, Event::Sigterm),
    (Stall::Log, Event::DaemonKilled),
    (Stall::Guard, Event::Nothing),
];

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut cases = CASES.map(|case| (case, Vec::new()));
    let mut usual_ms = 0.0_f64;
    for _ in 0..scale.pick(1, 5) {
        for ((stall, event), results) in &mut cases {
            results.push(tried(*stall, *event)?);
        }
        // Spread over the time that the cases take: the machine may be busier now than then.
        for _ in 0..3 {
            let ms = tried(Stall::Nothing, Event::Stop)?
                .map_err(|reason| anyhow::anyhow!("without a stall: {reason}"))?;
            usual_ms = usual_ms.max(ms);
        }
    }
    let name = "defect 2: from `pcc stop` to rest where nothing stalls, the longest, ms";
    report.shown(name, format!("{usual_ms:.0}"));
    for ((stall, event), results) in cases {
        let waits_ms = match event {
            Event::DaemonKilled => {
                shipped_number("controller.toml", "daemon_lost_ms") + TWO_HEARTBEATS_MS
            }
            Event::Nothing => GUARD_HELD_MS,
            Event::Stop | Event::Sigterm => 0.0,
        };
        let bar_ms = usual_ms + waits_ms + ALLOWANCE_MS;
        let longest_ms = results.iter().flatten().copied().fold(0.0, f64::max);
        let failed: Vec<&String> = results.iter().filter_map(|r| r.as_ref().err()).collect();
        let name = format!("defect 2: {}, {}: at rest, ms", stall.text(), event.text());
        let figure = match failed.first() {
            None => format!("{longest_ms:.0}"),
            Some(first) => format!("{} failed: {first}", failed.len()),
        };
        let bar = format!("<= {bar_ms:.0}, all");
        let passed = failed.is_empty() && longest_ms <= bar_ms;
        report.check(&name, figure, &bar, passed);
    }
    Ok(())
}

/// One motion that is to be stopped: milliseconds until the robot is at rest, or what went wrong.
///
/// # Errors
/// Where the premises do not hold: it does not move, nothing stalls.
fn tried(stall: Stall, event: Event) -> anyhow::Result<Result<f64, String>> {
    // The controller's, and those of the other two.
    let outputs = match stall {
        Stall::Pipe => vec![
            StalledOutput::pipe()?,
            StalledOutput::pipe()?,
            StalledOutput::pipe()?,
        ],
        Stall::Terminal => vec![
            StalledOutput::terminal()?,
            StalledOutput::terminal()?,
            StalledOutput::terminal()?,
        ],
        Stall::Disk => vec![StalledOutput::disk()?],
        Stall::Nothing | Stall::Relay | Stall::Guard | Stall::Log => Vec::new(),
    };
    let place = |part| match part {
        Part::Controller => 0,
        Part::Daemon => 1,
        Part::Robot => 2,
    };
    let mut processes = Processes::start(|part, world| {
        Ok(match outputs.get(place(part)) {
            Some(output) => part.start_onto(world, output.stdio()?),
            None => part.start(world),
        })
    })?;
    // Dropped before the processes: one that waits for its disk does not end.
    let mut outputs = outputs;
    processes.begin_motion(&FAR)?;
    let controller = processes.of(Part::Controller).pid();
    let mut held = None;
    for output in &mut outputs {
        output.stall()?;
        anyhow::ensure!(output.is_stalled()?, "the premise: a write would wait");
    }
    if !outputs.is_empty() {
        // Something to log: a controller that waits for its reader waits from now on.
        let mut order = Process::start(&processes.world, "pcc", &["speed", "1"]);
        let _ = order.wait(SETTLE);
    }
    if let Some(name) = thread_of(stall) {
        let thread = thread_named(controller, name);
        anyhow::ensure!(thread != controller, "the premise: a thread named {name}");
        held = Some(HeldThread::hold(thread)?);
    }
    let begin = Instant::now();
    let result = cause(&mut processes, event, begin);
    for output in &outputs {
        anyhow::ensure!(output.is_stalled()?, "the premise: nobody has read");
    }
    // One that was held may have ended with its process.
    let _ = held.map(HeldThread::release);
    let result = result?;
    if stall == Stall::Guard {
        return Ok(result.and_then(|ms| named(&processes).map(|()| ms)));
    }
    Ok(result)
}

fn thread_of(stall: Stall) -> Option<&'static str> {
    match stall {
        Stall::Relay => Some("relay"),
        Stall::Guard => Some("guard"),
        Stall::Log => Some("log"),
        Stall::Nothing | Stall::Pipe | Stall::Terminal | Stall::Disk => None,
    }
}

/// Has the robot stopped, and waits for its rest.
fn cause(
    processes: &mut Processes,
    event: Event,
    begin: Instant,
) -> anyhow::Result<Result<f64, String>> {
    let robot = processes.robot();
    let mut order = None;
    match event {
        Event::Stop => order = Some(Process::start(&processes.world, "pcc", &["stop"])),
        Event::Sigterm => processes.of(Part::Controller).signal(libc::SIGTERM),
        Event::DaemonKilled => processes.of(Part::Daemon).kill9(),
        Event::Nothing => {}
    }
    let Some(rest) = robot.time_to_rest(begin, LOOK) else {
        return Ok(Err(format!("still moving after {LOOK:?}")));
    };
    if let Some(mut order) = order {
        let ended = order.wait(LOOK);
        if !ended.is_ok_and(|status| status.success()) {
            let text = order.log();
            return Ok(Err(format!("pcc stop: {}", text.trim())));
        }
    }
    if event == Event::Sigterm {
        let controller = processes.of(Part::Controller).pid();
        let ended = wait_for("the controller ends", LOOK, || {
            has_ended(controller).then_some(())
        });
        if ended.is_err() {
            return Ok(Err(format!("the controller has not ended after {LOOK:?}")));
        }
    }
    Ok(Ok(rest.as_secs_f64() * 1e3))
}

/// The fault that the loop latched while nobody could have stopped it must have a name, and be cleared by a reset.
fn named(processes: &Processes) -> Result<(), String> {
    let world = &processes.world;
    wait_for_controller(world, "fault", PATIENCE).map_err(|error| error.to_string())?;
    let shown = tests::outside::shown(world);
    if !shown.contains("FAULT          guard held up") {
        return Err(format!("another cause is shown: {shown}"));
    }
    let reset = pcc(world, &["reset"], PATIENCE);
    let held = wait_for_controller(world, "holding", PATIENCE);
    match (reset.is_good(), held) {
        (true, Ok(())) => Ok(()),
        _ => Err(format!("pcc reset: {}", reset.summary())),
    }
}
