//! What the daemon was asked for and has answered, for recorders.

use iceoryx2::prelude::ZeroCopySend;

use super::plan::{PlanReport, PlanRequest};
use super::wire::wire_message;
use crate::capacity::DOF;

wire_message! {
    /// A request, of a client or of the daemon itself for the goal that stays, and its whole answer but for the knots (service `plan_record`).
    pub struct PlanRecord: "pcc.v7.PlanRecord", 6984 bytes {
        /// Number of the record among those of this daemon, from 1, without gaps.
        pub sequence: u64,
        /// When it was answered, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// [`super::Heartbeat::instance`] of the daemon.
        pub instance: u64,
        /// [`crate::codes::PlanDependence`]: what the plan depends on beside the request, as wide as the numbers that follow.
        pub depends_on: u64,
        /// Where the plan begins, radians: the request's start, or where the robot was.
        pub start_configuration_rad: [f64; DOF],
        /// The request, as its sender's memory has it when it is answered.
        pub request: PlanRequest,
        /// What it was answered.
        pub report: PlanReport,
    }
}
