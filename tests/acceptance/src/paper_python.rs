//! Pythons with the packages that independent figures need.

use std::env;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, ensure};
use tests::programs::repository;

/// A Python that has what the scripts' requirements name, where it is not to be installed.
const PYTHON_VARIABLE: &str = "PCC_REFERENCE_PYTHON";

/// One with PyTorch and ONNX Runtime.
pub(crate) fn reference_python() -> anyhow::Result<PathBuf> {
    let requirements = "scripts/requirements-bench.txt";
    python_with("venv-paper", requirements, "PyTorch and ONNX Runtime")
}

/// The named Python, or an environment of its own in `target/`, made from PyPI if it is not there yet.
pub(crate) fn python_with(
    folder: &str,
    requirements: &str,
    packages: &str,
) -> anyhow::Result<PathBuf> {
    if let Some(python) = env::var_os(PYTHON_VARIABLE) {
        return Ok(python.into());
    }
    let requirements = repository().join(requirements);
    let installed = environment(folder, packages, |pip| {
        pip.arg("-r").arg(&requirements);
    });
    installed.with_context(|| format!("{PYTHON_VARIABLE} may name a Python that has {packages}"))
}

/// An environment of its own in `target/`, with what pip installs, made from PyPI if it is not there yet.
pub(crate) fn environment(
    folder: &str,
    packages: &str,
    install: impl FnOnce(&mut Command),
) -> anyhow::Result<PathBuf> {
    let folder = repository().join("target").join(folder);
    let (python, complete) = (folder.join("bin/python"), folder.join("complete"));
    if complete.exists() {
        return Ok(python);
    }
    eprintln!(
        "  installing {packages} from PyPI into {}",
        folder.display()
    );
    let run = |command: &mut Command| {
        let status = command.status();
        let done = status.as_ref().is_ok_and(std::process::ExitStatus::success);
        ensure!(done, "{packages} could not be installed ({status:?})");
        Ok(())
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    let mut pip = Command::new(&python);
    install(pip.args(["-m", "pip", "install", "--quiet"]));
    run(&mut pip)?;
    std::fs::write(complete, "")?;
    Ok(python)
}
