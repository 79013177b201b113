//! The bounded queue of lines before the writing thread.

use std::collections::VecDeque;
use std::hint::spin_loop;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, TryLockError};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

/// Capacity of the queue, lines.
const LINES: usize = 1024;
/// Longest line, bytes; the rest of a longer one is cut off.
const LONGEST: usize = 8192;
/// Attempts of a logging thread to lock the queue, some 10 ns each, before its line is lost.
const LOCK_ATTEMPTS: usize = 2000;
/// Longest sleep of the writing thread: it is woken for every line.
const SLEEP: Duration = Duration::from_millis(100);

/// A bounded queue: putting a line in takes bounded time, whatever the writing thread, or any other, is held up by.
pub(crate) struct Queue {
    waiting: Mutex<VecDeque<Vec<u8>>>,
    writer: OnceLock<Thread>,
    queued: AtomicU64,
    done: AtomicU64,
    lost: AtomicU64,
}

impl Queue {
    pub(crate) fn new() -> Self {
        Self {
            waiting: Mutex::new(VecDeque::with_capacity(LINES)),
            writer: OnceLock::new(),
            queued: AtomicU64::new(0),
            done: AtomicU64::new(0),
            lost: AtomicU64::new(0),
        }
    }

    /// The thread that is woken for a line.
    pub(crate) fn wake(&self, writer: Thread) {
        let _ = self.writer.set(writer);
    }

    /// Appends a line, cut to `LONGEST` bytes, and wakes the writer; counts it as lost where the queue is full or its lock is not free
    /// soon.
    pub(crate) fn push(&self, line: Vec<u8>) {
        self.push_within(line, Duration::ZERO);
    }

    /// The same for a line that may wait so long for its place: what a program says last.
    pub(crate) fn push_within(&self, mut line: Vec<u8>, limit: Duration) {
        if line.len() > LONGEST {
            line.truncate(LONGEST);
            line.extend_from_slice(b"...\n");
        }
        let begin = Instant::now();
        while let Err(refused) = self.try_push(line) {
            if begin.elapsed() >= limit {
                self.lost.fetch_add(1, Ordering::Relaxed);
                return;
            }
            line = refused;
            thread::sleep(Duration::from_millis(1));
        }
        if let Some(writer) = self.writer.get() {
            writer.unpark();
        }
    }

    /// Gives the line back where there is no room, or the lock is not free soon.
    fn try_push(&self, line: Vec<u8>) -> Result<(), Vec<u8>> {
        match self.lock_soon() {
            Some(mut waiting) if waiting.len() < LINES => {
                waiting.push_back(line);
                self.queued.fetch_add(1, Ordering::Release);
                Ok(())
            }
            _ => Err(line),
        }
    }

    /// Locks the queue within bounded time; none where its holder is kept from running: it only moves a line or swaps two queues.
    fn lock_soon(&self) -> Option<MutexGuard<'_, VecDeque<Vec<u8>>>> {
        for _ in 0..LOCK_ATTEMPTS {
            match self.waiting.try_lock() {
                Ok(waiting) => return Some(waiting),
                Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => spin_loop(),
            }
        }
        None
    }

    /// Writes what comes, for ever: the work of the writing thread.
    pub(crate) fn write_to(&self, mut out: impl Write) {
        let (mut batch, mut told) = (VecDeque::with_capacity(LINES), 0);
        loop {
            self.write_waiting(&mut out, &mut batch, &mut told);
            thread::park_timeout(SLEEP);
        }
    }

    fn write_waiting(&self, out: &mut impl Write, batch: &mut VecDeque<Vec<u8>>, told: &mut u64) {
        if let Some(mut waiting) = self.lock_soon() {
            std::mem::swap(&mut *waiting, batch);
        }
        for line in batch.drain(..) {
            if out.write_all(&line).is_err() {
                self.lost.fetch_add(1, Ordering::Relaxed);
            }
            self.done.fetch_add(1, Ordering::Release);
        }
        let lost = self.lost.load(Ordering::Relaxed);
        if lost > *told {
            let text = format!(
                "{} log lines were lost: nobody took them in time\n",
                lost - *told
            );
            if out.write_all(text.as_bytes()).is_ok() {
                *told = lost;
            }
        }
    }

    /// Returns once every line before this call is written, or after `limit`.
    pub(crate) fn wait_until_written(&self, limit: Duration) {
        let (begin, queued) = (Instant::now(), self.queued.load(Ordering::Acquire));
        while self.done.load(Ordering::Acquire) < queued && begin.elapsed() < limit {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The writer of one event, which puts it into the queue as a whole.
pub(crate) struct Line(pub(crate) Arc<Queue>);

impl Write for Line {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        self.0.push(text.to_vec());
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

    /// Takes a line only when it is asked for one, like a pipe that is full.
    struct Held(Receiver<()>, SyncSender<String>);

    impl Write for Held {
        fn write(&mut self, text: &[u8]) -> io::Result<usize> {
            self.0.recv().map_err(io::Error::other)?;
            let _ = self.1.send(String::from_utf8_lossy(text).into_owned());
            Ok(text.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn started(out: impl Write + Send + 'static) -> Arc<Queue> {
        let queue = Arc::new(Queue::new());
        let writing = Arc::clone(&queue);
        let writer = thread::spawn(move || writing.write_to(out));
        queue.wake(writer.thread().clone());
        queue
    }

    #[test]
    fn while_nobody_reads_lines_are_lost_and_counted_and_nobody_waits() {
        let (ask, asked) = sync_channel(0);
        let (tell, told) = sync_channel(4 * LINES);
        let queue = started(Held(asked, tell));
        let sent = 5 * LINES;
        (0..sent).for_each(|line| queue.push(format!("{line}\n").into_bytes()));
        queue.wait_until_written(Duration::from_millis(5));
        let lost = queue.lost.load(Ordering::Relaxed) as usize;
        assert!((3 * LINES..=4 * LINES).contains(&lost), "{lost}");
        let (mut lines, mut told_lost) = (Vec::new(), 0);
        while lines.len() < sent - lost || told_lost < lost {
            ask.send(()).unwrap();
            let line: String = told.recv().unwrap();
            match line.split_once(" log lines") {
                Some((count, _)) => told_lost += count.parse::<usize>().unwrap(),
                None => lines.push(line),
            }
        }
        assert_eq!((lines.len(), told_lost), (sent - lost, lost));
        assert_eq!(lines[0], "0\n");
    }

    #[test]
    fn a_disk_that_is_full_loses_lines_and_ends_nothing() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let queue = started(Full);
        (0..3).for_each(|_| queue.push(b"line\n".to_vec()));
        queue.wait_until_written(Duration::from_secs(60));
        assert_eq!(queue.lost.load(Ordering::Relaxed), 3);
    }

    #[test]
    fn a_thread_that_is_held_with_the_queue_in_its_hand_stalls_nobody() {
        let queue = Queue::new();
        let held = queue.waiting.lock().unwrap();
        queue.push(b"line\n".to_vec());
        drop(held);
        assert_eq!(queue.lost.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn what_a_program_says_last_waits_for_the_queue() {
        let queue = Queue::new();
        let held = queue.waiting.lock().unwrap();
        queue.push(b"lost\n".to_vec());
        thread::scope(|scope| {
            let last =
                scope.spawn(|| queue.push_within(b"last\n".to_vec(), Duration::from_secs(60)));
            thread::sleep(Duration::from_millis(20));
            assert!(!last.is_finished());
            drop(held);
        });
        assert_eq!(*queue.waiting.lock().unwrap(), [b"last\n".to_vec()]);
        assert_eq!(queue.lost.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn a_line_without_end_is_cut() {
        let queue = Queue::new();
        queue.push(vec![b'x'; 10 * LONGEST]);
        assert_eq!(queue.waiting.lock().unwrap()[0].len(), LONGEST + 4);
    }
}
