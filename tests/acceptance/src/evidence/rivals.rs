//! The paper's rivals beside the authors' own program, on the authors' cases.

use std::fs;

use serde_json::Value;
use tests::programs::repository;

use crate::report::Report;
use crate::runs::{Evaluation, number};
use crate::scale::Scale;

/// Cases of the authors' sample.
const CASES: usize = 60;
/// Percentage points between a rival and the authors' program.
const BAR_POINTS: f64 = 5.0;
/// Each rival, and whose figure of the authors' program it is held against: it has none of `w-rrt-star`.
const RIVALS: [(&str, &str); 5] = [
    ("c-rrt", "c-rrt"),
    ("c-rrt-star", "c-rrt-star"),
    ("w-rrt", "w-rrt"),
    ("w-rrt-star", "w-rrt"),
    ("apf", "apf"),
];

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command =
        "pcc evaluate --dataset tests/data/reference-mixed-sample --candidates 10 --planner …";
    report.group("the paper's rivals", command, |report| {
        let data = repository().join("tests/data");
        let theirs = fs::read_to_string(data.join("reference-timings.json"))?;
        let theirs: Value = serde_json::from_str(&theirs)?;
        let dataset = data.join("reference-mixed-sample");
        for (rival, of_theirs) in RIVALS {
            let evaluation = Evaluation::of("authors-sample", &dataset, rival, CASES);
            let own = evaluation.run(report, scale)?;
            let success = 100.0 * number(&own, "/sampled/success")?;
            let pointer = format!(
                "/baselines_on_reference_mixed_sample_60_cases_10_attempts/{of_theirs}/success"
            );
            let expected = 100.0 * number(&theirs, &pointer)?;
            let cases = number(&own, "/cases")?;
            report.check(
                &format!("{rival}: success on the authors' {cases} cases × 10 attempts"),
                format!("{success:.1} %"),
                &format!("{expected:.1} ± {BAR_POINTS} %, the authors' program's {of_theirs}"),
                (success - expected).abs() <= BAR_POINTS && cases == CASES as f64,
            );
        }
        Ok(())
    });
}
