//! What pages are told: server-sent events, each one line of JSON.

use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Events that wait for a page; one that is slower is let go of, and joins anew.
const WAITING: usize = 256;

/// What a page that comes later is told first, in this order.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kept {
    View,
    Status,
    Motion,
    /// By the name of its source.
    Scene(String),
}

impl Kept {
    fn event(&self) -> &'static str {
        match self {
            Self::View => "view",
            Self::Status => "status",
            Self::Motion => "motion",
            Self::Scene(_) => "scene",
        }
    }
}

/// The pages that are there, and what was told last.
#[derive(Default)]
pub(super) struct Hub(Mutex<State>);

#[derive(Default)]
struct State {
    kept: BTreeMap<Kept, Arc<str>>,
    pages: Vec<SyncSender<Arc<str>>>,
}

impl Hub {
    /// Tells every page, and those that come later.
    pub(super) fn keep(&self, kept: Kept, value: &impl Serialize) -> anyhow::Result<()> {
        let event = event(kept.event(), value)?;
        let mut state = self.lock();
        state.send(&event);
        state.kept.insert(kept, event);
        Ok(())
    }

    /// Tells every page that is there.
    pub(super) fn tell(&self, name: &str, value: &impl Serialize) -> anyhow::Result<()> {
        let event = event(name, value)?;
        self.lock().send(&event);
        Ok(())
    }

    /// What a page is to be told from now on.
    pub(super) fn join(&self) -> Receiver<Arc<str>> {
        let (page, events) = sync_channel(WAITING);
        let mut state = self.lock();
        for event in state.kept.values() {
            // It is empty, and has room for more than is kept.
            let _ = page.try_send(Arc::clone(event));
        }
        state.pages.push(page);
        events
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn send(&mut self, event: &Arc<str>) {
        let has_room = |page: &SyncSender<Arc<str>>| match page.try_send(Arc::clone(event)) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        };
        self.pages.retain(has_room);
    }
}

fn event(name: &str, value: &impl Serialize) -> anyhow::Result<Arc<str>> {
    let json = serde_json::to_string(value)?;
    Ok(format!("event: {name}\ndata: {json}\n\n").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_comes_later_is_told_what_is_kept_and_a_slow_one_is_let_go_of() {
        let hub = Hub::default();
        hub.keep(Kept::Status, &1).unwrap();
        hub.keep(Kept::View, &2).unwrap();
        hub.keep(Kept::Status, &3).unwrap();
        hub.tell("frame", &4).unwrap();
        let slow = hub.join();
        for _ in 0..2 * WAITING {
            hub.tell("frame", &5).unwrap();
        }
        let told: Vec<_> = slow.iter().collect();
        assert_eq!(&*told[0], "event: view\ndata: 2\n\n");
        assert_eq!(&*told[1], "event: status\ndata: 3\n\n");
        assert_eq!(&*told[2], "event: frame\ndata: 5\n\n");
        assert_eq!(told.len(), WAITING);
    }
}
