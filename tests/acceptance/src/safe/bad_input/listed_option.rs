//! An option of `pcc`, and what a message about it must name.

use super::variant::Fault;
use super::wanted::Wanted;

/// An option as the help lists it.
pub(super) struct Listed {
    pub(super) name: String,
    /// Values that follow it.
    pub(super) values: usize,
    /// The names that are allowed, where it is a choice.
    pub(super) choices: Vec<String>,
}

impl Listed {
    /// The option, and a value of it.
    pub(super) fn fault(&self, value: &str) -> Fault {
        let name = self.name.trim_matches(['<', '>', '[', ']']);
        Fault::option(name, value)
            .or_key(name.trim_start_matches("--"))
            .or_key(&name.to_lowercase())
    }

    /// The same of a text that is tried as one of its values.
    pub(super) fn fault_of(&self, wanted: &Wanted, text: &str) -> Fault {
        // Of a list its first wrong value.
        let told = match self.name.as_str() {
            "--planners" | "--figures" => text.split(',').next().unwrap_or_default(),
            _ => text,
        };
        let mut fault = self.fault(told.trim());
        for alias in wanted.aliases() {
            fault = fault.or_key(alias);
        }
        // Beside the file that is viewed no port is right.
        if self.name == "--port" {
            fault = fault.or_value("used with '--port");
        }
        // clap calls a value that looks like an option an unexpected argument.
        if text.starts_with('-') {
            fault = fault.or_key(text);
        }
        fault
    }
}
