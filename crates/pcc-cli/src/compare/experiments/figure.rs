//! A figure of the page: its pictures, what is seen, and the command that makes it.

use pcc_model::Point;

/// A figure of the page.
pub(crate) struct Figure {
    /// Its anchor.
    pub(crate) id: &'static str,
    pub(crate) title: &'static str,
    pub(crate) pictures: Vec<Picture>,
    /// What is seen, as HTML.
    pub(crate) caption: String,
    /// What makes it.
    pub(crate) command: String,
}

/// A part of a figure.
pub(crate) struct Picture {
    /// Its anchor, where it has one of its own.
    pub(crate) id: Option<&'static str>,
    /// Whether it begins a row of its own.
    pub(crate) begins_row: bool,
    pub(crate) svg: String,
    pub(crate) caption: String,
}

impl Picture {
    pub(super) fn new(svg: String, caption: impl Into<String>) -> Self {
        Self {
            id: None,
            begins_row: false,
            svg,
            caption: caption.into(),
        }
    }

    pub(super) fn in_new_row(self) -> Self {
        Self {
            begins_row: true,
            ..self
        }
    }

    pub(super) fn with_id(self, id: &'static str) -> Self {
        Self {
            id: Some(id),
            ..self
        }
    }
}

/// Three numbers as an option of the command line takes them.
pub(super) fn words(point: &Point) -> String {
    let words = point
        .iter()
        .map(|it| format!("{}", (it * 1e4).round() / 1e4));
    words.collect::<Vec<_>>().join(" ")
}
