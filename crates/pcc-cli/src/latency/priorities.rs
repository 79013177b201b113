//! How the kernel schedules the threads of daemon, controller and robot: policies and real-time priorities.

use std::collections::BTreeMap;
use std::fs;

use serde_json::{Value, json};
use shared_types::ipc::{IpcOptions, Role, RoleLock};

/// Places of real-time priority and policy in `/proc/PID/task/TID/stat`, counted from behind the thread's name.
const PRIORITY: usize = 37;
const POLICY: usize = 38;
/// Policies by their numbers.
const POLICIES: [&str; 7] = [
    "SCHED_OTHER",
    "SCHED_FIFO",
    "SCHED_RR",
    "SCHED_BATCH",
    "policy 4",
    "SCHED_IDLE",
    "SCHED_DEADLINE",
];

/// The threads of each process of a robot that runs.
pub(super) struct Priorities(Vec<Process>);

struct Process {
    role: &'static str,
    threads: Vec<Thread>,
}

#[derive(Debug, PartialEq)]
struct Thread {
    name: String,
    policy: String,
    /// 1 to 99; 0 where the policy is no real-time one.
    priority: u32,
}

impl Priorities {
    /// As they are now; a process that cannot be read has no threads.
    pub(super) fn now(options: &IpcOptions) -> Self {
        let roles = [Role::PlannerDaemon, Role::Controller, Role::Robot];
        let of_role = |role: Role| {
            Some(Process {
                role: role.name(),
                threads: threads(RoleLock::holder(options, role)?),
            })
        };
        Self(roles.into_iter().filter_map(of_role).collect())
    }

    pub(super) fn show(&self) {
        for process in &self.0 {
            say!("{}'s threads: {}", process.role, process.text());
        }
    }

    pub(super) fn json(&self) -> Value {
        let of_thread = |thread: &Thread| {
            json!({
                "name": thread.name,
                "policy": thread.policy,
                "priority": thread.priority,
            })
        };
        let of_process = |process: &Process| {
            let threads: Vec<Value> = process.threads.iter().map(of_thread).collect();
            json!({ "role": process.role, "threads": threads })
        };
        self.0.iter().map(of_process).collect()
    }
}

impl Process {
    /// Those with a real-time priority by name, the highest first, and how many there are of each other policy.
    fn text(&self) -> String {
        let mut real_time: Vec<&Thread> =
            self.threads.iter().filter(|it| it.priority > 0).collect();
        real_time.sort_by_key(|thread| std::cmp::Reverse(thread.priority));
        let named = real_time.iter().map(|thread| {
            let Thread {
                name,
                policy,
                priority,
            } = thread;
            format!("{name} {policy} {priority}")
        });
        let mut others = BTreeMap::<&str, usize>::new();
        for thread in self.threads.iter().filter(|it| it.priority == 0) {
            *others.entry(&thread.policy).or_default() += 1;
        }
        let counted = others
            .iter()
            .map(|(policy, count)| format!("{count} {policy}"));
        let parts: Vec<String> = named.chain(counted).collect();
        match parts.as_slice() {
            [] => "cannot be read".to_owned(),
            parts => parts.join(", "),
        }
    }
}

fn threads(process: u32) -> Vec<Thread> {
    let tasks = fs::read_dir(format!("/proc/{process}/task"));
    let stats = tasks.into_iter().flatten().flatten();
    let texts = stats.filter_map(|task| fs::read_to_string(task.path().join("stat")).ok());
    texts.filter_map(|text| thread(&text)).collect()
}

/// The thread of a line of `/proc/PID/task/TID/stat`.
fn thread(stat: &str) -> Option<Thread> {
    let (_, named) = stat.split_once('(')?;
    let (name, rest) = named.rsplit_once(')')?;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    let policy: usize = fields.get(POLICY)?.parse().ok()?;
    let known = POLICIES.get(policy).map(|name| (*name).to_owned());
    Some(Thread {
        name: name.to_owned(),
        policy: known.unwrap_or_else(|| format!("policy {policy}")),
        priority: fields.get(PRIORITY)?.parse().ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_is_told_with_its_policy_and_priority() {
        let stat = "7 (hard (loop) S 1 7 7 0 -1 64 0 0 0 0 0 0 0 0 -81 0 9 0 5 1 1 1 1 1 1 1 1 0 0 0 0 0 0 0 -1 1 80 1 0 0 0";
        let expected = Thread {
            name: "hard (loop".to_owned(),
            policy: "SCHED_FIFO".to_owned(),
            priority: 80,
        };
        assert_eq!(thread(stat), Some(expected));
        assert_eq!(thread("7 (short) S 1"), None);
    }

    #[test]
    fn the_threads_of_this_process_are_read_and_told() {
        let process = Process {
            role: "test",
            threads: threads(std::process::id()),
        };
        assert!(!process.threads.is_empty());
        assert!(process.text().contains("SCHED_"), "{}", process.text());
    }
}
