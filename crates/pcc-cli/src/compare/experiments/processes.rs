//! Daemon, controller and simulated robot as processes of their own, for as long as a figure needs them.

use crate::compare::arguments::Arguments;
use crate::compare::subject::sha256_of;
use anyhow::{Context, ensure};
use input_files::{MAX_SETTINGS_BYTES, read_text};
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::fs::{self, DirBuilder, File};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf, absolute};
use std::process::{Child, Command, ExitStatus, Stdio};

/// The programs, each with its settings.
const PROGRAMS: [(&str, &str); 3] = [
    ("simulated-robot", "config/simulated-robot.toml"),
    ("controller", "config/controller.toml"),
    (DAEMON, "config/planner-daemon.toml"),
];
const DAEMON: &str = "planner-daemon";

/// What the names of a page's services begin with, before the number of its process.
const PREFIX: &str = "pcc-page-";
const SHARED_MEMORY: &str = "/dev/shm";

/// Runs a program, and ends it with a SIGTERM as soon as standard input ends, so that it does not outlive a parent that is killed; one that
/// takes longer than 3 s over that, as a demonstration whose controller is gone, is killed.
const WHILE_INPUT_LASTS: &str = r#"trap "" INT
exec 3<&0
"$@" </dev/null 3<&- & program=$!
{ read -r _ <&3; kill "$program"; sleep 3; kill -9 "$program"; } 2>/dev/null & watch=$!
wait "$program"; status=$?
kill "$watch" 2>/dev/null
exit "$status""#;

/// The running processes; they end with this value.
pub(super) struct Processes {
    /// Folder and prefix of their services, theirs alone.
    root: PathBuf,
    prefix: String,
    /// Where their settings and logs are.
    folder: PathBuf,
    running: Vec<Child>,
}

/// What the processes are, for records of what they did: hashes of their programs, settings and scenes.
///
/// # Errors
/// As [`Processes::start`].
pub(super) fn identity() -> anyhow::Result<Value> {
    let of = |(name, settings)| -> anyhow::Result<(String, Value)> {
        let program = sha256_of(&program(name)?)?;
        let file = settings_file(settings)?;
        let table = read_settings(file)?;
        let scene = table.get("scene").and_then(|it| it.get("file")?.as_str());
        let scene = scene.map(|it| sha256_of(Path::new(it))).transpose()?;
        let hashes = json!({ "program": program, "settings": sha256_of(file)?, "scene": scene });
        Ok((name.to_owned(), hashes))
    };
    let all = PROGRAMS.into_iter().map(of);
    Ok(Value::Object(all.collect::<anyhow::Result<_>>()?))
}

/// A program beside this one.
fn program(name: &str) -> anyhow::Result<PathBuf> {
    let program = std::env::current_exe()?.with_file_name(name);
    ensure!(
        program.is_file(),
        "{} is not built (cargo build --release -p planner-daemon -p controller -p pcc-cli), which the whole page needs",
        program.display()
    );
    Ok(program)
}

fn settings_file(file: &str) -> anyhow::Result<&Path> {
    ensure!(
        Path::new(file).is_file(),
        "{file} is not here; run the whole page in the repository's folder, or name --sets or --planners"
    );
    Ok(Path::new(file))
}

/// Settings as their file has them, but for the scene's file: it is named by its whole path.
fn read_settings(file: &Path) -> anyhow::Result<toml::Table> {
    let text = read_text(file, MAX_SETTINGS_BYTES)?;
    let mut table: toml::Table = text.parse().with_context(|| file.display().to_string())?;
    let folder = absolute(file.parent().unwrap_or(Path::new(".")))?;
    let named = table.get_mut("scene").and_then(|it| it.get_mut("file"));
    if let Some(toml::Value::String(scene)) = named {
        *scene = utf8(&folder.join(&*scene))?;
    }
    Ok(table)
}

/// A program's settings with what this command was given: robot, weights and threads.
fn settings(name: &str, file: &Path, arguments: &Arguments) -> anyhow::Result<String> {
    let mut table = read_settings(file)?;
    let path = |given: &Path| anyhow::Ok(toml::Value::String(utf8(&absolute(given)?)?));
    table.insert("robot".to_owned(), path(&arguments.robot)?);
    if name == DAEMON {
        table.insert("weights".to_owned(), path(&arguments.models.weights)?);
        if arguments.threads > 0 {
            let threads = i64::try_from(arguments.threads)?;
            table.insert("threads".to_owned(), threads.into());
        }
    }
    Ok(toml::to_string(&table)?)
}

fn utf8(path: &Path) -> anyhow::Result<String> {
    let text = path.to_str().map(str::to_owned);
    text.with_context(|| format!("{} is no text", path.display()))
}

impl Processes {
    /// Starts them with the robot and the weights that this command was given, with their settings and logs in a folder.
    ///
    /// # Errors
    /// Where a program is not beside this one, its settings are not there, or the command was given what the daemon does not read.
    pub(super) fn start(arguments: &Arguments, folder: &Path) -> anyhow::Result<Self> {
        arguments.models.refuse_for_daemon()?;
        let memory = Path::new(SHARED_MEMORY);
        let prefix = format!("{PREFIX}{}", std::process::id());
        let parent = if memory.is_dir() {
            memory.to_owned()
        } else {
            std::env::temp_dir()
        };
        let root = parent.join(&prefix);
        DirBuilder::new().mode(0o700).create(&root)?;
        let mut processes = Self {
            root,
            prefix,
            folder: folder.to_owned(),
            running: Vec::new(),
        };
        fs::create_dir_all(folder)?;
        for (name, file) in PROGRAMS {
            let written = folder.join(format!("{name}.toml"));
            fs::write(&written, settings(name, settings_file(file)?, arguments)?)?;
            let child = processes.spawn(&program(name)?, &["--config", &utf8(&written)?], name)?;
            processes.running.push(child);
        }
        Ok(processes)
    }

    /// A program that ends with this process, whatever ends that.
    fn spawn(&self, program: &Path, arguments: &[&str], log: &str) -> anyhow::Result<Child> {
        let log = File::create(self.folder.join(format!("{log}.log")))?;
        let spawned = Command::new("sh")
            .args(["-c", WHILE_INPUT_LASTS, "sh"])
            .arg(program)
            .args(arguments)
            .env("PCC_ROOT", &self.root)
            .env("PCC_PREFIX", &self.prefix)
            .stdin(Stdio::piped())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn();
        spawned.with_context(|| program.display().to_string())
    }

    /// Starts another command of this program beside them.
    pub(super) fn spawn_pcc(&mut self, arguments: &[&str]) -> anyhow::Result<()> {
        let child = self.spawn(&std::env::current_exe()?, arguments, arguments[0])?;
        self.running.push(child);
        Ok(())
    }

    /// Carries out another command of this program.
    ///
    /// # Errors
    /// Where it fails, with what it says at its end.
    pub(super) fn pcc(&self, arguments: &[&str]) -> anyhow::Result<()> {
        let name = arguments[0];
        let mut child = self.spawn(&std::env::current_exe()?, arguments, name)?;
        // Kept beyond the wait, which would close it: its end is what ends the command.
        let input = child.stdin.take();
        let status = child.wait()?;
        drop(input);
        let said = fs::read_to_string(self.folder.join(format!("{name}.log"))).unwrap_or_default();
        let last = said.lines().next_back().unwrap_or_default();
        ensure!(
            status.success(),
            "pcc {}: {last}; logs in {}; the same command goes on from here",
            arguments.join(" "),
            self.folder.display()
        );
        Ok(())
    }

    /// Ends the process that was started last.
    ///
    /// # Errors
    /// Where it fails.
    pub(super) fn end_last(&mut self) -> anyhow::Result<()> {
        let mut last = self.running.pop().context("nothing runs")?;
        let status = end(&mut last)?;
        ensure!(
            status.success(),
            "what ran beside ended with {status}; logs in {}",
            self.folder.display()
        );
        Ok(())
    }
}

/// Ends a process that ends with its standard input.
fn end(child: &mut Child) -> std::io::Result<ExitStatus> {
    drop(child.stdin.take());
    child.wait()
}

impl Drop for Processes {
    fn drop(&mut self) {
        // Nothing can be done about a process that cannot be waited for.
        self.running.iter_mut().for_each(|it| drop(end(it)));
        remove_services(|process| process == std::process::id());
    }
}

/// Removes the services of pages whose process was killed.
pub(crate) fn remove_what_killed_runs_left() {
    // None of this process are there yet: one of the same number made them.
    remove_services(|process| {
        let is_alive = Path::new("/proc").join(process.to_string()).exists();
        process == std::process::id() || !is_alive
    });
}

/// Removes the services of the pages of some processes, as far as they are this user's.
fn remove_services(of: impl Fn(u32) -> bool) {
    for folder in [PathBuf::from(SHARED_MEMORY), std::env::temp_dir()] {
        let there = fs::read_dir(folder).into_iter().flatten().flatten();
        for entry in there.filter(|it| page_process(&it.file_name()).is_some_and(&of)) {
            let is_folder = entry.file_type().is_ok_and(|it| it.is_dir());
            let _ = match is_folder {
                true => fs::remove_dir_all(entry.path()),
                false => fs::remove_file(entry.path()),
            };
        }
    }
}

/// The process whose page a folder or file of services is of.
fn page_process(name: &OsStr) -> Option<u32> {
    let rest = name.to_str()?.strip_prefix(PREFIX)?;
    rest.split('_').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Args, Command as Line, FromArgMatches};

    fn arguments(line: &[&str]) -> Arguments {
        let words = ["compare", "--out", "x"].iter().chain(line);
        let matches = Arguments::augment_args(Line::new("compare")).get_matches_from(words);
        Arguments::from_arg_matches(&matches).unwrap()
    }

    #[test]
    fn settings_have_what_the_command_was_given() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("planner-daemon.toml");
        let text = "robot = \"a.toml\"\nweights = \"../weights\"\nthreads = 2\n[scene]\nfile = \"s.toml\"\n";
        fs::write(&file, text).unwrap();
        let given = arguments(&["--robot", "/r.toml", "--weights", "/w", "--threads", "1"]);
        let made: toml::Table = settings(DAEMON, &file, &given).unwrap().parse().unwrap();
        let at = |key: &str| made[key].as_str().unwrap();
        assert_eq!((at("robot"), at("weights")), ("/r.toml", "/w"));
        assert_eq!(made["threads"].as_integer(), Some(1));
        let scene = folder.path().join("s.toml");
        assert_eq!(made["scene"]["file"].as_str(), scene.to_str());
        let made: toml::Table = settings("controller", &file, &given)
            .unwrap()
            .parse()
            .unwrap();
        assert_eq!(made["weights"].as_str(), Some("../weights"));
    }

    #[test]
    fn a_program_ends_with_its_input_and_tells_its_own_end() {
        let run = |line: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", WHILE_INPUT_LASTS, "sh", "sh", "-c", line]);
            command.stdin(Stdio::piped()).spawn().unwrap()
        };
        assert_eq!(end(&mut run("exec sleep 100")).unwrap().code(), Some(143));
        let mut deaf = run("trap '' TERM; while true; do sleep 1; done");
        std::thread::sleep(std::time::Duration::from_millis(500));
        assert_eq!(end(&mut deaf).unwrap().code(), Some(137));
        let mut own = run("exit 3");
        let input = own.stdin.take();
        assert_eq!(own.wait().unwrap().code(), Some(3));
        drop(input);
    }

    #[test]
    fn services_of_a_page_are_known_by_its_process() {
        let of = |name: &str| page_process(OsStr::new(name));
        assert_eq!(of("pcc-page-17"), Some(17));
        assert_eq!(of("pcc-page-17_ab.service"), Some(17));
        assert_eq!((of("pcc-page-x"), of("pcc-pages-17")), (None, None));
    }
}
