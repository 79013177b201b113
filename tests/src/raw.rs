//! A client that sends whatever it is told to, valid or not.

use std::thread;
use std::time::Duration;

use iceoryx2::prelude::PortFactory;
use shared_types::PROTOCOL_VERSION;
use shared_types::ipc::{
    IpcError, IpcNode, IpcOptions, PlanClient, PlanService, open_plan_service, plan_client,
};
use shared_types::message::{Knot, PlanReport, PlanRequest};

use crate::process::{TimedOut, wait_for};

/// What can go wrong.
#[derive(Debug, thiserror::Error)]
pub enum RawError {
    /// The service is not available.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// No answer.
    #[error(transparent)]
    TimedOut(#[from] TimedOut),
    /// iceoryx2 refused.
    #[error("iceoryx2: {0}")]
    Transport(String),
}

/// A port on `plan` without any check.
#[derive(Debug)]
pub struct RawClient {
    client: PlanClient,
    _service: PlanService,
    _node: IpcNode,
}

/// An answer as it is on the wire.
#[derive(Clone, Debug)]
pub struct RawAnswer {
    /// Its header.
    pub report: PlanReport,
    /// Its payload.
    pub knots: Vec<Knot>,
}

impl RawClient {
    /// Joins the service of a daemon that runs.
    ///
    /// # Errors
    /// [`RawError`].
    pub fn connect(options: &IpcOptions, limit: Duration) -> Result<Self, RawError> {
        let node = IpcNode::create(options, "raw-client")?;
        let service = wait_for("a daemon serves", limit, || {
            let service = open_plan_service(&node).ok()?;
            (service.dynamic_config().number_of_servers() > 0).then_some(service)
        })?;
        let client = plan_client(&node, &service)?;
        Ok(Self {
            client,
            _service: service,
            _node: node,
        })
    }

    /// Sends a request and waits for its answer.
    ///
    /// # Errors
    /// [`RawError`].
    pub fn ask(&self, wire: &PlanRequest, limit: Duration) -> Result<RawAnswer, RawError> {
        let transport = |error: &dyn std::fmt::Debug| RawError::Transport(format!("{error:?}"));
        let request = self
            .client
            .loan_uninit()
            .map_err(|error| transport(&error))?;
        let pending = request
            .write_payload(*wire)
            .send()
            .map_err(|error| transport(&error))?;
        let answer = wait_for("an answer", limit, || {
            thread::yield_now();
            pending.receive().ok().flatten()
        })?;
        Ok(RawAnswer {
            report: *answer.user_header(),
            knots: answer.payload().to_vec(),
        })
    }
}

/// A good request: from straight to a tip that every robot of the unit size reaches.
#[must_use]
pub fn good_request() -> PlanRequest {
    let mut goals = PlanRequest::ZEROED.goals;
    goals[0].tip_m = [0.0, -1.55, 2.25];
    PlanRequest {
        protocol_version: PROTOCOL_VERSION,
        candidate_count: 2,
        request_id: 1,
        seed: 7,
        deadline_ns: 30_000_000_000,
        sampler: shared_types::codes::Sampler::Straight.code(),
        goal_count: 1,
        goals,
        limits_scale: 1.0,
        ..PlanRequest::ZEROED
    }
}
