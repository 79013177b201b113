//! The text of doc comments for readers who have no Rust.

/// A doc comment as one paragraph, its links as code, without the paths of Rust's modules.
pub(crate) fn plain(doc: &str) -> String {
    let words: Vec<&str> = doc.split_whitespace().collect();
    let mut text = words.join(" ").replace("[`", "`").replace("`]", "`");
    for path in [
        "crate::codes::",
        "crate::capacity::",
        "crate::message::",
        "crate::",
        "super::",
    ] {
        text = text.replace(path, "");
    }
    text
}

/// The code that a field's doc comment says its number is.
pub(crate) fn code_of(doc: &str) -> Option<&str> {
    let behind = doc.trim_start().strip_prefix("[`crate::codes::")?;
    behind.split_once("`]").map(|(name, _)| name)
}
