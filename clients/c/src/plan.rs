//! Plans: requests, and answers in the daemon's own memory.

use std::ffi::c_char;
use std::ptr::null;

use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::codes::StartKind;
use shared_types::message::{Knot, NONE_SELECTED, PlanReport, PlanRequest};
use shared_types::valid::{self, PlannedExecution};

use crate::error::{Failure, Outcome, or_fail};
use crate::pointer::{free, give, options, read, robot, time_limit, write};

/// A connection to the planner daemon that outlives the daemon's restarts.
pub struct Client(client::Client);

/// An answer, in the daemon's own memory until it is freed.
pub struct Answer(client::PlanAnswer);

/// Joins the services of plans; the daemon need not run yet. A null pointer stands for `PCC_PREFIX` or `PCC_ROOT` of the environment, or
/// the default. Null where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_client_connect(prefix: *const c_char, root: *const c_char) -> *mut Client {
    let connect = || {
        Ok(give(Client(client::Client::connect(&options(
            prefix, root,
        )?)?)))
    };
    or_fail(connect(), std::ptr::null_mut())
}

/// Ends a connection; nothing where the pointer is null. Its answers stay valid.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_client_free(client: *mut Client) {
    free(client);
}

/// States the robot file that this program is set up for: a daemon that plans for another robot refuses what the client asks for from now on
/// (outcome wrong robot). 0, or -1 where the file is none.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_client_state_robot(client: *mut Client, robot_file: *const c_char) -> i32 {
    let state = || {
        let Client(client) = write(client, "client")?;
        client.state_robot(robot(robot_file)?.hash());
        Ok(0)
    };
    or_fail(state(), -1)
}

/// A request for ten candidates from where the robot is, asked for now, with the daemon's defaults; its goals are to be written. It is not
/// executed unless `execute` says so.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_plan_request() -> PlanRequest {
    PlanRequest {
        protocol_version: PROTOCOL_VERSION,
        candidate_count: 10,
        limits_scale: 1.0,
        previous_candidate: NONE_SELECTED,
        start: StartKind::Robot.code(),
        requested_mono_ns: mono_now_ns(),
        ..PlanRequest::ZEROED
    }
}

/// Sends a request and waits for its answer, `timeout_s` seconds in all. Null where there is none; an answer with another outcome than ok
/// is an answer.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_plan(
    client: *mut Client,
    request: *const PlanRequest,
    timeout_s: f64,
) -> *mut Answer {
    let plan = || {
        let request = valid::PlanRequest::try_from(read(request, "request")?)?;
        let Client(client) = write(client, "client")?;
        let answer = client.plan(&request, time_limit(timeout_s)?)?;
        Ok(give(Answer(answer)))
    };
    or_fail(plan(), std::ptr::null_mut())
}

/// Has a candidate of an earlier plan executed exactly as it was answered, and waits for the answer, `timeout_s` seconds in all;
/// [`NONE_SELECTED`] stands for the one that was selected. Null where there is no answer.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_execute(
    client: *mut Client,
    plan_id: u64,
    candidate: u32,
    timeout_s: f64,
) -> *mut Answer {
    let execute = || {
        let candidate = (candidate != NONE_SELECTED).then_some(candidate as usize);
        let execution = PlannedExecution::now(plan_id, candidate);
        let Client(client) = write(client, "client")?;
        let answer = client.execute_planned(&execution, time_limit(timeout_s)?)?;
        Ok(give(Answer(answer)))
    };
    or_fail(execute(), std::ptr::null_mut())
}

/// What happened; valid until the answer is freed. Null where the pointer is.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_answer_report(answer: *const Answer) -> *const PlanReport {
    let report =
        || read(answer, "answer").map(|Answer(answer)| std::ptr::from_ref(answer.wire_report()));
    or_fail(report(), null())
}

/// The knots of a candidate where the daemon wrote them; valid until the answer is freed. Their number is written to `count`. Null where
/// there is no such candidate.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_answer_knots(
    answer: *const Answer,
    candidate: u32,
    count: *mut usize,
) -> *const Knot {
    or_fail(knots(answer, candidate, count), null())
}

fn knots(answer: *const Answer, candidate: u32, count: *mut usize) -> Outcome<*const Knot> {
    let (Answer(answer), count) = (read(answer, "answer")?, write(count, "count")?);
    let of = |missing: usize| {
        Failure::argument(format!(
            "candidate is {candidate}; the answer has {missing}"
        ))
    };
    let found = answer.candidate(candidate as usize);
    let found = found.ok_or_else(|| of(answer.report().candidates.len()))?;
    *count = found.knots.len();
    Ok(found.knots.as_ptr())
}

/// Gives the answer's memory back to the daemon; nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_answer_free(answer: *mut Answer) {
    free(answer);
}
