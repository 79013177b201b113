//! The guides, followed in a clean clone: the commands of their blocks, in order, by a shell in its root. What goes on is ended at the end of its
//! block.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process;
use std::time::{Duration, Instant};

use ::tests::process::Process;
use ::tests::stack::{PATIENCE, Part, Stack};
use ::tests::world::Settings;
use anyhow::{Context, ensure};
use client::ResultView;
use shared_types::codes::MotionOutcome;
use tempfile::TempDir;

use crate::demo::clone_to_build;
use crate::report::Report;
use crate::scale::Scale;

/// How long a command may take that ends by itself: an example may have to be built.
const LIMIT: Duration = Duration::from_secs(300);
/// How long one may take to end at Ctrl-C.
const ENDS_WITHIN: Duration = Duration::from_secs(10);
const COMMAND: &str =
    "git clone; cargo build; the commands in the blocks of docs/guides, one after the other";
/// Longest time from `git clone` to the end of a page, those before it included, minutes.
const LONGEST_MINUTES: f64 = 60.0;

const FOLDER: &str = "docs/guides";

/// A page, and what runs before it is followed.
struct Guide {
    page: &'static str,
    before: &'static [Part],
    /// Whether a robot is held once the page's own programs run.
    has_robot: bool,
}

const GUIDES: [Guide; 6] = [
    Guide {
        page: "controller.md",
        before: &[Part::Daemon],
        has_robot: true,
    },
    Guide {
        page: "motor-driver.md",
        before: &[Part::Daemon, Part::Controller],
        has_robot: true,
    },
    Guide {
        page: "perception.md",
        before: &Part::ALL,
        has_robot: true,
    },
    Guide {
        page: "robot-file.md",
        before: &[],
        has_robot: false,
    },
    Guide {
        page: "replan.md",
        before: &Part::ALL,
        has_robot: true,
    },
    Guide {
        page: "latency.md",
        before: &[Part::Daemon],
        has_robot: false,
    },
];

pub(super) fn run(report: &mut Report, scale: Scale) {
    let mut newcomer = None;
    report.group("guides: pages", COMMAND, |report| {
        let pages = fs::read_dir(arrived(&mut newcomer, scale)?.root.join(FOLDER))?;
        let pages = pages.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
        let mut pages = pages.collect::<anyhow::Result<BTreeSet<String>>>()?;
        GUIDES.iter().for_each(|guide| {
            pages.remove(guide.page);
        });
        let left: Vec<String> = pages.into_iter().collect();
        report.none_of("guides: pages that are not followed", &left);
        Ok(())
    });
    for guide in GUIDES {
        report.group(&format!("guides: {}", guide.page), COMMAND, |report| {
            let newcomer = arrived(&mut newcomer, scale)?;
            guide.follow(report, &newcomer.root)?;
            newcomer.show_time(report, guide.page);
            Ok(())
        });
    }
}

/// The newcomer that all groups share.
fn arrived(newcomer: &mut Option<Newcomer>, scale: Scale) -> anyhow::Result<&Newcomer> {
    if newcomer.is_none() {
        *newcomer = Some(Newcomer::arrive(scale)?);
    }
    newcomer.as_ref().context("nobody arrived")
}

/// A clean clone, built as getting-started.md says.
struct Newcomer {
    root: PathBuf,
    begun: Instant,
    /// What was built before the clock began.
    built_before: &'static str,
    _folder: TempDir,
}

impl Newcomer {
    /// Clones and builds.
    fn arrive(scale: Scale) -> anyhow::Result<Self> {
        let (begun, folder) = (Instant::now(), tempfile::tempdir()?);
        let root = clone_to_build(folder.path(), scale)?;
        let page = fs::read_to_string(root.join("docs/getting-started.md"))?;
        let build = page.lines().find(|line| line.starts_with("cargo build"));
        let build = build.context("getting-started.md builds nothing")?;
        let status = process::Command::new("/bin/sh")
            .args(["-c", build])
            .current_dir(&root)
            .env_remove("CARGO_TARGET_DIR")
            .status()?;
        ensure!(status.success(), "{build}: {status}");
        Ok(Self {
            root,
            begun,
            built_before: scale.pick(
                "what is built is kept from run to run",
                "built from nothing",
            ),
            _folder: folder,
        })
    }

    fn show_time(&self, report: &mut Report, page: &str) {
        let line = format!(
            "guides: minutes from `git clone` to the end of {page} ({})",
            self.built_before
        );
        let minutes = self.begun.elapsed().as_secs_f64() / 60.0;
        report.at_most(&line, minutes, LONGEST_MINUTES);
    }
}

impl Guide {
    fn follow(&self, report: &mut Report, root: &Path) -> anyhow::Result<()> {
        let blocks = blocks(&fs::read_to_string(root.join(FOLDER).join(self.page))?)?;
        ensure!(!blocks.is_empty(), "{} has no commands", self.page);
        let mut stack = Stack::new(&Settings::default());
        let mut results = ResultView::watch(&stack.world.options)?;
        let built = root.join("target/release");
        let before = self.before.iter();
        let before = before.map(|part| part.start_built(&stack.world, &built));
        let _before: Vec<Process> = before.collect();
        if self.before == Part::ALL {
            stack.wait_until_ready()?;
        }
        for block in &blocks {
            self.follow_block(report, root, &mut stack, block)?;
        }
        self.show_joined(report, &blocks, &mut results)
    }

    fn follow_block(
        &self,
        report: &mut Report,
        root: &Path,
        stack: &mut Stack,
        commands: &[Command],
    ) -> anyhow::Result<()> {
        let mut going_on = Vec::new();
        for command in commands {
            let process = command.start(stack, root);
            if !command.is_ended_by_hand() {
                self.show(report, command, process, LIMIT)?;
                continue;
            }
            going_on.push((command, process));
            stack.client.wait_for_daemon(PATIENCE)?;
            if self.has_robot {
                stack.wait_until_held()?;
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
        let is_kept = status.success() && command.promise.is_kept(&log);
        report.check(&line, format!("{status}: {last}"), &bar, is_kept);
        Ok(())
    }

    /// Whether motions were joined by those of the next command where the page says so.
    fn show_joined(
        &self,
        report: &mut Report,
        blocks: &[Vec<Command>],
        results: &mut ResultView,
    ) -> anyhow::Result<()> {
        let commands = blocks.iter().flatten();
        let joining = commands.filter(|it| it.comment.starts_with("joins"));
        let (joining, mut ended) = (joining.count(), Vec::new());
        if joining == 0 {
            return Ok(());
        }
        results.drain(&mut ended)?;
        let joined = ended.iter();
        let joined = joined.filter(|it| it.outcome == MotionOutcome::Joined);
        let line = format!("guides: {}: motions that the next one joined", self.page);
        report.all_of(&line, joined.count(), joining);
        Ok(())
    }
}

/// What a page says of what a command prints.
#[derive(Debug, PartialEq)]
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
                let last = log.trim_end().lines().last().unwrap_or_default();
                let (begin, end) = text.split_once('…').unwrap_or((text, ""));
                let after = last.strip_prefix(begin);
                after.is_some_and(|after| match text.contains('…') {
                    true => after.ends_with(end),
                    false => after.is_empty(),
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

    fn start(&self, stack: &Stack, root: &Path) -> Process {
        let root = root.display().to_string();
        // What a shell starts in the background ignores Ctrl-C.
        let script = format!(
            "cd \"$0\" && exec env -u CARGO_TARGET_DIR --default-signal=INT {}",
            self.line
        );
        let shell = Path::new("/bin/sh");
        Process::start_program(&stack.world, shell, &["-c", &script, &root])
    }

    fn is_ended_by_hand(&self) -> bool {
        self.comment.contains("until Ctrl-C")
    }
}

/// The commands of a page, by its blocks.
fn blocks(page: &str) -> anyhow::Result<Vec<Vec<Command>>> {
    let blocks = page.split("```").skip(1).step_by(2);
    let commands = |block: &str| {
        let lines = block.lines().filter(|line| !line.is_empty());
        lines.map(Command::of).collect()
    };
    blocks.map(commands).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_last_line_is_the_whole_line_but_for_what_is_left_out() {
        let whole = Promise::LastLine("every scene counted".to_owned());
        assert!(whole.is_kept("a\nevery scene counted\n"));
        assert!(!whole.is_kept("not every scene counted"));
        assert!(!whole.is_kept("every scene counted\nan error"));
        let with_gap = Promise::LastLine("reached after … s".to_owned());
        assert!(with_gap.is_kept("reached after 2.7 s"));
        assert!(!with_gap.is_kept("reached after 2.7 s, late"));
    }

    #[test]
    fn blocks_have_commands_and_promises() {
        let page = "text\n```\ncargo build\n./a 1   # prints nothing, until Ctrl-C\n```\n`b`\n```\nc  # ends with \"d\"\n```\n";
        let blocks = blocks(page).unwrap();
        assert_eq!(blocks.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1]);
        let commands: Vec<&Command> = blocks.iter().flatten().collect();
        let lines: Vec<&str> = commands.iter().map(|it| it.line.as_str()).collect();
        assert_eq!(lines, ["cargo build", "./a 1", "c"]);
        let promises: Vec<&Promise> = commands.iter().map(|it| &it.promise).collect();
        let last = Promise::LastLine("d".to_owned());
        assert_eq!(promises, [&Promise::Nothing, &Promise::Silence, &last]);
        assert!(commands[1].is_ended_by_hand() && !commands[2].is_ended_by_hand());
    }
}
