//! What figures are drawn from: computed once, and kept as JSON.

use anyhow::{Context, ensure};
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
    /// Time that making them took, s.
    pub(super) seconds: f64,
    pub(super) data: T,
}

/// The data of a file, which are made where it is not there; an error where they were made by other settings.
pub(super) fn keep<T: Serialize + DeserializeOwned>(
    file: &Path,
    settings: &Value,
    make: impl FnOnce() -> anyhow::Result<T>,
) -> anyhow::Result<Kept<T>> {
    let name = file.display();
    if !file.exists() {
        let clock = Instant::now();
        let data = make()?;
        let seconds = clock.elapsed().as_secs_f64();
        let made = Kept {
            settings: settings.clone(),
            seconds,
            data,
        };
        write_whole(file, &serde_json::to_string(&made)?)?;
    }
    // Also what was just made is read, so that a run which goes on has the same numbers to the last digit.
    let text = fs::read_to_string(file).with_context(|| format!("cannot read {name}"))?;
    let kept: Kept<T> =
        serde_json::from_str(&text).with_context(|| format!("{name}: remove it"))?;
    ensure!(
        kept.settings == *settings,
        "{name} was made by other settings: {}\nthese are: {settings}\nchoose another --out, or remove the file",
        kept.settings
    );
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
        let made = keep(&file, &json!(1), || Ok(vec![0.1, 1.0 / 3.0])).unwrap();
        let again = keep(&file, &json!(1), || -> anyhow::Result<Vec<f64>> {
            anyhow::bail!("made twice")
        });
        assert_eq!(made.data, again.unwrap().data);
        let other = keep(&file, &json!(2), || Ok(vec![0.0]));
        assert!(other.err().unwrap().to_string().contains("other settings"));
    }
}
