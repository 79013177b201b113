//! The types that a service carries: those of this protocol, and those of the service that is there.

use std::fmt::{self, Display, Formatter};

use iceoryx2::prelude::{MessagingPattern as Pattern, ServiceName, ipc};
use iceoryx2::service::Service;
use iceoryx2::service::static_config::message_type_details::TypeDetail;
use iceoryx2::service::static_config::messaging_pattern::MessagingPattern;

use super::IpcNode;
use crate::message::Layout;

/// How the names of this project's types begin, before the protocol's version.
const PROTOCOL: &str = "pcc.v";
/// How iceoryx2 calls a header that is none.
const NO_HEADER: &str = "()";

/// The types of a service's messages: of what is published, or of requests and answers, each before its header; none of an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct CarriedTypes(Vec<CarriedType>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct CarriedType {
    name: String,
    bytes: usize,
    alignment: usize,
}

impl CarriedTypes {
    /// Those of these messages, in the order of [`Self::of`].
    pub(super) fn expected(layouts: &[Layout]) -> Self {
        Self(layouts.iter().map(CarriedType::of_layout).collect())
    }

    /// Those of the service with this full name, as it is there; none where it cannot be read.
    pub(super) fn found(node: &IpcNode, name: &ServiceName, pattern: Pattern) -> Option<Self> {
        let details = <ipc::Service as Service>::details(name, node.config(), pattern).ok()??;
        Some(Self::of(details.static_details.messaging_pattern()))
    }

    /// Those of a service that is there.
    pub(super) fn of(pattern: &MessagingPattern) -> Self {
        let details = match pattern {
            MessagingPattern::PublishSubscribe(it) => vec![it.message_type_details()],
            MessagingPattern::RequestResponse(it) => vec![
                it.request_message_type_details(),
                it.response_message_type_details(),
            ],
            _ => Vec::new(),
        };
        let parts = details.iter().flat_map(|it| [it.payload, it.user_header]);
        let types = parts.map(|detail| CarriedType::of_detail(&detail));
        Self(types.filter(|it| it.name != NO_HEADER).collect())
    }

    /// The name of the first one; empty where there is none.
    pub(super) fn first_name(&self) -> String {
        self.0.first().map_or(String::new(), |it| it.name.clone())
    }

    /// The protocol's version that the types' names have, where all have the same one.
    fn version(&self) -> Option<u32> {
        let versions: Option<Vec<u32>> = self.0.iter().map(CarriedType::version).collect();
        let versions = versions?;
        let first = *versions.first()?;
        versions.iter().all(|it| *it == first).then_some(first)
    }
}

impl CarriedType {
    fn of_layout(layout: &Layout) -> Self {
        Self {
            name: layout.type_name.to_owned(),
            bytes: layout.bytes,
            alignment: layout.alignment,
        }
    }

    fn of_detail(detail: &TypeDetail) -> Self {
        Self {
            name: detail.type_name().to_string(),
            bytes: detail.size(),
            alignment: detail.alignment(),
        }
    }

    fn version(&self) -> Option<u32> {
        let (version, _) = self.name.strip_prefix(PROTOCOL)?.split_once('.')?;
        version.parse().ok()
    }
}

impl Display for CarriedTypes {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return formatter.write_str("no type");
        }
        match self.version() {
            Some(version) => write!(formatter, "protocol version {version}: ")?,
            None => formatter.write_str("another protocol: ")?,
        }
        for (index, it) in self.0.iter().enumerate() {
            let before = if index == 0 { "" } else { ", " };
            let CarriedType {
                name,
                bytes,
                alignment,
            } = it;
            write!(
                formatter,
                "{before}{name} ({bytes} bytes, alignment {alignment})"
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Heartbeat, Payload};

    #[test]
    fn types_are_told_with_version_size_and_alignment() {
        assert_eq!(
            CarriedTypes::expected(&[Heartbeat::LAYOUT]).to_string(),
            format!(
                "protocol version {}: pcc.v{0}.Heartbeat (32 bytes, alignment 8)",
                crate::PROTOCOL_VERSION
            )
        );
        assert_eq!(CarriedTypes::expected(&[]).to_string(), "no type");
        let of_another = CarriedTypes(vec![CarriedType {
            name: "somebody.State".to_owned(),
            bytes: 16,
            alignment: 8,
        }]);
        assert_eq!(
            of_another.to_string(),
            "another protocol: somebody.State (16 bytes, alignment 8)"
        );
    }
}
