//! What figures are drawn from: computed once, and kept as JSON.

use crate::compare::subject::check;
use anyhow::Context;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Instant;

use crate::output_files::write_whole;

/// Data with what they were made by.
#[derive(Deserialize, Serialize)]
pub(super) struct Kept<T> {
    settings: Value,
    /// Where they were made: processor and number of cores.
    pub(super) machine: String,
    /// Time that making them took, s.
    pub(super) seconds: f64,
    pub(super) data: T,
}

/// The data of a file, which are made where it is not there; an error where they were made by other settings.
pub(super) fn keep<T: Serialize + DeserializeOwned>(
    file: &Path,
    settings: &Value,
    machine: &str,
    make: impl FnOnce() -> anyhow::Result<T>,
) -> anyhow::Result<Kept<T>> {
    let name = file.display();
    if !file.exists() {
        let clock = Instant::now();
        let data = make()?;
        let seconds = clock.elapsed().as_secs_f64();
        let made = Kept {
            settings: settings.clone(),
            machine: machine.to_owned(),
            seconds,
            data,
        };
        write_whole(file, &serde_json::to_string(&made)?)?;
    }
    // Also what was just made is read, so that a run which goes on has the same numbers to the last digit.
    let text = fs::read_to_string(file).with_context(|| format!("cannot read {name}"))?;
    let kept: Kept<T> =
        serde_json::from_str(&text).with_context(|| format!("{name}: remove it"))?;
    check(file, &kept.settings, settings)?;
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn data_are_made_once_and_refused_with_other_settings() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("numbers.json");
        let of = |seed: u64| json!({ "seed": seed });
        let made = keep(&file, &of(1), "one", || Ok(vec![0.1, 1.0 / 3.0])).unwrap();
        let again = keep(&file, &of(1), "another", || -> anyhow::Result<Vec<f64>> {
            anyhow::bail!("made twice")
        });
        let again = again.unwrap();
        assert_eq!((again.data, again.machine.as_str()), (made.data, "one"));
        let other = keep(&file, &of(2), "one", || Ok(vec![0.0]));
        let said = other.err().unwrap().to_string();
        assert!(said.contains("seed is 1 there and 2 here"), "{said}");
    }
}
