//! The guides, followed: every command of their blocks, in order, by a shell in the repository's root.

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, ensure};
use tests::process::Process;
use tests::programs::repository;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

use super::examples::wait_until_held;
use crate::report::Report;

/// How long a command may take that ends by itself: an example may have to be built.
const LIMIT: Duration = Duration::from_secs(300);
/// How long one may take to end at Ctrl-C.
const ENDS_WITHIN: Duration = Duration::from_secs(10);

/// A page, and what runs before it is followed.
struct Guide {
    page: &'static str,
    before: &'static [Part],
}

const GUIDES: [Guide; 5] = [
    Guide {
        page: "controller.md",
        before: &[Part::Daemon],
    },
    Guide {
        page: "motor-driver.md",
        before: &[Part::Daemon, Part::Controller],
    },
    Guide {
        page: "perception.md",
        before: &Part::ALL,
    },
    Guide {
        page: "robot-file.md",
        before: &[],
    },
    Guide {
        page: "replan.md",
        before: &Part::ALL,
    },
];

pub(super) fn run(report: &mut Report) {
    let command = "the commands of docs/guides, one after the other";
    for guide in GUIDES {
        report.group(&format!("guides: {}", guide.page), command, |report| {
            guide.follow(report)
        });
    }
}

impl Guide {
    fn follow(&self, report: &mut Report) -> anyhow::Result<()> {
        let root = repository();
        let page = root.join("docs/guides").join(self.page);
        let commands = commands(&fs::read_to_string(page)?)?;
        ensure!(!commands.is_empty(), "{} has no commands", self.page);
        let mut stack = Stack::new(&Settings::default());
        for part in self.before {
            stack.start(*part);
        }
        if self.before == Part::ALL {
            stack.wait_until_ready()?;
        }
        let mut going_on = Vec::new();
        for command in &commands {
            let in_root = format!("cd {} && exec {}", root.display(), command.line);
            let shell = Path::new("/bin/sh");
            let process = Process::start_program(&stack.world, shell, &["-c", &in_root]);
            if !command.is_ended_by_hand() {
                self.show(report, command, process, LIMIT)?;
                continue;
            }
            going_on.push((command, process));
            stack.client.wait_for_daemon(PATIENCE)?;
            if !self.before.is_empty() {
                wait_until_held(&mut stack)?;
            }
        }
        for (command, process) in going_on {
            process.signal(libc::SIGINT);
            self.show(report, command, process, ENDS_WITHIN)?;
        }
        Ok(())
    }

    /// What came of a command that ends, or is told to.
    fn show(
        &self,
        report: &mut Report,
        command: &Command,
        mut process: Process,
        limit: Duration,
    ) -> anyhow::Result<()> {
        let status = process.wait(limit)?;
        let log = process.log();
        let last = log.trim_end().lines().last().unwrap_or_default();
        let line = format!("guides: {}: `{}`", self.page, command.line);
        let bar = match &command.promise {
            Promise::Nothing => "ends without an error".to_owned(),
            Promise::Silence => "prints nothing".to_owned(),
            Promise::LastLine(text) => format!("ends with \"{text}\""),
        };
        let is_ended = command.is_ended_by_hand() && status.signal() == Some(libc::SIGINT);
        let is_kept = (status.success() || is_ended) && command.promise.is_kept(&log);
        report.check(&line, format!("{status}: {last}"), &bar, is_kept);
        Ok(())
    }
}

/// What a page says of what a command prints.
enum Promise {
    Nothing,
    Silence,
    /// Its last line, with `…` for what it does not say.
    LastLine(String),
}

impl Promise {
    fn is_kept(&self, log: &str) -> bool {
        match self {
            Self::Nothing => true,
            Self::Silence => log.is_empty(),
            Self::LastLine(text) => {
                let mut rest = log.trim_end().lines().last().unwrap_or_default();
                text.split('…').all(|part| {
                    let found = rest.split_once(part);
                    rest = found.map_or("", |(_, after)| after);
                    found.is_some()
                })
            }
        }
    }
}

/// A line of a page's blocks.
struct Command {
    line: String,
    comment: String,
    promise: Promise,
}

impl Command {
    fn of(line: &str) -> anyhow::Result<Self> {
        let (line, comment) = line.split_once(" # ").unwrap_or((line, ""));
        let promise = if comment.contains("prints nothing") {
            Promise::Silence
        } else if let Some((_, text)) = comment.split_once("ends with \"") {
            let text = text.split_once('"').context("no closing quote")?.0;
            Promise::LastLine(text.to_owned())
        } else {
            Promise::Nothing
        };
        Ok(Self {
            line: line.trim().to_owned(),
            comment: comment.to_owned(),
            promise,
        })
    }

    fn is_ended_by_hand(&self) -> bool {
        self.comment.contains("until Ctrl-C")
    }
}

/// The lines of a page's blocks that are commands.
fn commands(page: &str) -> anyhow::Result<Vec<Command>> {
    let blocks = page.split("```").skip(1).step_by(2);
    let lines = blocks.flat_map(str::lines).filter(|line| !line.is_empty());
    lines.map(Command::of).collect()
}
