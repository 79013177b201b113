//! Clients of every language that are killed while they ask: nothing of them remains, and the next request is served at once.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::Client;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::codes::Outcome;
use shared_types::ipc::{
    EventListener, IpcNode, event_listener, plan_answered_event, plan_asked_event,
};
use shared_types::valid::{Command, Goal, PlanRequest};
use tests::process::{Process, wait_for};
use tests::stack::{PATIENCE, Stack};
use tests::world::{Settings, World};

use super::examples::{Examples, TIP_M};
use crate::report::Report;
use crate::scale::Scale;

/// The next request is served within this.
const SERVED_WITHIN: Duration = Duration::from_secs(1);
/// What a killed client has left is gone within this: dead processes are looked for ten times a second.
const GONE_WITHIN: Duration = Duration::from_secs(5);
/// Dead processes were looked for several times then.
const CLEANED_AFTER: Duration = Duration::from_secs(1);
/// An example has started and sent its request within this.
const STARTED_WITHIN: Duration = Duration::from_secs(5);
/// Most kills of a stage for each one that must meet it: a client may be quicker than usual.
const TRIES: usize = 3;
/// Between two looks at the nodes.
const LOOK: Duration = Duration::from_micros(200);
/// Candidates of the next request.
const SERVED_CANDIDATES: usize = 10;
/// Clients that the daemon has places for: the one that is killed, or the next one.
const PLACES: i64 = 1;

/// What a client is at when it is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Stage {
    /// It joins the services.
    Joining,
    /// Its request is under way.
    Asking,
    /// Its answer has come.
    Answered,
    /// Its motion is under way, and it waits for the result.
    Waiting,
}

const STAGES: [Stage; 4] = [
    Stage::Joining,
    Stage::Asking,
    Stage::Answered,
    Stage::Waiting,
];

impl Stage {
    fn text(self) -> &'static str {
        match self {
            Self::Joining => "from its first file on and before its request was sent",
            Self::Asking => "between its request and the answer",
            Self::Answered => "right after its answer was sent",
            Self::Waiting => "while it waited for the result",
        }
    }
}

/// Kills the example `plan` of a language so often, in each stage in turn.
pub(super) fn run(examples: &Examples, report: &mut Report, scale: Scale) {
    let name = format!("{}: killed at every stage", examples.language);
    report.group(&name, examples.command, |report| {
        kill(examples, report, scale)
    });
}

/// The events of requests and answers.
struct Events {
    asked: EventListener,
    answered: EventListener,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Events {
    fn open(stack: &Stack) -> anyhow::Result<Self> {
        let node = IpcNode::create(&stack.world.options, "kills")?;
        Ok(Self {
            asked: event_listener(&node, &plan_asked_event(&node)?)?,
            answered: event_listener(&node, &plan_answered_event(&node)?)?,
            _node: node,
        })
    }

    /// Forgets what has come.
    fn forget(&self) -> anyhow::Result<()> {
        for events in [&self.asked, &self.answered] {
            while events.wait(None, Duration::ZERO)? {}
        }
        Ok(())
    }
}

/// What was seen of the kills.
#[derive(Default)]
struct Seen {
    /// Kills by stage, and those of them that met it.
    kills: BTreeMap<Stage, (usize, usize)>,
    /// What next requests were answered that have not the candidates that were wanted.
    unserved: Vec<String>,
    served_ms: Vec<f64>,
    /// Files that were not there before the kills and stayed after a clean-up.
    left: BTreeSet<PathBuf>,
}

fn kill(examples: &Examples, report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings {
        daemon: vec![("clients", PLACES.into())],
        ..Settings::default()
    })?;
    stack.disconnect_client();
    let events = Events::open(&stack)?;
    let mut random = Pcg64::seed_from_u64(21);
    // Builds what is missing, and makes what is made once.
    examples.plan(&stack.world)?;
    serve(&stack.world)?;
    let usual = Usual::measure(examples, &stack, &events)?;
    // Ports that stay are made with the first order; what the clients so far have left is removed.
    stack.controller.command(Command::Stop, PATIENCE)?;
    sleep(CLEANED_AFTER);
    let before = stack.world.shared_files();
    let bytes_before = stack.world.shared_memory_bytes();
    let mut seen = Seen::default();
    let wanted = scale.pick(3, 50);
    while let Some(stage) = seen.next_stage(wanted) {
        events.forget()?;
        let (kills, met) = seen.kills.entry(stage).or_default();
        // To and fro, so that there is a motion each time.
        let side = if kills.is_multiple_of(2) { 1.0 } else { -1.0 };
        let others = nodes(&stack.world);
        let mut client = start(examples, &stack, side)?;
        let watch = StageWatch {
            events: &events,
            world: &stack.world,
            others: &others,
        };
        watch
            .wait_until(stage, &usual, &mut random)
            .with_context(|| format!("{stage:?}: {}", client.log()))?;
        *kills += 1;
        *met += usize::from(kill_at(stage, &mut client, &events)?);
        let (unserved, took) = serve(&stack.world)?;
        seen.unserved
            .extend(unserved.map(|told| format!("{told} ({})", stage.text())));
        seen.served_ms.push(took.as_secs_f64() * 1e3);
        // What it has had begun is ended, so that the next one begins alike.
        stack.controller.command(Command::Stop, PATIENCE)?;
        stack.wait_until_held()?;
        seen.look_for_remains(&stack.world, &before);
    }
    seen.tell(examples, report, wanted);
    let figure = format!(
        "{} and {bytes_before} bytes",
        stack.world.shared_memory_bytes()
    );
    report.check(
        &examples.line("shared memory after all kills, and before"),
        figure,
        "no more than before",
        stack.world.shared_memory_bytes() <= bytes_before,
    );
    // All places are free again.
    let planned = examples.plan(&stack.world)?;
    examples.is_reached(report, "a motion after all kills", &planned);
    Ok(())
}

impl Seen {
    /// Of the stages that are not met so many times yet, nor missed too often, the one with the fewest kills.
    fn next_stage(&self, wanted: usize) -> Option<Stage> {
        let of = |stage: &Stage| self.kills.get(stage).copied().unwrap_or_default();
        let is_open = |stage: &Stage| {
            let (kills, met) = of(stage);
            met < wanted && kills < TRIES * wanted
        };
        let open = STAGES.into_iter().filter(is_open);
        open.min_by_key(|stage| of(stage).0)
    }

    /// Waits until nothing is there that was not there before, and notes what stays.
    fn look_for_remains(&mut self, world: &World, before: &BTreeSet<PathBuf>) {
        let known: BTreeSet<PathBuf> = before.union(&self.left).cloned().collect();
        let is_gone = wait_for("nothing remains", GONE_WITHIN, || {
            world.shared_files().is_subset(&known).then_some(())
        });
        if is_gone.is_err() {
            let now = world.shared_files();
            for left in now.difference(&known) {
                println!("  left behind: {}", left.display());
                self.left.insert(left.clone());
            }
        }
    }

    fn tell(&self, examples: &Examples, report: &mut Report, wanted: usize) {
        for (stage, (kills, met)) in &self.kills {
            let line = examples.line(&format!("kills that came {}", stage.text()));
            let bar = format!("{wanted}");
            report.check(&line, format!("{met} of {kills}"), &bar, *met == wanted);
        }
        let line = "next requests after a kill that have not their candidates";
        report.none_of(&examples.line(line), &self.unserved);
        let slowest_ms = self.served_ms.iter().copied().fold(0.0, f64::max);
        report.at_most(
            &examples.line("the next request after a kill, slowest, ms"),
            slowest_ms,
            SERVED_WITHIN.as_secs_f64() * 1e3,
        );
        let left: Vec<String> = self
            .left
            .iter()
            .map(|it| it.display().to_string())
            .collect();
        let line =
            "files and folders under the services' root and in /dev/shm that a kill left behind";
        report.none_of(&examples.line(line), &left);
    }
}

/// Kills a client; whether that met the stage.
fn kill_at(stage: Stage, client: &mut Process, events: &Events) -> anyhow::Result<bool> {
    let was_running = client.is_running();
    if was_running {
        client.signal(libc::SIGKILL);
    }
    // Looked at before the process is waited for, which takes as long as an answer.
    let is_met = match stage {
        Stage::Joining => !events.asked.wait(None, Duration::ZERO)?,
        Stage::Asking => !events.answered.wait(None, Duration::ZERO)?,
        Stage::Answered | Stage::Waiting => true,
    };
    client.kill9();
    Ok(was_running && is_met)
}

/// How long a client takes that nobody kills, s.
struct Usual {
    /// From when its node is there until its request is sent.
    joining_s: f64,
    /// From then until its answer is sent.
    asking_s: f64,
    /// From then until it has ended, with the result of its motion.
    waiting_s: f64,
}

impl Usual {
    /// The shorter times of two motions, to and fro.
    fn measure(examples: &Examples, stack: &Stack, events: &Events) -> anyhow::Result<Self> {
        let there = Self::of_a_motion(examples, stack, events, -1.0)?;
        let back = Self::of_a_motion(examples, stack, events, 1.0)?;
        Ok(Self {
            joining_s: there.joining_s.min(back.joining_s),
            asking_s: there.asking_s.min(back.asking_s),
            waiting_s: there.waiting_s.min(back.waiting_s),
        })
    }

    fn of_a_motion(
        examples: &Examples,
        stack: &Stack,
        events: &Events,
        side: f64,
    ) -> anyhow::Result<Self> {
        events.forget()?;
        let others = nodes(&stack.world);
        let mut client = start(examples, stack, side)?;
        wait_for_node(&stack.world, &others)?;
        let begun = Instant::now();
        heard(&events.asked).with_context(|| client.log())?;
        let joining_s = begun.elapsed().as_secs_f64();
        heard(&events.answered).with_context(|| client.log())?;
        let answered = Instant::now();
        client.wait(PATIENCE)?;
        Ok(Self {
            joining_s,
            asking_s: (answered - begun).as_secs_f64() - joining_s,
            waiting_s: answered.elapsed().as_secs_f64(),
        })
    }
}

/// Starts a client that asks for a motion to one side or the other.
fn start(examples: &Examples, stack: &Stack, side: f64) -> anyhow::Result<Process> {
    let tip = [TIP_M[0], side * TIP_M[1], TIP_M[2]].map(|axis| axis.to_string());
    examples.start(&stack.world, "plan", &tip.each_ref().map(String::as_str))
}

/// Waits until something was sent.
fn heard(events: &EventListener) -> anyhow::Result<()> {
    let begun = Instant::now();
    while !events.wait(None, STARTED_WITHIN)? {
        anyhow::ensure!(begun.elapsed() < STARTED_WITHIN, "nothing was sent");
    }
    Ok(())
}

/// Names of the nodes that are there or being made.
fn nodes(world: &World) -> BTreeSet<OsString> {
    let entries = fs::read_dir(world.options.root.join("nodes"));
    let entries = entries.into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name()).collect()
}

/// Waits until a node is made beside these others.
fn wait_for_node(world: &World, others: &BTreeSet<OsString>) -> anyhow::Result<()> {
    let begun = Instant::now();
    while nodes(world).is_subset(others) {
        anyhow::ensure!(begun.elapsed() < STARTED_WITHIN, "no node was made");
        sleep(LOOK);
    }
    Ok(())
}

/// How a client's stages are told from outside.
struct StageWatch<'a> {
    events: &'a Events,
    world: &'a World,
    /// The nodes before it was started.
    others: &'a BTreeSet<OsString>,
}

impl StageWatch<'_> {
    /// Waits until the client is at a stage, and a random moment longer.
    fn wait_until(&self, stage: Stage, usual: &Usual, random: &mut Pcg64) -> anyhow::Result<()> {
        let longest_s = match stage {
            Stage::Joining => {
                wait_for_node(self.world, self.others)?;
                usual.joining_s
            }
            Stage::Asking => {
                heard(&self.events.asked)?;
                usual.asking_s
            }
            Stage::Answered => {
                heard(&self.events.answered)?;
                0.5e-3
            }
            Stage::Waiting => {
                heard(&self.events.answered)?;
                usual.waiting_s
            }
        };
        sleep(Duration::from_secs_f64(random.random_range(0.0..longest_s)));
        Ok(())
    }
}

/// Joins as the next client, as soon as there is a place, and plans once; what it was answered where that has not given all candidates that
/// were wanted, and how long both took.
fn serve(world: &World) -> anyhow::Result<(Option<String>, Duration)> {
    let begun = Instant::now();
    let request = PlanRequest {
        candidate_count: SERVED_CANDIDATES,
        ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
    };
    let mut client = wait_for("a place", PATIENCE, || Client::connect(&world.options).ok())?;
    let unserved = match client.plan(&request, PATIENCE) {
        Ok(answer) => {
            let (report, count) = (answer.report(), answer.candidates().len());
            let is_whole = report.outcome == Outcome::Ok && count == SERVED_CANDIDATES;
            let told = || format!("{count} candidates, {}: {}", report.outcome, report.reason);
            (!is_whole).then(told)
        }
        Err(error) => Some(error.to_string()),
    };
    Ok((unserved, begun.elapsed()))
}
