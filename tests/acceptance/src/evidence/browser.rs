//! Headless Chromium, driven by the scripts of `crates/pcc-cli/viewer/browser`.

use std::env;
use std::io::{BufRead, BufReader, Lines};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};

use anyhow::{Context, ensure};
use serde::Deserialize;
use tests::programs::repository;

use crate::report::Report;

/// A browser that is to be used, where it is not one of those on the path.
const BROWSER_VARIABLE: &str = "PCC_CHROMIUM";
/// Names of the browser on the path.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Node with the scripts' package, and a browser.
pub(super) struct Browser {
    folder: PathBuf,
    program: PathBuf,
}

/// What a script says.
#[derive(Deserialize)]
struct Line {
    name: String,
    figure: String,
    bar: String,
    passed: bool,
}

/// A script that runs.
pub(super) struct Script {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Browser {
    /// # Errors
    /// Naming what is not there.
    pub(super) fn find() -> anyhow::Result<Self> {
        let named = env::var_os(BROWSER_VARIABLE).map(PathBuf::from);
        let program = named.or_else(|| BROWSERS.into_iter().find_map(on_path));
        let program = program.with_context(|| {
            format!(
                "no browser: install Chromium, or name one in {BROWSER_VARIABLE} ({} are not there)",
                BROWSERS.join(", ")
            )
        })?;
        on_path("node").context("no node: install Node.js 20 or later, with npm")?;
        let folder = repository().join("crates/pcc-cli/viewer");
        if !folder.join("node_modules/playwright-core").exists() {
            let mut npm = Command::new("npm");
            npm.args(["ci", "--ignore-scripts"]).current_dir(&folder);
            let done = npm.status().context("npm")?.success();
            ensure!(done, "npm ci has failed in {}", folder.display());
        }
        Ok(Self { folder, program })
    }

    /// Starts a script.
    pub(super) fn start(&self, script: &str, arguments: &[String]) -> anyhow::Result<Script> {
        let mut child = Command::new("node")
            .current_dir(&self.folder)
            .env("CHROMIUM", &self.program)
            .arg(format!("browser/{script}"))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()?;
        let out = child.stdout.take().context("no output")?;
        Ok(Script {
            child,
            lines: BufReader::new(out).lines(),
        })
    }
}

impl Script {
    /// Reports its checks until it says a word, or until it ends.
    ///
    /// # Errors
    /// Where it fails.
    pub(super) fn report(
        &mut self,
        report: &mut Report,
        until: Option<&str>,
    ) -> anyhow::Result<()> {
        for line in self.lines.by_ref() {
            let line = line?;
            if Some(line.as_str()) == until {
                return Ok(());
            }
            let line: Line = serde_json::from_str(&line).with_context(|| line.clone())?;
            report.check(&line.name, line.figure, &line.bar, line.passed);
        }
        let status = self.child.wait()?;
        ensure!(
            status.success() && until.is_none(),
            "the browser's script ended early: {status}"
        );
        Ok(())
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn on_path(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    let mut files = env::split_paths(&path).map(|folder| folder.join(name));
    files.find(|file| file.is_file())
}
