//! Clients of every language that are killed while they ask: nothing of them remains, and the next request is served at once.

use std::collections::BTreeMap;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::ipc::{
    EventListener, IpcNode, event_listener, plan_answered_event, plan_asked_event,
};
use shared_types::valid::{Command, Goal, PlanRequest};
use tests::process::wait_for;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::examples::{Examples, TIP_M, wait_until_held};
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

/// What a client is at when it is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Stage {
    /// It starts, and joins the services.
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

fn kill(examples: &Examples, report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    let events = Events::open(&stack)?;
    let mut random = Pcg64::seed_from_u64(21);
    // Builds what is missing, and makes what is made once.
    examples.plan(&stack.world)?;
    serve(&mut stack)?;
    let joining_s = joins_within_s(examples, &stack, &events)?;
    // Ports that stay are made with the first order; what the clients so far have left is removed.
    stack.controller.command(Command::Stop, PATIENCE)?;
    sleep(CLEANED_AFTER);
    let bytes_before = stack.world.shared_memory_bytes();
    let mut served_ms = Vec::new();
    let mut kills = BTreeMap::<Stage, usize>::new();
    for index in 0..scale.pick(8, 200) {
        let stage = STAGES[index % STAGES.len()];
        events.forget()?;
        // To and fro, so that there is a motion each time.
        let side = if (index / STAGES.len()).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let tip = [TIP_M[0], side * TIP_M[1], TIP_M[2]].map(|axis| axis.to_string());
        let mut client =
            examples.start(&stack.world, "plan", &tip.each_ref().map(String::as_str))?;
        wait_for_stage(stage, &events, joining_s, &mut random)
            .with_context(|| format!("{stage:?}: {}", client.log()))?;
        client.kill9();
        *kills.entry(stage).or_default() += 1;
        served_ms.push(serve(&mut stack)?.as_secs_f64() * 1e3);
        // What it has had begun is ended, so that the next one begins alike.
        stack.controller.command(Command::Stop, PATIENCE)?;
        wait_until_held(&mut stack)?;
    }
    let line = |what: &str| format!("{}: {what}", examples.language);
    report.shown(&line("kills by stage"), format!("{kills:?}"));
    let slowest_ms = served_ms.iter().copied().fold(0.0, f64::max);
    let bar_ms = SERVED_WITHIN.as_secs_f64() * 1e3;
    report.at_most(
        &line("the next request after a kill, slowest, ms"),
        slowest_ms,
        bar_ms,
    );
    let gone = wait_for("nothing remains", GONE_WITHIN, || {
        (stack.world.shared_memory_bytes() <= bytes_before).then_some(())
    });
    let figure = format!(
        "{} and {bytes_before} bytes",
        stack.world.shared_memory_bytes()
    );
    report.check(
        &line("shared memory after all kills, and before"),
        figure,
        "no more than before",
        gone.is_ok(),
    );
    // All places are free again.
    let planned = examples.plan(&stack.world)?;
    examples.is_reached(report, "a motion after all kills", &planned);
    Ok(())
}

/// How long a client takes from its start until its request is sent, s.
fn joins_within_s(examples: &Examples, stack: &Stack, events: &Events) -> anyhow::Result<f64> {
    events.forget()?;
    let begun = Instant::now();
    let tip = TIP_M.map(|axis| axis.to_string());
    let mut client = examples.start(&stack.world, "plan", &tip.each_ref().map(String::as_str))?;
    anyhow::ensure!(
        events.asked.wait(None, STARTED_WITHIN)?,
        "nothing was sent: {}",
        client.log()
    );
    let joined_s = begun.elapsed().as_secs_f64();
    client.wait(PATIENCE)?;
    Ok(joined_s)
}

/// Waits until a client is at a stage, and a random moment longer.
fn wait_for_stage(
    stage: Stage,
    events: &Events,
    joining_s: f64,
    random: &mut Pcg64,
) -> anyhow::Result<()> {
    let heard = |events: &EventListener| {
        let begun = Instant::now();
        while !events.wait(None, STARTED_WITHIN)? {
            anyhow::ensure!(begun.elapsed() < STARTED_WITHIN, "nothing was sent");
        }
        anyhow::Ok(())
    };
    let longest_s = match stage {
        Stage::Joining => joining_s,
        Stage::Asking => {
            heard(&events.asked)?;
            1.5e-3
        }
        Stage::Answered => {
            heard(&events.answered)?;
            0.5e-3
        }
        Stage::Waiting => {
            heard(&events.answered)?;
            0.5
        }
    };
    sleep(Duration::from_secs_f64(random.random_range(0.0..longest_s)));
    Ok(())
}

/// Plans for another client; how long that took.
fn serve(stack: &mut Stack) -> anyhow::Result<Duration> {
    let begun = Instant::now();
    let request = PlanRequest {
        candidate_count: 2,
        ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
    };
    stack.client.plan(&request, PATIENCE)?;
    Ok(begun.elapsed())
}
