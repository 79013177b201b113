//! The crate roots of the workspace of the working directory, as cargo names them.

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    targets: Vec<Target>,
}

#[derive(Deserialize)]
struct Target {
    src_path: PathBuf,
}

/// The crate roots that lie in, or are, one of these paths; all of the workspace where none is given.
pub(crate) fn selected(asked: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let all = of_workspace()?;
    if asked.is_empty() {
        return Ok(all);
    }
    let mut found = Vec::new();
    for path in asked {
        let within = path
            .canonicalize()
            .with_context(|| format!("{} is not there", path.display()))?;
        let before = found.len();
        found.extend(all.iter().filter(|root| root.starts_with(&within)).cloned());
        if found.len() == before {
            bail!(
                "{}: not a crate root of this workspace, and none lies in it",
                path.display()
            );
        }
    }
    found.sort();
    found.dedup();
    Ok(found)
}

fn of_workspace() -> anyhow::Result<Vec<PathBuf>> {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let answer = Command::new(cargo)
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .stderr(Stdio::inherit())
        .output()
        .context("cargo cannot be started")?;
    ensure!(answer.status.success(), "cargo metadata: {}", answer.status);
    let metadata: Metadata =
        serde_json::from_slice(&answer.stdout).context("the answer of cargo metadata")?;
    let targets = metadata
        .packages
        .iter()
        .flat_map(|package| &package.targets);
    let roots: Result<Vec<PathBuf>, _> = targets
        .map(|target| Path::canonicalize(&target.src_path))
        .collect();
    let mut roots = roots.context("a crate root that cargo metadata names")?;
    roots.sort();
    Ok(roots)
}
