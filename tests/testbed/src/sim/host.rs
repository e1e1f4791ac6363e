//! What a computer has besides its router: the router's transit mailbox, and the mailboxes of its modules. A router's
//! death touches none of it.

use rohrpost_mailbox::{Head, Name, Options, Priority};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Slots of the transit mailbox, as the shell makes it.
pub(crate) const TRANSIT_SLOTS: usize = 64;
/// Older packages are dropped when the router takes from it, ns.
pub(crate) const TRANSIT_AGE_MAX_NS: u64 = 2_000_000_000;
/// Mailboxes for data that a module has.
pub(super) const DATA_MAILBOXES: u8 = 4;
/// Commands that wait for a module at most.
pub(crate) const COMMAND_SLOTS: usize = 16;

/// A package between a module and its router.
#[derive(Clone, Debug)]
pub(crate) struct Parcel {
    pub(crate) number: u32,
    pub(crate) head: Head,
    pub(crate) body: Rc<[u8]>,
    /// When it was published, on the node's monotonic clock.
    pub(crate) published_ns: u64,
}

/// The router's mailbox: full, the newest of the least important gives way.
#[derive(Debug, Default)]
pub(crate) struct Transit {
    waiting: Vec<Parcel>,
}

impl Transit {
    /// Puts a package in; returns the one that has no room.
    pub(crate) fn post(&mut self, parcel: Parcel) -> Option<Parcel> {
        if self.waiting.len() < TRANSIT_SLOTS {
            self.waiting.push(parcel);
            return None;
        }
        let least = self.waiting.iter().enumerate().rev().min_by_key(|(_, other)| other.head.priority.0);
        match least {
            Some((at, other)) if parcel.head.priority.outranks(other.head.priority) => {
                let displaced = self.waiting.remove(at);
                self.waiting.push(parcel);
                Some(displaced)
            }
            _ => Some(parcel),
        }
    }

    /// The most urgent; of those, the first.
    pub(crate) fn take(&mut self) -> Option<Parcel> {
        self.first_at().map(|at| self.waiting.remove(at))
    }

    /// How many packages wait, and how important the first is.
    pub(crate) fn waits(&self) -> (usize, Option<Priority>) {
        (self.waiting.len(), self.waiting.iter().map(|parcel| parcel.head.priority).max_by_key(|priority| priority.0))
    }

    pub(crate) fn first(&self) -> Option<&Parcel> {
        self.first_at().map(|at| &self.waiting[at])
    }

    fn first_at(&self) -> Option<usize> {
        let all = self.waiting.iter().enumerate();
        all.max_by_key(|(at, parcel)| (parcel.head.priority.0, usize::MAX - at)).map(|(at, _)| at)
    }

    /// The router died with this one in its hand: it comes again, once.
    pub(crate) fn put_back(&mut self, mut parcel: Parcel) {
        parcel.head.options = parcel.head.options.with(Options::REDELIVERED);
        self.waiting.insert(0, parcel);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }
}

/// A mailbox's state.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Mailbox {
    /// How many faults take it away now.
    pub(crate) absent: u32,
    /// How many faults fill it now.
    pub(crate) full: u32,
    /// Packages in it; its reader may be slow.
    pub(crate) waiting: usize,
}

/// Why a mailbox does not take a package.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Closed {
    /// There is none of that name.
    Absent,
    /// There is no room.
    Full,
}

/// A computer but for its router.
#[derive(Debug, Default)]
pub(crate) struct Host {
    /// The router's mailbox.
    pub(crate) transit: Transit,
    /// Those of the modules.
    pub(crate) boxes: BTreeMap<Name, Mailbox>,
    /// How many faults keep its socket from taking every other datagram.
    pub(crate) unsendable: u32,
    /// What was put in them, in order, until the world looks: number of the package.
    pub(crate) arrived: Vec<u32>,
    /// Commands that came back from the node's own router, as errors.
    pub(crate) returned: Vec<u32>,
}

impl Host {
    /// Puts a package in a mailbox.
    ///
    /// # Errors
    /// [`Closed`]
    pub(crate) fn deliver(&mut self, to: Name, number: u32) -> Result<(), Closed> {
        let Some(mailbox) = self.boxes.get_mut(&to).filter(|mailbox| mailbox.absent == 0) else {
            return Err(Closed::Absent);
        };
        if mailbox.full > 0 || mailbox.waiting >= COMMAND_SLOTS {
            return Err(Closed::Full);
        }
        // Data and replies are read at once, commands when their turn comes.
        mailbox.waiting += usize::from(to.local() == rohrpost_mailbox::local::COMMANDS);
        self.arrived.push(number);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parcel(number: u32, priority: u8) -> Parcel {
        let head = Head { priority: Priority(priority), ..Head::default() };
        Parcel { number, head, body: Rc::new([]), published_ns: 0 }
    }

    #[test]
    fn a_full_transit_mailbox_loses_the_newest_of_the_least_important() {
        let mut transit = Transit::default();
        for n in 0..TRANSIT_SLOTS as u32 {
            assert!(transit.post(parcel(n, 10 + (n % 2) as u8)).is_none());
        }
        let lost = |transit: &mut Transit, number, priority| transit.post(parcel(number, priority)).map(|p| p.number);
        assert_eq!(lost(&mut transit, 100, 10), Some(100), "nothing is less important");
        assert_eq!(lost(&mut transit, 101, 200), Some(62));
        let order: Vec<u32> = std::iter::from_fn(|| transit.take()).map(|parcel| parcel.number).collect();
        assert_eq!(order[..4], [101, 1, 3, 5]);
        assert_eq!(order.len(), TRANSIT_SLOTS);
    }
}
