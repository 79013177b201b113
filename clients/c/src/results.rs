//! How motions ended.

use std::ffi::c_char;

use client::ResultView;
use shared_types::message::MotionResult;

use crate::error::or_fail;
use crate::pointer::{free, give, options, time_limit, write};

/// The results of motions: those since it was connected, and the last eight before.
pub struct Results(ResultView);

/// Joins the service of results; the controller need not run yet. Null where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_results_connect(prefix: *const c_char, root: *const c_char) -> *mut Results {
    let connect = || Ok(give(Results(ResultView::connect(&options(prefix, root)?)?)));
    or_fail(connect(), std::ptr::null_mut())
}

/// Ends it; nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_results_free(results: *mut Results) {
    free(results);
}

/// Waits until a trajectory has ended, `timeout_s` seconds at most: 1 and the result, 0 where it has not, -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_results_wait(
    results: *mut Results,
    trajectory_id: u32,
    timeout_s: f64,
    result: *mut MotionResult,
) -> i32 {
    let wait = || {
        let (Results(view), result) = (write(results, "results")?, write(result, "result")?);
        let ended = view.wait_for(trajectory_id, time_limit(timeout_s)?)?;
        if let Some(ended) = &ended {
            *result = ended.values;
        }
        Ok(i32::from(ended.is_some()))
    };
    or_fail(wait(), -1)
}
