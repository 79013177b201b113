//! Request–response services: `plan` (created by the daemon, opened by clients) and `command`.

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{AllocationStrategy, PortFactory, ipc};
use iceoryx2::response::Response;
use iceoryx2::service::builder::Builder;
use iceoryx2::service::builder::request_response::{
    RequestResponseOpenError, RequestResponseOpenOrCreateError,
};
use iceoryx2::service::port_factory::client::ClientCreateError;
use iceoryx2::service::port_factory::request_response::PortFactory as RequestResponse;
use iceoryx2::service::port_factory::server::ServerCreateError;

use super::opening::{NODES, open_service};
use super::{IpcError, IpcNode};
use crate::message::{Command, CommandReply, Knot, PlanReport, PlanRequest};

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

const PLAN: &str = "plan";
const COMMAND: &str = "command";
/// One live server, and one that died and was not cleaned up yet.
pub(super) const SERVERS: usize = 2;
/// Responses that one request's buffer holds (a newer one takes the place of one not read yet), and that the server
/// prepares for it.
pub(super) const RESPONSES: usize = 1;
/// Answers that a client holds of one plan request: an early one, and the whole one.
pub(super) const HELD_ANSWERS: usize = 2;
/// Replies that a client holds of one command.
pub(super) const HELD_REPLIES: usize = 1;
/// Requests that a client may prepare at once.
pub(super) const REQUEST_LOANS: usize = 2;
/// Clients of `command` at once; programs that only watch have none.
pub(super) const COMMAND_CLIENTS: usize = 32;
/// Places of clients of `command` that [`guest_command_client`] leaves free: the daemon gets its own however many give orders.
const RESERVED_COMMAND_CLIENTS: usize = 8;
pub(super) const COMMANDS_PER_CLIENT: usize = 2;

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
    let open = |builder: Builder<ipc::Service>| {
        builder
            .request_response::<PlanRequest, [Knot]>()
            .response_user_header::<PlanReport>()
            .enable_safe_overflow_for_requests(true)
            .enable_safe_overflow_for_responses(true)
            .enable_fire_and_forget_requests(false)
            .max_active_requests_per_client(capacity.active_requests_per_client)
            .max_loaned_requests(REQUEST_LOANS)
            .max_response_buffer_size(RESPONSES)
            .max_borrowed_responses_per_pending_response(HELD_ANSWERS)
            .max_servers(SERVERS)
            .max_clients(capacity.clients)
            .max_nodes(NODES)
            .open_or_create()
    };
    open_service(node, PLAN, open)
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
    open_service(node, PLAN, open)?.ok_or_else(|| IpcError::Missing {
        service: node.options().service_name(PLAN),
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
        builder
            .request_response::<Command, CommandReply>()
            .enable_safe_overflow_for_requests(true)
            .enable_safe_overflow_for_responses(true)
            // A stop arrives also when its sender no longer waits for the reply.
            .enable_fire_and_forget_requests(true)
            .max_active_requests_per_client(COMMANDS_PER_CLIENT)
            .max_loaned_requests(REQUEST_LOANS)
            .max_response_buffer_size(RESPONSES)
            .max_borrowed_responses_per_pending_response(HELD_REPLIES)
            .max_servers(SERVERS)
            .max_clients(COMMAND_CLIENTS)
            .max_nodes(NODES)
            .open_or_create()
    };
    open_service(node, COMMAND, open)
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

/// Makes a client of `command` for a program that a person uses: it leaves eight places free for daemon, controller and robot.
///
/// # Errors
/// As [`plan_client`].
pub fn guest_command_client(
    node: &IpcNode,
    service: &CommandService,
) -> Result<CommandClient, IpcError> {
    client(node, service, || {
        let taken = service.dynamic_config().number_of_clients();
        if taken + RESERVED_COMMAND_CLIENTS >= COMMAND_CLIENTS {
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
