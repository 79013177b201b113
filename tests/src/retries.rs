//! What was asked for again, by cause: a retry that is not seen would hide that something failed.

use std::collections::BTreeMap;
use std::sync::Mutex;

static ASKED_AGAIN: Mutex<BTreeMap<String, usize>> = Mutex::new(BTreeMap::new());

/// Notes a motion that is asked for again, or a fault that had to be reset before the next one.
pub fn note(cause: &str) {
    let cause = without_numbers(cause);
    *ASKED_AGAIN.lock().unwrap().entry(cause).or_default() += 1;
}

/// A cause as it is counted: causes differ in words, not in ids and distances.
#[must_use]
pub fn without_numbers(cause: &str) -> String {
    cause.replace(|c: char| c.is_ascii_digit(), "#")
}

/// What was noted since the last call.
#[must_use]
pub fn take() -> BTreeMap<String, usize> {
    std::mem::take(&mut ASKED_AGAIN.lock().unwrap())
}
