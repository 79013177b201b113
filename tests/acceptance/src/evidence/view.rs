//! The page of `pcc view` in headless Chromium: of a record, of an evaluation, among solids, and live.

use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use client::ScenePublisher;
use shared_types::ipc::IpcOptions;
use shared_types::message::MovingBall;
use tests::process::{Process, wait_for};
use tests::programs::repository;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::browser::Browser;
use crate::report::Report;
use crate::runs::{folder, run_pcc};
use crate::scale::Scale;

/// What is recorded, s.
const RECORDED_S: u32 = 62;
/// Tips that the robot goes between, base frame, m: the ball is on the other side.
const TIPS_M: [[f64; 3]; 4] = [
    [-1.45, 0.0, 2.25],
    [-0.3, 1.5, 2.2],
    [-1.2, 0.6, 2.3],
    [-0.3, -1.5, 2.2],
];
/// Time between two scenes, and for how long each counts.
const SCENE_PERIOD: Duration = Duration::from_millis(50);
const SCENE_LIFETIME: Duration = Duration::from_millis(500);
/// Time of a ball's way to and fro, s.
const BALL_PERIOD_S: f64 = 8.0;
/// For how long controller and daemon are away: the daemon's absence is noticed after 2.5 s.
const AWAY: Duration = Duration::from_secs(8);

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("the view", "pcc view FILE|--live", |report| {
        let browser = Browser::find()?;
        let out = folder().join("view");
        fs::create_dir_all(&out)?;
        alone(report)?;
        let mut stack = Stack::running(&Settings::default())?;
        let options = stack.world.options.clone();
        let is_over = AtomicBool::new(false);
        scope(|scope| {
            let ball = scope.spawn(|| move_a_ball(&options, &is_over));
            let done = files(report, scale, &browser, &mut stack, &out)
                .and_then(|()| live(report, &browser, &mut stack, &out));
            is_over.store(true, Ordering::Relaxed);
            let moved = ball.join();
            done.and(moved.unwrap_or_else(|_| bail!("the ball's source panicked")))
        })
    });
}

/// Served where nothing runs.
fn alone(report: &mut Report) -> anyhow::Result<()> {
    let world = World::new(&Settings::default());
    let mut served = serve(&world)?;
    let waiting = wait_for("it says who is not there", PATIENCE, || {
        let log = served.log();
        let line = log.lines().find(|line| line.starts_with("waiting for"));
        line.map(str::to_owned)
    })?;
    served.signal(libc::SIGINT);
    let status = served.wait(PATIENCE)?;
    report.check(
        "live: without any process, and its end at an interrupt",
        format!("{waiting}; {status}"),
        "named; success",
        waiting == "waiting for planner-daemon, controller, robot" && status.success(),
    );
    Ok(())
}

/// Pages of files.
fn files(
    report: &mut Report,
    scale: Scale,
    browser: &Browser,
    stack: &mut Stack,
    out: &Path,
) -> anyhow::Result<()> {
    let text = |path: PathBuf| path.display().to_string();
    let record = text(record(report, stack, out)?);
    let evaluated = text(out.join("default"));
    let dataset = "tests/data/reference-mixed-sample";
    run_pcc(&[
        "evaluate",
        "--dataset",
        dataset,
        "--planner",
        "default",
        "--out",
        &evaluated,
    ])?;
    let paths = format!("{evaluated}/paths.npz");
    let scene = "tests/data/scenes/workshop.toml";
    let [page, case, solids] =
        ["record", "case", "solids"].map(|name| text(out.join(name).with_extension("html")));
    run_pcc(&["view", &record, "--out", &page])?;
    run_pcc(&["view", &paths, "--case", "50", "--out", &case])?;
    run_pcc(&["view", &paths, "--scene", scene, "--out", &solids])?;
    let mut pages = vec![text(out.to_owned()), page, case, solids];
    for entry in fs::read_dir(repository().join("docs/results"))? {
        let path = entry?.path();
        pages.extend((path.extension() == Some("html".as_ref())).then(|| text(path)));
    }
    for name in scale.pick(&["page"][..], &["page", "compare"]) {
        let made = folder().join(name).join("index.html");
        report.check(
            &format!(
                "pages that are opened: `{name}`, which group `the page` or `comparison` has made"
            ),
            text(made.clone()),
            "it is there",
            made.is_file(),
        );
        if made.is_file() {
            let fresh = out.join(format!("made-now-{name}.html"));
            fs::copy(made, &fresh)?;
            pages.push(text(fresh));
        }
    }
    browser.start("check.mjs", &pages)?.report(report, None)
}

/// A minute of motions one after the other, and a ball that moves beside them.
fn record(report: &mut Report, stack: &mut Stack, out: &Path) -> anyhow::Result<PathBuf> {
    let file = out.join("record.mcap");
    let _ = fs::remove_file(&file);
    let name = file.display().to_string();
    let seconds = RECORDED_S.to_string();
    let mut recorder = Process::start(
        &stack.world,
        "pcc",
        &["record", &name, "--seconds", &seconds],
    );
    let mut moved = 0;
    for tip in TIPS_M.iter().cycle() {
        if !recorder.is_running() {
            break;
        }
        stack.move_tip(*tip)?;
        moved += 1;
    }
    let status = recorder.wait(PATIENCE)?;
    report.check(
        &format!("record: motions in {RECORDED_S} s, and the recorder's end"),
        format!("{moved}, {status}"),
        "> 5, success",
        moved > 5 && status.success(),
    );
    Ok(file)
}

/// Pages that are served, while the robot moves, and while controller and daemon are away.
fn live(
    report: &mut Report,
    browser: &Browser,
    stack: &mut Stack,
    out: &Path,
) -> anyhow::Result<()> {
    let mut served = serve(&stack.world)?;
    let address = address(&served)?;
    let is_over = AtomicBool::new(false);
    let mut script = browser.start("live.mjs", &[out.display().to_string(), address])?;
    scope(|scope| {
        let telling = scope.spawn(|| {
            let told = script.report(report, Some("watching"));
            is_over.store(true, Ordering::Relaxed);
            told
        });
        let moved = keep_moving(stack, &is_over);
        let told = telling.join();
        told.unwrap_or_else(|_| bail!("the report panicked"))
            .and(moved)
    })?;
    for part in [Part::Controller, Part::Daemon] {
        stack.kill9(part);
    }
    sleep(AWAY);
    for part in [Part::Controller, Part::Daemon] {
        stack.start(part);
    }
    stack.clear_fault()?;
    script.report(report, None)?;
    served.signal(libc::SIGINT);
    let status = served.wait(PATIENCE)?;
    let log = served.log();
    report.check(
        "live: its end at an interrupt, and what it said",
        format!("{status}: {}", log.replace('\n', "; ")),
        "success",
        status.success(),
    );
    Ok(())
}

fn keep_moving(stack: &mut Stack, is_over: &AtomicBool) -> anyhow::Result<()> {
    for tip in TIPS_M.iter().cycle() {
        if is_over.load(Ordering::Relaxed) {
            break;
        }
        stack.move_tip(*tip)?;
    }
    Ok(())
}

fn serve(world: &World) -> anyhow::Result<Process> {
    let served = Process::start(world, "pcc", &["view", "--live"]);
    address(&served)?;
    Ok(served)
}

fn address(served: &Process) -> anyhow::Result<String> {
    let found = wait_for("the address of the page", PATIENCE, || {
        let log = served.log();
        let line = log.lines().find(|line| line.starts_with("serving "))?;
        line.split(' ').nth(1).map(str::to_owned)
    });
    found.with_context(|| served.log())
}

/// Publishes a ball that goes to and fro where the robot does not go.
fn move_a_ball(options: &IpcOptions, is_over: &AtomicBool) -> anyhow::Result<()> {
    let mut source = ScenePublisher::connect(options, "acceptance")?;
    let begun = Instant::now();
    while !is_over.load(Ordering::Relaxed) {
        let angle = TAU * begun.elapsed().as_secs_f64() / BALL_PERIOD_S;
        let ball = MovingBall {
            centre_m: [2.6, 0.6 * angle.sin(), 0.6],
            radius_m: 0.25,
            velocity_m_s: [0.0, 0.6 * TAU / BALL_PERIOD_S * angle.cos(), 0.0],
        };
        source.publish(&[ball], SCENE_LIFETIME)?;
        sleep(SCENE_PERIOD);
    }
    Ok(source.take_leave()?)
}
