//! Time against the length of the tip's path: what planners take for how short a path, and how long motions last.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::compare::case_sets::CaseSet;
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use crate::compare::records::Answered;
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
    let shown = set
        .answered
        .iter()
        .filter(|it| !LEFT_OUT.contains(&it.planner));
    let lines = shown
        .zip(COLOURS.into_iter().cycle())
        .filter_map(|(it, colour)| {
            Some(Line::scatter(
                &name_of(&it.planner),
                vec![trade(it)?],
                colour,
            ))
        });
    let planners = Lines {
        x: Axis::logarithmic("ms a certified motion"),
        y: Axis::linear("median tip length ÷ distance"),
        lines: lines.map(|line| Line { dots: 6, ..line }).collect(),
        marks: Vec::new(),
    };
    let mut lines = Vec::new();
    for (planner, colour) in MOTIONS_OF.into_iter().zip(COLOURS) {
        let motions = set.of(planner)?.iter().flat_map(|it| &it.motions);
        let points = motions.map(|it| (it.tip_length, it.duration_s));
        lines.push(Line::scatter(
            &name_of(&planner),
            points.take(MOST_MOTIONS).collect(),
            colour,
        ));
    }
    let motions = Lines {
        x: Axis::linear("length of the tip's path, L"),
        y: Axis::linear("duration of the motion, s"),
        lines,
        marks: Vec::new(),
    };
    Ok(Figure {
        name: FigureName::TipLength,
        title: "Time against tip length",
        pictures: vec![
            Picture::new(
                planners.svg()?,
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

/// Time of all requests ÷ certified motions, ms, and the median of their tip length ÷ distance; none without motions.
fn trade(answered: &Answered) -> Option<(f64, f64)> {
    let motions = answered.records.iter().flat_map(|it| &it.motions);
    let mut ratios: Vec<f64> = motions.map(|it| it.tip_length_ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let seconds: f64 = answered.records.iter().map(|it| it.seconds).sum();
    let median = ratios.get(ratios.len() / 2)?;
    Some((1e3 * seconds / ratios.len() as f64, *median))
}
