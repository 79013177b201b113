//! The services that are there now, and who uses them.

use iceoryx2::prelude::{CallbackProgression, ipc};
use iceoryx2::service::Service;

use super::carried::CarriedTypes;
use super::node::user;
use super::{IpcError, IpcOptions};

/// A service that is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LiveService {
    /// Its name behind the prefix.
    pub name: String,
    /// The name of the type that it carries, or that a request is; empty where it is an event.
    pub type_name: String,
    /// The programs that have it open, with their processes.
    pub users: Vec<String>,
    /// Processes that were killed and not cleaned up yet.
    pub dead: usize,
}

/// Lists the services under a prefix, by name; joins none of them.
///
/// # Errors
/// What is wrong with the options, or [`IpcError::Unlisted`].
pub fn live_services(options: &IpcOptions) -> Result<Vec<LiveService>, IpcError> {
    options.prepare()?;
    let prefix = options.service_name("");
    let mut services = Vec::new();
    let listed = <ipc::Service as Service>::list(&options.config()?, |details| {
        let full = details.static_details.name().to_string();
        if let Some(name) = full.strip_prefix(&prefix) {
            let nodes = details.dynamic_details.map(|dynamic| dynamic.nodes);
            let nodes = nodes.unwrap_or_default();
            let mut users: Vec<String> = nodes.iter().filter_map(user).collect();
            let dead = nodes.len() - users.len();
            users.sort_unstable();
            services.push(LiveService {
                name: name.to_owned(),
                type_name: CarriedTypes::of(details.static_details.messaging_pattern())
                    .first_name(),
                users,
                dead,
            });
        }
        CallbackProgression::Continue
    });
    listed.map_err(|reason| IpcError::Unlisted {
        root: options.root.clone(),
        reason: format!("{reason:?}"),
    })?;
    services.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(services)
}
