//! Time against the length of the tip's path: what planners take for how short a path, and how long motions last.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::averages::median;
use crate::compare::case_sets::CaseSet;
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use crate::compare::records::{Answered, SetRecords};
use crate::sampler::{PlannerName, name_of};

/// Planners that are left out of the first picture: others of their kind are beside them.
const LEFT_OUT: [PlannerName; 4] = [
    PlannerName::Diffusion,
    PlannerName::DiffusionGuided,
    PlannerName::CRrtStar,
    PlannerName::WRrtStar,
];
/// Planners whose motions are told apart.
const MOTIONS_OF: [PlannerName; 3] = [
    PlannerName::Default,
    PlannerName::Straight,
    PlannerName::DiffusionPost,
];
/// Most motions of a planner that are shown.
const MOST_MOTIONS: usize = 300;

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let arguments = bench.arguments;
    let planners = arguments.planners();
    let set = bench.answers(&CaseSet::GENERAL, arguments.cases(), &planners)?;
    let (trades, motions) = (trades(&set), motions(&set)?);
    Ok(Figure {
        name: FigureName::TipLength,
        title: "Time against tip length",
        pictures: vec![
            Picture::new(
                trades.svg()?,
                "each planner: time a certified motion, and how long the tip's path is",
            ),
            Picture::new(
                motions.svg()?,
                format!("certified motions: how long they last (at most {MOST_MOTIONS} a planner)"),
            ),
        ],
        caption: format!(
            "{} unseen general cases. Lower and farther left is better.",
            set.cases.len()
        ),
        made_by: None,
    })
}

/// A point a planner: time a certified motion, and median tip length ÷ distance.
fn trades(set: &SetRecords) -> Lines {
    let answered = set.answered.iter();
    let shown = answered.filter(|it| !LEFT_OUT.contains(&it.planner));
    let lines = shown.zip(COLOURS).filter_map(|(it, colour)| {
        let line = Line::scatter(&name_of(&it.planner), vec![trade(it)?], colour);
        Some(Line { dots: 6, ..line })
    });
    Lines {
        x: Axis::logarithmic("ms a certified motion"),
        y: Axis::linear("median tip length ÷ distance"),
        lines: lines.collect(),
        marks: Vec::new(),
    }
}

/// Tip length and duration of the motions of [`MOTIONS_OF`], at most [`MOST_MOTIONS`] a planner, from cases all over the set.
fn motions(set: &SetRecords) -> anyhow::Result<Lines> {
    let mut lines = Vec::new();
    for (planner, colour) in MOTIONS_OF.into_iter().zip(COLOURS) {
        let motions = set.of(planner)?.iter().flat_map(|it| &it.motions);
        let points: Vec<_> = motions.map(|it| (it.tip_length, it.duration_s)).collect();
        let step = points.len().div_ceil(MOST_MOTIONS).max(1);
        let shown = points.into_iter().step_by(step).collect();
        lines.push(Line::scatter(&name_of(&planner), shown, colour));
    }
    Ok(Lines {
        x: Axis::linear("length of the tip's path, L"),
        y: Axis::linear("duration of the motion, s"),
        lines,
        marks: Vec::new(),
    })
}

/// Time of all requests ÷ certified motions, ms, and the median of their tip length ÷ distance; none without motions.
fn trade(answered: &Answered) -> Option<(f64, f64)> {
    let motions = answered.records.iter().flat_map(|it| &it.motions);
    let ratios: Vec<f64> = motions.map(|it| it.tip_length_ratio).collect();
    let milliseconds = 1e3 * answered.seconds() / ratios.len() as f64;
    Some((milliseconds, median(ratios.into_iter())?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn every_planner_has_a_colour_of_its_own() {
        let compared = PlannerName::value_variants().iter();
        let compared = compared.filter(|it| **it != PlannerName::Proposed);
        let shown = compared.filter(|it| !LEFT_OUT.contains(it)).count();
        assert!(shown <= COLOURS.len(), "{shown}");
    }
}
