//! The paper's generator: its speed beside the authors' program, and how much of what is asked for it keeps.

use std::fs;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::{program, repository};

use crate::report::Report;
use crate::runs::{folder, run_pcc};
use crate::scale::Scale;

/// How many times faster than the authors' program.
const FASTER: f64 = 25.0;
/// Percentage points around the paper's share of kept paths.
const SHARE_TOLERANCE: f64 = 3.0;

/// A setting, its name in the timings, and the share of the requested paths that the paper kept, %.
const SETTINGS: [(&str, &str, f64); 2] = [
    ("reference", "mixed_0_1_2_4", 48.6),
    ("obstacle-free", "obstacle_free", 70.6),
];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "pcc dataset --method paper --setting … --threads 1";
    report.group("generator", command, |report| {
        let timings = repository().join("tests/data/reference-timings.json");
        let timings: Value = serde_json::from_str(&fs::read_to_string(timings)?)?;
        for (setting, name, paper) in SETTINGS {
            let reference = timings.pointer(&format!("/dataset/{name}/kept_paths_per_cpu_s"));
            let reference = reference.and_then(Value::as_f64);
            let reference = reference.with_context(|| format!("no timing of {name}"))?;
            measure(report, scale, setting, reference, paper)?;
        }
        Ok(())
    });
}

/// What was asked for, what was kept, and the time of the processor, s.
#[derive(Default)]
struct Made {
    requested: f64,
    kept: f64,
    processor_s: f64,
}

fn measure(
    report: &mut Report,
    scale: Scale,
    setting: &str,
    reference: f64,
    paper: f64,
) -> anyhow::Result<()> {
    let (targets, seeds) = scale.pick((128, 1), (480, 3));
    let mut sum = Made::default();
    for seed in 0..seeds {
        let made = make(setting, targets, 9100 + seed)?;
        sum.requested += made.requested;
        sum.kept += made.kept;
        sum.processor_s += made.processor_s;
    }
    let rate = sum.kept / sum.processor_s;
    let figure = format!(
        "{rate:.0} kept paths a CPU second, {:.1} × the authors' program ({reference})",
        rate / reference
    );
    let name = format!("generator, {setting}: speed of one core over {seeds}×{targets} targets");
    let bar = format!(">= {FASTER} ×");
    report.check(&name, figure, &bar, rate >= FASTER * reference);
    let share = 100.0 * sum.kept / sum.requested;
    let name = format!(
        "generator, {setting}: kept of {} requested paths",
        sum.requested
    );
    let bar = format!("{paper} ± {SHARE_TOLERANCE} %, the paper's");
    let passed = (share - paper).abs() <= SHARE_TOLERANCE;
    report.check(&name, format!("{share:.1} %"), &bar, passed);
    Ok(())
}

fn make(setting: &str, targets: usize, seed: u64) -> anyhow::Result<Made> {
    eprintln!("  making {targets} {setting} targets, seed {seed}");
    let out = folder().join(format!("paper-generator-{setting}-{seed}"));
    // Blocks that are there already would not be made again.
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let (targets, seed) = (targets.to_string(), seed.to_string());
    let mut arguments = vec!["dataset", "--method", "paper", "--setting", setting];
    arguments.extend(["--targets", &targets, "--seed", &seed, "--threads", "1"]);
    arguments.extend(["--out", out.to_str().context("path")?]);
    // Building it, if need be, is not what is measured.
    let _ = program("pcc");
    let before = processor_time_of_children()?;
    run_pcc(&arguments)?;
    let processor_s = processor_time_of_children()? - before;
    let meta: Value = serde_json::from_str(&fs::read_to_string(out.join("dataset_meta.json"))?)?;
    let count = |name: &str| {
        let count = meta.get(name).and_then(Value::as_f64);
        count.with_context(|| format!("dataset_meta.json has no {name}"))
    };
    ensure!(
        processor_s > 0.5,
        "{processor_s} s are too few to say anything"
    );
    Ok(Made {
        requested: count("requested_paths")?,
        kept: count("actual_paths")?,
        processor_s,
    })
}

/// Time that ended child processes have had of the processor, in user and kernel mode, s.
fn processor_time_of_children() -> anyhow::Result<f64> {
    /// The kernel's unit in this file, whatever its own.
    const TICKS_PER_SECOND: f64 = 100.0;
    let stat = fs::read_to_string("/proc/self/stat")?;
    ticks_of_children(&stat)
        .map(|ticks| ticks / TICKS_PER_SECOND)
        .context("/proc/self/stat is not understood")
}

/// `cutime` and `cstime`, the 16th and 17th field; the second is the program's name in brackets.
fn ticks_of_children(stat: &str) -> Option<f64> {
    let (_, after_name) = stat.rsplit_once(") ")?;
    let mut fields = after_name.split(' ').skip(13);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some(next()? + next()?)
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn the_times_of_children_are_found_whatever_the_name() {
        let stat = "7 (a b) c) S 1 7 7 0 -1 4 10 20 0 0 3 4 500 60 20 0 1 0 9 8 7";
        assert_eq!(ticks_of_children(stat), Some(560.0));
        assert_eq!(ticks_of_children("7 (a) S 1"), None);
    }
}
