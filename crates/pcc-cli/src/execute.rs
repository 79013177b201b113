//! `pcc execute`: has a candidate of an earlier plan executed.

use std::time::{Duration, Instant};

use anyhow::bail;
use clap::Args;
use client::Client;
use shared_types::capacity::MAX_CANDIDATES;
use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::ipc::IpcOptions;
use shared_types::valid::{PlannedExecution, PreviousPlan};

use crate::follow::Follower;
use crate::number;
use crate::plan::print_answer;

/// How long a running daemon may take to show up or to reply.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Arguments of `pcc execute`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The plan's number, as pcc plan prints it; the daemon has the last 16 of its clients, and the goal's last.
    #[arg(value_parser = number::whole(1, u64::MAX))]
    plan_id: u64,
    /// The candidate, as the table of pcc plan shows it; without it, the selected one.
    #[arg(value_parser = number::whole(0, MAX_CANDIDATES - 1))]
    candidate: Option<usize>,
    /// Wait until the motion has ended, and tell how; fails where it is not reached.
    #[arg(long)]
    wait: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let execution = arguments.execution(mono_now_ns());
    let options = IpcOptions::from_env();
    let mut client = Client::connect(&options)?;
    let mut follower = Follower::connect(&options, arguments.wait)?;
    let clock = Instant::now();
    let answer = client.execute_planned(&execution, TIMEOUT)?;
    let report = answer.report();
    let Some(id) = report
        .trajectory_id
        .filter(|_| report.outcome == Outcome::Ok)
    else {
        bail!("not executed: {}", report.reason);
    };
    print_answer(&answer, clock.elapsed());
    follower.follow(id)
}

impl Arguments {
    /// The request; a stop that is ordered after `begun_ns` (nanoseconds of `CLOCK_MONOTONIC`) holds for it, too.
    fn execution(&self, begun_ns: i64) -> PlannedExecution {
        PlannedExecution {
            request_id: 0,
            plan: PreviousPlan {
                plan_id: self.plan_id,
                candidate: self.candidate,
            },
            begin_mono_ns: None,
            requested_mono_ns: begun_ns,
            robot_hash: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn a_plan_is_named_by_its_number_and_the_selected_candidate_by_none() {
        let line = |words: &str| <Line as clap::Parser>::try_parse_from(words.split(' '));
        let plan = |words| line(words).unwrap().arguments.execution(17);
        assert_eq!(plan("pcc 7").plan.candidate, None);
        let named = plan("pcc 7 3 --wait");
        assert_eq!((named.plan.plan_id, named.plan.candidate), (7, Some(3)));
        assert_eq!(named.requested_mono_ns, 17);
        for wrong in ["pcc", "pcc 0", "pcc 7 64", "pcc -7", "pcc 7 x"] {
            assert!(line(wrong).is_err(), "{wrong}");
        }
    }
}
