//! The setting `planner`.

use serde::Deserialize;

/// What answers requests.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(try_from = "String")]
pub enum PlannerKind {
    /// Each request is planned.
    Pcc,
    /// The first request is planned, and its plan answers all later ones, so that nothing but the transport takes time; nothing is
    /// executed.
    Null,
}

impl TryFrom<String> for PlannerKind {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        match name.as_str() {
            "pcc" => Ok(Self::Pcc),
            "null" => Ok(Self::Null),
            _ => Err("\"pcc\" or \"null\" is needed".to_owned()),
        }
    }
}
