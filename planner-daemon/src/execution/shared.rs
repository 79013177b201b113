//! A value that supervision writes and others read.

use std::sync::{Arc, Mutex, PoisonError};

/// A value that supervision writes, and that the service and planning read; nobody holds it for longer than a copy takes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shared<T>(Arc<Mutex<T>>);

impl<T: Clone> Shared<T> {
    pub(crate) fn set(&self, value: T) {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // What was there is dropped when nobody waits any more.
        let _before = std::mem::replace(&mut *held, value);
        drop(held);
    }

    pub(crate) fn get(&self) -> T {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.clone()
    }
}
