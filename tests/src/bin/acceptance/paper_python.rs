//! A Python with PyTorch and ONNX Runtime, for independent figures.

use std::env;
use std::path::PathBuf;
use std::process::Command;

use anyhow::ensure;
use tests::programs::repository;

/// A Python that has what `scripts/requirements-bench.txt` names, where it is not to be installed.
const PYTHON_VARIABLE: &str = "PCC_REFERENCE_PYTHON";

/// The named Python, or an environment of its own, made from PyPI if it is not there yet.
pub(crate) fn reference_python() -> anyhow::Result<PathBuf> {
    if let Some(python) = env::var_os(PYTHON_VARIABLE) {
        return Ok(python.into());
    }
    let folder = repository().join("target/venv-paper");
    let (python, complete) = (folder.join("bin/python"), folder.join("complete"));
    if complete.exists() {
        return Ok(python);
    }
    eprintln!(
        "  installing PyTorch and ONNX Runtime from PyPI into {}",
        folder.display()
    );
    let run = |command: &mut Command| {
        let status = command.status();
        let done = status.as_ref().is_ok_and(std::process::ExitStatus::success);
        ensure!(
            done,
            "PyTorch and ONNX Runtime could not be installed ({status:?}); {PYTHON_VARIABLE} may name a Python that has them"
        );
        Ok(())
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    let requirements = repository().join("scripts/requirements-bench.txt");
    let install = ["-m", "pip", "install", "--quiet", "-r"];
    run(Command::new(&python).args(install).arg(requirements))?;
    std::fs::write(complete, "")?;
    Ok(python)
}
