//! The setting `wait`.

use serde::Deserialize;

/// How the daemon waits for requests.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(try_from = "String")]
pub enum WaitMode {
    /// Always looks: one processor is busy.
    Poll,
    /// Sleeps until it is told of a request, and looks every ms.
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
