//! What guidance is worth: without it, with post correction, with guided prediction.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::averages;
use crate::compare::case_log::{CaseRecord, DrawnRecord};
use crate::compare::case_sets::CaseSet;
use crate::compare::drawing::{Bar, Bars, COLOURS};
use crate::compare::figure_name::FigureName;
use crate::compare::records::SetRecords;
use crate::sampler::PlannerName;

const VARIANTS: [(PlannerName, &str); 3] = [
    (PlannerName::Diffusion, "none"),
    (PlannerName::DiffusionPost, "post"),
    (PlannerName::DiffusionGuided, "guided"),
];

/// What the paper reports of a setting ("Results" of its ablation), %.
struct Paper {
    success: f64,
    /// Changes by post correction of the mean time and of the mean tip error, and by guided prediction of the time.
    post_time: f64,
    post_tip_error: f64,
    guided_time: f64,
}

const PAPER_FREE: Paper = Paper {
    success: 99.62,
    post_time: 15.1,
    post_tip_error: -55.6,
    guided_time: 60.4,
};
const PAPER_MIXED: Paper = Paper {
    success: 91.11,
    post_time: 56.8,
    post_tip_error: -45.4,
    guided_time: 102.2,
};

/// A panel: title, unit, and the values of a variant's records.
type Panel = (&'static str, &'static str, fn(&CaseRecord) -> Vec<f64>);

/// Panels of each kind of scenes; those without balls have no clearance.
const PANELS: [Panel; 4] = [
    ("Success of a case", "%", |record| {
        vec![100.0 * record.successes as f64 / record.asked as f64]
    }),
    ("Tip error of successes", "% of robot length", |record| {
        let errors = record.drawn.iter().filter(|it| it.is_success);
        errors.map(|it| 100.0 * it.tip_error / 3.0).collect()
    }),
    ("Sampling time of a path", "ms", |record| {
        let seconds = record.sampling_s.into_iter();
        seconds.map(|it| 1e3 * it / record.asked as f64).collect()
    }),
    ("Clearance of all paths", "L", |record| {
        clearances(&record.drawn)
    }),
];

fn clearances(drawn: &[DrawnRecord]) -> Vec<f64> {
    drawn.iter().filter_map(|it| it.clearance).collect()
}

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let planners = VARIANTS.map(|(planner, _)| planner);
    let count = bench.arguments.cases();
    let free = bench.answers(&CaseSet::OBSTACLE_FREE, count, &planners)?;
    let mixed = bench.answers(&CaseSet::REFERENCE, count, &planners)?;
    let mut pictures = Vec::new();
    for (set, panels, id) in [
        (&free, &PANELS[..3], "ablation-free"),
        (&mixed, &PANELS[..], "ablation-mixed"),
    ] {
        for (index, panel) in panels.iter().enumerate() {
            let drawn = picture(set, panel)?;
            pictures.push(if index == 0 {
                drawn.in_new_row().with_id(id)
            } else {
                drawn
            });
        }
    }
    Ok(Figure {
        name: FigureName::Ablation,
        title: "Ablation of guidance",
        pictures,
        caption: format!(
            "The paper's sampler without guidance, with post correction and with guided prediction, {} unseen cases each without balls and of the mixed reference \
             scenes (none to four balls), {} candidates a case, {}. Bars are means, whiskers the 5th and 95th percentiles: of cases (success, \
             time) and of paths (tip error ÷ 3 L, clearance of the nine points that the criterion looks at; below 0 they touch). All three begin with the \
             same noise. {}; {}.",
            free.cases.len(),
            bench.arguments.candidates,
            bench.models().sampling(),
            changes("Without balls", &free, &PAPER_FREE)?,
            changes("mixed", &mixed, &PAPER_MIXED)?
        ),
        made_by: None,
    })
}

/// What post correction and guided prediction change of the mean time and the mean tip error, beside the paper's.
fn changes(scenes: &str, set: &SetRecords, paper: &Paper) -> anyhow::Result<String> {
    let [success, tip_error, time, _] = PANELS.map(|(_, _, values)| values);
    let mean = |planner, values: fn(&CaseRecord) -> Vec<f64>| -> anyhow::Result<f64> {
        Ok(averages::mean(set.of(planner)?.iter().flat_map(values)).unwrap_or(f64::NAN))
    };
    let change = |planner, values| -> anyhow::Result<f64> {
        Ok(100.0 * (mean(planner, values)? / mean(PlannerName::Diffusion, values)? - 1.0))
    };
    let (post, guided) = (PlannerName::DiffusionPost, PlannerName::DiffusionGuided);
    Ok(format!(
        "{scenes}: post correction succeeds in {:.2} % (the paper's: {:.2} %), changes the mean time by {:+.1} % ({:+.1} %) and the mean tip error by {:+.1} % \
         ({:+.1} %); guided prediction the time by {:+.1} % ({:+.1} %) and the tip error by {:+.1} % (“marginal gains”)",
        mean(post, success)?,
        paper.success,
        change(post, time)?,
        paper.post_time,
        change(post, tip_error)?,
        paper.post_tip_error,
        change(guided, time)?,
        paper.guided_time,
        change(guided, tip_error)?,
    ))
}

fn picture(set: &SetRecords, (title, unit, values): &Panel) -> anyhow::Result<Picture> {
    let mut bars = Vec::new();
    for ((planner, name), colour) in VARIANTS.into_iter().zip(COLOURS) {
        let values: Vec<f64> = set.of(planner)?.iter().flat_map(values).collect();
        bars.extend(Bar::of(name, &values, colour));
    }
    let chart = Bars { title, unit, bars };
    Ok(Picture::new(chart.svg()?, format!("{} cases", set.set)))
}
