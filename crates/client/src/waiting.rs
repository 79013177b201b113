//! Waiting for another process: polling with a time limit, and the clean-up of dead nodes meanwhile.

use std::cell::Cell;
use std::fmt;
use std::time::{Duration, Instant};

use shared_types::ipc::{IpcNode, IpcOptions, Role, RoleHolder};

/// Time between two polls where no event is sent, or an answer is overdue.
pub(crate) const POLL_INTERVAL: Duration = Duration::from_micros(50);
/// Time between two clean-ups of dead processes.
const CLEANUP_PERIOD: Duration = Duration::from_millis(100);
/// For how long a process that lives is taken to have its role still.
const ROLE_PERIOD: Duration = Duration::from_secs(1);
/// Longest wait for another process that is cleaning up a dead node.
pub(crate) const CLEANUP_TIMEOUT: Duration = Duration::from_millis(500);
/// Time between two questions whether a call is given up.
const ASK_PERIOD: Duration = Duration::from_millis(50);

/// How long a call may take: a duration, and, where the program asks for that, a question whether it is given up before.
pub struct TimeLimit<'program> {
    begin: Instant,
    limit: Duration,
    ask: Option<&'program dyn Fn() -> bool>,
    asked: Cell<Instant>,
    is_given_up: Cell<bool>,
}

impl From<Duration> for TimeLimit<'_> {
    fn from(limit: Duration) -> Self {
        Self::new(limit)
    }
}

impl fmt::Debug for TimeLimit<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.limit.fmt(formatter)
    }
}

impl<'program> TimeLimit<'program> {
    /// So long from now on.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        let begin = Instant::now();
        Self {
            begin,
            limit,
            ask: None,
            asked: Cell::new(begin),
            is_given_up: Cell::new(false),
        }
    }

    /// The same, but the call ends as if the time were over once `is_given_up` returns true; it is asked every 50 ms while the call waits.
    #[must_use]
    pub fn unless(self, is_given_up: &'program dyn Fn() -> bool) -> Self {
        Self {
            ask: Some(is_given_up),
            ..self
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.begin.elapsed() >= self.limit || self.is_given_up()
    }

    fn is_given_up(&self) -> bool {
        if let Some(ask) = self.ask
            && !self.is_given_up.get()
            && self.asked.get().elapsed() >= ASK_PERIOD
        {
            self.is_given_up.set(ask());
            self.asked.set(Instant::now());
        }
        self.is_given_up.get()
    }

    /// Time that is left until it is over, or is to be looked at again.
    pub(crate) fn remaining(&self) -> Duration {
        let left = self.limit.saturating_sub(self.begin.elapsed());
        match self.ask {
            Some(_) => left.min(ASK_PERIOD),
            None => left,
        }
    }

    /// The whole duration, for messages.
    pub(crate) fn duration(&self) -> Duration {
        self.limit
    }
}

/// Cleans up after dead processes while the one that is waited for does not live, and not too often: that takes milliseconds of a processor,
/// which the daemon may be about to plan on.
#[derive(Debug)]
pub(crate) struct Cleaner {
    role: Role,
    /// The process of that role, where it is known.
    holder: Option<RoleHolder>,
    last: Option<Instant>,
}

impl Cleaner {
    /// For a program that waits for the process of that role, and whose node has just cleaned up.
    pub(crate) fn new(options: &IpcOptions, role: Role) -> Self {
        Self {
            role,
            holder: RoleHolder::find(options, role),
            last: Some(Instant::now()),
        }
    }

    /// Starts a new period: the next clean-up is due at its end.
    pub(crate) fn begin_period(&mut self) {
        self.last = Some(Instant::now());
    }

    /// Makes the next clean-up due now.
    pub(crate) fn make_due(&mut self) {
        self.last = None;
    }

    /// Cleans up at once where the process of the role has ended, and where none is known once in a period; returns whether a process was
    /// found dead.
    pub(crate) fn clean_if_due(&mut self, node: &IpcNode) -> bool {
        let has_ended = self.holder.as_ref().is_some_and(|holder| !holder.lives());
        let period = match self.holder {
            Some(_) => ROLE_PERIOD,
            None => CLEANUP_PERIOD,
        };
        let is_due = self.last.is_none_or(|it| it.elapsed() >= period);
        if !has_ended && !is_due {
            return false;
        }
        let found = RoleHolder::find(node.options(), self.role);
        let before = std::mem::replace(&mut self.holder, found);
        self.begin_period();
        if has_ended {
            // Also what another process is cleaning: what looks alive afterwards is alive.
            node.finish_cleaning(CLEANUP_TIMEOUT);
            return true;
        }
        let known = before.as_ref().zip(self.holder.as_ref());
        let is_known = known.is_some_and(|(before, found)| found.is(before));
        !is_known && node.clean_dead_nodes() > 0
    }
}

/// Calls `poll` until it returns a value or fails, or the limit is over (none). In between it calls `pause` with the time that is left.
pub(crate) fn wait<T, E>(
    limit: &TimeLimit<'_>,
    cleaner: &mut Cleaner,
    node: &IpcNode,
    mut pause: impl FnMut(Duration),
    mut poll: impl FnMut() -> Result<Option<T>, E>,
) -> Result<Option<T>, E> {
    loop {
        if let Some(value) = poll()? {
            return Ok(Some(value));
        }
        if limit.is_over() {
            return Ok(None);
        }
        cleaner.clean_if_due(node);
        pause(limit.remaining());
    }
}

#[cfg(test)]
mod tests {
    use shared_types::ipc::RoleLock;

    use super::*;

    #[test]
    fn who_has_given_a_role_up_and_lives_is_not_waited_for() {
        let directory = tempfile::tempdir().unwrap();
        let options = IpcOptions {
            prefix: "cleaner".to_owned(),
            root: directory.path().join("root"),
        };
        let role = RoleLock::acquire(&options, Role::Controller).unwrap();
        let node = IpcNode::create(&options, "client").unwrap();
        let mut cleaner = Cleaner::new(&options, Role::Controller);
        cleaner.make_due();
        assert!(!cleaner.clean_if_due(&node) && cleaner.holder.is_some());
        drop(role);
        assert!(!cleaner.clean_if_due(&node) && cleaner.holder.is_some());
        cleaner.make_due();
        assert!(!cleaner.clean_if_due(&node) && cleaner.holder.is_none());
    }

    #[test]
    fn a_call_that_is_given_up_is_over_and_stays_so() {
        let asked = Cell::new(0);
        let second_time = || {
            asked.set(asked.get() + 1);
            asked.get() == 2
        };
        let limit = TimeLimit::new(Duration::from_secs(60)).unless(&second_time);
        assert!(!limit.is_over() && asked.get() == 0);
        while !limit.is_over() {
            std::thread::sleep(limit.remaining());
        }
        assert!(limit.is_over() && asked.get() == 2);
        assert!(limit.begin.elapsed() >= 2 * ASK_PERIOD);
    }
}
