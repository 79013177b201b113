//! How much a run measures.

/// How much is done: the full run, or a quick form in which only counts and durations shrink.
#[derive(Clone, Copy)]
pub(crate) struct Scale {
    pub(crate) full: bool,
}

impl Scale {
    /// `quick` or `full`, whichever the run is.
    pub(crate) fn pick<T>(self, quick: T, full: T) -> T {
        if self.full { full } else { quick }
    }
}
