//! Requests asked again: each plan that depends on its request alone must be the same, bit for bit.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::{Context, ensure};
use client::Client;
use shared_types::codes::{Outcome, PlanDependence, StartKind};
use shared_types::ipc::IpcOptions;
use shared_types::message::PlanRecord;
use shared_types::valid::{Asked, PlanRequest};

use super::recording::Recording;

/// How long a daemon may take to show up.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Deadline of each request: that of the recorded one may have been kept on a faster machine.
const DEADLINE: Duration = Duration::from_secs(30);

/// What became of the records.
#[derive(Default)]
struct Replayed {
    equal: usize,
    /// Those that differ, by what they are.
    different: Vec<String>,
    /// Those that cannot be asked again, counted by what they depend on.
    left_out: BTreeMap<String, usize>,
}

/// # Errors
/// Where records are missing, the daemon plans for another robot or by other weights, or a plan differs.
pub(super) fn ask_again(recording: &Recording, options: &IpcOptions) -> anyhow::Result<()> {
    let plans = &recording.plans;
    ensure!(
        !plans.is_empty(),
        "the record has no plans; one that `pcc record` wrote while plans were asked for is needed"
    );
    check_whole(plans)?;
    let mut client = Client::connect(options)?;
    client.wait_for_daemon(TIMEOUT)?;
    let mut replayed = Replayed::default();
    for record in plans {
        replayed.ask(&mut client, record)?;
    }
    replayed.report()
}

/// Checks that no record was lost: their numbers rise by one, for each daemon.
fn check_whole(plans: &[PlanRecord]) -> anyhow::Result<()> {
    for pair in plans.windows(2) {
        let [before, after] = [&pair[0], &pair[1]];
        let of_one = before.instance == after.instance;
        ensure!(
            !of_one || after.sequence == before.sequence + 1,
            "records {} to {} are missing: what was lost cannot be replayed",
            before.sequence + 1,
            after.sequence.wrapping_sub(1)
        );
    }
    Ok(())
}

impl Replayed {
    fn ask(&mut self, client: &mut Client, record: &PlanRecord) -> anyhow::Result<()> {
        let depends_on = u32::try_from(record.depends_on).ok();
        let depends_on = depends_on.and_then(|code| PlanDependence::try_from(code).ok());
        let depends_on = depends_on.context("a record depends on what is not known here")?;
        if depends_on != PlanDependence::Nothing {
            *self.left_out.entry(depends_on.to_string()).or_default() += 1;
            return Ok(());
        }
        let answer = client.plan(&replayable_request(record)?, 2 * DEADLINE)?;
        let (now, then) = (answer.report(), &record.report);
        ensure!(
            now.robot_hash == then.robot_hash && now.weights_hash == then.weights_hash,
            "the daemon plans for robot {:016x} by weights {:016x}; recorded are {:016x} and {:016x}",
            now.robot_hash,
            now.weights_hash,
            then.robot_hash,
            then.weights_hash
        );
        // What was to be executed may have been refused for reasons that no record tells.
        let outcome = Outcome::try_from(then.outcome)?;
        let is_same = now.plan_hash == then.plan_hash
            && (now.outcome == outcome || outcome == Outcome::ExecutionRefused);
        if is_same {
            self.equal += 1;
        } else {
            self.different.push(format!(
                "record {}: {outcome}, hash {:016x}; now {}, hash {:016x}",
                record.sequence, then.plan_hash, now.outcome, now.plan_hash
            ));
        }
        Ok(())
    }

    fn report(&self) -> anyhow::Result<()> {
        say!("{} plans are the same, bit for bit", self.equal);
        for (dependence, count) in &self.left_out {
            say!("{count} left out: {dependence}");
        }
        for different in &self.different {
            say!("{different}");
        }
        let count = self.different.len();
        ensure!(count == 0, "{count} plans differ");
        Ok(())
    }
}

/// The request as it was planned, from where it was planned; nothing is executed.
fn replayable_request(record: &PlanRecord) -> anyhow::Result<PlanRequest> {
    let asked = Asked::try_from(&record.request);
    let asked = asked.with_context(|| format!("the request of record {}", record.sequence))?;
    let Asked::Plan(request) = asked else {
        anyhow::bail!("record {} is no plan", record.sequence);
    };
    let is_given = request.start == StartKind::Given;
    Ok(PlanRequest {
        execute: false,
        requested_mono_ns: None,
        begin_mono_ns: None,
        early_candidate_count: None,
        deadline: Some(DEADLINE),
        ignores_live_scene: true,
        start: StartKind::Given,
        start_configuration_rad: record.start_configuration_rad,
        start_velocity_rad_s: if is_given {
            request.start_velocity_rad_s
        } else {
            [0.0; 6]
        },
        start_acceleration_rad_s2: if is_given {
            request.start_acceleration_rad_s2
        } else {
            [0.0; 6]
        },
        ..*request
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(instance: u64, sequence: u64) -> PlanRecord {
        PlanRecord {
            instance,
            sequence,
            ..PlanRecord::ZEROED
        }
    }

    #[test]
    fn a_record_that_is_missing_is_named_and_another_daemon_counts_anew() {
        let whole = [record(1, 5), record(1, 6), record(2, 1), record(2, 2)];
        check_whole(&whole).unwrap();
        let error = check_whole(&[record(1, 5), record(1, 7)]).unwrap_err();
        assert!(error.to_string().contains("records 6 to 6"), "{error}");
    }
}
