//! The three processes of a world, to which something happens while the robot moves.

use std::time::Duration;

use anyhow::Context;
use tests::outside::{PoseFile, Said, execute, shown, wait_for_controller};
use tests::process::Process;
use tests::retries;
use tests::stack::Part;
use tests::world::{Settings, World};

/// A configuration far from straight, rad: several seconds away for the shipped limits.
pub(super) const FAR: [f64; 6] = [1.1, 0.4, -0.9, 0.7, 0.8, -1.0];
/// Long enough for everything that should happen at all.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);
/// How long the robot has been moving when something happens to it.
pub(super) const IN_MOTION: Duration = Duration::from_millis(500);

/// The three processes of a world, by [`Part`].
pub(super) struct Processes {
    // Before the world, whose folder they work in.
    pub(super) processes: [Process; 3],
    pub(super) world: World,
}

impl Processes {
    /// Starts them, and waits until the controller holds.
    pub(super) fn start(
        start: impl Fn(Part, &World) -> anyhow::Result<Process>,
    ) -> anyhow::Result<Self> {
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

    pub(super) fn shipped() -> anyhow::Result<Self> {
        Self::start(|part, world| Ok(part.start(world)))
    }

    pub(super) fn of(&mut self, part: Part) -> &mut Process {
        &mut self.processes[part as usize]
    }

    pub(super) fn robot(&self) -> PoseFile {
        PoseFile::of(&self.world)
    }

    /// Has a motion executed, asked again (which counts as a retry) where that is refused, and waits until the robot moves.
    pub(super) fn begin_motion(&self, goal: &[f64; 6]) -> anyhow::Result<()> {
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
