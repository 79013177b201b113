//! The table of candidates that `pcc plan` prints.

use client::PlanAnswer;
use shared_types::codes::{Outcome, Source, Stage};
use std::time::Duration;

/// Prints the outcome of an answer, its candidates, and the times of its stages.
pub(crate) fn print_answer(answer: &PlanAnswer, round_trip: Duration) {
    let report = answer.report();
    say!(
        "{}: plan {}, {} candidates, {:.2} ms round trip",
        report.outcome,
        report.plan_id,
        report.candidates.len(),
        1e3 * round_trip.as_secs_f64()
    );
    if report.outcome == Outcome::Ok && !report.reason.is_empty() {
        say!("{}", report.reason);
    }
    say!("  #  source         duration s  tip path m  clearance m  smoothness  tip error m  knots");
    for (index, c) in report.candidates.iter().enumerate() {
        let mark = if report.selected == Some(index) {
            '*'
        } else {
            ' '
        };
        let source = Source::try_from(c.source).map_or("unknown", Source::text);
        say!(
            "{mark} {index:2} {source:14} {:10.3} {:11.4} {:12.4} {:11.3e} {:12.2e} {:6}",
            c.duration_s,
            c.tip_path_m,
            c.clearance_m,
            c.smoothness,
            c.tip_error_m,
            c.knot_count
        );
    }
    say!("{}", stage_times(&report.stages_ns));
    if let Some(id) = report.trajectory_id {
        say!("published for execution as trajectory {id}");
    }
}

fn stage_times(stages_ns: &[u64]) -> String {
    let stage = |(stage, ns): (&Stage, &u64)| format!("{stage} {:.2}", *ns as f64 * 1e-6);
    let parts: Vec<String> = Stage::ALL.iter().zip(stages_ns).map(stage).collect();
    format!("stages, ms: {}", parts.join(", "))
}
