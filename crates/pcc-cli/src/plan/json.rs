//! An answer as one JSON object, with the knots of all candidates.

use crate::hash_text::hexadecimal;
use client::{Candidate, PlanAnswer};
use serde_json::{Map, Value, json};
use shared_types::codes::{Source, Stage};
use shared_types::message::Knot;
use std::time::Duration;

/// Prints an answer, also one without candidates. A clearance without obstacles is null.
pub(super) fn print_json(answer: &PlanAnswer, round_trip: Duration) {
    let report = answer.report();
    let stages = Stage::ALL.iter().zip(report.stages_ns);
    let stages = stages.map(|(stage, ns)| (stage.text().to_owned(), json!(ns as f64 * 1e-6)));
    let candidates: Vec<Value> = answer.candidates().map(candidate).collect();
    let object = json!({
        "outcome": report.outcome.text(),
        "reason": report.reason,
        "plan_id": report.plan_id,
        "plan_hash": hexadecimal(report.plan_hash),
        "robot_hash": hexadecimal(report.robot_hash),
        "weights_hash": hexadecimal(report.weights_hash),
        "trajectory_id": report.trajectory_id,
        "selected": report.selected,
        "round_trip_ms": 1e3 * round_trip.as_secs_f64(),
        "stages_ms": stages.collect::<Map<_, _>>(),
        "candidates": candidates,
    });
    say!("{object:#}");
}

fn candidate(candidate: Candidate<'_>) -> Value {
    let summary = candidate.summary;
    let knots: Vec<Value> = candidate.knots.iter().map(knot).collect();
    json!({
        "source": Source::try_from(summary.source).map_or("unknown", Source::text),
        "draw": summary.draw,
        "duration_s": summary.duration_s,
        "tip_path_m": summary.tip_path_m,
        "clearance_m": summary.clearance_m,
        "smoothness": summary.smoothness,
        "tip_error_m": summary.tip_error_m,
        "knots": knots,
    })
}

fn knot(knot: &Knot) -> Value {
    json!({
        "time_s": knot.time_s,
        "configuration_rad": knot.configuration_rad,
        "velocity_rad_s": knot.velocity_rad_s,
        "acceleration_rad_s2": knot.acceleration_rad_s2,
    })
}
