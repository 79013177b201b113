//! Figures beside those of an earlier run.

use std::path::Path;

use anyhow::Context;
use input_files::read_text;
use serde_json::Value;

use super::summary::{PERCENTILES, Summary};

/// Most bytes of such a file.
const MOST_BYTES: u64 = 16_000_000;

/// Reads the figures of a file that `--json` wrote.
pub(super) fn read(file: &Path) -> anyhow::Result<Value> {
    let text = read_text(file, MOST_BYTES)?;
    let is_no_json = || {
        let name = file.display();
        format!("{name} is no JSON, and a file that `pcc latency --json` wrote is needed")
    };
    let figures: Value = serde_json::from_str(&text).with_context(is_no_json)?;
    anyhow::ensure!(
        figures["plans"]["times_ms"].is_object(),
        "{} has no plans.times_ms: a file that `pcc latency --json` wrote is needed",
        file.display()
    );
    Ok(figures)
}

/// Shows now ÷ then of each percentile, and in what the loads differ.
pub(super) fn show(before: &Value, load: &Value, now: &Summary) {
    let (then, before) = (&before["load"], &before["plans"]["times_ms"]);
    for (name, now) in load.as_object().into_iter().flatten() {
        if then[name] != *now {
            say!("another load: {name} is {now}, then {}", then[name]);
        }
    }
    say!("now ÷ then:");
    for (name, percentiles) in now.percentiles_ms() {
        let ratios = PERCENTILES
            .iter()
            .zip(percentiles)
            .map(|((percentile, _), ms)| {
                let then = before[name][percentile].as_f64().filter(|then| *then > 0.0);
                then.map_or(format!("{:>9}", "-"), |then| format!("{:>9.3}", ms / then))
            });
        say!("{name:<26}{}", ratios.collect::<String>());
    }
}
