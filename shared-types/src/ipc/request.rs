//! Request–response services: `plan` (created by the daemon, opened by clients) and `command`.

use std::fmt::Debug;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{AllocationStrategy, IceoryxSend, PortFactory, ZeroCopySend, ipc};
use iceoryx2::response::Response;
use iceoryx2::service::builder::Builder;
use iceoryx2::service::builder::request_response::{
    Builder as RequestBuilder, RequestResponseOpenError, RequestResponseOpenOrCreateError,
};
use iceoryx2::service::port_factory::client::ClientCreateError;
use iceoryx2::service::port_factory::request_response::PortFactory as RequestResponse;
use iceoryx2::service::port_factory::server::ServerCreateError;

use super::opening::{NODES, open_service};
use super::{IpcError, IpcNode};
use crate::message::{Command, CommandReply, Knot, Layout, Payload, PlanReport, PlanRequest};

/// The open service `plan`.
pub type PlanService = RequestResponse<ipc::Service, PlanRequest, (), [Knot], PlanReport>;
/// Answers plan requests; create it in the thread that uses it.
pub type PlanServer = Server<ipc::Service, PlanRequest, (), [Knot], PlanReport>;
/// Sends plan requests; create it in the thread that uses it.
pub type PlanClient = Client<ipc::Service, PlanRequest, (), [Knot], PlanReport>;
/// A request at the daemon; dropping it without an answer tells the client.
pub type PlanActiveRequest = ActiveRequest<ipc::Service, PlanRequest, (), [Knot], PlanReport>;
/// A request at the client; dropping it cancels.
pub type PlanPending = PendingResponse<ipc::Service, PlanRequest, (), [Knot], PlanReport>;
/// An answer in shared memory: the report is its user header, all candidates' knots its slice.
pub type PlanResponse = Response<ipc::Service, [Knot], PlanReport>;
/// The open service `command`.
pub type CommandService = RequestResponse<ipc::Service, Command, (), CommandReply, ()>;
/// A command at the controller; dropping it without a reply tells the client.
pub type CommandRequest = ActiveRequest<ipc::Service, Command, (), CommandReply, ()>;
/// Answers commands; create it in the thread that uses it.
pub type CommandServer = Server<ipc::Service, Command, (), CommandReply, ()>;
/// Sends commands; create it in the thread that uses it.
pub type CommandClient = Client<ipc::Service, Command, (), CommandReply, ()>;

/// What `plan` carries: requests, answers, and the answers' header.
const PLAN_CARRIES: [Layout; 3] = [PlanRequest::LAYOUT, Knot::LAYOUT, PlanReport::LAYOUT];

/// One live server, and one that died and was not cleaned up yet.
const SERVERS: usize = 2;

/// The settings of a request–response service, equal in every program that opens it. A full buffer loses its oldest entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequestSettings {
    /// Its name behind the prefix.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    /// Who asks.
    pub from: &'static str,
    /// Who answers.
    pub to: &'static str,
    /// Servers at once.
    pub servers: usize,
    /// Clients at once.
    pub clients: usize,
    /// Places of clients that programs leave free which a person uses ([`guest_command_client`]).
    pub reserved_clients: usize,
    /// Requests of one client that wait for an answer at once.
    pub active_requests: usize,
    /// Requests that a client may prepare at once.
    pub request_loans: usize,
    /// Answers to one request that wait at the client.
    pub response_buffer: usize,
    /// Answers to one request that a client may hold at once.
    pub held_responses: usize,
    /// Whether a request counts whose sender waits for no answer.
    pub fire_and_forget: bool,
}

/// The settings of `plan` in a daemon of this capacity.
#[must_use]
pub const fn plan_settings(capacity: &PlanServiceCapacity) -> RequestSettings {
    RequestSettings {
        name: "plan",
        purpose: "A motion is asked for, or the execution of a candidate that was answered before.",
        from: "clients",
        to: "planner-daemon",
        servers: SERVERS,
        clients: capacity.clients,
        reserved_clients: 0,
        active_requests: capacity.active_requests_per_client,
        request_loans: REQUEST_LOANS,
        response_buffer: RESPONSES,
        held_responses: HELD_ANSWERS,
        fire_and_forget: false,
    }
}

/// The settings of `command`.
pub const COMMAND: RequestSettings = RequestSettings {
    name: "command",
    purpose: "The controller is ordered to stop, to pause, to go on, to change its speed, or to leave a fault.",
    from: "clients, planner-daemon",
    to: "controller's guard",
    servers: SERVERS,
    clients: 32,
    reserved_clients: 8,
    active_requests: 2,
    request_loans: REQUEST_LOANS,
    response_buffer: RESPONSES,
    held_responses: 1,
    // A stop arrives also when its sender no longer waits for the reply.
    fire_and_forget: true,
};
/// Responses that one request's buffer holds (a newer one takes the place of one not read yet), and that the server
/// prepares for it.
const RESPONSES: usize = 1;
/// Answers that a client holds of one plan request: an early one, and the whole one.
const HELD_ANSWERS: usize = 2;
/// Requests that a client may prepare at once.
const REQUEST_LOANS: usize = 2;

/// How much the daemon serves at once: it decides the shared memory ([`super::plan_bytes`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanServiceCapacity {
    /// Clients connected at once; default 4.
    pub clients: usize,
    /// Requests of one client at once, its queue included; default 4.
    pub active_requests_per_client: usize,
    /// Candidates of one answer, at most [`crate::capacity::MAX_CANDIDATES`]; default 16.
    pub candidates: usize,
    /// Knots of one candidate, at most [`crate::capacity::MAX_KNOTS`]; default 96.
    pub knots_per_candidate: usize,
}

impl Default for PlanServiceCapacity {
    fn default() -> Self {
        Self {
            clients: 4,
            active_requests_per_client: 4,
            candidates: 16,
            knots_per_candidate: 96,
        }
    }
}

impl PlanServiceCapacity {
    /// Knots that one answer can carry.
    #[must_use]
    pub const fn knots_per_response(&self) -> usize {
        self.candidates * self.knots_per_candidate
    }
}

/// Opens or creates `plan`: the daemon's side.
///
/// If clients outlived a daemon, their service is opened again and keeps the capacity it was created with, which must
/// suffice.
///
/// # Errors
/// [`IpcError::Incompatible`] if the service is there with less capacity, or any other [`IpcError`].
pub fn plan_service(
    node: &IpcNode,
    capacity: &PlanServiceCapacity,
) -> Result<PlanService, IpcError> {
    let settings = plan_settings(capacity);
    let open = |builder: Builder<ipc::Service>| {
        let builder = builder.request_response::<PlanRequest, [Knot]>();
        let builder = builder.response_user_header::<PlanReport>();
        with_settings(builder, &settings).open_or_create()
    };
    open_service(node, settings.name, &PLAN_CARRIES, open)
}

fn with_settings<Asked, Answer, Header>(
    builder: RequestBuilder<Asked, (), Answer, Header, ipc::Service>,
    settings: &RequestSettings,
) -> RequestBuilder<Asked, (), Answer, Header, ipc::Service>
where
    Asked: Debug + ZeroCopySend,
    Answer: Debug + IceoryxSend + ?Sized,
    Header: Debug + ZeroCopySend,
{
    builder
        .enable_safe_overflow_for_requests(true)
        .enable_safe_overflow_for_responses(true)
        .enable_fire_and_forget_requests(settings.fire_and_forget)
        .max_active_requests_per_client(settings.active_requests)
        .max_loaned_requests(settings.request_loans)
        .max_response_buffer_size(settings.response_buffer)
        .max_borrowed_responses_per_pending_response(settings.held_responses)
        .max_servers(settings.servers)
        .max_clients(settings.clients)
        .max_nodes(NODES)
}

/// Opens `plan` as it is: the clients' side.
///
/// # Errors
/// [`IpcError::Missing`] at once if no daemon has created it, or any other [`IpcError`].
pub fn open_plan_service(node: &IpcNode) -> Result<PlanService, IpcError> {
    let open = |builder: Builder<ipc::Service>| {
        let builder = builder.request_response::<PlanRequest, [Knot]>();
        match builder.response_user_header::<PlanReport>().open() {
            Ok(service) => Ok(Some(service)),
            Err(RequestResponseOpenError::DoesNotExist) => Ok(None),
            Err(error) => Err(RequestResponseOpenOrCreateError::RequestResponseOpenError(
                error,
            )),
        }
    };
    let name = plan_settings(&PlanServiceCapacity::default()).name;
    open_service(node, name, &PLAN_CARRIES, open)?.ok_or_else(|| IpcError::Missing {
        service: node.options().service_name(name),
        creator: "the planner-daemon",
    })
}

/// Makes the daemon's server, after cleaning up dead ones.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold the places, or [`IpcError::Failed`] (no shared memory left, for example).
pub fn plan_server(
    node: &IpcNode,
    service: &PlanService,
    capacity: &PlanServiceCapacity,
) -> Result<PlanServer, IpcError> {
    let create = || {
        let builder = service
            .server_builder()
            .max_loaned_responses_per_request(RESPONSES);
        let builder = builder.initial_max_slice_len(capacity.knots_per_response());
        builder
            .allocation_strategy(AllocationStrategy::Static)
            .create()
    };
    server(node, service, create)
}

/// Makes a client of `plan`, after cleaning up dead ones.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold all places, or [`IpcError::Failed`].
pub fn plan_client(node: &IpcNode, service: &PlanService) -> Result<PlanClient, IpcError> {
    client(node, service, || service.client_builder().create())
}

/// Opens or creates `command`: both sides.
///
/// # Errors
/// Any [`IpcError`].
pub fn command_service(node: &IpcNode) -> Result<CommandService, IpcError> {
    let open = |builder: Builder<ipc::Service>| {
        let builder = builder.request_response::<Command, CommandReply>();
        with_settings(builder, &COMMAND).open_or_create()
    };
    let carries = [Command::LAYOUT, CommandReply::LAYOUT];
    open_service(node, COMMAND.name, &carries, open)
}

/// Makes the controller's server of commands, after cleaning up dead ones.
///
/// # Errors
/// As [`plan_server`].
pub fn command_server(node: &IpcNode, service: &CommandService) -> Result<CommandServer, IpcError> {
    server(node, service, || {
        service
            .server_builder()
            .max_loaned_responses_per_request(RESPONSES)
            .create()
    })
}

/// Makes the daemon's client of `command`, after cleaning up dead ones.
///
/// # Errors
/// As [`plan_client`].
pub fn command_client(node: &IpcNode, service: &CommandService) -> Result<CommandClient, IpcError> {
    client(node, service, || service.client_builder().create())
}

/// Makes a client of `command` for a program that a person uses: the daemon gets its own however many give orders.
///
/// # Errors
/// As [`plan_client`].
pub fn guest_command_client(
    node: &IpcNode,
    service: &CommandService,
) -> Result<CommandClient, IpcError> {
    client(node, service, || {
        let taken = service.dynamic_config().number_of_clients();
        if taken + COMMAND.reserved_clients >= COMMAND.clients {
            return Err(ClientCreateError::ExceedsMaxSupportedClients);
        }
        service.client_builder().create()
    })
}

fn server<T>(
    node: &IpcNode,
    service: &impl PortFactory<Service = ipc::Service>,
    create: impl FnMut() -> Result<T, ServerCreateError>,
) -> Result<T, IpcError> {
    let full = ServerCreateError::ExceedsMaxSupportedServers;
    node.make_port(service, "server", create, &full)
}

fn client<T>(
    node: &IpcNode,
    service: &impl PortFactory<Service = ipc::Service>,
    create: impl FnMut() -> Result<T, ClientCreateError>,
) -> Result<T, IpcError> {
    let full = ClientCreateError::ExceedsMaxSupportedClients;
    node.make_port(service, "client", create, &full)
}
