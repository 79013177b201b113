//! The end of what threads do beside something else.

use std::sync::atomic::{AtomicBool, Ordering};

/// Ends what waits for it once dropped, also by a panic.
pub(super) struct Ends<'a>(pub(super) &'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
