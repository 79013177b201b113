//! Daemon, controller and simulated robot as processes of their own, for as long as a figure needs them.

use anyhow::{Context, ensure};
use std::fs::{self, DirBuilder, File};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The programs, each with its configuration.
const PROGRAMS: [(&str, &str); 3] = [
    ("simulated-robot", "config/simulated-robot.toml"),
    ("controller", "config/controller.toml"),
    ("planner-daemon", "config/planner-daemon.toml"),
];

/// Runs a program and ends it with a SIGTERM as soon as standard input ends, so that it does not outlive a parent that is killed.
const WHILE_INPUT_LASTS: &str =
    r#"trap "" INT; "$@" </dev/null & read -r _; kill "$!" 2>/dev/null; wait "$!""#;

/// The running processes; they end with this value.
pub(super) struct Processes {
    /// Folder and prefix of their services, theirs alone.
    root: PathBuf,
    prefix: String,
    /// Where their logs are.
    logs: PathBuf,
    running: Vec<Child>,
}

impl Processes {
    /// Starts them, with their logs in a folder.
    ///
    /// # Errors
    /// Where a program is not beside this one, or its configuration is not there.
    pub(super) fn start(logs: &Path) -> anyhow::Result<Self> {
        let memory = Path::new("/dev/shm");
        let prefix = format!("pcc-page-{}", std::process::id());
        let folder = if memory.is_dir() {
            memory.to_owned()
        } else {
            std::env::temp_dir()
        };
        let root = folder.join(&prefix);
        DirBuilder::new().mode(0o700).create(&root)?;
        let mut processes = Self {
            root,
            prefix,
            logs: logs.to_owned(),
            running: Vec::new(),
        };
        fs::create_dir_all(logs)?;
        let this = std::env::current_exe()?;
        for (name, configuration) in PROGRAMS {
            ensure!(
                Path::new(configuration).is_file(),
                "{configuration} is not here; run the whole page in the repository's folder, or name --sets or --planners"
            );
            let program = this.with_file_name(name);
            ensure!(
                program.is_file(),
                "{} is not built (cargo build --release -p planner-daemon -p controller -p pcc-cli), which the whole page needs",
                program.display()
            );
            processes.spawn(&program, &["--config", configuration], name)?;
        }
        Ok(processes)
    }

    fn command(&self, program: &Path, arguments: &[&str], log: &str) -> anyhow::Result<Command> {
        let log = File::create(self.logs.join(format!("{log}.log")))?;
        let mut command = Command::new(program);
        command
            .args(arguments)
            .env("PCC_ROOT", &self.root)
            .env("PCC_PREFIX", &self.prefix)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log);
        Ok(command)
    }

    fn spawn(&mut self, program: &Path, arguments: &[&str], log: &str) -> anyhow::Result<()> {
        let text = program.to_str().context("a path that is no text")?;
        let whole = [&["-c", WHILE_INPUT_LASTS, "sh", text], arguments].concat();
        let mut command = self.command(Path::new("sh"), &whole, log)?;
        let spawned = command.stdin(Stdio::piped()).spawn();
        self.running.push(spawned.with_context(|| text.to_owned())?);
        Ok(())
    }

    /// Starts another command of this program beside them.
    pub(super) fn spawn_pcc(&mut self, arguments: &[&str]) -> anyhow::Result<()> {
        self.spawn(&std::env::current_exe()?, arguments, arguments[0])
    }

    /// Carries out another command of this program.
    ///
    /// # Errors
    /// Where it fails, with what it says at its end.
    pub(super) fn pcc(&self, arguments: &[&str]) -> anyhow::Result<()> {
        let name = arguments[0];
        let status = self
            .command(&std::env::current_exe()?, arguments, name)?
            .status()?;
        let said = fs::read_to_string(self.logs.join(format!("{name}.log"))).unwrap_or_default();
        let last = said.lines().next_back().unwrap_or_default();
        ensure!(
            status.success(),
            "pcc {}: {last}; logs in {}; the same command goes on from here",
            arguments.join(" "),
            self.logs.display()
        );
        Ok(())
    }

    /// Ends the process that was started last.
    ///
    /// # Errors
    /// Where it fails.
    pub(super) fn end_last(&mut self) -> anyhow::Result<()> {
        let mut last = self.running.pop().context("nothing runs")?;
        drop(last.stdin.take());
        let status = last.wait()?;
        ensure!(
            status.success(),
            "what ran beside ended with {status}; logs in {}",
            self.logs.display()
        );
        Ok(())
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for child in &mut self.running {
            drop(child.stdin.take());
            // Nothing can be done about a process that cannot be waited for.
            let _ = child.wait();
        }
        let _ = fs::remove_dir_all(&self.root);
        let left = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        let own = left.filter(|it| {
            it.file_name()
                .to_string_lossy()
                .starts_with(&format!("{}_", self.prefix))
        });
        own.for_each(|it| drop(fs::remove_file(it.path())));
    }
}
