//! Figures beside those of an earlier run.

use std::path::Path;

use anyhow::Context;
use serde_json::Value;

use super::summary::{PERCENTILES, Summary};

/// Reads the figures of a file that `--json` wrote.
pub(super) fn read(file: &Path) -> anyhow::Result<Value> {
    let text = std::fs::read_to_string(file);
    let text = text.with_context(|| format!("cannot read {}", file.display()))?;
    let figures: Value =
        serde_json::from_str(&text).with_context(|| format!("{} is no JSON", file.display()))?;
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
