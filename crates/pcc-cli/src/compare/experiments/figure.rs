//! A figure of the page: its pictures, and what is seen.

use crate::compare::figure_name::FigureName;

/// A figure of the page.
pub(crate) struct Figure {
    pub(crate) name: FigureName,
    pub(crate) title: &'static str,
    pub(crate) pictures: Vec<Picture>,
    /// What is seen, as HTML.
    pub(crate) caption: String,
    /// Commands that its numbers are from, where it is drawn from a file in the repository.
    pub(crate) made_by: Option<String>,
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
