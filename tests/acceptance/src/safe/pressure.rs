//! Whether a stop is obeyed in time while everything that could delay it happens: outputs that nobody reads, a full disk, a
//! stopped terminal, watchers, a flood of scenes.
//!
//! A time begins just before the command, or the scene, is sent, and ends with the stamp of the first cycle in which the loop, which
//! executed until then, brakes. The command is sent by the program `pcc stop`, which says when, and by a program that has joined the
//! services before.

use std::fs::{self, File};
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::{ControllerView, ScenePublisher};
use pcc_model::Configuration;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, Sampler};
use shared_types::message::{Cycle, MovingBall};
use shared_types::valid::{Command, Goal, PlanRequest};
use tests::listener::Listener;
use tests::outside::pcc;
use tests::process::{Process, wait_for};
use tests::raw_scene::Flood;
use tests::stack::{Part, Stack};
use tests::stalled_output::{SmallDisk, StalledOutput};
use tests::world::{Settings, World};

use crate::report::Report;
use crate::scale::Scale;
use crate::spread::Spread;
use crate::stolen::StolenTimes;

/// Ends of the motions, rad.
const ENDS: [[f64; 6]; 2] = [[0.0; 6], [1.1, 0.4, -0.9, 0.7, 0.8, -1.0]];
const WATCHERS: usize = 10;
const FLOODING: usize = 3;
/// Scenes a second that each of them sends at least.
const FLOOD_HZ: f64 = 100.0;
/// Bytes of the disk that is filled, on which the services' files, the robot's pose and the logs are.
const DISK_BYTES: usize = 4 << 20;
/// How long a motion has been under way when it is to be stopped; it takes longer than a second.
const IN_MOTION_S: f64 = 0.15;
/// How long a stop is waited for at all.
const LIMIT: Duration = Duration::from_secs(5);
const LIFETIME: Duration = Duration::from_secs(30);
/// Motions that do not begin before a group of tries has failed.
const MOTIONS_ASKED_FOR: usize = 5;
/// Of 100 tries, so many within the first bar.
const OFTEN: f64 = 0.95;

/// What the robot is under.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pressure {
    Pipe,
    Disk,
    Terminal,
    Watchers,
    Flood,
    All,
}

impl Pressure {
    const EACH: [Self; 6] = [
        Self::Pipe,
        Self::Disk,
        Self::Terminal,
        Self::Watchers,
        Self::Flood,
        Self::All,
    ];

    fn text(self) -> &'static str {
        match self {
            Self::Pipe => "stderr that nobody reads",
            Self::Disk => "full disk",
            Self::Terminal => "stopped terminal",
            Self::Watchers => "10 watchers",
            Self::Flood => "3 flooding publishers",
            Self::All => "all together",
        }
    }

    fn has(self, other: Self) -> bool {
        self == other || self == Self::All
    }
}

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, pressure";
    for with_priorities in [false, true] {
        for pressure in Pressure::EACH {
            let how = if with_priorities {
                "with priorities"
            } else {
                "as shipped"
            };
            let name = format!("pressure: {}, {how}", pressure.text());
            report.group(&name, command, |report| {
                let tried = Tried::of(pressure, with_priorities, scale)?;
                tried.report(report, &name, with_priorities);
                Ok(())
            });
        }
    }
}

/// From the order to the first cycle that brakes.
struct Try {
    ms: f64,
    stolen_ms: f64,
}

/// An order that was obeyed, or why it was not.
type Outcome = Result<Try, String>;

/// All tries under one pressure.
struct Tried {
    /// `pcc stop`.
    program: Vec<Outcome>,
    /// Of a client that has joined the services before.
    stops: Vec<Outcome>,
    /// Of the daemon, after a ball on the body was published.
    scenes: Vec<Outcome>,
    /// Motions that were not begun when they were asked for, which is no try.
    not_begun: Vec<String>,
}

impl Tried {
    fn of(pressure: Pressure, with_priorities: bool, scale: Scale) -> anyhow::Result<Self> {
        let mut scenario = Scenario::start(pressure, with_priorities)?;
        scenario.begin_stall()?;
        let (mut program, mut stops, mut scenes) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..scale.pick(5, 100) {
            program.push(scenario.order(Scenario::run_pcc_stop)?);
            stops.push(scenario.order(Scenario::send_stop)?);
            scenes.push(scenario.order(Scenario::show_ball)?);
            scenario.still_stalls()?;
        }
        Ok(Self {
            program,
            stops,
            scenes,
            not_begun: scenario.not_begun,
        })
    }

    fn report(&self, report: &mut Report, about: &str, with_priorities: bool) {
        let orders = [
            ("`pcc stop` obeyed after it was sent", &self.program),
            (
                "another client's stop obeyed after it was sent",
                &self.stops,
            ),
            (
                "the daemon's stop obeyed after the scene was sent",
                &self.scenes,
            ),
        ];
        for (what, tries) in orders {
            let failed: Vec<String> = tries
                .iter()
                .filter_map(|t| t.as_ref().err().cloned())
                .collect();
            let name = format!("{about}: {what}");
            report.none_of(&format!("{name}: never"), &failed);
            let obeyed: Vec<&Try> = tries.iter().flatten().collect();
            let ms: Vec<f64> = obeyed.iter().map(|obeyed| obeyed.ms).collect();
            report.shown(&format!("{name}, ms"), Spread::of(&ms).to_string());
            let (often_ms, always_ms) = if with_priorities {
                (10.0, 10.0)
            } else {
                (20.0, 100.0)
            };
            let in_time = ms.iter().filter(|ms| **ms <= often_ms).count();
            let share = in_time as f64 / tries.len() as f64;
            if !with_priorities {
                let figure = format!("{in_time} of {}", tries.len());
                let bar = "95 of 100";
                report.check(
                    &format!("{name}: <= {often_ms} ms"),
                    figure,
                    bar,
                    share >= OFTEN,
                );
            }
            let kept = |t: &&&Try| t.ms <= always_ms + t.stolen_ms;
            let name = format!("{name}: <= {always_ms} ms plus stolen time");
            report.all_of(&name, obeyed.iter().filter(kept).count(), tries.len());
        }
        let name = format!("{about}: motions not begun when they were asked for");
        report.none_of(&name, &self.not_begun);
    }
}

/// A small disk in the place of a world's root folder.
fn disk(world: &World) -> anyhow::Result<SmallDisk> {
    let root = &world.options.root;
    fs::create_dir(root)?;
    SmallDisk::mount(root, DISK_BYTES).context("a full disk needs the right to mount one")
}

/// The robot under pressure. Dropped in this order.
struct Scenario {
    flood: Option<Flood>,
    watchers: Vec<Process>,
    scenes: ScenePublisher,
    command: ControllerView,
    stolen: StolenTimes,
    listener: Listener,
    disk: Option<SmallDisk>,
    stack: Stack,
    outputs: Vec<StalledOutput>,
    not_begun: Vec<String>,
    /// Scenes that each publisher of the flood had sent when that was looked at last, and when that was.
    flooded: (Vec<u64>, Instant),
}

impl Scenario {
    fn start(pressure: Pressure, with_priorities: bool) -> anyhow::Result<Self> {
        let mut settings = Settings {
            without_priorities: !with_priorities,
            ..Settings::default()
        };
        if with_priorities {
            settings.daemon.push((tests::world::PRIORITY, 10.into()));
        }
        let mut outputs = Vec::new();
        if pressure.has(Pressure::Terminal) {
            outputs.push(StalledOutput::terminal()?);
        }
        if pressure.has(Pressure::Pipe) {
            outputs.push(StalledOutput::pipe()?);
        }
        let world = World::new(&settings);
        let disk = pressure.has(Pressure::Disk).then(|| disk(&world));
        let disk = disk.transpose()?;
        let mut stack = Stack::within(world);
        for (index, part) in Part::ALL.into_iter().enumerate() {
            let log = stack
                .world
                .options
                .root
                .join(format!("{}.log", part.program()));
            // Where there are several, each process has another one.
            let mut errors: Vec<Stdio> = disk
                .iter()
                .map(|_| File::create(&log))
                .map(|log| log.map(Into::into))
                .collect::<Result<_, _>>()?;
            for output in &outputs {
                errors.push(output.stdio()?);
            }
            match errors.len() {
                0 => stack.start(part),
                count => stack.start_onto(part, errors.swap_remove(index % count)),
            }
        }
        stack.wait_until_ready()?;
        let options = stack.world.options.clone();
        let watchers = if pressure.has(Pressure::Watchers) {
            WATCHERS
        } else {
            0
        };
        let watch = |_| Process::start(&stack.world, "pcc", &["watch", "--rate-hz", "20"]);
        let watchers = (0..watchers).map(watch).collect();
        let mut command = ControllerView::connect(&options)?;
        command.prepare_to_command()?;
        // iceoryx2 hears who came first first: the camera comes last.
        let flood = pressure.has(Pressure::Flood);
        let flooding_since = Instant::now();
        let flood = flood.then(|| Flood::start(&options, FLOODING));
        if flood.is_some() {
            thread::sleep(Duration::from_secs(1));
        }
        let mut scenario = Self {
            flood,
            watchers,
            scenes: ScenePublisher::connect(&options, "camera")?,
            command,
            stolen: StolenTimes::watch()?,
            listener: Listener::start(&options),
            disk,
            stack,
            outputs,
            not_begun: Vec::new(),
            flooded: (vec![0; FLOODING], flooding_since),
        };
        scenario.scenes.publish(&[], LIFETIME)?;
        thread::sleep(Duration::from_secs(2));
        Ok(scenario)
    }

    fn begin_stall(&mut self) -> anyhow::Result<()> {
        for output in &mut self.outputs {
            output.stall()?;
        }
        if let Some(disk) = &self.disk {
            disk.fill()?;
        }
        self.still_stalls()
    }

    fn still_stalls(&mut self) -> anyhow::Result<()> {
        for output in &self.outputs {
            anyhow::ensure!(output.is_stalled()?, "the premise: a write would wait");
        }
        let full = self.disk.as_ref().is_none_or(SmallDisk::is_full);
        anyhow::ensure!(full, "the premise: the disk is full");
        let running = self.watchers.iter_mut().all(Process::is_running);
        anyhow::ensure!(running, "the premise: the watchers watch");
        if let Some(flood) = &self.flood {
            let sent = flood.sent_each();
            let (last, since) = (&self.flooded.0, self.flooded.1.elapsed());
            let least = FLOOD_HZ * since.as_secs_f64();
            let floods = |(now, last): (&u64, &u64)| (now - last) as f64 >= least;
            anyhow::ensure!(
                flood.alive() == FLOODING && sent.iter().zip(last).all(floods),
                "the premise: {FLOODING} publishers send {FLOOD_HZ} scenes a second each: {sent:?} after {last:?} {since:?} ago"
            );
            self.flooded = (sent, Instant::now());
        }
        Ok(())
    }

    /// A motion to the end that the robot is farther from, until it is under way.
    fn begin_motion(&mut self) -> anyhow::Result<u32> {
        for _ in 0..MOTIONS_ASKED_FOR {
            self.stack.wait_until_ready()?;
            match self.try_motion() {
                Ok(id) => return Ok(id),
                Err(why) => self.not_begun.push(why.to_string()),
            }
        }
        anyhow::bail!("no motion begins: {}", self.not_begun.join("; "))
    }

    fn try_motion(&mut self) -> anyhow::Result<u32> {
        self.scenes.confirm(LIMIT)?;
        let start = self.stack.commanded();
        let distance = |end: &[f64; 6]| (Configuration::from(*end) - start).norm();
        let farther = usize::from(distance(&ENDS[1]) > distance(&ENDS[0]));
        let request = PlanRequest {
            sampler: Sampler::Straight,
            candidate_count: 1,
            deadline: Some(Duration::from_secs(10)),
            execute: true,
            ..PlanRequest::new(start.into(), Goal::Configuration(ENDS[farther]))
        };
        let id = self.stack.try_motion(&request)?;
        let view = &mut self.stack.controller;
        let under_way = wait_for("the motion is under way", LIMIT, || {
            let state = view.latest_state().ok().flatten()?;
            let on_it = state.values.trajectory_id == id
                && state.values.trajectory_time_s >= IN_MOTION_S
                && state.state == LoopState::Executing;
            (on_it || state.values.refused_trajectory_id == id).then_some((on_it, state.refusal))
        });
        match under_way {
            Ok((true, _)) => Ok(id),
            Ok((false, refusal)) => anyhow::bail!("the controller refuses: {refusal}"),
            Err(error) => anyhow::bail!("{error}: {}", self.what_the_loop_does(id)),
        }
    }

    /// What the controller says, and where the cycles that were heard lie farthest apart.
    fn what_the_loop_does(&mut self, id: u32) -> String {
        let gap = self.listener.with(|heard| {
            let pairs = heard.cycles.iter().zip(heard.cycles.iter().skip(1));
            pairs
                .map(|(a, b)| (b.stamp_mono_ns - a.stamp_mono_ns, a.state, b.state))
                .max()
        });
        let now = mono_now_ns();
        let stolen = self.stolen.between(Instant::now() - LIMIT, Instant::now());
        match self.stack.controller.latest_state() {
            Ok(Some(s)) => format!(
                "{}, fault {}, waiting {}, refusal {} of {}, trajectory {} at {:.3} s of {id}, rate {:.2}, speed {:.2}, state {:.1} ms old, late run {}, longest gap (ns, codes) {gap:?}, stolen {:.1} ms",
                s.state,
                s.fault,
                s.waiting,
                s.refusal,
                s.values.refused_trajectory_id,
                s.values.trajectory_id,
                s.values.trajectory_time_s,
                s.values.rate,
                s.values.speed,
                (now - s.values.stamp_mono_ns) as f64 * 1e-6,
                s.values.longest_late_run,
                stolen.as_secs_f64() * 1e3,
            ),
            other => format!("{other:?}"),
        }
    }

    /// From a motion under way to the braking that an order brings about; the order says when it was sent.
    fn order(
        &mut self,
        give: impl FnOnce(&mut Self) -> anyhow::Result<i64>,
    ) -> anyhow::Result<Outcome> {
        let id = self.begin_motion()?;
        let sent_ns = give(self);
        let tried = match sent_ns {
            Ok(sent_ns) => self.braking(sent_ns),
            Err(error) => Err(format!("{error:#}")),
        };
        let end = self.stack.wait_for_end(id);
        self.scenes.publish(&[], LIFETIME)?;
        let _ = self.listener.take();
        Ok(tried.and_then(|tried| end.map(|_| tried).map_err(|error| error.to_string())))
    }

    /// A command of this process's client.
    fn send_stop(&mut self) -> anyhow::Result<i64> {
        let sent_ns = mono_now_ns();
        let reply = self.command.command(Command::Stop, LIMIT)?;
        anyhow::ensure!(reply.accepted, "refused: {}", reply.reason);
        Ok(sent_ns)
    }

    /// A ball on the body.
    fn show_ball(&mut self) -> anyhow::Result<i64> {
        let shape = self.stack.commanded();
        let ball = MovingBall {
            centre_m: self.stack.world.robot.backbone(&shape).point(1, 0.5).into(),
            radius_m: 0.3,
            velocity_m_s: [0.0; 3],
        };
        let sent_ns = mono_now_ns();
        self.scenes.publish(&[ball], LIFETIME)?;
        Ok(sent_ns)
    }

    /// The program, to its end.
    fn run_pcc_stop(&mut self) -> anyhow::Result<i64> {
        let started_ns = mono_now_ns();
        let said = pcc(&self.stack.world, &["stop"], LIMIT);
        anyhow::ensure!(said.is_good(), "{}", said.summary());
        let sent_ns = sent_at(&said.text).context(said.summary())?;
        let ran = started_ns..mono_now_ns();
        anyhow::ensure!(
            ran.contains(&sent_ns),
            "not sent while it ran: {}",
            said.summary()
        );
        Ok(sent_ns)
    }

    fn braking(&self, sent_ns: i64) -> Outcome {
        let braking = wait_for("the loop brakes", LIMIT, || {
            self.listener.with(|heard| {
                let state = |wanted: LoopState| move |cycle: &&Cycle| cycle.state == wanted.code();
                let mut before = heard.cycles.iter().filter(|c| c.stamp_mono_ns <= sent_ns);
                let executed = before
                    .next_back()
                    .is_some_and(|last| state(LoopState::Executing)(&last));
                let mut after = heard.cycles.iter().filter(|c| c.stamp_mono_ns > sent_ns);
                let first = after.find(state(LoopState::Stopping))?;
                Some(executed.then_some(first.stamp_mono_ns))
            })
        });
        let at_ns = braking.map_err(|error| error.what)?;
        let at_ns = at_ns.ok_or("it did not execute just before")?;
        let took = Duration::from_nanos((at_ns - sent_ns).unsigned_abs());
        let now = (Instant::now(), mono_now_ns());
        let sent = now.0 - Duration::from_nanos((now.1 - sent_ns).unsigned_abs());
        Ok(Try {
            ms: took.as_secs_f64() * 1e3,
            stolen_ms: self.stolen.between(sent, sent + took).as_secs_f64() * 1e3,
        })
    }
}

/// When `pcc stop` says that it has sent its order, nanoseconds of CLOCK_MONOTONIC.
fn sent_at(text: &str) -> Option<i64> {
    let (_, rest) = text.split_once("sent at ")?;
    let (seconds, rest) = rest.split_once('.')?;
    let (nanoseconds, _) = rest.split_once(" s")?;
    let (seconds, nanoseconds) = (seconds.parse::<i64>(), nanoseconds.parse::<i64>());
    Some(seconds.ok()? * 1_000_000_000 + nanoseconds.ok()?)
}
