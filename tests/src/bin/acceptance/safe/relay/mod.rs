//! A controller whose output stalls or one of whose threads is held, many watchers, and replies that belong to another command.
//!
//! Orders are given by `pcc`, and the robot is judged by the file in which it keeps its pose: the checks join no service.

mod held;
mod replies;
mod watchers;

use std::time::Duration;

use anyhow::Context;
use tests::outside::{PoseFile, Said, execute, shown, wait_for_controller};
use tests::process::Process;
use tests::retries;
use tests::stack::Part;
use tests::world::{Settings, World};

use crate::{Report, Scale};

/// A configuration far from straight, rad: several seconds away for the shipped limits.
const FAR: [f64; 6] = [1.1, 0.4, -0.9, 0.7, 0.8, -1.0];
/// Long enough for everything that should happen at all.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long the robot has been moving when something happens to it.
const IN_MOTION: Duration = Duration::from_millis(500);

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, relay";
    report.group("relay: stalled output, held threads", command, |report| {
        held::run(report, scale)
    });
    report.group("relay: watchers", command, |report| {
        watchers::run(report, scale)
    });
    report.group("relay: replies", command, |report| {
        replies::run(report, scale)
    });
}

/// The three processes of a world, by [`Part`].
struct Processes {
    // Before the world, whose folder they work in.
    processes: [Process; 3],
    world: World,
}

impl Processes {
    /// Starts them, and waits until the controller holds.
    fn start(start: impl Fn(Part, &World) -> anyhow::Result<Process>) -> anyhow::Result<Self> {
        let world = World::new(&Settings::default());
        let processes = [
            start(Part::Daemon, &world)?,
            start(Part::Controller, &world)?,
            start(Part::Robot, &world)?,
        ];
        let started = Self { processes, world };
        wait_for_controller(&started.world, "holding", PATIENCE)?;
        Ok(started)
    }

    fn shipped() -> anyhow::Result<Self> {
        Self::start(|part, world| Ok(part.start(world)))
    }

    fn of(&mut self, part: Part) -> &mut Process {
        &mut self.processes[part as usize]
    }

    fn robot(&self) -> PoseFile {
        PoseFile::of(&self.world)
    }

    /// Has a motion executed, asked again (which counts as a retry) where that is refused, and waits until the robot moves.
    fn begin_motion(&self, goal: &[f64; 6]) -> anyhow::Result<()> {
        let mut said = Said {
            status: None,
            text: String::new(),
            took: Duration::ZERO,
        };
        for _ in 0..20 {
            said = execute(&self.world, goal, PATIENCE);
            if said.is_good() {
                let moves = self.robot().wait_for_motion(IN_MOTION, PATIENCE);
                return moves.with_context(|| shown(&self.world));
            }
            retries::note(&said.summary());
            std::thread::sleep(Duration::from_millis(250));
        }
        anyhow::bail!("no motion: {}", said.summary())
    }
}
