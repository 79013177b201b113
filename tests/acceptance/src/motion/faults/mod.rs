//! Faults while a motion is about to be joined: what the controller does, how far the set-point moves, and how everything goes on.
//!
//! The rows are those of the table "Faults while joining" in docs/control.md.

mod documented;
mod floods;
mod messages;
mod outcome;
mod rows;
mod stand;

use anyhow::Context;

use self::documented::{Documented, table, without_detail};
use self::outcome::Outcome;
use self::rows::{ROWS, Row};
use self::stand::Stand;
use super::setpoints::{no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;

/// How far from its path rounding may bring a set-point, rad.
const ON_PATH_RAD: f64 = 1e-9;
/// Share by which way and time may differ from the documented ones.
const NEAR: f64 = 0.2;

/// Every row on processes of its own.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance motion, faults while joining";
    for row in ROWS {
        report.group(
            &format!("faults while joining: {}", row.name),
            command,
            |report| {
                for _ in 0..scale.pick(1, 3) {
                    inject(report, row)?;
                }
                Ok(())
            },
        );
    }
}

fn inject(report: &mut Report, row: &Row) -> anyhow::Result<()> {
    let mut stand = Stand::new(row.way)?;
    if let Some(intercept) = row.intercept {
        intercept(&mut stand);
    }
    let joining = stand.ask_for_joining()?;
    if row.is_pending {
        stand.wait_until_pending(&joining)?;
    }
    let fault_ns = (row.inject)(&mut stand, &joining)?;
    let heard = stand.settle()?;
    let outcome = Outcome::of(&stand.stack.world.robot, &heard, &joining, fault_ns);
    let recovered = (row.mend)(&mut stand).and_then(|()| stand.executes_anew());
    if recovered.is_err() {
        println!("{}", stand.last_words());
    }
    let mut table = table()?.into_iter();
    let documented = table.find(|it| it.name == without_detail(row.name));
    let documented = documented.with_context(|| format!("{} is not documented", row.name))?;
    show(report, row, &mut stand, &outcome, &recovered, &documented);
    Ok(())
}

fn show(
    report: &mut Report,
    row: &Row,
    stand: &mut Stand,
    outcome: &Outcome,
    recovered: &anyhow::Result<()>,
    documented: &Documented,
) {
    let line = |what: &str| format!("faults while joining, {}: {what}", row.name);
    let moved = [outcome.moved_mm, outcome.rests_after_s];
    let told = |[left, joined]: [&str; 2]| format!("the old motion: {left}; the new one: {joined}");
    let [left, joined] = &outcome.ends;
    report.check(
        &line("what the controller did"),
        told([left, joined]),
        &format!(
            "{}, as docs/control.md says: {}",
            told(row.ends),
            documented.done
        ),
        outcome.ends == row.ends && row.ends.iter().all(|end| documented.says_why(end)),
    );
    let notes = stand.notes();
    let figure = format!(
        "{:.2} mm, {:.3} s, on the old path {}{notes}",
        outcome.moved_mm,
        outcome.rests_after_s,
        outcome
            .path_time_s
            .map_or("none".to_owned(), |time_s| format!("{time_s:.3} s")),
    );
    let (bar, is_kept) = match documented.movement {
        None => (
            "as planned".to_owned(),
            moved.iter().all(|it| it.is_finite()),
        ),
        Some(movement) => {
            let [mm, s] = movement;
            let near = |(moved, documented): (&f64, f64)| (moved / documented - 1.0).abs() <= NEAR;
            let bar = format!("{mm} mm, {s} s within a fifth, as docs/control.md says");
            (bar, moved.iter().zip(movement).all(near))
        }
    };
    report.check(&line("from the fault until rest"), figure, &bar, is_kept);
    report.at_most(
        &line("distance of the set-points in motion from the path that they follow, rad"),
        outcome.off_path_rad,
        ON_PATH_RAD,
    );
    let verdict = stand.judged();
    within_limits(report, &line, verdict);
    no_offences(report, &line, verdict);
    report.check(
        &line("how it recovers, as docs/control.md says"),
        row.recovery.to_owned(),
        &documented.recovery,
        row.recovery == documented.recovery,
    );
    let what = format!("{}, and a new plan is executed to its end", row.recovery);
    let figure = recovered
        .as_ref()
        .map_or_else(|error| format!("{error:#}"), |()| "reached".to_owned());
    report.check(&line("how it recovers"), figure, &what, recovered.is_ok());
}
