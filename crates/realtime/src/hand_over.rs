//! A queue from one thread to another that wakes its receiver once.
//!
//! A channel of the standard library wakes its receiver while it holds a lock that the receiver needs to wait again: one that has little to do
//! until then sleeps for that lock once more. Here it is free by then (decision 0045).

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Makes both ends of a queue.
#[must_use]
pub fn channel<T>() -> (Sender<T>, Receiver<T>) {
    let shared = Arc::new(Shared {
        queue: Mutex::new(Queue {
            values: VecDeque::new(),
            is_over: false,
        }),
        changed: Condvar::new(),
    });
    (Sender(Arc::clone(&shared)), Receiver(shared))
}

/// Hands values over; the receiver ends once this is dropped and it has taken them all.
#[derive(Debug)]
pub struct Sender<T>(Arc<Shared<T>>);

/// Waits for values, in their order.
#[derive(Debug)]
pub struct Receiver<T>(Arc<Shared<T>>);

#[derive(Debug)]
struct Shared<T> {
    queue: Mutex<Queue<T>>,
    changed: Condvar,
}

#[derive(Debug)]
struct Queue<T> {
    values: VecDeque<T>,
    is_over: bool,
}

impl<T> Shared<T> {
    fn lock(&self) -> MutexGuard<'_, Queue<T>> {
        // Nothing of a caller runs while it is locked.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Queue<T>)) {
        change(&mut self.lock());
        self.changed.notify_one();
    }
}

impl<T> Sender<T> {
    /// Hands a value over; never waits for the receiver, and does not notice where that is gone.
    pub fn send(&self, value: T) {
        self.0.change(|queue| queue.values.push_back(value));
    }
}

impl<T> Drop for Sender<T> {
    fn drop(&mut self) {
        self.0.change(|queue| queue.is_over = true);
    }
}

impl<T> Iterator for Receiver<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        let is_waiting = |queue: &mut Queue<T>| queue.values.is_empty() && !queue.is_over;
        let queue = self.0.changed.wait_while(self.0.lock(), is_waiting);
        let mut queue = queue.unwrap_or_else(PoisonError::into_inner);
        queue.values.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::{sleep, spawn};
    use std::time::Duration;

    #[test]
    fn values_come_in_their_order_and_all_of_them_before_the_end() {
        let (sender, receiver) = channel();
        let receiving = spawn(move || receiver.collect::<Vec<_>>());
        for value in 0..100 {
            // The receiver sleeps now and then.
            if value % 10 == 0 {
                sleep(Duration::from_millis(2));
            }
            sender.send(value);
        }
        drop(sender);
        assert!(receiving.join().unwrap().into_iter().eq(0..100));
    }
}
