//! The comparison as a table for people and as one for programs.

use super::comparison::{Comparison, PlannerResult, SetResult};
use super::figures::Figures;
use crate::bootstrap::Interval;

/// A column of `compare.csv`: its name, and the figure.
type Column = (&'static str, fn(&Figures) -> Interval);

const COLUMNS: [Column; 10] = [
    ("success", |it| it.success),
    ("certified", |it| it.certified),
    ("answered", |it| it.answered),
    ("request_s", |it| it.request_s),
    ("seconds_a_success", |it| it.seconds_a_success),
    ("seconds_a_certified", |it| it.seconds_a_certified),
    ("tip_length_ratio", |it| it.tip_length_ratio),
    ("tip_smoothness", |it| it.tip_smoothness),
    ("duration_s", |it| it.duration_s),
    ("modes", |it| it.modes),
];

/// A row a planner, set and number of balls (`all` for all); each figure with the ends of its interval; empty where there is none.
pub(super) fn csv(comparison: &Comparison) -> String {
    let ends = |(name, _): &Column| format!("{name},{name}_low,{name}_high");
    let names: Vec<String> = COLUMNS.iter().map(ends).collect();
    let mut text = format!("set,planner,balls,cases,{}\n", names.join(","));
    for set in &comparison.sets {
        for planner in &set.planners {
            let whole = std::iter::once(("all".to_owned(), &planner.figures.all));
            let by_balls = planner.figures.by_balls.iter();
            let by_balls = by_balls.map(|(balls, figures)| (balls.to_string(), figures));
            for (balls, figures) in whole.chain(by_balls) {
                let cells: Vec<String> = COLUMNS
                    .iter()
                    .map(|column| cells(figures, column))
                    .collect();
                let (set, planner) = (&set.set, &planner.planner);
                text += &format!(
                    "{set},{planner},{balls},{},{}\n",
                    figures.cases,
                    cells.join(",")
                );
            }
        }
    }
    text
}

fn cells(figures: &Figures, (_, figure): &Column) -> String {
    let Interval { value, low, high } = figure(figures);
    let cell = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    [value, low, high].map(cell).join(",")
}

pub(super) fn print(comparison: &Comparison) {
    for SetResult {
        set,
        cases,
        planners,
    } in &comparison.sets
    {
        say!(
            "\n{set}: {cases} cases, {} candidates each; 95 % intervals over targets",
            comparison.candidates
        );
        say!(
            "{:17} {:>22} {:>22} {:>10} {:>9} {:>9} {:>10} {:>6}",
            "",
            "paper's success, %",
            "certified, %",
            "ms/success",
            "tip ratio",
            "smooth",
            "duration,s",
            "modes"
        );
        planners.iter().for_each(print_planner);
    }
}

fn print_planner(
    PlannerResult {
        planner, figures, ..
    }: &PlannerResult,
) {
    let all = &figures.all;
    let number = |it: Interval, scale: f64, digits: usize| {
        it.value.map_or_else(
            || "-".to_owned(),
            |value| format!("{:.digits$}", scale * value),
        )
    };
    let share = |it: Interval| {
        let text = |it: Option<f64>| it.map_or("-".to_owned(), |it| format!("{:.1}", 100.0 * it));
        format!("{} [{}, {}]", text(it.value), text(it.low), text(it.high))
    };
    say!(
        "{planner:17} {:>22} {:>22} {:>10} {:>9} {:>9} {:>10} {:>6}",
        share(all.success),
        share(all.certified),
        number(all.seconds_a_success, 1e3, 2),
        number(all.tip_length_ratio, 1.0, 3),
        number(all.tip_smoothness, 1.0, 1),
        number(all.duration_s, 1.0, 2),
        number(all.modes, 1.0, 1)
    );
}
