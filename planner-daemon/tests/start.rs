//! What keeps the daemon from starting is named, and it exits with a failure.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod common;

use std::fs;

use common::{World, until};

#[test]
fn every_reason_not_to_start_is_named() {
    let world = World::new();
    let no_robot = world.path().join("no-robot.toml");
    fs::write(&no_robot, "robot = \"nowhere.toml\"").unwrap();
    let (status, said) = world.run(&no_robot);
    assert!(!status.success());
    assert!(said.contains("nowhere.toml"), "{said}");
    let missing = world.path().join("missing.toml");
    let (status, said) = world.run(&missing);
    assert!(!status.success());
    assert!(said.contains("missing.toml"), "{said}");
    for (settings, named) in [
        ("threads = ", "is not understood"),
        ("colour = \"red\"", "unknown field `colour`"),
        ("threads = 0", "threads = 0 is not allowed: 1 to 64"),
        ("weights = \"nowhere\"", "`weights`, in"),
        ("shared_memory_budget_mb = 1.0", "shared_memory_budget_mb"),
        (
            "candidates = 64\nknots_per_candidate = 256",
            "candidates = 64, knots_per_candidate = 256",
        ),
        (
            "resident_memory_budget_mb = 1.0",
            "resident_memory_budget_mb",
        ),
        ("processors = [1000]", "processors [1000]"),
    ] {
        let (status, said) = world.run(&world.configuration(settings));
        assert_eq!(status.code(), Some(1), "{settings}: {said}");
        assert!(said.contains(named), "{settings}: {said}");
    }
}

#[test]
fn a_second_daemon_is_refused_by_name_and_budgets_are_printed() {
    let world = World::new();
    let configuration = world.configuration("");
    let first = world.start(&configuration);
    let said = first.said();
    assert!(
        said.contains("shared memory") && said.contains("of 48.0 MB"),
        "{said}"
    );
    assert!(
        said.contains("resident memory") && said.contains("of 250.0 MB"),
        "{said}"
    );
    let (status, said) = world.run(&configuration);
    assert_eq!(status.code(), Some(1));
    assert!(said.contains("a planner-daemon already runs"), "{said}");
    assert!(first.terminate().success());
}

/// Shared and resident memory that a daemon says it has, MB.
fn memory(said: &str) -> [f64; 2] {
    ["shared memory ", "resident memory "].map(|what| {
        let (_, after) = said.rsplit_once(what).unwrap();
        let number = after.split_whitespace().next().unwrap();
        number.parse().expect(said)
    })
}

#[test]
fn with_lock_memory_the_memory_of_the_answers_is_resident_from_the_start() {
    let world = World::new();
    let [locked, free] = ["lock_memory = true", "lock_memory = false"].map(|settings| {
        let daemon = world.start(&world.configuration(settings));
        let said = daemon.said();
        assert!(daemon.terminate().success());
        said
    });
    if locked.contains("is not brought into RAM") {
        eprintln!("locking is denied here: {locked}");
        let named = [
            "large answers can be delayed once",
            "Linux 5.14 and space in",
            "/dev/shm",
        ];
        let said = locked.replace('\n', " ");
        assert!(named.iter().all(|part| said.contains(part)), "{locked}");
        // With its reason: the kernel's error, in brackets.
        assert!(
            said.contains("once (") && said.contains("os error"),
            "{locked}"
        );
        assert!(!free.contains("is not brought into RAM"), "{free}");
        return;
    }
    let ([shared, with], [_, without]) = (memory(&locked), memory(&free));
    assert!(with - without > 0.5 * shared, "{locked}{free}");
}

/// Name, real-time priority and scheduling policy of each thread of a process, sorted (proc(5)).
fn threads(pid: u32) -> Vec<(String, u32, i32)> {
    let folder = fs::read_dir(format!("/proc/{pid}/task")).unwrap();
    let thread = |entry: std::io::Result<fs::DirEntry>| {
        // One that has ended has none.
        let stat = fs::read_to_string(entry.ok()?.path().join("stat")).ok()?;
        let (name, numbers) = stat.rsplit_once(')').unwrap();
        let (_, name) = name.split_once('(').unwrap();
        let numbers: Vec<&str> = numbers.split_whitespace().collect();
        let (priority, policy) = (numbers[37], numbers[38]);
        let name = name.to_owned();
        Some((name, priority.parse().unwrap(), policy.parse().unwrap()))
    };
    let mut threads: Vec<_> = folder.filter_map(thread).collect();
    threads.sort();
    threads
}

#[test]
fn planning_and_serving_have_the_priorities_that_are_asked_for_or_none() {
    let world = World::new();
    let daemon = world.start(&world.configuration("realtime_priority = 10\nthreads = 3"));
    let last = ("cleaning".to_owned(), 0, libc::SCHED_IDLE);
    let mut threads = until(|| {
        let threads = threads(daemon.pid());
        threads.contains(&last).then_some(threads)
    });
    // Those that wait for all others: cleaning up, which each node does, and writing the log.
    threads.retain(|(name, _, _)| !["cleaning", "ipc-sweeper", "log"].contains(&name.as_str()));
    let is_refused = daemon.said().contains("no real-time priorities 10 to 12");
    let wanted = match is_refused {
        true => [0; 6].map(|priority| (priority, libc::SCHED_OTHER)),
        false => [11, 11, 10, 10, 10, 12].map(|priority| (priority, libc::SCHED_FIFO)),
    };
    let names = [
        "heartbeat",
        "planner-daemon",
        "planning",
        "planning",
        "planning",
        "supervision",
    ];
    let wanted = names
        .into_iter()
        .zip(wanted)
        .map(|(name, (priority, policy))| (name.to_owned(), priority, policy));
    assert_eq!(threads, wanted.collect::<Vec<_>>(), "{}", daemon.said());
}
