//! What the client for Python costs beside that for Rust, and that its views of an answer are safe.

use std::fs;
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use client::Client;
use shared_types::valid::{Goal, PlanRequest};
use tests::process::Process;
use tests::programs::repository;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::examples::TIP_M;
use super::languages::{python_client, with_module};
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::median;

/// Windows in which both clients ask in turn.
const WINDOWS: usize = 5;
/// Plans a second while memory is looked at.
const RATE: u32 = 100;
/// Share of that rate that must be kept: sleeps end late, and the last plan takes its time.
const RATE_KEPT: f64 = 0.99;
/// Rounds between two looks at memory.
const ROUNDS: u32 = 6;
/// Growth of memory that is none, kB: a page of an allocator's here and there.
const FLAT_KB: u64 = 512;

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "tests/acceptance/src/join/plans.py";
    report.group("Python: round trips", command, |report| {
        round_trips(report, scale)
    });
    report.group("Python: views and memory", command, |report| {
        views_and_memory(report, scale)
    });
    let command = "tests/acceptance/src/join/waits.py";
    report.group("Python: threads and Ctrl-C", command, waits);
    report.group(
        "Python: notebook",
        "clients/python/examples/tour.ipynb",
        notebook,
    );
}

/// A Python that asks for plans when it is told to.
struct Plans {
    process: Child,
    input: ChildStdin,
    output: Lines<BufReader<ChildStdout>>,
}

impl Plans {
    fn start(world: &World) -> anyhow::Result<Self> {
        let script = repository().join("tests/acceptance/src/join/plans.py");
        let mut process = Command::new(python_client()?)
            .arg(script)
            .args(TIP_M.map(|axis| axis.to_string()))
            .env("PCC_PREFIX", &world.options.prefix)
            .env("PCC_ROOT", &world.options.root)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let input = process.stdin.take().context("no input")?;
        let output = process.stdout.take().context("no output")?;
        Ok(Self {
            process,
            input,
            output: BufReader::new(output).lines(),
        })
    }

    /// What it answers to a line.
    fn say(&mut self, line: &str) -> anyhow::Result<String> {
        writeln!(self.input, "{line}")?;
        self.input.flush()?;
        Ok(self.output.next().context("it has ended")??)
    }

    fn pace(&mut self, count: u32) -> anyhow::Result<Paced> {
        let told = self.say(&format!("paced {count} {RATE}"))?;
        let [plans, views, seconds] = told.split(' ').collect::<Vec<_>>()[..] else {
            bail!("plans.py: {told}");
        };
        Ok(Paced {
            plans: plans.parse()?,
            views: views.parse()?,
            seconds: seconds.parse()?,
        })
    }
}

/// What was planned at a rate.
struct Paced {
    plans: u32,
    /// Candidates whose knots were read.
    views: u32,
    seconds: f64,
}

/// Memory that may grow, kB.
#[derive(Clone, Copy, Debug)]
struct Memory {
    /// Of Python alone, without what it shares.
    python: u64,
    /// Of the daemon alone.
    daemon: u64,
    /// Of the services.
    shared: u64,
}

impl Memory {
    fn of(stack: &mut Stack, python: &Plans) -> anyhow::Result<Self> {
        Ok(Self {
            python: resident_kb(python.process.id())?,
            daemon: resident_kb(stack.process(Part::Daemon).pid())?,
            shared: stack.world.shared_memory_bytes() / 1024,
        })
    }
}

/// Resident memory of a process that it shares with none.
fn resident_kb(process: u32) -> anyhow::Result<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status"))?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("RssAnon:"));
    let number = line.and_then(|line| line.split_whitespace().next());
    Ok(number.context("no RssAnon")?.parse()?)
}

impl Drop for Plans {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn daemon() -> anyhow::Result<Stack> {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    Ok(stack)
}

fn round_trips(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = daemon()?;
    let count = scale.pick(400, 4_000);
    let mut python = Plans::start(&stack.world)?;
    let mut ratios = Vec::new();
    for window in 0..WINDOWS {
        let of_rust_ms = median_ms(&mut stack.client, count)?;
        let of_python_ms: f64 = python.say(&format!("plans {count}"))?.parse()?;
        ratios.push(of_python_ms / of_rust_ms);
        report.shown(
            &format!("Python: window {window}, median round trips of Rust and Python"),
            format!("{of_rust_ms:.4} and {of_python_ms:.4} ms"),
        );
    }
    let line = format!(
        "Python: round trip ÷ Rust's, with events, medians of {count}, median of five windows"
    );
    report.at_most(&line, median(&ratios), 1.15);
    Ok(())
}

/// The median of round trips of the request that Python makes.
fn median_ms(client: &mut Client, count: usize) -> anyhow::Result<f64> {
    let request = PlanRequest {
        candidate_count: 10,
        ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
    };
    let mut times_ms = Vec::new();
    for _ in 0..count {
        let begun = Instant::now();
        let answer = client.plan(&request, PATIENCE)?;
        times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        ensure!(
            !answer.report().candidates.is_empty(),
            "{}",
            answer.report()
        );
    }
    Ok(median(&times_ms))
}

fn views_and_memory(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = daemon()?;
    let mut python = Plans::start(&stack.world)?;
    outlives_its_answer(report, &mut stack, &mut python)?;
    let lasts = Duration::from_secs(scale.pick(60, 3_600));
    let count = RATE * lasts.as_secs() as u32 / ROUNDS;
    // What is made once.
    python.pace(count)?;
    let mut memory = vec![Memory::of(&mut stack, &python)?];
    let (mut plans, mut views, mut seconds) = (0, 0, 0.0);
    for _ in 0..ROUNDS {
        let paced = python.pace(count)?;
        plans += paced.plans;
        views += paced.views;
        seconds += paced.seconds;
        memory.push(Memory::of(&mut stack, &python)?);
    }
    let line = |what: &str| format!("Python: {what} in {} s", lasts.as_secs());
    let rate = f64::from(plans) / seconds;
    report.check(
        &line("plans a second"),
        format!("{rate:.2}, {plans} plans"),
        &format!(">= {} of {RATE}", f64::from(RATE) * RATE_KEPT),
        rate >= f64::from(RATE) * RATE_KEPT && plans == count * ROUNDS,
    );
    report.check(
        &line("views of knots that were made and read"),
        views.to_string(),
        &format!(">= {plans}"),
        views >= plans,
    );
    report.shown("Python: memory after each round, kB", format!("{memory:?}"));
    let grown = |of: fn(&Memory) -> u64| {
        let [first, last] = [&memory[0], &memory[ROUNDS as usize]].map(of);
        last.saturating_sub(first) as f64
    };
    for (whose, kb) in [
        ("its memory", grown(|it| it.python)),
        ("the daemon's memory", grown(|it| it.daemon)),
        ("shared memory", grown(|it| it.shared)),
    ] {
        let what = format!("growth of {whose}, kB, with {RATE} plans a second");
        report.at_most(&line(&what), kb, FLAT_KB as f64);
    }
    Ok(())
}

/// A view of knots whose answer and client are gone, after other plans, and after the daemon was killed and another one has planned.
fn outlives_its_answer(
    report: &mut Report,
    stack: &mut Stack,
    python: &mut Plans,
) -> anyhow::Result<()> {
    let mut says = |line: &str, told: String, expected: &str| {
        let passed = told == expected;
        report.check(&format!("Python: {line}"), told, expected, passed);
    };
    let line = "a view of knots";
    says(line, python.say("view")?, "a copy: False, writeable: False");
    let others = "100 plans with other knots";
    says("answers after it", python.say("others 100")?, others);
    let line = "a view whose answer and client are gone, after 100 plans to another tip";
    says(line, python.say("same")?, "the same numbers");
    stack.kill9(Part::Daemon);
    let line = "that view after the daemon was killed";
    says(line, python.say("same")?, "the same numbers");
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let line = "answers of another daemon";
    says(line, python.say("others 100")?, others);
    let line = "that view after another daemon has planned";
    says(line, python.say("same")?, "the same numbers");
    Ok(())
}

/// While a call waits for a daemon that is held, another Python thread counts, and Ctrl-C ends the call.
fn waits(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = daemon()?;
    let script = repository().join("tests/acceptance/src/join/waits.py");
    let mut arguments = vec![script.display().to_string()];
    arguments.extend(TIP_M.map(|axis| axis.to_string()));
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    stack.process(Part::Daemon).signal(libc::SIGSTOP);
    let mut waiting = Process::start_program(&stack.world, &python_client()?, &arguments);
    let status = waiting.wait(PATIENCE)?;
    let told = waiting.log();
    ensure!(status.success(), "waits.py: {status}: {told}");
    for line in told.lines() {
        let [name, counted, ended_s] = line.split(' ').collect::<Vec<_>>()[..] else {
            bail!("waits.py: {line}");
        };
        let figure = format!("Python: another thread's counts in a second's wait for {name}");
        let counted: u32 = counted.parse()?;
        report.check(&figure, counted.to_string(), ">= 200", counted >= 200);
        let line = format!("Python: Ctrl-C 0.3 s after a wait for {name} began ends it, s");
        report.at_most(&line, ended_s.parse()?, 0.5);
    }
    Ok(())
}

/// Every cell of the notebook, on the running processes.
fn notebook(report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let python = with_module("venv-notebook", &["nbclient>=0.10,<1", "ipykernel>=6,<8"])?;
    let run = "import nbformat, nbclient, sys; notebook = nbformat.read(sys.argv[1], 4); \
               nbclient.NotebookClient(notebook, timeout=60).execute(); \
               print(sum(cell.cell_type == 'code' and cell.execution_count is not None for cell in notebook.cells))";
    let done = Command::new(python)
        .args(["-c", run])
        .arg(repository().join("clients/python/examples/tour.ipynb"))
        .env("PCC_PREFIX", &stack.world.options.prefix)
        .env("PCC_ROOT", &stack.world.options.root)
        .output()?;
    let said = String::from_utf8_lossy(&done.stdout).trim().to_owned();
    let error = String::from_utf8_lossy(&done.stderr);
    let figure = if done.status.success() {
        said.clone()
    } else {
        error.lines().last().unwrap_or_default().to_owned()
    };
    let all = done.status.success() && said == "5";
    report.check("Python: cells of the notebook that ran", figure, "5", all);
    Ok(())
}
