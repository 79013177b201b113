//! Records: requests asked again are answered the same, what is missing is noticed, and what a killed recorder wrote can be read.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::mem::offset_of;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, ensure};
use client::GoalSender;
use mcap::read::MessageStream;
use mcap::{Message, Writer};
use shared_types::codes::GoalState;
use shared_types::message::{Goal as WireGoal, PlanRecord, PlanReport, PlanRequest as WireRequest};
use shared_types::valid::{Goal, PlanRequest};
use tests::process::{Process, wait_for};
use tests::programs::repository;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::examples::TIP_M;
use crate::paper_python::environment;
use crate::report::Report;
use crate::scale::Scale;

/// Where the robot is kept on its way to, m.
const KEPT_TIP_M: [f64; 3] = [1.0, -0.6, 2.2];
/// How long a program may take to record or to replay.
const LIMIT: Duration = Duration::from_secs(600);
/// Plans that are recorded before the recorder is killed.
const KILLED: usize = 50;
/// Byte of a number whose lowest bit is some tenths of it: only a plan for another goal reaches that.
const TENTHS: usize = 6;
/// Time in which a recorder has written what came before.
const WRITTEN: Duration = Duration::from_millis(600);

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("records", "pcc record FILE; pcc replay FILE", |report| {
        records(report, scale)
    });
}

fn records(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    let whole = stack.world.folder().join("whole.mcap");
    let requests = scale.pick("1000", "10000");
    record(report, &mut stack, &whole, requests)?;
    replayed(report, &stack, &whole, requests.parse()?)?;
    dropped(report, &stack, &whole)?;
    changed(report, &stack, &whole)?;
    let killed = killed(report, &mut stack)?;
    // The motion's plan, and at least one to the goal that stays.
    let least = requests.parse::<usize>()? + 2;
    by_another_reader(report, "whole", &whole, least..=usize::MAX, true)?;
    by_another_reader(
        report,
        "of a killed recorder",
        &killed,
        KILLED..=KILLED,
        false,
    )
}

/// Plans of a file by the MCAP reader of another project; it may end early where its recorder was killed.
fn by_another_reader(
    report: &mut Report,
    name: &str,
    file: &Path,
    expected: RangeInclusive<usize>,
    is_whole: bool,
) -> anyhow::Result<()> {
    let least = expected.start();
    let counts = counted_by_another_reader(file, is_whole)?;
    let plans = counts.get("plan_record").copied().unwrap_or_default();
    let bar = match is_whole {
        true => format!(">= {least}, cycles, pictures, and the counts at the end"),
        false => format!("{least}, cycles and pictures"),
    };
    let has = |topic: &str| counts.contains_key(topic);
    report.check(
        &format!("records: a file {name}, as the MCAP reader of another project reads it: plans"),
        format!("{plans} of {counts:?}"),
        &bar,
        expected.contains(&plans)
            && has("/picture")
            && has("cycle")
            && has("/message_counts") == is_whole,
    );
    Ok(())
}

/// Records so many requests of another program, and a motion.
fn record(
    report: &mut Report,
    stack: &mut Stack,
    whole: &Path,
    requests: &str,
) -> anyhow::Result<()> {
    let mut recorder = start_recorder(stack, whole)?;
    let mut asking = Process::start(
        &stack.world,
        "pcc",
        &["latency", "--requests", requests, "--warm-up", "0"],
    );
    let status = asking.wait(LIMIT)?;
    ensure!(status.success(), "pcc latency: {}", asking.log());
    let moving = PlanRequest {
        candidate_count: 10,
        execute: true,
        ..PlanRequest::from_robot(Goal::tip(TIP_M))
    };
    let id = stack.try_motion(&moving)?;
    stack.wait_for_end(id)?;
    keep_on_the_way(stack)?;
    std::thread::sleep(WRITTEN);
    let status = recorder.sigterm(PATIENCE)?;
    report.check(
        "records: the recorder's end",
        format!("{status}: {}", last_line(&recorder.log())),
        "success",
        status.success(),
    );
    Ok(())
}

/// Keeps the robot on its way to a goal until it is there, and gives it up.
fn keep_on_the_way(stack: &Stack) -> anyhow::Result<()> {
    let mut sender = GoalSender::connect(&stack.world.options)?;
    sender.give(Goal::tip(KEPT_TIP_M), 1.0)?;
    let reached = sender.wait_for(PATIENCE, |status| status.state == GoalState::Reached)?;
    ensure!(reached.is_some(), "the kept goal: {:?}", sender.status()?);
    sender.withdraw()?;
    let ended = sender.wait_for(PATIENCE, |status| status.state == GoalState::Ended)?;
    ensure!(
        ended.is_some(),
        "the withdrawn goal: {:?}",
        sender.status()?
    );
    Ok(())
}

fn replayed(report: &mut Report, stack: &Stack, whole: &Path, all: usize) -> anyhow::Result<()> {
    let told = replay(stack, whole, &[])?;
    report.shown("records: replayed", told.text.replace('\n', "; "));
    let same = told.first_number();
    // The motion's plan and the first one to the goal that stays begin at the rest of the robot, which the record tells.
    report.check(
        "records: plans asked again that are the same, bit for bit",
        same.to_string(),
        &format!(">= {}", all + 2),
        told.succeeded && same >= all + 2,
    );
    let goal = told
        .text
        .lines()
        .find(|line| line.contains("goals that stay"));
    let goal = goal.unwrap_or_default().to_owned();
    let is_named = goal.starts_with("left out: 1 goals that stay, 0 times moved, 1 withdrawn");
    report.check(
        "records: the goal that stays, given and withdrawn",
        goal,
        "counted, and named as left out",
        is_named && told.text.contains("became: reached"),
    );
    let robot_file = stack.world.config("robots/unit.toml").display().to_string();
    let told = replay(stack, whole, &["--robot", &robot_file])?;
    report.check(
        "records: motions and set-points against the robot file",
        told.text.replace('\n', "; "),
        "they fit",
        told.succeeded,
    );
    Ok(())
}

/// A record without one of its messages is not replayed.
fn dropped(report: &mut Report, stack: &Stack, whole: &Path) -> anyhow::Result<()> {
    let dropped = stack.world.folder().join("dropped.mcap");
    let robot_file = stack.world.config("robots/unit.toml").display().to_string();
    let robot = ["--robot", &robot_file];
    let cases: [(Place, &str, &[&str]); 5] = [
        (Place::First, "plan_record", &[]),
        (Place::Middle, "plan_record", &[]),
        (Place::Last, "plan_record", &[]),
        (Place::Middle, "cycle", &robot),
        (Place::Last, "trajectory", &robot),
    ];
    for (place, topic, arguments) in cases {
        without_one(whole, &dropped, topic, place)?;
        let told = replay(stack, &dropped, arguments)?;
        let told_of = told.text.contains("missing") && told.text.contains(topic);
        report.check(
            &format!("records: a record without the {place:?} message of {topic}"),
            last_line(&told.text),
            "refused, the topic named",
            !told.succeeded && told_of,
        );
    }
    Ok(())
}

/// A record one of whose plans was answered otherwise, or asked for otherwise, is told to differ.
fn changed(report: &mut Report, stack: &Stack, whole: &Path) -> anyhow::Result<()> {
    let changed = stack.world.folder().join("changed.mcap");
    let of_report = offset_of!(PlanRecord, report) + offset_of!(PlanReport, plan_hash);
    let of_request = offset_of!(PlanRecord, request)
        + offset_of!(WireRequest, goals)
        + offset_of!(WireGoal, tip_m)
        + TENTHS;
    for (what, byte) in [
        ("answer's plan_hash", of_report),
        ("request's goal", of_request),
    ] {
        with_one_changed(whole, &changed, byte)?;
        let told = replay(stack, &changed, &[])?;
        report.check(
            &format!("records: a record with a bit of one {what} changed"),
            last_line(&told.text),
            "1 plan told to differ",
            !told.succeeded && told.text.contains("plans differ"),
        );
    }
    Ok(())
}

/// The file of a recorder that is killed is replayed; its path.
fn killed(report: &mut Report, stack: &mut Stack) -> anyhow::Result<PathBuf> {
    let killed = stack.world.folder().join("killed.mcap");
    let mut recorder = start_recorder(stack, &killed)?;
    let request = PlanRequest {
        candidate_count: 10,
        ignores_live_scene: true,
        ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
    };
    for _ in 0..KILLED {
        stack.client.plan(&request, PATIENCE)?;
    }
    std::thread::sleep(WRITTEN);
    recorder.kill9();
    let told = replay(stack, &killed, &[])?;
    report.check(
        "records: plans of a recorder that was killed",
        told.text.replace('\n', "; "),
        &format!("{KILLED} the same"),
        told.succeeded && told.first_number() == KILLED,
    );
    Ok(killed)
}

fn start_recorder(stack: &Stack, file: &Path) -> anyhow::Result<Process> {
    let name = file.display().to_string();
    let recorder = Process::start(&stack.world, "pcc", &["record", &name]);
    wait_for("a recorder that records", PATIENCE, || {
        recorder.log().contains("recording into").then_some(())
    })?;
    Ok(recorder)
}

/// What `pcc replay` said.
struct Told {
    text: String,
    succeeded: bool,
}

impl Told {
    fn first_number(&self) -> usize {
        let mut numbers = self
            .text
            .lines()
            .filter_map(|line| line.split(' ').next()?.parse().ok());
        numbers.next().unwrap_or(0)
    }
}

fn replay(stack: &Stack, file: &Path, arguments: &[&str]) -> anyhow::Result<Told> {
    let name = file.display().to_string();
    let all = [&["replay", &name], arguments].concat();
    let mut process = Process::start(&stack.world, "pcc", &all);
    let succeeded = process.wait(LIMIT)?.success();
    Ok(Told {
        text: process.log().trim().to_owned(),
        succeeded,
    })
}

fn last_line(text: &str) -> String {
    text.lines().last().unwrap_or_default().to_owned()
}

/// Which of a topic's messages.
#[derive(Clone, Copy, Debug)]
enum Place {
    First,
    Middle,
    Last,
}

/// A copy of a file without one message of a topic.
fn without_one(from: &Path, to: &Path, topic: &str, place: Place) -> anyhow::Result<()> {
    let bytes = fs::read(from)?;
    let mut messages = messages(&bytes)?;
    messages.remove(index_of(&messages, topic, place)?);
    write(to, &messages)
}

/// A copy of a file with the lowest bit of this byte of its middle plan record changed.
fn with_one_changed(from: &Path, to: &Path, byte: usize) -> anyhow::Result<()> {
    let bytes = fs::read(from)?;
    let mut messages = messages(&bytes)?;
    let changed = index_of(&messages, "plan_record", Place::Middle)?;
    messages[changed].data.to_mut()[byte] ^= 1;
    write(to, &messages)
}

fn messages(bytes: &[u8]) -> anyhow::Result<Vec<Message<'_>>> {
    Ok(MessageStream::new(bytes)?.collect::<Result<_, _>>()?)
}

fn index_of(messages: &[Message<'_>], topic: &str, place: Place) -> anyhow::Result<usize> {
    let of_topic: Vec<usize> = (0..messages.len())
        .filter(|&index| messages[index].channel.topic == topic)
        .collect();
    let index = match place {
        Place::First => of_topic.first(),
        Place::Middle => of_topic.get(of_topic.len() / 2),
        Place::Last => of_topic.last(),
    };
    let index = index.with_context(|| format!("no {topic} was recorded"))?;
    Ok(*index)
}

fn write(to: &Path, messages: &[Message<'_>]) -> anyhow::Result<()> {
    let mut writer = Writer::new(BufWriter::new(File::create(to)?))?;
    for message in messages {
        writer.write(message)?;
    }
    writer.finish()?;
    Ok(())
}

/// Messages by topic, as the reader of the package `mcap` of PyPI has them; a file that is not whole may end early.
fn counted_by_another_reader(
    file: &Path,
    is_whole: bool,
) -> anyhow::Result<BTreeMap<String, usize>> {
    let python: PathBuf = environment("venv-mcap", "mcap", |pip| {
        pip.args(["mcap>=1.2,<2"]);
    })?;
    let script = repository().join("tests/src/bin/acceptance/join/count_messages.py");
    let mut counting = Command::new(python);
    counting.arg(script).arg(file);
    if !is_whole {
        counting.arg("--may-end-early");
    }
    let done = counting.output()?;
    ensure!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let text = String::from_utf8(done.stdout)?;
    let of_line = |line: &str| {
        let (topic, count) = line.split_once(' ')?;
        Some((topic.to_owned(), count.parse().ok()?))
    };
    let counts = text.lines().map(of_line).collect::<Option<_>>();
    counts.with_context(|| text.clone())
}
