//! Records: requests asked again are answered the same, what is missing is noticed, and what a killed recorder wrote can be read.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::BufWriter;
use std::mem::offset_of;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use client::{GoalSender, ScenePublisher};
use mcap::read::MessageStream;
use mcap::{Message, Writer};
use rand::RngExt;
use shared_types::codes::{GoalState, Outcome};
use shared_types::message::{
    Goal as WireGoal, MovingBall, PlanRecord, PlanReport, PlanRequest as WireRequest,
};
use shared_types::valid::{Goal, PlanRequest};
use tests::geometry::seeded;
use tests::mixed_requests::mixed_requests;
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
/// What is seen, beside the robot.
const SEEN: MovingBall = MovingBall {
    centre_m: [-1.2, 0.9, 1.0],
    radius_m: 0.1,
    velocity_m_s: [0.0; 3],
};
/// The topics that a record has, but for the counts (docs/records.md).
const TOPICS: [&str; 12] = [
    "/picture",
    "controller_state",
    "cycle",
    "goal",
    "goal_status",
    "motion_result",
    "plan_record",
    "robot_description",
    "robot_state",
    "scene",
    "scene_status",
    "trajectory",
];
/// How long a program may take to record or to replay.
const LIMIT: Duration = Duration::from_secs(600);
/// One request in so many is of `mixed_requests`; all others are of `pcc latency`.
const ONE_MIXED_IN: usize = 10;
/// How long a recorder records before it is killed.
const KILLED_AFTER: Range<Duration> = Duration::from_millis(700)..Duration::from_millis(1_700);
/// Seed of when it is killed.
const SEED: u64 = 9_411;
/// Byte of a number whose lowest bit is some tenths of it: only a plan for another goal reaches that.
const TENTHS: usize = 6;
/// Topic of the last message, which tells how many there are of each.
const COUNTS: &str = "/message_counts";
/// What a recorder is told is in its file within this (docs/records.md).
const PROMISED: Duration = Duration::from_millis(250);
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
    let requests = scale.pick(1_000, 10_000);
    record(report, &mut stack, &whole, requests)?;
    replayed(report, &stack, &whole, requests)?;
    dropped(report, &stack, &whole)?;
    changed(report, &stack, &whole)?;
    killed(report, &mut stack, scale.pick(2, 20))?;
    // The motion's plan, and at least one to the goal that stays.
    by_another_reader(report, "whole", &whole, requests + 2..=usize::MAX, true)
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
        expected.contains(&plans) && has("/picture") && has("cycle") && has(COUNTS) == is_whole,
    );
    Ok(())
}

/// Records so many requests, most of another program, and a motion.
fn record(
    report: &mut Report,
    stack: &mut Stack,
    whole: &Path,
    requests: usize,
) -> anyhow::Result<()> {
    let mut recorder = start_recorder(stack, whole)?;
    let mixed = requests / ONE_MIXED_IN;
    let others = (requests - mixed).to_string();
    let mut asking = Process::start(
        &stack.world,
        "pcc",
        &["latency", "--requests", &others, "--warm-up", "0"],
    );
    let status = asking.wait(LIMIT)?;
    ensure!(status.success(), "pcc latency: {}", asking.log());
    plan_in_a_live_scene(stack)?;
    let mut outcomes = BTreeMap::<String, usize>::new();
    for request in mixed_requests(&stack.world.unit_robot(), mixed) {
        let request = PlanRequest {
            ignores_live_scene: true,
            ..request
        };
        let outcome = stack.client.plan(&request, PATIENCE)?.report().outcome;
        *outcomes.entry(outcome.to_string()).or_default() += 1;
    }
    report.shown(
        "records: outcomes of the requests in scenes, in motion, to tips and configurations, by all rules of selection",
        format!("{outcomes:?}, beside {others} of `pcc latency`"),
    );
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

/// Plans past what a camera sees until it takes its leave: that plan depends on more than its request.
fn plan_in_a_live_scene(stack: &mut Stack) -> anyhow::Result<()> {
    let mut scenes = ScenePublisher::connect(&stack.world.options, "camera")?;
    scenes.publish(&[SEEN], PATIENCE)?;
    scenes.confirm(PATIENCE)?;
    let request = PlanRequest::new([0.0; 6], Goal::tip(TIP_M));
    let outcome = stack.client.plan(&request, PATIENCE)?.report().outcome;
    ensure!(outcome == Outcome::Ok, "in the live scene: {outcome}");
    scenes.take_leave()?;
    scenes.confirm(PATIENCE)?;
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
    let again = stack.world.folder().join("again.mcap");
    let mut recorder = start_recorder(stack, &again)?;
    let told = replay(stack, whole, &[])?;
    std::thread::sleep(WRITTEN);
    recorder.sigterm(PATIENCE)?;
    report.shown("records: replayed", told.text.replace('\n', "; "));
    // The motion's plan and the first one to the goal that stays begin at the rest of the robot, which the record tells.
    let least = all + 2;
    by_their_hashes(report, whole, &again, least)?;
    let same = told.first_number();
    report.check(
        "records: plans asked again that are the same, bit for bit",
        same.to_string(),
        &format!(">= {least}"),
        told.succeeded && same >= least,
    );
    report.check(
        "records: the plan in a live scene",
        told.text.replace('\n', "; "),
        "1 left out: the live scene",
        told.text
            .lines()
            .any(|it| it == "1 left out: the live scene"),
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

/// The hashes of the plans asked again, as another record has them: those of the first record in their order, but for what was left out.
fn by_their_hashes(
    report: &mut Report,
    whole: &Path,
    again: &Path,
    least: usize,
) -> anyhow::Result<()> {
    let [first, again] = [plan_hashes(whole)?, plan_hashes(again)?];
    let mut before = first.iter();
    let is_next = |hash: &&u64| before.any(|other| other == *hash);
    let same = again.iter().take_while(is_next).count();
    report.check(
        "records: plans asked again whose plan_hash in a record of the replay is the first record's",
        format!("{same} of {}, of {} of the first", again.len(), first.len()),
        &format!("all, >= {least}"),
        same == again.len() && same >= least,
    );
    Ok(())
}

/// The `plan_hash` of each plan that is recorded.
fn plan_hashes(file: &Path) -> anyhow::Result<Vec<u64>> {
    let bytes = fs::read(file)?;
    let at = offset_of!(PlanRecord, report) + offset_of!(PlanReport, plan_hash);
    let of = |message: &Message<'_>| {
        let hash = message.data.get(at..at + 8).context("a short record")?;
        Ok(u64::from_le_bytes(hash.try_into()?))
    };
    let messages = messages(&bytes)?;
    let plans = messages
        .iter()
        .filter(|message| message.channel.topic == "plan_record");
    plans.map(of).collect()
}

/// A record without one of its messages is not replayed.
fn dropped(report: &mut Report, stack: &Stack, whole: &Path) -> anyhow::Result<()> {
    let dropped = stack.world.folder().join("dropped.mcap");
    let robot_file = stack.world.config("robots/unit.toml").display().to_string();
    let robot = ["--robot", &robot_file];
    let mut cases: Vec<(Place, String, &[&str])> = vec![
        (Place::First, "plan_record".to_owned(), &[]),
        (Place::Last, "plan_record".to_owned(), &[]),
        (Place::Middle, "cycle".to_owned(), &robot),
        (Place::Last, "trajectory".to_owned(), &robot),
    ];
    let recorded = topics(whole)?;
    let recorded: Vec<&str> = recorded.iter().map(String::as_str).collect();
    report.check(
        "records: topics that are recorded",
        recorded.join(", "),
        &TOPICS.join(", "),
        recorded == TOPICS,
    );
    let none: &[&str] = &[];
    cases.extend(TOPICS.map(|topic| (Place::Middle, topic.to_owned(), none)));
    for (place, topic, arguments) in &cases {
        let (place, topic) = (*place, topic.as_str());
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
            "1 plans differ",
            !told.succeeded && last_line(&told.text).ends_with("1 plans differ"),
        );
    }
    Ok(())
}

/// The file of a recorder that is killed while it records has what was answered before it wrote last, is read by another project and replayed.
fn killed(report: &mut Report, stack: &mut Stack, times: usize) -> anyhow::Result<()> {
    let mut random = seeded(SEED);
    for time in 0..times {
        let killed = stack.world.folder().join(format!("killed-{time}.mcap"));
        let mut recorder = start_recorder(stack, &killed)?;
        let lasts = random.random_range(KILLED_AFTER);
        let request = PlanRequest {
            candidate_count: 10,
            ignores_live_scene: true,
            ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
        };
        stack.client.plan(&request, PATIENCE)?;
        let (begun, mut answered) = (Instant::now(), Vec::new());
        while begun.elapsed() < lasts {
            stack.client.plan(&request, PATIENCE)?;
            answered.push(begun.elapsed());
        }
        recorder.kill9();
        let written = answered.partition_point(|at| *at + PROMISED < lasts);
        let told = replay(stack, &killed, &[])?;
        // The one that was asked before the clock began, too.
        let expected = written + 1..=answered.len() + 1;
        report.check(
            "records: plans of a recorder that was killed under load, asked again",
            told.text.replace('\n', "; "),
            &format!("{expected:?} the same"),
            told.succeeded && written > 0 && expected.contains(&told.first_number()),
        );
        by_another_reader(report, "of a killed recorder", &killed, expected, false)?;
    }
    Ok(())
}

/// The topics of a file but for its last message.
fn topics(file: &Path) -> anyhow::Result<BTreeSet<String>> {
    let bytes = fs::read(file)?;
    let topics = messages(&bytes)?.into_iter();
    let topics = topics.map(|message| message.channel.topic.clone());
    Ok(topics.filter(|topic| topic != COUNTS).collect())
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
    let script = repository().join("tests/acceptance/src/join/count_messages.py");
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
