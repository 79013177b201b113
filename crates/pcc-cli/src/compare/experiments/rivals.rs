//! The paper's comparison of planners: success and time.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::averages::{mean, percentile};
use crate::bootstrap::Interval;
use crate::compare::case_log::CaseRecord;
use crate::compare::case_sets::CaseSet;
use crate::compare::charts::named_rows;
use crate::compare::figure_name::FigureName;
use crate::compare::figures::Figures;
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
    let set = bench.answers(&CaseSet::REFERENCE, bench.arguments.cases(), &PLANNERS)?;
    let names = PLANNERS.map(|planner| name_of(&planner));
    let figures = PLANNERS.map(|planner| Ok(Figures::of(set.of(planner)?)));
    let figures: Vec<Figures> = figures.into_iter().collect::<anyhow::Result<_>>()?;
    let rows = |figure: fn(&Figures) -> Interval, scale: f64| {
        let intervals = figures.iter().map(|it| figure(it).scaled(scale));
        let names = names.iter().map(String::as_str);
        names.zip(intervals).collect::<Vec<(&str, Interval)>>()
    };
    let of_cases = |value: fn(&CaseRecord) -> Option<f64>| {
        let bars = PLANNERS.iter().zip(&names).map(|(planner, name)| {
            let values = set.of(*planner)?.iter().filter_map(value);
            Ok((name.as_str(), percentiles(values.collect())))
        });
        bars.collect::<anyhow::Result<Vec<(&str, Interval)>>>()
    };
    let success_of_cases = of_cases(|it| Some(it.successes as f64 / it.asked as f64))?;
    let time_of_cases =
        of_cases(|it| (it.successes > 0).then(|| 1e3 * it.drawing_s / it.successes as f64))?;
    let success = rows(|it| it.success, 1.0);
    let time = rows(|it| it.seconds_a_success, 1e3);
    Ok(Figure {
        name: FigureName::Comparison,
        title: "Success and time beside the paper's rivals",
        pictures: vec![
            Picture::new(
                named_rows("Success by the paper's criterion", false, &success)?,
                "of all paths asked for, with 95 % intervals",
            ),
            Picture::new(
                named_rows("Milliseconds a successful path (log)", true, &time)?,
                "time of all cases ÷ successful paths, with 95 % intervals",
            ),
            Picture::new(
                named_rows("Success in a case", false, &success_of_cases)?,
                "mean of the cases, and 5th and 95th percentiles",
            )
            .in_new_row(),
            Picture::new(
                named_rows(
                    "Milliseconds a successful path, in a case (log)",
                    true,
                    &time_of_cases,
                )?,
                "mean of the cases that have one, and 5th and 95th percentiles",
            ),
        ],
        caption: format!(
            "{} unseen mixed reference cases, {} candidates or attempts a case, one case at a time; above with intervals, below with the paper's error bars. The time of the rivals is that until their paths are \
             there; that of all other planners is of the whole request, certificates included. The paper has 91.11 % and 34.0 ms a successful path for its planner \
             (on an NVIDIA RTX 5090), about 70 % for workspace RRT, RRT* and APF, and about 65 % for configuration-space RRT and RRT*. The whole page has all {} planners with \
             confidence intervals below.",
            set.cases.len(),
            bench.arguments.candidates,
            bench.arguments.planners().len()
        ),
        made_by: None,
    })
}

/// The mean of some values, with the 5th and 95th percentiles in place of an interval.
fn percentiles(mut values: Vec<f64>) -> Interval {
    values.sort_by(f64::total_cmp);
    Interval {
        value: mean(values.iter().copied()),
        low: percentile(&values, 0.05),
        high: percentile(&values, 0.95),
    }
}
