//! What pages are told: server-sent events, each one line of JSON.

use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Events that wait for a page; one that is slower is let go of, and joins anew.
const WAITING: usize = 256;

/// What a page that joins is told first, in this order: the whole state, which takes the place of all that it was told before.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kept {
    /// Where a page begins anew.
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

/// An event, and when it was told to a page.
#[derive(Debug)]
pub(super) struct Told {
    pub(super) event: Arc<str>,
    pub(super) at: Instant,
}

/// The pages that are there, and what was told last.
#[derive(Default)]
pub(super) struct Hub(Mutex<State>);

#[derive(Default)]
struct State {
    kept: BTreeMap<Kept, Arc<str>>,
    pages: Vec<SyncSender<Told>>,
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

    /// Tells those that come later no more of it.
    pub(super) fn forget(&self, kept: &Kept) {
        self.lock().kept.remove(kept);
    }

    /// Tells every page that is there.
    pub(super) fn tell(&self, name: &str, value: &impl Serialize) -> anyhow::Result<()> {
        let event = event(name, value)?;
        self.lock().send(&event);
        Ok(())
    }

    /// What a page is to be told from now on: what is kept, and then each event. It ends where the page is too slow.
    pub(super) fn join(&self) -> impl Iterator<Item = Told> + use<> {
        let (page, events) = sync_channel(WAITING);
        let mut state = self.lock();
        let kept: Vec<Told> = state.kept.values().map(Told::now).collect();
        state.pages.push(page);
        kept.into_iter().chain(events)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn send(&mut self, event: &Arc<str>) {
        let has_room = |page: &SyncSender<Told>| match page.try_send(Told::now(event)) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        };
        self.pages.retain(has_room);
    }
}

impl Told {
    fn now(event: &Arc<str>) -> Self {
        Self {
            event: Arc::clone(event),
            at: Instant::now(),
        }
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
    fn a_page_that_joins_is_told_what_is_kept_first_and_a_slow_one_is_let_go_of() {
        let hub = Hub::default();
        hub.keep(Kept::Status, &1).unwrap();
        hub.keep(Kept::View, &2).unwrap();
        hub.keep(Kept::Status, &3).unwrap();
        hub.keep(Kept::Scene("gone".to_owned()), &4).unwrap();
        hub.tell("frame", &4).unwrap();
        hub.forget(&Kept::Scene("gone".to_owned()));
        let slow = hub.join();
        for _ in 0..2 * WAITING {
            hub.tell("frame", &5).unwrap();
        }
        let told: Vec<_> = slow.map(|told| told.event).collect();
        assert_eq!(&*told[0], "event: view\ndata: 2\n\n");
        assert_eq!(&*told[1], "event: status\ndata: 3\n\n");
        assert_eq!(&*told[2], "event: frame\ndata: 5\n\n");
        assert_eq!(told.len(), 2 + WAITING);
    }

    #[test]
    fn each_page_that_joins_is_told_everything_that_is_kept() {
        let hub = Hub::default();
        for source in 0..2 * WAITING {
            hub.keep(Kept::Scene(source.to_string()), &source).unwrap();
        }
        for _ in 0..2 {
            assert_eq!(hub.join().take(2 * WAITING).count(), 2 * WAITING);
        }
    }
}
