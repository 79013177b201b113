//! What the hard loop allocates and which system calls it makes, counted over the running process.

use std::fs;
use std::path::Path;
use std::time::Duration;

use shared_types::valid::{ControllerState, Goal};
use tests::process::wait_for;
use tests::programs::repository;
use tests::retries;
use tests::stack::{MoveError, PATIENCE, Stack};
use tests::system_calls;
use tests::world::Settings;

use crate::report::Report;
use crate::scale::Scale;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance chain, real time";
    report.group("allocations", command, |report| allocations(report, scale));
    report.group("system calls", command, |report| {
        system_calls_of_the_loop(report, scale)
    });
    report.group("unsafe code", command, unsafe_code);
}

/// Motions between two configurations until the controller has counted so many cycles more.
fn move_for(stack: &mut Stack, cycles: u64) -> anyhow::Result<usize> {
    let begin = stack.controller_state().values.cycle;
    let mut motions = 0;
    while stack.controller_state().values.cycle < begin + cycles {
        let side = if motions % 2 == 0 { 0.8 } else { -0.8 };
        let id = stack.begin_motion(Goal::Configuration([side, 0.4, -side, 0.3, 0.5, side]))?;
        match stack.wait_for_end(id) {
            Err(error @ MoveError::CutShort(_)) => {
                retries::note(&error.to_string());
                stack.clear_fault()?;
            }
            end => drop(end?),
        }
        motions += 1;
    }
    Ok(motions)
}

fn allocations(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::fast_robot())?;
    // The first contact with the robot connects ports, which is not the cycle's own work.
    move_for(&mut stack, 1000)?;
    let before = stack.controller_state().values;
    let motions = move_for(&mut stack, scale.pick(10_000, 60_000))?;
    let after = stack.controller_state().values;
    let cycles = after.cycle - before.cycle;
    let sent = after.setpoints_sent - before.setpoints_sent;
    let arena = after.loop_arena_allocations - before.loop_arena_allocations;
    let system = after.loop_system_allocations - before.loop_system_allocations;
    let name =
        format!("allocations from the loop's arena over {cycles} cycles and {motions} motions");
    report.check(
        &name,
        format!("{arena} for {sent} sends"),
        "<= one a send",
        arena <= sent && cycles >= 10_000,
    );
    let name = "allocations of the loop that reached the system allocator";
    report.check(name, system.to_string(), "0", system == 0);
    report.check(
        "trajectories that arrived meanwhile",
        motions.to_string(),
        ">= 3",
        motions >= 3,
    );
    Ok(())
}

fn system_calls_of_the_loop(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::fast_robot())?;
    move_for(&mut stack, 1000)?;
    let before: ControllerState = stack.controller_state();
    let duration = Duration::from_secs(scale.pick(5, 20));
    let thread = before.values.loop_thread_id;
    let counter = std::thread::spawn(move || system_calls::count(thread, duration));
    let mut motions = 0;
    while !counter.is_finished() {
        motions += move_for(&mut stack, 200)?;
    }
    let counts = counter.join().unwrap()?;
    let begin = shared_types::clock::mono_now_ns();
    let after = wait_for("a new state", PATIENCE, || {
        let state = stack.controller_state();
        (state.values.stamp_mono_ns > begin).then_some(state)
    })?;
    let cycles = after.values.cycle - before.values.cycle;
    let is_sleep = |name: &str| name == "clock_nanosleep" || name == "restart_syscall";
    let named = counts
        .iter()
        .map(|(number, count)| (system_calls::name(*number), *count));
    let (sleeps, others): (Vec<_>, Vec<_>) = named.partition(|(name, _)| is_sleep(name));
    let slept: u64 = sleeps.iter().map(|(_, count)| count).sum();
    let others: Vec<String> = others
        .iter()
        .map(|(name, count)| format!("{count} × {name}"))
        .collect();
    report.none_of(
        "system calls of the loop's thread other than its sleep",
        &others,
    );
    let figure = format!("{slept} sleeps in {cycles} cycles, {motions} motions");
    let passed = slept > 1000 && slept <= cycles && motions > 0;
    report.check(
        "sleeps counted meanwhile",
        figure,
        "1000 to one a cycle",
        passed,
    );
    Ok(())
}

/// Files with `unsafe` must say why at each place, and only where memory, vectors or system calls need it.
fn unsafe_code(report: &mut Report) -> anyhow::Result<()> {
    let mut files = Vec::new();
    for folder in [
        "shared-types",
        "planner-daemon",
        "controller",
        "crates",
        "tests",
    ] {
        rust_files(&repository().join(folder), &mut files);
    }
    let (mut places, mut unexplained, mut confined) = (0, Vec::new(), Vec::new());
    for file in &files {
        let text = fs::read_to_string(file)?;
        let lines: Vec<&str> = text.lines().collect();
        let uses: Vec<usize> = (0..lines.len()).filter(|&i| is_unsafe(lines[i])).collect();
        let name = file.strip_prefix(repository())?.display().to_string();
        let silent = uses.iter().filter(|&&i| !is_explained(&lines, i));
        unexplained.extend(silent.map(|i| format!("{name}:{}", i + 1)));
        places += uses.len();
        if !uses.is_empty() {
            confined.push(name);
        }
    }
    let figure = format!(
        "{places} places in {} of {} files",
        confined.len(),
        files.len()
    );
    report.check(
        "unsafe code confined",
        figure,
        "<= a tenth of the files",
        confined.len() * 10 <= files.len(),
    );
    report.none_of("unsafe places without a SAFETY comment", &unexplained);
    Ok(())
}

fn rust_files(folder: &Path, files: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// A block or an implementation; declarations explain themselves with `# Safety`.
fn is_unsafe(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    let found = ["unsafe {", "unsafe impl"]
        .iter()
        .any(|what| code.contains(what));
    found && !code.contains('"')
}

fn is_explained(lines: &[&str], at: usize) -> bool {
    lines[at.saturating_sub(8)..=at]
        .iter()
        .any(|line| line.contains("SAFETY:"))
}
