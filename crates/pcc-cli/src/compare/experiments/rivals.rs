//! The paper's comparison of planners: success and time.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::bootstrap::Interval;
use crate::compare::case_log::CaseRecord;
use crate::compare::case_sets::CaseSet;
use crate::compare::charts::named_rows;
use crate::compare::drawing::{Bar, COLOURS};
use crate::compare::figure_name::FigureName;
use crate::sampler::{PlannerName, name_of};

/// This project's planner, the paper's, and the paper's rivals.
const PLANNERS: [PlannerName; 8] = [
    PlannerName::Default,
    PlannerName::Fast,
    PlannerName::DiffusionPost,
    PlannerName::CRrt,
    PlannerName::CRrtStar,
    PlannerName::WRrt,
    PlannerName::WRrtStar,
    PlannerName::Apf,
];

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let count = bench.arguments.cases();
    let set = bench.answers(&CaseSet::REFERENCE, count, &PLANNERS)?;
    let names = PLANNERS.map(|planner| name_of(&planner));
    let rows = |values: fn(&CaseRecord) -> Option<f64>| -> anyhow::Result<Vec<(&str, Interval)>> {
        let row = |(planner, name)| {
            let values: Vec<f64> = set.of(planner)?.iter().filter_map(values).collect();
            Ok((name, spread(&values)))
        };
        PLANNERS
            .into_iter()
            .zip(names.iter().map(String::as_str))
            .map(row)
            .collect()
    };
    let success = rows(|record| Some(record.successes as f64 / record.asked as f64))?;
    let time = rows(|record| {
        (record.successes > 0).then(|| 1e3 * record.drawing_s / record.successes as f64)
    })?;
    Ok(Figure {
        name: FigureName::Comparison,
        title: "Success and time beside the paper's rivals",
        pictures: vec![
            Picture::new(
                named_rows("Success by the paper's criterion", false, &success)?,
                "mean over cases, 5th to 95th percentile",
            ),
            Picture::new(
                named_rows("Milliseconds a successful path (log)", true, &time)?,
                "mean over cases with a success, 5th to 95th percentile",
            ),
        ],
        caption: format!(
            "{count} unseen mixed reference cases, {} candidates or attempts a case, one case at a time. The time of the rivals is that until their paths are \
             there; that of all other planners is of the whole request, certificates included. The paper has 91.11 % and 34.0 ms a successful path for its planner \
             (on an NVIDIA RTX 5090), about 70 % for workspace RRT, RRT* and APF, and about 65 % for configuration-space RRT and RRT*. The whole page has all {} planners with \
             confidence intervals below.",
            bench.arguments.candidates,
            bench.arguments.planners().len()
        ),
        made_by: None,
    })
}

/// Mean, 5th and 95th percentiles.
fn spread(values: &[f64]) -> Interval {
    let bar = Bar::of("", values, COLOURS[0]);
    Interval {
        value: bar.as_ref().map(|it| it.mean),
        low: bar.as_ref().map(|it| it.p5),
        high: bar.as_ref().map(|it| it.p95),
    }
}
