//! Services that a client by iceoryx2's own rules was making when it was held, or killed: it holds no lock of this project's.
//!
//! Each try lets it go one system call further than the one before. A held one must find its service as it left it: it makes it, and
//! hears the robot's processes there. A killed one's must be in nobody's way.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tests::outside::pcc;
use tests::plain_client::{KINDS, PlainClient};
use tests::process::Process;
use tests::stack::Part;
use tests::world::{Settings, World};

use crate::report::Report;
use crate::scale::Scale;

const COMMAND: &str = "acceptance safe, half-made services";
/// Longer than any of this project's processes waits before it takes memory without a size for a dead one's.
const HELD: Duration = Duration::from_millis(1800);
/// Long enough for everything that should happen at all.
const PATIENCE: Duration = Duration::from_secs(20);
/// A second until what a dead one left is looked at closely, and the start of a daemon on a busy machine, s.
const PLANS_WITHIN_S: f64 = 5.0;
/// Tries at once: they mostly wait.
const AT_ONCE: usize = 4;
const PLAN: &[&str] = &[
    "plan",
    "--tip",
    "0.8",
    "0.2",
    "2.7",
    "--sampler",
    "straight",
    "--start",
    "0.1",
    "0",
    "0",
    "0",
    "0",
    "0",
];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let step = scale.pick(5, 1);
    report.group("half-made services, maker held", COMMAND, |report| {
        let tries = Tries::of(step, held)?;
        tries.premises(report, "was held")?;
        let name =
            "defect 9: services lost, or not met by the robot's processes, whose maker was held";
        report.none_of(name, &tries.wrong);
        let name = "defect 9: services whose maker was held at which a daemon ended";
        report.none_of(name, &tries.ended);
        Ok(())
    });
    report.group("half-made services, maker killed", COMMAND, |report| {
        let tries = Tries::of(step, killed)?;
        tries.premises(report, "was killed")?;
        let name =
            "defect 9: deaths of a service's maker after which the robot's processes do not plan";
        report.none_of(name, &tries.wrong);
        let name = "defect 9: deaths of a service's maker after which a daemon ended";
        report.none_of(name, &tries.ended);
        report.at_most(
            "defect 9: from a maker's death until the robot plans, s",
            tries.longest_s,
            PLANS_WITHIN_S,
        );
        Ok(())
    });
}

/// What a maker had made when something happened to it.
#[derive(Clone, Copy, Debug, Default)]
struct Remains {
    /// The service's description is there, and nobody may read it yet.
    is_unfinished: bool,
    /// Shared memory is there that has no size.
    is_unsized: bool,
}

impl Remains {
    fn of(world: &World) -> Self {
        let files = |folder| fs::read_dir(folder).into_iter().flatten().flatten();
        let is_unfinished = files(world.options.root.join("services")).any(|file| {
            let data = file.metadata();
            data.is_ok_and(|data| data.permissions().mode() & 0o777 != 0o400)
        });
        let prefix = format!("{}_", world.options.prefix);
        let is_unsized = files("/dev/shm".into()).any(|file| {
            let is_ours = file.file_name().to_string_lossy().starts_with(&prefix);
            is_ours && file.metadata().is_ok_and(|data| data.len() == 0)
        });
        Self {
            is_unfinished,
            is_unsized,
        }
    }
}

/// What became of one try: what its maker had made, how often the daemon ended by itself, how long it took, s, and what went wrong.
type Try = (Remains, usize, Result<f64, String>);

#[derive(Debug, Default)]
struct Tries {
    count: usize,
    unfinished: usize,
    unsized_memory: usize,
    longest_s: f64,
    /// Daemons that ended by themselves: nobody here ends one.
    ended: Vec<String>,
    wrong: Vec<String>,
}

impl Tries {
    /// Every `step`-th system call of each kind's making, until it is made.
    fn of(
        step: usize,
        attempt: impl Fn(&str, usize) -> anyhow::Result<Option<Try>> + Sync,
    ) -> anyhow::Result<Self> {
        let all = Mutex::new(Self::default());
        for kind in KINDS {
            let (next, end) = (AtomicUsize::new(1), AtomicUsize::new(usize::MAX));
            let work = || -> anyhow::Result<()> {
                loop {
                    let calls = next.fetch_add(step, Ordering::SeqCst);
                    if calls >= end.load(Ordering::SeqCst) {
                        return Ok(());
                    }
                    match attempt(kind, calls)? {
                        None => drop(end.fetch_min(calls, Ordering::SeqCst)),
                        Some(outcome) => all.lock().unwrap().count(kind, calls, outcome),
                    }
                }
            };
            thread::scope(|scope| {
                let workers = [(); AT_ONCE].map(|()| scope.spawn(work));
                workers
                    .into_iter()
                    .try_for_each(|worker| worker.join().unwrap())
            })?;
        }
        Ok(all.into_inner().unwrap())
    }

    fn count(&mut self, kind: &str, calls: usize, (remains, ended, outcome): Try) {
        self.count += 1;
        self.unfinished += usize::from(remains.is_unfinished);
        self.unsized_memory += usize::from(remains.is_unsized);
        if ended > 0 {
            let ended = format!("{kind}, after {calls} calls ({remains:?}): {ended} times");
            self.ended.push(ended);
        }
        match outcome {
            Ok(seconds) => self.longest_s = self.longest_s.max(seconds),
            Err(reason) => {
                let reason = format!("{kind}, after {calls} calls ({remains:?}): {reason}");
                self.wrong.push(reason);
            }
        }
    }

    fn premises(&self, report: &mut Report, what: &str) -> anyhow::Result<()> {
        let (description, memory) = (self.unfinished, self.unsized_memory);
        report.shown(
            &format!("instants of making a service at which its maker {what}"),
            format!(
                "{}; description unfinished: {description}, memory without a size: {memory}",
                self.count
            ),
        );
        anyhow::ensure!(
            description > 0 && memory > 0,
            "the premise: something is half-made"
        );
        Ok(())
    }
}

fn world() -> World {
    World::new(&Settings {
        without_weights: true,
        ..Settings::default()
    })
}

/// A maker that says it has its node, and is held after so many calls.
fn held(kind: &str, calls: usize) -> anyhow::Result<Option<Try>> {
    let world = prepared()?;
    let mut maker = PlainClient::start(&world, kind);
    maker.says("node", PATIENCE).map_err(anyhow::Error::msg)?;
    let Some(held) = maker.hold_making(calls)? else {
        return Ok(None);
    };
    let remains = Remains::of(&world);
    let (mut daemon, mut ended) = (Part::Daemon.start(&world), 0);
    thread::sleep(HELD);
    held.release()?;
    let begin = Instant::now();
    let outcome = maker
        .says("made", PATIENCE)
        .and_then(|()| plans(&world, (&mut daemon, &mut ended), begin))
        .map(|()| {
            if kind == "requests" {
                // Nobody answers it here; the maker hears it.
                let _ = pcc(&world, &["speed", "1"], PATIENCE);
            }
        })
        .and_then(|()| maker.says("heard", PATIENCE));
    Ok(Some((
        remains,
        ended,
        outcome.map(|()| begin.elapsed().as_secs_f64()),
    )))
}

/// The same, but it is killed there.
fn killed(kind: &str, calls: usize) -> anyhow::Result<Option<Try>> {
    let world = prepared()?;
    let mut maker = PlainClient::start(&world, kind);
    maker.says("node", PATIENCE).map_err(anyhow::Error::msg)?;
    let Some(held) = maker.hold_making(calls)? else {
        return Ok(None);
    };
    let remains = Remains::of(&world);
    maker.kill9();
    // It is gone, and so may be who held it.
    let _ = held.release();
    drop(maker);
    let begin = Instant::now();
    let (mut daemon, mut ended) = (Part::Daemon.start(&world), 0);
    let outcome = plans(&world, (&mut daemon, &mut ended), begin);
    Ok(Some((
        remains,
        ended,
        outcome.map(|()| begin.elapsed().as_secs_f64()),
    )))
}

/// A world in which the robot's processes have made the root folder and what clients in other languages take, and are gone again.
fn prepared() -> anyhow::Result<World> {
    let world = world();
    let said = pcc(&world, &["watch", "--times", "1"], PATIENCE);
    anyhow::ensure!(said.status.is_some(), "pcc watch: {}", said.summary());
    Ok(world)
}

/// Asks for plans until one comes; a daemon that could not start is counted and started again.
fn plans(
    world: &World,
    (daemon, ended): (&mut Process, &mut usize),
    begin: Instant,
) -> Result<(), String> {
    loop {
        if !daemon.is_running() {
            *ended += 1;
            *daemon = Part::Daemon.start(world);
        }
        let said = pcc(world, PLAN, PATIENCE);
        if said.is_good() {
            return Ok(());
        }
        if begin.elapsed() > PATIENCE {
            let log = daemon.log();
            let last = log.lines().last().unwrap_or_default();
            return Err(format!("{}; the daemon: {last}", said.summary()));
        }
        thread::sleep(Duration::from_millis(50));
    }
}
