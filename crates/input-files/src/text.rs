//! Texts of unknown length, as messages quote them.

use std::path::Path;

/// Most characters of either end of a line that a message quotes.
const QUOTED: usize = 120;

/// A text whose lines may be as long as a file: without the middles of its long lines.
#[must_use]
pub fn shortened(text: &str) -> String {
    let lines = text.lines().map(|line| {
        let length = line.chars().count();
        if length <= 2 * QUOTED {
            return line.to_owned();
        }
        let begin: String = line.chars().take(QUOTED).collect();
        let end: String = line.chars().skip(length - QUOTED).collect();
        format!("{begin} … {end}")
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// A path as a message has it: in quotes, without the middle of a long one.
#[must_use]
pub fn shown(path: &Path) -> String {
    shortened(&format!("{path:?}"))
}
