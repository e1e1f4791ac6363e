//! What is still to happen in a simulated world.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Events by time, and at one moment in the order in which they were planned.
#[derive(Debug)]
pub struct Events<E> {
    waiting: BinaryHeap<Reverse<Entry<E>>>,
    ticket: u64,
}

impl<E> Default for Events<E> {
    fn default() -> Self {
        Self { waiting: BinaryHeap::new(), ticket: 0 }
    }
}

impl<E> Events<E> {
    /// Something happens at this time.
    pub fn push(&mut self, at_ns: u64, event: E) {
        self.ticket += 1;
        self.waiting.push(Reverse(Entry { at_ns, ticket: self.ticket, event }));
    }

    /// The next event, and when it happens.
    pub fn pop(&mut self) -> Option<(u64, E)> {
        self.waiting.pop().map(|Reverse(entry)| (entry.at_ns, entry.event))
    }
}

#[derive(Debug)]
struct Entry<E> {
    at_ns: u64,
    ticket: u64,
    event: E,
}

impl<E> PartialEq for Entry<E> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl<E> Eq for Entry<E> {}
impl<E> PartialOrd for Entry<E> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl<E> Ord for Entry<E> {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.at_ns, self.ticket).cmp(&(other.at_ns, other.ticket))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_come_by_time_and_at_one_moment_as_planned() {
        let mut events = Events::default();
        [(5, 'c'), (3, 'a'), (5, 'd'), (4, 'b')].into_iter().for_each(|(at_ns, event)| events.push(at_ns, event));
        let all: Vec<_> = std::iter::from_fn(|| events.pop()).collect();
        assert_eq!(all, [(3, 'a'), (4, 'b'), (5, 'c'), (5, 'd')]);
    }
}
