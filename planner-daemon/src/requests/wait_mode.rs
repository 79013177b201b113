//! The setting `wait`.

use serde::Deserialize;

/// How the daemon waits for requests.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(try_from = "String")]
pub enum WaitMode {
    /// Polls without sleeping: one processor is always busy.
    Poll,
    /// Sleeps until an event announces a request, and polls every millisecond.
    Event,
}

impl TryFrom<String> for WaitMode {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        match name.as_str() {
            "poll" => Ok(Self::Poll),
            "event" => Ok(Self::Event),
            _ => Err("\"event\" or \"poll\" is needed".to_owned()),
        }
    }
}
