//! What happens to a process from outside: it is killed, stopped for a while, or one of its threads is held.

use std::fs;
use std::time::Duration;

use rand::RngExt;
use rand_pcg::Pcg64;

use crate::stack::{Part, Stack};
use crate::system_calls::{HeldThread, TraceError};

/// What is done to a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// SIGKILL; it is started again afterwards.
    Kill,
    /// SIGSTOP, and SIGCONT 5 ms to 2 s later.
    Stop,
    /// One thread is held by ptrace for 5 ms to 1 s; the others go on.
    Hold,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Kill, Self::Stop, Self::Hold];

    /// Shortest and longest time, s.
    fn range_s(self) -> (f64, f64) {
        match self {
            Self::Kill => (1e-3, 0.1),
            Self::Stop => (5e-3, 2.0),
            Self::Hold => (5e-3, 1.0),
        }
    }

    /// A time for it, every order of magnitude alike; for a kill, the time until it is started again.
    #[must_use]
    pub fn draw_duration(self, rng: &mut Pcg64) -> Duration {
        let (least, most) = self.range_s();
        let exponent = rng.random_range(least.ln()..most.ln());
        Duration::from_secs_f64(exponent.exp())
    }
}

/// A thread of a process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thread {
    /// The kernel's number.
    pub id: u32,
    /// Its process, its own name, and its place among those of that name.
    pub name: String,
}

/// The threads that a process has now, in the order of their numbers.
#[must_use]
pub fn threads(program: &str, pid: u32) -> Vec<Thread> {
    let folder = fs::read_dir(format!("/proc/{pid}/task"));
    let entries = folder.into_iter().flatten().flatten();
    let mut ids: Vec<u32> = entries
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
        .collect();
    ids.sort_unstable();
    let mut threads: Vec<Thread> = Vec::new();
    for id in ids {
        let name = fs::read_to_string(format!("/proc/{pid}/task/{id}/comm")).unwrap_or_default();
        let name = format!("{program}/{}", name.trim());
        let alike = |thread: &&Thread| thread.name.split(' ').next() == Some(&name);
        let place = 1 + threads.iter().filter(alike).count();
        threads.push(Thread {
            id,
            name: format!("{name} {place}"),
        });
    }
    threads
}

/// A disturbance that has begun and not ended.
#[derive(Debug)]
pub enum Ongoing {
    /// It has to be started again.
    Killed,
    /// It has to be told to go on.
    Stopped,
    /// One of its threads, which ends with this.
    Held(HeldThread, Thread),
}

impl Ongoing {
    /// Begins one; `turn` chooses the thread.
    ///
    /// # Errors
    /// [`TraceError`] where a thread cannot be held.
    pub fn begin(
        stack: &mut Stack,
        part: Part,
        kind: Kind,
        turn: usize,
    ) -> Result<Self, TraceError> {
        match kind {
            Kind::Kill => {
                stack.kill9(part);
                Ok(Self::Killed)
            }
            Kind::Stop => {
                stack.process(part).signal(libc::SIGSTOP);
                Ok(Self::Stopped)
            }
            Kind::Hold => {
                let threads = threads(part.program(), stack.process(part).pid());
                let thread = threads[turn % threads.len()].clone();
                Ok(Self::Held(HeldThread::hold(thread.id)?, thread))
            }
        }
    }

    /// Ends it: the process goes on, or runs anew.
    ///
    /// # Errors
    /// [`TraceError`] where the thread that was held is gone.
    pub fn end(self, stack: &mut Stack, part: Part) -> Result<(), TraceError> {
        match self {
            Self::Killed => stack.start(part),
            Self::Stopped => stack.process(part).signal(libc::SIGCONT),
            Self::Held(held, _) => held.release()?,
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use std::sync::Barrier;

    #[test]
    fn the_threads_of_a_process_are_named_and_told_apart() {
        let (named, looked) = (Barrier::new(3), Barrier::new(3));
        std::thread::scope(|scope| {
            for _ in 0..2 {
                let worker = std::thread::Builder::new().name("alike".to_owned());
                let wait = || {
                    named.wait();
                    looked.wait();
                };
                worker.spawn_scoped(scope, wait).unwrap();
            }
            named.wait();
            let found = threads("me", std::process::id());
            looked.wait();
            let names: Vec<String> = found.into_iter().map(|thread| thread.name).collect();
            for name in ["me/alike 1", "me/alike 2"] {
                assert!(names.iter().any(|known| known == name), "{names:?}");
            }
        });
    }

    #[test]
    fn times_are_of_every_order_of_magnitude() {
        let mut rng = Pcg64::seed_from_u64(1);
        let times: Vec<f64> = (0..1000)
            .map(|_| Kind::Stop.draw_duration(&mut rng).as_secs_f64())
            .collect();
        assert!(times.iter().all(|time| (5e-3..2.0).contains(time)));
        let below = |limit: f64| times.iter().filter(|time| **time < limit).count();
        assert!(below(0.02) > 100 && below(0.2) > 400 && below(1.0) < 950);
    }
}
