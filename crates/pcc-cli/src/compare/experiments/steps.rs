//! Success and time of the paper's sampler against its steps.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::averages;
use crate::cases_hash::hash_of;
use crate::compare::case_log::CaseRecord;
use crate::compare::case_sets::CaseSet;
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use crate::evaluate::{Asked, answer};
use crate::sampler::PlannerName;
use anyhow::Context;
use datasets::Case;
use denoiser::Solver;
use planning::MOST_CORRECTIONS;
use serde::{Deserialize, Serialize};
use serde_json::json;

const STEPS: [usize; 9] = [1, 2, 4, 6, 8, 12, 16, 25, 50];
const SOLVERS: [(Solver, &str, &str); 2] = [
    (Solver::Ddim, "ddim", "DDIM"),
    (Solver::DpmSolver, "dpm-solver", "DPM-Solver++"),
];
const PLANNER: PlannerName = PlannerName::DiffusionPost;

/// What some steps come to.
#[derive(Deserialize, Serialize)]
struct Point {
    steps: usize,
    success: f64,
    /// Sampling alone, ms.
    a_candidate_ms: f64,
}

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let cases = bench.cases(&CaseSet::REFERENCE, bench.scale(20, 100))?;
    let (mut by_steps, mut by_time) = (Vec::new(), Vec::new());
    for ((solver, option, name), colour) in SOLVERS.into_iter().zip(COLOURS) {
        let points = measure(bench, solver, option, &cases)?;
        let line = |x: fn(&Point) -> f64| {
            let points = points.iter().map(|it| (x(it), it.success)).collect();
            Line::measured(name, points, colour)
        };
        by_steps.push(line(|it| it.steps as f64));
        by_time.push(line(|it| it.a_candidate_ms));
    }
    let chart = |name, lines| Lines {
        x: Axis::logarithmic(name),
        y: Axis::share("success"),
        lines,
        marks: Vec::new(),
    };
    Ok(Figure {
        name: FigureName::Steps,
        title: "Success against sampling steps",
        pictures: vec![
            Picture::new(chart("steps", by_steps).svg()?, "by steps"),
            Picture::new(
                chart("ms a candidate, sampling alone", by_time).svg()?,
                "by time",
            ),
        ],
        caption: format!(
            "<code>diffusion-post</code> with both solvers, {} unseen mixed reference cases × {} candidates, success by the paper's criterion as sampled.",
            cases.len(),
            bench.arguments.candidates
        ),
        made_by: None,
    })
}

fn measure(
    bench: &Bench,
    solver: Solver,
    option: &str,
    cases: &[Case],
) -> anyhow::Result<Vec<Point>> {
    let mut points = Vec::new();
    for steps in STEPS {
        let loaded = bench.planner_by(PLANNER, &bench.models().with_steps(steps, solver))?;
        let candidates = bench.arguments.candidates;
        let settings = json!({
            "cases": cases.len(), "cases_hash": hash_of(cases), "candidates": candidates
        });
        let name = format!("steps-{option}-{steps}");
        points.push(bench.keep(&name, &loaded.records, &settings, || {
            let asked = Asked {
                planner: PLANNER,
                candidates,
                corrections: MOST_CORRECTIONS,
            };
            let mut records = Vec::new();
            for (index, case) in cases.iter().enumerate() {
                let seed = bench.arguments.seed.wrapping_add(index as u64);
                let answer = answer(&loaded.planner, asked, seed, case.clone(), None)?;
                records.push(CaseRecord::of(
                    &bench.robot,
                    &bench.subject.machine,
                    index,
                    candidates,
                    &answer,
                ));
            }
            let paths = (cases.len() * candidates) as f64;
            let successes: usize = records.iter().map(|it| it.successes).sum();
            let sampling_s = averages::mean(records.iter().filter_map(|it| it.sampling_s));
            let sampling_s = sampling_s.context("every request was refused")?;
            Ok(Point {
                steps,
                success: successes as f64 / paths,
                a_candidate_ms: 1e3 * sampling_s / candidates as f64,
            })
        })?);
    }
    Ok(points)
}
