//! The queue of requests: round robin over clients, first in first out for each.

use std::collections::VecDeque;

/// A bounded queue for each client.
#[derive(Debug)]
pub(crate) struct FairQueue<Client, Item> {
    /// Clients with something waiting, the next to be served first; none of the queues is empty.
    turns: VecDeque<(Client, VecDeque<Item>)>,
    per_client: usize,
}

impl<Client: PartialEq, Item> FairQueue<Client, Item> {
    /// A queue that holds at most `per_client` items of each client.
    pub(crate) fn new(per_client: usize) -> Self {
        Self {
            turns: VecDeque::new(),
            per_client,
        }
    }

    /// Appends an item; gives it back if its client has as many as it may.
    pub(crate) fn push(&mut self, client: Client, item: Item) -> Result<(), Item> {
        match self.turns.iter_mut().find(|(other, _)| *other == client) {
            Some((_, items)) if items.len() >= self.per_client => return Err(item),
            Some((_, items)) => items.push_back(item),
            None => self.turns.push_back((client, VecDeque::from([item]))),
        }
        Ok(())
    }

    /// Takes the next item for which `is_out` is true: the oldest of the client whose turn it is of those whose oldest is such a one, which
    /// then waits until all others had theirs.
    pub(crate) fn pop_if(&mut self, is_out: impl Fn(&Item) -> bool) -> Option<Item> {
        let is_turn = |(_, items): &(_, VecDeque<Item>)| items.front().is_some_and(&is_out);
        let turn = self.turns.iter().position(is_turn)?;
        let (client, mut items) = self.turns.remove(turn)?;
        let item = items.pop_front();
        if !items.is_empty() {
            self.turns.push_back((client, items));
        }
        item
    }

    /// Takes the next item, whatever it is.
    pub(crate) fn pop(&mut self) -> Option<Item> {
        self.pop_if(|_| true)
    }

    /// All items, in no order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Item> {
        self.turns.iter().flat_map(|(_, items)| items)
    }

    /// Takes out the items for which `is_out` is true, whosever turn it is.
    pub(crate) fn take_out(&mut self, is_out: impl Fn(&Item) -> bool) -> Vec<Item> {
        let mut taken = Vec::new();
        for (_, items) in &mut self.turns {
            while let Some(index) = items.iter().position(&is_out) {
                taken.extend(items.remove(index));
            }
        }
        self.turns.retain(|(_, items)| !items.is_empty());
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_that_floods_does_not_starve_the_others() {
        let mut queue = FairQueue::new(100);
        for number in 0..100 {
            queue.push("flood", number).unwrap();
        }
        for number in 0..3 {
            queue.push("a", 1000 + number).unwrap();
            queue.push("b", 2000 + number).unwrap();
        }
        let served: Vec<_> = std::iter::from_fn(|| queue.pop()).collect();
        assert_eq!(served.len(), 106);
        assert_eq!(
            served[..9],
            [0, 1000, 2000, 1, 1001, 2001, 2, 1002, 2002],
            "one each, in turn"
        );
        assert_eq!(served[9..], (3..100).collect::<Vec<_>>());
    }

    #[test]
    fn a_client_that_comes_late_waits_for_one_turn_of_each_other() {
        let mut queue = FairQueue::new(10);
        for number in 0..5 {
            queue.push(1, number).unwrap();
        }
        assert_eq!(queue.pop(), Some(0));
        queue.push(2, 100).unwrap();
        assert_eq!([queue.pop(), queue.pop()], [Some(1), Some(100)]);
    }

    #[test]
    fn what_is_not_wanted_now_keeps_its_place_and_all_that_its_client_has_behind_it() {
        let mut queue = FairQueue::new(10);
        for (client, item) in [('a', 1), ('a', 2), ('b', 4), ('c', 6)] {
            queue.push(client, item).unwrap();
        }
        let even = |queue: &mut FairQueue<char, i32>| queue.pop_if(|item| item % 2 == 0);
        assert_eq!([even(&mut queue), even(&mut queue)], [Some(4), Some(6)]);
        assert_eq!(even(&mut queue), None);
        assert_eq!([queue.pop(), queue.pop()], [Some(1), Some(2)]);
    }

    #[test]
    fn each_client_has_its_own_bound() {
        let mut queue = FairQueue::new(2);
        assert_eq!(queue.push('a', 1), Ok(()));
        assert_eq!(queue.push('a', 2), Ok(()));
        assert_eq!(queue.push('a', 3), Err(3));
        assert_eq!(queue.push('b', 4), Ok(()));
    }

    #[test]
    fn what_is_taken_out_leaves_the_others_in_their_order() {
        let mut queue = FairQueue::new(4);
        for number in 0..4 {
            queue.push(number % 2, number).unwrap();
        }
        assert_eq!(queue.take_out(|number| number % 2 == 0), [0, 2]);
        assert_eq!(
            [queue.pop(), queue.pop(), queue.pop()],
            [Some(1), Some(3), None]
        );
        assert!(queue.take_out(|_| true).is_empty());
    }
}
