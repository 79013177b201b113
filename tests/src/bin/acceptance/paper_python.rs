//! Pythons with the packages that independent figures need.

use std::env;
use std::path::PathBuf;
use std::process::Command;

use anyhow::ensure;
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
        ensure!(
            done,
            "{packages} could not be installed ({status:?}); {PYTHON_VARIABLE} may name a Python that has it"
        );
        Ok(())
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    let requirements = repository().join(requirements);
    let install = ["-m", "pip", "install", "--quiet", "-r"];
    run(Command::new(&python).args(install).arg(requirements))?;
    std::fs::write(complete, "")?;
    Ok(python)
}
